//! Colorings on the device equal those of the CPU, whatever the graph.

use std::sync::{Mutex, MutexGuard, PoisonError};

use incise_gpu::coloring::{ColoringKernels, DeviceColoring, DeviceGraph, jones_plassmann, scgc};
use incise_gpu::{GpuContext, GpuError};
use incise_graph::{Coloring, ConstraintGraph, Incidence};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::support::gpu;

static KERNELS: Mutex<Option<ColoringKernels>> = Mutex::new(None);

/// The kernels that all tests share, since compiling them is what takes time. One test at a time, too: devices run
/// kernels one after the other anyway, and counts of traffic mean something.
fn kernels() -> MutexGuard<'static, Option<ColoringKernels>> {
    let mut kernels = KERNELS.lock().unwrap_or_else(PoisonError::into_inner);
    kernels.get_or_insert_default();
    kernels
}

type OnGraph =
    fn(&GpuContext, &mut ColoringKernels, &DeviceGraph) -> Result<DeviceColoring, GpuError>;

/// Those that give what sequential coloring, largest first, gives.
const LARGEST_FIRST: [(&str, OnGraph); 2] = [("jones_plassmann", jones_plassmann), ("scgc", scgc)];

/// The device's coloring, checked by itself.
fn checked(
    name: &str,
    gpu: &GpuContext,
    graph: &ConstraintGraph,
    coloring: &DeviceColoring,
) -> Coloring {
    let read = coloring.read(gpu).unwrap();
    read.verify(graph)
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(coloring.vertex_count(), graph.vertex_count(), "{name}");
    assert_eq!(coloring.color_count(), read.color_count(), "{name}");
    assert_eq!(coloring.color_count(), read.distinct_colors(), "{name}");
    assert_eq!(
        coloring.rounds() == 0,
        graph.vertex_count() == 0,
        "{name}: {} rounds",
        coloring.rounds()
    );
    read
}

/// All algorithms on one graph.
fn check(gpu: &GpuContext, graph: &ConstraintGraph) {
    let mut kernels = kernels();
    let kernels = kernels.as_mut().unwrap();
    let expected = incise_coloring::scgc(graph).coloring;
    let device = DeviceGraph::new(gpu, graph).unwrap();
    for (name, color) in LARGEST_FIRST {
        let before = gpu.traffic();
        let coloring = color(gpu, kernels, &device).unwrap();
        assert_eq!(gpu.traffic().since(before).uploaded_bytes, 0, "{name}");
        assert_eq!(checked(name, gpu, graph, &coloring), expected, "{name}");
    }
}

fn clique(n: u32) -> ConstraintGraph {
    let one = Incidence::from_constraints(1, (0..n).map(|_| [0u32])).unwrap();
    ConstraintGraph::from_incidence(&one)
}

fn path(n: u32) -> ConstraintGraph {
    let edges: Vec<(u32, u32)> = (1..n).map(|b| (b - 1, b)).collect();
    ConstraintGraph::from_edges(n as usize, &edges).unwrap()
}

/// Stars with so many leaves each.
fn stars(count: u32, leaves: u32) -> ConstraintGraph {
    let star = |s: u32| (1..=leaves).map(move |leaf| (s * (leaves + 1), s * (leaves + 1) + leaf));
    let edges: Vec<(u32, u32)> = (0..count).flat_map(star).collect();
    ConstraintGraph::from_edges((count * (leaves + 1)) as usize, &edges).unwrap()
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

#[test]
fn sizes_around_workgroups() {
    let Some(gpu) = gpu("sizes_around_workgroups") else {
        return;
    };
    for n in [0, 1, 2, 63, 64, 65, 255, 256, 257] {
        check(gpu, &path(n));
        check(gpu, &ConstraintGraph::from_edges(n as usize, &[]).unwrap());
    }
}

#[test]
fn cliques_need_all_colors() {
    let Some(gpu) = gpu("cliques_need_all_colors") else {
        return;
    };
    for n in [31, 32, 33, 64, 65, 360] {
        check(gpu, &clique(n));
    }
}

#[test]
fn degrees_have_no_limit() {
    let Some(gpu) = gpu("degrees_have_no_limit") else {
        return;
    };
    check(gpu, &stars(1, 1280));
    check(gpu, &stars(40, 31));
}

#[test]
fn worklists_pass_two_to_the_sixteen() {
    let Some(gpu) = gpu("worklists_pass_two_to_the_sixteen") else {
        return;
    };
    check(gpu, &path(65_537));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn random_graphs(graph in random_graph()) {
        if let Some(gpu) = gpu("random_graphs") {
            check(gpu, &graph);
        }
    }
}
