//! `incise mesh`: generating, converting and looking at meshes.

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
    assert!(
        out.contains("1 tets removed that were there twice"),
        "{out}"
    );
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
