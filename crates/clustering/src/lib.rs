//! Clusterings of constraint graphs: which constraints are solved one after the other as one block.
//!
//! Colors run one after the other, so their number limits how parallel a solver is. Merging
//! neighboring constraints into clusters and coloring the clusters needs fewer colors, converges
//! better (Gauss-Seidel inside a cluster) and leaves a smaller graph to color. [`serial_neighbor`]
//! is the paper's clustering (Algorithm 2); [`update_local`] changes only what a cut has touched
//! (section 4.3).
//!
//! The algorithms take a [`ConstraintGraph`](incise_graph::ConstraintGraph) of anything; they know
//! nothing of meshes.
//!
//! ```
//! use std::num::NonZeroUsize;
//!
//! use incise_clustering::serial_neighbor;
//! use incise_graph::{ConstraintGraph, Incidence};
//!
//! // A row of eight springs.
//! let springs = Incidence::from_constraints(9, (0u32..8).map(|i| [i, i + 1]))?;
//! let graph = ConstraintGraph::from_incidence(&springs);
//!
//! let pairs = serial_neighbor(&graph, NonZeroUsize::MIN.saturating_add(1));
//! assert_eq!(pairs.occupied(), 4);
//! assert_eq!(graph.quotient(&pairs).edge_count(), 3);
//! # Ok::<(), incise_graph::GraphError>(())
//! ```

mod error;
mod method;
mod serial_neighbor;
mod update;

pub use error::ClusteringError;
pub use method::{Method, cluster};
pub use serial_neighbor::serial_neighbor;
pub use update::update_local;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
