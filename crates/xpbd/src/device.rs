//! Interface of a [`Solver`] for a device that solves on its own: tets and particles as plain numbers, changes since
//! the last query, and loading of a state.
//!
//! Tets, masses and materials are edited in the solver here; a GPU applies the same changes that the layout of this
//! crate applies. Changes are tracked on request only. Cost: a number an edit.

use crate::constraints::{Obstacle, kept_depth};
use crate::layout::{CONSTANTS, ClusterOrder, OrderedTet, REST, in_slots};
use crate::neo_hookean::MAX_COFACTOR_NORM;
use crate::particles::Particles;
use crate::{Changes, Float, Solver, StepSettings, TetSolve};

/// A tet as plain numbers for a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetData<R> {
    /// Its particles.
    pub corners: [u32; 4],
    /// The gradients of the barycentric coordinates of corners 1 to 3 (9 numbers in 1/m, one gradient after the other);
    /// `μV Σ w q qᵀ` over all corners with inverse mass w and gradient q (xx, yy, zz, and twice xy, xz, yz, in 1/s²);
    /// `μV` in J.
    pub rest: [R; REST],
    /// `l/μ`, γ, and the damping time in s.
    pub constants: [R; CONSTANTS],
}

impl<R: Float> Solver<R> {
    /// Starts tracking changes. The first [`Solver::take_changes`] afterwards returns everything.
    pub fn track_changes(&mut self) {
        self.changes = Some(Changes::everything());
    }

    /// Returns the changes since the last call; none unless [`Solver::track_changes`] was called.
    ///
    /// # Example
    /// ```
    /// # use glam::DVec3;
    /// # use incise_xpbd::{Material, Solver};
    /// # let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// # let mut solver = Solver::<f32>::new(&rest);
    /// # let rubber = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
    /// # solver.add_material(rubber)?;
    /// # solver.push_tet([0, 1, 2, 3], rest, 0);
    /// solver.track_changes();
    /// assert!(solver.take_changes().all_tets);
    /// solver.push_copy(3);
    /// solver.relink_tet(0, [0, 1, 2, 4]);
    /// let changes = solver.take_changes();
    /// assert_eq!((changes.tets, changes.particles), (vec![0], vec![4]));
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn take_changes(&mut self) -> Changes {
        self.changes
            .as_mut()
            .map(std::mem::take)
            .unwrap_or_default()
    }

    /// Returns a tet as plain numbers for a kernel.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn tet_data(&self, tet: u32) -> TetData<R> {
        let ingredients = self.tets.ingredients(&self.particles, tet);
        TetData {
            corners: ingredients.tet.particles,
            rest: ingredients.rest([0, 1, 2, 3]),
            constants: ingredients.constants,
        }
    }

    /// Returns the order in which the solver here solves the tets of a cluster, and that of their corners. A kernel that
    /// uses both rounds as this solver does.
    ///
    /// # Panics
    /// If a tet does not exist.
    #[must_use]
    pub fn solving_order(&self, tets: &[u32]) -> Vec<OrderedTet> {
        let corners = |tet| self.tet_particles(tet as usize);
        ClusterOrder::default().of(tets, corners).to_vec()
    }

    /// Returns [`Solver::tet_data`] of a tet with its corners in the order of their slots.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn ordered_tet_data(&self, ordered: OrderedTet) -> TetData<R> {
        let ingredients = self.tets.ingredients(&self.particles, ordered.tet);
        TetData {
            corners: in_slots(ingredients.tet.particles, ordered.slots),
            rest: ingredients.rest(ordered.slots),
            constants: ingredients.constants,
        }
    }

    /// Returns the volume of a tet at rest in m³, negative if it is inverted there.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn rest_volume(&self, tet: usize) -> f64 {
        self.tets.rest_volumes[tet]
    }

    /// Returns whether a tet is solved. Tets too flat to be represented are not.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn takes_part(&self, tet: usize) -> bool {
        self.tets.list[tet].inverse_rest != [R::ZERO; 9]
    }

    /// Returns whether there is a single material, so that all tets have equal constants.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        self.tets.materials.len() < 2
    }

    /// Returns whether any material is damped.
    #[must_use]
    pub fn is_damped(&self) -> bool {
        self.tets.is_damped()
    }

    /// Returns the position relative to [`Solver::origin`] in m with the inverse mass in 1/kg (0 for fixed and rigidly
    /// attached particles), and the velocity in m/s.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn particle_data(&self, particle: usize) -> ([R; 4], [R; 3]) {
        let data = R::read(&self.particles.cells[particle]);
        (data, R::components(self.particles.velocities[particle]))
    }

    /// Prepares the state as a step does first: moves the origin if the body has moved far, and displaces particles of
    /// a body that lies on an exact line. Returns the number of displaced particles.
    pub fn prepare_state(&mut self) -> usize {
        let origin = self.particles.origin;
        let jittered = self.prepare();
        if let Some(changes) = &mut self.changes {
            changes.all_particles |= origin != self.particles.origin || jittered > 0;
        }
        jittered
    }

    /// Loads positions (the fourth number is ignored) and velocities that were computed elsewhere from this solver's
    /// state, relative to the same origin. Data for residuals of an earlier step is dropped.
    ///
    /// # Panics
    /// If the number of positions or velocities differs from that of particles.
    pub fn load_state(&mut self, positions: &[[R; 4]], velocities: &[[R; 4]]) {
        let count = self.particle_count();
        assert_eq!((positions.len(), velocities.len()), (count, count));
        let Particles {
            cells,
            velocities: own,
            ..
        } = &mut self.particles;
        for ((cell, x), (velocity, v)) in cells
            .iter()
            .zip(positions)
            .zip(own.iter_mut().zip(velocities))
        {
            let [.., weight] = R::read(cell);
            R::write(cell, [x[0], x[1], x[2], weight]);
            *velocity = R::vector(v[0], v[1], v[2]);
        }
        self.stepper.last.clear();
    }

    /// Loads the data of a last substep computed elsewhere, for [`Solver::residuals`]: the positions before the
    /// constraints were solved (the fourth number is ignored), the two multipliers of each tet, and how the tets were
    /// solved.
    ///
    /// # Panics
    /// If the number of positions differs from that of particles, or the number of multipliers from that of tets.
    pub fn load_last_substep(
        &mut self,
        predicted: &[[R; 4]],
        multipliers: &[[R; 2]],
        tet_solve: TetSolve,
    ) {
        assert_eq!(predicted.len(), self.particle_count());
        assert_eq!(multipliers.len(), self.tet_count());
        let last = &mut self.stepper.last;
        last.clear();
        let vectors = predicted.iter().map(|x| R::vector(x[0], x[1], x[2]));
        last.predicted.extend(vectors);
        last.multipliers.extend_from_slice(multipliers);
        last.tet_solve = tet_solve;
    }

    /// Ends a frame that was computed elsewhere: handles take their poses at its end.
    pub fn end_frame(&mut self) {
        self.constraints.end_frame();
    }
}

impl Solver<f32> {
    /// Norm of the derivative of det F (√3 at rest) up to which tets resist a change of volume as their material
    /// states; beyond it derivative, det F and γ are scaled down to this norm.
    pub const MAX_COFACTOR_NORM: f64 = MAX_COFACTOR_NORM;

    /// Returns the colliders `elapsed` s after the start of the frame, at the end of a substep, relative to the origin,
    /// as 22 numbers each.
    ///
    /// The first number is the kind: 0 plane, 1 capsule or sphere, 2 box; the second the friction; the fifth to seventh
    /// the motion in the substep. A plane has its offset along the normal third and the unit normal from the ninth on.
    /// A capsule has its radius third, one over the squared length of its axis fourth (0 for a sphere), and from the
    /// ninth on its start, its axis and the normal of points on the axis. A box has half its edges third, fourth and
    /// eighth, and from the ninth on its center and its three axes. The last two are the part of a depth at the start of
    /// the substep that is left at its end, and a depth that is rounding.
    pub fn collider_data<'a>(
        &self,
        settings: &'a StepSettings,
        elapsed: f64,
    ) -> impl Iterator<Item = [f32; 22]> + use<'a> {
        let kept = kept_depth(settings);
        Obstacle::<f32>::place(settings, elapsed, self.particles.origin, kept)
            .map(|obstacle| obstacle.numbers())
    }
}
