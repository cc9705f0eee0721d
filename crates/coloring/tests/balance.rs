//! Balancing keeps what it must and evens out what it can.

use incise_coloring::{Conflicts, Order, auto, balance, balance_weights, greedy};
use incise_graph::{ClusterId, Clustering, ColorId, Coloring, ColoringMetrics, ConstraintGraph};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::generators::{bipartite, clique, constraints, erdos_renyi, kuhn, path};

/// Balances and checks everything that holds for any input; returns the range of the class sizes.
fn check(conflicts: &impl Conflicts, coloring: &Coloring) -> u64 {
    let graph = conflicts.graph();
    let before = ColoringMetrics::by_vertices(coloring);
    let mut balanced = coloring.clone();
    let stats = balance(conflicts, &mut balanced);
    balanced.verify(&graph).unwrap();
    let after = ColoringMetrics::by_vertices(&balanced);
    assert_eq!(after.colors, before.colors);
    assert!(after.chi2 <= before.chi2 && stats.settled);
    let mut again = balanced.clone();
    let stats = balance(conflicts, &mut again);
    assert_eq!((stats.moves, stats.chains, stats.flips), (0, 0, 0));
    assert_eq!(again, balanced);
    after.range
}

#[test]
fn what_can_be_even_becomes_even() {
    for by in [Order::Natural, Order::LargestFirst, Order::SmallestLast] {
        for n in [4, 6, 8] {
            let incidence = kuhn(n);
            assert!(check(&incidence, &greedy(&incidence, by)) <= 1);
            let labels = 0..incidence.constraint_count();
            let labels = labels.map(|c| ClusterId::new(c / 5)).collect();
            let clusters = incidence.quotient(&Clustering::from_labels(labels).unwrap());
            // Seventy clusters in fifteen colors are too tight for these moves.
            let most = if n == 4 { 2 } else { 1 };
            assert!(check(&clusters, &greedy(&clusters, by)) <= most);
        }
        assert!(check(&path(200), &greedy(&path(200), by)) <= 1);
    }
    let tight = auto(&kuhn(6)).coloring;
    assert!(check(&kuhn(6), &tight) <= 1);
    // Edgeless, with three colors named.
    let edgeless = ConstraintGraph::from_edges(100, &[]).unwrap();
    let mut colors = vec![ColorId(0); 100];
    (colors[7], colors[8]) = (ColorId(1), ColorId(2));
    assert_eq!(check(&edgeless, &Coloring::new(colors)), 1);
}

/// Only flips help: every vertex of the heavy class has a neighbor in the light one.
#[test]
fn stars_of_unlike_sizes_are_flipped() {
    // Six stars with three leaves each; all centers have color 1.
    let edges: Vec<(u32, u32)> = (0..6)
        .flat_map(|i| (1..4).map(move |leaf| (4 * i, 4 * i + leaf)))
        .collect();
    let stars = ConstraintGraph::from_edges(24, &edges).unwrap();
    let colors = (0..24).map(|v| ColorId(u32::from(v % 4 == 0))).collect();
    assert_eq!(check(&stars, &Coloring::new(colors)), 0);
}

/// Only a chain helps: class 0 fits into 1, class 1 into 2, but class 0 not into 2.
#[test]
fn a_chain_goes_through_the_class_between() {
    // Four vertices of color 0, all adjacent to the vertex of color 2; three of color 1.
    let edges = [(0, 7), (1, 7), (2, 7), (3, 7)];
    let graph = ConstraintGraph::from_edges(8, &edges).unwrap();
    let mut coloring = Coloring::new([0, 0, 0, 0, 1, 1, 1, 2].map(ColorId).to_vec());
    assert!(check(&graph, &coloring) <= 1);
    balance(&graph, &mut coloring);
    assert_eq!(ColoringMetrics::by_vertices(&coloring).max, 3);
}

#[test]
fn what_cannot_be_even_ends() {
    let star = bipartite(1, 40);
    assert_eq!(check(&star, &greedy(&star, Order::LargestFirst)), 39);
    let whole = clique(20);
    assert_eq!(check(&whole, &greedy(&whole, Order::Natural)), 0);
    assert_eq!(check(&path(0), &Coloring::default()), 0);
    let one = Coloring::new(vec![ColorId(0); 5]);
    assert_eq!(
        check(&ConstraintGraph::from_edges(5, &[]).unwrap(), &one),
        0
    );
}

/// Vacant clusters weigh nothing and may have any color.
#[test]
fn weights_decide() {
    let edgeless = ConstraintGraph::from_edges(6, &[]).unwrap();
    let mut coloring = Coloring::new([0, 0, 0, 0, 0, 1].map(ColorId).to_vec());
    balance_weights(&edgeless, &mut coloring, &[8, 1, 3, 4, 0, 0]);
    let metrics = ColoringMetrics::by_weights(&coloring, &[8, 1, 3, 4, 0, 0]);
    assert_eq!((metrics.min, metrics.max), (8, 8));
}

proptest! {
    #[test]
    fn random_graphs(graph in erdos_renyi(60)) {
        for by in [Order::Natural, Order::SmallestLast] {
            check(&graph, &greedy(&graph, by));
        }
    }

    #[test]
    fn random_constraints(incidence in constraints(80), weights in vec(0u32..9, 80)) {
        let coloring = greedy(&incidence, Order::LargestFirst);
        check(&incidence, &coloring);
        let graph = ConstraintGraph::from_incidence(&incidence);
        let weights = &weights[..incidence.constraint_count()];
        let (mut one, mut other) = (coloring.clone(), coloring.clone());
        let stats = balance_weights(&incidence, &mut one, weights);
        prop_assert_eq!(stats, balance_weights(&graph, &mut other, weights));
        prop_assert_eq!(&one, &other);
        one.verify(&graph).unwrap();
        let before = ColoringMetrics::by_weights(&coloring, weights);
        let after = ColoringMetrics::by_weights(&one, weights);
        prop_assert!(after.colors <= before.colors && after.chi2 <= before.chi2);
        prop_assert!(stats.settled);
    }
}
