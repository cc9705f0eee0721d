//! Ten substeps of one iteration: both precisions, with and without damping, with and without clusters of ten tets, on
//! one and two threads; and the plain kernel for comparison. Then the cost of a cut of twenty tets for schedule and
//! layout.
//!
//! The body hangs from one end and swings on from iteration to iteration, so that no step is the trivial one of a body
//! at rest.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

mod plain;
mod update;

use std::num::NonZeroUsize;

use incise::clustering::serial_neighbor;
use incise::coloring::scgc;
use incise::graph::{Clustering, Schedule};
use incise::mesh::TetId;
use incise::mesh::glam::DVec3;
use incise::xpbd::{Material, Real, Solver, StepSettings, TetSolve};
use incise_benches::{Bench, Case};
use plain::Plain;
use rayon::{ThreadPool, ThreadPoolBuilder};
use update::{Stage, Updated};

fn main() {
    let pools = [1, 2].map(|threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        (threads, pool.unwrap())
    });
    incise_benches::run("xpbd", |bench| {
        for (name, stage, rebuilds) in [
            ("cut-schedule", Stage::Schedule, false),
            ("cut-schedule-rebuilt", Stage::Schedule, true),
            ("cut-layout", Stage::Layout, false),
            ("cut-layout-rebuilt", Stage::Layout, true),
        ] {
            let mut following = Updated::new(bench.case, solver::<f32>(bench.case, 0.0), rebuilds);
            bench.measure(name, |b| {
                b.iter_custom(|count| (0..count).map(|_| following.time(stage)).sum());
            });
        }
        let graph = bench.case.graph();
        let none = Clustering::none(graph.vertex_count());
        let serial = serial_neighbor(&graph, NonZeroUsize::MIN.saturating_add(9));
        for (name, clustering) in [("none", none), ("serial10", serial)] {
            let coloring = scgc(&graph.quotient(&clustering)).coloring;
            let schedule = Schedule::new(&clustering, &coloring);
            plain_substeps(bench, &format!("plain-{name}"), &schedule);
            for (damping_name, damping) in [("undamped", 0.0), ("damped", 0.002)] {
                for (threads, pool) in &pools {
                    let rest = format!("{name}-{damping_name}-{threads}");
                    substeps::<f32>(bench, &format!("f32-{rest}"), damping, &schedule, pool);
                    substeps::<f64>(bench, &format!("f64-{rest}"), damping, &schedule, pool);
                }
            }
        }
    });
}

fn substeps<R: Real>(
    bench: &mut Bench<'_, '_>,
    name: &str,
    damping: f64,
    schedule: &Schedule,
    pool: &ThreadPool,
) {
    let mut solver = solver::<R>(bench.case, damping);
    let time = calm(&solver);
    let settings = StepSettings {
        substeps: SUBSTEPS,
        gravity: Some(GRAVITY),
        ..StepSettings::new(time * f64::from(SUBSTEPS))
    };
    bench.measure(name, |b| {
        b.iter(|| {
            let report = pool.install(|| solver.step(schedule, &settings)).unwrap();
            assert_eq!(report.repaired, 0, "the measured step is an honest one");
        });
    });
}

/// Measures the substeps by the plain kernel, in single precision without damping, after a check that the motion is the
/// same.
fn plain_substeps(bench: &mut Bench<'_, '_>, name: &str, schedule: &Schedule) {
    let mut solver = solver::<f32>(bench.case, 0.0);
    let time = calm(&solver);
    let count = solver.particle_count();
    let positions: Vec<DVec3> = (0..count).map(|p| solver.position(p)).collect();
    let weight = |p| {
        if solver.is_fixed(p) {
            0.0
        } else {
            1.0 / solver.mass(p)
        }
    };
    let weights: Vec<f64> = (0..count).map(weight).collect();
    let tets: Vec<_> = (0..solver.tet_count())
        .map(|t| solver.tet_particles(t).map(|p| p as usize))
        .collect();
    // Gauss-Seidel in another order is another motion.
    let order = (0..schedule.color_count())
        .flat_map(|color| schedule.clusters(color))
        .flat_map(|&cluster| solver.solving_order(schedule.constraints(cluster)))
        .map(|ordered| ordered.tet);
    let stiffness = [RUBBER.mu(), RUBBER.volume_stiffness()];
    let mut plain = Plain::new(&positions, &weights, &tets, order, stiffness, time);
    let settings = StepSettings {
        substeps: SUBSTEPS,
        // The plain kernel solves that form.
        tet_solve: TetSolve::Block,
        gravity: Some(GRAVITY),
        ..StepSettings::new(time * f64::from(SUBSTEPS))
    };
    solver.step(schedule, &settings).unwrap();
    (0..SUBSTEPS).for_each(|_| plain.substep(GRAVITY));
    let apart = (0..count).map(|p| plain.position(p).distance(solver.position(p)));
    assert!(apart.fold(0.0, f64::max) < 1e-5, "the same motion");
    bench.measure(name, |b| {
        b.iter(|| (0..SUBSTEPS).for_each(|_| plain.substep(GRAVITY)));
    });
}

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
/// Substeps of a frame.
const SUBSTEPS: u32 = 10;
const RUBBER: Material = Material {
    young_modulus: 1e5,
    poisson_ratio: 0.45,
    density: 1000.0,
    damping: 0.0,
};

/// The time in s of a substep in which tets of any shape are stable.
fn calm<R: Real>(solver: &Solver<R>) -> f64 {
    (0.35 / solver.kappa(1.0)).sqrt()
}

/// The case in rubber, held at its low end in x. Scaled to one meter.
fn solver<R: Real>(case: &Case, damping: f64) -> Solver<R> {
    let [low, high] = case.bounds();
    let scale = 1.0 / (high - low).max_element();
    let positions: Vec<DVec3> = case
        .mesh
        .positions
        .iter()
        .map(|&x| (x - low) * scale)
        .collect();
    let mut solver = Solver::new(&positions);
    let material = Material { damping, ..RUBBER };
    let rubber = solver.add_material(material).unwrap();
    let mut masses = vec![0.0; positions.len()];
    for (t, tet) in case.mesh.tets.iter().enumerate() {
        let particles = tet.map(|p| p.0);
        let rest = tet.map(|p| positions[p.index()]);
        solver.push_tet(particles, rest, rubber);
        let volume = case.mesh.volume(TetId::new(t)) * scale.powi(3);
        for p in tet {
            masses[p.index()] += 0.25 * material.density * volume;
        }
    }
    for (p, &mass) in masses.iter().enumerate() {
        solver.set_mass(p, mass);
        if positions[p].x < 0.2 {
            solver.set_fixed(p, true);
        }
    }
    solver
}
