//! `cargo xtask cutting`: cost of cuts by stage and mesh size, and effect of snapping.
//!
//! Costs: a blade sweeps through the middle of a body at rest in 60 frames, one thread, 20 Gauss-Seidel iterations per
//! frame; the table shows the stages next to the solve time of these frames. If the cost is proportional to the cut,
//! the cost per cut tet does not depend on the mesh. The stroke is repeated faster and slower: a frame of a slow one
//! cuts fewer tets.
//!
//! Snapping: five planes through the body one after another. More snapping makes fewer and better tets, which need
//! fewer substeps, and moves the cut surface to particles of the mesh.

use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::ensure;
use clap::Args;
use comfy_table::Table;
use incise::cutting::{
    CutOptions, CuttableMesh, FaceTag, PieceTracker, Plane, Skin, Sweep, cut_plane,
};
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::meshing::Shape;
use incise::scene::StrokeSpec;
use incise::{Scene, Simulation};

use crate::experiment::median;
use crate::models::{Model, models};
use crate::table;

/// Frames of the stroke.
const FRAMES: u32 = 60;

#[derive(Debug, Args)]
pub(crate) struct CuttingArguments {
    /// Small generated meshes only.
    #[arg(long)]
    quick: bool,
    /// Take the .vtk meshes of this folder instead of generated ones.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Tets of generated livers beside them.
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "100000,1000000"
    )]
    generated: Vec<usize>,
    /// Only the tables of a stroke by stages and by frames.
    #[arg(long)]
    stroke_only: bool,
    /// Write the tables to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn cutting(arguments: &CuttingArguments) -> anyhow::Result<()> {
    let mut models = models(arguments.models.as_deref(), usize::MAX, arguments.quick)?;
    if arguments.models.is_some() {
        let chosen = ["liver_11k", "liver_89k", "armadillo_227k"];
        models.retain(|model| chosen.contains(&model.name.as_str()));
    }
    if !arguments.quick {
        for tets in arguments.generated.iter().copied() {
            models.push(Model::generated(Shape::Liver, tets)?);
        }
    }
    let mut text = String::new();
    let [stages, frames] = stages(&models)?;
    writeln!(text, "## A stroke by stages\n\n{stages}\n")?;
    writeln!(text, "## Median and worst frame by size\n\n{frames}\n")?;
    let rest = if arguments.stroke_only {
        &[]
    } else {
        &models[..]
    };
    for model in rest.iter().take(1) {
        let table = speeds(model, arguments.quick)?;
        writeln!(
            text,
            "## A stroke by its speed, {}\n\n{table}\n",
            model.name
        )?;
    }
    if !rest.is_empty() {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let table = one.install(|| alone(rest))?;
        writeln!(text, "## Cutting by itself\n\n{table}\n")?;
    }
    for model in rest.iter().take(1) {
        writeln!(
            text,
            "## Snapping, {}\n\n{}\n",
            model.name,
            snapping(model)?
        )?;
    }
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// Blade above the body at the start, and its path through the body.
pub(crate) fn stroke(mesh: &TetMesh) -> ([DVec3; 2], DVec3) {
    let low = mesh.positions.iter().copied().reduce(DVec3::min);
    let high = mesh.positions.iter().copied().reduce(DVec3::max);
    let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
    let at = |x, y, z| low + (high - low) * DVec3::new(x, y, z);
    // Slightly tilted, so that it does not coincide with lattice planes.
    let blade = [at(0.48, -0.2, 1.02), at(0.493, 1.2, 1.02)];
    (blade, at(0.0, 0.0, 0.0) - at(0.0, 0.0, 1.04))
}

/// Cost of a stroke through the middle of a body in a number of frames.
struct Cost {
    cut_tets: usize,
    cutting_frames: usize,
    /// Microseconds per cut tet: cut, cluster, color, schedule.
    stages: [f64; 4],
    /// Median in ms.
    solve: f64,
    /// Median of all stages in ms.
    follow: f64,
    /// Largest ratio of a frame's cutting to the median solve time.
    largest: f64,
    /// Frame with the largest sum of stages in ms: cut, cluster, color, schedule.
    worst: [f64; 4],
    /// Frames with the blade beside the body, in ms: the first one, then the median and the largest of the others.
    air: [f64; 3],
}

impl Cost {
    fn measure(model: &Model, frames: u32) -> anyhow::Result<Self> {
        let mut scene = Scene::built_in();
        scene.contact = None;
        scene.world = incise::scene::WorldSpec::default();
        model.put_into(&mut scene.body[0]);
        scene.solver.substeps = 1.into();
        scene.solver.iterations = 20;
        let scale = scene.body[0].scale;
        let (blade, way) = stroke(&model.mesh);
        scene.stroke = vec![StrokeSpec::sweep(
            [1, 1 + u64::from(frames)],
            blade.map(|x| (x * scale).to_array()).to_vec(),
            vec![[0.0; 3], (way * scale).to_array()],
        )];
        let mut simulation = Simulation::with_threads(&scene, 1)?;
        let (mut sums, mut cut_tets) = ([0.0; 4], 0);
        let (mut solves, mut follows) = (Vec::new(), Vec::new());
        let (mut worst, mut air) = ([0.0; 4], Vec::new());
        for frame in 0..frames + 2 {
            let report = simulation.step()?;
            let ms = report.ms;
            let parts = [ms.cut, ms.cluster, ms.color, ms.schedule];
            let Some(cut) = report.cut else {
                if (1..=frames).contains(&frame) {
                    air.push(parts.iter().sum::<f64>());
                }
                continue;
            };
            for (sum, part) in sums.iter_mut().zip(parts) {
                *sum += part;
            }
            cut_tets += cut.tets_cut;
            let follow: f64 = parts.iter().sum();
            if follow > worst.iter().sum() {
                worst = parts;
            }
            solves.push(ms.solve);
            follows.push(follow);
        }
        simulation.check()?;
        ensure!(cut_tets > 0, "the blade missed {}", model.name);
        ensure!(!air.is_empty(), "the blade starts in {}", model.name);
        let others = air.split_off(1);
        let solve = median(solves.iter().copied());
        Ok(Self {
            cut_tets,
            cutting_frames: solves.len(),
            stages: sums.map(|sum| 1e3 * sum / cut_tets as f64),
            solve,
            follow: median(follows),
            largest: worst.iter().sum::<f64>() / solve,
            worst,
            air: [
                air[0],
                median(others.iter().copied()),
                others.iter().copied().fold(0.0, f64::max),
            ],
        })
    }
}

/// Stages of the frames that cut, in microseconds per cut tet; median and worst frame against the solve time.
fn stages(models: &[Model]) -> anyhow::Result<[Table; 2]> {
    let mut stages = table([
        "mesh",
        "tets",
        "tets cut",
        "cut µs a tet",
        "cluster",
        "color",
        "schedule",
        "in all",
    ]);
    let mut frames = table([
        "mesh",
        "tets",
        "solve ms (median)",
        "cut to layout ms (median)",
        "of the solve time",
        "worst frame ms",
        "of the solve time",
        "cut, cluster, color, schedule and layout",
        "first frame, blade outside ms",
        "blade outside ms (median)",
        "the largest",
    ]);
    for model in models {
        let cost = Cost::measure(model, FRAMES)?;
        frames.add_row([
            model.name.clone(),
            model.mesh.tets.len().to_string(),
            format!("{:.3}", cost.solve),
            format!("{:.3}", cost.follow),
            format!("{:.1} %", 100.0 * cost.follow / cost.solve),
            format!("{:.3}", cost.worst.iter().sum::<f64>()),
            format!("{:.1} %", 100.0 * cost.largest),
            cost.worst.map(|ms| format!("{ms:.2}")).join(", "),
            format!("{:.3}", cost.air[0]),
            format!("{:.3}", cost.air[1]),
            format!("{:.3}", cost.air[2]),
        ]);
        let mut row = vec![
            model.name.clone(),
            model.mesh.tets.len().to_string(),
            cost.cut_tets.to_string(),
        ];
        let all: f64 = cost.stages.iter().sum();
        row.extend(
            cost.stages
                .iter()
                .chain([&all])
                .map(|us| format!("{us:.2}")),
        );
        stages.add_row(row);
    }
    Ok([stages, frames])
}

/// Measures a stroke at different speeds.
fn speeds(model: &Model, quick: bool) -> anyhow::Result<Table> {
    let mut table = table([
        "frames of the stroke",
        "cm a second at 60 frames a second",
        "tets cut a frame",
        "cut to schedule, µs a tet",
        "cut to schedule, ms (median)",
        "solve ms (median)",
        "share of solving",
        "largest share of a frame",
    ]);
    let mut scene = Scene::built_in();
    scene.contact = None;
    model.put_into(&mut scene.body[0]);
    let length = stroke(&model.mesh).1.length() * scene.body[0].scale;
    let all = [15, 30, FRAMES, 120, 240, 480];
    for &frames in if quick { &all[1..3] } else { &all[..] } {
        let cost = Cost::measure(model, frames)?;
        table.add_row([
            frames.to_string(),
            format!("{:.1}", 100.0 * length * 60.0 / f64::from(frames)),
            format!("{:.1}", cost.cut_tets as f64 / cost.cutting_frames as f64),
            format!("{:.2}", cost.stages.iter().sum::<f64>()),
            format!("{:.3}", cost.follow),
            format!("{:.3}", cost.solve),
            format!("{:.1} %", 100.0 * cost.follow / cost.solve),
            format!("{:.1} %", 100.0 * cost.largest),
        ]);
    }
    Ok(table)
}

/// The cutting crate alone: the swept blade, a plane cut, and updates by their deltas.
fn alone(models: &[Model]) -> anyhow::Result<Table> {
    let mut table = table([
        "mesh",
        "tets cut by the blade",
        "blade µs a tet",
        "frame ms (mean)",
        "frame without a cut ms",
        "pieces µs a tet",
        "skin µs a tet",
        "undo µs a tet",
        "tets cut by the plane",
        "plane µs a tet",
    ]);
    for model in models {
        let base = CuttableMesh::new(model.mesh.clone())?;
        let (blade, way) = stroke(&model.mesh);
        let mut body = base.clone();
        let mut positions = body.mesh().positions.clone();
        let mut sweep = Sweep::new(&body, &positions, &blade, CutOptions::default())?;
        let (mut pieces, mut skin) = (PieceTracker::new(&body), Skin::new(body.boundary()));
        let (mut cut_tets, mut seconds) = (0, [0.0; 4]);
        let mut deltas = Vec::new();
        for frame in 1..=FRAMES {
            let offset = way * (f64::from(frame) / f64::from(FRAMES));
            let pose = blade.map(|x| x + offset);
            let start = Instant::now();
            let delta = sweep.advance(&mut body, &positions, &pose)?;
            seconds[0] += start.elapsed().as_secs_f64();
            delta.extend_particles(&mut positions);
            let start = Instant::now();
            pieces.apply_delta(&body, &delta);
            seconds[1] += start.elapsed().as_secs_f64();
            let start = Instant::now();
            skin.apply_delta(&delta);
            seconds[2] += start.elapsed().as_secs_f64();
            cut_tets += delta.removed.len();
            deltas.push(delta);
        }
        // Repeated at the blade's last position: nothing is left to cut.
        let last = blade.map(|x| x + way);
        let start = Instant::now();
        ensure!(sweep.advance(&mut body, &positions, &last)?.is_empty());
        let idle = start.elapsed().as_secs_f64();
        let start = Instant::now();
        for delta in deltas.iter().rev() {
            body.undo(delta)?;
        }
        seconds[3] = start.elapsed().as_secs_f64();
        ensure!(
            body.mesh() == base.mesh(),
            "undone, the mesh is what it was"
        );

        let plane = Plane {
            point: blade[0],
            normal: (blade[1] - blade[0]).cross(way),
        };
        let mut halves = base.clone();
        let start = Instant::now();
        let options = CutOptions::default();
        let delta = cut_plane(&mut halves, &model.mesh.positions, &plane, &options)?;
        let at_once = start.elapsed().as_secs_f64();
        let micro =
            |seconds: f64, tets: usize| format!("{:.2}", 1e6 * seconds / tets.max(1) as f64);
        table.add_row([
            model.name.clone(),
            cut_tets.to_string(),
            micro(seconds[0], cut_tets),
            format!("{:.3}", 1e3 * seconds[0] / f64::from(FRAMES)),
            format!("{:.3}", 1e3 * idle),
            micro(seconds[1], cut_tets),
            micro(seconds[2], cut_tets),
            micro(seconds[3], cut_tets),
            delta.removed.len().to_string(),
            micro(at_once, delta.removed.len()),
        ]);
    }
    Ok(table)
}

/// Effects of snapping.
fn snapping(model: &Model) -> anyhow::Result<Table> {
    let mut table = table([
        "snap",
        "tets cut",
        "tets each became",
        "tets after",
        "pieces",
        "smallest dihedral",
        "largest dihedral",
        "worst volume ratio",
        "substeps times",
        "cut face from its plane (largest, in edges)",
    ]);
    let rest = &model.mesh;
    let low = rest.positions.iter().copied().reduce(DVec3::min);
    let high = rest.positions.iter().copied().reduce(DVec3::max);
    let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
    let edge = mean_edge(rest);
    let before = smallest_altitude(rest);
    for snap in [0.0, 0.01, 0.05, 0.1, 0.15, 0.2, 0.25] {
        let mut body = CuttableMesh::new(rest.clone())?;
        let (mut cut, mut made, mut worst) = (0, 0, 1.0_f64);
        let (mut dihedral, mut farthest) = ([180.0_f64, 0.0_f64], 0.0_f64);
        let planes = [
            ([0.5, 0.5, 0.5], [1.0, 0.1, 0.2]),
            ([0.5, 0.5, 0.45], [0.1, 0.2, 1.0]),
            ([0.45, 0.5, 0.5], [0.2, 1.0, -0.1]),
            ([0.35, 0.5, 0.5], [1.0, 0.8, 0.1]),
            ([0.6, 0.5, 0.5], [1.0, -0.5, 0.7]),
        ];
        for (tag, (at, normal)) in (0..).zip(planes) {
            let plane = Plane {
                point: low + (high - low) * DVec3::from_array(at),
                normal: DVec3::from_array(normal),
            };
            let options = CutOptions {
                snap,
                tag,
                ..CutOptions::default()
            };
            let positions = body.mesh().positions.clone();
            let delta = cut_plane(&mut body, &positions, &plane, &options)?;
            cut += delta.removed.len();
            made += delta.added.len();
            worst = worst.min(delta.worst_volume_ratio);
            if let Some([least, most]) = delta.dihedral {
                dihedral = [dihedral[0].min(least), dihedral[1].max(most)];
            }
            let unit = plane.unit_normal()?;
            for triangle in delta
                .surface_added
                .iter()
                .filter(|t| t.tag == FaceTag::Cut(tag))
            {
                for p in triangle.particles {
                    let off = unit
                        .dot(body.mesh().positions[p.index()] - plane.point)
                        .abs();
                    farthest = farthest.max(off);
                }
            }
        }
        body.check()?;
        // Kappa is proportional to the inverse square of the smallest altitude, the number of substeps to the root of
        // kappa.
        let substeps = before / smallest_altitude(body.mesh());
        table.add_row([
            format!("{snap}"),
            cut.to_string(),
            format!("{:.2}", made as f64 / cut.max(1) as f64),
            body.mesh().tets.len().to_string(),
            body.mesh().pieces().count.to_string(),
            format!("{:.4}°", dihedral[0]),
            format!("{:.2}°", dihedral[1]),
            format!("{worst:.1e}"),
            format!("{substeps:.1}"),
            format!("{:.3}", farthest / edge),
        ]);
    }
    Ok(table)
}

fn smallest_altitude(mesh: &TetMesh) -> f64 {
    mesh.quality().min_altitude
}

fn mean_edge(mesh: &TetMesh) -> f64 {
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let mut sum = 0.0;
    for tet in &mesh.tets {
        for (i, j) in pairs {
            sum += mesh.positions[tet[i].index()].distance(mesh.positions[tet[j].index()]);
        }
    }
    sum / (6 * mesh.tets.len()).max(1) as f64
}
