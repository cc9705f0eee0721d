//! Vibrations: how fast they die with damping, and that nothing is gained without it.

use glam::{DVec3, dvec3};
use incise_mesh::generate::kuhn_box;
use incise_xpbd::{Material, Real, Solver};

use crate::body::{RUBBER, body, disturb, frames, plain, substep, within};

const LENGTH: f64 = 0.8;

/// A slender bar held at one end and let go from its first longitudinal mode: the amplitudes of
/// the far end at its turning points, and the angular frequency between them.
fn ringing<R: Real>(material: Material, kappa: f64) -> (Vec<f64>, f64) {
    let mesh = kuhn_box([16, 2, 2], dvec3(LENGTH, 0.1, 0.1));
    let mut solver = body::<R>(&mesh, material);
    for (p, &x) in mesh.positions.iter().enumerate() {
        solver.set_fixed(p, x.x == 0.0);
        let mode = (std::f64::consts::FRAC_PI_2 * x.x / LENGTH).sin();
        solver.set_position(p, x + DVec3::X * (0.01 * LENGTH * mode));
    }
    let (settings, schedule) = (substep(&solver, kappa), plain(&mesh));
    let end = mesh.positions.len() - 1;
    let stretch = |solver: &Solver<R>| solver.position(end).x - mesh.positions[end].x;
    assert_eq!(mesh.positions[end].x, LENGTH);
    // The amplitude of a half period is the largest stretch between two passages through rest.
    let (mut peaks, mut times) = (vec![0.0_f64], Vec::new());
    let mut last = stretch(&solver);
    for n in 0.. {
        solver.step(&schedule, &settings).unwrap();
        let now = stretch(&solver);
        if now * last < 0.0 {
            times.push(f64::from(n) * settings.time_step);
            peaks.push(0.0);
        }
        last = now;
        let current = peaks.len() - 1;
        peaks[current] = peaks[current].max(now.abs());
        if times.len() == 9 {
            break;
        }
    }
    let omega = std::f64::consts::PI * 8.0 / (times[8] - times[0]);
    (peaks, omega)
}

/// The decay of the logarithm of the amplitude for each radian.
fn decay<R: Real>(material: Material, kappa: f64) -> [f64; 2] {
    let (peaks, omega) = ringing::<R>(material, kappa);
    [
        (peaks[1] / peaks[8]).ln() / (7.0 * std::f64::consts::PI),
        omega,
    ]
}

/// The damping acts along the gradients of the two constraints. At rest both point to a change of volume, so it resists
/// changes of volume by the viscosity `damping · (l + μ/3)` and nothing else: of Rayleigh's `damping · E` a bar under
/// tension feels the part below, 2/3 at Poisson's ratio 0, 17 % at 0.3, 3.6 % at 0.45.
fn part_of_rayleigh(material: &Material) -> f64 {
    let volume_rate = 1.0 - 2.0 * material.poisson_ratio;
    (material.volume_stiffness() + material.mu() / 3.0) * volume_rate * volume_rate
        / material.young_modulus
}

/// Measured: 1.06 to 1.26 times that at Poisson's ratio 0, 1.33 to 1.6 times at 0.3, where it is small beside what the
/// held end and the substep itself take. So a factor of 1.8 either way; full Rayleigh damping would be off by 5.7 at
/// 0.3. The substep's own damping, 1.1 % of critical, is subtracted.
#[test]
fn damping_is_the_volume_part_of_rayleighs() {
    for nu in [0.0, 0.3] {
        let material = |damping| Material {
            poisson_ratio: nu,
            damping,
            ..RUBBER
        };
        let [own, omega] = decay::<f64>(material(0.0), 0.1);
        within("own damping", own, 0.02);
        let stiffness = RUBBER.young_modulus / RUBBER.density;
        let theory = std::f64::consts::FRAC_PI_2 / LENGTH * stiffness.sqrt();
        // Measured 0.3 % and, with the held end narrowing, 1 %.
        within("frequency", (omega / theory - 1.0).abs(), 0.02);
        let part = part_of_rayleigh(&material(0.0));
        for ratio in [0.02, 0.1] {
            let damped = material(2.0 * ratio / omega);
            for [measured, _] in [decay::<f64>(damped, 0.1), decay::<f32>(damped, 0.1)] {
                assert!(measured > own);
                let factor = (measured - own) / (ratio * part);
                within("factor", factor.max(1.0 / factor), 1.8);
            }
        }
    }
}

/// The time in periods in which the amplitude of a bar's first longitudinal vibration halves without damping: from the
/// total energy (which goes with its square) after four periods, so that energy passed on to other vibrations counts.
fn half_life(kappa: f64) -> f64 {
    const PERIODS: f64 = 4.0;
    let mesh = kuhn_box([16, 2, 2], dvec3(LENGTH, 0.1, 0.1));
    let material = Material {
        poisson_ratio: 0.0,
        ..RUBBER
    };
    let mut solver = body::<f64>(&mesh, material);
    for (p, &x) in mesh.positions.iter().enumerate() {
        solver.set_fixed(p, x.x == 0.0);
        let mode = (std::f64::consts::FRAC_PI_2 * x.x / LENGTH).sin();
        solver.set_position(p, x + DVec3::X * (0.01 * LENGTH * mode));
    }
    let (settings, schedule) = (substep(&solver, kappa), plain(&mesh));
    let energy = |solver: &Solver<f64>| {
        let energy = solver.energy(None);
        energy.kinetic + energy.elastic
    };
    let start = energy(&solver);
    let period = 4.0 * LENGTH * (RUBBER.density / RUBBER.young_modulus).sqrt();
    for _ in 0..frames(PERIODS * period, &settings) {
        solver.step(&schedule, &settings).unwrap();
    }
    PERIODS * 2.0 * std::f64::consts::LN_2 / (start / energy(&solver)).ln()
}

/// Without damping the substep itself takes energy, as implicit Euler does, by a part of the order of Δt. Measured 4.8,
/// 9.1, 18.0, 35.6 periods: half the substep doubles them. (At another Poisson's ratio than 0 the bar does not begin in
/// a pure vibration, and what it passes on to fast ones is lost at any substep.)
#[test]
fn the_half_life_of_a_vibration_doubles_with_half_the_substep() {
    let lives = [0.5, 0.125, 1.0 / 32.0, 1.0 / 128.0].map(half_life);
    within("at kappa 0.5", (lives[0] - 4.8).abs(), 0.5);
    for pair in lives.windows(2) {
        within("half the substep", (pair[1] / pair[0] - 1.95).abs(), 0.1);
    }
}

/// The largest and the last energy of a disturbed body that nobody touches, as parts of what it was given: the substep
/// itself damps the fast vibrations (measured 0.28 to 0.84 after the first substep, below 1e-5 after 2000).
fn largest_gain<R: Real>(kappa: f64) -> [f64; 2] {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.01, 10);
    let (settings, schedule) = (substep(&solver, kappa), plain(&mesh));
    let total = |solver: &Solver<R>| {
        let energy = solver.energy(None);
        energy.kinetic + energy.elastic
    };
    let start = total(&solver);
    let (mut largest, mut end) = (0.0, 0.0);
    for _ in 0..2000 {
        solver.step(&schedule, &settings).unwrap();
        end = total(&solver) / start;
        largest = f64::max(largest, end);
    }
    [largest, end]
}

#[test]
fn without_damping_the_energy_does_not_grow() {
    for kappa in [0.5, 0.1, 0.02] {
        for [largest, end] in [largest_gain::<f64>(kappa), largest_gain::<f32>(kappa)] {
            within("largest", largest, 1.0);
            within("in the end", end, 1e-4);
        }
    }
}
