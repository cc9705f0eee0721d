//! The methods by name, for command lines and scene files.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use incise_graph::{Clustering, ConstraintGraph};

use crate::{ClusteringError, serial_neighbor};

/// A clustering method, chosen at run time; written `none` or `serial:10`.
///
/// ```
/// use incise_clustering::{Method, cluster};
/// use incise_graph::ConstraintGraph;
///
/// let path = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 3)])?;
/// let method: Method = "serial:2".parse()?;
/// assert_eq!(cluster(method, &path).occupied(), 2);
/// assert_eq!(cluster(Method::None, &path).occupied(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Every constraint alone.
    #[default]
    None,
    /// [`serial_neighbor`] with this largest cluster size.
    Serial(NonZeroUsize),
}

impl FromStr for Method {
    type Err = ClusteringError;

    fn from_str(text: &str) -> Result<Self, ClusteringError> {
        match text.split_once(':') {
            None if text == "none" => Ok(Self::None),
            None if text == "serial" => Err(ClusteringError::BadSize {
                text: text.to_owned(),
            }),
            Some(("serial", size)) => {
                size.parse()
                    .map(Self::Serial)
                    .map_err(|_| ClusteringError::BadSize {
                        text: text.to_owned(),
                    })
            }
            _ => Err(ClusteringError::UnknownMethod {
                text: text.to_owned(),
            }),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Serial(size) => write!(f, "serial:{size}"),
        }
    }
}

/// Clusters `graph` by the given method. Deterministic.
#[must_use]
pub fn cluster(method: Method, graph: &ConstraintGraph) -> Clustering {
    match method {
        Method::None => Clustering::none(graph.vertex_count()),
        Method::Serial(max_size) => serial_neighbor(graph, max_size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for text in ["none", "serial:1", "serial:10"] {
            assert_eq!(text.parse::<Method>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn mistakes_are_told_apart() {
        for text in [
            "serial:0",
            "serial:",
            "serial:-1",
            "serial:x",
            "serial",
            "serial:99999999999999999999",
        ] {
            let error = text.parse::<Method>().unwrap_err();
            assert_eq!(
                error,
                ClusteringError::BadSize {
                    text: text.to_owned()
                }
            );
        }
        for text in ["", "None", "none:3", "cereal:3"] {
            let error = text.parse::<Method>().unwrap_err();
            assert_eq!(
                error,
                ClusteringError::UnknownMethod {
                    text: text.to_owned()
                }
            );
        }
    }
}
