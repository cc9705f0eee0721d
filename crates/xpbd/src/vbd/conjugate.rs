//! [`Conjugate`]: preconditioned conjugate gradients for the matrix of a correction.
//!
//! The preconditioner is one symmetric cycle: a Gauss-Seidel sweep over the rows in the colors of the stars, the
//! coarse correction, and a sweep backwards. Dot products are summed in double precision, row after row.
//!
//! Each iteration lowers the energy `x·Ax/2 - b·x` by a gain that is at hand, and the gains of all iterations together
//! are the energy between start and solution. So the last few gains tell what is left, which the residual does not
//! where rows of very different stiffness meet.
//!
//! Source of the estimate: Hestenes, Stiefel 1952; Strakoš, Tichý 2002.
//! Cost of an iteration: three products, and a coarse solution.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::{Block, apply, solve};
use super::coarse::Coarse;
use super::matrix::Blocks;
use crate::Float;
use crate::float::finite;

/// When to stop.
pub(super) struct Limits<E> {
    pub(super) iterations: u32,
    /// The part of the first error, in the norm of the energy.
    pub(super) reduction: f64,
    /// What may be left of `x·Ax/2 - b·x` in any case, for what was gained so far.
    pub(super) energy: E,
}

/// How a solution ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct CgReport {
    pub(super) iterations: u32,
    /// The estimated energy between where it is and the solution, as a part of what was gained.
    pub(super) left: f64,
    /// Twice the energy that was gained, which is the product of right side and solution.
    pub(super) slope: f64,
}

/// Gains that say what was left before them: so many iterations late is the estimate, and so many are made at least.
pub(super) const FEWEST_ITERATIONS: u32 = 4;

/// Rows of a color that a thread relaxes at a time. Waking a thread costs as much as some hundred of them.
const PARALLEL_RELAXED: usize = 512;

/// Last digits of the trace that rounding may have taken from the pivots of a diagonal block.
const ROUNDING: f64 = 4.0;

/// The vectors of the iteration.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Conjugate<R: Float> {
    inverses: Vec<Block<R>>,
    solution: Vec<R::Vector>,
    residual: Vec<R::Vector>,
    direction: Vec<R::Vector>,
    product: Vec<R::Vector>,
    preconditioned: Vec<R::Vector>,
}

impl<R: Float> Conjugate<R> {
    /// Bytes of all vectors.
    pub(super) fn bytes(&self) -> usize {
        let vectors = [
            &self.solution,
            &self.residual,
            &self.direction,
            &self.product,
            &self.preconditioned,
        ];
        size_of_val(&*self.inverses) + vectors.map(|v| size_of_val(&**v)).iter().sum::<usize>()
    }

    /// The result of [`Conjugate::solve`].
    pub(super) fn solution(&self) -> &[R::Vector] {
        &self.solution
    }

    /// Inverts the diagonal blocks of a matrix, which solutions need until matrix or held rows change.
    pub(super) fn prepare(&mut self, matrix: &Blocks<R>, held: &[bool]) {
        (0..held.len())
            .into_par_iter()
            .with_min_len(PARALLEL_ROWS)
            .map(|row| inverse::<R>(&matrix.blocks[matrix.offsets[row]], held[row]))
            .collect_into_vec(&mut self.inverses);
    }

    /// Solves `A x = b` approximately. Rows that are held stay zero. The matrix must have been
    /// prepared with these rows.
    pub(super) fn solve(
        &mut self,
        matrix: &Blocks<R>,
        coarse: &mut Coarse,
        colors: &[usize],
        b: &[R::Vector],
        held: &[bool],
        limits: &Limits<impl Fn(f64) -> f64>,
    ) -> CgReport {
        let rows = b.len();
        for v in [
            &mut self.solution,
            &mut self.direction,
            &mut self.product,
            &mut self.preconditioned,
        ] {
            v.clear();
            v.resize(rows, R::Vector::default());
        }
        self.residual.clear();
        self.residual.extend(b);
        let mut last = 0.0;
        let mut gains = [f64::INFINITY; FEWEST_ITERATIONS as usize];
        let mut solved = CgReport {
            iterations: 0,
            left: 1.0,
            slope: 0.0,
        };
        while solved.iterations < limits.iterations {
            self.precondition(matrix, coarse, colors, held);
            let now = dot::<R>(&self.residual, &self.preconditioned);
            if now == 0.0 {
                solved.left = 0.0;
                return solved;
            }
            let share = R::from_f64(if solved.iterations == 0 {
                0.0
            } else {
                now / last
            });
            last = now;
            for (d, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *d = *z + *d * share;
            }
            matrix.multiply(&self.direction, &mut self.product);
            let curvature = dot::<R>(&self.direction, &self.product);
            let length = now / curvature;
            // Rounding has the last word, or the matrix is not positive along this direction.
            if !(now > 0.0 && length.is_finite() && length > 0.0) {
                return solved;
            }
            let step = R::from_f64(length);
            for (x, d) in self.solution.iter_mut().zip(&self.direction) {
                *x += *d * step;
            }
            for (r, q) in self.residual.iter_mut().zip(&self.product) {
                *r += *q * -step;
            }
            let gain = length * now;
            solved.slope += gain;
            gains[(solved.iterations % FEWEST_ITERATIONS) as usize] = gain;
            solved.iterations += 1;
            solved.left = (gains.iter().sum::<f64>() / solved.slope).min(1.0);
            let enough = (limits.reduction * limits.reduction)
                .max(2.0 * (limits.energy)(0.5 * solved.slope) / solved.slope);
            if solved.iterations >= FEWEST_ITERATIONS && solved.left <= enough {
                return solved;
            }
        }
        solved
    }

    /// One cycle for the residual.
    fn precondition(
        &mut self,
        matrix: &Blocks<R>,
        coarse: &mut Coarse,
        colors: &[usize],
        held: &[bool],
    ) {
        let Self {
            inverses,
            residual,
            preconditioned: z,
            product,
            ..
        } = self;
        // From zero, nothing right of the diagonal matters yet, and nothing but that is left over afterwards.
        for color in colors.windows(2) {
            relax(matrix, inverses, residual, z, color[0]..color[1], false);
        }
        matrix.multiply_upper(z, product);
        coarse.correct::<R>(product, z, held);
        for color in colors.windows(2).rev() {
            relax(matrix, inverses, residual, z, color[0]..color[1], true);
        }
    }
}

/// Solves each row of a color for its own unknown. It sees the colors before its own and, on the way back, those after
/// it; no two rows of a color are coupled.
fn relax<R: Float>(
    matrix: &Blocks<R>,
    inverses: &[Block<R>],
    b: &[R::Vector],
    z: &mut [R::Vector],
    rows: Range<usize>,
    is_way_back: bool,
) {
    let start = rows.start;
    let (before, rest) = z.split_at_mut(start);
    let (own, after) = rest.split_at_mut(rows.len());
    let (before, after) = (&*before, &*after);
    own.par_iter_mut()
        .with_min_len(PARALLEL_RELAXED)
        .enumerate()
        .for_each(|(k, z)| {
            let row = start + k;
            let mut force = matrix.without(b[row], matrix.lower(row), |column| before[column]);
            if is_way_back {
                force = matrix.without(force, matrix.upper(row), |column| after[column - rows.end]);
            }
            *z = apply::<R>(&inverses[row], force);
        });
}

/// The inverse of a symmetric block, in double precision and with the last digits of its trace added to the diagonal,
/// so that it is as positive as the block was before rounding; zero if it has none or the row is held.
fn inverse<R: Float>(block: &Block<R>, held: bool) -> Block<R> {
    let columns = block.map(R::to_dvec3);
    let trace = columns[0].x + columns[1].y + columns[2].z;
    let rounding = ROUNDING * R::EPSILON.to_f64() * trace;
    let [a, b, c] = columns.map(<f64 as Float>::components);
    let h = [a[0], b[0], c[0], b[1], c[1], c[2]];
    let [a, b, c] = DVec3::AXES.map(|axis| solve::<f64>(rounding, h, axis));
    let inverse = [a, b, c].map(R::from_dvec3);
    if held || !inverse.into_iter().all(finite::<R>) {
        return [R::Vector::default(); 3];
    }
    inverse
}

fn dot<R: Float>(a: &[R::Vector], b: &[R::Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| R::dot(*a, *b).to_f64()).sum()
}
