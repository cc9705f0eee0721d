//! Colorings of constraint graphs: which constraints, or clusters of constraints, may run at the
//! same time.
//!
//! [`scgc`] is the paper's parallel algorithm (Algorithm 1), [`greedy`] the sequential one that
//! defines its result: both give every vertex the smallest color that no neighbor of higher
//! [`priority`] has, so they agree bit for bit, on any number of threads. [`extend_first_fit`]
//! colors what a cut has added and leaves the rest alone. Nobody here has a limit on the number of
//! colors: palettes are as long as the degrees ask for.
//!
//! The algorithms take a [`ConstraintGraph`](incise_graph::ConstraintGraph) of anything; they know
//! nothing of meshes.
//!
//! ```
//! use incise_coloring::{Order, greedy, scgc};
//! use incise_graph::{ConstraintGraph, Incidence};
//!
//! // A closed ring of five springs.
//! let ring = Incidence::from_constraints(5, (0u32..5).map(|i| [i, (i + 1) % 5]))?;
//! let graph = ConstraintGraph::from_incidence(&ring);
//!
//! let result = scgc(&graph);
//! result.coloring.verify(&graph)?;
//! assert_eq!(result.coloring.color_count(), 3);
//! assert_eq!(result.coloring, greedy(&graph, Order::LargestFirst));
//! # Ok::<(), incise_graph::GraphError>(())
//! ```

mod algorithm;
mod buckets;
mod conflicts;
mod error;
mod extend;
mod first_fit;
mod greedy;
mod order;
mod palette;
mod priority;
mod scgc;
mod within;

pub use algorithm::{Algorithm, color};
pub use conflicts::Conflicts;
pub use error::ColoringError;
pub use extend::extend_first_fit;
pub use greedy::greedy;
pub use order::{Order, order};
pub use priority::{hash, priorities, priority_order};
pub use scgc::{Scgc, ScgcStats, scgc};
pub use within::color_within_clusters;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
