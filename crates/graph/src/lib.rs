//! Data types for scheduling constraints in parallel.
//!
//! A Gauss-Seidel solver visits constraints one after the other, because two constraints on one
//! particle must not move it at the same time. Constraints that share no particle may run in
//! parallel. The types of this crate describe this: the particles of each constraint
//! ([`Incidence`]), the constraints that conflict ([`ConstraintGraph`]), the constraints solved as
//! one block ([`Clustering`]), the parallel steps ([`Coloring`]), and the flat order of a solver
//! ([`Schedule`]). The algorithms that compute clusterings and colorings are in `incise-clustering`
//! and `incise-coloring`.
//!
//! Constraints, particles and graph vertices are plain `u32` numbers from 0, so any constraint of
//! any arity fits: a spring, a bending angle, a tetrahedron. Ragged arrays are stored as `offsets`
//! and `values` (CSR), or, where they change, as [`Rows`].
//!
//! ```
//! use incise_graph::{Clustering, ColorId, Coloring, ConstraintGraph, Incidence, Schedule};
//!
//! // A strip of cloth: six particles, five springs in a row.
//! let springs = [[0u32, 1], [1, 2], [2, 3], [3, 4], [4, 5]];
//! let incidence = Incidence::from_constraints(6, springs)?;
//! let graph = ConstraintGraph::from_incidence(&incidence);
//! assert_eq!(graph.neighbors(1), [0, 2]);
//!
//! // Even springs first, then odd ones. (`incise-coloring` finds such a coloring for any graph.)
//! let coloring = Coloring::new([0, 1, 0, 1, 0].map(ColorId).to_vec());
//! coloring.verify(&graph)?;
//!
//! let schedule = Schedule::new(&Clustering::none(5), &coloring);
//! schedule.check(&incidence)?;
//! for color in 0..schedule.color_count() {
//!     for &cluster in schedule.clusters(color) {
//!         // These blocks share no particle: run them in parallel, each from front to back.
//!         for &spring in schedule.constraints(cluster) {
//!             let _ends = incidence.particles_of(spring as usize);
//!         }
//!     }
//! }
//! assert!(schedule.order().eq([0, 2, 4, 1, 3]));
//! # Ok::<(), incise_graph::GraphError>(())
//! ```

mod classes;
mod clustering;
mod coloring;
mod constraint_graph;
mod csr;
mod disjoint_sets;
mod error;
mod id;
mod incidence;
#[cfg(feature = "petgraph")]
mod interop;
mod lanes;
mod metrics;
mod read;
mod rows;
mod schedule;

pub use classes::Classes;
pub use clustering::Clustering;
pub use coloring::Coloring;
pub use constraint_graph::ConstraintGraph;
pub use disjoint_sets::DisjointSets;
pub use error::GraphError;
pub use id::{ClusterId, ColorId};
pub use incidence::Incidence;
pub use lanes::{LaneGroup, Lanes};
pub use metrics::ColoringMetrics;
pub use read::{read_dimacs, read_matrix_market};
pub use rows::Rows;
pub use schedule::Schedule;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
