//! Particles on handles: exact where rigid, by closed forms where not, and through cuts.

use glam::{DQuat, DVec3, dvec3};
use incise_graph::Schedule;
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Pose, Real, Solver, StepSettings, XpbdError};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, RUBBER, advance, body, plain, positions, within};

fn step<R: Real>(solver: &mut Solver<R>, settings: &StepSettings) {
    let report = solver.step(&Schedule::default(), settings).unwrap();
    assert_eq!(report.repaired, 0);
}

fn noisy_pose(noise: &mut Noise) -> Pose {
    Pose {
        position: noise.vector() * 0.02,
        rotation: DQuat::from_axis_angle(DVec3::Z, noise.scalar() * 0.1),
    }
}

/// One end of a beam is dragged about: whatever the beam and a collider do, the held particles are where the pose says.
fn held_exactly<R: Real>() {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut solver = body::<R>(&mesh, RUBBER);
    let mut noise = Noise(9);
    let first = noisy_pose(&mut noise);
    let handle = solver.add_handle(first);
    let held: Vec<usize> = (0..solver.particle_count())
        .filter(|&p| mesh.positions[p].x < 0.01)
        .collect();
    // From the back, so that each is sorted in before the others.
    for &p in held.iter().rev() {
        solver.attach(p, handle, 0.0, 0.0).unwrap();
    }
    let place: Vec<DVec3> = held
        .iter()
        .map(|&p| first.rotation.conjugate() * (solver.position(p) - first.position))
        .collect();
    let settings = StepSettings {
        substeps: 6,
        iterations: 2,
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(-0.01, 0.5)],
        ..StepSettings::new(0.01)
    };
    let schedule = plain(&mesh);
    for _ in 0..20 {
        let pose = noisy_pose(&mut noise);
        solver.move_handle(handle, pose);
        solver.step(&schedule, &settings).unwrap();
        assert_eq!(solver.handle(handle), pose);
        for (&p, &place) in held.iter().zip(&place) {
            let target = R::to_dvec3(R::from_dvec3(pose.apply(place)));
            assert_eq!(solver.position(p), target);
        }
    }
    assert_eq!(solver.handle_of(held[0]), Some(handle));
    // Released, they keep the velocity that they had, and fall.
    let p = held[0];
    let velocity = solver.velocity(p);
    assert!(velocity.length() > 0.01);
    solver.detach(p);
    assert_eq!((solver.handle_of(p), solver.velocity(p)), (None, velocity));
    let before = solver.position(held[1]);
    let free = solver.position(p);
    advance(&mut solver, &schedule, &settings, 1);
    assert_eq!(solver.position(held[1]), before);
    assert_ne!(solver.position(p), free);
}

#[test]
fn rigidly_held_particles_are_where_the_pose_says_to_the_bit() {
    held_exactly::<f32>();
    held_exactly::<f64>();
}

/// Poses in between: on the straight line, and turned by the same angle in the same time.
#[test]
fn poses_are_interpolated() {
    let [a, b] = [0.0, 2.0].map(|angle| Pose {
        position: DVec3::X * angle,
        rotation: DQuat::from_rotation_y(angle),
    });
    assert_eq!((a.toward(&b, 1.0), a.toward(&a, 0.3)), (b, a));
    for i in 0..=10 {
        let fraction = f64::from(i) / 10.0;
        let pose = a.toward(&b, fraction);
        let expected = DVec3::X * 2.0 * fraction
            + DQuat::from_rotation_y(2.0 * fraction) * dvec3(0.0, 1.0, 2.0);
        let point = pose.apply(dvec3(0.0, 1.0, 2.0));
        within("point", point.distance(expected), 1e-14);
    }
    // Held particles move evenly: the velocity is that of the way over the time.
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    solver.set_mass(0, 1.0);
    let handle = solver.add_handle(Pose::at(DVec3::ONE));
    solver.attach(0, handle, 0.0, 0.0).unwrap();
    solver.move_handle(handle, Pose::at(DVec3::ONE + DVec3::Y * 0.5));
    let settings = StepSettings {
        substeps: 7,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.1)
    };
    step(&mut solver, &settings);
    within(
        "velocity",
        solver.velocity(0).distance(DVec3::Y * 5.0),
        1e-13,
    );
    // The handle stays, and so does the particle.
    step(&mut solver, &settings);
    assert_eq!(
        (solver.position(0), solver.velocity(0)),
        (DVec3::Y * 0.5, DVec3::ZERO)
    );
}

/// A particle on a compliant attachment hangs lower by its weight times the compliance, and stays there to the last
/// digits from the first step on.
#[test]
fn a_compliant_attachment_gives_way_by_force_times_compliance() {
    for (iterations, compliance) in [(1, 0.01), (4, 0.01), (1, 1e-6), (4, 1e-6)] {
        let mut solver = Solver::<f64>::new(&[DVec3::ONE]);
        solver.set_mass(0, 2.0);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        solver.attach(0, handle, compliance, 0.0).unwrap();
        let sag = GRAVITY * 2.0 * compliance;
        solver.set_position(0, DVec3::ONE + sag);
        let settings = StepSettings {
            substeps: 3,
            iterations,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.016)
        };
        for _ in 0..200 {
            step(&mut solver, &settings);
            within("sag", solver.position(0).distance(DVec3::ONE + sag), 1e-12);
        }
    }
}

/// Damping is against the handle, not against the world: a particle carried along at the handle's speed feels none, and
/// one beside it comes to rest on it.
#[test]
fn damping_is_relative_to_the_handle() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::Y]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for p in 0..2 {
        solver.set_mass(p, 1.0);
        solver.attach(p, handle, 1e-2, 0.2).unwrap();
    }
    let speed = DVec3::X * 3.0;
    solver.set_velocity(0, speed);
    let settings = StepSettings {
        substeps: 4,
        ..StepSettings::new(0.01)
    };
    for frame in 1..=500 {
        let at = speed * 0.01 * f64::from(frame);
        solver.move_handle(handle, Pose::at(at));
        step(&mut solver, &settings);
        // Rounding of numbers up to 15 m.
        within("carried", solver.position(0).distance(at), 1e-11);
    }
    // Critically damped at 10/s: within 5 s it has caught up.
    let at = DVec3::Y + speed * 5.0;
    within("caught up", solver.position(1).distance(at), 1e-9);
}

/// A cut copies a held particle and puts another between two: all three follow the handle.
#[test]
fn copies_and_particles_between_are_attached_too() {
    for compliance in [0.0, 1e-4] {
        let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X, DVec3::Y]);
        let first = solver.add_handle(Pose::at(DVec3::ZERO));
        let second = solver.add_handle(Pose::at(DVec3::Z));
        solver.attach(0, first, compliance, 0.0).unwrap();
        solver.attach(1, first, compliance, 0.0).unwrap();
        solver.attach(2, second, compliance, 0.0).unwrap();
        solver.push_copy(1);
        solver.push_particle_between(0, 1, 0.25);
        solver.push_particle_between(0, 2, 0.5);
        (0..6).for_each(|p| solver.set_mass(p, 1.0));
        let handles: Vec<Option<u32>> = (0..6).map(|p| solver.handle_of(p)).collect();
        let [one, two] = [Some(first), Some(second)];
        assert_eq!(handles, [one, one, two, one, one, None]);
        let start = positions(&solver);
        solver.move_handle(first, Pose::at(DVec3::Z * 0.1));
        let settings = StepSettings {
            substeps: 20,
            ..StepSettings::new(1.0)
        };
        for _ in 0..20 {
            step(&mut solver, &settings);
        }
        for p in [0, 1, 3, 4] {
            // A compliant one without damping loses its vibration to the implicit substep: α / Δt² is 0.04 of 1.
            let error = solver.position(p).distance(start[p] + DVec3::Z * 0.1);
            within("place", error, if compliance == 0.0 { 0.0 } else { 1e-9 });
        }
        assert_eq!(solver.position(2), start[2]);
        assert_eq!(solver.position(5), start[5]);
        // Another attachment replaces the first.
        solver.attach(3, second, 0.0, 0.0).unwrap();
        assert_eq!(solver.handle_of(3), two);
    }
}

/// A cut puts a particle between two that hang at rest on a damped handle at rest: nothing moves.
#[test]
fn a_particle_between_begins_at_its_own_place() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for p in 0..2 {
        solver.set_mass(p, 1.0);
        solver.attach(p, handle, 1e-3, 0.1).unwrap();
    }
    let settings = StepSettings::new(0.01);
    step(&mut solver, &settings);
    solver.push_particle_between(0, 1, 0.25);
    solver.set_mass(2, 1.0);
    step(&mut solver, &settings);
    assert_eq!(solver.position(2), DVec3::X * 0.25);
}

#[test]
fn a_fixed_particle_stays_fixed_on_a_handle() {
    let mut solver = Solver::<f32>::new(&[DVec3::ONE; 2]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for (p, compliance) in [(0, 0.0), (1, 0.1)] {
        solver.set_mass(p, 1.0);
        solver.set_fixed(p, true);
        solver.attach(p, handle, compliance, 0.0).unwrap();
    }
    solver.move_handle(handle, Pose::at(DVec3::X));
    step(&mut solver, &StepSettings::new(0.01));
    assert_eq!(positions(&solver), [DVec3::ONE; 2]);
    assert_eq!(solver.max_speed(), 0.0);
    // Freed, it jumps to its handle.
    solver.set_fixed(0, false);
    step(&mut solver, &StepSettings::new(0.01));
    assert_eq!(solver.position(0), DVec3::ONE + DVec3::X);
}

#[test]
fn bad_attachments_are_refused_by_name() {
    let mut solver = Solver::<f64>::new(&[DVec3::ONE]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        for (name, compliance, damping) in [
            ("attachment compliance", bad, 0.0),
            ("attachment damping", 0.0, bad),
        ] {
            let error = solver.attach(0, handle, compliance, damping).unwrap_err();
            let XpbdError::Setting { what, .. } = error else {
                panic!("{error}");
            };
            assert_eq!(what, name);
        }
    }
    assert_eq!(solver.handle_of(0), None);
}

#[test]
#[should_panic(expected = "poses are finite")]
fn a_pose_that_is_nowhere_is_refused() {
    Solver::<f64>::new(&[]).add_handle(Pose::at(DVec3::NAN));
}

/// A pose beyond the range of single precision leaves the particle where it was, and the step says so.
#[test]
fn a_pose_out_of_range_is_reported() {
    let mut solver = Solver::<f32>::new(&[DVec3::ONE]);
    solver.set_mass(0, 1.0);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.attach(0, handle, 0.0, 0.0).unwrap();
    solver.move_handle(handle, Pose::at(DVec3::X * 1e300));
    let settings = StepSettings::new(0.01);
    let report = solver.step(&Schedule::default(), &settings).unwrap();
    assert_eq!(report.repaired, 1);
    assert_eq!(solver.position(0), DVec3::ONE);
}

/// Attachments are solved in parallel, 4096 at a time, with the same bits on any number of threads.
#[test]
fn threads_do_not_change_a_bit() {
    let run = |threads: usize| {
        let mut noise = Noise(4);
        let at: Vec<DVec3> = (0..20_000).map(|_| noise.vector()).collect();
        let mut solver = Solver::<f32>::new(&at);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for p in 0..at.len() {
            solver.set_mass(p, 1.0);
            let compliance = if p % 3 == 0 { 0.0 } else { 1e-3 };
            solver.attach(p, handle, compliance, 0.01).unwrap();
        }
        let settings = StepSettings {
            substeps: 2,
            iterations: 2,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.016)
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            for _ in 0..3 {
                solver.move_handle(handle, noisy_pose(&mut noise));
                step(&mut solver, &settings);
            }
        });
        positions(&solver)
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Anything finite at all, in single precision.
    #[test]
    fn any_attachment_leaves_any_particle_finite(
        particles in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -45..37i32, -300..300i32), 1..8),
        compliance in prop_oneof![Just(0.0), (-300..300i32).prop_map(|e| 10f64.powi(e))],
        damping in -10..10i32,
        to in (prop::array::uniform3(-1.0..1.0f64), -40..300i32, 0.0..3.0f64),
        iterations in 1..4u32,
    ) {
        let at: Vec<DVec3> = particles
            .iter()
            .map(|(x, size, _)| DVec3::from_array(*x) * 10f64.powi(*size))
            .collect();
        let mut solver = Solver::<f32>::new(&at);
        let handle = solver.add_handle(Pose::at(DVec3::ONE));
        for (p, (_, _, mass)) in particles.iter().enumerate() {
            solver.set_mass(p, 10f64.powi(*mass));
            solver.attach(p, handle, compliance, 10f64.powi(damping)).unwrap();
        }
        let (to, size, angle) = to;
        solver.move_handle(handle, Pose {
            position: DVec3::from_array(to) * 10f64.powi(size),
            rotation: DQuat::from_rotation_z(angle),
        });
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
    }
}
