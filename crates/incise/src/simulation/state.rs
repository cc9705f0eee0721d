//! [`State`]: all of a simulation that changes with time.
//!
//! A snapshot is a copy of it, and a simulation that takes a state over continues as the one it came from, to the bit.
//! What follows from the rest is left out and built again: the layout of the solvers, and what a device has. Cost of a
//! copy: O(particles + tets).

use std::sync::Arc;

use glam::DVec3;

use crate::Scene;
use crate::attachment::AttachmentHandle;
use crate::collider::Colliders;
use crate::distance::DistanceHandle;
use crate::group::Group;
use crate::pieces::PieceNumbers;
use crate::place::Place;
use crate::report::FrameReport;
use crate::scene::{Precision, ReportSpec, SolverSpec};
use crate::strokes::Timeline;
use crate::whole::Whole;

/// All of a simulation that changes with time. A copy has its solvers on the processor.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// The scene with all bodies, as each was added.
    pub(super) scene: Arc<Scene>,
    /// The settings of the solver as they are now.
    pub(super) solver: SolverSpec,
    pub(super) precision: Precision,
    pub(super) place: Place,
    pub(super) clock: Clock,
    pub(super) gravity: Option<DVec3>,
    /// The names of the colliders in the settings of all groups.
    pub(super) colliders: Colliders,
    pub(super) next: NextNumbers,
    pub(super) reporting: ReportSpec,
    /// In the order of their first bodies.
    pub(super) groups: Vec<Group>,
    /// All groups together, if there are several.
    pub(super) whole: Option<Whole>,
    pub(super) pieces: PieceNumbers,
    /// Whether a particle lies on a cut; empty before the first.
    pub(super) on_cut: Vec<bool>,
    pub(super) timeline: Timeline,
    pub(super) report: FrameReport,
    /// Whether the solvers have the residuals of the last frame.
    pub(super) residuals_kept: bool,
}

/// The numbers of the next handles; none is given twice.
#[derive(Clone, Copy, Debug)]
pub(super) struct NextNumbers {
    pub(super) attachment: u32,
    pub(super) distance: u32,
}

impl NextNumbers {
    /// Those after all handles of a scene.
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            attachment: AttachmentHandle::of_scene(scene.attachment.len()).0,
            distance: DistanceHandle::of_scene(scene.distance.len()).0,
        }
    }

    /// Gives no number that another simulation has given.
    pub(super) fn keep_numbers_of(&mut self, other: Self) {
        self.attachment = self.attachment.max(other.attachment);
        self.distance = self.distance.max(other.distance);
    }
}

/// The number of the next frame, and the simulated time of every frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// Length of a frame in s.
    pub(super) time_step: f64,
    /// The frame since which frames have this length, and the simulated time in s at its start.
    epoch: (u64, f64),
    pub(super) next_frame: u64,
}

impl Clock {
    /// A clock before the first frame.
    pub(super) fn new(time_step: f64) -> Self {
        Self {
            time_step,
            epoch: (0, 0.0),
            next_frame: 0,
        }
    }

    /// The simulated time in s at the start of a frame that is not before the last change of the time step.
    pub(super) fn time_at(&self, frame: u64) -> f64 {
        let (first, start) = self.epoch;
        start + (frame - first) as f64 * self.time_step
    }

    /// Sets the length of the frames to come in s.
    pub(super) fn set_time_step(&mut self, time_step: f64) {
        if time_step.to_bits() != self.time_step.to_bits() {
            self.epoch = (self.next_frame, self.time_at(self.next_frame));
            self.time_step = time_step;
        }
    }
}
