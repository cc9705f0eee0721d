//! Energies and forces: rest, rotation, small strains, and that the solver's force is the slope of the energy.

use glam::{DMat3, DQuat, DVec3, dvec3};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};
use incise_xpbd::{Material, Real, Solver};

use crate::body::{Noise, RUBBER, body, disturb, plain, schedule, substep, within};
use crate::finite_elements;

const RATIOS: [f64; 5] = [0.0, 0.1, 0.3, 0.45, 0.49];

fn with_ratio(poisson_ratio: f64) -> Material {
    Material {
        poisson_ratio,
        ..RUBBER
    }
}

fn deform<R: Real>(solver: &mut Solver<R>, mesh: &TetMesh, f: DMat3) {
    for (p, &x) in mesh.positions.iter().enumerate() {
        solver.set_position(p, f * x);
    }
}

fn elastic(solver: &Solver<f64>) -> f64 {
    solver.energy(None).elastic
}

/// The slopes of the elastic energy, negative: central differences with steps of `step`.
fn slopes(solver: &mut Solver<f64>, step: f64) -> Vec<DVec3> {
    let mut out = Vec::new();
    for p in 0..solver.particle_count() {
        let x = solver.position(p);
        out.push(DVec3::from_array([DVec3::X, DVec3::Y, DVec3::Z].map(
            |axis| {
                let [low, high] = [-step, step].map(|s| {
                    solver.set_position(p, x + axis * s);
                    elastic(solver)
                });
                (low - high) / (2.0 * step)
            },
        )));
        solver.set_position(p, x);
    }
    out
}

fn relative_difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    let square = |v: DVec3| v.length_squared();
    let gap: f64 = a.iter().zip(b).map(|(x, y)| square(*x - *y)).sum();
    (gap / b.iter().copied().map(square).sum::<f64>()).sqrt()
}

/// In units of E V. Rounding of F (1e-16) enters the energy times the stress-free slopes `μ F - l (1 - γ) cof F`, whose
/// parts are of the order of E; in single precision the entries of the inverse rest matrix are good to 6e-8.
#[test]
fn elastic_energy_is_zero_at_rest_and_under_rotation() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.17, 0.23));
    let unit = RUBBER.young_modulus * mesh.total_volume();
    let mut double = body::<f64>(&mesh, RUBBER);
    let mut single = body::<f32>(&mesh, RUBBER);
    within("f64 at rest", elastic(&double).abs() / unit, 1e-14);
    within(
        "f32 at rest",
        single.energy(None).elastic.abs() / unit,
        1e-6,
    );
    let mut noise = Noise(1);
    for _ in 0..20 {
        let turn = DQuat::from_scaled_axis(noise.vector() * 3.0);
        deform(&mut double, &mesh, DMat3::from_quat(turn));
        deform(&mut single, &mesh, DMat3::from_quat(turn));
        within("f64 rotated", elastic(&double).abs() / unit, 1e-14);
        within(
            "f32 rotated",
            single.energy(None).elastic.abs() / unit,
            1e-6,
        );
    }
}

/// The largest force on a particle of a rotated body in units of μ times the smallest face, as residual and as what a
/// very short substep makes of it.
fn force_of_rotation<R: Real>(turn: DQuat) -> [f64; 2] {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let mut solver = body::<R>(&mesh, RUBBER);
    deform(&mut solver, &mesh, DMat3::from_quat(turn));
    let settings = substep(&solver, 1e-6);
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    let residual = solver.residuals(settings.time_step).unwrap().force;
    let applied = (0..solver.particle_count())
        .map(|p| solver.velocity(p).length() * solver.mass(p) / settings.time_step)
        .fold(0.0, f64::max);
    [residual, applied].map(|force| force / (RUBBER.mu() * 0.1 * 0.1))
}

/// Measured at most 2e-15 and 4e-7 applied; the residual sums over 36 particles and divides the last digit of their
/// positions by Δt².
#[test]
fn a_rotated_body_feels_no_force() {
    let mut noise = Noise(22);
    for _ in 0..10 {
        let turn = DQuat::from_scaled_axis(noise.vector() * 3.0);
        let [residual, applied] = force_of_rotation::<f64>(turn);
        within("f64 residual", residual, 1e-13);
        within("f64", applied, 1e-14);
        let [residual, applied] = force_of_rotation::<f32>(turn);
        within("f32 residual", residual, 2e-5);
        within("f32", applied, 1e-6);
    }
}

#[test]
fn elastic_energy_does_not_change_under_rotation_of_a_strained_body() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let mut solver = body::<f64>(&mesh, RUBBER);
    disturb(&mut solver, 0.1, 2);
    let before = elastic(&solver);
    for p in 0..solver.particle_count() {
        let turn = DQuat::from_scaled_axis(dvec3(1.0, -2.0, 0.5));
        solver.set_position(p, turn * solver.position(p));
    }
    // Nothing cancels here: rounding only.
    within("change", (elastic(&solver) / before - 1.0).abs(), 1e-13);
}

/// The second derivatives of the energy per volume at rest are `C11 = λ + 2μ` and `C12 = λ` of linear elasticity; with
/// steps of 1e-4 truncation (step²) and rounding (1e-16 / step²) are both about 1e-8, times λ/μ = 49 at ratio 0.49.
/// Without the shift `l = λ + μ` the ratio at 0.3 would come out as 0.167.
#[test]
fn uniaxial_strain_recovers_young_and_poisson() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    for nu in RATIOS {
        let mut solver = body::<f64>(&mesh, with_ratio(nu));
        let mut energy = |x: f64, y: f64| {
            deform(
                &mut solver,
                &mesh,
                DMat3::from_diagonal(dvec3(1.0 + x, 1.0 + y, 1.0)),
            );
            elastic(&solver)
        };
        let h = 1e-4;
        let c11 = (energy(h, 0.0) - 2.0 * energy(0.0, 0.0) + energy(-h, 0.0)) / (h * h);
        let c12 = (energy(h, h) - energy(h, -h) - energy(-h, h) + energy(-h, -h)) / (4.0 * h * h);
        let ratio = c12 / (c11 + c12);
        let young = (c11 - c12) * (c11 + 2.0 * c12) / (c11 + c12);
        within("Poisson's ratio", (ratio - nu).abs(), 1e-4);
        within(
            "Young's modulus",
            (young / RUBBER.young_modulus - 1.0).abs(),
            1e-4,
        );
    }
}

/// Strains of 1e-5 leave a nonlinear part of about 1e-5 times λ/μ.
#[test]
fn force_of_small_strains_is_that_of_linear_elements() {
    let mesh = kuhn_box([2, 2, 2], dvec3(1.0, 0.8, 1.3));
    for nu in RATIOS {
        let mut solver = body::<f64>(&mesh, with_ratio(nu));
        disturb(&mut solver, 1e-5, 3);
        let u: Vec<DVec3> = (0..mesh.positions.len())
            .map(|p| solver.position(p) - mesh.positions[p])
            .collect();
        let linear = finite_elements::forces(&mesh, &with_ratio(nu), &u);
        let force = slopes(&mut solver, 1e-6);
        within("force", relative_difference(&force, &linear), 2e-4);
    }
}

/// One substep from a strained state at speed zero gives each particle the impulse `Δt f`, up to terms of the order of
/// kappa; so at kappa 1e-7 the force that the solver applies is the slope of the energy that it reports.
#[test]
fn the_solver_applies_the_slope_of_the_energy() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    for (nu, clustering) in [(0.0, "none"), (0.3, "serial:5"), (0.49, "none")] {
        let mut solver = body::<f64>(&mesh, with_ratio(nu));
        disturb(&mut solver, 0.1, 4);
        let force = slopes(&mut solver, 1e-6);
        let settings = substep(&solver, 1e-7);
        let schedule = schedule(&mesh, "scgc", clustering);
        solver.step(&schedule, &settings).unwrap();
        let applied: Vec<DVec3> = (0..solver.particle_count())
            .map(|p| solver.velocity(p) * solver.mass(p) / settings.time_step)
            .collect();
        within("applied force", relative_difference(&applied, &force), 1e-5);
    }
}

#[test]
fn energies_of_motion_and_height_are_the_textbook_ones() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let mut solver = body::<f64>(&mesh, RUBBER);
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, dvec3(3.0, 0.0, 4.0));
    }
    let energy = solver.energy(Some(DVec3::NEG_Z * 10.0));
    // A tonne at 5 m/s, its center half a meter up.
    within("kinetic", (energy.kinetic / 12_500.0 - 1.0).abs(), 1e-14);
    within("gravity", (energy.gravity / 5_000.0 - 1.0).abs(), 1e-14);
    assert_eq!(solver.energy(None).gravity, 0.0);
    within("speed", (solver.max_speed() - 5.0).abs(), 0.0);
    let before = energy.elastic;
    solver.step(&plain(&mesh), &substep(&solver, 0.01)).unwrap();
    within(
        "moving at one speed strains nothing",
        (elastic(&solver) - before).abs(),
        1e-6,
    );
}

/// Beside the six tets of a cube a flat one: the difference between the energies with and without it.
#[test]
fn slivers_hold_what_the_other_tets_do_not() {
    let mut mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let [a, b, c, _] = mesh.tets[0];
    let [x, y, z] = [a, b, c].map(|p| mesh.positions[p.index()]);
    let normal = (y - x).cross(z - x).normalize();
    let apex = ParticleId::new(mesh.positions.len());
    let without = elastic(&stretched(&mesh));
    mesh.positions.push((x + y + z) / 3.0 + normal * 1e-3);
    mesh.tets.push([a, b, c, apex]);
    if mesh.volume(TetId::new(mesh.tets.len() - 1)) < 0.0 {
        mesh.tets.last_mut().unwrap().swap(0, 1);
    }
    let with = stretched(&mesh);
    let slivers = with.sliver_energy();
    assert!(slivers > 1e-4 * without);
    within(
        "energy of the sliver",
        ((elastic(&with) - slivers) / without - 1.0).abs(),
        1e-12,
    );
    assert_eq!(
        stretched(&kuhn_box([1, 1, 1], DVec3::ONE)).sliver_energy(),
        0.0
    );
}

/// A body stretched to twice its length.
fn stretched(mesh: &TetMesh) -> Solver<f64> {
    let mut solver = body::<f64>(mesh, RUBBER);
    deform(
        &mut solver,
        mesh,
        DMat3::from_diagonal(dvec3(2.0, 1.0, 1.0)),
    );
    solver
}
