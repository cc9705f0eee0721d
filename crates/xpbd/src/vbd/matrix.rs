//! [`Blocks`]: the matrix of a Newton step, one 3×3 block for each pair of particles with a common tet.
//!
//! Rows and columns follow the solving order of the stars, so colors are contiguous and rows are filled from the terms,
//! every row by itself: no two threads write the same block, and each sum has one order. What is right of the diagonal
//! is copied from the left. Cost: 9 numbers an edge and direction; a product is twice as many operations as numbers.

use std::ops::Range;

use rayon::prelude::*;

use super::VertexStars;
use super::block::{Block, add_cross, add_isotropic, add_outer, apply};
use super::hessian::held_excess;
use crate::float::{load, weight};
use crate::{Float, Solver};

/// Rows a thread takes at a time.
pub(super) const PARALLEL_ROWS: usize = 512;

/// A symmetric matrix of blocks with the pattern of a mesh.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Blocks<R: Float> {
    /// Where the blocks of each row end, a 0 before the first.
    pub(super) offsets: Vec<usize>,
    /// Where the blocks right of the diagonal begin in each row.
    upper: Vec<usize>,
    /// Where the transpose of each block right of the diagonal is, row by row.
    mirrors: Vec<u32>,
    /// The column of each block; the diagonal comes first in its row, the others ascend.
    pub(super) columns: Vec<u32>,
    pub(super) blocks: Vec<Block<R>>,
    /// For each term, the indices of its three blocks within their row.
    pub(super) block_indices: Vec<[u32; 3]>,
    /// The held excess of each tet.
    excess: Vec<R>,
}

impl<R: Float> Blocks<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.offsets)
            + size_of_val(&*self.upper)
            + size_of_val(&*self.mirrors)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.blocks)
            + size_of_val(&*self.block_indices)
            + size_of_val(&*self.excess)
    }

    /// The pattern of some stars; no values yet. O(pairs + blocks log valence).
    pub(super) fn new(stars: &VertexStars<R>) -> Self {
        let mut blocks = Self {
            offsets: Vec::new(),
            upper: Vec::new(),
            mirrors: Vec::new(),
            columns: Vec::new(),
            blocks: Vec::new(),
            block_indices: Vec::new(),
            excess: Vec::new(),
        };
        blocks.sync(stars);
        blocks
    }

    /// Takes the pattern of other stars; memory is used again. O(pairs + blocks log valence).
    pub(super) fn sync(&mut self, stars: &VertexStars<R>) {
        let Self {
            offsets,
            upper,
            mirrors,
            columns,
            blocks,
            block_indices,
            ..
        } = self;
        let rows = stars.order.len();
        let mut row_of = vec![0u32; rows];
        for (row, &p) in (0u32..).zip(&stars.order) {
            row_of[p as usize] = row;
        }
        offsets.clear();
        offsets.push(0);
        upper.clear();
        columns.clear();
        block_indices.clear();
        // Which row has seen a column last, and where the column's block is in that row.
        let mut seen = vec![(u32::MAX, 0u32); rows];
        for (row, diagonal) in (0..rows).zip(0u32..) {
            let first = columns.len();
            columns.push(diagonal);
            seen[row].0 = diagonal;
            let of_tets = stars.of(row).iter().flat_map(|term| term.others);
            for p in of_tets.chain(stars.constraints.neighbors(row)) {
                let column = row_of[p as usize];
                let mark = &mut seen[column as usize].0;
                if *mark != diagonal {
                    *mark = diagonal;
                    columns.push(column);
                }
            }
            let beside = &mut columns[first + 1..];
            beside.sort_unstable();
            upper.push(first + 1 + beside.partition_point(|&column| column < diagonal));
            for (block, &column) in (1u32..).zip(&*beside) {
                seen[column as usize].1 = block;
            }
            let terms = stars.of(row).iter();
            block_indices
                .extend(terms.map(|term| term.others.map(|p| seen[row_of[p as usize] as usize].1)));
            offsets.push(columns.len());
        }
        blocks.clear();
        blocks.resize(columns.len(), [R::Vector::default(); 3]);
        // Rows come in ascending order, so the transposes in a row are met from its first block on.
        let mut next: Vec<usize> = offsets[..rows].iter().map(|first| first + 1).collect();
        mirrors.clear();
        for (row, &from) in upper.iter().enumerate() {
            for &column in &columns[from..offsets[row + 1]] {
                let block = &mut next[column as usize];
                mirrors.push(u32::try_from(*block).expect("blocks are numbered in 32 bits"));
                *block += 1;
            }
        }
    }

    /// Fills the matrix with the semidefinite second derivatives of the potential, and `force` with what is left over
    /// of the forces. Rows of particles that `held` are all zero, and so is their force.
    pub(super) fn fill(
        &mut self,
        solver: &Solver<R>,
        stars: &VertexStars<R>,
        time: R,
        held: &[bool],
        force: &mut [R::Vector],
    ) {
        let tets = solver.tets.list.par_iter().with_min_len(PARALLEL_ROWS);
        tets.map(|tet| {
            held_excess(
                tet,
                tet.particles
                    .map(|p| load::<R>(&solver.particles.cells[p as usize])),
            )
        })
        .collect_into_vec(&mut self.excess);
        let Self {
            offsets,
            upper,
            columns,
            blocks,
            block_indices,
            excess,
            ..
        } = self;
        let per_time_squared = R::ONE / (time * time);
        let mut rest = &mut force[..];
        let slices: Vec<_> = row_slices(offsets, blocks)
            .into_iter()
            .map(|(range, blocks)| {
                let (force, later) = std::mem::take(&mut rest).split_at_mut(range.len());
                rest = later;
                (range, blocks, force)
            })
            .collect();
        slices.into_par_iter().for_each(|(range, blocks, force)| {
            let first = offsets[range.start];
            for (row, force) in range.zip(force) {
                let blocks = &mut blocks[offsets[row] - first..offsets[row + 1] - first];
                blocks.fill([R::Vector::default(); 3]);
                *force = R::Vector::default();
                if held[row] {
                    continue;
                }
                let p = stars.order[row] as usize;
                let particle = &solver.particles.cells[p];
                let x = load::<R>(particle);
                let inertia = per_time_squared / weight::<R>(particle);
                let free = solver.particles.previous[p] + solver.particles.velocities[p] * time;
                *force = (free - x) * inertia;
                let mut isotropic = inertia;
                let lower = upper[row] - offsets[row];
                let pairs = stars.offsets[row]..stars.offsets[row + 1];
                for pair in pairs {
                    let term = &stars.terms[pair];
                    let corner = term.at(&solver.particles, x);
                    let ([a, b, c], slope) = (corner.others, corner.slope);
                    *force += corner.force;
                    let [wa, wb, wc] = term.pulls;
                    isotropic -= wa + wb + wc;
                    // Gradients of √(lV) det F at this particle (minus slope) and at the others.
                    let held = term.slope * excess[stars.tets[pair] as usize];
                    add_outer::<R>(&mut blocks[0], slope, slope);
                    let around = [(a, b, c, wa), (b, c, a, wb), (c, a, b, wc)];
                    for ((_, b, c, pull), block) in around.into_iter().zip(block_indices[pair]) {
                        if block as usize >= lower {
                            continue;
                        }
                        let gradient = R::cross(b, c) * term.slope;
                        let block = &mut blocks[block as usize];
                        add_outer::<R>(block, -slope, gradient);
                        add_isotropic::<R>(block, pull);
                        // The second derivative of det F by this particle and a is that of -n / 6V.
                        add_cross::<R>(block, (c - b) * -held);
                    }
                }
                add_isotropic::<R>(&mut blocks[0], isotropic);
                if let Some(viscosity) = &stars.viscosity {
                    viscosity.add_blocks(row, blocks);
                    *force += viscosity.force(row, &stars.order, |p| {
                        load::<R>(&solver.particles.cells[p]) - solver.particles.previous[p]
                    });
                }
                if !stars.constraints.is_empty() {
                    let columns = &columns[offsets[row]..offsets[row + 1]];
                    let terms = &stars.constraints;
                    terms.add_row(solver, &stars.order, row, columns, blocks, force);
                }
            }
        });
        self.mirror(held);
    }

    /// The forces that [`Blocks::fill`] says are left over, without the matrix.
    pub(super) fn forces(
        &self,
        solver: &Solver<R>,
        stars: &VertexStars<R>,
        time: R,
        held: &[bool],
        force: &mut [R::Vector],
    ) {
        let per_time_squared = R::ONE / (time * time);
        self.each_row(force, |row| {
            if held[row] {
                return R::Vector::default();
            }
            let p = stars.order[row] as usize;
            let particle = &solver.particles.cells[p];
            let x = load::<R>(particle);
            let free = solver.particles.previous[p] + solver.particles.velocities[p] * time;
            let mut force = (free - x) * (per_time_squared / weight::<R>(particle));
            for term in stars.of(row) {
                force += term.at(&solver.particles, x).force;
            }
            if let Some(viscosity) = &stars.viscosity {
                force += viscosity.force(row, &stars.order, |p| {
                    load::<R>(&solver.particles.cells[p]) - solver.particles.previous[p]
                });
            }
            if !stars.constraints.is_empty() {
                force += stars.constraints.force(solver, &stars.order, row);
            }
            force
        });
    }

    /// Copies what is left of the diagonal to its right, but in rows of particles that are held.
    fn mirror(&mut self, held: &[bool]) {
        let mut mirrors = self.mirrors.iter();
        for (row, &held) in held.iter().enumerate() {
            let right = self.upper[row]..self.offsets[row + 1];
            for (block, &mirror) in right.zip(&mut mirrors) {
                if !held {
                    let [a, b, c] = self.blocks[mirror as usize].map(R::components);
                    self.blocks[block] = [
                        R::vector(a[0], b[0], c[0]),
                        R::vector(a[1], b[1], c[1]),
                        R::vector(a[2], b[2], c[2]),
                    ];
                }
            }
        }
    }

    /// `y = A x`.
    pub(super) fn multiply(&self, x: &[R::Vector], y: &mut [R::Vector]) {
        self.each_row(y, |row| {
            let all = self.offsets[row]..self.offsets[row + 1];
            -self.without(R::Vector::default(), all, |column| x[column])
        });
    }

    /// `y = -U x` with U what is right of the diagonal.
    pub(super) fn multiply_upper(&self, x: &[R::Vector], y: &mut [R::Vector]) {
        self.each_row(y, |row| {
            self.without(R::Vector::default(), self.upper(row), |column| x[column])
        });
    }

    fn each_row(&self, y: &mut [R::Vector], value: impl Fn(usize) -> R::Vector + Sync) {
        let rows = y.par_iter_mut().with_min_len(PARALLEL_ROWS).enumerate();
        rows.for_each(|(row, y)| *y = value(row));
    }

    /// `b` less some blocks times the vectors of their columns.
    #[inline]
    pub(super) fn without(
        &self,
        mut b: R::Vector,
        range: Range<usize>,
        x: impl Fn(usize) -> R::Vector,
    ) -> R::Vector {
        for (&column, block) in self.columns[range.clone()].iter().zip(&self.blocks[range]) {
            b = b - apply::<R>(block, x(column as usize));
        }
        b
    }

    /// The blocks of a row left of the diagonal.
    pub(super) fn lower(&self, row: usize) -> Range<usize> {
        self.offsets[row] + 1..self.upper[row]
    }

    /// The blocks of a row right of the diagonal.
    pub(super) fn upper(&self, row: usize) -> Range<usize> {
        self.upper[row]..self.offsets[row + 1]
    }

    /// Whether this is the pattern of as many rows and pairs.
    pub(super) fn belongs_to(&self, stars: &VertexStars<R>) -> bool {
        self.offsets.len() == stars.order.len() + 1 && self.block_indices.len() == stars.terms.len()
    }

    /// The columns and blocks of a row.
    #[inline]
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, &Block<R>)> + Clone {
        let range = self.offsets[row]..self.offsets[row + 1];
        self.columns[range.clone()]
            .iter()
            .map(|&c| c as usize)
            .zip(&self.blocks[range])
    }
}

/// The rows of a matrix in one slice a thread, each with its blocks.
pub(super) fn row_slices<'a, B>(
    offsets: &[usize],
    mut blocks: &'a mut [B],
) -> Vec<(Range<usize>, &'a mut [B])> {
    let rows = offsets.len() - 1;
    let parts = rayon::current_num_threads()
        .min(rows.div_ceil(PARALLEL_ROWS))
        .max(1);
    let mut slices = Vec::with_capacity(parts);
    for part in 0..parts {
        let (start, end) = (rows * part / parts, rows * (part + 1) / parts);
        let (own, later) = blocks.split_at_mut(offsets[end] - offsets[start]);
        blocks = later;
        slices.push((start..end, own));
    }
    slices
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_graph::{Clustering, ColorId, Coloring, Schedule};

    use super::*;
    use crate::{DistanceConstraint, ImplicitStep, Material, Pose, VbdSettings};

    /// Where no pressure is held back (a body stretched a little), the matrix is the second derivative of the
    /// potential: differences of the forces with step 1e-6, good to 1e-9 of the stiffness.
    #[test]
    fn blocks_are_the_slopes_of_the_forces() {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        let mut solver = Solver::<f64>::new(&rest);
        let stuff = Material {
            young_modulus: 1e4,
            poisson_ratio: 0.3,
            density: 1e3,
            damping: 0.02,
        };
        solver.add_material(stuff).expect("a sound material");
        for tet in [[0, 1, 2, 3], [1, 4, 2, 3]] {
            solver.push_tet(tet, tet.map(|p| rest[p as usize]), 0);
        }
        for p in 0..5 {
            solver.set_mass(p, 10.0);
            let x = solver.particles.local(p);
            solver.set_position(
                p,
                DVec3::new(1.05 * x.x + 0.02 * x.y, 1.04 * x.y, 1.06 * x.z),
            );
        }
        let distances = [1e-3, 0.0].map(|compliance| DistanceConstraint {
            particles: [0, 4],
            length: 0.5,
            compliance,
            damping: 0.05,
            tension_only: false,
        });
        let order = Coloring::new(vec![ColorId(0), ColorId(1)]);
        let order = Schedule::new(&Clustering::none(2), &order);
        solver.set_distances(&distances, order).expect("sound");
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        solver.attach(2, handle, 1e-3, 0.2).expect("sound");
        let colors = Coloring::new([0, 1, 2, 3, 4].map(ColorId).to_vec());
        let schedule = Schedule::new(&Clustering::none(5), &colors);
        let mut stars = VertexStars::new(&solver, &schedule).expect("a proper coloring");
        let order = stars.order.clone();
        let mut blocks = Blocks::new(&stars);
        let settings = VbdSettings::new(0.1, 1);
        let step = ImplicitStep::new(&mut solver, &mut stars, &settings).expect("sound");
        let mut forces = vec![DVec3::ZERO; 5];
        blocks.fill(step.solver, step.stars, 0.1, &[false; 5], &mut forces);
        let mut exact = Vec::new();
        step.forces(&mut exact);
        for (row, &p) in order.iter().enumerate() {
            assert!((forces[row] - exact[p as usize]).length() < 1e-11 * stuff.young_modulus);
        }
        let mut product = vec![DVec3::ZERO; 5];
        for (column, &q) in order.iter().enumerate() {
            for axis in DVec3::AXES {
                let mut motion = vec![DVec3::ZERO; 5];
                motion[column] = axis;
                blocks.multiply(&motion, &mut product);
                let x = step.solver.particles.local(q as usize);
                let [low, high] = [-1e-6, 1e-6].map(|h| {
                    step.solver.set_position(q as usize, x + axis * h);
                    step.forces(&mut exact);
                    exact.clone()
                });
                step.solver.set_position(q as usize, x);
                for (row, &p) in order.iter().enumerate() {
                    let slope = (high[p as usize] - low[p as usize]) / 2e-6;
                    let error = (slope + product[row]).length();
                    assert!(error < 1e-8 * stuff.young_modulus, "{p} {q}: {error:e}");
                }
            }
        }
    }
}
