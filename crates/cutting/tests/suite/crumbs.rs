//! Thin slices, and the crumbs that cuts would leave.

use glam::DVec3;
use incise_cutting::{
    CutError, CutOptions, CuttableMesh, PieceTracker, Plane, Sweep, cut_plane, cut_surface,
};
use incise_mesh::{TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, jittered_box, noise, options, strip, volumes};

fn without_crumbs_kept(snap: f64) -> CutOptions {
    CutOptions {
        crumbs: 0.0,
        ..options(snap)
    }
}

fn mean_edge(mesh: &TetMesh) -> f64 {
    let lengths = mesh.tets.iter().flat_map(|tet| {
        let x = tet.map(|p| mesh.positions[p.index()]);
        [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| x[i].distance(x[j]))
    });
    lengths.sum::<f64>() / (6 * mesh.tets.len()) as f64
}

fn mean_volume(mesh: &TetMesh) -> f64 {
    mesh.total_volume() / mesh.tets.len() as f64
}

/// So many parallel planes that are `gap` mean edges apart; returns the body and the crumbs kept.
fn slices(
    mesh: &TetMesh,
    gap: f64,
    count: usize,
    normal: DVec3,
    options: &CutOptions,
) -> (CuttableMesh, usize) {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let step = normal.normalize() * gap * mean_edge(mesh);
    let mut crumbs = 0;
    for i in 0..count {
        let before = body.mesh().clone();
        let point = DVec3::new(-0.063, 0.0, 0.0) + step * i as f64;
        let plane = Plane { point, normal };
        let delta = cut_plane(&mut body, &before.positions, &plane, options).unwrap();
        check_cut(&before, &body, &delta);
        crumbs += delta.crumbs;
    }
    (body, crumbs)
}

/// A slice thinner than the snap distance is there as one sheet or not at all.
#[test]
fn thin_slices() {
    for tets in [2_000, 11_000] {
        let mesh = generate(Shape::Liver, tets).unwrap();
        let whole = DVec3::new(1.0, 0.1, 0.05);
        for (snap, gap, most) in [
            (0.1, 0.02, 3),
            (0.2, 0.02, 3),
            (0.1, 0.05, 3),
            (0.2, 0.1, 3),
        ] {
            let (body, _) = slices(&mesh, gap, 2, whole, &options(snap));
            let volumes = volumes(&body);
            assert!(
                (2..=most).contains(&volumes.len()),
                "{tets} tets, gap {gap}, snap {snap}: {volumes:?}"
            );
            // The first cut is where it was.
            let (once, _) = slices(&mesh, gap, 1, whole, &options(snap));
            let smaller = |body| crate::bodies::volumes(body)[0];
            if volumes.len() == 2 {
                assert!((volumes[0] - smaller(&once)).abs() < 1e-9);
            }
        }
        for snap in [0.1, 0.2] {
            let (body, _) = slices(&mesh, 0.02, 10, whole, &options(snap));
            let volumes = volumes(&body);
            assert!((2..=11).contains(&volumes.len()), "{volumes:?}");
            assert!(volumes[0] > 0.5 * mean_volume(&mesh));
        }
    }
}

/// Slices thicker than the snap distance are all there, without a crumb.
#[test]
fn slices_that_are_thick_enough() {
    let mesh = generate(Shape::Liver, 2_000).unwrap();
    for (snap, gap) in [(0.0, 0.1), (0.1, 0.2), (0.1, 0.3), (0.2, 0.4)] {
        let (body, crumbs) = slices(&mesh, gap, 4, DVec3::new(1.0, 0.1, 0.05), &options(snap));
        assert_eq!(volumes(&body).len(), 5, "gap {gap}, snap {snap}");
        assert_eq!(crumbs, 0);
    }
}

/// A plate with one layer of elements that are flatter than the snap distance is cut along its middle, and its half again.
#[test]
fn a_plate_flatter_than_the_snap_distance() {
    let mesh = kuhn_box([4, 4, 1], DVec3::new(1.0, 1.0, 0.04));
    for snap in [0.1, 0.2, 0.25] {
        let mut body = CuttableMesh::new(mesh.clone()).unwrap();
        for (z, pieces) in [(0.02, 2), (0.01, 3)] {
            let before = body.mesh().clone();
            let plane = Plane {
                point: DVec3::Z * z,
                normal: DVec3::Z,
            };
            let delta = cut_plane(&mut body, &before.positions, &plane, &options(snap)).unwrap();
            check_cut(&before, &body, &delta);
            assert_eq!(volumes(&body).len(), pieces);
        }
    }
}

/// A wedge whose tip is thinner than the snap distance comes off as one piece.
#[test]
fn a_wedge() {
    let mesh = generate(Shape::Liver, 2_000).unwrap();
    for snap in [0.1, 0.2] {
        let mut body = CuttableMesh::new(mesh.clone()).unwrap();
        for turn in [0.0, 0.15] {
            let before = body.mesh().clone();
            let plane = Plane {
                point: DVec3::new(-0.063, 0.6, 0.0),
                normal: DVec3::new(1.0, turn, 0.0),
            };
            let delta = cut_plane(&mut body, &before.positions, &plane, &options(snap)).unwrap();
            check_cut(&before, &body, &delta);
        }
        let volumes = volumes(&body);
        assert_eq!(volumes.len(), 3, "snap {snap}: {volumes:?}");
    }
}

/// A corner of less than half a mean tet stays on the body if crumbs are kept, and comes off if not.
#[test]
fn a_corner() {
    let mesh = kuhn_box([4; 3], DVec3::ONE);
    let volume = |size: f64| size.powi(3) / 6.0 / mean_volume(&mesh);
    for (size, comes_off) in [(0.1, false), (0.24, true), (0.4, true)] {
        assert_eq!(volume(size) > 0.5, comes_off);
        for crumbs in [0.0, 0.5] {
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let mut pieces = PieceTracker::new(&body);
            let plane = Plane {
                point: DVec3::X * size,
                normal: DVec3::ONE,
            };
            let options = CutOptions {
                crumbs,
                ..options(0.0)
            };
            let delta = cut_plane(&mut body, &mesh.positions, &plane, &options).unwrap();
            check_cut(&mesh, &body, &delta);
            pieces.apply_delta(&body, &delta);
            pieces.check(&body).unwrap();
            let kept = !comes_off && crumbs > 0.0;
            assert_eq!(delta.crumbs, usize::from(kept));
            assert_eq!(pieces.count(), if kept { 1 } else { 2 });
            let expected = if kept { size.powi(3) / 6.0 } else { 0.0 };
            assert!((delta.crumb_volume - expected).abs() < 1e-15);
            // And so it is when the cut is made again.
            let before = body.mesh().clone();
            let again = cut_plane(&mut body, &before.positions, &plane, &options).unwrap();
            check_cut(&before, &body, &again);
            assert!(again.is_empty());
        }
    }
}

/// A body of a single tet has no crumbs: every cut parts it.
#[test]
fn a_single_tet() {
    let mesh = body(0, 0);
    for size in [0.2, 0.5, 0.8] {
        let mut body = CuttableMesh::new(mesh.clone()).unwrap();
        let plane = Plane {
            point: DVec3::X * size,
            normal: DVec3::X,
        };
        let delta = cut_plane(&mut body, &mesh.positions, &plane, &options(0.1)).unwrap();
        check_cut(&mesh, &body, &delta);
        assert_eq!((volumes(&body).len(), delta.crumbs), (2, 0));
    }
}

#[test]
fn bad_sizes_are_refused() {
    let mesh = kuhn_box([1; 3], DVec3::ONE);
    for crumbs in [-0.1, 101.0, f64::NAN] {
        let mut body = CuttableMesh::new(mesh.clone()).unwrap();
        let plane = Plane {
            point: DVec3::splat(0.4),
            normal: DVec3::X,
        };
        let options = CutOptions {
            crumbs,
            ..CutOptions::default()
        };
        let refused = cut_plane(&mut body, &mesh.positions, &plane, &options);
        assert!(matches!(refused, Err(CutError::Crumbs { .. })));
        assert_eq!(body.mesh(), &mesh);
    }
}

/// Short strokes beside and across each other, a few edges large; returns the crumbs kept.
fn short_strokes(body: &mut CuttableMesh, count: usize, seed: u64, options: &CutOptions) -> usize {
    let edge = mean_edge(body.mesh());
    let mut crumbs = 0;
    for i in 0..count {
        let direction =
            |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(seed, 20 * i + 3 * k + j)));
        let center = DVec3::splat(0.5) + 0.3 * direction(0);
        let along = direction(1).normalize_or(DVec3::X) * 3.0 * edge;
        let path = direction(2).normalize_or(DVec3::Y) * 3.0 * edge;
        let pose = |t: f64| [center - along + path * t, center + along + path * t];
        let rest = body.mesh().positions.clone();
        let mut stroke = Sweep::new(body, &rest, &pose(-1.0), *options).unwrap();
        for t in [-0.5, 0.0, 0.5, 1.0] {
            let before = body.mesh().clone();
            let delta = stroke.advance(body, &before.positions, &pose(t)).unwrap();
            check_cut(&before, body, &delta);
            crumbs += delta.crumbs;
        }
    }
    crumbs
}

/// Many strokes leave hardly a piece below the size of a crumb, where the same strokes without the rule leave many.
#[test]
fn many_short_strokes() {
    for snap in [0.0, 0.1, 0.2] {
        let mesh = jittered_box(6, 0.2, 5);
        let limit = 0.5 * mean_volume(&mesh);
        let mut kept = CuttableMesh::new(mesh.clone()).unwrap();
        let crumbs = short_strokes(&mut kept, 12, 3, &options(snap));
        let mut loose = CuttableMesh::new(mesh).unwrap();
        short_strokes(&mut loose, 12, 3, &without_crumbs_kept(snap));
        let small = |body: &CuttableMesh| volumes(body).iter().filter(|v| **v < limit).count();
        // What comes off a part not much larger than a crumb has nothing to stay with.
        assert!(5 * small(&kept) <= small(&loose), "snap {snap}");
        assert!(crumbs > 0);
    }
}

/// Cuts that cross at the largest snap distance leave no pieces of a single tet.
#[test]
fn single_tets_at_the_largest_snap_distance() {
    let mut single = [0, 0];
    for seed in 0..40_u64 {
        let mesh = jittered_box(6, 0.1, seed);
        let direction = |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(seed, 3 * k + j)));
        for (single, options) in single
            .iter_mut()
            .zip([without_crumbs_kept(0.25), options(0.25)])
        {
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            for i in 0..4 {
                let before = body.mesh().clone();
                let plane = Plane {
                    point: DVec3::splat(0.5) + 0.05 * direction(i),
                    normal: direction(i),
                };
                let delta = cut_plane(&mut body, &before.positions, &plane, &options).unwrap();
                check_cut(&before, &body, &delta);
            }
            let sizes = body.mesh().pieces().sizes();
            *single += sizes.iter().filter(|size| **size == 1).count();
        }
    }
    let [loose, kept] = single;
    assert!(loose > 0 && kept == 0, "{kept} of {loose}");
}

/// Random cuts of all kinds: whatever comes off is no crumb, unless all of it is small.
fn check_crumbs(kind: usize, seed: u64, snap: f64, crumbs: f64) -> Result<(), TestCaseError> {
    let mesh = body(kind, seed);
    let limit = crumbs * mean_volume(&mesh);
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
    let size = mesh
        .positions
        .iter()
        .map(|x| x.distance(center))
        .fold(0.0, f64::max);
    let options = CutOptions {
        crumbs,
        ..options(snap)
    };
    for i in 0..4 {
        let direction =
            |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(seed, 30 * i + 3 * k + j)));
        let point = center + 0.3 * size * direction(0);
        let before = body.mesh().clone();
        let parts = volumes(&body);
        let delta = if i % 2 == 0 {
            let plane = Plane {
                point,
                normal: direction(1) + DVec3::splat(1e-3),
            };
            cut_plane(&mut body, &before.positions, &plane, &options).unwrap()
        } else {
            let bend = [direction(1), direction(2), direction(3)].map(|x| point + size * x);
            let further = bend.map(|x| x + 2.0 * size * direction(4));
            let Ok(surface) = strip(&bend, &further) else {
                continue;
            };
            cut_surface(&mut body, &before.positions, &surface, &options).unwrap()
        };
        check_cut(&before, &body, &delta);
        prop_assert_eq!(delta.crumbs == 0, delta.crumb_volume == 0.0);
        let now = volumes(&body);
        let small = |parts: &[f64]| parts.iter().filter(|v| **v < limit).count();
        // Crumbs stay with parts of eight times their size. Beside a smaller one they come off, be it there before or cut
        // off as well.
        let has_breakable = parts.iter().any(|v| *v < 40.0 * limit);
        let has_middling = now.iter().any(|v| (limit..8.0 * limit).contains(v));
        if !has_breakable && !has_middling {
            prop_assert!(small(&now) <= small(&parts), "{:?} became {:?}", parts, now);
        }
    }
    Ok(())
}

/// A crumb that touches only other crumbs stays with one of them.
#[test]
fn crumbs_among_crumbs_stay() {
    for (kind, seed, crumbs) in [
        (3, 18_404_474_360_994_821_452, 2.0),
        (1, 16_040_593_107_969_700_588, 0.05),
    ] {
        check_crumbs(kind, seed, 0.0, crumbs).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn no_crumbs_come_off(
        kind in 1_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.1, 0.2, 0.25]),
        crumbs in prop::sample::select(vec![0.05, 0.5, 2.0]),
    ) {
        check_crumbs(kind, seed, snap, crumbs)?;
    }
}
