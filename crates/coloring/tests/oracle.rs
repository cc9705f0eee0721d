//! `scgc` equals `greedy`, both are proper and within the bounds, for any number of threads.

use incise_coloring::{Algorithm, Order, Scgc, color, greedy, priority_order, scgc};
use incise_graph::{ClusterId, Clustering, ConstraintGraph};
use proptest::prelude::*;

use crate::generators::{bipartite, clique, erdos_renyi, golden, kuhn, path};

fn with_threads(threads: usize, graph: &ConstraintGraph) -> Scgc {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
        .install(|| scgc(graph))
}

/// Everything that holds for any graph; returns the number of colors and the rounds.
fn check(graph: &ConstraintGraph) -> (usize, usize) {
    let result = scgc(graph);
    let oracle = greedy(graph, Order::LargestFirst);
    result.coloring.verify(graph).unwrap();
    assert_eq!(result.coloring, oracle);
    assert!(oracle.color_count() <= graph.max_degree() + 1);
    assert_eq!(oracle.color_count(), oracle.distinct_colors());
    let stats = result.stats;
    let counted = stats.dependency_free + stats.shortcut1 + stats.shortcut2 + stats.shortcut3;
    assert_eq!(counted, graph.vertex_count());
    assert!(stats.removed_edges <= graph.edge_count());
    (oracle.color_count(), stats.rounds)
}

/// Greedy by the definition: the smallest color no colored neighbor has, in the documented order.
fn definition(graph: &ConstraintGraph) -> Vec<usize> {
    let mut colors = vec![usize::MAX; graph.vertex_count()];
    for v in priority_order(graph) {
        let taken: Vec<usize> = graph
            .neighbors(v as usize)
            .iter()
            .map(|&u| colors[u as usize])
            .collect();
        colors[v as usize] = (0..).find(|color| !taken.contains(color)).unwrap();
    }
    colors
}

#[test]
fn cliques_need_all_colors() {
    for n in [1, 2, 31, 32, 33, 63, 64, 65, 127, 128, 129, 130, 360] {
        assert_eq!(check(&clique(n)), (n as usize, n as usize));
    }
}

#[test]
fn sparse_families() {
    assert_eq!(check(&path(0)), (0, 0));
    assert_eq!(
        check(&ConstraintGraph::from_edges(1000, &[]).unwrap()),
        (1, 1)
    );
    assert_eq!(check(&bipartite(1, 5000)), (2, 2));
    assert_eq!(check(&bipartite(1, 1)), (2, 2));
    assert_eq!(check(&bipartite(70, 90)).0, 2);
    assert!(check(&path(5000)).0 <= 3);
}

#[test]
fn disconnected_parts_do_not_meet() {
    let edges = [(0, 1), (1, 2), (2, 0), (5, 6), (8, 9), (9, 10)];
    assert_eq!(
        check(&ConstraintGraph::from_edges(12, &edges).unwrap()).0,
        3
    );
}

#[test]
fn lattices_clustered_or_not() {
    for n in [1, 2, 5] {
        let incidence = kuhn(n);
        let graph = ConstraintGraph::from_incidence(&incidence);
        assert!(check(&graph).0 >= incidence.clique_bound());
        greedy(&graph, Order::LargestFirst)
            .verify_incidence(&incidence)
            .unwrap();
        for size in [2, 5, 6, 50] {
            let labels = (0..graph.vertex_count())
                .map(|c| ClusterId::new(c / size))
                .collect();
            let clustering = Clustering::from_labels(labels).unwrap();
            let clusters = incidence.quotient(&clustering);
            let quotient = graph.quotient(&clustering);
            assert!(check(&quotient).0 >= clusters.clique_bound());
            greedy(&quotient, Order::LargestFirst)
                .verify_incidence(&clusters)
                .unwrap();
        }
    }
}

#[test]
fn threads_change_nothing() {
    let graph = ConstraintGraph::from_incidence(&kuhn(10));
    let one = with_threads(1, &graph);
    for threads in [2, 3] {
        assert_eq!(with_threads(threads, &graph), one);
    }
}

/// Colors are part of the contract: a change of hash, order or rule fails here.
#[test]
fn golden_hash() {
    let graph = ConstraintGraph::from_incidence(&kuhn(8));
    let coloring = scgc(&graph).coloring;
    let hash = golden(&coloring);
    assert_eq!((coloring.color_count(), hash), (34, 0x6c30_379c_9f35_058c));
}

#[test]
fn every_name_gives_a_proper_coloring() {
    let graph = ConstraintGraph::from_incidence(&kuhn(3));
    for algorithm in Algorithm::ALL {
        let result = color(algorithm, &graph, 1).unwrap();
        result.coloring.verify(&graph).unwrap();
        assert!(result.rounds > 0);
    }
}

proptest! {
    #[test]
    fn random_graphs(graph in erdos_renyi(90)) {
        check(&graph);
        let colors: Vec<usize> = greedy(&graph, Order::LargestFirst).colors().iter().map(|color| color.index()).collect();
        prop_assert_eq!(colors, definition(&graph));
    }
}
