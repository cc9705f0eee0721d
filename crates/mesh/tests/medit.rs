//! Medit files of other programs, where the folder with them is at hand.

use incise_mesh::glam::DVec3;
use incise_mesh::{TetMesh, io};

use crate::given::folder;

/// The same tets, and coordinates within the given distance.
fn assert_same(mesh: &TetMesh, original: &TetMesh, tolerance: f64, name: &str) {
    assert_eq!(mesh.tets, original.tets, "{name}");
    assert_eq!(mesh.positions.len(), original.positions.len(), "{name}");
    for (p, q) in mesh.positions.iter().zip(&original.positions) {
        assert!(
            (*p - *q).abs().max_element() <= tolerance,
            "{name}: {p} {q}"
        );
    }
}

fn center_and_scale(positions: &mut [DVec3]) {
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions
        .iter()
        .copied()
        .fold(DVec3::NEG_INFINITY, DVec3::max);
    for p in positions {
        *p = (*p - (low + high) / 2.0) / (high - low).max_element();
    }
}

#[test]
fn medit_files_of_other_programs() {
    let Some(folder) = folder() else { return };
    for name in ["liver_5k", "sphere_7k"] {
        let original = io::read(folder.join(format!("{name}.vtk"))).unwrap();
        // TetGen wrote the mesh before it was centered and its longest side scaled to 1, which was then rounded to 9
        // digits.
        for (kind, tolerance) in [
            ("gmsh.mesh", 0.0),
            ("meshio.mesh", 0.0),
            ("meshio.meshb", 0.0),
            ("tetgen0.mesh", 2e-9),
            ("tetgen1.mesh", 2e-9),
        ] {
            let kind = format!("{name}.{kind}");
            let mut file = io::read_medit(folder.join("formats").join(&kind)).unwrap();
            if kind.contains("tetgen") {
                center_and_scale(&mut file.mesh.positions);
            }
            assert_same(&file.mesh, &original, tolerance, &kind);
            file.mesh.check().unwrap();
            // Gmsh and meshio give all tets the reference 1, TetGen none.
            let expected = if kind.contains("tetgen") {
                0
            } else {
                file.mesh.tets.len()
            };
            assert_eq!(file.regions, vec![1; expected], "{kind}");
        }
    }
}
