//! Which settings a scene is best run with: measured on this machine, against a reference of the same scene.
//!
//! Users trade speed for accuracy. [`advise`] measures that trade for one scene: it runs [`candidates`] for some frames,
//! takes the time of each and its [`Deviation`] from a [`Reference`], and picks the most accurate that meets a budget.
//! The parts are public, since sweeps over settings need the same ones.
//!
//! Errors are of positions, as a part of the motion and of the body's size, and of the volume; settings are compared by the
//! first. Settings whose errors are below what is left of the reference's own cannot be told apart; of those the fastest is
//! taken.
//!
//! Cost: seven runs of the reference's coarsest, and each candidate three times, those far beyond the budget for two
//! frames only.

mod candidates;
mod motion;
mod newton;
mod pareto;
mod reference;

pub use candidates::{accurate_substeps, candidates, name, solver_table};
pub use motion::{Deviation, Motion};
pub use pareto::non_dominated;
pub use reference::{Reference, ReferenceKind, newton_motion, with};

use serde::Serialize;

use crate::scene::{Method, Scene, SolverSpec};
use crate::{Error, Simulation};

/// Frames that are measured unless told otherwise: at most so many, and at least these seconds.
const MOST_FRAMES: u32 = 100;
const SECONDS: f64 = 0.5;

/// Tets times frames up to which Newton's method is asked, some ten seconds.
const NEWTON_WORK: usize = 60_000;
/// Steps of a frame of its coarsest run.
const NEWTON_STEPS: u32 = 4;
/// Candidates this much beyond the budget are not measured.
const FAR: f64 = 8.0;
/// Runs of each candidate, of which each frame's fastest counts.
const ROUNDS: u32 = 2;

/// What [`advise`] is asked.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// Time of a frame in ms that may be spent, positive.
    pub budget_ms: f64,
    /// Frames that are measured, from the scene's start, at least 1.
    pub frames: u32,
    /// Threads, or rayon's pool.
    pub threads: Option<usize>,
}

/// A setting and what it was measured to be worth.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// The setting in a few words.
    pub name: String,
    /// Its `[solver]` table.
    pub solver: String,
    /// Mean time of a frame in ms, of each frame's fastest.
    pub ms: f64,
    /// That of the slowest frame.
    pub slowest_ms: f64,
    /// How far it is from the reference.
    pub error: Deviation,
    /// Whether it is what the scene has.
    pub of_the_scene: bool,
    /// Whether no other one is as fast and as accurate.
    pub non_dominated: bool,
}

/// What is measured against.
#[derive(Clone, Debug, Serialize)]
pub struct Against {
    /// Where it comes from.
    pub kind: ReferenceKind,
    /// Why not from Newton's method.
    pub why_not_newton: Option<String>,
    /// Steps of a frame in its three runs.
    pub steps: [u32; 3],
    /// The order of convergence they show; absent where they do not differ.
    pub order: Option<f64>,
    /// What may be left of its error.
    pub left: Deviation,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// Time budget of a frame in ms, from [`Question::budget_ms`].
    pub budget_ms: f64,
    /// Number of measured frames, from [`Question::frames`].
    pub frames: u32,
    /// Tets of the scene before all cuts.
    pub tets: usize,
    /// Substeps of a frame that bring kappa to 0.5.
    pub accurate_substeps: u32,
    /// What errors are measured against.
    pub reference: Against,
    /// All that was measured, by rising time.
    pub measured: Vec<Measured>,
    /// Settings that are far too slow for the budget or that the scene cannot be run with, by name.
    pub left_out: Vec<String>,
    /// The most accurate that meets the budget, by its number in `measured`; absent if none does.
    pub best: Option<usize>,
    /// The fastest that is more accurate than the best, or, without one, the fastest of all.
    pub next: Option<usize>,
}

/// Settings with the accuracy that they have by default, for comparison with those that name it.
fn with_default_accuracy(spec: &SolverSpec) -> SolverSpec {
    let is_default = spec.method == Method::Auto && spec.budget_ms.is_none();
    SolverSpec {
        accuracy: spec
            .accuracy
            .or(is_default.then_some(crate::accuracy::DEFAULT_ACCURACY)),
        ..spec.clone()
    }
}

/// Frames enough for a scene's strokes and handles and for half a second, at most 100.
#[must_use]
pub fn default_frames(scene: &Scene) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped"
    )]
    let frames = (SECONDS / scene.solver.time_step)
        .ceil()
        .clamp(1.0, f64::from(MOST_FRAMES)) as u32;
    let needed = u32::try_from(scene.frames_needed()).unwrap_or(u32::MAX);
    frames.max(needed).min(MOST_FRAMES)
}

/// Measures what settings of a scene's solver cost and are worth on this machine, and picks.
///
/// ```
/// use incise::Scene;
/// use incise::advise::{Question, advise};
///
/// let scene = Scene::from_toml(
///     r#"
///     [world]
///     gravity = [0.0, 0.0, -9.81]
///     [[body]]
///     shape = { kind = "beam", tets = 250 }
///     fixed = [{ half_space = { point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
///     "#,
/// )?;
/// let question = Question { budget_ms: 1e3, frames: 2, threads: Some(1) };
/// let advice = advise(&scene, &question)?;
/// let best = &advice.measured[advice.best.expect("a second is enough")];
/// println!("{}: {:.2} ms, {:.3} % off\n{}", best.name, best.ms, best.error.largest, best.solver);
/// # assert!(best.ms <= 1e3 && best.error.largest < 1.0);
/// # Ok::<(), incise::Error>(())
/// ```
///
/// # Errors
/// [`Error::Value`] for a question out of its range, and as [`Simulation::new`] for the scene.
pub fn advise(scene: &Scene, question: &Question) -> Result<Advice, Error> {
    let Question {
        budget_ms,
        frames,
        threads,
    } = *question;
    if !(budget_ms > 0.0 && budget_ms.is_finite()) {
        return Err(crate::validate::value(
            "budget-ms",
            budget_ms,
            "positive and finite",
        ));
    }
    if frames == 0 {
        return Err(crate::validate::value("frames", frames, "at least 1"));
    }
    let tets = Simulation::new(scene)?.mesh().tets.len();
    let substeps = accurate_substeps(scene)?;
    let reference = reference_of(scene, tets, frames, substeps)?;
    let mut specs = vec![scene.solver.clone()];
    specs.extend(
        candidates(scene, substeps)
            .into_iter()
            .filter(|spec| *spec != with_default_accuracy(&scene.solver)),
    );
    let (mut kept, mut left_out) = (Vec::new(), Vec::new());
    for (i, spec) in specs.iter().enumerate() {
        // What the scene has is run as it is: its bodies may have substeps of their own.
        let run = if i == 0 {
            scene.clone()
        } else {
            with(scene, spec)
        };
        let run = Scene {
            report: crate::scene::ReportSpec::default(),
            ..run
        };
        match Motion::of(&run, frames.min(2), threads) {
            Ok(probe) if i == 0 || probe.fastest_ms() <= FAR * budget_ms => kept.push((i, run)),
            Ok(probe) => left_out.push(format!(
                "{} (too slow: {:.3} ms at its fastest)",
                name(spec),
                probe.fastest_ms()
            )),
            Err(error) if i == 0 => return Err(error),
            Err(error) => left_out.push(format!("{} ({error})", name(spec))),
        }
    }
    let mut motions: Vec<Option<Motion>> = vec![None; kept.len()];
    for _ in 0..ROUNDS {
        for ((_, run), motion) in kept.iter().zip(&mut motions) {
            let again = Motion::of(run, frames, threads)?;
            match motion {
                Some(motion) => motion.keep_fastest(&again),
                None => *motion = Some(again),
            }
        }
    }
    let mut measured = Vec::new();
    for ((i, _), motion) in kept.iter().zip(motions.iter().flatten()) {
        measured.push(Measured {
            name: name(&specs[*i]),
            solver: solver_table(&specs[*i])?,
            ms: motion.ms_per_frame(),
            slowest_ms: motion.slowest_ms(),
            error: motion.deviation(&reference.motion),
            of_the_scene: *i == 0,
            non_dominated: false,
        });
    }
    measured.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let floor = reference.left.motion;
    let points: Vec<[f64; 2]> = measured
        .iter()
        .map(|m| [m.ms, m.error.motion.max(floor)])
        .collect();
    let front = non_dominated(&points);
    for &i in &front {
        measured[i].non_dominated = true;
    }
    let (best, next) = pick(&points, &front, budget_ms);
    Ok(Advice {
        budget_ms,
        frames,
        tets,
        accurate_substeps: substeps,
        reference: Against {
            kind: reference.kind,
            why_not_newton: reference.why_not_newton,
            steps: reference.steps,
            order: reference.order.is_finite().then_some(reference.order),
            left: reference.left,
        },
        measured,
        left_out,
        best,
        next,
    })
}

/// By Newton's method if that can do the scene in reasonable time, else by the solver itself.
fn reference_of(
    scene: &Scene,
    tets: usize,
    frames: u32,
    substeps: u32,
) -> Result<Reference, Error> {
    let why = if tets.saturating_mul(frames as usize) > NEWTON_WORK {
        let most = NEWTON_WORK / frames as usize;
        format!("it takes too long above {most} tets for {frames} frames")
    } else {
        match Reference::newton(scene, frames, NEWTON_STEPS) {
            Err(Error::Advise(why)) => why,
            done => return done,
        }
    };
    let mut reference = Reference::xpbd(scene, frames, substeps.saturating_mul(4))?;
    reference.why_not_newton = Some(why);
    Ok(reference)
}

/// The most accurate of a front that meets a budget, and the next that is more accurate: without the first, the fastest
/// of all. A front rises in time and falls in error.
fn pick(points: &[[f64; 2]], front: &[usize], budget: f64) -> (Option<usize>, Option<usize>) {
    let meets = front.partition_point(|&i| points[i][0] <= budget);
    (
        meets.checked_sub(1).map(|last| front[last]),
        front.get(meets).copied(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_within_the_budget_is_picked() {
        let points = [[1.0, 9.0], [2.0, 4.0], [3.0, 5.0], [4.0, 1.0]];
        let front = non_dominated(&points);
        assert_eq!(pick(&points, &front, 0.5), (None, Some(0)));
        assert_eq!(pick(&points, &front, 1.0), (Some(0), Some(1)));
        assert_eq!(pick(&points, &front, 3.5), (Some(1), Some(3)));
        assert_eq!(pick(&points, &front, 9.0), (Some(3), None));
        assert_eq!(pick(&[], &[], 1.0), (None, None));
    }
}
