//! [`TetMesh::check`]: counts violations of the rules of a valid mesh and reports the first one.
//!
//! Three passes: coordinates, tets, faces. Tets with missing or repeated corners are counted and skipped by later
//! rules, where they would only cause further faults. The sign of a volume is exact ([`orientation`]), also for slivers
//! left by a cut. Cost: O(n log n) for the faces.

use crate::faces::outward_face;
use crate::{CheckReport, Faces, Fault, MeshError, ParticleId, TetId, TetMesh, orientation};
impl TetMesh {
    /// Checks that the mesh is valid: not empty and without any fault counted by [`check_report`](Self::check_report).
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
    /// use incise_mesh::{glam::DVec3, kuhn_box};
    ///
    /// let mut mesh = kuhn_box([2, 2, 2], DVec3::ONE);
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

    /// Counts the violations of every rule. A mesh without tets has none.
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

        for face in Faces::of(&self.tets, |t| sound[t]).iter() {
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

    /// Records the faults of one tet; false if its corners cannot be used by later rules.
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
        // A corner that is not finite has been counted already, and the volume is then undefined.
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

/// True if a cyclic sequence of three distinct particles can be rotated into ascending order.
fn is_ascending_cycle([a, b, c]: [ParticleId; 3]) -> bool {
    (a < b) as u8 + (b < c) as u8 + (c < a) as u8 == 2
}
