//! A body moves wherever it is as it does at the origin of the world: what counts is where it is to itself.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, Coloring, Schedule};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Collider, Material, Real, Solver, StepSettings};

use crate::body::{GRAVITY, RUBBER, advance, body, largest_distance, plain, positions, within};

/// Side of a cell: representable, so that shifted meshes are the same mesh.
const CELL: f64 = 0.125;

fn bar() -> TetMesh {
    kuhn_box([5, 2, 2], DVec3::new(5.0, 2.0, 2.0) * CELL)
}

fn shifted(mesh: &TetMesh, shift: DVec3) -> TetMesh {
    let mut mesh = mesh.clone();
    mesh.positions.iter_mut().for_each(|x| *x += shift);
    mesh
}

/// Positions relative to `shift` and velocities after a bar, held at one end, has hung for 0.2 s and hit the ground.
fn hang<R: Real>(shift: DVec3) -> (Vec<DVec3>, Vec<DVec3>) {
    let mesh = shifted(&bar(), shift);
    let material = Material {
        young_modulus: 1e5,
        damping: 1e-3,
        ..RUBBER
    };
    let mut solver = body::<R>(&mesh, material);
    for (p, x) in mesh.positions.iter().enumerate() {
        if x.x == shift.x {
            solver.set_fixed(p, true);
        }
    }
    let settings = StepSettings {
        substeps: 10,
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(shift.z - 0.0625, 0.5)],
        ..StepSettings::new(0.02)
    };
    advance(&mut solver, &plain(&mesh), &settings, 10);
    let velocities = (0..solver.particle_count()).map(|p| solver.velocity(p));
    let relative = positions(&solver).into_iter().map(|x| x - shift);
    (relative.collect(), velocities.collect())
}

/// Shifts by whole meters are multiples of the mesh's own grid, so the relative positions are the same to the bit. The
/// world's positions are doubles: 1e9 m away their last digit is 1.2e-7 m.
#[test]
fn far_from_the_origin_a_body_moves_as_at_it() {
    let start = bar().positions;
    let single = hang::<f32>(DVec3::ZERO);
    let double = hang::<f64>(DVec3::ZERO);
    assert!(largest_distance(&single.0, &start) > 0.02, "it must move");
    for far in [1e4, 1e6, 1e9] {
        let shift = dvec3(far, -far, far);
        for (what, here, there) in [
            ("f32", &single, hang::<f32>(shift)),
            ("f64", &double, hang::<f64>(shift)),
        ] {
            assert!(here.1 == there.1, "{what} at {far:e}: other velocities");
            let digit = far * f64::EPSILON;
            within(what, largest_distance(&here.0, &there.0), 2.0 * digit);
        }
    }
}

/// Where the shift is no multiple of the grid, the mesh itself is rounded: what remains is rounding in single precision
/// (6e-8 of the 0.6 m), which hanging on a fixed end amplifies by about a hundred.
#[test]
fn an_odd_shift_changes_no_more_than_rounding() {
    let here = hang::<f32>(DVec3::ZERO);
    for far in [1e4, 1e6] {
        let there = hang::<f32>(dvec3(far / 3.0, far / 7.0, -far / 9.0));
        within("odd", largest_distance(&here.0, &there.0), 1e-5);
    }
}

/// How far a bar without forces is from its rest shape after it has flown for `frames` of 0.02 s, and how far it has
/// come.
fn journey<R: Real>(speed: DVec3, frames: usize) -> (f64, DVec3, Solver<R>) {
    let mesh = bar();
    let mut solver = body::<R>(&mesh, RUBBER);
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, speed);
    }
    let settings = StepSettings {
        substeps: 10,
        ..StepSettings::new(0.02)
    };
    advance(&mut solver, &plain(&mesh), &settings, frames);
    let moved = positions(&solver);
    let mean = |x: &[DVec3]| x.iter().sum::<DVec3>() / x.len() as f64;
    let way = mean(&moved) - mean(&mesh.positions);
    let back: Vec<DVec3> = moved.into_iter().map(|x| x - way).collect();
    (largest_distance(&back, &mesh.positions), way, solver)
}

/// Ten kilometers away single precision ends at a millimeter, a hundredth of a cell. With its origin along, the body's
/// coordinates reach 11 m, the way of a frame, and end at 5e-7 m.
#[test]
fn a_body_that_travels_far_takes_its_origin_along() {
    let speed = dvec3(500.0, 0.0, -250.0);
    let (deformed, way, solver) = journey::<f32>(speed, 1000);
    assert!((solver.position(0) - solver.origin()).length() < 15.0);
    // A velocity is exact but for what rounded corrections add to it.
    within("way", (way / 20.0 - speed).length() / speed.length(), 1e-5);
    within("shape", deformed, 100.0 * 5e-7);
    let (deformed, _, _) = journey::<f64>(speed, 100);
    within("f64 shape", deformed, 100.0 * 1e-15);
}

#[test]
fn a_new_origin_moves_no_fixed_particle_and_no_position() {
    let mut solver = Solver::<f32>::new(&[DVec3::ZERO, DVec3::X]);
    for p in 0..2 {
        solver.set_position(p, solver.position(p) + DVec3::new(48.0, 0.5, -16.0));
    }
    let before = positions(&solver);
    assert_eq!(solver.origin(), DVec3::ZERO);
    let schedule = Schedule::new(&Clustering::none(0), &Coloring::new(Vec::new()));
    solver.step(&schedule, &StepSettings::new(0.01)).unwrap();
    assert_eq!(solver.origin(), DVec3::new(48.0, 0.0, -16.0));
    assert_eq!(positions(&solver), before);
}

/// Measures do not see the distance either.
#[test]
fn measures_are_those_of_the_body() {
    let measure = |shift: DVec3| {
        let mesh = shifted(&bar(), shift);
        let mut solver = body::<f32>(&mesh, RUBBER);
        for p in 0..solver.particle_count() {
            let x = mesh.positions[p] - shift;
            solver.set_position(p, shift + dvec3(1.25 * x.x, x.y, x.z));
        }
        (solver.energy(None), solver.volume(), solver.kappa(1e-3))
    };
    assert_eq!(measure(DVec3::ZERO), measure(DVec3::splat(1e6)));
}
