//! `incise scene`: the schema, the pages made from it, and validation.

use std::path::Path;

use incise::Scene;
use incise::scene::BodySpec;
use serde_json::Value;

use crate::support::{SCENE, Sandbox};

/// A file of the folder `docs` of the workspace.
fn page(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn pages_are_those_of_the_structs() {
    let sandbox = Sandbox::new();
    for (flag, name) in [
        ("--reference", "scene.md"),
        ("--schema", "scene.schema.json"),
    ] {
        assert!(
            sandbox.good(&["scene", flag]) == page(name),
            "docs/{name} is stale: run `cargo run --release -- scene {flag} > docs/{name}`"
        );
    }
}

/// All names of properties in a schema.
fn properties(schema: &Value, into: &mut Vec<String>) {
    if let Some(keys) = schema["properties"].as_object() {
        into.extend(keys.keys().cloned());
    }
    match schema {
        Value::Object(map) => map.values().for_each(|value| properties(value, into)),
        Value::Array(items) => items.iter().for_each(|value| properties(value, into)),
        _ => {}
    }
}

#[test]
fn every_key_is_on_the_page_with_a_meaning() {
    let schema: Value = serde_json::from_str(&Sandbox::new().good(&["scene", "--schema"])).unwrap();
    let mut keys = Vec::new();
    properties(&schema, &mut keys);
    assert!(keys.len() > 80, "{}", keys.len());
    let reference = page("scene.md");
    for key in keys {
        assert!(
            reference.contains(&format!("`{key}`")) || reference.contains(&format!("[{key}]")),
            "{key} is not on the page"
        );
    }
    for line in reference.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        assert!(
            cells.iter().all(|cell| !cell.is_empty()),
            "an empty cell in: {line}"
        );
        assert_ne!(cells.last(), Some(&"-"), "no meaning in: {line}");
    }
}

#[test]
fn the_commented_scene_has_every_default() {
    let sandbox = Sandbox::new();
    let text = sandbox.good(&["scene", "--defaults"]);
    let mut scene = Scene::from_toml(&text).unwrap();
    assert!(scene.body[0].shape.take().is_some());
    let expected = Scene::default().with(|spec| spec.body = vec![BodySpec::default()]);
    assert_eq!(scene, expected);
    sandbox.write("scene.toml", &text);
    let checked = sandbox.good(&["scene", "--check", "scene.toml"]);
    assert!(
        checked.starts_with("scene.toml: valid: 1 body, "),
        "{checked}"
    );
}

#[test]
fn a_wrong_scene_is_refused_with_line_and_key() {
    let sandbox = Sandbox::with_scene();
    let valid = sandbox.good(&["scene", "--check", "scene.toml"]);
    assert!(valid.ends_with("tets, 1 stroke\n"), "{valid}");
    assert_eq!(sandbox.list().len(), 1);
    for (from, to, expected) in [
        (
            "young_modulus = 1e4",
            "young_modulus = -1.0",
            "wrong.toml: line 6: ",
        ),
        (
            "kind = \"plane\"",
            "kind = \"plain\"",
            "did you mean 'plane'?",
        ),
        ("frame = 1", "fram = 1", "did you mean 'frame'?"),
    ] {
        assert!(SCENE.contains(from));
        sandbox.write("wrong.toml", SCENE.replacen(from, to, 1));
        let outcome = sandbox.incise(&["scene", "--check", "wrong.toml"]);
        assert_eq!(outcome.code, 2);
        assert!(outcome.stderr.contains(expected), "{}", outcome.stderr);
        assert!(
            outcome.stderr.contains("wrong.toml: line "),
            "{}",
            outcome.stderr
        );
    }
    assert_eq!(sandbox.incise(&["scene"]).code, 2);
    assert_eq!(sandbox.incise(&["scene", "--schema", "--defaults"]).code, 2);
}

/// Problems of a valid scene are known before a long run.
#[test]
fn the_check_of_a_scene_warns() {
    let sandbox = Sandbox::with_scene();
    let region = "fixed = [{ sphere = { center = [9, 9, 9], radius = 1 } }]";
    sandbox.write("scene.toml", SCENE.replace("young_modulus = 1e4", region));
    let outcome = sandbox.incise(&["scene", "--check", "scene.toml"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(outcome.stdout.contains(": valid: "), "{}", outcome.stdout);
    let warning = "warning: body[0].fixed[0]: the region contains nothing";
    assert!(outcome.stderr.contains(warning), "{}", outcome.stderr);
}
