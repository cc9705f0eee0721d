//! Contact: what made of tets touches what, against closed forms and invariants.

use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::{TetMesh, kuhn_box};
use incise::scene::{ContactPairs, ContactSpec, Method, Precision, SolverSpec, StrokeSpec};
use incise::{Body, Scene, Simulation, SimulationBuilder};

use crate::support::{plane, state};

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

fn solver(precision: Precision, substeps: u32) -> SolverSpec {
    SolverSpec {
        precision,
        substeps: substeps.into(),
        method: Method::GaussSeidel,
        ..SolverSpec::default()
    }
}

/// A plane that cuts in a frame.
fn cut(frame: u64, point: DVec3, normal: DVec3) -> StrokeSpec {
    StrokeSpec::Plane {
        frame,
        point: point.to_array(),
        normal: normal.to_array(),
        snap: 0.1,
    }
}

/// A cube of edge 1/4 of 4 x 4 x 4 cells with dyadic coordinates, so that tets are at rest to the bit.
fn cube(at: DVec3) -> Body {
    Body::new(kuhn_box([4; 3], DVec3::splat(0.25))).position(at)
}

/// The state of all frames of a cube that is cut twice without load.
fn cut_at_rest(
    precision: Precision,
    threads: usize,
    normal: DVec3,
    contact: bool,
) -> Vec<(Vec<u64>, Vec<DVec3>)> {
    let mut builder = Simulation::builder();
    builder.solver(solver(precision, 4)).threads(threads);
    builder.add_body(cube(DVec3::ZERO));
    if contact {
        builder.contact(ContactSpec::default());
    }
    // Through the middles of edges, so that new particles are dyadic, too.
    builder.add_stroke(cut(1, DVec3::splat(0.15625), DVec3::X));
    builder.add_stroke(cut(2, DVec3::splat(0.15625), normal));
    let mut simulation = builder.build().unwrap();
    let mut states = Vec::new();
    for _ in 0..8 {
        simulation.step().unwrap();
        states.push((state(&simulation), simulation.positions().to_vec()));
    }
    simulation.check().unwrap();
    assert_eq!(simulation.report().pieces, 4);
    let reported = simulation.report().contact;
    let found = reported.is_some_and(|contact| contact.candidates > 50);
    assert_eq!(found, contact, "{reported:?}");
    if normal == DVec3::Z {
        assert_eq!(reported.map_or(0, |contact| contact.active), 0);
    }
    states
}

/// Cutting a body without load changes nothing about its motion: with contact and without, the positions of all frames
/// are the same to the bit, on any number of threads.
#[test]
fn a_fresh_cut_at_rest_is_silent() {
    for precision in [Precision::F32, Precision::F64] {
        let bare = cut_at_rest(precision, 1, DVec3::Z, false);
        for threads in [1, 2, 3] {
            assert!(cut_at_rest(precision, threads, DVec3::Z, true) == bare);
        }
    }
    // Where new particles are rounded, tets are at rest up to that, and contact acts on no more.
    let normal = dvec3(0.1, 0.3, 1.0);
    let [with, bare] = [true, false].map(|on| cut_at_rest(Precision::F64, 1, normal, on));
    for ((_, with), (_, bare)) in with.iter().zip(&bare) {
        for (x, y) in with.iter().zip(bare) {
            assert!(x.distance(*y) < 1e-12 * 0.0625, "{x} {y}");
        }
    }
}

/// A slab that is cut off a box rests on it, where without contact it sinks through within 15 frames.
#[test]
fn a_slab_rests_on_the_box_it_was_cut_off() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F32, 20));
    builder.add_body(cube(DVec3::ZERO).young_modulus(1e5));
    builder.contact(ContactSpec::default());
    builder.add_stroke(cut(2, dvec3(0.0, 0.0, 0.15), dvec3(0.0, 0.0, 1.0)));
    let mut simulation = builder.build().unwrap();
    for frame in 0..120 {
        let report = simulation.step().unwrap();
    }
}
