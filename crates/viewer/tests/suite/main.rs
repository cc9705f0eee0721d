//! The viewer as a program, without a display: its messages when no window can be opened.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

use std::path::Path;
use std::process::{Command, Output};

/// Runs the viewer with arguments in an environment without a display.
fn viewer(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_incise-viewer"))
        .args(arguments)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap()
}

fn sentence(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{text}");
    assert_eq!(text.trim_end().lines().count(), 1, "{text}");
    text
}

// Elsewhere a window needs no such variables.
#[cfg(all(unix, not(target_os = "macos")))]
#[test]
fn a_missing_display_is_reported() {
    let output = viewer(&[]);
    assert_eq!(output.status.code(), Some(1));
    let text = sentence(&output);
    assert!(text.contains("a display is needed"), "{text}");
    assert!(text.contains("incise run"), "{text}");
}

#[cfg(all(unix, not(target_os = "macos")))]
#[test]
fn a_display_that_does_not_answer_is_named() {
    let output = Command::new(env!("CARGO_BIN_EXE_incise-viewer"))
        .env("DISPLAY", ":61234")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(sentence(&output).contains("a display is needed"));
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let output = viewer(&["nowhere.vtk"]);
    assert_eq!(output.status.code(), Some(2));
    let text = sentence(&output);
    assert!(text.contains("nowhere.vtk: file not found"), "{text}");
}

#[test]
fn a_broken_scene_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, "[world]\ngravty = [0, 0, 0]\n").unwrap();
    let output = viewer(&[path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let text = sentence(&output);
    assert!(
        text.contains("scene.toml") && text.contains("gravity"),
        "{text}"
    );
}

#[test]
fn help_has_an_example() {
    let output = viewer(&["--help"]);
    assert!(output.status.success());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("Example: incise-viewer fixtures/"), "{text}");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    assert!(
        fixtures.join("crossing.toml").is_file(),
        "the example exists"
    );
}
