//! [`Changes`]: changes by edits of a solver, for a device that solves on its own. Cost: a number an edit.

/// Changes by edits of a solver, for a device that solves on its own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Changes {
    /// Whether masses or materials have changed without a list of their tets, so that all tets must be read again.
    pub all_tets: bool,
    /// Tets with other corners, another rest shape or corners of another mass, with repetitions; some may no longer
    /// exist.
    pub tets: Vec<u32>,
    /// Whether the origin has moved, so that all particles must be read again.
    pub all_particles: bool,
    /// Particles that are new or have another position, velocity or mass, with repetitions; some may no longer exist.
    pub particles: Vec<u32>,
    /// Whether particles were attached, detached or appended with an attachment.
    pub attachments: bool,
    /// Whether the distance constraints were replaced.
    pub distances: bool,
    /// Whether the volume constraints were replaced.
    pub volumes: bool,
    /// Whether the contacts were replaced or removed.
    pub contacts: bool,
}

impl Changes {
    /// Returns a value that marks everything as changed, for a new device.
    #[must_use]
    pub fn everything() -> Self {
        Self {
            all_tets: true,
            all_particles: true,
            attachments: true,
            distances: true,
            volumes: true,
            contacts: true,
            ..Self::default()
        }
    }
}
