//! Incremental potential and force residual of an iterate, in double precision.
//!
//! Summed in fixed parts and orders, so the numbers do not depend on the number of threads. Cost: a pass over the tets,
//! for the residual on one thread.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::ImplicitStep;
use crate::Float;
use crate::float::weight;
use crate::forces::ForceMeter;
use crate::neo_hookean::TetConstraint;
use crate::wide::wide;

/// Tets summed as one part: the same parts for any number of threads.
const PARALLEL_TETS: usize = 2048;
/// How far from a collider a particle may press it, as a part of the size of a tet.
const TOUCHING: f64 = 1e-3;

impl<R: Float> ImplicitStep<'_, R> {
    /// Returns the incremental potential in J: inertia, tets, damping and constraints. Its elastic part is 0 at rest.
    /// Hard constraints contribute with their present multipliers, see [`ImplicitStep::update_multipliers`].
    #[must_use]
    pub fn potential(&self) -> f64 {
        self.potentials().total
    }

    /// [`ImplicitStep::potential`] and what it consists of.
    pub(super) fn potentials(&self) -> Potential {
        let solver = &*self.solver;
        let elastic = |tets: &[TetConstraint<R>]| {
            wide(
                #[inline(always)]
                || {
                    let mut sums = [0.0; 2];
                    for tet in tets {
                        let tet = tet.to_f64();
                        let [a, b, c, d] = tet.particles;
                        let at = |p: u32| solver.particles.local(p as usize);
                        let [energy, terms] = energy_and_terms(&tet, [at(a), at(b), at(c), at(d)]);
                        sums[0] += energy;
                        sums[1] += terms;
                    }
                    sums
                },
            )
        };
        let tets: Vec<[f64; 2]> = solver
            .tets
            .list
            .par_chunks(PARALLEL_TETS)
            .map(elastic)
            .collect();
        let mut parts: Vec<f64> = tets.iter().map(|part| part[0]).collect();
        let elastic = parts.iter().sum();
        parts.extend((0..solver.particle_count()).map(|p| self.inertia(p)));
        parts.extend(self.dissipated());
        let constraints = &self.stars.data.constraints;
        if !constraints.is_empty() {
            parts.push(constraints.energy(solver, &|p| solver.particles.local(p as usize)));
        }
        let total: f64 = parts.into_iter().sum();
        let terms = total.abs() + tets.iter().map(|part| part[1]).sum::<f64>();
        Potential {
            total,
            elastic,
            rounding: f64::EPSILON * terms,
        }
    }

    /// Adds the potential of each connected part of the body, in J, to the sum of the part's smallest particle. The
    /// parts must be known.
    pub(super) fn add_potentials(&self, sums: &mut [f64]) {
        let solver = &*self.solver;
        let parts = &*self.stars.parts;
        let of = |p: u32| parts[p as usize] as usize;
        let mut elastic = vec![0.0; solver.tet_count()];
        let chunks = elastic.par_chunks_mut(PARALLEL_TETS);
        chunks
            .zip(solver.tets.list.par_chunks(PARALLEL_TETS))
            .for_each(|(energies, tets)| {
                wide(
                    #[inline(always)]
                    || {
                        for (energy, tet) in energies.iter_mut().zip(tets) {
                            let [a, b, c, d] = tet.particles;
                            let at = |p: u32| solver.particles.local(p as usize);
                            let at = [at(a), at(b), at(c), at(d)];
                            *energy = energy_and_terms(&tet.to_f64(), at)[0];
                        }
                    },
                );
            });
        for (tet, energy) in solver.tets.list.iter().zip(elastic) {
            sums[of(tet.particles[0])] += energy;
        }
        for (p, &part) in parts.iter().enumerate() {
            sums[part as usize] += self.inertia(p);
        }
        for (&p, energy) in self.stars.data.order.iter().zip(self.dissipated()) {
            sums[of(p)] += energy;
        }
        let position = |p: u32| solver.particles.local(p as usize);
        for (p, energy) in self.stars.data.constraints.energies(solver, &position) {
            sums[of(p)] += energy;
        }
    }

    /// The inertial potential in J of a particle.
    fn inertia(&self, p: usize) -> f64 {
        if weight::<R>(&self.solver.particles.cells[p]) <= R::ZERO {
            return 0.0;
        }
        let lag = self.solver.particles.local(p) - self.free_position(p);
        0.5 * self.time.to_f64().powi(-2) * self.solver.mass(p) * lag.length_squared()
    }

    /// What damping takes in J, by rows of the order; empty where nothing is damped.
    fn dissipated(&self) -> Vec<f64> {
        let Some(viscosity) = &self.stars.viscosity else {
            return Vec::new();
        };
        let particles = &self.solver.particles;
        let motion = |p: usize| particles.local(p) - R::to_dvec3(particles.previous[p]);
        let order = &self.stars.data.order;
        let rows = (0..order.len()).into_par_iter().with_min_len(PARALLEL_TETS);
        rows.map(|row| {
            let force = viscosity.exact_force(row, order, &motion);
            -0.5 * force.dot(motion(order[row] as usize))
        })
        .collect()
    }

    /// The energy in J of the motion in the substep.
    pub(super) fn kinetic(&self) -> f64 {
        let per_time_squared = self.time.to_f64().powi(-2);
        let solver = &*self.solver;
        let each = (0..solver.particle_count()).map(|p| {
            let way = solver.particles.local(p) - R::to_dvec3(solver.particles.previous[p]);
            solver.mass(p) * way.length_squared()
        });
        0.5 * per_time_squared * each.sum::<f64>()
    }

    /// Writes the residual forces in N, `M (x̃ - x) / Δt² - ∇U(x)` with the energy U of tets, damping and constraints,
    /// to `out`; zero in the solution. Forces on particles that do not move, and forces that a collider bears, are set
    /// to zero.
    pub fn forces(&self, out: &mut Vec<DVec3>) {
        self.forces_at(&|p| self.solver.particles.local(p), out);
    }

    /// Returns the norm of [`ImplicitStep::forces`] over all particles in N.
    #[must_use]
    pub fn residual(&self) -> f64 {
        let mut forces = Vec::new();
        self.forces(&mut forces);
        norm(&forces)
    }

    /// The residual in N that the free motion would have.
    pub(super) fn free_residual(&self) -> f64 {
        let mut forces = Vec::new();
        self.forces_at(&|p| self.free_position(p), &mut forces);
        norm(&forces)
    }

    /// Where a particle would be if it were free.
    pub(super) fn free_position(&self, p: usize) -> DVec3 {
        R::to_dvec3(
            self.solver.particles.previous[p] + self.solver.particles.velocities[p] * self.time,
        )
    }

    fn forces_at(&self, position: &impl Fn(usize) -> DVec3, out: &mut Vec<DVec3>) {
        let solver = &*self.solver;
        self.inner_forces(position, out);
        let per_time_squared = self.time.to_f64().powi(-2);
        for (p, force) in out.iter_mut().enumerate() {
            let x = position(p);
            *force += (self.free_position(p) - x) * (per_time_squared * solver.mass(p));
            if weight::<R>(&solver.particles.cells[p]) <= R::ZERO {
                *force = DVec3::ZERO;
            }
            for obstacle in &solver.constraints.colliders.obstacles {
                *force = obstacle.left_of(*force, R::from_dvec3(x));
            }
        }
    }

    /// Adds the forces of the substep on what holds the bodies to those of a frame: of springs, of colliders, which bear
    /// what is left over at a particle that touches them, and of the constraints on held particles. O(tets), on one
    /// thread.
    pub(super) fn measure(&self, meter: &mut ForceMeter) {
        let solver = &*self.solver;
        let particles = &solver.particles;
        let time = self.settings.substep_time();
        let mut forces = Vec::new();
        self.inner_forces(&|p| particles.local(p), &mut forces);
        let local = |p: u32| particles.local(p as usize);
        for (p, force) in self.stars.data.constraints.anchor_forces(&local) {
            let p = p as usize;
            let Some(attachment) = solver.constraints.attachments.get(p) else {
                continue;
            };
            if particles.is_free(p) {
                let at = particles.origin + R::to_dvec3(attachment.target);
                meter.add_handle(attachment.handle, force * -time, at);
            } else {
                forces[p] -= force;
            }
        }
        meter.add_forces(particles, &forces, time);
        let per_time_squared = self.time.to_f64().powi(-2);
        // On a curved collider a particle ends next to the surface. Nothing is left over where it does not press.
        let gap = TOUCHING * self.stars.data.size;
        for (p, &inner) in forces.iter().enumerate() {
            if solver.constraints.colliders.obstacles.is_empty() || !particles.is_free(p) {
                continue;
            }
            let x = particles.local(p);
            let lag = self.free_position(p) - x;
            let mut force = inner + lag * (per_time_squared * solver.mass(p));
            // Sweeps reach the law of friction only about, so what that leaves is borne too, by the last one.
            let mut last = None;
            for (number, obstacle) in solver.constraints.colliders.obstacles.iter().enumerate() {
                if let Some(borne) = obstacle.borne(force, R::from_dvec3(x), gap) {
                    meter.add_collider(number, borne * time, particles.origin + x);
                    force -= borne;
                    last = Some(number);
                }
            }
            if let Some(number) = last {
                meter.add_collider(number, force * time, particles.origin + x);
            }
        }
    }

    /// Writes the forces of tets, damping and constraints in N to `out`.
    fn inner_forces(&self, position: &impl Fn(usize) -> DVec3, out: &mut Vec<DVec3>) {
        let solver = &*self.solver;
        out.clear();
        out.resize(solver.particle_count(), DVec3::ZERO);
        for tet in &solver.tets.list {
            let tet = tet.to_f64();
            let e = tet.evaluate(tet.particles.map(|p| position(p as usize)));
            let deviatoric = tet.stiffness * e.deviatoric;
            let hydrostatic = tet.stiffness * tet.ratio * e.hydrostatic;
            for (k, &p) in tet.particles.iter().enumerate() {
                out[p as usize] -= e.deviatoric_gradients[k] * deviatoric
                    + e.hydrostatic_gradients[k] * hydrostatic;
            }
        }
        if let Some(viscosity) = &self.stars.viscosity {
            let motion = |p: usize| position(p) - R::to_dvec3(solver.particles.previous[p]);
            for (row, &p) in self.stars.data.order.iter().enumerate() {
                out[p as usize] += viscosity.exact_force(row, &self.stars.data.order, &motion);
            }
        }
        let constraints = &self.stars.data.constraints;
        if !constraints.is_empty() {
            constraints.add_forces(solver, &|p| position(p as usize), out);
        }
    }
}

/// The incremental potential in J.
#[derive(Clone, Copy, Debug)]
pub(super) struct Potential {
    pub(super) total: f64,
    /// The part of it in the tets.
    pub(super) elastic: f64,
    /// A bound of its rounding: the energy of a tet is the small difference of large terms.
    pub(super) rounding: f64,
}

/// The energy of a tet with its corners at `x`, 0 at rest, and the sum of the terms that it is the difference of.
#[inline(always)]
fn energy_and_terms(tet: &TetConstraint<f64>, x: [DVec3; 4]) -> [f64; 2] {
    let q = DMat3::from_cols_array(&tet.inverse_rest).transpose();
    let f = DMat3::from_cols(x[1] - x[0], x[2] - x[0], x[3] - x[0]) * q;
    let squared = f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared();
    let (bulge, at_rest) = (f.determinant() - tet.gamma, 1.0 - tet.gamma);
    let (now, before) = (bulge * bulge, at_rest * at_rest);
    [
        0.5 * tet.stiffness * (squared - 3.0 + tet.ratio * (now - before)),
        0.5 * tet.stiffness * (squared + 3.0 + tet.ratio * (now + before)),
    ]
}

fn norm(forces: &[DVec3]) -> f64 {
    forces
        .iter()
        .map(|f| f.length_squared())
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use incise_graph::{Clustering, ColorId, Coloring, Schedule};

    use super::*;
    use crate::{
        DistanceConstraint, Material, Pose, Solver, VbdSettings, VertexStars, VolumeConstraint,
    };

    /// Central differences of the potential with step 1e-6 of a unit tet: 1e-12 of the third derivatives, and rounding
    /// 1e-16 of the potential over the step, together below 1e-7 of the largest force.
    #[test]
    fn forces_are_the_slopes_of_the_potential() {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        let mut solver = Solver::<f64>::new(&rest);
        let stuff = Material {
            young_modulus: 1e4,
            poisson_ratio: 0.4,
            density: 1e3,
            damping: 0.03,
        };
        solver.add_material(stuff).expect("a sound material");
        for tet in [[0, 1, 2, 3], [1, 4, 2, 3]] {
            solver.push_tet(tet, tet.map(|p| rest[p as usize]), 0);
        }
        for p in 0..5 {
            solver.set_mass(p, 10.0 + p as f64);
            let x = solver.particles.local(p);
            solver.set_position(
                p,
                DVec3::new(1.3 * x.x + 0.2 * x.y, 0.7 * x.y, x.z - 0.4 * x.x),
            );
            solver.set_velocity(p, DVec3::new(1.0, -2.0, x.x));
        }
        // All kinds of constraints, one of each hard.
        let one = |constraints: usize| {
            let colors = (0u32..).take(constraints).map(ColorId).collect();
            Schedule::new(&Clustering::none(constraints), &Coloring::new(colors))
        };
        let distance = |particles, compliance, damping, tension_only| DistanceConstraint {
            particles,
            length: 0.5,
            compliance,
            damping,
            tension_only,
        };
        let distances = [
            distance([0, 4], 1e-3, 0.1, false),
            distance([3, 4], 0.0, 0.0, true),
            distance([0, 1], 1e-4, 0.02, true),
        ];
        solver.set_distances(&distances, one(3)).expect("sound");
        let volumes = [1e-4, 0.0].map(|compliance| VolumeConstraint {
            damping: compliance * 1e3,
            ..VolumeConstraint::of_tet(
                [0, 1, 2, 3],
                [rest[0], rest[1], rest[2], rest[3]],
                compliance,
            )
        });
        solver.set_volumes(&volumes, one(2)).expect("sound");
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        solver.attach(2, handle, 1e-3, 0.2).expect("sound");
        let colors = Coloring::new([0, 1, 2, 3, 4].map(ColorId).to_vec());
        let schedule = Schedule::new(&Clustering::none(5), &colors);
        let mut stars = VertexStars::new(&solver, &schedule).expect("a proper coloring");
        let mut settings = VbdSettings::new(0.1, 1);
        settings.step.gravity = Some(DVec3::NEG_Z);
        let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings).expect("sound");
        step.sweep();
        step.update_multipliers();
        let mut forces = Vec::new();
        step.forces(&mut forces);
        let size = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
        for (p, force) in forces.iter().enumerate() {
            let x = step.solver.particles.local(p);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let [low, high] = [-1e-6, 1e-6].map(|h| {
                    step.solver.set_position(p, x + axis * h);
                    step.potential()
                });
                step.solver.set_position(p, x);
                let error = (high - low) / 2e-6 + force.dot(axis);
                assert!(error.abs() < 1e-7 * size, "{p} {axis} {error:e}");
            }
        }
    }
}
