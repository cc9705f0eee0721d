//! [`XpbdError`]: what can be wrong with a material, a setting or a constraint.

use incise_graph::GraphError;

/// Why a solver refused its input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum XpbdError {
    /// A material constant outside its range.
    #[error("{what} is {value}: it must be {range}")]
    Material {
        /// The constant.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        range: &'static str,
    },
    /// A setting of the solver outside its range.
    #[error("{what} is {value}: it must be {range}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        range: &'static str,
    },
    /// A value of a distance or volume constraint outside its range.
    #[error("{what} of constraint {index} is {value}: it must be {range}")]
    Constraint {
        /// The number of the constraint.
        index: usize,
        /// The value's name.
        what: &'static str,
        /// The value.
        value: f64,
        /// The range it must lie in.
        range: &'static str,
    },
    /// What a step would solve is not what schedule, tets and masses say.
    #[error("the layout has another {what} {number} than schedule, tets and masses say")]
    Layout {
        /// What differs.
        what: &'static str,
        /// Its number.
        number: usize,
    },
    /// Contacts were set and the method does not solve them.
    #[error(
        "method {method} does not solve contacts: use colored Gauss-Seidel, or clear the contacts"
    )]
    ContactMethod {
        /// The name of the method.
        method: &'static str,
    },
    /// Constraints on particles that do not exist, or a schedule that is not theirs.
    #[error("{what} constraints: {source}")]
    Schedule {
        /// The kind of constraint.
        what: &'static str,
        /// What is wrong.
        source: GraphError,
    },
}
