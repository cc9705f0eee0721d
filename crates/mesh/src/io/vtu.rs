//! VTK XML unstructured grids (`.vtu`): a whole mesh with fields, for viewers.
//!
//! Source: "VTK XML Formats" (Kitware). Linear.

use std::path::Path;

use glam::DVec3;

use super::{Fields, write_atomically, xml};
use crate::{MeshError, ParticleId};

/// VTK's number for a tetrahedron.
const TETRA: u8 = 10;

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
    write_atomically(path, |out| {
        xml::open(out, "UnstructuredGrid")?;
        writeln!(out, "<UnstructuredGrid>")?;
        writeln!(
            out,
            "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
            positions.len(),
            tets.len()
        )?;
        xml::fields(out, "PointData", fields.particles, None)?;
        xml::fields(out, "CellData", fields.cells, None)?;
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
    })
}
