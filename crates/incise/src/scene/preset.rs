//! [`Preset`]: a setting of the solver under one name, whose single keys can still be overridden.
//!
//! The keys that a scene names are laid over those of the preset, so a preset is a set of other defaults. The defaults
//! of a method that is not the default one are treated the same way.

use serde::{Deserialize, Serialize};

/// Other defaults for the keys of `[solver]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// That of the paper: see [`SolverSpec::paper`](super::SolverSpec::paper).
    Paper,
}
