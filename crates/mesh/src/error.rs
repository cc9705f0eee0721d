//! [`MeshError`]: why a mesh was refused.

use crate::CheckReport;

/// Why a mesh was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh without a single tet.
    #[error("the mesh has no tetrahedra: give one with at least one")]
    Empty,

    /// A mesh that breaks a rule of [`TetMesh::check`](crate::TetMesh::check).
    #[error("the mesh is not sound: {0}")]
    Faulty(Box<CheckReport>),
}
