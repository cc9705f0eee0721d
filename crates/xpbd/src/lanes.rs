//! [`solve_block`]: the Stable Neo-Hookean constraints of several tets at once, one in each lane of a processor.
//!
//! With deformation gradient F the deviatoric constraint is `C_D = |F|` and the hydrostatic one `C_H = det F - γ`; half
//! their squares over the compliances `1/(μV)` and `1/(lV)` are the energy exactly. At rest both gradients are parallel,
//! so solving one after the other lets them fight; solved as one 2×2 system, a tet at rest stays at rest whatever the
//! stiffness. (A body of many stays so up to a kappa of 2: rounding in one tet disturbs the next.)
//!
//! The matrix needs no gradients at the corners. With `G = Σ w q qᵀ` over the corners (see `Layout`), `Σ w |∇C|²` is
//! `G : AᵀA` for `A = dC/dF`; the mixed term is `det F tr G / |F|`, since `Fᵀ cof F = det F`. Both corrections then are
//! one matrix times the gradients of the barycentric coordinates.
//!
//! Products and sums are rounded one by one, not fused, so that every instruction set gives the same bits.
//!
//! Source: Macklin and Müller 2021 (constraints), Ton-That et al. 2023 (block solve), paper equations 5 and 6. The paper
//! prints a minus in its equation 6; its equation 3 gives the plus used here.
//! Cost: about 330 operations, one square root and two divisions a tet (block form, undamped); in single precision 80
//! bytes of the layout and four corners of 16 bytes, read and written. Taking corners from where they are and putting
//! them back is more than half of the instructions, since there is no safe instruction for it.

mod memory;

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

use crate::Real;
use crate::layout::{CONSTANTS, Layout, REST};
use crate::step::Factors;
use memory::{gather, load_multipliers, scatter, splat, store_multipliers};

/// What a pass over the tets is given. Public only because [`Real`] names it.
#[expect(unnameable_types, reason = "nobody else makes passes")]
#[derive(Debug)]
pub struct Pass<'a, R: Real> {
    pub(crate) layout: &'a Layout<R>,
    pub(crate) particles: &'a [R::Particle],
    /// Positions at the start of the substep; used with damping only.
    pub(crate) previous: &'a [R::Vector],
    /// Block, number, lane: the multipliers; empty if not kept.
    pub(crate) multipliers: &'a [R::Atomic],
    /// Where corrections are gathered by a Jacobi pass, which leaves the particles as they are; else empty.
    pub(crate) corrections: &'a [R::Particle],
    pub(crate) factors: Factors<R>,
}

/// What is solved; each choice is compiled on its own. Whether multipliers are kept and where corrections go is asked
/// once a block, which costs nothing that can be measured; compiled on their own they would make four times the code.
pub(crate) trait Kind {
    /// Whether constraints resist the rate of their change.
    const DAMPED: bool;
    /// Whether the two constraints of a tet are solved one after the other; compiled with damping only, which may be 0.
    const SEQUENTIAL: bool;
}

type Matrix<V> = [[V; 3]; 3];

/// The norm of the derivative of det F, √3 at rest, up to which tets resist a change of volume as their material says:
/// that of a tet stretched two and a half times along each axis, or fifty times along one while it is thinned
/// to the same volume. No tissue gets there unbroken.
pub(crate) const STEEP: f64 = 10.0;

/// The tets of one block, with what is needed of them.
struct Tets<'a, R: Real, S: Simd> {
    simd: S,
    rest: &'a [R],
    /// `l/μ`.
    ratio: R::Lanes<S>,
    gamma: R::Lanes<S>,
    /// Damping time over the time of a substep.
    damping: R::Lanes<S>,
    time_squared: R::Lanes<S>,
    relaxation: R::Lanes<S>,
}

/// Solves the tets of a block, which share no particle.
#[inline(always)]
pub(crate) fn solve_block<R: Real, S: Simd, K: Kind>(simd: S, pass: &Pass<'_, R>, block: usize) {
    let lanes = R::Lanes::<S>::LEN;
    let layout = pass.layout;
    let active = layout.active[block];
    let corners = &layout.particles[block * lanes..(block + 1) * lanes];
    let read = |p: u32| R::read(&pass.particles[p as usize]);
    let mut x = gather::<R, S>(simd, corners, read);
    let tets = Tets::<R, S>::new(simd, pass, block);
    let q = tets.gradients();
    let f = deformation::<R, S>(&x, &q);
    let old = if K::DAMPED {
        let before = |p: u32| {
            let [x, y, z] = R::components(pass.previous[p as usize]);
            [x, y, z, R::ZERO]
        };
        deformation::<R, S>(&gather::<R, S>(simd, corners, before), &q)
    } else {
        f
    };
    let keeps = !pass.multipliers.is_empty();
    let mut multipliers = if keeps {
        load_multipliers::<R, S>(simd, pass, block)
    } else {
        [splat::<R, S>(simd, R::ZERO); 2]
    };
    let jacobi = !pass.corrections.is_empty();
    let before = x;
    if K::SEQUENTIAL {
        let change = tets.deviatoric::<K>(&f, &old, &mut multipliers[0]);
        move_corners::<R, S>(&mut x, &change, &q);
        let f = if jacobi {
            f
        } else {
            deformation::<R, S>(&x, &q)
        };
        let change = tets.hydrostatic::<K>(&f, &old, &mut multipliers[1]);
        move_corners::<R, S>(&mut x, &change, &q);
    } else {
        let change = tets.both::<K>(&f, &old, &mut multipliers);
        move_corners::<R, S>(&mut x, &change, &q);
    }
    if keeps {
        store_multipliers::<R, S>(pass, block, multipliers);
    }
    if jacobi {
        for k in 0..4 {
            for axis in 0..3 {
                x[k][axis] -= before[k][axis];
            }
        }
        let add = |p: u32, [x, y, z, _]: [R; 4]| {
            let sum = &pass.corrections[p as usize];
            let [a, b, c, d] = R::read(sum);
            R::write(sum, [a + x, b + y, c + z, d]);
        };
        scatter::<R, S>(&x, corners, active, add);
    } else {
        let write = |p: u32, values| R::write(&pass.particles[p as usize], values);
        scatter::<R, S>(&x, corners, active, write);
    }
}

impl<'a, R: Real, S: Simd> Tets<'a, R, S> {
    #[inline(always)]
    fn new(simd: S, pass: &Pass<'a, R>, block: usize) -> Self {
        let lanes = R::Lanes::<S>::LEN;
        let layout = pass.layout;
        let rest = &layout.rest[block * REST * lanes..(block + 1) * REST * lanes];
        let mut constants = [splat::<R, S>(simd, R::ZERO); CONSTANTS];
        for (k, constant) in constants.iter_mut().enumerate() {
            *constant = if layout.constants.is_empty() {
                splat::<R, S>(simd, layout.constant[k])
            } else {
                let start = (block * CONSTANTS + k) * lanes;
                R::Lanes::<S>::from_slice(simd, &layout.constants[start..start + lanes])
            };
        }
        let [ratio, gamma, damping] = constants;
        Self {
            simd,
            rest,
            ratio,
            gamma,
            damping: damping * splat::<R, S>(simd, pass.factors.per_time),
            time_squared: splat::<R, S>(simd, pass.factors.time_squared),
            relaxation: splat::<R, S>(simd, pass.factors.relaxation),
        }
    }

    #[inline(always)]
    fn splat(&self, value: R) -> R::Lanes<S> {
        splat::<R, S>(self.simd, value)
    }

    #[inline(always)]
    fn rest(&self, k: usize) -> R::Lanes<S> {
        let lanes = R::Lanes::<S>::LEN;
        R::Lanes::<S>::from_slice(self.simd, &self.rest[k * lanes..(k + 1) * lanes])
    }

    /// The rows of the inverse rest matrix: the gradients of the barycentric coordinates of corners 1 to 3.
    #[inline(always)]
    fn gradients(&self) -> Matrix<R::Lanes<S>> {
        [
            [self.rest(0), self.rest(1), self.rest(2)],
            [self.rest(3), self.rest(4), self.rest(5)],
            [self.rest(6), self.rest(7), self.rest(8)],
        ]
    }

    /// `G : AᵀA` in units of the stiffness times time squared.
    #[inline(always)]
    fn weighted(&self, a: &Matrix<R::Lanes<S>>) -> R::Lanes<S> {
        let [a, b, c] = a;
        let same = self.rest(9) * dot::<R, S>(a, a)
            + self.rest(10) * dot::<R, S>(b, b)
            + self.rest(11) * dot::<R, S>(c, c);
        let mixed = self.rest(12) * dot::<R, S>(a, b)
            + self.rest(13) * dot::<R, S>(a, c)
            + self.rest(14) * dot::<R, S>(b, c);
        (same + mixed) * self.time_squared
    }

    /// `μV` times the square of the time.
    #[inline(always)]
    fn stiffness(&self) -> R::Lanes<S> {
        self.rest(15) * self.time_squared
    }

    /// The norm of F and one over it; at F = 0 the gradient has no direction, no correction is finite, and the tet waits
    /// for its neighbors.
    #[inline(always)]
    fn norm(&self, f: &Matrix<R::Lanes<S>>) -> (R::Lanes<S>, R::Lanes<S>) {
        let square =
            dot::<R, S>(&f[0], &f[0]) + dot::<R, S>(&f[1], &f[1]) + dot::<R, S>(&f[2], &f[2]);
        let norm = square.sqrt();
        (norm, self.splat(R::ONE) / norm)
    }

    /// The derivative of det F, det F and γ; where the first is longer than [`STEEP`], all three are scaled down to that.
    ///
    /// The stiffness against a change of volume grows with the square of the derivative, which is that of an area. In a
    /// tet stretched a hundred times it is 10⁸ times what kappa says, and such tets throw their corners away, farther
    /// each time. A constraint over a number has the same solutions and pulls the same way, less.
    #[inline(always)]
    fn volume(&self, f: &Matrix<R::Lanes<S>>) -> (Matrix<R::Lanes<S>>, [R::Lanes<S>; 2]) {
        let mut cofactor = cofactor::<R, S>(f);
        let [a, b, c] = &cofactor;
        let square = dot::<R, S>(a, a) + dot::<R, S>(b, b) + dot::<R, S>(c, c);
        let mut volume = dot::<R, S>(&f[0], a);
        let mut gamma = self.gamma;
        let limit = R::from_f64(STEEP);
        let steep = square.simd_gt(self.splat(limit * limit));
        if steep.any_true() {
            let scale = self.splat(limit) / square.sqrt();
            let scale = steep.select(scale, self.splat(R::ONE));
            for entry in cofactor.as_flattened_mut() {
                *entry *= scale;
            }
            volume *= scale;
            gamma *= scale;
        }
        (cofactor, [volume, gamma])
    }

    /// The change of F's corners per weight that satisfies both constraints to first order, and of the multipliers.
    ///
    /// The equations are multiplied by stiffness and time squared, which makes the matrix one plus numbers of the order
    /// of kappa: as they are usually written, with compliances, they leave the range of single precision for a body of
    /// micrometers.
    #[inline(always)]
    fn both<K: Kind>(
        &self,
        f: &Matrix<R::Lanes<S>>,
        old: &Matrix<R::Lanes<S>>,
        multipliers: &mut [R::Lanes<S>; 2],
    ) -> Matrix<R::Lanes<S>> {
        let (one, zero) = (self.splat(R::ONE), self.splat(R::ZERO));
        let (norm, scale) = self.norm(f);
        let (cofactor, [volume, gamma]) = self.volume(f);
        let trace = (self.rest(9) + self.rest(10) + self.rest(11)) * self.time_squared;
        let mut m11 = self.weighted(f) * scale * scale;
        let mut m22 = self.weighted(&cofactor);
        let mut m12 = trace * volume * scale;
        let (mut deviatoric, mut hydrostatic) = (norm, volume - gamma);
        if K::DAMPED {
            let motion = difference::<R, S>(f, old);
            deviatoric += self.damping * scale * product::<R, S>(f, &motion);
            hydrostatic += self.damping * product::<R, S>(&cofactor, &motion);
            let damped = one + self.damping;
            (m11, m22, m12) = (m11 * damped, m22 * damped, m12 * damped);
        }
        // At rest the gradients are parallel and only the one keeps the system regular. The difference is not negative
        // (Cauchy-Schwarz); where rounding says otherwise, it is noise. Overflow makes it NaN and stays so.
        let parallel = m11 * m22 - m12 * m12;
        let parallel = parallel.simd_lt(zero).select(zero, parallel);
        let inverse = one / (self.ratio * (parallel + m22) + m11 + one);
        let stiffness = self.stiffness();
        let b1 = -(stiffness * deviatoric + multipliers[0]);
        let b2 = -(stiffness * self.ratio * hydrostatic + multipliers[1]);
        let d1 = ((self.ratio * m22 + one) * b1 - m12 * b2) * inverse * self.relaxation;
        let d2 = ((m11 + one) * b2 - self.ratio * m12 * b1) * inverse * self.relaxation;
        let sound = (d1 + d2).is_finite();
        let (d1, d2) = (sound.select(d1, zero), sound.select(d2, zero));
        multipliers[0] += d1;
        multipliers[1] += d2;
        let along = d1 * scale;
        let mut change = [[zero; 3]; 3];
        for j in 0..3 {
            for axis in 0..3 {
                let entry = f[j][axis] * along + cofactor[j][axis] * d2;
                change[j][axis] = sound.select(entry, zero);
            }
        }
        change
    }

    /// The same for the deviatoric constraint alone.
    #[inline(always)]
    fn deviatoric<K: Kind>(
        &self,
        f: &Matrix<R::Lanes<S>>,
        old: &Matrix<R::Lanes<S>>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let (norm, scale) = self.norm(f);
        let mut constraint = norm;
        let mut m = self.weighted(f) * scale * scale;
        if K::DAMPED {
            let rate = product::<R, S>(f, &difference::<R, S>(f, old));
            constraint += self.damping * scale * rate;
            m *= self.splat(R::ONE) + self.damping;
        }
        self.alone(f, scale, self.stiffness(), constraint, m, multiplier)
    }

    /// The same for the hydrostatic constraint alone.
    #[inline(always)]
    fn hydrostatic<K: Kind>(
        &self,
        f: &Matrix<R::Lanes<S>>,
        old: &Matrix<R::Lanes<S>>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let (cofactor, [volume, gamma]) = self.volume(f);
        let mut constraint = volume - gamma;
        let mut m = self.weighted(&cofactor) * self.ratio;
        if K::DAMPED {
            let rate = product::<R, S>(&cofactor, &difference::<R, S>(f, old));
            constraint += self.damping * rate;
            m *= self.splat(R::ONE) + self.damping;
        }
        let stiffness = self.stiffness() * self.ratio;
        let one = self.splat(R::ONE);
        self.alone(&cofactor, one, stiffness, constraint, m, multiplier)
    }

    /// The change of a multiplier that satisfies its constraint, whose derivative is `scale` times a matrix, times that.
    #[inline(always)]
    fn alone(
        &self,
        derivative: &Matrix<R::Lanes<S>>,
        scale: R::Lanes<S>,
        stiffness: R::Lanes<S>,
        constraint: R::Lanes<S>,
        m: R::Lanes<S>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let zero = self.splat(R::ZERO);
        let b = -(stiffness * constraint + *multiplier);
        let d = b / (m + self.splat(R::ONE)) * self.relaxation;
        let sound = d.is_finite();
        let d = sound.select(d, zero);
        *multiplier += d;
        let along = d * scale;
        let mut change = [[zero; 3]; 3];
        for j in 0..3 {
            for axis in 0..3 {
                change[j][axis] = sound.select(derivative[j][axis] * along, zero);
            }
        }
        change
    }
}

/// The columns of F.
#[inline(always)]
fn deformation<R: Real, S: Simd>(
    x: &[[R::Lanes<S>; 4]; 4],
    q: &Matrix<R::Lanes<S>>,
) -> Matrix<R::Lanes<S>> {
    let mut f = *q;
    for axis in 0..3 {
        let [a, b, c] = [
            x[1][axis] - x[0][axis],
            x[2][axis] - x[0][axis],
            x[3][axis] - x[0][axis],
        ];
        for j in 0..3 {
            f[j][axis] = a * q[0][j] + b * q[1][j] + c * q[2][j];
        }
    }
    f
}

/// Moves the corners by the weight of each times a matrix times the gradient of its barycentric coordinate.
#[inline(always)]
fn move_corners<R: Real, S: Simd>(
    x: &mut [[R::Lanes<S>; 4]; 4],
    change: &Matrix<R::Lanes<S>>,
    q: &Matrix<R::Lanes<S>>,
) {
    for axis in 0..3 {
        let row = [change[0][axis], change[1][axis], change[2][axis]];
        let a = dot::<R, S>(&row, &q[0]);
        let b = dot::<R, S>(&row, &q[1]);
        let c = dot::<R, S>(&row, &q[2]);
        x[0][axis] -= x[0][3] * (a + b + c);
        x[1][axis] += x[1][3] * a;
        x[2][axis] += x[2][3] * b;
        x[3][axis] += x[3][3] * c;
    }
}

#[inline(always)]
fn dot<R: Real, S: Simd>(a: &[R::Lanes<S>; 3], b: &[R::Lanes<S>; 3]) -> R::Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<R: Real, S: Simd>(a: &[R::Lanes<S>; 3], b: &[R::Lanes<S>; 3]) -> [R::Lanes<S>; 3] {
    [
        a[1] * b[2] - b[1] * a[2],
        a[2] * b[0] - b[2] * a[0],
        a[0] * b[1] - b[0] * a[1],
    ]
}

/// The derivative of the determinant.
#[inline(always)]
fn cofactor<R: Real, S: Simd>([a, b, c]: &Matrix<R::Lanes<S>>) -> Matrix<R::Lanes<S>> {
    [
        cross::<R, S>(b, c),
        cross::<R, S>(c, a),
        cross::<R, S>(a, b),
    ]
}

#[inline(always)]
fn difference<R: Real, S: Simd>(
    a: &Matrix<R::Lanes<S>>,
    b: &Matrix<R::Lanes<S>>,
) -> Matrix<R::Lanes<S>> {
    let mut difference = *a;
    for j in 0..3 {
        for axis in 0..3 {
            difference[j][axis] = a[j][axis] - b[j][axis];
        }
    }
    difference
}

/// The sum of the products of all entries.
#[inline(always)]
fn product<R: Real, S: Simd>(a: &Matrix<R::Lanes<S>>, b: &Matrix<R::Lanes<S>>) -> R::Lanes<S> {
    dot::<R, S>(&a[0], &b[0]) + dot::<R, S>(&a[1], &b[1]) + dot::<R, S>(&a[2], &b[2])
}

#[cfg(test)]
mod tests;
