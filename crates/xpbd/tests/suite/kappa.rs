//! Kappa, the number that decides whether a substep is accurate, and the units that decide nothing.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::{Material, Real, Solver, StepSettings};

use crate::body::{RUBBER, advance, body, disturb, plain, positions, within};

fn tet<R: Real>(rest: [DVec3; 4], material: Material) -> Solver<R> {
    let mut solver = Solver::new(&rest);
    let number = solver.add_material(material).unwrap();
    solver.push_tet([0, 1, 2, 3], rest, number);
    solver
}

const CORNER: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

#[test]
fn kappa_of_known_tets() {
    let material = Material {
        young_modulus: 3000.0,
        density: 1000.0,
        ..RUBBER
    };
    // The smallest altitude of the unit corner is 1/√3, onto the slanted face: kappa = 3 · 3 · Δt².
    let solver = tet::<f64>(CORNER, material);
    within("corner", (solver.kappa(1.0) - 9.0).abs(), 1e-14);
    within(
        "corner in f32",
        (tet::<f32>(CORNER, material).kappa(1.0) - 9.0).abs(),
        1e-14,
    );
    // A tet of height 1/4 over a large base: the altitude onto the base is the smallest.
    let flat = [
        DVec3::ZERO,
        DVec3::X * 8.0,
        DVec3::Y * 8.0,
        dvec3(2.0, 2.0, 0.25),
    ];
    within(
        "flat",
        (tet::<f64>(flat, material).kappa(1.0) / 48.0 - 1.0).abs(),
        1e-14,
    );
}

#[test]
fn kappa_scales_with_time_and_size() {
    let one = tet::<f64>(CORNER, RUBBER).kappa(1.0);
    let half = tet::<f64>(CORNER.map(|x| x * 0.5), RUBBER).kappa(1.0);
    assert_eq!(half, 4.0 * one);
    let solver = tet::<f64>(CORNER, RUBBER);
    assert_eq!(solver.kappa(0.25), one / 16.0);
    let heavy = Material {
        density: 4.0 * RUBBER.density,
        ..RUBBER
    };
    assert_eq!(tet::<f64>(CORNER, heavy).kappa(1.0), one / 4.0);
}

#[test]
fn kappa_of_a_body_is_that_of_its_stiffest_tet() {
    let mut solver = tet::<f64>(CORNER, RUBBER);
    assert_eq!(solver.kappa(1.0), solver.kappa_of(0, 1.0));
    let stiff = Material {
        young_modulus: 16.0 * RUBBER.young_modulus,
        ..RUBBER
    };
    let number = solver.add_material(stiff).unwrap();
    solver.push_tet([0, 1, 2, 3], CORNER, number);
    assert_eq!(solver.kappa(1.0), solver.kappa_of(1, 1.0));
    assert_eq!(solver.kappa_of(1, 1.0), 16.0 * solver.kappa_of(0, 1.0));
    assert_eq!(Solver::<f64>::new(&[]).kappa(1.0), 0.0);
}

/// Sizes and times multiplied by the same power of two leave kappa and every digit of the motion as they were, only the
/// exponents change: nothing in the solver depends on the unit of length. In single precision from micrometers on.
#[test]
fn the_unit_of_length_changes_no_digit() {
    fn run<R: Real>(size: f64) -> Vec<DVec3> {
        let mesh = kuhn_box([3, 2, 2], dvec3(0.75, 0.5, 0.5) * size);
        let mut solver = body::<R>(
            &mesh,
            Material {
                damping: 1e-4 * size,
                ..RUBBER
            },
        );
        disturb(&mut solver, 0.0625 * size, 20);
        let settings = StepSettings {
            iterations: 2,
            ..StepSettings::new(1.0 / 512.0 * size)
        };
        advance(&mut solver, &plain(&mesh), &settings, 50);
        positions(&solver).into_iter().map(|x| x / size).collect()
    }
    for power in [-20, -10, 10, 20] {
        assert_eq!(
            run::<f32>(1.0),
            run::<f32>(2f64.powi(power)),
            "2^{power} in f32"
        );
        assert_eq!(
            run::<f64>(1.0),
            run::<f64>(2f64.powi(power)),
            "2^{power} in f64"
        );
    }
}
