//! [`ContactError`]: what can be wrong with settings or with a detector that does not belong to its mesh.

/// Why a detector was refused or does not agree with its mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A setting outside its range.
    #[error("{what} is {value}: it must be {range}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        range: &'static str,
    },
    /// A body for each particle is needed.
    #[error("{given} body numbers are given for {particles} particles: give one for each")]
    Bodies {
        /// How many numbers are given.
        given: usize,
        /// How many particles there are.
        particles: usize,
    },
    /// The state is not the one that the mesh asks for: a delta was left out, or there is a defect in this crate.
    #[error("the contact state does not match its mesh: {0}")]
    Differs(String),
}
