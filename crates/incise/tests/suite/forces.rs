//! Forces that a simulation reports and hands out: closed forms, handles, sleep, and what has no forces.

use incise::mesh::glam::{DQuat, DVec3, dvec3};
use incise::mesh::kuhn_box;
use incise::report::{Force, ForceKind};
use incise::scene::{
    AttachmentSpec, ColliderSpec, ContactSpec, Method, Precision, Quantity, Region, ReportSpec,
    SleepSpec, SolverSpec,
};
use incise::{Body, Error, Simulation, SimulationBuilder};

use crate::support::{scene, state};

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
/// Of a cube of 0.1 m and 1000 kg/m³.
const WEIGHT: f64 = 9.81;

fn report(every: u64) -> ReportSpec {
    ReportSpec::default().with(|spec| {
        spec.every = every;
        spec.quantities = vec![Quantity::Force];
    })
}

fn solver(precision: Precision) -> SolverSpec {
    SolverSpec::default().with(|spec| {
        spec.precision = precision;
        spec.substeps = 20.into();
        spec.method = Method::GaussSeidel;
    })
}

/// A cube of 0.1 m around a point.
fn cube(at: DVec3) -> Body {
    let mut mesh = kuhn_box([3; 3], DVec3::splat(0.1));
    mesh.positions
        .iter_mut()
        .for_each(|x| *x += at - DVec3::splat(0.05));
    Body::new(mesh)
        .young_modulus(1e5)
        .density(1000.0)
        .damping(0.1)
}

fn builder() -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).report(report(1)).threads(1);
    builder.solver(solver(Precision::F64));
    builder
}

/// A box at rest presses with its weight, whatever accuracy is asked for: precision follows from it. With a small accuracy
/// substeps are so many that single precision would lose a tenth of the weight.
#[test]
fn a_box_at_rest_presses_with_its_weight_at_any_accuracy() {
    let of = |keys: &str| {
        let text = format!(
            "[world]\ngravity = [0, 0, -9.81]\nground = {{ height = 0.0, friction = 0.5 }}\n\
             [report]\nquantities = [\"force\"]\n[solver]\ntime_step = 0.0166\n{keys}\n\
             [[body]]\nshape = {{ kind = \"box\", tets = 500 }}\nscale = 0.2\nposition = [0, 0, 0.1]\n\
             young_modulus = 1e6\ndamping = 0.01\n"
        );
        let mut simulation = Simulation::with_threads(&scene(&text), 1).unwrap();
        let weight = 9.81 * 1000.0 * simulation.mesh().total_volume();
        let mut sum = 0.0;
        for frame in 0..40 {
            simulation.step().unwrap();
            if frame >= 20 {
                let forces = &simulation.report().forces;
                let ground = forces.iter().find(|f| f.kind == ForceKind::Ground);
                sum -= ground.unwrap().force.force.z / 20.0;
            }
        }
        let precision = simulation.report().precision;
        ((sum / weight - 1.0).abs(), precision)
    };
    for accuracy in [0.1, 0.05, 0.02] {
        let (error, precision) = of(&format!("accuracy = {accuracy}"));
        assert!(error < accuracy / 3.0, "{accuracy}, {precision}: {error:e}");
    }
    // What the choice avoids.
    let (single, _) = of("substeps = 200\nprecision = \"f32\"");
    assert!(single > 0.03, "{single:e}");
    assert_eq!(of("substeps = 200").1, "f64");
    assert_eq!(of("substeps = 20").1, "f32");
}

/// The particles above a height.
fn above(z: f64) -> Region {
    Region::half_space([0.0, 0.0, z], [0.0, 0.0, 1.0])
}

#[track_caller]
fn near(force: Force, expected: DVec3, tolerance: f64) {
    let error = force.force.distance(expected);
    assert!(error <= tolerance, "{force:?} is not {expected}");
}

fn run(simulation: &mut Simulation, frames: usize) {
    for _ in 0..frames {
        simulation.step().unwrap();
    }
}

/// A cube that hangs from an attachment weighs what it weighs, in both precisions and by VBD, and turns nothing about
/// the middle of what is held.
#[test]
fn an_attachment_feels_the_weight_that_hangs_from_it() {
    for spec in [
        solver(Precision::F32),
        solver(Precision::F64),
        SolverSpec::of(Method::Vbd).with(|spec| {
            spec.two_level = true;
            spec.iterations = 30;
            spec.precision = Precision::F64;
        }),
    ] {
        let mut builder = builder();
        builder.solver(spec);
        builder.add_body(cube(DVec3::ZERO));
        let held = builder.add_attachment(AttachmentSpec::new(0, vec![above(0.049)]));
        let mut simulation = builder.build().unwrap();
        assert_eq!(simulation.attachments(), [held]);
        run(&mut simulation, 120);
        let force = simulation.attachment_force(held).unwrap();
        near(force, GRAVITY, 0.01 * WEIGHT);
        assert!(force.point.distance(DVec3::Z * 0.05) < 1e-6);
        assert!(force.torque.length() < 0.01 * WEIGHT * 0.1, "{force:?}");
        // The report says the same.
        let [reported] = simulation.report().forces[..] else {
            panic!("one force")
        };
        assert_eq!((reported.kind, reported.index), (ForceKind::Attachment, 0));
        assert_eq!(reported.force, force);
        // Carried about, the point follows.
        simulation
            .move_attachment(held, DVec3::X * 0.01, DQuat::IDENTITY)
            .unwrap();
        run(&mut simulation, 1);
        let moved = simulation.attachment_force(held).unwrap();
        assert!(moved.point.distance(dvec3(0.01, 0.0, 0.05)) < 1e-6);
        // It takes force to set the cube in motion.
        assert!(moved.force.x < -1.0, "{moved:?}");
    }
}

#[test]
fn what_fixed_particles_are_fixed_to_feels_the_weight() {
    let mut builder = builder();
    let body = builder.add_body(cube(DVec3::ZERO).pinned(|x| x.z > 0.049));
    let mut simulation = builder.build().unwrap();
    run(&mut simulation, 120);
    let force = simulation.fixed_force(body).unwrap();
    near(force, GRAVITY, 0.01 * WEIGHT);
    assert!(force.torque.length() < 0.01 * WEIGHT * 0.1);
    assert_eq!(simulation.report().forces[0].kind, ForceKind::Fixed);
}

/// Cubes of one, two and three: each bears what is above it.
#[test]
fn a_stack_bears_what_is_above() {
    let mut builder = builder();
    builder.ground(0.0, 0.3);
    builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.3));
    let all = [0.05, 0.15, 0.25].map(|z| builder.add_body(cube(DVec3::Z * z)));
    let mut simulation = builder.build().unwrap();
    assert_eq!(simulation.bodies(), all);
    run(&mut simulation, 150);
    let [a, b, c] = all;
    let lower = simulation.contact_force(a, b).unwrap();
    let upper = simulation.contact_force(b, c).unwrap();
    near(
        simulation.ground_force().unwrap(),
        GRAVITY * 3.0,
        0.03 * WEIGHT,
    );
    near(lower, GRAVITY * 2.0, 0.02 * WEIGHT);
    near(upper, GRAVITY, 0.01 * WEIGHT);
    let back = simulation.contact_force(c, b).unwrap();
    assert_eq!((back.force, back.torque), (-upper.force, -upper.torque));
    assert_eq!(simulation.contact_force(a, c).unwrap(), Force::default());
    // Torque about the middle of the stack: none.
    let torque = simulation.ground_force().unwrap().torque;
    assert!(torque.length() < 0.03 * WEIGHT * 0.1, "{torque}");
    let kinds: Vec<_> = simulation.report().forces.iter().map(|f| f.kind).collect();
    let expected = [ForceKind::Ground, ForceKind::Contact, ForceKind::Contact];
    assert_eq!(kinds, expected);
    // One with itself has none.
    assert!(simulation.contact_force(a, a).is_err());
}

/// A collider that several bodies of their own solvers lie on feels all of them; its handle survives the removal of
/// another one.
#[test]
fn a_collider_feels_all_bodies() {
    let mut builder = builder();
    builder.add_body(cube(dvec3(0.0, 0.0, 0.05)));
    builder.add_body(cube(dvec3(0.3, 0.0, 0.05)));
    let plane = |z: f64| ColliderSpec::plane([0.15, 0.0, z], [0.0, 0.0, 1.0]).with_friction(0.5);
    let below = builder.add_collider(plane(-5.0));
    let floor = builder.add_collider(plane(0.0));
    let mut simulation = builder.build().unwrap();
    assert_eq!(simulation.colliders(), [below, floor]);
    run(&mut simulation, 150);
    let force = simulation.collider_force(floor).unwrap();
    near(force, GRAVITY * 2.0, 0.02 * WEIGHT);
    assert!(force.torque.length() < 0.02 * WEIGHT * 0.1, "{force:?}");
    near(simulation.collider_force(below).unwrap(), DVec3::ZERO, 0.0);
    simulation.remove_collider(below).unwrap();
    assert_eq!(simulation.collider_force(floor).unwrap(), force);
    assert!(simulation.collider_force(below).is_err());
    let late = simulation.add_collider(&plane(-6.0)).unwrap();
    let refused = simulation.collider_force(late).unwrap_err();
    assert!(
        refused.to_string().contains("before its force is read"),
        "{refused}"
    );
    assert!(simulation.ground_force().is_err());
}

/// A grab on springs feels the sum of their stiffness times their lengths; a new one at its place has no force yet.
#[test]
fn a_grab_feels_its_springs() {
    let mut builder = Simulation::builder();
    builder.report(report(1)).threads(1);
    builder.solver(solver(Precision::F64));
    let body = builder.add_body(cube(DVec3::ZERO).pinned(|x| x.z < -0.049));
    let mut simulation = builder.build().unwrap();
    let top = DVec3::Z * 0.05;
    let compliance = 0.05;
    let grab = simulation.grab(top, 0.03, compliance).unwrap().unwrap();
    let before = simulation.positions().to_vec();
    let held: Vec<usize> = (0..before.len())
        .filter(|&p| before[p].distance(top) <= 0.03)
        .collect();
    assert!(held.len() > 3);
    let pull = dvec3(0.002, 0.0, 0.01);
    simulation.move_grab(grab, top + pull).unwrap();
    run(&mut simulation, 200);
    let springs: DVec3 = held
        .iter()
        .map(|&p| (simulation.positions()[p] - before[p] - pull) / compliance)
        .sum();
    let force = simulation.grab_force(grab).unwrap();
    assert!(force.force.length() > 0.1);
    near(force, springs, 1e-3 * springs.length());
    assert!(force.point.distance(top + pull) < 1e-12);
    // At rest without gravity the other end bears the opposite.
    let other = simulation.fixed_force(body).unwrap();
    near(other, -springs, 0.01 * springs.length());
    simulation.release(grab).unwrap();
    assert!(simulation.grab_force(grab).is_err());
    let next = simulation.grab(top, 0.03, 0.0).unwrap().unwrap();
    let refused = simulation.grab_force(next).unwrap_err();
    assert!(
        refused.to_string().contains("before its force is read"),
        "{refused}"
    );
    run(&mut simulation, 1);
    simulation.grab_force(next).unwrap();
}

/// Where it fell asleep a body presses on, in frames that report and for a report that begins later.
#[test]
fn a_sleeping_body_presses_on() {
    for every in [1, 7] {
        let mut builder = builder();
        builder.ground(0.0, 0.5);
        builder.solver(
            solver(Precision::F64).with(|spec| spec.sleep = Some(SleepSpec::new(2e-2, 0.1))),
        );
        builder.report(report(every));
        builder.add_body(cube(DVec3::Z * 0.05));
        let mut simulation = builder.build().unwrap();
        let asleep = |s: &mut Simulation| s.step().unwrap().bodies[0].asleep == Some(true);
        assert!((0..400).any(|_| asleep(&mut simulation)));
        run(&mut simulation, 20);
        while !(simulation.next_frame() - 1).is_multiple_of(every) {
            let frame = simulation.ground_force();
            assert!(frame.is_err(), "not in this frame");
            run(&mut simulation, 1);
        }
        assert_eq!(simulation.report().bodies[0].asleep, Some(true));
        near(simulation.ground_force().unwrap(), GRAVITY, 0.05 * WEIGHT);
        // Turned off and on it measures again.
        simulation.set_report(ReportSpec::default()).unwrap();
        run(&mut simulation, 1);
        assert!(simulation.ground_force().is_err());
        simulation.set_report(report(1)).unwrap();
        run(&mut simulation, 1);
        assert_eq!(simulation.report().bodies[0].asleep, Some(false));
        near(simulation.ground_force().unwrap(), GRAVITY, 0.05 * WEIGHT);
    }
}

/// A report of forces changes no bit, and a scene that does not ask has none.
#[test]
fn forces_change_no_bit() {
    let run = |quantities: &str| {
        let text = format!(
            r#"
            [report]
            quantities = {quantities}
            [world]
            gravity = [0.0, 0.0, -9.81]
            ground = {{ height = -0.6, friction = 0.3 }}
            [solver]
            substeps = 6
            [[body]]
            shape = {{ kind = "box", tets = 300 }}
            young_modulus = 2e4
            damping = 0.02
            [[stroke]]
            kind = "plane"
            frame = 3
            point = [0.02, 0.0, 0.0]
            normal = [1.0, 0.1, 0.0]
            [[attachment]]
            regions = [{{ half_space = {{ point = [0.4, 0.0, 0.0], normal = [1.0, 0.0, 0.0] }} }}]
            frames = [0, 20]
            path = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.1]]
            "#
        );
        let mut simulation = Simulation::with_threads(&scene(&text), 2).unwrap();
        let mut lines = Vec::new();
        for _ in 0..10 {
            simulation.step().unwrap();
            lines.push(serde_json::to_value(simulation.report()).unwrap());
        }
        (state(&simulation), lines)
    };
    let (without, silent) = run("[]");
    let (with, lines) = run("[\"force\"]");
    assert_eq!(with, without);
    assert!(silent.iter().all(|line| line.get("forces").is_none()));
    for line in lines {
        let force = &line["forces"][0];
        assert_eq!(force["kind"], "attachment");
        for key in ["force", "torque", "point"] {
            assert_eq!(force[key].as_array().unwrap().len(), 3);
        }
    }
}

/// What cannot measure forces says so by the key.
#[test]
fn what_has_no_forces_says_so() {
    let text = "[report]\nquantities = [\"force\"]\n[[body]]\nshape = { kind = \"box\", tets = 200 }\n[solver]\n";
    for setting in ["method = \"chebyshev\"", "backend = \"gpu\""] {
        let refused = Simulation::new(&scene(&format!("{text}{setting}"))).unwrap_err();
        let is_named =
            matches!(&refused, Error::Value { field, .. } if field == "report.quantities");
        assert!(is_named, "{refused}");
    }
    // A free choice falls on the processor.
    let simulation = Simulation::new(&scene(&format!("{text}backend = \"auto\""))).unwrap();
    assert_eq!(simulation.report().backend, "cpu");
    let mut simulation = Simulation::new(&scene(text)).unwrap();
    // Before the first frame there are none.
    let body = simulation.bodies()[0];
    assert!(simulation.fixed_force(body).is_err());
    simulation.step().unwrap();
    assert_eq!(simulation.fixed_force(body).unwrap(), Force::default());
    let chebyshev = SolverSpec::of(Method::Chebyshev);
    let refused = simulation.set_solver(&chebyshev).unwrap_err();
    assert!(
        refused.to_string().contains("report.quantities"),
        "{refused}"
    );
    simulation.set_report(ReportSpec::default()).unwrap();
    simulation.set_solver(&chebyshev).unwrap();
    assert!(simulation.set_report(report(1)).is_err());
    // No contact, no contact force.
    assert!(simulation.contact_force(body, body).is_err());
}
