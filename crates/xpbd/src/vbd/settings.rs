//! [`VbdSettings`]: settings of a frame of VBD.

use crate::{StepSettings, XpbdError};

/// Initial guess of a substep. It changes the number of iterations needed, not the solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// Free motion of the particles: exact in free fall. In an impact this lies inside a collider, and too few
    /// iterations add energy to a stiff body.
    #[default]
    Inertia,
    /// Free motion under the gravity that acted effectively in the last substep, between none and all of it: a body at
    /// rest starts at its position. Keeps the velocities of a substep.
    ///
    /// Each connected part of the body starts on the line from a safe start to that guess, where its potential is at
    /// most that of the safe start: its last position, or for a free part its rigid motion.
    ///
    /// With an accuracy, held parts also start nearer to their last position where that lowers the potential, if their
    /// kinetic energy is below the allowed error: an error left by a substep would otherwise come back twice as large
    /// in the next one.
    ///
    /// Source: Chen et al. 2024, section 3.7, for gravity.
    Adaptive,
}

/// Time integration of a substep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Integrator {
    /// Implicit Euler, first order: a vibration of period T loses a factor of `exp(-2 π² Δt / T)` in each period.
    #[default]
    ImplicitEuler,
    /// The backward differentiation formula of two steps (BDF2), second order and as stable: the factor is
    /// `exp(-4 π⁴ (Δt / T)³)`. Keeps three vectors a particle; costs a pass over the particles.
    ///
    /// The first substep, and each with another length than the one before, is one of implicit Euler. For a particle
    /// whose velocity was set or that touches a collider, constant velocity is assumed before.
    ///
    /// Source: Curtiss and Hirschfelder 1952; Hairer, Wanner 1996, section III.3.
    Bdf2,
}

/// Settings of one frame of VBD.
///
/// Unlike XPBD, VBD converges with `step.iterations` to the solution of the implicit substep, at any stiffness;
/// `step.substeps` then improve the accuracy in time. `step.relaxation` above 1 is over-relaxation.
#[derive(Clone, Debug, PartialEq)]
pub struct VbdSettings {
    /// Time, substeps, iterations (sweeps, or rounds of a sweep and a correction), relaxation, forces.
    pub step: StepSettings,
    /// Time integration of a substep.
    pub integrator: Integrator,
    /// Initial guess of the iterations.
    pub guess: Guess,
    /// Ends a substep before its last iteration once the force residual has fallen to this fraction of its value at
    /// the free motion. Costs [`crate::ImplicitStep::residual`] each iteration.
    pub tolerance: Option<f64>,
    /// Ends a substep of [`crate::Solver::step_vbd_two_level`] before its last iteration once the estimated error
    /// ([`crate::CoarseCorrectionReport::error`]) is at most this.
    pub accuracy: Option<f64>,
    /// Whether to report residual force and potential of the frame's last iterate. Costs
    /// [`crate::ImplicitStep::residual`] and [`crate::ImplicitStep::potential`] once a frame.
    pub measure: bool,
}

impl VbdSettings {
    /// Returns settings with one substep of `iterations` by implicit Euler, without forces.
    #[must_use]
    pub fn new(time_step: f64, iterations: u32) -> Self {
        Self {
            step: StepSettings {
                iterations,
                ..StepSettings::new(time_step)
            },
            integrator: Integrator::ImplicitEuler,
            guess: Guess::Inertia,
            tolerance: None,
            accuracy: None,
            measure: false,
        }
    }

    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        self.step.check()?;
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        if self.step.relaxation >= 2.0 {
            return refuse("relaxation", self.step.relaxation, "above 0 and below 2");
        }
        if let Some(value) = self.accuracy
            && !(value.is_finite() && value > 0.0)
        {
            return refuse("accuracy", value, "positive and finite");
        }
        match self.tolerance {
            Some(value) if !(value.is_finite() && value > 0.0) => {
                refuse("tolerance", value, "positive and finite")
            }
            _ => Ok(()),
        }
    }
}
