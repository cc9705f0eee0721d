//! Tets taken away.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_cutting::{CutError, CutOptions, CuttableMesh, Plane, carve, cut_plane, remove_tets};
use incise_mesh::{TetId, kuhn_box};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, noise};

/// The corners of each tet as positions, regardless of numbers.
fn shapes(body: &CuttableMesh) -> BTreeSet<[u64; 12]> {
    let mesh = body.mesh();
    let shape = |tet: usize| {
        let corners = mesh
            .corners(TetId::new(tet))
            .map(|x| x.to_array().map(f64::to_bits));
        std::array::from_fn(|i| corners[i / 3][i % 3])
    };
    (0..mesh.tets.len()).map(shape).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// What is left are the tets that were not named, unmoved; the body holds together exactly where faces do.
    #[test]
    fn random_removals(kind in 0_usize..6, seed in any::<u32>(), share in 0.0..1.0_f64, cut_first in any::<bool>()) {
        let mut cuttable = CuttableMesh::new(body(kind, seed.into())).unwrap();
        if cut_first {
            let rest = cuttable.mesh().positions.clone();
            let point = rest[seed as usize % rest.len()] * 0.9;
            let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed.into(), k))) + DVec3::splat(1e-3);
            cut_plane(&mut cuttable, &rest, &Plane { point, normal }, &CutOptions::default()).unwrap();
        }
        for round in 0..3 {
            let before = cuttable.mesh().clone();
            let limit = 2.0 * share.powi(3) - 1.0;
            let doomed: Vec<TetId> = (0..before.tets.len())
                .filter(|t| noise(u64::from(seed) ^ round, *t) < limit)
                .map(TetId::new)
                .collect();
            let mut expected = shapes(&cuttable);
            for tet in &doomed {
                let corners = before.corners(*tet).map(|x| x.to_array().map(f64::to_bits));
                expected.remove(&std::array::from_fn(|i| corners[i / 3][i % 3]));
            }
            let delta = remove_tets(&mut cuttable, &doomed, 7).unwrap();
            prop_assert_eq!(shapes(&cuttable), expected);
            prop_assert_eq!(delta.deleted.len(), doomed.len());
            check_cut(&before, &cuttable, &delta);
        }
    }
}

/// Two boxes that touch in an edge after the tets between them are gone separate there.
#[test]
fn what_hangs_by_an_edge_comes_apart() {
    let mesh = kuhn_box([2, 2, 1], DVec3::new(2.0, 2.0, 1.0));
    let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
    let off_diagonal = |x: DVec3| (x.x < 1.0) != (x.y < 1.0);
    let delta = carve(&mut cuttable, &mesh.positions, off_diagonal, 0).unwrap();
    assert_eq!(delta.deleted.len(), 12);
    assert_eq!(delta.copies.len(), 2, "both ends of the common edge");
    assert_eq!(cuttable.mesh().pieces().count, 2);
    check_cut(&mesh, &cuttable, &delta);
}

/// A bored body has a hole: a torus of one piece.
#[test]
fn a_hole_is_bored() {
    let mesh = kuhn_box([8, 8, 4], DVec3::ONE);
    let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
    let drill = |x: DVec3| (x.x - 0.5).hypot(x.y - 0.5) < 0.2;
    let delta = carve(&mut cuttable, &mesh.positions, drill, 3).unwrap();
    check_cut(&mesh, &cuttable, &delta);
    assert_eq!(cuttable.mesh().pieces().count, 1);
    assert_eq!(cuttable.mesh().surface().euler_characteristic(), 0);
}

#[test]
fn everything_nothing_and_what_is_not_there() {
    let mesh = kuhn_box([1; 3], DVec3::ONE);
    let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
    assert!(remove_tets(&mut cuttable, &[], 0).unwrap().is_empty());
    assert!(matches!(
        remove_tets(&mut cuttable, &[TetId(2), TetId(6)], 0),
        Err(CutError::NoSuchTet {
            tet: TetId(6),
            tets: 6
        })
    ));
    assert_eq!(cuttable.mesh(), &mesh);
    let all: Vec<TetId> = (0..6).map(TetId).collect();
    let delta = remove_tets(&mut cuttable, &all, 0).unwrap();
    assert_eq!(
        (cuttable.mesh().tets.len(), cuttable.boundary_count()),
        (0, 0)
    );
    cuttable.check().unwrap();
    cuttable.undo(&delta).unwrap();
    cuttable.check().unwrap();
    assert_eq!(cuttable.mesh(), &mesh);
}
