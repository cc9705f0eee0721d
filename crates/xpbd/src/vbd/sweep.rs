//! [`ImplicitStep::sweep`]: moves every particle once to the minimum of the potential over its position.

use rayon::prelude::*;

use super::block::solve;
use super::constraints::Local;
use super::{ImplicitStep, VertexStars};
use crate::constraints::outside;
use crate::float::{finite, load, store, weight};
use crate::wide::wide;
use crate::{Float, Solver};

/// Pairs of particle and tet in a color from which a second thread pays for its wake-up.
const PARALLEL_PAIRS: usize = 1024;

/// How far a particle is moved that sees only collapsed tets, as a part of the size of a tet.
const NUDGE: f64 = 1e-6;

/// What a sweep uses at every particle.
struct Sweep<R> {
    time: R,
    /// `1 / Δt²`.
    per_time_squared: R,
    relaxation: R,
    nudge: R,
}

impl<R: Float> ImplicitStep<'_, R> {
    /// Moves every free particle once, color by color, and out of colliders.
    ///
    /// Without colliders the potential does not rise, up to rounding. Cost: about 60 operations a pair of particle and
    /// tet, and three divisions a particle; [`VertexStars::pair_count`].
    pub fn sweep(&mut self) {
        let sweep = Sweep {
            time: self.time,
            per_time_squared: R::ONE / (self.time * self.time),
            relaxation: R::from_f64(self.settings.relaxation),
            nudge: R::from_f64(NUDGE * self.stars.data.size),
        };
        let threads = rayon::current_num_threads();
        let (solver, stars) = (&*self.solver, &*self.stars);
        for color in 0..stars.color_count() {
            let rows = stars.data.colors[color]..stars.data.colors[color + 1];
            let pairs = stars.data.offsets[rows.end] - stars.data.offsets[rows.start];
            if threads == 1 || pairs < PARALLEL_PAIRS {
                wide(
                    #[inline(always)]
                    || {
                        for row in rows {
                            sweep.step_vbd(solver, stars, row);
                        }
                    },
                );
            } else {
                (0..threads).into_par_iter().for_each(|thread| {
                    let share = |part| rows.start + rows.len() * part / threads;
                    wide(
                        #[inline(always)]
                        || {
                            for row in share(thread)..share(thread + 1) {
                                sweep.step_vbd(solver, stars, row);
                            }
                        },
                    );
                });
            }
        }
    }
}

impl<R: Float> Sweep<R> {
    /// Moves one particle into its minimum.
    #[inline(always)]
    fn step_vbd(&self, solver: &Solver<R>, stars: &VertexStars<R>, row: usize) {
        let Solver {
            particles,
            constraints,
            ..
        } = solver;
        let obstacles = &*constraints.colliders.obstacles;
        let p = stars.data.order[row] as usize;
        let particle = &particles.cells[p];
        let inverse_mass = weight::<R>(particle);
        if inverse_mass <= R::ZERO {
            return;
        }
        let x = load::<R>(particle);
        let free = particles.previous[p] + particles.velocities[p] * self.time;
        // Minus the gradient, the isotropic part of the matrix, and the rest of it: xx, xy, xz, yy, yz, zz.
        let inertia = self.per_time_squared / inverse_mass;
        let mut force = (free - x) * inertia;
        let mut isotropic = inertia;
        let mut h = [R::ZERO; 6];
        for term in stars.data.of(row) {
            let corner = term.at(particles, x);
            force += corner.force;
            let [wa, wb, wc] = term.pulls;
            isotropic -= wa + wb + wc;
            let [u, v, w] = R::components(corner.slope);
            h[0] += u * u;
            h[1] += u * v;
            h[2] += u * w;
            h[3] += v * v;
            h[4] += v * w;
            h[5] += w * w;
        }
        let collapsed = h[0] + h[3] + h[5] == R::ZERO && !stars.data.of(row).is_empty();
        if let Some(viscosity) = &stars.viscosity {
            let motion = |p: usize| load::<R>(&particles.cells[p]) - particles.previous[p];
            force += viscosity.force(row, &stars.data.order, motion);
            viscosity.add_diagonal(row, &mut h);
        }
        let mut step = if stars.data.constraints.is_empty() {
            solve(isotropic, h, force) * self.relaxation
        } else {
            let tets = Local {
                isotropic,
                h,
                force,
            };
            let (step, local) = stars.data.constraints.minimize(
                solver,
                &stars.data.order,
                row,
                &tets,
                self.relaxation,
            );
            (isotropic, h) = (local.isotropic, local.h);
            step
        };
        // All its tets lie on lines: a tiny push out of them, if that is unstable, grows from sweep to sweep.
        if collapsed {
            step += push_of::<R>(p) * self.nudge;
        }
        let mut moved = x + step;
        for obstacle in obstacles {
            let along = |normal| solve(isotropic, h, normal);
            let out = obstacle.push_along(x, moved, particles.previous[p], along);
            moved = out.unwrap_or(moved);
        }
        // On a curved collider, or where colliders overlap, it may still be inside of one.
        if !obstacles.is_empty() {
            moved = outside(obstacles, moved, particles.previous[p]).unwrap_or(moved);
        }
        if finite::<R>(moved) {
            store::<R>(particle, moved);
        }
    }
}

/// A direction that differs from particle to particle: each coordinate in -1 .. 1, by the mixing step of `SplitMix64`.
#[cold]
pub(super) fn push_of<R: Float>(particle: usize) -> R::Vector {
    let coordinate = |k: u64| {
        let mut z = (particle as u64 * 3 + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        R::from_f64(((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    };
    R::vector(coordinate(0), coordinate(1), coordinate(2))
}
