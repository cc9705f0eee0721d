//! The rules a sound mesh obeys, and a report that counts every breach and names the first.
//!
//! Three passes: coordinates, tets, faces. Tets whose corners are missing or repeated are counted and left out of the
//! later rules, where they would only cause follow-up faults. The sign of a volume is exact ([`orientation`]), so that
//! slivers left by a cut are judged rightly. Cost: O(n log n) for the faces, about 1 ms for 11,000 tets.

use std::fmt;

use glam::DVec3;

use crate::faces::{by_face, outward_face, sorted_sides};
use crate::{MeshError, ParticleId, TetId, TetMesh, orientation};

/// How often a mesh breaks each rule, and the first breach.
///
/// Shown as one sentence. `first` is of the first kind, in the order of the fields, that occurs at all, and is the
/// breach with the lowest index (for faces: the lowest particles).
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
    /// The first breach.
    pub first: Option<Fault>,
}

/// One breach of one rule.
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
        /// The particle used twice.
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
    /// Whether no rule is broken.
    #[must_use]
    pub const fn is_sound(&self) -> bool {
        self.first.is_none()
    }

    fn note(&mut self, fault: Fault) {
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

impl TetMesh {
    /// Whether the mesh is sound: not empty, and without any fault that [`check_report`](Self::check_report) counts.
    ///
    /// Unused particles are allowed.
    ///
    /// # Errors
    /// [`MeshError::Empty`] without tets, [`MeshError::Faulty`] with the report otherwise.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{MeshError, generate};
    ///
    /// let mut mesh = generate::kuhn_box([2, 2, 2], incise_mesh::glam::DVec3::ONE);
    /// assert!(mesh.check().is_ok());
    ///
    /// mesh.tets[7].swap(0, 1);
    /// let error = mesh.check().unwrap_err();
    /// assert!(error.to_string().contains("first: tet 7 has the volume -"));
    /// ```
    pub fn check(&self) -> Result<(), MeshError> {
        if self.tets.is_empty() {
            return Err(MeshError::Empty);
        }
        let report = self.check_report();
        if report.is_sound() {
            Ok(())
        } else {
            Err(MeshError::Faulty(Box::new(report)))
        }
    }

    /// Counts every breach of every rule. A mesh without tets breaks none.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    #[must_use]
    pub fn check_report(&self) -> CheckReport {
        let mut report = CheckReport::default();
        for (p, &position) in self.positions.iter().enumerate() {
            if !position.is_finite() {
                report.note(Fault::NonFinite {
                    particle: ParticleId::new(p),
                    position,
                });
            }
        }
        let sound: Vec<bool> = (0..self.tets.len())
            .map(|t| self.check_tet(TetId::new(t), &mut report))
            .collect();

        let sides = sorted_sides(&self.tets, |t| sound[t]);
        for face in by_face(&sides) {
            match *face {
                [_] => {}
                [s, t] => {
                    let turns = [s, t].map(|side| {
                        is_ascending_cycle(outward_face(
                            self.tets[side.tet().index()],
                            side.local(),
                        ))
                    });
                    if turns[0] == turns[1] {
                        report.note(Fault::Overlapping {
                            face: s.face(),
                            tets: [s.tet(), t.tet()],
                        });
                    }
                }
                _ => report.note(Fault::Crowded {
                    face: face[0].face(),
                    tets: face.len(),
                }),
            }
        }
        report
    }

    /// Notes the faults of one tet; false when its corners cannot be used any further.
    fn check_tet(&self, tet: TetId, report: &mut CheckReport) -> bool {
        let corners = self.tets[tet.index()];
        let particles = self.positions.len();
        if let Some(&corner) = corners.iter().find(|c| c.index() >= particles) {
            report.note(Fault::OutOfRange {
                tet,
                corner,
                particles,
            });
            return false;
        }
        if let Some(i) = (1..4).find(|&i| corners[..i].contains(&corners[i])) {
            report.note(Fault::Repeated {
                tet,
                particle: corners[i],
            });
            return false;
        }
        let positions = self.corners(tet);
        // A corner that is not finite has been counted already and has no volume to judge.
        if positions.iter().all(|p| p.is_finite()) {
            let orientation = orientation(positions);
            if orientation.is_nan() || orientation <= 0.0 {
                report.note(Fault::NonPositive {
                    tet,
                    volume: orientation / 6.0,
                });
            }
        }
        true
    }
}

/// Whether a cyclic sequence of three different particles can be rotated into ascending order.
fn is_ascending_cycle([a, b, c]: [ParticleId; 3]) -> bool {
    (a < b) as u8 + (b < c) as u8 + (c < a) as u8 == 2
}
