//! The matrix and the forces of a Newton step, as [`Blocks`].
//!
//! Rows are filled from the terms of the stars, every row by itself: no two threads write the same block, and each sum
//! has one order. Cost: O(pairs of particles and tets).

use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::{add_cross, add_isotropic, add_outer};
use super::hessian::held_excess;
use super::matrix::Blocks;
use super::row_slices::row_slices;
use super::vertex_stars::VertexStars;
use crate::float::{load, weight};
use crate::{Float, Solver};

impl<R: Float> Blocks<R> {
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
                let p = stars.data.order[row] as usize;
                let particle = &solver.particles.cells[p];
                let x = load::<R>(particle);
                let inertia = per_time_squared / weight::<R>(particle);
                let free = solver.particles.previous[p] + solver.particles.velocities[p] * time;
                *force = (free - x) * inertia;
                let mut isotropic = inertia;
                let lower = upper[row] - offsets[row];
                let pairs = stars.data.offsets[row]..stars.data.offsets[row + 1];
                for pair in pairs {
                    let term = &stars.data.terms[pair];
                    let corner = term.at(&solver.particles, x);
                    let ([a, b, c], slope) = (corner.others, corner.slope);
                    *force += corner.force;
                    let [wa, wb, wc] = term.pulls;
                    isotropic -= wa + wb + wc;
                    // Gradients of √(lV) det F at this particle (minus slope) and at the others.
                    let held = term.slope * excess[stars.data.tets[pair] as usize];
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
        });
    }
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
        let order = stars.data.order.clone();
        let mut blocks = Blocks::new(&stars.data);
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
