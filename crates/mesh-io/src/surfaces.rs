//! Closed or open surfaces of triangles: `.obj`, `.stl`, `.ply`, `.off`, and for viewers `.glb` and `.gltf`.
//!
//! The readers are our own, because tetrahedralization has equal requirements for all four: coordinates as doubles,
//! corners within bounds, the line or byte of an error, and memory bounded by the size of the file. Of the crates for
//! these formats, `stl_io` keeps coordinates as `f32`, also in ASCII files; `tobj` reports no line, splits a file into
//! models with separate point numbers, and has doubles only as a feature of the whole build; `ply-rs-bw` creates as
//! many elements as a header announces when they have no properties, so a file of 100 bytes can fill the memory.
//!
//! Polygons become fans of triangles around their first corner, which is correct for convex ones. Linear.

use std::io::{self, Write};
use std::path::Path;

use incise_mesh::TriangleSurface;

use crate::endings::{ending, is_among, unsupported_format};
#[cfg(feature = "gltf")]
use crate::gltf;
#[cfg(feature = "obj")]
use crate::obj;
#[cfg(feature = "off")]
use crate::off;
#[cfg(feature = "ply")]
use crate::ply::{self, PlyEncoding};
#[cfg(feature = "stl")]
use crate::stl;
use crate::text::load;
use crate::{MeshIoError, write_atomically};

const KNOWN: &str = ".obj, .stl, .ply, .off";
const KNOWN_TO_WRITERS: &str = ".obj, .stl, .ply, .off, .glb, .gltf";

/// Reads a surface in the format of the file's ending. All variants of a format are supported.
///
/// Points that no triangle uses are kept. STL has no points: bit-identical corners become one.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::FormatLeftOut`] for a format that this build
/// lacks, [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`] or [`MeshIoError::ParseBytes`] if its
/// content is wrong or has no triangle.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.off", std::process::id()));
/// let mesh = kuhn_box([1, 1, 1], DVec3::splat(0.1));
/// let surface = incise_mesh::TriangleSurface::boundary_of(&mesh);
/// incise_mesh_io::write_surface(&path, &surface)?;
/// assert_eq!(incise_mesh_io::read_surface(&path)?, surface);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read_surface(path: impl AsRef<Path>) -> Result<TriangleSurface, MeshIoError> {
    let path = path.as_ref();
    let parse = parser(path)?;
    parse(&load(path)?, path)
}

/// Parses a surface in memory, for example from an archive or a network. The ending of `path` selects the format, and
/// errors contain the path; it need not exist.
///
/// # Errors
/// The errors of [`read_surface`] except [`MeshIoError::Io`].
///
/// # Example
/// ```
/// let bytes = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
/// assert_eq!(incise_mesh_io::parse_surface("a.off", bytes)?.triangles.len(), 1);
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn parse_surface(path: impl AsRef<Path>, bytes: &[u8]) -> Result<TriangleSurface, MeshIoError> {
    let path = path.as_ref();
    parser(path)?(bytes, path)
}

type Writer = fn(&mut dyn Write, &TriangleSurface) -> io::Result<()>;
type Parser = fn(&[u8], &Path) -> Result<TriangleSurface, MeshIoError>;

fn parser(path: &Path) -> Result<Parser, MeshIoError> {
    let parser: Option<Parser> = match ending(path).as_str() {
        #[cfg(feature = "obj")]
        "obj" => Some(obj::parse_obj),
        #[cfg(feature = "stl")]
        "stl" => Some(stl::parse_stl),
        #[cfg(feature = "ply")]
        "ply" => Some(ply::parse_ply),
        #[cfg(feature = "off")]
        "off" => Some(off::parse_off),
        _ => None,
    };
    parser.ok_or_else(|| unsupported_format(path, KNOWN))
}

/// True if [`write_surface`] supports the ending of the file name.
#[must_use]
pub fn is_surface(path: &Path) -> bool {
    is_among(path, KNOWN_TO_WRITERS)
}

/// Writes a surface in the format of the file's ending: `.obj`, `.off` and `.stl` as text, `.ply` as little-endian
/// binary. All keep every bit of the coordinates, and all but `.stl` keep points without triangles.
///
/// For viewers there are `.glb` (binary) and `.gltf` (text), which also have normals but cannot be read: their
/// coordinates are rounded to floats.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::FormatLeftOut`] for a format that this build
/// lacks, [`MeshIoError::Io`] if the file cannot be written, or, for `.glb` and `.gltf`, if there are no triangles, a
/// coordinate is too large for a float, or the file would have 4 GiB.
///
/// # Panics
/// For `.stl`, `.glb` and `.gltf`, if a corner has no position.
pub fn write_surface(path: impl AsRef<Path>, surface: &TriangleSurface) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    let write: Option<Writer> = match ending(path).as_str() {
        #[cfg(feature = "obj")]
        "obj" => Some(obj::write),
        #[cfg(feature = "stl")]
        "stl" => Some(stl::write),
        #[cfg(feature = "ply")]
        "ply" => Some(|out, surface| ply::write(out, surface, PlyEncoding::LittleEndian)),
        #[cfg(feature = "off")]
        "off" => Some(off::write),
        #[cfg(feature = "gltf")]
        "glb" => Some(gltf::write_glb),
        #[cfg(feature = "gltf")]
        "gltf" => Some(gltf::write_gltf),
        _ => None,
    };
    let write = write.ok_or_else(|| unsupported_format(path, KNOWN_TO_WRITERS))?;
    write_atomically(path, |out| write(out, surface))
}

#[cfg(test)]
#[cfg(all(feature = "obj", feature = "stl", feature = "ply", feature = "off"))]
mod tests;
