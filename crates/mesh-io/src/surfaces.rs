//! Closed or open surfaces of triangles: `.obj`, `.stl`, `.ply`, `.off`, `.glb`, `.gltf`.
//!
//! The readers of all but glTF are our own, because tetrahedralization has equal requirements for all: coordinates as doubles,
//! corners within bounds, the line or byte of an error, and memory bounded by the size of the file. Of the crates for
//! these formats, `stl_io` keeps coordinates as `f32`, also in ASCII files; `tobj` reports no line, splits a file into
//! models with separate point numbers, and has doubles only as a feature of the whole build; `ply-rs-bw` creates as
//! many elements as a header announces when they have no properties, so a file of 100 bytes can fill the memory.
//!
//! Polygons become fans of triangles around their first corner, which is correct for convex ones. Linear.

use std::io::{self, Write};
use std::path::Path;

use incise_mesh::TriangleSurface;

use crate::endings::{SURFACES, ending, is_among, no_surface, unsupported_format};
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
use crate::{MeshIoError, SurfaceFile, write_atomically};

/// Reads a surface in the format of the file's ending, without texture coordinates. All variants of a format are
/// supported.
///
/// Points that no triangle uses are kept. STL has no points: bit-identical corners become one.
///
/// # Errors
/// The errors of [`read_surface_file`].
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
    read_surface_file(path).map(|file| file.surface)
}

/// Reads a surface with the texture coordinates that `.obj`, `.glb` and `.gltf` may have.
///
/// Of a glTF file all triangles of the default scene are read, at the places that its nodes give them, with the third
/// axis up. A `.gltf` may have its numbers in other files of its folder. Skins, morph targets and animations are not
/// applied.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::Tets`] for that of a mesh of tets,
/// [`MeshIoError::FormatLeftOut`] for a format that this build lacks, [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`], [`MeshIoError::ParseBytes`] or
/// [`MeshIoError::ParseContent`] if its content is wrong or has no triangle.
pub fn read_surface_file(path: impl AsRef<Path>) -> Result<SurfaceFile, MeshIoError> {
    let path = path.as_ref();
    let parse = parser(path)?;
    parse(&load(path)?, path, true)
}

/// Parses a surface in memory, for example from an archive or a network. The ending of `path` selects the format, and
/// errors contain the path; it need not exist.
///
/// # Errors
/// The errors of [`parse_surface_file`].
///
/// # Example
/// ```
/// let bytes = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
/// assert_eq!(incise_mesh_io::parse_surface("a.off", bytes)?.triangles.len(), 1);
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn parse_surface(path: impl AsRef<Path>, bytes: &[u8]) -> Result<TriangleSurface, MeshIoError> {
    parse_surface_file(path, bytes).map(|file| file.surface)
}

/// Parses a surface with its texture coordinates in memory.
///
/// # Errors
/// The errors of [`read_surface_file`] except [`MeshIoError::Io`]; [`MeshIoError::ParseContent`] also for a `.gltf` with
/// numbers in other files.
pub fn parse_surface_file(
    path: impl AsRef<Path>,
    bytes: &[u8],
) -> Result<SurfaceFile, MeshIoError> {
    let path = path.as_ref();
    parser(path)?(bytes, path, false)
}

type Writer = fn(&mut dyn Write, &SurfaceFile) -> io::Result<()>;
/// The last argument is true if files beside this one may be read.
type Parser = fn(&[u8], &Path, bool) -> Result<SurfaceFile, MeshIoError>;

fn parser(path: &Path) -> Result<Parser, MeshIoError> {
    let parser: Option<Parser> = match ending(path).as_str() {
        #[cfg(feature = "obj")]
        "obj" => Some(|bytes, path, _| obj::parse_obj(bytes, path)),
        #[cfg(feature = "stl")]
        "stl" => Some(|bytes, path, _| stl::parse_stl(bytes, path).map(SurfaceFile::from)),
        #[cfg(feature = "ply")]
        "ply" => Some(|bytes, path, _| ply::parse_ply(bytes, path).map(SurfaceFile::from)),
        #[cfg(feature = "off")]
        "off" => Some(|bytes, path, _| off::parse_off(bytes, path).map(SurfaceFile::from)),
        #[cfg(feature = "gltf")]
        "glb" | "gltf" => Some(gltf::parse),
        _ => None,
    };
    parser.ok_or_else(|| no_surface(path))
}

/// True if [`read_surface`] and [`write_surface`] support the ending of the file name.
#[must_use]
pub fn is_surface(path: &Path) -> bool {
    is_among(path, SURFACES)
}

/// Writes a surface in the format of the file's ending: `.obj`, `.off` and `.stl` as text, `.ply` as little-endian
/// binary. All keep every bit of the coordinates, and all but `.stl` keep points without triangles.
///
/// `.glb` (binary) and `.gltf` (text) have coordinates that are rounded to floats, and normals.
///
/// # Errors
/// The errors of [`write_surface_file`].
///
/// # Panics
/// For `.stl`, `.glb` and `.gltf`, if a corner has no position.
pub fn write_surface(path: impl AsRef<Path>, surface: &TriangleSurface) -> Result<(), MeshIoError> {
    write_surface_file(path, &SurfaceFile::from(surface.clone()))
}

/// Writes a surface like [`write_surface`], in `.obj`, `.glb` and `.gltf` with its texture coordinates.
///
/// # Errors
/// [`MeshIoError::UnknownFormat`] for another ending, [`MeshIoError::FormatLeftOut`] for a format that this build
/// lacks, [`MeshIoError::FieldLength`] for texture coordinates that not all triangles have, [`MeshIoError::Io`] if the
/// file cannot be written, or, for `.glb` and `.gltf`, if there are no triangles, a coordinate is too large for a float,
/// or the file would have 4 GiB.
///
/// # Panics
/// For `.stl`, `.glb` and `.gltf`, if a corner has no position.
pub fn write_surface_file(path: impl AsRef<Path>, file: &SurfaceFile) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    let write: Option<Writer> = match ending(path).as_str() {
        #[cfg(feature = "obj")]
        "obj" => Some(obj::write),
        #[cfg(feature = "stl")]
        "stl" => Some(|out, file| stl::write(out, &file.surface)),
        #[cfg(feature = "ply")]
        "ply" => Some(|out, file| ply::write(out, &file.surface, PlyEncoding::LittleEndian)),
        #[cfg(feature = "off")]
        "off" => Some(|out, file| off::write(out, &file.surface)),
        #[cfg(feature = "gltf")]
        "glb" => Some(gltf::write_glb),
        #[cfg(feature = "gltf")]
        "gltf" => Some(gltf::write_gltf),
        _ => None,
    };
    let write = write.ok_or_else(|| unsupported_format(path, SURFACES))?;
    file.check()?;
    write_atomically(path, |out| write(out, file))
}

#[cfg(test)]
#[cfg(all(feature = "obj", feature = "stl", feature = "ply", feature = "off"))]
mod tests;
