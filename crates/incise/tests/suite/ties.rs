//! Attachments and distances that a program adds, moves, changes and removes while a simulation runs.

use incise::mesh::glam::{DQuat, DVec3};
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, DistanceSpec, EndSpec, Method, Precision, Region, SolverSpec, StrokeSpec,
};
use incise::{Body, Simulation, SimulationBuilder};

use crate::support::state;

/// The solvers that tests run with: XPBD in both precisions, VBD with and without correction.
fn solvers() -> Vec<SolverSpec> {
    let with = |change: fn(&mut SolverSpec)| {
        let mut spec = SolverSpec::default().with(|spec| spec.method = Method::GaussSeidel);
        change(&mut spec);
        spec
    };
    vec![
        with(|spec| spec.precision = Precision::F32),
        with(|spec| spec.precision = Precision::F64),
        with(|spec| (spec.method, spec.iterations) = (Method::Vbd, 10)),
        with(|spec| {
            (spec.method, spec.iterations) = (Method::Vbd, 6);
            (spec.two_level, spec.precision) = (true, Precision::F64);
        }),
    ]
}

/// A beam of 1 m along x, weightless.
fn beam(solver: &SolverSpec) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.solver(solver.clone());
    builder.add_body(Body::new(generate(Shape::Beam, 300).unwrap()).young_modulus(1e5));
    builder
}

fn end(sign: f64) -> Region {
    Region::half_space([0.45 * sign, 0.0, 0.0], [sign, 0.0, 0.0])
}

/// The particles of one end of the beam at rest.
fn of_end(simulation: &Simulation, sign: f64) -> Vec<usize> {
    let rest = &simulation.mesh().positions;
    (0..rest.len())
        .filter(|&p| sign * rest[p].x >= 0.45)
        .collect()
}

fn thread(to: [f64; 3], length: f64) -> DistanceSpec {
    let point = |point| EndSpec::new(0, point);
    DistanceSpec::new(point([-0.5, 0.0, 0.0]), point(to)).with(|spec| {
        spec.length = Some(length);
        spec.tension_only = true;
    })
}

/// What is declared and what is added before the first frame is the same simulation, to the bit. (VBD colors particles by
/// all that ties them, so its order differs.)
#[test]
fn adding_at_the_start_is_declaring() {
    for solver in &solvers()[..2] {
        let run = |declared: bool| {
            let mut builder = beam(solver);
            let grip = AttachmentSpec::new(0, vec![end(1.0)]);
            let tie = thread([0.5, 0.0, 0.0], 0.95);
            let (mut simulation, grip, tie) = if declared {
                let (grip, tie) = (builder.add_attachment(grip), builder.add_distance(tie));
                (builder.build().unwrap(), grip, tie)
            } else {
                let mut simulation = builder.build().unwrap();
                let grip = simulation.add_attachment(&grip).unwrap();
                let tie = simulation.add_distance(&tie).unwrap();
                (simulation, grip, tie)
            };
            for frame in 1..=6 {
                let angle = 0.05 * f64::from(frame);
                let rotation = DQuat::from_rotation_x(angle);
                simulation
                    .move_attachment(grip, DVec3::Y * 0.1 * angle, rotation)
                    .unwrap();
                simulation.step().unwrap();
            }
            simulation.set_distance(tie, 0.9, 1e-6).unwrap();
            simulation.step().unwrap();
            simulation.check().unwrap();
            state(&simulation)
        };
        assert!(run(true) == run(false), "{solver:?}");
    }
}

/// An attachment turns its particles about their center and displaces them, exactly where it is rigid; a path that it had
/// no longer counts; released particles move freely.
#[test]
fn an_attachment_is_moved_made_soft_and_removed() {
    for solver in solvers() {
        let mut builder = beam(&solver);
        builder.add_attachment(AttachmentSpec::new(0, vec![end(-1.0)]));
        let grip = builder.add_attachment(AttachmentSpec::new(0, vec![end(1.0)]).with(|spec| {
            spec.frames = [0, 100];
            spec.path = vec![[0.0; 3], [0.0, 0.0, 5.0]];
        }));
        let mut simulation = builder.build().unwrap();
        let held = of_end(&simulation, 1.0);
        let rest: Vec<DVec3> = held
            .iter()
            .map(|&p| simulation.mesh().positions[p])
            .collect();
        let center = rest.iter().sum::<DVec3>() / rest.len() as f64;
        let (mut offset, mut rotation) = (DVec3::ZERO, DQuat::IDENTITY);
        for frame in 1..=8 {
            offset = DVec3::new(0.01, 0.0, -0.02) * f64::from(frame);
            rotation = DQuat::from_rotation_y(0.04 * f64::from(frame));
            simulation.move_attachment(grip, offset, rotation).unwrap();
            simulation.step().unwrap();
        }
        let error = |simulation: &Simulation| {
            let there = held.iter().zip(&rest).map(|(&p, &x)| {
                let expected = center + offset + rotation * (x - center);
                simulation.positions()[p].distance(expected)
            });
            there.fold(0.0, f64::max)
        };
        assert!(error(&simulation) < 1e-6, "{}", error(&simulation));
        simulation.set_attachment_compliance(grip, 1.0).unwrap();
        for _ in 0..10 {
            simulation.step().unwrap();
        }
        let soft = error(&simulation);
        assert!(soft > 1e-4, "{soft}: the strained body pulls it away");
        simulation.set_attachment_compliance(grip, 0.0).unwrap();
        simulation.step().unwrap();
        let at = |simulation: &Simulation| simulation.positions()[held[0]];
        let still = at(&simulation);
        simulation.step().unwrap();
        assert!(at(&simulation).distance(still) < 1e-6);
        simulation.remove_attachment(grip).unwrap();
        simulation.step().unwrap();
        assert!(at(&simulation).distance(still) > 1e-5);
        simulation.check().unwrap();
        let refused = simulation.move_attachment(grip, offset, rotation);
        assert!(refused.unwrap_err().to_string().contains("removed"));
        // Its frame and its particles are there for the next one, whose handle is another.
        let again = simulation
            .add_attachment(&AttachmentSpec::new(0, vec![end(1.0)]))
            .unwrap();
        assert_ne!(again, grip);
        let before: Vec<DVec3> = held.iter().map(|&p| simulation.positions()[p]).collect();
        simulation.step().unwrap();
        for (&p, before) in held.iter().zip(before) {
            assert!(simulation.positions()[p].distance(before) < 1e-6);
        }
    }
}

/// A thread across the beam, pulled tight and cut, in a body that was cut before.
#[test]
fn a_suture_is_pulled_tight_and_cut() {
    for solver in solvers() {
        let mut simulation = beam(&solver).build().unwrap();
        simulation
            .cut(StrokeSpec::plane(0, [0.01, 0.0, 0.0], [1.0, 0.0, 0.0]))
            .unwrap();
        assert_eq!(simulation.step().unwrap().pieces, 2);
        let tie = simulation
            .add_distance(&thread([0.5, 0.0, 0.0], 1.0))
            .unwrap();
        let ends = |simulation: &Simulation| {
            let at = |x: f64| {
                let rest = simulation.mesh().positions.iter().enumerate();
                let near = rest.min_by(|a, b| {
                    let far = |x: &DVec3, to: f64| x.distance_squared(DVec3::X * to);
                    far(a.1, x).total_cmp(&far(b.1, x))
                });
                simulation.positions()[near.unwrap().0]
            };
            at(-0.5).distance(at(0.5))
        };
        // A meter a second, for a frame at a time: what is free keeps the speed that the thread gave it.
        for step in 1..=5 {
            let length = 1.0 - 0.016 * f64::from(step);
            simulation.set_distance(tie, length, 0.0).unwrap();
            simulation.step().unwrap();
        }
        assert!(ends(&simulation) < 0.925, "{}", ends(&simulation));
        let snapshot = simulation.snapshot().unwrap();
        simulation.remove_distance(tie).unwrap();
        assert!(simulation.remove_distance(tie).is_err());
        assert!(simulation.set_distance(tie, 1.0, 0.0).is_err());
        simulation.step().unwrap();
        simulation.check().unwrap();
        // The snapshot has it still.
        simulation.restore(&snapshot).unwrap();
        simulation.set_distance(tie, 0.9, 0.0).unwrap();
        let other = simulation
            .add_distance(&thread([0.5, 0.0, 0.0], 2.0))
            .unwrap();
        assert_ne!(other, tie);
        simulation.step().unwrap();
        assert!(ends(&simulation) < 0.915, "{}", ends(&simulation));
        simulation.check().unwrap();
    }
}

#[test]
fn bad_ties_are_refused_and_nothing_changes() {
    let mut builder = beam(&SolverSpec::default());
    builder.add_body(Body::new(generate(Shape::Box, 200).unwrap()).position(DVec3::Z * 3.0));
    let grip = builder.add_attachment(AttachmentSpec::new(0, vec![end(1.0)]));
    let mut simulation = builder.build().unwrap();
    simulation.step().unwrap();
    let before = state(&simulation);
    let whole = AttachmentSpec::new(0, vec![end(-1.0), end(1.0)]);
    let soft = AttachmentSpec::new(0, vec![end(-1.0)]).with(|spec| spec.compliance = f64::NAN);
    let missing = AttachmentSpec::new(2, vec![end(1.0)]);
    let message = |result: Result<_, incise::Error>| match result {
        Ok(_) => panic!("it was taken"),
        Err(error) => error.to_string(),
    };
    let refusals = [
        (message(simulation.add_attachment(&whole)), "regions"),
        (message(simulation.add_attachment(&soft)), "compliance"),
        (
            message(simulation.add_attachment(&missing)),
            "attachment.body",
        ),
    ];
    for (message, key) in refusals {
        assert!(message.contains(key), "{message}");
    }
    let mut tie = thread([0.5, 0.0, 0.0], 1.0);
    tie.to.body = 7;
    let message_of = |error: incise::Error| error.to_string();
    let apart = message_of(simulation.add_distance(&tie).unwrap_err());
    assert!(apart.contains("distance.to.body"), "{apart}");
    tie = thread([-0.5, 0.0, 0.0], 1.0);
    assert!(simulation.add_distance(&tie).is_err());
    for (offset, rotation) in [
        (DVec3::NAN, DQuat::IDENTITY),
        (DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
    ] {
        assert!(simulation.move_attachment(grip, offset, rotation).is_err());
    }
    assert!(simulation.set_attachment_compliance(grip, -1.0).is_err());
    assert!(state(&simulation) == before);
    simulation.check().unwrap();
}
