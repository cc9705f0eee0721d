//! [`TriangleSurface`]: positions and triangles: the content of a surface file, and the input for
//! filling a body with tets.

use glam::DVec3;

use crate::{ParticleId, TetMesh};

/// A surface of triangles with its own positions, closed or open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleSurface {
    /// Position of each particle in meters, including unused ones.
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
