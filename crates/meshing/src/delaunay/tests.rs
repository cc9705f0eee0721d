//! Tests of the defining property by brute force, of the hull, and of named degenerate cases.

use glam::dvec3;
use incise_mesh::TetId;
use proptest::prelude::*;

use super::*;
use crate::delaunay::cells::is_in_sphere;
use crate::random::in_cube;

/// Asserts a valid mesh with a convex surface that uses each position once and has empty circumspheres.
fn assert_delaunay(points: &[DVec3]) -> TetMesh {
    let mesh = delaunay(points).expect("the points span a volume");
    assert_eq!(mesh.positions, points);
    // Tested at a scale without overflow.
    let scaled = TetMesh {
        positions: scaled(points),
        tets: mesh.tets.clone(),
    };
    scaled.check().expect("sound");
    let surface = scaled.surface();
    assert!(surface.is_manifold());
    assert_eq!(surface.euler_characteristic(), 2);
    assert_eq!(scaled.face_pieces().count, 1);
    let at = |p: ParticleId| scaled.positions[p.index()];
    for &[a, b, c] in &surface.triangles {
        let outside = |&p: &DVec3| orientation([at(a), at(b), at(c), p]) > 0.0;
        assert!(!scaled.positions.iter().any(outside), "the hull is convex");
    }
    for t in 0..scaled.tets.len() {
        let corners = scaled.corners(TetId::new(t));
        assert!(!scaled.positions.iter().any(|&p| is_in_sphere(corners, p)));
    }
    let mut positions: Vec<[u64; 3]> = points
        .iter()
        .map(|p| (*p + 0.0).to_array().map(f64::to_bits))
        .collect();
    let mut used: Vec<ParticleId> = mesh.tets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut used: Vec<_> = used.iter().map(|p| positions[p.index()]).collect();
    for list in [&mut positions, &mut used] {
        list.sort_unstable();
    }
    positions.dedup();
    assert_eq!(used, positions, "each position once");
    mesh
}

fn grid(n: i32) -> Vec<DVec3> {
    let range = 0..n;
    range
        .clone()
        .flat_map(|i| {
            range.clone().flat_map(move |j| {
                (0..n).map(move |k| dvec3(f64::from(i), f64::from(j), f64::from(k)))
            })
        })
        .collect()
}

fn is_flat(points: &[DVec3]) -> bool {
    matches!(delaunay(points), Err(MeshingError::Points(_)))
}

#[test]
fn four_points() {
    let mesh = assert_delaunay(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
    assert_eq!(mesh.tets.len(), 1);
    assert_delaunay(&[DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::Z]);
}

#[test]
fn no_volume() {
    assert!(is_flat(&[]));
    assert!(is_flat(&[DVec3::ONE; 9]));
    assert!(is_flat(&[DVec3::ZERO, DVec3::X, DVec3::Y]));
    let line: Vec<_> = (0..20)
        .map(|i| f64::from(i) * dvec3(1.0, 3.0, 5.0))
        .collect();
    assert!(is_flat(&line));
    let plane: Vec<_> = (0..40)
        .map(|i| dvec3(f64::from(i % 7), f64::from(i / 7), 0.0))
        .map(|p| p + p.x * DVec3::Z)
        .collect();
    assert!(is_flat(&plane));
    // One point a rounding error off the plane is enough.
    let mut off = plane;
    off[17].z = off[17].z.next_up();
    assert_delaunay(&off);
}

#[test]
fn invalid_points_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut points = grid(2);
        points[3].y = bad;
        let message = delaunay(&points).expect_err("not finite").to_string();
        assert!(message.contains("point 3"), "{message}");
    }
}

#[test]
fn grids() {
    for n in [2, 3, 5] {
        let mesh = assert_delaunay(&grid(n));
        let volume = f64::from((n - 1) * (n - 1) * (n - 1));
        // Only sixths are rounded.
        assert!((mesh.total_volume() / volume - 1.0).abs() < 1e-13);
    }
}

#[test]
fn duplicates() {
    let mut points = grid(3);
    points.extend(grid(3));
    points.extend([-DVec3::ZERO, DVec3::ONE, DVec3::ONE]);
    assert!((assert_delaunay(&points).total_volume() - 8.0).abs() < 1e-12);
}

#[test]
fn on_a_sphere() {
    // Exactly: whole numbers with x² + y² + z² = 9² · 5², in all signs and orders.
    let mut points = Vec::new();
    for x in -45..=45_i32 {
        for y in -45..=45_i32 {
            for z in -45..=45_i32 {
                if x * x + y * y + z * z == 45 * 45 {
                    points.push(dvec3(f64::from(x), f64::from(y), f64::from(z)));
                }
            }
        }
    }
    assert!(points.len() > 200);
    assert_delaunay(&points);
    // Nearly cospherical points and their center.
    let mut points: Vec<_> = (0..300).map(|n| in_cube(3, n).normalize()).collect();
    assert_delaunay(&points);
    points.push(DVec3::ZERO);
    assert_delaunay(&points);
}

#[test]
fn two_skew_lines_and_one_line_beside_a_point() {
    let mut points: Vec<_> = (0..12).map(|i| dvec3(f64::from(i), 0.0, 0.0)).collect();
    points.extend((0..12).map(|i| dvec3(0.0, f64::from(i), 1.0)));
    assert_eq!(assert_delaunay(&points).tets.len(), 11 * 11);
    let mut points: Vec<_> = (0..30).map(|i| dvec3(f64::from(i), 0.0, 0.0)).collect();
    points.extend([DVec3::Y, DVec3::Z]);
    assert_eq!(assert_delaunay(&points).tets.len(), 29);
}

#[test]
fn all_scales() {
    let points: Vec<_> = (0..60).map(|n| in_cube(11, n)).collect();
    let mesh = assert_delaunay(&points);
    for scale in [
        2.0_f64.powi(-900),
        2.0_f64.powi(-40),
        2.0_f64.powi(60),
        2.0_f64.powi(1020),
    ] {
        let moved: Vec<_> = points.iter().map(|p| *p * scale).collect();
        assert_eq!(assert_delaunay(&moved).tets, mesh.tets);
    }
    // Far from the origin coordinates are coarse, and many points become coplanar.
    let far: Vec<_> = points.iter().map(|p| *p + 1e15).collect();
    assert_delaunay(&far);
    // Flat and thin point sets.
    assert_delaunay(
        &points
            .iter()
            .map(|p| *p * dvec3(1.0, 1.0, 1e-14))
            .collect::<Vec<_>>(),
    );
    assert_delaunay(
        &points
            .iter()
            .map(|p| *p * dvec3(1.0, 1e-13, 1e-14))
            .collect::<Vec<_>>(),
    );
}

#[test]
fn many_points_in_linear_time() {
    // Too many for brute force: the local property, which implies the global one, is left to the check of the hull.
    let points: Vec<_> = (0..20_000).map(|n| in_cube(5, n)).collect();
    let mesh = delaunay(&points).expect("a volume");
    mesh.check().expect("sound");
    // Poisson points have 24 pi²/35 = 6.77 tets each in the mean; a cube has fewer at its surface.
    let ratio = mesh.tets.len() as f64 / points.len() as f64;
    assert!((6.4..6.8).contains(&ratio), "{ratio}");
    assert!((mesh.total_volume() / mesh.surface().volume(&points) - 1.0).abs() < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Integers in a small range: nearly everything is degenerate.
    #[test]
    fn small_whole_numbers(coordinates in prop::collection::vec(prop::array::uniform3(0..4_i32), 0..60)) {
        let points: Vec<_> = coordinates.iter().map(|c| DVec3::from_array(c.map(f64::from))).collect();
        if is_flat(&points) {
            for a in 1..points.len() {
                for b in 1..a {
                    for c in 1..b {
                        prop_assert!(orientation([points[0], points[a], points[b], points[c]]) == 0.0);
                    }
                }
            }
        } else {
            assert_delaunay(&points);
        }
    }

    /// General points, some of them on common planes and lines to rounding.
    #[test]
    fn general_points(seed in 0..u64::MAX, count in 4..80_u64, coarse in 0..3_u8) {
        let points: Vec<_> = (0..count).map(|n| {
            let p = in_cube(seed, n);
            match coarse {
                0 => p,
                1 => (p * 3.0).round() * 0.1,
                _ => p.normalize() * dvec3(1.0, 0.7, 1.3),
            }
        }).collect();
        if !is_flat(&points) {
            assert_delaunay(&points);
        }
    }
}
