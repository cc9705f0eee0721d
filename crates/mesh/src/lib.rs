//! Tetrahedral meshes: data type, checks, boundary surface, pieces, quality, repair.
//!
//! A [`TetMesh`] is a plain value: positions, and four corners per tet. All other data are computed from it by
//! functions. The crate does not depend on files, generators, materials, solvers or time. `incise-mesh-io` reads and
//! writes files, `incise-meshing` fills shapes and surfaces with tets.
//!
//! ```
//! use incise_mesh::{RepairOptions, TetId, glam::DVec3, kuhn_box, repair};
//!
//! // A box of 4 x 2 x 2 cells, six tets each. Any positions and corners of your own will do.
//! let mut mesh = kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0));
//!
//! // Counts every fault and reports the first; the sign of a volume is exact.
//! mesh.check()?;
//!
//! // Derived data.
//! let surface = mesh.surface();
//! assert!(surface.is_manifold());
//! assert_eq!(surface.euler_characteristic(), 2);
//! assert_eq!(mesh.pieces().count, 1);
//! assert!(mesh.quality().min_dihedral > 44.9);
//! assert!(mesh.volume(TetId(0)) > 0.0);
//!
//! // An inverted tet is found, and flipped by `repair`.
//! mesh.tets[7].swap(0, 1);
//! assert!(mesh.check().unwrap_err().to_string().contains("first: tet 7 has the volume -"));
//! let repaired = repair(&mesh, &RepairOptions::ALL);
//! repaired.mesh.check()?;
//! # Ok::<(), incise_mesh::MeshError>(())
//! ```
//!
//! Conventions: meters; a tet `[a, b, c, d]` is positive when `(b - a) × (c - a) · (d - a) > 0`; orders are by index
//! and independent of hashing and threads, so equal input gives equal output.

mod bounds;
mod check;
mod closest_point;
mod disjoint_sets;
mod error;
mod faces;
mod histogram;
mod ids;
mod kuhn_box;
mod orientation;
mod pieces;
mod pinches;
mod quality;
mod repair;
mod report;
mod surface;
mod tet_mesh;
mod triangle_surface;

pub use bounds::Bounds;
pub use closest_point::{ClosestPoint, TrianglePart, closest_on_triangle};
pub use disjoint_sets::DisjointSets;
pub use error::MeshError;
pub use faces::{FaceSide, Faces};
pub use glam;
pub use histogram::QualityHistograms;
pub use ids::{ParticleId, TetId};
pub use kuhn_box::kuhn_box;
pub use orientation::orientation;
pub use pieces::Pieces;
pub use quality::{QualitySummary, TetQuality, dihedral_angles, outward_normals, tet_quality};
pub use repair::{RepairOptions, RepairReport, Repaired, repair};
pub use report::{CheckReport, Fault};
pub use surface::Surface;
pub use tet_mesh::{TetMesh, signed_volume};
pub use triangle_surface::TriangleSurface;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
