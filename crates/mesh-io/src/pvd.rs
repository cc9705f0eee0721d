//! ParaView collections (`.pvd`): the list of files that make up an animation, with their times.
//!
//! Source: the ParaView wiki, "PVD File Format". Linear.

use std::path::Path;

use crate::xml::Escaped;
use crate::{MeshIoError, write_atomically};

/// Writes a collection of frames: the time in seconds and the file of each, the file relative to the collection.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be written.
///
/// # Example
/// ```
/// use incise_mesh_io::write_pvd;
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.pvd", std::process::id()));
/// write_pvd(&path, &[(0.0, "surface_0000.vtp"), (0.01, "surface_0001.vtp")])?;
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn write_pvd(
    path: impl AsRef<Path>,
    frames: &[(f64, impl AsRef<str>)],
) -> Result<(), MeshIoError> {
    write_atomically(path, |out| {
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>"
        )?;
        for (time, file) in frames {
            let file = Escaped(file.as_ref());
            writeln!(
                out,
                "<DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{file}\"/>"
            )?;
        }
        writeln!(out, "</Collection>\n</VTKFile>")
    })
}
