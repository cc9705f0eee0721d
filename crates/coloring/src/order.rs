//! Orders in which vertices get to choose: what makes greedy coloring good or bad.
//!
//! First fit uses at most one color more than the largest number of neighbors a vertex has among
//! those before it. So an order is good if few neighbors come before each vertex.
//! [`LargestFirst`](Order::LargestFirst) puts hubs first. Two orders are better:
//! [`SmallestLast`](Order::SmallestLast) puts the vertex with the fewest neighbors left last, and
//! [`MaximumCardinality`](Order::MaximumCardinality) puts the vertex with the most colored neighbors
//! next. Both find an order of least possible width, `SmallestLast` for any graph (Matula and Beck
//! 1983), `MaximumCardinality` for chordal ones (Tarjan and Yannakakis 1984). Both pick from buckets
//! in O(vertices + edges).

use crate::buckets::{Buckets, Extreme};
use crate::random::Random;
use crate::{Conflicts, priority_order};

/// Order in which greedy coloring visits vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Order {
    /// Ascending by number.
    Natural,
    /// Random with this seed; equal on every machine.
    Random(u64),
    /// Most neighbors first, ties by hash: [`priority_order`], that of the parallel algorithms
    /// (Welsh and Powell 1967).
    LargestFirst,
    /// Most neighbors first, by an upper bound of their number: [`Conflicts::degree_bound`], ties by number. From
    /// incidence this needs no edges, but where neighbors share several particles it differs from
    /// what a graph gives.
    DegreeBound,
    /// Smallest last: filled from the back with the vertex that has the fewest neighbors among
    /// those not placed yet.
    SmallestLast,
    /// Maximum cardinality search (MCS): next is the vertex with the most neighbors among those
    /// already placed.
    MaximumCardinality,
}

/// Returns all vertices of `conflicts` in an order, the first to choose in front.
///
/// Deterministic, and but for `DegreeBound` the same for a graph and the incidence it came from. O(n)
/// for `Natural`, O(n + entries) for `DegreeBound`, O(n) for `Random`, O(n log n + degrees) for
/// `LargestFirst`, O(n + edges) for the other two, from incidence O(sum over particles of valence
/// squared).
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
            let mut order: Vec<u32> = natural().collect();
            Random::new(seed).shuffle(&mut order);
            order
        }
        Order::LargestFirst => priority_order(conflicts),
        Order::DegreeBound => by_degree_bound(conflicts),
        Order::SmallestLast => smallest_last(conflicts),
        Order::MaximumCardinality => maximum_cardinality(conflicts),
    }
}

/// Counting sort, descending and stable.
fn by_degree_bound(conflicts: &impl Conflicts) -> Vec<u32> {
    let degree_bound = conflicts.degree_bound();
    let most = degree_bound.iter().max().map_or(0, |&most| most as usize);
    // Bound -> position of the next vertex with that bound.
    let mut next = vec![0u32; most + 2];
    for &degree_bound in &degree_bound {
        next[most - degree_bound as usize + 1] += 1;
    }
    for i in 0..=most {
        next[i + 1] += next[i];
    }
    let mut order = vec![0; degree_bound.len()];
    for (v, &degree_bound) in (0..).zip(&degree_bound) {
        let next = &mut next[most - degree_bound as usize];
        order[*next as usize] = v;
        *next += 1;
    }
    order
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
