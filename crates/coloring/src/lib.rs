//! Colors constraints, or clusters of them, so that those of one color can be solved at the same
//! time.
//!
//! Constraints of one color share no particle. [`auto`] finds a coloring with few colors, often the
//! lower bound, which is the largest number of constraints at a particle; [`balance`] evens out the
//! classes; [`Recoloring`] updates a coloring when constraints are added and removed. [`scgc`] is
//! the paper's parallel algorithm (Algorithm 1) with its shortcuts as flags; [`jones_plassmann`]
//! and [`ecl_gc`] are its predecessors, and [`greedy`] in [`Order::LargestFirst`] defines the
//! result of all three, bit for bit, on any number of threads. [`vivace`], [`wlc`], [`dsatur`],
//! [`iterated_greedy`] and [`tabu`] complete the set; [`Algorithm`] has the names of all. The
//! number of colors is not limited.
//!
//! All functions take [`Conflicts`]: lists of particles per constraint
//! ([`Incidence`](incise_graph::Incidence)), which is often enough and much faster than building a
//! graph, or any graph ([`ConstraintGraph`](incise_graph::ConstraintGraph)). The crate does not
//! depend on meshes.
//!
//! ```
//! use incise_coloring::{Order, auto, greedy, scgc};
//! use incise_graph::{ConstraintGraph, Incidence};
//!
//! // A closed ring of five springs.
//! let ring = Incidence::from_constraints(5, (0u32..5).map(|i| [i, (i + 1) % 5]))?;
//! let coloring = auto(&ring).coloring;
//! coloring.verify_incidence(&ring)?;
//! assert_eq!(coloring.color_count(), 3);
//!
//! // In parallel, from the graph.
//! let graph = ConstraintGraph::from_incidence(&ring);
//! assert_eq!(scgc(&graph).coloring, greedy(&ring, Order::LargestFirst));
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
