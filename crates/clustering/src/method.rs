//! [`Method`]: the clustering methods by name, for command lines and scene files.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use incise_graph::{Clustering, Incidence};

use crate::{ClusteringError, greedy_k_neighbor, pressure, serial_neighbor_incidence};

/// A clustering method selected at run time; written `none`, or a name and a size as in
/// `serial:10`.
///
/// ```
/// use incise_clustering::{Method, cluster};
/// use incise_graph::Incidence;
///
/// let springs = Incidence::from_constraints(5, (0u32..4).map(|i| [i, i + 1]))?;
/// let method: Method = "serial:2".parse()?;
/// assert_eq!(cluster(method, &springs).occupied(), 2);
/// assert_eq!(cluster(Method::None, &springs).occupied(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// Every constraint is a cluster of its own: `none`.
    #[default]
    None,
    /// [`serial_neighbor`](crate::serial_neighbor) with this largest cluster size: `serial:K`.
    Serial(NonZeroUsize),
    /// [`serial_neighbor`](crate::serial_neighbor) with up to this many constraints beside the
    /// seed, so one more in total: `serial-loose:K`, the reading that matches the paper's counts.
    SerialLoose(NonZeroUsize),
    /// [`greedy_k_neighbor`] with this largest cluster size: `greedy-k:K`.
    GreedyK(NonZeroUsize),
    /// [`pressure`] with this largest cluster size: `pressure:K`.
    Pressure(NonZeroUsize),
}

impl Method {
    /// The largest size of a cluster.
    ///
    /// ```
    /// use incise_clustering::Method;
    ///
    /// assert_eq!(Method::None.max_size().get(), 1);
    /// assert_eq!("serial-loose:5".parse::<Method>()?.max_size().get(), 6);
    /// # Ok::<(), incise_clustering::ClusteringError>(())
    /// ```
    #[must_use]
    pub fn max_size(self) -> NonZeroUsize {
        match self {
            Self::None => NonZeroUsize::MIN,
            Self::Serial(size) | Self::GreedyK(size) | Self::Pressure(size) => size,
            Self::SerialLoose(beside) => beside.saturating_add(1),
        }
    }
}

impl Method {
    /// The names accepted by [`from_str`](Self::from_str), without the cluster size.
    pub const NAMES: [&str; 5] = ["none", "serial", "serial-loose", "greedy-k", "pressure"];
}

impl FromStr for Method {
    type Err = ClusteringError;

    fn from_str(text: &str) -> Result<Self, ClusteringError> {
        if text == "none" {
            return Ok(Self::None);
        }
        let (name, size) = text.split_once(':').unwrap_or((text, ""));
        let method = match name {
            "serial" => Self::Serial,
            "serial-loose" => Self::SerialLoose,
            "greedy-k" => Self::GreedyK,
            "pressure" => Self::Pressure,
            _ => {
                return Err(ClusteringError::UnknownMethod {
                    text: text.to_owned(),
                });
            }
        };
        size.parse()
            .map(method)
            .map_err(|_| ClusteringError::BadSize {
                text: text.to_owned(),
            })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Serial(size) => write!(f, "serial:{size}"),
            Self::SerialLoose(size) => write!(f, "serial-loose:{size}"),
            Self::GreedyK(size) => write!(f, "greedy-k:{size}"),
            Self::Pressure(size) => write!(f, "pressure:{size}"),
        }
    }
}

/// Clusters the constraints of `incidence` by the given method. Deterministic.
///
/// A graph without incidence can be clustered by [`serial_neighbor`](crate::serial_neighbor).
#[must_use]
pub fn cluster(method: Method, incidence: &Incidence) -> Clustering {
    let max_size = method.max_size();
    match method {
        Method::None => Clustering::none(incidence.constraint_count()),
        Method::Serial(_) | Method::SerialLoose(_) => {
            serial_neighbor_incidence(incidence, max_size)
        }
        Method::GreedyK(_) => greedy_k_neighbor(incidence, max_size),
        Method::Pressure(_) => pressure(incidence, max_size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for text in [
            "none",
            "serial:1",
            "serial:10",
            "serial-loose:5",
            "greedy-k:7",
            "pressure:256",
        ] {
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
            "serial-loose:0",
            "greedy-k",
            "pressure:",
        ] {
            let error = text.parse::<Method>().unwrap_err();
            assert_eq!(
                error,
                ClusteringError::BadSize {
                    text: text.to_owned()
                }
            );
        }
        for text in ["", "None", "none:3", "cereal:3", "greedy:3", "pressure 3"] {
            let error = text.parse::<Method>().unwrap_err();
            assert_eq!(
                error,
                ClusteringError::UnknownMethod {
                    text: text.to_owned()
                }
            );
        }
        let message = "cereal:3".parse::<Method>().unwrap_err().to_string();
        for name in [
            "none",
            "serial:K",
            "serial-loose:K",
            "greedy-k:K",
            "pressure:K",
        ] {
            assert!(message.contains(name), "{message} lacks {name}");
        }
    }

    #[test]
    fn the_loose_reading_counts_the_seed_extra() {
        let fan = Incidence::from_constraints(1, [[0u32]; 12]).unwrap();
        let size = |name: &str| cluster(name.parse().unwrap(), &fan).max_size();
        assert_eq!((size("serial:3"), size("serial-loose:3")), (3, 4));
    }
}
