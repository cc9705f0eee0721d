//! The three forms of solving a tet, and damping, on the device against the host.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_graph::Incidence;
use incise_meshing::{Shape, generate};
use incise_xpbd::{Material, Method, Solver, StepSettings, TetSolve};

use crate::solver::{SOFT, body, clusters, schedules, settings, share, tiled};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar, free};

pub(crate) const TET_SOLVES: [TetSolve; 3] =
    [TetSolve::Split, TetSolve::Block, TetSolve::Sequential];

const DAMPED: Material = Material {
    damping: 0.02,
    ..SOFT
};

/// The largest distance of a particle from the origin of the host.
fn extent(solver: &Solver<f32>) -> f64 {
    let lengths = (0..solver.particle_count()).map(|p| solver.position(p).length());
    lengths.fold(0.0, f64::max)
}

/// The largest difference between the velocities of device and host in m/s.
fn velocity_difference(twins: &mut Twins) -> f64 {
    let host = &twins.host;
    let device = twins.device.host().unwrap();
    (0..host.particle_count())
        .map(|p| device.velocity(p).distance(host.velocity(p)))
        .fold(0.0, f64::max)
}

/// Ten frames of each form with `settings`, with and without damping, in `mappings`.
fn compare(test: &str, settings: &StepSettings, mappings: &[(&str, ClusterMapping)]) {
    let Some(gpu) = gpu(test) else { return };
    for tet_solve in TET_SOLVES {
        let settings = StepSettings {
            tet_solve,
            ..settings.clone()
        };
        for &mapping in mappings {
            for material in [SOFT, DAMPED] {
                let mut twins = Twins::new(gpu, &bar(), material, mapping, |_| ());
                for _ in 0..10 {
                    twins.step(&settings);
                }
                let (far, speed) = (twins.apart(), velocity_difference(&mut twins));
                // Ten frames of rounding in another order; velocities are differences of positions over 4 ms.
                let damping = material.damping;
                let what = format!("{test}, {tet_solve:?}, {mapping:?}, damping {damping}");
                assert!(far < 1e-5, "{what}: {far}");
                assert!(speed < 1e-3, "{what}: {speed}");
            }
        }
    }
}

#[test]
fn one_iteration() {
    compare("one_iteration", &settings(), &FORMS);
}

#[test]
fn several_iterations_accumulate_multipliers() {
    let settings = StepSettings {
        substeps: 2,
        iterations: 4,
        relaxation: 0.9,
        ..settings()
    };
    let test = "several_iterations_accumulate_multipliers";
    compare(test, &settings, &FORMS);
}

#[test]
fn jacobi_and_chebyshev() {
    let chebyshev = Method::Chebyshev {
        spectral_radius: 0.9,
        chebyshev_start: 4,
    };
    for method in [Method::Jacobi, chebyshev] {
        for iterations in [1, 12] {
            let settings = StepSettings {
                iterations,
                relaxation: 0.07,
                method,
                ..settings()
            };
            compare("jacobi_and_chebyshev", &settings, &FORMS[..1]);
        }
    }
}

/// Each combination of form, iterations and damping gives its own positions.
#[test]
fn the_selected_form_is_used() {
    let Some(gpu) = gpu("the_selected_form_is_used") else {
        return;
    };
    let after = |tet_solve, iterations, damping| {
        let settings = StepSettings {
            tet_solve,
            iterations,
            ..settings()
        };
        let material = Material { damping, ..SOFT };
        let mut twins = Twins::new(gpu, &bar(), material, FORMS[0], |_| ());
        for _ in 0..10 {
            twins.step(&settings);
        }
        twins.device.host().unwrap().clone()
    };
    let mut solvers = Vec::new();
    for tet_solve in TET_SOLVES {
        for iterations in [1, 2] {
            for damping in [0.0, 0.02] {
                solvers.push(after(tet_solve, iterations, damping));
            }
        }
    }
    for (k, one) in solvers.iter().enumerate() {
        for other in &solvers[k + 1..] {
            // Five times the deviation that other tests allow between the twins.
            assert!(crate::solver::distance(one, other) > 5e-5);
        }
    }
}

/// A stiff free body stays at rest in the split form after a cut, on the device and on the host.
#[test]
fn a_cut_body_stays_at_rest() {
    let Some(gpu) = gpu("a_cut_body_stays_at_rest") else {
        return;
    };
    let still = StepSettings {
        gravity: None,
        ..settings()
    };
    for damping in [0.0, 0.01] {
        let stiff = Material {
            young_modulus: 1e7,
            damping,
            ..SOFT
        };
        for mapping in FORMS {
            for iterations in [1, 3] {
                let still = StepSettings {
                    iterations,
                    ..still.clone()
                };
                let mesh = generate(Shape::Sphere, 200).unwrap();
                let mut twins = Twins::new(gpu, &mesh, stiff, mapping, free);
                for _ in 0..5 {
                    twins.step(&still);
                }
                twins.edit(cut);
                // The cut changes the steps of tiles.
                if mapping.1 == ClusterMapping::Workgroups {
                    let host = &twins.host;
                    let corners = (0..host.tet_count()).map(|t| host.tet_particles(t));
                    let incidence =
                        Incidence::from_constraints(host.particle_count(), corners).unwrap();
                    let (clustering, coloring) = clusters(&mesh, mapping.0);
                    twins.order = tiled(&incidence, &clustering, &coloring);
                }
                for _ in 0..40 {
                    twins.step(&still);
                }
                // A free body drifts by the rounding of its velocities: 6e-8 m over 4 ms, for 0.7 s.
                let drift = 1e-4;
                let far = twins.apart();
                assert!(far < drift, "{mapping:?}: {far}");
                for (p, rest) in mesh.positions.iter().enumerate() {
                    let moved = twins.host.position(p).distance(*rest);
                    assert!(moved < drift, "{mapping:?}: {moved}");
                }
            }
        }
    }
}

/// Separates the tets on both sides of the plane x = 0.
fn cut(solver: &mut Solver<f32>) {
    let low = |solver: &Solver<f32>, tet| {
        let corners = solver.tet_particles(tet);
        corners
            .map(|p| solver.position(p as usize).x)
            .iter()
            .sum::<f64>()
            < 0.0
    };
    let (lower, upper): (Vec<_>, Vec<_>) =
        (0..solver.tet_count()).partition(|&tet| low(solver, tet));
    let kept: HashSet<u32> = lower
        .iter()
        .flat_map(|&t| solver.tet_particles(t))
        .collect();
    let mut copies = HashMap::new();
    for tet in upper {
        let corners = solver.tet_particles(tet).map(|p| {
            if !kept.contains(&p) {
                return p;
            }
            *copies.entry(p).or_insert_with(|| {
                let copy = solver.particle_count();
                solver.push_copy(p as usize);
                u32::try_from(copy).unwrap()
            })
        });
        solver.relink_tet(tet, corners);
    }
    assert!(!copies.is_empty());
    for (p, copy) in copies {
        let half = 0.5 * solver.mass(p as usize);
        solver.set_mass(p as usize, half);
        solver.set_mass(copy as usize, half);
    }
}

/// One substep from states far from rest. Deviations are relative to the size of the state.
#[test]
fn states_far_from_rest() {
    let Some(gpu) = gpu("states_far_from_rest") else {
        return;
    };
    type Map = fn(usize, DVec3) -> DVec3;
    let states: [(&str, Map); 7] = [
        ("collapsed to a point", |_, _| DVec3::splat(0.25)),
        ("collapsed to a plane", |_, x| dvec3(x.x, x.y, 0.25)),
        ("inverted", |_, x| dvec3(-x.x, x.y, x.z)),
        ("inside out and turned", |_, x| dvec3(x.y, x.x, 0.5 * x.z)),
        // The norm of the derivative of det F is 10 at a stretch of 7 along one axis, or 2.4 along all.
        ("stretched along an axis", |_, x| {
            dvec3(20.0 * x.x, x.y, x.z)
        }),
        ("stretched along all axes", |_, x| x * 12.0),
        ("stretched, sheared, inverted", |p, x| {
            dvec3(-30.0 * x.x + 9.0 * x.y, x.y, (p % 3) as f64 * x.z)
        }),
    ];
    for (state, map) in states {
        for mapping in FORMS {
            for (tet_solve, iterations) in TET_SOLVES
                .into_iter()
                .flat_map(|form| [(form, 1), (form, 2)])
            {
                let mut twins = Twins::new(gpu, &bar(), DAMPED, mapping, |solver| {
                    free(solver);
                    for p in 0..solver.particle_count() {
                        solver.set_position(p, map(p, solver.position(p)));
                    }
                });
                let settings = StepSettings {
                    tet_solve,
                    iterations,
                    gravity: None,
                    ..StepSettings::new(0.004)
                };
                let size = extent(&twins.host);
                twins.step(&settings);
                let far = twins.apart() / size;
                let what = format!("{state}, {tet_solve:?}, {mapping:?}, {iterations} iterations");
                assert!(far < 1e-5, "{what}: {far}");
                let speed = velocity_difference(&mut twins) / size;
                assert!(speed < 1e-3, "{what}: {speed}");
            }
        }
    }
}

/// Damping takes a pass at the end of a substep and no memory; a scene without a damped material has no such pass.
#[test]
fn damping_is_a_pass_without_memory() {
    let Some(gpu) = gpu("damping_is_a_pass_without_memory") else {
        return;
    };
    for (method, form) in FORMS {
        let (schedule, _) = schedules(&bar(), method);
        let spent = [SOFT, DAMPED].map(|material| {
            let gpu = share(gpu);
            let mut device = GpuSolver::new(gpu.clone(), body(&bar(), &[material]), form).unwrap();
            device.step(&schedule, &settings()).unwrap();
            let before = gpu.traffic();
            device.step(&schedule, &settings()).unwrap();
            let spent = gpu.traffic().since(before);
            assert_eq!(
                (spent.uploaded_bytes, spent.buffers, spent.passes),
                (0, 0, 1)
            );
            (
                spent.dispatches,
                device.dispatches_per_pass() as u64,
                device.bytes(),
            )
        });
        let [(plain, pass, bytes), (damped, _, damped_bytes)] = spent;
        let substeps = u64::from(settings().substeps);
        assert_eq!(plain, substeps * (2 + pass));
        assert_eq!(damped, substeps * (2 + 2 * pass));
        assert_eq!(bytes, damped_bytes);
    }
}
