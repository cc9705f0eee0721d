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

    /// The surface without the particles that no triangle uses; the others keep their order. Of the boundary of a body it
    /// leaves what lies inside. O(n).
    ///
    /// # Panics
    /// If a corner has no position.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{TriangleSurface, glam::DVec3, kuhn_box};
    ///
    /// let surface = TriangleSurface::boundary_of(&kuhn_box([2, 2, 2], DVec3::splat(0.1)));
    /// let shell = surface.without_unused();
    /// // Of 27 particles one lies inside.
    /// assert_eq!((shell.positions.len(), shell.triangles.len()), (26, 48));
    /// ```
    #[must_use]
    pub fn without_unused(&self) -> Self {
        let mut is_used = vec![false; self.positions.len()];
        for corner in self.triangles.as_flattened() {
            is_used[corner.index()] = true;
        }
        let mut kept = Self::default();
        let mut numbers = vec![ParticleId(0); self.positions.len()];
        for (p, &position) in self
            .positions
            .iter()
            .enumerate()
            .filter(|(p, _)| is_used[*p])
        {
            numbers[p] = ParticleId::new(kept.positions.len());
            kept.positions.push(position);
        }
        kept.triangles = self
            .triangles
            .iter()
            .map(|triangle| triangle.map(|corner| numbers[corner.index()]))
            .collect();
        kept
    }
}
