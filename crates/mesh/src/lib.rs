//! Tetrahedral meshes: the value, checks, quality, boundary surface, file formats, generated shapes.

mod ids;
mod tet_mesh;

pub use glam;
pub use ids::{ParticleId, TetId};
pub use tet_mesh::{TetMesh, signed_volume};
