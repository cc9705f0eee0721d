//! [`CuttableMesh`]: a mesh together with the lists that make cutting it local.

use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::CutError;
use crate::stars::Stars;

/// A tetrahedral mesh at rest that can be cut.
///
/// Owns the mesh and, for each particle, the tets around it. Strokes change both in place and return what they changed
/// as a [`crate::CutDelta`].
#[derive(Clone, Debug)]
pub struct CuttableMesh {
    pub(crate) mesh: TetMesh,
    pub(crate) stars: Stars,
}

impl CuttableMesh {
    /// Takes over a mesh.
    ///
    /// # Errors
    /// [`CutError::Mesh`] if the mesh does not pass [`TetMesh::check`].
    pub fn new(mesh: TetMesh) -> Result<Self, CutError> {
        mesh.check()?;
        let stars = Stars::new(&mesh);
        Ok(Self { mesh, stars })
    }

    /// The mesh at rest, with all cuts made so far.
    #[must_use]
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// The tets around a particle, in no particular order (the same for the same history of cuts).
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn around(&self, particle: ParticleId) -> impl Iterator<Item = TetId> + '_ {
        self.stars.around(particle)
    }

    /// Checks the mesh and recomputes the lists to compare. O(n log n); for tests and on request.
    ///
    /// # Errors
    /// [`CutError::Mesh`] if the mesh is broken.
    ///
    /// # Panics
    /// If the lists around the particles do not belong to the mesh, which would be a defect of this crate.
    pub fn check(&self) -> Result<(), CutError> {
        self.mesh.check()?;
        assert_eq!(
            self.stars.first_difference(&self.mesh),
            None,
            "the lists of tets around particles are current"
        );
        Ok(())
    }
}
