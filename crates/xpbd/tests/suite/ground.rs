//! Fixed particles, the ground and its friction.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, Coloring, Schedule};
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Material, Real, Solver, StepSettings};

use crate::body::{GRAVITY, Noise, RUBBER, body, disturb, plain, substep, within};

fn on_ground<R: Real>(solver: &Solver<R>, height: f64, friction: f64) -> StepSettings {
    StepSettings {
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(height, friction)],
        ..substep(solver, 0.3)
    }
}

fn fixed_particles_stay<R: Real>() {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.02, 8);
    // One of them below the ground, one with a velocity that it had before.
    let held = [0, 7, 20, 44];
    solver.set_position(0, dvec3(0.0, 0.0, -0.5));
    solver.set_velocity(7, DVec3::ONE);
    for p in held {
        solver.set_fixed(p, true);
    }
    let before = held.map(|p| solver.position(p));
    let settings = StepSettings {
        iterations: 2,
        ..on_ground(&solver, -0.1, 0.3)
    };
    for _ in 0..200 {
        solver.step(&plain(&mesh), &settings).unwrap();
        assert_eq!(held.map(|p| solver.position(p)), before);
        assert_eq!(held.map(|p| solver.velocity(p)), [DVec3::ZERO; 4]);
    }
    assert!(solver.max_speed() > 0.0);
    // Released, they move again.
    solver.set_fixed(0, false);
    assert!(!solver.is_fixed(0) && solver.is_fixed(7));
    solver.step(&plain(&mesh), &settings).unwrap();
    assert_ne!(solver.position(0), before[0]);
}

#[test]
fn fixed_particles_do_not_move_at_all() {
    fixed_particles_stay::<f32>();
    fixed_particles_stay::<f64>();
}

/// A body thrown down on the ground, turned so that corners and edges hit it; the height is no round number.
fn lowest<R: Real>(iterations: u32) -> f64 {
    let mesh = kuhn_box([3, 3, 3], DVec3::splat(0.3));
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.02, 9);
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, dvec3(1.0, 0.3, -4.0));
    }
    let height = R::from_f64(-0.1 / 3.0).to_f64();
    let settings = StepSettings {
        iterations,
        ..on_ground(&solver, height, 0.3)
    };
    let mut lowest = f64::INFINITY;
    for _ in 0..500 {
        solver.step(&plain(&mesh), &settings).unwrap();
        for p in 0..solver.particle_count() {
            lowest = lowest.min(solver.position(p).z - height);
        }
    }
    lowest
}

#[test]
fn no_particle_ends_a_frame_below_the_ground() {
    for iterations in [1, 4] {
        assert_eq!(lowest::<f32>(iterations), 0.0);
        assert_eq!(lowest::<f64>(iterations), 0.0);
    }
}

/// However deep a particle is and whatever the height, it is put on the ground exactly, not by adding the depth. The
/// substep is as long as the time in which a depth decays.
#[test]
fn particles_end_on_the_ground_to_the_bit() {
    let mut noise = Noise(21);
    let depths: Vec<DVec3> = (0..1000)
        .map(|_| DVec3::NEG_Z * 1e4 * noise.scalar().abs())
        .collect();
    let mut solver = Solver::<f32>::new(&depths);
    (0..depths.len()).for_each(|p| solver.set_mass(p, 1.0));
    let schedule = Schedule::new(&Clustering::none(0), &Coloring::new(Vec::new()));
    let settings = StepSettings {
        colliders: vec![Collider::ground(0.1, 0.0)],
        ..StepSettings::new(0.02)
    };
    solver.step(&schedule, &settings).unwrap();
    assert!((0..depths.len()).all(|p| solver.position(p).z == f64::from(0.1_f32)));
}

/// A block that lies on the ground and slides at 2 m/s: where its center of mass stops or is after 1 s, and its speed.
fn slide<R: Real>(friction: f64) -> [f64; 2] {
    let mesh = kuhn_box([4, 4, 2], dvec3(0.4, 0.4, 0.2));
    let mut solver = body::<R>(
        &mesh,
        Material {
            damping: 2e-3,
            ..RUBBER
        },
    );
    let settings = on_ground(&solver, 0.0, friction);
    // It settles under its weight first.
    for _ in 0..500 {
        solver.step(&plain(&mesh), &settings).unwrap();
    }
    let center = |solver: &Solver<R>| {
        let mass: f64 = (0..solver.particle_count()).map(|p| solver.mass(p)).sum();
        let each = |p: usize| {
            [solver.position(p).x, solver.velocity(p).x].map(|v| v * solver.mass(p) / mass)
        };
        (0..solver.particle_count())
            .map(each)
            .fold([0.0; 2], |s, e| [s[0] + e[0], s[1] + e[1]])
    };
    let start = center(&solver)[0];
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, solver.velocity(p) + DVec3::X * 2.0);
    }
    let mut time = 0.0;
    while time < 1.0 {
        solver.step(&plain(&mesh), &settings).unwrap();
        time += settings.time_step;
    }
    let [x, speed] = center(&solver);
    [x - start, speed]
}

/// Coulomb: a block stops after `v² / (2 μ g)`.
#[test]
fn friction_stops_a_sliding_block_at_coulombs_distance() {
    for friction in [0.3, 0.6] {
        let coulomb = 2.0 * 2.0 / (2.0 * friction * -GRAVITY.z);
        let [way, speed] = slide::<f64>(friction);
        within("way", (way / coulomb - 1.0).abs(), 0.1);
        within("speed at the end", speed.abs(), 0.01);
        let [way, speed] = slide::<f32>(friction);
        within("f32 way", (way / coulomb - 1.0).abs(), 0.1);
        within("f32 speed at the end", speed.abs(), 0.01);
    }
}

#[test]
fn without_friction_a_block_keeps_its_speed() {
    let [way, speed] = slide::<f64>(0.0);
    within("f64", (speed / 2.0 - 1.0).abs(), 1e-9);
    within("way", (way / 2.0 - 1.0).abs(), 0.01);
    // Each of 2000 substeps rounds a particle's position some twenty times by 1e-8 m, which is 2e-5 m/s each; averaged
    // over 75 particles a few thousandths of the 2 m/s may be lost.
    within("f32", (slide::<f32>(0.0)[1] / 2.0 - 1.0).abs(), 3e-3);
}
