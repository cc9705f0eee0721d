//! [`ImplicitStep::sweep`]: every particle once into the minimum of the potential over its position.

use rayon::prelude::*;

use super::constraints::Local;
use super::matrix::Block;
use super::{ImplicitStep, VertexStars};
use crate::constraints::outside;
use crate::float::{finite, load, store, weight};
use crate::{Float, Solver};

/// Pairs of particle and tet in a color from which a second thread pays for its wake-up.
const PARALLEL_PAIRS: usize = 1024;

/// How far a particle is moved that sees only collapsed tets, as a part of the size of a tet.
const NUDGE: f64 = 1e-6;

/// The backward error of [`solve`] in last digits of the trace: one was enough in all tests.
const BACKWARD_ERROR: f64 = 4.0;

/// What a sweep uses at every particle.
struct Sweep<R> {
    time: R,
    /// `1 / Δt²`.
    per_time_squared: R,
    relaxation: R,
    nudge: R,
}

impl<R: Float> ImplicitStep<'_, R> {
    /// Moves every free particle once, color after color, and out of colliders.
    ///
    /// Without colliders the potential does not rise, up to rounding. Cost: about 60 operations a pair of particle and
    /// tet, and three divisions a particle; [`VertexStars::pair_count`].
    pub fn sweep(&mut self) {
        let sweep = Sweep {
            time: self.time,
            per_time_squared: R::ONE / (self.time * self.time),
            relaxation: R::from_f64(self.settings.relaxation),
            nudge: R::from_f64(NUDGE * self.stars.size),
        };
        let threads = rayon::current_num_threads();
        let (solver, stars) = (&*self.solver, &*self.stars);
        for color in 0..stars.color_count() {
            let places = stars.colors[color]..stars.colors[color + 1];
            let pairs = stars.offsets[places.end] - stars.offsets[places.start];
            if threads == 1 || pairs < PARALLEL_PAIRS {
                places.for_each(|place| sweep.step_vbd(solver, stars, place));
            } else {
                (0..threads).into_par_iter().for_each(|thread| {
                    let share = |part| places.start + places.len() * part / threads;
                    for place in share(thread)..share(thread + 1) {
                        sweep.step_vbd(solver, stars, place);
                    }
                });
            }
        }
    }
}

impl<R: Float> Sweep<R> {
    /// Moves one particle into its minimum.
    #[inline]
    fn step_vbd(&self, solver: &Solver<R>, stars: &VertexStars<R>, place: usize) {
        let Solver {
            particles,
            constraints,
            ..
        } = solver;
        let obstacles = &*constraints.colliders.obstacles;
        let p = stars.order[place] as usize;
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
        for term in stars.of(place) {
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
        let collapsed = h[0] + h[3] + h[5] == R::ZERO && !stars.of(place).is_empty();
        if let Some(viscosity) = &stars.viscosity {
            let motion = |p: usize| load::<R>(&particles.cells[p]) - particles.previous[p];
            force += viscosity.force(place, &stars.order, motion);
            viscosity.add_diagonal(place, &mut h);
        }
        let mut step = if stars.constraints.is_empty() {
            solve(isotropic, h, force) * self.relaxation
        } else {
            let tets = Local {
                isotropic,
                h,
                force,
            };
            let (step, local) =
                stars
                    .constraints
                    .minimize(solver, &stars.order, place, &tets, self.relaxation);
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

/// Solves `(isotropic I + h) y = force` with h symmetric, positive semidefinite and given as xx, xy, xz, yy, yz, zz.
///
/// Gaussian elimination without square roots. No pivot of such a matrix is smaller than its isotropic part; where
/// rounding says otherwise, it is noise. Rounding acts like a matrix of some last digits of the trace, which beside a
/// sliver can be stiffer than everything else: a solution that lives on it is shortened, so that the quadratic with
/// this matrix and force does not rise along it.
#[inline]
pub(super) fn solve<R: Float>(isotropic: R, h: [R; 6], force: R::Vector) -> R::Vector {
    let [f0, f1, f2] = R::components(force);
    let at_least = |pivot: R| if pivot > isotropic { pivot } else { isotropic };
    let d0 = R::ONE / (h[0] + isotropic);
    let (l1, l2) = (h[1] * d0, h[2] * d0);
    let d1 = R::ONE / at_least(h[3] - l1 * h[1] + isotropic);
    let m12 = h[4] - l1 * h[2];
    let l3 = m12 * d1;
    let d2 = R::ONE / at_least(h[5] - l2 * h[2] - l3 * m12 + isotropic);
    let y1 = f1 - l1 * f0;
    let y2 = f2 - l2 * f0 - l3 * y1;
    let z = y2 * d2;
    let y = y1 * d1 - l3 * z;
    let x = f0 * d0 - l1 * y - l2 * z;
    let solution = R::vector(x, y, z);
    let gain = R::dot(force, solution);
    let error = (h[0] + h[3] + h[5]) * (R::EPSILON * R::from_f64(BACKWARD_ERROR));
    let lost = R::dot(solution, solution) * error;
    if lost > gain && gain > R::ZERO {
        solution * (gain / lost)
    } else {
        solution
    }
}

/// Adds a symmetric block to a matrix that is given as xx, xy, xz, yy, yz, zz.
#[inline]
pub(super) fn add_symmetric<R: Float>(h: &mut [R; 6], block: &Block<R>) {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = block.map(R::components);
    for (entry, value) in h.iter_mut().zip([xx, xy, xz, yy, yz, zz]) {
        *entry += value;
    }
}

/// A direction that differs from particle to particle: each coordinate in -1 .. 1, by the mixing step of `SplitMix64`.
#[cold]
fn push_of<R: Float>(particle: usize) -> R::Vector {
    let coordinate = |k: u64| {
        let mut z = (particle as u64 * 3 + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        R::from_f64(((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    };
    R::vector(coordinate(0), coordinate(1), coordinate(2))
}

#[cfg(test)]
mod tests {
    use super::{push_of, solve};

    /// In single precision, beside slivers of any flatness, no step leads above where it started. Without the bound on
    /// the solution three of ten do.
    #[test]
    fn steps_beside_slivers_do_not_raise_the_potential() {
        for case in 0..20_000 {
            let flatness = 10.0_f32.powi(case % 6);
            let vector = |k: usize| push_of::<f32>(4 * case as usize + k);
            let slopes = [vector(0) * flatness, vector(1), vector(2)];
            let force = vector(3);
            let isotropic = 1e-3_f32;
            let mut h = [0.0; 6];
            for [x, y, z] in slopes.map(|slope| slope.to_array()) {
                for (entry, value) in h.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
                    *entry += value;
                }
            }
            let step = solve::<f32>(isotropic, h, force).as_dvec3();
            let stretch = slopes.map(|slope| slope.as_dvec3().dot(step).powi(2));
            let resistance =
                f64::from(isotropic) * step.length_squared() + stretch.iter().sum::<f64>();
            let gain = force.as_dvec3().dot(step) - 0.5 * resistance;
            assert!(gain >= 0.0, "flatness {flatness}: {gain}, {step}");
        }
    }
}
