//! Random constraints and degenerate cases.

use incise_graph::Incidence;
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

/// Constraints of arity 0 to 4 on a few particles, often with several components.
pub(crate) fn incidences() -> impl Strategy<Value = Incidence> {
    (4u32..40).prop_flat_map(|particles| {
        vec(
            btree_set(0..particles, 0..=4).prop_map(Vec::from_iter),
            0..60,
        )
        .prop_map(move |rows| Incidence::from_constraints(particles as usize, rows).unwrap())
    })
}

/// No constraints, constraints without particles, one particle with all constraints, many
/// components, a long row, and the tets of a box of cubes.
pub(crate) fn awkward() -> Vec<Incidence> {
    let build = |particles: usize, rows: Vec<Vec<u32>>| {
        Incidence::from_constraints(particles, rows).unwrap()
    };
    vec![
        build(0, vec![]),
        build(3, vec![]),
        build(0, vec![vec![]; 5]),
        build(1, vec![vec![0]; 500]),
        build(501, (1..=500).map(|i| vec![0, i]).collect()),
        build(200, (0..100).map(|i| vec![2 * i, 2 * i + 1]).collect()),
        build(
            300,
            (0..90)
                .map(|i| vec![3 * (i / 3), 3 * (i / 3) + 1 + i % 2])
                .collect(),
        ),
        build(301, (0..300).map(|i| vec![i, i + 1]).collect()),
        boxes(6),
    ]
}

/// `n` x `n` x `n` cubes of five tets each, mirrored from cube to cube to match.
fn boxes(n: u32) -> Incidence {
    let number = |x: u32, y: u32, z: u32| (z * (n + 1) + y) * (n + 1) + x;
    let tets = [
        [0u32, 3, 5, 6],
        [1, 0, 3, 5],
        [2, 0, 3, 6],
        [4, 0, 5, 6],
        [7, 3, 5, 6],
    ];
    let cells = (0..n * n * n).map(|cell| (cell % n, cell / n % n, cell / n / n));
    let rows = cells.flat_map(|(x, y, z)| {
        let flip = if (x + y + z) % 2 == 1 { 7 } else { 0 };
        tets.map(|tet| {
            tet.map(|corner| {
                let corner = corner ^ flip;
                number(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2))
            })
        })
    });
    Incidence::from_constraints(((n + 1) * (n + 1) * (n + 1)) as usize, rows).unwrap()
}
