//! [`Solver::step_direct`]: all constraints of a body at once, by a sparse Cholesky factorization.
//!
//! Each iteration solves `(J M⁻¹ Jᵀ + α̃) Δλ = -(C + α̃ λ)` and moves the particles by `M⁻¹ Jᵀ Δλ`: Newton's method on the
//! constraints, of which a Gauss-Seidel pass is an approximation. It has no order of solving, and its dual residual
//! falls quadratically. It still drops the primal residual (the change of J with the positions is left out), so it ends
//! near where XPBD would with infinitely many passes (the gap vanishes with kappa), not at the step of backward Euler:
//! see [`crate::Residuals::force`], and use substeps for accuracy.
//!
//! The constraints are those of [`TetSolve::Block`]; damped materials are refused.
//!
//! With the rows and columns scaled by the root of stiffness times Δt² the matrix is a positive semidefinite one plus
//! the identity, so it is regular whatever the state: at rest both gradients of a tet are parallel, and only the
//! compliance, here the identity, keeps them apart.
//!
//! Source: paper equation 4; Macklin, Müller, Chentanez 2016. Computed in double precision; positions keep the solver's.
//! Cost of an iteration: the factorization of two rows a tet, some 140 entries in each before fill-in. For small bodies:
//! measure before using it beyond some thousand tets.

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use glam::DVec3;

use crate::collider::Obstacle;
use crate::neo_hookean::Evaluation;
use crate::real::{store, weight};
use crate::{Real, Solver, StepReport, StepSettings, TetSolve, XpbdError};

/// What stays the same over a frame: who is coupled with whom, and the order of elimination.
struct Pattern {
    /// The (tet, corner) pairs of each particle that moves, as offsets and values.
    offsets: Vec<usize>,
    corners: Vec<[usize; 2]>,
    structure: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    elimination: SymbolicLlt<usize>,
}

/// Two constraints of a tet as the system sees them.
struct Rows {
    evaluation: Evaluation<f64>,
    /// Roots of stiffness times Δt², the second less where the volume has a steep slope, as in the kernel.
    scales: [f64; 2],
}

impl Rows {
    /// The scaled gradient of a constraint at a corner.
    fn gradient(&self, constraint: usize, corner: usize) -> DVec3 {
        let gradients = match constraint {
            0 => &self.evaluation.deviatoric_gradients,
            _ => &self.evaluation.hydrostatic_gradients,
        };
        gradients[corner] * self.scales[constraint]
    }
}

impl<R: Real> Solver<R> {
    /// Advances by one frame like [`Solver::step`], with every iteration a direct solve of all constraints together.
    ///
    /// No schedule is needed. Keeps what [`Solver::residuals`] needs.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`], or with [`XpbdError::Factorization`] if a system is so stiff
    /// that its numbers or its factors leave double precision. The state is that before the frame then.
    ///
    /// # Determinism
    /// One thread, always the same order, as long as the feature `rayon` of faer is off.
    ///
    /// # Example
    /// ```
    /// # use glam::DVec3;
    /// # use incise_xpbd::{Material, Solver, StepSettings};
    /// # let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// # let material = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
    /// # let mut solver = Solver::<f64>::new(&rest);
    /// # solver.add_material(material)?;
    /// # solver.push_tet([0, 1, 2, 3], rest, 0);
    /// # (0..4).for_each(|p| solver.set_mass(p, 1000.0 / 6.0 / 4.0));
    /// solver.set_position(3, DVec3::Z * 1.2);
    /// let settings = StepSettings { iterations: 8, ..StepSettings::new(0.01) };
    /// solver.step_direct(&settings)?;
    /// assert!(solver.residuals(0.01).expect("they are kept").dual < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step_direct(&mut self, settings: &StepSettings) -> Result<StepReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step_direct").entered();
        settings.check()?;
        self.refuse_soft_constraints()?;
        if self.is_damped() {
            return Err(XpbdError::Unknown { kind: "damping" });
        }
        let before: Vec<_> = (0..self.particle_count())
            .map(|p| (self.vector(p), self.velocities[p]))
            .collect();
        let outcome = self.frame_direct(settings);
        if outcome.is_err() {
            for (p, (x, velocity)) in before.into_iter().enumerate() {
                store::<R>(&self.particles[p], x);
                self.velocities[p] = velocity;
            }
            self.predicted.clear();
        }
        outcome
    }

    fn frame_direct(&mut self, settings: &StepSettings) -> Result<StepReport, XpbdError> {
        self.follow_body();
        let pattern = self.pattern().ok_or(XpbdError::Factorization)?;
        let mut report = StepReport {
            repaired: 0,
            unfolded: self.unfold(),
        };
        let time = settings.substep_time();
        for number in 1..=settings.substeps {
            self.predict(settings, R::from_f64(time));
            let ended = f64::from(number) / f64::from(settings.substeps);
            report.repaired += self.move_held(ended);
            let elapsed = ended * settings.time_step;
            let obstacles: Vec<_> = Obstacle::place(settings, elapsed, self.origin).collect();
            self.predicted = (0..self.particle_count()).map(|p| self.vector(p)).collect();
            // The multipliers, each over the scale of its row.
            let mut multipliers = vec![0.0; 2 * self.tet_count()];
            for _ in 0..settings.iterations {
                self.solve_all(&pattern, settings, &mut multipliers)
                    .ok_or(XpbdError::Factorization)?;
                self.project_to_colliders(&obstacles);
            }
            self.kept.clear();
            self.kept_form = TetSolve::Block;
            for t in 0..self.tet_count() {
                let scales = self.scales(t, time);
                let multiplier = |c| R::from_f64(scales[c] * multipliers[2 * t + c]);
                self.kept.push([multiplier(0), multiplier(1)]);
            }
            let per_time = R::from_f64(1.0 / time);
            report.repaired += self.update_velocities(R::from_f64(time), per_time);
            self.update_held(per_time);
        }
        self.arrive();
        Ok(report)
    }

    /// One direct solve; `None` if it left double precision.
    fn solve_all(
        &self,
        pattern: &Pattern,
        settings: &StepSettings,
        multipliers: &mut [f64],
    ) -> Option<()> {
        let time = settings.substep_time();
        let rows: Vec<Rows> = (0..self.tet_count()).map(|t| self.rows(t, time)).collect();
        let matrix = SparseColMat::new_from_argsort(
            pattern.structure.clone(),
            &pattern.order,
            &self.entries(pattern, &rows),
        )
        .ok()?;
        let factors =
            Llt::try_new_with_symbolic(pattern.elimination.clone(), matrix.as_ref(), Side::Lower)
                .ok()?;
        let mut change = faer::Col::<f64>::from_fn(multipliers.len(), |i| {
            let row = &rows[i / 2];
            let values = [row.evaluation.deviatoric, row.evaluation.hydrostatic];
            -(row.scales[i % 2] * values[i % 2] + multipliers[i])
        });
        factors.solve_in_place(&mut change);
        if !(0..multipliers.len()).all(|i| change[i].is_finite()) {
            return None;
        }
        for (i, multiplier) in multipliers.iter_mut().enumerate() {
            change[i] *= settings.relaxation;
            *multiplier += change[i];
        }
        for p in 0..self.particle_count() {
            let corners = &pattern.corners[pattern.offsets[p]..pattern.offsets[p + 1]];
            let pushes = corners.iter().map(|&[t, k]| {
                rows[t].gradient(0, k) * change[2 * t] + rows[t].gradient(1, k) * change[2 * t + 1]
            });
            let push: DVec3 = pushes.sum();
            let weight = weight::<R>(&self.particles[p]).to_f64();
            let moved = R::from_dvec3(self.local(p) + push * weight);
            store::<R>(&self.particles[p], moved);
        }
        Some(())
    }

    fn scales(&self, tet: usize, time: f64) -> [f64; 2] {
        let tet = self.tets[tet].to_f64();
        [tet.stiffness, tet.ratio * tet.stiffness].map(|stiffness| stiffness.sqrt() * time)
    }

    fn rows(&self, tet: usize, time: f64) -> Rows {
        let evaluation = self.evaluate(&self.tets[tet].to_f64());
        let [deviatoric, hydrostatic] = self.scales(tet, time);
        Rows {
            scales: [deviatoric, hydrostatic * evaluation.hydrostatic_scale()],
            evaluation,
        }
    }

    /// `None` if the pattern has more entries than can be counted.
    fn pattern(&self) -> Option<Pattern> {
        let mut offsets = vec![0; self.particle_count() + 1];
        let moving = |p: u32| self.moves(p as usize);
        let all = || {
            self.tets.iter().enumerate().flat_map(|(t, tet)| {
                tet.particles
                    .into_iter()
                    .enumerate()
                    .map(move |(k, p)| (t, k, p))
            })
        };
        for (_, _, p) in all().filter(|&(_, _, p)| moving(p)) {
            offsets[p as usize + 1] += 1;
        }
        for p in 0..self.particle_count() {
            offsets[p + 1] += offsets[p];
        }
        let mut next = offsets.clone();
        let mut corners = vec![[0; 2]; offsets[self.particle_count()]];
        for (t, k, p) in all().filter(|&(_, _, p)| moving(p)) {
            corners[next[p as usize]] = [t, k];
            next[p as usize] += 1;
        }
        let size = 2 * self.tet_count();
        let mut indices: Vec<Pair<usize, usize>> = (0..size).map(|i| Pair::new(i, i)).collect();
        for p in 0..self.particle_count() {
            for_each_coupling(
                &corners[offsets[p]..offsets[p + 1]],
                |[t, _, c], [u, _, d]| {
                    indices.push(Pair::new(2 * t + c, 2 * u + d));
                },
            );
        }
        let (structure, order) =
            SymbolicSparseColMat::try_new_from_indices(size, size, &indices).ok()?;
        let elimination = SymbolicLlt::try_new(structure.as_ref(), Side::Lower).ok()?;
        Some(Pattern {
            offsets,
            corners,
            structure,
            order,
            elimination,
        })
    }

    /// The values of the lower triangle in the order in which the pattern lists their places.
    fn entries(&self, pattern: &Pattern, rows: &[Rows]) -> Vec<f64> {
        let mut entries = vec![1.0; 2 * rows.len()];
        for p in 0..self.particle_count() {
            let weight = weight::<R>(&self.particles[p]).to_f64();
            let corners = &pattern.corners[pattern.offsets[p]..pattern.offsets[p + 1]];
            for_each_coupling(corners, |[t, k, c], [u, l, d]| {
                entries.push(weight * rows[t].gradient(c, k).dot(rows[u].gradient(d, l)));
            });
        }
        entries
    }
}

/// Calls `visit` with all pairs of constraints, each as tet, corner and number, that meet at a particle with these
/// corners, the later one first.
fn for_each_coupling(corners: &[[usize; 2]], mut visit: impl FnMut([usize; 3], [usize; 3])) {
    for &[t, k] in corners {
        for &[u, l] in corners.iter().filter(|&&[u, _]| u <= t) {
            for (c, d) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if 2 * t + c >= 2 * u + d {
                    visit([t, k, c], [u, l, d]);
                }
            }
        }
    }
}
