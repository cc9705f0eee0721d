//! Whole planes.

use glam::DVec3;
use incise_cutting::{CutError, CutOptions, CuttableMesh, Plane, cut_plane};
use incise_mesh::kuhn_box;
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{bend, body, check_cut, noise, pieces_by_sign};

fn options(snap: f64) -> CutOptions {
    CutOptions {
        snap,
        ..CutOptions::default()
    }
}

/// Cuts the body at rest and checks everything.
fn cut(cuttable: &mut CuttableMesh, plane: &Plane, snap: f64) -> incise_cutting::CutDelta {
    let before = cuttable.mesh().clone();
    let delta = cut_plane(cuttable, &before.positions, plane, &options(snap)).unwrap();
    check_cut(&before, cuttable, &delta);
    delta
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    /// Random planes through random bodies, bent or not: checked mesh, volume, and without snapping the number of
    /// pieces that the signs alone give.
    #[test]
    fn random_planes(
        kind in 0_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
        bent in prop::bool::ANY, offset in -0.2..0.2_f64,
    ) {
        let mesh = body(kind, seed);
        let positions = if bent { bend(&mesh, 0.2) } else { mesh.positions.clone() };
        let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
        let normal = DVec3::new(noise(seed, 1), noise(seed, 2), noise(seed, 3));
        prop_assume!(normal.length() > 0.1);
        let plane = Plane { point: center + normal * offset, normal };
        let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
        let delta = cut_plane(&mut cuttable, &positions, &plane, &options(snap)).unwrap();
        check_cut(&mesh, &cuttable, &delta);
        let sign = |p: usize| normal.dot(positions[p] - plane.point) > 0.0;
        if snap == 0.0 {
            prop_assert_eq!(cuttable.mesh().pieces().count, pieces_by_sign(&mesh, sign));
        }
        for added in &delta.added {
            prop_assert!(added.corners.iter().any(|p| p.index() >= mesh.positions.len()));
        }

        // The same plane again changes nothing.
        let mut positions = positions;
        delta.extend_particles(&mut positions);
        let again = cut_plane(&mut cuttable, &positions, &plane, &options(snap)).unwrap();
        prop_assert!(again.is_empty(), "cutting the same again made {} tets", again.added.len());
    }

    /// The other side of the normal gives the mirror image: same mesh up to the names of copies.
    #[test]
    fn reversed_normal(kind in 0_usize..6, seed in any::<u64>(), snap in 0.0..0.2_f64) {
        let mesh = body(kind, seed);
        let normal = DVec3::new(noise(seed, 4), noise(seed, 5), 1.0);
        let point = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let results = [normal, -normal].map(|normal| {
            let mut cuttable = CuttableMesh::new(mesh.clone()).unwrap();
            cut(&mut cuttable, &Plane { point, normal }, snap);
            let mesh = cuttable.mesh();
            (mesh.pieces().count, mesh.tets.len(), mesh.positions.len())
        });
        prop_assert_eq!(results[0], results[1]);
    }

    /// Several planes one after the other.
    #[test]
    fn many_planes(kind in 1_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.1])) {
        let mut cuttable = CuttableMesh::new(body(kind, seed)).unwrap();
        let center = cuttable.mesh().positions.iter().sum::<DVec3>() / cuttable.mesh().positions.len() as f64;
        for i in 0..3 {
            let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, 10 + 3 * i + k))) + DVec3::splat(1e-3);
            let point = center + DVec3::splat(0.1 * noise(seed, 100 + i));
            cut(&mut cuttable, &Plane { point, normal }, snap);
        }
    }
}

#[test]
fn slabs_of_a_box() {
    let mut body = CuttableMesh::new(kuhn_box([10, 3, 3], DVec3::new(5.0, 1.0, 1.0))).unwrap();
    for (i, x) in [0.7, 1.3, 2.11, 3.0, 4.2].into_iter().enumerate() {
        cut(
            &mut body,
            &Plane {
                point: DVec3::splat(x),
                normal: DVec3::X,
            },
            0.1,
        );
        assert_eq!(body.mesh().pieces().count, i + 2);
    }
}

#[test]
fn a_cube_diced_into_a_thousand() {
    let mut body = CuttableMesh::new(kuhn_box([10; 3], DVec3::ONE)).unwrap();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for i in 1..10 {
            let point = DVec3::splat(0.1 * f64::from(i) + 0.013);
            let positions = body.mesh().positions.clone();
            cut_plane(
                &mut body,
                &positions,
                &Plane {
                    point,
                    normal: axis,
                },
                &options(0.0),
            )
            .unwrap();
        }
    }
    body.check().unwrap();
    assert_eq!(body.mesh().pieces().count, 1000);
    assert!((body.mesh().total_volume() - 1.0).abs() < 1e-12);
}

/// Planes through whole layers of particles, rounding included: nothing is split, everything separates.
#[test]
fn plane_through_particles() {
    for nudge in [0.0, 1e-17, -1e-13, 1e-13] {
        let mut body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
        let delta = cut(
            &mut body,
            &Plane {
                point: DVec3::splat(0.5 + nudge),
                normal: DVec3::X,
            },
            0.0,
        );
        assert!(delta.added.is_empty() && delta.points.is_empty());
        assert_eq!(delta.copies.len(), 25);
        assert_eq!(body.mesh().pieces().count, 2);
    }
}

/// The diagonal planes that gave flat and inverted tets without a tolerance.
#[test]
fn planes_through_edges_and_faces() {
    let diagonals = [
        (DVec3::new(1.0, 1.0, 0.0), 1.0),
        (DVec3::ONE, 1.5),
        (DVec3::ONE, 1.0),
        (DVec3::new(1.0, -1.0, 0.0), 0.0),
    ];
    for (normal, sum) in diagonals {
        let mut body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
        let point = normal * sum / normal.length_squared();
        for _ in 0..3 {
            cut(&mut body, &Plane { point, normal }, 0.0);
        }
        assert_eq!(body.mesh().pieces().count, 2, "normal {normal}");
    }
}

/// Planes that touch the boundary or miss the body change nothing.
#[test]
fn touching_and_missing() {
    for x in [0.0, 1.0, -1e-13, 1.0 + 1e-13, 2.0, 1e-13] {
        let mut body = CuttableMesh::new(kuhn_box([3; 3], DVec3::ONE)).unwrap();
        let delta = cut(
            &mut body,
            &Plane {
                point: DVec3::splat(x),
                normal: DVec3::X,
            },
            0.0,
        );
        assert!(delta.is_empty(), "at {x}");
    }
}

#[test]
fn torus_once_and_twice() {
    let mut body = CuttableMesh::new(generate(Shape::Torus, 2000).unwrap()).unwrap();
    cut(
        &mut body,
        &Plane {
            point: DVec3::splat(1e-3),
            normal: DVec3::X,
        },
        0.1,
    );
    assert_eq!(body.mesh().pieces().count, 2);
    cut(
        &mut body,
        &Plane {
            point: DVec3::splat(1e-3),
            normal: DVec3::Y,
        },
        0.1,
    );
    assert_eq!(body.mesh().pieces().count, 4);
}

#[test]
fn sphere_volumes_are_those_of_the_caps() {
    let mesh = generate(Shape::Sphere, 6000).unwrap();
    let whole = mesh.total_volume();
    let mut body = CuttableMesh::new(mesh).unwrap();
    cut(
        &mut body,
        &Plane {
            point: DVec3::new(0.0, 0.0, 0.2),
            normal: DVec3::Z,
        },
        0.1,
    );
    let pieces = body.mesh().pieces();
    assert_eq!(pieces.count, 2);
    let mut volumes = pieces.volumes(body.mesh());
    volumes.sort_by(f64::total_cmp);
    let height = 0.3;
    let cap = std::f64::consts::PI * height * height * (1.5 - height) / 3.0;
    assert!(
        (volumes[0] / cap - 1.0).abs() < 0.03,
        "{} against {cap}",
        volumes[0]
    );
    assert!((volumes[0] + volumes[1] - whole).abs() < 1e-12);
}

/// Snapping keeps the children from becoming slivers.
#[test]
fn snapping_bounds_the_volume_ratio() {
    let plane = Plane {
        point: DVec3::splat(0.47),
        normal: DVec3::new(1.0, 0.3, 0.2),
    };
    let ratio = |snap| {
        let mut body = CuttableMesh::new(crate::bodies::jittered_box(6, 0.2, 7)).unwrap();
        cut(&mut body, &plane, snap).worst_volume_ratio
    };
    assert!(ratio(0.1) >= 1e-3, "{}", ratio(0.1));
    assert!(ratio(0.2) >= 8e-3, "{}", ratio(0.2));
    assert!(ratio(0.0) < ratio(0.1));
}

/// Extreme scales and offsets: the same cut.
#[test]
fn scales_and_offsets() {
    for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-3, 1.0)] {
        let mut mesh = kuhn_box([3; 3], DVec3::ONE);
        mesh.positions
            .iter_mut()
            .for_each(|x| *x = *x * scale + DVec3::splat(offset));
        let mut body = CuttableMesh::new(mesh.clone()).unwrap();
        let point = DVec3::splat(0.4 * scale + offset);
        let delta = cut_plane(
            &mut body,
            &mesh.positions,
            &Plane {
                point,
                normal: DVec3::X,
            },
            &options(0.1),
        )
        .unwrap();
        body.check().unwrap();
        assert_eq!((body.mesh().pieces().count, delta.removed.len()), (2, 54));
    }
}

#[test]
fn bad_strokes_change_nothing() {
    let mesh = kuhn_box([2; 3], DVec3::ONE);
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let good = Plane {
        point: DVec3::splat(0.4),
        normal: DVec3::X,
    };
    let mut attempt = |plane: Plane, options: CutOptions, positions: &[DVec3]| {
        let error = cut_plane(&mut body, positions, &plane, &options).unwrap_err();
        assert_eq!(body.mesh(), &mesh);
        error
    };
    let default = CutOptions::default();
    let zero = Plane {
        normal: DVec3::ZERO,
        ..good
    };
    assert!(matches!(
        attempt(zero, default, &mesh.positions),
        CutError::ZeroNormal { .. }
    ));
    let nan = Plane {
        point: DVec3::NAN,
        ..good
    };
    assert!(matches!(
        attempt(nan, default, &mesh.positions),
        CutError::NonFinite { .. }
    ));
    let infinite = Plane {
        normal: DVec3::INFINITY,
        ..good
    };
    assert!(matches!(
        attempt(infinite, default, &mesh.positions),
        CutError::NonFinite { .. }
    ));
    assert!(matches!(
        attempt(good, options(0.3), &mesh.positions),
        CutError::Snap { .. }
    ));
    assert!(matches!(
        attempt(good, options(f64::NAN), &mesh.positions),
        CutError::Snap { .. }
    ));
    assert!(matches!(
        attempt(good, default, &mesh.positions[1..]),
        CutError::PositionCount { .. }
    ));
    let tiny = Plane {
        normal: DVec3::X * 1e-300,
        ..good
    };
    cut_plane(&mut body, &mesh.positions, &tiny, &default).unwrap();
    assert_eq!(body.mesh().pieces().count, 2);
}
