//! The algorithms by name, for command lines and scene files.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use incise_graph::Coloring;

use crate::{
    ColoringError, Conflicts, EclGc, Order, Scgc, Shortcuts, Vivace, VivaceOptions, Wlc, auto,
    dsatur, ecl_gc, greedy, iterated_greedy, scgc_with, tabu, vivace, wlc,
};

/// A coloring algorithm, chosen at run time.
///
/// Written as a name, for some with a parameter behind a colon:
///
/// | text | is |
/// |---|---|
/// | `auto` | [`auto`](crate::auto()), the default |
/// | `scgc`, `scgc:13` | [`scgc`](crate::scgc()), or with shortcuts 1 and 3 only |
/// | `jones-plassmann` | [`jones_plassmann`](crate::jones_plassmann) |
/// | `ecl-gc` | [`ecl_gc`](crate::ecl_gc()) |
/// | `vivace`, `vivace:4` | [`vivace`](crate::vivace()), with this shrinking factor |
/// | `wlc`, `wlc:64` | [`wlc`](crate::wlc()), with this chunk; 2048 without |
/// | `mcs` | [`greedy`](crate::greedy()) in order of maximum cardinality |
/// | `greedy`, `greedy:natural` | [`greedy`](crate::greedy()), largest first, or in the order `natural`, `random`, `largest-first`, `degree-bound` or `smallest-last` |
/// | `dsatur` | [`dsatur`](crate::dsatur()) |
/// | `iterated-greedy`, `iterated-greedy:500` | [`iterated_greedy`](crate::iterated_greedy()) after `greedy:degree-bound`, with so many passes; 50 without |
/// | `tabu`, `tabu:1000000` | [`tabu`](crate::tabu()) after `greedy:smallest-last`, with so many steps a color; 100,000 without |
///
/// ```
/// use incise_coloring::{Algorithm, color};
/// use incise_graph::ConstraintGraph;
///
/// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
/// let algorithm: Algorithm = "vivace:2".parse()?;
/// color(algorithm, &path, 7)?.coloring.verify(&path)?;
/// assert_eq!(algorithm.to_string(), "vivace:2");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Algorithm {
    /// `auto`
    #[default]
    Auto,
    /// `scgc`, and `jones-plassmann` without any shortcut.
    Scgc(Shortcuts),
    /// `ecl-gc`
    EclGc,
    /// `vivace`, with the shrinking factor.
    Vivace(NonZeroUsize),
    /// `wlc`, with the chunk.
    Wlc(NonZeroUsize),
    /// `greedy` and `mcs`. The seed of a random order is that given to [`color`].
    Greedy(Order),
    /// `dsatur`
    Dsatur,
    /// `iterated-greedy`, with the passes.
    IteratedGreedy(NonZeroUsize),
    /// `tabu`, with the steps for each color.
    Tabu(NonZeroUsize),
}

/// A coloring, and the work of finding it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Colored {
    /// The coloring.
    pub coloring: Coloring,
    /// Parallel rounds; 1 for the sequential algorithms.
    pub rounds: usize,
    /// Number of visits of neighbors, for algorithms that count them; defined by their statistics.
    pub edge_visits: Option<u64>,
}

const fn number(value: usize) -> NonZeroUsize {
    match NonZeroUsize::new(value) {
        Some(value) => value,
        None => NonZeroUsize::MIN,
    }
}

/// The names of the orders of `greedy:`.
const ORDERS: [(&str, Order); 5] = [
    ("natural", Order::Natural),
    ("random", Order::Random(0)),
    ("largest-first", Order::LargestFirst),
    ("degree-bound", Order::DegreeBound),
    ("smallest-last", Order::SmallestLast),
];

impl Algorithm {
    /// All names, the default first; parameters only where they make another algorithm.
    pub const ALL: [Self; 17] = [
        Self::Auto,
        Self::Scgc(Shortcuts::ALL),
        Self::Scgc(Shortcuts::NONE),
        Self::EclGc,
        Self::Vivace(number(1)),
        Self::Vivace(number(2)),
        Self::Vivace(number(4)),
        Self::Wlc(number(2048)),
        Self::Greedy(Order::MaximumCardinality),
        Self::Greedy(Order::LargestFirst),
        Self::Greedy(Order::Natural),
        Self::Greedy(Order::Random(0)),
        Self::Greedy(Order::DegreeBound),
        Self::Greedy(Order::SmallestLast),
        Self::Dsatur,
        Self::IteratedGreedy(number(50)),
        Self::Tabu(number(100_000)),
    ];
}

impl Algorithm {
    /// The names that [`from_str`](Self::from_str) knows, without parameters.
    pub const NAMES: [&str; 11] = [
        "auto",
        "scgc",
        "jones-plassmann",
        "ecl-gc",
        "vivace",
        "wlc",
        "mcs",
        "greedy",
        "dsatur",
        "iterated-greedy",
        "tabu",
    ];
}

impl FromStr for Algorithm {
    type Err = ColoringError;

    /// # Errors
    /// No algorithm has this name, or it has no such parameter; the message lists the valid ones.
    fn from_str(text: &str) -> Result<Self, ColoringError> {
        let (name, parameter) = match text.split_once(':') {
            Some((name, parameter)) => (name, Some(parameter)),
            None => (text, None),
        };
        let refuse = |expected| ColoringError::BadParameter {
            text: text.to_owned(),
            expected,
        };
        let count = |default: usize| match parameter {
            None => Ok(number(default)),
            Some(digits) => digits
                .parse()
                .map_err(|_| refuse("a whole number from 1 on")),
        };
        let plain = |algorithm| match parameter {
            None => Ok(algorithm),
            Some(_) => Err(refuse("nothing")),
        };
        match name {
            "auto" => plain(Self::Auto),
            "scgc" => match parameter {
                None => Ok(Self::Scgc(Shortcuts::ALL)),
                Some(digits) => shortcuts(digits)
                    .map(Self::Scgc)
                    .ok_or_else(|| refuse("some of the digits 1, 2, 3 in this order")),
            },
            "jones-plassmann" => plain(Self::Scgc(Shortcuts::NONE)),
            "ecl-gc" => plain(Self::EclGc),
            "vivace" => match count(1)? {
                factor if u32::try_from(factor.get()).is_ok() => Ok(Self::Vivace(factor)),
                _ => Err(refuse("a whole number below 2^32")),
            },
            "wlc" => count(2048).map(Self::Wlc),
            "mcs" => plain(Self::Greedy(Order::MaximumCardinality)),
            "greedy" => {
                let order = parameter.unwrap_or("largest-first");
                let known = ORDERS.into_iter().find(|(name, _)| *name == order);
                known.map(|(_, order)| Self::Greedy(order)).ok_or_else(|| {
                    refuse("natural, random, largest-first, degree-bound or smallest-last")
                })
            }
            "dsatur" => plain(Self::Dsatur),
            "iterated-greedy" => count(50).map(Self::IteratedGreedy),
            "tabu" => count(100_000).map(Self::Tabu),
            _ => Err(ColoringError::UnknownAlgorithm {
                name: text.to_owned(),
                known: Self::NAMES.join(", "),
            }),
        }
    }
}

/// The shortcuts of a list of digits.
fn shortcuts(digits: &str) -> Option<Shortcuts> {
    Shortcuts::COMBINATIONS
        .into_iter()
        .skip(1)
        .find(|&shortcuts| list(shortcuts) == digits)
}

/// The digits of the shortcuts that are on.
fn list(shortcuts: Shortcuts) -> String {
    let Shortcuts { one, two, three } = shortcuts;
    let digits = [(one, '1'), (two, '2'), (three, '3')];
    let on = digits.into_iter().filter(|(on, _)| *on);
    on.map(|(_, digit)| digit).collect()
}

impl fmt::Display for Algorithm {
    /// The shortest text that gives the same algorithm.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Auto => f.write_str("auto"),
            Self::Scgc(Shortcuts::ALL) => f.write_str("scgc"),
            Self::Scgc(Shortcuts::NONE) => f.write_str("jones-plassmann"),
            Self::Scgc(shortcuts) => write!(f, "scgc:{}", list(shortcuts)),
            Self::EclGc => f.write_str("ecl-gc"),
            Self::Vivace(NonZeroUsize::MIN) => f.write_str("vivace"),
            Self::Vivace(factor) => write!(f, "vivace:{factor}"),
            Self::Wlc(chunk) if chunk.get() == 2048 => f.write_str("wlc"),
            Self::Wlc(chunk) => write!(f, "wlc:{chunk}"),
            Self::Greedy(Order::MaximumCardinality) => f.write_str("mcs"),
            Self::Greedy(Order::LargestFirst) => f.write_str("greedy"),
            Self::Greedy(Order::Natural) => f.write_str("greedy:natural"),
            Self::Greedy(Order::Random(_)) => f.write_str("greedy:random"),
            Self::Greedy(Order::DegreeBound) => f.write_str("greedy:degree-bound"),
            Self::Greedy(Order::SmallestLast) => f.write_str("greedy:smallest-last"),
            Self::Dsatur => f.write_str("dsatur"),
            Self::IteratedGreedy(passes) if passes.get() == 50 => f.write_str("iterated-greedy"),
            Self::IteratedGreedy(passes) => write!(f, "iterated-greedy:{passes}"),
            Self::Tabu(steps) if steps.get() == 100_000 => f.write_str("tabu"),
            Self::Tabu(steps) => write!(f, "tabu:{steps}"),
        }
    }
}

/// Colors by the given algorithm. The result is proper, and the same for any number of threads.
///
/// `seed` chooses the random numbers of `vivace`, `greedy:random`, `iterated-greedy` and `tabu`.
/// Searching algorithms stop at [`Conflicts::clique_bound`].
///
/// # Errors
/// Returns an error if an algorithm fails. No algorithm fails with the settings that a name can state.
pub fn color(
    algorithm: Algorithm,
    conflicts: &impl Conflicts,
    seed: u64,
) -> Result<Colored, ColoringError> {
    let sequential = |coloring| Colored {
        coloring,
        rounds: 1,
        edge_visits: None,
    };
    let parallel = |coloring, rounds, edge_visits| Colored {
        coloring,
        rounds,
        edge_visits: Some(edge_visits),
    };
    let bound = conflicts.clique_bound();
    Ok(match algorithm {
        Algorithm::Auto => sequential(auto(conflicts).coloring),
        Algorithm::Scgc(shortcuts) => {
            let Scgc { coloring, stats } = scgc_with(conflicts, shortcuts);
            parallel(coloring, stats.rounds, stats.edge_visits)
        }
        Algorithm::EclGc => {
            let EclGc { coloring, stats } = ecl_gc(conflicts);
            let rounds = stats.large_rounds + stats.small_rounds;
            parallel(coloring, rounds, stats.edge_visits)
        }
        Algorithm::Vivace(factor) => {
            let options = VivaceOptions {
                shrinking: u32::try_from(factor.get()).unwrap_or(u32::MAX),
                seed,
                ..VivaceOptions::default()
            };
            let Vivace { coloring, stats } = vivace(conflicts, options)?;
            parallel(coloring, stats.rounds, stats.edge_visits)
        }
        Algorithm::Wlc(chunk) => {
            let Wlc { coloring, stats } = wlc(conflicts, chunk);
            parallel(coloring, stats.rounds, stats.edge_visits)
        }
        Algorithm::Greedy(Order::Random(_)) => sequential(greedy(conflicts, Order::Random(seed))),
        Algorithm::Greedy(order) => sequential(greedy(conflicts, order)),
        Algorithm::Dsatur => sequential(dsatur(conflicts)),
        Algorithm::IteratedGreedy(passes) => {
            let mut coloring = greedy(conflicts, Order::DegreeBound);
            iterated_greedy(conflicts, &mut coloring, passes.get(), bound, seed);
            sequential(coloring)
        }
        Algorithm::Tabu(steps) => {
            let graph = conflicts.graph();
            let mut coloring = greedy(&*graph, Order::SmallestLast);
            tabu(&*graph, &mut coloring, bound, steps.get(), seed);
            sequential(coloring)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_round_trip() {
        for algorithm in Algorithm::ALL {
            assert_eq!(algorithm.to_string().parse(), Ok(algorithm));
        }
        for text in [
            "scgc:1",
            "scgc:13",
            "scgc:2",
            "vivace:3",
            "wlc:1",
            "iterated-greedy:7",
            "tabu:9",
        ] {
            assert_eq!(text.parse::<Algorithm>().unwrap().to_string(), text);
        }
        assert_eq!("scgc:123".parse(), Ok(Algorithm::Scgc(Shortcuts::ALL)));
        assert_eq!(
            "greedy:largest-first".parse(),
            Ok(Algorithm::Greedy(Order::LargestFirst))
        );
    }

    #[test]
    fn mistakes_are_told_apart() {
        for text in [
            "auto:1",
            "scgc:",
            "scgc:0",
            "scgc:31",
            "scgc:1234",
            "vivace:0",
            "vivace:-1",
            "vivace:4294967296",
            "wlc:x",
            "greedy:best",
            "greedy:",
            "tabu:1.5",
        ] {
            let error = text.parse::<Algorithm>().unwrap_err();
            assert!(
                matches!(error, ColoringError::BadParameter { .. }),
                "{error}"
            );
            assert!(error.to_string().contains(text));
        }
        for text in ["", "SCGC", "jp", "greedy-natural"] {
            let error = text.parse::<Algorithm>().unwrap_err();
            assert!(
                matches!(error, ColoringError::UnknownAlgorithm { .. }),
                "{error}"
            );
        }
    }
}
