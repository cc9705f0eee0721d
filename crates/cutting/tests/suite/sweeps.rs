//! Blades swept through resting and moving bodies.

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutError, CutOptions, CuttableMesh, FaceTag, Plane, StrokeRegistry, Sweep,
    TriangleSurface, carve, cut_level_set, cut_plane, cut_surface,
};
use incise_mesh::{TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, jittered_box, noise, pieces_by_sign};

fn options(snap: f64) -> CutOptions {
    CutOptions {
        snap,
        ..CutOptions::default()
    }
}

/// Moves a blade along a path of offsets in `frames` steps through a body whose particles are at `motion(rest, time)`,
/// time going from 0 to 1. Checks everything after every frame.
fn sweep(
    body: &mut CuttableMesh,
    blade: &[DVec3],
    offset: impl Fn(f64) -> DVec3,
    motion: impl Fn(DVec3, f64) -> DVec3,
    frames: usize,
    snap: f64,
) {
    let pose = |time| blade.iter().map(|x| *x + offset(time)).collect::<Vec<_>>();
    let now = |mesh: &TetMesh, time| {
        mesh.positions
            .iter()
            .map(|x| motion(*x, time))
            .collect::<Vec<_>>()
    };
    let mut stroke = Sweep::new(body, &now(body.mesh(), 0.0), &pose(0.0), options(snap)).unwrap();
    for frame in 1..=frames {
        let time = frame as f64 / frames as f64;
        let before = body.mesh().clone();
        let delta = stroke
            .advance(body, &now(&before, time), &pose(time))
            .unwrap();
        check_cut(&before, body, &delta);
    }
}

fn still(x: DVec3, _: f64) -> DVec3 {
    x
}

/// A long blade and its path, sweeping the whole plane around `center` that holds both.
fn whole_plane(center: DVec3, along: DVec3, normal: DVec3) -> ([DVec3; 2], DVec3, DVec3) {
    let along = (along - normal * along.dot(normal) / normal.length_squared()).normalize();
    let path = normal.normalize().cross(along);
    (
        [center - along * 4.0, center + along * 4.0],
        path * -3.0,
        path * 3.0,
    )
}

/// The volume of the tets that have all four particles on cut faces.
fn wholly_on_the_cut(body: &CuttableMesh) -> f64 {
    let mut on = vec![false; body.mesh().positions.len()];
    for triangle in body.boundary().filter(|t| t.tag != FaceTag::Outer) {
        triangle.particles.iter().for_each(|p| on[p.index()] = true);
    }
    let tets = body.mesh().tets.iter().enumerate();
    tets.filter(|(_, corners)| corners.iter().all(|p| on[p.index()]))
        .map(|(t, _)| body.mesh().volume(TetId::new(t)))
        .sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    /// On a body at rest a blade swept through a plane does what the plane does at once.
    #[test]
    fn a_swept_plane_is_the_plane(
        kind in 0_usize..6, seed in any::<u64>(), frames in 1_usize..40,
        snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let along = DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
        let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let (blade, from, to) = whole_plane(center, along, normal);

        let mut swept = CuttableMesh::new(mesh.clone()).unwrap();
        sweep(&mut swept, &blade, |t| from.lerp(to, t), still, frames, snap);
        let mut at_once = CuttableMesh::new(mesh.clone()).unwrap();
        cut_plane(&mut at_once, &mesh.positions, &Plane { point: center, normal }, &options(snap)).unwrap();

        prop_assert_eq!(swept.mesh().pieces().count, at_once.mesh().pieces().count);
        prop_assert_eq!(swept.mesh().tets.len(), at_once.mesh().tets.len());
        let volumes = |body: &CuttableMesh| {
            let mut volumes = body.mesh().pieces().volumes(body.mesh());
            volumes.sort_by(f64::total_cmp);
            volumes
        };
        // A tet with all four particles on the surface may go with either side: the plane weighs its particles, the
        // sweep, which does not know them all at once, joins it to a neighbor.
        let between = wholly_on_the_cut(&at_once);
        for (a, b) in volumes(&swept).into_iter().zip(volumes(&at_once)) {
            prop_assert!((a - b).abs() < 1e-9 + between, "{} against {}, {} between", a, b, between);
        }
    }

    /// A body that swings and bends meanwhile separates all the same, with no thread left between frames.
    #[test]
    fn a_moving_body(
        kind in prop::sample::select(vec![1_usize, 2, 4]), seed in any::<u64>(), frames in 5_usize..60,
        snap in prop::sample::select(vec![0.0, 0.1]),
    ) {
        let mesh = body(kind, seed);
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let along = DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
        let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let (blade, from, to) = whole_plane(center, along, normal);
        let swing = DVec3::from_array([6, 7, 8].map(|k| 0.2 * noise(seed, k)));
        let motion = |x: DVec3, t: f64| {
            let wave = 4.0 * t * (1.0 - t);
            x + swing * wave + 0.1 * wave * DVec3::new(x.y * x.z, x.z * x.x, x.x * x.y)
        };
        let mut cut = CuttableMesh::new(mesh.clone()).unwrap();
        sweep(&mut cut, &blade, |t| from.lerp(to, t), motion, frames, snap);
        // Thick convex bodies separate into two pieces; chips at the rim may come off besides where the cut is curved.
        let pieces = cut.mesh().pieces();
        let mut volumes = pieces.volumes(cut.mesh());
        volumes.sort_by(f64::total_cmp);
        prop_assert!(pieces.count >= 2, "one piece is left");
        let second = volumes[volumes.len() - 2];
        prop_assert!(second > 0.01 * mesh.total_volume(), "the second piece has {second}");
    }
}

/// The blade stops half-way: one piece. It continues: two.
#[test]
fn half_way_and_on() {
    let mut body = CuttableMesh::new(jittered_box(5, 0.2, 3)).unwrap();
    let blade = [DVec3::new(0.45, -1.0, 0.0), DVec3::new(0.52, 2.0, 0.0)];
    let pose = |z: f64| blade.map(|x| x + DVec3::Z * z);
    let rest = |body: &CuttableMesh| body.mesh().positions.clone();
    let mut stroke = Sweep::new(&body, &rest(&body), &pose(1.2), options(0.1)).unwrap();
    for frame in 1..=24 {
        let before = body.mesh().clone();
        let delta = stroke
            .advance(
                &mut body,
                &before.positions,
                &pose(1.2 - 0.06 * f64::from(frame)),
            )
            .unwrap();
        check_cut(&before, &body, &delta);
        if frame == 12 {
            assert_eq!(body.mesh().pieces().count, 1);
            assert!(!body.mesh().positions.len().eq(&216), "but it has been cut");
            // Standing still cuts nothing.
            let before = body.mesh().clone();
            let delta = stroke
                .advance(&mut body, &before.positions, &pose(1.2 - 0.06 * 12.0))
                .unwrap();
            assert!(delta.is_empty());
        }
    }
    assert_eq!(body.mesh().pieces().count, 2);
}

/// A second stroke from the other side meets the first and overlaps it by a tet.
#[test]
fn two_strokes_that_meet() {
    for (snap, x, depth) in [
        (0.0, 0.4, 0.77),
        (0.1, 0.4, 0.913),
        (0.1, 0.41371, 0.7),
        (0.0, 0.5, 0.77),
    ] {
        let mut body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
        let blade = [DVec3::new(x, -1.0, 0.0), DVec3::new(x, 2.0, 0.0)];
        sweep(
            &mut body,
            &blade,
            |t| DVec3::Z * (1.3 - t * depth),
            still,
            10,
            snap,
        );
        assert_eq!(body.mesh().pieces().count, 1);
        sweep(
            &mut body,
            &blade,
            |t| DVec3::Z * (1.2 * t - 0.3),
            still,
            10,
            snap,
        );
        assert_eq!(
            body.mesh().pieces().count,
            2,
            "snap {snap}, x {x}, depth {depth}"
        );
    }
}

/// Crossing strokes of half depth leave one piece, of full depth four.
#[test]
fn crossing_strokes() {
    for (depth, pieces) in [(0.5, 1), (1.2, 4)] {
        let mut body = CuttableMesh::new(jittered_box(5, 0.15, 11)).unwrap();
        let first = [DVec3::new(0.47, -1.0, 1.1), DVec3::new(0.47, 2.0, 1.1)];
        let second = [DVec3::new(-1.0, 0.53, 1.1), DVec3::new(2.0, 0.53, 1.1)];
        sweep(
            &mut body,
            &first,
            |t| DVec3::NEG_Z * t * depth,
            still,
            9,
            0.1,
        );
        sweep(
            &mut body,
            &second,
            |t| DVec3::NEG_Z * t * depth,
            still,
            9,
            0.1,
        );
        assert_eq!(body.mesh().pieces().count, pieces);
    }
}

/// Two strokes at the same time, each following the other's cuts, their fronts more than a tet apart.
#[test]
fn strokes_at_the_same_time() {
    for (snap, lead) in [(0.1, -0.4), (0.1, 0.4), (0.0, 0.4)] {
        let mut body = CuttableMesh::new(jittered_box(5, 0.15, 12)).unwrap();
        let blades = [
            [DVec3::new(0.47, -1.0, 1.6), DVec3::new(0.47, 2.0, 1.6)],
            [
                DVec3::new(-1.0, 0.53, 1.6 - lead),
                DVec3::new(2.0, 0.53, 1.6 - lead),
            ],
        ];
        let rest = body.mesh().positions.clone();
        let mut strokes =
            blades.map(|blade| Sweep::new(&body, &rest, &blade, options(snap)).unwrap());
        for frame in 1..=22 {
            for i in 0..2 {
                let before = body.mesh().clone();
                let pose = blades[i].map(|x| x - DVec3::Z * 0.1 * f64::from(frame));
                let delta = strokes[i]
                    .advance(&mut body, &before.positions, &pose)
                    .unwrap();
                check_cut(&before, &body, &delta);
                strokes[1 - i].apply_delta(&body, &delta);
            }
        }
        assert_eq!(body.mesh().pieces().count, 4, "snap {snap}, lead {lead}");
    }
}

/// A bent blade cuts a wedge out.
#[test]
fn a_bent_blade() {
    let mut body = CuttableMesh::new(jittered_box(6, 0.1, 5)).unwrap();
    let blade = [
        DVec3::new(0.2, 0.0, 1.4),
        DVec3::new(0.5, 0.0, 0.45),
        DVec3::new(0.8, 0.0, 1.4),
    ];
    sweep(
        &mut body,
        &blade,
        |t| DVec3::Y * (-0.2 + 1.4 * t),
        still,
        30,
        0.1,
    );
    assert_eq!(body.mesh().pieces().count, 2);
}

/// A curved path: the blade sweeps a quarter of a circle around an edge of the box.
#[test]
fn a_curved_path() {
    let mut body = CuttableMesh::new(jittered_box(6, 0.1, 6)).unwrap();
    let blade = [DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 2.0, 0.0)];
    let circle = |t: f64| {
        let angle = std::f64::consts::FRAC_PI_2 * (1.2 * t - 0.1);
        DVec3::new(angle.cos(), 0.0, angle.sin()) * 0.6
    };
    sweep(&mut body, &blade, circle, still, 40, 0.1);
    assert_eq!(body.mesh().pieces().count, 2);
    let smaller = body
        .mesh()
        .pieces()
        .volumes(body.mesh())
        .into_iter()
        .fold(1.0, f64::min);
    let quarter = std::f64::consts::PI * 0.36 / 4.0;
    assert!(
        (smaller / quarter - 1.0).abs() < 0.05,
        "{smaller} against {quarter}"
    );
}

/// A blade whose end stays inside cuts a slit: one piece, but a longer boundary.
#[test]
fn a_short_blade_cuts_a_slit() {
    let mesh = kuhn_box([6; 3], DVec3::ONE);
    let triangles = mesh.surface().triangles.len();
    let mut body = CuttableMesh::new(mesh).unwrap();
    let blade = [DVec3::new(0.45, 0.5, 1.2), DVec3::new(0.45, 2.0, 1.2)];
    sweep(
        &mut body,
        &blade,
        |t| DVec3::NEG_Z * t * 1.5,
        still,
        12,
        0.1,
    );
    assert_eq!(body.mesh().pieces().count, 1);
    assert!(body.mesh().surface().triangles.len() > triangles + 20);
}

/// A blade that only dips into a tet without meeting an edge, or misses, changes nothing.
#[test]
fn no_edge_no_cut() {
    let mut body = CuttableMesh::new(kuhn_box([1; 3], DVec3::ONE)).unwrap();
    let point = DVec3::new(0.5, 0.3, 0.1);
    let blade = [point, point + DVec3::new(0.01, 0.01, 0.0)];
    sweep(&mut body, &blade, |t| DVec3::Y * 0.02 * t, still, 3, 0.1);
    sweep(&mut body, &blade, |t| DVec3::splat(5.0 + t), still, 3, 0.1);
    assert_eq!(body.mesh().tets.len(), 6);
}

/// The liver of the main job, swinging, sliced by a long blade.
#[test]
fn a_swinging_liver() {
    let mesh = generate(Shape::Liver, 2000).unwrap();
    let x = 0.05;
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let blade = [DVec3::new(x, -2.0, 0.0), DVec3::new(x, 2.0, 0.0)];
    let motion = |p: DVec3, t: f64| p + DVec3::new(0.05 * t * p.z, 0.0, -0.1 * t * p.x * p.x);
    sweep(
        &mut body,
        &blade,
        |t| DVec3::Z * (0.9 - 1.8 * t),
        motion,
        60,
        0.1,
    );
    assert_eq!(
        body.mesh().pieces().count,
        pieces_by_sign(&mesh, |p| mesh.positions[p].x > x)
    );
}

#[test]
fn bad_blades_are_refused() {
    let body = CuttableMesh::new(kuhn_box([1; 3], DVec3::ONE)).unwrap();
    let positions = body.mesh().positions.clone();
    let new = |blade: &[DVec3]| Sweep::new(&body, &positions, blade, CutOptions::default());
    assert!(matches!(
        new(&[DVec3::ZERO]),
        Err(CutError::ShortBlade { points: 1, .. })
    ));
    assert!(matches!(
        new(&[DVec3::ONE, DVec3::ONE]),
        Err(CutError::ShortBlade { points: 2, .. })
    ));
    assert!(matches!(
        new(&[DVec3::ONE, DVec3::NAN]),
        Err(CutError::NonFinite { .. })
    ));
    let mut stroke = new(&[DVec3::ONE, DVec3::ZERO]).unwrap();
    let mut body = body.clone();
    let changed = stroke.advance(&mut body, &positions, &[DVec3::ONE; 3]);
    assert!(matches!(
        changed,
        Err(CutError::BladeChanged { before: 2, now: 3 })
    ));
    let infinite = stroke.advance(&mut body, &positions, &[DVec3::ONE, DVec3::INFINITY]);
    assert!(matches!(infinite, Err(CutError::NonFinite { .. })));
}

/// A pose of the long blade that the tests below move down.
fn pose(z: f64) -> [DVec3; 2] {
    [DVec3::new(0.45, -1.0, z), DVec3::new(0.52, 2.0, z)]
}

/// A step that would make too many tets leaves mesh and stroke as they were: what comes after is the same, to the bit,
/// as if it had not been tried.
#[test]
fn a_refused_step_is_forgotten() {
    for snap in [0.0, 0.2] {
        for earlier in [false, true] {
            let mesh = jittered_box(5, 0.2, 3);
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let mut registry = StrokeRegistry::default();
            if earlier {
                let mut stroke =
                    Sweep::new(&body, &mesh.positions, &pose(-0.2), options(snap)).unwrap();
                let delta =
                    stroke.advance_joining(&mut body, &mesh.positions, &pose(0.1), &mut registry);
                assert!(!delta.unwrap().is_empty());
            }
            let rest = |body: &CuttableMesh| body.mesh().positions.clone();
            let whole = {
                let (mut body, mut registry) = (body.clone(), registry.clone());
                let mut stroke =
                    Sweep::new(&body, &rest(&body), &pose(1.2), options(snap)).unwrap();
                let positions = rest(&body);
                stroke
                    .advance_joining(&mut body, &positions, &pose(-0.2), &mut registry)
                    .unwrap();
                body.mesh().tets.len()
            };
            let limited = CutOptions {
                max_tets: whole - 1,
                ..options(snap)
            };
            let mut stroke = Sweep::new(&body, &rest(&body), &pose(1.2), limited).unwrap();
            let positions = rest(&body);
            stroke
                .advance_joining(&mut body, &positions, &pose(0.7), &mut registry)
                .unwrap();
            let (mut twin, mut twin_body, mut twin_memory) =
                (stroke.clone(), body.clone(), registry.clone());

            let positions = rest(&body);
            let refused = stroke.advance_joining(&mut body, &positions, &pose(-0.2), &mut registry);
            assert!(
                matches!(refused, Err(CutError::TooManyTets { .. })),
                "nothing was refused"
            );
            assert_eq!(body.mesh(), twin_body.mesh());
            let went_on = stroke
                .advance_joining(&mut body, &positions, &pose(0.5), &mut registry)
                .unwrap();
            let expected = twin
                .advance_joining(&mut twin_body, &positions, &pose(0.5), &mut twin_memory)
                .unwrap();
            assert!(!expected.is_empty());
            assert_eq!(went_on, expected);
        }
    }
}

/// Positions that are not numbers change nothing, in the stroke neither.
#[test]
fn bad_positions_are_refused() {
    let mesh = jittered_box(3, 0.2, 3);
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut positions = mesh.positions.clone();
        positions[7].y = bad;
        let refused = |result: Result<CutDelta, CutError>| {
            assert!(
                matches!(result, Err(CutError::NonFinite { .. })),
                "{result:?}"
            );
        };
        let new = Sweep::new(&body, &positions, &pose(1.2), options(0.1));
        assert!(matches!(new, Err(CutError::NonFinite { .. })));
        let mut stroke = Sweep::new(&body, &mesh.positions, &pose(1.2), options(0.1)).unwrap();
        refused(stroke.advance(&mut body, &positions, &pose(0.5)));
        let surface = TriangleSurface::rectangle(DVec3::splat(0.5), DVec3::X, DVec3::Y).unwrap();
        refused(cut_surface(&mut body, &positions, &surface, &options(0.1)));
        refused(carve(&mut body, &positions, |_| true, 0));
        let plane = Plane {
            point: DVec3::splat(0.4),
            normal: DVec3::ONE,
        };
        refused(cut_plane(&mut body, &positions, &plane, &options(0.1)));
        refused(cut_level_set(
            &mut body,
            &positions,
            |x| x.x.max(0.1) - 0.5,
            &options(0.1),
        ));
        assert_eq!(body.mesh(), &mesh);
        let mut other = body.clone();
        let delta = stroke
            .advance(&mut other, &mesh.positions, &pose(0.5))
            .unwrap();
        assert!(!delta.is_empty());
    }
}

/// Tets are taken away, also beside the front, and a stroke that follows continues; one that does not, or that an undo
/// has overtaken, is refused.
#[test]
fn removals_and_undo_on_the_way() {
    for snap in [0.0, 0.2] {
        for inside in [0.3, 0.8] {
            let mesh = jittered_box(5, 0.2, 3);
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let mut stroke = Sweep::new(&body, &mesh.positions, &pose(1.2), options(snap)).unwrap();
            let advance = |stroke: &mut Sweep, body: &mut CuttableMesh, z: f64| {
                let before = body.mesh().clone();
                let delta = stroke.advance(body, &before.positions, &pose(z))?;
                check_cut(&before, body, &delta);
                Ok::<_, CutError>(delta)
            };
            advance(&mut stroke, &mut body, 0.6).unwrap();
            let (early, early_body) = (stroke.clone(), body.mesh().clone());

            let drill =
                |x: DVec3| DVec3::new(x.x - 0.5, x.y - 0.5, 0.0).length() < 0.15 && x.z > inside;
            let before = body.mesh().clone();
            let removal = carve(&mut body, &before.positions, drill, 1).unwrap();
            assert!(!removal.moved.is_empty());
            let refused = advance(&mut stroke, &mut body, 0.3);
            assert!(matches!(refused, Err(CutError::NotFollowed { .. })));
            stroke.apply_delta(&body, &removal);
            advance(&mut stroke, &mut body, 0.3).unwrap();
            let last = advance(&mut stroke, &mut body, 0.1).unwrap();
            body.undo(&last).unwrap();
            let refused = advance(&mut stroke, &mut body, -0.2);
            assert!(matches!(refused, Err(CutError::NotFollowed { .. })));

            // The stroke cut through all the same; whatever the drill left between.
            let mut stroke = early;
            let mut body = CuttableMesh::new(early_body).unwrap();
            let removal = carve(&mut body, &before.positions, drill, 1).unwrap();
            stroke.apply_delta(&body, &removal);
            for z in [0.3, 0.1, -0.2] {
                advance(&mut stroke, &mut body, z).unwrap();
            }
            let mut volumes = body.mesh().pieces().volumes(body.mesh());
            volumes.sort_by(f64::total_cmp);
            assert!(volumes[volumes.len() - 2] > 0.3, "{volumes:?}");
        }
    }
}
