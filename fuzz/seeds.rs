//! Writes the seeds of the targets of mesh files to `corpus`: a small mesh in every form that the library writes, and some
//! forms that it reads only.
//!
//! `cargo run --example seeds`, in the folder of this file.

use std::fs;
use std::path::Path;

use incise_mesh::glam::DVec3;
use incise_mesh::kuhn_box;
use incise_mesh_io::{MeshFile, MeshIoError, MshKind, NamedValues, OwnedValues, PlyEncoding};

const VTU: &str = r#"<?xml version="1.0"?><VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="UInt32">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="appended" offset="0"/></Cells>
</Piece></UnstructuredGrid><AppendedData encoding="base64">_AQAAAAo=</AppendedData></VTKFile>"#;

/// The array of types is compressed: blocks, their size, the size of the last, the compressed size of each.
const VTU_ZLIB: &str = r#"<VTKFile type="UnstructuredGrid" header_type="UInt32" compressor="vtkZLibDataCompressor">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<Points><DataArray type="Float32" NumberOfComponents="3">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity">0 1 2 3</DataArray><DataArray type="Int64" Name="offsets">4</DataArray>
<DataArray type="UInt8" Name="types" format="binary">AQAAAAEAAAAAAAAACQAAAA==eJzjAgAACwAL</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>"#;

const VTK: &str = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n\
    CELLS 3 5\nOFFSETS vtktypeint64\n0 1 5\nCONNECTIVITY vtktypeint64\n0\n0 1 2 3\nCELL_TYPES 2\n1 10\n\
    POINT_DATA 4\nSCALARS s double\nLOOKUP_TABLE t\n1 nan -inf 4\nMETADATA\nINFORMATION 0\n\nNORMALS n float\n\
    0 0 1 0 0 1 0 0 1 0 0 1\nLOOKUP_TABLE t 1\n1 1 1 1\nCELL_DATA 2\nFIELD FieldData 3\nwords 1 2 string\nCELLS 1\nPOINTS 2\n\
    medit:ref 1 2 int\n3 4\nflags 1 2 bit\n1 0\n";

const MSH_1: &str =
    "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n9 0 0 1\n$ENDNOD\n$ELM\n1\n2 4 6 3 4 1 2 3 9\n$ENDELM\n";

const MSH_41: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"tissue\"\n$EndPhysicalNames\n$Entities\n\
    0 0 1 1\n1 0 0 0 1 1 1 0 1 1\n2 0 0 0 1 1 1 2 7 8 1 1\n$EndEntities\n$PartitionedEntities\n1\n0\n0 0 0 1\n\
    5 3 2 1 1 0 0 0 1 1 1 1 33 0\n$EndPartitionedEntities\n$Nodes\n1 4 1 4\n3 2 1 4\n4\n3\n2\n1\n0 0 0 0 0 0\n\
    1 0 0 0 0 0\n0 1 0 0 0 0\n0 0 1 0 0 0\n$EndNodes\n$Elements\n2 2 1 2\n2 1 2 1\n1 1 2 3\n3 5 4 1\n2 1 2 3 4\n$EndElements\n\
    $NodeData\n1\n\"u\"\n1\n0.5\n4\n0\n3\n1\n0\n3 1 2 3\n$EndNodeData\n";

const MEDIT: &str = "MeshVersionFormatted 1\nDimension\n3\nTetrahedra\n1\n1 2 3 4 -8\nTriangles 1\n1 2 3 9\nHexahedra 0\n\
    Vertices\n4\n0 0 0 5\n1 0 0 5 # second\n0 1 0 5\n0 0 1e0 6\nEnd";

const OBJ: &str = "# c\nv 0 0 0\nv 1 0 0\nvn 0 0 1\nv 0 1 0 1\nf 1//1 2/1 \\\n-1/1/1\nl 1 2\n";

const PLY: &str = "ply\nformat ascii 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty double y\n\
    property float z\nproperty list uchar int more\nelement edge 1\nproperty int a\nelement face 1\n\
    property list uint8 int32 vertex_index\nend_header\n0 0 0 0\n1 0 0 1 7\n0 1 0 0\n3\n3 0 1 2\n";

const OFF: &str =
    "COFF 3 2 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1 # c\n0 1 0 1 1 1 1\n2 0 1\n3 0 1 2 0.5 0.5\n";

fn main() -> Result<(), MeshIoError> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let path = |target: &str, name: &str| {
        let folder = corpus.join(target);
        fs::create_dir_all(&folder).expect("the folder can be made");
        folder.join(name)
    };
    let put = |target: &str, name: &str, bytes: &[u8]| {
        fs::write(path(target, name), bytes).expect("the file can be written");
    };
    let file = sample();
    let plain = MeshFile::from(file.mesh.clone());

    incise_mesh_io::write_file(path("vtk", "plain.vtk"), &plain)?;
    incise_mesh_io::write_file(path("vtk", "fields.vtk"), &file)?;
    incise_mesh_io::write_vtk_binary(path("vtk", "binary.vtk"), &file)?;
    put("vtk", "data.vtk", VTK.as_bytes());

    incise_mesh_io::write_file(path("vtu", "fields.vtu"), &file)?;
    put("vtu", "appended.vtu", VTU.as_bytes());
    put("vtu", "zlib.vtu", VTU_ZLIB.as_bytes());
    let raw = VTU
        .replace("base64", "raw")
        .replace("AQAAAAo=", "\u{1}\0\0\0\n");
    put("vtu", "raw.vtu", raw.as_bytes());

    for (name, kind) in [
        ("text41.msh", MshKind::Text41),
        ("binary41.msh", MshKind::Binary41),
        ("text22.msh", MshKind::Text22),
        ("binary22.msh", MshKind::Binary22),
    ] {
        incise_mesh_io::write_msh(path("msh", name), &file, kind)?;
    }
    put("msh", "version1.msh", MSH_1.as_bytes());
    put("msh", "entities.msh", MSH_41.as_bytes());

    incise_mesh_io::write_file(path("medit", "text.mesh"), &file)?;
    incise_mesh_io::write_file(path("medit", "binary.meshb"), &file)?;
    put("medit", "sections.mesh", MEDIT.as_bytes());

    let pair = path("tetgen", "pair.node");
    incise_mesh_io::write_file(&pair, &file)?;
    let [nodes, tets] = ["node", "ele"].map(|ending| {
        let half = pair.with_extension(ending);
        let bytes = fs::read(&half).expect("it was written");
        fs::remove_file(half).expect("it was written");
        bytes
    });
    put("tetgen", "pair", &[&nodes[..], b"\0", &tets].concat());
    let ten = "4 3 1 1\n1 0 0 0 0.5 1 # c\n2 1 0 0 0 0\n3 0 1 0 0 0\n4 0 0 1 0 0\n\0\
        1 10 1\n1 1 2 3 4 1 1 1 1 1 1 -7\n";
    put("tetgen", "ten", ten.as_bytes());

    let surface = incise_mesh::TriangleSurface::boundary_of(&file.mesh);
    for target in ["obj", "stl", "ply", "off"] {
        incise_mesh_io::write_surface(path(target, &format!("box.{target}")), &surface)?;
    }
    incise_mesh_io::write_surface(path("gltf", "box.glb"), &surface)?;
    incise_mesh_io::write_surface(path("gltf", "box.gltf"), &surface)?;
    incise_mesh_io::write_stl_binary(path("stl", "binary.stl"), &surface)?;
    incise_mesh_io::write_ply(path("ply", "text.ply"), &surface, PlyEncoding::Ascii)?;
    incise_mesh_io::write_ply(path("ply", "big.ply"), &surface, PlyEncoding::BigEndian)?;
    put("obj", "faces.obj", OBJ.as_bytes());
    put("ply", "properties.ply", PLY.as_bytes());
    put("off", "colors.off", OFF.as_bytes());
    for (name, bytes) in [
        ("a.vtk", VTK.as_bytes()),
        ("a.vtu", VTU.as_bytes()),
        ("a.vtu", VTU_ZLIB.as_bytes()),
        ("a.vtu", raw.as_bytes()),
        ("a.msh", MSH_1.as_bytes()),
        ("a.msh", MSH_41.as_bytes()),
        ("a.mesh", MEDIT.as_bytes()),
    ] {
        incise_mesh_io::parse_file(name, bytes)?;
    }
    for (name, text) in [("a.obj", OBJ), ("a.ply", PLY), ("a.off", OFF)] {
        incise_mesh_io::parse_surface(name, text.as_bytes())?;
    }
    Ok(())
}

/// One box of tets with regions and fields.
fn sample() -> MeshFile {
    let mut file = MeshFile::from(kuhn_box([1, 1, 1], DVec3::new(0.5, 1.0, 2.0)));
    let named = |name: &str, values| NamedValues {
        name: name.to_owned(),
        values,
    };
    file.regions = vec![1, -2, 3, 4, 5, 0];
    file.particles = vec![
        named("speed", OwnedValues::Vectors(file.mesh.positions.clone())),
        named("reference", OwnedValues::Scalars(vec![7.0; 8])),
    ];
    file.tets = vec![named("a b", OwnedValues::Scalars(vec![0.25; 6]))];
    file
}
