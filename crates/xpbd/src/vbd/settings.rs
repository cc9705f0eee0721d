//! [`VbdSettings`]: how a frame of VBD is computed.

use crate::{StepSettings, XpbdError};

/// Where the iterations of a substep start. It changes how many are needed, not where they lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// Where the particles would be if they were free: exact in free fall. In an impact that is inside of a collider, and
    /// too few iterations leave a stiff body with energy that it did not have.
    #[default]
    Inertia,
    /// Where free particles would be if gravity were what it seemed to be in the last substep, between none of it and
    /// all: a body that lies or hangs starts where it is. Keeps the velocities of a substep.
    ///
    /// Each connected part of the body then starts on the line from a safe start to that guess, where its potential is
    /// at most that of the safe start: where the part was, or moved rigidly with its momentum if nothing holds it.
    ///
    /// With an accuracy, parts of a body that something holds also start nearer to where they were, as far as that
    /// lowers the potential, if the energy of their motion is below the error allowed: what a substep leaves over would
    /// otherwise come back twice as large in the next one.
    ///
    /// Source: Chen et al. 2024, section 3.7, for gravity.
    Adaptive,
}

/// The rule by which a substep advances in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Integrator {
    /// Implicit Euler, first order: a vibration of period T loses a factor of `exp(-2 π² Δt / T)` in each period.
    #[default]
    ImplicitEuler,
    /// The backward differentiation formula of two steps (BDF2), second order and as stable: the factor is
    /// `exp(-4 π⁴ (Δt / T)³)`. Keeps three vectors a particle; costs a pass over the particles.
    ///
    /// The first substep, and each that has another length than the one before, is one of implicit Euler. A particle
    /// whose velocity was changed from outside or that touches a collider is taken to have moved steadily before.
    ///
    /// Source: Curtiss and Hirschfelder 1952; Hairer, Wanner 1996, section III.3.
    Bdf2,
}

/// How one frame of VBD is computed.
///
/// Unlike XPBD, VBD converges with `step.iterations` to the solution of the implicit substep, at any
/// stiffness; `step.substeps` then buy accuracy in time. `step.relaxation` above 1 is over-relaxation.
#[derive(Clone, Debug, PartialEq)]
pub struct VbdSettings {
    /// Time, substeps, iterations (sweeps, or rounds of a sweep and a correction), relaxation, forces.
    pub step: StepSettings,
    /// How a substep advances in time.
    pub integrator: Integrator,
    /// Where the iterations start.
    pub guess: Guess,
    /// Ends a substep before its last iteration once the force residual has fallen to this fraction of its value at
    /// the free motion. Costs [`crate::ImplicitStep::residual`] each iteration.
    pub tolerance: Option<f64>,
    /// Ends a substep of [`crate::Solver::step_vbd_two_level`] before its last iteration once the estimated error
    /// ([`crate::CoarseCorrectionReport::error`]) is at most this.
    pub accuracy: Option<f64>,
    /// Whether to report what the last iterate of the frame is worth. Costs [`crate::ImplicitStep::residual`] and
    /// [`crate::ImplicitStep::potential`] once a frame.
    pub measure: bool,
}

impl VbdSettings {
    /// One substep of `iterations` by implicit Euler, no forces.
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
