//! Legacy VTK files with an unstructured grid, ASCII and binary.
//!
//! Versions 1 to 5.1 are read: the cells as lists with sizes, or (from 5.0 on) as offsets and connectivity. Keywords
//! may be in any case and sections in any order. Tets are read, cells of lower dimension skipped, and other volume
//! cells are an error. Point and cell data with one or three components become fields. The first cell array with a
//! common name of regions becomes the regions. Other data, tables and metadata are skipped. Orientation is kept.
//! Linear.
//!
//! The crate `vtkio` (0.7.0-rc2) has both the legacy and the XML formats, but it trusts the numbers in a compressed
//! file: it slices and multiplies by them unchecked and reserves as much memory as they announce. It reads a last block
//! of length 0 as empty, and its errors have no position. The reader is therefore our own.
//!
//! Source: "VTK File Formats for VTK Version 4.2" (Kitware) and the 5.1 format as the VTK library writes it.

mod arrays;
mod cursor;
mod read;
#[cfg(test)]
mod tests;
mod write;

use std::path::Path;

use incise_mesh::TetMesh;

pub(crate) use read::{parse_vtk, parse_vtk_mesh};
pub use write::{write_vtk, write_vtk_binary, write_vtk_file};

use crate::text::load;
use crate::{MeshFile, MeshIoError};

/// Reads the tets of a legacy VTK file; see [`read`](crate::read). Point and cell data are skipped.
///
/// # Errors
/// The errors of [`read`](crate::read), and [`MeshIoError::ParseBytes`] if a binary file has wrong content.
pub fn read_vtk(path: impl AsRef<Path>) -> Result<TetMesh, MeshIoError> {
    let path = path.as_ref();
    parse_vtk_mesh(&load(path)?, path)
}

/// Reads a legacy VTK file, ASCII or binary, with its regions and fields.
///
/// Integers beyond 2^53 in a field are rounded. Regions are the first cell array of whole numbers of 32 bits that is
/// named `regions`, `medit:ref`, `gmsh:physical`, `tetgen:ref` or `CellEntityIds`.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`] or, for a binary file,
/// [`MeshIoError::ParseBytes`] if its content is wrong, [`MeshIoError::Empty`] if it has no cells.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let mut file = incise_mesh_io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::ONE));
/// file.regions = vec![7; file.mesh.tets.len()];
/// let path = std::env::temp_dir().join(format!("incise-doc-file-{}.vtk", std::process::id()));
/// incise_mesh_io::write_vtk_binary(&path, &file)?;
/// assert_eq!(incise_mesh_io::read_vtk_file(&path)?, file);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read_vtk_file(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    parse_vtk(&load(path)?, path)
}
