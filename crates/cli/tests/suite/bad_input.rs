//! Bad input: one sentence on stderr, exit code 2, nothing on stdout, no files left.

use crate::support::{SCENE, Sandbox};

/// A mesh of a single tet, as text.
const TET: &str = "# vtk DataFile Version 3.0\na tet\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n\
                   0 0 0\n1 0 0\n0 1 0\n0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";

/// The folder of every case: a sound scene, a sound mesh and whatever is wrong.
pub(crate) fn sandbox() -> Sandbox {
    let sandbox = Sandbox::with_scene();
    sandbox.write("tet.vtk", TET);
    sandbox
}

/// Runs the binary on bad input; the message must contain all of `parts`.
pub(crate) fn refused(sandbox: &Sandbox, arguments: &[&str], parts: &[&str]) -> String {
    let before = sandbox.list();
    let outcome = sandbox.incise(arguments);
    let message = outcome.stderr;
    assert_eq!(outcome.code, 2, "{arguments:?}: {message}");
    assert_eq!(outcome.stdout, "", "{arguments:?} printed something");
    for part in parts {
        assert!(
            message.contains(part),
            "{arguments:?}: {part:?} is not in {message:?}"
        );
    }
    assert!(
        sandbox.list() == before,
        "{arguments:?} left something behind: {:?}",
        sandbox.list().keys()
    );
    message
}

/// Runs the binary on bad input; the message must contain all of `parts` and be one line without repetition.
pub(crate) fn refused_in_a_sentence(sandbox: &Sandbox, arguments: &[&str], parts: &[&str]) {
    let message = refused(sandbox, arguments, parts);
    assert!(
        message.starts_with("error: ") && message.ends_with('\n'),
        "{message:?}"
    );
    assert_eq!(message.lines().count(), 1, "{message:?}");
    let clauses: Vec<&str> = message.trim_end().split(": ").collect();
    for (i, clause) in clauses.iter().enumerate() {
        assert!(
            !clauses[i + 1..].contains(clause),
            "{message:?} repeats itself"
        );
    }
}

#[test]
fn scenes_with_a_mistake() {
    for (sound, mistaken, parts) in [
        (
            "young_modulus = 1e4",
            "young_modulus = -1e4",
            &["scene.toml: line 6: body[0].young_modulus is -10000"][..],
        ),
        (
            "young_modulus = 1e4",
            "young_modulus = nan",
            &["body[0].young_modulus is NaN"],
        ),
        (
            "young_modulus = 1e4",
            "poisson_ratio = 0.5",
            &[
                "scene.toml: line 6: body[0].poisson_ratio is 0.5",
                "below 0.5",
            ],
        ),
        (
            "young_modulus = 1e4",
            "poisson_ratio = 0.7",
            &["body[0].poisson_ratio is 0.7"],
        ),
        (
            "young_modulus = 1e4",
            "youngs_modulus = 1e4",
            &["scene.toml: line", "did you mean 'young_modulus'?"],
        ),
        (
            "young_modulus = 1e4",
            "density = 0.0",
            &["body[0].density is 0"],
        ),
        (
            "[world]",
            "[solver]\ntime_step = 0.0\n[world]",
            &["solver.time_step is 0"],
        ),
        (
            "[world]",
            "[solver]\ncoloring = \"gredy\"\n[world]",
            &["solver.coloring", "gredy", "greedy"],
        ),
        (
            "[world]",
            "[solver]\nclustering = \"serial:0\"\n[world]",
            &["solver.clustering", "serial:0"],
        ),
        (
            "[world]",
            "[solver]\nclustering = \"blocks:4\"\n[world]",
            &["solver.clustering", "blocks:4"],
        ),
        (
            "[world]",
            "[wrld]",
            &["scene.toml: line 2", "did you mean 'world'?"],
        ),
        ("[world]", "[world", &["scene.toml: line 2"]),
        (
            "normal = [1.0, 0.1, 0.0]",
            "normal = [0, 0, 0]",
            &["scene.toml: line 11: stroke[0].normal is zero"],
        ),
        (
            "normal = [1.0, 0.1, 0.0]",
            "normal = [0, inf, 0]",
            &["stroke[0].normal is inf"],
        ),
        ("normal = [1.0, 0.1, 0.0]", "", &["scene.toml", "normal"]),
        ("tets = 300", "tets = 0", &["body[0].shape", "0 tets"]),
        ("tets = 300", "tets = -5", &["scene.toml: line 5"]),
        (
            "\"box\"",
            "\"bx\"",
            &["body[0].shape", "did you mean 'box'?"],
        ),
        (
            "shape = { kind = \"box\", tets = 300 }",
            "mesh = \"none.vtk\"",
            &["body[0].mesh", "none.vtk"],
        ),
        (
            "shape = { kind = \"box\", tets = 300 }",
            "",
            &["scene.toml: line 4: body[0] is without a mesh"],
        ),
        (
            "shape = {",
            "mesh = \"tet.vtk\"\nshape = {",
            &["body[0] is given mesh and shape"],
        ),
    ] {
        let sandbox = sandbox();
        assert!(SCENE.contains(sound), "{sound}");
        sandbox.write("scene.toml", SCENE.replacen(sound, mistaken, 1));
        refused_in_a_sentence(&sandbox, &["run", "scene.toml", "--frames", "2"], parts);
    }
    let sandbox = sandbox();
    sandbox.write("scene.toml", "[world]\ngravity = [0, 0, -9.81]\n");
    refused_in_a_sentence(&sandbox, &["run", "scene.toml"], &["body is missing"]);
    refused_in_a_sentence(
        &sandbox,
        &["run", "scene.toml", "--mesh", "tet.vtk"],
        &["[[body]]"],
    );
    let blade = "[[stroke]]\nkind = \"sweep\"\nframes = [1, 2]\nblade = [[0, 0, 1], [0, 0, 1]]\npath = [[0, 0, 0], [0, 0, -1]]\n";
    sandbox.write("scene.toml", SCENE.to_owned() + blade);
    refused_in_a_sentence(
        &sandbox,
        &["run", "scene.toml"],
        &["stroke[1].blade", "at least two different points"],
    );
}

#[test]
fn meshes_with_a_mistake() {
    let half = &TET[..TET.len() / 2];
    let binary = TET.replace("ASCII", "BINARY");
    for (name, content, parts) in [
        ("half.vtk", half.to_owned(), &["half.vtk:"][..]),
        (
            "end.vtk",
            TET.replace("CELL_TYPES 1\n10\n", ""),
            &["end.vtk:"],
        ),
        (
            "nan.vtk",
            TET.replace("0 1 0", "0 nan 0"),
            &["nan.vtk:8", "nan"],
        ),
        ("inf.vtk", TET.replace("0 1 0", "0 1e999 0"), &["inf.vtk:8"]),
        (
            "range.vtk",
            TET.replace("4 0 1 2 3", "4 0 1 2 4"),
            &["range.vtk:11", "4"],
        ),
        ("flat.vtk", TET.replace("0 0 1\n", "1 1 0\n"), &["tet 0"]),
        (
            "turned.vtk",
            TET.replace("4 0 1 2 3", "4 1 0 2 3"),
            &["tet 0"],
        ),
        (
            "twice.vtk",
            TET.replace("4 0 1 2 3", "4 0 1 2 2"),
            &["tet 0"],
        ),
        (
            "none.vtk",
            TET.replace(
                "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10",
                "CELLS 0 0\nCELL_TYPES 0",
            ),
            &["no tetrahedra"],
        ),
        (
            "huge.vtk",
            TET.replace("POINTS 4", "POINTS 4000000000000"),
            &["huge.vtk:"],
        ),
        ("empty.vtk", String::new(), &["empty.vtk:"]),
        ("binary.vtk", binary, &["binary.vtk at byte", "ends early"]),
        ("words.vtk", "no mesh at all".into(), &["words.vtk:"]),
        ("mesh.xyz", TET.into(), &["mesh.xyz", ".vtk, .vtu, .msh"]),
        ("mesh", TET.into(), &["mesh", ".vtk, .vtu, .msh"]),
        (
            "alone.node",
            "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n".into(),
            &["alone.ele"],
        ),
    ] {
        let sandbox = sandbox();
        sandbox.write(name, content);
        refused_in_a_sentence(&sandbox, &["run", "scene.toml", "--mesh", name], parts);
        refused_in_a_sentence(&sandbox, &["color", name, "--csv", "colors.csv"], parts);
        refused_in_a_sentence(&sandbox, &["mesh", "info", name], parts);
    }
    let sandbox = sandbox();
    for command in [
        &["color", "none.vtk"][..],
        &["mesh", "info", "none.vtk"],
        &["mesh", "convert", "none.vtk", "a.vtk"],
        &["run", "--mesh", "none.vtk"],
        &["run", "none.toml"],
    ] {
        refused_in_a_sentence(&sandbox, command, &["cannot read none."]);
    }
}
