//! Cuts tetrahedral meshes with planes, surfaces and swept blades; each cut returns one [`CutDelta`].
//!
//! A [`CuttableMesh`] holds a mesh at rest. [`cut_plane`] cuts it with a whole plane at once, [`cut_level_set`] along
//! the zero set of a field, [`cut_surface`] along triangles; a [`Sweep`] moves a blade through it frame by frame. All
//! work where the blade is, in the body's present, deformed state, and cut the rest shape at the same fractions of its
//! edges. All change the mesh in place and return what they changed, so the mesh need not be compared before and after.
//!
//! - Crossed edges get a particle, the tets around them are split by ordered bisection ([`split_tet`]): the mesh
//!   conforms by construction, no tet is ever flat or inverted, volume is kept.
//! - Crossings close to a particle move to it ([`CutOptions::snap`]), which keeps the new tets well shaped.
//! - The body separates where faces are cut through and stays whole around the front of an unfinished stroke.
//!
//! ```
//! use glam::DVec3;
//! use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
//! use incise_mesh::kuhn_box;
//!
//! let mut body = CuttableMesh::new(kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0)))?;
//! let positions = body.mesh().positions.clone();
//! let plane = Plane { point: DVec3::new(0.8, 0.0, 0.0), normal: DVec3::X };
//! let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default())?;
//! println!("{} tets cut into {}", delta.removed.len(), delta.added.len());
//! assert_eq!(body.mesh().pieces().count, 2);
//! # Ok::<(), incise_cutting::CutError>(())
//! ```
//!
//! The crate does not depend on constraints, solvers, colors or the GPU.

mod align;
mod bisect;
mod blade;
mod broad_phase;
mod ccd;
mod closest;
mod component_search;
mod crumbs;
mod cuttable;
mod delta;
mod ends;
mod error;
mod faces;
mod finite;
mod flips;
mod improve;
mod index;
mod level_set;
mod motion;
mod operation;
mod options;
mod parallel;
mod pieces;
mod places;
mod plane;
mod quality;
mod remove;
mod separate;
mod sheets;
mod side_labels;
mod sign_split;
mod skin;
mod stars;
mod stroke;
mod stroke_registry;
mod surface;
mod sweep;
mod tiles;
mod tree;
mod triangles;
mod undo;

pub use bisect::{SplitEdge, split_tet};
pub use cuttable::CuttableMesh;
pub use delta::{
    AddedTet, BoundaryTriangle, CutDelta, EdgePoint, FaceTag, MovedTet, RelinkedTet, RemovedTet,
};
pub use ends::join_ends;
pub use error::CutError;
pub use improve::{ImproveOptions, ImproveQueue, improve};
pub use level_set::cut_level_set;
pub use options::{CutOptions, Separation};
pub use pieces::{Piece, PieceEvent, PieceTracker};
pub use plane::{Plane, cut_plane};
pub use remove::{carve, remove_tets};
pub use skin::{Skin, SkinChange, SkinVertex};
pub use stroke_registry::StrokeRegistry;
pub use sweep::Sweep;
pub use triangles::{TriangleSurface, cut_surface, cut_surface_joining};

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
