//! Closed or open surfaces of triangles: `.obj`, `.stl`, `.ply`, `.off`, and for viewers `.glb` and `.gltf`.
//!
//! Readers of our own, because what a tetrahedralization needs is the same in all four: coordinates as doubles, corners
//! within bounds, the line or byte of what is wrong, and memory bounded by the size of the file. Of the crates for these
//! formats, `stl_io` keeps coordinates as `f32`, ASCII ones too; `tobj` names no line, splits a file into models that number
//! their points anew, and has doubles as a feature of the whole build only; `ply-rs-bw` makes as many elements as a header
//! announces when they have no properties, so that a file of 100 bytes fills the memory.
//!
//! Polygons become fans of triangles around their first corner, right for convex ones. Linear.

mod gltf;
mod obj;
mod off;
mod ply;
mod stl;

use std::path::Path;

use glam::DVec3;

use super::text::load;
use super::{ending, unknown, write_atomically};
use crate::{MeshError, ParticleId, TetMesh};

pub use ply::{PlyEncoding, write_ply};
pub use stl::write_stl_binary;

/// Positions and triangles, as surface files have them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleSurface {
    /// Position of each particle, in meters, used by a triangle or not.
    pub positions: Vec<DVec3>,
    /// The corners of each triangle, counterclockwise when seen from outside.
    pub triangles: Vec<[ParticleId; 3]>,
}

impl TriangleSurface {
    /// The boundary of a mesh, with all its particles.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
    ///
    /// let mesh = kuhn_box([2, 2, 2], DVec3::splat(0.1));
    /// let path = std::env::temp_dir().join(format!("incise-doc-{}.glb", std::process::id()));
    /// io::write_surface(&path, &io::TriangleSurface::boundary_of(&mesh))?;
    /// # std::fs::remove_file(path).ok();
    /// # Ok::<(), incise_mesh::MeshError>(())
    /// ```
    #[must_use]
    pub fn boundary_of(mesh: &TetMesh) -> Self {
        Self {
            positions: mesh.positions.clone(),
            triangles: mesh.surface().triangles,
        }
    }
}

const KNOWN: &str = ".obj, .stl, .ply, .off";
const KNOWN_TO_WRITERS: &str = ".obj, .stl, .ply, .off, .glb, .gltf";

/// Reads a surface, the format chosen by the ending of the file name. Every form of a format is understood.
///
/// Points that no triangle uses are kept. STL has no points: equal corners, to the bit, become one.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::Io`] if the file cannot be read, [`MeshError::Parse`]
/// or [`MeshError::ParseBytes`] if its content is wrong or has no triangle.
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.off", std::process::id()));
/// let mesh = kuhn_box([1, 1, 1], DVec3::splat(0.1));
/// let surface = io::TriangleSurface::boundary_of(&mesh);
/// io::write_surface(&path, &surface)?;
/// assert_eq!(io::read_surface(&path)?, surface);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn read_surface(path: impl AsRef<Path>) -> Result<TriangleSurface, MeshError> {
    let path = path.as_ref();
    let parse = parser(path)?;
    parse(&load(path)?, path)
}

/// Reads a surface that is in memory: the content of a file in an archive or from a network. The ending of `path` names
/// the format, and errors name the path; it need not exist.
///
/// # Errors
/// As [`read_surface`], but [`MeshError::Io`].
///
/// # Example
/// ```
/// use incise_mesh::io;
///
/// let bytes = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
/// assert_eq!(io::parse_surface("a.off", bytes)?.triangles.len(), 1);
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn parse_surface(path: impl AsRef<Path>, bytes: &[u8]) -> Result<TriangleSurface, MeshError> {
    let path = path.as_ref();
    parser(path)?(bytes, path)
}

type Parser = fn(&[u8], &Path) -> Result<TriangleSurface, MeshError>;

fn parser(path: &Path) -> Result<Parser, MeshError> {
    Ok(match ending(path).as_str() {
        "obj" => obj::parse_obj,
        "stl" => stl::parse_stl,
        "ply" => ply::parse_ply,
        "off" => off::parse_off,
        _ => return Err(unknown(path, KNOWN)),
    })
}

/// Whether the ending of a file name is that of a surface which [`write_surface`] writes.
#[must_use]
pub fn is_surface(path: &Path) -> bool {
    KNOWN_TO_WRITERS
        .split(", ")
        .any(|known| known[1..] == ending(path))
}

/// Writes a surface, the format chosen by the ending of the file name: `.obj`, `.off` and `.stl` as text, `.ply` as
/// little-endian binary. All keep every bit of the coordinates, and all but `.stl` points without triangles.
///
/// For viewers there are `.glb` (binary) and `.gltf` (the same as text), which have normals, too, but are not read: their
/// coordinates are rounded to floats.
///
/// # Errors
/// [`MeshError::UnknownFormat`] for another ending, [`MeshError::Io`] if the file cannot be written, or, for `.glb` and
/// `.gltf`, if there are no triangles, a coordinate is too large for a float, or the file would have 4 GiB.
///
/// # Panics
/// For `.stl`, `.glb` and `.gltf`, if a corner has no position.
pub fn write_surface(path: impl AsRef<Path>, surface: &TriangleSurface) -> Result<(), MeshError> {
    let path = path.as_ref();
    let write = match ending(path).as_str() {
        "obj" => obj::write,
        "stl" => stl::write,
        "ply" => return write_ply(path, surface, PlyEncoding::LittleEndian),
        "off" => off::write,
        "glb" => gltf::write_glb,
        "gltf" => gltf::write_gltf,
        _ => return Err(unknown(path, KNOWN_TO_WRITERS)),
    };
    write_atomically(path, |out| write(out, surface))
}

/// Adds the triangles of a polygon; points and lines have none.
fn fan(polygon: &[ParticleId], triangles: &mut Vec<[ParticleId; 3]>) {
    if let [first, rest @ ..] = polygon {
        triangles.extend(rest.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
}

#[cfg(test)]
mod tests;
