//! Clustering of constraints into blocks whose members are solved one after the other.
//!
//! Colors run one after the other, so their number limits how parallel a solver is. Merging
//! neighboring constraints into clusters and coloring the clusters needs fewer colors, converges
//! better (Gauss-Seidel inside a cluster) and leaves a smaller graph to color. [`serial_neighbor`]
//! is the paper's clustering (Algorithm 2), [`greedy_k_neighbor`] the one to which the paper
//! compares it, and
//! [`pressure`] one that aims at few colors; [`update_local`] changes only what a cut has touched
//! (section 4.3), and [`merge_small`] joins what the cut left small with its neighbors.
//!
//! The algorithms take an [`Incidence`](incise_graph::Incidence) of any constraints and do not
//! depend on meshes. [`serial_neighbor`] needs only a graph.
//!
//! ```
//! use std::num::NonZeroUsize;
//!
//! use incise_clustering::pressure;
//! use incise_graph::Incidence;
//!
//! // A row of eight springs.
//! let springs = Incidence::from_constraints(9, (0u32..8).map(|i| [i, i + 1]))?;
//!
//! let pairs = pressure(&springs, NonZeroUsize::MIN.saturating_add(1));
//! assert_eq!(pairs.occupied(), 4);
//! // One row per pair: rows that share a particle need different colors.
//! let clusters = springs.quotient(&pairs);
//! assert_eq!(clusters.clique_bound(), 2);
//! # Ok::<(), incise_graph::GraphError>(())
//! ```

mod candidates;
mod error;
mod greedy_k_neighbor;
mod merge;
mod method;
mod parts;
mod pressure;
mod serial_neighbor;
mod update;

pub use error::ClusteringError;
pub use greedy_k_neighbor::greedy_k_neighbor;
pub use merge::{MergeLists, Moved, merge_small};
pub use method::{Method, cluster};
pub use pressure::pressure;
pub use serial_neighbor::{serial_neighbor, serial_neighbor_incidence};
pub use update::update_local;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
