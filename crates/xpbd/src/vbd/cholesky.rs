//! A dense Cholesky factorization for a few hundred unknowns.
//!
//! `A = L Lᵀ`, row by row, so that everything is a dot product of contiguous rows, summed in eight lanes whatever the
//! machine: the bits are the same everywhere. A pivot that has vanished beside its diagonal belongs to an unknown that
//! others already span (the turn of a lump on a line); it is left out. Cost: n³ / 6 multiplications, n² to solve.

/// The factor of a symmetric positive semidefinite matrix.
#[derive(Clone, Debug, Default)]
pub(super) struct Cholesky {
    size: usize,
    /// Lower triangle in full rows; the diagonal holds the inverse, 0 for what is left out.
    factor: Vec<f64>,
}

/// Part of its diagonal that a pivot must keep.
const VANISHED: f64 = 1e-10;

impl Cholesky {
    /// Bytes of the factor.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.factor)
    }

    /// A zero matrix to fill and then factor.
    pub(super) fn reset(&mut self, size: usize) {
        self.size = size;
        self.factor.clear();
        self.factor.resize(size * size, 0.0);
    }

    /// The entries from a column on of a row; only those up to the diagonal count.
    #[inline]
    pub(super) fn row_mut(&mut self, row: usize, column: usize) -> &mut [f64] {
        &mut self.factor[row * self.size + column..(row + 1) * self.size]
    }

    /// Replaces the matrix by its factor.
    pub(super) fn factor(&mut self) {
        let n = self.size;
        for i in 0..n {
            let (above, rest) = self.factor.split_at_mut(i * n);
            let row = &mut rest[..n];
            for j in 0..i {
                let other = &above[j * n..j * n + n];
                row[j] = (row[j] - dot(&row[..j], &other[..j])) * other[j];
            }
            let pivot = row[i] - dot(&row[..i], &row[..i]);
            let sound = pivot.is_finite() && pivot > VANISHED * row[i];
            row[i] = if sound { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }

    /// Solves in place.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let n = self.size;
        for i in 0..n {
            let row = &self.factor[i * n..i * n + n];
            b[i] = (b[i] - dot(&row[..i], &b[..i])) * row[i];
        }
        for i in (0..n).rev() {
            let row = &self.factor[i * n..i * n + n];
            b[i] *= row[i];
            let x = b[i];
            for (b, l) in b[..i].iter_mut().zip(row) {
                *b -= l * x;
            }
        }
    }
}

#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (a, b) in a.zip(b) {
        for k in 0..8 {
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
        cholesky.reset(n);
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
}
