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
    /// Two pieces have begun to press on each other, in a scene with contact.
    ContactBegan {
        /// Their numbers, as in [`Simulation::pieces`](crate::Simulation::pieces).
        pieces: [u32; 2],
        /// The numbers of their bodies in the scene.
        bodies: [usize; 2],
    },
    /// Two pieces that touched press no more and have parted by 2% of a mean edge.
    ContactEnded {
        /// Their numbers, as in [`Simulation::pieces`](crate::Simulation::pieces).
        pieces: [u32; 2],
        /// The numbers of their bodies in the scene.
        bodies: [usize; 2],
    },
}
