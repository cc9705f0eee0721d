//! [`Jacobi`]: data of an iteration that corrects all constraints from one set of positions, and its extrapolation.
//!
//! Corrections are summed color by color, so that no two threads add to one particle at once and every sum has a fixed
//! order. Chebyshev's semi-iteration then extrapolates along the line through the iterate before last:
//! `x ← x̂ + (ω - 1) (x̂ - x⁻)` with x̂ the Jacobi iterate and x⁻ the one before last. In this form ω = 1 is Jacobi to the
//! bit. Multipliers are extrapolated in the same way, so that they match the positions.
//!
//! Source: Wang 2015, algorithm 1, for the extrapolation; paper section 5.3 for the comparison.
//! Cost: that of a Gauss-Seidel pass, a pass over the particles, and with Chebyshev two more copies of the state.

use crate::Float;
use crate::float::{load, store};

/// The state of Jacobi iterations within a substep.
#[derive(Debug)]
pub(crate) struct Jacobi<R: Float> {
    /// What the constraints want to move each particle by.
    pub(crate) corrections: Vec<R::Particle>,
    /// The last two iterates; empty without extrapolation.
    last: Iterate<R>,
    before: Iterate<R>,
    /// Iterations made in this substep.
    made: u32,
    /// The weight ω.
    weight: f64,
}

#[derive(Debug, Default)]
struct Iterate<R: Float> {
    positions: Vec<R::Vector>,
    multipliers: Vec<[R; 4]>,
}

impl<R: Float> Default for Jacobi<R> {
    fn default() -> Self {
        Self {
            corrections: Vec::new(),
            last: Iterate::default(),
            before: Iterate::default(),
            made: 0,
            weight: 1.0,
        }
    }
}

impl<R: Float> Jacobi<R> {
    /// Begins a substep.
    pub(crate) fn restart(&mut self) {
        self.made = 0;
        self.weight = 1.0;
    }

    /// Begins an iteration.
    pub(crate) fn begin(
        &mut self,
        particles: &[R::Particle],
        multipliers: &[R::Particle],
        extrapolating: bool,
    ) {
        let nothing = || R::particle([R::ZERO; 4]);
        self.corrections.clear();
        self.corrections.resize_with(particles.len(), nothing);
        if extrapolating {
            self.last.positions.clear();
            self.last.positions.extend(particles.iter().map(load::<R>));
            self.last.multipliers.clear();
            self.last
                .multipliers
                .extend(multipliers.iter().map(R::read));
        }
    }

    /// Moves the particles by the gathered corrections.
    pub(crate) fn apply(&self, particles: &[R::Particle]) {
        for (particle, correction) in particles.iter().zip(&self.corrections) {
            store::<R>(particle, load::<R>(particle) + load::<R>(correction));
        }
    }

    /// Leaps ahead, once `chebyshev_start` iterations have been made.
    pub(crate) fn extrapolate(
        &mut self,
        particles: &[R::Particle],
        multipliers: &[R::Particle],
        spectral_radius: f64,
        chebyshev_start: u32,
    ) {
        self.made += 1;
        if self.made > chebyshev_start {
            let square = spectral_radius * spectral_radius;
            self.weight = if self.made == chebyshev_start + 1 {
                2.0 / (2.0 - square)
            } else {
                4.0 / (4.0 - square * self.weight)
            };
            let further = R::from_f64(self.weight) - R::ONE;
            for (particle, &before) in particles.iter().zip(&self.before.positions) {
                let now = load::<R>(particle);
                store::<R>(particle, now + (now - before) * further);
            }
            for (multiplier, &before) in multipliers.iter().zip(&self.before.multipliers) {
                let now = R::read(multiplier);
                let leap = |k: usize| now[k] + (now[k] - before[k]) * further;
                R::write(multiplier, std::array::from_fn(leap));
            }
        }
        std::mem::swap(&mut self.last, &mut self.before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Chebyshev polynomial of degree k.
    fn chebyshev(k: u32, x: f64) -> f64 {
        let (mut before, mut last) = (1.0, x);
        for _ in 0..k {
            (before, last) = (last, 2.0 * x * last - before);
        }
        before
    }

    /// On the iteration `x̂ = r x`, for which this is made, k steps leave `T_k(r / ρ) / T_k(1 / ρ)` of the start.
    #[test]
    fn extrapolation_makes_chebyshev_polynomials() {
        let radius = 0.9;
        for r in [0.9, 0.5, 0.1, 0.0, -0.3, -0.9] {
            let particles = [f64::particle([1.0, 2.0, 0.0, 1.0])];
            let multipliers = [f64::particle([0.0, 0.0, 3.0, 0.0])];
            let mut jacobi = Jacobi::<f64>::default();
            jacobi.restart();
            for k in 1..=30 {
                jacobi.begin(&particles, &multipliers, true);
                let [x, y, z, w] = f64::read(&particles[0]);
                f64::write(&particles[0], [r * x, r * y, r * z, w]);
                let [.., multiplier, _] = f64::read(&multipliers[0]);
                f64::write(&multipliers[0], [0.0, 0.0, r * multiplier, 0.0]);
                jacobi.extrapolate(&particles, &multipliers, radius, 1);
                let left = chebyshev(k, r / radius) / chebyshev(k, 1.0 / radius);
                let [x, y, _, w] = f64::read(&particles[0]);
                let [.., multiplier, _] = f64::read(&multipliers[0]);
                for (value, start) in [(x, 1.0), (y, 2.0), (multiplier, 3.0)] {
                    assert!((value - start * left).abs() < 1e-12, "{r}, {k}: {value}");
                }
                assert_eq!(w, 1.0);
            }
        }
    }

    #[test]
    fn a_delay_leaves_the_first_iterations_alone() {
        let particles = [f64::particle([1.0, 0.0, 0.0, 1.0])];
        let mut jacobi = Jacobi::<f64>::default();
        for _ in 0..5 {
            jacobi.begin(&particles, &[], true);
            let [x, ..] = f64::read(&particles[0]);
            f64::write(&particles[0], [0.5 * x, 0.0, 0.0, 1.0]);
            jacobi.extrapolate(&particles, &[], 0.9, 5);
        }
        assert_eq!(f64::read(&particles[0])[0], 1.0 / 32.0);
    }
}
