//! The solver on the device against its CPU twin.

use std::sync::Arc;

use glam::DVec3;
use incise_clustering::{Method as Clustered, cluster};
use incise_coloring::{Order, color_within_clusters, greedy};
use incise_gpu::{ClusterMapping, GpuContext, GpuSolver};
use incise_graph::{Clustering, ColorId, Coloring, Incidence, Schedule};
use incise_mesh::{TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use incise_xpbd::{Material, Solver, StepSettings, TetSolve};

use crate::support::{gpu, skip};
use crate::tet_solve::TET_SOLVES;

pub(crate) const SOFT: Material = Material {
    young_modulus: 1e5,
    poisson_ratio: 0.45,
    density: 1000.0,
    damping: 0.0,
};

/// A body of one or two materials, held at one side.
pub(crate) fn body(mesh: &TetMesh, materials: &[Material]) -> Solver<f32> {
    let mut solver = Solver::new(&mesh.positions);
    let mut mass = vec![0.0; mesh.positions.len()];
    for material in materials {
        solver.add_material(*material).unwrap();
    }
    for (t, tet) in mesh.tets.iter().enumerate() {
        let material = t % materials.len();
        let rest = mesh.corners(TetId::new(t));
        solver.push_tet(tet.map(|p| p.0), rest, u16::try_from(material).unwrap());
        for p in tet {
            mass[p.index()] += 0.25 * materials[material].density * mesh.volume(TetId::new(t));
        }
    }
    let low = mesh.positions.iter().map(|x| x.x).fold(f64::MAX, f64::min);
    for (p, x) in mesh.positions.iter().enumerate() {
        solver.set_mass(p, mass[p]);
        if x.x < low + 1e-9 {
            solver.set_fixed(p, true);
        }
    }
    solver
}

/// Clusters with their colors.
pub(crate) fn clusters(mesh: &TetMesh, method: &str) -> (Clustering, Coloring) {
    let incidence =
        Incidence::from_constraints(mesh.positions.len(), mesh.tets.iter().copied()).unwrap();
    let clustering = cluster(method.parse::<Clustered>().unwrap(), &incidence);
    let coloring = greedy(&incidence.quotient(&clustering), Order::LargestFirst);
    (clustering, coloring)
}

/// A schedule without clusters that solves the tets in the order in which tiles do.
pub(crate) fn tiled(incidence: &Incidence, clustering: &Clustering, outer: &Coloring) -> Schedule {
    let inner = color_within_clusters(incidence, clustering);
    let steps = inner.color_count();
    let both = clustering.labels().iter().zip(inner.colors());
    let both = both.map(|(cluster, step)| {
        let color = outer.color(cluster.index()).index() * steps + step.index();
        ColorId(u32::try_from(color).unwrap())
    });
    let both = Coloring::new(both.collect());
    Schedule::new(&Clustering::none(clustering.constraint_count()), &both)
}

/// A schedule on clusters, and one without that solves the tets in the order in which tiles do.
pub(crate) fn schedules(mesh: &TetMesh, method: &str) -> (Schedule, Schedule) {
    let incidence =
        Incidence::from_constraints(mesh.positions.len(), mesh.tets.iter().copied()).unwrap();
    let (clustering, coloring) = clusters(mesh, method);
    let tiled = tiled(&incidence, &clustering, &coloring);
    (Schedule::new(&clustering, &coloring), tiled)
}

pub(crate) fn share(gpu: &'static GpuContext) -> Arc<GpuContext> {
    Arc::new(GpuContext::from_device(
        gpu.device().clone(),
        gpu.queue().clone(),
    ))
}

/// The largest distance of a particle from its twin, in units of the body's size of 1.
pub(crate) fn distance(a: &Solver<f32>, b: &Solver<f32>) -> f64 {
    let apart = |p| a.position(p).distance(b.position(p));
    (0..a.particle_count()).map(apart).fold(0.0, f64::max)
}

pub(crate) fn settings() -> StepSettings {
    StepSettings {
        substeps: 4,
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(0.016)
    }
}

fn twins(
    test: &str,
    materials: &[Material],
    settings: &StepSettings,
    method: &str,
    form: ClusterMapping,
) {
    let Some(gpu) = gpu(test) else { return };
    let mesh = kuhn_box([6, 3, 3], DVec3::new(1.0, 0.5, 0.5));
    let (schedule, tiled) = schedules(&mesh, method);
    let mut device = GpuSolver::new(share(gpu), body(&mesh, materials), form).unwrap();
    let mut twin = body(&mesh, materials);
    let order = match form {
        ClusterMapping::Threads => &schedule,
        ClusterMapping::Workgroups => &tiled,
    };
    for _ in 0..10 {
        device.step(&schedule, settings).unwrap();
        twin.step(order, settings).unwrap();
    }
    let far = distance(device.host().unwrap(), &twin);
    // Ten frames of rounding in another order; the bodies move by some centimeters.
    assert!(far < 1e-5, "{test}: {far}");
    assert!(twin.position(mesh.positions.len() - 1).z < 0.5 - 0.01);
    assert_eq!(device.repaired(), 0);
}

#[test]
fn threads_solve_clusters() {
    twins(
        "threads_solve_clusters",
        &[SOFT],
        &settings(),
        "serial:10",
        ClusterMapping::Threads,
    );
}

#[test]
fn threads_solve_damped_bodies_of_several_materials() {
    let stiff = Material {
        young_modulus: 4e5,
        damping: 0.02,
        ..SOFT
    };
    let test = "threads_solve_damped_bodies_of_several_materials";
    twins(
        test,
        &[SOFT, stiff],
        &settings(),
        "serial:5",
        ClusterMapping::Threads,
    );
}

#[test]
fn threads_iterate_with_multipliers() {
    let settings = StepSettings {
        substeps: 2,
        iterations: 3,
        ..settings()
    };
    twins(
        "threads_iterate_with_multipliers",
        &[SOFT],
        &settings,
        "none",
        ClusterMapping::Threads,
    );
}

#[test]
fn threads_solve_one_constraint_after_the_other() {
    let settings = StepSettings {
        tet_solve: TetSolve::Sequential,
        relaxation: 0.9,
        ..settings()
    };
    let test = "threads_solve_one_constraint_after_the_other";
    twins(
        test,
        &[SOFT],
        &settings,
        "serial:10",
        ClusterMapping::Threads,
    );
}

#[test]
fn workgroups_solve_tiles() {
    twins(
        "workgroups_solve_tiles",
        &[SOFT],
        &settings(),
        "pressure:128",
        ClusterMapping::Workgroups,
    );
}

#[test]
fn workgroups_solve_damped_tiles_with_multipliers() {
    let stiff = Material {
        young_modulus: 4e5,
        damping: 0.02,
        ..SOFT
    };
    let settings = StepSettings {
        substeps: 2,
        iterations: 2,
        ..settings()
    };
    let test = "workgroups_solve_damped_tiles_with_multipliers";
    twins(
        test,
        &[SOFT, stiff],
        &settings,
        "pressure:64",
        ClusterMapping::Workgroups,
    );
}

/// A body of several thousand tets has colors of more than one group.
#[test]
fn colors_of_several_groups() {
    let Some(gpu) = gpu("colors_of_several_groups") else {
        return;
    };
    let mesh = generate(Shape::Sphere, 4000).unwrap();
    for (method, form) in [
        ("none", ClusterMapping::Threads),
        ("pressure:128", ClusterMapping::Workgroups),
    ] {
        let (schedule, tiled) = schedules(&mesh, method);
        let mut device = GpuSolver::new(share(gpu), body(&mesh, &[SOFT]), form).unwrap();
        let mut twin = body(&mesh, &[SOFT]);
        for _ in 0..3 {
            device.step(&schedule, &settings()).unwrap();
            let order = if form == ClusterMapping::Threads {
                &schedule
            } else {
                &tiled
            };
            twin.step(order, &settings()).unwrap();
        }
        let far = distance(device.host().unwrap(), &twin);
        assert!(far < 1e-6, "{method}: {far}");
        assert!(device.dispatches_per_pass() <= schedule.color_count());
    }
}

#[test]
fn residuals_come_from_the_device() {
    let Some(gpu) = gpu("residuals_come_from_the_device") else {
        return;
    };
    let mesh = kuhn_box([4, 2, 2], DVec3::new(1.0, 0.5, 0.5));
    for (method, form) in [
        ("serial:10", ClusterMapping::Threads),
        ("pressure:128", ClusterMapping::Workgroups),
    ] {
        for tet_solve in TET_SOLVES {
            for iterations in [1, 2] {
                let settings = StepSettings {
                    tet_solve,
                    iterations,
                    ..settings()
                };
                let what = format!("{method}, {tet_solve:?}, {iterations} iterations");
                let (schedule, tiled) = schedules(&mesh, method);
                let mut device = GpuSolver::new(share(gpu), body(&mesh, &[SOFT]), form).unwrap();
                let mut twin = body(&mesh, &[SOFT]);
                let order = match form {
                    ClusterMapping::Threads => &schedule,
                    ClusterMapping::Workgroups => &tiled,
                };
                for _ in 0..3 {
                    device.step_keeping_residuals(&schedule, &settings).unwrap();
                    twin.step_keeping_residuals(order, &settings).unwrap();
                }
                let time = settings.substep_time();
                let there = device.host().unwrap().residuals(time).unwrap();
                let here = twin.residuals(time).unwrap();
                // Single precision over the square of the time of a substep.
                assert!(
                    (there.force / here.force - 1.0).abs() < 1e-2,
                    "{what}: {there:?} {here:?}"
                );
                assert!(
                    (there.dual / here.dual - 1.0).abs() < 1e-2,
                    "{what}: {there:?} {here:?}"
                );
                device.step(&schedule, &settings).unwrap();
                twin.step(order, &settings).unwrap();
                // A step that keeps nothing has no residuals, as on the host.
                assert_eq!(device.host().unwrap().residuals(time), twin.residuals(time));
            }
        }
    }
}

/// A frame reads nothing back and sends only the settings, once.
#[test]
fn a_frame_reads_nothing_and_sends_nothing() {
    let Some(gpu) = gpu("a_frame_reads_nothing_and_sends_nothing") else {
        return;
    };
    let gpu = share(gpu);
    let mesh = kuhn_box([6, 3, 3], DVec3::new(1.0, 0.5, 0.5));
    for (method, form) in [
        ("serial:10", ClusterMapping::Threads),
        ("pressure:128", ClusterMapping::Workgroups),
    ] {
        let (schedule, _) = schedules(&mesh, method);
        let mut device = GpuSolver::new(Arc::clone(&gpu), body(&mesh, &[SOFT]), form).unwrap();
        device.step(&schedule, &settings()).unwrap();
        let before = gpu.traffic();
        for _ in 0..5 {
            device.step(&schedule, &settings()).unwrap();
        }
        let spent = gpu.traffic().since(before);
        assert_eq!(
            (spent.uploaded_bytes, spent.readbacks, spent.buffers),
            (0, 0, 0)
        );
        assert_eq!((spent.submits, spent.passes), (5, 5));
        let substep = 2 + device.dispatches_per_pass() as u64;
        assert_eq!(spent.dispatches, 5 * 4 * substep);
    }
}

#[test]
fn a_cluster_that_is_too_large_for_a_tile_is_an_error() {
    let Some(gpu) = gpu("a_cluster_that_is_too_large_for_a_tile_is_an_error") else {
        return;
    };
    let mesh = kuhn_box([5, 5, 4], DVec3::ONE);
    let (schedule, _) = schedules(&mesh, "pressure:300");
    let mut device =
        GpuSolver::new(share(gpu), body(&mesh, &[SOFT]), ClusterMapping::Workgroups).unwrap();
    let error = device.step(&schedule, &settings()).unwrap_err();
    assert!(
        matches!(error, incise_gpu::GpuError::Block { limit: 256, .. }),
        "{error}"
    );
}

/// Drivers may round sums in their own way. Lavapipe rounds each operation as the processor does, as long as no compiler
/// takes them in another order: there the twins are equal to the bit, which shows every other difference.
#[test]
fn lavapipe_gives_the_same_bits() {
    let Some(gpu) = gpu("lavapipe_gives_the_same_bits") else {
        return;
    };
    if !gpu.adapter().name.contains("llvmpipe") {
        skip("lavapipe_gives_the_same_bits", &gpu.adapter().name);
        return;
    }
    let mesh = kuhn_box([6, 3, 3], DVec3::new(1.0, 0.5, 0.5));
    let stiff = Material {
        young_modulus: 4e5,
        damping: 0.02,
        ..SOFT
    };
    for materials in [&[SOFT][..], &[SOFT, stiff]] {
        for (method, form) in [
            ("serial:10", ClusterMapping::Threads),
            ("pressure:64", ClusterMapping::Workgroups),
            ("pressure:128", ClusterMapping::Workgroups),
            ("pressure:256", ClusterMapping::Workgroups),
        ] {
            for (tet_solve, iterations) in TET_SOLVES
                .into_iter()
                .flat_map(|form| [(form, 1), (form, 2)])
            {
                let settings = StepSettings {
                    tet_solve,
                    iterations,
                    ..settings()
                };
                let (schedule, tiled) = schedules(&mesh, method);
                let mut device = GpuSolver::new(share(gpu), body(&mesh, materials), form).unwrap();
                let mut twin = body(&mesh, materials);
                let order = if form == ClusterMapping::Threads {
                    &schedule
                } else {
                    &tiled
                };
                for _ in 0..5 {
                    device.step(&schedule, &settings).unwrap();
                    twin.step(order, &settings).unwrap();
                }
                let host = device.host().unwrap();
                for p in 0..twin.particle_count() {
                    assert_eq!(
                        host.particle_data(p),
                        twin.particle_data(p),
                        "{method} {tet_solve:?} {iterations}"
                    );
                }
            }
        }
    }
}
