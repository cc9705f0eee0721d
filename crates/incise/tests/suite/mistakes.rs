//! Mistakes that are no numbers, or lie between numbers, are refused by the name of their field as well.

use incise::scene::{Region, SleepSpec, StrokeSpec};
use incise::{Scene, Simulation};

use crate::values::{plane, refused, region, sound, sweep};

/// A mistake in a sound scene, and the field an error names.
type Mistake = (&'static str, fn(&mut Scene));

const MISTAKES: [Mistake; 28] = [
    ("solver.substeps", |s| s.solver.substeps = 0.into()),
    ("solver.sleep.speed", |s| {
        s.solver.sleep = Some(SleepSpec::new(f64::NAN, 1.0));
    }),
    ("solver.sleep.time", |s| {
        s.solver.sleep = Some(SleepSpec::new(1.0, 0.0));
    }),
    ("solver.max_substeps", |s| s.solver.max_substeps = 0),
    ("body[0].substeps", |s| s.body[0].substeps = Some(0.into())),
    ("solver.iterations", |s| s.solver.iterations = 0),
    ("solver.clustering", |s| {
        s.solver.clustering = "serial:0".into();
    }),
    ("solver.clustering", |s| {
        s.solver.clustering = "serial:-1".into();
    }),
    ("solver.clustering", |s| {
        s.solver.clustering = "serial".into();
    }),
    ("solver.clustering", |s| {
        s.solver.clustering = "parallel:4".into();
    }),
    ("solver.clustering", |s| s.solver.clustering = String::new()),
    ("solver.coloring", |s| s.solver.coloring = "gredy".into()),
    ("report.every", |s| s.report.every = 0),
    ("body", |s| s.body.clear()),
    ("body[0]", |s| s.body[0].shape = None),
    ("body[0]", |s| s.body[0].mesh = Some("both.vtk".into())),
    ("body[0].shape", |s| {
        s.body[0].shape.as_mut().unwrap().kind = "cube".into();
    }),
    ("body[0].shape", |s| {
        s.body[0].shape.as_mut().unwrap().tets = 0;
    }),
    ("body[0].shape", |s| {
        s.body[0].shape.as_mut().unwrap().tets = usize::MAX;
    }),
    ("body[0].fixed[3].particles", |s| {
        s.body[0].fixed[3] = Region::Particles(vec![0, 4_000_000_000]);
    }),
    ("body[0].fixed[0].half_space.normal", |s| {
        *region(s, 1) = 0.0;
    }),
    ("body[0].fixed[1].box", |s| *region(s, 2) = 1.5),
    ("stroke[0].normal", |s| plane(s).1[0] = 0.0),
    ("stroke[1].frames", |s| *sweep(s).0 = [3, 3]),
    ("stroke[1].frames", |s| *sweep(s).0 = [3, 2]),
    ("stroke[1].path", |s| sweep(s).2.truncate(1)),
    ("stroke[1].blade", |s| sweep(s).1.truncate(1)),
    ("stroke[1].blade", |s| {
        let blade = sweep(s).1;
        blade[1] = blade[0];
    }),
];

#[test]
fn mistakes_are_refused_by_name() {
    for (field, mistake) in MISTAKES {
        let mut scene = sound();
        mistake(&mut scene);
        refused(&scene, field);
    }
    assert!(
        Simulation::with_threads(&sound(), 0)
            .unwrap_err()
            .to_string()
            .starts_with("threads is 0")
    );
}

#[test]
fn the_largest_frame_number_does_not_overflow() {
    let mut scene = sound();
    match &mut scene.stroke[0] {
        StrokeSpec::Plane { frame, .. } => *frame = u64::MAX,
        _ => panic!("the first stroke is a plane"),
    }
    *sweep(&mut scene).0 = [0, u64::MAX];
    assert_eq!(scene.frames_needed(), u64::MAX);
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.step().unwrap();
}

/// A stroke added during the run is checked like those of the scene, and refused without a trace.
#[test]
fn a_late_stroke_is_checked_too() {
    let mut simulation = Simulation::new(&sound()).unwrap();
    let mut stroke = sound().stroke[0].clone();
    if let StrokeSpec::Plane { normal, .. } = &mut stroke {
        *normal = [0.0; 3];
    }
    let error = simulation.cut(stroke).unwrap_err().to_string();
    assert!(error.starts_with("stroke[2]"), "{error}");
    simulation.step().unwrap();
}
