//! `cargo xtask stress-cut`: thousands of random strokes, with all derived data checked after each.
//!
//! The body sags under its weight, fixed on one side, with a ground for falling pieces. Each stroke is of a random kind
//! and place, a few edges large: rectangles, bent strips, punches, blades swept over several frames, in overlapping rows or
//! across their own path, repeats of the previous stroke, at its place or beside it by less than an edge (thin slices),
//! sometimes a removal of tets. Up to three frames without a blade follow, in which the mesh is improved. After every frame
//! all derived data is recomputed and compared (`Simulation::check`, volume to 1e-12), positions must be finite, and the
//! deltas must agree with the mesh. A body that has tripled its tets is replaced by a new one. The seed determines
//! everything.
//!
//! With `--contact` parts and sides of cuts touch. Energy is measured then: kinetic, elastic and gravity together must not
//! grow in a frame by more than a part in a thousand of the energy that the body has when it falls by its own size. Frames
//! that take tets away or collapse edges change the body and are left out. A frame that gains more fails the run at its end.
//! The one that gains most is named, with the seed with which its body is the first.
//! With `--energy` energy is measured without contact, to compare.
//!
//! One iteration a substep does not solve its equations. To tell whether the gain comes from that, a frame that gains energy
//! is computed again from the state before it with 8 times as many, with 100 times, and with 100 times and without recovery
//! from depth, which does work by itself. The results are counted; none of them excuses the frame. More iterations also
//! relax what the frames before left, so to compare, run all strokes with `--iterations 8`.
//!
//! A second number leaves out tets of less than a hundredth of the mean volume: a sliver is as stiff as it is thin, so an
//! error of a thousandth of an edge in one of them can be more energy than all other tets have. Another column counts the
//! frames in which inverted tets gain more than half of what the body gains. Neither decides whether the run fails.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use clap::Args;
use incise::cutting::Skin;
use incise::mesh::glam::{DMat3, DVec3};
use incise::mesh::{Bounds, TetId};
use incise::report::CutReport;
use incise::scene::{BodySpec, ContactSpec, Precision, Quantity, Region, ReportSpec, StrokeSpec};
use incise::{Scene, Simulation, Snapshot};
use incise_reference::{Material, StableNeoHookean};

use crate::models::{Model, models};
use crate::random::Random;
use crate::table;

#[derive(Debug, Args)]
pub(crate) struct StressArguments {
    /// Number of strokes on each mesh.
    #[arg(long, default_value_t = 10_000)]
    strokes: u64,
    /// Random seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Stop after so many seconds in all.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// A small generated mesh only.
    #[arg(long)]
    quick: bool,
    /// Also the mesh of this file.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Let bodies, pieces and the sides of cuts touch, and measure energy.
    #[arg(long)]
    contact: bool,
    /// Measure energy without contact, too.
    #[arg(long)]
    energy: bool,
    /// Without improvement after strokes.
    #[arg(long)]
    plain: bool,
    /// Iterations a substep.
    #[arg(long, default_value_t = 1)]
    iterations: u32,
}

/// Largest growth of the energy in a frame, as a part of weight times size of the body.
const MOST_GAINED: f64 = 1e-3;

/// By how many times more iterations a frame that gains energy is computed again; the last time without recovery from depth.
const AGAIN: [u32; 3] = [8, 100, 100];

/// How often a run says how far it has come.
const NEWS: Duration = Duration::from_secs(60);

/// Recovery time in s that leaves depth as it is.
const NO_RECOVERY: f64 = 1e3;

/// Tets of a smaller volume, as a fraction of the mean, are slivers.
const SLIVER: f64 = 0.01;

/// Statistics of a stress run.
#[derive(Debug, Default)]
struct Tally {
    strokes: u64,
    cut: u64,
    bodies: u64,
    tets_cut: usize,
    tets_created: usize,
    /// Particles that improvements took out.
    collapsed: usize,
    detached: usize,
    most_pieces: usize,
    least_dihedral: f64,
    least_ratio: f64,
    most_colors: usize,
    /// The largest growth of the energy in a frame, as a part of weight times size.
    most_gained: f64,
    /// The largest growth without the energy of slivers.
    most_gained_without_slivers: f64,
    /// Frames with more growth than is allowed, those in which inverted tets gain most of it, and the frame with the most.
    gaining: u64,
    gaining_by_inverted: u64,
    worst_gain: Option<String>,
    /// The seed with which the present body is the first.
    body_seed: u64,
    /// Frames that also gain too much with each of [`AGAIN`].
    gaining_again: [u64; AGAIN.len()],
    /// The most contacts that pressed in a frame.
    most_active: usize,
    /// The deepest contact in mean edges.
    deepest: f64,
    repaired: usize,
}

impl Tally {
    /// Says how far the run has come.
    #[expect(clippy::print_stderr, reason = "a run takes an hour")]
    fn tell(&self, mesh: &str, arguments: &StressArguments) {
        let (made, all) = (self.strokes, arguments.strokes);
        let (bodies, pieces) = (self.bodies, self.most_pieces);
        eprint!("{mesh}: {made} of {all} strokes, {bodies} bodies, at most {pieces} pieces");
        if arguments.contact || arguments.energy {
            let (frames, most) = (self.gaining, self.most_gained);
            let without_slivers = self.most_gained_without_slivers;
            eprint!(
                "; {frames} frames gained too much energy, at most {most:.1e}, without slivers {without_slivers:.1e}"
            );
        }
        eprintln!();
    }
}

#[expect(
    clippy::print_stdout,
    reason = "the table is the result of the command"
)]
pub(crate) fn stress(arguments: &StressArguments) -> anyhow::Result<()> {
    let mut bodies = models(None, 12_000, arguments.quick)?;
    bodies.retain(|model| model.name.contains("liver") && model.mesh.tets.len() <= 12_000);
    if let Some(path) = &arguments.mesh {
        bodies.insert(0, Model::read(path.clone())?);
    }
    let start = Instant::now();
    let mut gains: Vec<String> = Vec::new();
    let mut columns = vec![
        "mesh",
        "strokes",
        "that cut",
        "violations",
        "bodies used up",
        "tets cut",
        "tets each became",
        "particles taken out",
        "pieces detached",
        "most pieces",
        "most colors",
        "smallest dihedral",
        "worst volume ratio",
    ];
    let with_energy = arguments.contact || arguments.energy;
    if with_energy {
        columns.extend([
            "most contacts",
            "deepest in edges",
            "repaired",
            "most energy gained",
            "without slivers",
            "frames that gain too much",
            "most of it in inverted tets",
            "with 8 times the iterations",
            "with 100 times",
            "without recovery",
        ]);
    }
    let mut table = table(columns);
    for (i, model) in bodies.iter().enumerate() {
        // Each mesh gets its share of the time.
        let share = (i + 1) as f64 / bodies.len() as f64;
        let end = arguments.seconds.map(|seconds| seconds * share);
        let late = || end.is_some_and(|end| start.elapsed().as_secs_f64() > end);
        let tally = stress_one(model, arguments, late)?;
        let mut row = vec![
            model.name.clone(),
            tally.strokes.to_string(),
            tally.cut.to_string(),
            "0".to_owned(),
            tally.bodies.to_string(),
            tally.tets_cut.to_string(),
            format!(
                "{:.2}",
                tally.tets_created as f64 / tally.tets_cut.max(1) as f64
            ),
            tally.collapsed.to_string(),
            tally.detached.to_string(),
            tally.most_pieces.to_string(),
            tally.most_colors.to_string(),
            format!("{:.3}°", tally.least_dihedral),
            format!("{:.1e}", tally.least_ratio),
        ];
        if with_energy {
            row.extend([
                tally.most_active.to_string(),
                format!("{:.3}", tally.deepest),
                tally.repaired.to_string(),
                format!("{:.1e}", tally.most_gained),
                format!("{:.1e}", tally.most_gained_without_slivers),
                tally.gaining.to_string(),
                tally.gaining_by_inverted.to_string(),
            ]);
            row.extend(tally.gaining_again.map(|frames| frames.to_string()));
        }
        gains.extend(tally.worst_gain);
        table.add_row(row);
    }
    println!("{table}");
    ensure!(gains.is_empty(), "energy is gained: {}", gains.join("; "));
    Ok(())
}

/// Runs until all strokes are made or time is up; fails at the first violation.
fn stress_one(
    model: &Model,
    arguments: &StressArguments,
    late: impl Fn() -> bool,
) -> anyhow::Result<Tally> {
    let mut random = Random(arguments.seed);
    let mut tally = Tally {
        least_dihedral: f64::INFINITY,
        least_ratio: 1.0,
        ..Tally::default()
    };
    let mut told = Instant::now();
    while tally.strokes < arguments.strokes && !late() {
        tally.bodies += 1;
        tally.body_seed = random.0;
        let mut scene = scene(model, arguments.plain, &mut random);
        scene.solver.iterations = arguments.iterations;
        if arguments.contact {
            scene.contact = Some(ContactSpec::default());
        }
        if arguments.contact || arguments.energy {
            scene.report = ReportSpec::default().with(|spec| {
                spec.quantities = vec![Quantity::Energy];
            });
        }
        let mut simulation = Simulation::new(&scene)?;
        let limit = 3 * simulation.mesh().tets.len();
        let mut energy = Energy::new(&scene, &simulation);
        let mut skin = Skin::new(simulation.boundary());
        let mut last = None;
        while tally.strokes < arguments.strokes && simulation.mesh().tets.len() < limit && !late() {
            let stroke = match last.take() {
                Some(stroke) if random.below(8) == 0 => stroke,
                Some(stroke) if random.below(6) == 0 => beside(stroke, &simulation, &mut random),
                _ => random_stroke(&simulation, &mut random),
            };
            let frame = simulation.report().frame + 1;
            let stroke = due(stroke, frame);
            let frames = stroke.last_frame() - stroke.first_frame() + 1;
            simulation.cut(stroke.clone())?;
            tally.strokes += 1;
            for _ in 0..frames + random.below(4) as u64 {
                let before = match arguments.contact || arguments.energy {
                    true => Some(simulation.snapshot()?),
                    false => None,
                };
                let step = checked_step(&mut simulation, &mut skin, &mut tally);
                step.with_context(|| {
                    let (seed, strokes) = (arguments.seed, tally.strokes);
                    format!("{}, seed {seed}, stroke {strokes}: {stroke:?}", model.name)
                })?;
                if let Some(before) = before {
                    energy.note(&scene, &before, &simulation, &mut tally)?;
                }
            }
            last = Some(stroke);
            if told.elapsed() >= NEWS {
                told = Instant::now();
                tally.tell(&model.name, arguments);
            }
        }
    }
    Ok(tally)
}

/// Runs a frame and checks all derived data.
fn checked_step(
    simulation: &mut Simulation,
    skin: &mut Skin,
    tally: &mut Tally,
) -> anyhow::Result<()> {
    let report = simulation.step()?.clone();
    simulation.check()?;
    for delta in simulation.deltas() {
        skin.apply_delta(delta);
    }
    ensure!(
        skin.triangles().len() == simulation.boundary().count(),
        "the skin has other triangles than the body"
    );
    let mut positions = simulation.positions().iter().enumerate();
    if let Some((p, x)) = positions.find(|(_, x)| !x.is_finite()) {
        let mesh = simulation.mesh();
        let around = mesh.tets.iter().enumerate();
        let around = around.filter(|(_, tet)| tet.iter().any(|q| q.index() == p));
        let volumes: Vec<f64> = around.map(|(t, _)| mesh.volume(TetId::new(t))).collect();
        bail!(
            "particle {p} is at {x} in {} with {} repaired; volumes of its tets: {volumes:?}",
            report.precision,
            report.repaired
        );
    }
    if let Some(cut) = report.cut {
        tally.cut += 1;
        tally.tets_cut += cut.tets_cut;
        tally.tets_created += cut.tets_created;
        tally.collapsed += cut.collapsed;
        tally.least_ratio = tally.least_ratio.min(cut.worst_volume_ratio);
        let least = cut.dihedral.map_or(f64::INFINITY, |[least, _]| least);
        tally.least_dihedral = tally.least_dihedral.min(least);
    }
    tally.repaired += report.repaired;
    if let Some(contact) = report.contact {
        tally.most_active = tally.most_active.max(contact.active);
        tally.deepest = tally.deepest.max(contact.max_depth);
    }
    tally.detached += report.detached.len();
    tally.most_pieces = tally.most_pieces.max(report.pieces);
    tally.most_colors = tally.most_colors.max(report.colors);
    Ok(())
}

/// Energies in J.
#[derive(Clone, Copy, Debug)]
struct Joules {
    /// Kinetic, elastic and gravity energy.
    all: f64,
    /// All without the elastic energy of slivers.
    without_slivers: f64,
    /// The elastic energy of inverted tets.
    inverted: f64,
}

/// The energy of a body from frame to frame, where it is reported.
struct Energy {
    law: StableNeoHookean,
    /// That of the last frame.
    last: Option<Joules>,
    /// Weight times size in J.
    scale: f64,
}

impl Energy {
    fn new(scene: &Scene, simulation: &Simulation) -> Self {
        let mesh = simulation.mesh();
        let bounds = Bounds::around(mesh.positions.iter().copied());
        let body = &scene.body[0];
        let mass = body.density * mesh.total_volume();
        let law = Material {
            young_modulus: body.young_modulus,
            poisson_ratio: body.poisson_ratio,
            density: body.density,
        }
        .law();
        Self {
            law,
            last: None,
            scale: mass * 9.81 * bounds.size().max_element(),
        }
    }

    /// The energy after the last frame; `None` where it is not reported.
    fn of(&self, simulation: &Simulation) -> Option<Joules> {
        let energy = simulation.report().energy?;
        let (mesh, positions) = (simulation.mesh(), simulation.positions());
        let least = SLIVER * mesh.total_volume() / mesh.tets.len() as f64;
        let not_elastic = energy.kinetic + energy.gravity;
        let mut joules = Joules {
            all: not_elastic + energy.elastic,
            without_slivers: not_elastic,
            inverted: 0.0,
        };
        for (t, tet) in mesh.tets.iter().enumerate() {
            let [rest, now] = [&mesh.positions[..], positions].map(|x| {
                let [a, b, c, d] = tet.map(|p| x[p.index()]);
                DMat3::from_cols(b - a, c - a, d - a)
            });
            let volume = mesh.volume(TetId::new(t));
            let elastic = volume * self.law.energy_density(now * rest.inverse());
            if volume >= least {
                joules.without_slivers += elastic;
            }
            if now.determinant() < 0.0 {
                joules.inverted += elastic;
            }
        }
        Some(joules)
    }

    /// Counts the last frame if it has gained energy, and computes it again then from the state before.
    fn note(
        &mut self,
        scene: &Scene,
        before: &Snapshot,
        simulation: &Simulation,
        tally: &mut Tally,
    ) -> anyhow::Result<()> {
        let Some(now) = self.of(simulation) else {
            return Ok(());
        };
        let report = simulation.report();
        let changes_body = |cut: &CutReport| cut.tets_removed > 0 || cut.collapsed > 0;
        let last = self.last.replace(now);
        let Some(last) = last.filter(|_| !report.cut.as_ref().is_some_and(changes_body)) else {
            return Ok(());
        };
        let gained = (now.all - last.all) / self.scale;
        let without_slivers = (now.without_slivers - last.without_slivers) / self.scale;
        tally.most_gained = tally.most_gained.max(gained);
        let is_worst = gained >= tally.most_gained;
        let most = &mut tally.most_gained_without_slivers;
        *most = most.max(without_slivers);
        if gained <= MOST_GAINED {
            return Ok(());
        }
        tally.gaining += 1;
        let by_inverted = (now.inverted - last.inverted) / self.scale;
        tally.gaining_by_inverted += u64::from(by_inverted > 0.5 * gained);
        let mut again = Vec::new();
        for (i, times) in AGAIN.into_iter().enumerate() {
            let mut simulation = Simulation::new(scene)?;
            simulation.restore(before)?;
            let spec = simulation.solver_spec().clone();
            simulation.set_solver(&spec.with(|spec| spec.iterations *= times))?;
            let is_last = i + 1 == AGAIN.len();
            if let Some(contact) = scene.contact.clone().filter(|_| is_last) {
                simulation.set_contact(&contact.with(|spec| spec.recovery_time = NO_RECOVERY))?;
            }
            simulation.step()?;
            let then = self.of(&simulation).context("energy is reported")?;
            let gained = (then.all - last.all) / self.scale;
            again.push(format!("{gained:.1e}"));
            tally.gaining_again[i] += u64::from(gained > MOST_GAINED);
        }
        if is_worst {
            tally.worst_gain = Some(format!(
                "stroke {}, frame {} of the body that is the first with seed {}: from {last:?} to {now:?} J, {gained:.1e} of \
                 weight times size; computed again with {AGAIN:?} times the iterations, the last time without recovery: {}; {:?}",
                tally.strokes,
                report.frame,
                tally.body_seed,
                again.join(", "),
                report.contact,
            ));
        }
        Ok(())
    }
}

/// The built-in scene without its stroke, with a ground below.
fn scene(model: &Model, plain: bool, random: &mut Random) -> Scene {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.cutting.improve = !plain;
    scene.stroke.clear();
    model.put_into(&mut scene.body[0]);
    let body: &mut BodySpec = &mut scene.body[0];
    body.young_modulus = 2e4;
    scene.solver.precision = [Precision::F32, Precision::F64][random.below(2)];
    scene.world.ground = Some(incise::scene::GroundSpec::default().with(|spec| {
        spec.height = -1.0;
        spec.friction = 0.5;
    }));
    scene
}

/// A stroke a few edges large at a random particle.
fn random_stroke(simulation: &Simulation, random: &mut Random) -> StrokeSpec {
    let positions = simulation.positions();
    let mesh = simulation.mesh();
    let tet = mesh.tets[random.below(mesh.tets.len())];
    let center = positions[tet[0].index()];
    let edge = mesh.positions[tet[0].index()].distance(mesh.positions[tet[1].index()]);
    let size = edge.max(0.02) * (0.5 + 3.0 * random.unit());
    let (u, v) = (random.direction(), random.direction());
    let normal = u.cross(v).normalize_or(DVec3::X);
    let v = normal.cross(u) * size;
    let u = u * size;
    let array = DVec3::to_array;
    let (frame, snap) = (0, [0.0, 0.05, 0.1, 0.1, 0.1, 0.2][random.below(6)]);
    match random.below(12) {
        0..=3 => StrokeSpec::rectangle(frame, array(&center), array(&u), array(&v)).with_snap(snap),
        4 | 5 => {
            // A strip of two bays, bent at the middle.
            let bend = normal * size * random.unit();
            let rows = [center - v, center + bend, center + v];
            let points = rows
                .iter()
                .flat_map(|row| [array(&(*row - u)), array(&(*row + u))]);
            StrokeSpec::surface(
                frame,
                points.collect(),
                vec![[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]],
            )
            .with_snap(snap)
        }
        6 => StrokeSpec::punch(frame, Region::sphere(array(&center), size)).with_snap(snap),
        7 if random.below(8) == 0 => {
            StrokeSpec::remove(frame, Region::sphere(array(&center), 0.5 * size))
        }
        10 => {
            // Rows that overlap, to and fro.
            let across = |row: i32| 0.4 * f64::from(row) * u;
            let rows = (-2..=2).flat_map(|row| {
                let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
                [
                    array(&(across(row) - sign * v)),
                    array(&(across(row) + sign * v)),
                ]
            });
            StrokeSpec::sweep(
                [0, 10 + random.below(10) as u64],
                vec![array(&(center - 0.35 * u)), array(&(center + 0.35 * u))],
                rows.collect(),
            )
            .with_snap(snap)
        }
        11 => {
            // A loop across its own path.
            let n = normal * size * 0.4;
            let path = [-v - n, v + n, v - n, -v + n, -v - n];
            StrokeSpec::sweep(
                [0, 5 + random.below(10) as u64],
                vec![array(&(center - u)), array(&(center + u))],
                path.iter().map(array).collect(),
            )
            .with_snap(snap)
        }
        _ => {
            let frames = 2 + random.below(6) as u64;
            let middle = center + normal * size * 0.3;
            StrokeSpec::sweep(
                [0, frames],
                vec![array(&(middle - u)), array(&(middle + u))],
                vec![array(&-v), array(&(normal * size * 0.2)), array(&v)],
            )
            .with_snap(snap)
        }
    }
}

/// A stroke moved aside by 0.02 to 0.22 edges.
fn beside(mut stroke: StrokeSpec, simulation: &Simulation, random: &mut Random) -> StrokeSpec {
    let mesh = simulation.mesh();
    let edge = (mesh.total_volume() / mesh.tets.len().max(1) as f64 * 8.0).cbrt();
    let by = random.direction() * edge * (0.02 + 0.2 * random.unit());
    let shift = |x: &mut [f64; 3]| *x = (DVec3::from_array(*x) + by).to_array();
    match &mut stroke {
        StrokeSpec::Plane { point, .. } => shift(point),
        StrokeSpec::Rectangle { center, .. } => shift(center),
        StrokeSpec::Surface { points, .. } => points.iter_mut().for_each(shift),
        StrokeSpec::Sweep { blade, .. } => blade.iter_mut().for_each(shift),
        StrokeSpec::Punch { region, .. } | StrokeSpec::Remove { region, .. } => {
            if let Region::Sphere { center, .. } = region {
                shift(center);
            }
        }
        _ => unreachable!("random strokes are of these kinds"),
    }
    stroke
}

/// Moves a stroke to start at a frame.
fn due(mut stroke: StrokeSpec, now: u64) -> StrokeSpec {
    match &mut stroke {
        StrokeSpec::Plane { frame, .. }
        | StrokeSpec::Rectangle { frame, .. }
        | StrokeSpec::Surface { frame, .. }
        | StrokeSpec::Punch { frame, .. }
        | StrokeSpec::Remove { frame, .. } => *frame = now,
        StrokeSpec::Sweep { frames, .. } => *frames = [now, now + frames[1] - frames[0]],
        _ => unreachable!("random strokes are of these kinds"),
    }
    stroke
}
