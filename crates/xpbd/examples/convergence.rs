//! Prints the convergence of VBD within one large step: residual and milliseconds, round by round.
//!
//! `cargo run --release -p incise-xpbd --example convergence -- [MESH] [gravity|stretch] [f32|f64] [ROUNDS]
//! [SWEEPS] [OMEGA] [AGGREGATE] [REDUCTION]`
//!
//! A body 0.2 m long of Young's modulus 1e7 Pa and Poisson's ratio 0.49, held where x is smallest, falls under gravity
//! or starts at twice its size; a step is 16 ms. Residuals are relative to the weight of the body or to the start. A
//! round is some sweeps and, unless AGGREGATE is 0, a correction. Without a mesh file the body is a box. Threads: those
//! of rayon (`RAYON_NUM_THREADS`).

#![expect(clippy::print_stdout, reason = "a program that prints a table")]

use std::error::Error;
use std::time::Instant;

use glam::DVec3;
use incise_graph::{Clustering, Schedule};
use incise_mesh::{TetId, TetMesh, kuhn_box};
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, ImplicitStep, Material, Real, Solver, VbdSettings,
    VertexStars,
};

const STUFF: Material = Material {
    young_modulus: 1e7,
    poisson_ratio: 0.49,
    density: 1000.0,
    damping: 0.0,
};
const TIME_STEP: f64 = 0.016;
const GRAVITY: f64 = 9.81;

/// What the command line says.
struct Plan {
    stretched: bool,
    rounds: usize,
    sweeps: usize,
    relaxation: f64,
    correction: CoarseCorrectionSettings,
}

fn body<R: Real>(mesh: &TetMesh) -> Result<Solver<R>, Box<dyn Error>> {
    let mut solver = Solver::new(&mesh.positions);
    let material = solver.add_material(STUFF)?;
    let mut masses = vec![0.0; mesh.positions.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        solver.push_tet(tet.map(|p| p.0), mesh.corners(TetId::new(t)), material);
        for p in tet {
            masses[p.index()] += STUFF.density * mesh.volume(TetId::new(t)) / 4.0;
        }
    }
    let left = mesh
        .positions
        .iter()
        .map(|x| x.x)
        .fold(f64::INFINITY, f64::min);
    for (p, mass) in masses.into_iter().enumerate() {
        solver.set_mass(p, mass);
        solver.set_fixed(p, mesh.positions[p].x < left + 0.01);
    }
    Ok(solver)
}

fn run<R: Real>(mesh: &TetMesh, plan: &Plan) -> Result<(), Box<dyn Error>> {
    let mut solver = body::<R>(mesh)?;
    let mut settings = VbdSettings::new(TIME_STEP, 1);
    settings.step.relaxation = plan.relaxation;
    let free: Vec<usize> = (0..solver.particle_count())
        .filter(|&p| !solver.is_fixed(p))
        .collect();
    if plan.stretched {
        free.iter()
            .for_each(|&p| solver.set_position(p, mesh.positions[p] * 2.0));
    } else {
        settings.step.gravity = Some(DVec3::NEG_Z * GRAVITY);
    }
    let weight = free
        .iter()
        .map(|&p| (GRAVITY * solver.mass(p)).powi(2))
        .sum::<f64>()
        .sqrt();

    let clock = Instant::now();
    let incidence = solver.star_incidence();
    let colored = incise_coloring::color("greedy".parse()?, &incidence, 0)?;
    let clusters = Clustering::none(incidence.constraint_count());
    let mut stars = VertexStars::new(&solver, &Schedule::new(&clusters, &colored.coloring))?;
    let mut correction = None;
    if plan.correction.aggregate > 0 {
        correction = Some(CoarseCorrection::new(&stars, plan.correction)?);
    }
    println!(
        "{} particles, {} pairs, {} colors, {} aggregates, made in {:.1} ms; kappa up to {:.0}",
        solver.particle_count(),
        stars.pair_count(),
        stars.color_count(),
        correction
            .as_ref()
            .map_or(0, CoarseCorrection::aggregate_count),
        clock.elapsed().as_secs_f64() * 1e3,
        solver.kappa(TIME_STEP),
    );
    let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings)?;
    let scale = if plan.stretched {
        step.residual()
    } else {
        weight
    };
    println!("round         ms   residual  potential/J  iterations");
    let mut time = 0.0;
    for round in 1..=plan.rounds {
        let clock = Instant::now();
        (0..plan.sweeps).for_each(|_| step.sweep());
        let report = correction
            .as_mut()
            .map(|correction| step.correct(correction));
        time += clock.elapsed().as_secs_f64() * 1e3;
        // Sweeps alone are many: they are shown at powers of two.
        if report.is_some() || round.is_power_of_two() || round == plan.rounds {
            let residual = step.residual() / scale;
            let iterations = report.map_or(0, |report| report.iterations);
            println!(
                "{round:5} {time:10.3}  {residual:.3e}    {:.3e}  {iterations}",
                step.potential()
            );
            if residual < 1e-6 {
                break;
            }
        }
    }
    step.finish();
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |k: usize, default: &'static str| arguments.get(k).map_or(default, |a| a);
    let mut mesh = match argument(0, "box") {
        "box" => kuhn_box([24, 10, 8], DVec3::new(24.0, 10.0, 8.0)),
        path => incise_mesh_io::read(path)?,
    };
    let ends = (DVec3::MAX, DVec3::MIN);
    let (low, high) = mesh
        .positions
        .iter()
        .fold(ends, |(l, h), &x| (l.min(x), h.max(x)));
    let scale = 0.2 / (high - low).max_element();
    mesh.positions.iter_mut().for_each(|x| *x *= scale);
    let plan = Plan {
        stretched: argument(1, "gravity") == "stretch",
        rounds: argument(3, "20").parse()?,
        sweeps: argument(4, "1").parse()?,
        relaxation: argument(5, "1.5").parse()?,
        correction: CoarseCorrectionSettings {
            aggregate: argument(6, "120").parse()?,
            reduction: argument(7, "0.01").parse()?,
            ..CoarseCorrectionSettings::default()
        },
    };
    match argument(2, "f64") {
        "f32" => run::<f32>(&mesh, &plan),
        _ => run::<f64>(&mesh, &plan),
    }
}
