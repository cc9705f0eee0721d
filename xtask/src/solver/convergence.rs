//! Iterations and milliseconds to a residual, by method: the paper's Table 3 with a force residual.
//!
//! One implicit step of a liver that hangs by one end, from rest, with the paper's material and time step, once at
//! organ size and once at a size where the step is well-posed (kappa at most 0.5). The residual is the unbalanced
//! force, `‖M (x - x̃) / Δt² + ∇U(x)‖`, over the weight `‖M g‖`: it is 1 at the start. XPBD omits a part of the
//! equations, so its residual stops at a floor, which the table shows.

use std::time::Instant;

use comfy_table::Table;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, ImplicitStep, Material, Method, Solver,
    StepSettings, TetSolve, VbdSettings,
};

use super::body::{body, scaled, schedule, stars};
use crate::table;

/// The paper's, of which it names the first two; its density is not given, nor the size of its meshes.
const PAPER: Material = Material {
    young_modulus: 1e7,
    poisson_ratio: 0.49,
    density: 1000.0,
    damping: 0.0,
};
/// The paper's time step in s.
const TIME_STEP: f64 = 0.016;
const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
/// Target residuals of the table.
const TARGETS: [f64; 4] = [0.5, 0.1, 0.05, 0.01];

/// Runs of XPBD of which the fastest counts.
const TIMINGS: usize = 3;

/// A residual on the way, after some iterations and milliseconds.
struct Point {
    iterations: u32,
    ms: f64,
    residual: f64,
    /// Residual that XPBD iterates on.
    dual: Option<f64>,
}

pub(crate) fn convergence(mesh: &TetMesh, quick: bool) -> anyhow::Result<String> {
    let mut text = String::from("## Convergence within a step\n\n");
    for size in [0.2, well_posed_size(mesh)?] {
        let mesh = scaled(mesh, size);
        let kappa = hanging(&mesh)?.kappa(TIME_STEP);
        let runs = runs(&mesh, quick)?;
        text += &format!(
            "{} tets, {size:.3} m long, density 1000 kg/m³, E = 1e7 Pa, Poisson's ratio 0.49, step 16 ms, double precision, \
             {} threads: kappa up to {kappa:.3}. Iterations and milliseconds to a residual:\n\n{}\n\n\
             Residual after as many iterations, or rounds of two sweeps and a correction:\n\n{}\n\n",
            mesh.tets.len(),
            rayon::current_num_threads(),
            summary(&runs),
            curves(&runs),
        );
    }
    Ok(text)
}

/// The length in m at which the largest kappa of a tet is 0.5.
fn well_posed_size(mesh: &TetMesh) -> anyhow::Result<f64> {
    let kappa = hanging(&scaled(mesh, 1.0))?.kappa(TIME_STEP);
    Ok((kappa / 0.5).sqrt())
}

/// The body, held where x is smallest.
fn hanging(mesh: &TetMesh) -> anyhow::Result<Solver<f64>> {
    let length = mesh.positions.iter().map(|x| x.x).fold(0.0, f64::max);
    body(mesh, PAPER, |x| x.x < 0.05 * length)
}

/// All methods with their residuals.
fn runs(mesh: &TetMesh, quick: bool) -> anyhow::Result<Vec<(String, Vec<Point>)>> {
    let mut runs = Vec::new();
    let most = if quick { 20 } else { 2048 };
    let plain = StepSettings {
        gravity: Some(GRAVITY),
        ..StepSettings::new(TIME_STEP)
    };
    let paper = StepSettings {
        tet_solve: TetSolve::Sequential,
        relaxation: 0.8,
        ..plain.clone()
    };
    for size in [1, 5, 10, 15, 20, 25] {
        let name = format!("Gauss-Seidel, paper's form, clusters of {size}");
        runs.push((name, xpbd(mesh, &format!("serial:{size}"), &paper, most)?));
    }
    for relaxation in [1.0, 0.8, 0.2] {
        let settings = StepSettings {
            relaxation,
            ..plain.clone()
        };
        let name = format!("Gauss-Seidel, block form, clusters of 10, relaxation {relaxation}");
        runs.push((name, xpbd(mesh, "serial:10", &settings, most)?));
    }
    let jacobi = StepSettings {
        method: Method::Jacobi,
        relaxation: 0.1,
        ..paper.clone()
    };
    let name = "Jacobi, paper's form, relaxation 0.1".to_owned();
    runs.push((name, xpbd(mesh, "none", &jacobi, most)?));
    for spectral_radius in [0.9, 0.99, 0.999] {
        let settings = StepSettings {
            method: Method::Chebyshev {
                spectral_radius,
                chebyshev_start: 10,
            },
            ..jacobi.clone()
        };
        let name = format!("Chebyshev, the same, spectral radius {spectral_radius}");
        runs.push((name, xpbd(mesh, "none", &settings, most)?));
    }
    for relaxation in [1.0, 1.9] {
        let name = format!("vbd, relaxation {relaxation}");
        runs.push((name, vbd(mesh, relaxation, most)?));
    }
    let name = "vbd with coarse correction".to_owned();
    runs.push((name, corrected(mesh, 8)?));
    Ok(runs)
}

fn summary(runs: &[(String, Vec<Point>)]) -> Table {
    let mut table = table([
        "method",
        "to 0.5",
        "to 0.1",
        "to 0.05",
        "to 0.01",
        "smallest residual",
        "dual at the end",
    ]);
    for (name, points) in runs {
        let reached = |target: f64| {
            let point = points.iter().find(|p| p.residual <= target);
            point.map_or("never".to_owned(), |p| {
                format!("{}, {:.2} ms", p.iterations, p.ms)
            })
        };
        let least = points.iter().map(|p| p.residual);
        let least = least.fold(f64::INFINITY, f64::min);
        let dual = points.last().and_then(|p| p.dual);
        let mut row = vec![name.clone()];
        row.extend(TARGETS.map(reached));
        row.push(format!("{least:.1e}"));
        row.push(dual.map_or(String::new(), number));
        table.add_row(row);
    }
    table
}

fn curves(runs: &[(String, Vec<Point>)]) -> Table {
    let counts = [1, 2, 4, 8, 16, 64, 256, 1024, 2048];
    let mut table = table([
        "method", "1", "2", "4", "8", "16", "64", "256", "1024", "2048",
    ]);
    for (name, points) in runs {
        let mut row = vec![name.clone()];
        row.extend(counts.map(|count| {
            let point = points.iter().find(|p| p.iterations == count);
            point.map_or(String::new(), |p| number(p.residual))
        }));
        table.add_row(row);
    }
    table
}

/// Formats a number; a value that is not finite has diverged.
fn number(value: f64) -> String {
    if value < 1e100 {
        format!("{value:.1e}")
    } else {
        "diverged".to_owned()
    }
}

/// One, two, three, four, six, eight, twelve, ... up to `most`.
fn checkpoints(most: u32) -> Vec<u32> {
    let powers = (0..).map(|k| 1 << k);
    let both = powers.flat_map(|power: u32| [power, power + power / 2]);
    let mut points: Vec<u32> = both.take_while(|&k| k <= most).collect();
    points.dedup();
    points
}

/// Runs XPBD for each number of iterations from the start: for the time, and again for the residual.
fn xpbd(
    mesh: &TetMesh,
    clustering: &str,
    settings: &StepSettings,
    most: u32,
) -> anyhow::Result<Vec<Point>> {
    let schedule = schedule(mesh, clustering)?;
    let mut points = Vec::new();
    for iterations in checkpoints(most) {
        let settings = StepSettings {
            iterations,
            ..settings.clone()
        };
        let mut ms = f64::INFINITY;
        for _ in 0..TIMINGS {
            let mut timed = hanging(mesh)?;
            // The first step reorders the tets.
            timed.step(&schedule, &StepSettings::new(1e-9))?;
            let start = Instant::now();
            timed.step(&schedule, &settings)?;
            ms = ms.min(start.elapsed().as_secs_f64() * 1e3);
        }
        let mut solver = hanging(mesh)?;
        solver.step_keeping_residuals(&schedule, &settings)?;
        let residuals = solver.residuals(TIME_STEP).expect("they were kept");
        points.push(Point {
            iterations,
            ms,
            residual: residuals.force / solver.load(GRAVITY),
            dual: Some(residuals.dual),
        });
    }
    Ok(points)
}

fn vbd(mesh: &TetMesh, relaxation: f64, most: u32) -> anyhow::Result<Vec<Point>> {
    let mut solver = hanging(mesh)?;
    let weight = solver.load(GRAVITY);
    let mut stars = stars(&solver)?;
    let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings(relaxation))?;
    let (mut ms, mut made, mut points) = (0.0, 0, Vec::new());
    for iterations in checkpoints(most) {
        let start = Instant::now();
        (made..iterations).for_each(|_| step.sweep());
        ms += start.elapsed().as_secs_f64() * 1e3;
        made = iterations;
        points.push(Point {
            iterations,
            ms,
            residual: step.residual() / weight,
            dual: None,
        });
    }
    let _ = step.finish();
    Ok(points)
}

/// Rounds of two sweeps and a correction.
fn corrected(mesh: &TetMesh, rounds: u32) -> anyhow::Result<Vec<Point>> {
    let mut solver = hanging(mesh)?;
    let weight = solver.load(GRAVITY);
    let mut stars = stars(&solver)?;
    let mut correction = CoarseCorrection::new(&stars, CoarseCorrectionSettings::default())?;
    let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings(1.5))?;
    let (mut ms, mut points) = (0.0, Vec::new());
    for iterations in 1..=rounds {
        let start = Instant::now();
        step.sweep();
        step.sweep();
        step.correct(&mut correction);
        ms += start.elapsed().as_secs_f64() * 1e3;
        points.push(Point {
            iterations,
            ms,
            residual: step.residual() / weight,
            dual: None,
        });
    }
    let _ = step.finish();
    Ok(points)
}

fn settings(relaxation: f64) -> VbdSettings {
    let mut settings = VbdSettings::new(TIME_STEP, 1);
    settings.step.gravity = Some(GRAVITY);
    settings.step.relaxation = relaxation;
    settings
}
