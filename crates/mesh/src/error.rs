//! [`MeshError`]: errors of mesh checks.

use crate::CheckReport;

/// A mesh that was rejected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh without tets.
    #[error("the mesh has no tetrahedra: give one with at least one")]
    Empty,

    /// A mesh that violates a rule of [`TetMesh::check`](crate::TetMesh::check).
    #[error("the mesh is not sound: {0}")]
    Faulty(Box<CheckReport>),
}
