//! [`History`]: the history of each particle for BDF2, and the reduction of its substep to implicit Euler.
//!
//! BDF2 asks for `3 x₁ - 4 x₀ + x₋₁ = 2 Δt v₁` and the like for v. With `τ = 2 Δt / 3`, `w = (x₀ - x₋₁) / Δt` and
//! `x' = x₀ + w Δt / 3`, `v' = v₀ + (v₀ - v₋₁) / 3` that is `x₁ = x' + τ v₁` and `v₁ = v' + τ a₁`: an implicit Euler
//! substep of length τ from other positions and velocities. After it `w` becomes `(2 v₁ + w) / 3`, so no positions are
//! kept, whose rounding over a short substep would show.
//!
//! A substep without a history is split into [`STARTUP_SUBSTEPS`] substeps of implicit Euler: a single one would cost a
//! spinning body a part of `(ω Δt)²` of its angular momentum. Cost: a pass over the particles before and after each
//! substep; the first substep costs [`STARTUP_SUBSTEPS`] times as much.

use glam::DVec3;

use crate::Float;
use crate::float::{load, store, weight};
use crate::particles::Particles;

/// The velocities that BDF2 needs of earlier substeps, by particle.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct History<R: Float> {
    particles: Vec<Past<R>>,
    /// The length of the last substep in s.
    time: f64,
    /// The startup that the present substep belongs to, if any.
    startup: Option<Startup>,
}

/// Substeps of implicit Euler that replace a substep without a history.
const STARTUP_SUBSTEPS: u32 = 4;

/// The progress through the substeps of implicit Euler that begin a history.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Startup {
    count: u32,
    done: u32,
}

/// What is known of a particle at the end of a substep, in m/s.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Past<R: Float> {
    /// The mean velocity during the substep.
    mean: R::Vector,
    /// The velocity before it.
    before: R::Vector,
    /// The velocity after it, to see whether it was changed since.
    after: R::Vector,
}

impl<R: Float> Past<R> {
    /// That of a particle that moves steadily.
    fn steady(velocity: R::Vector) -> Self {
        Self {
            mean: velocity,
            before: velocity,
            after: velocity,
        }
    }
}

impl<R: Float> Default for History<R> {
    fn default() -> Self {
        Self {
            particles: Vec::new(),
            time: 0.0,
            startup: None,
        }
    }
}

impl<R: Float> History<R> {
    /// Bytes of the list.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.particles)
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.particles.clear();
    }

    /// The number of implicit Euler substeps that replace the next substep of length `time`: `None` if it has a
    /// history.
    pub(super) fn startup_substeps(&self, time: f64) -> Option<u32> {
        let has_history = !self.particles.is_empty() && self.time.to_bits() == time.to_bits();
        (!has_history).then_some(STARTUP_SUBSTEPS)
    }

    /// Begins a history: the next `count` substeps are implicit Euler and make up one of length `time`.
    pub(super) fn start(&mut self, particles: &Particles<R>, time: f64, count: u32) {
        (self.time, self.startup) = (time, Some(Startup { count, done: 0 }));
        self.particles.clear();
        let before = particles.velocities.iter().map(|&before| Past {
            mean: R::Vector::default(),
            before,
            after: before,
        });
        self.particles.extend(before);
    }

    /// Moves particles and velocities to where an implicit Euler substep starts that does what BDF2 does, and returns
    /// the length of that substep: 2/3 of `time`. Such a substep adds all of `time` times gravity to velocities, of
    /// which a third is taken off here.
    ///
    /// New particles, and those whose velocity was changed since, are taken to have moved steadily.
    pub(super) fn begin(
        &mut self,
        particles: &mut Particles<R>,
        time: f64,
        gravity: Option<DVec3>,
    ) -> f64 {
        let third = R::from_f64(1.0 / 3.0);
        let fall = R::from_dvec3(gravity.unwrap_or(DVec3::ZERO) * time);
        self.startup = None;
        self.particles.truncate(particles.len());
        let velocities = &particles.velocities[self.particles.len()..];
        self.particles
            .extend(velocities.iter().copied().map(Past::steady));
        let step = R::from_f64(time);
        for (p, past) in self.particles.iter_mut().enumerate() {
            let particle = &particles.cells[p];
            let velocity = &mut particles.velocities[p];
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
    pub(super) fn end(&mut self, particles: &Particles<R>, touches: impl Fn(R::Vector) -> bool) {
        let [one, two] = [1.0 / 3.0, 2.0 / 3.0].map(R::from_f64);
        // The part of a startup substep, and of the startup that has passed.
        let startup = self.startup.as_mut().map(|startup| {
            startup.done += 1;
            let part = |number: u32| R::from_f64(f64::from(number) / f64::from(startup.count));
            [part(1), part(startup.done)]
        });
        for (p, past) in self.particles.iter_mut().enumerate() {
            let velocity = particles.velocities[p];
            if touches(load::<R>(&particles.cells[p])) {
                *past = Past::steady(velocity);
                if let Some([_, passed]) = startup {
                    past.mean = velocity * passed;
                }
                continue;
            }
            past.after = velocity;
            past.mean = match startup {
                Some([part, _]) => past.mean + velocity * part,
                None => velocity * two + past.mean * one,
            };
        }
    }
}
