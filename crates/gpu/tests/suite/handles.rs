//! Handles on the device against those of the host.

use std::sync::Arc;

use glam::{DQuat, DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_xpbd::{Pose, Solver, StepSettings};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar};

/// The pose of the moving handle at the end of a frame.
fn pose(frame: u32) -> Pose {
    let time = f64::from(frame);
    Pose {
        position: dvec3(1.0, 0.2, 0.2) + dvec3(0.004, 0.002, -0.003) * time,
        rotation: DQuat::from_axis_angle(dvec3(1.0, 2.0, 2.0) / 3.0, 0.03 * time),
    }
}

/// Particles whose x is at least this.
fn beyond(solver: &Solver<f32>, x: f64) -> Vec<usize> {
    let there = |&p: &usize| solver.position(p).x > x - 1e-6;
    (0..solver.particle_count()).filter(there).collect()
}

/// The far end is attached to a moving handle, some particles before it with a compliance to that one and to one at
/// rest; some of the fixed ones are attached as well, which makes no difference.
fn hang(solver: &mut Solver<f32>) {
    let moving = solver.add_handle(pose(0));
    let still = solver.add_handle(Pose::at(DVec3::ZERO));
    for p in beyond(solver, 0.75) {
        let rigid = solver.position(p).x > 0.9;
        let (compliance, damping) = if rigid { (0.0, 0.0) } else { (2e-3, 0.02) };
        solver.attach(p, moving, compliance, damping).unwrap();
    }
    solver.attach(2, still, 1e-2, 0.0).unwrap();
    for p in 0..solver.particle_count() {
        if solver.is_fixed(p) && p % 2 == 0 {
            solver.attach(p, moving, 0.0, 0.0).unwrap();
        }
    }
}

fn turn(test: &str, settings: &StepSettings) {
    let Some(gpu) = gpu(test) else { return };
    for form in FORMS {
        let mut twins = Twins::new(gpu, &bar(), SOFT, form, hang);
        let fixed = beyond(&twins.host, f64::MIN)
            .into_iter()
            .filter(|&p| twins.host.is_fixed(p))
            .map(|p| (p, twins.host.position(p)))
            .collect::<Vec<_>>();
        let held = beyond(&twins.host, 1.0);
        let anchors: Vec<_> = held
            .iter()
            .map(|&p| pose(0).rotation.conjugate() * (twins.host.position(p) - pose(0).position))
            .collect();
        for frame in 1..=10 {
            twins.device.move_handle(0, pose(frame));
            twins.host.move_handle(0, pose(frame));
            twins.step(settings);
        }
        // Ten frames of rounding in another order.
        let far = twins.apart();
        assert!(far < 1e-5, "{test}, {form:?}: {far}");
        let device = twins.device.cached_host();
        assert!(!held.is_empty() && !fixed.is_empty());
        let mut fastest = 0.0;
        for (&p, anchor) in held.iter().zip(anchors) {
            let x = device.position(p);
            // Rotation and sum in single precision.
            assert!(x.distance(pose(10).apply(anchor)) < 1e-6);
            let apart = device.velocity(p).distance(twins.host.velocity(p));
            // The last digit of a position over the time of a substep.
            assert!(apart < 1e-6 / settings.substep_time(), "{test}: {apart}");
            fastest = f64::max(fastest, device.velocity(p).length());
        }
        assert!(fastest > 0.1);
        for (p, x) in fixed {
            assert_eq!(device.position(p), x);
        }
    }
}

#[test]
fn a_turning_handle_is_followed() {
    turn("a_turning_handle_is_followed", &settings());
}

#[test]
fn hanging_particles_keep_multipliers_over_iterations() {
    let settings = StepSettings {
        substeps: 2,
        iterations: 3,
        relaxation: 0.8,
        ..settings()
    };
    turn(
        "hanging_particles_keep_multipliers_over_iterations",
        &settings,
    );
}

/// A particle attached to a handle is fixed and freed again, which does not change its attachment.
#[test]
fn attached_particles_can_be_fixed_and_released() {
    let Some(gpu) = gpu("attached_particles_can_be_fixed_and_released") else {
        return;
    };
    let mut twins = Twins::new(gpu, &bar(), SOFT, FORMS[0], hang);
    let held = beyond(&twins.host, 1.0)[0];
    let mut last = twins.host.position(held);
    for (frame, fixed) in (1..).zip([false, true, true, false]) {
        twins.edit(|solver| solver.set_fixed(held, fixed));
        twins.device.move_handle(0, pose(frame));
        twins.host.move_handle(0, pose(frame));
        twins.step(&settings());
        // A few frames of rounding in another order.
        assert!(twins.apart() < 1e-5, "frame {frame}");
        let now = twins.device.cached_host().position(held);
        assert_eq!(now == last, fixed, "frame {frame}");
        last = now;
    }
}

/// A body held only by springs to handles far from the origin of their frame.
#[test]
fn places_far_from_the_middle_of_a_handle_are_exact() {
    let test = "places_far_from_the_middle_of_a_handle_are_exact";
    let Some(gpu) = gpu(test) else { return };
    let far = dvec3(3e4, -2e4, 1e4);
    let turned = |angle| {
        let rotation = DQuat::from_rotation_z(angle);
        // So that the middle of the body stays where it is.
        let middle = DVec3::splat(0.25);
        Pose {
            position: middle - rotation * (middle - far),
            rotation,
        }
    };
    let hang = |solver: &mut Solver<f32>| {
        let handle = solver.add_handle(turned(0.0));
        for p in beyond(solver, 0.5) {
            solver.attach(p, handle, 0.0, 0.0).unwrap();
        }
    };
    let mut twins = Twins::new(gpu, &bar(), SOFT, FORMS[0], hang);
    for frame in 1..=3 {
        let pose = turned(0.05 * f64::from(frame));
        twins.device.move_handle(0, pose);
        twins.host.move_handle(0, pose);
        twins.step(&settings());
    }
    // The rounding of the body's own size.
    assert!(twins.apart() < 1e-5);
}

/// Handles at rest are sent once, and without attachments there are no dispatches for them.
#[test]
fn handles_at_rest_are_sent_once() {
    let Some(gpu) = gpu("handles_at_rest_are_sent_once") else {
        return;
    };
    let gpu = share(gpu);
    let (schedule, _) = schedules(&bar(), "serial:10");
    let mut solver = body(&bar(), &[SOFT]);
    hang(&mut solver);
    let mut device = GpuSolver::new(Arc::clone(&gpu), solver, ClusterMapping::Threads).unwrap();
    let spent = |device: &mut GpuSolver| {
        let before = gpu.traffic();
        device.step(&schedule, &settings()).unwrap();
        gpu.traffic().since(before)
    };
    spent(&mut device);
    let still = spent(&mut device);
    assert_eq!(
        (still.uploaded_bytes, still.readbacks, still.passes),
        (0, 0, 1)
    );
    let substep = 2 + 3 + device.dispatches_per_pass() as u64;
    assert_eq!(still.dispatches, 4 * substep);
    device.move_handle(0, pose(3));
    let moving = spent(&mut device);
    // Two handles at five times.
    assert_eq!((moving.uploaded_bytes, moving.readbacks), (2 * 5 * 48, 0));
    let arrived = spent(&mut device);
    assert_eq!(arrived.uploaded_bytes, 2 * 5 * 48);
    assert_eq!(spent(&mut device).uploaded_bytes, 0);
    let solver = device.edit().unwrap();
    (0..solver.particle_count()).for_each(|p| solver.detach(p));
    spent(&mut device);
    let without = spent(&mut device);
    assert_eq!(without.dispatches, 4 * (substep - 3));
}
