//! The sequential algorithms against their definitions, and incidence against its graph.

use incise_coloring::{
    Conflicts, Order, auto, dsatur, greedy, iterated_greedy, order, priorities, tabu,
};
use incise_graph::{Coloring, ConstraintGraph, Incidence};
use proptest::prelude::*;

use crate::generators::{bipartite, clique, constraints, erdos_renyi, kuhn, path};

const ORDERS: [Order; 6] = [
    Order::Natural,
    Order::Random(7),
    Order::LargestFirst,
    Order::DegreeBound,
    Order::SmallestLast,
    Order::MaximumCardinality,
];

fn is_permutation(order: &[u32], vertices: usize) {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq((0..).take(vertices)));
}

/// For each vertex of `order`, how many of its neighbors come before it.
fn width(graph: &ConstraintGraph, order: &[u32], v: u32, at: usize) -> usize {
    let before = &order[..at];
    let neighbors = graph.neighbors(v as usize);
    neighbors.iter().filter(|u| before.contains(u)).count()
}

/// Asserts, from the back, that each vertex has the fewest neighbors among those still there.
fn is_smallest_last(graph: &ConstraintGraph, order: &[u32]) {
    for end in (0..order.len()).rev() {
        let left = &order[..=end];
        let fewest = left.iter().map(|&v| width(graph, order, v, end + 1)).min();
        assert_eq!(Some(width(graph, order, order[end], end + 1)), fewest);
    }
}

/// Asserts that each next vertex has the most neighbors among those already placed.
fn is_maximum_cardinality(graph: &ConstraintGraph, order: &[u32]) {
    for at in 0..order.len() {
        let most = order[at..]
            .iter()
            .map(|&v| width(graph, order, v, at))
            .max();
        assert_eq!(Some(width(graph, order, order[at], at)), most);
    }
}

/// DSATUR by its definition.
fn slow_dsatur(graph: &ConstraintGraph) -> Vec<usize> {
    let keys = priorities(graph);
    let mut colors = vec![usize::MAX; graph.vertex_count()];
    for _ in 0..colors.len() {
        let around = |v: usize| {
            let mut around: Vec<usize> = graph
                .neighbors(v)
                .iter()
                .map(|&u| colors[u as usize])
                .filter(|&color| color != usize::MAX)
                .collect();
            around.sort_unstable();
            around.dedup();
            around
        };
        let uncolored = (0..colors.len()).filter(|&v| colors[v] == usize::MAX);
        let next = uncolored
            .max_by_key(|&v| (around(v).len(), keys[v]))
            .unwrap();
        let taken = around(next);
        colors[next] = (0..).find(|color| !taken.contains(color)).unwrap();
    }
    colors
}

fn indices(coloring: &Coloring) -> Vec<usize> {
    coloring
        .colors()
        .iter()
        .map(|color| color.index())
        .collect()
}

/// Everything that must hold for any input; returns the colors of `auto`.
fn check(conflicts: &impl Conflicts) -> usize {
    let graph = conflicts.graph();
    let bound = conflicts.clique_bound();
    assert!(
        conflicts
            .degree_bound()
            .iter()
            .zip(graph.degrees())
            .all(|(&c, d)| c >= d)
    );
    for by in ORDERS {
        is_permutation(&order(conflicts, by), graph.vertex_count());
        let coloring = greedy(conflicts, by);
        coloring.verify(&graph).unwrap();
        let colors = coloring.color_count();
        assert!(bound <= colors && colors <= graph.max_degree() + 1);
        assert_eq!(colors, coloring.distinct_colors());

        let mut better = coloring.clone();
        iterated_greedy(conflicts, &mut better, 5, bound, 3);
        better.verify(&graph).unwrap();
        assert!(better.color_count() <= colors);
        let mut best = better.clone();
        tabu(conflicts, &mut best, bound, 50, 3);
        best.verify(&graph).unwrap();
        assert!(best.color_count() <= better.color_count());
        assert_eq!(best.color_count(), best.distinct_colors());
    }
    let saturation = dsatur(conflicts);
    saturation.verify(&graph).unwrap();
    assert_eq!(saturation.color_count(), saturation.distinct_colors());
    let result = auto(conflicts);
    result.coloring.verify(&graph).unwrap();
    assert_eq!(result, auto(conflicts));
    let colors = result.coloring.color_count();
    assert_eq!(colors, result.coloring.distinct_colors());
    assert!(bound <= result.bound && result.bound <= colors);
    assert!(colors <= greedy(conflicts, Order::DegreeBound).color_count());
    colors
}

#[test]
fn families_with_known_numbers() {
    assert_eq!(check(&path(0)), 0);
    assert_eq!(check(&ConstraintGraph::from_edges(100, &[]).unwrap()), 1);
    assert_eq!(check(&bipartite(1, 300)), 2);
    assert_eq!(check(&bipartite(20, 30)), 2);
    assert_eq!(check(&path(301)), 2);
    for n in [1, 2, 63, 64, 65, 128, 129] {
        assert_eq!(check(&clique(n)), n as usize);
    }
    for (left, right) in [(1, 1), (1, 300), (40, 70)] {
        assert_eq!(dsatur(&bipartite(left, right)).color_count(), 2);
    }
}

/// One particle with more constraints than any fixed palette has colors.
#[test]
fn a_particle_with_1280_constraints_needs_1280_colors() {
    let fan = Incidence::from_constraints(1281, (1u32..1281).map(|i| [0, i])).unwrap();
    for by in ORDERS {
        assert_eq!(greedy(&fan, by).color_count(), 1280);
    }
    assert_eq!(auto(&fan).coloring.color_count(), 1280);
}

/// 26 is the best known for twelve cubes a side, the bound is 24.
#[test]
fn lattices_come_close_to_the_best_known() {
    let incidence = kuhn(12);
    let result = auto(&incidence);
    result.coloring.verify_incidence(&incidence).unwrap();
    assert_eq!(result.bound, 24);
    assert!(result.coloring.color_count() <= 28);
    assert!(
        auto(&ConstraintGraph::from_incidence(&incidence))
            .coloring
            .color_count()
            <= 28
    );
}

#[test]
fn a_search_repeats_itself_and_a_seed_changes_it() {
    let incidence = kuhn(4);
    let start = greedy(&incidence, Order::Natural);
    let after = |seed| {
        let mut coloring = start.clone();
        let passes = iterated_greedy(&incidence, &mut coloring, 3, 0, seed);
        let steps = tabu(&incidence, &mut coloring, 0, 500, seed);
        (coloring, passes, steps)
    };
    assert_eq!(after(1), after(1));
    assert_ne!(after(1).0, after(2).0);
    let shuffled = |seed| order(&incidence, Order::Random(seed));
    assert_eq!(shuffled(1), shuffled(1));
    assert_ne!(shuffled(1), shuffled(2));
}

proptest! {
    #[test]
    fn orders_keep_their_word(graph in erdos_renyi(40)) {
        is_smallest_last(&graph, &order(&graph, Order::SmallestLast));
        is_maximum_cardinality(&graph, &order(&graph, Order::MaximumCardinality));
        let keys = priorities(&graph);
        let largest = order(&graph, Order::LargestFirst);
        prop_assert!(largest.is_sorted_by_key(|&v| std::cmp::Reverse(keys[v as usize])));
        let degree_bound = graph.degree_bound();
        let crowded = order(&graph, Order::DegreeBound);
        prop_assert!(crowded.is_sorted_by_key(|&v| (std::cmp::Reverse(degree_bound[v as usize]), v)));
    }

    #[test]
    fn dsatur_by_definition(graph in erdos_renyi(40)) {
        prop_assert_eq!(indices(&dsatur(&graph)), slow_dsatur(&graph));
    }

    #[test]
    fn random_graphs(graph in erdos_renyi(60)) {
        check(&graph);
    }

    #[test]
    fn incidence_gives_what_its_graph_gives(incidence in constraints(80), seed: u64) {
        check(&incidence);
        let graph = ConstraintGraph::from_incidence(&incidence);
        prop_assert_eq!(incidence.degrees(), graph.degrees());
        let some: Vec<u32> = order(&graph, Order::Random(seed)).into_iter().step_by(2).collect();
        prop_assert_eq!(incidence.first_fit(&some), graph.first_fit(&some));
        for by in ORDERS.into_iter().filter(|&by| by != Order::DegreeBound) {
            prop_assert_eq!(greedy(&incidence, by), greedy(&graph, by));
        }
        prop_assert_eq!(dsatur(&incidence), dsatur(&graph));
        let mut one = greedy(&graph, Order::Natural);
        let mut other = one.clone();
        let passes = iterated_greedy(&graph, &mut one, 4, 1, seed);
        prop_assert_eq!(passes, iterated_greedy(&incidence, &mut other, 4, 1, seed));
        let steps = tabu(&graph, &mut one, 1, 100, seed);
        prop_assert_eq!(steps, tabu(&incidence, &mut other, 1, 100, seed));
        prop_assert_eq!(one, other);
    }
}
