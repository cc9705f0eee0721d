//! [`Smoother`]: symmetric Gauss-Seidel sweeps over the rows of a matrix, in the colors of the stars.
//!
//! Cost of a cycle: the blocks left of the diagonal twice, those right of it twice.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::{Block, apply, row_product, solve};
use super::matrix::{Blocks, each_row};
use crate::Float;
use crate::float::finite;

/// Rows of a color that a thread relaxes at a time. Waking a thread costs as much as some hundred of them.
const PARALLEL_RELAXED: usize = 512;

/// Last digits of the trace that rounding may have taken from the pivots of a diagonal block.
const ROUNDING: f64 = 4.0;

/// Inverses of the diagonal blocks of a matrix, and what the first half of a cycle has left over.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Smoother<R: Float> {
    /// The inverse of the diagonal block of each row.
    inverses: Vec<Block<R>>,
    residual: Vec<R::Vector>,
}

impl<R: Float> Smoother<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.inverses) + size_of_val(&*self.residual)
    }

    /// Takes the values of a matrix. Rows that are held get no inverse, so their unknowns stay zero.
    pub(super) fn prepare(&mut self, matrix: &Blocks<R>, held: &[bool]) {
        (0..held.len())
            .into_par_iter()
            .with_min_len(PARALLEL_ROWS)
            .map(|row| inverse::<R>(&matrix.blocks[matrix.offsets[row]], held[row]))
            .collect_into_vec(&mut self.inverses);
        self.residual.resize(held.len(), R::Vector::default());
    }

    /// The first half of a cycle for the right side `b`: sets the unknowns `z` by a sweep through all colors, from zero,
    /// and returns what that leaves over of each row.
    pub(super) fn forward(
        &mut self,
        matrix: &Blocks<R>,
        colors: &[usize],
        b: &[R::Vector],
        z: &mut [R::Vector],
    ) -> &[R::Vector] {
        let inverses = &self.inverses;
        // From zero, nothing right of the diagonal matters yet, and nothing but that is left over afterwards.
        for color in colors.windows(2) {
            let (before, rest) = z.split_at_mut(color[0]);
            each_row(
                &mut rest[..color[1] - color[0]],
                PARALLEL_RELAXED,
                #[inline(always)]
                |k| {
                    let row = color[0] + k;
                    let lower = product(matrix, matrix.lower(row), before, 0);
                    apply::<R>(&inverses[row], b[row] - lower)
                },
            );
        }
        each_row(
            &mut self.residual,
            PARALLEL_ROWS,
            #[inline(always)]
            |row| -product(matrix, matrix.upper(row), z, 0),
        );
        &self.residual
    }

    /// The second half: a sweep through all colors backwards.
    pub(super) fn backward(
        &self,
        matrix: &Blocks<R>,
        colors: &[usize],
        b: &[R::Vector],
        z: &mut [R::Vector],
    ) {
        let inverses = &self.inverses;
        for color in colors.windows(2).rev() {
            let (before, rest) = z.split_at_mut(color[0]);
            let (own, after) = rest.split_at_mut(color[1] - color[0]);
            let (before, after) = (&*before, &*after);
            each_row(
                own,
                PARALLEL_RELAXED,
                #[inline(always)]
                |k| {
                    let row = color[0] + k;
                    let lower = product(matrix, matrix.lower(row), before, 0);
                    let upper = product(matrix, matrix.upper(row), after, color[1]);
                    apply::<R>(&inverses[row], b[row] - (lower + upper))
                },
            );
        }
    }
}

/// Some blocks of a row times the unknowns of their columns, of which `z` has those from `first` on.
#[inline(always)]
fn product<R: Float>(
    matrix: &Blocks<R>,
    range: Range<usize>,
    z: &[R::Vector],
    first: usize,
) -> R::Vector {
    let (columns, blocks) = (&matrix.columns[range.clone()], &matrix.blocks[range]);
    row_product::<R>(columns, blocks, |column| z[column - first])
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
