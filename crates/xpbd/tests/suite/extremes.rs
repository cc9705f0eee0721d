//! Whatever comes in, as long as it is finite: no infinity and no NaN comes out.

use glam::{DVec3, dvec3};
use incise_mesh::{TetMesh, generate::kuhn_box};
use incise_xpbd::{Collider, Material, Real, Solver, StepSettings};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, RUBBER, body, disturb, plain, positions};

/// Fails unless every number that the solver shows is finite.
#[track_caller]
fn assert_finite<R: Real>(solver: &Solver<R>, what: &str) {
    for p in 0..solver.particle_count() {
        let state = (solver.position(p), solver.velocity(p));
        assert!(
            state.0.is_finite() && state.1.is_finite(),
            "{what}: {p} {state:?}"
        );
    }
    let energy = solver.energy(Some(GRAVITY));
    let sum = energy.kinetic + energy.elastic + energy.gravity;
    assert!(sum.is_finite(), "{what}: {energy:?}");
    let volume = solver.volume();
    assert!(
        (volume.total + volume.min_ratio).is_finite(),
        "{what}: {volume:?}"
    );
}

/// Runs a body from a state through some frames in several modes.
fn survive<R: Real>(
    mesh: &TetMesh,
    material: Material,
    time_step: f64,
    what: &str,
    prepare: &dyn Fn(&mut Solver<R>),
) {
    let schedule = plain(mesh);
    for (substeps, iterations) in [(1, 1), (1, 10), (10, 1)] {
        let mut solver = body::<R>(mesh, material);
        prepare(&mut solver);
        let settings = StepSettings {
            substeps,
            iterations,
            gravity: Some(GRAVITY),
            colliders: vec![Collider::ground(-1.0, 0.5)],
            ..StepSettings::new(time_step)
        };
        for _ in 0..20 {
            solver.step_keeping_residuals(&schedule, &settings).unwrap();
            let residuals = solver.residuals(settings.substep_time()).unwrap();
            assert!(
                (residuals.primal + residuals.dual).is_finite(),
                "{what}: {residuals:?}"
            );
        }
        let what = format!("{what}, {substeps} substeps of {iterations} iterations");
        assert_finite(&solver, &what);
    }
}

fn small() -> TetMesh {
    kuhn_box([2, 2, 2], DVec3::splat(0.125))
}

type Prepare<R> = Box<dyn Fn(&mut Solver<R>)>;
/// A body, a material, a time step, and what is done to the body.
type Case<R> = (TetMesh, Material, f64, Prepare<R>);

fn place<R: Real>(map: impl Fn(usize, DVec3) -> DVec3 + 'static) -> Case<R> {
    let prepare = move |solver: &mut Solver<R>| {
        for p in 0..solver.particle_count() {
            solver.set_position(p, map(p, solver.position(p)));
        }
    };
    (small(), RUBBER, 1.0 / 60.0, Box::new(prepare))
}

fn cases<R: Real>() -> Vec<(String, Case<R>)> {
    let mut cases: Vec<(String, Case<R>)> = vec![
        ("on a point".into(), place(|_, _| DVec3::splat(0.05))),
        ("on the origin".into(), place(|_, _| DVec3::ZERO)),
        ("on a line".into(), place(|_, x| dvec3(x.x, 0.0, 0.0))),
        ("on a plane".into(), place(|_, x| dvec3(x.x, x.y, 0.0))),
        ("mirrored".into(), place(|_, x| dvec3(x.x, x.y, -x.z))),
        ("doubled".into(), place(|_, x| x * 2.0)),
        ("a thousandfold".into(), place(|_, x| x * 1000.0)),
        ("far away".into(), place(|_, x| x + DVec3::splat(1e4))),
        ("denormal".into(), place(|_, x| x * 1e-42)),
        (
            "scrambled".into(),
            place(|p, _| Noise(p as u64).vector() * 0.125),
        ),
    ];
    let mut add =
        |what: String, mesh: TetMesh, material: Material, time: f64, prepare: Prepare<R>| {
            cases.push((what, (mesh, material, time, prepare)));
        };
    let disturbed = || Box::new(|solver: &mut Solver<R>| disturb(solver, 0.01, 13));
    for young_modulus in [1e1, 1e3, 1e6, 1e9, 1e12] {
        for time in [1e-4, 1e-2, 1e-1] {
            for (poisson_ratio, damping) in [(0.0, 0.0), (0.4999, 0.0), (0.3, 10.0)] {
                let material = Material {
                    young_modulus,
                    poisson_ratio,
                    damping,
                    ..RUBBER
                };
                add(
                    format!("{material:?}, time step {time}"),
                    small(),
                    material,
                    time,
                    disturbed(),
                );
            }
        }
    }
    for ratio in [1e-6, 1e-3, 1e3, 1e6] {
        let prepare = move |solver: &mut Solver<R>| {
            disturb(solver, 0.01, 14);
            for p in 0..solver.particle_count() / 2 {
                solver.set_mass(p, solver.mass(p) * ratio);
            }
        };
        add(
            format!("mass ratio {ratio}"),
            small(),
            RUBBER,
            1.0 / 60.0,
            Box::new(prepare),
        );
    }
    for mass in [0.0, 1e-300] {
        let prepare = move |solver: &mut Solver<R>| {
            disturb(solver, 0.01, 15);
            (0..9).for_each(|p| solver.set_mass(p, mass));
        };
        add(
            format!("masses of {mass}"),
            small(),
            RUBBER,
            1.0 / 60.0,
            Box::new(prepare),
        );
    }
    for size in [1e-6, 1e6] {
        let mesh = kuhn_box([2, 2, 2], DVec3::splat(size));
        let prepare = move |solver: &mut Solver<R>| disturb(solver, 0.1 * size, 16);
        add(
            format!("size {size}"),
            mesh,
            RUBBER,
            1.0 / 60.0,
            Box::new(prepare),
        );
    }
    for thickness in [1e-9, 1e-15] {
        let mesh = kuhn_box([2, 2, 2], dvec3(1.0, 1.0, thickness));
        add(
            format!("slivers of {thickness}"),
            mesh,
            RUBBER,
            1.0 / 60.0,
            disturbed(),
        );
    }
    cases
}

fn all_survive<R: Real>() {
    for (what, (mesh, material, time, prepare)) in cases::<R>() {
        survive(&mesh, material, time, &what, &*prepare);
    }
}

#[test]
fn extremes_stay_finite_in_single_precision() {
    all_survive::<f32>();
}

#[test]
fn extremes_stay_finite_in_double_precision() {
    all_survive::<f64>();
}

/// What leaves the range of single precision is put back where it was, and the step says so.
#[test]
fn a_step_out_of_range_is_reported() {
    let mesh = small();
    let mut solver = body::<f32>(&mesh, RUBBER);
    let before = positions(&solver);
    let settings = StepSettings {
        gravity: Some(DVec3::X * 1e300),
        ..StepSettings::new(0.01)
    };
    let report = solver.step(&plain(&mesh), &settings).unwrap();
    assert_eq!(report.repaired, solver.particle_count());
    assert_eq!(positions(&solver), before);
    assert_finite(&solver, "out of range");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Anything at all: sizes, materials and states over many powers of ten.
    #[test]
    fn random_extremes_stay_finite(
        young in 1.0..12.0f64,
        nu in 0.0..0.4999f64,
        density in -3.0..5.0f64,
        damping in -6.0..2.0f64,
        time in -4.0..-1.0f64,
        size in -4.0..4.0f64,
        spread in -6.0..3.0f64,
        seed in any::<u64>(),
    ) {
        let mesh = kuhn_box([2, 1, 1], DVec3::splat(10f64.powf(size)));
        let material = Material {
            young_modulus: 10f64.powf(young),
            poisson_ratio: nu,
            density: 10f64.powf(density),
            damping: 10f64.powf(damping),
        };
        let amount = 10f64.powf(size + spread);
        let time = 10f64.powf(time);
        survive::<f32>(&mesh, material, time, "f32", &|s| disturb(s, amount, seed));
        survive::<f64>(&mesh, material, time, "f64", &|s| disturb(s, amount, seed));
    }
}
