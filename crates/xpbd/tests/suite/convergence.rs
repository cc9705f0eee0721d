//! The order of convergence in the substep.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::StepSettings;

use crate::body::{GRAVITY, RUBBER, body, plain, positions, substep};

/// A beam released under its weight, after four frames of that many substeps; kappa is 0.5 with ten.
fn fallen(substeps: u32) -> Vec<DVec3> {
    let mesh = kuhn_box([8, 2, 2], dvec3(0.8, 0.2, 0.2));
    let mut solver = body::<f64>(&mesh, RUBBER);
    for (p, x) in mesh.positions.iter().enumerate() {
        solver.set_fixed(p, x.x == 0.0);
    }
    let settings = StepSettings {
        gravity: Some(GRAVITY),
        substeps,
        ..StepSettings::new(substep(&solver, 0.5).time_step * 10.0)
    };
    for _ in 0..4 {
        solver.step(&plain(&mesh), &settings).unwrap();
    }
    positions(&solver)
}

/// Both the integrator and the order of solving are of first order in the substep. Against 1600 substeps, whose own
/// error is a quarter of that of 400, the slopes of such a method come out as 1.01, 1.05, 1.10, 1.22. Measured 1.32,
/// 1.15, 1.14, 1.24: at kappa 0.5 terms of higher order show.
#[test]
fn the_error_is_of_first_order_in_the_substep() {
    let reference = fallen(1600);
    let error = |substeps: u32| -> f64 {
        let squares = fallen(substeps).into_iter().zip(&reference);
        squares
            .map(|(x, y)| x.distance_squared(*y))
            .sum::<f64>()
            .sqrt()
    };
    let counts = [10, 50, 100, 200, 400];
    let errors = counts.map(error);
    for k in 1..counts.len() {
        let ratio = f64::from(counts[k]) / f64::from(counts[k - 1]);
        let slope = (errors[k - 1] / errors[k]).ln() / ratio.ln();
        // 1.00 is the theory against an exact reference.
        assert!(
            (0.9..1.4).contains(&slope),
            "{} substeps: {slope}",
            counts[k]
        );
    }
}
