//! A restored simulation continues from its snapshot as it did before, to the bit.

use std::path::Path;

use incise::mesh::glam::DVec3;
use incise::report::Milliseconds;
use incise::scene::{Precision, Quantity, ReportSpec, SolverSpec, StrokeSpec, Substeps};
use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation, state, sweep};

/// All that is to be seen of a simulation, as words; times aside.
pub(crate) fn everything(simulation: &mut Simulation) -> Vec<u64> {
    simulation.read_back().unwrap();
    let mut report = simulation.report().clone();
    report.ms = Milliseconds::default();
    let triangles: Vec<_> = simulation.boundary().collect();
    let text = format!(
        "{report:?} {:?} {:?} {:?} {:?} {:?}",
        simulation.pieces(),
        simulation.on_cut(),
        simulation.mesh().tets,
        triangles,
        simulation.softened(),
    );
    let mut words = state(simulation);
    words.extend(text.bytes().map(u64::from));
    words
}

/// Simulates some more frames; returns all that is visible after each.
fn go_on(simulation: &mut Simulation, frames: u32) -> Vec<Vec<u64>> {
    (0..frames)
        .map(|_| {
            simulation.step().unwrap();
            everything(simulation)
        })
        .collect()
}

/// A plane through the middle, at once.
pub(crate) fn halving(at: f64) -> StrokeSpec {
    StrokeSpec::plane(0, [at, 0.0, 0.0], [1.0, 0.2, 0.1])
}

/// Takes a snapshot at a frame and continues; restores it in this and in another simulation of the scene, makes a new
/// simulation of it, and of one that was written and read; all continue equally.
fn comes_back(scene: &Scene, first: u32, frames: u32) {
    let mut one = simulation(scene);
    go_on(&mut one, first);
    let at_that_time = everything(&mut one);
    let snapshot = one.snapshot().unwrap();
    assert!(everything(&mut one) == at_that_time, "it has changed");
    let then = go_on(&mut one, frames);
    let mut other = simulation(scene);
    for simulation in [&mut one, &mut other] {
        simulation.restore(&snapshot).unwrap();
        assert!(simulation.deltas().is_empty());
        simulation.check().unwrap();
        assert!(everything(simulation) == at_that_time);
        assert!(go_on(simulation, frames) == then, "it went on otherwise");
        simulation.check().unwrap();
    }
    let mut fresh = Simulation::from_snapshot(&snapshot).unwrap();
    assert!(everything(&mut fresh) == at_that_time);
    assert!(go_on(&mut fresh, frames) == then, "a fork differs");
    #[cfg(feature = "save")]
    {
        let bytes = postcard::to_stdvec(&snapshot).unwrap();
        let read: incise::Snapshot = postcard::from_bytes(&bytes).unwrap();
        let mut loaded = Simulation::from_snapshot(&read).unwrap();
        assert!(go_on(&mut loaded, frames) == then, "what was read differs");
        loaded.check().unwrap();
    }
}

#[test]
fn every_shipped_scene_goes_on_as_it_did() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    // Each before something is cut, or while it is.
    for (name, first, frames) in [
        ("beam", 3, 4),
        ("crossing", 5, 20),
        ("two_bodies", 2, 4),
        ("colliders", 20, 5),
        ("attachments", 64, 8),
        ("distances", 5, 5),
    ] {
        let mut scene = Scene::load(&folder.join(format!("{name}.toml"))).unwrap();
        for precision in [Precision::F32, Precision::F64] {
            scene.solver.precision = precision;
            let mut simulation = simulation(&scene);
            let cuts = (0..first + frames).any(|_| simulation.step().unwrap().cut.is_some());
            assert!(cuts || scene.stroke.is_empty(), "{name} is not cut");
            comes_back(&scene, first, frames);
        }
    }
}

/// A beam and a box, swept and halved, with what else the text of the solver says.
fn two_bodies(solver: &str) -> Scene {
    let beam = body("beam", 300, [0.0, 0.0, 0.0]);
    let cube = body("box", 200, [0.0, 2.0, 0.0]);
    let sweep = sweep(
        [1, 6],
        [[0.05, -1.0, 0.6], [0.1, 3.0, 0.6]],
        [0.0, 0.0, -1.2],
    );
    let plane = plane(4, [-0.1, 0.0, 0.0], [1.0, 0.2, 0.0]);
    scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.8, friction = 0.4 }}\n\
         [report]\nquantities = [\"residual\", \"kappa\", \"energy\"]\n[solver]\n{solver}\n\
         {beam}{cube}{sweep}{plane}"
    ))
}

#[test]
fn every_method_goes_on_as_it_did() {
    for solver in [
        "iterations = 3\ntet_solve = \"sequential\"",
        "method = \"jacobi\"",
        "method = \"chebyshev\"\nprecision = \"f64\"",
        "method = \"vbd\"\nsubsteps = 2",
        "method = \"vbd\"\nsubsteps = 1\niterations = 2\ntwo_level = true\nprecision = \"f64\"",
        "substeps = \"auto\"\nmax_substeps = 7\nmerge_clusters = false",
        // One falls asleep before the snapshot, and is woken by the blade.
        "sleep = { speed = 10.0, time = 0.02 }",
    ] {
        comes_back(&two_bodies(solver), 3, 5);
    }
}

#[test]
fn clusters_under_way_are_taken_in_their_frame() {
    let scene = two_bodies("recluster = { threshold = 1.01, frames = 3 }");
    let mut simulation = simulation(&scene);
    let frames = |simulation: &mut Simulation| -> Vec<usize> {
        let frames = (0..6).map(|_| simulation.step().unwrap().reclustered);
        frames.collect()
    };
    let mut first = (0..8).map(|_| simulation.step().unwrap().cut.is_some());
    assert!(first.any(|cut| cut), "no clusters are worn");
    simulation.step().unwrap();
    let snapshot = simulation.snapshot().unwrap();
    let then = frames(&mut simulation);
    assert!(then[..2] == [0, 0] && then[2] > 0, "{then:?}");
    simulation.restore(&snapshot).unwrap();
    assert_eq!(frames(&mut simulation), then);
    let first = u32::try_from(simulation.report().frame + 1 - 6).unwrap();
    comes_back(&scene, first, 6);
}

#[test]
fn later_changes_are_undone() {
    let mut simulation = simulation(&scene(&body("sphere", 300, [0.0, 0.0, 0.0])));
    simulation.step().unwrap();
    let before = simulation.snapshot().unwrap();
    let pieces = simulation.pieces();
    for at in [0.01, -0.2] {
        simulation.cut(halving(at)).unwrap();
        simulation.step().unwrap();
        assert_eq!(simulation.report().pieces, 2);
        let tags = simulation
            .boundary()
            .filter(|t| t.tag == incise::cutting::FaceTag::Cut(0));
        assert!(tags.count() > 0, "the stroke has the number of the first");
        simulation.restore(&before).unwrap();
        assert_eq!(simulation.pieces(), pieces);
        assert!(simulation.on_cut().is_empty());
        // A stroke that was added and has not cut goes, too.
        simulation.cut(halving(at)).unwrap();
        simulation.restore(&before).unwrap();
        assert_eq!(simulation.step().unwrap().pieces, 1);
        simulation.restore(&before).unwrap();
    }
}

/// A simulation of other bodies, another precision, or more bodies than the snapshot's takes all of it over.
#[test]
fn a_snapshot_of_another_simulation_is_continued() {
    let one = scene(&body("sphere", 300, [0.0, 0.0, 0.0]));
    let mut first = simulation(&one);
    first.cut(halving(0.03)).unwrap();
    go_on(&mut first, 2);
    let snapshot = first.snapshot().unwrap();
    let then = go_on(&mut first, 3);
    let mut doubled = one.clone();
    doubled.solver.precision = Precision::F64;
    let others = [
        scene(&body("box", 300, [0.0, 0.0, 0.0])),
        scene(&body("sphere", 300, [0.0, 0.0, 0.0]).repeat(2)),
        doubled,
    ];
    for other in others {
        let mut simulation = simulation(&other);
        simulation.step().unwrap();
        simulation.restore(&snapshot).unwrap();
        simulation.check().unwrap();
        assert!(go_on(&mut simulation, 3) == then);
    }
}

#[test]
fn reports_change_from_the_next_frame_on() {
    let mut simulation = simulation(&scene(&body("sphere", 300, [0.0, 0.0, 0.0])));
    assert!(simulation.step().unwrap().energy.is_none());
    let report = ReportSpec::default().with(|spec| {
        spec.every = 2;
        spec.quantities = vec![Quantity::Energy];
    });
    simulation.set_report(report.clone()).unwrap();
    let reported = |simulation: &mut Simulation| simulation.step().unwrap().energy.is_some();
    // Frames are counted from the first.
    assert_eq!(
        [1, 2, 3].map(|_| reported(&mut simulation)),
        [false, true, false]
    );
    let snapshot = simulation.snapshot().unwrap();
    simulation.set_report(ReportSpec::default()).unwrap();
    assert!(!reported(&mut simulation));
    simulation.restore(&snapshot).unwrap();
    assert!(reported(&mut simulation));
    let none = report.with(|spec| spec.every = 0);
    let error = simulation.set_report(none).unwrap_err();
    assert!(error.to_string().contains("report.every"), "{error}");
    assert!(!reported(&mut simulation));
    assert!(reported(&mut simulation));
}

/// Against what an allocator counts.
#[test]
fn the_bytes_are_about_those_that_are_asked_for() {
    let of = |name: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
        Scene::load(&folder.join(format!("{name}.toml"))).unwrap()
    };
    let with = |mut scene: Scene, change: &dyn Fn(&mut SolverSpec)| {
        change(&mut scene.solver);
        scene
    };
    let doubled = |name| with(of(name), &|solver| solver.precision = Precision::F64);
    for (scene, frames) in [
        (of("beam"), 1),
        (of("crossing"), 2),
        (of("crossing"), 12),
        (of("crossing"), 45),
        (doubled("crossing"), 45),
        (of("two_bodies"), 2),
        (doubled("two_bodies"), 6),
        (of("attachments"), 70),
        (doubled("distances"), 1),
        (two_bodies("method = \"vbd\"\nsubsteps = 1"), 2),
        (
            two_bodies("method = \"vbd\"\nsubsteps = 1\ntwo_level = true\nprecision = \"f64\""),
            2,
        ),
        (
            two_bodies("recluster = { threshold = 1.01, frames = 9 }"),
            6,
        ),
    ] {
        let mut simulation = simulation(&scene);
        (0..frames).for_each(|_| assert!(simulation.step().is_ok()));
        let mut snapshot = None;
        let asked = allocation_counter::measure(|| snapshot = Some(simulation.snapshot().unwrap()));
        let ratio = snapshot.unwrap().bytes() as f64 / asked.bytes_current as f64;
        // Strokes' memories and small clusters are not known better.
        assert!(
            (0.8..1.2).contains(&ratio),
            "{ratio} times what is asked for"
        );
    }
}

#[test]
fn grabs_continue_from_a_snapshot() {
    for precision in [Precision::F32, Precision::F64] {
        let mut scene = scene(&body("box", 400, [0.0; 3]));
        scene.solver.precision = precision;
        let mut simulation = simulation(&scene);
        let blade = |z: f64| [DVec3::new(-1.0, 0.03, z), DVec3::new(1.0, 0.03, z)];
        let top = simulation.positions().iter().copied();
        let top = top.fold(DVec3::NEG_INFINITY, |a, b| if b.z > a.z { b } else { a });
        let grab = simulation.grab(top, 0.2, 1e-4).unwrap().unwrap();
        let stroke = simulation.begin_stroke(&blade(0.6), 0.1).unwrap();
        // Half of the stroke before the moment, half after it; the hand pulls all the time.
        let work = |simulation: &mut Simulation, frames: std::ops::Range<u32>| {
            let mut seen = Vec::new();
            for frame in frames {
                let way = f64::from(frame);
                simulation
                    .move_blade(stroke, &blade(0.5 - 0.1 * way))
                    .unwrap();
                simulation
                    .move_grab(grab, top + DVec3::Y * (0.01 * way))
                    .unwrap();
                seen.extend(go_on(simulation, 1));
            }
            seen
        };
        work(&mut simulation, 0..5);
        let tets = simulation.mesh().tets.len();
        let snapshot = simulation.snapshot().unwrap();
        let then = work(&mut simulation, 5..12);
        simulation.end_stroke(stroke).unwrap();
        simulation.release(grab).unwrap();
        go_on(&mut simulation, 2);
        simulation.restore(&snapshot).unwrap();
        assert!(work(&mut simulation, 5..12) == then, "it went on otherwise");
        assert!(
            simulation.mesh().tets.len() > tets,
            "the blade goes on, too"
        );
        // Other settings leave hands as they are.
        let spec = simulation.solver_spec().clone().with(|spec| {
            spec.substeps = Substeps::Fixed(9);
            spec.clustering = "serial:5".to_owned();
        });
        simulation.set_solver(&spec).unwrap();
        work(&mut simulation, 12..14);
        simulation.end_stroke(stroke).unwrap();
        simulation.release(grab).unwrap();
        simulation.check().unwrap();
    }
}
