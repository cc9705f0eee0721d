//! Tetrahedral meshes: the value, checks, quality, boundary surface, file formats, generated shapes.

mod check;
mod error;
mod faces;
pub mod generate;
mod ids;
pub mod io;
mod orientation;
mod pieces;
mod quality;
mod surface;
mod tet_mesh;

pub use check::{CheckReport, Fault};
pub use error::MeshError;
pub use glam;
pub use ids::{ParticleId, TetId};
pub use orientation::orientation;
pub use pieces::Pieces;
pub use quality::{QualitySummary, TetQuality, tet_quality};
pub use surface::Surface;
pub use tet_mesh::{TetMesh, signed_volume};
