//! [`ScalarConstraints`]: constraints of one number on a few particles, solved by colored Gauss-Seidel.
//!
//! What distances and volumes have in common: a value C, its gradients, a compliance, a damping time, and an order in
//! which those that share particles do not meet. One step of XPBD is
//! `Δλ = -(C + α̃ λ + γ ∇C · (x - xₙ)) / ((1 + γ) Σ w |∇C|² + α̃)` with `α̃ = α / Δt²` and `γ` the damping time over
//! Δt. With one iteration a substep the multiplier λ is 0 and not stored.
//!
//! Source: Macklin, Müller, Chentanez 2016, equations 18 and 26. Cost: 60 operations a distance, 150 a volume.

use incise_graph::{ClusterId, Incidence, Schedule};
use rayon::prelude::*;

use super::ConstraintKind;
use crate::float::{load, store, weight};
use crate::particles::Particles;
use crate::substep::{Factors, Substep};
use crate::{Float, XpbdError};

/// Constraints in a color from which a second thread pays for its wake-up.
const PARALLEL_CONSTRAINTS: usize = 256;

/// One constraint on `K` particles.
pub(crate) trait ScalarConstraint<R: Float, const K: usize>: Sync {
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "C: serde::Serialize",
        deserialize = "C: serde::Deserialize<'de>"
    ))
)]
pub(crate) struct ScalarConstraints<R: Float, C, const K: usize> {
    pub(crate) list: Vec<C>,
    pub(crate) schedule: Schedule,
    damped: bool,
    /// Kept only while a step has more than one iteration.
    #[cfg_attr(feature = "serde", serde(skip))]
    multipliers: Vec<R::Atomic>,
}

impl<R: Float, C, const K: usize> Default for ScalarConstraints<R, C, K> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            schedule: Schedule::default(),
            damped: false,
            multipliers: Vec::new(),
        }
    }
}

impl<R: Float, C: Clone, const K: usize> Clone for ScalarConstraints<R, C, K> {
    fn clone(&self) -> Self {
        Self {
            list: self.list.clone(),
            schedule: self.schedule.clone(),
            damped: self.damped,
            // Each substep begins with new ones.
            multipliers: Vec::new(),
        }
    }
}

impl<R: Float, C: ScalarConstraint<R, K>, const K: usize> ScalarConstraints<R, C, K> {
    /// Constraints and a schedule of theirs. `what` names the kind.
    pub(crate) fn new(
        what: &'static str,
        particle_count: usize,
        list: Vec<C>,
        schedule: Schedule,
    ) -> Result<Self, XpbdError> {
        let refuse = |source| XpbdError::Schedule { what, source };
        let particles = list.iter().map(C::particles);
        let incidence = Incidence::from_constraints(particle_count, particles).map_err(refuse)?;
        schedule.check(&incidence).map_err(refuse)?;
        if list.is_empty() {
            return Ok(Self::default());
        }
        let damped = list.iter().any(|c| c.damping() > R::ZERO);
        Ok(Self {
            list,
            schedule,
            damped,
            multipliers: Vec::new(),
        })
    }

    /// The order in which the constraints are solved, if there are any.
    pub(crate) fn schedule(&self) -> Option<&Schedule> {
        (!self.list.is_empty()).then_some(&self.schedule)
    }

    /// Replaces a constraint, or appends one.
    pub(crate) fn put(&mut self, index: usize, constraint: C) {
        self.damped |= constraint.damping() > R::ZERO;
        if index == self.list.len() {
            self.list.push(constraint);
        } else {
            self.list[index] = constraint;
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
    fn solve_one<const DAMPED: bool>(
        &self,
        index: usize,
        particles: &Particles<R>,
        factors: &Factors<R>,
    ) {
        let constraint = &self.list[index];
        let numbers = constraint.particles();
        let cells = numbers.map(|p| &particles.cells[p as usize]);
        let x = cells.map(|cell| load::<R>(cell));
        let weights = cells.map(|cell| weight::<R>(cell));
        let Some((value, gradients)) = constraint.evaluate(x) else {
            return;
        };
        let (mut damping, mut rate, mut steepness) = (R::ZERO, R::ZERO, R::ZERO);
        if DAMPED {
            damping = constraint.damping() * factors.per_time;
            for k in 0..K {
                let motion = x[k] - particles.previous[numbers[k] as usize];
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
            store::<R>(cells[k], x[k] + gradients[k] * (weights[k] * change));
        }
        if let Some(multiplier) = multiplier {
            (before + change).store(multiplier);
        }
        if particles.keeps_refused() {
            for k in 0..K {
                particles.refuse(numbers[k], gradients[k] * change);
            }
        }
    }
}

impl<R: Float, C: ScalarConstraint<R, K>, const K: usize> ConstraintKind<R>
    for ScalarConstraints<R, C, K>
{
    fn begin(&mut self, _particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        self.multipliers.clear();
        if substep.has_multipliers {
            self.multipliers
                .resize_with(self.list.len(), || R::ZERO.cell());
        }
        0
    }

    /// One pass over all constraints, color after color, within a color in parallel.
    fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) {
        if self.list.is_empty() {
            return;
        }
        let factors = &substep.factors;
        if self.damped {
            self.sweep(|index| self.solve_one::<true>(index, particles, factors));
        } else {
            self.sweep(|index| self.solve_one::<false>(index, particles, factors));
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.list)
    }
}
