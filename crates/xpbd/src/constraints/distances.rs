//! [`DistanceConstraint`]: springs, rods and threads between two particles.
//!
//! The constraint is `C = |a - b| - length` with the energy `C² / (2 · compliance)`. A thread pulls but does not push.
//!
//! Source: Macklin, Müller, Chentanez 2016. Cost: 60 operations a distance.

use super::scalar::{ScalarConstraint, ScalarConstraints};
use crate::direction::direction;
use crate::{Float, XpbdError};

/// Distance constraint between two particles: a spring, a rod or a thread. See [`crate::Solver::set_distances`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DistanceConstraint {
    /// The two particles.
    pub particles: [u32; 2],
    /// Distance at rest in m, at least 0.
    pub length: f64,
    /// One over the stiffness in m/N, at least 0; 0 is a rod.
    pub compliance: f64,
    /// Damping time in s, at least 0: the rate of change is resisted by this times the stiffness. No effect on a rod,
    /// whose rate of change is 0.
    pub damping: f64,
    /// Whether it acts only while the particles are farther apart than `length`, as a thread does.
    pub tension_only: bool,
}

impl DistanceConstraint {
    /// Checks that each value lies in its range.
    pub(crate) fn check(&self, index: usize) -> Result<(), XpbdError> {
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

/// A distance constraint as plain numbers for a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceData<R> {
    /// Its particles.
    pub particles: [u32; 2],
    /// Distance at rest in m.
    pub length: R,
    /// Compliance in m/N.
    pub compliance: R,
    /// Damping time in s.
    pub damping: R,
    /// Whether it acts only while the particles are farther apart.
    pub tension_only: bool,
}

/// All distance constraints.
pub(crate) type Distances<R> = ScalarConstraints<R, Distance<R>, 2>;

/// A distance constraint in the solver's precision.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Distance<R> {
    particles: [u32; 2],
    length: R,
    compliance: R,
    damping: R,
    tension_only: bool,
}

impl<R: Float> Distance<R> {
    pub(crate) fn new(constraint: &DistanceConstraint) -> Self {
        Self {
            particles: constraint.particles,
            length: R::from_f64(constraint.length),
            compliance: R::from_f64(constraint.compliance),
            damping: R::from_f64(constraint.damping),
            tension_only: constraint.tension_only,
        }
    }

    /// All there is to know.
    pub(crate) fn data(&self) -> DistanceData<R> {
        DistanceData {
            particles: self.particles,
            length: self.length,
            compliance: self.compliance,
            damping: self.damping,
            tension_only: self.tension_only,
        }
    }

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
            tension_only: self.tension_only,
        }
    }
}

impl<R: Float> ScalarConstraint<R, 2> for Distance<R> {
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
        self.tension_only
    }
}
