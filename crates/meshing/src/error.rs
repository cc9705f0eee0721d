//! [`MeshingError`]: why a body was not made.

/// Why a shape, a surface or points could not be filled with tets.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshingError {
    /// A name that is not a [`Shape`](crate::Shape).
    #[error("unknown shape '{name}'; known are: {known}")]
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
