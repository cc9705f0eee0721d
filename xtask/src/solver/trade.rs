//! What accuracy costs: errors of a falling beam beside milliseconds per frame, by method.
//!
//! All methods move the same tets, so what the mesh itself does wrong (locking) does not count. They take turns for
//! some rounds, and each frame counts with its fastest time: on a machine that does other things as well this is the
//! figure that changes least, and its ratios mean more than it does. One thread.

use comfy_table::Table;
use incise::xpbd::{DescentSettings, Form, Method, StepSettings};
use rayon::prelude::*;

use super::beam::{Beam, Difference, FRAME, GRAVITY, Motion};
use super::rest::at_rest;
use super::runner::Recipe;
use crate::table;

/// What moves the beam.
enum Mover {
    Solver(Recipe),
    /// The reference with some steps a frame.
    Newton(u32),
}

pub(crate) fn trade(quick: bool) -> anyhow::Result<String> {
    let ratios: &[f64] = if quick { &[0.3] } else { &[0.3, 0.45, 0.49] };
    let beams: Vec<Beam> = ratios.iter().map(|&nu| Beam::new(nu, quick)).collect();
    let limits: Vec<(Motion, Difference)> = beams
        .par_iter()
        .map(|beam| beam.limit(if quick { 2 } else { 8 }))
        .collect::<anyhow::Result<_>>()?;
    let mut text = String::from("## Speed and accuracy\n\n");
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for (beam, (limit, left)) in beams.iter().zip(&limits) {
        let rows = alone.install(|| rows(beam, limit, quick))?;
        text += &format!(
            "{} tets, E = 1e6 Pa, Poisson's ratio {}. The tip sinks by {:.3} m; the reference is within {:.1e} % of that and {:.1e} % of the volume.\n\n{rows}\n\n",
            beam.mesh.tets.len(),
            beam.material.poisson_ratio,
            beam.deflection(limit),
            left.tip,
            left.volume,
        );
    }
    Ok(text + &at_rest(quick)?)
}

fn rows(beam: &Beam, limit: &Motion, quick: bool) -> anyhow::Result<Table> {
    let movers = movers();
    let mut best: Vec<[Option<Measured>; 2]> = movers.iter().map(|_| [None, None]).collect();
    for _ in 0..if quick { 1 } else { 4 } {
        for ((_, mover), best) in movers.iter().zip(&mut best) {
            match mover {
                Mover::Solver(recipe) => {
                    keep(&mut best[0], beam, limit, &beam.run::<f32>(recipe)?);
                    keep(&mut best[1], beam, limit, &beam.run::<f64>(recipe)?);
                }
                Mover::Newton(substeps) => {
                    keep(&mut best[1], beam, limit, &beam.newton(*substeps)?);
                }
            }
        }
    }
    let mut table = table([
        "method",
        "kappa",
        "ms per frame, f32",
        "f64",
        "error of the tip in %, f32",
        "f64",
        "error of the volume in %, f32",
        "f64",
    ]);
    let solver = beam.solver::<f64>()?;
    for ((name, mover), best) in movers.iter().zip(&best) {
        let time = match mover {
            Mover::Solver(recipe) => recipe.substep_time(),
            Mover::Newton(substeps) => FRAME / f64::from(*substeps),
        };
        let [single, double] = best.each_ref().map(Measured::cells);
        let [a, b, c] = single;
        let [d, e, f] = double;
        let kappa = digits(solver.kappa(time));
        table.add_row([name.clone(), kappa, a, d, b, e, c, f]);
    }
    Ok(table)
}

struct Measured {
    /// The fastest time of each frame in s.
    times: Vec<f64>,
    error: Difference,
}

impl Measured {
    /// Milliseconds per frame, error of the tip, error of the volume.
    fn cells(measured: &Option<Self>) -> [String; 3] {
        let Some(Self { times, error }) = measured else {
            return [const { String::new() }; 3];
        };
        let ms = 1e3 * times.iter().sum::<f64>() / times.len() as f64;
        [ms, error.tip, error.volume].map(digits)
    }
}

/// The motion is the same each time; only the times differ.
fn keep(best: &mut Option<Measured>, beam: &Beam, limit: &Motion, motion: &Motion) {
    match best {
        Some(best) => {
            for (time, &other) in best.times.iter_mut().zip(&motion.times) {
                *time = time.min(other);
            }
        }
        None => {
            *best = Some(Measured {
                times: motion.times.clone(),
                error: beam.difference(motion, limit),
            });
        }
    }
}

/// Two or three digits, up to five before the point.
pub(crate) fn digits(value: f64) -> String {
    let places = match value.abs() {
        ..0.001 => return format!("{value:.1e}"),
        ..0.01 => 5,
        ..0.1 => 4,
        ..1.0 => 3,
        ..10.0 => 2,
        ..100.0 => 1,
        ..1e5 => 0,
        _ => return format!("{value:.1e}"),
    };
    format!("{value:.places$}")
}

fn movers() -> Vec<(String, Mover)> {
    let mut movers = Vec::new();
    let mut xpbd = |name: &str, clustering, settings: &StepSettings, counts: &[[u32; 2]]| {
        for &[substeps, iterations] in counts {
            let settings = StepSettings {
                substeps,
                iterations,
                ..settings.clone()
            };
            let recipe = Recipe::Xpbd {
                clustering,
                settings,
            };
            let name = format!("{name}, {substeps} x {iterations}");
            movers.push((name, Mover::Solver(recipe)));
        }
    };
    let block = StepSettings {
        gravity: Some(GRAVITY),
        ..StepSettings::new(FRAME)
    };
    let substeps = [1, 2, 5, 10, 20, 40, 80, 160, 320].map(|n| [n, 1]);
    xpbd("XPBD", "none", &block, &substeps);
    xpbd("XPBD", "none", &block, &[[1, 5], [1, 20], [1, 100]]);
    let both = [[20, 2], [20, 4], [40, 2], [40, 4], [80, 2]];
    xpbd("XPBD", "none", &block, &both);
    xpbd("XPBD, clusters of 10", "serial:10", &block, &[[20, 1]]);
    for (name, relaxation, counts) in [
        ("XPBD, relaxation 0.2", 0.2, [[1, 20], [20, 1]]),
        ("XPBD, relaxation 0.8", 0.8, [[1, 20], [20, 1]]),
        ("XPBD, relaxation 1.2", 1.2, [[1, 20], [20, 1]]),
    ] {
        let settings = StepSettings {
            relaxation,
            ..block.clone()
        };
        xpbd(name, "none", &settings, &counts);
    }
    let sequential = StepSettings {
        form: Form::Sequential,
        ..block.clone()
    };
    let few = [[20, 1], [80, 1], [320, 1]];
    xpbd("sequential form", "none", &sequential, &few);
    let paper = StepSettings {
        relaxation: 0.8,
        ..sequential.clone()
    };
    let name = "paper (sequential, relaxation 0.8, clusters of 10)";
    xpbd(name, "serial:10", &paper, &[[1, 20], [1, 100]]);
    let jacobi = StepSettings {
        method: Method::Jacobi,
        ..block.clone()
    };
    xpbd("Jacobi, relaxation 1", "none", &jacobi, &few);
    let jacobi = StepSettings {
        relaxation: 0.1,
        ..jacobi
    };
    let many = [[1, 20], [1, 100], [20, 20]];
    xpbd("Jacobi, relaxation 0.1", "none", &jacobi, &many);
    let chebyshev = StepSettings {
        method: Method::Chebyshev {
            spectral_radius: 0.9,
            delay: 10,
        },
        ..jacobi
    };
    let name = "Chebyshev, relaxation 0.1, spectral radius 0.9";
    xpbd(name, "none", &chebyshev, &many);
    for (substeps, iterations, relaxation) in [
        (1, 5, 1.0),
        (1, 20, 1.0),
        (1, 100, 1.0),
        (4, 5, 1.0),
        (4, 20, 1.0),
        (4, 100, 1.0),
        (1, 100, 1.9),
        (4, 100, 1.9),
    ] {
        let mut settings = DescentSettings::new(FRAME, iterations);
        settings.step = StepSettings {
            substeps,
            iterations,
            relaxation,
            ..block.clone()
        };
        let name = format!("descent, relaxation {relaxation}, {substeps} x {iterations}");
        movers.push((name, Mover::Solver(Recipe::Descent(settings))));
    }
    for (substeps, tolerance) in [(1, 1e-2), (1, 1e-4), (4, 1e-2), (16, 1e-2)] {
        let mut settings = DescentSettings::new(FRAME, 30);
        settings.step.substeps = substeps;
        settings.step.gravity = Some(GRAVITY);
        settings.tolerance = Some(tolerance);
        let name = format!("corrected descent to {tolerance:e}, substeps {substeps}");
        movers.push((name, Mover::Solver(Recipe::Corrected(settings))));
    }
    for substeps in [1, 4] {
        let name = format!("Newton, implicit Euler, steps {substeps}");
        movers.push((name, Mover::Newton(substeps)));
    }
    movers
}
