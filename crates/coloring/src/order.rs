//! Orders in which vertices get to choose: what makes greedy coloring good or bad.
//!
//! First fit uses at most one color more than the largest number of neighbors a vertex has among
//! those before it. So an order is good if few neighbors come before anybody: hubs first
//! ([`LargestFirst`](Order::LargestFirst)), or, better, whoever has the fewest neighbors left goes
//! last ([`SmallestLast`](Order::SmallestLast)), or whoever has the most colored neighbors goes
//! next ([`MaximumCardinality`](Order::MaximumCardinality)). The last two find an order of least
//! possible width, the first for any graph (Matula and Beck 1983), the second for chordal ones
//! (Tarjan and Yannakakis 1984); both pick from buckets in O(vertices + edges).

use crate::buckets::{Buckets, Extreme};
use crate::{Conflicts, hash, priority_order};

/// Who chooses first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// By number.
    Natural,
    /// By a hash of this seed and the number; the same on every machine.
    Random(u64),
    /// Most neighbors first, ties by hash: [`priority_order`], that of the parallel algorithms
    /// (Welsh and Powell 1967).
    LargestFirst,
    /// Backwards: last whoever has the fewest neighbors among those not placed yet.
    SmallestLast,
    /// Next whoever has the most neighbors among those already placed (maximum cardinality search,
    /// MCS).
    MaximumCardinality,
}

/// All vertices of `conflicts`, those that choose first in front.
///
/// Deterministic, and the same for a graph and the incidence it came from. O(n) for `Natural`, O(n
/// log n) for `Random`, O(n log n + degrees) for `LargestFirst`, O(n + edges) for the other two,
/// from incidence O(sum over particles of valence squared).
///
/// ```
/// use incise_coloring::{Order, order};
/// use incise_graph::ConstraintGraph;
///
/// // A triangle with a tail: 3 hangs on 2, 4 on 3.
/// let graph = ConstraintGraph::from_edges(5, &[(0, 1), (1, 2), (2, 0), (2, 3), (3, 4)])?;
/// assert_eq!(order(&graph, Order::Natural), [0, 1, 2, 3, 4]);
/// assert_eq!(order(&graph, Order::LargestFirst)[0], 2);
/// assert_eq!(order(&graph, Order::SmallestLast).last(), Some(&4));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn order(conflicts: &impl Conflicts, order: Order) -> Vec<u32> {
    let natural = || (0..).take(conflicts.vertex_count());
    match order {
        Order::Natural => natural().collect(),
        Order::Random(seed) => {
            let mut keys: Vec<(u64, u32)> = natural().map(|v| (mix(seed, v), v)).collect();
            keys.sort_unstable();
            keys.into_iter().map(|(_, v)| v).collect()
        }
        Order::LargestFirst => priority_order(conflicts),
        Order::SmallestLast => smallest_last(conflicts),
        Order::MaximumCardinality => maximum_cardinality(conflicts),
    }
}

/// A random-looking number for each pair (the finalizer of `SplitMix64`, which is a bijection).
fn mix(seed: u64, v: u32) -> u64 {
    let x = seed
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(u64::from(v) << 32 | u64::from(hash(v)));
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Takes the vertex with the fewest neighbors left, again and again, and reverses.
fn smallest_last(conflicts: &impl Conflicts) -> Vec<u32> {
    let graph = conflicts.graph();
    let mut buckets = Buckets::new(&graph.degrees());
    let mut order = Vec::with_capacity(graph.vertex_count());
    while let Some(v) = buckets.take(Extreme::Smallest) {
        order.push(v);
        for &u in graph.neighbors(v as usize) {
            buckets.decrease(u);
        }
    }
    order.reverse();
    order
}

/// Takes the vertex with the most neighbors taken, again and again.
fn maximum_cardinality(conflicts: &impl Conflicts) -> Vec<u32> {
    let graph = conflicts.graph();
    let mut buckets = Buckets::new(&vec![0; graph.vertex_count()]);
    let mut order = Vec::with_capacity(graph.vertex_count());
    while let Some(v) = buckets.take(Extreme::Largest) {
        order.push(v);
        for &u in graph.neighbors(v as usize) {
            buckets.increase(u);
        }
    }
    order
}
