//! Springs, rods and threads against closed forms.

use glam::{DVec3, dvec3};
use incise_coloring::color;
use incise_graph::{Clustering, ConstraintGraph, Incidence, Schedule};
use incise_xpbd::{DistanceConstraint, Real, Solver, StepSettings, XpbdError};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, positions, within};

/// A spring or rod.
fn distance(particles: [u32; 2], length: f64, compliance: f64) -> DistanceConstraint {
    DistanceConstraint {
        particles,
        length,
        compliance,
        damping: 0.0,
        tension_only: false,
    }
}

/// An order for any constraints.
fn order<const K: usize>(particles: usize, constraints: &[[u32; K]]) -> Schedule {
    let incidence = Incidence::from_constraints(particles, constraints.iter().copied()).unwrap();
    let graph = ConstraintGraph::from_incidence(&incidence);
    let coloring = color("greedy".parse().unwrap(), &graph, 0)
        .unwrap()
        .coloring;
    Schedule::new(&Clustering::none(constraints.len()), &coloring)
}

fn link<R: Real>(solver: &mut Solver<R>, constraints: &[DistanceConstraint]) {
    let particles: Vec<[u32; 2]> = constraints.iter().map(|c| c.particles).collect();
    let schedule = order(solver.particle_count(), &particles);
    solver.set_distances(constraints, schedule).unwrap();
    assert_eq!(solver.distance_count(), constraints.len());
}

fn step<R: Real>(solver: &mut Solver<R>, settings: &StepSettings) {
    let report = solver.step(&Schedule::default(), settings).unwrap();
    assert_eq!(report.repaired, 0);
}

/// Particles one below the other, the first without mass, so that it stays.
fn hanging<R: Real>(count: u32, mass: f64, compliance: f64) -> Solver<R> {
    let at: Vec<DVec3> = (0..count).map(|p| DVec3::NEG_Z * f64::from(p)).collect();
    let mut solver = Solver::new(&at);
    (1..at.len()).for_each(|p| solver.set_mass(p, mass));
    let springs: Vec<DistanceConstraint> = (1..count)
        .map(|p| distance([p - 1, p], 1.0, compliance))
        .collect();
    link(&mut solver, &springs);
    solver
}

/// A chain of springs under its weight, put where each spring is stretched by the weight below it times its compliance:
/// it stays there, with any number of iterations and any relaxation, because that solves the equations of a substep.
fn stays_in_balance<R: Real>(tolerance: f64) {
    for (iterations, relaxation) in [(1, 1.0), (50, 1.0), (50, 0.8)] {
        let (count, mass, compliance) = (2, 0.5, 0.02);
        let mut solver = hanging::<R>(count, mass, compliance);
        let stretched = DVec3::NEG_Z * (1.0 + mass * -GRAVITY.z * compliance);
        solver.set_position(1, stretched);
        let settings = StepSettings {
            substeps: 5,
            iterations,
            relaxation,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.016)
        };
        for _ in 0..200 {
            step(&mut solver, &settings);
            let error = solver.position(1).distance(stretched);
            within("balance", error, tolerance);
        }
    }
}

/// In double precision the last digits of 1000 substeps. In single precision each iteration rounds positions by 6e-8 m,
/// and the undamped spring keeps what that adds up to: 1e-4 measured with 50 iterations.
#[test]
fn a_spring_hangs_by_weight_times_compliance() {
    stays_in_balance::<f64>(1e-12);
    stays_in_balance::<f32>(5e-4);
}

/// A damped chain comes to rest where spring `i` carries all below it.
#[test]
fn a_chain_settles_where_each_spring_carries_what_hangs_below() {
    let (count, mass, compliance) = (6, 0.2, 0.05);
    let mut solver = hanging::<f64>(count, mass, compliance);
    let damped: Vec<DistanceConstraint> = (1..count)
        .map(|p| DistanceConstraint {
            damping: 0.2,
            ..distance([p - 1, p], 1.0, compliance)
        })
        .collect();
    link(&mut solver, &damped);
    // One pass leaves an error of the order of the damping times gravity and the substep; ten solve the substep.
    let settings = StepSettings {
        substeps: 10,
        iterations: 10,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.016)
    };
    for _ in 0..3000 {
        step(&mut solver, &settings);
    }
    let mut z = 0.0;
    for p in 1..count {
        z -= 1.0 + f64::from(count - p) * mass * -GRAVITY.z * compliance;
        // The slowest of its vibrations has decayed by then; rounding remains.
        within("height", (solver.position(p as usize).z - z).abs(), 1e-9);
    }
}

/// The frequency of a mass on a spring is `sqrt(k / m) / 2π`: after one period it is back. The method is implicit,
/// which lengthens and damps by the order of the substep times the angular frequency, here 10 / 10000.
#[test]
fn a_spring_swings_at_its_frequency() {
    let mut solver = hanging::<f64>(2, 1.0, 0.01);
    solver.set_position(1, dvec3(0.0, 0.0, -1.1));
    let settings = StepSettings {
        substeps: 100,
        ..StepSettings::new(0.01)
    };
    // Falling through the middle for the second time.
    let mut crossings = Vec::new();
    let (mut time, mut before) = (0.0, -0.1);
    while crossings.len() < 3 {
        step(&mut solver, &settings);
        time += 0.01;
        let now = solver.position(1).z + 1.0;
        if before * now < 0.0 {
            crossings.push(time - 0.01 * now / (now - before));
        }
        before = now;
    }
    let period = std::f64::consts::TAU / 10.0;
    within(
        "period",
        ((crossings[2] - crossings[0]) / period - 1.0).abs(),
        1e-3,
    );
}

/// A rod's pendulum: `2π sqrt(l / g) (1 + θ² / 16)` for small amplitudes θ, to first order in the substep. The length
/// is kept by the solve of each substep up to the square of the angle it turns in it, (0.3 · 1e-4)² / 2.
#[test]
fn a_pendulum_swings_at_its_period() {
    let angle = 0.1f64;
    let mut solver = hanging::<f64>(2, 1.0, 0.0);
    solver.set_position(1, dvec3(angle.sin(), 0.0, -angle.cos()));
    let settings = StepSettings {
        substeps: 50,
        gravity: Some(GRAVITY),
        ..StepSettings::new(5e-3)
    };
    let mut crossings = Vec::new();
    let (mut time, mut before) = (0.0, angle);
    while crossings.len() < 5 {
        step(&mut solver, &settings);
        time += 5e-3;
        let x = solver.position(1);
        within("length", (x.length() - 1.0).abs(), 1e-8);
        if before * x.x < 0.0 {
            crossings.push(time - 5e-3 * x.x / (x.x - before));
        }
        before = x.x;
    }
    let period = std::f64::consts::TAU / (-GRAVITY.z).sqrt() * (1.0 + angle * angle / 16.0);
    within(
        "period",
        ((crossings[4] - crossings[0]) / (2.0 * period) - 1.0).abs(),
        1e-3,
    );
}

/// A thread does not push what comes nearer, and stops what falls.
#[test]
fn a_thread_pulls_but_does_not_push() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, dvec3(0.0, 0.0, -0.5)]);
    solver.set_mass(1, 1.0);
    let thread = DistanceConstraint {
        tension_only: true,
        damping: 0.01,
        ..distance([0, 1], 1.0, 1e-6)
    };
    link(&mut solver, &[thread]);
    let mut settings = StepSettings {
        substeps: 10,
        iterations: 3,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.01)
    };
    // Free fall through half a meter takes 0.319 s.
    for frame in 1..=31 {
        step(&mut solver, &settings);
        let n = f64::from(frame * 10);
        let fallen = 0.5 * -GRAVITY.z * 1e-6 * n * (n + 1.0);
        within("fall", (solver.position(1).z + 0.5 + fallen).abs(), 1e-12);
    }
    for _ in 0..300 {
        step(&mut solver, &settings);
        // Stretched by its weight, and by the stop at 3.2 m/s at most by v sqrt(m α).
        let length = solver.position(1).length();
        assert!(length < 1.0 + 4e-3, "{length}");
    }
    let length = solver.position(1).length();
    within("length at rest", (length - 1.0 - 9.81e-6).abs(), 1e-8);
    // Thrown up it flies as if there were no thread.
    settings.gravity = None;
    solver.set_velocity(1, DVec3::Z * 2.0);
    let start = solver.position(1).z;
    for _ in 0..20 {
        step(&mut solver, &settings);
    }
    within("flight", (solver.position(1).z - start - 0.4).abs(), 1e-6);
}

/// Constraints between two particles are internal: momentum is kept, whatever the masses; and with a mass ratio of a
/// million a rod is still a rod. Rounding of a position costs 1e-16 times the mass over the substep, 2e-13 of the mass,
/// in each of 2000 substeps.
#[test]
fn momentum_is_kept_at_mass_ratios_of_a_million() {
    for ratio in [1.0, 1e3, 1e6] {
        for compliance in [0.0, 1e-3] {
            let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X]);
            solver.set_mass(0, ratio);
            solver.set_mass(1, 1.0);
            solver.set_velocity(1, dvec3(0.3, 1.0, 0.0));
            link(&mut solver, &[distance([0, 1], 1.0, compliance)]);
            let settings = StepSettings {
                substeps: 20,
                ..StepSettings::new(0.01)
            };
            let momentum = |s: &Solver<f64>| s.velocity(0) * ratio + s.velocity(1);
            let before = momentum(&solver);
            for _ in 0..100 {
                step(&mut solver, &settings);
            }
            within(
                "momentum",
                momentum(&solver).distance(before),
                1e-11 * ratio,
            );
            if compliance == 0.0 {
                let length = solver.position(0).distance(solver.position(1));
                // The square of the angle of 5e-4 that it turns in a substep.
                within("length", (length - 1.0).abs(), 1e-6);
            }
        }
    }
}

/// A cloth of 64 × 64 with rods, springs, threads, damping: the same bits on any number of threads.
fn cloth<R: Real>(threads: usize, iterations: u32) -> Vec<DVec3> {
    let n = 64u32;
    let at: Vec<DVec3> = (0..n * n)
        .map(|p| dvec3(f64::from(p % n), f64::from(p / n), 0.0) * 0.01)
        .collect();
    let mut solver = Solver::<R>::new(&at);
    (1..at.len()).for_each(|p| solver.set_mass(p, 1e-3));
    let mut springs = Vec::new();
    let mut noise = Noise(3);
    for p in 0..n * n {
        for (right, up) in [(1, 0), (0, 1), (1, 1)] {
            if p % n + right < n && p / n + up < n {
                springs.push(DistanceConstraint {
                    damping: 1e-3,
                    tension_only: noise.scalar() > 0.0,
                    ..distance([p, p + right + up * n], 0.009, 1e-4 * noise.scalar().abs())
                });
            }
        }
    }
    let particles: Vec<[u32; 2]> = springs.iter().map(|s| s.particles).collect();
    let schedule = order(at.len(), &particles);
    // As much as one color needs to be shared out.
    assert!((0..schedule.color_count()).any(|c| schedule.color_constraints(c).count() > 1024));
    solver.set_distances(&springs, schedule).unwrap();
    let settings = StepSettings {
        substeps: 3,
        iterations,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.016)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(|| {
        for _ in 0..5 {
            step(&mut solver, &settings);
        }
    });
    positions(&solver)
}

#[test]
fn threads_do_not_change_a_bit() {
    for iterations in [1, 3] {
        let one = cloth::<f32>(1, iterations);
        assert!(one.iter().any(|x| x.z < -1e-3));
        assert!(one == cloth::<f32>(2, iterations) && one == cloth::<f32>(3, iterations));
    }
    assert!(cloth::<f64>(1, 2) == cloth::<f64>(3, 2));
}

#[test]
fn bad_constraints_and_foreign_schedules_are_refused_and_change_nothing() {
    let mut solver = hanging::<f64>(3, 1.0, 0.1);
    let good = distance([0, 1], 1.0, 0.0);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let table = [
            ("length", distance([0, 1], bad, 0.0)),
            ("compliance", distance([0, 1], 1.0, bad)),
            (
                "damping",
                DistanceConstraint {
                    damping: bad,
                    ..good
                },
            ),
        ];
        for (name, constraint) in table {
            let list = [distance([1, 2], 1.0, 0.0), constraint];
            let error = solver
                .set_distances(&list, order(3, &[[1u32, 2], [0, 1]]))
                .unwrap_err();
            let XpbdError::Constraint { index: 1, what, .. } = error else {
                panic!("{error}");
            };
            assert_eq!(what, name);
        }
    }
    let one_color = Schedule::new(
        &Clustering::none(2),
        &incise_graph::Coloring::new(vec![incise_graph::ColorId(0); 2]),
    );
    let both = [good, distance([1, 2], 1.0, 0.0)];
    for (list, schedule) in [
        (&both[..], one_color.clone()),
        (&both[..], order(3, &[[0u32, 1]])),
        (&both[..1], order(3, &[[0u32, 1], [1, 2]])),
        (&[distance([0, 3], 1.0, 0.0)][..], order(4, &[[0u32, 3]])),
    ] {
        let error = solver.set_distances(list, schedule).unwrap_err();
        assert!(
            matches!(
                error,
                XpbdError::Schedule {
                    what: "distance",
                    ..
                }
            ),
            "{error}"
        );
    }
    assert_eq!(solver.distance_count(), 2);
    solver.set_distances(&[], Schedule::default()).unwrap();
    assert_eq!(solver.distance_count(), 0);
}

/// Two particles on one spot have no direction to part in: they wait, and part once they are moved.
#[test]
fn a_spring_without_a_direction_waits() {
    for compliance in [0.0, 1e-3] {
        let mut solver = Solver::<f32>::new(&[DVec3::ONE; 2]);
        (0..2).for_each(|p| solver.set_mass(p, 1.0));
        link(&mut solver, &[distance([0, 1], 0.5, compliance)]);
        let settings = StepSettings::new(0.01);
        step(&mut solver, &settings);
        assert_eq!(positions(&solver), [DVec3::ONE; 2]);
        solver.set_position(0, DVec3::ONE + DVec3::X * 1e-6);
        step(&mut solver, &settings);
        assert!(solver.position(0).distance(solver.position(1)) > 1e-3);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Anything finite at all, in both precisions.
    #[test]
    fn any_constraint_leaves_any_particle_finite(
        particles in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -45..37i32, -300..300i32), 3..8),
        springs in prop::collection::vec((0..8u32, 1..8u32, -40..37i32, -300..300i32, -10..10i32, 0..8u8), 1..12),
        iterations in 1..4u32,
    ) {
        let count = u32::try_from(particles.len()).unwrap();
        let at: Vec<DVec3> = particles
            .iter()
            .map(|(x, size, _)| DVec3::from_array(*x) * 10f64.powi(*size))
            .collect();
        let constraints: Vec<DistanceConstraint> = springs
            .iter()
            .map(|&(p, other, length, compliance, damping, what)| DistanceConstraint {
                particles: [p % count, (p % count + 1 + other % (count - 1)) % count],
                length: if what & 1 == 0 { 0.0 } else { 10f64.powi(length) },
                compliance: if what & 2 == 0 { 0.0 } else { 10f64.powi(compliance) },
                damping: if what & 2 == 0 { 0.0 } else { 10f64.powi(damping) },
                tension_only: what & 4 == 0,
            })
            .collect();
        finite::<f32>(&at, &particles, &constraints, iterations)?;
        finite::<f64>(&at, &particles, &constraints, iterations)?;
    }
}

fn finite<R: Real>(
    at: &[DVec3],
    particles: &[([f64; 3], i32, i32)],
    constraints: &[DistanceConstraint],
    iterations: u32,
) -> Result<(), TestCaseError> {
    let mut solver = Solver::<R>::new(at);
    for (p, (_, _, mass)) in particles.iter().enumerate() {
        solver.set_mass(p, 10f64.powi(*mass));
    }
    link(&mut solver, constraints);
    let settings = StepSettings {
        substeps: 2,
        iterations,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.1)
    };
    for _ in 0..3 {
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    for p in 0..at.len() {
        prop_assert!(solver.position(p).is_finite() && solver.velocity(p).is_finite());
    }
    Ok(())
}
