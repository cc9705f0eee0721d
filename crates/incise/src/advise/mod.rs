//! Search for the best solver settings of a scene, measured on this machine against a reference.
//!
//! [`advise`] runs [`candidates`] for some frames, takes the time of each and its [`Deviation`] from a [`Reference`],
//! and recommends the most accurate settings within a time budget. The parts are public for sweeps over settings.
//!
//! Errors are those of positions, relative to the motion and to the size of the body, and of the volume; settings are
//! compared by the first. Settings with errors below that of the reference cannot be distinguished; the fastest of them
//! is taken.
//!
//! Cost: seven times the coarsest run of the reference, and each candidate three times (two frames only, if far beyond
//! the budget).

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

/// Largest default number of measured frames.
const MOST_FRAMES: u32 = 100;
const SECONDS: f64 = 0.5;

/// Tets times frames up to which Newton's method is the reference; takes some ten seconds.
const NEWTON_WORK: usize = 60_000;
/// Steps of a frame in the coarsest run of Newton's method.
const NEWTON_STEPS: u32 = 4;
/// Candidates this much beyond the budget are not measured.
const FAR: f64 = 8.0;
/// Runs of each candidate, of which each frame's fastest counts.
const ROUNDS: u32 = 2;

/// Conditions of a search for settings by [`advise`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct AdviseSettings {
    /// Time budget of a frame in ms, positive.
    pub budget_ms: f64,
    /// Number of measured frames from the scene's start, at least 1.
    pub frames: u32,
    /// Number of threads; `None` uses rayon's pool.
    pub threads: Option<usize>,
}

impl AdviseSettings {
    /// A time budget of a frame in ms and a number of measured frames, on rayon's pool.
    #[must_use]
    pub fn new(budget_ms: f64, frames: u32) -> Self {
        Self {
            budget_ms,
            frames,
            threads: None,
        }
    }
}

/// Settings of the solver with their measured time and error.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Measured {
    /// Short name of the settings.
    pub name: String,
    /// The settings as a `[solver]` table.
    pub solver: String,
    /// Mean time of a frame in ms, of each frame's fastest.
    pub ms: f64,
    /// Time of the slowest frame in ms.
    pub slowest_ms: f64,
    /// Error against the reference.
    pub error: Deviation,
    /// Whether these are the settings of the scene.
    pub is_scene_setting: bool,
    /// Whether no other settings are both as fast and as accurate.
    pub non_dominated: bool,
}

/// The reference of an [`Advice`].
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct ReferenceSummary {
    /// Method that computed the reference.
    pub kind: ReferenceKind,
    /// Reason for not using Newton's method.
    pub why_not_newton: Option<String>,
    /// Steps of a frame in the three runs of the reference.
    pub steps: [u32; 3],
    /// Order of convergence of the three runs; absent if they do not differ.
    pub order: Option<f64>,
    /// Estimate of the reference's own error.
    pub left: Deviation,
}

/// Result of [`advise`]: measured settings and the recommended ones.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Advice {
    /// Time budget of a frame in ms, from [`AdviseSettings::budget_ms`].
    pub budget_ms: f64,
    /// Number of measured frames, from [`AdviseSettings::frames`].
    pub frames: u32,
    /// Tets of the scene before all cuts.
    pub tets: usize,
    /// Substeps of a frame that bring kappa to 0.5.
    pub accurate_substeps: u32,
    /// The reference that errors are measured against.
    pub reference: ReferenceSummary,
    /// Measured settings by rising time.
    pub measured: Vec<Measured>,
    /// Names of settings that are far too slow for the budget or not possible for the scene.
    pub left_out: Vec<String>,
    /// Index in `measured` of the most accurate settings within the budget; absent if there are none.
    pub best: Option<usize>,
    /// Index in `measured` of the fastest settings that are more accurate than `best`, or without `best` the fastest of
    /// all.
    pub next: Option<usize>,
}

/// Returns settings with their default accuracy filled in, for comparison with settings that state it.
fn with_default_accuracy(spec: &SolverSpec) -> SolverSpec {
    let is_default = spec.method == Method::Auto && spec.budget_ms.is_none();
    SolverSpec {
        accuracy: spec
            .accuracy
            .or(is_default.then_some(crate::accuracy::DEFAULT_ACCURACY)),
        ..spec.clone()
    }
}

/// Returns the number of frames that covers a scene's strokes and attachments and half a second, at most 100.
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

/// Measures time and error of solver settings for a scene on this machine, and recommends settings for a time budget.
///
/// ```
/// use incise::Scene;
/// use incise::advise::{AdviseSettings, advise};
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
/// let question = AdviseSettings::new(1e3, 2);
/// let advice = advise(&scene, &question)?;
/// let best = &advice.measured[advice.best.expect("a second is enough")];
/// println!("{}: {:.2} ms, {:.3} % off\n{}", best.name, best.ms, best.error.largest, best.solver);
/// # assert!(best.ms <= 1e3 && best.error.largest < 1.0);
/// # Ok::<(), incise::Error>(())
/// ```
///
/// # Errors
/// [`Error::Value`] if a value of the question lies outside its range; the errors of [`Simulation::new`] for the scene.
pub fn advise(scene: &Scene, question: &AdviseSettings) -> Result<Advice, Error> {
    advise_with(scene, question, &mut |_| {})
}

/// Does what [`advise`] does, and calls `progress` with a description before each of its steps: all may take minutes.
///
/// # Errors
/// Those of [`advise`].
pub fn advise_with(
    scene: &Scene,
    question: &AdviseSettings,
    progress: &mut dyn FnMut(&str),
) -> Result<Advice, Error> {
    let AdviseSettings {
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
    progress("computing the reference");
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
        progress(&format!(
            "trying setting {} of {}: {}",
            i + 1,
            specs.len(),
            name(spec)
        ));
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
    for round in 1..=ROUNDS {
        for (k, ((i, run), motion)) in (1..).zip(kept.iter().zip(&mut motions)) {
            progress(&format!(
                "measuring setting {k} of {}, round {round} of {ROUNDS}: {}",
                kept.len(),
                name(&specs[*i])
            ));
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
            is_scene_setting: *i == 0,
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
        reference: ReferenceSummary {
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

/// Computes the reference by Newton's method if it supports the scene in reasonable time, otherwise by the solver
/// itself.
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

/// Returns the most accurate point of a front within a budget, and the next more accurate one; without the first, the
/// fastest of all. A front rises in time and falls in error.
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
