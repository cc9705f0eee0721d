//! Meshes made by other programs, where a folder with some is at hand.
//!
//! The folder `shared/meshes` is looked for beside the workspace, or in the folder that the environment variable
//! `INCISE_SHARED` names. Without it the tests say so and pass.

use std::fs;
use std::io::{Write, stderr};
use std::path::{Path, PathBuf};

use incise_mesh::io;

pub(crate) fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("INCISE_SHARED").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = shared.unwrap_or(beside).join("meshes");
    if !folder.is_dir() {
        // Not by `eprintln`, which is shown for tests that fail only.
        let line = format!("SKIPPED: there is no folder {}\n", folder.display());
        stderr()
            .write_all(line.as_bytes())
            .expect("there is a stderr");
        return None;
    }
    Some(folder)
}

/// The numbers after a keyword at the start of a line, found without the reader.
fn announced(text: &str, keyword: &str) -> Option<Vec<usize>> {
    let line = text.lines().find(|line| line.starts_with(keyword))?;
    Some(
        line.split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect(),
    )
}

#[test]
fn vtk_files() {
    let Some(folder) = folder() else { return };
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "vtk") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let mesh = io::read(&path).unwrap();
        assert_eq!(
            Some(mesh.positions.len()),
            announced(&text, "POINTS ").map(|n| n[0])
        );
        assert_eq!(
            Some(mesh.tets.len()),
            announced(&text, "CELL_TYPES ").map(|n| n[0])
        );
        mesh.check().unwrap();
        assert_eq!(mesh.pieces().count, 1);
        assert_eq!(mesh.surface().euler_characteristic(), 2);
    }
}

#[test]
fn the_same_mesh_from_different_programs() {
    let Some(folder) = folder() else { return };
    for name in ["liver_5k", "sphere_7k"] {
        let original = io::read(folder.join(format!("{name}.vtk"))).unwrap();
        for kind in [
            "gmsh.ascii.vtk",
            "meshio.vtk51.ascii.vtk",
            "tetgen0.node",
            "tetgen1.ele",
            "meshio.node",
        ] {
            let mesh = io::read(folder.join("formats").join(format!("{name}.{kind}"))).unwrap();
            assert_eq!(mesh.positions.len(), original.positions.len());
            assert_eq!(mesh.tets.len(), original.tets.len());
            mesh.check().unwrap();
            // TetGen's own files show the mesh before its longest side was scaled to 1.
            assert!(
                (mesh.total_volume() / original.total_volume() - 1.0).abs() < 0.02,
                "{name}.{kind}"
            );
        }
        // These keep the order of points and tets and every digit of the original.
        for kind in [
            "gmsh.ascii.vtk",
            "gmsh.bin.vtk",
            "meshio.vtk42.bin.vtk",
            "meshio.vtk51.ascii.vtk",
            "meshio.vtk51.bin.vtk",
            "meshio.vtu",
        ] {
            let path = folder.join("formats").join(format!("{name}.{kind}"));
            let file = match kind.ends_with("vtu") {
                true => io::read_vtu(path).unwrap(),
                false => io::read_vtk_file(path).unwrap(),
            };
            assert_eq!(file.mesh.tets, original.tets, "{name}.{kind}");
            assert_eq!(file.mesh.positions, original.positions, "{name}.{kind}");
        }
        // TetGen's own order, as in its own files; these are oriented when read.
        let formats = folder.join("formats");
        let file = io::read_vtk_file(formats.join(format!("{name}.tetgen1.vtk"))).unwrap();
        let mut oriented = file.mesh;
        oriented.orient_positively();
        let same = io::read(formats.join(format!("{name}.tetgen1.ele"))).unwrap();
        assert_eq!(oriented.tets, same.tets, "{name}");
        for (a, b) in oriented.positions.iter().zip(&same.positions) {
            // Both are texts of 17 digits, which is exact.
            assert_eq!(a, b, "{name}");
        }
        // Asked to count from 0, TetGen 1.5 counts the points in its VTK file from 1, which VTK does not know.
        let error = io::read_vtk_file(formats.join(format!("{name}.tetgen0.vtk"))).unwrap_err();
        let expected = format!("but there are {}, counted from 0", same.positions.len());
        assert!(error.to_string().contains(&expected), "{error}");
    }
}
