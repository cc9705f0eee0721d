//! Deltas carry everything: they can be written, read and replayed; a cut that would be too large or too fine is
//! refused or kept in bounds.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_cutting::{
    CutError, CutOptions, CuttableMesh, FaceTag, Plane, Skin, SkinChange, SkinVertex, carve,
    cut_plane,
};
use incise_mesh::{ParticleId, TetId, kuhn_box};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, noise};

const SLANTED: Plane = Plane {
    point: DVec3::new(0.43, 0.51, 0.47),
    normal: DVec3::new(1.0, 0.3, -0.2),
};

#[cfg(feature = "serde")]
#[test]
fn a_delta_survives_being_written() {
    let mesh = kuhn_box([3; 3], DVec3::ONE);
    let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
    let delta = cut_plane(
        &mut cuttable,
        &mesh.positions,
        &SLANTED,
        &CutOptions::default(),
    )
    .unwrap();
    let text = serde_json::to_string(&delta).unwrap();
    let read: incise_cutting::CutDelta = serde_json::from_str(&text).unwrap();
    assert_eq!(read, delta);
    let mut replayed = mesh;
    read.apply(&mut replayed);
    assert_eq!(&replayed, cuttable.mesh());
}

#[test]
fn cut_faces_carry_the_tag_of_their_stroke() {
    let mesh = kuhn_box([3; 3], DVec3::ONE);
    let mut cuttable = CuttableMesh::new(mesh).unwrap();
    for (tag, normal) in [(4, DVec3::X), (9, DVec3::Y)] {
        let rest = cuttable.mesh().positions.clone();
        let options = CutOptions {
            tag,
            ..CutOptions::default()
        };
        let plane = Plane { normal, ..SLANTED };
        cut_plane(&mut cuttable, &rest, &plane, &options).unwrap();
    }
    for (tag, normal, across) in [
        (4, DVec3::X, SLANTED.point.x),
        (9, DVec3::Y, SLANTED.point.y),
    ] {
        let mut area = 0.0;
        for triangle in cuttable.boundary().filter(|t| t.tag == FaceTag::Cut(tag)) {
            let [a, b, c] = triangle
                .particles
                .map(|p| cuttable.mesh().positions[p.index()]);
            assert!(
                [a, b, c]
                    .iter()
                    .all(|x| (normal.dot(*x) - across).abs() < 0.1 / 3.0 + 1e-12)
            );
            area += (b - a).cross(c - a).dot(normal).abs() / 2.0;
        }
        assert!(
            (area - 2.0).abs() < 1e-12,
            "both sides of a unit square: {area}"
        );
    }
}

/// Each split keeps the promised share of the volume, also where snapping is off.
#[test]
fn the_guard_bounds_the_volume_of_children() {
    for seed in 0..20 {
        for min_volume_ratio in [1e-6, 1e-4, 1e-2] {
            let mesh = body(2, seed);
            let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
            let options = CutOptions {
                snap: 0.0,
                min_volume_ratio,
                ..CutOptions::default()
            };
            let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
            let plane = Plane { normal, ..SLANTED };
            let delta = cut_plane(&mut cuttable, &mesh.positions, &plane, &options).unwrap();
            check_cut(&mesh, &cuttable, &delta);
            // Rounding of volumes.
            assert!(delta.worst_volume_ratio > min_volume_ratio * (1.0 - 1e-9));
        }
    }
    let options = CutOptions {
        min_volume_ratio: 0.02,
        ..CutOptions::default()
    };
    assert!(matches!(options.check(), Err(CutError::VolumeLimit { .. })));
}

/// What would grow beyond the limit is refused, says how large it would be, and changes nothing.
#[test]
fn growth_is_capped() {
    let mesh = kuhn_box([4; 3], DVec3::ONE);
    let cut = |max_tets| {
        let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
        let options = CutOptions {
            max_tets,
            ..CutOptions::default()
        };
        let result = cut_plane(&mut cuttable, &mesh.positions, &SLANTED, &options);
        cuttable.check().unwrap();
        (result, cuttable)
    };
    let (delta, _) = cut(usize::MAX);
    let needed = delta.unwrap().tets_after();
    let (refused, untouched) = cut(needed - 1);
    assert!(matches!(
        refused,
        Err(CutError::TooManyTets { tets, limit }) if tets == needed && limit == needed - 1
    ));
    assert_eq!(untouched.mesh(), &mesh);
    assert!(cut(needed).0.is_ok());
}

/// The triangles of a skin as tets, particles and tags, each once.
fn listed(skin: &Skin) -> BTreeSet<(TetId, [ParticleId; 3], FaceTag)> {
    let vertex = |v: u32| skin.vertices()[v as usize];
    let triangles = skin.triangles().iter().enumerate();
    let all: Vec<_> = triangles
        .map(|(i, corners)| {
            assert!(corners.iter().all(|&v| vertex(v).tag == skin.tag(i)));
            (
                skin.tet(i),
                corners.map(|v| vertex(v).particle),
                skin.tag(i),
            )
        })
        .collect();
    let set: BTreeSet<_> = all.iter().copied().collect();
    assert_eq!(set.len(), all.len());
    set
}

/// A copy that gets only the parts a skin reports as changed stays equal to it.
fn upload(copy: &mut (Vec<[u32; 3]>, Vec<SkinVertex>), skin: &Skin, change: &SkinChange) {
    copy.0.resize(skin.triangles().len(), [u32::MAX; 3]);
    copy.1.resize(
        skin.vertices().len(),
        SkinVertex {
            particle: ParticleId(0),
            tag: FaceTag::Outer,
        },
    );
    for &i in &change.triangles {
        copy.0[i] = skin.triangles()[i];
    }
    for &i in &change.vertices {
        copy.1[i] = skin.vertices()[i];
    }
    assert_eq!(copy.0, skin.triangles());
    assert_eq!(copy.1, skin.vertices());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    /// A skin that follows cuts and removals equals a rebuilt one, whatever was uploaded of it in parts.
    #[test]
    fn a_skin_follows(kind in 0_usize..6, seed in any::<u32>()) {
        let mut cuttable = CuttableMesh::new(body(kind, seed.into())).unwrap();
        let mut skin = Skin::new(cuttable.boundary());
        let mut copy = (skin.triangles().to_vec(), skin.vertices().to_vec());
        for round in 0..6_u32 {
            let rest = cuttable.mesh().positions.clone();
            let random = |k| noise(u64::from(seed) + u64::from(round), k);
            let delta = if round % 3 == 2 {
                let point = DVec3::from_array([0, 1, 2].map(random));
                carve(&mut cuttable, &rest, |x| x.distance(point) < 0.4, round).unwrap()
            } else {
                let plane = Plane {
                    point: rest[seed as usize % rest.len()] * 0.9,
                    normal: DVec3::from_array([3, 4, 5].map(random)) + DVec3::splat(1e-6),
                };
                let options = CutOptions { tag: round, ..CutOptions::default() };
                cut_plane(&mut cuttable, &rest, &plane, &options).unwrap()
            };
            let change = skin.apply_delta(&delta);
            upload(&mut copy, &skin, &change);
            prop_assert_eq!(listed(&skin), listed(&Skin::new(cuttable.boundary())));
            prop_assert!(skin.outer_triangles().all(|t| skin.tag(t) == FaceTag::Outer));
            prop_assert!(skin.cut_triangles().all(|t| skin.tag(t) != FaceTag::Outer));
            prop_assert_eq!(skin.cut_triangles().end, skin.triangles().len());
            let normals = skin.normals(&cuttable.mesh().positions);
            prop_assert!(normals.iter().all(|n| *n == DVec3::ZERO || (n.length() - 1.0).abs() < 1e-9));
        }
    }

    /// Many cuts taken back one by one, then made again: the same bits both times.
    #[test]
    fn undo_all_and_again(kind in 0_usize..6, seed in any::<u32>(), snap in prop::sample::select(vec![0.0, 0.1])) {
        let mesh = body(kind, seed.into());
        let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
        let options = CutOptions { snap, ..CutOptions::default() };
        let make = |cuttable: &mut CuttableMesh| {
            (0..4).map(|i| {
                let rest = cuttable.mesh().positions.clone();
                let random = |from| DVec3::from_array([0, 1, 2].map(|k| noise(seed.into(), from + k)));
                let point = rest[seed as usize % mesh.positions.len()] * 0.5 + rest[i] * 0.5;
                let plane = Plane { point, normal: random(10 * i) + DVec3::splat(1e-6) };
                cut_plane(cuttable, &rest, &plane, &options).unwrap()
            }).collect::<Vec<_>>()
        };
        let first = make(&mut cuttable);
        let cut = cuttable.clone();
        for delta in first.iter().rev() {
            cuttable.undo(delta).unwrap();
            cuttable.check().unwrap();
        }
        prop_assert_eq!(cuttable.mesh(), &mesh);
        let again = make(&mut cuttable);
        prop_assert_eq!(first, again);
        prop_assert_eq!(cut.mesh(), cuttable.mesh());
    }
}
