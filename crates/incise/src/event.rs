//! [`Event`]: what happened in a frame, for programs that react to it: sounds, scores, effects.

use crate::report::DetachedReport;

/// Something that happened in the last frame: [`Simulation::events`](crate::Simulation::events).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub enum Event {
    /// A stroke has changed the mesh for the first time.
    CutBegan {
        /// Its number, as in [`FaceTag::Cut`](crate::cutting::FaceTag::Cut).
        stroke: u32,
    },
    /// A piece has come off.
    PieceDetached(DetachedReport),
    /// A stroke that has changed the mesh is over.
    CutEnded {
        /// Its number.
        stroke: u32,
    },
}
