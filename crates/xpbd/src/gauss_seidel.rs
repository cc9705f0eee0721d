//! One Gauss-Seidel pass over the tets: color after color, within a color in parallel.
//!
//! Clusters of one color share no particle and run in parallel; a color too small to be worth a second thread stays on
//! one.
//!
//! Source: paper sections 3 and 4.1. Cost: 390 operations a tet.

use incise_graph::Schedule;
use rayon::prelude::*;

use crate::real::{load, store, weight};
use crate::{Real, Solver};

/// Constraints in a color from which a second thread pays for its wake-up.
const PARALLEL_CONSTRAINTS: usize = 256;

/// What a pass over the constraints has to do beyond the plain solve; each choice is compiled on its own.
pub(crate) struct Pass<R> {
    pub(crate) time_squared: R,
    pub(crate) per_time: R,
    pub(crate) relaxation: R,
}

impl<R: Real> Solver<R> {
    /// One Gauss-Seidel pass over all constraints.
    pub(crate) fn pass<const DAMPED: bool, const MULTIPLIERS: bool>(
        &self,
        schedule: &Schedule,
        pass: &Pass<R>,
    ) {
        let threads = rayon::current_num_threads();
        for color in 0..schedule.color_count() {
            let solve = |tets: &[u32]| {
                for &tet in tets {
                    self.solve_tet::<DAMPED, MULTIPLIERS>(tet as usize, pass);
                }
            };
            let tets = schedule.color_constraints(color);
            if threads == 1 || tets.len() < PARALLEL_CONSTRAINTS {
                solve(tets);
            } else {
                let clusters = schedule.clusters(color);
                (0..threads).into_par_iter().for_each(|thread| {
                    let share = |part| clusters.start + clusters.len() * part / threads;
                    for cluster in share(thread)..share(thread + 1) {
                        solve(schedule.constraints(cluster));
                    }
                });
            }
        }
    }

    #[inline]
    fn solve_tet<const DAMPED: bool, const MULTIPLIERS: bool>(&self, tet: usize, pass: &Pass<R>) {
        let constraint = &self.tets[tet];
        let corners = constraint.particles.map(|p| &self.particles[p as usize]);
        let x = corners.map(|corner| load::<R>(corner));
        let weights = corners.map(|corner| weight::<R>(corner));
        let evaluation = constraint.evaluate(x);
        let multipliers = if MULTIPLIERS {
            self.multipliers_of(tet)
        } else {
            [R::ZERO; 2]
        };
        let (mut damping, mut rates) = (R::ZERO, [R::ZERO; 2]);
        if DAMPED {
            damping = R::from_f64(self.materials[usize::from(self.material_of[tet])].damping)
                * pass.per_time;
            let previous = constraint.particles.map(|p| self.previous[p as usize]);
            let mut moved = [R::ZERO; 2];
            for k in 0..4 {
                let motion = x[k] - previous[k];
                moved[0] = moved[0] + R::dot(evaluation.deviatoric_gradients[k], motion);
                moved[1] = moved[1] + R::dot(evaluation.hydrostatic_gradients[k], motion);
            }
            rates = moved.map(|m| damping * m);
        }
        let change = constraint.solve(
            &evaluation,
            weights,
            multipliers,
            pass.time_squared,
            damping,
            rates,
        );
        let Some(change) = change else { return };
        let change = change.map(|c| c * pass.relaxation);
        for k in 0..4 {
            let along = evaluation.deviatoric_gradients[k] * change[0]
                + evaluation.hydrostatic_gradients[k] * change[1];
            store::<R>(corners[k], x[k] + along * weights[k]);
        }
        if MULTIPLIERS {
            for k in 0..2 {
                (multipliers[k] + change[k]).store(&self.multipliers[tet][k]);
            }
        }
    }

    pub(crate) fn multipliers_of(&self, tet: usize) -> [R; 2] {
        let [deviatoric, hydrostatic] = &self.multipliers[tet];
        [R::load(deviatoric), R::load(hydrostatic)]
    }
}
