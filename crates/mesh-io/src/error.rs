//! [`MeshIoError`]: errors of reading and writing files.

use std::io;
use std::path::PathBuf;

/// A mesh or surface that could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshIoError {
    /// A file without tets.
    #[error("the mesh has no tetrahedra: give one with at least one")]
    Empty,

    /// An error of the operating system while reading or writing a file.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// The action that failed: `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },

    /// A text file that violates its format.
    #[error("{}:{line}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The text that was found and the expected one.
        message: String,
    },

    /// A binary file that violates its format.
    #[error("{} at byte {byte}: {message}", path.display())]
    ParseBytes {
        /// The file.
        path: PathBuf,
        /// The byte, counted from 0.
        byte: usize,
        /// The content that was found and the expected one.
        message: String,
    },

    /// A file of nested content that violates its format; the message names the place, such as `meshes[2]`.
    #[error("{}: {message}", path.display())]
    ParseContent {
        /// The file.
        path: PathBuf,
        /// The content that was found and the expected one.
        message: String,
    },

    /// A file whose ending is not that of a supported format.
    #[error("cannot tell the format of {}: use one of the endings {known}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The supported endings, separated by commas.
        known: &'static str,
    },

    /// A surface of triangles where a mesh of tets is needed.
    #[error(
        "{} is a surface of triangles, not a mesh of tets: fill it by `incise mesh tetrahedralize` (in a program by \
         incise_meshing::tetrahedralize)",
        path.display()
    )]
    Surface {
        /// The file.
        path: PathBuf,
    },

    /// A mesh of tets where a surface of triangles is needed.
    #[error(
        "{} is a mesh of tets, not a surface: `incise mesh convert` writes its boundary (in a program \
         incise_mesh::TriangleSurface::boundary_of)",
        path.display()
    )]
    Tets {
        /// The file.
        path: PathBuf,
    },

    /// A file of a format that is left out of this build.
    #[error(
        "{}: this build lacks the format: enable the feature \"{feature}\" of incise-mesh-io",
        path.display()
    )]
    FormatLeftOut {
        /// The file.
        path: PathBuf,
        /// The Cargo feature of the format.
        feature: &'static str,
    },

    /// A field (named values per particle or per cell) with the wrong number of values.
    #[error(
        "field {name:?} has {found} values but {expected} are needed: give one for each element"
    )]
    FieldLength {
        /// The name of the field.
        name: String,
        /// The number of elements.
        expected: usize,
        /// The number of values given.
        found: usize,
    },
}
