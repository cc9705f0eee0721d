//! Measures this solver on the beam of the scripts in their way.
//!
//! The beam is 1 m by 0.25 by 0.25 of Kuhn cubes, E = 1e6 Pa, Poisson's ratio 0.45, 1000 kg/m³, fixed at one end, with
//! gravity, in substeps of 1/1200 s. The time of an iteration is a third of the difference between a substep with four
//! iterations and one with one, the fastest of each, which excludes prediction and velocities; a frame is 20 substeps
//! of one iteration.

use std::time::Instant;

use incise::graph::Schedule;
use incise::mesh::glam::DVec3;
use incise::mesh::kuhn_box;
use incise::scene::Precision;
use incise::xpbd::{Material, Real, Solver, StepSettings};
use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};

use crate::solver::body::{body, schedule};

const SUBSTEPS: u32 = 20;

/// Times of this solver.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Ours {
    pub(super) tets: usize,
    pub(super) colors: usize,
    pub(super) ms_per_iter: f64,
    pub(super) ms_frame: f64,
}

/// Measures this solver with the clusters and the form that scenes have by default.
pub(super) fn ours(cells: [usize; 3], frames: u32, precision: Precision) -> anyhow::Result<Ours> {
    match precision {
        Precision::F64 => in_precision::<f64>(cells, frames),
        _ => in_precision::<f32>(cells, frames),
    }
}

fn in_precision<R: Real>(cells: [usize; 3], frames: u32) -> anyhow::Result<Ours> {
    let mesh = kuhn_box(cells, DVec3::new(1.0, 0.25, 0.25));
    let rubber = Material {
        young_modulus: 1e6,
        poisson_ratio: 0.45,
        density: 1000.0,
        damping: 0.0,
    };
    let held = mesh
        .positions
        .iter()
        .map(|x| x.x)
        .fold(f64::INFINITY, f64::min)
        + 1e-9;
    let mut solver = body::<R>(&mesh, rubber, |x| x.x < held)?;
    let schedule = schedule(&mesh, "pressure:10")?;
    let substep = StepSettings {
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(1.0 / 60.0 / f64::from(SUBSTEPS))
    };
    let four = StepSettings {
        iterations: 4,
        ..substep.clone()
    };
    let frame = StepSettings {
        time_step: 1.0 / 60.0,
        substeps: SUBSTEPS,
        ..substep.clone()
    };
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        let one = fastest(&mut solver, &schedule, &substep, 10 * frames)?;
        let four = fastest(&mut solver, &schedule, &four, 10 * frames)?;
        let ms_frame = fastest(&mut solver, &schedule, &frame, frames)?;
        Ok(Ours {
            tets: mesh.tets.len(),
            colors: schedule.color_count(),
            ms_per_iter: (four - one) / 3.0,
            ms_frame,
        })
    })
}

/// Fastest of some steps in ms, after two warm-up steps.
fn fastest<R: Real>(
    solver: &mut Solver<R>,
    schedule: &Schedule,
    settings: &StepSettings,
    steps: u32,
) -> anyhow::Result<f64> {
    let mut best = f64::INFINITY;
    for step in 0..steps + 2 {
        let start = Instant::now();
        solver.step(schedule, settings)?;
        if step >= 2 {
            best = best.min(1e3 * start.elapsed().as_secs_f64());
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The beam has as many tets as that of the scripts.
    #[test]
    fn the_beam_is_that_of_the_scripts() {
        for precision in [Precision::F32, Precision::F64] {
            let ours = ours([16, 4, 4], 1, precision).unwrap();
            assert_eq!(ours.tets, 1536);
            assert!(ours.colors > 1 && ours.ms_frame > 0.0);
        }
    }
}
