//! Reading and writing meshes, the format chosen by the ending of the file name.
//!
//! | ending | format | read | written | kept beside the tets |
//! |---|---|---|---|---|
//! | `.vtk` | legacy VTK 2.0 to 5.1, text and binary | yes | 4.2 text, 5.1 binary ([`write_vtk_binary`]) | regions, scalars, vectors |
//! | `.vtu` | VTK XML unstructured grid: text, base64, appended, zlib | yes | base64; appended with zlib ([`write_vtu_compressed`]) | regions, scalars, vectors |
//! | `.msh` | Gmsh 1, 2 and 4.1, text and binary | yes | 4.1 and 2.2 ([`write_msh`]) | regions (physical groups, without their names), scalars, vectors |
//! | `.node`, `.ele` | TetGen, a pair of files | yes | yes | regions, up to 256 attributes, markers |
//! | `.mesh`, `.meshb` | Medit, text and binary | yes | yes | regions (references), references of points |
//! | `.obj`, `.off`, `.ply`, `.stl` | triangle surfaces | [`read_surface`] | [`write_surface`], [`write_ply`], [`write_stl_binary`] | |
//! | `.glb`, `.gltf` | glTF 2.0 surface for viewers | | [`write_surface`], rounded to floats | normals |
//! | `.vtp` | VTK XML surface with fields | | [`write_vtp`] | scalars, vectors |
//! | `.pvd` | ParaView collection of time steps | | [`write_pvd`] | |
//!
//! Coordinates are written so that reading gives the same bits back. Readers trust no number in a file: they reserve no
//! more memory than the file could fill, never panic, and name file and line of what is wrong. Every file is written
//! beside its final name and renamed when complete. Time and memory are linear in the size of the file.
//!
//! Reading takes at most ten times the size of a usual file as memory, and 20 times that of any file but for two kinds: 64
//! times for fields of single bits in VTK files, since each becomes a double; and for a compressed `.vtu` what its counts
//! and its blocks agree upon and hold, where zlib can make 1032 bytes of one, and then five times that for doubles.

mod atomic;
mod fields;
mod file;
mod medit;
mod msh;
mod pvd;
mod surfaces;
#[cfg(test)]
mod test_files;
mod tetgen;
mod text;
mod used;
mod vtk;
mod vtp;
mod vtu;
mod xml;

use std::path::Path;

pub use atomic::write_atomically;
pub use fields::{Field, Fields, Values};
pub use file::{MeshFile, NamedValues, OwnedValues};
pub use medit::{read_medit, write_medit};
pub use msh::{MshKind, read_msh, write_msh};
pub use pvd::write_pvd;
pub use surfaces::{
    PlyEncoding, TriangleSurface, is_surface, parse_surface, read_surface, write_ply,
    write_stl_binary, write_surface,
};
pub use tetgen::{parse_tetgen, read_tetgen, read_tetgen_file, write_tetgen, write_tetgen_file};
pub use vtk::{read_vtk, read_vtk_file, write_vtk, write_vtk_binary, write_vtk_file};
pub use vtp::write_vtp;
pub use vtu::{read_vtu, write_vtu, write_vtu_compressed, write_vtu_file};

use crate::{MeshError, TetMesh};

/// The endings of mesh files that are read and written.
const KNOWN: &str = ".vtk, .vtu, .msh, .node, .ele, .mesh, .meshb";

/// Reads a mesh with what its file says beside it, in the format that the ending names; of a `.node`/`.ele` pair either
/// name will do.
///
/// Particles that no tet uses are kept; cells that are no volumes are left out. The mesh has tets, existing corners and
/// finite coordinates; whether it is sound in all other respects is for [`TetMesh::check`] to say.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::Io`] if the file cannot be read, [`MeshError::Parse`] or
/// [`MeshError::ParseBytes`] if its content is wrong or has volumes other than tets, [`MeshError::Empty`] if it has no
/// cells.
pub fn read_file(path: impl AsRef<Path>) -> Result<MeshFile, MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" => read_vtk_file(path),
        "vtu" => read_vtu(path),
        "msh" => read_msh(path),
        "node" | "ele" => read_tetgen_file(path),
        "mesh" | "meshb" => read_medit(path),
        _ => Err(unknown(path, KNOWN)),
    }
}

/// Reads a mesh that is in memory: the content of a file in an archive or from a network. The ending of `path` names the
/// format, and errors name the path; it need not exist. For the two files of TetGen there is [`parse_tetgen`].
///
/// # Errors
/// As [`read_file`], but [`MeshError::Io`]; [`MeshError::UnknownFormat`] for `.node` and `.ele`, too.
///
/// # Example
/// ```
/// use incise_mesh::io;
///
/// let text = "MeshVersionFormatted 2 Dimension 3 Vertices 4 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0
///     Tetrahedra 1 1 2 3 4 7 End";
/// let file = io::parse_file("a.mesh", text.as_bytes())?;
/// assert_eq!((file.mesh.tets.len(), file.regions), (1, vec![7]));
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn parse_file(path: impl AsRef<Path>, bytes: &[u8]) -> Result<MeshFile, MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" => vtk::parse_vtk(bytes, path),
        "vtu" => vtu::parse_vtu(bytes, path),
        "msh" => msh::parse_msh(bytes, path),
        "mesh" | "meshb" => medit::parse_medit(bytes, path),
        _ => Err(unknown(path, ".vtk, .vtu, .msh, .mesh, .meshb")),
    }
}

/// The mesh alone of what [`read_file`] reads.
///
/// # Errors
/// As [`read_file`].
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let folder = std::env::temp_dir();
/// let path = folder.join(format!("incise-doc-{}.msh", std::process::id()));
/// let mesh = kuhn_box([2, 2, 2], DVec3::splat(0.1));
/// io::write(&path, &mesh)?;
/// assert_eq!(io::read(&path)?, mesh);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn read(path: impl AsRef<Path>) -> Result<TetMesh, MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        // Without looking at what else is in there.
        "vtk" => read_vtk(path),
        "node" | "ele" => read_tetgen(path),
        _ => read_file(path).map(|file| file.mesh),
    }
}

/// Writes a mesh with what is to be kept beside it, as far as the format has a place for it; of a `.node`/`.ele` pair
/// either name will do. An existing file is replaced.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::FieldLength`] for values of the wrong number,
/// [`MeshError::Io`] if the file cannot be written.
pub fn write_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" if file.is_plain() => write_vtk(path, &file.mesh),
        "vtk" => write_vtk_file(path, file),
        "vtu" => write_vtu_file(path, file),
        "msh" => write_msh(path, file, MshKind::default()),
        "node" | "ele" => write_tetgen_file(path, file),
        "mesh" | "meshb" => write_medit(path, file),
        _ => Err(unknown(path, KNOWN)),
    }
}

/// Writes a mesh with nothing beside it.
///
/// # Errors
/// As [`write_file`].
pub fn write(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        "vtk" => write_vtk(path, mesh),
        "node" | "ele" => write_tetgen(path, mesh),
        "vtu" => write_vtu(path, &mesh.positions, &mesh.tets, Fields::default()),
        _ => write_file(path, &MeshFile::from(mesh.clone())),
    }
}

fn unknown(path: &Path, known: &'static str) -> MeshError {
    MeshError::UnknownFormat {
        path: path.to_owned(),
        known,
    }
}

fn ending(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase()
}
