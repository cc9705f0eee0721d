//! [`VbdSettings`]: how a frame of VBD is computed.

use crate::{StepSettings, XpbdError};

/// Where the iterations of a substep start. It changes how many are needed, not where they lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// Where the particles would be if they were free: exact in free fall.
    #[default]
    Inertia,
    /// As if gravity were what it seemed to be in the last substep, between none of it and all: a body that lies or
    /// hangs starts where it is. Keeps the velocities of a substep.
    ///
    /// Source: Chen et al. 2024, section 3.7.
    Adaptive,
}

/// How one frame of VBD is computed.
///
/// Unlike XPBD, VBD converges with `step.iterations` to the backward Euler solution of the substep, at any
/// stiffness; `step.substeps` then buy accuracy in time. `step.relaxation` above 1 is over-relaxation.
#[derive(Clone, Debug, PartialEq)]
pub struct VbdSettings {
    /// Time, substeps, iterations (sweeps, or rounds of a sweep and a correction), relaxation, forces.
    pub step: StepSettings,
    /// Where the iterations start.
    pub guess: Guess,
    /// Ends a substep before its last iteration once the force residual has fallen to this fraction of its value at
    /// the free motion. Costs [`crate::ImplicitStep::residual`] each iteration.
    pub tolerance: Option<f64>,
    /// Whether to report what the last iterate of the frame is worth. Costs [`crate::ImplicitStep::residual`] and
    /// [`crate::ImplicitStep::potential`] once a frame.
    pub measure: bool,
}

impl VbdSettings {
    /// One substep of `iterations`, no forces.
    #[must_use]
    pub fn new(time_step: f64, iterations: u32) -> Self {
        Self {
            step: StepSettings {
                iterations,
                ..StepSettings::new(time_step)
            },
            guess: Guess::Inertia,
            tolerance: None,
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
        match self.tolerance {
            Some(value) if !(value.is_finite() && value > 0.0) => {
                refuse("tolerance", value, "positive and finite")
            }
            _ => Ok(()),
        }
    }
}
