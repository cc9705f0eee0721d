//! Another solver in the place of the host's: results equal those of a device that never had the first.

use glam::{DVec3, dvec3};
use incise_gpu::GpuSolver;
use incise_mesh::kuhn_box;
use incise_xpbd::{Pose, Solver};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, bar};

/// Positions and velocities to the bit.
fn state(device: &mut GpuSolver) -> Vec<[u64; 3]> {
    let solver = device.host().unwrap();
    (0..solver.particle_count())
        .flat_map(|p| [solver.position(p), solver.velocity(p)])
        .map(|v| v.to_array().map(f64::to_bits))
        .collect()
}

/// From a bar on a handle to a smaller one that is free, and back, while the device is ahead.
#[test]
fn a_replaced_solver_leaves_nothing_behind() {
    let Some(gpu) = gpu("a_replaced_solver_leaves_nothing_behind") else {
        return;
    };
    let small = kuhn_box([2, 1, 1], dvec3(0.5, 0.2, 0.2));
    let settings = settings();
    for (clustering, form) in FORMS {
        let held = || {
            let mut solver = body(&bar(), &[SOFT]);
            let handle = solver.add_handle(Pose::at(DVec3::ZERO));
            solver.attach(0, handle, 0.0, 0.0).unwrap();
            solver.attach(5, handle, 1e-4, 0.0).unwrap();
            solver
        };
        let kinds: [&dyn Fn() -> Solver<f32>; 2] = [&held, &|| body(&small, &[SOFT])];
        let orders = [bar(), small.clone()].map(|mesh| schedules(&mesh, clustering).0);
        let expected = [0, 1].map(|k| {
            let mut device = GpuSolver::new(share(gpu), kinds[k](), form).unwrap();
            (0..2).for_each(|_| device.step(&orders[k], &settings).unwrap());
            state(&mut device)
        });
        let mut device = GpuSolver::new(share(gpu), held(), form).unwrap();
        for turn in 1..4 {
            let k = turn % 2;
            (0..2).for_each(|_| device.step(&orders[1 - k], &settings).unwrap());
            device.replace(kinds[k]());
            (0..2).for_each(|_| device.step(&orders[k], &settings).unwrap());
            device.check(&orders[k]).unwrap();
            assert!(state(&mut device) == expected[k], "{clustering} {turn}");
        }
    }
}
