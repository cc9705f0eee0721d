//! The command line with and without a GPU.

use std::io::Write;

use serde_json::Value;

use crate::support::Sandbox;

/// True if there is a GPU or a software adapter; prints a note if not.
fn has_gpu(test: &str, stderr: &str, code: i32) -> bool {
    if code == 0 {
        return true;
    }
    assert!(std::env::var_os("INCISE_REQUIRE_GPU").is_none(), "{stderr}");
    assert!(
        stderr.contains("no GPU") || stderr.contains("GPU path"),
        "{stderr}"
    );
    assert_eq!((code, stderr.lines().count()), (2, 1), "{stderr}");
    // Not by `eprintln`, which is shown for tests that fail only.
    let line = format!("SKIPPED {test}: {stderr}\n");
    std::io::stderr().write_all(line.as_bytes()).unwrap();
    false
}

#[test]
fn a_scene_runs_on_a_gpu_or_reports_the_reason() {
    let sandbox = Sandbox::with_scene();
    let run = [
        "run",
        "scene.toml",
        "--frames",
        "6",
        "--backend",
        "gpu",
        "--out",
        "there",
    ];
    let outcome = sandbox.incise(&run);
    if !has_gpu(
        "a_scene_runs_on_a_gpu_or_reports_the_reason",
        &outcome.stderr,
        outcome.code,
    ) {
        return;
    }
    assert!(
        outcome.stdout.contains("computed on "),
        "{}",
        outcome.stdout
    );
    sandbox.good(&[
        "run",
        "scene.toml",
        "--frames",
        "6",
        "--backend",
        "cpu",
        "--out",
        "here",
    ]);
    let frames = |folder: &str| -> Vec<Value> {
        let text = sandbox.read(&format!("{folder}/frames.jsonl"));
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    };
    for (there, here) in frames("there").iter().zip(&frames("here")) {
        assert_eq!(
            (&there["backend"], &here["backend"]),
            (&"gpu".into(), &"cpu".into())
        );
        for key in ["tets", "pieces", "colors", "cut"] {
            assert_eq!(there[key], here[key]);
        }
    }
    assert_eq!(sandbox.names("there"), sandbox.names("here"));
}

#[test]
fn auto_always_runs_and_reports_its_backend() {
    let sandbox = Sandbox::with_scene();
    let out = sandbox.good(&["run", "scene.toml", "--frames", "2", "--backend", "auto"]);
    assert!(out.contains("computed on "), "{out}");
    let silent = sandbox.good(&["run", "scene.toml", "--frames", "2"]);
    assert!(!silent.contains("computed on "), "{silent}");
}

#[test]
fn colorings_on_a_gpu_are_those_of_the_processor() {
    let sandbox = Sandbox::new();
    sandbox.good(&["mesh", "generate", "box", "--tets", "300", "tet.vtk"]);
    let color = |backend: &str, algorithm: &str, csv: &str| {
        sandbox.incise(&[
            "color",
            "tet.vtk",
            "--backend",
            backend,
            "--algorithm",
            algorithm,
            "--csv",
            csv,
            "--json",
        ])
    };
    for algorithm in ["scgc", "jones-plassmann", "ecl-gc", "vivace", "wlc"] {
        let there = color("gpu", algorithm, "there.csv");
        let test = "colorings_on_a_gpu_are_those_of_the_processor";
        if !has_gpu(test, &there.stderr, there.code) {
            return;
        }
        assert_eq!(color("cpu", algorithm, "here.csv").code, 0);
        assert_eq!(
            sandbox.read("there.csv"),
            sandbox.read("here.csv"),
            "{algorithm}"
        );
        let report: Value = serde_json::from_str(&there.stdout).unwrap();
        assert_eq!(
            (&report["backend"], &report["verified"]),
            (&"gpu".into(), &true.into())
        );
    }
    let refused = color("gpu", "dsatur", "none.csv");
    assert_eq!(refused.code, 2);
    assert!(
        refused.stderr.contains("jones-plassmann"),
        "{}",
        refused.stderr
    );
}

/// Libraries of GPU drivers complain on stderr without a folder for sockets.
#[test]
#[cfg(target_os = "linux")]
fn nothing_is_on_stderr_without_a_folder_for_sockets() {
    let sandbox = Sandbox::with_scene();
    for folder in [None, Some(""), Some("relative")] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_incise"));
        command.env_remove("XDG_RUNTIME_DIR");
        if let Some(folder) = folder {
            command.env("XDG_RUNTIME_DIR", folder);
        }
        let run = "run scene.toml --frames 1 --backend gpu --no-pictures";
        let output = command.args(run.split(' ')).current_dir(sandbox.path("."));
        let output = output.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        let code = output.status.code().unwrap();
        let test = "nothing_is_on_stderr_without_a_folder_for_sockets";
        if !has_gpu(test, &stderr, code) {
            return;
        }
        assert_eq!(stderr, "", "{folder:?}");
    }
}
