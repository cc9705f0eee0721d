//! [`Event`]: an event of a frame, for programs that react with sounds, scores or effects.

use crate::report::DetachedReport;

/// An event of the last frame: beginning and end of cuts, and detached pieces. See
/// [`Simulation::events`](crate::Simulation::events).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub enum Event {
    /// A stroke has changed the mesh for the first time.
    CutBegan {
        /// Number of the stroke, as in [`FaceTag::Cut`](crate::cutting::FaceTag::Cut).
        stroke: u32,
    },
    /// A piece has been detached.
    PieceDetached(DetachedReport),
    /// A stroke that has changed the mesh has ended.
    CutEnded {
        /// Number of the stroke.
        stroke: u32,
    },
    /// Two pieces have begun to press on each other, in a scene with contact.
    ContactBegan {
        /// Their numbers, as in [`Simulation::pieces`](crate::Simulation::pieces).
        pieces: [u32; 2],
        /// The numbers of their bodies in the scene.
        bodies: [usize; 2],
    },
    /// Two pieces that touched no longer press and are at least 2% of a mean edge apart.
    ContactEnded {
        /// Their numbers, as in [`Simulation::pieces`](crate::Simulation::pieces).
        pieces: [u32; 2],
        /// The numbers of their bodies in the scene.
        bodies: [usize; 2],
    },
}
