//! Blades with a body: they keep the sides of their cut apart, feel what they push, and come and go without a trace.

use std::collections::BTreeMap;

use incise::cutting::FaceTag;
use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::kuhn_box;
use incise::report::{CutWork, ForceKind};
use incise::scene::{
    ContactSpec, Method, Precision, Quantity, ReportSpec, SolidBladeSpec, SolverSpec, StrokeSpec,
};
use incise::{Body, Error, Simulation, SimulationBuilder};

use crate::support::{scene, state};

const SOLID: SolidBladeSpec = SolidBladeSpec::new(0.004, 10.0, 0.05);

/// A loaf that is held at its far end, and is cut along its middle.
fn loaf(solver: SolverSpec) -> SimulationBuilder {
    loaf_of(solver, false)
}

/// A loaf, or its mirror image in z.
fn loaf_of(solver: SolverSpec, is_mirrored: bool) -> SimulationBuilder {
    let mut mesh = kuhn_box([12, 4, 6], dvec3(0.2, 0.06, 0.1));
    mesh.positions
        .iter_mut()
        .for_each(|x| *x -= dvec3(0.0, 0.03, 0.05));
    if is_mirrored {
        mesh.positions.iter_mut().for_each(|x| x.z = -x.z);
        mesh.tets.iter_mut().for_each(|tet| tet.swap(0, 1));
    }
    let body = Body::new(mesh).young_modulus(2e4).damping(0.02);
    let mut builder = Simulation::builder();
    builder
        .solver(solver)
        .threads(1)
        .report(ReportSpec::default().with(|spec| spec.quantities = vec![Quantity::Force]));
    builder.add_body(body.pinned(|x| x.x > 0.199));
    builder
}

fn gauss_seidel(precision: Precision) -> SolverSpec {
    SolverSpec::default().with(|spec| {
        spec.precision = precision;
        spec.substeps = 12.into();
        spec.method = Method::GaussSeidel;
    })
}

/// The edge across the loaf, a little off the layers of its mesh.
fn edge(x: f64) -> [DVec3; 2] {
    [-0.05, 0.05].map(|y| dvec3(x, y, 0.003))
}

/// Brings a blade in by `frames` of 4 mm; returns its stroke.
fn bring_in(simulation: &mut Simulation, solid: &SolidBladeSpec, frames: u32) -> u32 {
    let stroke = simulation
        .begin_solid_stroke(&edge(-0.01), 0.1, solid)
        .unwrap();
    simulation.step().unwrap();
    for frame in 1..=frames {
        let x = -0.01 + 0.004 * f64::from(frame);
        simulation.move_blade(stroke, &edge(x)).unwrap();
        simulation.step().unwrap();
    }
    stroke
}

/// The particles on one side of the cut only, and whether they are above: by the shape at rest, in which the cut is flat.
fn sides(simulation: &Simulation) -> BTreeMap<usize, bool> {
    let mut votes: BTreeMap<usize, [bool; 2]> = BTreeMap::new();
    let rest = &simulation.mesh().positions;
    for triangle in simulation.boundary().filter(|t| t.tag != FaceTag::Outer) {
        let [x, y, z] = triangle.particles.map(|p| rest[p.index()]);
        let is_above = (y - x).cross(z - x).z < 0.0;
        for p in triangle.particles {
            votes.entry(p.index()).or_default()[usize::from(is_above)] = true;
        }
    }
    let clear = votes.into_iter().filter(|(_, votes)| votes[0] != votes[1]);
    clear.map(|(p, votes)| (p, votes[1])).collect()
}

/// Heights above the middle of the blade of the particles beside the flat part of the blade with its edge at x, each on
/// its own side.
fn beside(simulation: &Simulation, x: f64) -> Vec<f64> {
    let tip = 0.5 * SOLID.thickness / (0.5 * SOLID.wedge_angle_degrees.to_radians()).tan();
    let all = sides(simulation).into_iter();
    all.filter_map(|(p, is_above)| {
        let at = simulation.positions()[p];
        let behind = x - at.x;
        let inside = behind > tip + 1e-6 && behind < SOLID.height - 1e-6;
        let height = at.z - 0.003;
        inside.then_some(if is_above { height } else { -height })
    })
    .collect()
}

/// Beside the blade the sides are its thickness apart, in every frame, also under a load that bends the loaf down onto it;
/// a blade without a body leaves them together.
#[test]
fn the_sides_are_the_thickness_apart_at_the_blade() {
    for (precision, gravity) in [(Precision::F32, 0.0), (Precision::F64, 2.0)] {
        let mut builder = loaf(gauss_seidel(precision));
        builder.gravity(DVec3::NEG_Z * gravity);
        let mut simulation = builder.build().unwrap();
        let stroke = simulation
            .begin_solid_stroke(&edge(-0.01), 0.1, &SOLID)
            .unwrap();
        simulation.step().unwrap();
        let mut seen = 0;
        for frame in 1..=30 {
            let x = -0.01 + 0.004 * f64::from(frame);
            simulation.move_blade(stroke, &edge(x)).unwrap();
            simulation.step().unwrap();
            for height in beside(&simulation, x) {
                assert!(height >= 0.5 * SOLID.thickness - 1e-7, "{frame}: {height}");
                seen += 1;
            }
        }
        assert!(seen > 300, "{seen}");
        simulation.check().unwrap();
    }
    let mut simulation = loaf(gauss_seidel(Precision::F64)).build().unwrap();
    let stroke = simulation.begin_stroke(&edge(-0.01), 0.1).unwrap();
    simulation.step().unwrap();
    for frame in 1..=30 {
        let x = -0.01 + 0.004 * f64::from(frame);
        simulation.move_blade(stroke, &edge(x)).unwrap();
        simulation.step().unwrap();
    }
    let together = beside(&simulation, 0.11);
    assert!(
        together
            .iter()
            .all(|height| height.abs() < 0.5 * SOLID.thickness)
    );
    assert!(simulation.blade_force(stroke).is_err());
}

/// What is pushed aside presses the blade back, friction more so, and the holder of the loaf bears the opposite.
#[test]
fn the_blade_feels_what_it_pushes() {
    let mut pushes = Vec::new();
    for friction in [0.0, 0.4] {
        let solid = SOLID.with(|spec| spec.friction = friction);
        let mut simulation = loaf(gauss_seidel(Precision::F64)).build().unwrap();
        let body = simulation.bodies()[0];
        let stroke = bring_in(&mut simulation, &solid, 25);
        let moving = simulation.blade_force(stroke).unwrap();
        assert!(moving.force.x < 0.0, "{moving:?}");
        let reported = simulation.report().forces.iter();
        let kinds: Vec<_> = reported.map(|f| (f.kind, f.index)).collect();
        assert_eq!(kinds, [(ForceKind::Blade, 0), (ForceKind::Fixed, 0)]);
        pushes.push(moving.force.x);
        // At rest nothing else holds the loaf.
        for _ in 0..150 {
            simulation.step().unwrap();
        }
        let blade = simulation.blade_force(stroke).unwrap();
        let holder = simulation.fixed_force(body).unwrap();
        let sum = blade.force + holder.force;
        assert!(blade.force.length() > 0.01, "{blade:?}");
        assert!(
            sum.length() < 0.01 * blade.force.length(),
            "{blade:?} {holder:?}"
        );
        assert!((blade.point - edge(0.09)[0].midpoint(edge(0.09)[1])).length() < 1e-12);
    }
    assert!(pushes[1] < 1.2 * pushes[0], "{pushes:?}");
}

/// In a mirror the blade feels the mirror image of its force: neither side is preferred. The cut numbers its copies
/// otherwise there, so tets are solved in another order.
#[test]
fn neither_side_is_preferred() {
    let force = |is_mirrored: bool| {
        let mut simulation = loaf_of(gauss_seidel(Precision::F64), is_mirrored)
            .build()
            .unwrap();
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        let edge = |x: f64| [-0.05, 0.05].map(|y| dvec3(x, y, 0.003 * sign));
        let stroke = simulation
            .begin_solid_stroke(&edge(-0.01), 0.1, &SOLID)
            .unwrap();
        simulation.step().unwrap();
        for frame in 1..=25 {
            let x = -0.01 + 0.004 * f64::from(frame);
            simulation.move_blade(stroke, &edge(x)).unwrap();
            simulation.step().unwrap();
        }
        for _ in 0..100 {
            simulation.step().unwrap();
        }
        let force = simulation.blade_force(stroke).unwrap().force;
        dvec3(force.x, force.y, force.z * sign)
    };
    let (one, other) = (force(false), force(true));
    assert!(one.length() > 0.01, "{one}");
    assert!(one.distance(other) < 0.03 * one.length(), "{one} {other}");
}

/// Drawn back, a blade keeps its direction, lets go of the sides, and leaves no force.
#[test]
fn a_blade_that_is_drawn_back_lets_go() {
    let mut builder = loaf(gauss_seidel(Precision::F64));
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    let stroke = bring_in(&mut simulation, &SOLID, 25);
    for frame in 1..=30 {
        let x = 0.09 - 0.004 * f64::from(frame);
        simulation.move_blade(stroke, &edge(x)).unwrap();
        simulation.step().unwrap();
        for height in beside(&simulation, x) {
            assert!(height >= 0.5 * SOLID.thickness - 1e-7, "{frame}: {height}");
        }
    }
    let out = simulation.blade_force(stroke).unwrap();
    assert_eq!(out.force, DVec3::ZERO);
    for _ in 0..60 {
        simulation.step().unwrap();
    }
    // The cut closes again.
    let rest = simulation.mesh().positions.iter();
    let away = rest
        .zip(simulation.positions())
        .map(|(x, y)| x.distance(*y));
    let farthest = away.fold(0.0, f64::max);
    assert!(farthest < 0.25 * SOLID.thickness, "{farthest}");
    simulation.end_stroke(stroke).unwrap();
    simulation.step().unwrap();
    assert!(simulation.blade_force(stroke).is_err());
}

/// A sweep of a scene with a body is, to the bit, the same strokes made live, on any number of threads.
#[test]
fn a_scene_says_what_a_program_does() {
    let stroke = StrokeSpec::solid_sweep(
        [0, 25],
        edge(-0.01).map(|x| x.to_array()).to_vec(),
        vec![[0.0; 3], [0.1, 0.0, 0.0]],
        SOLID,
    );
    let mut of_scene = loaf(gauss_seidel(Precision::F32));
    of_scene.add_stroke(stroke.clone()).threads(3);
    let mut of_scene = of_scene.build().unwrap();
    let mut live = loaf(gauss_seidel(Precision::F32)).build().unwrap();
    let number = live.begin_solid_stroke(&edge(-0.01), 0.1, &SOLID).unwrap();
    for frame in 0..25 {
        let pose = stroke.blade_at(frame).unwrap();
        live.move_blade(number, &pose).unwrap();
        live.step().unwrap();
        of_scene.step().unwrap();
        assert_eq!(state(&live), state(&of_scene), "{frame}");
        let [a, b] = [&live, &of_scene].map(|s| s.blade_force(number).unwrap());
        assert_eq!(a, b);
    }
    assert!(live.blade_force(number).unwrap().force.x < 0.0);
}

#[test]
fn what_knows_no_solid_blade_says_so() {
    let text = r#"
        [[body]]
        shape = { kind = "box", tets = 200 }
        [[stroke]]
        kind = "sweep"
        frames = [0, 10]
        blade = [[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]
        path = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
        solid = { thickness = 0.01, wedge_angle_degrees = 30.0, height = 0.2 }
        "#;
    let refused = |scene: &incise::Scene, key: &str| {
        let refused = Simulation::new(scene).unwrap_err();
        let is_named = matches!(&refused, Error::Value { field, .. } if field == key);
        assert!(is_named, "{refused}");
    };
    let good = scene(text);
    Simulation::new(&good).unwrap();
    refused(
        &scene(&text.replace("0.01", "0.0")),
        "stroke[0].solid.thickness",
    );
    refused(
        &scene(&text.replace("= 30.0", "= 180.0")),
        "stroke[0].solid.wedge_angle_degrees",
    );
    refused(
        &scene(&text.replace("height = 0.2", "height = 0.2, toughness = -1.0")),
        "stroke[0].solid.toughness",
    );
    let bent = text.replace("blade = [", "blade = [[-1.0, -2.0, 0.0], ");
    refused(&scene(&bent), "stroke[0].solid.blade");
    refused(
        &scene(&format!("solver.method = \"vbd\"\n{text}")),
        "stroke[0].solid",
    );
    refused(
        &scene(&format!("solver.backend = \"gpu\"\n{text}")),
        "stroke[0].solid",
    );
    let mut simulation = Simulation::new(&good).unwrap();
    assert!(simulation.set_solver(&SolverSpec::of(Method::Vbd)).is_err());
    let mut by_vbd = good.clone();
    by_vbd.stroke.clear();
    by_vbd.solver = SolverSpec::of(Method::Vbd);
    let mut simulation = Simulation::new(&by_vbd).unwrap();
    assert!(simulation.cut(good.stroke[0].clone()).is_err());
    assert!(
        simulation
            .begin_solid_stroke(&edge(0.0), 0.1, &SOLID)
            .is_err()
    );
}

/// A thin blade whose edge the tissue resists.
fn tough(toughness: f64) -> SolidBladeSpec {
    SolidBladeSpec::new(0.0002, 5.0, 0.05).with(|spec| spec.toughness = toughness)
}

/// How far a tough blade moves in a frame.
const WAY: f64 = 0.002;

/// The force on a blade, and what it has parted, after each frame on its way through the loaf from x = -0.01 on.
fn part(
    solver: SolverSpec,
    solid: &SolidBladeSpec,
    snap: f64,
) -> (Simulation, Vec<(DVec3, CutWork)>) {
    let mut simulation = loaf(solver).build().unwrap();
    let stroke = simulation
        .begin_solid_stroke(&edge(-0.01), snap, solid)
        .unwrap();
    simulation.step().unwrap();
    let mut frames = Vec::new();
    for frame in 1..=95 {
        let x = -0.01 + WAY * f64::from(frame);
        simulation.move_blade(stroke, &edge(x)).unwrap();
        simulation.step().unwrap();
        let force = simulation.blade_force(stroke).unwrap().force;
        frames.push((force, simulation.cut_work(stroke).unwrap()));
    }
    simulation.end_stroke(stroke).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
    let parted = simulation.cut_work(stroke).unwrap();
    assert!(simulation.blade_force(stroke).is_err());
    frames.push((DVec3::ZERO, parted));
    (simulation, frames)
}

/// At a constant speed the force on a blade is the toughness times the width of the tissue that it cuts, up to 5%, of which
/// 2% are the wedge that holds the cut open. The work of its drive is in every frame at least what its edge does, and that is
/// at least the toughness times the area of the cut, but for what the cut is ahead of the edge: part of a tet.
#[test]
fn parting_takes_the_toughness_times_the_width() {
    for (precision, toughness, snap) in [
        (Precision::F64, 100.0, 0.1),
        (Precision::F64, 30.0, 0.0),
        (Precision::F32, 60.0, 0.1),
    ] {
        let solid = tough(toughness);
        let (_, frames) = part(gauss_seidel(precision), &solid, snap);
        let width = 0.06;
        let expected = toughness * width;
        let steady = &frames[40..80];
        let mean = steady.iter().map(|(force, _)| -force.x).sum::<f64>() / steady.len() as f64;
        assert!(
            (mean / expected - 1.0).abs() < 0.05,
            "{mean} for {expected}"
        );
        let mut driven = 0.0;
        // A row of tets.
        let row = 0.2 / 12.0 * expected;
        for (number, (force, parted)) in frames.iter().enumerate() {
            driven -= force.x * WAY;
            assert!(
                driven >= parted.work * (1.0 - 1e-6),
                "{number}: {driven} {parted:?}"
            );
            let owed = toughness * parted.area - parted.work;
            assert!(owed < row, "{number}: {owed} of {row}");
            assert!(owed > -2.0 * row, "{number}: {owed} of {row}");
        }
        let (_, last) = frames[frames.len() - 1];
        assert!(last.area > 0.8 * 0.18 * width, "{last:?}");
        assert!(driven > toughness * last.area, "{driven} {last:?}");
    }
}

/// Reports have the work of the cuts of a frame, which add up to the toughness times the area.
#[test]
fn the_work_of_a_cut_is_reported() {
    let mut simulation = loaf(gauss_seidel(Precision::F32)).build().unwrap();
    let stroke = simulation
        .begin_solid_stroke(&edge(-0.01), 0.1, &tough(100.0))
        .unwrap();
    simulation.step().unwrap();
    let mut sum = 0.0;
    for frame in 1..=60 {
        let x = -0.01 + WAY * f64::from(frame);
        simulation.move_blade(stroke, &edge(x)).unwrap();
        let report = simulation.step().unwrap();
        let work = report.cut.and_then(|cut| cut.work);
        assert!(work.is_none_or(|work| work > 0.0));
        sum += work.unwrap_or(0.0);
    }
    let parted = simulation.cut_work(stroke).unwrap();
    assert!(sum > 0.1, "{sum}");
    assert!((sum - 100.0 * parted.area).abs() < 1e-9 * sum);
    // A blade without a toughness parts for nothing.
    let free = bring_in(&mut simulation, &SOLID, 0);
    assert!(simulation.cut_work(free).is_err());
}

/// Below the force that it takes tissue gives and is not cut; it comes back when the blade does. A softer one is cut on the
/// same way.
#[test]
fn a_blade_below_the_force_indents() {
    for (toughness, cuts) in [(1000.0, false), (30.0, true)] {
        let solid = tough(toughness);
        let mut simulation = loaf(gauss_seidel(Precision::F64)).build().unwrap();
        let stroke = simulation
            .begin_solid_stroke(&edge(-0.01), 0.1, &solid)
            .unwrap();
        simulation.step().unwrap();
        let mut pushes = Vec::new();
        for frame in 1..=17 {
            let x = -0.01 + WAY * f64::from(frame);
            simulation.move_blade(stroke, &edge(x)).unwrap();
            simulation.step().unwrap();
            pushes.push(-simulation.blade_force(stroke).unwrap().force.x);
        }
        let parted = simulation.cut_work(stroke).unwrap();
        let bare = simulation.boundary().filter(|t| t.tag != FaceTag::Outer);
        assert_eq!(bare.count() > 0, cuts);
        assert_eq!(parted.area > 0.0, cuts, "{parted:?}");
        if cuts {
            continue;
        }
        // Where little of the edge is in a tet, it slips a little.
        assert!(parted.work < 1e-3 * toughness * 0.06 * 0.024, "{parted:?}");
        let last = pushes[pushes.len() - 1];
        assert!(last > 3.0 && last < 0.5 * toughness * 0.06, "{last}");
        assert!(
            pushes.windows(2).all(|pair| pair[1] >= 0.8 * pair[0]),
            "{pushes:?}"
        );
        // The front of the loaf, at x = 0, goes with the edge.
        let rest = simulation.mesh().positions.iter();
        let moved = rest.zip(simulation.positions());
        let front = moved.filter(|(rest, _)| rest.x.abs() < 1e-9);
        let deepest = front.map(|(_, x)| x.x).fold(0.0, f64::max);
        assert!(deepest > 0.7 * 0.024 && deepest < 0.026, "{deepest}");
        for frame in 1..=20 {
            let x = 0.024 - WAY * f64::from(frame);
            simulation.move_blade(stroke, &edge(x)).unwrap();
            simulation.step().unwrap();
        }
        assert_eq!(simulation.blade_force(stroke).unwrap().force, DVec3::ZERO);
        for _ in 0..600 {
            simulation.step().unwrap();
        }
        let rest = simulation.mesh().positions.iter();
        let away = rest
            .zip(simulation.positions())
            .map(|(x, y)| x.distance(*y));
        let farthest = away.fold(0.0, f64::max);
        assert!(farthest < 1e-3, "{farthest}");
        simulation.check().unwrap();
    }
}

/// A tough blade of a scene is, to the bit, one that is moved live, on any number of threads and through a snapshot; its cut
/// is finished after it has ended.
#[test]
fn a_tough_stroke_continues_to_the_bit() {
    let stroke = StrokeSpec::solid_sweep(
        [0, 40],
        edge(-0.01).map(|x| x.to_array()).to_vec(),
        vec![[0.0; 3], [0.08, 0.0, 0.0]],
        tough(100.0),
    );
    let mut of_scene = loaf(gauss_seidel(Precision::F32));
    of_scene.add_stroke(stroke.clone()).threads(3);
    let mut of_scene = of_scene.build().unwrap();
    let mut live = loaf(gauss_seidel(Precision::F32)).build().unwrap();
    let number = live
        .begin_solid_stroke(&edge(-0.01), 0.1, &tough(100.0))
        .unwrap();
    for frame in 0..=40 {
        live.move_blade(number, &stroke.blade_at(frame).unwrap())
            .unwrap();
        if frame == 40 {
            live.end_stroke(number).unwrap();
        }
        if frame % 13 == 7 {
            live = Simulation::from_snapshot(&live.snapshot().unwrap()).unwrap();
        }
        live.step().unwrap();
        of_scene.step().unwrap();
        assert_eq!(state(&live), state(&of_scene), "{frame}");
        let [a, b] = [&live, &of_scene].map(|s| s.cut_work(number).unwrap());
        assert_eq!(a, b);
    }
    let before = live.cut_work(number).unwrap();
    assert!(live.move_blade(number, &edge(0.1)).is_err());
    for simulation in [&mut live, &mut of_scene] {
        for _ in 0..3 {
            simulation.step().unwrap();
        }
    }
    assert_eq!(state(&live), state(&of_scene));
    let after = live.cut_work(number).unwrap();
    assert!(after.work == before.work && after.area >= before.area);
}
