//! BDF2 against closed forms: free fall, the decay of a spring, a spinning body; and what it must leave alone.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{
    Collider, DistanceConstraint, Integrator, Real, Solver, VbdSettings, VertexStars,
};

use crate::body::{GRAVITY, RUBBER, body, within};
use crate::vbd::{falling, held_beam, stars};

const BOTH: [Integrator; 2] = [Integrator::ImplicitEuler, Integrator::Bdf2];

fn settings(integrator: Integrator, time_step: f64, iterations: u32) -> VbdSettings {
    VbdSettings {
        integrator,
        ..VbdSettings::new(time_step, iterations)
    }
}

/// BDF2 is exact for a parabola. What remains is the start by four steps of implicit Euler, an eighth of g Δt² too far,
/// which the formula's other root raises by a half: 9.375e-6 of the way after 200 steps.
#[test]
fn free_fall_is_the_parabola() {
    fn gap<R: Real>() -> f64 {
        let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
        let mut solver = body::<R>(&mesh, RUBBER);
        let mut stars = stars(&solver);
        let mut settings = settings(Integrator::Bdf2, 0.01, 1);
        settings.step.gravity = Some(GRAVITY);
        for _ in 0..200 {
            solver.step_vbd(&mut stars, &settings).unwrap();
        }
        let fallen = 0.5 * GRAVITY * 4.0;
        let gaps = (0..mesh.positions.len())
            .map(|p| (solver.position(p) - mesh.positions[p] - fallen).length());
        gaps.fold(0.0, f64::max) / fallen.length() - 9.375e-6
    }
    within("f64", gap::<f64>(), 1e-12);
    within("f32", gap::<f32>(), 1e-4);
}

/// A mass on a spring, 40 steps a period, after ten periods. Euler keeps exp(-2 π² / 40) of the amplitude in each,
/// which the second order of its expansion changes by a percent; BDF2 keeps exp(-4 π⁴ / 40³), up to 2.4 z² = 6% of the
/// exponent, with z = 2 π / 40.
#[test]
fn a_spring_decays_as_derived() {
    for (integrator, expected, tolerance) in [
        (Integrator::ImplicitEuler, -2.0 * 9.8696 / 40.0, 0.02),
        (Integrator::Bdf2, -4.0 * 97.409 / 64_000.0, 0.08),
    ] {
        let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X]);
        solver.add_material(RUBBER).unwrap();
        solver.set_mass(0, 1.0);
        solver.set_mass(1, 1.0);
        solver.set_fixed(0, true);
        let compliance = 1e-3_f64;
        let spring = DistanceConstraint {
            particles: [0, 1],
            length: 1.0,
            compliance,
            damping: 0.0,
            tension_only: false,
        };
        let one = |count| {
            let colors = Coloring::new((0..count).map(ColorId).collect());
            Schedule::new(&Clustering::none(count as usize), &colors)
        };
        solver.set_distances(&[spring], one(1)).unwrap();
        solver.set_position(1, dvec3(1.1, 0.0, 0.0));
        let mut stars = VertexStars::new(&solver, &one(2)).unwrap();
        let period = std::f64::consts::TAU * compliance.sqrt();
        let settings = settings(integrator, period / 40.0, 1);
        let energy = |solver: &Solver<f64>| {
            let stretch = solver.position(1).x - 1.0;
            0.5 * stretch * stretch / compliance + 0.5 * solver.velocity(1).length_squared()
        };
        let mut run = |steps| {
            for _ in 0..steps {
                solver.step_vbd(&mut stars, &settings).unwrap();
            }
            energy(&solver)
        };
        // BDF2 starts by a rule of first order.
        let start = run(40);
        let end = run(400);
        let decay = 0.5 * (end / start).ln() / 10.0;
        let error = (decay / expected - 1.0).abs();
        assert!(error < tolerance, "{integrator:?}: {decay} for {expected}");
    }
}

/// The angular momentum of a spinning box about its center, as a part of that at the start, after 2 s of 10 ms steps.
fn spin_left(integrator: Integrator) -> f64 {
    let mesh: TetMesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut solver = body::<f64>(&mesh, RUBBER);
    let center = dvec3(0.2, 0.1, 0.1);
    for (p, x) in mesh.positions.iter().enumerate() {
        solver.set_velocity(p, DVec3::Z.cross(*x - center) * 6.0);
    }
    let momentum = |solver: &Solver<f64>| {
        let each = (0..solver.particle_count()).map(|p| {
            let arm = solver.position(p) - center;
            arm.cross(solver.velocity(p)).z * solver.mass(p)
        });
        each.sum::<f64>()
    };
    let start = momentum(&solver);
    let mut stars = stars(&solver);
    let mut settings = settings(integrator, 0.01, 60);
    settings.step.relaxation = 1.5;
    for _ in 0..200 {
        solver.step_vbd(&mut stars, &settings).unwrap();
    }
    momentum(&solver) / start
}

/// Euler loses ω² Δt of it a second to first order, which at 6 rad/s and 10 ms is half of it in 2 s.
#[test]
fn a_spinning_body_keeps_its_angular_momentum() {
    let [euler, bdf2] = BOTH.map(spin_left);
    assert!(euler < 0.65, "{euler}");
    assert!(bdf2 > 0.99 && bdf2 < 1.01, "{bdf2}");
}

/// What is at rest for one rule is so for the other.
#[test]
fn rest_is_rest_for_both() {
    let mut solver = held_beam::<f64>(RUBBER);
    let mut stars = stars(&solver);
    let mut settings = falling(400);
    settings.step.relaxation = 1.7;
    settings.tolerance = Some(1e-10);
    for _ in 0..150 {
        solver.step_vbd(&mut stars, &settings).unwrap();
    }
    let before = solver.max_speed();
    settings.integrator = Integrator::Bdf2;
    for _ in 0..10 {
        solver.step_vbd(&mut stars, &settings).unwrap();
    }
    assert!(before < 1e-5, "{before}");
    assert!(solver.max_speed() < 2.0 * before, "{}", solver.max_speed());
}

/// A box falls onto the ground by 10 cm: it gains no energy, so it does not bounce higher than it fell.
#[test]
fn an_impact_adds_no_energy() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let mut solver = body::<f64>(&mesh, RUBBER);
    let mut stars = stars(&solver);
    let mut settings = settings(Integrator::Bdf2, 0.01, 60);
    settings.step.gravity = Some(GRAVITY);
    settings.step.colliders.push(Collider::ground(-0.1, 0.0));
    let energy = |solver: &Solver<f64>| {
        let energy = solver.energy(Some(GRAVITY));
        energy.kinetic + energy.elastic + energy.gravity
    };
    let start = energy(&solver);
    let kinetic = |solver: &Solver<f64>| solver.energy(None).kinetic;
    let mut fastest = 0.0_f64;
    for _ in 0..300 {
        solver.step_vbd(&mut stars, &settings).unwrap();
        fastest = fastest.max(kinetic(&solver));
        assert!(energy(&solver) < start + 1e-3 * fastest);
    }
    assert!(fastest > 1.0, "it falls: {fastest}");
}

/// A ground that leaves a body during its first substep does not change how fast the body moves along the ground.
#[test]
fn contact_at_the_start_keeps_the_sliding_velocity() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let mut solver = body::<f64>(&mesh, RUBBER);
    for p in 0..mesh.positions.len() {
        solver.set_velocity(p, DVec3::X);
    }
    let mut stars = stars(&solver);
    let mut settings = settings(Integrator::Bdf2, 0.01, 60);
    // At 1e-4 m above the body's lower side after a quarter of the substep, below it afterwards.
    let mut ground = Collider::ground(0.0026, 0.0);
    ground.velocity = DVec3::NEG_Z;
    settings.step.colliders.push(ground);
    for _ in 0..5 {
        solver.step_vbd(&mut stars, &settings).unwrap();
        settings.step.colliders.clear();
    }
    let center = |x: &dyn Fn(usize) -> DVec3| {
        let all = (0..mesh.positions.len()).map(|p| x(p) * solver.mass(p));
        all.sum::<DVec3>()
            / (0..mesh.positions.len())
                .map(|p| solver.mass(p))
                .sum::<f64>()
    };
    let way = center(&|p| solver.position(p)) - center(&|p| mesh.positions[p]);
    within("way", way.x - 0.05, 1e-5);
    assert!(way.z > 0.0, "it was touched: {way}");
}

/// A velocity set from outside, another time step and a pause under another rule start the history again.
#[test]
fn interruptions_leave_no_trace() {
    let mesh = kuhn_box([2, 1, 1], dvec3(0.2, 0.1, 0.1));
    let mut solver = body::<f64>(&mesh, RUBBER);
    let mut stars = stars(&solver);
    let push = |solver: &mut Solver<f64>, speed: f64| {
        (0..mesh.positions.len()).for_each(|p| solver.set_velocity(p, DVec3::X * speed));
    };
    for (integrator, time, speed) in [
        (Integrator::Bdf2, 0.01, 1.0),
        (Integrator::Bdf2, 0.01, -2.0),
        (Integrator::Bdf2, 0.003, 0.5),
        (Integrator::ImplicitEuler, 0.01, 3.0),
        (Integrator::Bdf2, 0.01, 4.0),
    ] {
        push(&mut solver, speed);
        let start = solver.position(0).x;
        let settings = settings(integrator, time, 1);
        for _ in 0..5 {
            solver.step_vbd(&mut stars, &settings).unwrap();
        }
        within(
            "way",
            solver.position(0).x - start - 5.0 * time * speed,
            1e-12,
        );
        within("speed", solver.velocity(0).x - speed, 1e-12);
    }
}
