//! Endings of file names, and the errors of unsupported ones.

use std::path::Path;

use crate::MeshIoError;

/// The error for an unsupported ending of `path`: unknown, with the `known` ones, or of a format
/// left out of this build.
pub(crate) fn unsupported_format(path: &Path, known: &'static str) -> MeshIoError {
    let path = path.to_owned();
    match feature(&ending(&path)) {
        Some(feature) if is_among(&path, known) => MeshIoError::FormatLeftOut { path, feature },
        _ => MeshIoError::UnknownFormat { path, known },
    }
}

/// The Cargo feature of the format with an ending.
fn feature(ending: &str) -> Option<&'static str> {
    Some(match ending {
        "vtk" => "vtk",
        "vtu" => "vtu",
        "msh" => "msh",
        "node" | "ele" => "tetgen",
        "mesh" | "meshb" => "medit",
        "obj" => "obj",
        "stl" => "stl",
        "ply" => "ply",
        "off" => "off",
        "glb" | "gltf" => "gltf",
        _ => return None,
    })
}

/// True if the ending of `path` is in a list such as `.obj, .stl`.
pub(crate) fn is_among(path: &Path, known: &str) -> bool {
    let ending = ending(path);
    known.split(", ").any(|known| known[1..] == ending)
}

/// The ending of a file name without its dot, in lower case.
pub(crate) fn ending(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase()
}
