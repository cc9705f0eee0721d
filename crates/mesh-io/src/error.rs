//! [`MeshIoError`]: why a file was not read or written.

use std::io;
use std::path::PathBuf;

/// Why a mesh or a surface could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshIoError {
    /// A file without a single tet.
    #[error("the mesh has no tetrahedra: give one with at least one")]
    Empty,

    /// The operating system refused to read or write a file.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was tried: `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },

    /// A file whose content is not what its format says.
    #[error("{}:{line}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What was found and what was expected.
        message: String,
    },

    /// A file without lines whose content is not what its format says.
    #[error("{} at byte {byte}: {message}", path.display())]
    ParseBytes {
        /// The file.
        path: PathBuf,
        /// The byte, counted from 0.
        byte: usize,
        /// What was found and what was expected.
        message: String,
    },

    /// A file whose ending names no format that can be read or written.
    #[error("cannot tell the format of {}: use one of the endings {known}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The endings that work, separated by commas.
        known: &'static str,
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
