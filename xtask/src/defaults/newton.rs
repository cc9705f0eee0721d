//! Scenes with default settings beside Newton's method: hanging, pressed and freely spinning bodies.
//!
//! The settled state is compared with a static equilibrium by `incise-reference`, the motion with implicit Euler at
//! three step sizes, extrapolated twice. Both references have the mesh and the energy of the scene. Default scenes have
//! no damping, so the settled state is the mean over six periods, weighted by a Hann window.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetMesh};
use incise::meshing::{Shape, generate};
use incise::report::ChosenMethod;
use incise::scene::{AttachmentSpec, BodySpec, Region, ShapeSpec};
use incise::{Scene, Simulation};
use incise_reference::ReferenceBody;
use serde::{Deserialize, Serialize};

use super::{Warned, warnings};

/// Positions of all particles, state after state.
type States = Vec<Vec<DVec3>>;

/// Longest side of a body in m, and its density in kg/m³.
const SIZE: f64 = 0.2;
const DENSITY: f64 = 1000.0;
/// The press of a handle, as a fraction of the side it moves along.
const PRESS: f64 = 0.1;
/// Implicit steps of a period at the coarsest of three step sizes.
const STEPS: f64 = 24.0;

/// Load on a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Load {
    /// Fixed at one end, gravity from the first frame.
    Hanging,
    /// Fixed at one side; a handle moves the opposite side.
    Pressed,
    /// Free, rigid rotation at the start, no gravity.
    Spinning,
}

impl Load {
    pub(super) const ALL: [Self; 3] = [Self::Hanging, Self::Pressed, Self::Spinning];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Hanging => "hanging",
            Self::Pressed => "pressed",
            Self::Spinning => "spinning",
        }
    }
}

/// A scene of the comparison.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) shape: Shape,
    pub(super) tets: usize,
    pub(super) load: Load,
    pub(super) young_modulus: f64,
    pub(super) poisson_ratio: f64,
}

/// Errors of a scene, as fractions of the displacement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct NewtonRow {
    pub(super) shape: String,
    pub(super) load: Load,
    pub(super) young_modulus: f64,
    pub(super) poisson_ratio: f64,
    pub(super) tets: usize,
    /// Method that `auto` chose.
    pub(super) method: String,
    pub(super) substeps: u32,
    pub(super) precision: String,
    /// Frames of 0.016 s over which the motion is compared.
    pub(super) frames: u64,
    /// Period of the slowest vibration or of a revolution in s.
    pub(super) period: f64,
    /// Absent for a spinning body, which does not settle.
    pub(super) settled: Option<f64>,
    pub(super) motion: f64,
    /// The difference between the last two extrapolations of the reference motion.
    pub(super) reference: f64,
    pub(super) warned: Warned,
}

/// A scene with the data that the reference needs.
struct Setup {
    scene: Scene,
    mesh: TetMesh,
    fixed: Vec<bool>,
    held: Vec<bool>,
    gravity: DVec3,
    /// Displacement of the handle at the end.
    press: DVec3,
    /// Rate of rotation in rad/s at the start.
    spin: DVec3,
    center: DVec3,
}

/// Duration of a scene, in strides of some frames; states are compared after each stride.
struct Span {
    stride: u64,
    /// Implicit steps per stride at the coarsest step size.
    steps: u32,
    /// Strides of the handle's motion, of the compared motion and in total.
    ramp: u64,
    motion: u64,
    all: u64,
}

pub(super) fn measure(case: Case, folder: &Path) -> anyhow::Result<NewtonRow> {
    let mut setup = Setup::new(case)?;
    let step = setup.scene.solver.time_step;
    let period = setup.period(case)?;
    let span = Span::new(case.load, period, step);
    setup.add_press(&span);
    let name = format!(
        "{}-{}-{:.0e}-{}.toml",
        case.shape,
        case.load.name(),
        case.young_modulus,
        case.poisson_ratio
    );
    fs::write(folder.join(name), setup.scene.to_toml()?)?;
    let reference = setup.reference_motion(case, &span, step);
    let (reference, uncertain) = reference.with_context(|| format!("{case:?}"))?;
    let run = setup.run(case, &span)?;
    let equilibrium = match case.load {
        Load::Spinning => None,
        Load::Hanging | Load::Pressed => Some(setup.equilibrium(case)?),
    };
    // Frames may coincide with the start of a vibration's period, so the settled state counts as motion too.
    let sag = equilibrium.as_deref().map_or(0.0, |x| setup.moved(x));
    let [motion, uncertainty] =
        [&run.motion, &uncertain].map(|states| setup.error(states, &reference, sag));
    let settled = equilibrium.map(|x| setup.error(&[run.mean], &[x], 0.0));
    Ok(NewtonRow {
        shape: case.shape.to_string(),
        load: case.load,
        young_modulus: case.young_modulus,
        poisson_ratio: case.poisson_ratio,
        tets: setup.mesh.tets.len(),
        method: run.method,
        substeps: run.substeps,
        precision: run.precision,
        frames: span.stride * span.motion,
        period,
        settled,
        motion,
        reference: uncertainty,
        warned: run.warned,
    })
}

/// Results of a run of a scene.
struct Run {
    /// Positions after each stride of the compared motion.
    motion: States,
    /// Mean positions of the settled state.
    mean: Vec<DVec3>,
    method: String,
    substeps: u32,
    precision: String,
    warned: Warned,
}

impl Setup {
    fn new(case: Case) -> anyhow::Result<Self> {
        let mut mesh = generate(case.shape, case.tets)?;
        for x in &mut mesh.positions {
            *x *= SIZE;
        }
        let ends = (DVec3::MAX, DVec3::MIN);
        let (low, high) = mesh
            .positions
            .iter()
            .fold(ends, |(low, high), &x| (low.min(x), high.max(x)));
        let extent = high - low;
        // The beam is bent by its free end; the others are compressed.
        let axis = if case.load == Load::Pressed && case.shape != Shape::Beam {
            DVec3::Z
        } else {
            DVec3::X
        };
        let depth = 0.15 * extent.dot(axis);
        let fixed_side = low * axis + depth * axis;
        let held_side = high * axis - depth * axis;
        let half_space =
            |point: DVec3, normal: DVec3| Region::half_space(point.to_array(), normal.to_array());
        let below = |x: DVec3| x.dot(axis) <= fixed_side.dot(axis);
        let above = |x: DVec3| x.dot(axis) >= held_side.dot(axis);
        let is_held = case.load == Load::Pressed;
        let is_fixed = case.load != Load::Spinning;
        let mut scene = Scene::default();
        let gravity = match case.load {
            Load::Hanging => DVec3::NEG_Z * 9.81 * (case.young_modulus / 5e5).min(1.0),
            _ => DVec3::ZERO,
        };
        if case.load == Load::Hanging {
            scene.world.gravity = Some(gravity.to_array());
        }
        scene.body.push(BodySpec::default().with(|spec| {
            spec.shape = Some(ShapeSpec::new(case.shape.to_string(), case.tets));
            spec.scale = SIZE;
            spec.young_modulus = case.young_modulus;
            spec.poisson_ratio = case.poisson_ratio;
            spec.density = DENSITY;
            spec.fixed = if is_fixed {
                vec![half_space(fixed_side, -axis)]
            } else {
                Vec::new()
            };
        }));
        let press = match (case.load, case.shape) {
            (Load::Pressed, Shape::Beam) => DVec3::NEG_Z * PRESS * extent.x,
            (Load::Pressed, _) => DVec3::NEG_Z * PRESS * extent.z,
            _ => DVec3::ZERO,
        };
        if is_held {
            let held = AttachmentSpec::new(0, vec![half_space(held_side, axis)]);
            scene.attachment.push(held);
        }
        let rate = (0.24 * case.young_modulus / DENSITY).sqrt() / SIZE;
        let positions = mesh.positions.iter();
        let fixed = positions.clone().map(|&x| is_fixed && below(x)).collect();
        let held = positions.map(|&x| is_held && above(x)).collect();
        let mut setup = Self {
            scene,
            mesh,
            fixed,
            held,
            gravity,
            press,
            spin: if is_fixed {
                DVec3::ZERO
            } else {
                DVec3::Z * rate.min(10.0)
            },
            center: DVec3::ZERO,
        };
        let body = setup.body(case)?;
        let mass: f64 = body.masses().iter().sum();
        let moments = body.masses().iter().zip(&setup.mesh.positions);
        setup.center = moments.map(|(m, x)| *x * *m).sum::<DVec3>() / mass;
        ensure!(
            !is_fixed || setup.fixed.contains(&true),
            "{case:?} holds nothing"
        );
        Ok(setup)
    }

    /// Body of the reference, with handled particles fixed.
    fn body(&self, case: Case) -> anyhow::Result<ReferenceBody> {
        let material = incise_reference::Material {
            young_modulus: case.young_modulus,
            poisson_ratio: case.poisson_ratio,
            density: DENSITY,
        };
        let tets = self.mesh.tets.iter();
        let tets: Vec<[u32; 4]> = tets.map(|t| t.map(|ParticleId(p)| p)).collect();
        let mut body = ReferenceBody::new(&self.mesh.positions, &tets, |_tet| material)?;
        for (p, fixed) in body.fixed.iter_mut().enumerate() {
            *fixed = self.fixed[p] || self.held[p];
        }
        for (v, x) in body.velocities.iter_mut().zip(&self.mesh.positions) {
            *v = self.spin.cross(*x - self.center);
        }
        Ok(body)
    }

    /// Period of a revolution, or Rayleigh's estimate for the slowest vibration from a small sag.
    fn period(&self, case: Case) -> anyhow::Result<f64> {
        if case.load == Load::Spinning {
            return Ok(TAU / self.spin.length());
        }
        let gravity = DVec3::NEG_Z * 1e-2 * case.young_modulus / 1e6;
        let mut body = self.body(case)?;
        body.settle(gravity)?;
        let moved = body.positions.iter().zip(&self.mesh.positions);
        let sums = moved.zip(body.masses()).map(|((x, at_rest), mass)| {
            let u = *x - *at_rest;
            (mass * gravity.dot(u), mass * u.length_squared())
        });
        let (work, square) = sums.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        Ok(TAU / (work / square).sqrt())
    }

    /// Sets the handle's path, a smooth ramp with a point after each stride.
    fn add_press(&mut self, span: &Span) {
        let press = self.press;
        for handle in &mut self.scene.attachment {
            handle.frames = [0, span.ramp * span.stride];
            let offsets = (0..=span.ramp).map(|i| (press * span.part(i)).to_array());
            handle.path = offsets.collect();
        }
    }

    /// Twice extrapolated motion, and the finer of the two once extrapolated ones.
    fn reference_motion(
        &self,
        case: Case,
        span: &Span,
        frame: f64,
    ) -> anyhow::Result<(States, States)> {
        let motion = |steps| self.implicit_motion(case, span, frame, steps);
        let levels = [
            motion(span.steps)?,
            motion(2 * span.steps)?,
            motion(4 * span.steps)?,
        ];
        let combined = |a: &[Vec<DVec3>], wa: f64, b: &[Vec<DVec3>], wb: f64| {
            let frames = a.iter().zip(b);
            frames
                .map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a * wa + *b * wb).collect())
                .collect::<States>()
        };
        let coarse = combined(&levels[1], 2.0, &levels[0], -1.0);
        let fine = combined(&levels[2], 2.0, &levels[1], -1.0);
        let twice = combined(&fine, 4.0 / 3.0, &coarse, -1.0 / 3.0);
        Ok((twice, fine))
    }

    fn implicit_motion(
        &self,
        case: Case,
        span: &Span,
        frame: f64,
        steps: u32,
    ) -> anyhow::Result<States> {
        let mut body = self.body(case)?;
        let mut motion = Vec::new();
        let time_step = frame * span.stride as f64 / f64::from(steps);
        for stride in 0..span.motion {
            let [from, to] = [stride, stride + 1].map(|i| span.part(i));
            for step in 1..=steps {
                let part = from + (to - from) * f64::from(step) / f64::from(steps);
                self.press_to(&mut body, part);
                body.step(time_step, self.gravity)?;
            }
            motion.push(body.positions.clone());
        }
        Ok(motion)
    }

    fn press_to(&self, body: &mut ReferenceBody, part: f64) {
        for p in (0..self.held.len()).filter(|&p| self.held[p]) {
            body.positions[p] = self.mesh.positions[p] + self.press * part;
        }
    }

    fn equilibrium(&self, case: Case) -> anyhow::Result<Vec<DVec3>> {
        let mut body = self.body(case)?;
        for part in 1..=5 {
            let part = f64::from(part) / 5.0;
            self.press_to(&mut body, part);
            body.settle(self.gravity * part)?;
        }
        Ok(body.positions)
    }

    fn run(&self, case: Case, span: &Span) -> anyhow::Result<Run> {
        let mut simulation = Simulation::with_threads(&self.scene, 1)?;
        // The mesh rounded to single precision.
        let same = simulation.positions().iter().zip(&self.mesh.positions);
        ensure!(
            simulation.positions().len() == self.mesh.positions.len()
                && same.clone().all(|(a, b)| a.distance(*b) < 1e-7),
            "the scene has another mesh"
        );
        let mut run = Run {
            motion: Vec::new(),
            mean: vec![DVec3::ZERO; self.mesh.positions.len()],
            substeps: 0,
            method: String::new(),
            precision: String::new(),
            warned: Warned::new(),
        };
        if case.load == Load::Spinning {
            simulation.set_velocities(|x| self.spin.cross(x - self.center))?;
        }
        let report = simulation.step()?;
        warnings(report, &mut run.warned);
        let chosen = report.bodies.first().context("the choice is reported")?;
        run.substeps = chosen.substeps;
        let is_vbd = chosen.method == Some(ChosenMethod::TwoLevelVbd);
        run.method = if is_vbd { "vbd" } else { "gauss-seidel" }.to_owned();
        report.precision.clone_into(&mut run.precision);
        // The mean excludes the handle's motion and two periods.
        let first = span.ramp.max(span.all / 4) * span.stride;
        let last = match case.load {
            Load::Spinning => span.motion,
            Load::Hanging | Load::Pressed => span.all,
        } * span.stride;
        let mut weights = 0.0;
        for frame in 1..=last {
            if frame > 1 {
                warnings(simulation.step()?, &mut run.warned);
            }
            if frame % span.stride == 0 && frame / span.stride <= span.motion {
                run.motion.push(simulation.positions().to_vec());
            }
            if frame > first {
                let phase = (frame - first) as f64 / (last - first + 1) as f64;
                let weight = 1.0 - (TAU * phase).cos();
                weights += weight;
                for (mean, x) in run.mean.iter_mut().zip(simulation.positions()) {
                    *mean += *x * weight;
                }
            }
        }
        for mean in &mut run.mean {
            *mean /= weights;
        }
        Ok(run)
    }

    /// RMS distance of all free particles in all states, relative to the RMS displacement or to `sag`, whichever is
    /// larger.
    fn error(&self, states: &[Vec<DVec3>], exact: &[Vec<DVec3>], sag: f64) -> f64 {
        let (mut off, mut moved) = (0.0, 0.0);
        for (state, exact) in states.iter().zip(exact) {
            let free = self.free();
            off += free
                .map(|p| state[p].distance_squared(exact[p]))
                .sum::<f64>();
            moved += self.moved(exact).max(sag).powi(2);
        }
        // JSON has no infinity.
        (off / moved).sqrt().min(f64::MAX)
    }

    /// Root of the summed squared displacements of all free particles.
    fn moved(&self, state: &[DVec3]) -> f64 {
        let squares = self
            .free()
            .map(|p| self.mesh.positions[p].distance_squared(state[p]));
        squares.sum::<f64>().sqrt()
    }

    fn free(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.fixed.len()).filter(|&p| !self.fixed[p] && !self.held[p])
    }
}

impl Span {
    fn new(load: Load, period: f64, frame: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "some thousand frames at most"
        )]
        let count = |number: f64| number.clamp(1.0, 1e4) as u64;
        let (steps_wanted, periods) = match load {
            Load::Spinning => (2.0 * STEPS, 1.0),
            Load::Hanging | Load::Pressed => (STEPS, 2.0),
        };
        let stride = count(period / frame / steps_wanted);
        // At most 24 steps per frame: the reference is not converged for faster vibrations; the page states this.
        let steps = count((steps_wanted * frame / period).ceil().min(STEPS));
        let strides = |periods: f64| count((periods * period / frame / stride as f64).ceil());
        let ramp = if load == Load::Pressed {
            strides(2.0).max(4)
        } else {
            0
        };
        let motion = match load {
            Load::Pressed => ramp + strides(1.0),
            Load::Hanging | Load::Spinning => strides(periods).max(4),
        };
        Self {
            stride,
            steps: u32::try_from(steps).unwrap_or(1),
            ramp,
            motion,
            all: ramp + strides(8.0).max(64),
        }
    }

    /// Fraction of the handle's path after a number of strides.
    fn part(&self, stride: u64) -> f64 {
        let x = stride.min(self.ramp) as f64 / self.ramp.max(1) as f64;
        x * x * (3.0 - 2.0 * x)
    }
}
