//! Results have the same bits for any number of threads, and from one release to the next.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Material, Real, StepSettings};

use crate::body::{GRAVITY, RUBBER, body, disturb, plain, schedule};

/// FNV-1a over the bits of positions and velocities. Single precision widens without loss.
pub(crate) fn hash<'a>(vectors: impl IntoIterator<Item = &'a DVec3>) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for value in vectors.into_iter().flat_map(|v| v.to_array()) {
        for byte in value.to_bits().to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

/// Everything a step can do, at once: damping, iterations, relaxation, gravity, ground with friction.
fn everything(time_step: f64) -> StepSettings {
    StepSettings {
        substeps: 2,
        iterations: 3,
        relaxation: 0.9,
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(-0.01, 0.4)],
        ..StepSettings::new(time_step)
    }
}

const DAMPED: Material = Material {
    damping: 1e-3,
    ..RUBBER
};

/// The hash after some frames of a body of 48,000 tets on `threads` threads.
fn state<R: Real>(threads: usize, clustering: &str, settings: &StepSettings) -> u64 {
    let mesh = kuhn_box([20, 20, 20], DVec3::ONE);
    let schedule = schedule(&mesh, "scgc", clustering);
    // The solver shares a color out from 128 tets on, or fewer on narrower processors: most colors of this body are
    // larger by far.
    let large =
        (0..schedule.color_count()).filter(|&c| schedule.color_constraints(c).count() > 1024);
    assert!(large.count() > 10);
    let mut solver = body::<R>(&mesh, DAMPED);
    disturb(&mut solver, 0.005, 6);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        for _ in 0..3 {
            solver.step(&schedule, settings).unwrap();
        }
    });
    let moved: Vec<DVec3> = (0..solver.particle_count())
        .flat_map(|p| [solver.position(p), solver.velocity(p)])
        .collect();
    hash(&moved)
}

fn same_for_any_number_of_threads<R: Real>() {
    for clustering in ["none", "serial:10"] {
        // The first passes run on one thread.
        let long = StepSettings {
            substeps: 8,
            ..StepSettings::new(8e-3)
        };
        for settings in [everything(2e-3), long] {
            let [one, two, three] = [1, 2, 3].map(|n| state::<R>(n, clustering, &settings));
            assert_eq!((one, one), (two, three), "{clustering} {settings:?}");
        }
    }
}

#[test]
fn threads_do_not_change_a_bit_in_single_precision() {
    same_for_any_number_of_threads::<f32>();
}

#[test]
fn threads_do_not_change_a_bit_in_double_precision() {
    same_for_any_number_of_threads::<f64>();
}

/// The hash after a fall of a small beam on the ground.
fn golden<R: Real>() -> u64 {
    let mesh = kuhn_box([6, 3, 2], dvec3(0.6, 0.3, 0.2));
    let mut solver = body::<R>(&mesh, DAMPED);
    disturb(&mut solver, 0.01, 7);
    solver.set_fixed(0, true);
    for _ in 0..50 {
        solver.step(&plain(&mesh), &everything(2e-3)).unwrap();
    }
    let moved: Vec<DVec3> = (0..solver.particle_count())
        .flat_map(|p| [solver.position(p), solver.velocity(p)])
        .collect();
    hash(&moved)
}

/// Only additions, multiplications, divisions and square roots, each rounded as IEEE 754 says: the bits are the same on
/// every processor. A change of these hashes is a change of results and belongs into the release notes.
#[test]
fn golden_states_are_kept() {
    assert_eq!(format!("{:016x}", golden::<f32>()), "77be52444360324d");
    assert_eq!(format!("{:016x}", golden::<f64>()), "dd4a9276db0c0a2c");
}
