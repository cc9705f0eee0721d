//! Bodies after random strokes: falling on a ground, and free at rest.

use std::path::PathBuf;

use anyhow::Context;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::mesh_io;
use incise::meshing::{Shape, generate, irregular};
use incise::scene::{BodySpec, GroundSpec, Precision, Quantity, StrokeSpec};
use incise::{Scene, Simulation};
use serde::{Deserialize, Serialize};

use super::{Warned, warnings};
use crate::random::Random;

/// Longest side of a body in m.
const SIZE: f64 = 0.25;

/// A body to cut.
#[derive(Clone, Debug)]
pub(super) enum CutBody {
    /// A mesh file; a missing one has a row that says so.
    File(Option<PathBuf>),
    /// A generated liver.
    Liver(usize),
    /// A Delaunay mesh of scattered points in a torus.
    Irregular(usize),
}

impl CutBody {
    pub(super) fn name(&self) -> String {
        match self {
            Self::File(_) => "liver_11k".to_owned(),
            Self::Liver(tets) => format!("generated liver, {tets} tets"),
            Self::Irregular(tets) => format!("irregular torus, {tets} tets"),
        }
    }

    pub(super) fn mesh(&self) -> anyhow::Result<Option<TetMesh>> {
        Ok(Some(match self {
            Self::File(None) => return Ok(None),
            Self::File(Some(path)) => {
                mesh_io::read(path).with_context(|| path.display().to_string())?
            }
            Self::Liver(tets) => generate(Shape::Liver, *tets)?,
            Self::Irregular(tets) => irregular(Shape::Torus, *tets, 5)?,
        }))
    }
}

/// Time of the strokes into a falling body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Strokes {
    /// In free fall, before the ground loads the body.
    Before,
    /// While the body falls on the ground and lies there.
    During,
}

impl Strokes {
    /// The distance to the ground in m: twenty frames of 0.01 s take 0.2 m.
    const fn drop(self) -> f64 {
        match self {
            Self::Before => 0.25,
            Self::During => 0.05,
        }
    }
}

/// A body under load after 20 strokes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct LoadRow {
    pub(super) strokes: Strokes,
    pub(super) young_modulus: f64,
    pub(super) substeps: u32,
    pub(super) precision: String,
    pub(super) snap: f64,
    pub(super) tets: usize,
    /// Largest kappa of a tet.
    pub(super) kappa: f64,
    /// Largest speed in m/s of all frames, and of the last 50.
    pub(super) fastest: f64,
    pub(super) fastest_at_end: f64,
    /// Inverted tets: the maximum over frames, and in the last frame.
    pub(super) most_inverted: usize,
    pub(super) inverted: usize,
    pub(super) softened: usize,
    /// Largest kinetic energy of the last 50 frames as a fraction of the energy released by gravity.
    pub(super) kinetic_at_end: f64,
    /// The speed in m/s of a fall from the top of the body to the ground.
    pub(super) fall: f64,
    pub(super) is_failure: bool,
    pub(super) warned: Warned,
}

impl LoadRow {
    /// True if the kinetic energy is less than that of the fall.
    pub(super) fn is_bounded(&self) -> bool {
        !self.is_failure && self.kinetic_at_end < 1.0
    }

    /// True if the fastest particle is also slower than ten falls, and at the end than three.
    pub(super) fn is_slow(&self) -> bool {
        self.fastest < 10.0 * self.fall && self.fastest_at_end < 3.0 * self.fall
    }
}

/// A free body at rest after 30 strokes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct RestRow {
    pub(super) body: String,
    pub(super) precision: String,
    pub(super) snap: f64,
    pub(super) tets: usize,
    pub(super) substeps: u32,
    /// Largest speed in m/s of the first and the last 100 of 500 frames after the strokes.
    pub(super) first: f64,
    pub(super) last: f64,
    /// Largest number of inverted tets in a frame.
    pub(super) inverted: usize,
    pub(super) warned: Warned,
}

impl RestRow {
    /// Limit of the largest speed in m/s.
    pub(super) fn bar(&self) -> f64 {
        if self.precision == "f64" { 1e-9 } else { 1e-2 }
    }

    pub(super) fn passes(&self) -> bool {
        self.first.max(self.last) < self.bar()
            && !self.is_growing()
            && self.inverted == 0
            && self.tets > 0
    }

    /// True if the speed grows by more than the effect of rounding on the largest speed.
    pub(super) fn is_growing(&self) -> bool {
        self.last > 2.0 * self.first
    }
}

/// Rectangle of two to eight tenths of the body, at the current position of a random particle.
fn random_stroke(simulation: &Simulation, random: &mut Random, snap: f64) -> StrokeSpec {
    let positions = simulation.positions();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a fraction of the number of particles, rounded down"
    )]
    let center = positions[(random.unit() * positions.len() as f64) as usize];
    let size = SIZE * (0.1 + 0.3 * random.unit());
    let u = random.vector().normalize_or(DVec3::X);
    let v = random.vector().cross(u);
    let v = v.normalize_or(u.any_orthonormal_vector());
    StrokeSpec::rectangle(
        simulation.next_frame(),
        center.to_array(),
        (u * size).to_array(),
        (v * size).to_array(),
    )
    .with_snap(snap)
}

/// Scene with a body of 25 cm from a mesh file.
fn scene(file: PathBuf, mesh: &TetMesh, young_modulus: f64, precision: Precision) -> Scene {
    let (low, high) = ends(mesh.positions.iter().copied());
    let mut scene = Scene::default();
    scene.report.quantities = vec![Quantity::Speed, Quantity::Volume, Quantity::Kappa];
    scene.solver.precision = precision;
    scene.body.push(BodySpec::default().with(|spec| {
        spec.mesh = Some(file);
        spec.scale = SIZE / (high - low).max_element();
        spec.young_modulus = young_modulus;
        spec.poisson_ratio = 0.45;
        spec.density = 1000.0;
    }));
    scene
}

/// Corners of the smallest box around positions.
pub(super) fn ends(positions: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    positions.fold((DVec3::MAX, DVec3::MIN), |(low, high), x| {
        (low.min(x), high.max(x))
    })
}

/// Strokes into a body that falls on a ground, one per frame of 0.01 s.
pub(super) fn load(
    body: &CutBody,
    file: PathBuf,
    young_modulus: f64,
    substeps: u32,
    precision: Precision,
    (strokes, snap): (Strokes, f64),
    [count, frames]: [u64; 2],
) -> anyhow::Result<LoadRow> {
    let mesh = body
        .mesh()?
        .context("the body of this scene is generated")?;
    let mut scene = scene(file, &mesh, young_modulus, precision);
    let (low, high) = ends(mesh.positions.iter().copied());
    let height = (high.z - low.z) * scene.body[0].scale + strokes.drop();
    scene.world.gravity = Some([0.0, 0.0, -9.81]);
    scene.world.ground = Some(GroundSpec::default().with(|spec| {
        spec.height = low.z * scene.body[0].scale - strokes.drop();
        spec.friction = 0.5;
    }));
    scene.report.quantities.push(Quantity::Energy);
    scene.solver.time_step = 0.01;
    scene.solver.substeps = substeps.into();
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let mut random = Random(18);
    let mut row = LoadRow {
        strokes,
        young_modulus,
        substeps,
        precision: precision.name().to_owned(),
        snap,
        tets: 0,
        kappa: 0.0,
        fastest: 0.0,
        fastest_at_end: 0.0,
        most_inverted: 0,
        inverted: 0,
        softened: 0,
        kinetic_at_end: 0.0,
        fall: (2.0 * 9.81 * height).sqrt(),
        is_failure: false,
        warned: Warned::new(),
    };
    let (mut highest, mut released) = (None, 0.0);
    for frame in 0..frames {
        if frame < count {
            let stroke = random_stroke(&simulation, &mut random, snap);
            simulation.cut(stroke)?;
        }
        let report = simulation.step()?;
        warnings(report, &mut row.warned);
        row.is_failure |= report.warnings().iter().any(incise::Warning::is_failure);
        let speed = report.max_speed.context("no speed was reported")?;
        let speed = if speed.is_finite() { speed } else { f64::MAX };
        row.fastest = row.fastest.max(speed);
        if frame + 50 >= frames {
            row.fastest_at_end = row.fastest_at_end.max(speed);
        }
        row.inverted = report.inverted_tets.unwrap_or(0);
        row.most_inverted = row.most_inverted.max(row.inverted);
        row.kappa = row.kappa.max(report.kappa.unwrap_or(0.0)).min(f64::MAX);
        let softened = report.softened.map_or(0, |softened| softened.tets);
        row.softened = row.softened.max(softened);
        row.tets = report.tets;
        let energy = report.energy.context("no energy was reported")?;
        let highest = *highest.get_or_insert(energy.gravity);
        released = f64::max(released, highest - energy.gravity);
        if frame + 50 >= frames {
            let kinetic = (energy.kinetic / released).min(f64::MAX);
            row.kinetic_at_end = row.kinetic_at_end.max(kinetic);
        }
    }
    Ok(row)
}

/// Thirty strokes into a free body of E = 1e5 Pa without gravity, one per frame, followed by 500 frames without
/// strokes. `None` if the mesh is missing.
pub(super) fn rest(
    body: &CutBody,
    file: PathBuf,
    snap: f64,
    precision: Precision,
    [strokes, frames]: [u64; 2],
) -> anyhow::Result<Option<RestRow>> {
    let Some(mesh) = body.mesh()? else {
        return Ok(None);
    };
    let scene = scene(file, &mesh, 1e5, precision);
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let mut random = Random(30);
    let mut row = RestRow {
        body: body.name(),
        precision: precision.name().to_owned(),
        snap,
        tets: 0,
        substeps: 0,
        first: 0.0,
        last: 0.0,
        inverted: 0,
        warned: Warned::new(),
    };
    for frame in 0..strokes + frames {
        if frame < strokes {
            let stroke = random_stroke(&simulation, &mut random, snap);
            simulation.cut(stroke)?;
        }
        let report = simulation.step()?;
        warnings(report, &mut row.warned);
        let speed = report.max_speed.context("no speed was reported")?;
        let speed = if speed.is_finite() { speed } else { f64::MAX };
        if frame >= strokes && frame < strokes + frames / 5 {
            row.first = row.first.max(speed);
        }
        if frame >= strokes + frames - frames / 5 {
            row.last = row.last.max(speed);
        }
        row.inverted = row.inverted.max(report.inverted_tets.unwrap_or(0));
        row.tets = report.tets;
        row.substeps = report.bodies.first().map_or(0, |body| body.substeps);
    }
    Ok(Some(row))
}
