//! The memory that a reader takes is bounded by the size of the file, for any lengths written in it.
//!
//! Counted is what the program asks for, at its peak: where a list grows, the old and the new one together.

mod dense;

use std::fs;

use allocation_counter::measure;
use incise_mesh_io::MeshIoError;
use miniz_oxide::deflate::compress_to_vec_zlib;

use crate::given::folder;

/// Messages, paths, and what the XML reader needs.
const SLACK: u64 = 64 << 10;

/// Fields of single bits, of which each becomes a double.
const BITS: &str = "bits";

/// The most memory that reading takes at one time, in bytes, with the file itself.
fn peak(name: &str, bytes: &[u8]) -> (u64, Result<(), MeshIoError>) {
    let mut result = Ok(());
    let info = measure(|| {
        result = match name {
            "tetgen" => {
                let mut files = bytes.splitn(2, |&byte| byte == 0);
                let [nodes, tets] = [files.next(), files.next()].map(Option::unwrap_or_default);
                incise_mesh_io::parse_tetgen("a.node", nodes, tets).map(drop)
            }
            "obj" | "stl" | "ply" | "off" | "glb" => {
                incise_mesh_io::parse_surface(format!("a.{name}"), bytes).map(drop)
            }
            _ => incise_mesh_io::parse_file(format!("a.{name}"), bytes).map(drop),
        };
    });
    (info.bytes_max + bytes.len() as u64, result)
}

#[test]
fn dense_files() {
    for (name, what, bytes) in dense::dense() {
        let (peak, _) = peak(name, &bytes);
        let times = if what == BITS { 64 } else { 20 };
        let size = bytes.len() as u64;
        assert!(size > 100_000, "{name}, {what}: {size}");
        assert!(
            peak <= times * size + SLACK,
            "{name}, {what}: {peak} for {size}"
        );
    }
}

#[test]
fn wrong_counts_reserve_no_memory() {
    let vtk = |body: &str| {
        format!("# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\n{body}")
    };
    let vtu = |points: &str, cells: &str, format: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">
            <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" {format}>AAAAAA==</DataArray></Points></Piece>"
        )
    };
    let msh = |body: &str| format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n{body}");
    let msh_2 = |body: &str| format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{body}");
    for count in [
        "1000000000",
        "4294967295",
        "9223372036854775807",
        "18446744073709551615",
    ] {
        let files = [
            ("vtk", vtk(&format!("POINTS {count} float\n0 0 0\n"))),
            (
                "vtk",
                vtk(&format!("POINTS {count} double\n0 0 0\n")).replace("ASCII", "BINARY"),
            ),
            ("vtk", vtk(&format!("CELLS {count} {count}\n4 0 0 0 0\n"))),
            ("vtk", vtk(&format!("CELLS 1 {count}\n{count} 0 0 0 0\n"))),
            (
                "vtk",
                vtk(&format!("CELLS 1 {count}\n4 0 0 0 0\n")).replace("ASCII", "BINARY"),
            ),
            (
                "vtk",
                vtk(&format!(
                    "CELLS 3 {count}\nOFFSETS vtktypeint64\n0 4 {count}\nCONNECTIVITY vtktypeint64\n0 0 0 0"
                )),
            ),
            ("vtk", vtk(&format!("CELL_TYPES {count}\n10\n"))),
            (
                "vtk",
                vtk(&format!("POINT_DATA {count}\nSCALARS a int\n1\n")),
            ),
            (
                "vtk",
                vtk(&format!(
                    "POINT_DATA {count}\nFIELD f {count}\na 1 {count} int\n1\n"
                )),
            ),
            (
                "vtk",
                vtk(&format!("FIELD f {count}\na {count} {count} bit\n1\n"))
                    .replace("ASCII", "BINARY"),
            ),
            ("vtk", vtk(&format!("FIELD f 1\na {count} 1 string\nb\n"))),
            ("vtk", vtk(&format!("LOOKUP_TABLE a {count}\n1\n"))),
            ("vtu", vtu(count, "1", "")),
            ("vtu", vtu("1", count, "format=\"binary\"")),
            ("vtu", vtu(count, count, "format=\"binary\"")),
            (
                "vtu",
                vtu("1", "1", &format!("format=\"appended\" offset=\"{count}\""))
                    + "</UnstructuredGrid><AppendedData encoding=\"raw\">_</AppendedData></VTKFile>",
            ),
            (
                "msh",
                msh(&format!("$Nodes\n1 {count} 1 {count}\n3 1 0 {count}\n1\n")),
            ),
            ("msh", msh(&format!("$Nodes\n{count} 1 1 1\n"))),
            (
                "msh",
                msh(&format!(
                    "$Elements\n1 {count} 1 {count}\n3 1 4 {count}\n1 1 1 1 1\n"
                )),
            ),
            (
                "msh",
                msh(&format!("$Entities\n{count} {count} {count} {count}\n1 ")),
            ),
            ("msh", msh(&format!("$NodeData\n{count}\n1\n"))),
            (
                "msh",
                msh(&format!("$NodeData\n0\n0\n3\n0\n3\n{count}\n1 1 1 1\n")),
            ),
            (
                "msh",
                msh(&format!("$NodeData\n0\n0\n3\n0\n{count}\n1\n1 1 1 1\n")),
            ),
            ("msh", msh_2(&format!("$Nodes\n{count}\n1 0 0 0\n"))),
            (
                "msh",
                msh_2(&format!("$Elements\n{count}\n1 4 0 1 1 1 1\n")),
            ),
            ("msh", format!("$NOD\n{count}\n1 0 0 0\n")),
            ("msh", format!("$ELM\n{count}\n1 4 1 1 4 1 1 1 1\n")),
            (
                "mesh",
                format!("MeshVersionFormatted 1 Dimension 3 Vertices {count} 0 0 0 0"),
            ),
            (
                "mesh",
                format!("MeshVersionFormatted 1 Dimension 3 Tetrahedra {count} 1 1 1 1 0"),
            ),
            ("tetgen", format!("{count} 3 0 0\n1 0 0 0\n")),
            ("tetgen", format!("1 3 {count} 0\n1 0 0 0 1\n")),
            ("tetgen", format!("{count} 3 256 0\n1 0 0 0 1\n")),
            (
                "tetgen",
                format!("1 3 0 0\n1 0 0 0\n\0{count} 4 0\n1 1 1 1 1\n"),
            ),
            (
                "tetgen",
                format!("1 3 0 0\n1 0 0 0\n\01 4 {count}\n1 1 1 1 1 1\n"),
            ),
            ("off", format!("{count} 1\n0 0 0\n")),
            ("off", format!("1 {count}\n0 0 0\n3 0 0 0\n")),
            ("off", format!("1 1\n0 0 0\n{count} 0 0 0\n")),
            ("obj", format!("v 0 0 0\nf 1 1 {count}\n")),
            ("glb", gltf(count, "4", "4")),
            ("glb", gltf("1", count, "4")),
            ("glb", gltf("1", "4", count)),
            ("ply", ply(count, "1", "0 0 0\n")),
            ("ply", ply("1", count, "0 0 0\n3 0 0 0\n")),
            ("ply", ply("1", "1", &format!("0 0 0\n{count} 0 0 0\n"))),
            (
                "ply",
                ply(count, "1", "0 0 0\n").replace("ascii", "binary_little_endian"),
            ),
            (
                "ply",
                ply("1", count, "\0\0\0\0\0\0\0\0\0\0\0\0").replace("ascii", "binary_big_endian"),
            ),
        ];
        for (name, text) in files {
            let (peak, result) = peak(name, text.as_bytes());
            assert!(result.is_err(), "{text}");
            assert!(peak <= SLACK, "{peak} for {text}");
        }
    }
    // The counts of binary files.
    for word in [[0xff, 0xff, 0xff, 0x7f], [0xff; 4]] {
        let mut stl = vec![b' '; 80];
        stl.extend(word);
        let section = |code: i32| [code.to_le_bytes(), 999_i32.to_le_bytes(), word].concat();
        let start = [1, 2, 3, 20, 3].map(i32::to_le_bytes).concat();
        let nodes = b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n";
        for (name, bytes) in [
            ("stl", stl),
            ("mesh", [&start[..], &section(4)].concat()),
            ("mesh", [&start[..], &section(8)].concat()),
            ("msh", [&nodes[..], &word.repeat(8)].concat()),
        ] {
            let (peak, result) = peak(name, &bytes);
            assert!(result.is_err());
            assert!(peak <= SLACK, "{peak} for {name}");
        }
    }
}

/// A glTF file of one point.
fn gltf(points: &str, view: &str, buffer: &str) -> String {
    format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],
        \"buffers\":[{{\"byteLength\":{buffer},\"uri\":\"data:;base64,AAAAAA==\"}}],
        \"bufferViews\":[{{\"buffer\":0,\"byteLength\":{view}}}],
        \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":{points},\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[0,0,0]}}]}}"
    )
}

/// The text of a glTF file may consist of empty objects.
#[test]
fn empty_objects_of_gltf() {
    let head = "{\"asset\":{\"version\":\"2.0\"}";
    for list in ["nodes", "materials", "scenes", "samplers"] {
        let text = format!("{head},\"{list}\":[{}{{}}]}}", "{},".repeat(50_000));
        let (most, result) = peak("glb", text.as_bytes());
        assert!(result.is_err());
        let size = text.len() as u64;
        assert!(most <= 500 * size + SLACK, "{list}: {most} for {size}");
    }
}

fn ply(points: &str, faces: &str, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {points}\nproperty float x\nproperty float y\nproperty float z\n\
        element face {faces}\nproperty list uint uint vertex_index\nend_header\n{body}"
    )
}

/// A file whose points are one compressed block, with a header that says what it likes.
fn compressed(points: usize, block: u64, content: &[u8]) -> Vec<u8> {
    let packed = compress_to_vec_zlib(content, 9);
    let mut file = format!(
        "<VTKFile type=\"UnstructuredGrid\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">
        <UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"1\">
        <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points>
        <Cells><DataArray type=\"Int8\" Name=\"connectivity\">0 0 0 0</DataArray>
        <DataArray type=\"Int8\" Name=\"offsets\">4</DataArray><DataArray type=\"Int8\" Name=\"types\">10</DataArray></Cells>
        </Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_"
    )
    .into_bytes();
    for number in [1, block, 0, packed.len() as u64] {
        file.extend(number.to_le_bytes());
    }
    file.extend(packed);
    file
}

/// zlib makes up to 1032 bytes of one, and a file may do so if it says it first, twice: by its counts and by the header
/// of the block. What a block holds beyond that is not decompressed, and what it only claims takes no memory.
#[test]
fn compressed_files() {
    let (points, size) = (100_000, 2_400_000_u64);
    let zeros = vec![0; 2_400_000];
    let honest = compressed(points, size, &zeros);
    assert!(honest.len() < 5_000);
    let (most, result) = peak("vtu", &honest);
    result.unwrap();
    // The block, the array it is part of, the doubles, the points.
    assert!(most <= 5 * size, "{most}");

    let huge = usize::MAX / 100;
    for (name, file) in [
        ("counts are lower", compressed(1, 24, &zeros)),
        ("header is lower", compressed(points, 24, &zeros)),
        ("counts are higher", compressed(huge, size, &zeros)),
        (
            "both are higher",
            compressed(huge, 24 * huge as u64, &zeros[..999]),
        ),
        ("wrap around", compressed(usize::MAX / 24 + 1, 8, &zeros)),
    ] {
        let (peak, result) = peak("vtu", &file);
        assert!(result.is_err(), "{name}");
        assert!(peak <= SLACK, "{name}: {peak}");
    }
}

#[test]
fn files_of_other_programs() {
    let Some(folder) = folder() else { return };
    for entry in fs::read_dir(folder.join("formats")).unwrap() {
        let path = entry.unwrap().path();
        if ["face", "ele"]
            .iter()
            .any(|ending| path.extension().is_some_and(|e| e == *ending))
        {
            continue;
        }
        let mut size = fs::metadata(&path).unwrap().len();
        if path.extension().is_some_and(|ending| ending == "node") {
            size += fs::metadata(path.with_extension("ele")).unwrap().len();
        }
        let info = measure(|| drop(incise_mesh_io::read_file(&path)));
        assert!(
            info.bytes_max <= 10 * size,
            "{}: {} for {size}",
            path.display(),
            info.bytes_max
        );
    }
}
