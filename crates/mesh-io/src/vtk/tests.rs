//! Legacy VTK files of every variant, whole, broken and cut.

use std::path::Path;

use proptest::prelude::*;

use super::write::{binary, text};
use super::{parse_vtk, parse_vtk_mesh};
use crate::test_files::{cut, sample};
use crate::{MeshFile, MeshIoError, OwnedValues};

fn read(bytes: &[u8]) -> Result<MeshFile, MeshIoError> {
    parse_vtk(bytes, Path::new("a.vtk"))
}

fn written(file: &MeshFile) -> [Vec<u8>; 2] {
    let [mut ascii, mut bytes] = [Vec::new(), Vec::new()];
    text(&mut ascii, file).unwrap();
    binary(&mut bytes, file).unwrap();
    [ascii, bytes]
}

/// A binary file of an old version as other programs write it: 32-bit cells with sizes, and data of many kinds.
fn old_binary() -> Vec<u8> {
    let mut f = b"# vtk DataFile Version 2.0\nold\nBINARY\nDATASET UNSTRUCTURED_GRID\n".to_vec();
    let words = |f: &mut Vec<u8>, numbers: &[i32]| {
        f.extend(numbers.iter().flat_map(|n| n.to_be_bytes()));
        f.push(b'\n');
    };
    let floats = |f: &mut Vec<u8>, numbers: &[f32]| {
        f.extend(numbers.iter().flat_map(|n| n.to_be_bytes()));
        f.push(b'\n');
    };
    f.extend(b"FIELD FieldData 2\nTimeValue 1 1 float\n");
    floats(&mut f, &[0.5]);
    f.extend(b"names 1 2 string\n\xc3abc\x80\x02xy\n");
    f.extend(b"METADATA\nINFORMATION 1\nNAME a LOCATION b\nDATA 1\n\n");
    f.extend(b"POINTS 5 float\n");
    floats(
        &mut f,
        &[0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 1., 1.],
    );
    f.extend(b"CELLS 3 14\n");
    words(&mut f, &[4, 0, 1, 2, 3, 3, 0, 1, 2, 4, 1, 2, 3, 4]);
    f.extend(b"CELL_TYPES 3\n");
    words(&mut f, &[10, 5, 10]);
    f.extend(b"CELL_DATA 3\nSCALARS CellEntityIds int 1\nLOOKUP_TABLE default\n");
    words(&mut f, &[7, 8, -9]);
    f.extend(b"SCALARS bare short\n\x00\x01\xff\xfe\x00\x03\nCOLOR_SCALARS rgb 3\n\x00\x00\x00\x00\x00\x00\x00\x00\x00\n");
    f.extend(b"SCALARS flag bit\nLOOKUP_TABLE default\n\xa0\n");
    f.extend(b"POINT_DATA 5\nVECTORS a%20b float\n");
    floats(&mut f, &[1.5; 15]);
    f.extend(b"LOOKUP_TABLE own 2\n\x0a\x0a\x0a\x0a\x20\x20\x20\x20\n");
    f
}

#[test]
fn a_binary_file_of_another_program() {
    let file = read(&old_binary()).unwrap();
    assert_eq!(file.mesh.tets.len(), 2);
    assert_eq!(file.mesh.positions[4], glam::DVec3::ONE);
    assert_eq!(file.regions, [7, -9]);
    assert_eq!(file.tets.len(), 3, "{:?}", file.tets);
    assert_eq!(file.tets[0].values, OwnedValues::Scalars(vec![1.0, 3.0]));
    assert_eq!(file.tets[2].values, OwnedValues::Scalars(vec![1.0, 1.0]));
    assert_eq!(file.particles[0].name, "a b");
    let mesh = parse_vtk_mesh(&old_binary(), Path::new("a.vtk")).unwrap();
    assert_eq!(mesh, file.mesh);
}

#[test]
fn data_of_a_text() {
    let text = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n\
        CELLS 3 5\nOFFSETS vtktypeint64\n0 1 5\nCONNECTIVITY vtktypeint64\n0\n0 1 2 3\nCELL_TYPES 2\n1 10\n\
        POINT_DATA 4\nSCALARS s double\n1 nan -inf 4\nMETADATA\nINFORMATION 0\n\nNORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1\n\
        TENSORS t float\n1 2 3 4 5 6 7 8 9\n1 2 3 4 5 6 7 8 9\n1 2 3 4 5 6 7 8 9\n1 2 3 4 5 6 7 8 9\n\
        CELL_DATA 2\nFIELD FieldData 3\nwords 1 2 string\nCELLS 1\nPOINTS 2\nmedit:ref 1 2 int\n3 4\nregions 1 2 int\n5 6\n";
    let file = read(text.as_bytes()).unwrap();
    assert_eq!(file.regions, [4]);
    assert_eq!(file.tets[0].values, OwnedValues::Scalars(vec![6.0]));
    let names: Vec<_> = file.particles.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["s", "n"]);
    for (from, to, expected) in [
        ("0 1 2 3", "0 1 2 9", "a.vtk:12: the cell 1 uses point 9"),
        ("1 10", "1 14", "a.vtk:12: the cell 1 is a pyramid"),
        ("1 10", "1 24", "is a quadratic tetrahedron (cell type 24)"),
        ("1 10", "1 5", "none of the 2 cells is a tetrahedron"),
        ("\n0 1 5", "\n0 5 1", "a.vtk:8: the offsets do not run"),
        (
            "POINT_DATA 4",
            "POINT_DATA 5",
            "\"METADATA\" is not a value",
        ),
        (
            "ref 1 2 int",
            "ref 1 3 int",
            "a.vtk:33: the array \"medit:ref\" has 3 values",
        ),
        (
            "s double",
            "s triple",
            "a.vtk:16: the data type \"triple\" is not known",
        ),
        ("1 nan", "1 none", "a.vtk:17: \"none\" is not a value"),
    ] {
        let error = read(text.replacen(from, to, 1).as_bytes());
        let error = error.expect_err(to).to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
}

#[test]
fn data_are_of_all_elements() {
    let start = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n\
        CELLS 2 8\n2 0 1\n4 0 1 2 3\nCELL_TYPES 2\n3 10\n";
    let one = "CELL_DATA 1\nSCALARS a int\n7\n";
    let two = "CELL_DATA 2\nSCALARS b int\n7 8\n";
    let file = read(format!("{start}{two}{two}").as_bytes()).unwrap();
    assert_eq!(file.tets.len(), 2);
    for (data, expected) in [
        (one.to_owned(), ":12: there are data of 1 cells but 2 cells"),
        (
            format!("{one}{two}"),
            ":15: there are data of 2 elements but of 1 before",
        ),
        (
            "POINT_DATA 3\n".to_owned(),
            ":12: there are data of 3 points but 4 points",
        ),
    ] {
        let error = read(format!("{start}{data}").as_bytes())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
}

#[test]
fn errors_of_a_binary_file_name_the_byte() {
    let good = old_binary();
    let find = |what: &[u8]| good.windows(what.len()).position(|w| w == what).unwrap();
    let points = find(b"POINTS 5 float\n") + 15;
    let mut bad = good.clone();
    bad[points + 8..points + 12].copy_from_slice(&f32::NAN.to_be_bytes());
    let error = read(&bad).unwrap_err().to_string();
    assert!(
        error.contains(&format!("at byte {}: the coordinate NaN", points + 8)),
        "{error}"
    );

    let cells = find(b"CELLS 3 14\n") + 11;
    for (number, expected) in [
        (-1_i32, "a number is not the number of points of a cell"),
        (99, "the cells need more than the 14 numbers"),
        (3, "a number is not"),
    ] {
        let mut bad = good.clone();
        bad[cells..cells + 4].copy_from_slice(&number.to_be_bytes());
        bad[cells + 16..cells + 20].copy_from_slice(&(-5_i32).to_be_bytes());
        let error = read(&bad).unwrap_err().to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    let huge = b"# vtk DataFile Version 2.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 18446744073709551615 double\n0";
    assert!(read(huge).unwrap_err().to_string().contains("ends early"));
    let unknown = b"# vtk DataFile Version 2.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nKITTENS 3\n";
    let error = read(unknown).unwrap_err().to_string();
    assert!(
        error.contains("the section \"KITTENS\" is not known"),
        "{error}"
    );
}

#[test]
fn every_prefix_is_an_error_or_the_same_mesh() {
    let [ascii, bytes] = written(&sample());
    for whole in [ascii, bytes, old_binary()] {
        let mesh = read(&whole).unwrap().mesh;
        // A file that ends between two sections of data, or within its last number, cannot be told from a complete one.
        cut(&whole, read, |_, part| part.mesh == mesh);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn noise_is_no_reason_to_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let [ascii, bytes] = written(&sample());
        for mut bytes in [ascii, bytes, old_binary()] {
            for (place, byte) in &flips {
                let place = place.index(bytes.len());
                bytes[place] = *byte;
            }
            if let Ok(file) = read(&bytes) {
                file.check().unwrap();
                assert!(file.mesh.positions.iter().all(|p| p.is_finite()));
                assert!(file.mesh.tets.iter().flatten().all(|p| p.index() < file.mesh.positions.len()));
            }
        }
    }
}
