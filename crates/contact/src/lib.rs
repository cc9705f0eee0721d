//! Contact between deforming bodies of tetrahedra, their pieces and the sides of cuts, found while they are cut.
//!
//! A [`ContactDetector`] applies each [`incise_cutting::CutDelta`] and lists, once a frame, what may touch:
//!
//! - [`PairContact`]: two particles that were one before a cut. They start at a gap of exactly 0, need no search and
//!   hold the sides of a cut apart from its first frame on ([`FreshPairs`]).
//! - [`FaceContact`]: a vertex and a triangle, found by a search over the surface.
//! - [`EdgeContact`]: two sharp edges that cross, found by the same search.
//!
//! All are plain records of particle numbers and normals; a solver keeps `C ≥ 0` for each of them. A fresh cut has
//! `C = 0` to the bit, so cutting a body without load changes nothing about its motion.
//!
//! ```
//! use glam::DVec3;
//! use incise_contact::{ContactDetector, ContactSettings, ContactState};
//! use incise_cutting::{CuttableMesh, PieceTracker};
//! use incise_mesh::{ParticleId, kuhn_box};
//!
//! // Two boxes, the second 1 mm above the first.
//! let mut mesh = kuhn_box([2; 3], DVec3::splat(0.1));
//! let above = mesh.clone();
//! let first = mesh.positions.len();
//! mesh.positions.extend(above.positions.iter().map(|x| *x + DVec3::Z * 0.101));
//! let tets = above.tets.iter().map(|tet| tet.map(|p| ParticleId::new(first + p.index())));
//! mesh.tets.extend(tets);
//! let bodies = CuttableMesh::new(mesh)?;
//! let pieces = PieceTracker::new(&bodies);
//! let body_of = (0..2 * first).map(|p| u32::from(p >= first)).collect();
//!
//! let mut contacts = ContactDetector::new(&bodies, body_of, ContactSettings::default())?;
//! let velocities = vec![DVec3::ZERO; 2 * first];
//! let positions = &bodies.mesh().positions;
//! let update = contacts.update(&ContactState {
//!     mesh: &bodies,
//!     pieces: &pieces,
//!     positions,
//!     velocities: &velocities,
//!     fixed: &[],
//!     frame_time: 1.0 / 60.0,
//! });
//! assert!(update.faces_changed);
//! for contact in contacts.faces() {
//!     assert!((contact.gap(positions) - 0.001).abs() < 1e-12);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What touches what
//!
//! [`ContactSettings::bodies`] says which different bodies may touch, [`ContactSettings::self_contact`] whether a body
//! touches itself. Pieces that have come off a body, and the two sides of a fresh cut, touch in any case: a piece that
//! was cut off rests on what is left.
//!
//! # Limits
//!
//! Edges are noticed if they are rims of cuts or if their triangles turn by more than 40° at rest: a rounded edge of a
//! coarse mesh, or a fold of a plate, may cross another edge between its vertices. A vertex that moves by more than half
//! the thickness of a body in one substep may pass through it.

mod ahead;
mod detector;
mod edges;
mod error;
mod face;
mod index;
mod normals;
mod pairs;
mod parts;
mod query;
mod reserve;
mod settings;
mod state;
mod surface;
mod tree;
mod walk;

pub use detector::{ContactDetector, ContactUpdate};
pub use edges::EdgeContact;
pub use error::ContactError;
pub use face::{FaceContact, FaceLimit};
pub use pairs::{FreshPairs, PairContact};
pub use settings::{BodyPairs, ContactSettings};
pub use state::ContactState;
pub use surface::ContactSurface;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
