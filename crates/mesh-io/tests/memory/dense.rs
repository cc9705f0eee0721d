//! Files in which every byte stands for as much as it can: the smallest numbers, the smallest cells, many fields.

use std::fmt::Write;

use super::BITS;

/// Files in which every byte stands for as much as it can.
pub(super) fn dense() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let mut files: Vec<(&'static str, &'static str, Vec<u8>)> = Vec::new();
    let n = 10_000;
    let mut add = |name, what, bytes: Vec<u8>| files.push((name, what, bytes));

    let head = "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\n";
    let one = "POINTS 1 float\n0 0 0\nCELLS 1 5\n4 0 0 0 0\nCELL_TYPES 1\n10\n";
    let points = format!("POINTS {n} float\n{}\n", "0 0 0 ".repeat(n));
    let cells = format!(
        "CELLS {n} {}\n{}\nCELL_TYPES {n}\n{}\n",
        5 * n,
        "4 0 0 0 0 ".repeat(n),
        "10 ".repeat(n)
    );
    add("vtk", "text", format!("{head}{points}{cells}").into());
    add(
        "vtk",
        "empty cells",
        format!(
            "{head}{points}CELLS {} {}\n{}4 0 0 0 0\nCELL_TYPES {}\n{}10\n",
            n + 1,
            n + 5,
            "0 ".repeat(n),
            n + 1,
            "1 ".repeat(n)
        )
        .into(),
    );
    add("vtk", "values", format!("{head}{points}{cells}POINT_DATA {n}\nSCALARS a int\nLOOKUP_TABLE b\n{}\nVECTORS c int\n{}\n", "1 ".repeat(n), "1 1 1 ".repeat(n)).into());
    add(
        "vtk",
        "many fields",
        format!(
            "{head}{one}POINT_DATA 1\nFIELD f {n}\n{}",
            "a 1 1 int 1\n".repeat(n)
        )
        .into(),
    );
    let binary = head.replace("ASCII", "BINARY").into_bytes();
    let mut b = binary.clone();
    b.extend(format!("POINTS {n} float\n").bytes());
    b.extend(vec![0; 12 * n]);
    b.extend(format!("\nCELLS {n} {}\n", 5 * n).bytes());
    for _ in 0..n {
        b.extend([0, 0, 0, 4]);
        b.extend([0; 16]);
    }
    b.extend(format!("\nCELL_TYPES {n}\n").bytes());
    for _ in 0..n {
        b.extend([0, 0, 0, 10]);
    }
    add("vtk", "binary", b.clone());
    let mut bits = b.clone();
    bits.extend(format!("\nPOINT_DATA {n}\nFIELD f 100\n").bytes());
    for _ in 0..100 {
        bits.extend(format!("a 1 {n} bit\n").bytes());
        bits.extend(vec![0; n / 8]);
    }
    add("vtk", BITS, bits);
    let mut bytes = b.clone();
    bytes.extend(format!("\nPOINT_DATA {n}\nFIELD f 10\n").bytes());
    for _ in 0..10 {
        bytes.extend(format!("a 3 {n} char\n").bytes());
        bytes.extend(vec![0; 3 * n]);
    }
    add("vtk", "bytes", bytes);
    let mut none = binary.clone();
    none.extend(format!("FIELD f 1\na 1 {} bit\n", 80 * n).bytes());
    none.extend(vec![0; 10 * n]);
    add("vtk", "field data", none);
    let mut cells = binary;
    cells.extend(format!("CELLS {} 0\nOFFSETS char\n", 20 * n).bytes());
    cells.extend(vec![0; 20 * n]);
    cells.extend(b"\nCONNECTIVITY char\n\nCELL_TYPES 1\n\0\0\0\x0a");
    add("vtk", "offsets of bytes", cells);

    let vtu = |points: usize, cells: usize, data: &str, rest: &[u8]| {
        let mut text = format!("<VTKFile type=\"UnstructuredGrid\" header_type=\"UInt32\"><UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">{data}</Piece></UnstructuredGrid>").into_bytes();
        text.extend(rest);
        text
    };
    let grid = format!(
        "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">{}</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\">{}</DataArray><DataArray type=\"Int32\" Name=\"offsets\">{}</DataArray><DataArray type=\"UInt8\" Name=\"types\">{}</DataArray></Cells>",
        "0 0 0 ".repeat(n),
        "0 0 0 0 ".repeat(n),
        (1..=n).map(|i| format!("{} ", 4 * i)).collect::<String>(),
        "10 ".repeat(n)
    );
    add("vtu", "text", vtu(n, n, &grid, b"</VTKFile>"));
    let small = "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">0 0 0</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 0 0 0</DataArray><DataArray type=\"Int32\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\">10</DataArray></Cells>";
    // So many that a list of them has just grown.
    for (what, section) in [
        ("many arrays of values", "PointData"),
        ("many arrays of points", "Points"),
        ("many arrays of cells", "Cells"),
    ] {
        let arrays = "<DataArray/>".repeat((1 << 14) + 1);
        let data = format!("{small}<{section}>{arrays}</{section}>");
        add("vtu", what, vtu(1, 1, &data, b"</VTKFile>"));
    }
    add(
        "vtu",
        "many fields",
        vtu(
            1,
            1,
            &format!(
                "{small}<PointData>{}</PointData>",
                "<DataArray type=\"Int8\">1</DataArray>".repeat(n)
            ),
            b"</VTKFile>",
        ),
    );
    let mut raw = b"<AppendedData encoding=\"raw\">_".to_vec();
    let mut fields = String::new();
    let start = raw.len();
    for _ in 0..20 {
        write!(
            fields,
            "<DataArray type=\"Int8\" NumberOfComponents=\"3\" format=\"appended\" offset=\"{}\"/>",
            raw.len() - start
        )
        .expect("memory takes everything");
        raw.extend(count(3 * n));
        raw.extend(vec![0; 3 * n]);
    }
    raw.extend(b"</AppendedData></VTKFile>");
    add(
        "vtu",
        "bytes",
        vtu(
            n,
            n,
            &format!("{grid}<PointData>{fields}</PointData>"),
            &raw,
        ),
    );

    let msh = |nodes: &str, elements: &str, more: &str| {
        format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n{nodes}$EndNodes\n$Elements\n{elements}$EndElements\n{more}").into_bytes()
    };
    let nodes = format!(
        "1 {n} 1 {n}\n3 1 0 {n}\n{}{}",
        (1..=n).map(|i| format!("{i}\n")).collect::<String>(),
        "0 0 0\n".repeat(n)
    );
    let tets = format!(
        "1 {n} 1 {n}\n3 1 4 {n}\n{}",
        (1..=n)
            .map(|i| format!("{i} 1 1 1 1\n"))
            .collect::<String>()
    );
    add("msh", "text", msh(&nodes, &tets, ""));
    add(
        "msh",
        "same tets",
        msh(
            &nodes,
            &format!("1 {n} 1 {n}\n3 1 4 {n}\n{}", "1 1 1 1 1\n".repeat(n)),
            "$ElementData\n0\n0\n3\n0\n1\n0\n$EndElementData\n",
        ),
    );
    add(
        "msh",
        "data",
        msh(
            &nodes,
            &tets,
            &format!(
                "$NodeData\n0\n0\n3\n0\n1\n{n}\n{}$EndNodeData\n",
                "1 1\n".repeat(n)
            ),
        ),
    );
    add(
        "msh",
        "sparse data",
        msh(
            &nodes,
            &tets,
            &"$NodeData\n0\n0\n3\n0\n3\n1\n1 1 1 1\n$EndNodeData\n".repeat(1000),
        ),
    );
    add(
        "msh",
        "many data",
        msh(
            "1 1 1 1\n3 1 0 1\n1\n0 0 0\n",
            "1 1 1 1\n3 1 4 1\n1 1 1 1 1\n",
            &"$NodeData\n0\n0\n3\n0\n1\n1\n1 1\n$EndNodeData\n".repeat(n),
        ),
    );
    add(
        "msh",
        "entities",
        format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 {n}\n{}$EndEntities\n",
            "1 0 0 0 0 0 0 0 0\n".repeat(n)
        )
        .into(),
    );

    add(
        "mesh",
        "text",
        format!(
            "MeshVersionFormatted 1 Dimension 3 Vertices {n} {} Tetrahedra {n} {} End",
            "0 0 0 1 ".repeat(n),
            "1 1 1 1 1 ".repeat(n)
        )
        .into(),
    );
    let node = format!(
        "{n} 3 0 0\n{}",
        (1..=n).map(|i| format!("{i} 0 0 0\n")).collect::<String>()
    );
    let ele = format!("{n} 4 0\n{}", "1 1 1 1 1\n".repeat(n));
    add("tetgen", "text", format!("{node}\0{ele}").into());
    add(
        "tetgen",
        "attributes",
        format!(
            "{n} 3 10 1\n{}\0{ele}",
            (1..=n)
                .map(|i| format!("{i} 0 0 0 1 1 1 1 1 1 1 1 1 1 1\n"))
                .collect::<String>()
        )
        .into(),
    );
    add(
        "tetgen",
        "many attributes",
        format!(
            "1 3 256 0\n1 0 0 0{}\n\0{} 4 256\n{}",
            " 1".repeat(256),
            n / 10,
            format!("1 1 1 1 1{}\n", " 1".repeat(256)).repeat(n / 10)
        )
        .into(),
    );

    add(
        "obj",
        "text",
        format!("{}{}", "v 0 0 0\n".repeat(n), "f 1 1 1\n".repeat(n)).into(),
    );
    add(
        "obj",
        "one polygon",
        format!("v 0 0 0\nf{}\n", " 1".repeat(20 * n)).into(),
    );
    let polygons = format!("f{}\n", " 1".repeat(30)).repeat(n);
    add("obj", "polygons", format!("v 0 0 0\n{polygons}").into());
    add("obj", "texture points", "vt 0\n".repeat(20 * n).into());
    let polygons = format!("f{}\n", " 1/1".repeat(30)).repeat(n);
    add(
        "obj",
        "texture",
        format!("v 0 0 0\nvt 0\n{polygons}").into(),
    );
    let one_polygon = format!("v 0 0 0\nvt 0\nf{}\n", " 1/1".repeat(10 * n));
    add("obj", "texture of one polygon", one_polygon.into());
    add(
        "off",
        "text",
        format!("{n} {n}\n{}{}", "0 0 0\n".repeat(n), "3 0 0 0\n".repeat(n)).into(),
    );
    add(
        "off",
        "one polygon",
        format!("1 1\n0 0 0\n{}{}\n", 20 * n, " 0".repeat(20 * n)).into(),
    );
    let polygons = format!("30{}\n", " 0".repeat(30)).repeat(n);
    add(
        "off",
        "polygons",
        format!("1 {n}\n0 0 0\n{polygons}").into(),
    );
    add("stl", "text", format!("solid\n{}endsolid", (0..n).map(|i| format!("facet normal 0 0 0 outer loop vertex {i} 0 0 vertex {i} 1 0 vertex {i} 2 0 endloop endfacet\n")).collect::<String>()).into());
    let mut stl = vec![b' '; 80];
    stl.extend(count(n));
    for i in 0..n {
        stl.extend([0; 12]);
        for c in 0..9_u16 {
            stl.extend(f32::to_le_bytes((9 * i) as f32 + f32::from(c)));
        }
        stl.extend([0; 2]);
    }
    add("stl", "binary", stl);
    let ply = |kind: &str, points: usize, faces: usize| {
        format!("ply\nformat {kind} 1.0\nelement vertex {points}\nproperty char x\nproperty char y\nproperty char z\nelement face {faces}\nproperty list uint uchar vertex_index\nend_header\n").into_bytes()
    };
    let mut text = ply("ascii", n, n);
    text.extend("0 0 0\n".repeat(n).bytes());
    text.extend("3 0 0 0\n".repeat(n).bytes());
    add("ply", "text", text);
    let mut binary = ply("binary_little_endian", 20 * n, 1);
    binary.extend(vec![0; 60 * n]);
    binary.extend([3, 0, 0, 0, 0, 0, 0]);
    add("ply", "points of bytes", binary);
    let mut binary = ply("binary_little_endian", 1, 1);
    binary.extend([0; 3]);
    binary.extend(count(20 * n));
    binary.extend(vec![0; 20 * n]);
    add("ply", "one polygon", binary);
    let mut binary = ply("binary_little_endian", 1, n);
    binary.extend([0; 3]);
    for _ in 0..n {
        binary.extend(count(60));
        binary.extend([0; 60]);
    }
    add("ply", "polygons", binary);
    let mut binary = ply("binary_big_endian", 1, n);
    let short = binary
        .windows(5)
        .position(|w| w == b"uchar")
        .expect("it is there");
    binary.splice(short..short + 5, *b"ushort");
    binary.extend([0; 3]);
    for _ in 0..n {
        binary.extend([0, 0, 0, 60]);
        binary.extend([0; 120]);
    }
    add("ply", "polygons of two bytes", binary);
    add(
        "ply",
        "header",
        format!(
            "ply\nformat ascii 1.0\n{}",
            "element a 0\nproperty char b\n".repeat(n)
        )
        .into(),
    );
    add(
        "ply",
        "header 2",
        format!("ply\nformat ascii 1.0\n{}", "element a 0\n".repeat(10 * n)).into(),
    );
    files
}

fn count(n: usize) -> [u8; 4] {
    u32::try_from(n).expect("the files are small").to_le_bytes()
}
