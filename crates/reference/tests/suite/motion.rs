//! Rest, free fall, momentum, energy: what every step must keep.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use proptest::prelude::*;

use crate::support::{Noise, RUBBER, body, largest_distance, vector, within};

#[test]
fn a_body_at_rest_stays_there() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    for time in [1e-4, 1e-2, 1.0, 100.0] {
        let mut body = body(&mesh, RUBBER);
        for _ in 0..3 {
            let report = body.step(time, DVec3::ZERO).unwrap();
            assert!(report.residual() <= report.rounding);
        }
        // The last digit of positions of order one, a few times.
        let moved = largest_distance(&body.positions, &mesh.positions);
        within("moved", moved, 1e-14);
    }
}

/// Implicit Euler falls by `g Δt² n (n + 1) / 2` in n steps, whatever the body is made of.
#[test]
fn free_fall_is_the_closed_form() {
    let mesh = kuhn_box([2, 1, 1], dvec3(2.0, 1.0, 1.0));
    let gravity = dvec3(0.3, -0.2, -9.81);
    for time in [1e-5, 1e-2, 0.5] {
        let mut body = body(&mesh, RUBBER);
        for n in 1..=20 {
            body.step(time, gravity).unwrap();
            let fallen = gravity * (time * time * f64::from(n * (n + 1)) / 2.0);
            let error = body.positions[3].distance(mesh.positions[3] + fallen);
            within(
                "position",
                error,
                1e-14 * (2.0 + fallen.length()) * f64::from(n),
            );
            let speed = gravity * (time * f64::from(n));
            let error = body.velocities[3].distance(speed);
            within("velocity", error, 1e-10 * speed.length());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Forces are minus the slope of the energy, in every coordinate of every particle.
    #[test]
    fn elastic_forces_are_the_slope_of_energy(seed in any::<u64>(), amount in 0.0..0.5f64) {
        let mesh = kuhn_box([1, 1, 2], dvec3(1.0, 1.0, 2.0));
        let mut body = body(&mesh, RUBBER);
        let mut noise = Noise(seed);
        for x in &mut body.positions {
            *x += noise.vector() * amount;
        }
        let forces = body.elastic_forces();
        for (p, force) in forces.iter().enumerate() {
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let step = 1e-5;
                let mut energy_at = |s: f64| {
                    let here = body.positions[p];
                    body.positions[p] += axis * s;
                    let energy = body.energy().elastic;
                    body.positions[p] = here;
                    energy
                };
                let slope = (energy_at(step) - energy_at(-step)) / (2.0 * step);
                // Rounding 1e-16 of 1e7 J over the step, and the step squared times the stiffness of 1e7 N/m.
                prop_assert!((slope + force.dot(axis)).abs() < 1e-2, "{slope} {force}");
            }
        }
    }

    /// A free body keeps its momentum to the residual. (Implicit Euler does not keep angular momentum.)
    #[test]
    fn momentum_is_kept(seed in any::<u64>(), drift in vector()) {
        let mesh = kuhn_box([2, 1, 1], dvec3(2.0, 1.0, 1.0));
        let mut body = body(&mesh, RUBBER);
        let mut noise = Noise(seed);
        for v in &mut body.velocities {
            *v = drift + noise.vector();
        }
        let momentum = |body: &incise_reference::ReferenceBody| -> DVec3 {
            let each = body.masses().iter().zip(&body.velocities);
            each.map(|(m, v)| v * m).sum()
        };
        let before = momentum(&body);
        for _ in 0..5 {
            body.step(0.01, DVec3::ZERO).unwrap();
        }
        // Each step may leave 1e-10 of some 1e5 N for 0.01 s.
        prop_assert!(momentum(&body).distance(before) < 5e-6);
    }

    /// Without gravity implicit Euler never gains energy, however large the step: the old state costs at least as much
    /// in the potential that the new one minimizes.
    #[test]
    fn energy_never_grows(seed in any::<u64>(), time in 1e-3..1.0f64) {
        let mesh = kuhn_box([2, 1, 1], dvec3(2.0, 1.0, 1.0));
        let mut body = body(&mesh, RUBBER);
        let mut noise = Noise(seed);
        for x in &mut body.positions {
            *x += noise.vector() * 0.1;
        }
        let sum = |body: &incise_reference::ReferenceBody| body.energy().kinetic + body.energy().elastic;
        let mut last = sum(&body);
        for _ in 0..5 {
            body.step(time, DVec3::ZERO).unwrap();
            let now = sum(&body);
            prop_assert!(now <= last * (1.0 + 1e-9) + 1e-9, "{last} J to {now} J");
            last = now;
        }
    }
}

/// A turned body moves as the body does, turned.
#[test]
fn motion_sees_no_rotation() {
    let mesh = kuhn_box([2, 1, 1], dvec3(2.0, 1.0, 1.0));
    let turn = glam::DMat3::from_axis_angle(dvec3(1.0, 2.0, 2.0) / 3.0, 1.0);
    let gravity = dvec3(0.0, 0.0, -9.81);
    let mut plain = body(&mesh, RUBBER);
    let mut turned = body(&mesh, RUBBER);
    for (p, x) in mesh.positions.iter().enumerate() {
        (plain.fixed[p], turned.fixed[p]) = (x.x == 0.0, x.x == 0.0);
        turned.positions[p] = turn * *x;
    }
    for _ in 0..10 {
        plain.step(0.02, gravity).unwrap();
        turned.step(0.02, turn * gravity).unwrap();
    }
    let expected: Vec<DVec3> = plain.positions.iter().map(|x| turn * *x).collect();
    // Each step leaves 1e-10 of the forces, which for this beam is some 1e-10 of its sag.
    within(
        "distance",
        largest_distance(&expected, &turned.positions),
        1e-9,
    );
    assert!(plain.positions[2].distance(mesh.positions[2]) > 1e-3);
}
