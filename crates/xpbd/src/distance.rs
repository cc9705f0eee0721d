//! [`DistanceConstraint`]: springs, rods and threads between two particles.
//!
//! The constraint is `C = |a - b| - length` with the energy `C² / (2 · compliance)`. A thread pulls but does not push.
//!
//! Source: Macklin, Müller, Chentanez 2016. Cost: 60 operations a distance.

use incise_graph::Schedule;

use crate::direction::direction;
use crate::scalar::{Constraints, Scalar};
use crate::{DistanceData, Float, Solver, XpbdError};

/// Keeps two particles at a distance. See [`Solver::set_distances`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceConstraint {
    /// The two particles.
    pub particles: [u32; 2],
    /// Their distance at rest in m, at least 0.
    pub length: f64,
    /// One over the stiffness in m/N, at least 0; 0 is a rod.
    pub compliance: f64,
    /// Damping time in s, at least 0: the rate of change is resisted by this times the stiffness. A rod's own rate is
    /// already held at 0, so there it does nothing.
    pub damping: f64,
    /// Whether it acts only while the particles are farther apart than `length`, as a thread does.
    pub only_when_longer: bool,
}

impl DistanceConstraint {
    fn check(&self, index: usize) -> Result<(), XpbdError> {
        for (what, value) in [
            ("length", self.length),
            ("compliance", self.compliance),
            ("damping", self.damping),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(XpbdError::Constraint {
                    index,
                    what,
                    value,
                    range: "at least 0 and finite",
                });
            }
        }
        Ok(())
    }
}

/// The same in the solver's precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance<R> {
    particles: [u32; 2],
    length: R,
    compliance: R,
    damping: R,
    only_when_longer: bool,
}

impl<R: Float> Distance<R> {
    /// All there is to know.
    pub(crate) fn data(&self) -> DistanceData<R> {
        DistanceData {
            particles: self.particles,
            length: self.length,
            compliance: self.compliance,
            damping: self.damping,
            only_when_longer: self.only_when_longer,
        }
    }
}

impl<R: Float> Distance<R> {
    /// The distance at rest.
    #[inline]
    pub(crate) fn length(&self) -> R {
        self.length
    }

    /// The constraint in double precision.
    pub(crate) fn to_f64(self) -> Distance<f64> {
        Distance {
            particles: self.particles,
            length: self.length.to_f64(),
            compliance: self.compliance.to_f64(),
            damping: self.damping.to_f64(),
            only_when_longer: self.only_when_longer,
        }
    }
}

impl<R: Float> Scalar<R, 2> for Distance<R> {
    #[inline]
    fn particles(&self) -> [u32; 2] {
        self.particles
    }

    /// Without a direction while both particles coincide; then it waits for others to part them.
    #[inline]
    fn evaluate(&self, [a, b]: [R::Vector; 2]) -> Option<(R, [R::Vector; 2])> {
        let (length, along) = direction::<R>(a - b)?;
        Some((length - self.length, [along, -along]))
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
        self.only_when_longer
    }
}

impl<R: Float> Solver<R> {
    /// Replaces all distance constraints; none at all takes neither memory nor time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`, which a coloring of any kind may have made. O(constraints).
    ///
    /// A cut leaves them on their particles: what is copied does not take its springs along.
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A kilogram on a spring of 10 N/m stretches it by `m g` times the compliance.
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{DistanceConstraint, Solver, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::NEG_Z]);
    /// solver.set_mass(1, 1.0); // the other one has none and stays
    /// let spring = DistanceConstraint {
    ///     particles: [0, 1],
    ///     length: 1.0,
    ///     compliance: 0.1,
    ///     damping: 0.2,
    ///     only_when_longer: false,
    /// };
    /// let order = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// solver.set_distances(&[spring], order)?;
    /// let gravity = Some(DVec3::NEG_Z * 9.81);
    /// let settings = StepSettings { substeps: 4, gravity, ..StepSettings::new(0.016) };
    /// for _ in 0..1000 {
    ///     solver.step(&Schedule::default(), &settings)?;
    /// }
    /// assert!((solver.position(1).z + 1.0 + 9.81 * 0.1).abs() < 1e-6);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_distances(
        &mut self,
        constraints: &[DistanceConstraint],
        schedule: Schedule,
    ) -> Result<(), XpbdError> {
        let mut list = Vec::with_capacity(constraints.len());
        for (index, constraint) in constraints.iter().enumerate() {
            constraint.check(index)?;
            list.push(Distance {
                particles: constraint.particles,
                length: R::from_f64(constraint.length),
                compliance: R::from_f64(constraint.compliance),
                damping: R::from_f64(constraint.damping),
                only_when_longer: constraint.only_when_longer,
            });
        }
        let distances = Constraints::new("distance", self.particle_count(), list, schedule)?;
        self.distances = (!constraints.is_empty()).then_some(distances);
        self.note(|changes| changes.distances = true);
        Ok(())
    }

    /// Number of distance constraints.
    #[must_use]
    pub fn distance_count(&self) -> usize {
        self.distances.as_ref().map_or(0, |d| d.list.len())
    }
}
