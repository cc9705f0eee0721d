//! Files of other writers are read, and errors name what is wrong.

use std::fs;

use incise_mesh::glam::{DVec3, dvec3};
use incise_mesh::{ParticleId, TetMesh, kuhn_box, orientation};
use incise_mesh_io::{MeshFile, MeshIoError, MshKind};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..Default::default() })]

    #[test]
    fn noise_in_a_file_is_no_reason_to_panic(place in 0..2000_usize, byte: u8, length in 0..8_usize) {
        let folder = tempfile::tempdir().unwrap();
        let mesh = kuhn_box([2, 1, 1], dvec3(0.1, 0.7, 1.3));
        for name in ["mesh.vtk", "mesh.node", "mesh.ele"] {
            let path = folder.path().join(name);
            incise_mesh_io::write(&path, &mesh).unwrap();
            let mut bytes = fs::read(&path).unwrap();
            let place = place % bytes.len();
            let end = (place + length).min(bytes.len());
            bytes[place..end].fill(byte);
            fs::write(&path, bytes).unwrap();
            if let Ok(mesh) = incise_mesh_io::read(&path) {
                assert!(mesh.positions.iter().all(|p| p.is_finite()));
                assert!(mesh.tets.iter().flatten().all(|p| p.index() < mesh.positions.len()));
            }
        }
    }
}

fn read_text(name: &str, text: &str) -> Result<TetMesh, MeshIoError> {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join(name);
    fs::write(&path, text).expect("the file can be written");
    incise_mesh_io::read(path)
}

const HEADER: &str = "# vtk DataFile Version 2.0\n\u{e9}tude\nASCII\nDATASET UNSTRUCTURED_GRID\n";
const POINTS: &str = "POINTS 5 float\n0 0 0 1 0 0\n0 1 0  0 0 1\n1 1 1\n";

#[test]
fn vtk_of_other_writers() {
    let expected = [[0, 1, 2, 3].map(ParticleId), [1, 2, 3, 4].map(ParticleId)];
    let old = "cells 2 10\n4 0 1 2 3 4 1 2 3 4\ncell_types 2\n10 10\n";
    let new = "CELLS 3 8\nOFFSETS vtktypeint64\n0 4 8\nCONNECTIVITY vtktypeint64\n0 1 2 3 1 2 3 4\nCELL_TYPES 2\n10\n10\n";
    let mixed = "CELLS 4 18\n3 0 1 2\n4 0 1 2 3\n4 1 2 3 4\n3 0 1 3\nCELL_TYPES 4\n5 10 10 5\n";
    for cells in [old, new, mixed] {
        let mesh = read_text("a.vtk", &format!("{HEADER}{POINTS}{cells}")).unwrap();
        assert_eq!(mesh.tets, expected);
        assert_eq!(mesh.positions[4], DVec3::ONE);
        // Sections in another order, with others between and after; line ends of another system.
        let fields = "FIELD FieldData 1\nTimeValue 1 1 double\n0.5\nMETADATA\nINFORMATION 0\n\n";
        let data = "POINT_DATA 5\nSCALARS CELLS double 1\nLOOKUP_TABLE default\n1 2 3 4 5\n";
        let text = format!("{HEADER}{fields}{cells}{POINTS}{data}").replace('\n', "\r\n");
        assert_eq!(read_text("a.vtk", &text).unwrap().tets, expected);
    }
}

#[test]
fn vtk_errors_name_the_line() {
    let cells = "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";
    let good = format!("{HEADER}{POINTS}{cells}");
    for (from, to, expected) in [
        ("ASCII", "EBCDIC", ":3: ASCII or BINARY expected"),
        (
            "UNSTRUCTURED_GRID",
            "POLYDATA",
            ":4: DATASET UNSTRUCTURED_GRID expected",
        ),
        (
            "0 1 0  ",
            "0 nan 0  ",
            ":7: the coordinate nan is not finite",
        ),
        (
            "0 1 0  ",
            "0 -inf 0  ",
            ":7: the coordinate -inf is not finite",
        ),
        (
            "0 1 0  ",
            "0 1e999 0  ",
            ":7: the coordinate 1e999 is not finite",
        ),
        ("0 1 0  ", "0 1,5 0  ", ":7: \"1,5\" is not a coordinate"),
        (
            "4 0 1 2 3",
            "4 0 1 2 7",
            ":10: the cell 0 uses point 7 but there are 5",
        ),
        (
            "4 0 1 2 3",
            "4 0 1 2 -1",
            ":10: \"-1\" is not a point of a cell",
        ),
        ("4 0 1 2 3", "3 0 1 2", ":10: the tet 0 has 3 points"),
        (
            "\n10\n",
            "\n5\n",
            ":10: none of the 1 cells is a tetrahedron",
        ),
        (
            "\n10\n",
            "\n12\n",
            ":10: the cell 0 is a hexahedron (cell type 12), only tets",
        ),
        (
            "CELLS 1 5",
            "CELLS 1 4",
            ":10: the cells need more than the 4 numbers",
        ),
        (
            "POINTS 5",
            "POINTS 99999999999999999",
            ":8: \"CELLS\" is not a coordinate",
        ),
        (
            "POINTS 5",
            "POINTS -5",
            ":5: \"-5\" is not the number of points",
        ),
        (
            "CELLS 1 5",
            "CELLS 18446744073709551615 18446744073709551615",
            ":11: \"CELL_TYPES\" is not",
        ),
        ("float", "int", ":5: points of type \"int\""),
        ("# vtk", "# not", ":1: the file does not start with"),
    ] {
        let error = read_text("a.vtk", &good.replacen(from, to, 1))
            .expect_err(to)
            .to_string();
        let expected = expected.replace(":8: \"CELLS\"", ":9: \"CELLS\"");
        assert!(error.contains(&expected), "{error} lacks {expected}");
    }
    let empty = format!("{HEADER}{POINTS}CELLS 0 0\nCELL_TYPES 0\n");
    assert!(matches!(
        read_text("a.vtk", &empty),
        Err(MeshIoError::Empty)
    ));
}

#[test]
fn tetgen_of_other_writers() {
    let folder = tempfile::tempdir().unwrap();
    let [node, ele] = ["a.node", "a.ele"].map(|name| folder.path().join(name));
    let points = "# points\n4 3 1 1 # counts\n1 0 0 0 7.5 1\n\n2 1 0 0 7.5 1\n3 0 1 0 7.5 0\n4 0 0 1 7.5 0\n# end\n";
    fs::write(&node, points).unwrap();
    fs::write(&ele, "1 4 1\n1 2 1 3 4 99\n# end").unwrap();
    let mesh = incise_mesh_io::read(&node).unwrap();
    assert!(orientation(mesh.corners(incise_mesh::TetId(0))) > 0.0);
    assert_eq!(mesh.tets[0], [1, 0, 3, 2].map(ParticleId));

    for (text, expected) in [
        (
            "1 4 1\n1 0 1 2 3 99\n",
            "a.ele:2: point 0 does not exist, there are 4 counted from 1",
        ),
        (
            "2 4 1\n1 1 2 3 4 99\n",
            "a.ele:2: the file ends early: 2 tets announced but 1 found",
        ),
        (
            "1 4 1\n1 1 2 3\n",
            "a.ele:2: the line ends before a point of a tet",
        ),
        ("1 8 1\n", "a.ele:1: the tets have 8 points"),
    ] {
        fs::write(&ele, text).unwrap();
        let error = incise_mesh_io::read(&node).unwrap_err().to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    fs::write(&node, points.replace("3 0 1 0", "5 0 1 0")).unwrap();
    assert!(
        incise_mesh_io::read(&node)
            .unwrap_err()
            .to_string()
            .contains("a.node:6: point 3 expected but 5 found")
    );
}

#[test]
fn unknown_endings_name_the_known_ones() {
    let error = incise_mesh_io::read("mesh.step").unwrap_err().to_string();
    assert!(
        error.contains("mesh.step")
            && error.contains(".vtk, .vtu, .msh, .node, .ele, .mesh, .meshb")
    );
    assert!(
        incise_mesh_io::write("mesh", &TetMesh::default())
            .unwrap_err()
            .to_string()
            .contains(".vtu")
    );
    assert!(
        incise_mesh_io::read("no/such/file.vtk")
            .unwrap_err()
            .to_string()
            .starts_with("cannot read no")
    );
}

#[test]
fn fields_of_the_wrong_length_are_refused() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let field = [incise_mesh_io::Field {
        name: "speed",
        values: incise_mesh_io::Values::Scalars(&[0.0; 7]),
    }];
    let fields = incise_mesh_io::Fields {
        particles: &field,
        ..Default::default()
    };
    let error =
        incise_mesh_io::write_vtu("never.vtu", &mesh.positions, &mesh.tets, fields).unwrap_err();
    assert_eq!(
        error.to_string(),
        "field \"speed\" has 7 values but 8 are needed: give one for each element"
    );
}

#[test]
fn regions_of_the_wrong_length_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.msh");
    let mut file = MeshFile::from(kuhn_box([1, 1, 1], DVec3::ONE));
    file.regions = vec![1];
    for kind in [MshKind::Text41, MshKind::Binary22] {
        let error = incise_mesh_io::write_msh(&path, &file, kind).unwrap_err();
        assert!(matches!(error, MeshIoError::FieldLength { found: 1, .. }));
        assert!(!path.exists());
    }
    assert!(matches!(
        incise_mesh_io::read_msh(&path),
        Err(MeshIoError::Io { .. })
    ));
}
