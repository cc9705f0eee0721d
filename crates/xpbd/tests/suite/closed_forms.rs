//! Affine and uniaxial stretches, whose answers are known in closed form.
//!
//! Where such a body comes to rest differs from the answer by a part proportional to kappa: the tets are solved one
//! after the other, each sees what the one before it did, and with stress in them that does not cancel. So the answer
//! is approached with the substep, and two runs tell where: a straight line through them meets kappa 0 at the closed
//! form.

use glam::{DMat3, DVec3, dvec3};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Material, Real, Solver};

use crate::body::{KineticDamping, Noise, RUBBER, body, frames, plain, substep, within};

/// Stretched, sheared and turned by up to a tenth.
const AFFINE: DMat3 = DMat3::from_cols(
    dvec3(1.1, 0.05, -0.04),
    dvec3(0.1, 0.95, 0.02),
    dvec3(-0.05, 0.08, 1.05),
);

fn on_boundary(x: DVec3) -> bool {
    x.min_element() == 0.0 || x.max_element() == 1.0
}

/// A cube of 384 tets whose inner particles lie on no grid, stretched by [`AFFINE`] and held on its boundary; the inner
/// particles are that far from where they belong.
fn patch<R: Real>(distance: f64) -> (TetMesh, Solver<R>) {
    let mut mesh = kuhn_box([4, 4, 4], DVec3::ONE);
    let mut noise = Noise(31);
    for x in &mut mesh.positions {
        *x += if on_boundary(*x) {
            DVec3::ZERO
        } else {
            noise.vector() * 0.04
        };
    }
    let mut solver = body::<R>(
        &mesh,
        Material {
            poisson_ratio: 0.3,
            ..RUBBER
        },
    );
    for (p, &x) in mesh.positions.iter().enumerate() {
        let shift = if on_boundary(x) {
            DVec3::ZERO
        } else {
            noise.vector() * distance
        };
        solver.set_position(p, AFFINE * x + shift);
        solver.set_fixed(p, on_boundary(x));
    }
    (mesh, solver)
}

/// Where the inner particles of a patch come to rest, from where they should.
fn deviations<R: Real>(kappa: f64) -> Vec<DVec3> {
    let (mesh, mut solver) = patch::<R>(0.02);
    let (settings, schedule) = (substep(&solver, kappa), plain(&mesh));
    let mut damping = KineticDamping::default();
    // Measured: nothing changes any more after a fifth of that.
    for _ in 0..1600 {
        solver.step(&schedule, &settings).unwrap();
        damping.apply(&mut solver);
    }
    (0..mesh.positions.len())
        .map(|p| solver.position(p) - AFFINE * mesh.positions[p])
        .collect()
}

fn largest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length()).fold(0.0, f64::max)
}

/// The largest force on an inner particle of such a patch in units of E h²: the speed that a substep at kappa 1e-6
/// gives it, in which nothing else happens.
fn force_inside(distance: f64) -> f64 {
    let (mesh, mut solver) = patch::<f64>(distance);
    let settings = substep(&solver, 1e-6);
    solver.step(&plain(&mesh), &settings).unwrap();
    let forces = (0..mesh.positions.len())
        .map(|p| solver.velocity(p).length() * solver.mass(p) / settings.time_step);
    forces.fold(0.0, f64::max) / (RUBBER.young_modulus / 16.0)
}

/// An affine stretch of any mesh has the same stress everywhere and so no force on an inner particle: what is left is
/// of the order of kappa, measured 8e-8. A thousandth of an edge from there the force is 3e-2.
#[test]
fn an_affine_stretch_leaves_no_force_inside() {
    within("affine", force_inside(0.0), 1e-6);
    assert!(force_inside(1e-3) > 1e-2);
}

/// Measured in edges of the cube: 5.8e-3 kappa, in both precisions. So 1e-4 is met at kappa 0.01; no substep a test can
/// afford meets 1e-8, but the straight line through two comes within 1e-7.
#[test]
fn a_patch_comes_to_rest_where_it_should() {
    let [coarse, fine] = [0.02, 0.01].map(deviations::<f64>);
    within("f64", largest(&fine), 1e-4);
    within("f32", largest(&deviations::<f32>(0.01)), 1e-4);
    within("half the kappa", largest(&fine) / largest(&coarse), 0.51);
    let limit: Vec<DVec3> = fine
        .iter()
        .zip(&coarse)
        .map(|(f, c)| *f * 2.0 - *c)
        .collect();
    within("at kappa 0", largest(&limit), 1e-6);
}

/// A bar of square section drawn to `stretch` times its length, its ends free to narrow: the relative errors of its
/// width and of the pull on its end where it comes to rest.
///
/// With width t the side is free of stress, `μ t + l (J - γ) s t = 0`, so `J = γ - μ / (l s)` and `t² = J / s`; the
/// pull on the unit area is `μ s + l (J - γ) t²`.
fn drawn<R: Real>(poisson_ratio: f64, stretch: f64, kappa: f64) -> [f64; 2] {
    const WIDTH: f64 = 0.5;
    let mesh = kuhn_box([4, 2, 2], dvec3(1.0, WIDTH, WIDTH));
    let material = Material {
        poisson_ratio,
        ..RUBBER
    };
    let mut solver = body::<R>(&mesh, material);
    let at_end = |p: usize| [0.0, 1.0].contains(&mesh.positions[p].x);
    for (p, &x) in mesh.positions.iter().enumerate() {
        solver.set_position(p, dvec3(x.x * stretch, x.y, x.z));
    }
    let (settings, schedule) = (substep(&solver, kappa), plain(&mesh));
    let (mut damping, mut pull) = (KineticDamping::default(), 0.0);
    // Fifty times as long as a wave of stress takes to run along it.
    let wave = (RUBBER.density / RUBBER.young_modulus).sqrt();
    for _ in 0..frames(50.0 * wave, &settings) {
        solver.step(&schedule, &settings).unwrap();
        pull = 0.0;
        for p in (0..mesh.positions.len()).filter(|&p| at_end(p)) {
            // A rail across the end holds it back; what it takes is its momentum.
            let (x, v) = (solver.position(p), solver.velocity(p));
            if mesh.positions[p].x == 1.0 {
                pull -= v.x * solver.mass(p) / settings.time_step;
            }
            solver.set_position(p, dvec3(mesh.positions[p].x * stretch, x.y, x.z));
            solver.set_velocity(p, dvec3(0.0, v.y, v.z));
        }
        damping.apply(&mut solver);
    }
    let mean_at = |side: f64| {
        let particles = (0..mesh.positions.len()).filter(|&p| mesh.positions[p].y == side);
        let (sum, count) =
            particles.fold((0.0, 0.0), |(s, n), p| (s + solver.position(p).y, n + 1.0));
        sum / count
    };
    let width = (mean_at(WIDTH) - mean_at(0.0)) / WIDTH;
    let (mu, l, gamma) = (material.mu(), material.volume_stiffness(), material.gamma());
    let volume = gamma - mu / (l * stretch);
    let thin = (volume / stretch).sqrt();
    let stress = mu * stretch + l * (volume - gamma) * thin * thin;
    [width / thin - 1.0, pull / (stress * WIDTH * WIDTH) - 1.0]
}

/// Measured at kappa 0.005: at most 0.06 % of the width and 0.26 % of the pull; at kappa 0.5 the pull lacks up to 24 %,
/// because here the substep's own correction is released at the ends and held inside. At kappa 0: below 3e-5.
#[test]
fn a_drawn_bar_has_the_width_and_the_pull_of_the_closed_form() {
    for poisson_ratio in [0.0, 0.3, 0.45] {
        for stretch in [0.8, 1.5] {
            let [coarse, fine] = [0.02, 0.005].map(|k| drawn::<f64>(poisson_ratio, stretch, k));
            let single = drawn::<f32>(poisson_ratio, stretch, 0.005);
            for k in 0..2 {
                let limit = (4.0 * fine[k] - coarse[k]) / 3.0;
                within("f64", fine[k].abs(), 0.005);
                within("f32", single[k].abs(), 0.01);
                within("at kappa 0", limit.abs(), 1e-3);
            }
        }
    }
}
