//! [`System`]: the sparse matrix of Newton's method, and its Cholesky factorization.
//!
//! Particles that share a tet share a 3×3 block; only the lower triangle of the symmetric matrix is stored, by columns.
//! Pattern, ordering and symbolic factorization depend on the tets alone and are computed once. A fixed particle has
//! rows of the identity, so that fixing and releasing particles does not change the pattern.
//!
//! Cost: O(tets) to assemble; a factorization of n particles takes about n² operations in three dimensions.

use faer::Side;
use faer::col::ColMut;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use glam::{DMat3, DVec3};

use crate::ReferenceError;

/// A symmetric matrix over the coordinates of particles.
pub(crate) struct System {
    /// Offsets of the neighbors of each particle p: the particles after p that share a tet with it, ascending.
    neighbor_offsets: Vec<usize>,
    neighbors: Vec<u32>,
    /// Column offsets of the lower triangle.
    offsets: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    symbolic: SymbolicLlt<usize>,
}

impl std::fmt::Debug for System {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("System");
        shown.field("entries", &self.values.len());
        shown.finish_non_exhaustive()
    }
}

impl System {
    /// Creates the zero matrix with the pattern of the given tets.
    pub(crate) fn new(
        particles: usize,
        tets: impl Iterator<Item = [u32; 4]>,
    ) -> Result<Self, ReferenceError> {
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for tet in tets {
            for a in tet {
                pairs.extend(tet.into_iter().filter(|&b| a < b).map(|b| [a, b]));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut neighbor_offsets = vec![0; particles + 1];
        for [a, _] in &pairs {
            neighbor_offsets[*a as usize + 1] += 1;
        }
        for p in 0..particles {
            neighbor_offsets[p + 1] += neighbor_offsets[p];
        }
        let neighbors: Vec<u32> = pairs.into_iter().map(|[_, b]| b).collect();

        let (mut offsets, mut rows) = (vec![0], Vec::new());
        for p in 0..particles {
            for k in 0..3 {
                rows.extend(3 * p + k..3 * p + 3);
                let later = &neighbors[neighbor_offsets[p]..neighbor_offsets[p + 1]];
                rows.extend(
                    later
                        .iter()
                        .flat_map(|&r| 3 * r as usize..3 * r as usize + 3),
                );
                offsets.push(rows.len());
            }
        }
        let (n, values) = (3 * particles, vec![0.0; rows.len()]);
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &offsets, None, &rows);
        let symbolic = SymbolicLlt::try_new(pattern, Side::Lower)
            .map_err(|_| ReferenceError::Memory { particles })?;
        Ok(Self {
            neighbor_offsets,
            neighbors,
            offsets,
            rows,
            values,
            symbolic,
        })
    }

    /// Sets all entries to zero.
    pub(crate) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds a value to the diagonal entries of a particle.
    pub(crate) fn add_diagonal(&mut self, p: usize, value: f64) {
        for k in 0..3 {
            let start = self.offsets[3 * p + k];
            self.values[start] += value;
        }
    }

    /// Adds a block at row particle r and column particle c, r not before c; of a diagonal block only the lower
    /// triangle.
    pub(crate) fn add(&mut self, r: u32, c: u32, block: DMat3) {
        let p = c as usize;
        let place = (r != c).then(|| {
            let range = self.neighbor_offsets[p]..self.neighbor_offsets[p + 1];
            let found = self.neighbors[range].binary_search(&r);
            found.expect("particles of one tet are neighbors")
        });
        for (k, column) in block.to_cols_array_2d().into_iter().enumerate() {
            let start = self.offsets[3 * p + k];
            let (start, column) = match place {
                Some(i) => (start + 3 - k + 3 * i, &column[..]),
                None => (start, &column[k..]),
            };
            for (entry, value) in self.values[start..].iter_mut().zip(column) {
                *entry += value;
            }
        }
    }

    /// Solves for a right-hand side in place; `Ok(false)` if the matrix is not positive definite.
    pub(crate) fn solve(&self, x: &mut [DVec3]) -> Result<bool, ReferenceError> {
        let n = 3 * x.len();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.offsets, None, &self.rows);
        let matrix = SparseColMatRef::new(pattern, &self.values);
        let factor = match Llt::try_new_with_symbolic(self.symbolic.clone(), matrix, Side::Lower) {
            Ok(factor) => factor,
            Err(LltError::Numeric(_)) => return Ok(false),
            Err(LltError::Generic(_)) => {
                return Err(ReferenceError::Memory { particles: x.len() });
            }
        };
        let mut flat: Vec<f64> = x.iter().flat_map(|v| v.to_array()).collect();
        factor.solve_in_place(ColMut::from_slice_mut(&mut flat));
        for (v, &solved) in x.iter_mut().zip(flat.as_chunks().0) {
            *v = DVec3::from_array(solved);
        }
        Ok(x.iter().all(|v| v.is_finite()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Matrix of a row of tets with `diagonal` on the diagonal and random symmetric blocks elsewhere.
    fn system(tets: u32, diagonal: f64) -> (System, Vec<Vec<f64>>) {
        let n = tets as usize + 3;
        let mut system =
            System::new(n, (0..tets).map(|t| [t + 2, t, t + 3, t + 1])).expect("small");
        let mut dense = vec![vec![0.0; 3 * n]; 3 * n];
        let mut seed = 1u32;
        let mut next = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1u32 << 23) - 1.0
        };
        for c in 0..tets + 3 {
            for r in c..(c + 4).min(tets + 3) {
                let mut block = DMat3::from_cols_array(&std::array::from_fn(|_| next()));
                if r == c {
                    block = block + block.transpose();
                    system.add_diagonal(c as usize, diagonal);
                }
                system.add(r, c, block);
                for i in 0..3 {
                    for j in 0..3 {
                        let (row, column) = (3 * r as usize + i, 3 * c as usize + j);
                        dense[row][column] = block.col(j)[i] + diagonal * f64::from(row == column);
                        dense[column][row] = dense[row][column];
                    }
                }
            }
        }
        (system, dense)
    }

    /// Covers both kinds of factorization that the library chooses from, for thin and for thick factors. The matrices
    /// are diagonally dominant with a condition number below 10.
    #[test]
    fn solutions_solve_the_dense_system() {
        for tets in [1, 7, 200] {
            let (system, dense) = system(tets, 40.0);
            let right: Vec<DVec3> = (0..tets + 3)
                .map(|p| DVec3::new(1.0, f64::from(p), -2.0))
                .collect();
            let mut x = right.clone();
            assert_eq!(system.solve(&mut x), Ok(true));
            let flat: Vec<f64> = x.iter().flat_map(|v| v.to_array()).collect();
            for (p, b) in right.iter().enumerate() {
                for k in 0..3 {
                    let product: f64 = dense[3 * p + k].iter().zip(&flat).map(|(a, x)| a * x).sum();
                    assert!((product - b[k]).abs() < 1e-12 * f64::from(tets + 3));
                }
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        for tets in [1, 7, 200] {
            let (system, _) = system(tets, 0.0);
            assert_eq!(
                system.solve(&mut vec![DVec3::ONE; tets as usize + 3]),
                Ok(false)
            );
        }
    }
}
