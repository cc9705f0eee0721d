//! Tet meshes by the ending of the file name, which selects the format.
//!
//! Formats that are left out of the build are not matched here; the error of their endings names the feature that adds
//! them.

use std::path::Path;

use incise_mesh::TetMesh;

use crate::endings::{MESHES, ending, is_among, no_mesh, unsupported_format};
#[cfg(feature = "medit")]
use crate::medit::{read_medit, write_medit};
#[cfg(feature = "msh")]
use crate::msh::{MshKind, read_msh, write_msh};
#[cfg(feature = "tetgen")]
use crate::tetgen::{read_tetgen, read_tetgen_file, write_tetgen, write_tetgen_file};
#[cfg(feature = "vtk")]
use crate::vtk::{read_vtk, read_vtk_file, write_vtk, write_vtk_file};
#[cfg(feature = "vtu")]
use crate::vtu::{read_vtu, write_vtu, write_vtu_file};
use crate::{MeshFile, MeshIoError};

/// True if [`read`] and [`write()`] support the ending of the file name.
#[must_use]
pub fn is_mesh(path: &Path) -> bool {
    is_among(path, MESHES)
}

/// Reads a mesh with its regions and values, in the format of the file's ending; for a `.node`/`.ele` pair either name
/// is accepted.
///
/// Particles that no tet uses are kept; cells other than volumes are skipped. The mesh has tets, existing corners and
/// finite coordinates; [`TetMesh::check`] checks all other rules.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::Surface`] for that of a surface,
/// [`MeshIoError::FormatLeftOut`] for a format that this build lacks, [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`] or [`MeshIoError::ParseBytes`] if its
/// content is wrong or has volumes other than tets, [`MeshIoError::Empty`] if it has no cells.
pub fn read_file(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        #[cfg(feature = "vtk")]
        "vtk" => read_vtk_file(path),
        #[cfg(feature = "vtu")]
        "vtu" => read_vtu(path),
        #[cfg(feature = "msh")]
        "msh" => read_msh(path),
        #[cfg(feature = "tetgen")]
        "node" | "ele" => read_tetgen_file(path),
        #[cfg(feature = "medit")]
        "mesh" | "meshb" => read_medit(path),
        _ => Err(no_mesh(path, MESHES)),
    }
}

/// Parses a mesh in memory, for example from an archive or a network. The ending of `path` selects the format, and
/// errors contain the path; it need not exist. For the two files of TetGen use [`parse_tetgen`](crate::parse_tetgen).
///
/// # Errors
/// The errors of [`read_file`] except [`MeshIoError::Io`]; [`MeshIoError::UnknownFormat`] for `.node` and `.ele`, too.
///
/// # Example
/// ```
/// let text = "MeshVersionFormatted 2 Dimension 3 Vertices 4 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0
///     Tetrahedra 1 1 2 3 4 7 End";
/// let file = incise_mesh_io::parse_file("a.mesh", text.as_bytes())?;
/// assert_eq!((file.mesh.tets.len(), file.regions), (1, vec![7]));
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn parse_file(path: impl AsRef<Path>, bytes: &[u8]) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        #[cfg(feature = "vtk")]
        "vtk" => crate::vtk::parse_vtk(bytes, path),
        #[cfg(feature = "vtu")]
        "vtu" => crate::vtu::parse_vtu(bytes, path),
        #[cfg(feature = "msh")]
        "msh" => crate::msh::parse_msh(bytes, path),
        #[cfg(feature = "medit")]
        "mesh" | "meshb" => crate::medit::parse_medit(bytes, path),
        _ => Err(no_mesh(path, ".vtk, .vtu, .msh, .mesh, .meshb")),
    }
}

/// Reads a mesh like [`read_file`], without regions and values.
///
/// # Errors
/// The errors of [`read_file`].
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let folder = std::env::temp_dir();
/// let path = folder.join(format!("incise-doc-{}.msh", std::process::id()));
/// let mesh = kuhn_box([2, 2, 2], DVec3::splat(0.1));
/// incise_mesh_io::write(&path, &mesh)?;
/// assert_eq!(incise_mesh_io::read(&path)?, mesh);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read(path: impl AsRef<Path>) -> Result<TetMesh, MeshIoError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        // Skips the data of points and cells.
        #[cfg(feature = "vtk")]
        "vtk" => read_vtk(path),
        #[cfg(feature = "tetgen")]
        "node" | "ele" => read_tetgen(path),
        _ => read_file(path).map(|file| file.mesh),
    }
}

/// Writes a mesh with those regions and values that the format supports; for a `.node`/`.ele` pair either name is
/// accepted. An existing file is replaced.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::FormatLeftOut`] for a format that this build
/// lacks, [`MeshIoError::FieldLength`] for values of the wrong number, [`MeshIoError::Io`] if the file cannot be
/// written.
pub fn write_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        #[cfg(feature = "vtk")]
        "vtk" if file.is_plain() => write_vtk(path, &file.mesh),
        #[cfg(feature = "vtk")]
        "vtk" => write_vtk_file(path, file),
        #[cfg(feature = "vtu")]
        "vtu" => write_vtu_file(path, file),
        #[cfg(feature = "msh")]
        "msh" => write_msh(path, file, MshKind::default()),
        #[cfg(feature = "tetgen")]
        "node" | "ele" => write_tetgen_file(path, file),
        #[cfg(feature = "medit")]
        "mesh" | "meshb" => write_medit(path, file),
        _ => Err(unsupported_format(path, MESHES)),
    }
}

/// Writes a mesh without regions and values.
///
/// # Errors
/// The errors of [`write_file`].
pub fn write(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    match ending(path).as_str() {
        #[cfg(feature = "vtk")]
        "vtk" => write_vtk(path, mesh),
        #[cfg(feature = "tetgen")]
        "node" | "ele" => write_tetgen(path, mesh),
        #[cfg(feature = "vtu")]
        "vtu" => write_vtu(path, &mesh.positions, &mesh.tets, crate::Fields::default()),
        _ => write_file(path, &MeshFile::from(mesh.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In a build without formats the error of each ending names its feature; other endings stay unknown.
    #[test]
    fn formats_that_are_left_out_name_their_feature() {
        for known in MESHES.split(", ") {
            let error = unsupported_format(Path::new(&format!("a{known}")), MESHES);
            assert!(
                matches!(error, MeshIoError::FormatLeftOut { .. }),
                "{error}"
            );
        }
        let error = unsupported_format(Path::new("a.meshb"), MESHES);
        assert!(error.to_string().contains("\"medit\""), "{error}");
        let error = unsupported_format(Path::new("a.obj"), MESHES);
        assert!(matches!(error, MeshIoError::UnknownFormat { .. }));
        let error = read(Path::new("a.obj")).unwrap_err();
        assert!(error.to_string().contains("tetrahedralize"), "{error}");
    }
}
