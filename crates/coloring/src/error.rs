//! [`ColoringError`]: invalid requests and improper colorings.

use crate::Algorithm;

/// An invalid request, or a coloring that failed its check.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ColoringError {
    /// No algorithm has this name.
    #[error("unknown coloring algorithm '{name}'; known are: {}", Algorithm::NAMES.join(", "))]
    UnknownAlgorithm {
        /// The name asked for.
        name: String,
    },
    /// An algorithm with a parameter that it has not.
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
    /// An edit removes a vertex from a particle where it is not.
    #[error("vertex {vertex} cannot be removed from particle {particle}: it is not there")]
    NotThere {
        /// The vertex.
        vertex: u32,
        /// The particle.
        particle: u32,
    },
    /// A coloring that is not proper, or not about the same vertices.
    #[error(transparent)]
    Graph(#[from] incise_graph::GraphError),
    /// A count that is kept up to date differs from what it counts.
    #[error("the counts kept beside the coloring are wrong: this is a defect, please report it")]
    Books,
}
