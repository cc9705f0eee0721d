//! [`Solver::step_vbd`] and [`ImplicitStep`]: a frame of VBD, and a single substep in parts.

use super::constraints::SWEEP_PENALTY;
use super::{Guess, Integrator, VbdSettings, VertexStars};
use crate::constraints::Constraints;
use crate::{Float, Solver, StepReport, StepSettings, XpbdError};

/// Report of a frame of VBD.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VbdReport {
    /// Number of particles that were put back, see [`StepReport::repaired`].
    pub repaired: usize,
    /// Number of iterations over all substeps.
    pub iterations: u32,
    /// Force residual at the end of the last substep as a fraction of that at the free motion; only with a tolerance.
    pub residual: Option<f64>,
    /// Largest error after the last correction of a substep, see [`crate::CoarseCorrectionReport::error`]; only with
    /// coarse corrections.
    pub error: Option<f64>,
    /// [`ImplicitStep::residual`] in N at the end of the frame, if measured.
    pub force: Option<f64>,
    /// [`ImplicitStep::potential`] in J at the end of the frame, if measured.
    pub potential: Option<f64>,
}

impl<R: Float> Solver<R> {
    /// A frame of sweeps alone.
    pub(crate) fn frame_of_sweeps(
        &mut self,
        stars: &mut VertexStars<R>,
        settings: &VbdSettings,
    ) -> Result<VbdReport, XpbdError> {
        self.frame_of_vbd(stars, settings, SWEEP_PENALTY, |step| {
            step.sweep();
            true
        })
    }

    /// A frame in which a substep ends early when `iterate` says that it has no more to give.
    pub(super) fn frame_of_vbd(
        &mut self,
        stars: &mut VertexStars<R>,
        settings: &VbdSettings,
        penalty: f64,
        mut iterate: impl FnMut(&mut ImplicitStep<'_, R>) -> bool,
    ) -> Result<VbdReport, XpbdError> {
        settings.check()?;
        if self.constraints.contacts.is_declared() {
            return Err(XpbdError::ContactMethod { method: "vbd" });
        }
        if self.constraints.blades.count() > 0 {
            return Err(XpbdError::BladeMethod { method: "vbd" });
        }
        self.recenter();
        let mut meter = self.stepper.meter.take();
        if let Some(meter) = &mut meter {
            meter.start(&self.particles, &self.constraints, &settings.step);
        }
        let mut report = VbdReport::default();
        let (count, time) = (settings.step.substeps, settings.step.substep_time());
        for number in 1..=count {
            let is_bdf2 = settings.integrator == Integrator::Bdf2;
            let startup = stars.history.startup_substeps(time).filter(|_| is_bdf2);
            if let Some(parts) = startup {
                stars.history.start(&self.particles, time, parts);
            }
            let parts = startup.unwrap_or(1);
            for part in 1..=parts {
                let substep = Substep {
                    number: (number - 1) * parts + part,
                    count: count * parts,
                    is_startup: startup.is_some(),
                };
                if let Some(meter) = &mut meter {
                    meter.begin(&self.particles);
                }
                let mut step = ImplicitStep::predicted(self, stars, settings, penalty, substep);
                step.run(settings, &mut report, &mut iterate);
                report.error = match (report.error, step.error) {
                    (Some(a), Some(b)) => Some(a.max(b)),
                    (a, b) => a.or(b),
                };
                let own_time = step.settings.substep_time();
                if let Some(meter) = &mut meter {
                    step.measure(meter);
                }
                report.repaired += step.finish().repaired;
                if let Some(meter) = &mut meter {
                    meter.end(&self.particles, settings.step.gravity, own_time);
                }
            }
        }
        self.stepper.meter = meter;
        Ok(report)
    }
}

/// A substep of a frame of `count` equal ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Substep {
    /// From 1.
    number: u32,
    count: u32,
    /// True for the implicit Euler substeps that begin a history of BDF2.
    is_startup: bool,
}

/// One substep of VBD between its prediction and its end, for callers that control or observe its convergence.
///
/// The positions of the solver are the iterate. Velocities are updated only by [`ImplicitStep::finish`]; a step dropped
/// before that leaves velocities that do not belong to the positions.
#[derive(Debug)]
#[must_use = "velocities follow in `finish`"]
pub struct ImplicitStep<'a, R: Float> {
    pub(super) solver: &'a mut Solver<R>,
    pub(super) stars: &'a mut VertexStars<R>,
    pub(super) settings: StepSettings,
    /// Whether the frame ends with it.
    last: bool,
    /// The Δt of the implicit Euler substep that is solved; BDF2 makes it 2/3 of the substep, or less at the start.
    pub(super) time: R,
    integrator: Integrator,
    /// The error at which it may end.
    pub(super) accuracy: Option<f64>,
    /// What the last coarse correction left over.
    pub(super) error: Option<f64>,
    /// Held particles that could not follow their handle.
    lost: usize,
}

impl<'a, R: Float> ImplicitStep<'a, R> {
    /// Begins the last substep of a frame: moves the particles to the initial guess, and handles to their target poses.
    ///
    /// # Errors
    /// If the settings do not pass [`VbdSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the stars have another number of particles, tets or constraints.
    pub fn new(
        solver: &'a mut Solver<R>,
        stars: &'a mut VertexStars<R>,
        settings: &VbdSettings,
    ) -> Result<Self, XpbdError> {
        settings.check()?;
        let (count, time) = (settings.step.substeps, settings.step.substep_time());
        let is_startup = stars.history.startup_substeps(time).is_some();
        if is_startup {
            stars.history.start(&solver.particles, time, 1);
        }
        let substep = Substep {
            number: count,
            count,
            is_startup,
        };
        Ok(Self::predicted(
            solver,
            stars,
            settings,
            SWEEP_PENALTY,
            substep,
        ))
    }

    pub(super) fn predicted(
        solver: &'a mut Solver<R>,
        stars: &'a mut VertexStars<R>,
        settings: &VbdSettings,
        penalty: f64,
        substep: Substep,
    ) -> Self {
        assert!(
            stars.data.fits(solver),
            "the stars belong to these particles, tets and constraints"
        );
        let own = StepSettings {
            substeps: substep.count,
            ..settings.step.clone()
        };
        let own_time = own.substep_time();
        let implicit_time = match settings.integrator {
            Integrator::ImplicitEuler => {
                stars.history.clear();
                own_time
            }
            Integrator::Bdf2 if substep.is_startup => own_time,
            Integrator::Bdf2 => {
                let particles = &mut solver.particles;
                stars.history.begin(particles, own_time, own.gravity)
            }
        };
        let time = R::from_f64(implicit_time);
        let gravity = own.gravity.map(|g| R::from_dvec3(g * own_time));
        solver.particles.predict(gravity, time, true);
        let ended = f64::from(substep.number) / f64::from(substep.count);
        let Constraints {
            attachments,
            colliders,
            ..
        } = &mut solver.constraints;
        let lost = attachments.move_rigid_attachments(&solver.particles, ended);
        colliders.place(&own, ended * own.time_step, solver.particles.origin, 0.0);
        stars.begin(solver, implicit_time, penalty);
        let mut step = Self {
            solver,
            stars,
            last: substep.number == substep.count,
            settings: own,
            time,
            integrator: settings.integrator,
            accuracy: settings.accuracy,
            error: None,
            lost,
        };
        if settings.guess == Guess::Adaptive {
            step.start(settings.accuracy);
        }
        step
    }

    /// Iterates until the settings or the tolerance say that it is enough, then measures if asked to.
    pub(super) fn run(
        &mut self,
        settings: &VbdSettings,
        report: &mut VbdReport,
        mut iterate: impl FnMut(&mut Self) -> bool,
    ) {
        let start = settings.tolerance.map(|_| self.free_residual());
        for _ in 0..settings.step.iterations {
            let more = iterate(self);
            self.update_multipliers();
            report.iterations += 1;
            if let (Some(tolerance), Some(start)) = (settings.tolerance, start) {
                let residual = self.residual();
                report.residual = Some(if start > 0.0 {
                    residual / start
                } else {
                    residual
                });
                if residual <= tolerance * start {
                    break;
                }
            }
            if !more {
                break;
            }
        }
        if settings.measure && self.last {
            report.force = Some(self.residual());
            report.potential = Some(self.potential());
        }
    }

    /// Updates the multipliers of hard constraints to their forces at the present positions, as [`Solver::step_vbd`]
    /// does after each iteration; no effect without hard constraints. It changes potential and forces, which are zero
    /// only where the constraints are met as well.
    pub fn update_multipliers(&mut self) {
        self.stars.data.constraints.update_multipliers(self.solver);
    }

    /// Ends the substep: computes velocities from the motion.
    pub fn finish(self) -> StepReport {
        let per_time = R::ONE / self.time;
        let Solver {
            particles,
            constraints,
            ..
        } = self.solver;
        let repaired = particles.update_velocities(self.time, per_time, true);
        constraints
            .attachments
            .update_rigid_attachments(particles, per_time);
        if self.integrator == Integrator::Bdf2 {
            let touches = |x| constraints.colliders.touches(x);
            self.stars.history.end(particles, touches);
        }
        if self.last {
            constraints.end_frame();
        }
        StepReport {
            repaired: repaired + self.lost,
            jittered: 0,
        }
    }
}
