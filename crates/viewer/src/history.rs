//! [`History`]: where the strokes began, to go back there.
//!
//! Taking a stroke back goes back in time, to the frame in which it began: what has fallen off since then is where it was.
//! Only the newest snapshots are kept, as many as fit into [`BUDGET`].

use std::collections::VecDeque;

use incise::{Grab, Snapshot};

/// The most memory for snapshots, in bytes.
const BUDGET: usize = 1 << 30;

/// The moment before a stroke.
#[derive(Debug)]
pub(crate) struct UndoPoint {
    pub(crate) snapshot: Snapshot,
    /// Whether the stroke is the scene's: it will begin again.
    pub(crate) scripted: bool,
    /// The stroke in progress at that moment.
    pub(crate) stroke: Option<u32>,
    /// The grab in use at that moment.
    pub(crate) grab: Option<Grab>,
}

/// The moments before the strokes, oldest first.
#[derive(Debug, Default)]
pub(crate) struct History {
    moments: VecDeque<UndoPoint>,
}

impl History {
    /// Keeps a moment, and drops the oldest ones that have no room any more.
    pub(crate) fn keep(&mut self, moment: UndoPoint) {
        self.moments.push_back(moment);
        let bytes = |moment: &UndoPoint| moment.snapshot.bytes();
        let mut sum: usize = self.moments.iter().map(bytes).sum();
        while sum > BUDGET && self.moments.len() > 1 {
            sum -= self.moments.pop_front().as_ref().map_or(0, bytes);
        }
    }

    /// The last moment, which is then forgotten.
    pub(crate) fn take(&mut self) -> Option<UndoPoint> {
        self.moments.pop_back()
    }

    pub(crate) fn len(&self) -> usize {
        self.moments.len()
    }

    pub(crate) fn clear(&mut self) {
        self.moments.clear();
    }
}
