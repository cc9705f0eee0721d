//! Colorings on the device equal those of the CPU, for any graph.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use std::num::NonZeroUsize;
use std::sync::{Mutex, MutexGuard, PoisonError};

use incise_clustering::{greedy_k_neighbor, serial_neighbor_incidence};
use incise_coloring::{Tie, VivaceOptions};
use incise_gpu::coloring::{
    ColoringKernels, DeviceColoring, DeviceGraph, DeviceIncidence, ecl_gc, jones_plassmann, scgc,
    scgc_incidence, vivace, wlc,
};
use incise_gpu::{GpuContext, GpuError};
use incise_graph::{Coloring, ConstraintGraph, Incidence};
use incise_mesh::glam::DVec3;
use incise_mesh::kuhn_box;
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

use crate::support::gpu;

static KERNELS: Mutex<Option<ColoringKernels>> = Mutex::new(None);

/// The kernels that all tests share, since compiling them is what takes time. One test at a time, too: devices run
/// kernels one after the other anyway, and counts of traffic mean something. Work arrays contain data of the test
/// before, which must not matter.
fn kernels() -> MutexGuard<'static, Option<ColoringKernels>> {
    let mut kernels = KERNELS.lock().unwrap_or_else(PoisonError::into_inner);
    kernels.get_or_insert_default();
    kernels
}

type OnGraph =
    fn(&GpuContext, &mut ColoringKernels, &DeviceGraph) -> Result<DeviceColoring, GpuError>;

/// Those that give what sequential coloring, largest first, gives.
const LARGEST_FIRST: [(&str, OnGraph); 3] = [
    ("jones_plassmann", jones_plassmann),
    ("ecl_gc", ecl_gc),
    ("scgc", scgc),
];

/// Bytes of the options of an algorithm, all that a coloring may upload.
const OPTIONS: u64 = 16;

/// The device's coloring, which says of itself what it is.
fn read(name: &str, gpu: &GpuContext, coloring: &DeviceColoring) -> Coloring {
    let read = coloring.read(gpu).unwrap();
    assert_eq!(coloring.vertex_count(), read.vertex_count(), "{name}");
    assert_eq!(coloring.color_count(), read.color_count(), "{name}");
    assert_eq!(coloring.color_count(), read.distinct_colors(), "{name}");
    let rounds = coloring.rounds();
    assert_eq!(rounds == 0, read.vertex_count() == 0, "{name}: {rounds}");
    read
}

/// Reads the device's coloring and proves it proper.
fn checked(
    name: &str,
    gpu: &GpuContext,
    graph: &ConstraintGraph,
    coloring: &DeviceColoring,
) -> Coloring {
    let read = read(name, gpu, coloring);
    if let Err(error) = read.verify(graph) {
        panic!("{name}: {error}");
    }
    read
}

/// Checks the algorithms whose colors do not depend on the order of threads within a round.
fn check_largest_first(gpu: &GpuContext, kernels: &mut ColoringKernels, graph: &ConstraintGraph) {
    let expected = [
        incise_coloring::jones_plassmann(graph).coloring,
        incise_coloring::ecl_gc(graph).coloring,
        incise_coloring::scgc(graph).coloring,
    ];
    let device = DeviceGraph::new(gpu, graph).unwrap();
    assert_eq!(device.vertex_count(), graph.vertex_count());
    for ((name, color), expected) in LARGEST_FIRST.into_iter().zip(expected) {
        let before = gpu.traffic();
        let coloring = color(gpu, kernels, &device).unwrap();
        assert_eq!(gpu.traffic().since(before).uploaded_bytes, 0, "{name}");
        assert_eq!(checked(name, gpu, graph, &coloring), expected, "{name}");
    }
}

/// Shrinking factor, seed and tie rule.
const VIVACE: [(u32, u64, Tie); 3] = [
    (1, 0, Tie::HighestOfSame),
    (4, 0x0123_4567_89ab_cdef, Tie::HighestOfSame),
    (2, 0xfedc_ba98_7654_3210, Tie::HighestOfAll),
];

fn check_vivace(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &ConstraintGraph,
    choices: &[(u32, u64, Tie)],
) {
    let device = DeviceGraph::new(gpu, graph).unwrap();
    for &(shrinking, seed, tie) in choices {
        let options = VivaceOptions {
            shrinking,
            seed,
            tie,
            ..VivaceOptions::default()
        };
        let twin = incise_coloring::vivace(graph, options).unwrap();
        let before = gpu.traffic();
        let coloring = vivace(gpu, kernels, &device, options).unwrap();
        assert!(gpu.traffic().since(before).uploaded_bytes <= OPTIONS);
        let found = checked("vivace", gpu, graph, &coloring);
        assert_eq!(found, twin.coloring, "{options:?}");
        assert_eq!(coloring.rounds(), twin.stats.rounds, "{options:?}");
    }
}

fn check_wlc(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &ConstraintGraph,
    chunks: &[usize],
) {
    let device = DeviceGraph::new(gpu, graph).unwrap();
    for &chunk in chunks {
        let chunk = NonZeroUsize::new(chunk).unwrap();
        let twin = incise_coloring::wlc(graph, chunk);
        let before = gpu.traffic();
        let coloring = wlc(gpu, kernels, &device, chunk).unwrap();
        assert!(gpu.traffic().since(before).uploaded_bytes <= OPTIONS);
        let found = checked("wlc", gpu, graph, &coloring);
        assert_eq!(found, twin.coloring, "chunk {chunk}");
        assert_eq!(coloring.rounds(), twin.stats.rounds, "chunk {chunk}");
    }
}

/// All algorithms on one graph.
fn check(gpu: &GpuContext, graph: &ConstraintGraph) {
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    check_largest_first(gpu, kernels, graph);
    check_vivace(gpu, kernels, graph, &VIVACE);
    check_wlc(gpu, kernels, graph, &[50, 2048, usize::MAX]);
}

fn check_incidence(gpu: &GpuContext, incidence: &Incidence) {
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    let expected = incise_coloring::scgc(incidence).coloring;
    let device = DeviceIncidence::new(gpu, incidence).unwrap();
    assert_eq!(device.constraint_count(), incidence.constraint_count());
    assert_eq!(device.particle_count(), incidence.particle_count());
    let before = gpu.traffic();
    let coloring = scgc_incidence(gpu, kernels, &device).unwrap();
    assert_eq!(gpu.traffic().since(before).uploaded_bytes, 0);
    let found = read("scgc_incidence", gpu, &coloring);
    found.verify_incidence(incidence).unwrap();
    assert_eq!(found, expected);
}

/// Everything, from incidence and from its graph.
fn check_both(gpu: &GpuContext, incidence: &Incidence) {
    check_incidence(gpu, incidence);
    check(gpu, &ConstraintGraph::from_incidence(incidence));
}

/// So many constraints on one particle: each one adjacent to all others.
fn fan(n: u32) -> Incidence {
    Incidence::from_constraints(1, (0..n).map(|_| [0u32])).unwrap()
}

/// Springs in a row.
fn springs(n: u32) -> Incidence {
    Incidence::from_constraints(n as usize + 1, (0..n).map(|i| [i, i + 1])).unwrap()
}

/// The tets of a box.
fn tets(cells: [usize; 3]) -> Incidence {
    let mesh = kuhn_box(cells, DVec3::ONE);
    let tets = mesh.tets.iter().map(|tet| tet.map(|p| p.0));
    Incidence::from_constraints(mesh.positions.len(), tets).unwrap()
}

/// Star graphs with the given numbers of leaves.
fn stars(count: u32, leaves: u32) -> ConstraintGraph {
    let star = |s: u32| (1..=leaves).map(move |leaf| (s * (leaves + 1), s * (leaves + 1) + leaf));
    let edges: Vec<(u32, u32)> = (0..count).flat_map(star).collect();
    ConstraintGraph::from_edges((count * (leaves + 1)) as usize, &edges).unwrap()
}

/// A clique of which each vertex has a neighbor of its own.
fn thorny(n: u32) -> ConstraintGraph {
    let pairs = (0..n).flat_map(|b| (0..b).map(move |a| (a, b)));
    let edges: Vec<_> = pairs.chain((0..n).map(|v| (v, n + v))).collect();
    ConstraintGraph::from_edges(2 * n as usize, &edges).unwrap()
}

/// Each pair an edge with the same chance, from none to all.
fn random_graph() -> impl Strategy<Value = ConstraintGraph> {
    (0u32..90, 0.0f64..1.0).prop_flat_map(|(n, density)| {
        let pairs: Vec<(u32, u32)> = (0..n).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        vec(0.0f64..1.0, pairs.len()).prop_map(move |draws| {
            let chosen = pairs
                .iter()
                .zip(&draws)
                .filter(|(_, draw)| **draw < density);
            let edges: Vec<_> = chosen.map(|(pair, _)| *pair).collect();
            ConstraintGraph::from_edges(n as usize, &edges).unwrap()
        })
    })
}

/// Constraints of zero to five particles each; few particles, so that some are crowded, or many.
fn random_incidence() -> impl Strategy<Value = Incidence> {
    (1u32..60).prop_flat_map(|particles| {
        let one =
            btree_set(0..particles, 0..=5usize.min(particles as usize)).prop_map(Vec::from_iter);
        vec(one, 0..200).prop_map(move |constraints| {
            Incidence::from_constraints(particles as usize, constraints).unwrap()
        })
    })
}

#[test]
fn sizes_around_workgroups() {
    let Some(gpu) = gpu("sizes_around_workgroups") else {
        return;
    };
    for n in [0, 1, 63, 64, 65, 255, 256, 257] {
        check_both(gpu, &springs(n));
    }
    for n in [0, 1, 65] {
        // No conflicts: no particles, and no edges.
        let lonely = Incidence::from_constraints(0, (0..n).map(|_| [0u32; 0])).unwrap();
        check_both(gpu, &lonely);
    }
}

#[test]
fn cliques_need_all_colors() {
    let Some(gpu) = gpu("cliques_need_all_colors") else {
        return;
    };
    for n in [31, 32, 33, 63, 64, 65, 129, 360] {
        check_both(gpu, &fan(n));
    }
}

#[test]
fn degrees_have_no_limit() {
    let Some(gpu) = gpu("degrees_have_no_limit") else {
        return;
    };
    check(gpu, &stars(1, 1280));
    // Centers on both sides of ECL-GC's threshold.
    for leaves in [30, 31, 32, 33] {
        check(gpu, &stars(3, leaves));
    }
    // Colors beyond the palettes of small neighbors.
    for n in [33, 66] {
        check(gpu, &thorny(n));
    }
    // One constraint on many particles, each with another constraint.
    let center = std::iter::once((0..1280u32).collect());
    let star = center.chain((0..1280u32).map(|p| vec![p]));
    check_incidence(gpu, &Incidence::from_constraints(1280, star).unwrap());
}

#[test]
fn worklists_pass_two_to_the_sixteen() {
    let Some(gpu) = gpu("worklists_pass_two_to_the_sixteen") else {
        return;
    };
    let springs = springs(65_537);
    check_incidence(gpu, &springs);
    let graph = ConstraintGraph::from_incidence(&springs);
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    check_largest_first(gpu, kernels, &graph);
    // Palettes of one color take a round for every other vertex of a path whose numbers ascend.
    check_vivace(gpu, kernels, &graph, &[VIVACE[0], VIVACE[2]]);
    check_wlc(gpu, kernels, &graph, &[8192, usize::MAX]);
}

/// More workgroups than fit into one row of a grid, from the host and from the device.
#[test]
fn grids_have_several_rows() {
    let Some(gpu) = gpu("grids_have_several_rows") else {
        return;
    };
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    let vertices = 65_535 * 64 + 65;
    // The last vertices wait for others.
    let last = u32::try_from(vertices).unwrap() - 1;
    let edges = [(last, 0), (last - 1, last), (last - 2, last), (1, 2)];
    let graph = ConstraintGraph::from_edges(vertices, &edges).unwrap();
    let device = DeviceGraph::new(gpu, &graph).unwrap();
    let expected = incise_coloring::jones_plassmann(&graph).coloring;
    for (name, color) in LARGEST_FIRST {
        let coloring = color(gpu, kernels, &device).unwrap();
        assert_eq!(checked(name, gpu, &graph, &coloring), expected, "{name}");
    }
}

#[test]
fn tets_clustered_or_not() {
    let Some(gpu) = gpu("tets_clustered_or_not") else {
        return;
    };
    for cells in [[1, 1, 1], [6, 5, 4]] {
        let tets = tets(cells);
        check_both(gpu, &tets);
        for size in [2, 5, 64] {
            let size = NonZeroUsize::new(size).unwrap();
            for clustering in [
                serial_neighbor_incidence(&tets, size),
                greedy_k_neighbor(&tets, size),
            ] {
                check_both(gpu, &tets.quotient(&clustering));
                let graph = ConstraintGraph::from_incidence(&tets);
                check(gpu, &graph.quotient(&clustering));
            }
        }
    }
}

#[test]
fn one_vertex_a_time_is_sequential() {
    let Some(gpu) = gpu("one_vertex_a_time_is_sequential") else {
        return;
    };
    let graph = ConstraintGraph::from_incidence(&tets([2, 2, 2]));
    let mut kernels = kernels();
    check_wlc(gpu, kernels.as_mut().unwrap(), &graph, &[1]);
}

#[test]
fn too_few_rounds_are_an_error() {
    let Some(gpu) = gpu("too_few_rounds_are_an_error") else {
        return;
    };
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    let graph = ConstraintGraph::from_incidence(&tets([3, 3, 3]));
    let device = DeviceGraph::new(gpu, &graph).unwrap();
    let needed = incise_coloring::vivace(&graph, VivaceOptions::default()).unwrap();
    let needed = needed.stats.rounds;
    for max_rounds in [0, needed - 1, needed] {
        let options = VivaceOptions {
            max_rounds,
            ..VivaceOptions::default()
        };
        let result = vivace(gpu, kernels, &device, options);
        if max_rounds == needed {
            assert_eq!(result.unwrap().rounds(), needed);
        } else {
            let stalled = GpuError::Stalled {
                algorithm: "vivace",
                rounds: max_rounds,
            };
            assert_eq!(result.unwrap_err(), stalled);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn random_graphs(graph in random_graph()) {
        if let Some(gpu) = gpu("random_graphs") {
            check(gpu, &graph);
        }
    }

    #[test]
    fn random_constraints(incidence in random_incidence()) {
        if let Some(gpu) = gpu("random_constraints") {
            check_both(gpu, &incidence);
        }
    }
}
