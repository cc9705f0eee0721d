//! [`CheckReport`] and [`Fault`]: violated rules of a valid mesh, as counts and as a sentence.

use std::fmt;

use glam::DVec3;

use crate::{ParticleId, TetId};

/// The number of violations of each rule, and the first violation.
///
/// Displayed as one sentence. `first` belongs to the first rule, in the order of the fields, that is violated, and has
/// the lowest index (for faces, the lowest particles).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckReport {
    /// Particles with a coordinate that is NaN or infinite.
    pub non_finite: usize,
    /// Tets with a corner that is not a particle of the mesh.
    pub out_of_range: usize,
    /// Tets that use one particle for two corners.
    pub repeated: usize,
    /// Tets whose volume is zero or negative.
    pub non_positive: usize,
    /// Faces with more than two tets.
    pub crowded: usize,
    /// Faces whose two tets lie on the same side.
    pub overlapping: usize,
    /// The first violation.
    pub first: Option<Fault>,
}

/// One violation of a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// A particle has a coordinate that is NaN or infinite.
    NonFinite {
        /// The particle.
        particle: ParticleId,
        /// Its position.
        position: DVec3,
    },
    /// A tet has a corner that is not a particle of the mesh.
    OutOfRange {
        /// The tet.
        tet: TetId,
        /// The corner.
        corner: ParticleId,
        /// The number of particles.
        particles: usize,
    },
    /// A tet uses one particle for two corners.
    Repeated {
        /// The tet.
        tet: TetId,
        /// The repeated particle.
        particle: ParticleId,
    },
    /// A tet is flat or inverted.
    NonPositive {
        /// The tet.
        tet: TetId,
        /// Its volume in m³.
        volume: f64,
    },
    /// A face has more than two tets.
    Crowded {
        /// The particles of the face, ascending.
        face: [ParticleId; 3],
        /// The number of tets.
        tets: usize,
    },
    /// The two tets of a face lie on the same side of it.
    Overlapping {
        /// The particles of the face, ascending.
        face: [ParticleId; 3],
        /// The two tets.
        tets: [TetId; 2],
    },
}

impl CheckReport {
    /// True if no rule is violated.
    #[must_use]
    pub const fn is_sound(&self) -> bool {
        self.first.is_none()
    }

    pub(crate) fn note(&mut self, fault: Fault) {
        *match fault {
            Fault::NonFinite { .. } => &mut self.non_finite,
            Fault::OutOfRange { .. } => &mut self.out_of_range,
            Fault::Repeated { .. } => &mut self.repeated,
            Fault::NonPositive { .. } => &mut self.non_positive,
            Fault::Crowded { .. } => &mut self.crowded,
            Fault::Overlapping { .. } => &mut self.overlapping,
        } += 1;
        if self
            .first
            .as_ref()
            .is_none_or(|first| first.rank() > fault.rank())
        {
            self.first = Some(fault);
        }
    }
}

impl Fault {
    const fn rank(&self) -> u8 {
        match self {
            Self::NonFinite { .. } => 0,
            Self::OutOfRange { .. } => 1,
            Self::Repeated { .. } => 2,
            Self::NonPositive { .. } => 3,
            Self::Crowded { .. } => 4,
            Self::Overlapping { .. } => 5,
        }
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = &self.first else {
            return write!(f, "no faults");
        };
        let kinds = [
            (
                self.non_finite,
                "particles with a coordinate that is not finite",
            ),
            (self.out_of_range, "tets with a corner that does not exist"),
            (self.repeated, "tets with a repeated corner"),
            (self.non_positive, "tets that are flat or inverted"),
            (self.crowded, "faces with more than two tets"),
            (self.overlapping, "faces with both tets on one side"),
        ];
        let mut separator = "";
        for (count, what) in kinds.into_iter().filter(|&(count, _)| count > 0) {
            write!(f, "{separator}{what}: {count}")?;
            separator = ", ";
        }
        write!(f, "; first: {first}")
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite {
                particle,
                position: p,
            } => {
                write!(
                    f,
                    "particle {particle} is at ({}, {}, {}), correct its coordinates",
                    p.x, p.y, p.z
                )
            }
            Self::OutOfRange {
                tet,
                corner,
                particles,
            } => {
                write!(
                    f,
                    "tet {tet} has the corner {corner} but there are only {particles} particles, from 0 on"
                )
            }
            Self::Repeated { tet, particle } => {
                write!(
                    f,
                    "tet {tet} has particle {particle} twice, remove the tet or correct its corners"
                )
            }
            Self::NonPositive { tet, volume } if *volume < 0.0 => {
                write!(
                    f,
                    "tet {tet} has the volume {volume:e} m³, exchange two of its corners"
                )
            }
            Self::NonPositive { tet, volume } => {
                write!(
                    f,
                    "tet {tet} has the volume {volume:e} m³, remove it or move its corners"
                )
            }
            Self::Crowded {
                face: [a, b, c],
                tets,
            } => {
                write!(
                    f,
                    "face ({a}, {b}, {c}) has {tets} tets, remove all but two"
                )
            }
            Self::Overlapping {
                face: [a, b, c],
                tets: [t, u],
            } => {
                write!(
                    f,
                    "tets {t} and {u} lie on the same side of face ({a}, {b}, {c}), remove or turn one"
                )
            }
        }
    }
}
