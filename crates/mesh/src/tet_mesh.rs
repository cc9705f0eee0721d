//! [`TetMesh`]: positions and four corners per tetrahedron, without derived data.
//!
//! A mesh is a plain value with public fields. Derived data (surface, pieces, quality) are computed
//! by functions and stored elsewhere if they are needed for longer, so they cannot become outdated
//! here.

use glam::DVec3;

use crate::{ParticleId, TetId};

/// A tetrahedral mesh at rest.
///
/// A tet `[a, b, c, d]` is positively oriented when `(b - a) × (c - a) · (d - a) > 0`.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TetMesh {
    /// Position of each particle, in meters.
    pub positions: Vec<DVec3>,
    /// The four corners of each tet, positively oriented.
    pub tets: Vec<[ParticleId; 4]>,
}

impl TetMesh {
    /// The corner positions of one tet.
    ///
    /// # Panics
    /// If the tet or one of its corners does not exist.
    #[must_use]
    pub fn corners(&self, tet: TetId) -> [DVec3; 4] {
        self.tets[tet.index()].map(|p| self.positions[p.index()])
    }

    /// The signed volume of one tet in m³: positive for a positively oriented one.
    ///
    /// # Panics
    /// If the tet or one of its corners does not exist.
    #[must_use]
    pub fn volume(&self, tet: TetId) -> f64 {
        signed_volume(self.corners(tet))
    }

    /// The sum of the signed volumes of all tets in m³.
    #[must_use]
    pub fn total_volume(&self) -> f64 {
        (0..self.tets.len())
            .map(|t| self.volume(TetId::new(t)))
            .sum()
    }
}

/// The signed volume of a tetrahedron: `(b - a) × (c - a) · (d - a) / 6`.
#[must_use]
pub fn signed_volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}
