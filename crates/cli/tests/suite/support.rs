//! A folder to run the binary in, and what came out.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

/// A small body that a plane cuts in frame 1.
pub(crate) const SCENE: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
[[body]]
shape = { kind = "box", tets = 300 }
young_modulus = 1e4
[[stroke]]
kind = "plane"
frame = 1
point = [0.03, 0.0, 0.0]
normal = [1.0, 0.1, 0.0]
"#;

/// What a run of the binary gave.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// A folder of its own, gone at the end of the test.
pub(crate) struct Sandbox(TempDir);

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// With the small scene as `scene.toml`.
    pub(crate) fn with_scene() -> Self {
        let sandbox = Self::new();
        sandbox.write("scene.toml", SCENE);
        sandbox
    }

    /// With a generated box as `box.vtk`.
    pub(crate) fn with_mesh() -> Self {
        let sandbox = Self::new();
        sandbox.good(&["mesh", "generate", "box", "--tets", "400", "box.vtk"]);
        sandbox
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Runs the binary here.
    pub(crate) fn incise(&self, arguments: &[&str]) -> Outcome {
        let output = Command::new(env!("CARGO_BIN_EXE_incise"))
            // Without one, libraries of some GPU drivers complain on stderr.
            .env("XDG_RUNTIME_DIR", self.0.path())
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .unwrap();
        Outcome {
            code: output.status.code().unwrap(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Runs the binary, which must end well and say nothing on the error stream; gives what it printed.
    pub(crate) fn good(&self, arguments: &[&str]) -> String {
        let outcome = self.incise(arguments);
        assert_eq!(
            (outcome.code, outcome.stderr.as_str()),
            (0, ""),
            "{arguments:?}: {outcome:?}"
        );
        outcome.stdout
    }

    /// All files and folders below, with the content of the files.
    pub(crate) fn list(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        list(self.0.path(), &mut found);
        found
    }

    /// The names of the files in a folder.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path(folder))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

fn list(folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            list(&path, found);
            found.insert(path, Vec::new());
        } else {
            let content = fs::read(&path).unwrap();
            found.insert(path, content);
        }
    }
}

/// The keys of a JSON object, sorted.
pub(crate) fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys
}

/// Names separated by commas, sorted.
pub(crate) fn names(list: &str) -> Vec<&str> {
    let mut names: Vec<&str> = list.split(", ").collect();
    names.sort_unstable();
    names
}
