//! [`Constraints`]: constraints of one number on a few particles, solved by colored Gauss-Seidel.
//!
//! What distances and volumes have in common: a value C, its gradients, a compliance, a damping time, and an order in
//! which those that share particles do not meet. One step of XPBD is
//! `Δλ = -(C + α̃ λ + γ ∇C · (x - xₙ)) / ((1 + γ) Σ w |∇C|² + α̃)` with `α̃ = α / Δt²` and `γ` the damping time over
//! Δt. With one iteration a substep the multiplier λ is 0 and not stored.
//!
//! Source: Macklin, Müller, Chentanez 2016, equations 18 and 26. Cost: 60 operations a distance, 150 a volume.

use incise_graph::{ClusterId, Incidence, Schedule};
use rayon::prelude::*;

use crate::float::{load, store, weight};
use crate::step::Factors;
use crate::{Float, Solver, XpbdError};

/// Constraints in a color from which a second thread pays for its wake-up.
const PARALLEL_CONSTRAINTS: usize = 256;

/// One constraint on `K` particles.
pub(crate) trait Scalar<R: Float, const K: usize>: Sync {
    fn particles(&self) -> [u32; K];
    /// Value and gradients; `None` where there is no gradient.
    fn evaluate(&self, x: [R::Vector; K]) -> Option<(R, [R::Vector; K])>;
    fn compliance(&self) -> R;
    /// Damping time in s.
    fn damping(&self) -> R;
    /// Whether it only makes its value smaller.
    fn one_sided(&self) -> bool;
}

/// All constraints of a kind with their order.
#[derive(Debug)]
pub(crate) struct Constraints<R: Float, C> {
    pub(crate) list: Vec<C>,
    pub(crate) schedule: Schedule,
    damped: bool,
    /// Kept only while a step has more than one iteration.
    multipliers: Vec<R::Atomic>,
}

impl<R: Float, C: Clone> Clone for Constraints<R, C> {
    fn clone(&self) -> Self {
        Self {
            list: self.list.clone(),
            schedule: self.schedule.clone(),
            damped: self.damped,
            // They begin anew with each substep.
            multipliers: Vec::new(),
        }
    }
}

impl<R: Float, C> Constraints<R, C> {
    /// Puts constraints and a schedule together that fit. `what` names the kind.
    pub(crate) fn new<const K: usize>(
        what: &'static str,
        particle_count: usize,
        list: Vec<C>,
        schedule: Schedule,
    ) -> Result<Self, XpbdError>
    where
        C: Scalar<R, K>,
    {
        let refuse = |source| XpbdError::Schedule { what, source };
        let particles = list.iter().map(C::particles);
        let incidence = Incidence::from_constraints(particle_count, particles).map_err(refuse)?;
        schedule.check(&incidence).map_err(refuse)?;
        let damped = list.iter().any(|c| c.damping() > R::ZERO);
        Ok(Self {
            list,
            schedule,
            damped,
            multipliers: Vec::new(),
        })
    }

    /// Replaces a constraint, or appends one.
    pub(crate) fn put<const K: usize>(&mut self, index: usize, constraint: C)
    where
        C: Scalar<R, K>,
    {
        self.damped |= constraint.damping() > R::ZERO;
        if index == self.list.len() {
            self.list.push(constraint);
        } else {
            self.list[index] = constraint;
        }
    }

    /// Begins a substep.
    pub(crate) fn begin(&mut self, with_multipliers: bool) {
        self.multipliers.clear();
        if with_multipliers {
            self.multipliers
                .resize_with(self.list.len(), || R::ZERO.cell());
        }
    }

    /// One pass over all constraints, color after color, within a color in parallel.
    pub(crate) fn pass<const K: usize>(&self, solver: &Solver<R>, factors: &Factors<R>)
    where
        C: Scalar<R, K>,
    {
        if self.damped {
            self.sweep(|index| self.solve::<K, true>(index, solver, factors));
        } else {
            self.sweep(|index| self.solve::<K, false>(index, solver, factors));
        }
    }

    fn sweep(&self, solve: impl Fn(usize) + Sync) {
        let threads = rayon::current_num_threads();
        let schedule = &self.schedule;
        for color in 0..schedule.color_count() {
            let clusters = schedule.clusters(color);
            let solve_all = |clusters: &[ClusterId]| {
                for &cluster in clusters {
                    for &index in schedule.constraints(cluster) {
                        solve(index as usize);
                    }
                }
            };
            let mut constraints = schedule.color_constraints(color);
            if threads == 1 || constraints.nth(PARALLEL_CONSTRAINTS - 1).is_none() {
                solve_all(clusters);
                continue;
            }
            (0..threads).into_par_iter().for_each(|thread| {
                let share = |part| clusters.len() * part / threads;
                solve_all(&clusters[share(thread)..share(thread + 1)]);
            });
        }
    }

    #[inline]
    fn solve<const K: usize, const DAMPED: bool>(
        &self,
        index: usize,
        solver: &Solver<R>,
        factors: &Factors<R>,
    ) where
        C: Scalar<R, K>,
    {
        let constraint = &self.list[index];
        let numbers = constraint.particles();
        let particles = numbers.map(|p| &solver.particles[p as usize]);
        let x = particles.map(|particle| load::<R>(particle));
        let weights = particles.map(|particle| weight::<R>(particle));
        let Some((value, gradients)) = constraint.evaluate(x) else {
            return;
        };
        let (mut damping, mut rate, mut steepness) = (R::ZERO, R::ZERO, R::ZERO);
        if DAMPED {
            damping = constraint.damping() * factors.per_time;
            for k in 0..K {
                let motion = x[k] - solver.previous[numbers[k] as usize];
                rate += R::dot(gradients[k], motion);
            }
        }
        for k in 0..K {
            steepness += weights[k] * R::dot(gradients[k], gradients[k]);
        }
        let compliance = constraint.compliance() / factors.time_squared;
        let multiplier = self.multipliers.get(index);
        let before = multiplier.map_or(R::ZERO, R::load);
        let residual = value + compliance * before + damping * rate;
        let mut change =
            -(residual / ((R::ONE + damping) * steepness + compliance)) * factors.relaxation;
        if constraint.one_sided() {
            // Slack it does not pull, not even to damp; and in all it never pushes.
            if value <= R::ZERO && change < R::ZERO {
                return;
            }
            if before + change > R::ZERO {
                change = -before;
            }
        }
        // Nothing that could move it, or out of range.
        if !change.is_finite() {
            return;
        }
        for k in 0..K {
            store::<R>(particles[k], x[k] + gradients[k] * (weights[k] * change));
        }
        if let Some(multiplier) = multiplier {
            (before + change).store(multiplier);
        }
    }
}
