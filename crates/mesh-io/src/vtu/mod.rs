//! VTK XML unstructured grids (`.vtu`): a whole mesh with fields.
//!
//! Files with one piece are read: arrays as text, in base64, or appended, raw or in base64; with headers of 32 or 64
//! bits, of both byte orders, uncompressed or compressed with zlib. LZ4 and LZMA are an error. Cells and fields are
//! treated as in a legacy file (see `vtk`, also for why the crate `vtkio` is not used). Elements are parsed by
//! `quick-xml`, which does not resolve entities of the file's own; blocks are decompressed by `miniz_oxide`, which
//! takes a limit.
//!
//! Source: "VTK XML Formats" (Kitware). Linear.

mod compressed;
mod data;
mod read;
#[cfg(test)]
mod tests;

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use incise_mesh::ParticleId;

pub use compressed::write_vtu_compressed;
pub(crate) use read::parse_vtu;

use crate::text::load;
use crate::vtk_grid::REGIONS;
use crate::{Fields, MeshFile, MeshIoError, NamedValues, write_atomically, xml};

/// VTK's number for a tetrahedron.
const TETRA: u8 = 10;

/// Reads a VTK XML file of an unstructured grid, with its regions and fields.
///
/// [`read_vtk_file`](crate::read_vtk_file) describes how regions and fields are found.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`] if its content is wrong,
/// [`MeshIoError::ParseBytes`] if its appended data are, [`MeshIoError::Empty`] if it has no cells.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let mut file = incise_mesh_io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::ONE));
/// file.regions = vec![7; file.mesh.tets.len()];
/// let path = std::env::temp_dir().join(format!("incise-doc-file-{}.vtu", std::process::id()));
/// incise_mesh_io::write_vtu_file(&path, &file)?;
/// assert_eq!(incise_mesh_io::read_vtu(&path)?, file);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read_vtu(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    parse_vtu(&load(path)?, path)
}

/// Writes a mesh with its regions (as a cell array `regions`) and fields; all numbers keep every bit.
///
/// # Errors
/// [`MeshIoError::FieldLength`] if the values or regions are of the wrong number, [`MeshIoError::Io`] if the file
/// cannot be written.
pub fn write_vtu_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    file.check()?;
    write_atomically(path, |out| put_file(out, file))
}

fn put_file(out: &mut dyn Write, file: &MeshFile) -> io::Result<()> {
    let particles: Vec<_> = file.particles.iter().map(NamedValues::as_field).collect();
    let tets: Vec<_> = file.tets.iter().map(NamedValues::as_field).collect();
    let fields = Fields {
        particles: &particles,
        cells: &tets,
    };
    put(
        out,
        &file.mesh.positions,
        &file.mesh.tets,
        fields,
        &file.regions,
    )
}

/// Writes tets at the given (rest or deformed) positions in meters, with fields.
///
/// # Errors
/// [`MeshIoError::FieldLength`] for a field without exactly one value per particle or tet, [`MeshIoError::Io`] if the
/// file cannot be written.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
/// let speed = vec![0.0; mesh.positions.len()];
/// let fields = incise_mesh_io::Fields {
///     particles: &[incise_mesh_io::Field { name: "speed", values: incise_mesh_io::Values::Scalars(&speed) }],
///     ..Default::default()
/// };
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.vtu", std::process::id()));
/// incise_mesh_io::write_vtu(&path, &mesh.positions, &mesh.tets, fields)?;
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn write_vtu(
    path: impl AsRef<Path>,
    positions: &[DVec3],
    tets: &[[ParticleId; 4]],
    fields: Fields<'_>,
) -> Result<(), MeshIoError> {
    fields.check(positions.len(), tets.len())?;
    write_atomically(path, |out| put(out, positions, tets, fields, &[]))
}

fn put(
    out: &mut dyn Write,
    positions: &[DVec3],
    tets: &[[ParticleId; 4]],
    fields: Fields<'_>,
    regions: &[i32],
) -> io::Result<()> {
    xml::open(out, "UnstructuredGrid")?;
    writeln!(out, "<UnstructuredGrid>")?;
    writeln!(
        out,
        "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
        positions.len(),
        tets.len()
    )?;
    xml::fields(out, "PointData", fields.particles, None)?;
    writeln!(out, "<CellData>")?;
    if !regions.is_empty() {
        let numbers = regions.iter().map(|region| region.to_le_bytes());
        xml::integers(out, "Int32", REGIONS, numbers)?;
    }
    xml::arrays(out, fields.cells, None)?;
    writeln!(out, "</CellData>")?;
    xml::positions(out, positions.iter().copied())?;
    writeln!(out, "<Cells>")?;
    let corners = tets.iter().flatten().map(|p| i64::from(p.0).to_le_bytes());
    xml::integers(out, "Int64", "connectivity", corners)?;
    xml::integers(
        out,
        "Int64",
        "offsets",
        (1_i64..).take(tets.len()).map(|i| (4 * i).to_le_bytes()),
    )?;
    xml::integers(out, "UInt8", "types", tets.iter().map(|_| [TETRA]))?;
    writeln!(out, "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
}
