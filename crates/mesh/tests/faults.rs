//! Every fault of a mesh is found, counted and reported.

use incise_mesh::glam::DVec3;
use incise_mesh::{CheckReport, Fault, MeshError, ParticleId, TetId, TetMesh, kuhn_box};

fn cube() -> TetMesh {
    kuhn_box([2, 2, 2], DVec3::ONE)
}

fn report(mesh: &TetMesh) -> (CheckReport, String) {
    match mesh.check() {
        Err(error @ MeshError::Faulty(_)) => (mesh.check_report(), error.to_string()),
        other => panic!("a fault expected, not {other:?}"),
    }
}

#[test]
fn empty() {
    assert!(matches!(TetMesh::default().check(), Err(MeshError::Empty)));
    assert!(TetMesh::default().check_report().is_sound());
}

#[test]
fn non_finite() {
    for (axis, value) in [(0, f64::NAN), (1, f64::INFINITY), (2, f64::NEG_INFINITY)] {
        let mut mesh = cube();
        mesh.positions[13][axis] = value;
        let (report, text) = report(&mesh);
        assert_eq!(report.non_finite, 1);
        assert_eq!(report.non_positive, 0);
        assert!(matches!(
            report.first,
            Some(Fault::NonFinite {
                particle: ParticleId(13),
                ..
            })
        ));
        assert!(
            text.contains("particle 13 is at (")
                && text
                    .to_lowercase()
                    .contains(&value.to_string().to_lowercase())
        );
    }
}

#[test]
fn out_of_range() {
    let mut mesh = cube();
    mesh.tets[5][2] = ParticleId(27);
    mesh.tets[9][0] = ParticleId(u32::MAX);
    let (report, text) = report(&mesh);
    assert_eq!(
        (report.out_of_range, report.crowded, report.overlapping),
        (2, 0, 0)
    );
    assert!(
        text.contains("tet 5 has the corner 27 but there are only 27 particles"),
        "{text}"
    );
}

#[test]
fn repeated() {
    let mut mesh = cube();
    mesh.tets[3][1] = mesh.tets[3][3];
    let (report, text) = report(&mesh);
    assert_eq!((report.repeated, report.non_positive), (1, 0));
    assert!(text.contains("tet 3 has particle"), "{text}");
}

#[test]
fn flat_and_inverted() {
    let mut mesh = cube();
    mesh.tets[4].swap(1, 2);
    let (turned, text) = report(&mesh);
    assert_eq!(turned.non_positive, 1);
    assert!(turned.overlapping > 0);
    assert!(text.contains("first: tet 4 has the volume -"), "{text}");
    assert_eq!(mesh.orient_positively(), 1);
    mesh.check().unwrap();

    // In one plane, and off it by the smallest representable step.
    let mut mesh = TetMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, 0.0)],
        tets: vec![[0, 1, 2, 3].map(ParticleId)],
    };
    assert_eq!(report(&mesh).0.non_positive, 1);
    mesh.positions[3].z = 1e-100;
    mesh.check().unwrap();
}

#[test]
fn crowded_face() {
    let mut mesh = cube();
    // Corners 0 and 3 are the ends of the diagonal of a cell, so that this face is inside it.
    let [a, b, _, c] = mesh.tets[20];
    mesh.positions.push(DVec3::new(9.0, 4.0, 2.0));
    mesh.tets.push([a, b, c, ParticleId(27)]);
    mesh.orient_positively();
    let (report, text) = report(&mesh);
    assert_eq!(report.crowded, 1);
    assert!(text.contains("has 3 tets"), "{text}");
}

#[test]
fn overlapping_tets() {
    let mesh = TetMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::splat(0.2)],
        tets: vec![[0, 1, 2, 3].map(ParticleId), [0, 1, 2, 4].map(ParticleId)],
    };
    let (report, text) = report(&mesh);
    assert_eq!(report.overlapping, 1);
    assert_eq!(
        report.first,
        Some(Fault::Overlapping {
            face: [0, 1, 2].map(ParticleId),
            tets: [TetId(0), TetId(1)]
        })
    );
    assert!(
        text.contains("tets 0 and 1 lie on the same side of face (0, 1, 2)"),
        "{text}"
    );
}
