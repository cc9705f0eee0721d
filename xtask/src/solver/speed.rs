//! Cost of a Gauss-Seidel pass: nanoseconds per tet and milliseconds per iteration.
//!
//! One table compares bodies, clusters and forms on one thread and on two. A second compares frames on 1, 2, 4, ... threads,
//! up to the number of cores.
//!
//! A beam of Kuhn cubes, 1 m by 0.25 by 0.25, of 11,520 or 92,160 tets, E = 1e6 Pa, Poisson's ratio 0.45, fixed at one
//! end and swinging, and the livers. The time is that of one frame of 20 substeps of one iteration, the fastest of many,
//! over the number of tets and substeps; it includes prediction and velocities.

use std::path::Path;
use std::thread::available_parallelism;
use std::time::Instant;

use anyhow::Context;
use comfy_table::Table;
use incise::mesh::glam::DVec3;
use incise::mesh::{TetMesh, kuhn_box};
use incise::mesh_io;
use incise::meshing::Shape;
use incise::xpbd::{Material, Real, StepSettings, TetSolve};
use rayon::ThreadPoolBuilder;

use super::body::{body, scaled, schedule};
use crate::experiment::median;
use crate::models::Model;
use crate::table;

const SUBSTEPS: u32 = 20;
const RUBBER: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.45,
    density: 1000.0,
    damping: 0.0,
};

pub(crate) fn speed(liver: &TetMesh, models: Option<&Path>, quick: bool) -> anyhow::Result<String> {
    let beam = |cells| kuhn_box(cells, DVec3::new(1.0, 0.25, 0.25));
    let mut table = table([
        "body",
        "clusters",
        "colors",
        "form",
        "precision",
        "1 thread: ns a tet",
        "ms an iteration",
        "2 threads: ns a tet",
        "ms an iteration",
        "gain",
    ]);
    let small = if quick { [6, 2, 2] } else { [30, 8, 8] };
    let mut bodies = vec![("beam", beam(small)), ("liver", scaled(liver, 20.0))];
    if !quick {
        bodies.push(("beam", beam([60, 16, 16])));
        if let Some(models) = models {
            let path = models.join("liver_89k.vtk");
            let large = mesh_io::read(&path).with_context(|| path.display().to_string())?;
            bodies.push(("liver", scaled(&large, 20.0)));
        }
    }
    for (name, mesh) in &bodies {
        for clusters in ["none", "serial:10", "pressure:10"] {
            for form in [TetSolve::Split, TetSolve::Sequential] {
                row::<f32>(&mut table, name, mesh, clusters, form, quick)?;
                row::<f64>(&mut table, name, mesh, clusters, form, quick)?;
            }
        }
    }
    Ok(format!("## Speed of a pass\n\n{table}\n\n"))
}

fn settings(tet_solve: TetSolve) -> StepSettings {
    StepSettings {
        substeps: SUBSTEPS,
        tet_solve,
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(1.0 / 240.0)
    }
}

fn row<R: Real>(
    table: &mut Table,
    name: &str,
    mesh: &TetMesh,
    clusters: &str,
    tet_solve: TetSolve,
    quick: bool,
) -> anyhow::Result<()> {
    let schedule = schedule(mesh, clusters)?;
    let settings = settings(tet_solve);
    let mut solver = body::<R>(mesh, RUBBER, |x| x.x < 0.02)?;
    let best = times(&[1, 2], quick, || {
        Ok(solver.step(&schedule, &settings).map(drop)?)
    })?;
    let tets = mesh.tets.len();
    let [one, two] = [0, 1].map(|i| best[i].fastest / f64::from(SUBSTEPS) * 1e-3);
    let each = |seconds: f64| format!("{:.1}", seconds * 1e9 / tets as f64);
    table.add_row([
        format!("{name}, {tets} tets"),
        clusters.to_owned(),
        schedule.color_count().to_string(),
        format!("{tet_solve:?}").to_lowercase(),
        format!("f{}", 8 * size_of::<R>()),
        each(one),
        format!("{:.3}", one * 1e3),
        each(two),
        format!("{:.3}", two * 1e3),
        format!("{:.2}", one / two),
    ]);
    Ok(())
}

/// Milliseconds of a frame.
struct FrameTimes {
    fastest: f64,
    median: f64,
}

/// Times of a frame on teams of so many threads each.
///
/// The teams take turns, so that other load of the machine affects all; several frames each, since threads that sleep
/// while the others work wake up on their cores.
fn times(
    threads: &[usize],
    quick: bool,
    mut frame: impl FnMut() -> anyhow::Result<()> + Send,
) -> anyhow::Result<Vec<FrameTimes>> {
    let (turns, frames) = if quick { (2, 1) } else { (4, 12) };
    let mut teams = Vec::new();
    for &count in threads {
        let pool = ThreadPoolBuilder::new().num_threads(count).build()?;
        teams.push((pool, Vec::new()));
    }
    for _ in 0..turns {
        for (pool, all) in &mut teams {
            for _ in 0..frames {
                let start = Instant::now();
                pool.install(&mut frame)?;
                all.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let times = teams.into_iter().map(|(_, ms)| FrameTimes {
        fastest: ms.iter().copied().fold(f64::INFINITY, f64::min),
        median: median(ms),
    });
    Ok(times.collect())
}

/// Time of a frame by number of threads: 1, 2, 4 and on to the number of cores.
pub(crate) fn threads(models: Option<&Path>, quick: bool) -> anyhow::Result<String> {
    let cores = available_parallelism().map_or(1, usize::from);
    let counts: Vec<usize> = std::iter::successors(Some(1), |threads| Some(2 * threads))
        .take_while(|&threads| threads < cores)
        .chain([cores])
        .collect();
    let mut table = table([
        "body",
        "clusters",
        "colors",
        "threads",
        "ms a frame, fastest",
        "median",
        "ns a tet and substep, fastest",
        "median",
        "gain, fastest",
        "median",
    ]);
    let sizes: &[usize] = if quick {
        &[1_500, 3_000]
    } else {
        &[11_000, 118_000, 1_000_000]
    };
    let mut bodies = Vec::new();
    if let Some(models) = models {
        for name in ["liver_11k", "liver_89k", "sphere_118k", "armadillo_227k"] {
            bodies.push(Model::read(models.join(format!("{name}.vtk")))?);
        }
    } else {
        for &tets in sizes {
            bodies.push(Model::generated(Shape::Liver, tets)?);
        }
    }
    for Model { name, mesh, .. } in &bodies {
        let mesh = scaled(mesh, 1.0);
        for clusters in ["serial:10", "pressure:10"] {
            let schedule = schedule(&mesh, clusters)?;
            let settings = settings(TetSolve::Split);
            let mut solver = body::<f32>(&mesh, RUBBER, |x| x.x < 0.02)?;
            let frame = || Ok(solver.step(&schedule, &settings).map(drop)?);
            let times = times(&counts, quick, frame)?;
            let tets = mesh.tets.len();
            for (threads, time) in counts.iter().zip(&times) {
                let each = |ms: f64| format!("{:.2}", ms * 1e6 / f64::from(SUBSTEPS) / tets as f64);
                table.add_row([
                    format!("{name}, {tets} tets"),
                    clusters.to_owned(),
                    schedule.color_count().to_string(),
                    threads.to_string(),
                    format!("{:.3}", time.fastest),
                    format!("{:.3}", time.median),
                    each(time.fastest),
                    each(time.median),
                    format!("{:.2}", times[0].fastest / time.fastest),
                    format!("{:.2}", times[0].median / time.median),
                ]);
            }
        }
    }
    Ok(format!("## Threads\n\n{table}\n\n"))
}
