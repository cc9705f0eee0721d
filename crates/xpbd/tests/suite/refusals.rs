//! Invalid settings and materials are errors that name the value, and nothing moves then.

use glam::DVec3;
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Material, Solver, StepSettings, XpbdError};

use crate::body::{RUBBER, body, plain, positions};

const NAN: f64 = f64::NAN;
const INFINITY: f64 = f64::INFINITY;

#[test]
fn bad_materials_are_refused_by_name() {
    let young = |young_modulus| Material {
        young_modulus,
        ..RUBBER
    };
    let poisson = |poisson_ratio| Material {
        poisson_ratio,
        ..RUBBER
    };
    let density = |density| Material { density, ..RUBBER };
    let damping = |damping| Material { damping, ..RUBBER };
    let mut table = Vec::new();
    for bad in [0.0, -1.0, NAN, INFINITY] {
        table.push(("young_modulus", bad, young(bad)));
        table.push(("density", bad, density(bad)));
    }
    for bad in [-0.1, 0.5, 0.6, NAN, INFINITY] {
        table.push(("poisson_ratio", bad, poisson(bad)));
    }
    for bad in [-1e-9, NAN, INFINITY] {
        table.push(("damping", bad, damping(bad)));
    }
    let mut solver = Solver::<f32>::new(&[]);
    for (name, bad, material) in table {
        let error = solver.add_material(material).unwrap_err();
        let XpbdError::Material { what, value, range } = &error else {
            panic!("{error} is no material's error");
        };
        assert_eq!((*what, value.to_bits()), (name, bad.to_bits()));
        assert_eq!(
            error.to_string(),
            format!("{name} is {bad}: it must be {range}")
        );
    }
    // None of them was taken.
    assert_eq!(solver.add_material(RUBBER), Ok(0));
    for good in [
        poisson(0.0),
        poisson(0.4999),
        damping(0.0),
        young(1e-3),
        density(1e-3),
    ] {
        assert_eq!(good.check(), Ok(()));
    }
}

#[test]
fn bad_settings_are_refused_by_name_and_nothing_moves() {
    let good = StepSettings {
        gravity: Some(DVec3::NEG_Z),
        ..StepSettings::new(0.01)
    };
    let ground = |height, friction| StepSettings {
        colliders: vec![Collider::ground(height, friction)],
        ..good.clone()
    };
    let mut table = vec![
        (
            "substeps",
            StepSettings {
                substeps: 0,
                ..good.clone()
            },
        ),
        (
            "iterations",
            StepSettings {
                iterations: 0,
                ..good.clone()
            },
        ),
        (
            "gravity",
            StepSettings {
                gravity: Some(DVec3::new(0.0, NAN, 0.0)),
                ..good.clone()
            },
        ),
        (
            "gravity",
            StepSettings {
                gravity: Some(DVec3::INFINITY),
                ..good.clone()
            },
        ),
        ("collider point", ground(NAN, 0.0)),
        ("collider point", ground(-INFINITY, 0.0)),
        ("collider friction", ground(0.0, NAN)),
        ("collider friction", ground(0.0, INFINITY)),
        ("collider friction", ground(0.0, -0.1)),
    ];
    for time_step in [0.0, -0.01, NAN, INFINITY] {
        table.push((
            "time_step",
            StepSettings {
                time_step,
                ..good.clone()
            },
        ));
    }
    for relaxation in [0.0, -0.5, 2.1, NAN, INFINITY] {
        table.push((
            "relaxation",
            StepSettings {
                relaxation,
                ..good.clone()
            },
        ));
    }
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let mut solver = body::<f64>(&mesh, RUBBER);
    for (name, settings) in table {
        for keep in [false, true] {
            let outcome = if keep {
                solver.step_keeping_residuals(&plain(&mesh), &settings)
            } else {
                solver.step(&plain(&mesh), &settings)
            };
            let Err(XpbdError::Setting { what, .. }) = outcome else {
                panic!("{settings:?} gave {outcome:?}");
            };
            assert_eq!(what, name);
        }
        assert_eq!(positions(&solver), mesh.positions);
        assert_eq!(solver.max_speed(), 0.0);
    }
    assert_eq!(good.check(), Ok(()));
    solver.step(&plain(&mesh), &good).unwrap();
    assert!(solver.max_speed() > 0.0);
}

/// Values that fit a double but not the solver's own precision are errors as well.
#[test]
#[should_panic(expected = "positions are finite")]
fn a_position_too_large_for_single_precision_is_refused() {
    Solver::<f32>::new(&[DVec3::ZERO]).set_position(0, DVec3::X * 1e300);
}

#[test]
#[should_panic(expected = "positions are finite")]
fn a_body_that_is_nowhere_is_refused() {
    let _ = Solver::<f64>::new(&[DVec3::ZERO, DVec3::new(0.0, NAN, 0.0)]);
}

#[test]
#[should_panic(expected = "velocities are finite")]
fn a_velocity_too_large_for_single_precision_is_refused() {
    Solver::<f32>::new(&[DVec3::ZERO]).set_velocity(0, DVec3::X * 1e300);
}

#[test]
#[should_panic(expected = "a mass is finite and not negative")]
fn a_negative_mass_is_refused() {
    Solver::<f32>::new(&[DVec3::ZERO]).set_mass(0, -1.0);
}

#[test]
#[should_panic(expected = "the particles of a tet exist")]
fn a_tet_on_missing_particles_is_refused() {
    let mut solver = Solver::<f32>::new(&[DVec3::ZERO; 3]);
    let rubber = solver.add_material(RUBBER).unwrap();
    solver.push_tet(
        [0, 1, 2, 3],
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        rubber,
    );
}

#[test]
#[should_panic(expected = "the schedule belongs to these tets")]
fn a_foreign_schedule_is_refused() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let small = kuhn_box([1, 1, 1], DVec3::ONE);
    let _ = body::<f32>(&small, RUBBER).step(&plain(&mesh), &StepSettings::new(0.01));
}
