//! [`History`]: undo points, one before each stroke.
//!
//! Undo restores the whole simulation as it was in the frame in which the stroke began. The newest snapshots are kept, as
//! many as fit into [`BUDGET`].

use std::collections::VecDeque;

use incise::{Grab, Snapshot};

/// Largest memory for snapshots, in bytes.
const BUDGET: usize = 1 << 30;

/// The state before a stroke.
#[derive(Debug)]
pub(crate) struct UndoPoint {
    pub(crate) snapshot: Snapshot,
    /// True if the stroke is part of the scene, so that it begins again.
    pub(crate) scripted: bool,
    /// The stroke in progress at that time.
    pub(crate) stroke: Option<u32>,
    /// The grab in use at that time.
    pub(crate) grab: Option<Grab>,
}

/// Undo points, oldest first.
#[derive(Debug, Default)]
pub(crate) struct History {
    points: VecDeque<UndoPoint>,
}

impl History {
    /// Adds an undo point and drops the oldest ones that exceed the budget.
    pub(crate) fn push(&mut self, point: UndoPoint) {
        self.points.push_back(point);
        let bytes = |point: &UndoPoint| point.snapshot.bytes();
        let mut sum: usize = self.points.iter().map(bytes).sum();
        while sum > BUDGET && self.points.len() > 1 {
            sum -= self.points.pop_front().as_ref().map_or(0, bytes);
        }
    }

    /// Removes and returns the newest undo point.
    pub(crate) fn pop(&mut self) -> Option<UndoPoint> {
        self.points.pop_back()
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }
}
