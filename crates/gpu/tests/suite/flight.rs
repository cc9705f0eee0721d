//! Frames that nobody waits for, and positions that arrive while the device goes on.

use std::sync::Arc;

use glam::{DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar};

#[test]
fn frames_that_nobody_reads() {
    let Some(gpu) = gpu("frames_that_nobody_reads") else {
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

/// All positions of a solver.
fn positions(device: &mut GpuSolver) -> Vec<DVec3> {
    let mut positions = Vec::new();
    device.host().unwrap().positions(&mut positions);
    positions
}

/// Positions of a frame arrive although the device has gone on, far from the origin of the world.
#[test]
fn positions_are_those_of_when_they_were_asked_for() {
    let Some(gpu) = gpu("positions_are_those_of_when_they_were_asked_for") else {
        return;
    };
    let mut mesh = bar();
    mesh.positions
        .iter_mut()
        .for_each(|x| *x += dvec3(1e4, -2e4, 3e4));
    for form in FORMS {
        let [mut device, mut other] = [(); 2].map(|()| Twins::new(gpu, &mesh, SOFT, form, |_| ()));
        // At the start the host has them.
        let mut at_once = device.device.begin_readback().unwrap();
        let start = at_once.try_positions().unwrap().map(<[_]>::to_vec);
        assert_eq!(start, Some(positions(&mut device.device)));
        assert_eq!(start, Some(at_once.wait().unwrap()));
        let mut readbacks = Vec::new();
        let mut expected = Vec::new();
        for _ in 0..4 {
            device.device.step(&device.schedule, &settings()).unwrap();
            readbacks.push(device.device.begin_readback().unwrap());
            other.device.step(&other.schedule, &settings()).unwrap();
            expected.push(positions(&mut other.device));
        }
        // Waited for in whatever order.
        let last = readbacks.pop().unwrap();
        assert_eq!(Some(last.wait().unwrap()), expected.pop());
        for (mut readback, expected) in readbacks.into_iter().zip(expected) {
            while readback.try_positions().unwrap().is_none() {
                std::thread::yield_now();
            }
            let arrived = readback.try_positions().unwrap().map(<[_]>::to_vec);
            assert_eq!(arrived, Some(readback.wait().unwrap()), "it stays");
            assert_eq!(arrived, Some(expected));
        }
    }
}

/// Who asks a device that is gone does not wait for ever, and then gets an error.
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
    let [mut looked_at, waited_for] = [(); 2].map(|()| device.begin_readback().unwrap());
    gpu.device().destroy();
    // What was on its way may still arrive; the device is known to be gone once it has nothing to do.
    let lost = |error| matches!(error, GpuError::Lost { .. });
    let ended = loop {
        match looked_at.try_positions().map(|found| found.is_some()) {
            Ok(false) => std::thread::yield_now(),
            ended => break ended,
        }
    };
    assert!(ended.is_ok() || ended.is_err_and(lost));
    let waited = waited_for.wait();
    assert!(waited.is_ok() || waited.is_err_and(lost));
    assert!(gpu.wait().is_err_and(lost));
    assert!(device.step(&schedule, &settings()).is_err_and(lost));
    assert!(device.begin_readback().is_err_and(lost));
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
