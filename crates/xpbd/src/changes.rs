//! [`Changes`]: what edits of a solver have changed, for a device that solves on its own. Cost: a number an edit.

/// What edits have changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Changes {
    /// Masses or materials have changed and their tets are not named: all tets are to be read again.
    pub all_tets: bool,
    /// Tets with other corners, another rest shape or corners of another mass, with repetitions; some may be gone
    /// since.
    pub tets: Vec<u32>,
    /// The origin has moved: all particles are to be read again.
    pub all_particles: bool,
    /// Particles that are new or have another position, velocity or mass, with repetitions; some may be gone since.
    pub particles: Vec<u32>,
    /// Whether particles were attached, detached or appended with an attachment.
    pub attachments: bool,
    /// Whether the distance constraints were replaced.
    pub distances: bool,
    /// Whether the volume constraints were replaced.
    pub volumes: bool,
}

impl Changes {
    /// Everything, for a device that begins.
    #[must_use]
    pub fn everything() -> Self {
        Self {
            all_tets: true,
            all_particles: true,
            attachments: true,
            distances: true,
            volumes: true,
            ..Self::default()
        }
    }
}
