//! [`Smoother`]: symmetric Gauss-Seidel sweeps over the rows of a matrix, in the colors of the stars.
//!
//! Both triangles of the matrix are kept in slices of rows (`triangle`). The half sweeps share products: a sweep from
//! zero leaves nothing but what is right of the diagonal, the sweep backwards needs what is left of it once, before it
//! begins, and with what the sweep backwards has added up the whole matrix times the result is half a product.
//!
//! Cost of a cycle: the blocks left of the diagonal twice, those right of it twice; the product, once more the left.

use super::PARALLEL_ROWS;
use super::block::{Block, apply, solve};
use super::matrix::{Blocks, each_row};
use super::triangle::Triangle;
use crate::Float;
use crate::float::finite;
use glam::DVec3;

/// Last digits of the trace that rounding may have taken from the pivots of a diagonal block.
const ROUNDING: f64 = 4.0;

/// Inverses of the diagonal blocks of a matrix, its triangles, and what the halves of a cycle leave for later.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Smoother<R: Float> {
    /// The diagonal block of each row, and its inverse.
    diagonals: Vec<Block<R>>,
    inverses: Vec<Block<R>>,
    lower: Triangle<R>,
    upper: Triangle<R>,
    /// The pattern that the triangles have, by its number.
    pattern: u64,
    /// What the first half of a cycle has left over.
    residual: Vec<R::Vector>,
    /// The products left of the diagonal with the unknowns before the second half, and those right of it after.
    products: Vec<R::Vector>,
}

impl<R: Float> Smoother<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.diagonals)
            + size_of_val(&*self.inverses)
            + size_of_val(&*self.residual)
            + size_of_val(&*self.products)
            + self.lower.bytes()
            + self.upper.bytes()
    }

    /// Takes the values of a matrix with rows in these colors. Rows that are held get no inverse, so their unknowns
    /// stay zero.
    pub(super) fn prepare(&mut self, matrix: &Blocks<R>, colors: &[usize], held: &[bool]) {
        if self.pattern != matrix.patterns {
            rayon::join(
                || self.lower.sync(matrix, colors, |row| matrix.lower(row)),
                || self.upper.sync(matrix, colors, |row| matrix.upper(row)),
            );
            self.pattern = matrix.patterns;
        }
        self.lower.fill::<false>(matrix);
        self.upper.fill::<true>(matrix);
        let diagonal = |&first: &usize| matrix.blocks[first];
        self.diagonals.clear();
        self.diagonals
            .extend(matrix.offsets[..held.len()].iter().map(diagonal));
        self.inverses.resize(held.len(), Block::<R>::default());
        let Self {
            diagonals,
            inverses,
            ..
        } = self;
        each_row(
            inverses,
            PARALLEL_ROWS,
            #[inline(always)]
            |row| inverse::<R>(&diagonals[row], held[row]),
        );
        self.residual.resize(held.len(), R::Vector::default());
        self.products.resize(held.len(), R::Vector::default());
    }

    /// The first half of a cycle for the right side `b`: sets the unknowns `z` by a sweep through all colors, from zero,
    /// and returns what that leaves over of each row.
    pub(super) fn forward(&mut self, b: &[R::Vector], z: &mut [R::Vector]) -> &[R::Vector] {
        let Self {
            inverses,
            lower,
            upper,
            residual,
            ..
        } = self;
        // From zero, nothing right of the diagonal matters yet, and nothing but that is left over afterwards.
        for color in 0..lower.color_count() {
            lower.relax(color, z, |z, row, lower| {
                z[row] = apply::<R>(&inverses[row], b[row] - lower);
            });
        }
        upper.product(z, |row, upper| residual[row] = -upper);
        residual
    }

    /// The second half: a sweep through all colors backwards.
    pub(super) fn backward(&mut self, b: &[R::Vector], z: &mut [R::Vector]) {
        let Self {
            inverses,
            lower,
            upper,
            products,
            ..
        } = self;
        // The sweep meets what is left of the diagonal before it has changed.
        lower.product(z, |row, lower| products[row] = lower);
        for color in (0..upper.color_count()).rev() {
            upper.relax(color, z, |z, row, upper| {
                z[row] = apply::<R>(&inverses[row], b[row] - (products[row] + upper));
                products[row] = upper;
            });
        }
    }

    /// The whole matrix times the unknowns `z` that [`Smoother::backward`] has set; undefined in rows that are held.
    pub(super) fn multiply(&mut self, z: &[R::Vector], out: &mut [R::Vector]) {
        let Self {
            diagonals,
            lower,
            products,
            ..
        } = self;
        lower.product(z, |row, lower| {
            let diagonal = apply::<R>(&diagonals[row], z[row]);
            out[row] = diagonal + (lower + products[row]);
        });
    }
}

/// The inverse of a symmetric block, in double precision and with the last digits of its trace added to the diagonal,
/// so that it is as positive as the block was before rounding; zero if it has none or the row is held.
#[inline(always)]
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
