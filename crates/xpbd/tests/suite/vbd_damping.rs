//! Damping of materials in VBD: equilibria do not move, vibrations decay as the closed form says.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Material, Real, Solver, VbdSettings,
};

use crate::body::{KineticDamping, RUBBER, body, largest_distance, positions, within};
use crate::vbd::{falling, held_beam, stars};

/// A hanging beam settles at the same place with any damping: within 1e-6 of its sag.
#[test]
fn equilibria_do_not_depend_on_damping() {
    let settled = |damping| {
        let mut solver = held_beam::<f64>(Material { damping, ..RUBBER });
        let mut stars = stars(&solver);
        let mut correction =
            CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
        let mut settings = falling(50);
        settings.tolerance = Some(1e-9);
        let mut still = KineticDamping::default();
        for _ in 0..250 {
            solver
                .step_vbd_two_level(&mut stars, &mut correction, &settings)
                .unwrap();
            still.apply(&mut solver);
        }
        within("speed", solver.max_speed(), 1e-7);
        positions(&solver)
    };
    let free = settled(0.0);
    let sag = largest_distance(&free, &positions(&held_beam::<f64>(RUBBER)));
    for damping in [0.002, 0.01, 0.05] {
        let gap = largest_distance(&free, &settled(damping));
        within(&format!("damping {damping}"), gap, 1e-6 * sag);
    }
}

/// A slender bar is released from its first longitudinal mode. The logarithmic decay of the amplitude for each radian
/// and the angular frequency, from the turning points.
fn decay<R: Real>(material: Material, time: f64) -> [f64; 2] {
    const LENGTH: f64 = 0.8;
    let mesh = kuhn_box([8, 1, 1], dvec3(LENGTH, 0.1, 0.1));
    let mut solver: Solver<R> = body(&mesh, material);
    for (p, &x) in mesh.positions.iter().enumerate() {
        solver.set_fixed(p, x.x == 0.0);
        let mode = (std::f64::consts::FRAC_PI_2 * x.x / LENGTH).sin();
        solver.set_position(p, x + DVec3::X * (0.002 * LENGTH * mode));
    }
    let mut stars = stars(&solver);
    let mut correction =
        CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
    let mut settings = VbdSettings::new(time, 20);
    settings.tolerance = Some(1e-6);
    let end = mesh.positions.len() - 1;
    let (mut peaks, mut times) = (vec![0.0_f64], Vec::new());
    let mut last = 0.0;
    for n in 0.. {
        solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
        let now = solver.position(end).x - LENGTH;
        if now * last < 0.0 {
            times.push((f64::from(n) - now / (now - last)) * time);
            peaks.push(0.0);
        }
        last = now;
        let current = peaks.len() - 1;
        peaks[current] = peaks[current].max(now.abs());
        if times.len() == 5 {
            break;
        }
    }
    let omega = std::f64::consts::PI * 4.0 / (times[4] - times[0]);
    [
        (peaks[1] / peaks[4]).ln() / (3.0 * std::f64::consts::PI),
        omega,
    ]
}

/// Three corners held, the fourth moved by 1e-6 of its height: linear elasticity with the stiffness `V |q|² (2μ + λ)`
/// along the gradient q of its barycentric coordinate and `V |q|² μ` across. Both vibrations are damped oscillators,
/// `m ẍ + k τ ẋ + k x = 0`, each step a backward Euler step of that. What is left is of second order in the strain.
#[test]
fn a_corner_is_a_damped_oscillator() {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for (direction, poisson_ratio) in [
        (DVec3::Z, 0.0),
        (DVec3::Z, 0.4),
        (DVec3::X, 0.1),
        (DVec3::Y, 0.45),
    ] {
        for damping in [0.0, 0.002, 0.05] {
            let material = Material {
                poisson_ratio,
                damping,
                ..RUBBER
            };
            let (mu, mass, time) = (material.mu(), 40.0, 2e-3);
            let lambda = material.volume_stiffness() - mu;
            let modulus = if direction == DVec3::Z {
                2.0 * mu + lambda
            } else {
                mu
            };
            let k = modulus / 6.0;
            let mut solver = Solver::<f64>::new(&rest);
            solver.add_material(material).unwrap();
            solver.push_tet([0, 1, 2, 3], rest, 0);
            solver.set_mass(3, mass);
            let (mut x, mut v) = (1e-6, 0.0);
            solver.set_position(3, DVec3::Z + direction * x);
            let mut stars = stars(&solver);
            for _ in 0..100 {
                solver
                    .step_vbd(&mut stars, &VbdSettings::new(time, 1))
                    .unwrap();
                v = (v - time / mass * k * x) / (1.0 + time / mass * k * (time + damping));
                x += time * v;
                let gap = solver.position(3).distance(DVec3::Z + direction * x);
                within("gap", gap, 1e-4 * 1e-6);
            }
        }
    }
}

/// Of a mode of angular frequency ω the ratio of critical damping is `τ ω / 2`, for any mode and Poisson's ratio,
/// because the viscosity is proportional to the stiffness. What the bar loses without damping, to the step and to other
/// modes, is subtracted; 15 % of the rest remain, as damping changes what other modes get.
#[test]
fn vibrations_decay_as_the_closed_form_says() {
    for nu in [0.0, 0.3, 0.45] {
        let material = |damping| Material {
            poisson_ratio: nu,
            damping,
            ..RUBBER
        };
        let time = 5e-4;
        let [own, omega] = decay::<f64>(material(0.0), time);
        for ratio in [0.02, 0.1] {
            let tau = 2.0 * ratio / omega;
            for [measured, _] in [
                decay::<f64>(material(tau), time),
                decay::<f32>(material(tau), time),
            ] {
                within(
                    &format!("nu {nu} ratio {ratio}: {measured} less {own}"),
                    ((measured - own) / ratio - 1.0).abs(),
                    0.15,
                );
            }
        }
    }
}

/// A free body that turns as a whole keeps its angular momentum, and loses to damping only in second order of the angle
/// of a substep.
#[test]
fn a_rigid_rotation_is_hardly_damped() {
    let spin = |damping| {
        let mesh = kuhn_box([2, 2, 2], DVec3::splat(0.2));
        let mut solver = body::<f64>(&mesh, Material { damping, ..RUBBER });
        for (p, x) in mesh.positions.iter().enumerate() {
            solver.set_velocity(p, DVec3::Z.cross(*x - DVec3::splat(0.1)));
        }
        let mut stars = stars(&solver);
        let mut settings = VbdSettings::new(5e-4, 200);
        settings.tolerance = Some(1e-8);
        for _ in 0..400 {
            solver.step_vbd(&mut stars, &settings).unwrap();
        }
        solver.energy(None).kinetic
    };
    let [free, damped] = [spin(0.0), spin(0.01)];
    within("loss", 1.0 - damped / free, 1e-3);
}

/// Without a damped material there is no matrix of viscosity.
#[test]
fn undamped_bodies_pay_nothing() {
    let bytes = |damping| {
        let mut solver = held_beam::<f32>(Material { damping, ..RUBBER });
        let mut stars = stars(&solver);
        let made = stars.bytes();
        solver.step_vbd(&mut stars, &falling(2)).unwrap();
        stars.bytes() - made
    };
    assert_eq!(bytes(0.0), 0);
    assert!(bytes(0.01) > 0);
}
