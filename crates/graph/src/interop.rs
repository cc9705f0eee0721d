//! Conversion of graphs from and to `petgraph`, for algorithms that this workspace does not have.
//!
//! Node `i` is vertex `i` in both directions. Cost: O(vertices + edges), plus the edge sort of
//! [`ConstraintGraph::from_edges`] on the way in.

use petgraph::graph::{NodeIndex, UnGraph};
use petgraph::visit::EdgeRef;

use crate::{ConstraintGraph, GraphError};

impl From<&ConstraintGraph> for UnGraph<(), ()> {
    /// Builds a `petgraph` graph; node `i` is vertex `i`, and edges ascend.
    ///
    /// ```
    /// use incise_graph::ConstraintGraph;
    /// use petgraph::graph::UnGraph;
    ///
    /// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
    /// let outside = UnGraph::from(&path);
    /// assert_eq!(petgraph::algo::connected_components(&outside), 1);
    /// assert_eq!(ConstraintGraph::try_from(&outside)?, path);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    fn from(graph: &ConstraintGraph) -> Self {
        let mut result = Self::with_capacity(graph.vertex_count(), graph.edge_count());
        for _ in 0..graph.vertex_count() {
            result.add_node(());
        }
        for (a, b) in graph.edges() {
            result.add_edge(NodeIndex::new(a as usize), NodeIndex::new(b as usize), ());
        }
        result
    }
}

impl<N, E> TryFrom<&UnGraph<N, E>> for ConstraintGraph {
    type Error = GraphError;

    /// Builds a graph from a `petgraph` graph; vertex `i` is node `i`, weights are ignored and
    /// parallel edges merged.
    ///
    /// # Errors
    /// An edge from a node to itself; too many edges.
    fn try_from(graph: &UnGraph<N, E>) -> Result<Self, GraphError> {
        let number = |node: NodeIndex| {
            u32::try_from(node.index()).map_err(|_| GraphError::TooMany {
                what: "vertices",
                count: node.index() + 1,
            })
        };
        let mut edges = Vec::with_capacity(graph.edge_count());
        for edge in graph.edge_references() {
            edges.push((number(edge.source())?, number(edge.target())?));
        }
        Self::from_edges(graph.node_count(), &edges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_edges_merge_and_loops_are_refused() {
        let mut outside = UnGraph::<&str, f32>::default();
        let (a, b) = (outside.add_node("a"), outside.add_node("b"));
        outside.add_edge(a, b, 0.5);
        outside.add_edge(b, a, 1.5);
        assert_eq!(ConstraintGraph::try_from(&outside).unwrap().edge_count(), 1);
        outside.add_edge(b, b, 2.5);
        assert_eq!(
            ConstraintGraph::try_from(&outside),
            Err(GraphError::SelfLoop { edge: 2, vertex: 1 })
        );
    }
}
