//! [`XpbdError`]: what can be wrong with a material, a setting or a tet.

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
    /// A direct solve left double precision.
    #[cfg(feature = "direct")]
    #[error("the constraints are too stiff for a direct solve: use a smaller substep")]
    Factorization,
}
