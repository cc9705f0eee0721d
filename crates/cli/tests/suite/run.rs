//! `incise run`: the table, and one JSON object per frame with the promised keys.

use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::{SCENE, Sandbox, keys, names};

const ALWAYS: &str =
    "frame, time_s, particles, tets, clusters, colors, pieces, cut, bodies, ms, backend, precision";

/// The objects of a file of lines.
fn frames(sandbox: &Sandbox, file: &str) -> Vec<Value> {
    let text = sandbox.read(file);
    assert!(text.ends_with('\n'));
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn a_run_prints_a_table_and_writes_its_files() {
    let sandbox = Sandbox::with_scene();
    let table = sandbox.good(&["run", "scene.toml", "--frames", "4", "--no-pictures"]);
    for part in [
        "ms per frame",
        "solve",
        "4 (1 with a cut)",
        "smallest child of a cut",
        "tets at start, end",
        "pieces",
        "none: without [contact] pieces pass through each other",
        "kappa",
        "files are in out",
    ] {
        assert!(table.contains(part), "{part} is not in\n{table}");
    }
    let surfaces = [0, 1, 2, 3].map(|frame| format!("surface_{frame:05}.vtp"));
    let mut expected = vec!["frames.jsonl", "mesh.vtu", "scene.toml", "surface.pvd"];
    expected.extend(surfaces.iter().map(String::as_str));
    assert_eq!(sandbox.names("out"), expected);
    assert_eq!(sandbox.names("."), ["out", "scene.toml"]);
    for surface in &surfaces {
        assert!(sandbox.read("out/surface.pvd").contains(surface));
        assert!(
            sandbox
                .read(&format!("out/{surface}"))
                .contains("Name=\"cut\"")
        );
    }
    let mesh = sandbox.read("out/mesh.vtu");
    for field in ["rest_position", "cluster", "color", "piece"] {
        assert!(mesh.contains(&format!("Name=\"{field}\"")), "{field}");
    }
}

#[test]
fn the_table_has_rows_of_contact_and_cuts_only_where_there_are_any() {
    let sandbox = Sandbox::with_scene();
    sandbox.write("touching.toml", format!("{SCENE}\n[contact]\n"));
    for (scene, declared) in [("scene.toml", false), ("touching.toml", true)] {
        let table = sandbox.good(&["run", scene, "--frames", "1", "--no-pictures"]);
        assert!(!table.contains("of a cut"), "nothing was cut yet:\n{table}");
        assert_eq!(table.contains("contact"), declared, "{table}");
    }
}

#[test]
fn every_line_has_exactly_the_promised_keys() {
    let sandbox = Sandbox::with_scene();
    sandbox.good(&[
        "run",
        "scene.toml",
        "--frames",
        "4",
        "--quiet",
        "--jsonl",
        "lines.jsonl",
    ]);
    assert_eq!(
        sandbox.read("lines.jsonl"),
        sandbox.read("out/frames.jsonl")
    );
    let frames = frames(&sandbox, "lines.jsonl");
    assert_eq!(frames.len(), 4);
    for (i, frame) in frames.iter().enumerate() {
        let came_off = if i == 1 { ", detached" } else { "" };
        assert_eq!(keys(frame), names(&format!("{ALWAYS}{came_off}")));
        assert_eq!(
            keys(&frame["ms"]),
            names("cut, cluster, color, schedule, upload, solve, readback, other, total")
        );
        assert_eq!(
            (&frame["frame"], &frame["backend"], &frame["precision"]),
            (&i.into(), &"cpu".into(), &"f32".into())
        );
        assert_eq!(frame["pieces"], if i == 0 { 1 } else { 2 });
        if i == 1 {
            assert_eq!(
                keys(&frame["cut"]),
                names(
                    "tets_cut, tets_created, particles_created, snapped, worst_volume_ratio, dihedral"
                )
            );
        } else {
            assert!(frame["cut"].is_null());
        }
    }
}

#[test]
fn reports_appear_when_asked_for() {
    let sandbox = Sandbox::new();
    let report = "[report]\nevery = 2\nquantities = [\"residual\", \"energy\", \"volume\", \"speed\", \"kappa\"]\n";
    sandbox.write("scene.toml", report.to_owned() + SCENE);
    sandbox.good(&[
        "run",
        "scene.toml",
        "--frames",
        "3",
        "--quiet",
        "--no-pictures",
    ]);
    let frames = frames(&sandbox, "out/frames.jsonl");
    let all = format!(
        "{ALWAYS}, residual, energy, volume, volume_error, min_volume_ratio, max_speed, inverted_tets, kappa, softened"
    );
    let cut = format!("{ALWAYS}, detached");
    for (frame, expected) in frames.iter().zip([&all, &cut, &all]) {
        assert_eq!(keys(frame), names(expected));
    }
    assert_eq!(
        keys(&frames[0]["residual"]),
        names("primal, primal_relative, dual, dual_rms, force, force_relative, potential")
    );
    assert_eq!(
        keys(&frames[0]["energy"]),
        names("kinetic, elastic, gravity")
    );
}

#[test]
fn chosen_substeps_are_in_the_table_and_in_every_line() {
    let sandbox = Sandbox::new();
    let solver = "[solver]\nmethod = \"gauss-seidel\"\nmax_substeps = 2\n";
    sandbox.write("scene.toml", SCENE.replace("1e4", "1e6") + solver);
    let outcome = sandbox.incise(&["run", "scene.toml", "--frames", "3", "--no-pictures"]);
    assert_eq!(outcome.code, 0);
    let warning = outcome.stderr;
    assert!(
        warning.starts_with("warning: body 0: the expected error is"),
        "{warning}"
    );
    assert_eq!(warning.lines().count(), 1, "{warning}");
    let lines = frames(&sandbox, "out/frames.jsonl");
    assert_eq!(lines[0]["warnings"][0]["code"], "substeps_capped");
    assert_eq!(lines[0]["warnings"][0]["where"], "body 0");
    assert!(lines[1].get("warnings").is_none());
    let table = outcome.stdout;
    assert!(table.contains("substeps of body 0"), "{table}");
    assert!(table.contains("2 (limited; "), "{table}");
    for frame in frames(&sandbox, "out/frames.jsonl") {
        assert_eq!(frame["bodies"][0]["substeps"], 2);
        assert_eq!(frame["bodies"][0]["shortfall"], "cap");
    }
}

/// Chebyshev with too large a relaxation diverges: the run ends in that frame with exit code 1, unless it is told to go on.
#[test]
fn a_diverged_run_fails() {
    let sandbox = Sandbox::new();
    let solver = "[solver]\nmethod = \"chebyshev\"\nrelaxation = 1.9\nsubsteps = 1\n";
    sandbox.write("scene.toml", SCENE.to_owned() + solver);
    let run = [
        "run",
        "scene.toml",
        "--frames",
        "60",
        "--no-pictures",
        "--quiet",
    ];
    let outcome = sandbox.incise(&run);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(outcome.stderr.contains("diverged"), "{outcome:?}");
    assert!(frames(&sandbox, "out/frames.jsonl").len() < 60);
    let outcome = sandbox.incise(&[&run[..], &["--keep-going"]].concat());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    assert_eq!(frames(&sandbox, "out/frames.jsonl").len(), 60);
}

#[test]
fn quiet_prints_nothing() {
    let sandbox = Sandbox::with_scene();
    assert_eq!(
        sandbox.good(&["run", "scene.toml", "--frames", "2", "--quiet", "--check"]),
        ""
    );
}

#[test]
fn check_reports_the_number_of_checked_cuts() {
    let sandbox = Sandbox::new();
    let second =
        "[[stroke]]\nkind = \"plane\"\nframe = 3\npoint = [0, 0.02, 0]\nnormal = [0, 1, 0]\n";
    sandbox.write("scene.toml", SCENE.to_owned() + second);
    for (frames, cuts) in [("1", 0), ("3", 1), ("5", 2)] {
        let text = sandbox.good(&[
            "run",
            "scene.toml",
            "--frames",
            frames,
            "--check",
            "--no-pictures",
        ]);
        assert!(
            text.contains(&format!("checked after {cuts} cut")),
            "{text}"
        );
    }
}

#[test]
fn a_stroke_after_the_last_frame_is_named() {
    let sandbox = Sandbox::new();
    sandbox.write("scene.toml", SCENE.replace("frame = 1", "frame = 7"));
    let run = |frames| sandbox.good(&["run", "scene.toml", "--no-pictures", "--frames", frames]);
    let late = run("7");
    assert!(
        late.contains("stroke[0] begins at frame 7, after the last frame: --frames 8 includes it"),
        "{late}"
    );
    assert!(!run("8").contains("stroke[0]"));
}

#[test]
fn without_frames_all_strokes_are_carried_out() {
    let sandbox = Sandbox::new();
    let late = SCENE
        .replace("frame = 1", "frame = 203")
        .replace("tets = 300", "tets = 200");
    sandbox.write("scene.toml", late);
    sandbox.good(&["run", "scene.toml", "--quiet", "--no-pictures"]);
    let frames = frames(&sandbox, "out/frames.jsonl");
    assert_eq!(frames.len(), 204);
    assert_eq!(frames[203]["pieces"], 2);
}

/// A reader that stops reading, as `head` does, is no reason to panic.
#[test]
fn a_closed_pipe_is_no_failure() {
    let sandbox = Sandbox::with_mesh();
    let mut child = Command::new(env!("CARGO_BIN_EXE_incise"))
        .args(["mesh", "info", "box.vtk"])
        .current_dir(sandbox.path("."))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
    assert!(output.status.success());
}
