//! Cost of a Gauss-Seidel pass: nanoseconds per tet and milliseconds per iteration, on one thread and on two.
//!
//! A beam of Kuhn cubes, 1 m by 0.25 by 0.25, of 11,520 or 92,160 tets, E = 1e6 Pa, Poisson's ratio 0.45, fixed at one
//! end and swinging, and the livers. The time is that of one frame of 20 substeps of one iteration, the fastest of many,
//! over the number of tets and substeps; it includes prediction and velocities.

use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use comfy_table::Table;
use incise::mesh::glam::DVec3;
use incise::mesh::{TetMesh, kuhn_box};
use incise::mesh_io;
use incise::xpbd::{Material, Real, StepSettings, TetSolve};
use rayon::ThreadPoolBuilder;

use super::body::{body, scaled, schedule};
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

fn row<R: Real>(
    table: &mut Table,
    name: &str,
    mesh: &TetMesh,
    clusters: &str,
    tet_solve: TetSolve,
    quick: bool,
) -> anyhow::Result<()> {
    let schedule = schedule(mesh, clusters)?;
    let settings = StepSettings {
        substeps: SUBSTEPS,
        tet_solve,
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(1.0 / 240.0)
    };
    let mut solver = body::<R>(mesh, RUBBER, |x| x.x < 0.02)?;
    let pools = [1, 2].map(|threads| ThreadPoolBuilder::new().num_threads(threads).build());
    let mut best = [f64::INFINITY; 2];
    // In turn, so that other load of the machine affects both; several frames each, since threads that sleep while the
    // others work wake up on their cores.
    let (turns, frames) = if quick { (2, 1) } else { (4, 12) };
    for _ in 0..turns {
        for (pool, best) in pools.iter().zip(&mut best) {
            let pool = pool.as_ref().map_err(|error| anyhow::anyhow!("{error}"))?;
            for _ in 0..frames {
                let start = Instant::now();
                pool.install(|| solver.step(&schedule, &settings))?;
                let seconds = start.elapsed().as_secs_f64() / f64::from(SUBSTEPS);
                *best = best.min(seconds);
            }
        }
    }
    let tets = mesh.tets.len();
    let [one, two] = best;
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
