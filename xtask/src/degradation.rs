//! `cargo xtask degradation`: effect of many small strokes into one mesh on clusters, colors and the solve time.
//!
//! One scene runs without merging, with merging, and with background re-clustering, alternating frame by frame, so that
//! other load of the machine affects all alike. The mesh stays at rest, and the solver makes 20 Gauss-Seidel iterations
//! per frame. At the end all derived data is checked.
//!
//! A second table has what the strokes leave with snap 0, 0.1 and 0.2, without and with `[cutting] improve`: tets, pieces,
//! crumbs that stayed with a larger part, thin tets, tets flatter than any of the uncut body, which need shorter substeps,
//! colors, and the time of a frame as a multiple of that of the uncut body, which runs beside in turn. Tets are compared
//! with those of the uncut body and with a body that has all cut faces but not their crossings: the tets of the uncut one
//! and those that each stroke alone adds to it. Thin tets count as near a feature if a corner is on an edge where outer
//! surface and cut faces of strokes meet, where a boundary folds by more than 37 degrees, or where a cut ends.

use std::fmt::Write;
use std::num::NonZeroU32;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use comfy_table::Table;
use incise::clustering::cluster;
use incise::coloring::auto;
use incise::cutting::{CutOptions, CuttableMesh, FaceTag, Sweep};
use incise::graph::Incidence;
use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetMesh, outward_normals, tet_quality};
use incise::scene::{ReclusterSpec, StrokeSpec};
use incise::{FrameReport, Scene, Simulation};

use crate::experiment::median;
use crate::models::{Model, models};
use crate::table;

#[derive(Debug, Args)]
pub(crate) struct DegradationArguments {
    /// Take the .vtk meshes of this folder instead of generated ones.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Only the model of this name.
    #[arg(long, value_name = "NAME", default_value = "liver_11k")]
    model: String,
    /// Number of strokes.
    #[arg(long, value_name = "N", default_value_t = 200)]
    strokes: u64,
    /// Number of solver threads.
    #[arg(long, value_name = "N", default_value_t = 1)]
    threads: usize,
    /// Strokes across each other in the middle of the body, six mean edges wide and long, instead of smaller ones into
    /// its surface.
    #[arg(long)]
    crossing: bool,
    /// Only the table of what the strokes leave.
    #[arg(long)]
    shapes_only: bool,
    /// Snap distances of that table.
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "0,0.1,0.2"
    )]
    snaps: Vec<f64>,
    /// Improve the mesh where strokes cut what earlier ones have cut, in the scene that `--scene` writes.
    #[arg(long)]
    improve: bool,
    /// Write the scene of the strokes to this file and measure nothing; `incise run FILE --out DIR` renders it.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Write the tables to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Frames of a stroke.
const FRAMES: u64 = 5;
/// Frames from the start of a crossing stroke to that of the next one, as between strokes of a hand.
const CROSSING_FRAMES: u64 = 20;
/// Number of parts of the run; each has a row.
const PARTS: u64 = 4;
/// Depth of a stroke and its length, as fractions of the largest extent of the body.
const DEPTH: f64 = 0.12;
const LENGTH: f64 = 0.15;

impl DegradationArguments {
    /// Frames from the start of a stroke to that of the next one.
    fn period(&self) -> u64 {
        if self.crossing {
            CROSSING_FRAMES
        } else {
            FRAMES
        }
    }
}

/// One way to maintain the partition, with its history.
struct Run {
    name: &'static str,
    simulation: Simulation,
    reports: Vec<FrameReport>,
    /// Clusters and colors of a partition rebuilt from the current mesh after each part.
    fresh: Vec<[usize; 2]>,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn degradation(arguments: &DegradationArguments) -> anyhow::Result<()> {
    let models = models(arguments.models.as_deref(), usize::MAX, false)?;
    let named = models.iter().find(|model| model.name == arguments.model);
    let generated = models.iter().find(|model| model.name.starts_with("liver"));
    let model = match arguments.models {
        Some(_) => named,
        None => generated,
    };
    let model = model.with_context(|| format!("there is no model {}", arguments.model))?;
    if let Some(path) = &arguments.scene {
        let mut scene = scene_at_rest(model, arguments, 0.1);
        scene.cutting.improve = arguments.improve;
        if let Some(mesh) = &mut scene.body[0].mesh {
            // The scene may lie in another folder.
            *mesh = std::path::absolute(&*mesh)?;
        }
        std::fs::write(path, scene.to_toml()?)?;
        return Ok(());
    }
    let frames = arguments.period() * arguments.strokes;
    let mut text = format!(
        "## {}, {} {}strokes, {} thread(s)\n",
        model.name,
        arguments.strokes,
        if arguments.crossing { "crossing " } else { "" },
        arguments.threads,
    );
    if !arguments.shapes_only {
        let mut runs = runs(model, arguments)?;
        for frame in 0..frames {
            for run in &mut runs {
                let report = run.simulation.step()?.clone();
                run.reports.push(report);
                if (1..=PARTS).any(|part| frame + 1 == frames * part / PARTS) {
                    run.fresh.push(fresh_plan(run.simulation.mesh())?);
                }
            }
        }
        writeln!(text, "\n{}", course(&runs, arguments))?;
        writeln!(text, "\n{}", costs(&runs))?;
        for run in &runs {
            run.simulation.check()?;
        }
    }
    let left = shapes(model, arguments)?;
    writeln!(text, "\n## What the strokes leave, by snap\n\n{left}")?;
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// A body at rest and strokes into it, with the default solver of the experiment.
fn scene_at_rest(model: &Model, arguments: &DegradationArguments, snap: f64) -> Scene {
    let mut scene = Scene::built_in();
    scene.contact = None;
    // Only where it is measured.
    scene.cutting.improve = false;
    scene.world = incise::scene::WorldSpec::default();
    model.put_into(&mut scene.body[0]);
    scene.solver.substeps = 1.into();
    scene.solver.iterations = 20;
    let scale = scene.body[0].scale;
    scene.stroke = if arguments.crossing {
        crossing_strokes(&model.mesh, scale, arguments.strokes, snap)
    } else {
        small_strokes(&model.mesh, scale, arguments.strokes, snap)
    };
    scene
}

fn runs(model: &Model, arguments: &DegradationArguments) -> anyhow::Result<Vec<Run>> {
    let mut scene = scene_at_rest(model, arguments, 0.1);
    let mut runs = Vec::new();
    let renewing = Some(ReclusterSpec::default().with(|spec| {
        spec.threshold = 1.25;
        spec.frames = NonZeroU32::MIN.saturating_add(9);
    }));
    for (name, merges, recluster) in [
        ("no merging", false, None),
        ("merging", true, None),
        ("and re-clustering", true, renewing),
    ] {
        scene.solver.merge_clusters = merges;
        scene.solver.recluster = recluster;
        runs.push(Run {
            name,
            simulation: Simulation::with_threads(&scene, arguments.threads)?,
            reports: Vec::new(),
            fresh: Vec::new(),
        });
    }
    Ok(runs)
}

/// Short sweeps of a short blade into the surface at random places, one after another.
fn small_strokes(mesh: &TetMesh, scale: f64, strokes: u64, snap: f64) -> Vec<StrokeSpec> {
    let surface = mesh.surface();
    let low = mesh.positions.iter().copied().reduce(DVec3::min);
    let high = mesh.positions.iter().copied().reduce(DVec3::max);
    let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
    let size = (high - low).max_element();
    let mut dice = Dice(7);
    let stroke = |i: u64| {
        let triangle = surface.triangles[dice.below(surface.triangles.len())];
        let [a, b, c] = triangle.map(|p| mesh.positions[p.index()]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let turn = DVec3::new(dice.unit(), dice.unit(), dice.unit());
        let along = normal.cross(turn).normalize_or_zero() * LENGTH * size;
        let middle = (a + b + c) / 3.0 - 0.5 * along;
        let blade = [
            middle + 0.2 * DEPTH * size * normal,
            middle - DEPTH * size * normal,
        ];
        StrokeSpec::sweep(
            [FRAMES * i, FRAMES * i + FRAMES - 1],
            blade.map(|x| (x * scale).to_array()).to_vec(),
            vec![[0.0; 3], (along * scale).to_array()],
        )
        .with_snap(snap)
    };
    (0..strokes).map(stroke).collect()
}

/// Sweeps of a blade of six mean edges along a path as long, at random angles and places around the middle.
fn crossing_strokes(mesh: &TetMesh, scale: f64, strokes: u64, snap: f64) -> Vec<StrokeSpec> {
    let low = mesh.positions.iter().copied().reduce(DVec3::min);
    let high = mesh.positions.iter().copied().reduce(DVec3::max);
    let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
    let edge = mean_edge(mesh);
    let mut dice = Dice(3);
    let mut direction = || DVec3::new(dice.unit(), dice.unit(), dice.unit());
    let stroke = |i: u64| {
        let center = low + (high - low) * (0.5 + SPREAD * direction());
        let along = direction().normalize_or(DVec3::X) * 3.0 * edge;
        let path = direction().normalize_or(DVec3::Y) * 3.0 * edge;
        let array = |x: DVec3| (x * scale).to_array();
        StrokeSpec::sweep(
            [CROSSING_FRAMES * i, CROSSING_FRAMES * i + FRAMES - 1],
            vec![array(center - along - path), array(center + along - path)],
            vec![[0.0; 3], array(2.0 * path)],
        )
        .with_snap(snap)
    };
    (0..strokes).map(stroke).collect()
}

fn mean_edge(mesh: &TetMesh) -> f64 {
    // Volume of a regular tet with edge e: e³ / (6 √2).
    let mean = mesh.total_volume() / mesh.tets.len().max(1) as f64;
    (mean * 6.0 * std::f64::consts::SQRT_2).cbrt()
}

/// Number of tets that each stroke of a scene alone adds to the uncut body, in all.
fn added_alone(model: &Model, scene: &Scene) -> anyhow::Result<usize> {
    let mut mesh = model.mesh.clone();
    let scale = scene.body[0].scale;
    mesh.positions.iter_mut().for_each(|x| *x *= scale);
    let base = CuttableMesh::new(mesh)?;
    let mut added = 0;
    for stroke in &scene.stroke {
        let StrokeSpec::Sweep {
            blade, path, snap, ..
        } = stroke
        else {
            continue;
        };
        let mut body = base.clone();
        let mut positions = body.mesh().positions.clone();
        let pose = |k: u64| {
            let at = k as f64 / (FRAMES - 1) as f64;
            let [from, to] = [path[0], path[1]].map(DVec3::from_array);
            let pose = blade
                .iter()
                .map(|x| DVec3::from_array(*x) + from.lerp(to, at));
            pose.collect::<Vec<_>>()
        };
        let options = CutOptions {
            snap: *snap,
            ..CutOptions::default()
        };
        let mut sweep = Sweep::new(&body, &positions, &pose(0), options)?;
        for k in 1..FRAMES {
            let delta = sweep.advance(&mut body, &positions, &pose(k))?;
            delta.extend_particles(&mut positions);
        }
        added += body.mesh().tets.len() - base.mesh().tets.len();
    }
    Ok(added)
}

/// Whether each particle is on an edge of the boundary where surfaces of two kinds meet, where it folds, or where more
/// than two of its triangles meet. The front of a cut is a fold.
fn on_features(simulation: &Simulation) -> Vec<bool> {
    let mesh = simulation.mesh();
    let mut edges: Vec<([ParticleId; 2], FaceTag, DVec3)> = Vec::new();
    for triangle in simulation.boundary() {
        let [a, b, c] = triangle.particles;
        let corners = mesh.tets[triangle.tet.index()].map(|p| mesh.positions[p.index()]);
        let normal = outward_normals(corners)[usize::from(triangle.opposite)].normalize_or_zero();
        for (p, q) in [(a, b), (b, c), (c, a)] {
            edges.push(([p.min(q), p.max(q)], triangle.tag, normal));
        }
    }
    edges.sort_by_key(|edge| (edge.0, edge.1));
    let mut is_feature = vec![false; mesh.positions.len()];
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        let is_smooth = match around {
            [one, other] => one.1 == other.1 && one.2.dot(other.2) >= FOLD,
            _ => false,
        };
        if !is_smooth {
            around[0]
                .0
                .iter()
                .for_each(|p| is_feature[p.index()] = true);
        }
    }
    is_feature
}

/// Linear congruential generator (Knuth's constants); only the high bits are used.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next()).unwrap_or(0) % end
    }

    /// Random value from -1 to 1.
    fn unit(&mut self) -> f64 {
        self.next() as f64 / f64::from(1u32 << 30) - 1.0
    }
}

/// Clusters and colors of a partition built as at the start.
fn fresh_plan(mesh: &TetMesh) -> anyhow::Result<[usize; 2]> {
    let tets = mesh.tets.iter().copied();
    let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
    let method = Scene::built_in().solver.clustering.parse()?;
    let clustering = cluster(method, &incidence);
    let coloring = auto(&incidence.quotient(&clustering)).coloring;
    Ok([clustering.occupied(), coloring.color_count()])
}

/// Clusters, colors and the solve time after each part of the strokes.
fn course(runs: &[Run], arguments: &DegradationArguments) -> Table {
    let frames = arguments.period() * arguments.strokes;
    let mut table = table([
        "strokes",
        "",
        "tets",
        "clusters",
        "mean size",
        "of a fresh plan",
        "colors",
        "of a fresh plan",
        "solve ms (median)",
        "times no merging",
    ]);
    for (part, i) in (1..=PARTS).zip(0..) {
        let end = (frames * part / PARTS) as usize;
        let start = (frames * (part - 1) / PARTS) as usize;
        let mut first = None;
        for run in runs {
            let fresh = run.fresh.get::<usize>(i);
            let (Some(last), Some(fresh)) = (run.reports[..end].last(), fresh) else {
                continue;
            };
            let reports = &run.reports[start..end];
            // In a frame with a cut the solver also reorders the tets.
            let quiet = reports.iter().filter(|report| report.cut.is_none());
            let ms = median(quiet.map(|report| report.ms.solve));
            let first = *first.get_or_insert(ms);
            table.add_row([
                (arguments.strokes * part / PARTS).to_string(),
                run.name.to_owned(),
                last.tets.to_string(),
                last.clusters.to_string(),
                format!("{:.2}", last.tets as f64 / last.clusters as f64),
                format!("{:.2}", last.tets as f64 / fresh[0] as f64),
                last.colors.to_string(),
                fresh[1].to_string(),
                format!("{ms:.3}"),
                format!("{:.2}", ms / first),
            ]);
        }
    }
    table
}

/// Dihedral angles in degrees below which a tet counts as thin.
const THIN: f64 = 5.0;
/// Cosine between the normals of neighboring boundary triangles below which their edge is a fold.
const FOLD: f64 = 0.8;
/// Half the extent of the region around the middle of the body in which crossing strokes have their centers, in extents.
const SPREAD: f64 = 0.08;

/// A body under strokes.
struct Shaped {
    snap: f64,
    improves: bool,
    simulation: Simulation,
    /// Milliseconds of the frames without a cut since the last row.
    times: Vec<f64>,
    /// The largest frame since the last row in ms.
    worst: f64,
    crumbs: usize,
    needed: usize,
}

/// Tets, pieces, crumbs, thin and stiff tets, colors and frame time after each part of the strokes, for each snap distance
/// without and with improvement. The simulations and the uncut body run frame by frame in turn.
fn shapes(model: &Model, arguments: &DegradationArguments) -> anyhow::Result<Table> {
    let DegradationArguments {
        strokes, threads, ..
    } = *arguments;
    let mut runs = Vec::new();
    for &snap in &arguments.snaps {
        let mut scene = scene_at_rest(model, arguments, snap);
        let needed = model.mesh.tets.len() + added_alone(model, &scene)?;
        for improves in [false, true] {
            scene.cutting.improve = improves;
            runs.push(Shaped {
                snap,
                improves,
                simulation: Simulation::with_threads(&scene, threads)?,
                times: Vec::new(),
                worst: 0.0,
                crumbs: 0,
                needed,
            });
        }
    }
    let mut scene = scene_at_rest(model, arguments, 0.0);
    scene.stroke.clear();
    let mut uncut = Simulation::with_threads(&scene, threads)?;
    let (uncut_tets, flattest) = (uncut.mesh().tets.len(), uncut.mesh().quality().min_altitude);
    let mut table = table([
        "strokes",
        "snap",
        "improve",
        "tets",
        "of the uncut body",
        "of all cut faces",
        "pieces",
        "crumbs kept",
        "tets with a dihedral below 5°",
        "away from features",
        "flatter than all uncut ones",
        "colors",
        "frame without a cut ms (median)",
        "of the uncut body's",
        "worst frame ms",
    ]);
    for part in 1..=PARTS {
        let mut uncut_times = Vec::new();
        let end = |part| arguments.period() * strokes * part / PARTS;
        for _ in end(part - 1)..end(part) {
            uncut_times.push(uncut.step()?.ms.total);
            for run in &mut runs {
                let report = run.simulation.step()?;
                run.worst = run.worst.max(report.ms.total);
                match &report.cut {
                    Some(cut) => run.crumbs += cut.crumbs,
                    None => run.times.push(report.ms.total),
                }
            }
        }
        let uncut_ms = median(uncut_times);
        for run in &mut runs {
            let mesh = run.simulation.mesh();
            let is_feature = on_features(&run.simulation);
            let (mut thin, mut away, mut flat) = (0, 0, 0);
            for tet in &mesh.tets {
                let quality = tet_quality(tet.map(|p| mesh.positions[p.index()]));
                if quality.min_dihedral < THIN {
                    thin += 1;
                    away += usize::from(tet.iter().all(|p| !is_feature[p.index()]));
                }
                flat += usize::from(quality.min_altitude < flattest);
            }
            let ms = median(run.times.drain(..));
            let report = run.simulation.report();
            let times = |count: usize| format!("{:.2}", report.tets as f64 / count as f64);
            table.add_row([
                (strokes * part / PARTS).to_string(),
                format!("{}", run.snap),
                if run.improves { "on" } else { "off" }.to_owned(),
                report.tets.to_string(),
                times(uncut_tets),
                times(run.needed),
                report.pieces.to_string(),
                run.crumbs.to_string(),
                thin.to_string(),
                away.to_string(),
                flat.to_string(),
                report.colors.to_string(),
                format!("{ms:.3}"),
                format!("{:.2}", ms / uncut_ms),
                format!("{:.1}", std::mem::take(&mut run.worst)),
            ]);
        }
    }
    for run in &runs {
        run.simulation.check()?;
    }
    Ok(table)
}

/// Time of the updates after a cut.
fn costs(runs: &[Run]) -> Table {
    let mut table = table([
        "",
        "frames with a cut",
        "tets cut in them",
        "cluster µs a cut tet",
        "color µs a cut tet",
        "cluster + color ms (median)",
        "the largest",
        "of the time to solve",
        "re-clustered",
        "all frames ms",
    ]);
    for run in runs {
        let cutting = || {
            let cut = |report: &&FrameReport| report.cut.is_some();
            run.reports.iter().filter(cut)
        };
        let frames = cutting().count();
        let tets = cutting().filter_map(|report| report.cut);
        let tets = tets.map(|cut| cut.tets_cut).sum::<usize>() as f64;
        let cluster: f64 = cutting().map(|report| report.ms.cluster).sum();
        let color: f64 = cutting().map(|report| report.ms.color).sum();
        let both = || cutting().map(|report| report.ms.cluster + report.ms.color);
        let solve: f64 = cutting().map(|report| report.ms.solve).sum();
        let total: f64 = run.reports.iter().map(|report| report.ms.total).sum();
        table.add_row([
            run.name.to_owned(),
            frames.to_string(),
            format!("{:.1}", tets / frames as f64),
            format!("{:.2}", 1e3 * cluster / tets),
            format!("{:.2}", 1e3 * color / tets),
            format!("{:.3}", median(both())),
            format!("{:.3}", both().fold(0.0, f64::max)),
            format!("{:.3}", (cluster + color) / solve),
            count(run.reports.iter().map(|report| report.reclustered)),
            format!("{total:.0}"),
        ]);
    }
    table
}

fn count(numbers: impl Iterator<Item = usize>) -> String {
    numbers.sum::<usize>().to_string()
}
