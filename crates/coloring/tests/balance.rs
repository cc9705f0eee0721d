//! Balancing keeps a coloring proper and its colors, ends where no simple exchange helps, and is even where that is
//! possible.

use std::collections::BTreeSet;

use incise_coloring::{BalanceStats, Conflicts, Order, balance, greedy};
use incise_graph::{
    ClusterId, Clustering, ColorId, Coloring, ColoringMetrics, ConstraintGraph, Incidence,
};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

use crate::generators::{bipartite, clique, erdos_renyi, kuhn, path};

const ORDERS: [Order; 4] = [
    Order::Random(7),
    Order::LargestFirst,
    Order::SmallestLast,
    Order::MaximumCardinality,
];

fn coloring(colors: &[u32]) -> Coloring {
    Coloring::new(colors.iter().copied().map(ColorId).collect())
}

/// The colors that carry weight, with their loads.
fn loads(coloring: &Coloring, weights: &[u32]) -> Vec<(ColorId, u64)> {
    let mut loads = vec![0; coloring.color_count()];
    for (color, &weight) in coloring.colors().iter().zip(weights) {
        loads[color.index()] += u64::from(weight);
    }
    let all = (0..).map(ColorId).zip(loads);
    all.filter(|(_, load)| *load > 0).collect()
}

/// The vertices of two colors reached from `v` by edges between them.
fn component(
    graph: &ConstraintGraph,
    coloring: &Coloring,
    v: u32,
    other: ColorId,
) -> BTreeSet<u32> {
    let colors = [coloring.color(v as usize), other];
    let mut reached = BTreeSet::from([v]);
    let mut open = vec![v];
    while let Some(v) = open.pop() {
        for &u in graph.neighbors(v as usize) {
            if colors.contains(&coloring.color(u as usize)) && reached.insert(u) {
                open.push(u);
            }
        }
    }
    reached
}

/// No single vertex and no single component of two colors can change color and lower the sum of
/// squares. By the definition, one at a time.
fn assert_settled(graph: &ConstraintGraph, coloring: &Coloring, weights: &[u32]) {
    let loads = loads(coloring, weights);
    let load = |color| loads.iter().find(|(other, _)| *other == color).unwrap().1;
    for v in (0..).take(graph.vertex_count()) {
        let from = coloring.color(v as usize);
        if weights[v as usize] == 0 {
            continue;
        }
        for &(to, lighter) in loads.iter().filter(|(to, _)| *to != from) {
            let component = component(graph, coloring, v, to);
            let part = |color: ColorId| -> u64 {
                let members = component
                    .iter()
                    .filter(|&&u| coloring.color(u as usize) == color);
                members.map(|&u| u64::from(weights[u as usize])).sum()
            };
            let (given, taken) = (part(from), part(to));
            let helps = given > taken && lighter + given < load(from) + taken;
            assert!(!helps, "exchanging {from} and {to} in {component:?} helps");
        }
    }
}

/// Balances, and asserts what holds for any input. `conflicts` are those of `graph`.
fn check(
    conflicts: &impl Conflicts,
    graph: &ConstraintGraph,
    before: &Coloring,
    weights: &[u32],
) -> (Coloring, BalanceStats) {
    let mut after = before.clone();
    let stats = balance(conflicts, &mut after, weights);
    after.verify(graph).unwrap();
    let colors =
        |coloring: &Coloring| -> BTreeSet<ColorId> { coloring.colors().iter().copied().collect() };
    assert_eq!(colors(&after), colors(before), "the same colors are in use");
    let range = |coloring: &Coloring| {
        let loads = loads(coloring, weights);
        let max = loads.iter().map(|(_, load)| load).max();
        max.map_or(0, |max| {
            max - loads.iter().map(|(_, load)| load).min().unwrap()
        })
    };
    assert_eq!(
        (stats.range_before, stats.range),
        (range(before), range(&after))
    );
    let changed = before
        .colors()
        .iter()
        .zip(after.colors())
        .filter(|(a, b)| a != b);
    assert_eq!(stats.changed, changed.count());
    let metrics = |coloring| ColoringMetrics::by_weights(coloring, weights);
    assert!(metrics(&after).chi2 <= metrics(before).chi2);
    assert!(stats.changed == 0 || metrics(&after).chi2 < metrics(before).chi2);
    (after, stats)
}

/// Balances from incidence and from its graph, and asserts equal results.
fn check_both(incidence: &Incidence, before: &Coloring, weights: &[u32]) -> BalanceStats {
    let graph = ConstraintGraph::from_incidence(incidence);
    let result = check(incidence, &graph, before, weights);
    assert_eq!(check(&graph, &graph, before, weights), result);
    result.1
}

#[test]
fn nothing_to_do() {
    let none = ConstraintGraph::from_edges(0, &[]).unwrap();
    let (_, stats) = check(&none, &none, &Coloring::default(), &[]);
    assert_eq!(stats, BalanceStats::default());
    let edgeless = ConstraintGraph::from_edges(5, &[]).unwrap();
    assert_eq!(
        check(&edgeless, &edgeless, &coloring(&[0; 5]), &[9; 5])
            .1
            .changed,
        0
    );
    assert_eq!(
        check(&edgeless, &edgeless, &coloring(&[3; 5]), &[9; 5])
            .1
            .changed,
        0
    );
    assert_eq!(
        check(&edgeless, &edgeless, &coloring(&[0, 0, 0, 0, 1]), &[0; 5])
            .1
            .changed,
        0
    );
    let clique = clique(65);
    let before = greedy(&clique, Order::LargestFirst);
    assert_eq!(check(&clique, &clique, &before, &[1; 65]).1.changed, 0);
}

#[test]
fn edgeless_vertices_spread_at_once() {
    let edgeless = ConstraintGraph::from_edges(1000, &[]).unwrap();
    let before = Coloring::new(
        (0..1000)
            .map(|v| ColorId(v % 7 * u32::from(v < 20)))
            .collect(),
    );
    let (_, stats) = check(&edgeless, &edgeless, &before, &[1; 1000]);
    assert_eq!((stats.range, stats.chains, stats.flips), (1, 0, 0));
}

/// One color each for the members of a clique, all other vertices take the first color.
#[test]
fn any_number_of_colors() {
    for colors in [2, 31, 32, 33, 63, 64, 65, 127, 128, 129, 200] {
        let constraints = (0..4 * colors).map(|v| if v < colors { vec![0u32] } else { vec![] });
        let incidence = Incidence::from_constraints(1, constraints).unwrap();
        let before = greedy(&incidence, Order::LargestFirst);
        assert_eq!(before.color_count(), colors as usize);
        let weights = vec![1; 4 * colors as usize];
        assert_eq!(check_both(&incidence, &before, &weights).range, 0);
    }
}

/// Cliques of sizes 1 to 9, twelve of each.
#[test]
fn disjoint_cliques_become_even() {
    let members = (0..108u32).flat_map(|clique| (0..=clique % 9).map(move |_| [clique]));
    let incidence = Incidence::from_constraints(108, members).unwrap();
    for order in ORDERS {
        let before = greedy(&incidence, order);
        assert_eq!(before.color_count(), 9);
        let stats = check_both(&incidence, &before, &[1; 540]);
        assert_eq!((stats.range_before, stats.range), (96, 0));
    }
}

/// Blocks of consecutive tets stand for clusters. In small lattices they leave too few vertices per
/// color for any promise.
#[test]
fn lattices_become_even() {
    for (n, size) in [(1, 1), (2, 1), (3, 1), (6, 1), (6, 5), (6, 10)] {
        let lattice = kuhn(n);
        let labels = (0..lattice.constraint_count()).map(|c| ClusterId::new(c / size));
        let clustering = Clustering::from_labels(labels.collect()).unwrap();
        let clusters = lattice.quotient(&clustering);
        for order in ORDERS {
            let before = greedy(&clusters, order);
            let ones = vec![1; clusters.constraint_count()];
            let range = check_both(&clusters, &before, &ones).range;
            assert!(range <= 1, "{n} {size} {order:?}: {range}");
        }
    }
}

/// Classes of 1 and n, and no even coloring: every search must end without a change.
#[test]
fn stars_end_as_they_are() {
    for leaves in [2, 3, 64, 1000] {
        let star = bipartite(1, leaves);
        let before = greedy(&star, Order::LargestFirst);
        let stats = check(&star, &star, &before, &vec![1; leaves as usize + 1]).1;
        assert_eq!((stats.changed, stats.range), (0, u64::from(leaves) - 1));
    }
}

#[test]
fn paths_and_bipartite_graphs() {
    let path = path(1001);
    let before = greedy(&path, Order::Random(3));
    assert_eq!(check(&path, &path, &before, &[1; 1001]).1.range, 1);
    let uneven = bipartite(3, 9);
    let before = greedy(&uneven, Order::LargestFirst);
    assert_eq!(check(&uneven, &uneven, &before, &[1; 12]).1.range, 6);
}

/// Every vertex of the heavy class 0 has a neighbor in the light class 2, but 4 in class 1 has
/// none.
#[test]
fn a_chain_goes_around_a_block() {
    let graph = ConstraintGraph::from_edges(6, &[(0, 5), (1, 5), (2, 5), (3, 5)]).unwrap();
    let (after, stats) = check(&graph, &graph, &coloring(&[0, 0, 0, 1, 1, 2]), &[1; 6]);
    assert_eq!(
        (stats.moves, stats.chains, stats.flips, stats.range),
        (0, 1, 0, 0)
    );
    assert_eq!(after, coloring(&[1, 0, 0, 1, 2, 2]));
}

/// No vertex of class 0 can enter class 1 or 2, but vertex 0 has only one neighbor in class 1, and
/// that can enter class 2. Vertices 1 and 2 have two neighbors in class 1.
#[test]
fn a_detour_pushes_a_neighbor_on() {
    let block = [(0, 5), (1, 5), (2, 5), (4, 5)];
    let edges = [&block[..], &[(0, 3), (1, 3), (1, 4), (2, 3), (2, 4)]].concat();
    let graph = ConstraintGraph::from_edges(6, &edges).unwrap();
    let (after, stats) = check(&graph, &graph, &coloring(&[0, 0, 0, 1, 1, 2]), &[1; 6]);
    assert_eq!(
        (stats.moves, stats.chains, stats.flips, stats.range),
        (0, 1, 0, 0)
    );
    assert_eq!(after, coloring(&[1, 0, 0, 2, 1, 2]));
}

/// Two paths of three vertices with their centers in one class: one of them turns over.
#[test]
fn a_component_turns_over() {
    let graph = ConstraintGraph::from_edges(6, &[(0, 4), (1, 4), (2, 5), (3, 5)]).unwrap();
    let (_, stats) = check(&graph, &graph, &coloring(&[0, 0, 0, 0, 1, 1]), &[1; 6]);
    assert_eq!(
        (stats.moves, stats.chains, stats.flips, stats.range),
        (0, 0, 1, 0)
    );
    assert_eq!(stats.changed, 3);
}

#[test]
fn a_heavy_vertex_is_exchanged_for_a_lighter_one() {
    let graph = ConstraintGraph::from_edges(4, &[]).unwrap();
    let (_, stats) = check(&graph, &graph, &coloring(&[0, 0, 1, 1]), &[5, 5, 4, 4]);
    assert_eq!((stats.moves, stats.chains, stats.flips), (0, 0, 1));
    assert_eq!((stats.range, stats.changed), (0, 2));
}

/// The largest weights: sums leave 32 bits, squares 64.
#[test]
fn loads_do_not_overflow() {
    let graph = path(300);
    let before = greedy(&graph, Order::Natural);
    let weights: Vec<u32> = (0..300)
        .map(|v| u32::MAX - v * v % 1000 * (v % 2))
        .collect();
    let (after, stats) = check(&graph, &graph, &before, &weights);
    assert_settled(&graph, &after, &weights);
    assert!(stats.range <= stats.range_before);
}

/// Vacant clusters keep color 9. A color without vertices, such as 5, stays without.
#[test]
fn vacant_vertices_and_gaps_stay() {
    let constraints = (0..12u32).map(|v| if v < 10 { vec![v] } else { vec![] });
    let incidence = Incidence::from_constraints(10, constraints).unwrap();
    let mut colors = vec![0; 12];
    colors[3] = 7;
    colors[10] = 9;
    let weights: Vec<u32> = (0..12).map(|v| u32::from(v < 10)).collect();
    let before = coloring(&colors);
    let stats = check_both(&incidence, &before, &weights);
    assert_eq!((stats.range_before, stats.range, stats.changed), (8, 0, 4));
    let mut after = before.clone();
    balance(&incidence, &mut after, &weights);
    assert_eq!(after.colors()[10..], [9, 0].map(ColorId));
}

/// So many particles without constraints that bits for each of them would not pay.
#[test]
fn many_idle_particles_change_nothing() {
    let ends = || (0..40u32).map(|i| [i, (i * 7 + 1) % 40 + 40]);
    let few = Incidence::from_constraints(80, ends()).unwrap();
    let many = Incidence::from_constraints(100_000, ends()).unwrap();
    let before = Coloring::new(
        (0..40)
            .map(|v| ColorId(if v < 30 { 0 } else { v }))
            .collect(),
    );
    let weights: Vec<u32> = (0..40).map(|v| 1 + v % 4).collect();
    assert_eq!(
        check_both(&few, &before, &weights),
        check_both(&many, &before, &weights)
    );
}

#[test]
#[should_panic(expected = "one weight per vertex")]
fn weights_must_fit() {
    balance(&path(3), &mut coloring(&[0, 1, 0]), &[1; 2]);
}

#[test]
#[should_panic(expected = "one color per vertex")]
fn colors_must_fit() {
    balance(&path(3), &mut coloring(&[0, 1]), &[1; 3]);
}

/// Up to 60 constraints of up to 3 of 24 particles.
fn incidences() -> impl Strategy<Value = Incidence> {
    vec(btree_set(0u32..24, 0..=3).prop_map(Vec::from_iter), 0..60)
        .prop_map(|constraints| Incidence::from_constraints(24, constraints).unwrap())
}

fn orders() -> impl Strategy<Value = Order> {
    (0..ORDERS.len()).prop_map(|index| ORDERS[index])
}

proptest! {
    #[test]
    fn random_incidences(
        incidence in incidences(),
        order in orders(),
        unit in any::<bool>(),
        weights in vec(0u32..12, 60),
        gap in 1u32..3,
    ) {
        let weights: Vec<u32> = weights.into_iter().take(incidence.constraint_count()).map(|weight| if unit { 1 } else { weight }).collect();
        let before = greedy(&incidence, order);
        let before = Coloring::new(before.colors().iter().map(|color| ColorId(color.0 * gap)).collect());
        let graph = ConstraintGraph::from_incidence(&incidence);
        check_both(&incidence, &before, &weights);
        let (after, _) = check(&incidence, &graph, &before, &weights);
        assert_settled(&graph, &after, &weights);
    }

    #[test]
    fn random_graphs(graph in erdos_renyi(50), order in orders(), weights in vec(1u32..1000, 50), unit in any::<bool>()) {
        let weights: Vec<u32> = weights.into_iter().take(graph.vertex_count()).map(|weight| if unit { 1 } else { weight }).collect();
        let before = greedy(&graph, order);
        let (after, _) = check(&graph, &graph, &before, &weights);
        assert_settled(&graph, &after, &weights);
    }
}

/// The edges of a triangulated sheet, where six colors are as few as there can be: the search ends at its limit, and
/// further calls continue it.
#[test]
fn balancing_stops_at_its_limit_and_continues() {
    let side = 120u32;
    let mut springs = Vec::new();
    for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
        for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
            if x + dx < side && y + dy < side {
                springs.push([side * y + x, side * (y + dy) + x + dx]);
            }
        }
    }
    let incidence = Incidence::from_constraints((side * side) as usize, &springs).unwrap();
    let mut coloring = incise_coloring::auto(&incidence).coloring;
    let weights = vec![1; springs.len()];
    let first = balance(&incidence, &mut coloring, &weights);
    assert!(
        first.stopped && first.range < first.range_before / 2,
        "{first:?}"
    );
    let mut last = first;
    for _ in 0..20 {
        coloring.verify_incidence(&incidence).unwrap();
        if !last.stopped {
            break;
        }
        last = balance(&incidence, &mut coloring, &weights);
    }
    assert!(!last.stopped && last.range <= 1, "{last:?}");
}
