//! Tetrahedral meshes: the value, checks, quality, boundary surface, file formats, generated shapes.
//!
//! A [`TetMesh`] is a plain value: positions, and four corners per tet. Everything else is computed from it when asked
//! for, and nothing here knows of materials, solvers or time.
//!
//! ```
//! use incise_mesh::generate::{Shape, generate};
//! use incise_mesh::{TetId, io};
//!
//! // A solid from a formula, with the number of tets you want (to within 2 %).
//! let liver = generate(Shape::Liver, 2_000)?;
//!
//! // Sound? Counts every fault and names the first; the sign of a volume is exact.
//! liver.check()?;
//!
//! // What follows from it.
//! let surface = liver.surface();
//! assert!(surface.is_manifold());
//! assert_eq!(surface.euler_characteristic(), 2);
//! assert_eq!(liver.pieces().count, 1);
//! assert!(liver.quality().min_dihedral > 10.7);
//! assert!(liver.volume(TetId(0)) > 0.0);
//!
//! // Files, by ending; coordinates survive bit for bit.
//! let path = std::env::temp_dir().join(format!("incise-mesh-doc-{}.vtk", std::process::id()));
//! io::write(&path, &liver)?;
//! assert_eq!(io::read(&path)?, liver);
//! # std::fs::remove_file(path).ok();
//! # Ok::<(), incise_mesh::MeshError>(())
//! ```
//!
//! Conventions: meters; a tet `[a, b, c, d]` is positive when `(b - a) × (c - a) · (d - a) > 0`; orders are by index and
//! never depend on hashing or threads, so that equal input gives equal output.

mod check;
mod error;
mod faces;
pub mod generate;
mod histogram;
mod ids;
pub mod io;
mod orientation;
mod pieces;
mod pinches;
mod quality;
mod repair;
mod solid;
mod surface;
mod tet_mesh;

pub use check::{CheckReport, Fault};
pub use error::MeshError;
pub use glam;
pub use histogram::QualityHistograms;
pub use ids::{ParticleId, TetId};
pub use orientation::orientation;
pub use pieces::Pieces;
pub use quality::{QualitySummary, TetQuality, dihedral_angles, tet_quality};
pub use repair::{RepairOptions, RepairReport, Repaired, repair};
pub use solid::{Prepared, Solid};
pub use surface::Surface;
pub use tet_mesh::{TetMesh, signed_volume};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
