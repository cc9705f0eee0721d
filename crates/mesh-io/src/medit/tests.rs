//! Text and binary: round trips, files of other writers, and errors for broken files.

use std::fs;

use incise_mesh::kuhn_box;
use proptest::prelude::*;

use super::*;
use crate::test_files::cut;

/// Points and tets of any kind, with references or without.
fn files() -> impl Strategy<Value = MeshFile> {
    let coordinate = any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("finite", |c| c.is_finite());
    let positions = prop::collection::vec(prop::array::uniform3(coordinate), 1..20);
    let tets = prop::collection::vec(prop::array::uniform4(any::<prop::sample::Index>()), 1..20);
    (positions, tets, any::<[bool; 2]>(), any::<[i32; 40]>()).prop_map(
        |(positions, tets, [of_tets, of_points], references)| {
            let corner = |index: prop::sample::Index| ParticleId::new(index.index(positions.len()));
            let mut file = MeshFile::from(TetMesh {
                tets: tets.into_iter().map(|tet| tet.map(corner)).collect(),
                positions: positions.iter().copied().map(DVec3::from).collect(),
            });
            // References that are all 0 are none; one more makes sure that these are not.
            let nonzero = |n: usize| references[..n].iter().map(|r| r | 1);
            if of_tets {
                file.regions = nonzero(file.mesh.tets.len()).collect();
            }
            if of_points {
                let values = nonzero(positions.len()).map(f64::from).collect();
                file.particles.push(NamedValues {
                    name: REFERENCE.to_owned(),
                    values: OwnedValues::Scalars(values),
                });
            }
            file
        },
    )
}

/// Writes a file in all forms that exist.
fn forms(file: &MeshFile) -> [Vec<u8>; 4] {
    let mut forms = [const { Vec::new() }; 4];
    ascii::write(&mut forms[0], file).unwrap();
    for (form, version) in forms[1..].iter_mut().zip(2..) {
        binary::write(form, file, version).unwrap();
    }
    forms
}

fn parse(bytes: &[u8]) -> Result<MeshFile, MeshIoError> {
    parse_medit(bytes, Path::new("a.mesh"))
}

fn small() -> MeshFile {
    let mut file = MeshFile::from(kuhn_box([1, 1, 1], DVec3::new(0.1, 0.7, 1.3)));
    file.regions = vec![3, -1, 0, i32::MAX, i32::MIN, 7];
    file
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn round_trips_keep_every_bit(file in files()) {
        let bits = |file: &MeshFile| -> Vec<_> {
            file.mesh.positions.iter().map(|p| p.to_array().map(f64::to_bits)).collect()
        };
        for bytes in forms(&file) {
            let read = parse(&bytes).unwrap();
            prop_assert_eq!(bits(&read), bits(&file));
            prop_assert_eq!(&read, &file);
        }
    }

    #[test]
    fn noise_is_no_reason_to_panic(offset: prop::sample::Index, byte: u8, length in 1..9_usize) {
        for mut bytes in forms(&small()) {
            let offset = offset.index(bytes.len());
            let end = (offset + length).min(bytes.len());
            bytes[offset..end].fill(byte);
            if let Ok(file) = parse(&bytes) {
                prop_assert!(file.mesh.positions.iter().all(|p| p.is_finite()));
                let particles = file.mesh.positions.len();
                prop_assert!(file.mesh.tets.iter().flatten().all(|p| p.index() < particles));
            }
        }
    }

    #[test]
    fn any_bytes_are_no_reason_to_panic(bytes: Vec<u8>) {
        parse(&bytes).ok();
        parse(&[&1_i32.to_le_bytes()[..], &bytes].concat()).ok();
    }
}

#[test]
fn every_prefix_is_refused() {
    for bytes in forms(&small()) {
        // Only the line end after the last word may be missing.
        let complete = bytes.trim_ascii_end().len();
        cut(&bytes, parse, |end, part| {
            end == complete && part == small()
        });
    }
}

const TEXT: &str = "MeshVersionFormatted 1\n\nDimension\n3\n# points\nVertices\n4\n0 0 0 5\n1 0 0 5 # second\n\
    0 1 0 5\n0 0 1e0 6\n\nTriangles 1\n1 2 3 9\nTangents\n1\n0.5 nan -inf\nHexahedra 0\nTetrahedra\n1\n1 2 3 4 -8\nEnd\nmore";

#[test]
fn text_of_other_writers() {
    for text in [
        TEXT.to_owned(),
        TEXT.replace('\n', "\r\n"),
        TEXT.to_lowercase(),
    ] {
        let file = parse(text.as_bytes()).unwrap();
        assert_eq!(
            file.mesh.positions,
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
        );
        assert_eq!(file.mesh.tets, [[0, 1, 2, 3].map(ParticleId)]);
        assert_eq!(file.regions, [-8]);
        assert_eq!(
            file.particles[0].values,
            OwnedValues::Scalars(vec![5.0, 5.0, 5.0, 6.0])
        );
    }
    // Tets before points.
    let swapped =
        "MeshVersionFormatted 2 Dimension 3 Tetrahedra 1 1 1 1 1 0 Vertices 1 0 0 0 0 End";
    let file = parse(swapped.as_bytes()).unwrap();
    assert!(file.regions.is_empty() && file.particles.is_empty());
}

#[test]
fn errors_of_text_name_the_line() {
    for (from, to, expected) in [
        (
            "MeshVersionFormatted",
            "Mesh",
            ":1: the file does not start with",
        ),
        ("Formatted 1", "Formatted 5", ":1: version 5 is not 1 to 4"),
        (
            "Dimension\n3",
            "Dimension\n2",
            ":4: dimension 3 expected, not 2",
        ),
        ("Dimension\n3", "", ":5: Vertices before Dimension 3"),
        ("1 0 0 5", "1 x 0 5", ":9: \"x\" is not a coordinate"),
        (
            "1 0 0 5",
            "1 inf 0 5",
            ":9: the coordinate inf is not finite",
        ),
        ("1 0 0 5", "1 0 0 5.5", ":9: \"5.5\" is not a reference"),
        (
            "1 0 0 5",
            "1 0 0 4000000000",
            ":9: the reference 4000000000 does not fit",
        ),
        ("1 0 0 5", "1 0 0 5 5", ":11: \"1e0\" is not a reference"),
        (
            "Vertices\n4",
            "Vertices\n99999999999999",
            ":13: \"Triangles\" is not a coordinate",
        ),
        (
            "Vertices\n4",
            "Vertices\n-4",
            ":7: \"-4\" is not the number of points",
        ),
        (
            "2 3 4 -8",
            "2 3 5 -8",
            ":21: a tet has the point 5 but there are 4",
        ),
        ("2 3 4 -8", "2 3 0 -8", ":21: point 0 cannot be"),
        (
            "2 3 4 -8",
            "2 3 9999999999 -8",
            ":21: point 9999999999 cannot be",
        ),
        (
            "Hexahedra 0",
            "Hexahedra 2",
            ":18: there are 2 Hexahedra: only tets",
        ),
        (
            "Hexahedra 0",
            "TetrahedraP2 1",
            ":18: there are 1 TetrahedraP2: only tets",
        ),
        ("Triangles 1", "Tetrahedra 0", ":14: a keyword expected"),
        (
            "\nEnd\nmore",
            "\nTetrahedra 0 End",
            ":22: a second section Tetrahedra",
        ),
        (
            "\nEnd\nmore",
            "\n",
            ":21: the file ends early: the keyword End expected",
        ),
    ] {
        let text = TEXT.replacen(from, to, 1);
        let error = parse(text.as_bytes()).expect_err(to).to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    let none = TEXT.replace("1\n1 2 3 4 -8", "0");
    assert!(matches!(parse(none.as_bytes()), Err(MeshIoError::Empty)));
}

/// A binary file made by hand in any version and byte order, with triangles between the points and the tets.
fn by_hand(version: u8, big_endian: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    let number = |bytes: &mut Vec<u8>, number: i64, width: usize| {
        if big_endian {
            bytes.extend(&number.to_be_bytes()[8 - width..]);
        } else {
            bytes.extend(&number.to_le_bytes()[..width]);
        }
    };
    let (offset, whole) = [(4, 4), (4, 4), (8, 4), (8, 8)][usize::from(version) - 1];
    number(&mut bytes, 1, 4);
    number(&mut bytes, version.into(), 4);
    let section = |bytes: &mut Vec<u8>, code: i64, content: &[u8]| {
        number(bytes, code, 4);
        let next = bytes.len() + offset + content.len();
        number(bytes, i64::try_from(next).unwrap(), offset);
        bytes.extend(content);
    };
    let mut content = Vec::new();
    number(&mut content, 3, 4);
    section(&mut bytes, 3, &content);
    content.clear();
    number(&mut content, 4, whole);
    for (position, reference) in [[0.0; 3], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -2.0]]
        .into_iter()
        .zip(1_i64..)
    {
        for coordinate in position {
            if version == 1 {
                // These numbers are the same in f32.
                #[expect(clippy::cast_possible_truncation, reason = "exact")]
                let bits = (coordinate as f32).to_bits();
                number(&mut content, bits.into(), 4);
            } else {
                number(&mut content, f64::to_bits(coordinate).cast_signed(), 8);
            }
        }
        number(&mut content, reference, whole);
    }
    section(&mut bytes, 4, &content);
    content.clear();
    for n in [1, 1, 2, 3, 0] {
        number(&mut content, n, whole);
    }
    section(&mut bytes, 6, &content);
    content.clear();
    for n in [1, 1, 3, 2, 4, -5] {
        number(&mut content, n, whole);
    }
    section(&mut bytes, 8, &content);
    number(&mut bytes, 54, 4);
    number(&mut bytes, 0, offset);
    bytes
}

#[test]
fn all_binary_versions_and_byte_orders() {
    for version in 1..=4 {
        for big_endian in [false, true] {
            let bytes = by_hand(version, big_endian);
            let file = parse(&bytes).unwrap();
            assert_eq!(
                file.mesh.positions,
                [DVec3::ZERO, 0.5 * DVec3::X, DVec3::Y, -2.0 * DVec3::Z]
            );
            assert_eq!(file.mesh.tets, [[0, 2, 1, 3].map(ParticleId)]);
            assert_eq!(file.regions, [-5]);
            assert_eq!(
                file.particles[0].values,
                OwnedValues::Scalars(vec![1.0, 2.0, 3.0, 4.0])
            );
            cut(&bytes, parse, |_, _| false);
        }
    }
}

#[test]
fn errors_of_binary_name_the_byte() {
    // Version 2: dimension at 8, points at 20 (count 28, first 32), triangles at 144, tets at 172 (count 180).
    for (at, value, expected) in [
        (0, 257, "at byte 0: the file does not start with 1"),
        (4, 5, "at byte 4: version 5 is not 1 to 4"),
        (16, 2, "at byte 16: dimension 3 expected, not 2"),
        (8, 77, "at byte 20: Vertices before Dimension 3"),
        (12, 0, "at byte 8: the next keyword cannot be at 0"),
        (24, 140, "at byte 20: the next keyword cannot be at 140"),
        (24, -1, "at byte 20: the next keyword cannot be at -1"),
        (24, i32::MAX, "at byte 20: the next keyword cannot be at"),
        (
            28,
            i32::MAX,
            "at byte 28: 2147483647 points announced but the file has room for",
        ),
        (28, -1, "at byte 28: -1 points announced"),
        (
            36,
            0x7ff0_0000,
            "at byte 32: the coordinate inf is not finite",
        ),
        (
            144,
            10,
            "at byte 144: there are 1 Hexahedra: only tets are read",
        ),
        (
            144,
            30,
            "at byte 144: there are 1 TetrahedraP2: only tets are read",
        ),
        (144, 4, "at byte 144: a second section Vertices"),
        (
            180,
            2,
            "at byte 180: 2 tets announced but the file has room for 1",
        ),
        (188, 0, "at byte 188: point 0 cannot be"),
        (188, 5, "at byte 188: a tet has the point 5 but there are 4"),
    ] {
        let mut bytes = by_hand(2, false);
        bytes[at..at + 4].copy_from_slice(&i32::to_le_bytes(value));
        let error = parse(&bytes).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    let mut bytes = by_hand(4, false);
    let reference = bytes.len() - 12 - 8;
    bytes[reference + 7] = 1;
    let error = parse(&bytes).unwrap_err().to_string();
    assert!(error.contains("does not fit in 32 bits"), "{error}");
}

#[test]
fn versions_by_size() {
    assert_eq!(binary::lowest_version(&kuhn_box([1, 1, 1], DVec3::ONE)), 2);
    let folder = tempfile::tempdir().unwrap();
    let mut file = small();
    for name in ["a.mesh", "a.MeshB"] {
        let path = folder.path().join(name);
        write_medit(&path, &file).unwrap();
        assert_eq!(read_medit(&path).unwrap(), file);
        assert_eq!(fs::read(&path).unwrap()[0] == 1, name == "a.MeshB");
    }
    file.regions.pop();
    assert!(matches!(
        write_medit("a.mesh", &file),
        Err(MeshIoError::FieldLength { .. })
    ));
}

#[test]
fn references_that_do_not_fit_are_left_out() {
    for value in [0.5, 3e9, -0.0, f64::NAN] {
        let mut file = small();
        let values = vec![value; file.mesh.positions.len()];
        file.particles.push(NamedValues {
            name: REFERENCE.to_owned(),
            values: OwnedValues::Scalars(values),
        });
        for bytes in forms(&file) {
            assert_eq!(parse(&bytes).unwrap(), small());
        }
    }
}
