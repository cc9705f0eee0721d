//! [`Residuals`]: residuals of the last substep, in stated norms and units.
//!
//! Backward Euler requires `M (x - x̃) = ∇Cᵀ λ` and `C + α̃ λ = 0` at once. XPBD iterates on the second alone, so a
//! small dual residual does not show convergence. Without multipliers both are one equation,
//! `M (x - x̃) / Δt² + ∇U(x) = 0`, the gradient of the incremental potential `‖x - x̃‖²_M / (2 Δt²) + U(x)`. The force
//! residual is computed from positions alone, so it is large for any state that does not solve the step, also for a
//! collapsed or stalled one.
//!
//! Sources: Macklin, Müller, Chentanez 2016 (primal and dual); Gast et al. 2015 (incremental potential). Everything is
//! in double precision and summed in the order of particles and tets. Cost: one pass over the tets, on request only.

use glam::DVec3;

use crate::neo_hookean::{Evaluation, TetConstraint};
use crate::{Float, Solver, TetSolve};

/// Residuals of the last substep: the difference from a solution of its equations.
///
/// Sums are over free particles and solved tets. The equations contain only elastic forces and gravity, so ground
/// contact and damping contribute to `primal`, `force` and `potential`. In single precision the last digit of a
/// position over Δt² is the smallest `force` that can be reached. A value too large for a double is [`f64::MAX`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// `‖M (x - x̃) - ∇Cᵀ λ‖` in kg·m: the part of the equations of motion that XPBD leaves out. Compare it with `Δt²`
    /// times [`Solver::load`].
    pub primal: f64,
    /// `‖C + α̃ λ‖` without unit: the part that XPBD iterates on.
    pub dual: f64,
    /// Root mean square of `C + α̃ λ`, which does not grow with the number of constraints.
    pub dual_rms: f64,
    /// Number of constraints: two for each solved tet.
    pub constraints: usize,
    /// `‖M (x - x̃) / Δt² + ∇U(x)‖` in N, from positions alone: zero in the solution of backward Euler. Compare it with
    /// [`Solver::load`].
    pub force: f64,
    /// The incremental potential `‖x - x̃‖²_M / (2 Δt²) + U(x)` in J, which backward Euler minimizes. `U` is 0 at rest.
    pub potential: f64,
}

impl<R: Float> Solver<R> {
    /// Returns the residuals of the last substep at the present positions; `None` unless it was made by
    /// [`Solver::step_keeping_residuals`] with `substep_time` and no particle or tet was added since.
    ///
    /// # Example
    /// A single tet at rest falls freely, which it does without residual.
    /// ```
    /// # use glam::DVec3;
    /// # use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// # use incise_xpbd::{Material, Solver, StepSettings};
    /// # let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// # let material = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
    /// # let mut solver = Solver::<f64>::new(&rest);
    /// # solver.add_material(material)?;
    /// # solver.push_tet([0, 1, 2, 3], rest, 0);
    /// # (0..4).for_each(|p| solver.set_mass(p, 1000.0 / 6.0 / 4.0));
    /// # let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// let settings = StepSettings { gravity: Some(DVec3::NEG_Z), ..StepSettings::new(0.01) };
    /// solver.step_keeping_residuals(&schedule, &settings)?;
    /// let residuals = solver.residuals(settings.substep_time()).expect("they were kept");
    /// assert!(residuals.force < 1e-9 * solver.load(DVec3::NEG_Z));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn residuals(&self, substep_time: f64) -> Option<Residuals> {
        if !self.has_kept() {
            return None;
        }
        let last = &self.stepper.last;
        let time_squared = substep_time * substep_time;
        let inertia: Vec<DVec3> = (0..self.particle_count())
            .map(|p| {
                (self.particles.local(p) - R::to_dvec3(last.predicted[p]))
                    * self.particles.masses[p]
            })
            .collect();
        let mut potential: f64 = (0..self.particle_count())
            .filter(|&p| self.is_free(p))
            .map(|p| inertia[p].length_squared() / (2.0 * self.particles.masses[p] * time_squared))
            .sum();
        let mut force: Vec<DVec3> = inertia.iter().map(|&i| i / time_squared).collect();
        let mut primal = inertia;
        let mut dual = Vec::new();
        for (t, tet) in self.tets.list.iter().enumerate() {
            let tet = tet.to_f64();
            let stiffness = self.kept_stiffness(&tet);
            let evaluation = self.evaluate_kept(&tet);
            let values = [evaluation.deviatoric, evaluation.hydrostatic];
            potential += tet.energy(&tet.evaluate(self.particles.corners(tet.particles)));
            let multipliers = last.multipliers[t].map(R::to_f64);
            for (k, &p) in tet.particles.iter().enumerate() {
                let gradients = [
                    evaluation.deviatoric_gradients[k],
                    evaluation.hydrostatic_gradients[k],
                ];
                for c in 0..2 {
                    force[p as usize] += gradients[c] * (stiffness[c] * values[c]);
                    primal[p as usize] -= gradients[c] * multipliers[c];
                }
            }
            dual.extend(
                unsatisfied(stiffness, values, multipliers, time_squared)
                    .into_iter()
                    .flatten(),
            );
        }
        let moving = |vectors: Vec<DVec3>| {
            let entries = vectors.into_iter().enumerate();
            norm(
                entries
                    .filter(|&(p, _)| self.is_free(p))
                    .flat_map(|(_, v)| v.to_array()),
            )
        };
        let constraints = dual.len();
        let dual = norm(dual.into_iter());
        Some(Residuals {
            primal: moving(primal),
            dual,
            dual_rms: dual / (constraints.max(1) as f64).sqrt(),
            constraints,
            force: moving(force),
            potential: representable(potential),
        })
    }

    /// Returns for each tet the residual of its two constraints, `‖C + α̃ λ‖` without unit, 0 if it is not solved. The
    /// root of the sum of squares is [`Residuals::dual`]. `None` where [`Solver::residuals`] is. O(tets).
    ///
    /// # Example
    /// ```
    /// # use glam::DVec3;
    /// # use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// # use incise_xpbd::{Material, Solver, StepSettings};
    /// # let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// # let material = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
    /// # let mut solver = Solver::<f64>::new(&rest);
    /// # solver.add_material(material)?;
    /// # solver.push_tet([0, 1, 2, 3], rest, 0);
    /// # (0..4).for_each(|p| solver.set_mass(p, 1000.0 / 6.0 / 4.0));
    /// # let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// solver.set_position(3, DVec3::Z * 1.5);
    /// let settings = StepSettings::new(0.01);
    /// solver.step_keeping_residuals(&schedule, &settings)?;
    /// let time = settings.substep_time();
    /// let of_tets = solver.residuals_of_tets(time).expect("they were kept");
    /// assert_eq!(of_tets, [solver.residuals(time).expect("they were kept").dual]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn residuals_of_tets(&self, substep_time: f64) -> Option<Vec<f64>> {
        if !self.has_kept() {
            return None;
        }
        let time_squared = substep_time * substep_time;
        let of_tet = |(tet, kept): (&TetConstraint<R>, &[R; 2])| {
            let tet = tet.to_f64();
            let stiffness = self.kept_stiffness(&tet);
            let evaluation = self.evaluate_kept(&tet);
            let values = [evaluation.deviatoric, evaluation.hydrostatic];
            let left = unsatisfied(stiffness, values, kept.map(R::to_f64), time_squared);
            left.map_or(0.0, |left| norm(left.into_iter()))
        };
        Some(
            self.tets
                .list
                .iter()
                .zip(&self.stepper.last.multipliers)
                .map(of_tet)
                .collect(),
        )
    }

    /// Whether the last substep was kept, and no particle or tet was added since.
    fn has_kept(&self) -> bool {
        let last = &self.stepper.last;
        last.predicted.len() == self.particle_count() && last.multipliers.len() == self.tet_count()
    }

    /// Returns `‖M g‖` over the free particles in N, the scale to judge residuals by. The sum of squares shrinks with
    /// the size of the particles as that of [`Residuals::force`] does.
    #[must_use]
    pub fn load(&self, gravity: DVec3) -> f64 {
        let particles = (0..self.particle_count()).filter(|&p| self.is_free(p));
        norm(particles.flat_map(|p| (gravity * self.particles.masses[p]).to_array()))
    }

    /// One over the compliances of both constraints, as the last substep solved them.
    fn kept_stiffness(&self, tet: &TetConstraint<f64>) -> [f64; 2] {
        let volume = match self.stepper.last.tet_solve {
            TetSolve::Split => tet.ratio - 1.0,
            TetSolve::Block | TetSolve::Sequential => tet.ratio,
        };
        [tet.stiffness, volume * tet.stiffness]
    }

    /// Both constraints of a tet at the present positions, as the last substep solved them.
    fn evaluate_kept(&self, tet: &TetConstraint<f64>) -> Evaluation<f64> {
        let x = self.particles.corners(tet.particles);
        match self.stepper.last.tet_solve {
            TetSolve::Split => tet.evaluate_split(x),
            TetSolve::Block | TetSolve::Sequential => tet.evaluate(x),
        }
    }
}

/// `C + α̃ λ` of both constraints of a tet; `None` if it takes no part, or so little that its compliance overflows: it
/// has nothing to satisfy.
fn unsatisfied(
    stiffness: [f64; 2],
    values: [f64; 2],
    multipliers: [f64; 2],
    time_squared: f64,
) -> Option<[f64; 2]> {
    let compliances = stiffness.map(|s| 1.0 / (s * time_squared));
    // At Poisson's ratio 0 the volume constraint of the split form has no stiffness, so nothing to satisfy.
    let of = |c: usize| {
        if stiffness[c] > 0.0 {
            values[c] + compliances[c] * multipliers[c]
        } else {
            0.0
        }
    };
    let sound = compliances[0].is_finite() && (compliances[1].is_finite() || stiffness[1] <= 0.0);
    sound.then(|| [of(0), of(1)])
}

/// The Euclidean norm, without overflow of the squares.
fn norm(values: impl Iterator<Item = f64> + Clone) -> f64 {
    if values.clone().any(|v| !v.is_finite()) {
        return f64::MAX;
    }
    let largest = values.clone().fold(0.0, |a: f64, v| a.max(v.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    let sum: f64 = values.map(|v| (v / largest) * (v / largest)).sum();
    representable(largest * sum.sqrt())
}

/// The value, or the largest double where it is more than that.
fn representable(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norms_at_the_edges_of_double_precision() {
        let norm = |values: &[f64]| norm(values.iter().copied());
        assert_eq!(norm(&[]), 0.0);
        assert_eq!(norm(&[0.0, -0.0]), 0.0);
        assert_eq!(norm(&[3.0, -4.0]), 5.0);
        assert_eq!(norm(&[3e300, -4e300]), 5e300);
        assert_eq!(norm(&[3e-300, -4e-300]), 5e-300);
        assert_eq!(norm(&[f64::MAX, f64::MAX]), f64::MAX);
        // What is no number must not count as nothing.
        assert_eq!(norm(&[0.0, f64::NAN]), f64::MAX);
        assert_eq!(norm(&[1.0, f64::NEG_INFINITY]), f64::MAX);
    }
}
