//! Algorithm 2 compared with a literal version of it, and its guarantees.

use std::num::NonZeroUsize;

use incise_clustering::{serial_neighbor, serial_neighbor_incidence};
use incise_coloring::{Order, greedy, scgc};
use incise_graph::{ClusterId, Clustering, ConstraintGraph, Schedule};
use proptest::prelude::*;

use crate::inputs::incidences;

/// The algorithm as printed, with sets.
fn as_printed(graph: &ConstraintGraph, ks: usize) -> Vec<Vec<u32>> {
    let mut unclustered: Vec<u32> = (0..).take(graph.vertex_count()).collect(); // Line 1.
    let mut clusters = Vec::new(); // Line 2.
    for v in 0..graph.vertex_count() {
        let Some(place) = unclustered.iter().position(|&u| u as usize == v) else {
            continue;
        }; // Lines 3-4.
        let mut cluster = vec![unclustered.remove(place)]; // Lines 5-6.
        let free: Vec<u32> = unclustered
            .iter()
            .copied()
            .filter(|u| graph.neighbors(v).contains(u))
            .collect(); // Line 7.
        for &u in free.iter().take(ks - 1) {
            // Lines 8-10.
            cluster.push(u);
            unclustered.retain(|&other| other != u);
        }
        clusters.push(cluster); // Line 11.
    }
    clusters
}

proptest! {
    #[test]
    fn equals_the_printed_algorithm(incidence in incidences(), ks in 1usize..12) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        let clustering = serial_neighbor(&graph, NonZeroUsize::new(ks).unwrap());
        clustering.check().unwrap();
        prop_assert_eq!(&serial_neighbor(&graph, NonZeroUsize::new(ks).unwrap()), &clustering);
        let expected = as_printed(&graph, ks);
        prop_assert_eq!(clustering.cluster_count(), expected.len());
        prop_assert_eq!(clustering.occupied(), expected.len());
        prop_assert!(clustering.max_size() <= ks);
        let found = clustering.members();
        for (k, members) in expected.iter().enumerate() {
            // The seed comes first in both and is the smallest member.
            prop_assert_eq!(found.members(k), &members[..]);
            let seed = members[0] as usize;
            prop_assert!(members[1..].iter().all(|u| graph.neighbors(seed).contains(u)));
        }
        // A partition: every constraint in exactly one cluster.
        prop_assert!(clustering.labels().iter().all(|&k| k != ClusterId::NONE));
        prop_assert_eq!(clustering.sizes().iter().sum::<u32>() as usize, graph.vertex_count());
    }

    #[test]
    fn incidence_gives_what_the_graph_gives(incidence in incidences(), ks in 1usize..70) {
        let ks = NonZeroUsize::new(ks).unwrap();
        let graph = ConstraintGraph::from_incidence(&incidence);
        prop_assert_eq!(serial_neighbor_incidence(&incidence, ks), serial_neighbor(&graph, ks));
    }

    #[test]
    fn size_one_is_no_clustering(incidence in incidences()) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        prop_assert_eq!(serial_neighbor(&graph, NonZeroUsize::MIN), Clustering::none(graph.vertex_count()));
    }

    #[test]
    fn clusters_can_be_colored_and_scheduled(incidence in incidences(), ks in 1usize..12) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        let clustering = serial_neighbor(&graph, NonZeroUsize::new(ks).unwrap());
        let quotient = graph.quotient(&clustering);
        let coloring = scgc(&quotient).coloring;
        prop_assert_eq!(&coloring, &greedy(&quotient, Order::LargestFirst));
        coloring.verify_incidence(&incidence.quotient(&clustering)).unwrap();
        prop_assert!(coloring.color_count() >= incidence.quotient(&clustering).clique_bound());
        Schedule::new(&clustering, &coloring).check(&incidence).unwrap();
    }
}

#[test]
fn empty_graph() {
    let none = ConstraintGraph::from_edges(0, &[]).unwrap();
    assert_eq!(
        serial_neighbor(&none, NonZeroUsize::MAX),
        Clustering::none(0)
    );
}
