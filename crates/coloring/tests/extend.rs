//! Local recoloring keeps a coloring proper and touches nothing else.

use incise_coloring::{Order, extend_first_fit, greedy};
use incise_graph::{Coloring, ConstraintGraph};
use proptest::collection::btree_set;
use proptest::prelude::*;

use crate::generators::erdos_renyi;

/// The graph without the edges at the given vertices, as it was before they were new.
fn without(graph: &ConstraintGraph, gone: &[u32]) -> ConstraintGraph {
    let edges: Vec<_> = graph
        .edges()
        .filter(|(a, b)| !gone.contains(a) && !gone.contains(b))
        .collect();
    ConstraintGraph::from_edges(graph.vertex_count(), &edges).unwrap()
}

proptest! {
    #[test]
    fn used_slots_stay_proper((graph, new) in erdos_renyi(40).prop_flat_map(|graph| {
        let n = u32::try_from(graph.vertex_count()).unwrap();
        (Just(graph), btree_set(0..n.max(1), 0..=n as usize / 2))
    })) {
        let new: Vec<u32> = new.into_iter().collect();
        let before = greedy(&without(&graph, &new), Order::LargestFirst);
        let mut after = before.clone();
        extend_first_fit(&mut after, &new, |v, list| {
            list.extend_from_slice(graph.neighbors(v as usize));
        });
        after.verify(&graph).unwrap();
        for v in (0..).take(graph.vertex_count()).filter(|v| !new.contains(v)) {
            prop_assert_eq!(after.color(v as usize), before.color(v as usize));
        }
        prop_assert!(new.iter().all(|&v| after.color(v as usize).index() <= graph.degree(v as usize)));
    }

    #[test]
    fn appended_vertices_stay_proper((graph, kept) in erdos_renyi(40).prop_flat_map(|graph| {
        let n = graph.vertex_count();
        (Just(graph), 0..=n)
    })) {
        let mut new: Vec<u32> = (0..).take(graph.vertex_count()).skip(kept).collect();
        new.reverse();
        let mut coloring = Coloring::new(greedy(&without(&graph, &new), Order::LargestFirst).colors()[..kept].to_vec());
        extend_first_fit(&mut coloring, &new, |v, list| {
            list.extend_from_slice(graph.neighbors(v as usize));
        });
        coloring.verify(&graph).unwrap();
    }
}
