//! Clustering from scratch, and its local update after one plane has cut the body.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use std::num::NonZeroUsize;

use criterion::BatchSize;
use incise::clustering::{
    greedy_k_neighbor, pressure, serial_neighbor, serial_neighbor_incidence, update_local,
};
use incise::cutting::{CutDelta, CutOptions, CuttableMesh, Plane, cut_plane};
use incise::mesh::glam::DVec3;
use incise_benches::Case;

fn main() {
    incise_benches::run("clustering", |bench| {
        let case = bench.case;
        let graph = case.graph();
        let [five, ten] = [4, 9].map(|more| NonZeroUsize::MIN.saturating_add(more));
        let incidence = case.incidence();
        for (size, limit) in [(5, five), (10, ten)] {
            bench.measure(&format!("serial{size}"), |b| {
                b.iter(|| serial_neighbor_incidence(&incidence, limit));
            });
            bench.measure(&format!("greedy-k{size}"), |b| {
                b.iter(|| greedy_k_neighbor(&incidence, limit));
            });
            bench.measure(&format!("pressure{size}"), |b| {
                b.iter(|| pressure(&incidence, limit));
            });
        }
        bench.measure("serial10-from-graph", |b| {
            b.iter(|| serial_neighbor(&graph, ten));
        });

        let clustering = serial_neighbor(&graph, ten);
        let delta = cut(case);
        let removed: Vec<u32> = delta.removed.iter().map(|tet| tet.tet.0).collect();
        let (offsets, values) = groups(&delta);
        assert!(!values.is_empty(), "the plane meets the body");
        bench.measure("update-local", |b| {
            b.iter_batched_ref(
                || clustering.clone(),
                |clustering| update_local(clustering, &removed, &offsets, &values, ten).unwrap(),
                BatchSize::PerIteration,
            );
        });
    });
}

fn cut(case: &Case) -> CutDelta {
    let mut body = CuttableMesh::new(case.mesh.clone()).unwrap();
    let plane = Plane {
        point: case.at([0.48, 0.5, 0.5]),
        normal: DVec3::new(1.0, 0.03, 0.02),
    };
    cut_plane(
        &mut body,
        &case.mesh.positions,
        &plane,
        &CutOptions::default(),
    )
    .unwrap()
}

/// The children of each cut tet on each side of the cut, as a simulation groups them.
fn groups(delta: &CutDelta) -> (Vec<u32>, Vec<u32>) {
    let key = |i: usize| (delta.added[i].parent, delta.added[i].positive);
    let mut order: Vec<usize> = (0..delta.added.len()).collect();
    order.sort_unstable_by_key(|&i| (key(i), delta.added[i].tet));
    let mut offsets = vec![0];
    let mut values = Vec::with_capacity(order.len());
    for siblings in order.chunk_by(|&a, &b| key(a) == key(b)) {
        values.extend(siblings.iter().map(|&i| delta.added[i].tet.0));
        offsets.push(u32::try_from(values.len()).unwrap());
    }
    (offsets, values)
}
