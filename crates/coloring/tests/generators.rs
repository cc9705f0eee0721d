//! Graphs with known properties, and random ones.

use incise_graph::{Coloring, ConstraintGraph, Incidence};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

/// A fingerprint of a coloring: FNV-1a over the colors as little-endian 32-bit numbers.
pub(crate) fn golden(coloring: &Coloring) -> u64 {
    let bytes = coloring
        .colors()
        .iter()
        .flat_map(|color| color.0.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Every vertex adjacent to all others.
pub(crate) fn clique(n: u32) -> ConstraintGraph {
    ConstraintGraph::from_incidence(
        &Incidence::from_constraints(1, (0..n).map(|_| [0u32])).unwrap(),
    )
}

/// Every vertex below `left` adjacent to every one of the `right` others.
pub(crate) fn bipartite(left: u32, right: u32) -> ConstraintGraph {
    let edges: Vec<(u32, u32)> = (0..left)
        .flat_map(|a| (left..left + right).map(move |b| (a, b)))
        .collect();
    ConstraintGraph::from_edges((left + right) as usize, &edges).unwrap()
}

/// A chain of `n` vertices.
pub(crate) fn path(n: u32) -> ConstraintGraph {
    let edges: Vec<(u32, u32)> = (1..n).map(|b| (b - 1, b)).collect();
    ConstraintGraph::from_edges(n as usize, &edges).unwrap()
}

/// The tets of `n` x `n` x `n` cubes, each cut into six along its diagonal (Kuhn): one tet per
/// order in which a walk from corner to corner can take its three steps.
pub(crate) fn kuhn(n: u32) -> Incidence {
    let number = |p: [u32; 3]| (p[2] * (n + 1) + p[1]) * (n + 1) + p[0];
    let steps = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    let mut tets = Vec::new();
    for cell in 0..n * n * n {
        let corner = [cell % n, cell / n % n, cell / n / n];
        for order in steps {
            let mut walk = corner;
            let mut tet = vec![number(walk)];
            for axis in order {
                walk[axis] += 1;
                tet.push(number(walk));
            }
            tets.push(tet);
        }
    }
    Incidence::from_constraints(((n + 1) * (n + 1) * (n + 1)) as usize, tets).unwrap()
}

/// Each pair an edge with the same chance, from none to all.
pub(crate) fn erdos_renyi(max: u32) -> impl Strategy<Value = ConstraintGraph> {
    (0..max, 0.0f64..1.0).prop_flat_map(|(n, density)| {
        let pairs: Vec<(u32, u32)> = (0..n).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        vec(0.0f64..1.0, pairs.len()).prop_map(move |draws| {
            let edges: Vec<_> = pairs
                .iter()
                .zip(&draws)
                .filter(|(_, draw)| **draw < density)
                .map(|(pair, _)| *pair)
                .collect();
            ConstraintGraph::from_edges(n as usize, &edges).unwrap()
        })
    })
}

/// Constraints of zero to five particles each; few particles, so that some are crowded, or many.
pub(crate) fn constraints(max: usize) -> impl Strategy<Value = Incidence> {
    (1u32..60).prop_flat_map(move |particles| {
        let one =
            btree_set(0..particles, 0..=5usize.min(particles as usize)).prop_map(Vec::from_iter);
        vec(one, 0..max).prop_map(move |constraints| {
            Incidence::from_constraints(particles as usize, constraints).unwrap()
        })
    })
}
