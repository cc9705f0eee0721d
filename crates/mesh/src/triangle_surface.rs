//! [`TriangleSurface`]: positions and triangles, what a surface file holds and what a body is filled from.

use glam::DVec3;

use crate::{ParticleId, TetMesh};

/// A surface of triangles with its own positions, closed or open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleSurface {
    /// Position of each particle, in meters, used by a triangle or not.
    pub positions: Vec<DVec3>,
    /// The corners of each triangle, counterclockwise when seen from outside.
    pub triangles: Vec<[ParticleId; 3]>,
}

impl TriangleSurface {
    /// The boundary of a mesh, with all its particles.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{TriangleSurface, glam::DVec3, kuhn_box};
    ///
    /// let surface = TriangleSurface::boundary_of(&kuhn_box([2, 2, 2], DVec3::splat(0.1)));
    /// assert_eq!((surface.positions.len(), surface.triangles.len()), (27, 48));
    /// ```
    #[must_use]
    pub fn boundary_of(mesh: &TetMesh) -> Self {
        Self {
            positions: mesh.positions.clone(),
            triangles: mesh.surface().triangles,
        }
    }
}
