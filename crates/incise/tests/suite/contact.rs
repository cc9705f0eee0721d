//! Contact: what made of tets touches what, against closed forms and invariants.

use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::{TetMesh, kuhn_box};
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, ContactPairs, ContactSpec, CuttingSpec, Method, Precision, Region, SleepSpec,
    SolverSpec, StrokeSpec,
};
use incise::{Body, Event, Scene, Simulation, SimulationBuilder, Warning, WarningCode};

use crate::support::{scene, state};

pub(crate) const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
const DENSITY: f64 = 1000.0;

pub(crate) fn solver(precision: Precision, substeps: u32) -> SolverSpec {
    SolverSpec::default().with(|spec| {
        spec.precision = precision;
        spec.substeps = substeps.into();
        spec.method = Method::GaussSeidel;
    })
}

/// A plane that cuts in a frame.
pub(crate) fn cut(frame: u64, point: DVec3, normal: DVec3) -> StrokeSpec {
    StrokeSpec::plane(frame, point.to_array(), normal.to_array())
}

/// A cube of edge 1/4 of 4 x 4 x 4 cells with dyadic coordinates, so that tets are at rest to the bit.
pub(crate) fn cube(at: DVec3) -> Body {
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
    // With contact more of the mesh is improved in a frame, so the meshes would be different ones.
    builder.cutting(CuttingSpec::default().with(|spec| spec.improve = false));
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

/// The edge of the cube of [`cube`].
pub(crate) const EDGE: f64 = 0.25;

/// The mass of each particle: a quarter of each tet's.
fn masses(mesh: &TetMesh) -> Vec<f64> {
    let mut masses = vec![0.0; mesh.positions.len()];
    for t in 0..mesh.tets.len() {
        let tet = incise::mesh::TetId::new(t);
        for p in mesh.tets[t] {
            masses[p.index()] += 0.25 * DENSITY * mesh.volume(tet);
        }
    }
    masses
}

/// The mean position of the particles of a range, weighted by mass.
pub(crate) fn center(simulation: &Simulation, range: std::ops::Range<usize>) -> DVec3 {
    let masses = masses(simulation.mesh());
    let mut sum = DVec3::ZERO;
    for p in range.clone() {
        sum += simulation.positions()[p] * masses[p];
    }
    sum / masses[range].iter().sum::<f64>()
}

pub(crate) fn steps(simulation: &mut Simulation, count: u32) {
    for _ in 0..count {
        let report = simulation.step().unwrap();
        assert_eq!(
            (report.repaired, report.warnings.len()),
            (0, 0),
            "{report:?}"
        );
    }
}

/// The mean over some frames of the force on the second of two pieces.
pub(crate) fn mean_force(simulation: &mut Simulation, pieces: [u32; 2], frames: u32) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for _ in 0..frames {
        steps(simulation, 1);
        let contacts = simulation.contacts();
        let found = contacts.iter().find(|contact| contact.pieces == pieces);
        sum += found.map_or(DVec3::ZERO, |contact| contact.force);
    }
    sum / f64::from(frames)
}

/// A slab that is cut off a box rests on it, where without contact it sinks through within 15 frames.
#[test]
fn a_slab_rests_on_the_box_it_was_cut_off() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F64, 20));
    builder.add_body(cube(DVec3::ZERO).damping(0.02));
    builder.contact(ContactSpec::default());
    builder.add_stroke(cut(2, dvec3(0.0, 0.0, 0.15), DVec3::Z));
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 120);
    assert_eq!(simulation.report().pieces, 2);
    let slab = simulation.pieces()[1];
    // The body is cut as it is after two frames of its fall.
    assert!(
        (slab.volume / (EDGE * EDGE * 0.1) - 1.0).abs() < 0.03,
        "{slab:?}"
    );
    let force = mean_force(&mut simulation, [0, 1], 30);
    let weight = slab.mass * -GRAVITY.z;
    assert!(
        force.distance(DVec3::Z * weight) < 0.01 * weight,
        "{force} {weight}"
    );
    let contact = simulation.report().contact.unwrap();
    assert!(contact.active >= 25 && contact.buried == 0, "{contact:?}");
    assert!(contact.max_depth < 1e-3, "{contact:?}");
    simulation.check().unwrap();
}

/// Cubes of 2 x 2 x 2 cells on each other, each shifted by a third of a cell against the one below. A tower of ten would
/// buckle under its weight below 4e6 Pa.
pub(crate) fn stack(count: u32, precision: Precision) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(precision, 60));
    for number in 0..count {
        let shift = if number % 2 == 1 { EDGE / 6.0 } else { 0.0 };
        let at = dvec3(shift, 0.5 * shift, EDGE * f64::from(number));
        let cube = Body::new(kuhn_box([2; 3], DVec3::splat(EDGE))).position(at);
        builder.add_body(cube.young_modulus(2e7).damping(0.005));
    }
    builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.5));
    builder
}

/// Each interface of a stack carries the weight above it and is closed up to a thousandth of an edge.
#[test]
fn a_stack_carries_its_weight() {
    for (count, frames) in [(2, 100), (5, 150), (10, 250)] {
        let mut simulation = stack(count, Precision::F64).build().unwrap();
        steps(&mut simulation, frames);
        let weight = EDGE.powi(3) * DENSITY * -GRAVITY.z;
        for number in 1..count {
            let force = mean_force(&mut simulation, [number - 1, number], 20);
            let above = weight * f64::from(count - number);
            assert!(
                (force.z - above).abs() < 0.01 * above,
                "{count} {number}: {force} {above}"
            );
            // The tower sways a little.
            let sideways = force.with_z(0.0).length();
            assert!(sideways < 0.05 * above, "{count} {number}: {force} {above}");
        }
        let contact = simulation.report().contact.unwrap();
        assert!(contact.max_depth < 1e-3, "{count}: {contact:?}");
        assert!(
            contact.active >= 8 * (count as usize - 1),
            "{count}: {contact:?}"
        );
        simulation.check().unwrap();
    }
}

/// The speed in m/s that a block on a fixed plate of another density of tets gains in a second of a gravity that is
/// tilted by tan θ = 1/2.
fn gained_on_a_slope(friction: f64, cells: usize) -> f64 {
    let tilt = dvec3(1.0, 0.0, -2.0).normalize() * 9.81;
    let mut builder = Simulation::builder();
    builder.gravity(tilt).solver(solver(Precision::F64, 20));
    let plate = kuhn_box([12 * cells, 4 * cells, 1], dvec3(1.5, 0.5, 0.125));
    builder.add_body(Body::new(plate).pinned(|_| true));
    let block = kuhn_box([3; 3], DVec3::splat(0.1875));
    let block = Body::new(block).position(dvec3(0.05, 0.15, 0.125));
    builder.add_body(block.young_modulus(2e5).damping(0.01));
    builder.contact(ContactSpec::default().with(|spec| spec.friction = friction));
    let mut simulation = builder.build().unwrap();
    let particles = simulation.positions().len();
    let first = particles - 64;
    let mut speed = |frames: u32| {
        steps(&mut simulation, frames - 2);
        let before = center(&simulation, first..particles);
        steps(&mut simulation, 1);
        let after = center(&simulation, first..particles);
        steps(&mut simulation, 1);
        (after - before) / simulation.time_step()
    };
    // The first frames shear the block.
    let start = speed(15);
    let end = speed(25);
    let gained = end - start;
    assert!(gained.y.abs() + gained.z.abs() < 0.2, "{gained}");
    gained.x / (25.0 * 0.016)
}

/// `a = g (sin θ - μ cos θ)`, and the block stays for `μ > tan θ`.
#[test]
fn a_block_on_a_slope_follows_coulombs_law() {
    let (sine, cosine) = (1.0 / 5f64.sqrt(), 2.0 / 5f64.sqrt());
    for cells in [1, 2] {
        for friction in [0.0, 0.2, 0.4, 0.46, 0.52] {
            let expected = (9.81 * (sine - friction * cosine)).max(0.0);
            let found = gained_on_a_slope(friction, cells);
            // As much as 0.01 in the coefficient; the block still shakes from its start.
            let allowed = 0.01 * 9.81 * cosine;
            assert!(
                (found - expected).abs() < allowed,
                "{cells} {friction}: {found} {expected}"
            );
        }
    }
}

/// Bodies that collide in free flight keep their momentum, and come apart no faster than they met.
#[test]
fn a_collision_keeps_momentum() {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 10));
    builder.add_body(cube(DVec3::ZERO));
    builder.add_body(cube(dvec3(0.06, 0.03, 0.3)).young_modulus(3e4));
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    simulation
        .set_velocities(|x| {
            if x.z < 0.27 {
                DVec3::Z
            } else {
                dvec3(-0.1, 0.2, -2.0)
            }
        })
        .unwrap();
    let particles = simulation.positions().len();
    let all = 0..particles;
    let (half, time) = (particles / 2, simulation.time_step());
    let expected = 0.5 * dvec3(-0.1, 0.2, -1.0);
    let mut pressed = 0;
    for _ in 0..60 {
        let before = center(&simulation, all.clone());
        steps(&mut simulation, 1);
        let moved = center(&simulation, all.clone()) - before;
        // Positions are rounded to 1e-16 m, the frame lasts 16 ms.
        assert!((moved / time).distance(expected) < 1e-12, "{moved}");
        pressed += simulation.report().contact.unwrap().active;
    }
    assert!(pressed > 20, "{pressed}");
    let [low, high] = [0..half, half..particles].map(|range| center(&simulation, range));
    steps(&mut simulation, 1);
    let [lower, higher] = [0..half, half..particles].map(|range| center(&simulation, range));
    let parting = ((higher - high) - (lower - low)).z / time;
    assert!(parting > 0.0 && parting < 3.0, "{parting}");
}

/// Bodies that overlap by 2 mm at the start part at the depth over the recovery time.
#[test]
fn an_overlap_at_the_start_parts_slowly() {
    let (depth, recovery_time) = (2e-3, 0.02);
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 20));
    builder.add_body(cube(DVec3::ZERO));
    builder.add_body(cube(dvec3(0.02, 0.01, EDGE - depth)));
    builder.contact(ContactSpec::default().with(|spec| spec.recovery_time = recovery_time));
    let mut simulation = builder.build().unwrap();
    let particles = simulation.positions().len();
    let half = particles / 2;
    let mut last = f64::INFINITY;
    for frame in 0..40 {
        let before = simulation.positions().to_vec();
        steps(&mut simulation, 1);
        let moved = simulation.positions().iter().zip(&before);
        let fastest = moved.map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
        let speed = fastest / simulation.time_step();
        assert!(speed < 1.2 * depth / recovery_time, "{frame}: {speed}");
        last = center(&simulation, half..particles).z - center(&simulation, 0..half).z;
    }
    assert!(last > EDGE - 0.1 * depth, "{last}");
    assert_eq!(simulation.report().contact.unwrap().max_depth, 0.0);
}

/// The warnings that come in a second with two cubes that overlap by a depth and whose particles are pinned or not.
fn warnings_of_an_overlap(depth: f64, pinned: bool) -> Vec<Warning> {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 10));
    for at in [DVec3::ZERO, dvec3(0.02, 0.01, EDGE - depth)] {
        let body = cube(at);
        builder.add_body(if pinned { body.pinned(|_| true) } else { body });
    }
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    let mut warnings = Vec::new();
    for _ in 0..60 {
        simulation.step().unwrap();
        let new = simulation.report().warnings().iter();
        // Those that can part are told at once that they start inside each other.
        let is_start = |w: &&Warning| w.code == WarningCode::StartsInside;
        warnings.extend(new.filter(|w| pinned || !is_start(w)).cloned());
    }
    if pinned {
        assert!(simulation.report().contact.unwrap().max_depth > 0.0);
    }
    warnings
}

/// An overlap of more than a tenth of an edge that does not part is told once, with its bodies and pieces; one that is
/// not as deep or that parts is not.
#[test]
fn a_deep_contact_is_told() {
    let deep = warnings_of_an_overlap(0.02, true);
    assert_eq!(deep.len(), 1, "{deep:?}");
    assert_eq!(deep[0].code, WarningCode::ContactDepth);
    assert_eq!(deep[0].location, "bodies 0, 1");
    assert!(
        deep[0].message.starts_with("pieces 0 and 1 overlap by 2"),
        "{deep:?}"
    );
    assert_eq!(warnings_of_an_overlap(0.004, true), []);
    assert_eq!(warnings_of_an_overlap(0.02, false), []);
}

/// How many vertices are inside a tet of another piece, farther than `depth` m from each of its faces.
pub(crate) fn intruders(simulation: &Simulation, depth: f64) -> usize {
    let (mesh, x) = (simulation.mesh(), simulation.positions());
    let pieces = simulation.piece_numbers();
    let mut piece_of = vec![u32::MAX; x.len()];
    for (tet, piece) in mesh.tets.iter().zip(&pieces) {
        for p in tet {
            piece_of[p.index()] = *piece;
        }
    }
    let contains = |t: usize, p: usize| {
        let corners = mesh.tets[t].map(|corner| x[corner.index()]);
        let height = |face: [usize; 3], other: usize| {
            let [a, b, c] = face.map(|k| corners[k]);
            let normal = (b - a).cross(c - a).normalize();
            let inward = normal * normal.dot(corners[other] - a).signum();
            inward.dot(x[p] - a)
        };
        let faces = [
            ([1, 2, 3], 0),
            ([0, 2, 3], 1),
            ([0, 1, 3], 2),
            ([0, 1, 2], 3),
        ];
        faces
            .iter()
            .all(|(face, other)| height(*face, *other) > depth)
    };
    let is_inside = |p: &usize| {
        let others = (0..pieces.len()).filter(|&t| pieces[t] != piece_of[*p]);
        piece_of[*p] != u32::MAX && others.clone().any(|t| contains(t, *p))
    };
    (0..x.len()).filter(is_inside).count()
}

/// A ball that was cut in halves, drawn apart, shifted and pushed together again by 5% of its radius: no vertex lies in
/// a tet of the other half, but for 1% of an edge.
#[test]
fn halves_that_are_pushed_together_again_do_not_overlap() {
    for shift in [0.0, 0.02, 0.03] {
        let mut builder = Simulation::builder();
        builder.solver(solver(Precision::F32, 20));
        let ball = Body::new(generate(Shape::Sphere, 1500).unwrap()).scale(0.5);
        builder.add_body(ball.young_modulus(1e5).damping(0.005));
        builder.contact(ContactSpec::default());
        builder.add_stroke(cut(1, DVec3::ZERO, DVec3::X));
        for side in [-1.0, 1.0] {
            let cap = Region::half_space([0.2 * side, 0.0, 0.0], [side, 0.0, 0.0]);
            let to = |x: f64, y: f64| [x * side, y * side, 0.0];
            builder.add_attachment(AttachmentSpec::new(0, vec![cap]).with(|spec| {
                spec.frames = [2, 82];
                spec.path = vec![
                    to(0.0, 0.0),
                    to(0.1, 0.0),
                    to(0.1, 0.5 * shift),
                    to(0.0, 0.5 * shift),
                    to(-0.0125 * 0.5, 0.5 * shift),
                ];
            }));
        }
        let mut simulation = builder.build().unwrap();
        for _ in 0..110 {
            assert_eq!(simulation.step().unwrap().repaired, 0);
        }
        let contact = simulation.report().contact.unwrap();
        assert!(contact.active > 20, "{contact:?}");
        // 1% of an edge of 55 mm.
        let inside = intruders(&simulation, 5.5e-4);
        assert_eq!((contact.buried, inside), (0, 0), "{shift}: {contact:?}");
        // They press on each other along x.
        let force = mean_force(&mut simulation, [0, 1], 5);
        assert!(force.x.abs() > 1.0, "{shift}: {force}");
        simulation.check().unwrap();
    }
}

/// A simulation in the midst of contact: two boxes on each other, the upper one cut, which slides and tumbles.
pub(crate) fn busy(precision: Precision, threads: usize) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder
        .gravity(dvec3(2.0, 0.0, -9.81))
        .ground(0.0, 0.4)
        .solver(solver(precision, 10))
        .threads(threads);
    builder.add_body(cube(DVec3::ZERO));
    builder.add_body(cube(dvec3(0.07, 0.03, 0.27)));
    builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.1));
    builder.add_stroke(cut(3, dvec3(0.2, 0.1, 0.4), dvec3(1.0, 0.2, 0.8)));
    builder.add_stroke(cut(14, dvec3(0.1, 0.1, 0.1), dvec3(0.3, 1.0, 0.2)));
    builder
}

/// Everything that is to be seen of the last frame.
pub(crate) fn seen(simulation: &Simulation) -> String {
    let (contact, forces) = (simulation.report().contact, simulation.contacts());
    format!(
        "{contact:?} {forces:?} {:?} {:?}",
        simulation.events(),
        simulation.positions()
    )
}

#[test]
fn threads_do_not_change_a_bit() {
    for precision in [Precision::F32, Precision::F64] {
        let run = |threads| {
            let mut simulation = busy(precision, threads).build().unwrap();
            let mut frames = Vec::new();
            for _ in 0..30 {
                simulation.step().unwrap();
                frames.push(seen(&simulation));
            }
            simulation.check().unwrap();
            assert!(simulation.report().contact.unwrap().active > 10);
            frames
        };
        let one = run(1);
        assert!(one == run(2) && one == run(3));
    }
}

/// A snapshot goes back to the bit, before a cut and after it, here and in another simulation.
#[test]
fn snapshots_continue_contact() {
    let mut simulation = busy(Precision::F32, 1).build().unwrap();
    for frames in [2, 8, 11] {
        steps_of(&mut simulation, frames);
        let snapshot = simulation.snapshot().unwrap();
        let first = steps_of(&mut simulation, 9);
        simulation.restore(&snapshot).unwrap();
        simulation.check().unwrap();
        assert!(steps_of(&mut simulation, 9) == first);
        simulation.restore(&snapshot).unwrap();
        let mut other = Simulation::from_snapshot(&snapshot).unwrap();
        assert!(steps_of(&mut other, 9) == first);
    }
}

#[cfg(feature = "save")]
#[test]
fn snapshots_with_contact_survive_a_file() {
    let mut simulation = busy(Precision::F32, 1).build().unwrap();
    steps_of(&mut simulation, 12);
    let bytes = postcard::to_stdvec(&simulation.snapshot().unwrap()).unwrap();
    let first = steps_of(&mut simulation, 9);
    let read: incise::Snapshot = postcard::from_bytes(&bytes).unwrap();
    let mut other = Simulation::from_snapshot(&read).unwrap();
    assert!(steps_of(&mut other, 9) == first);
}

pub(crate) fn steps_of(simulation: &mut Simulation, count: u32) -> Vec<String> {
    let mut frames = Vec::new();
    for _ in 0..count {
        assert_eq!(simulation.step().unwrap().repaired, 0);
        frames.push(seen(simulation));
    }
    frames
}

/// What falls on something begins to touch it once, and ends it when it is thrown off; a body that is removed ends it,
/// too, and leaves nothing.
#[test]
fn contacts_begin_and_end() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F64, 20));
    let bodies = [0.0, 0.3, 0.6].map(|z| builder.add_body(cube(dvec3(0.0, 0.0, z)).damping(0.05)));
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    let run = |simulation: &mut Simulation, frames: u32| {
        let mut events = Vec::new();
        for _ in 0..frames {
            simulation.step().unwrap();
            events.extend(simulation.events().to_vec());
        }
        events
    };
    let events = run(&mut simulation, 60);
    let began = |a, b| Event::ContactBegan {
        pieces: [a, b],
        bodies: [a as usize, b as usize],
    };
    let ended = |a, b| Event::ContactEnded {
        pieces: [a, b],
        bodies: [a as usize, b as usize],
    };
    assert_eq!(events, [began(0, 1), began(1, 2)]);
    simulation
        .set_velocities(|x| {
            if x.z > 0.5 {
                DVec3::Z * 1.5
            } else {
                DVec3::ZERO
            }
        })
        .unwrap();
    assert_eq!(run(&mut simulation, 10), [ended(1, 2)]);
    assert_eq!(run(&mut simulation, 50), [began(1, 2)]);
    simulation.remove_body(bodies[1]).unwrap();
    assert_eq!(run(&mut simulation, 1), [ended(0, 1), ended(1, 2)]);
    assert_eq!(run(&mut simulation, 60), [began(0, 2)]);
    simulation.remove_body(bodies[0]).unwrap();
    simulation.remove_body(bodies[2]).unwrap();
    assert_eq!(run(&mut simulation, 2), [ended(0, 2)]);
    assert_eq!(simulation.report().contact.unwrap().candidates, 0);
    simulation.check().unwrap();
}

/// Only the pairs that are named touch, and others are solved alone.
#[test]
fn only_pairs_that_are_named_touch() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F32, 20));
    for z in [0.0, 0.25, 0.5] {
        builder.add_body(cube(dvec3(0.0, 0.0, z)).damping(0.02));
    }
    builder
        .contact(ContactSpec::default().with(|spec| spec.pairs = ContactPairs::Only(vec![[1, 0]])));
    let mut simulation = builder.build().unwrap();
    let particles = simulation.positions().len() / 3;
    let [first, second, third] = [0, 1, 2].map(|b| {
        simulation
            .location_of(incise::mesh::ParticleId::new(b * particles))
            .0
    });
    assert!(first == second && third != first);
    steps(&mut simulation, 60);
    let z = [0, 1, 2].map(|b| center(&simulation, b * particles..(b + 1) * particles).z);
    // The third falls through both and lies on the ground with the first.
    assert!((z[1] - z[0] - EDGE).abs() < 0.01, "{z:?}");
    assert!((z[2] - z[0]).abs() < 0.01, "{z:?}");
    // A body that is added is solved alone.
    simulation.add_body(cube(DVec3::X)).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
}

/// Where all bodies touch, one that is added later lies on the others.
#[test]
fn a_body_that_is_added_lies_on_the_others() {
    let mut simulation = stack(2, Precision::F64).build().unwrap();
    let before = simulation.positions().len();
    steps(&mut simulation, 5);
    let high = dvec3(0.0, 0.0, 2.0 * EDGE + 0.05);
    simulation.add_body(cube(high)).unwrap();
    simulation.check().unwrap();
    let all = simulation.positions().len();
    steps(&mut simulation, 90);
    simulation.check().unwrap();
    let below = center(&simulation, before / 2..before).z;
    let added = center(&simulation, before..all).z;
    assert!((added - below - EDGE).abs() < 0.02, "{added} {below}");
}

/// A stack sleeps as a whole, and what falls on it wakes it.
#[test]
fn a_stack_sleeps_as_a_whole() {
    let mut builder = Simulation::builder();
    let spec = solver(Precision::F32, 20).with(|spec| spec.sleep = Some(SleepSpec::new(1e-2, 0.2)));
    builder.gravity(GRAVITY).ground(0.0, 0.5).solver(spec);
    for z in [0.0, 0.25, 0.5] {
        builder.add_body(cube(dvec3(0.0, 0.0, z)).damping(0.1));
    }
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 150);
    assert_eq!(simulation.report().bodies.len(), 1);
    assert_eq!(simulation.report().bodies[0].asleep, Some(true));
    let still = simulation.positions().to_vec();
    steps(&mut simulation, 5);
    assert!(simulation.positions() == still && simulation.events().is_empty());
    assert_eq!(simulation.contacts().len(), 2);
    simulation
        .set_contact(&ContactSpec::default().with(|spec| spec.friction = 0.0))
        .unwrap();
    simulation.step().unwrap();
    assert_eq!(simulation.report().bodies[0].asleep, Some(false));
    assert_eq!(simulation.contacts().len(), 2);
}

/// A change of friction while it runs: what stuck slides.
#[test]
fn friction_changes_live() {
    let mut builder = Simulation::builder();
    builder
        .gravity(dvec3(3.0, 0.0, -9.0))
        .solver(solver(Precision::F32, 20));
    let plate = kuhn_box([12, 3, 1], dvec3(1.5, 0.375, 0.125));
    builder.add_body(Body::new(plate).pinned(|_| true));
    builder.add_body(
        cube(dvec3(0.0, 0.06, 0.125))
            .young_modulus(2e5)
            .damping(0.05),
    );
    let rough = ContactSpec::default().with(|spec| spec.friction = 0.8);
    builder.contact(rough.clone());
    let mut simulation = builder.build().unwrap();
    let all = simulation.positions().len();
    let block = all - 125..all;
    steps(&mut simulation, 40);
    let before = center(&simulation, block.clone()).x;
    steps(&mut simulation, 10);
    let stuck = center(&simulation, block.clone()).x - before;
    assert!(stuck.abs() < 1e-3, "{stuck}");
    simulation
        .set_contact(&rough.clone().with(|spec| spec.friction = 0.1))
        .unwrap();
    steps(&mut simulation, 10);
    let slid = center(&simulation, block).x - before - stuck;
    // a = 3 - 0.1 · 9, for 0.16 s.
    assert!((slid - 0.5 * 2.1 * 0.16 * 0.16).abs() < 5e-3, "{slid}");
    let others = rough
        .clone()
        .with(|spec| spec.pairs = ContactPairs::Only(vec![[0, 1]]));
    for bad in [others, rough.with(|spec| spec.friction = -1.0)] {
        assert!(simulation.set_contact(&bad).is_err());
    }
    let mut bare = simulation_without_contact();
    assert!(bare.set_contact(&ContactSpec::default()).is_err());
}

fn simulation_without_contact() -> Simulation {
    let mut builder = Simulation::builder();
    builder.add_body(cube(DVec3::ZERO));
    builder.build().unwrap()
}

/// A small cube that flies at 20 m/s, five of its cells a frame, does not pass through a plate: the frame is divided.
#[test]
fn a_fast_body_does_not_pass() {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F32, 40));
    let plate = kuhn_box([8, 8, 1], dvec3(0.5, 0.5, 0.0625));
    builder.add_body(
        Body::new(plate)
            .pinned(|x| x.x == 0.0 || x.x == 0.5)
            .young_modulus(1e6),
    );
    builder.add_body(cube(dvec3(0.13, 0.11, 0.2)).young_modulus(1e6));
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    simulation
        .set_velocities(|x| {
            if x.z > 0.1 {
                DVec3::NEG_Z * 20.0
            } else {
                DVec3::ZERO
            }
        })
        .unwrap();
    let all = simulation.positions().len();
    for _ in 0..20 {
        assert_eq!(simulation.step().unwrap().repaired, 0);
        let heights = center(&simulation, all - 125..all).z - center(&simulation, 0..all - 125).z;
        assert!(heights > 0.05, "{heights}");
    }
}

/// Methods that do not solve contact are refused by their key, and `auto` does not choose them.
#[test]
fn methods_without_contact_are_refused() {
    let text = "[contact]\n[solver]\nprecision = \"f64\"\n[[body]]\nshape = { kind = \"box\", tets = 200 }\n";
    for method in [Method::Jacobi, Method::Chebyshev, Method::Vbd] {
        let mut with = scene(text);
        with.solver.method = method;
        let error = Simulation::new(&with).unwrap_err();
        assert_eq!(error.key().as_deref(), Some("solver.method"), "{error}");
        let mut simulation = Simulation::new(&scene(text)).unwrap();
        let before = simulation.solver_spec().clone();
        assert!(
            simulation
                .set_solver(&before.clone().with(|spec| spec.method = method))
                .is_err()
        );
        assert_eq!(*simulation.solver_spec(), before);
        simulation.step().unwrap();
    }
    let mut stiff = scene(text);
    (stiff.body[0].young_modulus, stiff.solver.max_substeps) = (1e10, 10);
    let mut simulation = Simulation::new(&stiff).unwrap();
    simulation.step().unwrap();
    assert!(simulation.report().contact.is_some());
}

#[test]
fn values_out_of_range_are_refused_by_name() {
    let refused = |change: fn(&mut ContactSpec)| {
        let mut scene =
            Scene::from_toml("[[body]]\nshape = { kind = \"box\", tets = 200 }").unwrap();
        let mut contact = ContactSpec::default();
        change(&mut contact);
        scene.contact = Some(contact);
        Simulation::new(&scene).unwrap_err().key().unwrap()
    };
    assert_eq!(refused(|c| c.friction = -0.1), "contact.friction");
    assert_eq!(refused(|c| c.friction = f64::NAN), "contact.friction");
    assert_eq!(refused(|c| c.recovery_time = -1.0), "contact.recovery_time");
    assert_eq!(
        refused(|c| c.thickness = f64::INFINITY),
        "contact.thickness"
    );
    assert_eq!(
        refused(|c| c.pairs = ContactPairs::Only(vec![[0, 1]])),
        "contact.pairs[0]"
    );
    assert_eq!(
        refused(|c| c.pairs = ContactPairs::Only(vec![[0, 0]])),
        "contact.pairs[0]"
    );
    for text in [
        "pairs = \"none\"",
        "pairs = [[0]]",
        "pairs = 1",
        "fricton = 1.0",
    ] {
        assert!(
            Scene::from_toml(&format!("[contact]\n{text}")).is_err(),
            "{text}"
        );
    }
    let scene = Scene::from_toml("[contact]\npairs = [[0, 1]]\nfriction = 0.5").unwrap();
    assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
}

/// A thickness is kept between bodies; the sides of a fresh cut in a body stay together.
#[test]
fn a_thickness_parts_bodies_but_not_a_cut() {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 10));
    builder.add_body(cube(DVec3::ZERO));
    builder.add_body(cube(dvec3(0.0, 0.0, EDGE)));
    let thickness = 4e-3;
    builder.contact(ContactSpec::default().with(|spec| spec.thickness = thickness));
    builder.add_stroke(cut(1, DVec3::splat(0.15625), DVec3::X));
    let mut simulation = builder.build().unwrap();
    steps_of(&mut simulation, 40);
    assert_eq!(simulation.report().pieces, 4);
    let (rest, x) = (&simulation.mesh().positions, simulation.positions());
    let gap = |of: &dyn Fn(DVec3) -> f64, low: f64, side: &dyn Fn(usize) -> bool| {
        let heights = (0..x.len())
            .filter(|&p| of(rest[p]) == low && side(p))
            .map(|p| of(x[p]));
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
            (a.min(z), b.max(z))
        })
    };
    let first_of_second = (0..rest.len()).find(|&p| rest[p].z > EDGE).unwrap_or(0);
    assert!(first_of_second > 0);
    let z = |x: DVec3| x.z;
    let body = simulation
        .mesh()
        .tets
        .iter()
        .zip(simulation.piece_numbers());
    let mut is_upper = vec![false; rest.len()];
    for (tet, piece) in body {
        let upper = simulation
            .pieces()
            .iter()
            .any(|p| p.id == piece && p.body == 1);
        tet.iter().for_each(|p| is_upper[p.index()] = upper);
    }
    let lower = gap(&z, EDGE, &|p| !is_upper[p]);
    let upper = gap(&z, EDGE, &|p| is_upper[p]);
    assert!(upper.0 - lower.1 > 0.99 * thickness, "{upper:?} {lower:?}");
    // The cut has not opened: the sides have the positions that they would have without it.
    let sides = gap(&|x| x.x, 0.15625, &|_| true);
    assert!(sides.1 - sides.0 < 0.01 * thickness, "{sides:?}");
}

/// A body that no pair names is cut obliquely and its halves slide without friction: they touch although the body does not
/// touch itself elsewhere, also once the sides of the cut have slid apart.
#[test]
fn pieces_of_a_body_alone_touch_without_self_contact() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F32, 20));
    for at in [DVec3::ZERO, dvec3(0.0, 0.0, EDGE), dvec3(2.0, 0.0, 0.0)] {
        builder.add_body(cube(at).young_modulus(1e6).damping(0.005));
    }
    builder.contact(ContactSpec::default().with(|spec| {
        spec.pairs = ContactPairs::Only(vec![[0, 1]]);
        spec.self_contact = false;
        spec.friction = 0.0;
    }));
    let middle = dvec3(2.0 + 0.5 * EDGE, 0.5 * EDGE, 0.5 * EDGE);
    builder.add_stroke(cut(1, middle, dvec3(0.5, 0.0, 1.0)));
    let mut simulation = builder.build().unwrap();
    for frame in 0..16 {
        simulation.step().unwrap();
        let inside = intruders(&simulation, 0.02 * EDGE);
        assert_eq!(inside, 0, "{frame}: {:?}", simulation.report().contact);
    }
    assert!(simulation.report().contact.unwrap().active > 0);
}
