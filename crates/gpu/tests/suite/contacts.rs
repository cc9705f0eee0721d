//! Contacts on the device.

use glam::DVec3;
use incise_gpu::{ClusterMapping, GpuError, GpuSolver};
use incise_graph::{Coloring, Schedule};
use incise_xpbd::{ContactLaw, Solver, StepSettings};

use crate::solver::share;
use crate::support::gpu;

/// Contacts are refused, not ignored, until they are cleared.
#[test]
fn contacts_are_refused() {
    let Some(gpu) = gpu("contacts_are_refused") else {
        return;
    };
    let mut solver = Solver::<f32>::new(&[DVec3::ZERO]);
    let law = ContactLaw {
        friction: 0.0,
        recovery_time: 0.02,
    };
    let none = Coloring::default();
    solver
        .set_contacts(&law, (&[], &none), (&[], &none))
        .unwrap();
    let mut device = GpuSolver::new(share(gpu), solver, ClusterMapping::Threads).unwrap();
    let settings = StepSettings::new(0.01);
    let refused = device.step(&Schedule::default(), &settings).unwrap_err();
    assert_eq!(refused, GpuError::Unsupported { what: "contacts" });
    device.edit().unwrap().clear_contacts();
    device.step(&Schedule::default(), &settings).unwrap();
}
