//! [`VolumeConstraint`]: tets that keep their volume beyond what their material does.
//!
//! The constraint is `C = V / V₀ - 1` with the energy `V₀ C² / (2 · compliance)`, so the compliance is that of the
//! substance (one over a bulk modulus) and does not depend on the size of the tet: the children of a cut tet inherit
//! it. A tet far from its rest shape has small gradients, and a compliance of 0 then moves its corners far: it is no
//! remedy for collapsed tets.
//!
//! Source: Müller et al. 2007, section 3.3 (constraint); Macklin, Müller, Chentanez 2016 (compliance). Cost: 150
//! operations a tet.

use glam::DVec3;
use incise_graph::Schedule;

use crate::scalar::{Constraints, Scalar};
use crate::{Float, Solver, VolumeData, XpbdError};

/// Keeps the volume that four particles span. See [`Solver::set_volumes`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeConstraint {
    /// The corners, as those of a tet.
    pub particles: [u32; 4],
    /// The volume at rest in m³. One that is not positive or too small to be represented takes no part, as the
    /// slivers that cuts leave.
    pub rest_volume: f64,
    /// One over the bulk modulus, in 1/Pa, at least 0; 0 is incompressible.
    pub compliance: f64,
    /// Damping time in s, at least 0: the rate of change is resisted by this times the stiffness.
    pub damping: f64,
}

impl VolumeConstraint {
    /// The constraint of a tet with its corners at rest at `rest`.
    #[must_use]
    pub fn of_tet(particles: [u32; 4], rest: [DVec3; 4], compliance: f64) -> Self {
        let [a, b, c, d] = rest;
        Self {
            particles,
            rest_volume: (b - a).cross(c - a).dot(d - a) / 6.0,
            compliance,
            damping: 0.0,
        }
    }

    fn check(&self, index: usize) -> Result<(), XpbdError> {
        let refuse = |what, value, range| {
            Err(XpbdError::Constraint {
                index,
                what,
                value,
                range,
            })
        };
        if !self.rest_volume.is_finite() {
            return refuse("rest_volume", self.rest_volume, "finite");
        }
        for (what, value) in [("compliance", self.compliance), ("damping", self.damping)] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(what, value, "at least 0 and finite");
            }
        }
        Ok(())
    }
}

/// The same in the solver's precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TetVolume<R> {
    particles: [u32; 4],
    /// One over six times the volume at rest; 0 takes no part.
    per_six_volumes: R,
    /// Compliance over the volume at rest, in 1/J.
    compliance: R,
    damping: R,
}

impl<R: Float> TetVolume<R> {
    fn new(constraint: &VolumeConstraint) -> Self {
        let per_six = 1.0 / (6.0 * constraint.rest_volume);
        let compliance = constraint.compliance / constraint.rest_volume;
        let sound = constraint.rest_volume > 0.0
            && R::from_f64(per_six).is_finite()
            && R::from_f64(compliance).is_finite();
        Self {
            particles: constraint.particles,
            per_six_volumes: R::from_f64(if sound { per_six } else { 0.0 }),
            compliance: R::from_f64(if sound { compliance } else { 0.0 }),
            damping: R::from_f64(constraint.damping),
        }
    }

    /// All there is to know.
    pub(crate) fn data(&self) -> VolumeData<R> {
        VolumeData {
            particles: self.particles,
            per_six_volumes: self.per_six_volumes,
            compliance: self.compliance,
            damping: self.damping,
        }
    }
}

impl<R: Float> TetVolume<R> {
    /// The constraint in double precision.
    pub(crate) fn to_f64(self) -> TetVolume<f64> {
        TetVolume {
            particles: self.particles,
            per_six_volumes: self.per_six_volumes.to_f64(),
            compliance: self.compliance.to_f64(),
            damping: self.damping.to_f64(),
        }
    }
}

impl TetVolume<f64> {
    /// The square of the gradient at a corner of a regular tet of this volume at rest: one over the altitude squared.
    pub(crate) fn slope_squared(&self) -> f64 {
        // V = √3/8 h³.
        (0.75f64.sqrt() * 1.5 * self.per_six_volumes).cbrt().powi(2)
    }
}

impl<R: Float> Scalar<R, 4> for TetVolume<R> {
    #[inline]
    fn particles(&self) -> [u32; 4] {
        self.particles
    }

    #[inline]
    fn evaluate(&self, [a, b, c, d]: [R::Vector; 4]) -> Option<(R, [R::Vector; 4])> {
        let (e1, e2, e3) = (b - a, c - a, d - a);
        let scale = self.per_six_volumes;
        // Scaled before they are multiplied, so that tets of micrometers stay in the range of single precision.
        let g1 = R::cross(e2 * scale, e3);
        let g2 = R::cross(e3 * scale, e1);
        let g3 = R::cross(e1 * scale, e2);
        let value = R::dot(g1, e1) - R::ONE;
        (scale > R::ZERO).then_some((value, [-(g1 + g2 + g3), g1, g2, g3]))
    }

    #[inline]
    fn compliance(&self) -> R {
        self.compliance
    }

    #[inline]
    fn damping(&self) -> R {
        self.damping
    }

    #[inline]
    fn one_sided(&self) -> bool {
        false
    }
}

impl<R: Float> Solver<R> {
    /// Replaces all volume constraints; none at all takes neither memory nor time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`; where constraint `i` is that of tet `i`, the schedule of
    /// the tets fits. O(constraints).
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A flattened tet gets its volume back.
    /// ```
    /// use glam::{DVec3, dvec3};
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{Solver, StepSettings, VolumeConstraint};
    ///
    /// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// let mut solver = Solver::<f64>::new(&rest);
    /// (0..4).for_each(|p| solver.set_mass(p, 1.0));
    /// solver.set_position(3, dvec3(0.0, 0.0, 0.8));
    /// let order = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// solver.set_volumes(&[VolumeConstraint::of_tet([0, 1, 2, 3], rest, 0.0)], order)?;
    /// let settings = StepSettings { iterations: 5, ..StepSettings::new(0.016) };
    /// solver.step(&Schedule::default(), &settings)?;
    /// let [a, b, c, d] = [0, 1, 2, 3].map(|p| solver.position(p));
    /// assert!(((b - a).cross(c - a).dot(d - a) - 1.0).abs() < 1e-9);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_volumes(
        &mut self,
        constraints: &[VolumeConstraint],
        schedule: Schedule,
    ) -> Result<(), XpbdError> {
        let mut list = Vec::with_capacity(constraints.len());
        for (index, constraint) in constraints.iter().enumerate() {
            constraint.check(index)?;
            list.push(TetVolume::new(constraint));
        }
        let volumes = Constraints::new("volume", self.particle_count(), list, schedule)?;
        self.volume_constraints = (!constraints.is_empty()).then_some(volumes);
        self.note(|changes| changes.volumes = true);
        Ok(())
    }

    /// Number of volume constraints.
    #[must_use]
    pub fn volume_count(&self) -> usize {
        self.volume_constraints.as_ref().map_or(0, |v| v.list.len())
    }

    /// Gives the place of a volume constraint to another one; the place after the last appends it. The schedule has to
    /// follow: see [`Solver::reschedule_volumes`].
    ///
    /// # Errors
    /// A value outside its range; nothing has changed then.
    ///
    /// # Panics
    /// If there are no volume constraints, the place or a particle does not exist.
    pub fn put_volume(
        &mut self,
        place: usize,
        constraint: VolumeConstraint,
    ) -> Result<(), XpbdError> {
        constraint.check(place)?;
        self.check_particles(constraint.particles);
        let volumes = self.volume_constraints.as_mut();
        let volumes = volumes.expect("volume constraints are edited where there are some");
        volumes.put(place, TetVolume::new(&constraint));
        self.note(|changes| changes.volumes = true);
        Ok(())
    }

    /// Hangs a volume constraint on other particles that are copies of its own.
    ///
    /// # Panics
    /// If the constraint or a particle does not exist.
    pub fn relink_volume(&mut self, constraint: usize, particles: [u32; 4]) {
        self.check_particles(particles);
        let volumes = self.volume_constraints.as_mut();
        let volumes = volumes.expect("volume constraints are edited where there are some");
        volumes.list[constraint].particles = particles;
        self.note(|changes| changes.volumes = true);
    }

    /// Takes over the order of solving after edits; without volume constraints nothing happens. As with that of the
    /// tets, no two constraints of a color may share a particle ([`Schedule::check`]). O(constraints).
    ///
    /// # Panics
    /// If the schedule names a constraint that does not exist.
    pub fn reschedule_volumes(&mut self, schedule: &Schedule) {
        if let Some(volumes) = &mut self.volume_constraints {
            let last = schedule.order().max();
            assert!(
                last.is_none_or(|c| (c as usize) < volumes.list.len()),
                "the schedule belongs to these volume constraints"
            );
            volumes.schedule.clone_from(schedule);
            self.note(|changes| changes.volumes = true);
        }
    }
}
