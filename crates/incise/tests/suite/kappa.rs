//! Tets too stiff for the substep are softened to the limit and reported; without a limit none is.

use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation};

/// A sphere cut twice, with a report of kappa.
fn cut_sphere() -> Scene {
    let strokes =
        plane(1, [0.013, 0.0, 0.0], [1.0, 0.2, 0.0]) + &plane(2, [0.0, 0.02, 0.0], [0.1, 1.0, 0.3]);
    let mut scene = scene(&format!(
        "[report]\nquantities = [\"kappa\"]\n{}{strokes}",
        body("sphere", 600, [0.0, 0.0, 0.0])
    ));
    // Just under the limit before the cut.
    scene.solver.kappa_limit = 1.01 * unlimited(&scene).kappa();
    scene
}

/// Sets up a scene with its kappa limit removed.
fn unlimited(scene: &Scene) -> Simulation {
    let mut scene = scene.clone();
    scene.solver.kappa_limit = f64::INFINITY;
    simulation(&scene)
}

#[test]
fn slivers_of_a_cut_are_softened_and_reported() {
    let scene = cut_sphere();
    let mut simulation = simulation(&scene);
    assert_eq!(simulation.softened().tets, 0);
    let report = simulation.step().unwrap();
    assert_eq!(report.softened.unwrap().tets, 0);
    let mut last = 0;
    for _ in 0..2 {
        let report = simulation.step().unwrap().clone();
        let softened = report.softened.unwrap();
        assert!(report.cut.is_some() && softened.tets > last, "{softened:?}");
        last = softened.tets;
        assert!(softened.tets < report.tets && softened.strongest > 1.0);
        assert!(
            softened.volume_fraction > 0.0 && softened.volume_fraction < 0.2,
            "{softened:?}"
        );
        // The stiffest tet is softened to the limit but for rounding in single precision.
        let excess = report.kappa.unwrap() / scene.solver.kappa_limit;
        assert!((softened.strongest / excess - 1.0).abs() < 1e-5);
        assert_eq!(simulation.softened(), softened);
    }
}

#[test]
fn an_infinite_limit_softens_none() {
    let mut simulation = unlimited(&cut_sphere());
    let before = simulation.kappa();
    for _ in 0..3 {
        let report = simulation.step().unwrap();
        assert_eq!(report.softened.unwrap().tets, 0);
        assert_eq!(report.softened.unwrap().volume_fraction, 0.0);
    }
    assert!(
        simulation.kappa() > 2.0 * before,
        "the cut left no sliver to speak of"
    );
    simulation.check().unwrap();
}

#[test]
fn a_body_too_stiff_from_the_start_is_softened_as_a_whole() {
    let mut scene = scene(&body("sphere", 400, [0.0, 0.0, 0.0]));
    scene.body[0].young_modulus = 1e9;
    scene.solver.substeps = 5.into();
    scene.solver.kappa_limit = 1.0;
    let stiffest = unlimited(&scene).kappa();
    assert!(stiffest > 1e3);
    let simulation = simulation(&scene);
    let softened = simulation.softened();
    assert_eq!(softened.tets, simulation.mesh().tets.len());
    assert!(
        (softened.volume_fraction - 1.0).abs() < 1e-12,
        "{softened:?}"
    );
    assert!(
        (softened.strongest / stiffest - 1.0).abs() < 1e-5,
        "{softened:?} against {stiffest}"
    );
    // Kappa is still that of the material: the report hides nothing.
    assert_eq!(simulation.kappa(), stiffest);
}
