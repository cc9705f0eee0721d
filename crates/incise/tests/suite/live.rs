//! Blades that are moved frame by frame cut as those of a scene do, and what is asked of none is refused.

use incise::cutting::FaceTag;
use incise::mesh::ParticleId;
use incise::mesh::glam::{DVec3, dvec3};
use incise::scene::{Precision, Region, SleepSpec};
use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation, state, sweep};

const GRAVITY: &str = "[world]\ngravity = [0.0, 0.0, -9.81]\n";
/// A blade along x, from above to below a body of length 1.
const BLADE: [[f64; 3]; 2] = [[-1.0, 0.03, 0.7], [1.0, 0.05, 0.7]];
const WAY: [f64; 3] = [0.01, 0.02, -1.4];

/// The default of scenes.
const SNAP: f64 = 0.1;

/// The blade of a scene's sweep at a fraction of its way.
fn pose(fraction: f64) -> [DVec3; 2] {
    let offset = DVec3::ZERO.lerp(DVec3::from_array(WAY), fraction);
    BLADE.map(|x| DVec3::from_array(x) + offset)
}

/// Asserts that two simulations are bit-identical in all that a frame leaves behind, and in what its report counts.
fn assert_same(one: &Simulation, other: &Simulation, frame: u64) {
    assert!(state(one) == state(other), "frame {frame}");
    assert_eq!(one.report().cut, other.report().cut, "frame {frame}");
    assert!(one.deltas() == other.deltas(), "frame {frame}");
    let boundary = |s: &Simulation| s.boundary().collect::<Vec<_>>();
    assert!(boundary(one) == boundary(other), "frame {frame}");
}

/// Two falling bodies, one of which meets a scripted plane as well.
fn falling(precision: Precision, more: &str) -> Scene {
    let bodies = body("sphere", 500, [0.0; 3]) + &body("box", 300, [0.4, 0.0, -1.2]);
    let mut scene = scene(&format!("{GRAVITY}{more}{bodies}"));
    scene.solver.precision = precision;
    scene
}

#[test]
fn a_live_blade_cuts_as_a_sweep_of_the_scene_to_the_bit() {
    let frames = [2, 12];
    for precision in [Precision::F32, Precision::F64] {
        let strokes = plane(5, [0.1, 0.0, 0.0], [1.0, 0.1, 0.2]);
        let live = falling(precision, &strokes);
        let mut scripted = live.clone();
        scripted
            .stroke
            .extend(scene(&sweep(frames, BLADE, WAY)).stroke);
        let (mut scripted, mut live) = (simulation(&scripted), simulation(&live));
        let mut stroke = None;
        for frame in 0..16 {
            let fraction = (frame.min(frames[1]) - frame.min(frames[0])) as f64 / 10.0;
            match stroke {
                None if frame == frames[0] => {
                    // Neither the first pose nor a later one counts before the last one before the frame.
                    let begun = live.begin_stroke(&pose(0.3), SNAP).unwrap();
                    live.move_blade(begun, &pose(fraction)).unwrap();
                    stroke = Some(begun);
                }
                Some(stroke) if frame <= frames[1] => {
                    live.move_blade(stroke, &pose(0.9)).unwrap();
                    live.move_blade(stroke, &pose(fraction)).unwrap();
                    if frame == frames[1] {
                        live.end_stroke(stroke).unwrap();
                        assert!(live.move_blade(stroke, &pose(0.0)).is_err());
                    }
                }
                _ => {}
            }
            scripted.step().unwrap();
            live.step().unwrap();
            assert_same(&scripted, &live, frame);
            live.check().unwrap();
        }
        // A sphere in four, a box in two.
        assert!(live.report().pieces >= 5, "{}", live.report().pieces);
        // The plane of the scene is stroke 0.
        assert_eq!(stroke, Some(1));
        let tagged = |t: u32| live.boundary().any(|b| b.tag == FaceTag::Cut(t));
        assert!(tagged(0) && tagged(1) && !tagged(2));
    }
}

/// A blade that stands still, as a sweep whose way has no length does, cuts what falls through it.
#[test]
fn a_body_falls_through_a_blade_that_is_held() {
    let below = |x: [f64; 3]| [x[0], x[1], -0.7];
    let blade = BLADE.map(below);
    let live = falling(Precision::F64, "");
    let mut scripted = live.clone();
    let still = sweep([0, 60], blade, [0.0; 3]);
    scripted.stroke = scene(&still).stroke;
    let (mut scripted, mut live) = (simulation(&scripted), simulation(&live));
    let stroke = live
        .begin_stroke(&blade.map(DVec3::from_array), SNAP)
        .unwrap();
    for frame in 0..=60 {
        scripted.step().unwrap();
        live.step().unwrap();
        assert_same(&scripted, &live, frame);
    }
    live.end_stroke(stroke).unwrap();
    live.check().unwrap();
    // The sphere falls 4.7 m in 61 frames of 0.016 s, through the blade; the box began below it.
    assert_eq!(live.report().pieces, 3);
}

/// A stroke may stop in the body, and another one continues where it stopped; a third one is held meanwhile elsewhere.
#[test]
fn a_stroke_goes_on_where_another_stopped() {
    let mut scene = scene(&body("box", 600, [0.0; 3]));
    scene.solver.precision = Precision::F64;
    // So that frames without a cut have no report of one.
    scene.cutting.improve = false;
    let mut simulation = simulation(&scene);
    let across = |z: f64| [dvec3(-1.0, 0.03, z), dvec3(1.0, 0.03, z)];
    let along = |y: f64| [dvec3(0.3, y, -1.0), dvec3(0.3, y, 1.0)];
    let first = simulation.begin_stroke(&across(0.6), SNAP).unwrap();
    let other = simulation.begin_stroke(&along(-0.6), SNAP).unwrap();
    simulation.step().unwrap();
    simulation.move_blade(first, &across(0.02)).unwrap();
    simulation.move_blade(other, &along(-0.3)).unwrap();
    let cut = simulation.step().unwrap().cut.unwrap();
    assert!(cut.tets_cut > 0);
    // Nothing is pending: it ends at once, and the other one continues.
    simulation.end_stroke(first).unwrap();
    assert_eq!(simulation.step().unwrap().cut, None);
    assert_eq!(simulation.report().pieces, 1);
    let second = simulation.begin_stroke(&across(0.02), SNAP).unwrap();
    assert_eq!([first, other, second], [0, 1, 2]);
    for z in [0.02, -0.3, -0.6] {
        simulation.move_blade(second, &across(z)).unwrap();
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
    simulation.end_stroke(second).unwrap();
    simulation.end_stroke(other).unwrap();
    assert_eq!(simulation.report().pieces, 2);
    assert_eq!(simulation.step().unwrap().cut, None);
}

#[test]
fn invalid_blades_are_refused_and_nothing_changes() {
    let mut simulation = simulation(&scene(&body("box", 200, [0.0; 3])));
    let refused = |result: Result<(), incise::Error>, expected: &str| {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    };
    let [a, b] = pose(0.0);
    let nan = dvec3(0.0, f64::NAN, 0.0);
    for (blade, snap, expected) in [
        (&[][..], 0.0, "stroke[0].blade"),
        (&[a], 0.0, "stroke[0].blade"),
        (&[a, a, a], 0.0, "stroke[0].blade"),
        (&[a, nan], 0.0, "stroke[0].blade is NaN"),
        (&[a, DVec3::X * 1e300], 0.0, "stroke[0].blade"),
        (&[a, b], 0.3, "stroke[0].snap"),
        (&[a, b], f64::NAN, "stroke[0].snap"),
    ] {
        refused(simulation.begin_stroke(blade, snap).map(drop), expected);
    }
    refused(simulation.move_blade(0, &[a, b]), "stroke is 0");
    refused(simulation.end_stroke(0), "stroke is 0");

    let stroke = simulation.begin_stroke(&[a, b], 0.0).unwrap();
    assert_eq!(stroke, 0, "what was refused has no number");
    simulation.step().unwrap();
    for (blade, expected) in [
        (&[a][..], "stroke[0].blade"),
        (&[a, b, a], "stroke[0].blade"),
        (&[a, nan], "stroke[0].blade is NaN"),
        (&[a, DVec3::splat(f64::INFINITY)], "stroke[0].blade"),
    ] {
        refused(simulation.move_blade(stroke, blade), expected);
    }
    // A blade that was moved wrongly stands where it was.
    assert_eq!(simulation.step().unwrap().cut, None);
    simulation.move_blade(stroke, &pose(1.0)).unwrap();
    assert!(simulation.step().unwrap().cut.is_some());
    simulation.end_stroke(stroke).unwrap();
    refused(simulation.move_blade(stroke, &[a, b]), "stroke is 0");
    refused(simulation.end_stroke(stroke), "stroke is 0");
    refused(simulation.end_stroke(7), "stroke is 7");

    // Strokes of the scene cannot be moved interactively.
    simulation
        .cut(scene(&sweep([4, 40], BLADE, WAY)).stroke[0].clone())
        .unwrap();
    refused(simulation.move_blade(1, &[a, b]), "stroke is 1");
    refused(simulation.end_stroke(1), "stroke is 1");
    // One that no frame has seen leaves nothing.
    let unseen = simulation.begin_stroke(&[a, b], 0.0).unwrap();
    simulation.move_blade(unseen, &pose(0.5)).unwrap();
    simulation.end_stroke(unseen).unwrap();
    refused(simulation.move_blade(unseen, &[a, b]), "stroke is 2");
    simulation.step().unwrap();
    simulation.check().unwrap();
}

/// Every particle of two bodies is found where it is solved, those that cuts make too.
#[test]
fn particles_are_found_in_their_islands() {
    let bodies = body("box", 200, [0.0; 3]) + &body("sphere", 200, [3.0, 0.0, 0.0]);
    let strokes = plane(1, [0.03, 0.0, 0.0], [1.0, 0.1, 0.0])
        + &plane(2, [0.0, 0.0, 0.02], [0.1, 0.0, 1.0])
        + &plane(2, [0.0, 0.03, 0.02], [0.1, 1.0, 0.3]);
    let mut simulation = simulation(&scene(&(bodies + &strokes)));
    for _ in 0..3 {
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
    let mut counts = [0; 2];
    for (p, x) in simulation.mesh().positions.iter().enumerate() {
        let (island, number) = simulation.location_of(ParticleId::new(p));
        assert_eq!(island, usize::from(x.x > 1.5));
        // Particles of an island keep their order.
        assert_eq!(number, counts[island]);
        counts[island] += 1;
    }
    assert!(counts[0] > 60 && counts[1] > 60, "{counts:?}");
    let alone = self::simulation(&scene(&body("box", 200, [0.0; 3])));
    assert_eq!(alone.location_of(ParticleId(7)), (0, 7));
    assert_eq!((alone.time_step(), alone.next_frame()), (0.016, 0));
    assert_eq!(simulation.next_frame(), 3);
}

/// Velocities reach what nothing holds, wake what sleeps, and are refused together.
#[test]
fn velocities_are_set_between_frames() {
    for precision in [Precision::F32, Precision::F64] {
        let mut falling = scene(&body("box", 200, [0.0; 3]));
        falling.world.gravity = Some([0.0; 3]);
        falling.solver.sleep = Some(SleepSpec::new(1e-3, 0.1));
        falling.solver.precision = precision;
        let mut held = falling.clone();
        held.body[0].fixed = vec![Region::half_space([-0.4, 0.0, 0.0], [-1.0, 0.0, 0.0])];
        let mut free = Simulation::new(&falling).unwrap();
        while free.report().bodies[0].asleep != Some(true) {
            free.step().unwrap();
        }
        let before = free.positions().to_vec();
        assert!(free.set_velocities(|x| x / 0.0).is_err());
        free.step().unwrap();
        assert_eq!(free.positions(), before);
        let velocity = dvec3(1.0, 2.0, 3.0);
        free.set_velocities(|_| velocity).unwrap();
        free.step().unwrap();
        let way = velocity * free.time_step();
        for (x, before) in free.positions().iter().zip(&before) {
            assert!(x.distance(*before + way) < 1e-5, "{x} from {before}");
        }
        let mut held = Simulation::new(&held).unwrap();
        let before = held.positions().to_vec();
        held.set_velocities(|_| DVec3::X).unwrap();
        held.step().unwrap();
        for (x, before) in held.positions().iter().zip(&before) {
            if before.x <= -0.4 {
                assert_eq!(x, before);
            }
        }
        let moved = held.positions().iter().zip(&before);
        assert!(moved.filter(|(x, before)| x.x > before.x).count() > 10);
    }
}
