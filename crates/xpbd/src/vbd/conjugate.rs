//! [`Conjugate`]: preconditioned conjugate gradients for the matrix of a correction.
//!
//! The preconditioner is one symmetric cycle: a Gauss-Seidel sweep over the rows in the colors of the stars, the
//! coarse correction, and a sweep backwards (`smoother`). The product with a direction follows from that with the result
//! of the cycle, of which the cycle has half (the idea of Eisenstat 1981). Dot products are summed in double precision,
//! row after row.
//!
//! Each iteration lowers the energy `x·Ax/2 - b·x` by a gain that is at hand, and the gains of all iterations together
//! are the energy between start and solution. So the last few gains tell what is left, which the residual does not
//! where rows of very different stiffness meet.
//!
//! Source of the estimate: Hestenes, Stiefel 1952; Strakoš, Tichý 2002.
//! Cost of an iteration: two products and a half, and a coarse solution.

use super::coarse::Coarse;
use super::matrix::Blocks;
use super::smoother::Smoother;
use crate::Float;

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

/// The vectors of the iteration.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Conjugate<R: Float> {
    smoother: Smoother<R>,
    solution: Vec<R::Vector>,
    residual: Vec<R::Vector>,
    direction: Vec<R::Vector>,
    product: Vec<R::Vector>,
    preconditioned: Vec<R::Vector>,
    /// The matrix times `preconditioned`.
    image: Vec<R::Vector>,
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
            &self.image,
        ];
        self.smoother.bytes() + vectors.map(|v| size_of_val(&**v)).iter().sum::<usize>()
    }

    /// The result of [`Conjugate::solve`].
    pub(super) fn solution(&self) -> &[R::Vector] {
        &self.solution
    }

    /// Takes the values of a matrix, which solutions need until matrix or held rows change.
    pub(super) fn prepare(&mut self, matrix: &Blocks<R>, colors: &[usize], held: &[bool]) {
        self.smoother.prepare(matrix, colors, held);
    }

    /// Solves `A x = b` approximately for the matrix of the last [`Conjugate::prepare`]. Rows that are held, which are
    /// those given there, stay zero.
    pub(super) fn solve(
        &mut self,
        coarse: &mut Coarse,
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
            &mut self.image,
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
            self.precondition(coarse, held);
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
            let Self {
                smoother,
                direction,
                product,
                preconditioned: z,
                image,
                ..
            } = self;
            smoother.multiply(z, image);
            for (d, z) in direction.iter_mut().zip(&*z) {
                *d = *z + *d * share;
            }
            for (q, z) in product.iter_mut().zip(&*image) {
                *q = *z + *q * share;
            }
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
    fn precondition(&mut self, coarse: &mut Coarse, held: &[bool]) {
        let Self {
            smoother,
            residual,
            preconditioned: z,
            ..
        } = self;
        let left = smoother.forward(residual, z);
        coarse.correct::<R>(left, z, held);
        smoother.backward(residual, z);
    }
}

fn dot<R: Float>(a: &[R::Vector], b: &[R::Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| R::dot(*a, *b).to_f64()).sum()
}
