//! Contact through everything else that changes a scene: sleep, snapshots, undo, files, removal and cuts of what touches.

use incise::mesh::glam::{DVec3, dvec3};
use incise::scene::{ContactSpec, Precision, SleepSpec};
use incise::{Event, Simulation, SimulationBuilder};

use crate::contact::{EDGE, GRAVITY, cube, cut, intruders, seen, solver, steps, steps_of};

/// Cubes on each other that may sleep, of which strokes cut some.
fn tower(count: u32, precision: Precision) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    let sleep = SleepSpec::default().with(|spec| {
        spec.speed = 1e-2;
        spec.time = 0.2;
    });
    let spec = solver(precision, 20).with(|spec| spec.sleep = Some(sleep));
    builder.gravity(GRAVITY).ground(0.0, 0.5).solver(spec);
    for number in 0..count {
        let at = dvec3(0.0, 0.0, EDGE * f64::from(number));
        builder.add_body(cube(at).damping(0.1));
    }
    builder.contact(ContactSpec::default());
    builder
}

fn is_asleep(simulation: &Simulation) -> bool {
    simulation
        .report()
        .bodies
        .iter()
        .all(|body| body.asleep == Some(true))
}

/// A cut through the lower of two sleeping cubes wakes both: the cut face and the contact above it carry the weight, and
/// all falls asleep again. No contact ends meanwhile.
#[test]
fn a_cut_wakes_what_lies_on_it() {
    let mut simulation = tower(2, Precision::F32).build().unwrap();
    steps(&mut simulation, 150);
    assert!(is_asleep(&simulation));
    let frame = simulation.report().frame + 1;
    simulation
        .cut(cut(frame, dvec3(0.0, 0.0, 0.11), dvec3(0.1, 0.0, 1.0)))
        .unwrap();
    steps(&mut simulation, 1);
    assert!(!is_asleep(&simulation));
    assert_eq!(simulation.report().pieces, 3);
    let mut events = Vec::new();
    for _ in 0..120 {
        steps(&mut simulation, 1);
        events.extend(simulation.events().to_vec());
        simulation.check().unwrap();
    }
    let ends = |event: &Event| matches!(event, Event::ContactEnded { .. });
    assert!(!events.iter().any(ends), "{events:?}");
    // Piece 2 is the lower part of the lower cube.
    let mass = |piece: usize| simulation.pieces()[piece].mass;
    let contacts = simulation.contacts();
    let bears: Vec<_> = contacts.iter().map(|c| (c.pieces, c.force.z)).collect();
    let [([0, 1], upper), ([0, 2], lower)] = bears[..] else {
        panic!("{bears:?}");
    };
    for (force, mass) in [(upper, mass(1)), (-lower, mass(0) + mass(1))] {
        let weight = mass * -GRAVITY.z;
        assert!((force - weight).abs() < 0.02 * weight, "{force} {weight}");
    }
    steps(&mut simulation, 120);
    assert!(is_asleep(&simulation));
    assert_eq!(intruders(&simulation, 1e-3 * EDGE), 0);
}

/// A snapshot of sleeping bodies that touch sleeps, keeps their contacts, and wakes to the same bits.
#[test]
fn sleep_and_contact_survive_a_snapshot() {
    let mut simulation = tower(3, Precision::F32).build().unwrap();
    steps(&mut simulation, 20);
    let frame = simulation.report().frame + 1;
    simulation
        .cut(cut(frame, dvec3(0.0, 0.0, 0.36), dvec3(0.2, 0.1, 1.0)))
        .unwrap();
    steps(&mut simulation, 200);
    assert!(is_asleep(&simulation));
    let snapshot = simulation.snapshot().unwrap();
    let continued = |simulation: &mut Simulation| {
        // Which contacts press is a count of the last step, and no step is made here.
        steps(simulation, 3);
        let contacts = format!("{:?}", simulation.contacts());
        let asleep = (simulation.positions().to_vec(), contacts);
        assert!(is_asleep(simulation) && simulation.events().is_empty());
        assert_eq!(simulation.contacts().len(), 3);
        simulation.set_velocities(|x| x * 0.5).unwrap();
        let awake = steps_of(simulation, 30);
        assert!(!is_asleep(simulation));
        simulation.check().unwrap();
        (asleep, awake)
    };
    let first = continued(&mut simulation);
    let mut other = Simulation::from_snapshot(&snapshot).unwrap();
    assert!(continued(&mut other) == first);
    simulation.restore(&snapshot).unwrap();
    assert!(continued(&mut simulation) == first);
    #[cfg(feature = "save")]
    {
        let bytes = postcard::to_stdvec(&snapshot).unwrap();
        let read: incise::Snapshot = postcard::from_bytes(&bytes).unwrap();
        let mut of_file = Simulation::from_snapshot(&read).unwrap();
        assert!(continued(&mut of_file) == first);
    }
}

/// A cut through bodies that touch is undone without a trace: what follows is, to the bit, what follows without it, and the
/// same cut made again gives the same bits again.
#[test]
fn a_cut_in_contact_is_undone() {
    for precision in [Precision::F32, Precision::F64] {
        let mut simulation = tower(2, precision).build().unwrap();
        steps(&mut simulation, 25);
        let before = simulation.snapshot().unwrap();
        let uncut = steps_of(&mut simulation, 15);
        simulation.restore(&before).unwrap();
        let frame = simulation.report().frame + 1;
        let stroke = cut(frame, dvec3(0.12, 0.12, 0.25), dvec3(1.0, 0.2, 0.5));
        let mut runs = Vec::new();
        for _ in 0..2 {
            simulation.cut(stroke.clone()).unwrap();
            runs.push(steps_of(&mut simulation, 15));
            assert_eq!(simulation.report().pieces, 4);
            simulation.check().unwrap();
            simulation.restore(&before).unwrap();
            simulation.check().unwrap();
            assert!(steps_of(&mut simulation, 15) == uncut);
            simulation.restore(&before).unwrap();
        }
        assert!(runs[0] == runs[1] && runs[0] != uncut);
    }
}

/// A piece that lies on what it was cut off is cut again and again, also through both: each part rests on what is below it,
/// the lowest cut bears the weight of all parts above, and threads change nothing.
#[test]
fn a_piece_in_contact_is_cut_again() {
    let run = |threads: usize| {
        let mut builder = Simulation::builder();
        builder
            .gravity(GRAVITY)
            .ground(0.0, 0.5)
            .solver(solver(Precision::F64, 20))
            .threads(threads);
        builder.add_body(cube(DVec3::ZERO).young_modulus(3e5).damping(0.05));
        builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.8));
        let mut simulation = builder.build().unwrap();
        let mut frames = Vec::new();
        // The slab above, its two halves, and the block below with them.
        for (place, normal, pieces) in [
            (dvec3(0.0, 0.0, 0.14), DVec3::Z, 2),
            (dvec3(0.0, 0.0, 0.2), dvec3(0.05, 0.0, 1.0), 3),
            (dvec3(0.13, 0.1, 0.0), dvec3(1.0, 0.1, 0.0), 6),
        ] {
            let frame = simulation.report().frame + 1;
            simulation.cut(cut(frame, place, normal)).unwrap();
            for _ in 0..30 {
                simulation.step().unwrap();
                assert_eq!(simulation.report().repaired, 0);
                simulation.check().unwrap();
                frames.push(seen(&simulation));
            }
            assert_eq!(simulation.report().pieces, pieces);
            let contact = simulation.report().contact.unwrap();
            // Where three pieces meet, a corner that is under the plane of one triangle and outside of its tet counts as
            // deep, so the largest depth says less than what lies in the tets of other pieces.
            assert!(
                contact.buried == 0 && contact.depth_p99 < 0.01 && contact.max_depth < 0.1,
                "{contact:?}"
            );
            assert_eq!(intruders(&simulation, 2e-3 * EDGE), 0);
        }
        (simulation, frames)
    };
    let (mut simulation, frames) = run(1);
    assert!(run(2).1 == frames);
    // What touches a piece from above and from below differs by its weight.
    steps(&mut simulation, 60);
    let pieces = simulation.pieces();
    let mut sums = vec![DVec3::ZERO; pieces.len()];
    let averaged = 40;
    for _ in 0..averaged {
        steps(&mut simulation, 1);
        for contact in simulation.contacts() {
            let [below, above] = contact.pieces.map(|piece| piece as usize);
            sums[above] += contact.force / f64::from(averaged);
            sums[below] -= contact.force / f64::from(averaged);
        }
    }
    let positions = simulation.positions();
    let numbers = simulation.piece_numbers();
    let lowest = |piece: u32| {
        let tets = simulation.mesh().tets.iter().zip(&numbers);
        let of_piece = tets.filter(|(_, number)| **number == piece);
        let heights = of_piece.flat_map(|(tet, _)| tet.map(|p| positions[p.index()].z));
        heights.fold(f64::INFINITY, f64::min)
    };
    let mut free = 0;
    for piece in &pieces {
        if lowest(piece.id) < 0.01 {
            continue;
        }
        let weight = piece.mass * -GRAVITY.z;
        let force = sums[piece.id as usize];
        assert!(
            (force.z - weight).abs() < 0.03 * weight,
            "{piece:?} {force}"
        );
        free += 1;
    }
    assert_eq!(free, 4, "{pieces:?}");
}

/// A cut body below another is removed while both parts bear it: their contacts end, and it falls to the ground.
#[test]
fn a_cut_body_is_removed_from_below() {
    let mut builder = tower(2, Precision::F64);
    builder.add_stroke(cut(5, dvec3(0.12, 0.0, 0.0), DVec3::X));
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 100);
    assert_eq!(simulation.report().pieces, 4);
    let bodies = simulation.bodies();
    simulation.remove_body(bodies[0]).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
    let ended = |event: &&Event| matches!(event, Event::ContactEnded { .. });
    assert!(simulation.events().iter().filter(ended).count() >= 2);
    steps(&mut simulation, 120);
    let lowest = simulation.pieces().iter().map(|piece| piece.body).min();
    assert_eq!(lowest, Some(1));
    let used = simulation.mesh().tets.iter().flatten();
    let height = used.map(|p| simulation.positions()[p.index()].z);
    let height = height.fold(f64::INFINITY, f64::min);
    assert!(height.abs() < 1e-3, "{height}");
    assert_eq!(intruders(&simulation, 1e-3 * EDGE), 0);
    simulation.check().unwrap();
}
