//! A stiff organ whose end is pulled, uncut and while a blade sweeps through it: time and error at a requested
//! accuracy.

use std::path::Path;

use incise::advise::Motion;
use incise::mesh_io;
use incise::meshing::{Shape, generate};
use incise::scene::{Method, Precision, SolverSpec, Substeps};
use incise::{Scene, Simulation};
use serde::{Deserialize, Serialize};

use super::{Warned, warnings};
use crate::experiment::median;

/// Longest side in m.
const SIZE: f64 = 0.2;
/// Part of the length at each end that is held or pulled.
const HELD: f64 = 0.1;
/// Length of the pull in m.
const PULLED_BY: f64 = 0.03;
/// Frames of the pull.
const PULL: usize = 30;
/// Frames in all.
const FRAMES: u32 = 60;
/// Strokes of the cut form, four frames each.
pub(super) const STROKES: usize = 6;
/// Substeps of the reference; half as many estimate its own error.
const REFERENCE_SUBSTEPS: u32 = 8;
/// Accuracy whose times have a limit.
const TIMED_ACCURACY: f64 = 0.05;
/// Limits in ms for a frame of the pull without strokes, and for the slowest frame that cuts.
const BARS_MS: [f64; 2] = [8.0, 16.0];
/// Identical runs; the time of a frame is that of the fastest.
const RUNS: usize = 3;
/// Rounds per substep of the reference; from the third on each squares the error.
const REFERENCE_ROUNDS: u32 = 6;

/// An organ with an accuracy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct OrganRow {
    pub(super) accuracy: f64,
    pub(super) strokes: usize,
    /// Number of tets at the start and at the end.
    pub(super) tets: [usize; 2],
    /// Method, by its name in reports.
    pub(super) method: String,
    pub(super) substeps: u32,
    pub(super) precision: String,
    /// Median of the frames of the pull except the first two, the slowest frame that cuts, and the median of the last
    /// 20, in ms.
    pub(super) pulled_ms: f64,
    pub(super) slowest_cut_ms: Option<f64>,
    pub(super) last_ms: f64,
    /// Error of the motion over all frames, and that of the reference; with strokes of the particles before the cuts.
    pub(super) error: [f64; 2],
    pub(super) warned: Warned,
}

impl OrganRow {
    /// Descriptions of the values beyond their limits.
    pub(super) fn misses(&self) -> Vec<String> {
        let [uncut, cut] = BARS_MS;
        let is_timed = self.accuracy == TIMED_ACCURACY;
        let time = match self.slowest_cut_ms {
            Some(ms) => Some(("slowest frame that cuts", ms, cut)),
            None if self.strokes == 0 => Some(("frame of the pull", self.pulled_ms, uncut)),
            None => None,
        };
        let slow = time.filter(|(_, ms, bar)| is_timed && ms > bar);
        let slow = slow.map(|(what, ms, bar)| format!("{what} {ms:.1} ms, bar {bar} ms"));
        let [error, _] = self.error;
        let wrong = (error > self.accuracy).then(|| format!("error {:.1}%", 100.0 * error));
        slow.into_iter().chain(wrong).collect()
    }
}

/// Organ scene with or without the strokes of the cut form.
fn scene(tets: usize, strokes: usize, accuracy: f64, folder: &Path) -> anyhow::Result<Scene> {
    let mesh = generate(Shape::Liver, tets)?;
    let (low, high) = super::cut::ends(mesh.positions.iter().copied());
    let scale = SIZE / (high - low).max_element();
    let file = folder.join(format!("organ-{tets}.vtk"));
    mesh_io::write(&file, &mesh)?;
    let at = |part: f64| scale * (low.x + part * (high.x - low.x));
    let (held, pulled) = (at(HELD), at(1.0 - HELD));
    let mut text = format!(
        "[world]
gravity = [0.0, 0.0, -9.81]
[solver]
time_step = 0.01
accuracy = {accuracy}
[[body]]
mesh = {file:?}
scale = {scale}
young_modulus = 1e7
poisson_ratio = 0.49
fixed = [{{ half_space = {{ point = [{held}, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]
[[attachment]]
regions = [{{ half_space = {{ point = [{pulled}, 0.0, 0.0], normal = [1.0, 0.0, 0.0] }} }}]
frames = [0, {PULL}]
path = [[0.0, 0.0, 0.0], [{PULLED_BY}, 0.0, 0.0]]
"
    );
    let top = scale * high.z;
    for stroke in 0..strokes {
        // Where the pull has moved the particles that are at this part of the length at rest.
        let part = 0.25 + 0.5 * stroke as f64 / (STROKES - 1) as f64;
        let x = at(part) + PULLED_BY * (part - HELD) / (1.0 - 2.0 * HELD);
        // The organ narrows to one side: a blade up to the middle of the whole would pass beside it there.
        let near = mesh.positions.iter().map(|&at_rest| scale * at_rest);
        let near = near.filter(|p| (p.x - at(part)).abs() < 0.05 * SIZE);
        let (near_low, near_high) = super::cut::ends(near);
        let middle = 0.5 * (near_low + near_high);
        let first = PULL + 1 + 4 * stroke;
        text += &format!(
            "[[stroke]]
kind = \"sweep\"
frames = [{first}, {}]
blade = [[{x}, {}, {}], [{x}, {}, {}]]
path = [[0.0, 0.0, 0.0], [0.0, 0.0, {}]]
",
            first + 4,
            scale * low.y - 0.1,
            top + 0.01,
            middle.y,
            top + 0.01,
            -0.75 * (top - scale * low.z),
        );
    }
    Ok(Scene::from_toml(&text)?)
}

/// Runs the organ with an accuracy, and its reference.
pub(super) fn measure(
    tets: usize,
    strokes: usize,
    accuracy: f64,
    folder: &Path,
) -> anyhow::Result<OrganRow> {
    let scene = scene(tets, strokes, accuracy, folder)?;
    let mut warned = Warned::new();
    let mut ms = vec![f64::INFINITY; FRAMES as usize];
    let mut cuts = vec![false; FRAMES as usize];
    let mut simulation = Simulation::new(&scene)?;
    let at_start = simulation.mesh().tets.len();
    for run in 0..RUNS {
        if run > 0 {
            simulation = Simulation::new(&scene)?;
        }
        for (ms, cuts) in ms.iter_mut().zip(&mut cuts) {
            let report = simulation.step()?;
            *ms = ms.min(report.ms.total);
            *cuts = report.cut.is_some();
            warnings(report, &mut warned);
        }
    }
    let of_cuts = ms.iter().zip(&cuts).filter(|(_, cuts)| **cuts);
    let cut_ms = of_cuts.map(|(ms, _)| *ms).reduce(f64::max);
    let report = simulation.report();
    let body = report.bodies.first();
    let reference = |substeps| {
        let mut scene = scene.clone();
        scene.solver = SolverSpec::of(Method::Vbd).with(|spec| {
            spec.time_step = scene.solver.time_step;
            spec.substeps = Substeps::Fixed(substeps);
            spec.iterations = REFERENCE_ROUNDS;
            spec.two_level = true;
            spec.precision = Precision::F64;
        });
        Motion::of(&scene, FRAMES, None)
    };
    let best = reference(REFERENCE_SUBSTEPS)?;
    let own = reference(REFERENCE_SUBSTEPS / 2)?.deviation(&best);
    let motion = Motion::of(&scene, FRAMES, None)?;
    let error = [motion.deviation(&best).motion, own.motion].map(|percent| percent / 100.0);
    Ok(OrganRow {
        accuracy,
        strokes,
        tets: [at_start, report.tets],
        method: serde_json::to_value(body.and_then(|body| body.method))?
            .as_str()
            .unwrap_or("-")
            .to_owned(),
        substeps: body.map_or(0, |body| body.substeps),
        precision: report.precision.to_owned(),
        pulled_ms: median(ms[2..PULL].iter().copied()),
        slowest_cut_ms: cut_ms,
        last_ms: median(ms[ms.len() - 20..].iter().copied()),
        error,
        warned,
    })
}
