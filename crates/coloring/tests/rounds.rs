//! A slow model of Algorithm 1 that recomputes every palette in every round, to hold claims about
//! the shortcuts.

use std::collections::BTreeSet;

use incise_coloring::{Order, Shortcuts, greedy, priorities, scgc_with};
use incise_graph::ConstraintGraph;
use proptest::prelude::*;

use crate::generators::{clique, erdos_renyi, kuhn};

/// What the model finds: the color of every vertex, and the round that gave it, from 1.
struct Model {
    colors: Vec<usize>,
    rounds: Vec<usize>,
}

impl Model {
    fn round_count(&self) -> usize {
        self.rounds.iter().copied().max().unwrap_or(0)
    }
}

/// Jones-Plassmann with shortcut 1 if `one` and shortcut 3 if `three`, all tests on the palettes of
/// the round's start: {0, ..., number of higher neighbors} less the colors of decided higher
/// neighbors.
///
/// Asserts at every undecided vertex of every round that shortcut 3 implies shortcut 1, neighbor by
/// neighbor.
fn model(graph: &ConstraintGraph, one: bool, three: bool) -> Model {
    let ids: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    let rank = priorities(graph);
    let higher: Vec<Vec<usize>> = ids
        .iter()
        .map(|&v| {
            let above = |u: &&u32| rank[**u as usize] > rank[v as usize];
            graph
                .neighbors(v as usize)
                .iter()
                .filter(above)
                .map(|&u| u as usize)
                .collect()
        })
        .collect();
    let mut colors: Vec<Option<usize>> = vec![None; ids.len()];
    let mut rounds = vec![0; ids.len()];
    for round in 1.. {
        if !colors.contains(&None) {
            break;
        }
        let palettes: Vec<BTreeSet<usize>> = higher
            .iter()
            .map(|list| {
                let taken: BTreeSet<usize> = list.iter().filter_map(|&u| colors[u]).collect();
                (0..=list.len())
                    .filter(|color| !taken.contains(color))
                    .collect()
            })
            .collect();
        let snapshot = colors.clone();
        for (v, list) in higher
            .iter()
            .enumerate()
            .filter(|(v, _)| snapshot[*v].is_none())
        {
            let best = *palettes[v].first().unwrap();
            let waiting = || list.iter().filter(|&&u| snapshot[u].is_none());
            let shortcut1 = |u: &usize| !palettes[*u].contains(&best);
            let shortcut3 = |u: &usize| best < *palettes[*u].first().unwrap();
            let passes = |u: &usize| {
                assert!(
                    shortcut1(u) || !shortcut3(u),
                    "shortcut 3 found what shortcut 1 missed"
                );
                (one && shortcut1(u)) || (three && shortcut3(u))
            };
            if waiting().all(passes) {
                colors[v] = Some(best);
                rounds[v] = round;
            }
        }
    }
    Model {
        colors: colors.into_iter().map(Option::unwrap).collect(),
        rounds,
    }
}

fn compare(graph: &ConstraintGraph) {
    let oracle: Vec<usize> = greedy(graph, Order::LargestFirst)
        .colors()
        .iter()
        .map(|color| color.index())
        .collect();
    let run = |one, two, three| scgc_with(graph, Shortcuts { one, two, three }).stats;
    let [plain, three, one, both] = [(false, false), (false, true), (true, false), (true, true)]
        .map(|(one, three)| {
            let model = model(graph, one, three);
            assert_eq!(
                model.colors, oracle,
                "shortcuts change rounds, never colors"
            );
            let rounds = model.round_count();
            assert_eq!(run(one, false, three).rounds, rounds);
            // Shortcut 2 makes palettes smaller, which can only help.
            assert!(run(one, true, three).rounds <= rounds);
            if !one && !three {
                // Every edge is notified twice and found decided once; every other visit is that of a vertex that is
                // stopped, one in each round before its own.
                let waits: usize = model.rounds.iter().map(|round| round - 1).sum();
                let visits = 3 * graph.edge_count() + waits;
                assert_eq!(run(false, false, false).edge_visits, visits as u64);
            }
            rounds
        });
    assert_eq!(one, both, "shortcut 3 saves no round beside shortcut 1");
    assert!(one <= three && three <= plain);
    // Beside shortcut 1, with or without shortcut 2, shortcut 3 does not save a visit.
    for two in [false, true] {
        let [without, with] = [false, true].map(|three| run(true, two, three));
        assert_eq!(
            (without.rounds, without.edge_visits, without.removed_edges),
            (with.rounds, with.edge_visits, with.removed_edges)
        );
        assert_eq!(without.shortcut3, 0);
        assert_eq!(without.shortcut1, with.shortcut1 + with.shortcut3);
    }
}

#[test]
fn lattice() {
    compare(&ConstraintGraph::from_incidence(&kuhn(3)));
}

#[test]
fn rings_and_cliques() {
    for n in [31, 32, 33, 64, 65] {
        compare(&clique(n));
        let edges: Vec<_> = (0..n).map(|v| (v, (v + 1) % n)).collect();
        compare(&ConstraintGraph::from_edges(n as usize, &edges).unwrap());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_graphs(graph in erdos_renyi(50)) {
        compare(&graph);
    }
}
