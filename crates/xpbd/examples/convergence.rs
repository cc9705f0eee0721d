//! How descent converges within one large step: residual and milliseconds, iteration by iteration.
//!
//! `cargo run --release -p incise-xpbd --example convergence -- [MESH] [gravity|stretch] [ROUNDS] [ω] [AGGREGATE] [CG] [REDUCTION] [SWEEPS]`
//!
//! A body 0.2 m long of Young's modulus 1e7 Pa and Poisson's ratio 0.49, held where x is smallest, falls under gravity
//! or starts at twice its size. A step is 16 ms, kappa tens of thousands. Without a mesh file it is a box.

#![expect(clippy::print_stdout, reason = "a program that prints a table")]
#![expect(clippy::unwrap_used, reason = "an example may end with a panic")]

use std::time::Instant;

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, Schedule};
use incise_mesh::{TetId, TetMesh, generate::kuhn_box, io};
use incise_xpbd::{
    Correction, CorrectionSettings, DescentSettings, ImplicitStep, Material, Real, Solver, Stars,
};

const STUFF: Material = Material {
    young_modulus: 1e7,
    poisson_ratio: 0.49,
    density: 1000.0,
    damping: 0.0,
};

fn body<R: Real>(mesh: &TetMesh) -> Solver<R> {
    let mut solver = Solver::new(&mesh.positions);
    let material = solver.add_material(STUFF).unwrap();
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
    solver
}

fn run<R: Real>(
    mesh: &TetMesh,
    case: &str,
    rounds: usize,
    relaxation: f64,
    corrections: CorrectionSettings,
    sweeps: usize,
) {
    let mut solver = body::<R>(mesh);
    let mut settings = DescentSettings::new(0.016, 1);
    settings.step.relaxation = relaxation;
    let load = if case == "stretch" {
        for (p, &x) in mesh.positions.iter().enumerate() {
            if !solver.is_fixed(p) {
                solver.set_position(p, x * 2.0);
            }
        }
        None
    } else {
        settings.step.gravity = Some(DVec3::NEG_Z * 9.81);
        let weights = (0..solver.particle_count())
            .filter(|&p| !solver.is_fixed(p))
            .map(|p| (9.81 * solver.mass(p)).powi(2));
        Some(weights.sum::<f64>().sqrt())
    };
    let incidence = solver.star_incidence();
    let colored = incise_coloring::color("greedy".parse().unwrap(), &incidence, 0).unwrap();
    let schedule = Schedule::new(
        &Clustering::none(incidence.constraint_count()),
        &colored.coloring,
    );
    let clock = Instant::now();
    let mut stars = Stars::new(&solver, &schedule).unwrap();
    println!(
        "{} particles, {} pairs, {} colors, stars in {:.2} ms, kappa {:.0}",
        solver.particle_count(),
        stars.pair_count(),
        stars.color_count(),
        clock.elapsed().as_secs_f64() * 1e3,
        solver.kappa(0.016)
    );
    let clock = Instant::now();
    let mut correction =
        (corrections.aggregate > 0).then(|| Correction::new(&stars, corrections).unwrap());
    if let Some(correction) = &correction {
        println!(
            "{} aggregates, correction in {:.2} ms",
            correction.aggregate_count(),
            clock.elapsed().as_secs_f64() * 1e3
        );
    }
    let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings).unwrap();
    let start = step.residual();
    let load = load.unwrap_or(start);
    let mut time = 0.0;
    let mut next = 1.0;
    let (mut seen2, mut seen4) = (false, false);
    for round in 1..=rounds {
        let clock = Instant::now();
        for _ in 0..sweeps {
            step.sweep();
        }
        let report = correction.as_mut().map(|c| step.correct(c));
        time += clock.elapsed().as_secs_f64() * 1e3;
        let show = round as f64 >= next;
        if show || round % 20 == 0 || report.is_some() {
            let r = step.residual() / load;
            let hit = (!seen2 && r < 1e-2) || (!seen4 && r < 1e-4);
            seen2 |= r < 1e-2;
            seen4 |= r < 1e-4;
            if show || hit || report.is_some() {
                println!(
                    "{round:6} {time:10.3} ms   residual {:.3e}  potential {:.6e}  {}",
                    r,
                    step.potential(),
                    report.map_or(String::new(), |r| format!(
                        "{} cg, part {}",
                        r.iterations, r.taken
                    ))
                );
                next *= 1.5;
            }
            if seen4 {
                break;
            }
        }
    }
    println!(
        "{:.4} ms a sweep, {:.1} ns a pair",
        time / rounds as f64,
        time * 1e6 / rounds as f64 / step_pairs(&incidence)
    );
}

fn step_pairs(incidence: &incise_graph::Incidence) -> f64 {
    incidence.values().len() as f64
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |k: usize, default: &str| arguments.get(k).cloned().unwrap_or(default.into());
    let mut mesh = match argument(0, "box").as_str() {
        "box" => kuhn_box([24, 10, 8], dvec3(24.0, 10.0, 8.0)),
        path => io::read(path).unwrap(),
    };
    let (low, high) = mesh
        .positions
        .iter()
        .fold((DVec3::MAX, DVec3::MIN), |(l, h), &x| (l.min(x), h.max(x)));
    let scale = 0.2 / (high - low).max_element();
    mesh.positions.iter_mut().for_each(|x| *x *= scale);
    let rounds = argument(2, "200").parse().unwrap();
    let relaxation = argument(3, "1").parse().unwrap();
    let corrections = CorrectionSettings {
        aggregate: argument(4, "0").parse().unwrap(),
        iterations: argument(5, "50").parse().unwrap(),
        reduction: argument(6, "0.1").parse().unwrap(),
    };
    let sweeps = argument(7, "1").parse().unwrap();
    for (threads, single) in [(1, false), (2, false), (1, true)] {
        println!("threads {threads}, {}", if single { "f32" } else { "f64" });
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let case = argument(1, "gravity");
        pool.install(|| {
            if single {
                run::<f32>(&mesh, &case, rounds, relaxation, corrections, sweeps)
            } else {
                run::<f64>(&mesh, &case, rounds, relaxation, corrections, sweeps)
            }
        });
    }
}
