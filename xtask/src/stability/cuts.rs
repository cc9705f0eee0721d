//! Cutting rows of the matrix: scenes with strokes, with all derived data recomputed and compared after each.
//!
//! The body is a beam of E = 1e4 Pa, fixed at one end above a ground, or free without one. A body that has tripled its
//! number of tets is replaced by a new one. Strokes do not snap, so all slivers remain.

use std::sync::Arc;

use anyhow::{Context, ensure};
use incise::gpu::GpuContext;
use incise::mesh::glam::DVec3;
use incise::scene::{BodySpec, GroundSpec, Quantity, Region, ShapeSpec, StrokeSpec};
use incise::{Scene, Simulation, WarningCode};

use super::methods::Column;
use super::outcome::Outcome;
use crate::random::Random;

/// A way to cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// A random stroke in every frame.
    Strokes,
    /// A blade that passes through the body within a frame.
    FastBlade,
    /// A blade that moves by a hundredth of an edge per frame.
    SlowBlade,
    /// A body that falls past a nearly static blade.
    FastBody,
    /// Number of random strokes into a free body at rest without gravity, one per frame, followed by frames without
    /// strokes.
    AtRest(u64),
    /// Number of random strokes into a body that hangs from one end, one per frame, followed by frames without strokes.
    UnderLoad(u64),
    /// Pairs of planes 1/50 edge apart through a body that hangs from one end.
    Slivers,
}

impl Cut {
    pub(crate) const ALL: [Self; 9] = [
        Self::Strokes,
        Self::FastBlade,
        Self::SlowBlade,
        Self::FastBody,
        Self::AtRest(1),
        Self::AtRest(10),
        Self::AtRest(30),
        Self::UnderLoad(30),
        Self::Slivers,
    ];

    pub(crate) fn id(self) -> String {
        match self {
            Self::Strokes => "cut-strokes".to_owned(),
            Self::FastBlade => "cut-fast-blade".to_owned(),
            Self::SlowBlade => "cut-slow-blade".to_owned(),
            Self::FastBody => "cut-fast-body".to_owned(),
            Self::AtRest(strokes) => format!("cut-at-rest-{strokes}"),
            Self::UnderLoad(strokes) => format!("cut-under-load-{strokes}"),
            Self::Slivers => "cut-slivers".to_owned(),
        }
    }

    pub(crate) fn name(self, quick: bool) -> String {
        match self {
            Self::Strokes => format!("{} random strokes without snapping", self.frames(quick)),
            Self::FastBlade => "a blade through the body within a frame".to_owned(),
            Self::SlowBlade => "a blade of 1/100 edge a frame".to_owned(),
            Self::FastBody => "a body that falls past a blade".to_owned(),
            Self::AtRest(1) => "a free body at rest after 1 cut".to_owned(),
            Self::AtRest(strokes) => format!("a free body at rest after {strokes} cuts"),
            Self::UnderLoad(strokes) => format!("a hanging body after {strokes} cuts"),
            Self::Slivers => "slices of 1/50 edge in a hanging body".to_owned(),
        }
    }

    fn frames(self, quick: bool) -> u64 {
        match (self, quick) {
            (Self::Strokes, false) => 1000,
            (Self::Strokes, true) => 25,
            (Self::SlowBlade, false) => 500,
            (Self::FastBlade | Self::FastBody, false) => 120,
            (Self::AtRest(strokes) | Self::UnderLoad(strokes), false) => strokes + 300,
            (Self::AtRest(strokes) | Self::UnderLoad(strokes), true) => strokes + 20,
            (Self::Slivers, false) => 300,
            (_, true) => 30,
        }
    }

    fn scene(self, column: Column, quick: bool) -> Scene {
        let mut scene = Scene::default().with(|spec| spec.solver = column.method.spec(column));
        scene.report.quantities = vec![Quantity::Energy, Quantity::Volume, Quantity::Kappa];
        let gravity = if self == Self::FastBody { 1e2 } else { 9.81 };
        let at_rest = matches!(self, Self::AtRest(_));
        scene.world.gravity = (!at_rest).then_some([0.0, 0.0, -gravity]);
        // Parts cut off by the blade fall on without a ground and are not crushed.
        scene.world.ground =
            (self != Self::FastBody && !at_rest).then_some(GroundSpec::default().with(|spec| {
                spec.height = -1.0;
                spec.friction = 0.5;
            }));
        let held = Region::half_space([-0.45, 0.0, 0.0], [-1.0, 0.0, 0.0]);
        scene.body.push(BodySpec::default().with(|spec| {
            spec.shape = Some(ShapeSpec::new("beam", if quick { 300 } else { 1500 }));
            spec.scale = 1.0;
            spec.young_modulus = 1e4;
            spec.poisson_ratio = 0.45;
            spec.density = 1000.0;
            spec.fixed = if self == Self::FastBody || at_rest {
                Vec::new()
            } else {
                vec![held]
            };
        }));
        let last = self.frames(quick) - 1;
        let blade = |height: f64| vec![[0.02, -1.0, height], [0.03, 1.0, height]];
        let sweep = |frames, blade, way: f64| {
            StrokeSpec::sweep(frames, blade, vec![[0.0; 3], [0.0, 0.0, way]]).with_snap(0.0)
        };
        let edge = if quick { 0.1 } else { 0.06 };
        let plane =
            |frame, x: f64| StrokeSpec::plane(frame, [x, 0.0, 0.0], [1.0, 0.0, 0.3]).with_snap(0.0);
        scene.stroke = match self {
            Self::Strokes | Self::AtRest(_) | Self::UnderLoad(_) => Vec::new(),
            Self::Slivers => [-0.2, 0.05, 0.3]
                .iter()
                .zip([2, 4, 6])
                .flat_map(|(&x, frame)| [plane(frame, x), plane(frame + 1, x + 0.02 * edge)])
                .collect(),
            Self::FastBlade => vec![sweep([2, 3], blade(1.0), -3.0)],
            // Starts inside the body, because the blade is slow.
            Self::SlowBlade => vec![sweep([2, last], blade(-0.1), -6e-4 * last as f64)],
            Self::FastBody => vec![sweep([2, last], blade(-0.4), 1e-3)],
        };
        scene
    }
}

/// Runs the cuts on a body and returns its outcome.
pub(crate) fn run(
    cut: Cut,
    column: Column,
    gpu: Option<&Arc<GpuContext>>,
    quick: bool,
) -> anyhow::Result<Outcome> {
    let scene = cut.scene(column, quick);
    let fresh = || match gpu.filter(|_| column.gpu) {
        Some(gpu) => Simulation::on_device(&scene, gpu.clone()),
        None => Simulation::new(&scene),
    };
    let mut simulation = fresh()?;
    let (at_start, mut noise) = (simulation.mesh().tets.len(), Random(29));
    // A beam of 62.5 kg and 1 m.
    let mut watch = Watch::new(column, 62.5 * 9.81);
    for frame in 0..cut.frames(quick) {
        if cut == Cut::Strokes {
            if simulation.mesh().tets.len() > 3 * at_start {
                simulation = fresh()?;
                watch.start = None;
            }
            let stroke = random_stroke(&simulation, &mut noise);
            simulation.cut(stroke)?;
        }
        if matches!(cut, Cut::AtRest(strokes) | Cut::UnderLoad(strokes) if frame < strokes) {
            let stroke = random_stroke(&simulation, &mut noise);
            simulation.cut(stroke)?;
        }
        let what = || format!("{cut:?}, {column:?}, frame {frame}");
        simulation.step().with_context(what)?;
        if simulation.report().cut.is_some() {
            simulation.check().with_context(what)?;
        }
        if column.gpu {
            simulation.read_back()?;
        }
        if !watch.look(&simulation).with_context(what)? {
            break;
        }
    }
    Ok(watch.outcome)
}

/// Rectangle of half an edge to three edges at the current position of a random particle.
fn random_stroke(simulation: &Simulation, noise: &mut Random) -> StrokeSpec {
    let positions = simulation.positions();
    let share = 0.5 * (noise.signed() + 1.0) * positions.len() as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of the number of particles, rounded down"
    )]
    let center = positions[(share as usize).min(positions.len() - 1)];
    let size = 0.06 * (1.75 + 1.25 * noise.signed());
    let u = noise.vector().normalize_or(DVec3::X);
    let v = noise
        .vector()
        .cross(u)
        .normalize_or(u.any_orthonormal_vector());
    StrokeSpec::rectangle(
        simulation.report().frame + u64::from(simulation.report().time_s > 0.0),
        center.to_array(),
        (u * size).to_array(),
        (v * size).to_array(),
    )
    .with_snap(0.0)
}

/// Monitors a simulation after every frame.
pub(super) struct Watch {
    pub(super) outcome: Outcome,
    /// The unit of energies, in J.
    unit: f64,
    /// Energy at the start of the current body, in J.
    start: Option<f64>,
}

impl Watch {
    pub(super) fn new(column: Column, unit: f64) -> Self {
        Self {
            unit,
            start: None,
            outcome: Outcome::new(column),
        }
    }

    /// Records the state of the body; `false` if it is not finite.
    pub(super) fn look(&mut self, simulation: &Simulation) -> anyhow::Result<bool> {
        let (report, outcome) = (simulation.report(), &mut self.outcome);
        outcome.frames += 1;
        outcome.repaired += report.repaired;
        outcome.tets = report.tets;
        let energy = report.energy.context("no energy was reported")?;
        let sum = energy.kinetic + energy.elastic + energy.gravity;
        let volume = report.volume_error.context("no volume was reported")?;
        let kappa = report.kappa.context("no kappa was reported")?;
        ensure!(
            report.particles == simulation.positions().len(),
            "another number of particles"
        );
        let finite = simulation.positions().iter().all(|x| x.is_finite())
            && [sum, volume, kappa].iter().all(|n| n.is_finite());
        if !finite {
            outcome.not_finite = Some(outcome.frames);
            return Ok(false);
        }
        let start = *self.start.get_or_insert(sum);
        outcome.energy_rise = outcome.energy_rise.max((sum - start) / self.unit);
        outcome.volume = 1.0 + volume;
        outcome.inverted = report.inverted_tets.unwrap_or(0);
        outcome.kappa = outcome.kappa.max(kappa);
        let softened = report.softened.map_or(0, |softened| softened.tets);
        outcome.softened = outcome.softened.max(softened);
        let substeps = report.bodies.iter().map(|body| body.substeps).max();
        outcome.substeps = substeps.unwrap_or(outcome.substeps);
        // Some random strokes miss.
        let mut warnings = report.warnings().iter();
        outcome.warned |= warnings.any(|warning| warning.code != WarningCode::StrokeMissed);
        Ok(true)
    }
}
