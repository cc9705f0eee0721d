//! [`ContactState`]: mesh, pieces and motion, from which a detector finds contacts.

use glam::DVec3;
use incise_cutting::{CuttableMesh, PieceTracker};

/// Input of [`crate::ContactDetector::update`]: mesh, pieces, positions and velocities at the start of a frame.
#[derive(Clone, Copy, Debug)]
pub struct ContactState<'a> {
    /// The bodies that are solved together as one mesh, with all cuts made so far.
    pub mesh: &'a CuttableMesh,
    /// The pieces of that mesh.
    pub pieces: &'a PieceTracker,
    /// The present positions of the particles in m, finite.
    pub positions: &'a [DVec3],
    /// Their velocities in m/s.
    pub velocities: &'a [DVec3],
    /// By particle whether no force moves it; empty where all can be moved. Contacts of such particles alone are not
    /// listed unless they overlap.
    pub fixed: &'a [bool],
    /// How long the list will be used: the time of a frame in s, or of a part of it.
    pub frame_time: f64,
}
