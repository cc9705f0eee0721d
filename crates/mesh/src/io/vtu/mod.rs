//! VTK XML unstructured grids (`.vtu`): a whole mesh with fields.
//!
//! Read are files with one piece: arrays as text, in base64, or appended, raw or in base64; with headers of 32 or 64
//! bits, of both byte orders, plain or compressed with zlib. LZ4 and LZMA are refused by name. Cells and fields are
//! treated as in a legacy file (see `vtk`, also for why the crate `vtkio` is not used). The elements are read by
//! `quick-xml`, which does not resolve entities of the file's own; the blocks by `miniz_oxide`, which takes a limit.
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

pub use compressed::write_vtu_compressed;
pub(crate) use read::parse_vtu;

use super::text::load;
use super::vtk::grid::REGIONS;
use super::{Fields, MeshFile, NamedValues, write_atomically, xml};
use crate::{MeshError, ParticleId};

/// VTK's number for a tetrahedron.
const TETRA: u8 = 10;

/// Reads a VTK XML file of an unstructured grid, with its regions and fields.
///
/// Regions and fields are found as by [`read_vtk_file`](super::read_vtk_file).
///
/// # Errors
/// [`MeshError::Io`] if the file cannot be read, [`MeshError::Parse`] if its content is wrong, [`MeshError::ParseBytes`]
/// if its appended data are, [`MeshError::Empty`] if it has no cells.
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let mut file = io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::ONE));
/// file.regions = vec![7; file.mesh.tets.len()];
/// let path = std::env::temp_dir().join(format!("incise-doc-file-{}.vtu", std::process::id()));
/// io::write_vtu_file(&path, &file)?;
/// assert_eq!(io::read_vtu(&path)?, file);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn read_vtu(path: impl AsRef<Path>) -> Result<MeshFile, MeshError> {
    let path = path.as_ref();
    parse_vtu(&load(path)?, path)
}

/// Writes a mesh with its regions (as a cell array `regions`) and fields; all numbers keep every bit.
///
/// # Errors
/// [`MeshError::FieldLength`] if the values or regions are of the wrong number, [`MeshError::Io`] if the file cannot be
/// written.
pub fn write_vtu_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshError> {
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
/// [`MeshError::FieldLength`] for a field without exactly one value per particle or tet, [`MeshError::Io`] if the file
/// cannot be written.
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
/// let speed = vec![0.0; mesh.positions.len()];
/// let fields = io::Fields {
///     particles: &[io::Field { name: "speed", values: io::Values::Scalars(&speed) }],
///     ..Default::default()
/// };
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.vtu", std::process::id()));
/// io::write_vtu(&path, &mesh.positions, &mesh.tets, fields)?;
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn write_vtu(
    path: impl AsRef<Path>,
    positions: &[DVec3],
    tets: &[[ParticleId; 4]],
    fields: Fields<'_>,
) -> Result<(), MeshError> {
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
