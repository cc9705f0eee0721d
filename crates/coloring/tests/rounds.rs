//! A slow model of Algorithm 1 that recomputes every palette in every round, to hold claims about
//! the shortcuts.

use std::collections::BTreeSet;

use incise_coloring::{Order, greedy, priorities, scgc};
use incise_graph::ConstraintGraph;
use proptest::prelude::*;

use crate::generators::{erdos_renyi, kuhn};

/// Colors and rounds of Jones-Plassmann with shortcut 1 if `one` and shortcut 3 if `three`, all
/// tests on the palettes of the round's start: {0, ..., number of higher neighbors} less the colors
/// of decided higher neighbors.
///
/// Asserts at every undecided vertex of every round that shortcut 3 implies shortcut 1.
fn model(graph: &ConstraintGraph, one: bool, three: bool) -> (Vec<usize>, usize) {
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
    let mut rounds = 0;
    while colors.contains(&None) {
        rounds += 1;
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
            let shortcut1 = waiting().all(|&u| !palettes[u].contains(&best));
            let shortcut3 = waiting().all(|&u| best < *palettes[u].first().unwrap());
            assert!(
                shortcut1 || !shortcut3,
                "shortcut 3 found what shortcut 1 missed"
            );
            if waiting().next().is_none() || (one && shortcut1) || (three && shortcut3) {
                colors[v] = Some(best);
            }
        }
    }
    (colors.into_iter().map(Option::unwrap).collect(), rounds)
}

fn compare(graph: &ConstraintGraph) {
    let oracle: Vec<usize> = greedy(graph, Order::LargestFirst)
        .colors()
        .iter()
        .map(|color| color.index())
        .collect();
    let [plain, three, one, both] = [(false, false), (false, true), (true, false), (true, true)]
        .map(|(one, three)| {
            let (colors, rounds) = model(graph, one, three);
            assert_eq!(colors, oracle, "shortcuts change rounds, never colors");
            rounds
        });
    assert_eq!(one, both, "shortcut 3 saves no round beside shortcut 1");
    assert!(one <= three && three <= plain);
    // The shipped rounds also have shortcut 2, which can only make palettes smaller.
    assert!(scgc(graph).stats.rounds <= one);
}

#[test]
fn lattice() {
    compare(&ConstraintGraph::from_incidence(&kuhn(3)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_graphs(graph in erdos_renyi(50)) {
        compare(&graph);
    }
}
