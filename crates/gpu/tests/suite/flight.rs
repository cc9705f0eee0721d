//! Frames in flight, and which frames read back.

use std::sync::Arc;

use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, bar};

#[test]
fn frames_without_readback_equal_awaited_ones() {
    let Some(gpu) = gpu("frames_without_readback_equal_awaited_ones") else {
        return;
    };
    let mesh = bar();
    let gpu = share(gpu);
    let (schedule, _) = schedules(&mesh, FORMS[0].0);
    let [mut free, mut waiting] = [(); 2]
        .map(|()| GpuSolver::new(Arc::clone(&gpu), body(&mesh, &[SOFT]), FORMS[0].1).unwrap());
    let before = gpu.traffic();
    for _ in 0..50 {
        free.step(&schedule, &settings()).unwrap();
    }
    assert_eq!(gpu.traffic().since(before).readbacks, 0);
    for _ in 0..50 {
        waiting.step(&schedule, &settings()).unwrap();
        gpu.wait().unwrap();
    }
    let (one, two) = (free.host().unwrap(), waiting.host().unwrap());
    for p in 0..one.particle_count() {
        assert_eq!(one.particle_data(p), two.particle_data(p));
    }
}

/// A call on a lost device does not wait for ever, and then returns an error.
#[test]
fn a_lost_device_ends_the_waiting() {
    if gpu("a_lost_device_ends_the_waiting").is_none() {
        return;
    }
    // One of its own, since it is destroyed.
    let gpu = Arc::new(GpuContext::new(&GpuOptions::from_env()).unwrap());
    let mesh = bar();
    let (schedule, _) = schedules(&mesh, FORMS[0].0);
    let solver = body(&mesh, &[SOFT]);
    let mut device = GpuSolver::new(Arc::clone(&gpu), solver, FORMS[0].1).unwrap();
    device.step(&schedule, &settings()).unwrap();
    gpu.device().destroy();
    let lost = |error| matches!(error, GpuError::Lost { .. });
    assert!(gpu.wait().is_err_and(lost));
    assert!(device.step(&schedule, &settings()).is_err_and(lost));
    assert!(device.host().is_err_and(lost));
    assert!(device.measure(None).is_err_and(lost));
}

/// A frame with a blade reads back every time.
#[test]
fn reading_back_is_one_submit_and_after_the_first_time_makes_no_buffer() {
    let test = "reading_back_is_one_submit_and_after_the_first_time_makes_no_buffer";
    let Some(gpu) = gpu(test) else { return };
    let gpu = share(gpu);
    let mesh = bar();
    let (schedule, _) = schedules(&mesh, "serial:10");
    let mut device = GpuSolver::new(
        Arc::clone(&gpu),
        body(&mesh, &[SOFT]),
        ClusterMapping::Threads,
    )
    .unwrap();
    let mut read = || {
        device.step(&schedule, &settings()).unwrap();
        let before = gpu.traffic();
        device.host().unwrap();
        gpu.traffic().since(before)
    };
    let first = read();
    assert_eq!((first.submits, first.readbacks), (1, 3));
    for _ in 0..3 {
        let again = read();
        assert_eq!((again.submits, again.readbacks, again.buffers), (1, 3, 0));
    }
}
