//! [`ColoringError`]: invalid requests and improper colorings.

/// Errors of coloring: unknown names, invalid parameters, and failed checks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ColoringError {
    /// No algorithm has this name.
    #[error("unknown coloring algorithm '{name}'; known are: {known}")]
    UnknownAlgorithm {
        /// The name asked for.
        name: String,
        /// The known names.
        known: String,
    },
    /// The parameter of an algorithm is invalid.
    #[error("coloring algorithm '{text}': {expected} expected behind the name")]
    BadParameter {
        /// What was written.
        text: String,
        /// What may stand behind the colon.
        expected: &'static str,
    },
    /// A limit of rounds was reached before all vertices had a color.
    #[error("{uncolored} vertices have no color after {rounds} rounds; allow more of them")]
    TooManyRounds {
        /// The rounds made.
        rounds: usize,
        /// Vertices without a color.
        uncolored: usize,
    },
    /// An edit removes a vertex from a particle that it does not have.
    #[error("vertex {vertex} cannot be removed from particle {particle}: it is not there")]
    NoSuchPair {
        /// The vertex.
        vertex: u32,
        /// The particle.
        particle: u32,
    },
    /// A constraint that is to be removed does not exist, or a constraint that is to be added has no particle.
    #[error("constraint {vertex} has no particles")]
    NoParticles {
        /// The number of the constraint to remove, or the position of the constraint in the list of those to add.
        vertex: u32,
    },
    /// The coloring is not proper or has another number of vertices.
    #[error(transparent)]
    Graph(#[from] incise_graph::GraphError),
    /// An incrementally updated count differs from its recomputed value: a defect of this crate.
    #[error("the counts kept beside the coloring are wrong: this is a defect, please report it")]
    InconsistentCounts,
}
