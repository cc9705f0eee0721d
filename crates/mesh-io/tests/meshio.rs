//! What is written is read by meshio to the same tets and the same bits of every coordinate.
//!
//! Needs `python3` with `meshio`. Without them the test says so and passes, unless the environment variable
//! `INCISE_REQUIRE_MESHIO` is set. `INCISE_PYTHON` names another Python.

use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use incise_mesh::glam::dvec3;
use incise_mesh::{TriangleSurface, kuhn_box};
use incise_mesh_io::{MeshFile, MshKind, NamedValues, OwnedValues, PlyEncoding};

/// Prints a line for each file: its name, or what is wrong with it. A first line tells that meshio is there.
const SCRIPT: &str = r#"
import sys
try:
    import meshio, numpy
except ImportError as error:
    print("absent", error)
    sys.exit(0)
print("present", meshio.__version__)

def numbers(path, kind, columns):
    words = [w for w in open(path).read().split()]
    return numpy.array([kind(w) for w in words]).reshape(-1, columns)

for line in open("files.txt"):
    name, cell, kept, fields = line.rstrip("\n").split("\t")
    try:
        mesh = meshio.read(name)
        expected = numbers(cell + ".points", float, 3)
        found = numpy.asarray(mesh.points, dtype=float)
        connected = numbers(cell + ".cells", int, 4 if cell == "tetra" else 3)
        blocks = [b.data for b in mesh.cells if b.type == cell]
        assert blocks and len(blocks) == len(mesh.cells), [b.type for b in mesh.cells]
        data = numpy.vstack(blocks)
        if kept != "points":
            # STL has the corners of the triangles alone, in its binary form as floats.
            expected, found = expected[connected], found[data]
            if kept == "floats":
                expected = expected.astype(numpy.float32).astype(float)
        else:
            assert numpy.array_equal(data, connected), "the cells differ"
        # Bits, for which 0 and -0 differ.
        same = expected.shape == found.shape and expected.tobytes() == numpy.ascontiguousarray(found).tobytes()
        assert same, "the coordinates differ"
        for field in fields.split():
            place, name_of, expected = field.split(";")
            data = mesh.point_data if place == "points" else mesh.cell_data
            value = data[name_of] if place == "points" else numpy.concatenate(data[name_of])
            first = numpy.asarray(value, dtype=float).ravel()[:3]
            assert first.tolist() == [float(e) for e in expected.split(",")], (name_of, first)
        print("same", name)
    except Exception as error:
        print("DIFFERENT", name, type(error).__name__, str(error)[:300].replace("\n", " "))
"#;

/// A list of files for the script.
struct List<'a> {
    folder: &'a Path,
    lines: String,
    names: Vec<&'static str>,
}

impl List<'_> {
    /// A file of cells of meshio's name, which keeps all points or else what `kept` says, and the first values of
    /// fields.
    fn add(&mut self, name: &'static str, cell: &str, kept: &str, fields: &str) {
        self.names.push(name);
        let line = writeln!(self.lines, "{name}\t{cell}\t{kept}\t{fields}");
        line.expect("memory takes everything");
    }

    /// What the files of such cells are to have in them.
    fn put(
        &self,
        cell: &str,
        points: impl Iterator<Item = [f64; 3]>,
        cells: impl Iterator<Item = u32>,
    ) {
        let points: Vec<_> = points.flatten().map(|c| format!("{c:?}")).collect();
        let cells: Vec<_> = cells.map(|c| c.to_string()).collect();
        for (ending, text) in [("points", points.join(" ")), ("cells", cells.join(" "))] {
            std::fs::write(self.folder.join(format!("{cell}.{ending}")), text)
                .expect("the file can be written");
        }
    }
}

fn sample() -> MeshFile {
    let mut file = MeshFile::from(kuhn_box([2, 1, 1], dvec3(0.1, 0.7, 1.3)));
    // All tets are positive, so that TetGen's stay as they are, whatever these are.
    let hard = [-0.0, 5e-324, -2.5e-310, 1e300, f64::MAX, 0.1 + 0.2];
    file.mesh
        .positions
        .extend(hard.map(|c| dvec3(c, 1.0 / 3.0, -c)));
    let tets = file.mesh.tets.len();
    file.regions = (0..).map(|t| 3 + t % 2).take(tets).collect();
    let scalars = |count: usize| OwnedValues::Scalars((0..count).map(|i| 0.1 + i as f64).collect());
    let named = |name: &str, values| NamedValues {
        name: name.to_owned(),
        values,
    };
    file.particles = vec![
        named("heat", scalars(file.mesh.positions.len())),
        named(
            "speed",
            OwnedValues::Vectors(
                file.mesh
                    .positions
                    .iter()
                    .map(|_| dvec3(0.1, -0.0, 1e300))
                    .collect(),
            ),
        ),
    ];
    file.tets = vec![named("young", scalars(tets))];
    file
}

#[test]
fn files_read_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut list = List {
        folder: folder.path(),
        lines: String::new(),
        names: Vec::new(),
    };

    let file = sample();
    let mesh = &file.mesh;
    list.put(
        "tetra",
        mesh.positions.iter().map(|p| p.to_array()),
        mesh.tets.iter().flatten().map(|p| p.0),
    );
    let fields = "points;heat;0.1,1.1,2.1 points;speed;0.1,-0.0,1e300 cells;young;0.1,1.1,2.1";
    let vtk = &format!("{fields} cells;regions;3,4,3");
    let msh = &format!("{fields} cells;gmsh:physical;3,4,3");
    incise_mesh_io::write(path("plain.vtk"), mesh).unwrap();
    list.add("plain.vtk", "tetra", "points", "");
    incise_mesh_io::write_file(path("text.vtk"), &file).unwrap();
    list.add("text.vtk", "tetra", "points", vtk);
    incise_mesh_io::write_vtk_binary(path("binary.vtk"), &file).unwrap();
    list.add("binary.vtk", "tetra", "points", vtk);
    incise_mesh_io::write_file(path("fields.vtu"), &file).unwrap();
    list.add("fields.vtu", "tetra", "points", vtk);
    incise_mesh_io::write_vtu_compressed(path("zlib.vtu"), &file).unwrap();
    list.add("zlib.vtu", "tetra", "points", vtk);
    incise_mesh_io::write(path("plain.vtu"), mesh).unwrap();
    list.add("plain.vtu", "tetra", "points", "");
    for (name, kind) in [
        ("text41.msh", MshKind::Text41),
        ("binary41.msh", MshKind::Binary41),
        ("text22.msh", MshKind::Text22),
        ("binary22.msh", MshKind::Binary22),
    ] {
        incise_mesh_io::write_msh(path(name), &file, kind).unwrap();
        list.add(name, "tetra", "points", msh);
    }
    // The values of tets must be whole numbers for meshio.
    let mut regions = file.clone();
    regions.tets.clear();
    incise_mesh_io::write_file(path("pair.node"), &regions).unwrap();
    list.add("pair.node", "tetra", "points", "");
    incise_mesh_io::write_file(path("text.mesh"), &file).unwrap();
    list.add("text.mesh", "tetra", "points", "cells;medit:ref;3,4,3");
    incise_mesh_io::write_file(path("binary.meshb"), &file).unwrap();
    list.add("binary.meshb", "tetra", "points", "cells;medit:ref;3,4,3");

    let surface = TriangleSurface::boundary_of(&kuhn_box([2, 1, 1], dvec3(0.1, 0.7, 1.3)));
    list.put(
        "triangle",
        surface.positions.iter().map(|p| p.to_array()),
        surface.triangles.iter().flatten().map(|p| p.0),
    );
    for name in ["text.obj", "text.off", "little.ply", "text.stl"] {
        incise_mesh_io::write_surface(path(name), &surface).unwrap();
    }
    incise_mesh_io::write_ply(path("text.ply"), &surface, PlyEncoding::Ascii).unwrap();
    incise_mesh_io::write_ply(path("big.ply"), &surface, PlyEncoding::BigEndian).unwrap();
    incise_mesh_io::write_stl_binary(path("binary.stl"), &surface).unwrap();
    for name in ["text.obj", "text.off", "text.ply", "little.ply", "big.ply"] {
        list.add(name, "triangle", "points", "");
    }
    list.add("text.stl", "triangle", "corners", "");
    list.add("binary.stl", "triangle", "floats", "");
    std::fs::write(path("files.txt"), &list.lines).unwrap();

    let python = std::env::var_os("INCISE_PYTHON").unwrap_or_else(|| "python3".into());
    let run = Command::new(python)
        .args(["-c", SCRIPT])
        .current_dir(folder.path())
        .output();
    let (text, trouble) = match &run {
        Ok(run) => (
            String::from_utf8_lossy(&run.stdout),
            String::from_utf8_lossy(&run.stderr),
        ),
        Err(error) => ("".into(), error.to_string().into()),
    };
    if !text.starts_with("present") {
        let line = format!("SKIPPED: there is no Python with meshio: {text}{trouble}\n");
        assert!(
            std::env::var_os("INCISE_REQUIRE_MESHIO").is_none(),
            "{line}"
        );
        // Not by `eprintln`, which is shown for tests that fail only.
        std::io::stderr().write_all(line.as_bytes()).unwrap();
        return;
    }
    assert!(!text.contains("DIFFERENT"), "{text}");
    for name in list.names {
        assert!(
            text.contains(&format!("same {name}\n")),
            "{name}: {text}{trouble}"
        );
    }
}
