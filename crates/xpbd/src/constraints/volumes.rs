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

use super::scalar::{ScalarConstraint, ScalarConstraints};
use crate::{Float, XpbdError};

/// Volume constraint of the tet that four particles span. See [`crate::Solver::set_volumes`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeConstraint {
    /// The corners, as those of a tet.
    pub particles: [u32; 4],
    /// Volume at rest in m³. A constraint whose rest volume is not positive or too small to be represented, as for
    /// slivers of cuts, takes no part.
    pub rest_volume: f64,
    /// One over the bulk modulus, in 1/Pa, at least 0; 0 is incompressible.
    pub compliance: f64,
    /// Damping time in s, at least 0: the rate of change is resisted by this times the stiffness.
    pub damping: f64,
}

impl VolumeConstraint {
    /// Creates the constraint of a tet with its corners at rest at `rest`.
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

    /// Checks that each value lies in its range.
    pub(crate) fn check(&self, index: usize) -> Result<(), XpbdError> {
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

/// A volume constraint as plain numbers for a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeData<R> {
    /// Its particles.
    pub particles: [u32; 4],
    /// One over six times the volume at rest in 1/m³; 0 takes no part.
    pub per_six_volumes: R,
    /// Compliance over the volume at rest in 1/J.
    pub compliance: R,
    /// Damping time in s.
    pub damping: R,
}

/// All volume constraints.
pub(crate) type Volumes<R> = ScalarConstraints<R, TetVolume<R>, 4>;

/// A volume constraint in the solver's precision.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TetVolume<R> {
    pub(crate) particles: [u32; 4],
    /// One over six times the volume at rest; 0 takes no part.
    per_six_volumes: R,
    /// Compliance over the volume at rest, in 1/J.
    compliance: R,
    damping: R,
}

impl<R: Float> TetVolume<R> {
    pub(crate) fn new(constraint: &VolumeConstraint) -> Self {
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

impl<R: Float> ScalarConstraint<R, 4> for TetVolume<R> {
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
