//! Sequential first fit in priority order: what the parallel algorithm must reproduce.
//!
//! The vertices choose one after the other, most neighbors first (Welsh and Powell's order, with
//! ties broken as in [`priority`](crate::priority)), each the smallest color free among its
//! neighbors. Short enough to be believed, it is the oracle for [`scgc`](crate::scgc()). Cost: O(n
//! log n + edges) time, O(n) memory.

use incise_graph::{ColorId, Coloring, ConstraintGraph};

use crate::first_fit::FirstFit;
use crate::priority_order;

/// Colors `graph` sequentially, largest degree first.
///
/// Proper, deterministic, labels without gaps, at most `max_degree() + 1` colors. O(n log n +
/// edges).
///
/// ```
/// use incise_coloring::greedy;
/// use incise_graph::ConstraintGraph;
///
/// let triangle = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 0), (2, 3)])?;
/// let coloring = greedy(&triangle);
/// coloring.verify(&triangle)?;
/// assert_eq!(coloring.color_count(), 3);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn greedy(graph: &ConstraintGraph) -> Coloring {
    // A color too large for any palette stands for "none yet", so that it never counts as taken.
    let mut colors = vec![ColorId(u32::MAX); graph.vertex_count()];
    let mut first_fit = FirstFit::default();
    for v in priority_order(graph) {
        let neighbors = graph.neighbors(v as usize);
        let color = first_fit.choose(
            neighbors.len(),
            neighbors.iter().map(|&u| colors[u as usize]),
        );
        colors[v as usize] = color;
    }
    Coloring::new(colors)
}
