//! VTK XML poly data (`.vtp`): a surface with fields, the smallest file for one frame of an animation.
//!
//! Only particles on the surface are written, in ascending order, with their values. Source: "VTK XML Formats"
//! (Kitware). Linear.

use std::path::Path;

use glam::DVec3;
use incise_mesh::Surface;

use crate::used_particles::UsedParticles;
use crate::{Fields, MeshIoError, write_atomically, xml};

/// Writes a surface at the given (rest or deformed) positions of all particles in meters, with fields.
///
/// Particle fields have one value for each position, used or not; cell fields have one for each triangle.
///
/// # Errors
/// [`MeshIoError::FieldLength`] for a field of another length, [`MeshIoError::Io`] if the file cannot be written.
///
/// # Panics
/// If a corner has no position.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.vtp", std::process::id()));
/// incise_mesh_io::write_vtp(&path, &mesh.surface(), &mesh.positions, incise_mesh_io::Fields::default())?;
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn write_vtp(
    path: impl AsRef<Path>,
    surface: &Surface,
    positions: &[DVec3],
    fields: Fields<'_>,
) -> Result<(), MeshIoError> {
    let triangles = &surface.triangles;
    fields.check(positions.len(), triangles.len())?;
    let UsedParticles {
        particles: used,
        indices,
    } = UsedParticles::new(triangles, positions.len());
    write_atomically(path, |out| {
        xml::open(out, "PolyData")?;
        writeln!(out, "<PolyData>")?;
        let (points, polys) = (used.len(), triangles.len());
        writeln!(
            out,
            "<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
             NumberOfPolys=\"{polys}\">"
        )?;
        xml::fields(out, "PointData", fields.particles, Some(&used))?;
        xml::fields(out, "CellData", fields.cells, None)?;
        xml::positions(out, used.iter().map(|&particle| positions[particle]))?;
        writeln!(out, "<Polys>")?;
        let corners = triangles
            .iter()
            .flatten()
            .map(|p| i64::from(indices[p.index()]).to_le_bytes());
        xml::integers(out, "Int64", "connectivity", corners)?;
        xml::integers(
            out,
            "Int64",
            "offsets",
            (1_i64..).take(polys).map(|i| (3 * i).to_le_bytes()),
        )?;
        writeln!(out, "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>")
    })
}
