//! XML files of every variant, whole, broken and cut.

use std::path::Path;

use miniz_oxide::deflate::compress_to_vec_zlib;
use proptest::prelude::*;

use super::{parse_vtu, put_file};
use crate::base64;
use crate::test_files::{cut, sample};
use crate::{MeshFile, MeshIoError, OwnedValues};

fn read(bytes: &[u8]) -> Result<MeshFile, MeshIoError> {
    parse_vtu(bytes, Path::new("a.vtu"))
}

fn written(file: &MeshFile) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_file(&mut bytes, file).unwrap();
    bytes
}

fn base64(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    base64::base64(&mut out, bytes).unwrap();
    out
}

/// A way to store numbers.
#[derive(Clone, Copy, Debug)]
struct Variant {
    big: bool,
    wide: bool,
    compressed: bool,
    appended: bool,
    raw: bool,
}

impl Variant {
    fn all() -> impl Iterator<Item = Self> {
        (0..32).map(|i| Self {
            big: i & 1 > 0,
            wide: i & 2 > 0,
            compressed: i & 4 > 0,
            appended: i & 8 > 0,
            raw: i & 16 > 0,
        })
    }

    fn bytes<const N: usize>(self, mut little: [u8; N]) -> Vec<u8> {
        if self.big {
            little.reverse();
        }
        little.to_vec()
    }

    fn header(self, numbers: &[usize]) -> Vec<u8> {
        let one = |&n: &usize| match self.wide {
            true => self.bytes((n as u64).to_le_bytes()),
            false => self.bytes(u32::try_from(n).unwrap().to_le_bytes()),
        };
        numbers.iter().flat_map(one).collect()
    }

    /// An array as it stands in the file.
    fn encoded(self, data: &[u8]) -> Vec<u8> {
        let raw = self.appended && self.raw;
        let encode = |bytes: &[u8]| if raw { bytes.to_vec() } else { base64(bytes) };
        if !self.compressed {
            let header = self.header(&[data.len()]);
            return encode(&[header, data.to_vec()].concat());
        }
        let size = 40;
        let blocks: Vec<_> = data
            .chunks(size)
            .map(|b| compress_to_vec_zlib(b, 6))
            .collect();
        let mut numbers = vec![blocks.len(), size, data.len() % size];
        numbers.extend(blocks.iter().map(Vec::len));
        [encode(&self.header(&numbers)), encode(&blocks.concat())].concat()
    }

    /// Five points, a triangle between two tets, a region each and a field.
    fn file(self) -> Vec<u8> {
        let floats = |values: &[f32]| {
            values
                .iter()
                .flat_map(|v| self.bytes(v.to_le_bytes()))
                .collect()
        };
        let integers = |values: &[i32]| {
            values
                .iter()
                .flat_map(|v| self.bytes(v.to_le_bytes()))
                .collect()
        };
        let points: [f32; 15] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 1., 1.];
        let arrays: [(&str, &str, &str, Vec<u8>); 6] = [
            (
                "Points",
                "Float32\" NumberOfComponents=\"3",
                "Points",
                floats(&points),
            ),
            (
                "Cells",
                "Int32",
                "connectivity",
                integers(&[0, 1, 2, 3, 0, 1, 2, 1, 2, 3, 4]),
            ),
            ("Cells", "Int32", "offsets", integers(&[4, 7, 11])),
            ("Cells", "UInt8", "types", vec![10, 5, 10]),
            ("CellData", "Int32", "medit:ref", integers(&[1, 2, -3])),
            (
                "PointData",
                "Float32",
                "a&lt;b",
                floats(&[0.5, 1.5, 2.5, 3.5, f32::NAN]),
            ),
        ];
        let [order, header] = [
            if self.big {
                "BigEndian"
            } else {
                "LittleEndian"
            },
            if self.wide { "UInt64" } else { "UInt32" },
        ];
        let compressor = match self.compressed {
            true => " compressor=\"vtkZLibDataCompressor\"",
            false => "",
        };
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"{order}\" header_type=\"{header}\"{compressor}>\n\
            <UnstructuredGrid><!-- <Piece> --><FieldData><DataArray type=\"Float32\" Name=\"t\" format=\"ascii\">1</DataArray></FieldData>\n\
            <Piece NumberOfPoints=\"5\" NumberOfCells=\"3\">\n"
        )
        .into_bytes();
        let mut appended = b"_".to_vec();
        for (section, kind, name, data) in arrays {
            let data = self.encoded(&data);
            let start = format!("<{section}><DataArray type=\"{kind}\" Name=\"{name}\"");
            file.extend(start.bytes());
            let key = "<InformationKey><Value>7</Value></InformationKey>";
            if self.appended {
                let offset = appended.len() - 1;
                file.extend(format!(" format=\"appended\" offset=\"{offset}\">{key}").bytes());
                appended.extend(data);
            } else {
                file.extend(format!(" format=\"binary\">{key}\n  ").bytes());
                file.extend(data);
            }
            file.extend(format!("</DataArray></{section}>\n").bytes());
        }
        file.extend(b"</Piece></UnstructuredGrid>\n");
        if self.appended {
            let encoding = if self.raw { "raw" } else { "base64" };
            file.extend(format!("<AppendedData encoding=\"{encoding}\">\n ").bytes());
            file.extend(appended);
            file.extend(b"\n</AppendedData>");
        }
        file.extend(b"</VTKFile>\n");
        file
    }
}

#[test]
fn every_variant_reads_to_the_same() {
    for variant in Variant::all() {
        let file = read(&variant.file()).unwrap_or_else(|e| panic!("{variant:?}: {e}"));
        assert_eq!(file.mesh.tets.len(), 2);
        assert_eq!(file.mesh.tets[1].map(|p| p.0), [1, 2, 3, 4]);
        assert_eq!(file.mesh.positions[4], glam::DVec3::ONE);
        assert_eq!(file.regions, [1, -3]);
        assert_eq!(file.particles[0].name, "a<b");
        let OwnedValues::Scalars(values) = &file.particles[0].values else {
            panic!("scalars expected");
        };
        assert_eq!(values[..4], [0.5, 1.5, 2.5, 3.5]);
        assert!(values[4].is_nan());
    }
}

const TEXT: &str = "<VTKFile type=\"UnstructuredGrid\">
<UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">
<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray>
<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray>
<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells>
<PointData><Array type=\"String\" Name=\"s\" format=\"ascii\">65</Array><DataArray type=\"String\" Name=\"u\"/></PointData>
</Piece></UnstructuredGrid></VTKFile>";

#[test]
fn errors_of_a_text_name_the_line() {
    assert_eq!(read(TEXT.as_bytes()).unwrap().mesh.tets.len(), 1);
    for (from, to, expected) in [
        ("0 1 2 3", "0 1 2 4", "a.vtu:4: the cell 0 uses point 4"),
        (
            "0 1 2 3",
            "0 1 2 -3",
            "a.vtu:4: array \"connectivity\": \"-3\" is not",
        ),
        (
            "0 1 2 3",
            "0 1 2",
            "a.vtu:4: array \"connectivity\": 4 numbers expected but 3",
        ),
        (
            "0 1 2 3",
            "0 1 2 3 0",
            "a.vtu:4: array \"connectivity\": there are more than the 4",
        ),
        (">4<", ">3<", "there are more than the 3"),
        (">10<", ">12<", "a.vtu:4: the cell 0 is a hexahedron"),
        (
            "0 0 0 1 0",
            "nan 0 0 1 0",
            "a.vtu:3: the coordinate NaN is not finite",
        ),
        (
            "</Piece>",
            "</Piece><Piece>",
            "a.vtu:8: there are several elements Piece",
        ),
        (
            "OfPoints=\"4\"",
            "OfPoints=\"18446744073709551615\"",
            "the counts are too large",
        ),
        (
            "OfPoints=\"4\"",
            "OfPoints=\"4000000000000000\"",
            "numbers expected but 12 found",
        ),
        (
            "OfCells=\"1\"",
            "OfCells=\"-1\"",
            "a.vtu:2: NumberOfCells is \"-1\"",
        ),
        (
            "NumberOfCells=\"1\"",
            "",
            "a.vtu:2: the element Piece has no NumberOfCells",
        ),
        (
            "\"types\" format=\"ascii\"",
            "\"types\" format=\"morse\"",
            "a.vtu:6: format is \"morse\"",
        ),
        (
            "\"types\" format=\"ascii\"",
            "\"types\" format=\"appended\"",
            "has no offset",
        ),
        (
            "\"types\" format=\"ascii\"",
            "\"types\" format=\"appended\" offset=\"0\"",
            "AppendedData expected",
        ),
        ("\"types\"", "\"kinds\"", "an array types expected"),
        (
            "type=\"UnstructuredGrid\"",
            "type=\"PolyData\"",
            "a.vtu:1: the type of the file is \"PolyData\"",
        ),
        (
            "<VTKFile",
            "<VTKFile compressor=\"vtkLZ4DataCompressor\"",
            "compressor is \"vtkLZ4DataCompressor\"",
        ),
        (
            "<VTKFile",
            "<VTKFile header_type=\"UInt16\"",
            "header_type is \"UInt16\"",
        ),
        (
            "<VTKFile",
            "<VTKFile byte_order=\"Middle\"",
            "byte_order is \"Middle\"",
        ),
        ("</Points>", "</Pints>", "a.vtu:3: the file is no sound XML"),
    ] {
        assert!(TEXT.contains(from));
        let error = read(TEXT.replacen(from, to, 1).as_bytes());
        let error = error.expect_err(to).to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    let empty = TEXT.replace("Cells=\"1\"", "Cells=\"0\"");
    let empty = empty
        .replace(">0 1 2 3<", "><")
        .replace(">4<", "><")
        .replace(">10<", "><");
    assert!(matches!(read(empty.as_bytes()), Err(MeshIoError::Empty)));
}

#[test]
fn points_of_cells_are_integers() {
    for variant in Variant::all().filter(|variant| !variant.raw) {
        let file = String::from_utf8(variant.file()).unwrap();
        let bad = file.replacen("Int32\" Name=\"conn", "Float32\" Name=\"conn", 1);
        let error = read(bad.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains("\"connectivity\": a number is negative or no integer"),
            "{error}"
        );
    }
}

#[test]
fn lengths_of_compressed_arrays_are_checked() {
    let variant = Variant {
        big: false,
        wide: true,
        compressed: true,
        appended: true,
        raw: true,
    };
    let good = variant.file();
    let start = good.windows(3).position(|w| w == b"\n _").unwrap() + 3;
    for (word, expected) in [
        (0, "the array has"),
        (1, "the array has"),
        (2, "the array has"),
        (3, "bytes expected but"),
    ] {
        let mut bad = good.clone();
        bad[start + 8 * word..start + 8 * word + 8].fill(0xfe);
        let error = read(&bad).unwrap_err().to_string();
        assert!(
            error.contains(&format!("at byte {start}: array \"Points\"")),
            "{error}"
        );
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn bytes_that_several_arrays_share_are_refused() {
    let variant = Variant {
        big: false,
        wide: false,
        compressed: false,
        appended: true,
        raw: false,
    };
    let good = String::from_utf8_lossy(&variant.file()).into_owned();
    let field = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" Name=\"f\" format=\"appended\" offset=\"0\"/>";
    let bad = good.replacen("<PointData>", &format!("<PointData>{}", field.repeat(9)), 1);
    let error = read(bad.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("overlaps others"), "{error}");
}

#[test]
fn every_prefix_is_an_error_or_the_same_mesh() {
    let variants = Variant::all().map(Variant::file);
    for whole in variants.chain([written(&sample()), TEXT.as_bytes().to_vec()]) {
        let mesh = read(&whole).unwrap().mesh;
        // All arrays are there where only the last tags are missing.
        cut(&whole, read, |end, part| {
            part.mesh == mesh && end + 30 > whole.len()
        });
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn noise_is_no_reason_to_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let variants = Variant::all().map(Variant::file);
        for mut bytes in variants.chain([written(&sample()), TEXT.as_bytes().to_vec()]) {
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
