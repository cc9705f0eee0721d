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

/// Endings of mesh files that are read and written.
pub(crate) const MESHES: &str = ".vtk, .vtu, .msh, .node, .ele, .mesh, .meshb";

/// Endings of surface files that are read and written.
pub(crate) const SURFACES: &str = ".obj, .stl, .ply, .off, .glb, .gltf";

/// The error for a file to be read that is no mesh.
pub(crate) fn no_mesh(path: &Path, known: &'static str) -> MeshIoError {
    match is_among(path, SURFACES) {
        true => MeshIoError::Surface {
            path: path.to_owned(),
        },
        false => unsupported_format(path, known),
    }
}

/// The error for a file to be read that is no surface.
pub(crate) fn no_surface(path: &Path) -> MeshIoError {
    match is_among(path, MESHES) {
        true => MeshIoError::Tets {
            path: path.to_owned(),
        },
        false => unsupported_format(path, SURFACES),
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
