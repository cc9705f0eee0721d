//! Damping of strain rates, on velocities, after the constraints of a substep are solved.
//!
//! The dissipation of a tet is `τ V (μ |D|² + λ/2 tr²)` with `D = sym(Fᵀ Ḟ)` and `tr = cof F : Ḟ`: a Kelvin-Voigt
//! viscosity of τ times the stiffness, in Rayleigh's terms the part `β = τ` proportional to stiffness. It is 0 where
//! nothing moves, so no equilibrium moves, and 0 for rotations of the whole. A vibration of angular frequency ω is damped
//! by the fraction `τ ω / 2` of critical, in shear and in volume alike.
//!
//! One colored pass changes the velocities of each tet by two implicit steps, of the volume part exactly and of the
//! shear part along its force. Neither raises the kinetic energy, whatever τ, substep and stiffness. Where `τ / Δt` times
//! kappa exceeds about 1 the second one damps less than asked.
//!
//! Source: Kelvin-Voigt model; implicit steps derived in [`crate::simd_kernel`]. Cost: about a pass over the tets a
//! substep, and a copy of the velocities; nothing without a damped material.

use crate::gauss_seidel;
use crate::simd_kernel::Pass;
use crate::step::Factors;
use crate::{Float, Solver};

impl<R: Float> Solver<R> {
    /// Damps the velocities of a substep.
    pub(crate) fn damp(&mut self, factors: &Factors<R>) {
        let mut shared = std::mem::take(&mut self.shared_velocities);
        shared.clear();
        let cells = self.velocities.iter().zip(&self.particles);
        shared.extend(cells.map(|(&velocity, particle)| {
            let [x, y, z] = R::components(velocity);
            let [.., weight] = R::read(particle);
            R::particle([x, y, z, weight])
        }));
        let pass = Pass {
            layout: &self.layout,
            particles: &self.particles,
            velocities: &shared,
            multipliers: &[],
            corrections: &[],
            iterated: false,
            factors: *factors,
        };
        gauss_seidel::damp(self.level, &pass);
        for (velocity, cell) in self.velocities.iter_mut().zip(&shared) {
            let [x, y, z, _] = R::read(cell);
            *velocity = R::vector(x, y, z);
        }
        self.shared_velocities = shared;
    }
}
