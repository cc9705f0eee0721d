//! Colliders on the device against those of the host.

use std::sync::Arc;

use glam::{DQuat, DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, ColliderShape, Solver, StepSettings};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar, free};

/// A free bar, thrown along x onto colliders that start where they are put; they move on from frame to frame.
fn throw(test: &str, colliders: &[Collider]) {
    let Some(gpu) = gpu(test) else { return };
    let prepare = |solver: &mut Solver<f32>| {
        free(solver);
        for p in 0..solver.particle_count() {
            solver.set_velocity(p, dvec3(1.0, 0.3, -1.0));
        }
    };
    for form in FORMS {
        let mut twins = Twins::new(gpu, &bar(), SOFT, form, prepare);
        let mut alone = body(&bar(), &[SOFT]);
        prepare(&mut alone);
        let mut settings = StepSettings {
            colliders: colliders.to_vec(),
            ..settings()
        };
        let (order, _) = schedules(&bar(), form.0);
        for _ in 0..10 {
            twins.step(&settings);
            for collider in &mut settings.colliders {
                *collider = collider.moved(settings.time_step);
            }
            let free = StepSettings {
                colliders: Vec::new(),
                ..settings.clone()
            };
            alone.step(&order, &free).unwrap();
        }
        // Ten frames of rounding in another order, as without colliders.
        let far = twins.apart();
        assert!(far < 1e-5, "{test}, {form:?}: {far}");
        let hit = crate::solver::distance(&twins.host, &alone);
        assert!(hit > 1e-2, "{test}: no collider was touched");
        for p in 0..twins.host.particle_count() {
            let x = twins.device.cached_host().position(p);
            for collider in &settings.colliders {
                // In single precision on a surface.
                assert!(
                    collider.distance(x).0 > -1e-6,
                    "{test}: particle {p} is inside"
                );
            }
        }
    }
}

fn with(shape: ColliderShape, friction: f64, velocity: DVec3) -> Collider {
    Collider {
        friction,
        velocity,
        ..Collider::new(shape)
    }
}

#[test]
fn bodies_slide_on_a_plane() {
    throw("bodies_slide_on_a_plane", &[Collider::ground(-0.02, 0.3)]);
}

#[test]
fn bodies_lie_on_a_moving_slope() {
    let slope = ColliderShape::Plane {
        point: dvec3(0.5, 0.0, -0.02),
        normal: dvec3(-0.3, 0.2, 2.0),
    };
    let slope = with(slope, 0.8, dvec3(-0.5, 0.1, 0.4));
    throw("bodies_lie_on_a_moving_slope", &[slope]);
}

#[test]
fn bodies_fall_on_a_sphere() {
    let sphere = ColliderShape::Sphere {
        center: dvec3(0.4, 0.3, -0.52),
        radius: 0.5,
    };
    throw("bodies_fall_on_a_sphere", &[Collider::new(sphere)]);
}

#[test]
fn bodies_are_pushed_by_a_capsule() {
    let capsule = ColliderShape::Capsule {
        ends: [dvec3(0.3, -0.2, -0.2), dvec3(0.8, 0.7, -0.15)],
        radius: 0.12,
    };
    let capsule = with(capsule, 0.5, dvec3(0.2, 0.0, 0.8));
    throw("bodies_are_pushed_by_a_capsule", &[capsule]);
}

#[test]
fn bodies_fall_on_a_turned_box() {
    let shape = ColliderShape::Box {
        center: dvec3(0.5, 0.25, -0.45),
        half_extents: dvec3(0.3, 0.4, 0.2),
        rotation: DQuat::from_rotation_y(0.7),
    };
    let collider = with(shape, 0.4, dvec3(0.0, 0.3, 0.1));
    throw("bodies_fall_on_a_turned_box", &[collider]);
}

#[test]
fn several_colliders_hand_particles_around() {
    let wall = ColliderShape::Plane {
        point: DVec3::X * 1.03,
        normal: DVec3::NEG_X,
    };
    let sphere = ColliderShape::Sphere {
        center: dvec3(0.9, 0.2, -0.1),
        radius: 0.12,
    };
    let colliders = [
        Collider::ground(-0.03, 0.2),
        with(wall, 0.5, DVec3::NEG_X * 0.2),
        Collider::new(sphere),
    ];
    throw("several_colliders_hand_particles_around", &colliders);
}

/// Particles at the center of a sphere, on the axis of a capsule, in the middle of a box: the same one of all ways out,
/// at once in a long substep and at the depth over 20 ms in short ones.
#[test]
fn particles_on_the_axis_leave_as_on_the_host() {
    let Some(gpu) = gpu("particles_on_the_axis_leave_as_on_the_host") else {
        return;
    };
    let shapes = [
        ColliderShape::Sphere {
            center: DVec3::ZERO,
            radius: 0.3,
        },
        ColliderShape::Capsule {
            ends: [DVec3::NEG_X, DVec3::X],
            radius: 0.3,
        },
        ColliderShape::Box {
            center: DVec3::ZERO,
            half_extents: DVec3::splat(0.3),
            rotation: DQuat::IDENTITY,
        },
    ];
    let times = [(0.02, 1, 0.3), (0.01, 4, 0.15)];
    let cases = shapes
        .into_iter()
        .flat_map(|shape| times.map(|time| (shape, time)));
    for (shape, (time, substeps, way)) in cases {
        let make = || {
            let mut solver = Solver::<f32>::new(&[DVec3::ZERO, DVec3::X * 0.1, DVec3::ONE]);
            (0..3).for_each(|p| solver.set_mass(p, 1.0));
            solver
        };
        let settings = StepSettings {
            substeps,
            colliders: vec![Collider::new(shape)],
            ..StepSettings::new(time)
        };
        let schedule = incise_graph::Schedule::default();
        let mut device = GpuSolver::new(share(gpu), make(), ClusterMapping::Threads).unwrap();
        let mut twin = make();
        device.step(&schedule, &settings).unwrap();
        twin.step(&schedule, &settings).unwrap();
        let there = device.host().unwrap();
        for p in 0..3 {
            // Rounding of a few operations.
            assert!(
                there.position(p).distance(twin.position(p)) < 1e-6,
                "{shape:?} {p}"
            );
        }
        let gone = twin.position(0).length();
        assert!((gone - way).abs() < 1e-6, "{shape:?} {gone}");
    }
}

/// Colliders at rest are sent once.
#[test]
fn colliders_at_rest_are_sent_once() {
    let Some(gpu) = gpu("colliders_at_rest_are_sent_once") else {
        return;
    };
    let gpu = share(gpu);
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let (schedule, _) = schedules(&mesh, "serial:10");
    let mut device = GpuSolver::new(
        Arc::clone(&gpu),
        body(&mesh, &[SOFT]),
        ClusterMapping::Threads,
    )
    .unwrap();
    let mut settings = StepSettings {
        colliders: vec![Collider::ground(-0.1, 0.5), Collider::ground(-0.2, 0.5)],
        ..settings()
    };
    device.step(&schedule, &settings).unwrap();
    let spent = |device: &mut GpuSolver, settings: &StepSettings| {
        let before = gpu.traffic();
        device.step(&schedule, settings).unwrap();
        gpu.traffic().since(before)
    };
    let still = spent(&mut device, &settings);
    assert_eq!(
        (
            still.uploaded_bytes,
            still.buffers,
            still.passes,
            still.submits
        ),
        (0, 0, 1, 1)
    );
    let substep = 3 + device.dispatches_per_pass() as u64;
    assert_eq!(still.dispatches, 4 * substep);
    settings.colliders[0].velocity = DVec3::Z * 0.1;
    let moving = spent(&mut device, &settings);
    assert_eq!(moving.uploaded_bytes, 4 * 2 * 88);
    // Without colliders there is no trace of them.
    settings.colliders.clear();
    let without = spent(&mut device, &settings);
    assert_eq!(without.dispatches, still.dispatches - 4);
}
