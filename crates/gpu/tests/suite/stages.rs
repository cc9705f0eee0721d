//! Times of stages exist, fit into the time that passed, and do not change results.

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, dvec3};
use incise_gpu::{GpuSolver, StageTimes};
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Material, Pose, Solver, StepSettings};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::{gpu, skip};
use crate::twin::{FORMS, bar};

/// A step with its times, which are compared with the clock of the host. `passes` is how many the step may have.
fn timed(device: &mut GpuSolver, step: impl Fn(&mut GpuSolver), passes: f64) -> StageTimes {
    let gpu = Arc::clone(device.gpu());
    gpu.wait().unwrap();
    let start = Instant::now();
    step(device);
    gpu.wait().unwrap();
    let wall = 1e3 * start.elapsed().as_secs_f64();
    let times = device.stage_times().unwrap().expect("the step was timed");
    for time in [
        times.predict,
        times.solve,
        times.other,
        times.update,
        times.damp,
    ] {
        assert!(time.is_finite() && time >= 0.0, "{times:?}");
    }
    // Clocks of devices tick once a microsecond or more often.
    assert!(times.total() <= wall + 1e-3 * passes, "{times:?} of {wall}");
    times
}

#[test]
fn stages_are_timed_and_nothing_changes() {
    let Some(gpu) = gpu("stages_are_timed_and_nothing_changes") else {
        return;
    };
    if !gpu.has_timestamps() {
        skip("stages_are_timed_and_nothing_changes", "no timestamps");
        return;
    }
    let mesh = bar();
    let settings = StepSettings {
        iterations: 2,
        colliders: vec![Collider::ground(0.1, 0.5)],
        ..settings()
    };
    let hang = |solver: &mut Solver<f32>| {
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for (p, compliance) in [(20, 0.0), (30, 1e-3)] {
            solver.attach(p, handle, compliance, 0.0).unwrap();
        }
    };
    let damped = Material {
        damping: 0.01,
        ..SOFT
    };
    let all = FORMS
        .into_iter()
        .flat_map(|form| [SOFT, damped].map(|material| (form, material)));
    for ((method, form), material) in all {
        let gpu = share(gpu);
        let (schedule, _) = schedules(&mesh, method);
        let [mut device, mut other] = [(); 2].map(|()| {
            let mut solver = body(&mesh, &[material]);
            hang(&mut solver);
            GpuSolver::new(Arc::clone(&gpu), solver, form).unwrap()
        });
        let step = |device: &mut GpuSolver| {
            device.move_handle(0, Pose::at(dvec3(0.0, 0.0, 0.01)));
            device.step_keeping_residuals(&schedule, &settings).unwrap();
        };
        step(&mut device);
        step(&mut other);
        assert_eq!(device.stage_times().unwrap(), None);
        device.time_stages(true).unwrap();
        assert_eq!(device.stage_times().unwrap(), None, "nothing was timed yet");
        for _ in 0..3 {
            let before = gpu.traffic();
            let times = timed(&mut device, step, 36.0);
            // In each of four substeps: predict, other, twice solve and other, update, other, and damp with a damped
            // material. The copy of predictions lies between two of them.
            let is_damped = material.damping > 0.0;
            let passes = 8 + u64::from(is_damped);
            assert_eq!(gpu.traffic().since(before).passes, 4 * passes);
            assert!(times.solve > 0.0 && times.other > 0.0, "{times:?}");
            assert_eq!(times.damp > 0.0, is_damped, "{times:?}");
            step(&mut other);
        }
        device.time_stages(false).unwrap();
        let before = gpu.traffic();
        step(&mut device);
        assert_eq!(
            gpu.traffic().since(before).passes,
            2,
            "but for the copy, one"
        );
        assert_eq!(device.stage_times().unwrap(), None);
        step(&mut other);
        let (one, two) = (device.host().unwrap(), other.host().unwrap());
        for p in 0..one.particle_count() {
            assert_eq!(one.particle_data(p), two.particle_data(p));
        }
    }
}

/// A frame with more passes than a query set has queries for.
#[test]
fn long_frames_take_several_query_sets() {
    let Some(gpu) = gpu("long_frames_take_several_query_sets") else {
        return;
    };
    if !gpu.has_timestamps() {
        skip("long_frames_take_several_query_sets", "no timestamps");
        return;
    }
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let (schedule, _) = schedules(&mesh, "serial:10");
    let mut device = GpuSolver::new(share(gpu), body(&mesh, &[SOFT]), FORMS[0].1).unwrap();
    let settings = StepSettings {
        substeps: 700,
        ..settings()
    };
    device.time_stages(true).unwrap();
    let step = |device: &mut GpuSolver| device.step(&schedule, &settings).unwrap();
    step(&mut device);
    let all = timed(&mut device, step, 2100.0);
    // Three a substep in each of two steps, and one that sent the tets.
    assert_eq!(device.gpu().traffic().passes, 2 * 2100 + 1);
    assert!(all.predict > 0.0 && all.update > 0.0);
    assert!(all.other == 0.0 && all.damp == 0.0);
}
