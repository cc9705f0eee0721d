//! All formats: round trips, files of other writers, and errors for broken files.

mod errors;

use std::fs;
use std::io::{self, Write};

use glam::DVec3;
use incise_mesh::ParticleId;
use proptest::prelude::*;

use super::*;
use crate::stl::write_stl_binary;
use crate::test_files::cut;

type Parse = fn(&[u8], &Path) -> Result<TriangleSurface, MeshIoError>;

fn parse_obj(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshIoError> {
    obj::parse_obj(bytes, path).map(|file| file.surface)
}

fn bytes_of(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes everything");
    bytes
}

/// A surface in all forms that are written, the two of STL first.
fn forms(surface: &TriangleSurface) -> [(Parse, Vec<u8>); 7] {
    [
        (
            stl::parse_stl,
            bytes_of(|out| stl::write_binary(out, surface)),
        ),
        (stl::parse_stl, bytes_of(|out| stl::write(out, surface))),
        (
            parse_obj,
            bytes_of(|out| obj::write(out, &surface.clone().into())),
        ),
        (off::parse_off, bytes_of(|out| off::write(out, surface))),
        (
            ply::parse_ply,
            bytes_of(|out| ply::write(out, surface, PlyEncoding::Ascii)),
        ),
        (
            ply::parse_ply,
            bytes_of(|out| ply::write(out, surface, PlyEncoding::LittleEndian)),
        ),
        (
            ply::parse_ply,
            bytes_of(|out| ply::write(out, surface, PlyEncoding::BigEndian)),
        ),
    ]
}

fn parse(parse: Parse, bytes: &[u8]) -> Result<TriangleSurface, MeshIoError> {
    parse(bytes, Path::new("a"))
}

fn tetrahedron() -> TriangleSurface {
    TriangleSurface {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        triangles: [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
            .map(|t| t.map(ParticleId))
            .to_vec(),
    }
}

/// The corners of all triangles, as bits.
fn corners(surface: &TriangleSurface) -> Vec<[u64; 3]> {
    let bits = |p: &ParticleId| surface.positions[p.index()].to_array().map(f64::to_bits);
    surface.triangles.iter().flatten().map(bits).collect()
}

fn surfaces(coordinate: impl Strategy<Value = f64>) -> impl Strategy<Value = TriangleSurface> {
    let positions = prop::collection::vec(prop::array::uniform3(coordinate), 1..20);
    let triangles =
        prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 1..20);
    (positions, triangles).prop_map(|(positions, triangles)| TriangleSurface {
        triangles: triangles
            .into_iter()
            .map(|t| t.map(|corner| ParticleId::new(corner.index(positions.len()))))
            .collect(),
        positions: positions.into_iter().map(DVec3::from).collect(),
    })
}

fn any_finite() -> impl Strategy<Value = f64> {
    any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("finite", |c| c.is_finite())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn round_trips_keep_every_bit(surface in surfaces(any_finite())) {
        // STL text; then the formats that have points, which must agree one by one.
        let text = bytes_of(|out| stl::write(out, &surface));
        prop_assert_eq!(corners(&parse(stl::parse_stl, &text).unwrap()), corners(&surface));
        let forms: [(Parse, Vec<u8>); 5] = [
            (parse_obj, bytes_of(|out| obj::write(out, &surface.clone().into()))),
            (off::parse_off, bytes_of(|out| off::write(out, &surface))),
            (ply::parse_ply, bytes_of(|out| ply::write(out, &surface, PlyEncoding::Ascii))),
            (ply::parse_ply, bytes_of(|out| ply::write(out, &surface, PlyEncoding::LittleEndian))),
            (ply::parse_ply, bytes_of(|out| ply::write(out, &surface, PlyEncoding::BigEndian))),
        ];
        for (reader, bytes) in forms {
            let read = parse(reader, &bytes).unwrap();
            prop_assert_eq!(corners(&read), corners(&surface));
            prop_assert_eq!(&read, &surface);
        }
    }

    #[test]
    fn binary_stl_keeps_every_bit_of_floats(surface in surfaces(any::<f32>().prop_map(f64::from))) {
        let bytes = bytes_of(|out| stl::write_binary(out, &surface));
        prop_assert_eq!(corners(&parse(stl::parse_stl, &bytes).unwrap()), corners(&surface));
    }

    #[test]
    fn noise_is_no_reason_to_panic(place: prop::sample::Index, byte: u8, length in 1..9_usize) {
        for (reader, mut bytes) in forms(&tetrahedron()) {
            let place = place.index(bytes.len());
            let end = (place + length).min(bytes.len());
            bytes[place..end].fill(byte);
            if let Ok(surface) = parse(reader, &bytes) {
                prop_assert!(surface.positions.iter().all(|p| p.is_finite()));
                let points = surface.positions.len();
                prop_assert!(surface.triangles.iter().flatten().all(|p| p.index() < points));
            }
        }
    }

    #[test]
    fn any_bytes_are_no_reason_to_panic(bytes: Vec<u8>) {
        let starts = ["", "solid ", "OFF ", "f ", "ply\nformat binary_big_endian 1.0\n"];
        for reader in [stl::parse_stl, off::parse_off, parse_obj, ply::parse_ply] {
            for start in starts {
                parse(reader, &[start.as_bytes(), &bytes].concat()).ok();
            }
        }
    }
}

#[test]
fn prefixes_are_refused_or_a_part() {
    for (form, (reader, bytes)) in forms(&tetrahedron()).into_iter().enumerate() {
        assert_eq!(parse(reader, &bytes).unwrap(), tetrahedron_as_read(form));
        let text = ![0, 5, 6].contains(&form);
        let complete = if text {
            bytes.trim_ascii_end().len()
        } else {
            bytes.len()
        };
        cut(
            &bytes,
            |part| parse(reader, part),
            // Wavefront files announce nothing: a part of one is one. The name of a solid says nothing.
            |end, part| {
                form == 2 && part.triangles.len() < 4
                    || (form == 1 || end >= complete) && part == tetrahedron_as_read(form)
            },
        );
    }
}

/// STL numbers points as it meets them.
fn tetrahedron_as_read(form: usize) -> TriangleSurface {
    let mut surface = tetrahedron();
    if form < 2 {
        surface.positions.swap(1, 2);
        for corner in surface.triangles.iter_mut().flatten() {
            corner.0 = [0, 2, 1, 3][corner.index()];
        }
    }
    surface
}

/// Reads a square `[0, 1, 2, 3]`, which becomes a fan.
fn assert_square(reader: Parse, text: &[u8]) {
    let surface = parse(reader, text).unwrap();
    let square = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    assert_eq!(surface.positions, square);
    assert_eq!(
        surface.triangles,
        [[0, 1, 2], [0, 2, 3]].map(|t| t.map(ParticleId))
    );
}

#[test]
fn obj_of_other_writers() {
    let points = "v 0 0 0\nv 1 0 0 1.0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\n";
    for face in [
        "f 1 2 3 4",
        "f 1/1 2/1 3/2 4/7",
        "f 1//1 2//1 3//2 4//7 # c",
        "f -4/1/1 -3/1/1 -2/1/1 -1/1/1",
        "f 1 2 \\\n 3\\\n4",
        "f 1 2 3\nf 1 3 4",
    ] {
        let text =
            format!("# c\nmtllib a.mtl\no square\n{points}vt 0 0\nvn 0 0 1\ns off\n{face}\nl 1 2");
        assert_square(parse_obj, text.as_bytes());
        assert_square(parse_obj, text.replace('\n', "\r\n").as_bytes());
    }
    // Points after the face.
    assert_square(parse_obj, format!("f 1 2 3 4\n{points}").as_bytes());
}

#[test]
fn off_of_other_writers() {
    for text in [
        "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
        "# c\nOFF 4 1 0\n\n0 0 0 # c\n1 0 0\n1 1 0\n# c\n0 1 0\n4 0 1 2 3 255 0 0",
        "COFF\n4 1\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3 0.5 0.5 0.5",
        "NOFF\r\n4 2 4\r\n0 0 0 0 0 1\r\n1 0 0 0 0 1\r\n1 1 0 0 0 1\r\n0 1 0 0 0 1\r\n2 0 1\r\n4 0 1 2 3\r\n",
        "STCNOFF\n4 1 0\n0 0 0 0 0 1 0\n1 0 0 0 0 1 0\n1 1 0\n0 1 0\n4 0 1 2 3",
        "4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
    ] {
        assert_square(off::parse_off, text.as_bytes());
    }
}

#[test]
fn stl_of_other_writers() {
    let facet = |v: [&str; 3]| {
        format!(
            "  facet normal nan 0 1e0\n outer loop\n  vertex {}\n  vertex {}\n vertex {}\n endloop\n endfacet\n",
            v[0], v[1], v[2]
        )
    };
    let (one, two) = (
        facet(["0 0 0", "1 0 0", "1 1 0"]),
        facet(["0 0.0 0e9", "1 1 0", "0 1 0"]),
    );
    for text in [
        format!("solid a facet b\n{one}{two}endsolid a\n"),
        format!("\nsolid\n{one}endsolid\nSOLID solid\n{two}ENDSOLID a b"),
        format!("solid\n{one}{two}endsolid")
            .to_uppercase()
            .replacen("SOLID", "solid", 1),
    ] {
        assert_square(stl::parse_stl, text.as_bytes());
        assert_square(stl::parse_stl, text.replace('\n', "\r\n").as_bytes());
    }
    // A binary file that says solid, and one with more at its end.
    let (_, mut bytes) = forms(&tetrahedron())[0].clone();
    bytes[..5].copy_from_slice(b"solid");
    assert_eq!(
        parse(stl::parse_stl, &bytes).unwrap(),
        tetrahedron_as_read(0)
    );
    bytes[..5].copy_from_slice(b"other");
    bytes.extend([0; 33]);
    assert_eq!(
        parse(stl::parse_stl, &bytes).unwrap(),
        tetrahedron_as_read(0)
    );
    // A coordinate that no f32 can hold is not written as infinite.
    let mut far = tetrahedron();
    far.positions[1].x = 1e300;
    assert!(stl::write_binary(&mut io::sink(), &far).is_err());
}

const PLY: &str = "ply\nformat ascii 1.0\ncomment c\nobj_info i\nelement vertex 4\nproperty uchar red\nproperty float x\n\
    property float64 y\nproperty float32 z\nproperty list uchar int more\nelement edge 1\nproperty int a\n\
    element nothing 18446744073709551615\nelement face 1\nproperty float quality\n\
    property list uint8 int32 vertex_index\nend_header\n";
const PLY_BODY: &str = "9 0 0 0 0\n9 1 0 0 2 5 6\n9 1 1 0 0\n9 0 1 0 1 7\n3\nnan 4 0 1 2 3\n";

#[test]
fn ply_of_other_writers() {
    let text = format!("{PLY}{PLY_BODY}");
    assert_square(ply::parse_ply, text.as_bytes());
    assert_square(ply::parse_ply, text.replace('\n', "\r\n").as_bytes());
    for big_endian in [false, true] {
        let name = if big_endian {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        };
        let mut bytes = PLY.replace("ascii", name).into_bytes();
        let mut put = |number: &[u8]| {
            if big_endian {
                bytes.extend(number.iter().rev());
            } else {
                bytes.extend(number);
            }
        };
        for ([x, y], more) in [
            ([0.0, 0.0], &[][..]),
            ([1.0, 0.0], &[5, 6]),
            ([1.0, 1.0], &[]),
            ([0.0, 1.0], &[7]),
        ] {
            put(&[9]);
            put(&f32::to_le_bytes(x));
            put(&f64::from(y).to_le_bytes());
            put(&f32::to_le_bytes(0.0));
            put(&[u8::try_from(more.len()).unwrap()]);
            for number in more {
                put(&i32::to_le_bytes(*number));
            }
        }
        put(&3_i32.to_le_bytes());
        put(&f32::NAN.to_le_bytes());
        put(&[4]);
        for corner in 0..4 {
            put(&i32::to_le_bytes(corner));
        }
        assert_square(ply::parse_ply, &bytes);
        cut(&bytes, |part| parse(ply::parse_ply, part), |_, _| false);
    }
}

#[test]
fn files_by_ending() {
    let folder = tempfile::tempdir().unwrap();
    for (form, name) in [(1, "a.stl"), (2, "a.OBJ"), (3, "a.off"), (5, "a.ply")] {
        let path = folder.path().join(name);
        write_surface(&path, &tetrahedron()).unwrap();
        assert_eq!(fs::read(&path).unwrap(), forms(&tetrahedron())[form].1);
        assert_eq!(read_surface(&path).unwrap(), tetrahedron_as_read(form));
    }
    let path = folder.path().join("b.stl");
    write_stl_binary(&path, &tetrahedron()).unwrap();
    assert_eq!(read_surface(&path).unwrap(), tetrahedron_as_read(0));
    for result in [
        read_surface("a.step").map(|_| ()),
        write_surface("a.step", &tetrahedron()),
    ] {
        assert!(matches!(result, Err(MeshIoError::UnknownFormat { .. })));
    }
    assert!(matches!(
        read_surface(folder.path().join("c.obj")),
        Err(MeshIoError::Io { .. })
    ));
}
