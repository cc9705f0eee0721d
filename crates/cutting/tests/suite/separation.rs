//! The rule that says what a cut separates, and the paper's criterion where it agrees and where it fails.

use glam::DVec3;
use incise_cutting::{CutOptions, CuttableMesh, Plane, Separation, cut_plane};
use incise_mesh::{ParticleId, TetMesh, kuhn_box, signed_volume};
use proptest::prelude::*;

use crate::bodies::{body, jittered_box, noise};

const X_HALF: Plane = Plane {
    point: DVec3::new(0.5, 0.5, 0.5),
    normal: DVec3::X,
};

/// Without the rule for crumbs, which only cut faces have.
fn cut(mesh: &TetMesh, plane: &Plane, snap: f64, separation: Separation) -> CuttableMesh {
    cut_with_crumbs(mesh, plane, snap, separation, 0.0)
}

fn cut_with_crumbs(
    mesh: &TetMesh,
    plane: &Plane,
    snap: f64,
    separation: Separation,
    crumbs: f64,
) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let options = CutOptions {
        snap,
        separation,
        crumbs,
        ..CutOptions::default()
    };
    cut_plane(&mut body, &mesh.positions, plane, &options).unwrap();
    body.check().unwrap();
    body
}

fn pieces(mesh: &TetMesh, plane: &Plane, snap: f64, separation: Separation) -> usize {
    cut(mesh, plane, snap, separation).mesh().pieces().count
}

/// A body and a plane near its center.
fn body_and_plane(kind: usize, seed: u64) -> (TetMesh, Plane) {
    let mesh = body(kind, seed);
    let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
    let center = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
    let point = center + normal * 0.01;
    (mesh, Plane { point, normal })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Without a particle on the surface all three criteria give the same mesh; with snapped particles the one with
    /// particles off the surface still does.
    #[test]
    fn the_criteria_agree_where_they_should(
        kind in 0_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.1]),
    ) {
        let (mesh, plane) = body_and_plane(kind, seed);
        prop_assume!(plane.normal.length() > 0.1);
        let by_faces = cut(&mesh, &plane, snap, Separation::CutFaces);
        let by_particles = cut(&mesh, &plane, snap, Separation::SharedOffSurface);
        prop_assert_eq!(by_faces.mesh(), by_particles.mesh());
        if snap == 0.0 {
            let literal = cut(&mesh, &plane, snap, Separation::SharedOriginal);
            prop_assert_eq!(by_faces.mesh(), literal.mesh());
        }
    }
}

/// Four tets with a fifth of the mean volume come off a torus by both criteria; by default they stay where faces are cut.
#[test]
fn a_crumb_stays_where_faces_are_cut() {
    let (mesh, plane) = body_and_plane(5, 15_881_079_787_010_595_576);
    let [faces, particles] = [Separation::CutFaces, Separation::SharedOffSurface]
        .map(|separation| cut(&mesh, &plane, 0.1, separation));
    assert_eq!(faces.mesh(), particles.mesh());
    assert_eq!(faces.mesh().pieces().count, 3);
    let kept = cut_with_crumbs(&mesh, &plane, 0.1, Separation::CutFaces, 0.5);
    assert_eq!(kept.mesh().pieces().count, 2);
}

/// A plane through a layer of particles: they were there before, so the literal criterion keeps both sides tied.
#[test]
fn literal_criterion_fails_at_particles_on_the_plane() {
    let mesh = kuhn_box([4; 3], DVec3::ONE);
    assert_eq!(pieces(&mesh, &X_HALF, 0.0, Separation::CutFaces), 2);
    assert_eq!(pieces(&mesh, &X_HALF, 0.0, Separation::SharedOffSurface), 2);
    assert_eq!(pieces(&mesh, &X_HALF, 0.0, Separation::SharedOriginal), 1);
}

/// One snapped particle is enough to hold a body together for ever.
#[test]
fn literal_criterion_fails_at_snapped_particles() {
    let mesh = jittered_box(5, 0.3, 4);
    let plane = Plane {
        point: DVec3::new(0.4, 0.5, 0.5),
        normal: DVec3::new(1.0, 0.1, 0.05),
    };
    assert_eq!(pieces(&mesh, &plane, 0.1, Separation::CutFaces), 2);
    assert_eq!(pieces(&mesh, &plane, 0.1, Separation::SharedOffSurface), 2);
    assert_eq!(pieces(&mesh, &plane, 0.1, Separation::SharedOriginal), 1);
}

/// A tet with all four particles on the surface shares nothing with other tets and comes off as a chip.
#[test]
fn a_tet_on_the_surface_floats_off() {
    // A thin tet between four others: its particles lie within 0.02 of the plane x = 0.
    let mesh = oriented(
        vec![
            DVec3::new(0.02, 0.0, 0.0),
            DVec3::new(0.02, 1.0, 1.0),
            DVec3::new(-0.02, 1.0, 0.0),
            DVec3::new(-0.02, 0.0, 1.0),
            DVec3::new(1.0, 0.7, 0.6),
            DVec3::new(-1.0, 0.7, 0.6),
        ],
        &[
            [0, 1, 2, 3],
            [0, 1, 2, 4],
            [0, 1, 3, 4],
            [0, 2, 3, 5],
            [1, 2, 3, 5],
        ],
    );
    let plane = Plane {
        point: DVec3::ZERO,
        normal: DVec3::X,
    };
    assert_eq!(pieces(&mesh, &plane, 0.25, Separation::CutFaces), 2);
    let off_surface = pieces(&mesh, &plane, 0.25, Separation::SharedOffSurface);
    assert!(off_surface > 2, "{off_surface} pieces");
}

/// Two tets on the positive side of a bent sheet of snapped particles: no edge between them is crossed, so nothing may
/// separate there. The particle criterion tears them.
#[test]
fn a_grazed_sheet_holds() {
    let mesh = oriented(
        vec![
            DVec3::new(0.05, 0.0, 0.0), // snapped by the third tet
            DVec3::new(0.0, 1.0, 0.0),
            DVec3::new(0.0, 0.0, 1.0),
            DVec3::new(1.0, 0.3, 0.3),
            DVec3::new(0.01, 0.05, 0.05),
            DVec3::new(-1.0, -0.1, -0.1),
            DVec3::new(-1.0, -1.0, 0.0),
            DVec3::new(-1.0, 0.0, -1.0),
        ],
        &[[0, 1, 2, 3], [0, 1, 2, 4], [0, 5, 6, 7]],
    );
    let plane = Plane {
        point: DVec3::ZERO,
        normal: DVec3::X,
    };
    assert_eq!(pieces(&mesh, &plane, 0.1, Separation::CutFaces), 2);
    assert_eq!(pieces(&mesh, &plane, 0.1, Separation::SharedOffSurface), 3);
}

/// A mesh of tets given in any orientation.
fn oriented(positions: Vec<DVec3>, tets: &[[u32; 4]]) -> TetMesh {
    let positive = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(ParticleId);
        let volume = signed_volume(tet.map(|p| positions[p as usize]));
        if volume > 0.0 {
            [a, b, c, d]
        } else {
            [b, a, c, d]
        }
    };
    let tets = tets.iter().map(positive).collect();
    let mesh = TetMesh { positions, tets };
    mesh.check().unwrap();
    mesh
}
