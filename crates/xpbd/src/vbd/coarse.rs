//! [`Coarse`]: the affine motions of aggregates, their Galerkin matrix `Pᵀ A P` and its factor.
//!
//! An aggregate has twelve motions: `δx = u₀ + (r₁ u₁ + r₂ u₂ + r₃ u₃)` with r the place of the particle relative to
//! the aggregate's center over its radius. They contain its turns, stretches and shears, of which bending and bulging
//! of the body are made. A block of A between two particles contributes itself times the products of their r: no more
//! than 16 scaled copies. The matrix of a connected piece is dense, because its aggregates are few.
//!
//! The factor is kept from one correction to the next until conjugate gradients converge at less than [`AGED`] of their
//! rate with the new factor: a preconditioner need not be that of the present matrix, only symmetric and positive.
//! Affine motions also remain valid when the body rotates. A cut changes neither aggregates nor factor: new particles
//! join the aggregates of their neighbors, and all aggregates are grown again once the factor has aged.

use super::cholesky::Cholesky;
use super::matrix::Blocks;
use crate::Float;

/// A factor is stale when conjugate gradients converge at less than this part of the rate that they had when it was
/// new.
const AGED: f64 = 0.75;

/// In a frame with a cut, which has a new matrix to fill, a factor is stale only below this part of its first rate. Faces
/// that open slow conjugate gradients down with a new factor as well.
const AGED_IN_CUT: f64 = 0.25;

/// Iterations from which the rate of convergence of a solution is judged: fewer say nothing about the factor.
const RATED_ITERATIONS: u32 = 8;

/// Solutions after which a factor is stale in any case: it may be that of a state that was worse to begin with.
const OLDEST: u32 = 128;

/// The aggregate of a row that has none yet.
const NONE: u32 = u32::MAX;

/// Motions of an aggregate: four vectors.
const VECTORS: usize = 4;

/// What corrects a body aggregate by aggregate.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Coarse {
    /// The aggregate of each row.
    of: Vec<u32>,
    count: usize,
    /// 1, r₁, r₂, r₃ of each row, at the positions that the factor is of.
    weights: Vec<[f64; VECTORS]>,
    cholesky: Cholesky,
    values: Vec<f64>,
    age: Age,
    /// Whether the mesh has changed since the aggregates were grown.
    outdated: bool,
}

/// How well the factor still does.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Age {
    /// The rate of conjugate gradients with the new factor; `None` before it is known.
    first: Option<f64>,
    /// Solutions with it.
    solutions: u32,
    /// The rate of the last solution over the first one.
    relative: f64,
    /// Whether there is a factor and every row has an aggregate.
    usable: bool,
}

impl Coarse {
    /// Bytes of lists and factor.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.of)
            + size_of_val(&*self.weights)
            + size_of_val(&*self.values)
            + self.cholesky.bytes()
    }

    pub(super) fn new(of: Vec<u32>, count: usize) -> Self {
        let weights = vec![[0.0; VECTORS]; of.len()];
        Self {
            of,
            count,
            weights,
            cholesky: Cholesky::default(),
            values: Vec::new(),
            age: Age::default(),
            outdated: false,
        }
    }

    /// Whether the mesh has changed since the aggregates were grown.
    pub(super) fn is_outdated(&self) -> bool {
        self.outdated
    }

    /// Follows another order of the particles, of which some are new: these join aggregates of their neighbors, with
    /// the mean of their motions. O(blocks).
    pub(super) fn sync<R: Float>(&mut self, old: &[u32], new: &[u32], matrix: &Blocks<R>) {
        self.outdated = true;
        let mut before = vec![(NONE, [0.0; VECTORS]); new.len()];
        for ((&p, &a), &weight) in old.iter().zip(&self.of).zip(&self.weights) {
            before[p as usize] = (a, weight);
        }
        self.of.clear();
        self.weights.clear();
        for &p in new {
            let (a, weight) = before[p as usize];
            self.of.push(a);
            self.weights.push(weight);
        }
        let mut joining: Vec<usize> = (0..new.len()).filter(|&row| self.of[row] == NONE).collect();
        while !joining.is_empty() {
            let waiting = joining.len();
            let mut sums: Vec<(usize, u32, [f64; VECTORS])> = Vec::new();
            joining.retain(|&row| {
                let around = matrix.row(row).map(|(column, _)| column);
                let host = around.clone().map(|column| self.of[column]).min();
                let Some(host) = host.filter(|&host| host != NONE) else {
                    return true;
                };
                let hosts = around.filter(|&column| self.of[column] == host);
                let mut weight = [0.0; VECTORS];
                for column in hosts {
                    for (sum, part) in weight.iter_mut().zip(self.weights[column]) {
                        *sum += part;
                    }
                }
                // The first motion, a shift, is 1 everywhere and counts the neighbors.
                let count = weight[0].max(1.0);
                sums.push((row, host, weight.map(|sum| sum / count)));
                false
            });
            for (row, host, weight) in sums {
                (self.of[row], self.weights[row]) = (host, weight);
            }
            // A piece of new particles only.
            if joining.len() == waiting {
                self.age.usable = false;
                return;
            }
        }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Whether motions and factor are rebuilt for the next solution. In a frame with a cut they wait, unless they have
    /// become much worse.
    pub(super) fn is_stale(&self, is_cut: bool) -> bool {
        if !self.age.usable {
            return true;
        }
        match is_cut {
            true => self.age.relative < AGED_IN_CUT,
            false => self.age.relative < AGED || self.age.solutions >= OLDEST,
        }
    }

    /// Notes that a solution with this factor took `iterations` to bring the energy that is left to the part `left`.
    pub(super) fn note(&mut self, iterations: u32, left: f64) {
        self.age.solutions += 1;
        if iterations >= RATED_ITERATIONS && left > 0.0 {
            let rate = -left.ln() / f64::from(iterations);
            self.age.relative = rate / *self.age.first.get_or_insert(rate);
        }
    }

    /// Takes the motions at the positions `x` of the rows.
    pub(super) fn place(&mut self, x: impl Fn(usize) -> glam::DVec3) {
        let mut centers = vec![(glam::DVec3::ZERO, 0.0); self.count];
        for (row, &a) in self.of.iter().enumerate() {
            let center = &mut centers[a as usize];
            *center = (center.0 + x(row), center.1 + 1.0);
        }
        let mut radii = vec![0.0f64; self.count];
        for (row, &a) in self.of.iter().enumerate() {
            let center = centers[a as usize];
            let radius = &mut radii[a as usize];
            *radius = radius.max((x(row) - center.0 / center.1).length());
        }
        for (row, &a) in self.of.iter().enumerate() {
            let (center, radius) = (centers[a as usize], radii[a as usize]);
            let r = (x(row) - center.0 / center.1) / radius;
            let r = if r.is_finite() { r } else { glam::DVec3::ZERO };
            self.weights[row] = [1.0, r.x, r.y, r.z];
        }
    }

    /// Assembles and factors the matrix; held rows take no part.
    pub(super) fn assemble<R: Float>(&mut self, matrix: &Blocks<R>, held: &[bool]) {
        const WIDTH: usize = 3 * VECTORS;
        // Aggregates of different pieces are not coupled, and those of a piece have consecutive numbers.
        let mut firsts: Vec<u32> = (0..).take(self.count).collect();
        for (row, &a) in self.of.iter().enumerate() {
            for (column, _) in matrix.row(row) {
                let first = &mut firsts[a as usize];
                *first = self.of[column].min(*first);
            }
        }
        let of_aggregate = |(a, first)| {
            let columns = WIDTH * first as usize..WIDTH * (a + 1);
            std::iter::repeat_n(columns, WIDTH)
        };
        self.cholesky
            .reset(firsts.into_iter().enumerate().flat_map(of_aggregate));
        // The blocks of a row, times the motions of their columns, by aggregate: three rows of twelve numbers each.
        let mut sums: Vec<(u32, [[f64; WIDTH]; 3])> = Vec::new();
        for (row, &a) in self.of.iter().enumerate() {
            let left = self.weights[row];
            if held[row] {
                continue;
            }
            sums.clear();
            for (column, block) in matrix.row(row) {
                let b = self.of[column];
                // The lower triangle is enough.
                if b > a || held[column] {
                    continue;
                }
                let k = sums.iter().position(|sum| sum.0 == b).unwrap_or(sums.len());
                if k == sums.len() {
                    sums.push((b, [[0.0; WIDTH]; 3]));
                }
                // By rows.
                let [x, y, z] = block.map(|v| R::components(v).map(R::to_f64));
                let right = self.weights[column];
                for (k, sums) in sums[k].1.iter_mut().enumerate() {
                    let entries = [x[k], y[k], z[k]];
                    for (sums, right) in sums.chunks_exact_mut(3).zip(right) {
                        for (sum, entry) in sums.iter_mut().zip(entries) {
                            *sum += right * entry;
                        }
                    }
                }
            }
            for (b, sums) in &sums {
                for (i, left) in left.into_iter().enumerate() {
                    for (k, sums) in sums.iter().enumerate() {
                        let at = WIDTH * a as usize + 3 * i + k;
                        let target = self.cholesky.row_mut(at, WIDTH * *b as usize);
                        for (target, sum) in target.iter_mut().zip(sums) {
                            *target += left * sum;
                        }
                    }
                }
            }
        }
        self.cholesky.factor();
        self.age = Age {
            usable: true,
            relative: 1.0,
            ..Age::default()
        };
    }

    /// Adds the coarse correction for the forces `r` to `z`, but in held rows.
    ///
    /// With the rows left out on both sides this is symmetric and semidefinite whatever matrix the factor is of.
    pub(super) fn correct<R: Float>(
        &mut self,
        r: &[R::Vector],
        z: &mut [R::Vector],
        held: &[bool],
    ) {
        self.values.clear();
        self.values.resize(3 * VECTORS * self.count, 0.0);
        for (row, &a) in self.of.iter().enumerate() {
            if held[row] {
                continue;
            }
            let target = &mut self.values[3 * VECTORS * a as usize..][..3 * VECTORS];
            let force = R::components(r[row]).map(R::to_f64);
            for (j, weight) in self.weights[row].into_iter().enumerate() {
                for k in 0..3 {
                    target[3 * j + k] += weight * force[k];
                }
            }
        }
        self.cholesky.solve(&mut self.values);
        for (row, &a) in self.of.iter().enumerate() {
            if held[row] {
                continue;
            }
            let source = &self.values[3 * VECTORS * a as usize..][..3 * VECTORS];
            let mut motion = [0.0; 3];
            for (j, weight) in self.weights[row].into_iter().enumerate() {
                for k in 0..3 {
                    motion[k] += weight * source[3 * j + k];
                }
            }
            let [a, b, c] = motion.map(R::from_f64);
            z[row] += R::vector(a, b, c);
        }
    }
}
