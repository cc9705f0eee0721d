//! What can be wrong with a request to color.

/// A request that names something that does not exist.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ColoringError {
    /// No algorithm has this name.
    #[error("there is no coloring algorithm '{name}'; known are: {known}")]
    UnknownAlgorithm {
        /// The name asked for.
        name: String,
        /// The names that exist, separated by commas.
        known: String,
    },
}
