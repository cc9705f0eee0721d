//! [`ReferenceBody`]: particles, tets and the state that steps update.

use glam::{DMat3, DVec3};

use crate::element::Element;
use crate::newton::{Parts, Problem, minimize};
use crate::pieces::first_not_held;
use crate::system::System;
use crate::{Material, ReferenceError, Report};

/// A soft body of linear tets with lumped masses.
///
/// The state is public: move a fixed particle between steps to prescribe its motion. The tets and the data derived from
/// them (masses, the sparsity pattern of the matrix and its ordering) do not change.
///
/// ```
/// use glam::DVec3;
/// use incise_reference::{ReferenceBody, Material};
///
/// // A tet stands on three corners; the fourth begins to sink.
/// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let rubber = Material { young_modulus: 1e5, poisson_ratio: 0.45, density: 1000.0 };
/// let mut body = ReferenceBody::new(&rest, &[[0, 1, 2, 3]], |_tet| rubber)?;
/// body.fixed[..3].fill(true);
/// let report = body.step(0.01, DVec3::NEG_Z * 9.81)?;
/// assert!(report.residual() <= 1e-10 * report.scale);
/// assert!(body.positions[3].z < 1.0 && body.velocities[3].z < 0.0);
/// # Ok::<(), incise_reference::ReferenceError>(())
/// ```
#[derive(Debug)]
pub struct ReferenceBody {
    /// Position of each particle in m.
    pub positions: Vec<DVec3>,
    /// Velocity of each particle in m/s. The velocity of a fixed particle is neither read nor written.
    pub velocities: Vec<DVec3>,
    /// Marks the particles that do not move. A particle that belongs to no tet has no mass and is fixed too.
    pub fixed: Vec<bool>,
    pub(crate) masses: Vec<f64>,
    pub(crate) elements: Vec<Element>,
    pub(crate) system: System,
}

/// Energies in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic energy of the particles that are not fixed.
    pub kinetic: f64,
    /// Elastic energy; 0 at rest, its minimum.
    pub elastic: f64,
}

impl ReferenceBody {
    /// Creates a body at rest in the shape of `positions`; `material` gives the material of each tet.
    ///
    /// Each corner of a tet gets a quarter of its mass. O(tets), and the symbolic factorization.
    ///
    /// # Errors
    /// If a material does not pass [`Material::check`], a position is not finite, or a tet names a particle that does
    /// not exist or has no positive volume.
    pub fn new(
        positions: &[DVec3],
        tets: &[[u32; 4]],
        material: impl Fn(usize) -> Material,
    ) -> Result<Self, ReferenceError> {
        let particles = positions.len();
        check_finite("position", positions)?;
        let mut masses = vec![0.0; particles];
        let mut elements = Vec::with_capacity(tets.len());
        for (tet, &corners) in tets.iter().enumerate() {
            if let Some(&particle) = corners.iter().find(|&&p| p as usize >= particles) {
                return Err(ReferenceError::NoParticle {
                    tet,
                    particle,
                    particles,
                });
            }
            let material = material(tet);
            let rest = corners.map(|p| positions[p as usize]);
            let element = Element::new(tet, corners, rest, &material)?;
            for p in corners {
                masses[p as usize] += material.density * element.volume / 4.0;
            }
            elements.push(element);
        }
        Ok(Self {
            positions: positions.to_vec(),
            velocities: vec![DVec3::ZERO; particles],
            fixed: vec![false; particles],
            masses,
            elements,
            system: System::new(particles, tets.iter().copied())?,
        })
    }

    /// Mass of each particle in kg.
    #[must_use]
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Deformation gradient of a tet.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn deformation(&self, tet: usize) -> DMat3 {
        self.elements[tet].deformation(&self.positions)
    }

    /// Elastic force on each particle in N; the support of a fixed particle carries it. O(tets).
    #[must_use]
    pub fn elastic_forces(&self) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; self.positions.len()];
        for element in &self.elements {
            let stress = element.law.stress(element.deformation(&self.positions));
            for (p, gradient) in element.particles.into_iter().zip(element.gradients) {
                forces[p as usize] -= stress * gradient * element.volume;
            }
        }
        forces
    }

    /// Energies of the current state. O(tets).
    #[must_use]
    pub fn energy(&self) -> Energy {
        let moving = (0..self.positions.len()).filter(|&p| !self.fixed[p]);
        let kinetic = moving.map(|p| 0.5 * self.masses[p] * self.velocities[p].length_squared());
        let elastic = self.elements.iter().map(|element| {
            let f = element.deformation(&self.positions);
            element.volume * element.law.energy_density(f)
        });
        Energy {
            kinetic: kinetic.sum(),
            elastic: elastic.sum(),
        }
    }

    /// Number of tets with zero or negative volume. O(tets).
    ///
    /// An equilibrium with inverted tets is one of several; check this count after large steps and large loads.
    #[must_use]
    pub fn inverted(&self) -> usize {
        let inverted = |e: &&Element| e.deformation(&self.positions).determinant() <= 0.0;
        self.elements.iter().filter(inverted).count()
    }

    /// Advances by `time_step` s under `gravity` in m/s², by implicit Euler.
    ///
    /// The new positions are a minimum of `Σ m/2 |x - x̃|²/Δt² + U(x)` with the prediction `x̃ = x + Δt v + Δt² g`,
    /// found by Newton's method: see [`Report`] for its accuracy. Fixed particles stay at their positions. Large steps
    /// can have several minima; the result is the one found downhill from the prediction or from the current state,
    /// whichever has the lower potential.
    ///
    /// # Errors
    /// [`ReferenceError::Setting`] for a time step that is not positive or a gravity that is not finite,
    /// [`ReferenceError::NotFinite`] for the state, [`ReferenceError::NotConverged`] and [`ReferenceError::Range`] if
    /// no solution was found. The body is unchanged on an error.
    ///
    /// # Panics
    /// If the public lists do not have one entry per particle.
    ///
    /// # Determinism
    /// One thread; bit-identical results on processors of one kind.
    pub fn step(&mut self, time_step: f64, gravity: DVec3) -> Result<Report, ReferenceError> {
        let _span = tracing::debug_span!("reference::step").entered();
        let rate = 1.0 / (time_step * time_step);
        if !(time_step > 0.0 && time_step.is_finite() && rate.is_finite() && rate > 0.0) {
            return Err(ReferenceError::Setting {
                what: "time_step",
                value: time_step,
                range: "positive, with a finite square and inverse square",
            });
        }
        self.check(gravity)?;
        let held = self.held();
        let inertial: Vec<DVec3> = self.per_particle(&held, |p| self.velocities[p] * time_step);
        let predicted = self.per_particle(&held, |p| inertial[p] + gravity * time_step * time_step);
        let problem = Problem {
            rate,
            inertial,
            gravity,
            held,
        };
        let (moved, report) = minimize(&mut self.parts(), &problem, Some(&predicted))?;
        let velocities = self.per_particle(&problem.held, |p| moved[p] / time_step);
        self.commit(&problem.held, &moved, &velocities)?;
        Ok(report)
    }

    /// Moves the body to a static equilibrium under `gravity` in m/s², downhill from its current state; velocities
    /// become zero.
    ///
    /// # Errors
    /// [`ReferenceError::NotHeld`] if a piece can translate or rotate freely, and the errors of [`ReferenceBody::step`]. The
    /// body is unchanged on an error.
    ///
    /// # Panics
    /// If the public lists do not have one entry per particle.
    ///
    /// # Determinism
    /// One thread; bit-identical results on processors of one kind.
    pub fn settle(&mut self, gravity: DVec3) -> Result<Report, ReferenceError> {
        let _span = tracing::debug_span!("reference::settle").entered();
        self.check(gravity)?;
        let held = self.held();
        let tets = self.elements.iter().map(|e| e.particles);
        if let Some(particle) = first_not_held(&self.positions, tets, &held) {
            return Err(ReferenceError::NotHeld { particle });
        }
        let problem = Problem {
            rate: 0.0,
            inertial: vec![DVec3::ZERO; held.len()],
            gravity,
            held,
        };
        let (moved, report) = minimize(&mut self.parts(), &problem, None)?;
        let still = vec![DVec3::ZERO; moved.len()];
        self.commit(&problem.held, &moved, &still)?;
        Ok(report)
    }

    fn parts(&mut self) -> Parts<'_> {
        Parts {
            positions: &self.positions,
            masses: &self.masses,
            elements: &self.elements,
            system: &mut self.system,
        }
    }

    fn held(&self) -> Vec<bool> {
        let each = self.fixed.iter().zip(&self.masses);
        each.map(|(&fixed, &mass)| fixed || mass == 0.0).collect()
    }

    fn per_particle(&self, held: &[bool], value: impl Fn(usize) -> DVec3) -> Vec<DVec3> {
        let each = held.iter().enumerate();
        each.map(|(p, &held)| if held { DVec3::ZERO } else { value(p) })
            .collect()
    }

    /// Stores a solution if it is finite.
    fn commit(
        &mut self,
        held: &[bool],
        moved: &[DVec3],
        velocities: &[DVec3],
    ) -> Result<(), ReferenceError> {
        let positions: Vec<DVec3> = self
            .positions
            .iter()
            .zip(moved)
            .map(|(x, d)| x + d)
            .collect();
        if positions.iter().chain(velocities).any(|v| !v.is_finite()) {
            return Err(ReferenceError::Range);
        }
        self.positions = positions;
        for p in (0..held.len()).filter(|&p| !held[p]) {
            self.velocities[p] = velocities[p];
        }
        Ok(())
    }

    fn check(&self, gravity: DVec3) -> Result<(), ReferenceError> {
        let n = self.masses.len();
        assert!(
            self.positions.len() == n && self.velocities.len() == n && self.fixed.len() == n,
            "there is a position, a velocity and a flag for each particle"
        );
        if let Some(value) = gravity.to_array().into_iter().find(|c| !c.is_finite()) {
            return Err(ReferenceError::Setting {
                what: "gravity",
                value,
                range: "finite",
            });
        }
        check_finite("position", &self.positions)?;
        check_finite("velocity", &self.velocities)
    }
}

fn check_finite(what: &'static str, vectors: &[DVec3]) -> Result<(), ReferenceError> {
    match vectors.iter().position(|v| !v.is_finite()) {
        Some(particle) => Err(ReferenceError::NotFinite { what, particle }),
        None => Ok(()),
    }
}
