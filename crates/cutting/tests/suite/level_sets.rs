//! Level sets.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_cutting::{
    CutError, CutOptions, CuttableMesh, FaceTag, Plane, cut_level_set, cut_plane,
};
use incise_mesh::{ParticleId, TetMesh};
use proptest::prelude::*;

use crate::bodies::{bend, body, check_cut, jittered_box, noise, options, relabelled, volumes};

const CENTER: DVec3 = DVec3::new(0.48, 0.53, 0.51);

fn ball(x: DVec3) -> f64 {
    x.distance(CENTER) - 0.31
}

fn cut(mesh: &TetMesh, field: impl Fn(DVec3) -> f64 + Sync, snap: f64) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let delta = cut_level_set(&mut body, &mesh.positions, field, &options(snap)).unwrap();
    check_cut(mesh, &body, &delta);
    body
}

/// A ball in a box: a core (one sphere, 2) and a shell (two spheres, 4).
#[test]
fn a_ball_in_a_box() {
    for (n, snap) in [(6, 0.0), (6, 0.1), (9, 0.05), (12, 0.1)] {
        let mut body = cut(&jittered_box(n, 0.15, 3), ball, snap);
        let mesh = body.mesh();
        assert_eq!(mesh.pieces().count, 2);
        assert_eq!(mesh.surface().euler_characteristic(), 6);
        let core = volumes(&body)[0];
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.31_f64.powi(3);
        let h = 1.0 / n as f64;
        // Chords of a sphere of radius r in tets of edges up to √3 h lie up to 3 h² / 8 r inside, and snapped particles
        // lie off it on both sides: four times the ball's surface by h² holds both.
        assert!(
            (core - exact).abs() < 4.0 * h * h,
            "{core} against {exact} at h = {h}"
        );
        let positions = mesh.positions.clone();
        let again = cut_level_set(&mut body, &positions, ball, &options(snap)).unwrap();
        assert!(again.is_empty());
    }
}

/// The direction of a field of waves.
fn wave(seed: u64) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| 3.0 * noise(seed, k)))
}

fn wavy(wave: DVec3, x: DVec3) -> f64 {
    wave.dot(x).sin() + 0.5 * wave.dot(DVec3::new(x.y, x.z, x.x)).cos() - 0.2
}

/// Repeats a cut. Nothing separates, and no edge is cut but of particles that were snapped onto the surface: they lie
/// beside it, and edges between them and the other side may cross it.
fn changes_nothing_again(
    once: &mut CuttableMesh,
    field: impl Fn(DVec3) -> f64 + Sync,
    snap: f64,
) -> Result<(), TestCaseError> {
    let before = once.mesh().clone();
    let cut_faces = once.boundary().filter(|t| t.tag != FaceTag::Outer);
    let on_cut: BTreeSet<ParticleId> = cut_faces.flat_map(|t| t.particles).collect();
    let again = cut_level_set(once, &before.positions, &field, &options(snap)).unwrap();
    prop_assert!(again.copies.is_empty());
    for point in &again.points {
        let is_snapped =
            |p: &ParticleId| on_cut.contains(p) && field(before.positions[p.index()]).abs() > 1e-12;
        prop_assert!(snap > 0.0 && point.ends.iter().any(is_snapped), "{point:?}");
    }
    prop_assert_eq!(again.is_empty(), again.points.is_empty());
    Ok(())
}

/// A particle was snapped that has an edge to the other side of the surface, which the second cut splits.
#[test]
fn a_snapped_particle_with_an_edge_across_the_surface() {
    let (seed, snap) = (9_551_384_932_633_782_504, 0.05);
    let field = |x: DVec3| wavy(wave(seed), x);
    let mut once = cut(&body(1, seed), field, snap);
    let before = once.mesh().tets.len();
    changes_nothing_again(&mut once, field, snap).unwrap();
    assert_eq!(once.mesh().tets.len(), before + 2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// A plane as a field is the plane, on resting and bent bodies.
    #[test]
    fn a_plane_as_a_field(
        kind in 0_usize..6, seed in any::<u64>(), bent in prop::bool::ANY,
        snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2]),
    ) {
        let mesh = body(kind, seed);
        let positions = if bent { bend(&mesh, 0.2) } else { mesh.positions.clone() };
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        prop_assume!(normal.length() > 0.1);
        let normal = normal.normalize();
        let point = positions.iter().sum::<DVec3>() / positions.len() as f64;
        let mut one = CuttableMesh::new(mesh.clone()).unwrap();
        cut_plane(&mut one, &positions, &Plane { point, normal }, &options(snap)).unwrap();
        let mut other = CuttableMesh::new(mesh.clone()).unwrap();
        let delta = cut_level_set(&mut other, &positions, |x| normal.dot(x - point), &options(snap)).unwrap();
        check_cut(&mesh, &other, &delta);
        let (one, other) = (volumes(&one), volumes(&other));
        prop_assert_eq!(one.len(), other.len());
        for (a, b) in one.into_iter().zip(other) {
            prop_assert!((a - b).abs() < 1e-9);
        }
    }

    /// Any smooth field: the same again changes nothing but beside snapped particles; the negated field and other names for the particles give the
    /// same pieces.
    #[test]
    fn waves(kind in 0_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.05, 0.1, 0.2])) {
        let mesh = body(kind, seed);
        let wave = wave(seed);
        let field = |x: DVec3| wavy(wave, x);
        let mut once = cut(&mesh, field, snap);
        let expected = volumes(&once);

        changes_nothing_again(&mut once, field, snap)?;

        let same = |other: &CuttableMesh, slack: f64| {
            let other = volumes(other);
            other.len() == expected.len() && other.iter().zip(&expected).all(|(a, b)| (a - b).abs() < slack)
        };
        prop_assert!(same(&cut(&mesh, |x| -field(x), snap), 1e-12));
        // Ties of edge length go by the names: bent quads are halved along other diagonals, which matters in a tet
        // alone.
        let (renamed, _) = relabelled(&mesh, seed);
        let slack = mesh.total_volume() * if kind == 0 { 1.0 } else { 0.02 };
        prop_assert!(same(&cut(&renamed, field, snap), slack));
    }
}

#[test]
fn a_field_of_one_sign_changes_nothing() {
    let mesh = jittered_box(3, 0.1, 1);
    for field in [|_: DVec3| 1.0, |_: DVec3| 0.0, |x: DVec3| x.x] {
        let body = cut(&mesh, field, 0.1);
        assert_eq!(body.mesh(), &mesh);
    }
}

#[test]
fn bad_fields_change_nothing() {
    let mesh = jittered_box(3, 0.1, 1);
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let default = CutOptions::default();
    let nan = cut_level_set(&mut body, &mesh.positions, |x| (x.x - 0.5).sqrt(), &default);
    assert!(matches!(nan, Err(CutError::NonFinite { .. })));
    let hole = |x: DVec3| {
        let inner = mesh.positions.contains(&x);
        if inner { x.x - 0.5 } else { f64::INFINITY }
    };
    let hole = cut_level_set(&mut body, &mesh.positions, hole, &default);
    assert!(matches!(hole, Err(CutError::NonFinite { .. })));
    let short = cut_level_set(&mut body, &mesh.positions[1..], ball, &default);
    assert!(matches!(short, Err(CutError::PositionCount { .. })));
    assert_eq!(body.mesh(), &mesh);
}
