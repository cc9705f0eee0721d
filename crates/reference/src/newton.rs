//! Newton's method on the incremental potential.
//!
//! The unknowns are the displacements d from the start, not positions: inertia compares d with `Δt v`, and a difference
//! of positions would divide their rounding error by the square of the step. With `k = 1/Δt²` (0 in statics) the
//! potential is `Σ m (k/2 |d - Δt v|² - g · d) + U(x + d)`.
//!
//! An iteration solves with the exact Hessian, which converges quadratically. If that is not positive definite, the
//! iteration uses the Hessian with the eigenvalues of each tet clamped, which gives a descent direction. Backtracking
//! until the potential has decreased enough (Armijo's rule) makes it converge from any start. Near the end the decrease
//! is below rounding, so the rule has a tolerance for rounding; the iterations stop by the unbalanced force.
//!
//! Source: Nocedal and Wright 2006, chapters 3.1 and 3.4; Teran et al. 2005 (clamping).
//! Cost: one factorization per iteration, sometimes two, and a pass over the tets per trial.

use glam::DVec3;

use crate::element::Element;
use crate::system::System;
use crate::{ReferenceError, clamp_eigenvalues};

/// Accepted unbalanced force as a fraction of the acting forces.
const TOLERANCE: f64 = 1e-10;
/// Iterations before the solution fails.
const MAX_ITERATIONS: usize = 500;
/// Step halvings before a direction is rejected: the step is then about 1e-18.
const MAX_HALVINGS: usize = 60;
/// Sufficient fraction of the predicted decrease.
const ARMIJO: f64 = 1e-4;
/// Smallest eigenvalue of a tet's stiffness after clamping, in shear moduli.
const FLOOR: f64 = 1e-3;
/// Rounding of a sum of a few terms, in units of their size.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Accuracy of a solved step.
///
/// A solution is accepted when the unbalanced force is at most 1e-10 of the acting forces, or at most the rounding
/// error: at rest nothing else is left. The acting forces are the elastic forces on all particles, inertia and gravity;
/// their norms are added.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Norms of the unbalanced force in N, at the start and after each iteration. Relative to the scale, each is about
    /// the square of the previous one near the end.
    pub residuals: Vec<f64>,
    /// Norm of the acting forces in N.
    pub scale: f64,
    /// Upper estimate of the rounding error of the unbalanced force in N.
    pub rounding: f64,
    /// Iterations with a Hessian that was not positive definite and was clamped.
    pub clamped: usize,
}

impl Report {
    /// Newton iterations: the number of factorizations, except those of matrices that were not positive definite.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.residuals.len() - 1
    }

    /// Norm of the unbalanced force in N after the last iteration.
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.residuals.last().copied().unwrap_or(0.0)
    }
}

/// Borrowed parts of a body.
pub(crate) struct Parts<'a> {
    /// Positions at the start.
    pub(crate) positions: &'a [DVec3],
    pub(crate) masses: &'a [f64],
    pub(crate) elements: &'a [Element],
    pub(crate) system: &'a mut System,
}

/// Minimization problem of a step.
pub(crate) struct Problem {
    /// Reciprocal of the squared time step, 0 in statics.
    pub(crate) rate: f64,
    /// Displacement of each particle by its velocity over the step.
    pub(crate) inertial: Vec<DVec3>,
    pub(crate) gravity: DVec3,
    /// Particles that do not move.
    pub(crate) held: Vec<bool>,
}

/// Potential and its gradient at given displacements.
struct Evaluation {
    energy: f64,
    /// Bound of the rounding error of the energy.
    energy_rounding: f64,
    /// Negative unbalanced forces; zero at fixed particles.
    gradient: Vec<DVec3>,
    residual: f64,
    scale: f64,
    rounding: f64,
}

impl Evaluation {
    fn is_finite(&self) -> bool {
        let rounding = self.rounding + self.energy_rounding;
        (self.energy + self.residual + self.scale + rounding).is_finite()
    }

    fn converged(&self) -> bool {
        self.residual <= (TOLERANCE * self.scale).max(self.rounding)
    }
}

/// Minimizes the potential, downhill from zero displacement or from `start`, whichever is lower.
pub(crate) fn minimize(
    body: &mut Parts<'_>,
    problem: &Problem,
    start: Option<&[DVec3]>,
) -> Result<(Vec<DVec3>, Report), ReferenceError> {
    let mut d = vec![DVec3::ZERO; body.positions.len()];
    let mut now = evaluate(body, problem, &d);
    if let Some(start) = start {
        let other = evaluate(body, problem, start);
        if other.is_finite() && !(now.is_finite() && now.energy <= other.energy) {
            (d, now) = (start.to_vec(), other);
        }
    }
    if !now.is_finite() {
        return Err(ReferenceError::Range);
    }
    let mut report = Report {
        residuals: vec![now.residual],
        scale: now.scale,
        rounding: now.rounding,
        clamped: 0,
    };
    while !now.converged() {
        let next = if report.iterations() < MAX_ITERATIONS {
            improve(body, problem, &d, &now, &mut report)?
        } else {
            None
        };
        let Some((moved, evaluation)) = next else {
            return Err(ReferenceError::NotConverged {
                iterations: report.iterations(),
                residual: now.residual,
                scale: now.scale,
            });
        };
        (d, now) = (moved, evaluation);
        report.residuals.push(now.residual);
    }
    (report.scale, report.rounding) = (now.scale, now.rounding);
    Ok((d, report))
}

/// Does one iteration; `None` if no descent direction was found.
fn improve(
    body: &mut Parts<'_>,
    problem: &Problem,
    d: &[DVec3],
    now: &Evaluation,
    report: &mut Report,
) -> Result<Option<(Vec<DVec3>, Evaluation)>, ReferenceError> {
    for clamp in [false, true] {
        assemble(body, problem, d, clamp);
        let mut direction: Vec<DVec3> = now.gradient.iter().map(|g| -g).collect();
        if !body.system.solve(&mut direction)? {
            continue;
        }
        if let Some(found) = search(body, problem, d, now, &direction) {
            report.clamped += usize::from(clamp);
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// Backtracking line search: returns the first of the full step, its half, its quarter and so on with a sufficient
/// decrease.
fn search(
    body: &Parts<'_>,
    problem: &Problem,
    d: &[DVec3],
    now: &Evaluation,
    direction: &[DVec3],
) -> Option<(Vec<DVec3>, Evaluation)> {
    let slope: f64 = now
        .gradient
        .iter()
        .zip(direction)
        .map(|(g, p)| g.dot(*p))
        .sum();
    if slope.is_nan() || slope >= 0.0 {
        return None;
    }
    let mut share = 1.0;
    for _ in 0..MAX_HALVINGS {
        let moved: Vec<DVec3> = d
            .iter()
            .zip(direction)
            .map(|(d, p)| d + p * share)
            .collect();
        let next = evaluate(body, problem, &moved);
        let rounding = now.energy_rounding + next.energy_rounding;
        if next.is_finite() && next.energy <= now.energy + ARMIJO * share * slope + rounding {
            return Some((moved, next));
        }
        share *= 0.5;
    }
    None
}

fn evaluate(body: &Parts<'_>, problem: &Problem, d: &[DVec3]) -> Evaluation {
    let x: Vec<DVec3> = body.positions.iter().zip(d).map(|(x, d)| x + d).collect();
    let (mut energy, mut energy_terms) = (0.0, 0.0);
    let mut gradient = vec![DVec3::ZERO; x.len()];
    // Rounding error of the force on each particle.
    let mut noise = vec![0.0; x.len()];
    for element in body.elements {
        let f = element.deformation(&x);
        let law = &element.law;
        energy += element.volume * law.energy_density(f);
        energy_terms += element.volume * law.energy_terms(f);
        let stress = law.stress(f);
        let corners = element.particles.map(|p| x[p as usize]);
        let far = corners
            .iter()
            .map(|x| x.abs().max_element())
            .fold(0.0, f64::max);
        let steepest = element
            .gradients
            .iter()
            .map(|g| g.length())
            .fold(0.0, f64::max);
        // Cancellation between terms, and rounding of the positions multiplied by the stiffness.
        let stress_noise = law.stress_terms(f) + law.stiffness_bound(f) * steepest * far;
        for (p, g) in element.particles.into_iter().zip(element.gradients) {
            gradient[p as usize] += stress * g * element.volume;
            noise[p as usize] += stress_noise * g.length() * element.volume;
        }
    }
    let mut squares = [0.0; 5];
    for (p, (gradient, &mass)) in gradient.iter_mut().zip(body.masses).enumerate() {
        let elastic = *gradient;
        let weight = problem.gravity * mass;
        let mut inertia = DVec3::ZERO;
        if problem.held[p] {
            *gradient = DVec3::ZERO;
            noise[p] = 0.0;
        } else {
            let ahead = d[p] - problem.inertial[p];
            let kinetic = 0.5 * mass * problem.rate * ahead.length_squared();
            energy += kinetic - weight.dot(d[p]);
            energy_terms += kinetic + weight.length() * d[p].length();
            inertia = ahead * (mass * problem.rate);
            *gradient += inertia - weight;
            let sizes = d[p].length() + problem.inertial[p].length();
            noise[p] += mass * problem.rate * sizes + weight.length();
        }
        let lengths = [*gradient, elastic, inertia, weight].map(DVec3::length_squared);
        for (square, length) in squares
            .iter_mut()
            .zip(lengths.into_iter().chain([noise[p] * noise[p]]))
        {
            *square += length;
        }
    }
    let [residual, elastic, inertia, weight, noise] = squares.map(f64::sqrt);
    Evaluation {
        energy,
        energy_rounding: ROUNDING * energy_terms,
        gradient,
        residual,
        scale: elastic + inertia + weight,
        rounding: ROUNDING * noise,
    }
}

/// Assembles the Hessian, with the eigenvalues of each tet clamped if `clamp` is set.
fn assemble(body: &mut Parts<'_>, problem: &Problem, d: &[DVec3], clamp: bool) {
    let x: Vec<DVec3> = body.positions.iter().zip(d).map(|(x, d)| x + d).collect();
    let system = &mut *body.system;
    system.clear();
    for (p, &held) in problem.held.iter().enumerate() {
        system.add_diagonal(
            p,
            if held {
                1.0
            } else {
                body.masses[p] * problem.rate
            },
        );
    }
    for element in body.elements {
        let mut h = element.law.stiffness(element.deformation(&x));
        if clamp {
            clamp_eigenvalues(&mut h, FLOOR * element.law.mu);
        }
        let blocks = element.stiffness(&h);
        for (a, &r) in element.particles.iter().enumerate() {
            for (b, &c) in element.particles.iter().enumerate() {
                let held = problem.held[r as usize] || problem.held[c as usize];
                if r >= c && !held {
                    system.add(r, c, blocks[a][b]);
                }
            }
        }
    }
}
