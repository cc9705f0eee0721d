//! [`Preset`]: the name of a set of defaults for `[solver]`. [`SolverSpec`](super::SolverSpec) has the values.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Other defaults for the keys of `[solver]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// The settings of the paper's experiments: one step of 0.016 s, 500 iterations, sequential constraints.
    Paper,
}
