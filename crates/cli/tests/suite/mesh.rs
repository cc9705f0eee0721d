//! `incise mesh`: generating, converting and looking at meshes.

use incise::mesh::TriangleSurface;
use incise::mesh_io::{self, OwnedValues};
use serde_json::Value;

use crate::support::{Sandbox, keys, names};

const KEYS: &str = "input, tets, particles, pieces, boundary_triangles, euler_characteristic, volume, min_altitude, \
                    min_dihedral_degrees, max_dihedral_degrees, worst_radius_ratio, max_tets_per_particle, genus, substeps, \
                    dihedral_histogram, radius_ratio_histogram";

fn info(sandbox: &Sandbox, file: &str) -> Value {
    serde_json::from_str(&sandbox.good(&["mesh", "info", file, "--json"])).unwrap()
}

#[test]
fn every_shape_is_generated_with_about_the_wanted_tets() {
    let sandbox = Sandbox::new();
    for (shape, pieces, euler) in [
        ("box", 1, 2),
        ("beam", 1, 2),
        ("sphere", 1, 2),
        ("torus", 1, 0),
        ("plate", 1, 2),
        ("liver", 1, 2),
        ("bunny", 1, 2),
        ("armadillo", 1, 2),
        ("gear", 1, 0),
        ("shell", 1, 4),
        ("pair", 2, 4),
    ] {
        let file = format!("{shape}.vtk");
        assert_eq!(
            sandbox.good(&["mesh", "generate", shape, "--tets", "4000", &file]),
            ""
        );
        let report = info(&sandbox, &file);
        let tets = report["tets"].as_u64().unwrap();
        assert!(tets.abs_diff(4000) <= 80, "{shape}: {tets}");
        assert_eq!(
            (
                report["pieces"].as_u64(),
                report["euler_characteristic"].as_i64()
            ),
            (Some(pieces), Some(euler)),
            "{shape}"
        );
        assert_eq!(report["input"], file);
        assert_eq!(keys(&report), names(KEYS));
    }
}

#[test]
fn converting_there_and_back_keeps_every_bit() {
    let sandbox = Sandbox::with_mesh();
    sandbox.good(&["mesh", "convert", "box.vtk", "box.node"]);
    sandbox.good(&["mesh", "convert", "box.ele", "back.vtk"]);
    assert!(sandbox.read("box.vtk") == sandbox.read("back.vtk"));
    sandbox.good(&["mesh", "convert", "back.vtk", "box.vtu"]);
    assert!(sandbox.read("box.vtu").contains("UnstructuredGrid"));
    let (mut a, mut b) = (info(&sandbox, "box.vtk"), info(&sandbox, "box.node"));
    assert_ne!(a["input"].take(), b["input"].take());
    assert_eq!(a, b);
    let files = ["back.vtk", "box.ele", "box.node", "box.vtk", "box.vtu"];
    assert_eq!(sandbox.names("."), files);
}

#[test]
fn the_table_says_the_same() {
    let sandbox = Sandbox::with_mesh();
    let (table, report) = (
        sandbox.good(&["mesh", "info", "box.vtk"]),
        info(&sandbox, "box.vtk"),
    );
    for part in [
        report["tets"].to_string(),
        report["particles"].to_string(),
        "valid".into(),
        "pieces".into(),
    ] {
        assert!(table.contains(&part), "{part} is not in\n{table}");
    }
}

/// A written file replaces the one before it, also the one it was made from.
#[test]
fn a_mesh_may_be_converted_in_place() {
    let sandbox = Sandbox::with_mesh();
    let before = sandbox.read("box.vtk");
    sandbox.good(&["mesh", "convert", "box.vtk", "box.vtk"]);
    assert!(sandbox.read("box.vtk") == before);
    assert_eq!(sandbox.names("."), ["box.vtk"]);
}

#[test]
fn mesh_quality_is_shown_as_histograms() {
    let sandbox = Sandbox::with_mesh();
    let out = sandbox.good(&["mesh", "info", "box.vtk"]);
    for part in ["genus", "substeps", "dihedral angles", "radius ratios", "█"] {
        assert!(out.contains(part), "{part}: {out}");
    }
    let soft = info(&sandbox, "box.vtk");
    let stiff = [
        "mesh",
        "info",
        "box.vtk",
        "--json",
        "--young-modulus",
        "1e7",
    ];
    let stiff: Value = serde_json::from_str(&sandbox.good(&stiff)).unwrap();
    // Ten times the speed of sound.
    let [soft, stiff] = [&soft, &stiff].map(|report| report["substeps"].as_f64().unwrap());
    assert!(
        (stiff / soft - 10.0).abs() < 1.0 + 10.0 / soft,
        "{soft} {stiff}"
    );
    let refused = sandbox.incise(&["mesh", "info", "box.vtk", "--density", "0"]);
    assert_eq!(refused.code, 2);
    assert!(
        refused.stderr.contains("--density is 0"),
        "{}",
        refused.stderr
    );
}

#[test]
fn repairs_are_listed_one_by_one() {
    let sandbox = Sandbox::new();
    sandbox.good(&["mesh", "generate", "box", "--tets", "300", "box.node"]);
    assert_eq!(
        sandbox.good(&["mesh", "convert", "box.node", "same.node", "--repair"]),
        "nothing\n"
    );
    assert!(sandbox.read("box.ele") == sandbox.read("same.ele"));
    // A tet twice; the reader turns what is inside out by itself.
    let tets = sandbox.read("box.ele");
    let mut lines: Vec<String> = tets.lines().map(str::to_owned).collect();
    let first = lines
        .iter()
        .position(|line| line.split_whitespace().count() == 5)
        .unwrap();
    let words: Vec<String> = lines[first].split_whitespace().map(str::to_owned).collect();
    let count: usize = lines[..first]
        .iter()
        .rev()
        .find_map(|line| line.split_whitespace().next()?.parse().ok())
        .unwrap();
    lines[first - 1] = lines[first - 1].replacen(&count.to_string(), &(count + 1).to_string(), 1);
    lines.push(format!(
        "{} {} {} {} {}",
        count, words[2], words[1], words[3], words[4]
    ));
    sandbox.write("broken.ele", lines.join("\n") + "\n");
    sandbox.write("broken.node", sandbox.read("box.node"));
    let out = sandbox.good(&["mesh", "convert", "broken.node", "mended.vtk", "--repair"]);
    assert!(out.contains("1 repeated tet removed"), "{out}");
    sandbox.good(&["mesh", "info", "mended.vtk"]);
}

/// Through all formats and back: the same tets, to the bit, with what belongs to them.
#[test]
fn regions_survive_a_round_through_the_formats() {
    let sandbox = Sandbox::new();
    sandbox.good(&["mesh", "generate", "box", "--tets", "300", "a.vtk"]);
    for pair in [
        "a.vtk", "a.msh", "a.mesh", "a.meshb", "a.vtu", "a.node", "b.vtk",
    ]
    .windows(2)
    {
        sandbox.good(&["mesh", "convert", pair[0], pair[1]]);
    }
    assert!(sandbox.read("a.vtk") == sandbox.read("b.vtk"));
    let tetgen = sandbox.read("a.ele");
    let mut lines = tetgen.lines();
    let first = lines.next().unwrap().replace(" 0", " 1");
    let rows = lines
        .filter(|line| line.split_whitespace().count() == 5)
        .enumerate();
    let rows: Vec<String> = rows
        .map(|(i, line)| format!("{line} {}", 1 + i % 3))
        .collect();
    sandbox.write("r.ele", format!("{first}\n{}\n", rows.join("\n")));
    sandbox.write("r.node", sandbox.read("a.node"));
    let formats = [
        "r.node", "r.msh", "r.mesh", "r.meshb", "r.vtu", "r.vtk", "s.node",
    ];
    for pair in formats.windows(2) {
        sandbox.good(&["mesh", "convert", pair[0], pair[1]]);
    }
    assert!(
        sandbox
            .read("r.ele")
            .split_whitespace()
            .eq(sandbox.read("s.ele").split_whitespace())
    );
}

/// A cube of side 2 whose faces are turned outward.
const CUBE: &str = "OFF\n8 6 0\n-1 -1 -1\n1 -1 -1\n1 1 -1\n-1 1 -1\n-1 -1 1\n1 -1 1\n1 1 1\n-1 1 1\n\
    4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

#[test]
fn a_surface_is_filled_and_its_fit_reported() {
    let sandbox = Sandbox::new();
    sandbox.write("cube.off", CUBE);
    let told = sandbox.good(&[
        "mesh",
        "tetrahedralize",
        "cube.off",
        "cube.vtk",
        "--tets",
        "5000",
    ]);
    assert!(told.contains("(surface: 8.000000 m³)"), "{}", told);
    let report = info(&sandbox, "cube.vtk");
    let tets = report["tets"].as_u64().unwrap();
    assert!(tets.abs_diff(5_000) <= 100);
    assert_eq!(
        (report["pieces"].as_u64(), report["genus"].as_u64()),
        (Some(1), Some(0))
    );
    // Its edges are rounded.
    let volume = report["volume"].as_f64().unwrap();
    assert!((7.7..8.0).contains(&volume), "{volume}");
    assert!(report["min_dihedral_degrees"].as_f64().unwrap() > 9.3);
}

#[test]
fn unfillable_surfaces_are_refused_with_a_reason() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "open.off",
        CUBE.replace("8 6 0", "8 5 0").replace("4 3 0 4 7\n", ""),
    );
    sandbox.write("cube.off", CUBE);
    let bad = |arguments: &[&str]| {
        let outcome = sandbox.incise(arguments);
        assert_eq!(outcome.code, 2, "{}", outcome.stderr);
        assert_eq!(outcome.stderr.lines().count(), 1, "{}", outcome.stderr);
        outcome.stderr
    };
    let open = bad(&[
        "mesh",
        "tetrahedralize",
        "open.off",
        "a.vtk",
        "--tets",
        "500",
    ]);
    assert!(
        open.contains("open.off") && open.contains("has one triangle"),
        "{open}"
    );
    let few = bad(&["mesh", "tetrahedralize", "cube.off", "a.vtk", "--tets", "5"]);
    assert!(few.contains("ask for 100"), "{few}");
    let format = bad(&[
        "mesh",
        "tetrahedralize",
        "cube.step",
        "a.vtk",
        "--tets",
        "500",
    ]);
    assert!(format.contains(".stl"), "{format}");
    assert!(!sandbox.path("a.vtk").exists());
}

#[test]
fn the_boundary_of_a_body_is_written_as_a_surface_and_filled_again() {
    let sandbox = Sandbox::with_mesh();
    sandbox.good(&["mesh", "convert", "box.vtk", "box.stl"]);
    sandbox.good(&["mesh", "convert", "box.vtk", "box.glb"]);
    assert!(sandbox.path("box.glb").exists());
    let told = sandbox.good(&[
        "mesh",
        "tetrahedralize",
        "box.stl",
        "again.msh",
        "--tets",
        "600",
        "--levels",
        "2",
    ]);
    assert!(told.contains("1 piece\n"), "{told}");
    let report = info(&sandbox, "again.msh");
    assert!(report["tets"].as_u64().unwrap().abs_diff(600) <= 12);
}

/// OBJ, PLY and OFF files of a body have the points of its boundary and no others.
#[test]
fn surfaces_of_a_mesh_have_no_points_inside() {
    let sandbox = Sandbox::with_mesh();
    let mesh = mesh_io::read(sandbox.path("box.vtk")).unwrap();
    let boundary = TriangleSurface::boundary_of(&mesh);
    let mut used: Vec<_> = boundary.triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    assert!(used.len() < mesh.positions.len());
    for name in ["s.obj", "s.ply", "s.off"] {
        sandbox.good(&["mesh", "convert", "box.vtk", name]);
        let surface = mesh_io::read_surface(sandbox.path(name)).unwrap();
        let expected: Vec<_> = used.iter().map(|p| mesh.positions[p.index()]).collect();
        assert_eq!(surface.positions, expected, "{name}");
        let at = |surface: &TriangleSurface| -> Vec<_> {
            let corners = surface.triangles.as_flattened().iter();
            corners.map(|p| surface.positions[p.index()]).collect()
        };
        assert_eq!(at(&surface), at(&boundary), "{name}");
    }
    // Generated bodies, too.
    sandbox.good(&["mesh", "generate", "box", "--tets", "400", "direct.off"]);
    assert!(sandbox.read("direct.off") == sandbox.read("s.off"));
}

/// Surfaces are converted and described, and where tets are needed the message names the command that makes them.
#[test]
fn surfaces_are_taken_or_lead_to_tetrahedralize() {
    let sandbox = Sandbox::new();
    sandbox.write("cube.off", CUBE);
    for pair in [
        "cube.off", "a.obj", "a.stl", "a.ply", "a.glb", "a.gltf", "b.off",
    ]
    .windows(2)
    {
        sandbox.good(&["mesh", "convert", pair[0], pair[1]]);
        let report = info(&sandbox, pair[1]);
        assert_eq!(report["triangles"], 12, "{pair:?}");
        assert_eq!(report["points"], 8, "{pair:?}");
        assert_eq!(
            (&report["closed"], &report["parts"]),
            (&true.into(), &1.into())
        );
        assert_eq!(report["volume"], 8.0, "{pair:?}");
        assert_eq!(report["area"], 24.0, "{pair:?}");
        assert_eq!(
            report["low"],
            serde_json::json!([-1.0, -1.0, -1.0]),
            "{pair:?}"
        );
    }
    let text = sandbox.good(&["mesh", "info", "a.obj"]);
    assert!(text.contains("incise mesh tetrahedralize a.obj"), "{text}");
    sandbox.write(
        "open.off",
        CUBE.replace("8 6 0", "8 5 0").replace("4 3 0 4 7\n", ""),
    );
    let text = sandbox.good(&["mesh", "info", "open.off"]);
    assert!(text.contains("is open"), "{text}");
    let wrong = |arguments: &str| {
        let outcome = sandbox.incise(&arguments.split(' ').collect::<Vec<_>>());
        assert_eq!(outcome.code, 2, "{outcome:?}");
        outcome.stderr
    };
    for arguments in [
        "mesh convert a.obj a.vtk",
        "color a.obj",
        "run --mesh a.obj --frames 1 --no-pictures",
    ] {
        let error = wrong(arguments);
        assert!(error.contains("incise mesh tetrahedralize"), "{error}");
    }
    assert!(wrong("mesh convert a.obj b.obj --repair").contains("omit it"));
    sandbox.good(&["mesh", "generate", "box", "--tets", "300", "t.vtk"]);
    let error = wrong("mesh tetrahedralize t.vtk u.vtk --tets 300");
    assert!(error.contains("incise mesh convert"), "{error}");
    let error = wrong("mesh tetrahedralize a.obj u.step --tets 300");
    assert!(
        error.contains("u.step") && error.contains(".vtk"),
        "{error}"
    );
}

/// The texture of a square column goes around it: u is the side, v the height.
#[test]
fn texture_coordinates_are_kept_by_filling() {
    let sandbox = Sandbox::new();
    let mut text = String::new();
    let ring = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    for z in [-1, 1] {
        for [x, y] in ring {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for i in 0..4 {
        let (a, b) = (i + 1, (i + 1) % 4 + 1);
        text += &format!("f {a}/1 {b}/2 {}/3 {}/4\n", b + 4, a + 4);
    }
    text += "f 5/1 6/2 7/3 8/4\nf 4/1 3/2 2/3 1/4\n";
    sandbox.write("column.obj", text);
    sandbox.good(&["mesh", "convert", "column.obj", "column.glb"]);
    for surface in ["column.obj", "column.glb"] {
        sandbox.good(&["mesh", "tetrahedralize", surface, "c.vtu", "--tets", "1000"]);
        let file = mesh_io::read_file(sandbox.path("c.vtu")).unwrap();
        let texture = file
            .particles
            .iter()
            .find(|field| field.name == "texture_coordinates");
        let OwnedValues::Vectors(texture) = &texture.unwrap().values else {
            panic!("pairs are vectors");
        };
        let mut checked = 0;
        for (x, uv) in file.mesh.positions.iter().zip(texture) {
            // On a side, away from its edges: where the side y = -1 is nearest.
            if x.y < -0.9 && x.x.abs() < 0.7 && x.z.abs() < 0.7 {
                let expected = [0.5 * (x.x + 1.0), 0.5 * (x.z + 1.0), 0.0];
                for (found, expected) in uv.to_array().iter().zip(expected) {
                    // Floats in the .glb.
                    assert!((found - expected).abs() < 1e-6, "{surface}: {x} {uv}");
                }
                checked += 1;
            }
        }
        assert!(checked > 10, "{checked}");
    }
}

/// A plate of a hundredth of its side: refused in seconds with the number of tets that it needs.
#[test]
fn thin_plates_are_refused_with_a_number() {
    let sandbox = Sandbox::new();
    let plate = CUBE.replace(
        "-1 -1 -1\n1 -1 -1\n1 1 -1\n-1 1 -1\n",
        "-1 -1 -0.01\n1 -1 -0.01\n1 1 -0.01\n-1 1 -0.01\n",
    );
    let plate = plate.replace(
        "-1 -1 1\n1 -1 1\n1 1 1\n-1 1 1\n",
        "-1 -1 0.01\n1 -1 0.01\n1 1 0.01\n-1 1 0.01\n",
    );
    sandbox.write("plate.off", plate);
    let start = std::time::Instant::now();
    let fill = "mesh tetrahedralize plate.off p.vtk --tets 1000";
    let outcome = sandbox.incise(&fill.split(' ').collect::<Vec<_>>());
    assert_eq!(outcome.code, 2);
    assert!(
        outcome.stderr.contains("ask for 310000 tets or more"),
        "{outcome:?}"
    );
    assert!(start.elapsed().as_secs() < 10);
}

/// Two balls on a thin rod fall apart: the warning says so, with places.
#[test]
fn lost_parts_have_a_warning_with_their_place() {
    let sandbox = Sandbox::new();
    sandbox.write("cube.off", CUBE);
    // A cube with a needle on its upper side.
    let needle = CUBE
        .replace("8 6 0", "12 11 0")
        .replace(
            "-1 1 1\n",
            "-1 1 1\n-0.02 -0.02 1\n0.02 -0.02 1\n0 0.02 1\n0 0 3\n",
        )
        .replace(
            "4 4 5 6 7\n",
            "3 4 5 8\n3 5 9 8\n3 5 6 9\n4 6 7 10 9\n4 7 4 8 10\n3 8 9 11\n3 9 10 11\n3 10 8 11\n",
        )
        .replace("12 11 0", "12 13 0");
    sandbox.write("needle.off", needle);
    let fill = "mesh tetrahedralize needle.off n.vtk --tets 2000";
    let outcome = sandbox.incise(&fill.split(' ').collect::<Vec<_>>());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(
        outcome.stderr.starts_with("warning: parts of the surface")
            && outcome
                .stderr
                .contains("the farthest at (0.000, 0.000, 3.000)"),
        "{outcome:?}"
    );
}

#[test]
fn inverted_input_names_the_repair() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "inverted.mesh",
        "MeshVersionFormatted 2 Dimension 3 Vertices 4 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0\n Tetrahedra 1 1 3 2 4 0 End\n",
    );
    for arguments in [
        "mesh info inverted.mesh",
        "run --mesh inverted.mesh --frames 1 --no-pictures",
    ] {
        let outcome = sandbox.incise(&arguments.split(' ').collect::<Vec<_>>());
        assert_eq!(outcome.code, 2);
        assert!(
            outcome
                .stderr
                .contains("incise mesh convert IN OUT --repair"),
            "{outcome:?}"
        );
    }
    sandbox.good(&["mesh", "convert", "inverted.mesh", "sound.mesh", "--repair"]);
    sandbox.good(&["mesh", "info", "sound.mesh"]);
}
