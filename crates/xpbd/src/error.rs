//! [`XpbdError`]: errors of materials, settings and constraints.

use incise_graph::GraphError;

/// Error of a solver about its input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum XpbdError {
    /// A material constant outside its range.
    #[error("{what} is {value}: it must be {range}")]
    Material {
        /// Name of the constant.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        range: &'static str,
    },
    /// A setting of the solver outside its range.
    #[error("{what} is {value}: it must be {range}")]
    Setting {
        /// Name of the setting.
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
    /// The layout differs from schedule, tets and masses.
    #[error("the layout has another {what} {number} than schedule, tets and masses say")]
    Layout {
        /// Kind of item that differs.
        what: &'static str,
        /// Number of the item.
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
    /// Forces are measured and the method has none.
    #[error(
        "forces cannot be measured with method {method}, whose extrapolation moves particles by no force: use another method, or do not measure forces"
    )]
    ForceMethod {
        /// The name of the method.
        method: &'static str,
    },
    /// Constraints on particles that do not exist, or a schedule of other constraints.
    #[error("{what} constraints: {source}")]
    Schedule {
        /// The kind of constraint.
        what: &'static str,
        /// Cause.
        source: GraphError,
    },
}
