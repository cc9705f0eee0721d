//! Sequential first fit: vertices choose one after the other, each the smallest color that no
//! neighbor has.
//!
//! The order decides the number of colors ([`Order`]). In the order of the parallel algorithms,
//! [`Order::LargestFirst`], it is their oracle: short enough to be believed, and equal to them bit
//! for bit. Cost: that of the order, and one pass over the edges, or from incidence over the
//! entries.

use incise_graph::Coloring;

use crate::{Conflicts, Order, order};

/// Colors sequentially in the given order.
///
/// Proper, labels without gaps, at most one color more than the largest degree. Deterministic; a graph and the
/// incidence it came from give equal colorings. O(vertices + edges) beside the cost of [`order`]; from incidence
/// O(entries), for every 64 colors over those constraints that need so many.
///
/// ```
/// use incise_coloring::{Order, greedy};
/// use incise_graph::ConstraintGraph;
///
/// let triangle = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 0), (2, 3)])?;
/// let coloring = greedy(&triangle, Order::LargestFirst);
/// coloring.verify(&triangle)?;
/// assert_eq!(coloring.color_count(), 3);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn greedy(conflicts: &impl Conflicts, by: Order) -> Coloring {
    Coloring::new(conflicts.first_fit(&order(conflicts, by)))
}
