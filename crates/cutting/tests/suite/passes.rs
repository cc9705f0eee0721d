//! Strokes that come back over their own surface: rows of a scalpel, to and fro, in one sweep.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use incise_cutting::{CuttableMesh, Plane, StrokeRegistry, Sweep, cut_plane};
use incise_mesh::TetMesh;
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, noise, options, pieces_by_sign, volumes};

/// The corners of a path in rows, to and fro along `across`, each a `step` along `down` after the one before.
fn rows(across: DVec3, down: DVec3, [from, to]: [f64; 2], step: f64, detour: DVec3) -> Vec<DVec3> {
    let mut path = Vec::new();
    let starts = (0..).map(|row| (row, from + step * f64::from(row)));
    for (row, start) in starts.take_while(|(_, start)| *start < to + step) {
        let start = down * start;
        let side = if row % 2 == 0 { across } else { -across };
        path.extend([start - side, start + side]);
        // Around to the next row: a half circle beside the body.
        let turns = if detour == DVec3::ZERO { 0..0 } else { 1..12 };
        for i in turns {
            let angle = PI * f64::from(i) / 12.0;
            let further = side.normalize() * detour.length() * (1.0 - (2.0 * angle).cos());
            let on = down * step * f64::from(i) / 12.0;
            path.push(start + side + on + further + detour * angle.sin());
        }
    }
    path
}

/// Points along a path that are at most a step apart.
fn poses(path: &[DVec3], step: f64) -> Vec<DVec3> {
    let mut poses = vec![path[0]];
    for leg in path.windows(2) {
        let count = (leg[0].distance(leg[1]) / step).ceil().max(1.0);
        let parts = (1..).map(|i: u32| f64::from(i) / count);
        poses.extend(
            parts
                .take_while(|t| *t <= 1.0)
                .map(|t| leg[0].lerp(leg[1], t)),
        );
    }
    poses
}

/// Moves a blade by the `offsets` in turn, in a frame that moves with the body: both are displaced by `sway`.
fn sweep(
    mesh: &TetMesh,
    blade: [DVec3; 2],
    offsets: &[DVec3],
    sway: f64,
    snap: f64,
    mut registry: Option<StrokeRegistry>,
) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let away = |frame: usize| {
        let time = frame as f64;
        DVec3::new((0.9 * time).sin(), (0.7 * time).cos(), 0.0) * sway
    };
    let now = |mesh: &TetMesh, frame| -> Vec<DVec3> {
        let moved = mesh.positions.iter().map(|x| *x + away(frame));
        moved.collect()
    };
    let pose = |frame: usize| blade.map(|x| x + offsets[frame] + away(frame));
    let mut stroke = Sweep::new(&body, &now(mesh, 0), &pose(0), options(snap)).unwrap();
    for frame in 1..offsets.len() {
        let before = body.mesh().clone();
        let positions = now(&before, frame);
        let delta = match &mut registry {
            Some(registry) => stroke.advance_joining(&mut body, &positions, &pose(frame), registry),
            None => stroke.advance(&mut body, &positions, &pose(frame)),
        };
        let delta = delta.unwrap();
        if !delta.is_empty() {
            check_cut(&before, &body, &delta);
        }
    }
    body
}

/// A liver sliced in twelve rows that overlap by half of the blade, in one stroke.
#[test]
fn a_liver_in_rows() {
    let mesh = generate(Shape::Liver, 2_000).unwrap();
    let x = -0.063;
    let blade = [DVec3::new(x, 0.0, 0.0), DVec3::new(x, 0.0, -0.3)];
    let path = rows(
        DVec3::Y * 0.8,
        DVec3::NEG_Z,
        [-0.8, 0.85],
        0.15,
        DVec3::ZERO,
    );
    let expected = pieces_by_sign(&mesh, |p| mesh.positions[p].x > x);
    assert_eq!(expected, 2);
    for snap in [0.0, 0.1, 0.2] {
        for registry in [None, Some(StrokeRegistry::default())] {
            let body = sweep(&mesh, blade, &poses(&path, 0.05), 0.0, snap, registry);
            assert_eq!(body.mesh().pieces().count, expected, "snap {snap}");
        }
    }
}

/// A blade that backs up now and then on its way, further each time, cuts like one that does not.
#[test]
fn to_and_fro() {
    let mesh = body(2, 3);
    let blade = [DVec3::new(0.43, -0.5, 0.0), DVec3::new(0.47, 1.5, 0.0)];
    for snap in [0.0, 0.1, 0.2] {
        let back = (0..12).flat_map(|i| {
            let at = 1.3 - 0.12 * f64::from(i);
            [at, at + 0.1 * f64::from(i)]
        });
        let path: Vec<DVec3> = back
            .map(|z| DVec3::Z * z)
            .chain([DVec3::Z * -0.2])
            .collect();
        let cut = sweep(&mesh, blade, &poses(&path, 0.07), 0.0, snap, None);
        assert_eq!(cut.mesh().pieces().count, 2, "snap {snap}");
    }
}

/// The volumes of pieces of more than a hundredth of a body, ascending.
fn large_pieces(body: &CuttableMesh) -> Vec<f64> {
    let all = body.mesh().total_volume();
    let mut volumes = volumes(body);
    volumes.retain(|volume| *volume > 0.01 * all);
    volumes
}

/// A path along a line, around three quarters of a circle and across the line: the loop comes off, and the rest is parted.
fn crossing(turn: f64, shift: DVec3) -> Vec<DVec3> {
    let (middle, radius) = (DVec3::new(0.15, 0.12, 0.0), 0.22);
    let arc = (0..=24).map(|i| {
        let (sin, cos) = (PI * (f64::from(i) / 16.0 - 0.5)).sin_cos();
        middle + DVec3::new(cos, sin, 0.0) * radius
    });
    let start = DVec3::new(-0.9, middle.y - radius, 0.0);
    let end = DVec3::new(middle.x - radius, -0.9, 0.0);
    let path = std::iter::once(start).chain(arc).chain([end]);
    path.map(|x| DQuat::from_rotation_z(turn) * x + shift)
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// A stroke across its own path cuts its loop off and parts the rest.
    #[test]
    fn a_path_may_cross_itself(
        turn in 0.0..6.3_f64, x in -0.05..0.05_f64, y in -0.05..0.05_f64, step in 0.02..0.1_f64,
        snap in prop::sample::select(vec![0.0, 0.1, 0.2]),
        sway in prop::sample::select(vec![0.0, 0.05]),
    ) {
        let mesh = generate(Shape::Plate, 4_000).unwrap();
        let blade = [DVec3::Z * -0.4, DVec3::Z * 0.4];
        let path = poses(&crossing(turn, DVec3::new(x, y, 0.0)), step);
        let registry = Some(StrokeRegistry::default());
        let body = sweep(&mesh, blade, &path, sway, snap, registry);
        prop_assert_eq!(large_pieces(&body).len(), 3, "{:?}", large_pieces(&body));
    }

    /// Rows over a whole plane part a body where the plane does, wherever the blade turns around in between and however
    /// the body moves meanwhile.
    #[test]
    fn rows_cut_like_the_plane(
        kind in 1_usize..6, seed in any::<u64>(), step in 0.02..0.3_f64, detour in prop::sample::select(vec![0.0, 0.3]),
        sway in prop::sample::select(vec![0.0, 0.05]), joins in prop::bool::ANY,
        snap in prop::sample::select(vec![0.0, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let along = DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
        let normal = normal.normalize();
        let along = (along - normal * along.dot(normal)).normalize();
        let down = normal.cross(along);
        let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let size = mesh.positions.iter().map(|x| x.distance(center)).fold(0.0, f64::max);

        let blade = [center, center + down * 0.6 * size];
        let (range, detour) = ([-1.3 * size, 0.8 * size], normal * detour * size);
        let path = rows(along * 1.2 * size, down, range, 0.2 * size, detour);
        let registry = joins.then(StrokeRegistry::default);
        let cut = sweep(&mesh, blade, &poses(&path, step * size), sway * size, snap, registry);

        let mut whole = CuttableMesh::new(mesh.clone()).unwrap();
        let plane = Plane { point: center, normal };
        cut_plane(&mut whole, &mesh.positions, &plane, &options(snap)).unwrap();
        let (cut, whole) = (volumes(&cut), volumes(&whole));
        prop_assert_eq!(cut.len(), whole.len(), "{:?} {:?}", &cut, &whole);
        for (cut, whole) in cut.iter().zip(&whole) {
            prop_assert!((cut - whole).abs() < 0.05 * mesh.total_volume(), "{} {}", cut, whole);
        }
    }
}

/// Each of these paths crosses itself and has three corners of about 90 degrees, at one of which the loop stayed tied.
#[test]
fn a_path_may_have_corners() {
    let mesh = generate(Shape::Plate, 4_000).unwrap();
    let blade = [DVec3::Z * -0.4, DVec3::Z * 0.4];
    let corners = [
        (-0.9, -0.1),
        (0.25, -0.1),
        (0.3, 0.25),
        (-0.1, 0.3),
        (-0.15, -0.9),
    ];
    for (seed, snap) in [
        (78, 0.1),
        (86, 0.0),
        (90, 0.1),
        (93, 0.1),
        (103, 0.2),
        (108, 0.1),
    ] {
        let turn = DQuat::from_rotation_z(6.3 * noise(seed, 0).abs());
        let shift = DVec3::new(0.05 * noise(seed, 1), 0.05 * noise(seed, 2), 0.0);
        let path = corners.map(|(x, y)| turn * DVec3::new(x, y, 0.0) + shift);
        let path = poses(&path, 0.02 + 0.08 * noise(seed, 3).abs());
        let registry = Some(StrokeRegistry::default());
        let body = sweep(&mesh, blade, &path, 0.0, snap, registry);
        assert_eq!(
            large_pieces(&body).len(),
            3,
            "{seed}: {:?}",
            large_pieces(&body)
        );
    }
}
