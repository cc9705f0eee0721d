//! Meshes made by other programs, where a folder with some is at hand.
//!
//! The folder `shared/meshes` is looked for beside the workspace, or in the folder that the environment variable
//! `INCISE_SHARED` names. Without it the tests say so and pass.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{Write, stderr};
use std::path::{Path, PathBuf};

use incise_mesh::TetMesh;
use incise_mesh::glam::DVec3;
use incise_mesh_io::NamedValues;

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
        let mesh = incise_mesh_io::read(&path).unwrap();
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

/// Whether a program wrote its own mesh, which was turned, centered and scaled to a longest side of 1 for the original.
fn is_raw(name: &str) -> bool {
    name.contains(".tetgen")
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

/// Why a file of the list is an error, if it is one.
fn refusal(name: &str) -> Option<&'static str> {
    if name.ends_with(".face") {
        Some("use one of the endings")
    } else if name.ends_with(".tetgen0.vtk") {
        // Asked to count from 0, TetGen 1.5 counts the points in its VTK file from 1, which VTK does not know.
        Some("counted from 0")
    } else {
        None
    }
}

/// What the program says about regions: Gmsh puts all into entity 1 of a `.msh`, which says nothing, and meshio into
/// entity 0; in Medit files both give all the reference 1, TetGen 0, which says nothing.
fn region(name: &str) -> Option<i32> {
    let ending = Path::new(name).extension()?.to_str()?;
    match ending {
        "mesh" | "meshb" if !is_raw(name) => Some(1),
        "msh" if name.contains("meshio") => Some(0),
        _ => None,
    }
}

/// Every file of the list is there, and reads to the mesh it was made of or is the error of its reason.
#[test]
fn the_same_mesh_from_different_programs() {
    let Some(folder) = folder() else { return };
    let list = fs::read(folder.join("formats.json")).unwrap();
    let list: BTreeMap<String, BTreeMap<String, String>> = serde_json::from_slice(&list).unwrap();
    let files = fs::read_dir(folder.join("formats")).unwrap();
    let files: BTreeSet<_> = files
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(
        files.iter().eq(list.keys()),
        "the list is not that of the files"
    );
    assert!(list.len() >= 54);

    for (name, entry) in &list {
        let original = incise_mesh_io::read(folder.join(format!("{}.vtk", entry["mesh"]))).unwrap();
        let read = incise_mesh_io::read_file(folder.join("formats").join(name));
        if let Some(reason) = refusal(name) {
            let error = read.expect_err(name).to_string();
            assert!(error.contains(reason), "{error}");
            continue;
        }
        let mut file = read.unwrap_or_else(|error| panic!("{error}"));
        let count = file.mesh.tets.len();
        let regions = region(name).map(|region| vec![region; count]);
        assert!(file.regions == regions.unwrap_or_default(), "{name}");
        // Points have references in Medit files and markers in some of TetGen's.
        let expected = ["reference", "boundary marker"];
        let known = |field: &NamedValues| expected.contains(&field.name.as_str());
        assert!(
            file.particles.iter().all(known) && file.tets.is_empty(),
            "{name}"
        );
        if !is_raw(name) {
            // The original has 9 digits, which all of these keep, so that the doubles are the same.
            assert!(file.mesh == original, "{name}");
            continue;
        }
        file.mesh.orient_positively();
        file.mesh.check().unwrap();
        center_and_scale(&mut file.mesh.positions);
        let corners = |mesh: &TetMesh| -> Vec<_> {
            let sorted = |&(mut tet): &[_; 4]| {
                tet.sort_unstable();
                tet
            };
            mesh.tets.iter().map(sorted).collect()
        };
        assert!(corners(&file.mesh) == corners(&original), "{name}");
        assert_eq!(file.mesh.positions.len(), original.positions.len());
        for (p, q) in file.mesh.positions.iter().zip(&original.positions) {
            // The original was rounded to 9 digits after that.
            assert!((*p - *q).abs().max_element() <= 2e-9, "{name}: {p} {q}");
        }
    }
}
