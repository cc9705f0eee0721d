//! Reading and writing meshes, the format chosen by the ending of the file name.
//!
//! | ending | format | read | write |
//! |---|---|---|---|
//! | `.vtk` | legacy VTK, ASCII, unstructured grid | yes | yes |
//! | `.node`, `.ele` | TetGen, a pair of files | yes | yes |
//! | `.vtu` | VTK XML unstructured grid with fields | | [`write()`], [`write_vtu`] |
//! | `.vtp` | VTK XML surface with fields | | [`write_vtp`] |
//! | `.pvd` | ParaView collection of time steps | | [`write_pvd`] |
//!
//! Coordinates are written so that reading gives the same bits back. Readers trust no number in a file: they reserve no
//! more memory than the file could fill, never panic, and name file and line of what is wrong. Every file is written
//! beside its final name and renamed when complete. Time and memory are linear in the size of the file.

mod atomic;
mod fields;
mod file;
mod medit;
mod pvd;
mod surfaces;
mod tetgen;
mod text;
mod vtk;
mod vtp;
mod vtu;
mod xml;

use std::path::Path;

pub use atomic::write_atomically;
pub use fields::{Field, Fields, Values};
pub use file::{MeshFile, NamedValues, OwnedValues};
pub use medit::{read_medit, write_medit};
pub use pvd::write_pvd;
pub use surfaces::{
    PlyEncoding, TriangleSurface, read_surface, write_ply, write_stl_binary, write_surface,
};
pub use tetgen::{read_tetgen, read_tetgen_file, write_tetgen, write_tetgen_file};
pub use vtk::{read_vtk, write_vtk};
pub use vtp::write_vtp;
pub use vtu::write_vtu;

use crate::{MeshError, TetMesh};

/// Reads a mesh from a `.vtk` file or a `.node`/`.ele` pair (either name will do).
///
/// Particles that no tet uses are kept. The mesh has tets, existing corners and finite coordinates; whether it is sound
/// in all other respects is for [`TetMesh::check`] to say.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::Io`] if the file cannot be read, [`MeshError::Parse`]
/// if its content is wrong, [`MeshError::Empty`] if it has no cells.
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let folder = std::env::temp_dir();
/// let path = folder.join(format!("incise-doc-{}.vtk", std::process::id()));
/// let mesh = kuhn_box([2, 2, 2], DVec3::splat(0.1));
/// io::write(&path, &mesh)?;
/// assert_eq!(io::read(&path)?, mesh);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn read(path: impl AsRef<Path>) -> Result<TetMesh, MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" => read_vtk(path),
        "node" | "ele" => read_tetgen(path),
        _ => Err(MeshError::UnknownFormat {
            path: path.to_owned(),
            known: ".vtk, .node, .ele",
        }),
    }
}

/// Writes a mesh as `.vtk`, `.vtu` or a `.node`/`.ele` pair (either name will do). An existing file is replaced.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::Io`] if the file cannot be written.
pub fn write(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" => write_vtk(path, mesh),
        "node" | "ele" => write_tetgen(path, mesh),
        "vtu" => write_vtu(path, &mesh.positions, &mesh.tets, Fields::default()),
        _ => Err(MeshError::UnknownFormat {
            path: path.to_owned(),
            known: ".vtk, .vtu, .node, .ele",
        }),
    }
}

fn ending(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase()
}
