//! [`Reference`]: what the motion of a scene should be, and how well that is known.
//!
//! By Newton's method where `incise-reference` knows all that the scene has: implicit Euler at three step sizes, from
//! which Richardson's extrapolation removes the first two orders of the error; how much removing the second has changed
//! is what may be left. Otherwise by the solver itself, Gauss-Seidel in double precision with one iteration and three
//! numbers of substeps: the finest run counts as it is, and what may be left is its distance from the next coarser one.
//! The second kind is no proof: it shows where the solver goes, not that it goes to the right place.
//!
//! Source: Richardson 1911. Cost: seven times the coarsest run.

use serde::Serialize;

use super::motion::{Deviation, Motion};
use super::newton::{Newton, obstacle};
use crate::Error;
use crate::scene::{Backend, Method, Precision, Scene, SolverSpec, Substeps};

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ReferenceKind {
    /// Implicit Euler with Newton's method, extrapolated.
    Newton,
    /// The solver itself at a fine substep.
    Xpbd,
}

/// What a motion should be.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The motion.
    pub motion: Motion,
    /// What may be left of its error.
    pub left: Deviation,
    /// Where it comes from.
    pub kind: ReferenceKind,
    /// Why Newton's method was not taken.
    pub why_not_newton: Option<String>,
    /// The steps, or substeps, of a frame in each of the three runs.
    pub steps: [u32; 3],
    /// How far each of the three runs is from `motion`.
    pub errors: [Deviation; 3],
    /// The order of convergence that the three runs show, by the largest differences of their positions: `log2` of how
    /// much less the two finer runs differ than the two coarser ones. Not finite if they do not differ.
    pub order: f64,
}

impl Reference {
    /// By Newton's method with `steps`, twice and four times as many steps a frame.
    ///
    /// # Errors
    /// Returns [`Error::Advise`] if the scene has something that the reference does not know or a step cannot be
    /// solved, and the errors of [`crate::Simulation::new`].
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

    /// By the solver itself with `substeps`, twice and four times as many substeps a frame, all bodies with the same.
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

/// The motion of a scene by implicit Euler and Newton's method with `steps` steps a frame.
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

/// The scene with other settings for all bodies, reporting nothing but times.
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
