//! [`ContactError`]: settings out of range, and detectors that do not match their mesh.

/// Error of a contact detector: a setting out of range, or a state that does not match its mesh.
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
    /// The state differs from one rebuilt from the mesh: a delta was not applied, or this crate has a defect.
    #[error("the contact state does not match its mesh: {0}")]
    Differs(String),
}
