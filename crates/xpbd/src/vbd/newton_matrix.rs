//! The matrix and the forces of a Newton step, as [`Blocks`].
//!
//! Rows are filled from the terms of the stars, every row by itself: no two threads write the same block, and each sum
//! has one order. Cost: O(pairs of particles and tets).

use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::Block;
use super::hessian::held_excess;
use super::matrix::{Blocks, each_row};
use super::row_slices::row_slices;
use super::vertex_stars::VertexStars;
use crate::float::{load, weight};
use crate::wide::wide;
use crate::{Float, Solver};

/// Tets a thread takes at a time.
const PARALLEL_TETS: usize = 1024;

impl<R: Float> Blocks<R> {
    /// Fills the matrix up to its diagonal with the semidefinite second derivatives of the potential, and `force` with
    /// what is left over of the forces. Rows of particles that are `held` are zero up to there, and so is their force.
    pub(super) fn fill(
        &mut self,
        solver: &Solver<R>,
        stars: &VertexStars<R>,
        time: R,
        held: &[bool],
        force: &mut [R::Vector],
    ) {
        self.excess.resize(solver.tet_count(), R::ZERO);
        let tets = solver.tets.list.par_chunks(PARALLEL_TETS);
        let excess = self.excess.par_chunks_mut(PARALLEL_TETS);
        tets.zip(excess).for_each(|(tets, excess)| {
            wide(
                #[inline(always)]
                || {
                    for (tet, excess) in tets.iter().zip(excess) {
                        let [a, b, c, d] = tet.particles;
                        let at = |p: u32| load::<R>(&solver.particles.cells[p as usize]);
                        *excess = held_excess(tet, [at(a), at(b), at(c), at(d)]);
                    }
                },
            );
        });
        let Self {
            offsets,
            upper,
            columns,
            blocks,
            block_indices,
            excess,
            ..
        } = self;
        let mut rest = &mut force[..];
        let slices: Vec<_> = row_slices(offsets, blocks)
            .into_iter()
            .map(|(range, blocks)| {
                let (force, later) = std::mem::take(&mut rest).split_at_mut(range.len());
                rest = later;
                (range, blocks, force)
            })
            .collect();
        let fill = Fill {
            solver,
            stars,
            time,
            per_time_squared: R::ONE / (time * time),
            excess,
        };
        slices.into_par_iter().for_each(|(range, blocks, force)| {
            let first = offsets[range.start];
            wide(
                #[inline(always)]
                || {
                    for (row, force) in range.zip(force) {
                        let blocks = &mut blocks[offsets[row] - first..offsets[row + 1] - first];
                        blocks.fill([R::Vector::default(); 3]);
                        *force = R::Vector::default();
                        if held[row] {
                            continue;
                        }
                        let lower = upper[row] - offsets[row];
                        *force = fill.row(row, lower, block_indices, blocks);
                        if let Some(viscosity) = &stars.viscosity {
                            viscosity.add_blocks(row, blocks);
                            *force += viscosity.force(row, &stars.data.order, |p| {
                                load::<R>(&solver.particles.cells[p]) - solver.particles.previous[p]
                            });
                        }
                        if !stars.data.constraints.is_empty() {
                            let columns = &columns[offsets[row]..offsets[row + 1]];
                            let terms = &stars.data.constraints;
                            terms.add_row(solver, &stars.data.order, row, columns, blocks, force);
                        }
                    }
                },
            );
        });
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
        each_row(
            force,
            PARALLEL_ROWS,
            #[inline(always)]
            |row| {
                if held[row] {
                    return R::Vector::default();
                }
                let p = stars.data.order[row] as usize;
                let particle = &solver.particles.cells[p];
                let x = load::<R>(particle);
                let free = solver.particles.previous[p] + solver.particles.velocities[p] * time;
                let mut force = (free - x) * (per_time_squared / weight::<R>(particle));
                for term in stars.data.of(row) {
                    force += term.at(&solver.particles, x).force;
                }
                if let Some(viscosity) = &stars.viscosity {
                    force += viscosity.force(row, &stars.data.order, |p| {
                        load::<R>(&solver.particles.cells[p]) - solver.particles.previous[p]
                    });
                }
                if !stars.data.constraints.is_empty() {
                    force += stars.data.constraints.force(solver, &stars.data.order, row);
                }
                force
            },
        );
    }
}

/// What the rows of tets and inertia are filled from.
struct Fill<'a, R: Float> {
    solver: &'a Solver<R>,
    stars: &'a VertexStars<R>,
    time: R,
    per_time_squared: R,
    /// The held excess of each tet.
    excess: &'a [R],
}

impl<R: Float> Fill<'_, R> {
    /// Adds the terms of a row to the diagonal and to those of its blocks that come before number `lower`, and returns
    /// the force.
    #[inline(always)]
    fn row(
        &self,
        row: usize,
        lower: usize,
        block_indices: &[[u32; 3]],
        blocks: &mut [Block<R>],
    ) -> R::Vector {
        let data = &self.stars.data;
        let particles = &self.solver.particles;
        let p = data.order[row] as usize;
        let particle = &particles.cells[p];
        let x = load::<R>(particle);
        let inertia = self.per_time_squared / weight::<R>(particle);
        let free = particles.previous[p] + particles.velocities[p] * self.time;
        let mut force = (free - x) * inertia;
        let mut isotropic = inertia;
        // xx, xy, xz, yy, yz, zz.
        let mut h = [R::ZERO; 6];
        let pairs = data.offsets[row]..data.offsets[row + 1];
        let tets = data.tets[pairs.clone()].iter().zip(&block_indices[pairs]);
        for (term, (&tet, &[ia, ib, ic])) in data.of(row).iter().zip(tets) {
            let corner = term.at(particles, x);
            let ([a, b, c], slope) = (corner.others, corner.slope);
            force += corner.force;
            let [wa, wb, wc] = term.pulls;
            isotropic -= wa + wb + wc;
            // Gradients of √(lV) det F at this particle (minus slope) and at the others.
            let held = term.slope * self.excess[tet as usize];
            let [u, v, w] = R::components(slope);
            h[0] += u * u;
            h[1] += u * v;
            h[2] += u * w;
            h[3] += v * v;
            h[4] += v * w;
            h[5] += w * w;
            let mut add = |block: u32, b: R::Vector, c: R::Vector, pull: R| {
                if block as usize >= lower {
                    return;
                }
                let [x, y, z] = R::components(R::cross(b, c) * -term.slope);
                // The second derivative of det F by this particle and a is that of -n / 6V.
                let [p, q, r] = R::components((c - b) * -held);
                let block = &mut blocks[block as usize];
                block[0] += slope * x + R::vector(pull, r, -q);
                block[1] += slope * y + R::vector(-r, pull, p);
                block[2] += slope * z + R::vector(q, -p, pull);
            };
            add(ia, b, c, wa);
            add(ib, c, a, wb);
            add(ic, a, b, wc);
        }
        let [xx, xy, xz, yy, yz, zz] = h;
        blocks[0] = [
            R::vector(xx + isotropic, xy, xz),
            R::vector(xy, yy + isotropic, yz),
            R::vector(xz, yz, zz + isotropic),
        ];
        force
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_graph::{Clustering, ColorId, Coloring, Schedule};

    use super::*;
    use crate::vbd::smoother::Smoother;
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
        let order = stars.data.order.clone();
        let mut blocks = Blocks::new(&stars.data);
        let settings = VbdSettings::new(0.1, 1);
        let step = ImplicitStep::new(&mut solver, &mut stars, &settings).expect("sound");
        let mut forces = vec![DVec3::ZERO; 5];
        blocks.fill(step.solver, step.stars, 0.1, &[false; 5], &mut forces);
        blocks.mirror();
        let mut exact = Vec::new();
        step.forces(&mut exact);
        for (row, &p) in order.iter().enumerate() {
            assert!((forces[row] - exact[p as usize]).length() < 1e-11 * stuff.young_modulus);
        }
        let mut product = vec![DVec3::ZERO; 5];
        // What a cycle of the smoother says of the matrix times its result, against all rows.
        let mut smoother = Smoother::default();
        smoother.prepare(&blocks, &[0, 1, 2, 3, 4, 5], &[false; 5]);
        let (mut result, mut image) = (vec![DVec3::ZERO; 5], vec![DVec3::ZERO; 5]);
        smoother.forward(&forces, &mut result);
        for (k, x) in (1u8..).zip(&mut result) {
            *x += DVec3::new(1e-3, -2e-3, 3e-3) * f64::from(k);
        }
        smoother.backward(&forces, &mut result);
        smoother.multiply(&result, &mut image);
        blocks.multiply(&result, &mut product);
        for (image, product) in image.iter().zip(&product) {
            assert!((*image - *product).length() < 1e-12 * product.length().max(1.0));
        }
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
