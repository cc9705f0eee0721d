//! [`StepSettings`]: how a frame is computed and which forces there are.

use glam::DVec3;

use crate::XpbdError;

/// How one frame is computed.
///
/// Accuracy is bought by `substeps`: more of them approach the true motion, while more `iterations` of a large step
/// approach something else (the projection leaves out part of the equations of motion). The number that decides is
/// [`crate::Solver::kappa`].
///
/// In single precision a substep can be too short: what moves a particle by less than half the last digit of its
/// position, 6e-8 of the body's size, is rounded away. Velocities are kept apart from positions, so a body in free fall
/// only starts late, once its speed times the substep exceeds that; but stresses so small are not corrected. At 9.81
/// m/s² a body of 1 m at rest notices gravity within a substep of 8e-5 s or longer. Use double precision below that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSettings {
    /// Time of a frame in s, positive.
    pub time_step: f64,
    /// Equal parts a frame is divided into, at least 1.
    pub substeps: u32,
    /// Passes over all constraints in a substep, at least 1.
    pub iterations: u32,
    /// Factor on each correction, above 0 and at most 2; 1 is none.
    pub relaxation: f64,
    /// Acceleration in m/s².
    pub gravity: Option<DVec3>,
    /// A floor.
    pub ground: Option<Ground>,
}

/// A horizontal floor that particles do not pass; up is z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Its height in m.
    pub height: f64,
    /// Coulomb's coefficient of friction, at least 0.
    pub friction: f64,
}

impl StepSettings {
    /// One substep of one iteration, no forces.
    #[must_use]
    pub fn new(time_step: f64) -> Self {
        Self {
            time_step,
            substeps: 1,
            iterations: 1,
            relaxation: 1.0,
            gravity: None,
            ground: None,
        }
    }

    /// The time of a substep in s.
    #[must_use]
    pub fn substep_time(&self) -> f64 {
        self.time_step / f64::from(self.substeps)
    }

    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        if !(self.time_step.is_finite() && self.time_step > 0.0) {
            return refuse("time_step", self.time_step, "positive and finite");
        }
        if self.substeps == 0 {
            return refuse("substeps", 0.0, "at least 1");
        }
        if self.iterations == 0 {
            return refuse("iterations", 0.0, "at least 1");
        }
        if !(self.relaxation > 0.0 && self.relaxation <= 2.0) {
            return refuse("relaxation", self.relaxation, "above 0 and at most 2");
        }
        if let Some(value) = self
            .gravity
            .and_then(|g| g.to_array().into_iter().find(|c| !c.is_finite()))
        {
            return refuse("gravity", value, "finite");
        }
        if let Some(ground) = self.ground {
            if !ground.height.is_finite() {
                return refuse("ground height", ground.height, "finite");
            }
            if !(ground.friction.is_finite() && ground.friction >= 0.0) {
                return refuse("ground friction", ground.friction, "at least 0 and finite");
            }
        }
        Ok(())
    }
}
