//! Snapshots and changed settings on a GPU, and moves between CPU and GPU.

use std::sync::Arc;

use incise::scene::{Backend, Method, Quantity, SolverSpec};
use incise::{Error, Scene, Simulation};

use crate::gpu::{farthest, gpu};
use crate::snapshot::{everything, halving};
use crate::support::{body, scene};

/// A beam that is held, and a box; small, for the sake of time.
fn two_bodies() -> Scene {
    let beam = body("beam", 300, [0.0, 0.0, 0.0]);
    let cube = body("box", 200, [0.0, 2.0, 0.0]);
    let mut scene = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n\
         {beam}fixed = [{{ half_space = {{ point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n\
         {cube}"
    ));
    scene.solver.substeps = 2.into();
    scene
}

/// Simulates three more frames, the second with a cut; returns all that is visible after each.
fn go_on(simulation: &mut Simulation) -> Vec<Vec<u64>> {
    let frames = (0..3).map(|frame| {
        if frame == 1 {
            simulation.cut(halving(0.1)).unwrap();
        }
        simulation.step().unwrap();
        simulation.check().unwrap();
        everything(simulation)
    });
    frames.collect()
}

fn on(backend: Backend, spec: &SolverSpec) -> SolverSpec {
    spec.clone().with(|spec| spec.backend = backend)
}

#[test]
fn a_restored_device_run_is_bit_identical() {
    let Some(gpu) = gpu("a_restored_device_run_is_bit_identical") else {
        return;
    };
    let plain = two_bodies().solver;
    for solver in [
        plain.clone(),
        plain.clone().with(|spec| {
            spec.method = Method::Jacobi;
            spec.iterations = 3;
            spec.relaxation = 0.05;
        }),
        plain.with(|spec| spec.clustering = "pressure:64".into()),
    ] {
        let mut scene = two_bodies();
        scene.solver = solver;
        let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        there.cut(halving(-0.1)).unwrap();
        (0..2).for_each(|_| assert!(there.step().is_ok()));
        let snapshot = there.snapshot().unwrap();
        let then = go_on(&mut there);
        assert_eq!(there.report().pieces, 6);
        // In the same simulation, in a newly set up one, and in one that was on the processor.
        let mut fresh = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        let mut here = Simulation::new(&scene).unwrap();
        for simulation in [&mut there, &mut fresh, &mut here] {
            simulation.restore(&snapshot).unwrap();
            assert!(go_on(simulation) == then, "{:?}", scene.solver);
            assert_eq!(simulation.report().backend, "gpu");
        }
    }
}

#[test]
fn a_device_at_the_start_is_as_if_set_up_so() {
    let Some(gpu) = gpu("a_device_at_the_start_is_as_if_set_up_so") else {
        return;
    };
    let plain = two_bodies().solver.with(|spec| spec.backend = Backend::Gpu);
    for solver in [
        plain.clone().with(|spec| {
            spec.substeps = 3.into();
            spec.kappa_limit = 0.05;
        }),
        plain
            .clone()
            .with(|spec| spec.clustering = "pressure:64".into()),
        plain.clone().with(|spec| spec.iterations = 2),
        plain.with(|spec| {
            spec.method = Method::Chebyshev;
            spec.iterations = 3;
            spec.relaxation = 0.05;
        }),
    ] {
        let mut scene = two_bodies();
        let [mut from_here, mut from_there] = [
            Simulation::new(&scene).unwrap(),
            Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap(),
        ];
        assert_eq!(from_there.solver_spec().backend, Backend::Gpu);
        from_here.offer_device(Arc::clone(&gpu));
        scene.solver = solver.clone();
        let mut expected = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        let then = go_on(&mut expected);
        for simulation in [&mut from_here, &mut from_there] {
            simulation.set_solver(&solver).unwrap();
            let mut devices = simulation.device_solvers();
            assert!(devices.all(|device| Arc::ptr_eq(device.gpu(), &gpu)));
            drop(devices);
            assert!(go_on(simulation) == then, "{solver:?}");
        }
    }
}

/// There, cut, tuned, and back: the same motion as of a body that never left the processor.
#[test]
fn the_state_goes_there_and_comes_back() {
    let Some(gpu) = gpu("the_state_goes_there_and_comes_back") else {
        return;
    };
    let scene = two_bodies();
    let mut stays = Simulation::new(&scene).unwrap();
    let mut moves = Simulation::new(&scene).unwrap();
    moves.offer_device(gpu);
    let limited = scene.solver.clone().with(|spec| spec.kappa_limit = 0.1);
    let backends = [
        (Backend::Cpu, &scene.solver),
        (Backend::Gpu, &scene.solver),
        (Backend::Gpu, &limited),
        (Backend::Cpu, &limited),
        (Backend::Gpu, &scene.solver),
    ];
    for (turn, (backend, solver)) in backends.into_iter().enumerate() {
        stays.set_solver(solver).unwrap();
        moves.read_back().unwrap();
        let before = moves.positions().to_vec();
        moves.set_solver(&on(backend, solver)).unwrap();
        assert_eq!(moves.positions(), before);
        for simulation in [&mut stays, &mut moves] {
            if turn % 2 == 1 {
                let at = 0.1 * turn as f64 - 0.2;
                simulation.cut(halving(at)).unwrap();
            }
            (0..2).for_each(|_| assert!(simulation.step().is_ok()));
            simulation.check().unwrap();
        }
        let name = if backend == Backend::Gpu {
            "gpu"
        } else {
            "cpu"
        };
        assert_eq!(moves.report().backend, name);
        assert_eq!(moves.backend_note().is_some(), backend == Backend::Gpu);
        moves.read_back().unwrap();
        assert_eq!(stays.mesh().tets, moves.mesh().tets);
        let [one, other] = [stays.softened(), moves.softened()];
        assert_eq!(one.tets, other.tets);
        // Tets that a cut made are those of the positions that were cut, which a device rounds in its own way.
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-4 * a;
        assert!(
            near(one.volume_fraction, other.volume_fraction),
            "{one:?}, {other:?}"
        );
        assert!(near(one.strongest, other.strongest), "{one:?}, {other:?}");
        // The body has a length of 1: single precision and ten frames.
        let far = farthest(stays.positions(), moves.positions());
        assert!(far < 1e-4, "{turn}: {far}");
    }
}

/// A snapshot says where it is computed, too.
#[test]
fn a_snapshot_goes_back_to_its_place() {
    let Some(gpu) = gpu("a_snapshot_goes_back_to_its_place") else {
        return;
    };
    let scene = two_bodies();
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.offer_device(gpu);
    simulation.step().unwrap();
    let here = simulation.snapshot().unwrap();
    let then = go_on(&mut simulation);
    simulation
        .set_solver(&on(Backend::Gpu, &scene.solver))
        .unwrap();
    simulation.step().unwrap();
    let there = simulation.snapshot().unwrap();
    simulation.restore(&here).unwrap();
    assert!(go_on(&mut simulation) == then);
    assert_eq!(simulation.report().backend, "cpu");
    simulation.restore(&there).unwrap();
    assert_eq!(simulation.step().unwrap().backend, "gpu");
    // It knows the way by itself now.
    simulation.restore(&here).unwrap();
    simulation
        .set_solver(&on(Backend::Gpu, &scene.solver))
        .unwrap();
    assert_eq!(simulation.step().unwrap().backend, "gpu");
}

#[test]
fn a_device_is_refused_what_it_does_not_do() {
    let Some(gpu) = gpu("a_device_is_refused_what_it_does_not_do") else {
        return;
    };
    let scene = two_bodies();
    let plain = &scene.solver;
    let vbd = SolverSpec::of(Method::Vbd);
    let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    there.step().unwrap();
    let error = there.set_solver(&on(Backend::Gpu, &vbd)).unwrap_err();
    assert!(
        matches!(&error, Error::Value { field, .. } if field == "solver.method"),
        "{error}"
    );
    assert_eq!(there.step().unwrap().backend, "gpu");
    there.check().unwrap();
    // Automatically it goes where it can.
    there.set_solver(&on(Backend::Auto, &vbd)).unwrap();
    assert!(there.backend_note().unwrap().contains("solver.method"));
    assert_eq!(there.step().unwrap().backend, "cpu");
    there.set_solver(&on(Backend::Auto, plain)).unwrap();
    let name = if gpu.adapter().software { "cpu" } else { "gpu" };
    assert_eq!(there.step().unwrap().backend, name);
}

/// Residuals match those on the processor except for rounding, and exist only in the frames that report them.
#[test]
fn a_device_knows_the_residuals_of_its_tets() {
    let Some(gpu) = gpu("a_device_knows_the_residuals_of_its_tets") else {
        return;
    };
    let mut scene = two_bodies();
    scene.report.every = 2;
    scene.report.quantities = vec![Quantity::Residual];
    let mut there = Simulation::on_device(&scene, gpu).unwrap();
    for frame in 0..4 {
        there.step().unwrap();
        let Some(of_tets) = there.residuals_of_tets() else {
            assert!(frame % 2 == 1, "{frame}");
            // A readback does not bring back those of the frame before the last one, either.
            there.read_back().unwrap();
            assert!(there.residuals_of_tets().is_none());
            continue;
        };
        assert!(frame % 2 == 0);
        let dual = there.report().residual.unwrap().dual.unwrap();
        let sum: f64 = of_tets.iter().map(|left| left * left).sum();
        // Sums of hundreds of squares in double precision, in another order.
        assert!(dual > 0.0 && (sum.sqrt() / dual - 1.0).abs() < 1e-12);
    }
}
