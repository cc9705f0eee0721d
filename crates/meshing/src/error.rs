//! [`MeshingError`]: errors of mesh generation.

/// Error of filling a shape, a surface or points with tets.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshingError {
    /// Unknown name of a [`Shape`](crate::Shape).
    #[error("unknown shape '{name}'; known are: {known}")]
    UnknownShape {
        /// Name given.
        name: String,
        /// Known names, separated by commas.
        known: String,
    },

    /// Number of tets outside the range of a shape.
    #[error("a {shape} cannot be made of {wanted} tets: ask for {smallest} to {largest}")]
    TetCount {
        /// Name of the shape.
        shape: &'static str,
        /// Number given.
        wanted: usize,
        /// Smallest number supported.
        smallest: usize,
        /// Largest number supported.
        largest: usize,
    },

    /// A surface that does not enclose a volume, or cannot be filled with the given settings.
    #[error("the surface cannot be filled: {0}")]
    Surface(String),

    /// Points that cannot be tetrahedralized.
    #[error("the points cannot be filled with tetrahedra: {0}")]
    Points(String),

    /// A lattice with invalid bounds, spacing or size.
    #[error("the lattice cannot be laid out: {0}")]
    Lattice(String),
}
