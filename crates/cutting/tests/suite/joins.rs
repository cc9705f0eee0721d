//! Strokes that meet earlier ones through a registry.

use std::f64::consts::TAU;

use glam::DVec3;
use incise_cutting::{
    CutDelta, CuttableMesh, Plane, StrokeRegistry, Sweep, TriangleSurface, cut_plane,
    cut_surface_joining, join_ends,
};
use incise_mesh::{Bounds, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{body, check_cut, jittered_box, noise, options, volumes};

/// Moves a blade by `path` times 0 to 1 in `frames` steps; checks everything after each.
fn sweep(
    body: &mut CuttableMesh,
    registry: &mut StrokeRegistry,
    blade: [DVec3; 2],
    path: [DVec3; 2],
    frames: usize,
    snap: f64,
) {
    let pose =
        |frame: usize| blade.map(|x| x + path[0].lerp(path[1], frame as f64 / frames as f64));
    let rest = body.mesh().positions.clone();
    let mut stroke = Sweep::new(body, &rest, &pose(0), options(snap)).unwrap();
    for frame in 1..=frames {
        let before = body.mesh().clone();
        let delta = stroke
            .advance_joining(body, &before.positions, &pose(frame), registry)
            .unwrap();
        check_cut(&before, body, &delta);
    }
}

fn stand(
    body: &mut CuttableMesh,
    registry: &mut StrokeRegistry,
    surface: &TriangleSurface,
    snap: f64,
) -> CutDelta {
    let before = body.mesh().clone();
    let delta =
        cut_surface_joining(body, &before.positions, surface, &options(snap), registry).unwrap();
    check_cut(&before, body, &delta);
    delta
}

const BLADE: [DVec3; 2] = [DVec3::new(0.42, -1.0, 0.0), DVec3::new(0.47, 2.0, 0.0)];

fn z(from: f64, to: f64) -> [DVec3; 2] {
    [DVec3::Z * from, DVec3::Z * to]
}

/// A stroke stops half-way, and a new one continues: from the same line, from the other side meeting exactly or
/// overlapping a little, or beside it by a tenth of an edge.
#[test]
fn strokes_that_go_on() {
    let h = 0.2;
    for snap in [0.0, 0.1, 0.2] {
        for depth in [0.37, 0.6] {
            let goes_on = [
                ("the same line", z(depth, -0.2), 0.0),
                ("overlapping", z(depth + 0.3 * h, -0.2), 0.0),
                ("other side", z(-0.2, depth), 0.0),
                ("other side, overlapping", z(-0.2, depth + 0.2 * h), 0.0),
                ("beside it", z(depth, -0.2), 0.1 * h),
                ("other side, beside it", z(-0.2, depth), 0.1 * h),
                (
                    "other side, beside it, overlapping",
                    z(-0.2, depth + 0.5 * h),
                    0.1 * h,
                ),
            ];
            for (what, path, beside) in goes_on {
                for mesh in [kuhn_box([5; 3], DVec3::ONE), jittered_box(5, 0.15, 3)] {
                    let mut body = CuttableMesh::new(mesh).unwrap();
                    let mut registry = StrokeRegistry::default();
                    sweep(&mut body, &mut registry, BLADE, z(1.2, depth), 7, snap);
                    assert_eq!(body.mesh().pieces().count, 1);
                    let blade = BLADE.map(|x| x + DVec3::X * beside);
                    sweep(&mut body, &mut registry, blade, path, 7, snap);
                    let volumes = volumes(&body);
                    assert_eq!(
                        volumes.len(),
                        2,
                        "{what}, snap {snap}, depth {depth}: {volumes:?}"
                    );
                }
            }
        }
    }
}

/// Crossing strokes are left alone: half as deep they leave one piece, to the ground four.
#[test]
fn strokes_that_cross() {
    for (depth, pieces) in [(0.5, 1), (1.2, 4)] {
        for snap in [0.0, 0.1] {
            let mut body = CuttableMesh::new(jittered_box(5, 0.15, 11)).unwrap();
            let mut registry = StrokeRegistry::default();
            let first = [DVec3::new(0.47, -1.0, 1.1), DVec3::new(0.47, 2.0, 1.1)];
            let second = [DVec3::new(-1.0, 0.53, 1.1), DVec3::new(2.0, 0.53, 1.1)];
            for blade in [first, second] {
                sweep(&mut body, &mut registry, blade, z(0.0, -depth), 9, snap);
            }
            assert_eq!(body.mesh().pieces().count, pieces);
        }
    }
}

/// Half a cross from above, the rest from below: four pieces.
#[test]
fn a_cross_in_four_strokes() {
    let mut body = CuttableMesh::new(jittered_box(5, 0.15, 11)).unwrap();
    let mut registry = StrokeRegistry::default();
    let first = [DVec3::new(0.47, -1.0, 0.0), DVec3::new(0.47, 2.0, 0.0)];
    let second = [DVec3::new(-1.0, 0.53, 0.0), DVec3::new(2.0, 0.53, 0.0)];
    for path in [z(1.1, 0.45), z(-0.1, 0.45)] {
        for blade in [first, second] {
            sweep(&mut body, &mut registry, blade, path, 6, 0.1);
        }
    }
    assert_eq!(body.mesh().pieces().count, 4);
}

/// A standing surface in four parts, cut one after the other.
#[test]
fn a_plane_in_parts() {
    for snap in [0.0, 0.1] {
        let mut body = CuttableMesh::new(jittered_box(5, 0.15, 4)).unwrap();
        let mut registry = StrokeRegistry::default();
        let line = 0.47;
        for (y, z) in [(-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)] {
            assert_eq!(body.mesh().pieces().count, 1);
            let center = DVec3::new(0.43, line + y, line + z);
            let part = TriangleSurface::rectangle(center, DVec3::Y, DVec3::Z).unwrap();
            stand(&mut body, &mut registry, &part, snap);
        }
        assert_eq!(body.mesh().pieces().count, 2, "snap {snap}");
    }
}

/// Repeating a stroke changes nothing after the first time.
#[test]
fn the_same_again() {
    for snap in [0.0, 0.1, 0.2] {
        let mut body = CuttableMesh::new(jittered_box(5, 0.15, 4)).unwrap();
        let mut registry = StrokeRegistry::default();
        let center = DVec3::new(0.43, 0.5, 0.9);
        let slit = TriangleSurface::rectangle(center, DVec3::Y, DVec3::new(0.1, 0.0, 0.5)).unwrap();
        for time in 0..4 {
            let delta = stand(&mut body, &mut registry, &slit, snap);
            assert_eq!(delta.is_empty(), time > 0, "time {time}, snap {snap}");
        }
        let mut body = CuttableMesh::new(jittered_box(5, 0.15, 4)).unwrap();
        let mut registry = StrokeRegistry::default();
        for time in 0..4 {
            let before = body.mesh().clone();
            sweep(&mut body, &mut registry, BLADE, z(1.2, 0.4), 5, snap);
            assert_eq!(body.mesh() == &before, time > 0, "time {time}, snap {snap}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Two strokes of one plane that meet at any depth cut like the whole plane.
    #[test]
    fn halves_of_a_plane(
        kind in 1_usize..6, seed in any::<u64>(), depth in -0.2..0.2_f64, frames in 1_usize..12,
        from_both in prop::bool::ANY, snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let along = DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
        let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let normal = normal.normalize();
        let along = (along - normal * along.dot(normal)).normalize();
        let path = normal.cross(along);
        let blade = [center - along * 4.0, center + along * 4.0];

        let mut whole = CuttableMesh::new(mesh.clone()).unwrap();
        cut_plane(&mut whole, &mesh.positions, &Plane { point: center, normal }, &options(snap)).unwrap();
        let mut cut = CuttableMesh::new(mesh).unwrap();
        let mut registry = StrokeRegistry::default();
        sweep(&mut cut, &mut registry, blade, [path * 3.0, path * depth], frames, snap);
        let second = if from_both { [path * -3.0, path * depth] } else { [path * depth, path * -3.0] };
        sweep(&mut cut, &mut registry, blade, second, frames, snap);
        let (cut, whole) = (volumes(&cut), volumes(&whole));
        prop_assert_eq!(cut.len(), whole.len(), "{:?} {:?}", &cut, &whole);
    }
}

/// The plate that polygons are cut out of, and its mean edge.
fn plate() -> (TetMesh, f64) {
    let mesh = generate(Shape::Plate, 4_000).unwrap();
    let edge = (mesh.total_volume() / mesh.tets.len() as f64 * 6.0 * 2.0_f64.sqrt()).cbrt();
    (mesh, edge)
}

/// The corners of a regular polygon with 3 to 6 sides in the middle of the plate.
fn polygon(case: u64) -> Vec<DVec3> {
    let random = |k| 0.5 + 0.5 * noise(1000 + case, k);
    let sides = 3 + u32::try_from(case).unwrap() % 4;
    let middle = DVec3::new(random(0) - 0.5, random(1) - 0.5, 0.0) * 0.1;
    let (radius, turn) = (0.2 + 0.12 * random(2), TAU * random(3));
    let corner = |i| {
        let angle = turn + TAU * f64::from(i) / f64::from(sides);
        middle + DVec3::new(angle.cos(), angle.sin(), 0.0) * radius
    };
    (0..sides).map(corner).collect()
}

/// Cuts the first sides of a polygon out of a plate by one stroke each: rectangles that stand, or blades that move. Strokes
/// begin and end by `over` beyond the corners.
fn cut_sides(
    mesh: &TetMesh,
    corners: &[DVec3],
    sides: usize,
    over: f64,
    (snap, moves): (f64, bool),
) -> (CuttableMesh, StrokeRegistry) {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let mut registry = StrokeRegistry::default();
    for (i, &from) in corners[..sides].iter().enumerate() {
        let to = corners[(i + 1) % corners.len()];
        let along = (to - from).normalize() * over;
        let (from, to) = (from - along, to + along);
        let down = DVec3::Z * 0.4;
        if moves {
            sweep(&mut body, &mut registry, [-down, down], [from, to], 9, snap);
        } else {
            let middle = from.midpoint(to);
            let surface = TriangleSurface::rectangle(middle, (to - from) * 0.5, down).unwrap();
            stand(&mut body, &mut registry, &surface, snap);
        }
    }
    (body, registry)
}

/// Joins the ends of strokes; checks everything, and that it can be undone.
fn join(body: &mut CuttableMesh, registry: &mut StrokeRegistry) -> CutDelta {
    let (before, mut other) = (body.mesh().clone(), body.clone());
    let mut of_other = registry.clone();
    let delta = join_ends(&mut other, &mut of_other, 7);
    other.undo(&delta).unwrap();
    assert_eq!(other.mesh(), &before);
    assert_eq!(join_ends(body, registry, 7), delta);
    check_cut(&before, body, &delta);
    assert_eq!(delta.tets_after(), delta.tets_before, "no tet is split");
    assert!(!registry.has_new_ends() && join_ends(body, registry, 7).is_empty());
    delta
}

const KINDS: [(f64, bool); 4] = [(0.0, false), (0.1, false), (0.1, true), (0.2, true)];

/// Strokes at an angle that overlap by a mean edge at their ends cut off what lies between them, and joining their ends
/// adds no pieces.
#[test]
fn strokes_that_overlap_at_corners() {
    let (mesh, edge) = plate();
    for kind in KINDS {
        for case in 0..10_u64 {
            let corners = polygon(case);
            let (mut body, mut registry) = cut_sides(&mesh, &corners, corners.len(), edge, kind);
            assert_eq!(volumes(&body).len(), 2, "{kind:?} {case}");
            join(&mut body, &mut registry);
            assert_eq!(volumes(&body).len(), 2, "{kind:?} {case}");
        }
    }
}

/// Strokes that end at corners exactly, or beyond them by less than an edge, tie the polygon until their ends are joined;
/// then it comes off, and only it.
#[test]
fn strokes_that_end_at_corners() {
    let (mesh, edge) = plate();
    let thickness = mesh.total_volume() / {
        let size = Bounds::around(mesh.positions.iter().copied()).size();
        size.x * size.y
    };
    let mut tied = 0;
    for over in [0.0, 0.5] {
        for kind in KINDS {
            for case in 0..10_u64 {
                // Slivers of a cut without snapping tie one of them; joining ends is not for that.
                if (over, kind.0, case) == (0.5, 0.0, 2) {
                    continue;
                }
                let corners = polygon(case);
                let sides = corners.len();
                let (mut body, mut registry) = cut_sides(&mesh, &corners, sides, over * edge, kind);
                tied += usize::from(volumes(&body).len() == 1);
                join(&mut body, &mut registry);
                let pieces = volumes(&body);
                assert_eq!(pieces.len(), 2, "{over} {kind:?} {case}: {pieces:?}");
                // Faces run within an edge of the corners, which are a small part of the polygon.
                let area: f64 = (0..sides)
                    .map(|i| 0.5 * corners[i].cross(corners[(i + 1) % sides]).z)
                    .sum();
                let smaller = pieces[0].min(pieces[1]);
                let error = (smaller - area * thickness).abs() / (edge * edge * thickness);
                assert!(
                    error < 0.5 * sides as f64,
                    "{over} {kind:?} {case}: {error}"
                );
            }
        }
    }
    assert!(tied > 60, "{tied} were tied before");
}

/// Strokes that end apart by more than an edge are left alone.
#[test]
fn strokes_that_end_apart() {
    let (mesh, edge) = plate();
    for kind in KINDS {
        for case in 0..10_u64 {
            let corners = polygon(case);
            let (mut body, mut registry) = cut_sides(&mesh, &corners, corners.len(), -edge, kind);
            let delta = join(&mut body, &mut registry);
            assert!(delta.is_empty(), "{kind:?} {case}: {:?}", delta.copies);
        }
    }
}

/// Three sides of a square make a flap, whose corners are free: a plane through its hinge cuts it off.
#[test]
fn corners_of_a_flap() {
    let (mesh, _) = plate();
    for kind in KINDS {
        let square = [[-0.2, -0.17], [0.23, -0.17], [0.23, 0.21], [-0.2, 0.21]];
        let corners = square.map(|[x, y]| DVec3::new(x, y, 0.0));
        let (mut body, mut registry) = cut_sides(&mesh, &corners, 3, 0.0, kind);
        join(&mut body, &mut registry);
        assert_eq!(volumes(&body).len(), 1, "{kind:?}");
        let plane = Plane {
            point: DVec3::new(-0.1, 0.0, 0.0),
            normal: DVec3::X,
        };
        let rest = body.mesh().positions.clone();
        cut_plane(&mut body, &rest, &plane, &options(kind.0)).unwrap();
        assert_eq!(volumes(&body).len(), 3, "{kind:?}");
    }
}

/// A stroke that ends at the side of another one divides what is on that side.
#[test]
fn a_stroke_that_ends_at_the_side_of_another() {
    let (mesh, _) = plate();
    for kind in KINDS {
        let path = [[-1.0, 0.03], [1.0, 0.03], [0.13, 0.03], [0.27, 1.0]];
        let [a, b, c, d] = path.map(|[x, y]| DVec3::new(x, y, 0.0));
        let (mut body, mut registry) = cut_sides(&mesh, &[a, b], 1, 0.0, kind);
        let (from, to, down) = (c, d, DVec3::Z * 0.4);
        if kind.1 {
            sweep(
                &mut body,
                &mut registry,
                [-down, down],
                [to, from],
                9,
                kind.0,
            );
        } else {
            let middle = from.midpoint(to);
            let side = TriangleSurface::rectangle(middle, (to - from) * 0.5, down).unwrap();
            stand(&mut body, &mut registry, &side, kind.0);
        }
        join(&mut body, &mut registry);
        assert_eq!(volumes(&body).len(), 3, "{kind:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Random rectangles: joining their ends splits no tet, keeps every invariant and cuts off nothing small; one stroke has
    /// nothing to join.
    #[test]
    fn ends_of_random_strokes(
        seed in 0_u64..10_000,
        count in 1_usize..6,
        snap in 0.0..0.25_f64,
    ) {
        let mut body = CuttableMesh::new(jittered_box(5, 0.2, seed)).unwrap();
        let mean = body.mesh().total_volume() / body.mesh().tets.len() as f64;
        let mut registry = StrokeRegistry::default();
        for i in 0..count {
            let random = |k: usize| {
                let k = 9 * i + 3 * k;
                DVec3::new(noise(seed, k), noise(seed, k + 1), noise(seed, k + 2))
            };
            let (u, v) = (random(1).normalize(), random(2));
            let v = v.reject_from(u).normalize();
            let surface = TriangleSurface::rectangle(
                DVec3::splat(0.5) + random(0) * 0.4,
                u * 0.5,
                v * 0.4,
            )
            .unwrap();
            stand(&mut body, &mut registry, &surface, snap);
        }
        let small = |body: &CuttableMesh| volumes(body).iter().filter(|v| **v < 4.0 * mean).count();
        let before = small(&body);
        let delta = join(&mut body, &mut registry);
        prop_assert!(count > 1 || delta.is_empty());
        prop_assert!(small(&body) <= before, "{} {}", before, small(&body));
    }
}
