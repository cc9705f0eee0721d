//! Generates tetrahedral meshes: shapes by isosurface stuffing, closed surfaces filled with tets, Delaunay
//! tetrahedralizations, irregular bodies, and test bodies with known properties.
//!
//! ```
//! use incise_mesh::{TriangleSurface, glam::DVec3};
//! use incise_meshing::{Lattice, Shape, Solid, generate, stuff, tetrahedralize};
//!
//! // A solid from a formula, with the number of tets you want (to within 2 %), one piece, good angles.
//! let liver = generate(Shape::Liver, 2_000)?;
//! assert!(liver.tets.len().abs_diff(2_000) <= 40);
//! assert!(liver.quality().min_dihedral > 10.7);
//!
//! // A closed surface, from a file or anywhere else: welded, turned to one side, or refused with its first open edge.
//! let solid = Solid::new(&TriangleSurface::boundary_of(&liver))?;
//! assert!(solid.signed_distance(DVec3::splat(9.0)) > 0.0);
//! let body = tetrahedralize(&solid, 3_000, 0)?;
//! assert!(body.surface().is_manifold());
//!
//! // A level set of your own: negative inside.
//! let lattice = Lattice::covering(-DVec3::ONE, DVec3::ONE, 0.25, DVec3::ZERO)?;
//! let ball = stuff(&lattice, |p| p.length() - 1.0)?;
//! assert_eq!(ball.surface().euler_characteristic(), 2);
//! # Ok::<(), incise_meshing::MeshingError>(())
//! ```
//!
//! Only `+`, `-`, `*`, `/`, square root, minimum, maximum and absolute value are used, so that results are
//! bit-identical on all platforms and for any number of threads. Exact predicates, not tolerances, decide which points
//! are inside, above a plane or in a sphere.

mod delaunay;
mod distance;
mod error;
mod fans;
mod index;
mod irregular;
mod lattice;
mod merged_cells;
mod neighbors;
mod random;
mod search;
mod shapes;
mod solid;
mod solids;
mod stencil;
mod stuffing;
mod tetrahedralize;

pub use delaunay::delaunay;
pub use error::MeshingError;
pub use fans::{copies, fan, star};
pub use irregular::irregular;
pub use lattice::Lattice;
pub use search::generate;
pub use shapes::Shape;
pub use solid::{Prepared, Solid};
pub use stuffing::{stuff, stuff_graded};
pub use tetrahedralize::{Attempt, tetrahedralize, tetrahedralize_with};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
