//! The algorithms by name, for command lines and scene files.

use incise_graph::{Coloring, ConstraintGraph};

use crate::{ColoringError, Order, auto, greedy, scgc};

/// A coloring algorithm, chosen at run time.
///
/// ```
/// use incise_coloring::{Algorithm, color};
/// use incise_graph::ConstraintGraph;
///
/// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
/// let algorithm = Algorithm::from_name("scgc")?;
/// assert_eq!(color(algorithm, &path).color_count(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Algorithm {
    /// [`auto`](crate::auto()), the default.
    Auto,
    /// [`scgc`], parallel.
    Scgc,
    /// [`greedy`], sequential.
    Greedy,
}

impl Algorithm {
    /// All algorithms, the default first.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Scgc, Self::Greedy];

    /// The name, in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Scgc => "scgc",
            Self::Greedy => "greedy",
        }
    }

    /// The algorithm of that exact name.
    ///
    /// # Errors
    /// No algorithm has this name; the message lists those that exist.
    pub fn from_name(name: &str) -> Result<Self, ColoringError> {
        Self::ALL
            .into_iter()
            .find(|algorithm| algorithm.name() == name)
            .ok_or_else(|| ColoringError::UnknownAlgorithm {
                name: name.to_owned(),
                known: Self::ALL.map(Self::name).join(", "),
            })
    }
}

/// Colors `graph` by the given algorithm. The result is proper and the same for any number of
/// threads.
#[must_use]
pub fn color(algorithm: Algorithm, graph: &ConstraintGraph) -> Coloring {
    match algorithm {
        Algorithm::Auto => auto(graph).coloring,
        Algorithm::Scgc => scgc(graph).coloring,
        Algorithm::Greedy => greedy(graph, Order::LargestFirst),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for algorithm in Algorithm::ALL {
            assert_eq!(Algorithm::from_name(algorithm.name()), Ok(algorithm));
        }
        let error = Algorithm::from_name("SCGC").unwrap_err();
        assert_eq!(
            error.to_string(),
            "there is no coloring algorithm 'SCGC'; known are: auto, scgc, greedy"
        );
    }
}
