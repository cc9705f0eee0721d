//! Standing surfaces of triangles.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutError, CutOptions, CuttableMesh, Plane, Sweep, TriangleSurface, cut_level_set,
    cut_plane, cut_surface,
};
use incise_mesh::{TetMesh, kuhn_box};
use proptest::prelude::*;

use crate::bodies::{
    bend, body, check_cut, cuboid, icosphere, jittered_box, noise, options, relabelled, volumes,
};

/// Cuts the body at rest and checks everything.
fn cut(body: &mut CuttableMesh, surface: &TriangleSurface, snap: f64) -> CutDelta {
    let before = body.mesh().clone();
    let delta = cut_surface(body, &before.positions, surface, &options(snap)).unwrap();
    check_cut(&before, body, &delta);
    delta
}

fn cut_mesh(mesh: &TetMesh, surface: &TriangleSurface, snap: f64) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    cut(&mut body, surface, snap);
    body
}

fn close(one: &CuttableMesh, other: &CuttableMesh, slack: f64) -> bool {
    let (one, other) = (volumes(one), volumes(other));
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| (a - b).abs() < slack)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(80))]

    /// A rectangle larger than the body is the plane: on resting and bent bodies, to the number of tets.
    #[test]
    fn a_large_rectangle_is_the_plane(
        kind in 0_usize..6, seed in any::<u64>(), bent in prop::bool::ANY,
        snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let positions = if bent { bend(&mesh, 0.2) } else { mesh.positions.clone() };
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let along = DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
        let point = positions.iter().sum::<DVec3>() / positions.len() as f64;
        let u = normal.cross(along).normalize() * 4.0;
        let v = normal.normalize().cross(u);

        let mut one = CuttableMesh::new(mesh.clone()).unwrap();
        cut_plane(&mut one, &positions, &Plane { point, normal }, &options(snap)).unwrap();
        let surface = TriangleSurface::rectangle(point, u, v).unwrap();
        let mut other = CuttableMesh::new(mesh.clone()).unwrap();
        let delta = cut_surface(&mut other, &positions, &surface, &options(snap)).unwrap();
        check_cut(&mesh, &other, &delta);
        prop_assert_eq!(one.mesh().tets.len(), other.mesh().tets.len());
        prop_assert!(close(&one, &other, 1e-9), "{:?} {:?}", volumes(&one), volumes(&other));

        // The same again changes nothing.
        let mut positions = positions;
        delta.extend_particles(&mut positions);
        let again = cut_surface(&mut other, &positions, &surface, &options(snap)).unwrap();
        prop_assert!(again.is_empty(), "the same again made {} tets", again.added.len());
    }

    /// Any triangles at all leave a sound mesh; turned around and with other names for the particles they cut alike.
    #[test]
    fn any_triangles(
        kind in 0_usize..6, seed in any::<u64>(), count in 1_usize..12,
        snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let points: Vec<DVec3> = (0..3 * count)
            .map(|i| center + DVec3::from_array([0, 1, 2].map(|k| noise(seed, 10 + 3 * i + k))))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..u32::try_from(count).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let surface = TriangleSurface::new(&points, &triangles).unwrap();
        cut_mesh(&mesh, &surface, snap);

        // One triangle alone.
        let one = |triangle: [u32; 3]| TriangleSurface::new(&points, &[triangle]).unwrap();
        let expected = cut_mesh(&mesh, &one([0, 1, 2]), snap);
        prop_assert!(close(&expected, &cut_mesh(&mesh, &one([2, 1, 0]), snap), 1e-12));
        let (renamed, _) = relabelled(&mesh, seed);
        prop_assert!(close(&expected, &cut_mesh(&renamed, &one([0, 1, 2]), snap), 1e-9));
    }

    /// A ball of triangles of any size against tets of any size.
    #[test]
    fn balls(
        n in 2_usize..7, seed in any::<u64>(), times in 0_usize..3, radius in 0.05..0.45_f64,
        snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = jittered_box(n, 0.2, seed);
        let center = DVec3::splat(0.5) + DVec3::splat(0.03 * noise(seed, 9));
        let (points, mut triangles) = icosphere(center, radius, times);
        let surface = TriangleSurface::new(&points, &triangles).unwrap();
        let mut body = cut_mesh(&mesh, &surface, snap);
        // Turned around, some of them or all: they are turned back.
        for (i, triangle) in triangles.iter_mut().enumerate() {
            if noise(seed, 1000 + i) > 0.0 {
                triangle.swap(0, 1);
            }
        }
        let other = cut_mesh(&mesh, &TriangleSurface::new(&points, &triangles).unwrap(), snap);
        prop_assert!(close(&body, &other, 1e-9), "{:?} {:?}", volumes(&body), volumes(&other));
        // Large enough to hold some tets: the core falls out.
        if radius > 1.5 / n as f64 && n > 3 {
            let volumes = volumes(&body);
            prop_assert!(volumes.len() >= 2, "one piece");
            // With snapping, an edge made by the first cut may in rare cases snap a particle that no edge did before.
            if snap == 0.0 {
                let again = cut(&mut body, &surface, snap);
                prop_assert!(again.is_empty(), "the same again made {} tets", again.added.len());
            }
        }
    }
}

/// A closed surface carves a plug, as the level set does.
#[test]
fn a_ball_carves_a_plug() {
    let center = DVec3::new(0.48, 0.53, 0.51);
    for (n, snap) in [(6, 0.0), (6, 0.1), (10, 0.1)] {
        let mesh = jittered_box(n, 0.15, 3);
        let (points, triangles) = icosphere(center, 0.31, 3);
        let surface = TriangleSurface::new(&points, &triangles).unwrap();
        let body = cut_mesh(&mesh, &surface, snap);
        assert_eq!(body.mesh().pieces().count, 2);
        assert_eq!(body.mesh().surface().euler_characteristic(), 6);
        let mut other = CuttableMesh::new(mesh.clone()).unwrap();
        let field = |x: DVec3| x.distance(center) - 0.31;
        cut_level_set(&mut other, &mesh.positions, field, &options(snap)).unwrap();
        // Both are chords of the sphere: of the triangles (edges 0.05, so within 1e-3) and of the tets.
        let h = 1.0 / n as f64;
        assert!(
            close(&body, &other, 1e-3 + h * h),
            "{:?} {:?}",
            volumes(&body),
            volumes(&other)
        );
    }
}

/// A rectangle that ends inside cuts a slit.
#[test]
fn a_slit() {
    for snap in [0.0, 0.1] {
        let mesh = kuhn_box([6; 3], DVec3::ONE);
        let triangles = mesh.surface().triangles.len();
        let center = DVec3::new(0.45, 0.5, 1.0);
        let slit = TriangleSurface::rectangle(center, DVec3::Y, DVec3::Z * 0.57).unwrap();
        let mut body = cut_mesh(&mesh, &slit, snap);
        assert_eq!(body.mesh().pieces().count, 1);
        assert!(body.mesh().surface().triangles.len() > triangles + 50);
        assert!(cut(&mut body, &slit, snap).is_empty(), "the same again");
        // Inside altogether: a bubble without volume.
        let inner =
            TriangleSurface::rectangle(DVec3::splat(0.52), DVec3::Y * 0.4, DVec3::Z * 0.4).unwrap();
        let body = cut_mesh(&mesh, &inner, snap);
        assert_eq!(body.mesh().pieces().count, 1);
        assert_eq!(body.mesh().surface().euler_characteristic(), 4);
    }
}

/// Through whole layers of particles, through edges and faces of a lattice: nothing is flat, everything separates.
#[test]
fn exactly_through_particles() {
    let mesh = kuhn_box([4; 3], DVec3::ONE);
    let layers = [
        (DVec3::X, 0.5),
        (DVec3::new(1.0, 1.0, 0.0), 1.0),
        (DVec3::ONE, 1.5),
        (DVec3::ONE, 1.0),
        (DVec3::new(1.0, -1.0, 0.0), 0.0),
    ];
    for (normal, sum) in layers {
        for nudge in [0.0, 1e-13, -1e-13] {
            let point = normal * (sum + nudge) / normal.length_squared();
            // Corners of the rectangle and its diagonal on lattice points as well.
            let u = if normal.z == 0.0 {
                DVec3::Z
            } else {
                DVec3::new(1.0, -1.0, 0.0)
            } * 2.0;
            let v = normal.cross(u);
            let surface = TriangleSurface::rectangle(point, u, v).unwrap();
            let mut body = cut_mesh(&mesh, &surface, 0.0);
            assert_eq!(
                body.mesh().pieces().count,
                2,
                "normal {normal}, nudge {nudge}"
            );
            for _ in 0..2 {
                assert!(cut(&mut body, &surface, 0.0).is_empty());
            }
        }
    }
}

/// Along the boundary or outside: nothing.
#[test]
fn touching_and_missing() {
    for x in [0.0, 1.0, 1e-13, 1.0 + 1e-13, 2.0] {
        let surface =
            TriangleSurface::rectangle(DVec3::new(x, 0.5, 0.5), DVec3::Y, DVec3::Z).unwrap();
        let mut body = CuttableMesh::new(kuhn_box([3; 3], DVec3::ONE)).unwrap();
        assert!(cut(&mut body, &surface, 0.0).is_empty(), "at {x}");
    }
}

/// A quarter of a cylinder as a strip cuts out a quarter of a rod.
#[test]
fn a_curved_strip() {
    let line = |y: f64| {
        let at = move |i: u32| {
            let angle = 0.5 * PI * (f64::from(i) / 20.0 * 1.2 - 0.1);
            DVec3::new(angle.cos() * 0.6, y, angle.sin() * 0.6)
        };
        (0..=20).map(at).collect::<Vec<_>>()
    };
    let strip = crate::bodies::strip(&line(-0.5), &line(1.5)).unwrap();
    for snap in [0.0, 0.1] {
        let body = cut_mesh(&jittered_box(6, 0.1, 6), &strip, snap);
        let volumes = volumes(&body);
        assert_eq!(volumes.len(), 2);
        let quarter = PI * 0.36 / 4.0;
        assert!(
            (volumes[0] / quarter - 1.0).abs() < 0.05,
            "{} against {quarter}",
            volumes[0]
        );
    }
}

/// Three turns of a spiral, its ends inside and at the rim: one piece.
#[test]
fn a_spiral() {
    let line = |y: f64| {
        let at = move |i: u32| {
            let turns = f64::from(i) / 40.0;
            let angle = TAU * turns;
            DVec3::new(0.5, y, 0.5)
                + DVec3::new(angle.cos(), 0.0, angle.sin()) * (0.08 + 0.13 * turns)
        };
        (0..=120).map(at).collect::<Vec<_>>()
    };
    let strip = crate::bodies::strip(&line(-0.5), &line(1.5)).unwrap();
    let mesh = kuhn_box([16, 2, 16], DVec3::ONE);
    let triangles = mesh.surface().triangles.len();
    let body = cut_mesh(&mesh, &strip, 0.1);
    assert_eq!(body.mesh().pieces().count, 1);
    assert!(body.mesh().surface().triangles.len() > 2 * triangles);
}

/// Many small triangles do what two large ones do.
#[test]
fn a_fine_surface_is_the_plane() {
    let side = 60_u32;
    let at = |i: u32, j: u32| {
        DVec3::new(
            0.43,
            3.0 * f64::from(i) / f64::from(side) - 1.0,
            3.0 * f64::from(j) / f64::from(side) - 1.0,
        )
    };
    let points: Vec<DVec3> = (0..=side)
        .flat_map(|i| (0..=side).map(move |j| at(i, j)))
        .collect();
    let cells = (0..side).flat_map(|i| (0..side).map(move |j| i * (side + 1) + j));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|p| [[p, p + 1, p + side + 2], [p, p + side + 2, p + side + 1]])
        .collect();
    let surface = TriangleSurface::new(&points, &triangles).unwrap();
    let mesh = jittered_box(8, 0.15, 2);
    let body = cut_mesh(&mesh, &surface, 0.1);
    let mut plane = CuttableMesh::new(mesh.clone()).unwrap();
    let at = Plane {
        point: DVec3::splat(0.43),
        normal: DVec3::X,
    };
    cut_plane(&mut plane, &mesh.positions, &at, &options(0.1)).unwrap();
    assert_eq!(body.mesh().tets.len(), plane.mesh().tets.len());
    assert!(close(&body, &plane, 1e-9));
}

#[test]
fn bad_surfaces_are_refused() {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X * 2.0];
    let new = |triangles: &[[u32; 3]]| TriangleSurface::new(&points, triangles);
    assert!(matches!(new(&[]), Err(CutError::EmptySurface)));
    assert!(matches!(
        new(&[[0, 1, 2], [0, 1, 4]]),
        Err(CutError::TriangleIndex {
            triangle: 1,
            point: 4,
            points: 4
        })
    ));
    for flat in [[0, 1, 1], [0, 1, 3]] {
        assert!(matches!(
            new(&[[0, 1, 2], flat]),
            Err(CutError::FlatTriangle { triangle: 1, .. })
        ));
    }
    let nan = [DVec3::ZERO, DVec3::X, DVec3::NAN];
    assert!(matches!(
        TriangleSurface::new(&nan, &[[0, 1, 2]]),
        Err(CutError::NonFinite { .. })
    ));
    // Huge ones are as good as any.
    let huge = TriangleSurface::rectangle(DVec3::splat(0.4), DVec3::X * 1e200, DVec3::Y * 1e-200);
    assert!(huge.is_ok() || matches!(huge, Err(CutError::FlatTriangle { .. })));
    let mut body = CuttableMesh::new(kuhn_box([2; 3], DVec3::ONE)).unwrap();
    let surface = new(&[[0, 1, 2]]).unwrap();
    let short = cut_surface(&mut body, &points, &surface, &CutOptions::default());
    assert!(matches!(short, Err(CutError::PositionCount { .. })));
}

/// Enough particles and tets for several threads: the same bits for one, two and three.
#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mesh = jittered_box(16, 0.15, 5);
    assert!(
        mesh.positions.len() > 4096,
        "too few to be shared among threads: the test proves nothing"
    );
    let center = DVec3::new(0.48, 0.53, 0.51);
    let (points, triangles) = icosphere(center, 0.31, 2);
    let surface = TriangleSurface::new(&points, &triangles).unwrap();
    let results = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let standing =
                cut_surface(&mut body, &mesh.positions, &surface, &options(0.1)).unwrap();
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let field = |x: DVec3| x.distance(center) - 0.33;
            let field = cut_level_set(&mut body, &mesh.positions, field, &options(0.1)).unwrap();
            let mut body = CuttableMesh::new(mesh.clone()).unwrap();
            let blade = [DVec3::new(0.4, -1.0, 1.2), DVec3::new(0.45, 2.0, 1.2)];
            let mut stroke = Sweep::new(&body, &mesh.positions, &blade, options(0.1)).unwrap();
            let pose = blade.map(|x| x - DVec3::Z * 2.0);
            let moving = stroke.advance(&mut body, &mesh.positions, &pose).unwrap();
            [standing, field, moving]
        })
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0], results[2]);
    assert!(results[0].iter().all(|delta| !delta.is_empty()));
}

/// An octahedron.
fn octahedron(center: DVec3, radius: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let axes = [
        DVec3::X,
        DVec3::NEG_X,
        DVec3::Y,
        DVec3::NEG_Y,
        DVec3::Z,
        DVec3::NEG_Z,
    ];
    let points = axes.map(|axis| center + axis * radius).to_vec();
    let mut triangles = Vec::new();
    for (x, y, z) in [
        (0, 2, 4),
        (0, 2, 5),
        (0, 3, 4),
        (0, 3, 5),
        (1, 2, 4),
        (1, 2, 5),
        (1, 3, 4),
        (1, 3, 5),
    ] {
        let odd = (x + y + z) % 2 == 1;
        triangles.push(if odd { [x, z, y] } else { [x, y, z] });
    }
    (points, triangles)
}

/// Closed surfaces whose faces, edges and corners run exactly along faces, through edges and particles of a lattice:
/// the core falls out with its exact volume, and the same again changes nothing.
#[test]
fn closed_surfaces_on_a_lattice() {
    let half = DVec3::splat(0.5);
    let quarter = 0.25;
    let solids = [
        (
            "a cube along faces",
            cuboid(half - quarter, half + quarter),
            4,
            0.125,
            true,
        ),
        (
            "a cube half a cell off",
            cuboid(half - 0.125, half + 0.375),
            4,
            0.125,
            false,
        ),
        (
            "a cube half a cell off along an axis",
            cuboid(
                half - DVec3::new(0.25, 0.25, 0.125),
                half + DVec3::new(0.25, 0.25, 0.375),
            ),
            4,
            0.125,
            false,
        ),
        (
            "an octahedron through particles",
            octahedron(half, 0.375),
            8,
            4.0 / 3.0 * 0.375_f64.powi(3),
            true,
        ),
        (
            "an octahedron through particles of a coarse lattice",
            octahedron(half, 0.25),
            4,
            4.0 / 3.0 * 0.25_f64.powi(3),
            true,
        ),
    ];
    for (what, (points, triangles), cells, volume, exact) in solids {
        let surface = TriangleSurface::new(&points, &triangles).unwrap();
        for snap in [0.0, 0.1, 0.2] {
            for nudge in [0.0, 1e-13, -1e-13] {
                let mesh = kuhn_box([cells; 3], DVec3::ONE);
                let positions: Vec<DVec3> = mesh
                    .positions
                    .iter()
                    .map(|x| *x + DVec3::splat(nudge))
                    .collect();
                let mut body = CuttableMesh::new(mesh.clone()).unwrap();
                let delta = cut_surface(&mut body, &positions, &surface, &options(snap)).unwrap();
                check_cut(&mesh, &body, &delta);
                let found = volumes(&body);
                assert_eq!(found.len(), 2, "{what}, snap {snap}, nudge {nudge:e}");
                // Within a tet the mesh cuts corners: along the twelve edges, half a length unit each, of a cube half a
                // cell off, prisms of up to half that offset squared.
                let slack = if exact {
                    1e-9
                } else {
                    12.0 * 0.5 * 0.125 * 0.125 / 2.0
                };
                let lost = volume - found[0];
                assert!(
                    lost.abs() <= slack,
                    "{what}, snap {snap}, nudge {nudge:e}: {found:?}"
                );
                let again = cut(&mut body, &surface, snap);
                assert!(
                    again.is_empty(),
                    "{what}, snap {snap}, nudge {nudge:e}, again"
                );
            }
        }
    }
}

/// Twenty triangles with sharp folds. What pokes through a tet's face at a corner of them may fall off as a crumb.
#[test]
fn coarse_balls() {
    let cases = (0..40_u8).flat_map(|i| {
        let radius = [0.35, 0.38, 0.42][usize::from(i % 3)];
        let snap = [0.05, 0.1, 0.2][usize::from(i / 3 % 3)];
        [(5, i, 0.0, radius), (6, i, snap, radius)]
    });
    for (n, i, snap, radius) in cases {
        let seed = u64::from(i);
        let mesh = if seed == 0 {
            kuhn_box([n; 3], DVec3::ONE)
        } else {
            jittered_box(n, 0.2, seed)
        };
        let center = DVec3::splat(0.5) + DVec3::splat(0.03 * noise(seed, 9));
        let (points, triangles) = icosphere(center, radius, 0);
        let surface = TriangleSurface::new(&points, &triangles).unwrap();
        let mut body = cut_mesh(&mesh, &surface, snap);
        let found = volumes(&body);
        let core = found[found.len() - 2];
        let exact = 2.5362 * radius.powi(3);
        // The mesh cuts corners along 30 folds of 1.05 radii by at most what an edge of half a cell at 41 degrees
        // spans, and snaps to both sides: a fifth of the whole at these sizes.
        assert!(
            (core / exact - 1.0).abs() < 0.2,
            "cells {n}, seed {seed}, snap {snap}: {found:?} for {exact}"
        );
        let crumbs: f64 = found[..found.len() - 2].iter().sum();
        assert!(crumbs < 2e-4, "{found:?}");
        if snap == 0.0 {
            assert!(
                cut(&mut body, &surface, snap).is_empty(),
                "cells {n}, seed {seed}, again"
            );
        }
    }
}
