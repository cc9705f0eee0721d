//! [`Damping`] of strain rates, on velocities, after the constraints of a substep are solved.
//!
//! The dissipation of a tet is `τ V (μ |D|² + λ/2 tr²)` with `D = sym(Fᵀ Ḟ)` and `tr = cof F : Ḟ`: a Kelvin-Voigt
//! viscosity of τ times the stiffness, in Rayleigh's terms the part `β = τ` proportional to stiffness. It is 0 where
//! nothing moves, so no equilibrium moves, and 0 for rotations of the whole. A vibration of angular frequency ω is
//! damped by the fraction `τ ω / 2` of critical, in shear and in volume alike.
//!
//! One colored pass changes the velocities of each tet by two implicit steps, of the volume part exactly and of the
//! shear part along its force. Neither raises the kinetic energy, whatever τ, substep and stiffness. Where `τ / Δt`
//! times kappa exceeds about 1 the second one damps less than asked.
//!
//! Source: Kelvin-Voigt model; implicit steps derived in [`crate::simd_kernel`]. Cost: 1.4 passes
//! over the tets a substep in single and 1.6 in double precision, and a copy of the velocities; nothing without a damped
//! material.

use fearless_simd::Level;

use crate::Float;
use crate::gauss_seidel::{self, Sharing};
use crate::layout::Layout;
use crate::particles::Particles;
use crate::simd_kernel::{Cells, Pass};
use crate::substep::Factors;

/// The memory of the damping pass.
#[derive(Debug)]
pub(crate) struct Damping<R: Float> {
    /// Copies of velocities and inverse masses that threads may share, while some material is damped.
    cells: Vec<R::Particle>,
    sharing: Sharing<R>,
}

impl<R: Float> Default for Damping<R> {
    fn default() -> Self {
        Self {
            cells: Vec::new(),
            sharing: Sharing::default(),
        }
    }
}

impl<R: Float> Damping<R> {
    /// Damps the velocities of a substep.
    pub(crate) fn damp(
        &mut self,
        particles: &mut Particles<R>,
        layout: &Layout<R>,
        factors: Factors<R>,
        level: Level,
    ) {
        self.cells.clear();
        let cells = particles.velocities.iter().zip(&particles.cells);
        self.cells.extend(cells.map(|(&velocity, particle)| {
            let [x, y, z] = R::components(velocity);
            let [.., weight] = R::read(particle);
            R::particle([x, y, z, weight])
        }));
        let pass = Pass {
            layout,
            corners: &layout.blocks.corners,
            keeps_multipliers: false,
            corrections: &[],
            refused: &particles.refused,
            iterated: false,
            factors,
        };
        let mut cells = Cells {
            moved: &mut self.cells,
            positions: &mut particles.cells,
            multipliers: &mut [],
        };
        gauss_seidel::damp(level, &pass, &mut cells, &mut self.sharing);
        for (velocity, cell) in particles.velocities.iter_mut().zip(&self.cells) {
            let [x, y, z, _] = R::read(cell);
            *velocity = R::vector(x, y, z);
        }
    }
}
