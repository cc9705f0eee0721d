//! [`CoarseCorrection`]: a truncated Newton step for the whole body, preconditioned by aggregates.
//!
//! The error that sweeps leave varies slowly over the body. A correction solves `A d = f` with the semidefinite second
//! derivatives A (`hessian`) and the residual forces f by conjugate gradients, and moves along d while the potential
//! falls. The preconditioner is a symmetric Gauss-Seidel sweep over the blocks in the colors of the stars, with the
//! affine motions of aggregates in between (`coarse`): a two-level cycle. Only the aggregates are factored, not the
//! mesh, so a cut only needs a new pattern.
//!
//! With an accuracy the matrix is kept as long as steps gain the predicted energy: a body that moves smoothly needs a
//! new one only from time to time.
//!
//! From a start far from rest, with many solutions, it may converge to one of higher energy than sweeps would: sweep
//! first.
//!
//! Source: truncated Newton after Nash 2000; aggregates after Vaněk, Mandel, Brezina 1996, without smoothing.
//! Cost: filling is 3 sweeps, factoring 2 to 5, an iteration of conjugate gradients half of one.

use super::aggregates::aggregates;
use super::coarse::Coarse;
use super::conjugate::{Conjugate, FEWEST_ITERATIONS, Limits};
use super::constraints::CORRECTION_PENALTY;
use super::matrix::Blocks;
use super::state::Potential;
use super::{ImplicitStep, VbdReport, VbdSettings, VertexStars};
use crate::float::{finite, load, store, weight};
use crate::{Float, Solver, XpbdError};

/// Settings of a coarse correction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CoarseCorrectionSettings {
    /// Largest number of iterations of conjugate gradients.
    pub iterations: u32,
    /// Ends the iterations once the distance to the solution of the linear system, in the norm of the energy, is
    /// estimated to have fallen to this fraction.
    pub reduction: f64,
    /// Approximate number of particles of an aggregate before all cuts: see [`CoarseCorrection::new`].
    pub aggregate: usize,
}

impl Default for CoarseCorrectionSettings {
    fn default() -> Self {
        Self {
            iterations: 50,
            reduction: 0.01,
            aggregate: 120,
        }
    }
}

/// Report of a coarse correction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CoarseCorrectionReport {
    /// Number of iterations of conjugate gradients.
    pub iterations: u32,
    /// Fraction of the direction that was taken; 0 if no fraction lowers the potential.
    pub taken: f64,
    /// Estimated relative error after the correction: the root of the energy left to gain over the sum of the tets'
    /// energy and 3e-5 of the kinetic energy. Infinite for a state without energy that is no solution.
    pub error: f64,
}

/// How a search along a direction ended.
struct Search {
    /// The part of the direction that was taken, or 0.
    taken: f64,
    /// The energy of the tets in the end.
    elastic: f64,
    /// The decrease of the potential.
    gain: f64,
}

impl Search {
    fn failed(elastic: f64) -> Self {
        Self {
            taken: 0.0,
            elastic,
            gain: 0.0,
        }
    }
}

/// The weight of the energy of the motion in the measure of an error: what is lost of a motion in one step adds up in
/// the steps to come.
const MOTION: f64 = 3e-5;

/// Matrix, aggregates and vectors of a coarse correction, for the stars that it was created from.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct CoarseCorrection<R: Float> {
    settings: CoarseCorrectionSettings,
    /// Rows at first, when aggregates had the size of the settings.
    first_rows: usize,
    /// The particle of each row.
    order: Vec<u32>,
    matrix: Blocks<R>,
    coarse: Coarse,
    conjugate: Conjugate<R>,
    held: Vec<bool>,
    force: Vec<R::Vector>,
    base: Vec<R::Vector>,
    /// The substep time and held rows that the matrix was filled for, while it may be kept.
    filled: Option<(R, Vec<bool>)>,
    /// Whether the stars have changed since the last frame.
    is_cut: bool,
}

/// The part of the accuracy wanted that conjugate gradients may leave. Energies add, so 5/9 of the energy allowed is for
/// what the matrix misses.
const CG_ERROR_SHARE: f64 = 2.0 / 3.0;

/// That of a body with a Poisson's ratio above [`NEARLY_INCOMPRESSIBLE`]: the energy of its volume changes is large, so
/// shear may be further off than the energy tells (`cargo xtask defaults --only newton`). At a third the error of a
/// spinning body of 0.4999 was above or below the accuracy depending on the last digits.
const CG_ERROR_SHARE_INCOMPRESSIBLE: f64 = 1.0 / 5.0;

/// The largest Poisson's ratio at which the error in energy is one of the motion.
const NEARLY_INCOMPRESSIBLE: f64 = 0.49;

/// A matrix is filled again once its steps gain a part more or less than it predicts.
const KEPT_MISMATCH: f64 = 0.1;

/// A matrix is filled again after a step that gains more than this part of the energy.
const CALM: f64 = 0.01;

/// Halvings of a direction that does not lower the potential.
const HALVINGS: usize = 8;

/// Rounds in a row without a correction after which a substep ends: what is left is rounding.
const IDLE_ROUNDS: u32 = 2;

impl<R: Float> CoarseCorrection<R> {
    /// Returns the bytes of all arrays. O(1).
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.matrix.bytes()
            + size_of_val(&*self.order)
            + self.coarse.bytes()
            + self.conjugate.bytes()
            + size_of_val(&*self.held)
            + size_of_val(&*self.force)
            + size_of_val(&*self.base)
            + self.filled.as_ref().map_or(0, |(_, rows)| rows.len())
    }

    /// Creates the correction for some stars. O(pairs).
    ///
    /// Large aggregates are cheap to factor but need more iterations of conjugate gradients. The factor costs
    /// `(12 · aggregates)³ / 6` multiplications, so let the size of aggregates grow with the body: some tens of
    /// aggregates are enough.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] if the number of iterations or the size of aggregates is 0, or the reduction is not
    /// between 0 and 1.
    pub fn new(
        stars: &VertexStars<R>,
        settings: CoarseCorrectionSettings,
    ) -> Result<Self, XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        if settings.iterations == 0 {
            return refuse("iterations", 0.0, "at least 1");
        }
        if !(settings.reduction > 0.0 && settings.reduction < 1.0) {
            return refuse("reduction", settings.reduction, "above 0 and below 1");
        }
        if settings.aggregate == 0 {
            return refuse("aggregate", 0.0, "at least 1");
        }
        let matrix = Blocks::new(&stars.data);
        let (of, count) = aggregates(&matrix.offsets, &matrix.columns, settings.aggregate);
        Ok(Self {
            settings,
            first_rows: stars.data.order.len(),
            order: stars.data.order.clone(),
            matrix,
            coarse: Coarse::new(of, count),
            conjugate: Conjugate::default(),
            held: Vec::new(),
            force: Vec::new(),
            base: Vec::new(),
            filled: None,
            is_cut: false,
        })
    }

    /// Updates the correction after its stars were updated or rebuilt, for example after a cut. Particles keep their
    /// aggregates, new ones join those around them, and the factor stays in use. When it has aged, as many aggregates are
    /// grown again, larger ones if cuts have added particles. O(changed stars) and a copy of the rest after an update,
    /// O(pairs) after a rebuild.
    pub fn sync(&mut self, stars: &VertexStars<R>) {
        let old = std::mem::replace(&mut self.order, stars.data.order.clone());
        self.matrix.sync(&stars.data);
        self.coarse.sync(&old, &self.order, &self.matrix);
        self.filled = None;
        self.is_cut = true;
    }

    /// Compares the pattern of the matrix with that of the stars. O(pairs).
    ///
    /// # Errors
    /// [`XpbdError::Layout`] if it is another one.
    pub fn check(&self, stars: &VertexStars<R>) -> Result<(), XpbdError> {
        self.matrix.check(&stars.data)
    }

    /// Returns the number of aggregates.
    #[must_use]
    pub fn aggregate_count(&self) -> usize {
        self.coarse.count()
    }
}

impl<R: Float> Solver<R> {
    /// A frame of sweeps, each with a correction.
    pub(crate) fn frame_of_corrections(
        &mut self,
        stars: &mut VertexStars<R>,
        correction: &mut CoarseCorrection<R>,
        settings: &VbdSettings,
    ) -> Result<VbdReport, XpbdError> {
        let mut idle = 0;
        let report = self.frame_of_vbd(stars, settings, CORRECTION_PENALTY, |step| {
            step.sweep();
            let report = step.correct(correction);
            idle = if report.taken > 0.0 { 0 } else { idle + 1 };
            step.error = Some(report.error);
            idle < IDLE_ROUNDS && step.accuracy.is_none_or(|accuracy| report.error > accuracy)
        });
        correction.is_cut = false;
        report
    }
}

impl<R: Float> ImplicitStep<'_, R> {
    /// Moves the whole body along a Newton direction, by a length at which the potential has fallen.
    ///
    /// Particles that touch a collider do not move; sweeps lift them off.
    ///
    /// # Panics
    /// If the correction was created for other stars.
    pub fn correct(&mut self, correction: &mut CoarseCorrection<R>) -> CoarseCorrectionReport {
        let CoarseCorrection {
            settings,
            first_rows,
            matrix,
            coarse,
            conjugate,
            held,
            force,
            base,
            filled,
            is_cut,
            ..
        } = correction;
        let rows = self.stars.data.order.len();
        assert!(
            matrix.belongs_to(&self.stars.data),
            "the correction belongs to these stars"
        );
        held.clear();
        base.clear();
        for &p in &self.stars.data.order {
            let particle = &self.solver.particles.cells[p as usize];
            let x = load::<R>(particle);
            let touching = self.solver.constraints.colliders.touches(x);
            held.push(weight::<R>(particle) <= R::ZERO || touching);
            base.push(x);
        }
        force.clear();
        force.resize(rows, R::Vector::default());
        let colors = &self.stars.data.colors;
        let mut is_kept = self.accuracy.is_some()
            && matches!(&*filled, Some((time, rows)) if *time == self.time && rows == held);
        if is_kept {
            matrix.forces(self.solver, self.stars, self.time, held, force);
        } else {
            matrix.fill(self.solver, self.stars, self.time, held, force);
            conjugate.prepare(matrix, colors, held);
            *filled = Some((self.time, held.clone()));
        }
        if coarse.is_stale(*is_cut) {
            if coarse.is_outdated() {
                // The factor grows with the cube of their number, so aggregates grow with the body.
                let size = settings.aggregate * rows / (*first_rows).max(1);
                let size = size.max(settings.aggregate);
                let (of, count) = aggregates(&matrix.offsets, &matrix.columns, size);
                *coarse = Coarse::new(of, count);
            }
            coarse.place(|row| R::to_dvec3(base[row]));
            matrix.mirror();
            coarse.assemble(matrix, held);
        }
        let start = self.potentials();
        let motion = MOTION * self.kinetic();
        // The elastic energy of a prediction may be far above that of the solution, which is below the potential.
        let energy = |gain: f64| start.elastic.min(start.total - gain).max(0.0) + motion;
        let materials = &self.solver.tets.materials;
        let share = if materials
            .iter()
            .any(|material| material.poisson_ratio > NEARLY_INCOMPRESSIBLE)
        {
            CG_ERROR_SHARE_INCOMPRESSIBLE
        } else {
            CG_ERROR_SHARE
        };
        let accuracy = share * self.accuracy.unwrap_or(0.0);
        let limits = Limits {
            iterations: settings.iterations,
            reduction: settings.reduction,
            energy: |gain: f64| accuracy * accuracy * energy(gain),
        };
        let mut solved = conjugate.solve(coarse, force, held, &limits);
        let is_violent = |slope: f64| 0.5 * slope > CALM * energy(0.5 * slope);
        if is_kept && is_violent(solved.slope) {
            is_kept = false;
            matrix.fill(self.solver, self.stars, self.time, held, force);
            conjugate.prepare(matrix, colors, held);
            solved = conjugate.solve(coarse, force, held, &limits);
        }
        coarse.note(solved.iterations, solved.left);
        self.stars.try_start |= solved.iterations > FEWEST_ITERATIONS;
        let (direction, slope) = (conjugate.solution(), solved.slope);
        let of_parts = self.potentials_of_parts();
        let Search {
            taken,
            elastic,
            gain,
        } = self.search(start, base, direction, slope);
        if let Some(before) = of_parts {
            self.take_back_risen_parts(&before, start.rounding, base);
        }
        // A full step on a quadratic gains half of the slope, and leaves what the iteration left. Where a new matrix
        // misses the gain by a part, the square of that part is left; where that of an earlier state does, at most the
        // part.
        let expected = 0.5 * slope.max(0.0);
        let mismatch = if expected > start.rounding {
            (1.0 - gain / expected).abs()
        } else {
            0.0
        };
        let mismatch = match (taken == 1.0, is_kept) {
            (true, true) => mismatch,
            (true, false) => mismatch * mismatch,
            (false, _) => 1.0,
        };
        let left = expected * (solved.left + mismatch).min(1.0);
        let energy = elastic + MOTION * self.kinetic();
        if mismatch > KEPT_MISMATCH || is_violent(slope) {
            *filled = None;
        }
        let error = if left > 0.0 {
            (left / energy).sqrt()
        } else {
            0.0
        };
        CoarseCorrectionReport {
            iterations: solved.iterations,
            taken,
            error,
        }
    }

    /// The potential of each connected part of the body, at its smallest particle; `None` of a body that is one part.
    fn potentials_of_parts(&mut self) -> Option<Vec<f64>> {
        let parts = self.stars.parts(self.solver);
        if parts.iter().all(|part| *part == parts[0]) {
            return None;
        }
        let mut sums = vec![0.0; parts.len()];
        self.add_potentials(&mut sums);
        Some(sums)
    }

    /// Puts parts whose potential was `before` back to `base` if it has risen. The length of a step is chosen for the
    /// whole body, in which a crumb that gains energy does not count; gaining a little in each frame it would fly away.
    fn take_back_risen_parts(&self, before: &[f64], rounding: f64, base: &[R::Vector]) {
        let mut after = vec![0.0; before.len()];
        self.add_potentials(&mut after);
        for (&p, &x) in self.stars.data.order.iter().zip(base) {
            let part = self.stars.parts[p as usize] as usize;
            // What is no number has not fallen.
            let is_sound = after[part] - before[part] <= rounding;
            if !is_sound {
                store::<R>(&self.solver.particles.cells[p as usize], x);
            }
        }
    }

    /// Goes from `base`, where the potential is `start`, along a direction on which it falls by `slope` at first, and out of
    /// colliders: what that adds to the potential counts. Pushed out afterwards, a stiff body that hits the ground had a
    /// thousand times the energy of its motion.
    fn search(
        &self,
        start: Potential,
        base: &[R::Vector],
        direction: &[R::Vector],
        slope: f64,
    ) -> Search {
        let Solver {
            particles,
            constraints,
            ..
        } = &*self.solver;
        let place = |part: f64| {
            let part = R::from_f64(part);
            let mut sound = true;
            for ((&p, &x), &d) in self.stars.data.order.iter().zip(base).zip(direction) {
                let moved = x + d * part;
                sound &= finite::<R>(moved);
                store::<R>(
                    &particles.cells[p as usize],
                    if finite::<R>(moved) { moved } else { x },
                );
            }
            // The base is outside, and exact.
            if part > R::ZERO {
                constraints.colliders.project(particles);
            }
            sound
        };
        if !(slope.is_finite() && slope > 0.0) {
            return Search::failed(start.elastic);
        }
        let mut part = 1.0;
        for _ in 0..HALVINGS {
            let sound = place(part);
            let here = self.potentials();
            let rise = here.total - start.total;
            // Below its own rounding the potential says nothing, and so close to the solution Newton is right.
            let drowned = part == 1.0 && 0.5 * slope < start.rounding;
            if sound && (rise < 0.0 || drowned) {
                return Search {
                    taken: part,
                    elastic: here.elastic,
                    gain: -rise,
                };
            }
            // The minimum of the parabola through what is known, within reason.
            let parabola = slope * part * part / (2.0 * (rise + slope * part));
            part = if parabola.is_finite() {
                parabola.clamp(0.1 * part, 0.5 * part)
            } else {
                0.1 * part
            };
        }
        place(0.0);
        Search::failed(start.elastic)
    }
}
