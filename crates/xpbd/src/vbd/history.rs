//! [`History`]: what BDF2 remembers of each particle, and how it turns a substep into one of implicit Euler.
//!
//! BDF2 asks for `3 x₁ - 4 x₀ + x₋₁ = 2 Δt v₁` and the like for v. With `τ = 2 Δt / 3`, `w = (x₀ - x₋₁) / Δt` and
//! `x' = x₀ + w Δt / 3`, `v' = v₀ + (v₀ - v₋₁) / 3` that is `x₁ = x' + τ v₁` and `v₁ = v' + τ a₁`: an implicit Euler substep
//! of length τ from other positions and velocities. After it `w` becomes `(2 v₁ + w) / 3`, so no positions are kept, whose
//! rounding over a short substep would show.
//!
//! Without a history a substep is made of [`PARTS`] shorter ones of implicit Euler. One of its whole length would take
//! `(ω Δt)²` of the angular momentum of a spinning body for good. Cost: a pass over the particles before and after each
//! substep, and a first substep that takes as long as some.

use glam::DVec3;

use crate::real::{load, store, weight};
use crate::{Real, Solver};

/// The velocities that BDF2 needs of earlier substeps, by particle.
#[derive(Clone, Debug)]
pub(super) struct History<R: Real> {
    particles: Vec<Past<R>>,
    /// The length of the last substep in s.
    time: f64,
    /// The implicit Euler substeps that the present one is made of, if it has no history.
    parts: Option<u32>,
}

/// Substeps of implicit Euler that one without a history is made of.
const PARTS: u32 = 4;

/// What is known of a particle at the end of a substep, in m/s.
#[derive(Clone, Copy, Debug)]
struct Past<R: Real> {
    /// The mean velocity during the substep.
    mean: R::Vector,
    /// The velocity before it.
    before: R::Vector,
    /// The velocity after it, to see whether it was changed since.
    after: R::Vector,
}

impl<R: Real> Past<R> {
    /// That of a particle that moves steadily.
    fn steady(velocity: R::Vector) -> Self {
        Self {
            mean: velocity,
            before: velocity,
            after: velocity,
        }
    }
}

impl<R: Real> Default for History<R> {
    fn default() -> Self {
        Self {
            particles: Vec::new(),
            time: 0.0,
            parts: None,
        }
    }
}

impl<R: Real> History<R> {
    /// Bytes of the list.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.particles)
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.particles.clear();
    }

    /// How many substeps of implicit Euler the next substep of a length is made of, if it has no history.
    pub(super) fn parts(&self, time: f64) -> Option<u32> {
        let has_history = !self.particles.is_empty() && self.time.to_bits() == time.to_bits();
        (!has_history).then_some(PARTS)
    }

    /// Begins a history with so many substeps of implicit Euler, the first of which is next.
    pub(super) fn start(&mut self, solver: &Solver<R>, time: f64, parts: u32) {
        (self.time, self.parts) = (time, Some(parts));
        self.particles.clear();
        let before = solver.velocities.iter().map(|&before| Past {
            mean: R::Vector::default(),
            before,
            after: before,
        });
        self.particles.extend(before);
    }

    /// Moves particles and velocities to where an implicit Euler substep starts that does what BDF2 does, and returns the
    /// length of that substep: 2/3 of `time`. Such a substep adds all of `time` times gravity to velocities, of which a
    /// third is taken off here.
    ///
    /// New particles, and those whose velocity was changed since, are taken to have moved steadily.
    pub(super) fn begin(
        &mut self,
        solver: &mut Solver<R>,
        time: f64,
        gravity: Option<DVec3>,
    ) -> f64 {
        let third = R::from_f64(1.0 / 3.0);
        let fall = R::from_dvec3(gravity.unwrap_or(DVec3::ZERO) * time);
        self.parts = None;
        self.particles.truncate(solver.particle_count());
        let velocities = &solver.velocities[self.particles.len()..];
        self.particles
            .extend(velocities.iter().copied().map(Past::steady));
        let step = R::from_f64(time);
        for (p, past) in self.particles.iter_mut().enumerate() {
            let particle = &solver.particles[p];
            let velocity = &mut solver.velocities[p];
            if R::components(past.after) != R::components(*velocity) {
                *past = Past::steady(*velocity);
            }
            store::<R>(particle, load::<R>(particle) + past.mean * (step * third));
            let before = std::mem::replace(&mut past.before, *velocity);
            if weight::<R>(particle) > R::ZERO {
                *velocity = *velocity + (*velocity - before) * third - fall * third;
            }
        }
        2.0 / 3.0 * time
    }

    /// Takes in the velocities after a substep; what `touches` a collider moves steadily from then on.
    pub(super) fn end(&mut self, solver: &Solver<R>, touches: impl Fn(R::Vector) -> bool) {
        let [one, two] = [1.0 / 3.0, 2.0 / 3.0].map(R::from_f64);
        let share = self.parts.map(|parts| R::from_f64(1.0 / f64::from(parts)));
        for (p, past) in self.particles.iter_mut().enumerate() {
            let velocity = solver.velocities[p];
            if touches(load::<R>(&solver.particles[p])) {
                *past = Past::steady(velocity);
                continue;
            }
            past.after = velocity;
            past.mean = match share {
                Some(share) => past.mean + velocity * share,
                None => velocity * two + past.mean * one,
            };
        }
    }
}
