//! Jacobi and Chebyshev iterations on the device against those of the host.

use glam::dvec3;
use incise_gpu::{ClusterMapping, GpuError, GpuSolver};
use incise_meshing::{Shape, generate};
use incise_xpbd::{Collider, Material, Method, Pose, Solver, StepSettings, TetSolve};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar};

const CHEBYSHEV: Method = Method::Chebyshev {
    spectral_radius: 0.9,
    chebyshev_start: 4,
};

fn iterated(method: Method) -> StepSettings {
    StepSettings {
        substeps: 2,
        iterations: 20,
        relaxation: 0.07,
        method,
        ..settings()
    }
}

fn twins(
    test: &str,
    material: Material,
    settings: &StepSettings,
    prepare: impl Fn(&mut Solver<f32>),
) {
    let Some(gpu) = gpu(test) else { return };
    for method in ["none", "serial:10"] {
        let form = (method, ClusterMapping::Threads);
        let mut twins = Twins::new(gpu, &bar(), material, form, &prepare);
        let mut other = body(&bar(), &[material]);
        prepare(&mut other);
        let order = twins.order.clone();
        let other_settings = StepSettings {
            method: Method::GaussSeidel,
            ..settings.clone()
        };
        for _ in 0..10 {
            twins.step(settings);
            other.step(&order, &other_settings).unwrap();
        }
        // Ten frames of rounding in another order.
        let far = twins.apart();
        assert!(far < 1e-5, "{test}, {method}: {far}");
        let else_where = crate::solver::distance(&twins.host, &other);
        // More than three times what rounding may do.
        assert!(else_where > 3e-5, "{test}: as if by Gauss-Seidel");
    }
}

#[test]
fn jacobi_gathers_corrections() {
    twins(
        "jacobi_gathers_corrections",
        SOFT,
        &iterated(Method::Jacobi),
        |_| (),
    );
}

#[test]
fn jacobi_needs_no_multipliers_for_one_iteration() {
    let settings = StepSettings {
        substeps: 10,
        iterations: 1,
        tet_solve: TetSolve::Sequential,
        ..iterated(Method::Jacobi)
    };
    let damped = Material {
        damping: 0.01,
        ..SOFT
    };
    let test = "jacobi_needs_no_multipliers_for_one_iteration";
    twins(test, damped, &settings, |_| ());
}

#[test]
fn chebyshev_extrapolates() {
    twins("chebyshev_extrapolates", SOFT, &iterated(CHEBYSHEV), |_| ());
    // The leaps are what makes the difference.
    let mesh = bar();
    let (schedule, _) = schedules(&mesh, "none");
    let [plain, leaping] = [Method::Jacobi, CHEBYSHEV].map(|method| {
        let mut solver = body(&mesh, &[SOFT]);
        for _ in 0..10 {
            solver.step(&schedule, &iterated(method)).unwrap();
        }
        solver
    });
    assert!(crate::solver::distance(&plain, &leaping) > 1e-3);
}

#[test]
fn chebyshev_leaps_between_handles_and_colliders() {
    let settings = StepSettings {
        colliders: vec![Collider::ground(-0.01, 0.4)],
        tet_solve: TetSolve::Sequential,
        ..iterated(CHEBYSHEV)
    };
    let damped = Material {
        damping: 0.01,
        ..SOFT
    };
    let test = "chebyshev_leaps_between_handles_and_colliders";
    twins(test, damped, &settings, |solver| {
        let handle = solver.add_handle(Pose::at(dvec3(1.0, 0.0, 0.1)));
        for p in 0..solver.particle_count() {
            if solver.position(p).x > 0.9 {
                solver.attach(p, handle, 1e-3, 0.0).unwrap();
            }
        }
    });
}

/// One device switches from method to method.
#[test]
fn methods_may_alternate() {
    let Some(gpu) = gpu("methods_may_alternate") else {
        return;
    };
    let mut twins = Twins::new(gpu, &bar(), SOFT, FORMS[0], |_| ());
    let gauss_seidel = StepSettings {
        relaxation: 1.0,
        ..iterated(Method::GaussSeidel)
    };
    for settings in [
        iterated(CHEBYSHEV),
        gauss_seidel,
        iterated(Method::Jacobi),
        iterated(CHEBYSHEV),
    ] {
        twins.step(&settings);
        twins.step(&settings);
    }
    // Eight frames of rounding in another order.
    assert!(twins.apart() < 1e-5);
}

/// Colors of several groups have dispatches of their own.
#[test]
fn large_bodies_gather_as_well() {
    let Some(gpu) = gpu("large_bodies_gather_as_well") else {
        return;
    };
    let mesh = generate(Shape::Sphere, 4000).unwrap();
    let mut twins = Twins::new(gpu, &mesh, SOFT, ("none", ClusterMapping::Threads), |_| ());
    let settings = StepSettings {
        substeps: 1,
        iterations: 8,
        ..iterated(CHEBYSHEV)
    };
    twins.step(&settings);
    twins.step(&settings);
    assert!(twins.device.dispatches_per_pass() > 4);
    // Two frames of rounding in another order.
    assert!(twins.apart() < 1e-6);
}

#[test]
fn workgroups_do_not_gather() {
    let Some(gpu) = gpu("workgroups_do_not_gather") else {
        return;
    };
    let (schedule, _) = schedules(&bar(), "pressure:128");
    let solver = body(&bar(), &[SOFT]);
    let mut device = GpuSolver::new(share(gpu), solver, ClusterMapping::Workgroups).unwrap();
    for method in [Method::Jacobi, CHEBYSHEV] {
        let error = device.step(&schedule, &iterated(method)).unwrap_err();
        assert!(matches!(error, GpuError::Unsupported { .. }), "{error}");
    }
    device.step(&schedule, &settings()).unwrap();
}
