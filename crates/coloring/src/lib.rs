//! Colorings of constraint graphs: which constraints, or clusters of constraints, may run at the
//! same time.
//!
//! [`scgc`] is the paper's parallel algorithm (Algorithm 1), [`greedy`] the sequential one that
//! defines its result: both give every vertex the smallest color that no neighbor of higher
//! priority has, so they agree bit for bit, on any number of threads. [`Recoloring`] colors what a
//! cut has added and leaves the rest alone. Nobody here has a limit on the number of
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
mod auto;
mod balance;
mod buckets;
mod clique;
mod color_sets;
mod conflicts;
mod dsatur;
mod ecl_gc;
mod error;
mod first_fit;
mod greedy;
mod higher;
mod iterated_greedy;
mod order;
mod palette;
mod priority;
mod random;
mod recoloring;
mod scgc;
mod search;
mod shortcuts;
mod tabu;
mod vivace;
mod within;
mod wlc;

pub use algorithm::{Algorithm, Colored, color};
pub use auto::{Auto, auto};
pub use balance::{BalanceStats, balance};
pub use conflicts::Conflicts;
pub use dsatur::dsatur;
pub use ecl_gc::{EclGc, EclGcStats, ecl_gc};
pub use error::ColoringError;
pub use greedy::greedy;
pub use iterated_greedy::iterated_greedy;
pub use order::{Order, order};
pub use priority::{hash, priorities, priority_order};
pub use recoloring::{Recolored, Recoloring};
pub use scgc::{Scgc, ScgcStats, jones_plassmann, scgc, scgc_with};
pub use shortcuts::Shortcuts;
pub use tabu::tabu;
pub use vivace::{Tie, Vivace, VivaceOptions, VivaceStats, vivace};
pub use within::color_within_clusters;
pub use wlc::{Wlc, WlcStats, wlc};

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
