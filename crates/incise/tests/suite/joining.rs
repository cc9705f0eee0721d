//! Bodies with solvers of their own that a distance joins while the simulation runs.

use glam::{DQuat, DVec3, dvec3};
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, DistanceSpec, EndSpec, Precision, Region, SolverSpec, StrokeSpec, Substeps,
};
use incise::{Body, Simulation};

/// Three boxes in a row without gravity, each in an island of its own.
fn row(precision: Precision) -> Simulation {
    let mut builder = Simulation::builder();
    builder.solver(SolverSpec::default().with(|spec| {
        spec.precision = precision;
        spec.substeps = Substeps::Fixed(10);
    }));
    for x in [-2.0, 0.0, 2.0] {
        let mesh = generate(Shape::Box, 200).unwrap();
        builder.add_body(Body::new(mesh).position(dvec3(x, 0.0, 0.0)));
    }
    builder.build().unwrap()
}

/// A rod between the facing sides of two bodies of the row, as long as their distance at rest.
fn rod(from: usize, to: usize) -> DistanceSpec {
    let end =
        |body: usize, side: f64| EndSpec::new(body, [[-2.0, 0.0, 2.0][body] + side, 0.0, 0.0]);
    let side = if from < to { 0.5 } else { -0.5 };
    DistanceSpec::new(end(from, side), end(to, -side))
}

/// The particles of both ends of a rod, and its length at rest.
fn ends(simulation: &Simulation, rod: &DistanceSpec) -> (usize, usize, f64) {
    let rest = &simulation.mesh().positions;
    let nearest = |point: [f64; 3]| {
        let point = DVec3::from_array(point);
        let distance = |p: &usize| rest[*p].distance_squared(point);
        let all = 0..rest.len();
        all.min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap()
    };
    let (a, b) = (nearest(rod.from.point), nearest(rod.to.point));
    (a, b, rest[a].distance(rest[b]))
}

fn island_of(simulation: &Simulation, particle: usize) -> usize {
    simulation
        .location_of(incise::mesh::ParticleId::new(particle))
        .0
}

/// The sum of the positions: bodies of one mesh and density, so its change between frames is momentum but for a factor.
fn middle(simulation: &Simulation, masses: &[f64]) -> DVec3 {
    let weighted = simulation
        .positions()
        .iter()
        .zip(masses)
        .map(|(x, m)| *x * *m);
    weighted.sum::<DVec3>() / masses.iter().sum::<f64>()
}

/// A quarter of the volume of each tet at its corners.
fn masses(simulation: &Simulation) -> Vec<f64> {
    let mesh = simulation.mesh();
    let mut masses = vec![0.0; mesh.positions.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        for p in tet {
            masses[p.index()] += 0.25 * mesh.volume(incise::mesh::TetId::new(t));
        }
    }
    masses
}

#[test]
fn a_rod_added_in_flight_holds_bodies_together_and_keeps_their_momentum() {
    for (from, to) in [(0, 1), (2, 0)] {
        let mut simulation = row(Precision::F64);
        simulation
            .set_velocities(|x| dvec3(0.1 * x.x, 0.3, 0.0))
            .unwrap();
        simulation.step().unwrap();
        let masses = masses(&simulation);
        let first = middle(&simulation, &masses);
        simulation.step().unwrap();
        // Without gravity the center moves on as before.
        let expected = middle(&simulation, &masses) - first;
        let rod = rod(from, to);
        let (a, b, length) = ends(&simulation, &rod);
        let before = simulation.positions().to_vec();
        let (mesh, pieces) = (simulation.mesh().clone(), simulation.report().pieces);
        assert_ne!(island_of(&simulation, a), island_of(&simulation, b));
        simulation.add_distance(&rod).unwrap();
        simulation.check().unwrap();
        assert_eq!(island_of(&simulation, a), island_of(&simulation, b));
        assert_eq!(
            (&mesh, pieces),
            (simulation.mesh(), simulation.report().pieces)
        );
        for (x, y) in before.iter().zip(simulation.positions()) {
            assert!(x.distance(*y) < 1e-14);
        }
        let mut last = middle(&simulation, &masses);
        for _ in 0..30 {
            simulation.step().unwrap();
            let now = middle(&simulation, &masses);
            assert!((now - last - expected).length() < 1e-9, "{}", now - last);
            last = now;
        }
        let x = simulation.positions();
        assert!((x[a].distance(x[b]) - length).abs() < 1e-3 * length);
        simulation.check().unwrap();
    }
}

/// A rod that a program adds before the first frame does what one of the scene does.
#[test]
fn a_rod_added_at_first_is_one_of_the_scene() {
    let rod = rod(0, 1);
    let mut added = row(Precision::F64);
    added.add_distance(&rod).unwrap();
    let mut builder = Simulation::builder();
    builder.solver(added.solver_spec().clone());
    for x in [-2.0, 0.0, 2.0] {
        let mesh = generate(Shape::Box, 200).unwrap();
        builder.add_body(Body::new(mesh).position(dvec3(x, 0.0, 0.0)));
    }
    builder.add_distance(rod);
    let mut declared = builder.build().unwrap();
    for simulation in [&mut added, &mut declared] {
        simulation
            .set_velocities(|x| dvec3(0.2 * x.x, 0.0, 0.1 * x.y))
            .unwrap();
        for _ in 0..20 {
            simulation.step().unwrap();
        }
    }
    for (x, y) in added.positions().iter().zip(declared.positions()) {
        assert!(x.distance(*y) < 1e-9);
    }
}

/// Cuts, a grab, an attachment, a snapshot: all go on after bodies are joined.
#[test]
fn joined_bodies_keep_cuts_grabs_attachments_and_handles() {
    for precision in [Precision::F32, Precision::F64] {
        let mut simulation = row(precision);
        let plane = |x: f64| StrokeSpec::plane(0, [x, 0.01, 0.02], [1.0, 0.1, 0.0]);
        simulation.cut(plane(0.03)).unwrap();
        simulation.cut(plane(2.03)).unwrap();
        simulation.step().unwrap();
        let pieces = simulation.pieces();
        let numbers = simulation.piece_numbers();
        assert_eq!(pieces.len(), 5);
        let corner = |simulation: &Simulation, x: f64| {
            let all = simulation.positions().iter();
            let near = dvec3(x, 0.5, 0.5);
            *all.min_by(|a, b| a.distance(near).total_cmp(&b.distance(near)))
                .unwrap()
        };
        let mut grabs = Vec::new();
        for x in [-2.5, 0.5, 2.5] {
            let point = corner(&simulation, x);
            let grab = simulation.grab(point, 0.2, 0.0).unwrap().unwrap();
            simulation.move_grab(grab, point + DVec3::Z * 0.01).unwrap();
            grabs.push((grab, point));
        }
        let half = Region::half_space([2.45, 0.0, 0.0], [1.0, 0.0, 0.0]);
        simulation.release(grabs[2].0).unwrap();
        let held = simulation
            .add_attachment(&AttachmentSpec::new(2, vec![half]))
            .unwrap();
        simulation
            .move_attachment(held, DVec3::Y * 0.02, DQuat::IDENTITY)
            .unwrap();
        let snapshot = simulation.snapshot().unwrap();
        for turn in 0..2 {
            simulation.add_distance(&rod(2, 1)).unwrap();
            simulation.check().unwrap();
            assert_eq!(simulation.pieces(), pieces);
            assert_eq!(simulation.piece_numbers(), numbers);
            simulation.add_distance(&rod(0, 1)).unwrap();
            simulation.check().unwrap();
            assert_eq!(simulation.pieces(), pieces);
            for &(grab, point) in &grabs[..2] {
                simulation.move_grab(grab, point + DVec3::Z * 0.02).unwrap();
            }
            assert!(simulation.move_grab(grabs[2].0, DVec3::ZERO).is_err());
            simulation.step().unwrap();
            let lifted = grabs[1].1 + DVec3::Z * 0.02;
            let near = simulation
                .positions()
                .iter()
                .any(|x| x.distance(lifted) < 1e-5);
            assert!(near, "the grab moved on");
            simulation.cut(plane(-1.97)).unwrap();
            simulation.step().unwrap();
            assert_eq!(simulation.report().pieces, 6);
            simulation.check().unwrap();
            let whole = simulation.snapshot().unwrap();
            simulation.step().unwrap();
            let next = simulation.positions().to_vec();
            simulation.restore(&whole).unwrap();
            simulation.step().unwrap();
            assert_eq!(simulation.positions(), next, "turn {turn}");
            simulation.release(grabs[0].0).unwrap();
            simulation.remove_attachment(held).unwrap();
            simulation.step().unwrap();
            simulation.check().unwrap();
            simulation.restore(&snapshot).unwrap();
            simulation.check().unwrap();
        }
    }
}

/// A blade that is in bodies follows each of their meshes: they are joined once it has ended.
#[test]
fn bodies_are_not_joined_under_a_moving_blade() {
    let mut simulation = row(Precision::F64);
    let blade = |z: f64| [dvec3(-0.7, -1.0, z), dvec3(-0.7, 1.0, z)];
    let stroke = simulation.begin_stroke(&blade(2.0), 0.1).unwrap();
    simulation.step().unwrap();
    let before = simulation.snapshot().unwrap().bytes();
    let error = simulation.add_distance(&rod(0, 1)).unwrap_err();
    assert_eq!(error.key().as_deref(), Some("stroke[0]"), "{error}");
    assert_eq!(simulation.snapshot().unwrap().bytes(), before);
    simulation.end_stroke(stroke).unwrap();
    simulation.add_distance(&rod(0, 1)).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
}

/// A blade has cut the middle body and ends between frames, so the mesh waits to be improved when the bodies are joined.
/// Improvements after the join take out particles of cuts only, whichever body they are of.
#[test]
fn a_join_keeps_what_waits_to_be_improved_and_original_particles() {
    let mut builder = Simulation::builder();
    builder.solver(SolverSpec::default().with(|spec| spec.substeps = Substeps::Fixed(10)));
    for x in [-2.0, 0.0, 2.0] {
        let mesh = generate(Shape::Box, 200).unwrap();
        builder.add_body(Body::new(mesh).position(dvec3(x, 0.0, 0.0)));
    }
    let mut simulation = builder.build().unwrap();
    let originals = simulation.mesh().positions.len();
    simulation
        .cut(StrokeSpec::plane(0, [0.05, 0.02, 0.0], [1.0, 0.1, 0.1]).with_snap(0.0))
        .unwrap();
    let blade = |z: f64| [dvec3(0.07, -1.0, z), dvec3(0.07, 1.0, z)];
    let stroke = simulation.begin_stroke(&blade(0.8), 0.0).unwrap();
    simulation.step().unwrap();
    for frame in 1..=8 {
        let pose = blade(0.8 - 0.2 * f64::from(frame));
        simulation.move_blade(stroke, &pose).unwrap();
        simulation.step().unwrap();
    }
    simulation.end_stroke(stroke).unwrap();
    simulation.add_distance(&rod(0, 1)).unwrap();
    let collapsed = |simulation: &mut Simulation| {
        let report = simulation.step().unwrap();
        report.cut.as_ref().map_or(0, |cut| cut.collapsed)
    };
    assert!(collapsed(&mut simulation) > 0);
    simulation.check().unwrap();
    simulation
        .cut(StrokeSpec::plane(0, [0.0, 0.05, 0.02], [0.1, 1.0, 0.1]).with_snap(0.0))
        .unwrap();
    assert!(collapsed(&mut simulation) > 0);
    simulation.check().unwrap();
    let mut has_tet = vec![false; originals];
    for p in simulation.mesh().tets.iter().flatten() {
        if let Some(has_tet) = has_tet.get_mut(p.index()) {
            *has_tet = true;
        }
    }
    assert!(has_tet.iter().all(|has_tet| *has_tet));
}
