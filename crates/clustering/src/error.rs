//! [`ClusteringError`]: errors of method names and of edits.

/// An unknown method, or an edit that does not fit the clustering.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ClusteringError {
    /// No clustering method has this name.
    #[error(
        "unknown clustering '{text}'; write none, serial:K, serial-loose:K, greedy-k:K or pressure:K with a cluster size K, as serial:10"
    )]
    UnknownMethod {
        /// The text that was parsed.
        text: String,
    },
    /// A method whose cluster size is missing or not a positive whole number.
    #[error(
        "clustering '{text}' needs a largest cluster size of at least 1 after a colon, as serial:10"
    )]
    BadSize {
        /// The text that was parsed.
        text: String,
    },
    /// A constraint to remove that is in no cluster, or listed twice.
    #[error("constraint {constraint} cannot be removed: it is in no cluster, or listed twice")]
    NotClustered {
        /// The constraint.
        constraint: u32,
    },
    /// A new constraint that is still in a cluster, or listed twice.
    #[error(
        "constraint {constraint} is not new: it is in a cluster and not removed, or listed twice"
    )]
    NotNew {
        /// The constraint.
        constraint: u32,
    },
    /// Offsets of groups that do not start at 0, decrease or do not end at the number of new
    /// constraints.
    #[error(
        "group offsets must start with 0, must not decrease and must end with {values}, the number of constraints"
    )]
    BadOffsets {
        /// The number of new constraints.
        values: usize,
    },
}
