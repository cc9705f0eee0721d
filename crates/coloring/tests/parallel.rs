//! The parallel algorithms: the deterministic ones equal sequential greedy whatever their shortcuts, threads and input;
//! the others are proper and repeatable.

use std::num::NonZeroUsize;

use incise_coloring::{
    ColoringError, Conflicts, Order, Shortcuts, Tie, VivaceOptions, ecl_gc, greedy,
    jones_plassmann, scgc, scgc_with, vivace, wlc,
};
use incise_graph::{Coloring, ConstraintGraph, Incidence};
use proptest::prelude::*;

use crate::generators::{bipartite, clique, constraints, erdos_renyi, golden, kuhn, path};

fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(run)
}

fn options(shrinking: u32, seed: u64, tie: Tie) -> VivaceOptions {
    VivaceOptions {
        shrinking,
        seed,
        tie,
        ..VivaceOptions::default()
    }
}

fn chunk(size: usize) -> NonZeroUsize {
    NonZeroUsize::new(size).unwrap()
}

/// All that a proper coloring without gaps must be.
fn is_good(graph: &ConstraintGraph, coloring: &Coloring) {
    coloring.verify(graph).unwrap();
    assert_eq!(coloring.color_count(), coloring.distinct_colors());
    assert!(coloring.color_count() <= graph.max_degree() + 1);
}

fn check(conflicts: &impl Conflicts) {
    let graph = conflicts.graph();
    let oracle = greedy(conflicts, Order::LargestFirst);
    let mut rounds = Vec::new();
    for shortcuts in Shortcuts::COMBINATIONS {
        let result = scgc_with(conflicts, shortcuts);
        assert_eq!(result.coloring, oracle, "{shortcuts:?}");
        let stats = result.stats;
        let counted = stats.dependency_free + stats.shortcut1 + stats.shortcut2 + stats.shortcut3;
        assert_eq!(counted, graph.vertex_count());
        assert!(shortcuts.one || stats.shortcut1 == 0);
        assert!(shortcuts.two || stats.shortcut2 + stats.removed_edges == 0);
        assert!(shortcuts.three || stats.shortcut3 == 0);
        rounds.push(stats.rounds);
    }
    // In the order of the combinations: bit 0 is shortcut 1, bit 2 shortcut 3.
    assert_eq!(
        rounds[0b001], rounds[0b101],
        "shortcut 3 saves no round beside shortcut 1"
    );
    assert_eq!(rounds[0b011], rounds[0b111], "nor beside shortcuts 1 and 2");
    assert!(rounds[0b001] <= rounds[0b100] && rounds[0b100] <= rounds[0b000]);
    assert_eq!(jones_plassmann(conflicts).stats.rounds, rounds[0]);

    assert_eq!(ecl_gc(conflicts).coloring, oracle);
    for shrinking in [1, 2, 4, 1000] {
        for tie in [Tie::HighestOfSame, Tie::HighestOfAll] {
            let result = vivace(conflicts, options(shrinking, 5, tie)).unwrap();
            is_good(&graph, &result.coloring);
            assert!(result.stats.labels <= graph.max_degree() + 1);
            assert!(result.stats.labels >= result.coloring.color_count());
        }
    }
    assert_eq!(
        wlc(conflicts, chunk(1)).coloring,
        greedy(conflicts, Order::Natural)
    );
    for size in [2, 31, 2048, usize::MAX] {
        is_good(&graph, &wlc(conflicts, chunk(size)).coloring);
    }
}

#[test]
fn families() {
    check(&path(0));
    check(&ConstraintGraph::from_edges(500, &[]).unwrap());
    check(&path(700));
    for n in [1, 2, 31, 32, 33, 34, 63, 64, 65, 127, 128, 129, 130, 360] {
        check(&clique(n));
    }
    for (left, right) in [
        (1, 1),
        (1, 31),
        (1, 32),
        (1, 33),
        (1, 5000),
        (32, 33),
        (70, 90),
    ] {
        check(&bipartite(left, right));
    }
}

/// Parts of different degrees side by side, on both sides of the 32 at which ECL-GC splits.
#[test]
fn disconnected_parts_around_the_split() {
    let mut edges = Vec::new();
    let mut first = 0;
    for size in [1, 5, 31, 32, 33, 34, 60] {
        edges.extend((0..size).flat_map(|b| (0..b).map(move |a| (first + a, first + b))));
        first += size;
    }
    // A vertex of the largest part sees all others.
    edges.extend((0..first - 60).map(|v| (v, first - 1)));
    let graph = ConstraintGraph::from_edges(first as usize + 3, &edges).unwrap();
    check(&graph);
    let stats = ecl_gc(&graph).stats;
    assert!(stats.large_rounds > 0 && stats.small_rounds > 0);
}

#[test]
fn lattices() {
    for n in [1, 2, 4] {
        let incidence = kuhn(n);
        check(&incidence);
        check(&ConstraintGraph::from_incidence(&incidence));
    }
}

/// Where vertices are large, ECL-GC's interval test is shortcut 3: as many passes as it alone.
#[test]
fn the_interval_test_is_shortcut_three() {
    let graph = ConstraintGraph::from_incidence(&kuhn(6));
    let three = Shortcuts {
        three: true,
        ..Shortcuts::NONE
    };
    let alone = scgc_with(&graph, three).stats;
    let all = scgc(&graph).stats;
    let none = jones_plassmann(&graph).stats;
    assert!(all.rounds <= alone.rounds && alone.rounds < none.rounds);
    // The guard against a best color that moved costs ECL-GC a pass now and then.
    let large = ecl_gc(&graph).stats.large_rounds;
    assert!(
        alone.rounds <= large + 1 && large <= 2 * alone.rounds,
        "{large}"
    );
}

#[test]
fn threads_and_input_change_nothing() {
    let incidence = kuhn(9);
    let graph = ConstraintGraph::from_incidence(&incidence);
    let run = || {
        (
            Shortcuts::COMBINATIONS.map(|shortcuts| scgc_with(&graph, shortcuts)),
            jones_plassmann(&graph),
            ecl_gc(&graph),
            vivace(&graph, options(2, 9, Tie::HighestOfSame)).unwrap(),
            wlc(&graph, chunk(500)),
        )
    };
    let one = with_threads(1, run);
    for threads in [2, 3] {
        assert_eq!(with_threads(threads, run), one);
    }
    let from_incidence = |shortcuts| scgc_with(&incidence, shortcuts);
    assert_eq!(Shortcuts::COMBINATIONS.map(from_incidence), one.0);
    assert_eq!(jones_plassmann(&incidence), one.1);
    assert_eq!(ecl_gc(&incidence), one.2);
    assert_eq!(
        vivace(&incidence, options(2, 9, Tie::HighestOfSame)).unwrap(),
        one.3
    );
    assert_eq!(wlc(&incidence, chunk(500)), one.4);
}

/// Colors are part of the contract: a change of hash, draw or rule shows here.
#[test]
fn golden_hashes() {
    let graph = ConstraintGraph::from_incidence(&kuhn(6));
    let random = |shrinking, tie| {
        let result = vivace(&graph, options(shrinking, 42, tie)).unwrap();
        (result.coloring.color_count(), golden(&result.coloring))
    };
    let speculative = wlc(&graph, chunk(256)).coloring;
    assert_eq!(
        [
            random(1, Tie::HighestOfSame),
            random(4, Tie::HighestOfAll),
            (speculative.color_count(), golden(&speculative)),
        ],
        [
            (71, 1_875_300_665_919_296_404),
            (33, 7_105_074_515_219_873_475),
            (34, 11_244_840_884_543_282_536),
        ]
    );
}

/// In lock step a clique keeps one vertex a round; the chunk shrinks, which bounds the number of rounds.
#[test]
fn speculation_on_a_clique_ends_soon() {
    let result = wlc(&clique(1500), NonZeroUsize::MAX);
    assert_eq!(result.coloring.color_count(), 1500);
    assert!(result.stats.rounds <= 25, "{} rounds", result.stats.rounds);
}

#[test]
fn seeds_differ_and_rounds_are_limited() {
    let graph = ConstraintGraph::from_incidence(&kuhn(3));
    let colors = |seed| {
        vivace(&graph, options(1, seed, Tie::HighestOfSame))
            .unwrap()
            .coloring
    };
    assert_eq!(colors(1), colors(1));
    assert_ne!(colors(1), colors(2));
    let limited = VivaceOptions {
        max_rounds: 2,
        ..VivaceOptions::default()
    };
    let error = vivace(&clique(20), limited).unwrap_err();
    assert!(
        matches!(error, ColoringError::TooManyRounds { rounds: 2, .. }),
        "{error}"
    );
}

proptest! {
    #[test]
    fn random_graphs(graph in erdos_renyi(70)) {
        check(&graph);
    }

    #[test]
    fn random_constraints(incidence in constraints(90)) {
        check(&incidence);
        let graph = ConstraintGraph::from_incidence(&incidence);
        for shortcuts in Shortcuts::COMBINATIONS {
            prop_assert_eq!(scgc_with(&incidence, shortcuts), scgc_with(&graph, shortcuts));
        }
        prop_assert_eq!(ecl_gc(&incidence), ecl_gc(&graph));
    }
}

/// Incidence describes a graph, also with particles that no constraint touches.
#[test]
fn lonely_constraints_and_particles() {
    check(&Incidence::from_constraints(9, [vec![], vec![3u32], vec![], vec![3, 5]]).unwrap());
    check(&Incidence::from_constraints(0, [[0u32; 0]; 0]).unwrap());
}
