//! Solids and the bodies that fill them: winding numbers compared with a direct count, errors, and the filled surfaces
//! of the given meshes.

#![expect(
    clippy::unwrap_used,
    reason = "helpers of tests stop at the first surprise"
)]

use incise_mesh::glam::{DQuat, DVec3, dvec3};
use incise_mesh::{ParticleId, TetMesh, TriangleSurface, kuhn_box};
use incise_meshing::{
    Lattice, MeshingError, Shape, Solid, generate, stuff, tetrahedralize, tetrahedralize_with,
};
use proptest::prelude::*;

fn cube() -> TriangleSurface {
    TriangleSurface::boundary_of(&kuhn_box([2, 3, 1], DVec3::splat(0.5)))
}

/// Both surfaces, as one.
fn together(mut a: TriangleSurface, b: &TriangleSurface) -> TriangleSurface {
    let first = ParticleId::new(a.positions.len()).0;
    a.positions.extend(&b.positions);
    let moved = b
        .triangles
        .iter()
        .map(|t| t.map(|p| ParticleId(p.0 + first)));
    a.triangles.extend(moved);
    a
}

fn moved(mut surface: TriangleSurface, by: DVec3) -> TriangleSurface {
    surface.positions.iter_mut().for_each(|p| *p += by);
    surface
}

fn refusal(surface: &TriangleSurface) -> String {
    match Solid::new(surface) {
        Err(MeshingError::Surface(message)) => message,
        other => panic!("{other:?}"),
    }
}

/// The sum of the solid angles of all triangles over a full turn (van Oosterom and Strackee 1983).
fn winding_by_angles(surface: &TriangleSurface, point: DVec3) -> f64 {
    let angles = surface.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|p| surface.positions[p.index()] - point);
        let (x, y, z) = (a.length(), b.length(), c.length());
        let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
        2.0 * a.dot(b.cross(c)).atan2(below)
    });
    angles.sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn points_in_planes_and_on_lines_of_the_surface_are_on_the_right_side() {
    let surface = cube();
    let solid = Solid::new(&surface).unwrap();
    let (low, high) = (solid.low(), solid.high());
    // Multiples of a sixteenth of the sides: many lie in the planes of sides, behind edges and behind corners.
    for i in -4..20 {
        for j in -4..20 {
            for k in -4..20 {
                let t = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) / 16.0;
                let point = low + t * (high - low);
                let winding = solid.winding_number(point);
                let inside = (0..3).all(|a| t[a] > 0.0 && t[a] < 1.0);
                let outside = (0..3).any(|a| t[a] < 0.0 || t[a] > 1.0);
                if inside {
                    assert_eq!(winding, 1, "{t}");
                } else if outside {
                    assert_eq!(winding, 0, "{t}");
                } else {
                    // On the surface: either side, and no distance.
                    assert!(winding == 0 || winding == 1, "{t}");
                    assert!(solid.distance(point) == 0.0, "{t}");
                }
            }
        }
    }
}

#[test]
fn overlapping_shells_and_holes() {
    let ball = TriangleSurface::boundary_of(&generate(Shape::Sphere, 500).unwrap());
    let overlapping = together(ball.clone(), &moved(ball.clone(), dvec3(0.5, 0.0, 0.0)));
    let solid = Solid::new(&overlapping).unwrap();
    assert_eq!(solid.winding_number(dvec3(0.25, 0.0, 0.0)), 2);
    assert_eq!(solid.winding_number(dvec3(-0.25, 0.0, 0.0)), 1);
    let one = Solid::new(&ball).unwrap().volume();
    assert!((solid.volume() - 2.0 * one).abs() < 1e-12);

    // The inner shell faces inward: a cavity.
    let mut inner = ball.clone();
    inner.positions.iter_mut().for_each(|p| *p *= 0.5);
    inner.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let shell = Solid::new(&together(ball, &inner)).unwrap();
    assert_eq!(shell.winding_number(DVec3::ZERO), 0);
    assert_eq!(shell.winding_number(dvec3(0.4, 0.0, 0.0)), 1);
    assert!((shell.volume() / one - 7.0 / 8.0).abs() < 1e-12);
    let body = tetrahedralize(&shell, 5_000, 0).unwrap();
    body.check().unwrap();
    assert_eq!(body.surface().euler_characteristic(), 4);
    assert!(body.surface().is_manifold());
}

#[test]
fn repairs_of_a_surface_are_reported() {
    let mut surface = cube();
    surface.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let solid = Solid::new(&surface).unwrap();
    assert!(solid.prepared().inside_out);
    assert!((solid.volume() - 0.125).abs() < 1e-15);

    let mut surface = cube();
    surface.triangles[3].swap(0, 1);
    surface.triangles[7].swap(0, 1);
    let first = surface.triangles[0];
    surface.triangles.push([first[0], first[1], first[0]]);
    let solid = Solid::new(&surface).unwrap();
    assert_eq!(
        (solid.prepared().turned, solid.prepared().degenerate),
        (2, 1)
    );
    assert_eq!(solid.winding_number(dvec3(0.1, 0.1, 0.1)), 1);

    // A soup, in which each triangle has points of its own.
    let soup = TriangleSurface {
        positions: cube()
            .triangles
            .iter()
            .flatten()
            .map(|p| cube().positions[p.index()])
            .collect(),
        triangles: (0..cube().triangles.len())
            .map(|t| [0, 1, 2].map(|i| ParticleId::new(3 * t + i)))
            .collect(),
    };
    let solid = Solid::new(&soup).unwrap();
    assert!(solid.prepared().welded > 0);
    assert!((solid.volume() - 0.125).abs() < 1e-15);
}

#[test]
fn open_surfaces_are_refused_with_their_first_edge() {
    let mut open = cube();
    let [a, b, _] = open.triangles.remove(0);
    let message = refusal(&open);
    assert!(
        message.contains("has one triangle") && message.contains("open"),
        "{message}"
    );
    assert!(
        message.contains(&a.0.to_string()) || message.contains(&b.0.to_string()),
        "{message}"
    );

    // A fin on one edge of the cube.
    let mut fin = cube();
    let [a, b, _] = fin.triangles[0];
    let tip = ParticleId::new(fin.positions.len());
    fin.positions.push(dvec3(9.0, 9.0, 9.0));
    fin.triangles.push([a, b, tip]);
    assert!(refusal(&fin).contains("triangle"), "{}", refusal(&fin));

    // A strip of five triangles with a half turn.
    let strip = TriangleSurface {
        positions: (0..5)
            .map(|i| dvec3(f64::from(i), f64::from(i * i), 1.0))
            .collect(),
        triangles: (0..5)
            .map(|i| [i, (i + 1) % 5, (i + 2) % 5].map(ParticleId))
            .collect(),
    };
    assert!(refusal(&strip).contains("edge"), "{}", refusal(&strip));

    let mut wild = cube();
    wild.positions[2].x = f64::NAN;
    assert!(refusal(&wild).contains("point 2"));
    let mut far = cube();
    far.triangles[1][2] = ParticleId(1_000);
    assert!(refusal(&far).contains("triangle 1 has point 1000"));
    assert!(refusal(&TriangleSurface::default()).contains("no triangle"));

    let solid = Solid::new(&cube()).unwrap();
    for tets in [0, 99, 5_000_000] {
        let refused = tetrahedralize(&solid, tets, 0).unwrap_err().to_string();
        assert!(refused.contains("ask for 100 to 4000000"), "{refused}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Against the solid angles, for random shells that cut through one another and themselves.
    #[test]
    fn winding_numbers_are_those_of_the_solid_angles(
        offsets in prop::collection::vec(prop::array::uniform3(-0.6..0.6_f64), 1..4),
        pull in prop::array::uniform3(-2.0..2.0_f64),
        points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 32),
    ) {
        let mut surface = TriangleSurface::default();
        for offset in offsets {
            let mut part = TriangleSurface::boundary_of(&generate(Shape::Sphere, 200).unwrap());
            // Pulled through the other side, so that the shell meets itself.
            part.positions[3] += DVec3::from_array(pull);
            surface = together(surface, &moved(part, DVec3::from_array(offset)));
        }
        let Ok(solid) = Solid::new(&surface) else { return Ok(()) };
        let sign = if solid.prepared().inside_out { -1.0 } else { 1.0 };
        for point in points.into_iter().map(DVec3::from_array) {
            let expected = sign * winding_by_angles(&surface, point);
            // The angles of points very near a triangle suffer from rounding.
            if solid.distance(point) > 1e-6 {
                prop_assert!((expected - f64::from(solid.winding_number(point))).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn distances_are_those_of_all_triangles(points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 16)) {
        let surface = TriangleSurface::boundary_of(&generate(Shape::Torus, 500).unwrap());
        let solid = Solid::new(&surface).unwrap();
        // Each triangle alone, closed by its back.
        let alone: Vec<Solid> = surface.triangles.iter().map(|&t| {
            let positions = surface.positions.clone();
            Solid::new(&TriangleSurface { positions, triangles: vec![t, [t[0], t[2], t[1]]] }).unwrap()
        }).collect();
        for point in points.into_iter().map(DVec3::from_array) {
            let distance = solid.distance(point);
            let each = alone.iter().map(|triangle| triangle.distance(point));
            let expected = each.fold(f64::INFINITY, f64::min);
            prop_assert!((distance - expected).abs() < 1e-14);
            prop_assert_eq!(solid.signed_distance_within(point, 0.05).abs(), distance.min(0.05));
        }
    }
}

/// What must hold of a body that fills a solid up to a part of its volume.
fn fills(solid: &Solid, mesh: &TetMesh, tets: usize, lost: f64) {
    mesh.check().unwrap();
    assert!(mesh.tets.len().abs_diff(tets) * 50 <= tets);
    assert!(mesh.surface().is_manifold());
    let quality = mesh.quality();
    assert!(
        quality.min_dihedral > 9.3 && quality.max_dihedral < 161.7,
        "{quality:?}"
    );
    let volume = mesh.total_volume() / solid.volume();
    assert!((volume - 1.0).abs() < lost, "{volume}");
    let surface = TriangleSurface::boundary_of(mesh);
    let spacing = (12.0 * solid.volume() / tets as f64).cbrt();
    let out = solid.farthest(&surface) / spacing;
    assert!(out < 1.0, "{out} spacings from the input");
}

/// How far the input lies from the body, in spacings.
fn missed(solid: &Solid, surface: &TriangleSurface, mesh: &TetMesh) -> f64 {
    let spacing = (12.0 * solid.volume() / mesh.tets.len() as f64).cbrt();
    Solid::new(&TriangleSurface::boundary_of(mesh))
        .unwrap()
        .farthest(surface)
        / spacing
}

#[test]
fn boundaries_of_shapes_are_filled_again() {
    // Beveled edges, and chords that lie inside a curved surface, cost volume on so coarse a lattice.
    let lost = 0.03;
    for shape in [Shape::Liver, Shape::Torus, Shape::Beam] {
        let surface = TriangleSurface::boundary_of(&generate(shape, 2_000).unwrap());
        let solid = Solid::new(&surface).unwrap();
        let mesh = tetrahedralize(&solid, 5_000, 0).unwrap();
        fills(&solid, &mesh, 5_000, lost);
        assert!(missed(&solid, &surface, &mesh) < 1.0, "{shape}");
        let euler = mesh.surface().euler_characteristic();
        assert_eq!(euler, shape.euler_characteristic(), "{shape}");
    }
}

#[test]
fn surfaces_of_given_meshes() {
    let Some(folder) = crate::given::folder() else {
        return;
    };
    // Enough tets that no thin part is lost: the tips of ears and claws are a fraction of a spacing wide before.
    for (name, tets, whole) in [
        ("liver_11k", 22_000, true),
        ("sphere_7k", 13_000, true),
        ("bunny_19k", 300_000, true),
        ("armadillo_55k", 110_000, false),
    ] {
        let given = incise_mesh_io::read(folder.join(name).with_extension("vtk")).unwrap();
        let surface = TriangleSurface::boundary_of(&given);
        let solid = Solid::new(&surface).unwrap();
        let mesh = tetrahedralize(&solid, tets, 0).unwrap();
        fills(&solid, &mesh, tets, 0.02);
        let missed = missed(&solid, &surface, &mesh);
        assert!(
            missed < if whole { 1.0 } else { 2.5 },
            "{name}: {missed} spacings"
        );
        assert_eq!(mesh.pieces().count, 1, "{name}");
        if whole {
            assert_eq!(mesh.surface().euler_characteristic(), 2, "{name}");
        }
    }
}

#[test]
fn cones_that_touch_at_a_lattice_vertex_come_apart() {
    let lattice =
        Lattice::covering(DVec3::splat(-2.0), DVec3::splat(2.0), 0.5, DVec3::ZERO).unwrap();
    let cones = |p: DVec3| (p.y.hypot(p.z) - 0.5 * p.x.abs()).max(p.x.abs() - 1.7);
    let mut mesh = stuff(&lattice, cones).unwrap();
    assert_eq!((mesh.pieces().count, mesh.face_pieces().count), (1, 2));
    assert!(!mesh.surface().is_manifold());
    assert_eq!(mesh.split_pinches(), 1);
    assert_eq!((mesh.pieces().count, mesh.face_pieces().count), (2, 2));
    assert!(mesh.surface().is_manifold());
    mesh.check().unwrap();
    assert_eq!(mesh.split_pinches(), 0);
}

#[test]
fn a_graded_inside_leaves_more_tets_for_the_surface() {
    let surface = TriangleSurface::boundary_of(&generate(Shape::Sphere, 4_000).unwrap());
    let solid = Solid::new(&surface).unwrap();
    let [uniform, graded] = [0, 4].map(|levels| tetrahedralize(&solid, 60_000, levels).unwrap());
    for mesh in [&uniform, &graded] {
        fills(&solid, mesh, 60_000, 0.02);
    }
    let triangles = |mesh: &TetMesh| mesh.surface().triangles.len();
    assert!(triangles(&graded) > triangles(&uniform) * 5 / 4);
}

#[test]
fn shells_are_counted_and_torn_bodies_have_the_fewest_pieces() {
    // Two balls joined by a rod a twentieth as thick.
    let dumbbell = |p: DVec3| {
        let balls = (p - DVec3::X).length().min((p + DVec3::X).length()) - 0.5;
        balls.min((p.y.hypot(p.z) - 0.025).max(p.x.abs() - 1.0))
    };
    let half = dvec3(1.6, 0.6, 0.6);
    let fine = Lattice::covering(-half, half, 0.015, DVec3::splat(0.3)).unwrap();
    let surface = TriangleSurface::boundary_of(&stuff(&fine, dumbbell).unwrap());
    let solid = Solid::new(&surface).unwrap();
    assert_eq!(solid.prepared().shells, 1);
    let coarse = tetrahedralize(&solid, 2_000, 0).unwrap();
    assert_eq!(coarse.pieces().count, 2);
    assert!(coarse.surface().is_manifold());

    let ball = TriangleSurface::boundary_of(&generate(Shape::Sphere, 300).unwrap());
    let two = together(ball.clone(), &moved(ball, DVec3::X * 2.0));
    assert_eq!(Solid::new(&two).unwrap().prepared().shells, 2);
}

/// The number that a refusal recommends.
fn recommended(solid: &Solid, tets: usize) -> usize {
    let message = tetrahedralize(solid, tets, 0).unwrap_err().to_string();
    let number = message.split("ask for ").nth(1).unwrap();
    number.split(' ').next().unwrap().parse().unwrap()
}

/// A plate along the axes, one across them, and the wall of a hollow ball: too few tets are refused before any is made,
/// and the number that the refusal names gives one sound piece.
#[test]
fn thin_bodies_are_refused_with_a_number_that_works() {
    let plate = TriangleSurface::boundary_of(&kuhn_box([1, 1, 1], dvec3(1.0, 1.0, 0.03)));
    let mut oblique = plate.clone();
    let turn = DQuat::from_xyzw(0.3, -0.5, 0.2, 0.7).normalize();
    oblique.positions.iter_mut().for_each(|p| *p = turn * *p);
    let ball = TriangleSurface::boundary_of(&generate(Shape::Sphere, 3_000).unwrap());
    let mut inner = ball.clone();
    inner.positions.iter_mut().for_each(|p| *p *= 0.85);
    inner.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    for (surface, pieces) in [(plate, 1), (oblique, 1), (together(ball, &inner), 1)] {
        let solid = Solid::new(&surface).unwrap();
        let mut attempts = 0;
        let refused = tetrahedralize_with(&solid, 150, 0, &mut |_| attempts += 1);
        assert!(refused.is_err() && attempts == 0);
        let tets = recommended(&solid, 150);
        let mesh = tetrahedralize(&solid, tets, 0).unwrap();
        mesh.check().unwrap();
        assert_eq!(mesh.pieces().count, pieces, "{tets}");
        assert!(mesh.tets.len().abs_diff(tets) * 50 <= tets);
        // Two layers of vertices: where a layer lies near the surface, up to a sixth is beveled away.
        let part = mesh.total_volume() / solid.volume();
        assert!(part > 0.85, "{tets}: {part}");
        // No hole: only the thin corners of a plate lie farther away than a spacing.
        assert!(missed(&solid, &surface, &mesh) < 2.0);
    }
}

/// Each triangle of a surface is found by points near its middle, in the numbers of the surface: also where some were
/// dropped or turned.
#[test]
fn nearest_triangles_have_the_numbers_of_the_surface() {
    let mut surface = TriangleSurface::boundary_of(&generate(Shape::Torus, 400).unwrap());
    let first = surface.triangles[0];
    surface.triangles.insert(5, [first[0], first[1], first[0]]);
    surface.triangles[7].swap(0, 1);
    let solid = Solid::new(&surface).unwrap();
    for (t, triangle) in surface
        .triangles
        .iter()
        .enumerate()
        .filter(|(t, _)| *t != 5)
    {
        let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
        assert_eq!(solid.nearest_triangle((a + b + c) / 3.0), t);
    }
}
