//! [`Reference`]: the motion of a scene to compare with, and its estimated error.
//!
//! Newton's method is used where `incise-reference` supports the scene: implicit Euler at three step sizes, from which
//! Richardson's extrapolation removes the first two orders of the error. The change by the second extrapolation is the
//! estimated error. Otherwise the solver itself is used, Gauss-Seidel in double precision with one iteration and three
//! numbers of substeps: the finest run counts, and its distance from the next coarser one is the estimated error. The
//! second kind shows the limit of the solver and does not prove that it is correct.
//!
//! Source: Richardson 1911. Cost: seven times the coarsest run.

use serde::Serialize;

use super::motion::{Deviation, Motion};
use super::newton::{Newton, obstacle};
use crate::Error;
use crate::scene::{Backend, Method, Precision, Scene, SolverSpec, Substeps};

/// Method that computes a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ReferenceKind {
    /// Implicit Euler with Newton's method, extrapolated.
    Newton,
    /// The solver itself at a fine substep.
    Xpbd,
}

/// A motion to compare with, and its estimated error.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The motion.
    pub motion: Motion,
    /// Estimate of the error of `motion`.
    pub left: Deviation,
    /// Method that computed `motion`.
    pub kind: ReferenceKind,
    /// Reason for not using Newton's method.
    pub why_not_newton: Option<String>,
    /// The steps, or substeps, of a frame in each of the three runs.
    pub steps: [u32; 3],
    /// Deviation of each of the three runs from `motion`.
    pub errors: [Deviation; 3],
    /// Order of convergence of the three runs, by the largest differences of their positions: `log2` of the ratio of
    /// the difference of the two coarser runs to that of the two finer ones. Not finite if they do not differ.
    pub order: f64,
}

impl Reference {
    /// Computes a reference by Newton's method with `steps`, twice and four times as many steps a frame.
    ///
    /// # Errors
    /// Returns [`Error::Advise`] if the reference does not support a feature of the scene or cannot solve a step, and
    /// the errors of [`crate::Simulation::new`].
    pub fn newton(scene: &Scene, frames: u32, steps: u32) -> Result<Self, Error> {
        let newton = newton(scene)?;
        let steps = [1, 2, 4].map(|n| n * steps.max(1));
        let [a, b, c] = steps.map(|n| run(&newton, frames, n));
        let (a, b, c) = (a?, b?, c?);
        let coarse = a.combined(-1.0, &b, 2.0);
        let fine = b.combined(-1.0, &c, 2.0);
        let limit = coarse.combined(-1.0 / 3.0, &fine, 4.0 / 3.0);
        let left = fine.deviation(&limit);
        Ok(Self::of(
            ReferenceKind::Newton,
            steps,
            [&a, &b, &c],
            limit,
            left,
        ))
    }

    /// Computes a reference by the solver itself with `substeps`, twice and four times as many substeps a frame for all
    /// bodies.
    ///
    /// # Errors
    /// Returns the errors of [`Motion::of`].
    pub fn xpbd(scene: &Scene, frames: u32, substeps: u32) -> Result<Self, Error> {
        let steps = [1, 2, 4].map(|n| n * substeps.max(1));
        let run = |n| {
            let solver = SolverSpec {
                time_step: scene.solver.time_step,
                clustering: scene.solver.clustering.clone(),
                substeps: Substeps::Fixed(n),
                precision: Precision::F64,
                kappa_limit: scene.solver.kappa_limit,
                backend: Backend::Cpu,
                ..SolverSpec::of(Method::GaussSeidel)
            };
            Motion::of(&with(scene, &solver), frames, None)
        };
        let [a, b, c] = steps.map(run);
        let (a, b, c) = (a?, b?, c?);
        let (limit, left) = (c.clone(), b.deviation(&c));
        Ok(Self::of(
            ReferenceKind::Xpbd,
            steps,
            [&a, &b, &c],
            limit,
            left,
        ))
    }

    fn of(
        kind: ReferenceKind,
        steps: [u32; 3],
        runs: [&Motion; 3],
        limit: Motion,
        left: Deviation,
    ) -> Self {
        let [a, b, c] = runs;
        let order = (a.deviation(b).largest / b.deviation(c).largest).log2();
        Self {
            errors: runs.map(|run| run.deviation(&limit)),
            motion: limit,
            left,
            kind,
            why_not_newton: None,
            steps,
            order,
        }
    }
}

/// Computes the motion of a scene by implicit Euler and Newton's method with `steps` steps a frame.
///
/// # Errors
/// Returns the errors of [`Reference::newton`].
pub fn newton_motion(scene: &Scene, frames: u32, steps: u32) -> Result<Motion, Error> {
    run(&newton(scene)?, frames, steps)
}

fn newton(scene: &Scene) -> Result<Newton, Error> {
    if let Some(what) = obstacle(scene) {
        return Err(Error::Advise(format!(
            "the reference by Newton's method cannot do this scene: it has {what}"
        )));
    }
    Newton::new(scene)
}

fn run(newton: &Newton, frames: u32, steps: u32) -> Result<Motion, Error> {
    let motion = newton.motion(frames, steps.max(1));
    motion.map_err(|error| Error::Advise(format!("the reference fails: {error}")))
}

/// Returns the scene with other solver settings for all bodies, and reports of times only.
#[must_use]
pub fn with(scene: &Scene, solver: &SolverSpec) -> Scene {
    let mut scene = scene.clone();
    scene.solver = solver.clone();
    scene.report = crate::scene::ReportSpec::default();
    for body in &mut scene.body {
        body.substeps = None;
    }
    scene
}
