//! [`Solver::step`]: one frame of XPBD by colored Gauss-Seidel.
//!
//! Each substep moves the particles as if they were free, corrects them constraint by constraint in the order of the
//! schedule, and adds to the velocities what the corrections moved. Clusters of one color share no particle and run in
//! parallel; a color too small to be worth a second thread stays on one. Who computes never changes what is computed:
//! the result is the same to the bit for any number of threads, which is that of the rayon pool this is called in.
//!
//! Source: Macklin, Müller, Chentanez 2016; substeps after Macklin et al. 2019; paper section 3 and 4.1.
//! Cost: `substeps · iterations` passes over all tets.

use incise_graph::Schedule;
use rayon::prelude::*;

use crate::gauss_seidel::Pass;
use crate::real::{finite, load, store, weight};
use crate::{Ground, Real, Solver, StepSettings, XpbdError};

/// Particles a thread takes at a time.
const PARALLEL_PARTICLES: usize = 4096;

/// What a step has to say about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Particles that would have become infinite or NaN and were put back where they were instead, counted once for
    /// each substep. Anything but 0 means the step is not to be trusted: use more substeps.
    pub repaired: usize,
}

impl<R: Real> Solver<R> {
    /// Advances by one frame of `settings.time_step`.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    pub fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> Result<StepReport, XpbdError> {
        self.frame(schedule, settings, false)
    }

    /// The same, keeping what [`Solver::residuals`] needs from the last substep.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn step_keeping_residuals(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> Result<StepReport, XpbdError> {
        self.frame(schedule, settings, true)
    }

    fn frame(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        keep: bool,
    ) -> Result<StepReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step").entered();
        settings.check()?;
        if let Some(&tet) = schedule.order().iter().max() {
            assert!(
                (tet as usize) < self.tets.len(),
                "the schedule belongs to these tets"
            );
        }
        let mut report = StepReport::default();
        self.follow_body();
        self.predicted.clear();
        for substep in 0..settings.substeps {
            let keep = keep && substep + 1 == settings.substeps;
            report.repaired += self.substep(schedule, settings, keep);
        }
        Ok(report)
    }

    fn substep(&mut self, schedule: &Schedule, settings: &StepSettings, keep: bool) -> usize {
        let time = settings.substep_time();
        self.predict(settings, R::from_f64(time));
        let with_multipliers = keep || settings.iterations > 1;
        if with_multipliers {
            self.multipliers.clear();
            self.multipliers
                .resize_with(self.tets.len(), || [R::ZERO.cell(), R::ZERO.cell()]);
        }
        if keep {
            self.predicted = (0..self.particles.len()).map(|p| self.vector(p)).collect();
        }
        let pass = Pass {
            time_squared: R::from_f64(time * time),
            per_time: R::from_f64(1.0 / time),
            relaxation: R::from_f64(settings.relaxation),
        };
        let damped = self.materials.iter().any(|m| m.damping > 0.0);
        for _ in 0..settings.iterations {
            match (damped, with_multipliers) {
                (false, false) => self.pass::<false, false>(schedule, &pass),
                (false, true) => self.pass::<false, true>(schedule, &pass),
                (true, false) => self.pass::<true, false>(schedule, &pass),
                (true, true) => self.pass::<true, true>(schedule, &pass),
            }
            if let Some(ground) = settings.ground {
                self.project_to_ground(ground);
            }
        }
        self.update_velocities(R::from_f64(time), pass.per_time)
    }

    /// Moves every free particle by its velocity.
    fn predict(&mut self, settings: &StepSettings, time: R) {
        let change = settings
            .gravity
            .map(|g| R::from_dvec3(g * settings.substep_time()));
        let particles = self.particles.par_iter().with_min_len(PARALLEL_PARTICLES);
        particles
            .zip(&mut self.previous)
            .zip(&mut self.velocities)
            .for_each(|((particle, previous), velocity)| {
                let x = load::<R>(particle);
                *previous = x;
                if weight::<R>(particle) > R::ZERO {
                    if let Some(change) = change {
                        *velocity += change;
                    }
                    store::<R>(particle, x + *velocity * time);
                }
            });
    }

    /// Lifts particles out of the ground; friction holds them back by at most its share of the depth.
    fn project_to_ground(&self, ground: Ground) {
        let height = R::from_f64(ground.height - self.origin.z);
        let friction = R::from_f64(ground.friction);
        let particles = self.particles.par_iter().with_min_len(PARALLEL_PARTICLES);
        particles
            .zip(&self.previous)
            .for_each(|(particle, previous)| {
                let x = load::<R>(particle);
                let [a, b, c] = R::components(x);
                let depth = height - c;
                if !(depth > R::ZERO && weight::<R>(particle) > R::ZERO) {
                    return;
                }
                let [dx, dy, _] = R::components(x - *previous);
                let slide = (dx * dx + dy * dy).sqrt();
                let hold = friction * depth;
                let share = if slide > hold { hold / slide } else { R::ONE };
                store::<R>(particle, R::vector(a - dx * share, b - dy * share, height));
            });
    }

    /// Adds the corrections to the velocities; returns how many particles had to be put back.
    ///
    /// In exact numbers the velocity is the motion over the time. But positions are rounded, and a velocity taken from
    /// them would be wrong by their last digit over the time: in single precision a body in free fall would lose a
    /// hundredth of its speed, and far from the origin it would hang in the air. The prediction, computed again to the
    /// same bits, tells what part of the motion is correction; without correction the velocity stays as it is.
    fn update_velocities(&mut self, time: R, per_time: R) -> usize {
        let particles = self.particles.par_iter().with_min_len(PARALLEL_PARTICLES);
        particles
            .zip(&self.previous)
            .zip(&mut self.velocities)
            .map(|((particle, previous), velocity)| {
                if weight::<R>(particle) <= R::ZERO {
                    *velocity = R::Vector::default();
                    return 0;
                }
                let predicted = *previous + *velocity * time;
                let speed = *velocity + (load::<R>(particle) - predicted) * per_time;
                let finite = finite::<R>(speed);
                *velocity = if finite { speed } else { R::Vector::default() };
                if !finite {
                    store::<R>(particle, *previous);
                }
                usize::from(!finite)
            })
            .sum()
    }
}
