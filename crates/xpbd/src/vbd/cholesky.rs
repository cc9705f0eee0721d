//! A Cholesky factorization within the envelope of a matrix, for a few hundred unknowns that are coupled to each other.
//!
//! `A = L Lᵀ`, row by row, so that everything is a dot product of contiguous rows, summed in eight lanes whatever the
//! machine: the bits are the same everywhere. A row is stored from its first entry on, since L has no entry before that
//! of A: what is not coupled, such as the pieces of a body that was cut, costs as if each had a matrix of its own. A
//! pivot that has vanished beside its diagonal belongs to an unknown that others already span (the turn of an aggregate
//! on a line); it is left out.
//!
//! Source: the envelope method after Jennings 1966. Cost: n³ / 6 multiplications for n coupled unknowns, n² to solve.

use std::ops::Range;

use crate::wide::wide;

/// Lanes of a dot product. Rows begin at a multiple of them, so that no sum depends on what is left out.
const LANES: usize = 8;

/// The factor of a symmetric positive semidefinite matrix.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Cholesky {
    /// The columns that each row stores, and its offset in `factor`.
    rows: Vec<(Range<usize>, usize)>,
    /// The lower triangle by rows; the diagonal holds the inverse, 0 for what is left out.
    factor: Vec<f64>,
}

/// Part of its diagonal that a pivot must keep.
const VANISHED: f64 = 1e-10;

impl Cholesky {
    /// Bytes of the factor.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.rows) + size_of_val(&*self.factor)
    }

    /// A zero matrix to fill and then factor, from the columns in which each row may have entries. They include the
    /// diagonal; what is right of it does not count.
    pub(super) fn reset(&mut self, columns: impl Iterator<Item = Range<usize>>) {
        self.rows.clear();
        let mut offset = 0;
        for columns in columns {
            let stored = columns.start / LANES * LANES..columns.end;
            let width = stored.len();
            self.rows.push((stored, offset));
            offset += width;
        }
        self.factor.clear();
        self.factor.resize(offset, 0.0);
    }

    /// The stored entries of a row from a column on; only those up to the diagonal count.
    #[inline]
    pub(super) fn row_mut(&mut self, row: usize, column: usize) -> &mut [f64] {
        let (columns, offset) = &self.rows[row];
        &mut self.factor[offset + column - columns.start..offset + columns.len()]
    }

    /// The first column of a row, and its entries left of the diagonal.
    fn row(&self, row: usize) -> (usize, &[f64]) {
        let (columns, offset) = &self.rows[row];
        let first = columns.start;
        (first, &self.factor[*offset..offset + row - first])
    }

    /// The entry on the diagonal.
    fn diagonal(&self, row: usize) -> f64 {
        let (columns, offset) = &self.rows[row];
        self.factor[offset + row - columns.start]
    }

    /// Replaces the matrix by its factor.
    pub(super) fn factor(&mut self) {
        wide(
            #[inline(always)]
            || self.factor_rows(),
        );
    }

    #[inline(always)]
    fn factor_rows(&mut self) {
        for (i, (columns, offset)) in self.rows.iter().enumerate() {
            let first = columns.start;
            let (above, rest) = self.factor.split_at_mut(*offset);
            let row = &mut rest[..columns.len()];
            for j in first..i {
                let (others, offset) = &self.rows[j];
                let other = &above[*offset..offset + others.len()];
                let from = first.max(others.start);
                let product = dot(
                    &row[from - first..j - first],
                    &other[from - others.start..j - others.start],
                );
                row[j - first] = (row[j - first] - product) * other[j - others.start];
            }
            let left = &row[..i - first];
            let pivot = row[i - first] - dot(left, left);
            let sound = pivot.is_finite() && pivot > VANISHED * row[i - first];
            row[i - first] = if sound { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }

    /// Solves in place.
    pub(super) fn solve(&self, b: &mut [f64]) {
        wide(
            #[inline(always)]
            || {
                for i in 0..self.rows.len() {
                    let (first, row) = self.row(i);
                    b[i] = (b[i] - dot(row, &b[first..i])) * self.diagonal(i);
                }
                for i in (0..self.rows.len()).rev() {
                    let (first, row) = self.row(i);
                    b[i] *= self.diagonal(i);
                    let x = b[i];
                    for (b, l) in b[first..i].iter_mut().zip(row) {
                        *b -= l * x;
                    }
                }
            },
        );
    }
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut tail = 0.0;
    for (x, y) in a.remainder().iter().zip(b.remainder()) {
        tail += x * y;
    }
    for (a, b) in a.zip(b) {
        for k in 0..LANES {
            lanes[k] += a[k] * b[k];
        }
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (b + f)) + ((c + g) + (d + h)) + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `A = B Bᵀ` with a row of B repeated: the system is singular but consistent, and is solved.
    #[test]
    fn consistent_systems_are_solved() {
        let n = 21;
        let entry = |i: usize, k: usize| {
            (((i * 37 + k * 101) % 97) as f64 / 97.0 - 0.5) + if i == k { 2.0 } else { 0.0 }
        };
        let b = |i: usize, k: usize| entry(if i == 13 { 4 } else { i }, k);
        let a = |i: usize, j: usize| (0..n).map(|k| b(i, k) * b(j, k)).sum::<f64>();
        let mut cholesky = Cholesky::default();
        cholesky.reset((0..n).map(|_| 0..n));
        for i in 0..n {
            for (j, entry) in cholesky.row_mut(i, 0).iter_mut().enumerate() {
                *entry = a(i, j);
            }
        }
        cholesky.factor();
        let x: Vec<f64> = (0..n).map(|i| i as f64).collect();
        let right: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| a(i, j) * x[j]).sum())
            .collect();
        let mut y = right.clone();
        cholesky.solve(&mut y);
        for (i, right) in right.iter().enumerate() {
            let left: f64 = (0..n).map(|j| a(i, j) * y[j]).sum();
            // The matrix is well conditioned but for the repetition.
            assert!((left - right).abs() < 1e-9 * right.abs().max(1.0), "{i}");
        }
    }

    /// Two blocks that are not coupled: with rows that begin at their block and with full ones, to the bit.
    #[test]
    fn uncoupled_rows_are_unchanged_to_the_bit() {
        let blocks = [0..19, 19..32];
        let block = |i: usize| blocks[usize::from(i >= 19)].clone();
        let entry = |i: usize, j: usize| match (block(i).contains(&j), i == j) {
            (_, true) => 9.0,
            (true, false) => ((i * 37 + j * 101 + i * j) % 97) as f64 / 97.0 - 0.5,
            (false, false) => 0.0,
        };
        let solved = |columns: &dyn Fn(usize) -> Range<usize>| {
            let mut cholesky = Cholesky::default();
            cholesky.reset((0..32).map(columns));
            for i in 0..32 {
                let range = columns(i);
                for (j, target) in range.clone().zip(cholesky.row_mut(i, range.start)) {
                    *target = entry(i.max(j), i.min(j));
                }
            }
            cholesky.factor();
            let mut x: Vec<f64> = (0..32).map(|i| (i as f64).sin()).collect();
            cholesky.solve(&mut x);
            (x, cholesky.bytes())
        };
        let (x, bytes) = solved(&block);
        let (full, more) = solved(&|_| 0..32);
        assert_eq!(
            x.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            full.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        );
        assert!(bytes < more);
    }
}
