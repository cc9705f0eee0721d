//! [`Preset`]: the name of a set of defaults for `[solver]`. [`SolverSpec`](super::SolverSpec) has the values.

use serde::{Deserialize, Serialize};

/// Other defaults for the keys of `[solver]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// That of the paper: see [`SolverSpec::paper`](super::SolverSpec::paper).
    Paper,
}
