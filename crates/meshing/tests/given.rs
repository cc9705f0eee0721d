//! The folder of meshes made by other programs, where there is one.
//!
//! The folder `shared/meshes` is looked for beside the workspace, or in the folder that the environment variable
//! `INCISE_SHARED` names. Without it the tests that need it say so and pass.

use std::io::{Write, stderr};
use std::path::{Path, PathBuf};

pub(crate) fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("INCISE_SHARED").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = shared.unwrap_or(beside).join("meshes");
    if !folder.is_dir() {
        // Not by `eprintln`, which is shown for tests that fail only.
        let line = format!("SKIPPED: there is no folder {}\n", folder.display());
        stderr()
            .write_all(line.as_bytes())
            .expect("there is a stderr");
        return None;
    }
    Some(folder)
}
