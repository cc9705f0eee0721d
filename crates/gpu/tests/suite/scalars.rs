//! Distance and volume constraints on the device against those of the host.

use std::sync::Arc;

use glam::{DVec3, dvec3};
use incise_clustering::{Method as Clustered, cluster};
use incise_coloring::{Order, greedy};
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_graph::{Clustering, Incidence, Schedule};
use incise_mesh::{TetId, TetMesh};
use incise_xpbd::{DistanceConstraint, Solver, StepSettings, VolumeConstraint};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar};

/// An order of solving, on clusters of some constraints or of one each.
fn order<const K: usize>(count: usize, constraints: &[[u32; K]], clustered: bool) -> Schedule {
    let incidence = Incidence::from_constraints(count, constraints.iter().copied()).unwrap();
    let clustering = match clustered {
        true => cluster("serial:4".parse::<Clustered>().unwrap(), &incidence),
        false => Clustering::none(constraints.len()),
    };
    let coloring = greedy(&incidence.quotient(&clustering), Order::LargestFirst);
    Schedule::new(&clustering, &coloring)
}

/// Springs from every particle to some others: soft and rigid, damped and not, one-sided ones, and one between particles
/// that coincide.
fn springs(mesh: &TetMesh, damping: f64) -> Vec<DistanceConstraint> {
    let count = mesh.positions.len();
    let pairs = (0..count).flat_map(|a| [1, 7].map(|step| (a, (a + step) % count)));
    pairs
        .enumerate()
        .map(|(k, (a, b))| DistanceConstraint {
            particles: [a, b].map(|p| u32::try_from(p).unwrap()),
            length: mesh.positions[a].distance(mesh.positions[b]) * (0.9 + 0.02 * (k % 8) as f64),
            compliance: [1e-4, 1e-3, 0.0, 1e-2][k % 4],
            damping: damping * (k % 3) as f64,
            tension_only: k % 2 == 1,
        })
        .collect()
}

pub(crate) fn set_springs(solver: &mut Solver<f32>, mesh: &TetMesh, damping: f64, clustered: bool) {
    let springs = springs(mesh, damping);
    let particles: Vec<_> = springs.iter().map(|spring| spring.particles).collect();
    let order = order(mesh.positions.len(), &particles, clustered);
    solver.set_distances(&springs, order).unwrap();
}

pub(crate) fn set_volumes(solver: &mut Solver<f32>, mesh: &TetMesh, damping: f64, clustered: bool) {
    let particles: Vec<_> = mesh.tets.iter().map(|tet| tet.map(|p| p.0)).collect();
    let constraints: Vec<_> = particles
        .iter()
        .enumerate()
        .map(|(t, &tet)| {
            let mut volume = VolumeConstraint::of_tet(tet, mesh.corners(TetId::new(t)), 1e-6);
            volume.rest_volume *= 1.0 + 0.01 * (t % 5) as f64;
            if t % 7 == 0 {
                // Takes no part.
                volume.rest_volume = 0.0;
            }
            VolumeConstraint { damping, ..volume }
        })
        .collect();
    let order = order(mesh.positions.len(), &particles, clustered);
    solver.set_volumes(&constraints, order).unwrap();
}

fn twins(test: &str, settings: &StepSettings, prepare: impl Fn(&mut Solver<f32>)) {
    let Some(gpu) = gpu(test) else { return };
    for form in FORMS {
        let mut twins = Twins::new(gpu, &bar(), SOFT, form, &prepare);
        let mut without = body(&bar(), &[SOFT]);
        let order = twins.order.clone();
        for _ in 0..10 {
            twins.step(settings);
            without.step(&order, settings).unwrap();
        }
        // Ten frames of rounding in another order.
        let far = twins.apart();
        assert!(far < 1e-5, "{test}, {form:?}: {far}");
        let moved = crate::solver::distance(&twins.host, &without);
        assert!(moved > 1e-3, "{test}: the constraints did nothing");
    }
}

fn iterated() -> StepSettings {
    StepSettings {
        substeps: 2,
        iterations: 3,
        relaxation: 0.9,
        ..settings()
    }
}

#[test]
fn springs_pull() {
    twins("springs_pull", &settings(), |solver| {
        set_springs(solver, &bar(), 0.0, false);
    });
}

#[test]
fn springs_are_damped_and_solved_in_clusters() {
    let test = "springs_are_damped_and_solved_in_clusters";
    twins(test, &settings(), |solver| {
        set_springs(solver, &bar(), 0.01, true);
    });
}

#[test]
fn springs_keep_multipliers() {
    twins("springs_keep_multipliers", &iterated(), |solver| {
        set_springs(solver, &bar(), 0.01, false);
    });
}

#[test]
fn volumes_are_kept() {
    twins("volumes_are_kept", &settings(), |solver| {
        set_volumes(solver, &bar(), 0.0, false);
    });
}

#[test]
fn volumes_are_damped_with_multipliers() {
    let test = "volumes_are_damped_with_multipliers";
    twins(test, &iterated(), |solver| {
        set_springs(solver, &bar(), 0.0, true);
        set_volumes(solver, &bar(), 0.02, true);
    });
}

/// A thread that is slack does nothing; a spring between particles at one place waits.
#[test]
fn constraints_without_direction_do_nothing() {
    let Some(gpu) = gpu("constraints_without_direction_do_nothing") else {
        return;
    };
    let make = || {
        let mut solver = Solver::<f32>::new(&[DVec3::ZERO, DVec3::ZERO, DVec3::X, DVec3::Y]);
        (0..4).for_each(|p| solver.set_mass(p, 1.0));
        solver.set_velocity(2, dvec3(1.0, 0.0, 0.0));
        let spring = DistanceConstraint {
            particles: [0, 1],
            length: 1.0,
            compliance: 0.0,
            damping: 0.0,
            tension_only: false,
        };
        let thread = DistanceConstraint {
            particles: [2, 3],
            length: 2.0,
            tension_only: true,
            ..spring
        };
        let order = order(4, &[spring.particles, thread.particles], false);
        solver.set_distances(&[spring, thread], order).unwrap();
        solver
    };
    let settings = StepSettings::new(0.01);
    let mut device = GpuSolver::new(share(gpu), make(), ClusterMapping::Threads).unwrap();
    let mut twin = make();
    for _ in 0..3 {
        device.step(&Schedule::default(), &settings).unwrap();
        twin.step(&Schedule::default(), &settings).unwrap();
    }
    let there = device.host().unwrap();
    for p in 0..4 {
        // Nothing but a product and a sum a step.
        assert!(there.position(p).distance(twin.position(p)) < 1e-6);
    }
    assert_eq!(there.position(0), DVec3::ZERO);
}

/// Colors of more than 64 constraints have dispatches of their own, small ones share one; edits are followed; nothing is
/// sent twice.
#[test]
fn constraints_are_sent_once_after_edits() {
    let Some(gpu) = gpu("constraints_are_sent_once_after_edits") else {
        return;
    };
    let gpu_of_its_own = share(gpu);
    let mesh = incise_mesh::kuhn_box([12, 4, 4], dvec3(1.0, 0.5, 0.5));
    let (schedule, _) = schedules(&mesh, "serial:10");
    let prepare = |solver: &mut Solver<f32>| set_springs(solver, &mesh, 0.0, false);
    let mut solver = body(&mesh, &[SOFT]);
    prepare(&mut solver);
    let mut device =
        GpuSolver::new(Arc::clone(&gpu_of_its_own), solver, ClusterMapping::Threads).unwrap();
    let mut twin = body(&mesh, &[SOFT]);
    prepare(&mut twin);
    let mut both = |device: &mut GpuSolver| {
        let before = gpu_of_its_own.traffic();
        device.step(&schedule, &settings()).unwrap();
        twin.step(&schedule, &settings()).unwrap();
        gpu_of_its_own.traffic().since(before)
    };
    both(&mut device);
    let still = both(&mut device);
    assert_eq!((still.uploaded_bytes, still.passes), (0, 1));
    let without = 4 * (2 + device.dispatches_per_pass() as u64);
    assert!(
        still.dispatches > without + 4,
        "there are several runs of colors"
    );
    let volumes = |solver: &mut Solver<f32>| {
        solver.set_distances(&[], Schedule::default()).unwrap();
        set_volumes(solver, &mesh, 0.0, true);
    };
    volumes(device.edit().unwrap());
    volumes(&mut twin);
    let mut both = |device: &mut GpuSolver| {
        let before = gpu_of_its_own.traffic();
        device.step(&schedule, &settings()).unwrap();
        twin.step(&schedule, &settings()).unwrap();
        gpu_of_its_own.traffic().since(before)
    };
    both(&mut device);
    assert_eq!(both(&mut device).uploaded_bytes, 0);
    let edit = |solver: &mut Solver<f32>| {
        let tet = mesh.tets[5].map(|p| p.0);
        let volume = VolumeConstraint::of_tet(tet, mesh.corners(TetId::new(5)), 1e-5);
        solver.put_volume(5, volume).unwrap();
    };
    edit(device.edit().unwrap());
    edit(&mut twin);
    for _ in 0..3 {
        device.step(&schedule, &settings()).unwrap();
        twin.step(&schedule, &settings()).unwrap();
    }
    // A few frames of rounding in another order.
    let far = crate::solver::distance(device.host().unwrap(), &twin);
    assert!(far < 1e-5, "{far}");
    let none = |solver: &mut Solver<f32>| solver.set_volumes(&[], Schedule::default()).unwrap();
    none(device.edit().unwrap());
    device.step(&schedule, &settings()).unwrap();
    let before = gpu_of_its_own.traffic();
    device.step(&schedule, &settings()).unwrap();
    assert_eq!(gpu_of_its_own.traffic().since(before).dispatches, without);
}
