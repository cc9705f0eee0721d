//! Extreme states and settings on the device give no Inf and no NaN.

use glam::{DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Collider, ColliderShape, Material, Method, Pose, Solver, StepSettings};

use crate::scalars::{set_springs, set_volumes};
use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::tet_solve::TET_SOLVES;
use crate::twin::FORMS;

const RUBBER: Material = Material {
    young_modulus: 1e6,
    damping: 0.01,
    ..SOFT
};

fn small() -> TetMesh {
    kuhn_box([3, 2, 2], dvec3(1.0, 0.5, 0.5))
}

/// Runs thirty frames with each form of solving a tet, after which every number is finite.
fn survive(
    test: &str,
    material: Material,
    settings: &StepSettings,
    forms: &[(&str, ClusterMapping)],
    prepare: impl Fn(&mut Solver<f32>),
) {
    let Some(gpu) = gpu(test) else { return };
    let all = TET_SOLVES
        .into_iter()
        .flat_map(|tet_solve| forms.iter().map(move |&form| (tet_solve, form)));
    for (tet_solve, (method, form)) in all {
        let settings = &StepSettings {
            tet_solve,
            ..settings.clone()
        };
        let mesh = small();
        let (schedule, _) = schedules(&mesh, method);
        let mut solver = body(&mesh, &[material]);
        prepare(&mut solver);
        let mut device = GpuSolver::new(share(gpu), solver, form).unwrap();
        for _ in 0..30 {
            device.step(&schedule, settings).unwrap();
        }
        let repaired = device.repaired();
        let solver = device.host().unwrap();
        for p in 0..solver.particle_count() {
            let (x, v) = (solver.position(p), solver.velocity(p));
            assert!(
                x.is_finite() && v.is_finite(),
                "{test}, {tet_solve:?}, {form:?}: {p} {x} {v}, {repaired}"
            );
        }
        let energy = solver.energy(None);
        assert!(
            (energy.kinetic + energy.elastic).is_finite(),
            "{test}: {energy:?}"
        );
    }
}

fn grounded(settings: StepSettings) -> StepSettings {
    StepSettings {
        colliders: vec![Collider::ground(-1.0, 0.5)],
        ..settings
    }
}

/// Moves all particles that are not fixed.
fn place(solver: &mut Solver<f32>, map: impl Fn(usize, DVec3) -> DVec3) {
    for p in 0..solver.particle_count() {
        if !solver.is_fixed(p) {
            solver.set_position(p, map(p, solver.position(p)));
        }
    }
}

/// Numbers between -1 and 1 without order.
fn noise(p: usize) -> DVec3 {
    let coordinate = |axis: usize| {
        let mixed = (3 * p + axis + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)) % 2001) as f64 / 1000.0 - 1.0
    };
    dvec3(coordinate(0), coordinate(1), coordinate(2))
}

#[test]
fn inverted_bodies() {
    survive(
        "inverted_bodies",
        RUBBER,
        &grounded(settings()),
        &FORMS,
        |solver| {
            place(solver, |_, x| dvec3(-x.x, x.y, x.z));
        },
    );
}

#[test]
fn flattened_bodies() {
    survive(
        "flattened_bodies",
        RUBBER,
        &grounded(settings()),
        &FORMS,
        |solver| {
            place(solver, |_, x| dvec3(x.x, x.y, 0.0));
        },
    );
    survive(
        "flattened_bodies",
        RUBBER,
        &grounded(settings()),
        &FORMS,
        |solver| {
            place(solver, |_, _| DVec3::splat(0.1));
        },
    );
}

#[test]
fn scrambled_bodies() {
    survive(
        "scrambled_bodies",
        RUBBER,
        &grounded(settings()),
        &FORMS,
        |solver| {
            place(solver, |p, _| noise(p));
        },
    );
    let huge = |solver: &mut Solver<f32>| place(solver, |p, _| noise(p) * 1e6);
    survive(
        "scrambled_bodies",
        RUBBER,
        &grounded(settings()),
        &FORMS,
        huge,
    );
}

#[test]
fn bodies_of_great_stiffness() {
    let diamond = Material {
        young_modulus: 1e12,
        poisson_ratio: 0.499_99,
        ..RUBBER
    };
    for iterations in [1, 5] {
        let settings = grounded(StepSettings {
            iterations,
            ..settings()
        });
        survive(
            "bodies_of_great_stiffness",
            diamond,
            &settings,
            &FORMS,
            |solver| {
                place(solver, |p, x| x + noise(p) * 0.02);
            },
        );
    }
}

#[test]
fn particles_of_very_different_mass() {
    let test = "particles_of_very_different_mass";
    survive(test, RUBBER, &grounded(settings()), &FORMS, |solver| {
        for p in (0..solver.particle_count()).step_by(3) {
            solver.set_mass(p, solver.mass(p) * 1e6);
        }
    });
}

#[test]
fn one_long_substep() {
    let settings = grounded(StepSettings {
        gravity: Some(DVec3::NEG_Z * 9.81),
        ..StepSettings::new(0.1)
    });
    survive("one_long_substep", RUBBER, &settings, &FORMS, |solver| {
        place(solver, |p, x| x + noise(p) * 0.1);
    });
}

#[test]
fn iterations_that_diverge() {
    let jacobi = StepSettings {
        iterations: 10,
        relaxation: 1.9,
        method: Method::Jacobi,
        ..grounded(settings())
    };
    let chebyshev = StepSettings {
        method: Method::Chebyshev {
            spectral_radius: 0.999,
            chebyshev_start: 1,
        },
        ..jacobi.clone()
    };
    for settings in [jacobi, chebyshev] {
        survive(
            "iterations_that_diverge",
            RUBBER,
            &settings,
            &FORMS[..1],
            |solver| {
                place(solver, |p, x| x + noise(p) * 0.1);
            },
        );
    }
}

/// A scrambled body with springs, volumes to keep, handles and colliders that enclose it.
#[test]
fn everything_at_once() {
    let sphere = ColliderShape::Sphere {
        center: DVec3::ZERO,
        radius: 0.5,
    };
    let shape = ColliderShape::Box {
        center: DVec3::splat(0.3),
        half_extents: DVec3::splat(0.4),
        rotation: glam::DQuat::from_rotation_x(0.4),
    };
    let capsule = ColliderShape::Capsule {
        ends: [DVec3::NEG_X, DVec3::X],
        radius: 0.3,
    };
    let colliders = [sphere, shape, capsule].map(|shape| Collider {
        friction: 1.0,
        velocity: DVec3::NEG_Y,
        ..Collider::new(shape)
    });
    let settings = StepSettings {
        iterations: 2,
        colliders: colliders.to_vec(),
        ..settings()
    };
    survive("everything_at_once", RUBBER, &settings, &FORMS, |solver| {
        set_springs(solver, &small(), 0.1, true);
        set_volumes(solver, &small(), 0.1, true);
        let handle = solver.add_handle(Pose::at(DVec3::ONE));
        solver.move_handle(handle, Pose::at(DVec3::splat(1e6)));
        solver.attach(1, handle, 0.0, 0.0).unwrap();
        solver.attach(5, handle, 1e-9, 1.0).unwrap();
        place(solver, |p, _| noise(p));
    });
}
