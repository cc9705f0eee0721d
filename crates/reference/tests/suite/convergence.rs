//! Newton's method converges quadratically, also from far away, and implicit Euler to first order.

use std::f64::consts::PI;

use glam::{DQuat, DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_reference::{Material, ReferenceBody, Report};

use crate::support::{RUBBER, body, largest_distance, within};

/// Once the residual is a thousandth of the forces at play, each is at most `2 l/μ` times the square of the one before,
/// in proportion, and rounding; so at most four more are needed. (Measured: up to 0.4 l/μ.)
#[track_caller]
fn assert_quadratic(report: &Report, material: Material) {
    let law = material.law();
    let tail = report.residuals.iter().map(|r| r / report.scale);
    let tail: Vec<f64> = tail.skip_while(|&r| r > 1e-3).collect();
    assert!((2..=5).contains(&tail.len()), "{report:?}");
    for pair in tail.windows(2) {
        let bound = 2.0 * law.l / law.mu * pair[0] * pair[0] + report.rounding / report.scale;
        within("next residual", pair[1], bound);
    }
    within(
        "last residual",
        report.residual(),
        (1e-10 * report.scale).max(report.rounding),
    );
    // The estimate of rounding is not what lets these through.
    within("rounding", report.rounding, 1e-10 * report.scale);
}

/// A bar that is held at both ends, and the particles of its far end.
fn bar(material: Material) -> (ReferenceBody, Vec<usize>) {
    let mesh = kuhn_box([8, 2, 2], dvec3(4.0, 1.0, 1.0));
    let mut body = body(&mesh, material);
    let place = |p: usize| mesh.positions[p].x;
    let (near, far) = (
        mesh.positions[0].x,
        mesh.positions.iter().map(|x| x.x).fold(f64::MIN, f64::max),
    );
    for p in 0..mesh.positions.len() {
        body.fixed[p] = place(p) == near || place(p) == far;
    }
    let end = (0..mesh.positions.len())
        .filter(|&p| place(p) == far)
        .collect();
    (body, end)
}

#[test]
fn newton_converges_quadratically() {
    for nu in [0.0, 0.3, 0.45, 0.49] {
        let material = Material {
            poisson_ratio: nu,
            ..RUBBER
        };
        let (mut body, _) = bar(material);
        assert_quadratic(&body.step(0.05, DVec3::NEG_Z * 50.0).unwrap(), material);
        assert_quadratic(&body.settle(DVec3::NEG_Z * 20.0).unwrap(), material);
        // A quarter turn of one end at once.
        let (mut body, end) = bar(material);
        let center = end.iter().map(|&p| body.positions[p]).sum::<DVec3>() / end.len() as f64;
        for p in end {
            body.positions[p] =
                center + DQuat::from_rotation_x(PI / 2.0) * (body.positions[p] - center);
        }
        assert_quadratic(&body.settle(DVec3::ZERO).unwrap(), material);
        assert_eq!(body.inverted(), 0);
    }
}

/// Half the step, half the error: successive differences shrink by 2 to the order. The next term of the error makes it
/// less exact by the step over the period, here a few percent.
#[test]
fn implicit_euler_is_of_first_order() {
    let swing = |steps: u32| {
        let (mut body, end) = bar(RUBBER);
        for p in end {
            body.fixed[p] = false;
        }
        for _ in 0..steps {
            body.step(0.1 / f64::from(steps), DVec3::NEG_Z * 20.0)
                .unwrap();
        }
        body.positions
    };
    let runs = [20, 40, 80, 160].map(swing);
    let differences: Vec<f64> = runs
        .windows(2)
        .map(|r| largest_distance(&r[0], &r[1]))
        .collect();
    for pair in differences.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        within("distance from order 1", (order - 1.0).abs(), 0.15);
    }
    // It has moved: freely it would have fallen by g t²/2, 0.1 m.
    let fallen = largest_distance(&runs[3], &bar(RUBBER).0.positions);
    assert!((0.05..0.15).contains(&fallen), "{fallen}");
}
