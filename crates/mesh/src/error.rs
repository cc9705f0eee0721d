//! [`MeshError`]: everything that can go wrong with a mesh, one clear sentence each.

use std::io;
use std::path::PathBuf;

use crate::check::CheckReport;

/// Why a mesh could not be read, written, generated or accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh without a single tet.
    #[error("the mesh has no tetrahedra: give one with at least one")]
    Empty,

    /// A mesh that breaks a rule of [`TetMesh::check`](crate::TetMesh::check).
    #[error("the mesh is not sound: {0}")]
    Faulty(Box<CheckReport>),

    /// The operating system refused to read or write a file.
    #[error("cannot {action} {}: {source}", path.display())]
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

    /// The same for a file that has no lines.
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

    /// A name that is not a [`Shape`](crate::generate::Shape).
    #[error("there is no shape named {name:?}: use one of {known}")]
    UnknownShape {
        /// The name given.
        name: String,
        /// The names that work, separated by commas.
        known: String,
    },

    /// A number of tets that a shape cannot be generated with.
    #[error("a {shape} cannot be made of {wanted} tets: ask for {smallest} to {largest}")]
    TetCount {
        /// The name of the shape.
        shape: &'static str,
        /// The number asked for.
        wanted: usize,
        /// The smallest number supported.
        smallest: usize,
        /// The largest number supported.
        largest: usize,
    },

    /// A surface without an inside, or one that cannot be filled as asked.
    #[error("the surface cannot be filled: {0}")]
    Surface(String),

    /// Points that cannot be tetrahedralized.
    #[error("the points cannot be filled with tetrahedra: {0}")]
    Points(String),

    /// A lattice that cannot be laid out.
    #[error("the lattice cannot be laid out: {0}")]
    Lattice(String),
}
