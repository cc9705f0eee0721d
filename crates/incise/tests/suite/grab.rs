//! What a hand holds goes where the hand goes, the body follows, and what is released swings free.

use incise::mesh::glam::{DVec3, dvec3};
use incise::scene::{Method, Precision, Quantity, Region, SolverSpec, StrokeSpec};
use incise::{Error, Grab, Scene, Simulation};

use crate::support::{body, plane, scene, simulation, state};

/// A weightless box of length 1 around the origin.
fn free_box(precision: Precision) -> Scene {
    let mut scene = scene(&body("box", 300, [0.0; 3]));
    scene.solver.precision = precision;
    scene
}

/// One unit of the last place of numbers around 1, times what sums and frames add up.
fn rounding(precision: Precision) -> f64 {
    match precision {
        Precision::F64 => 1e-12,
        _ => 1e-5,
    }
}

/// The particles of a list of positions within a radius around a point.
fn within(positions: &[DVec3], point: DVec3, radius: f64) -> Vec<usize> {
    let all = 0..positions.len();
    all.filter(|&p| positions[p].distance(point) <= radius)
        .collect()
}

/// The middle of the mass of one body of even density, of the tets that `keep` says of by their middle at rest.
fn middle(simulation: &Simulation, keep: impl Fn(DVec3) -> bool) -> DVec3 {
    let (mesh, positions) = (simulation.mesh(), simulation.positions());
    let (mut sum, mut volume) = (DVec3::ZERO, 0.0);
    for (t, tet) in mesh.tets.iter().enumerate() {
        let rest = tet.map(|p| mesh.positions[p.index()]);
        if keep(rest.iter().sum::<DVec3>() / 4.0) {
            let of_tet = mesh.volume(incise::mesh::TetId::new(t));
            volume += of_tet;
            sum += tet.iter().map(|p| positions[p.index()]).sum::<DVec3>() * (0.25 * of_tet);
        }
    }
    sum / volume
}

/// The longest edge at rest.
fn longest_edge(simulation: &Simulation) -> f64 {
    let mesh = simulation.mesh();
    let lengths = mesh.tets.iter().flat_map(|tet| {
        let x = tet.map(|p| mesh.positions[p.index()]);
        [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(a, b)| x[a].distance(x[b]))
    });
    lengths.fold(0.0, f64::max)
}

fn take(simulation: &mut Simulation, point: DVec3, radius: f64, compliance: f64) -> Grab {
    let grab = simulation.grab(point, radius, compliance).unwrap();
    grab.expect("something is there")
}

#[test]
fn grabbed_particles_reach_the_target() {
    let vbd = |scene: &Scene| {
        scene.clone().with(|copy| {
            copy.solver =
                SolverSpec::of(Method::Vbd).with(|spec| spec.precision = scene.solver.precision);
        })
    };
    for precision in [Precision::F32, Precision::F64] {
        let scene = free_box(precision);
        for scene in [scene.clone(), vbd(&scene)] {
            let mut simulation = simulation(&scene);
            let before = simulation.positions().to_vec();
            let point = dvec3(0.0, 0.0, 0.5);
            let held = within(&before, point, 0.3);
            assert!(held.len() > 4);
            let grab = take(&mut simulation, point, 0.3, 0.0);
            simulation.check().unwrap();
            let way = dvec3(0.2, -0.1, 0.4);
            for step in 1..=20 {
                let to = point + way * (f64::from(step) / 20.0);
                // Of several calls the last one holds.
                simulation.move_grab(grab, DVec3::ZERO).unwrap();
                simulation.move_grab(grab, to).unwrap();
                simulation.step().unwrap();
                for &p in &held {
                    let off = simulation.positions()[p] - before[p] - (to - point);
                    assert!(off.length() < rounding(precision), "step {step}: {off}");
                }
            }
            simulation.check().unwrap();
            // A wave of shear has gone some 0.6 m through the body in 0.32 s: part of it has come along.
            let middle = middle(&simulation, |_| true);
            assert!((0.1..1.0).contains(&(middle.z / way.z)), "{middle}");
            let report = simulation.report();
            assert_eq!((report.repaired, report.pieces), (0, 1));
            // Without another call it stays there.
            simulation.step().unwrap();
            let off = simulation.positions()[held[0]] - before[held[0]] - way;
            assert!(off.length() < rounding(precision), "{off}");
        }
    }
}

/// A spring between hand and body: what is held lags behind, the more the softer it is, and pulls the body all the same.
#[test]
fn a_soft_grab_lags_behind() {
    let point = dvec3(0.0, 0.0, 0.5);
    let way = dvec3(0.0, 0.0, 0.3);
    let lag = |compliance: f64| {
        let mut simulation = simulation(&free_box(Precision::F64));
        let p = within(simulation.positions(), point, 0.3)[0];
        let start = simulation.positions()[p];
        let grab = take(&mut simulation, point, 0.3, compliance);
        simulation.move_grab(grab, point + way).unwrap();
        for _ in 0..6 {
            simulation.step().unwrap();
        }
        simulation.check().unwrap();
        assert!(middle(&simulation, |_| true).z > 1e-3);
        simulation.positions()[p].distance(start + way)
    };
    // Springs of 10 and of 1 kN/m a particle, on a body of 1 t and 10 kPa.
    let [rigid, stiff, soft] = [0.0, 1e-4, 1e-3].map(lag);
    assert!(rigid < 1e-12 && stiff > 1e-4, "{rigid} {stiff}");
    assert!(soft > stiff && soft < 0.3, "{soft} {stiff}");
}

/// Between two frames a hand lets go and takes hold again, of a handle that has come a long way: nothing jumps.
#[test]
fn a_released_region_can_be_grabbed_again_at_once() {
    for precision in [Precision::F32, Precision::F64] {
        let mut simulation = simulation(&free_box(precision));
        let mut point = DVec3::ZERO;
        for turn in 0..4 {
            let grab = take(&mut simulation, point, 2.0, 0.0);
            if turn % 2 == 1 {
                // The hand stays.
                simulation.step().unwrap();
            }
            point += DVec3::X;
            simulation.move_grab(grab, point).unwrap();
            simulation.step().unwrap();
            // What it would have done next it does not do.
            simulation.move_grab(grab, point + DVec3::Y).unwrap();
            simulation.release(grab).unwrap();
            for (x, rest) in simulation
                .positions()
                .iter()
                .zip(&simulation.mesh().positions)
            {
                let off = (*x - *rest - point).length();
                assert!(off < rounding(precision), "turn {turn}: {off}");
            }
        }
        let grab = take(&mut simulation, point, 2.0, 0.0);
        let before = simulation.positions().to_vec();
        simulation.step().unwrap();
        assert_eq!(simulation.positions(), before);
        simulation.release(grab).unwrap();
    }
}

/// All of a body in a hand that moves evenly: once released, it keeps moving as before.
#[test]
fn released_particles_keep_their_velocity() {
    for precision in [Precision::F32, Precision::F64] {
        let mut simulation = simulation(&free_box(precision));
        let grab = take(&mut simulation, DVec3::ZERO, 2.0, 0.0);
        let velocity = dvec3(0.5, 0.25, 1.0);
        let a_frame = velocity * simulation.time_step();
        for step in 1..=5 {
            let to = a_frame * f64::from(step);
            simulation.move_grab(grab, to).unwrap();
            simulation.step().unwrap();
        }
        simulation.release(grab).unwrap();
        for _ in 0..5 {
            let before = simulation.positions().to_vec();
            simulation.step().unwrap();
            for (x, before) in simulation.positions().iter().zip(&before) {
                // The velocity of what is held is taken from rounded positions: a digit over the substep.
                let off = (*x - *before - a_frame).length();
                assert!(off < 20.0 * rounding(precision), "{off}");
            }
        }
        simulation.check().unwrap();
    }
}

/// A body that was pulled aside swings free: the middle of its mass moves on evenly, whatever the rest does.
#[test]
fn momentum_is_kept_after_release() {
    let mut simulation = simulation(&free_box(Precision::F64));
    let point = dvec3(0.3, 0.0, 0.5);
    let grab = take(&mut simulation, point, 0.3, 0.0);
    for step in 1..=10 {
        let to = point + DVec3::Z * (0.02 * f64::from(step));
        simulation.move_grab(grab, to).unwrap();
        simulation.step().unwrap();
    }
    simulation.release(grab).unwrap();
    let mut middles = vec![middle(&simulation, |_| true)];
    for _ in 0..10 {
        simulation.step().unwrap();
        middles.push(middle(&simulation, |_| true));
    }
    let ways: Vec<DVec3> = middles.windows(2).map(|two| two[1] - two[0]).collect();
    // Pulled at up to 1.25 m/s, in one corner.
    assert!(ways[0].z > 1e-3, "{}", ways[0]);
    for way in &ways {
        // Each correction of a tet keeps the momentum to the last digit; thousands of them a frame add up.
        assert!((*way - ways[0]).length() < 1e-11, "{way} {}", ways[0]);
    }
}

#[test]
fn both_sides_of_a_cut_grab_are_held_and_released() {
    let strokes = plane(4, [0.03, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let run = |threads: usize, precision: Precision| {
        let mut scene = scene(&(body("box", 1500, [0.0; 3]) + &strokes));
        scene.solver.precision = precision;
        let mut simulation = Simulation::with_threads(&scene, threads).unwrap();
        let point = dvec3(0.0, 0.0, 0.5);
        let grab = take(&mut simulation, point, 0.5, 0.0);
        let longest = longest_edge(&simulation);
        assert!(longest < 0.35, "{longest}");
        let to = |step: u32| point + DVec3::Z * (0.02 * f64::from(step));
        for step in 1..=20 {
            simulation.move_grab(grab, to(step)).unwrap();
            simulation.step().unwrap();
            simulation.check().unwrap();
        }
        assert_eq!(simulation.report().pieces, 2);
        // All that the cut made between particles that are held is where the hand is, on both sides: both ends of an edge
        // lie within the hand if a point of it does by the edge's length.
        let rest = &simulation.mesh().positions;
        let inside = within(rest, point, 0.5 - longest);
        let new = inside.iter().filter(|&&p| (rest[p].x - 0.03).abs() < 1e-6);
        assert!(new.count() >= 4);
        for p in inside {
            let off = simulation.positions()[p] - rest[p] - DVec3::Z * 0.4;
            assert!(off.length() < rounding(precision), "{p}: {off}");
        }
        for side in [-1.0, 1.0] {
            let middle = middle(&simulation, |x| (x.x - 0.03) * side > 0.0);
            assert!(middle.z > 0.1, "{side}: {middle}");
        }
        simulation.release(grab).unwrap();
        // No copy is attached to the released handle.
        simulation.check().unwrap();
        // The next grab takes the same handle: what was released does not come along.
        let before = [-1.0, 1.0].map(|side| middle(&simulation, |x| (x.x - 0.03) * side > 0.0));
        let left = simulation.positions()
            [within(&simulation.mesh().positions, dvec3(-0.5, 0.0, 0.0), 0.3)[0]];
        let grab = take(&mut simulation, left, 0.4, 0.0);
        for step in 1..=20 {
            let to = left - DVec3::X * (0.05 * f64::from(step));
            simulation.move_grab(grab, to).unwrap();
            simulation.step().unwrap();
        }
        let after = [-1.0, 1.0].map(|side| middle(&simulation, |x| (x.x - 0.03) * side > 0.0));
        assert!(after[0].x < before[0].x - 0.1, "{} {}", after[0], before[0]);
        assert!(after[1].x > before[1].x - 0.1, "{} {}", after[1], before[1]);
        simulation.check().unwrap();
        state(&simulation)
    };
    for precision in [Precision::F32, Precision::F64] {
        assert!(run(1, precision) == run(3, precision));
    }
}

#[test]
fn fixed_or_attached_particles_cannot_be_grabbed() {
    let text = body("box", 300, [0.0; 3])
        + "fixed = [{ half_space = { point = [0, 0, 0.1], normal = [0, 0, 1] } }]\n"
        + "[[attachment]]\nregions = [{ half_space = { point = [0, 0, -0.4], normal = [0, 0, -1] } }]\n\
           frames = [1, 2]\npath = [[0, 0, 0], [0, 0, 0]]\n";
    let mut simulation = simulation(&scene(&text));
    let [top, bottom] = [0.5, -0.5].map(|z| dvec3(0.0, 0.0, z));
    for (point, radius) in [(top, 0.3), (bottom, 0.05), (DVec3::Z * 3.0, 1.0)] {
        assert_eq!(simulation.grab(point, radius, 0.0).unwrap(), None);
    }
    // A radius that reaches the free ones: these are held, the fixed ones stay.
    let before = simulation.positions().to_vec();
    let grab = take(&mut simulation, top, 0.6, 0.0);
    assert_eq!(simulation.grab(top, 0.6, 0.0).unwrap(), None);
    simulation.move_grab(grab, top + DVec3::X * 0.01).unwrap();
    simulation.step().unwrap();
    let mut moved = 0;
    for (x, before) in simulation.positions().iter().zip(&before) {
        let way = (*x - *before).length();
        if before.z > 0.1 {
            assert_eq!(way, 0.0);
        } else if before.distance(top) <= 0.6 {
            assert!((way - 0.01).abs() < rounding(Precision::F32), "{way}");
            moved += 1;
        }
    }
    assert!(moved > 0);
    simulation.release(grab).unwrap();
    let again = take(&mut simulation, top, 0.6, 0.0);
    assert_ne!(grab, again);
    simulation.check().unwrap();
}

/// A radius over two bodies, and over two pieces of one: only that of the nearest particle is held.
#[test]
fn grabs_do_not_join_separate_parts() {
    let bodies = body("box", 300, [0.0; 3]) + &body("box", 300, [0.0, 0.0, 1.01]);
    let mut scene = scene(&(bodies + &plane(0, [0.03, 0.0, 0.0], [1.0, 0.0, 0.0])));
    scene.solver.precision = Precision::F64;
    let mut simulation = simulation(&scene);
    assert_eq!(simulation.step().unwrap().pieces, 4);
    let before = simulation.positions().to_vec();
    // Within the lower body, left of the cut.
    let point = dvec3(-0.1, 0.0, 0.45);
    let grab = take(&mut simulation, point, 0.5, 0.0);
    for step in 1..=5 {
        let to = point - DVec3::X * (0.02 * f64::from(step));
        simulation.move_grab(grab, to).unwrap();
        simulation.step().unwrap();
    }
    let rest = &simulation.mesh().positions;
    let mut moved = 0;
    for tet in &simulation.mesh().tets {
        let center = tet.iter().map(|p| rest[p.index()]).sum::<DVec3>() / 4.0;
        for p in tet.map(incise::mesh::ParticleId::index) {
            let way = simulation.positions()[p] - before[p];
            if center.x > 0.03 || center.z > 0.505 {
                // Corrections of a body at rest are rounding.
                assert!(way.length() < 1e-12, "{p}: {way}");
            } else if before[p].distance(point) <= 0.5 {
                assert!((way + DVec3::X * 0.1).length() < 1e-12, "{p}: {way}");
                moved += 1;
            }
        }
    }
    assert!(moved > 20);
    simulation.check().unwrap();
}

/// A stroke removes all that is held, or even the whole body; then the grab is released.
#[test]
fn grabbed_particles_may_be_cut_away() {
    for (precision, radius) in [
        (Precision::F32, 0.5),
        (Precision::F64, 0.5),
        (Precision::F32, 3.0),
    ] {
        let mut scene = free_box(precision);
        scene.report.quantities = vec![Quantity::Speed];
        let mut simulation = simulation(&scene);
        let point = dvec3(0.0, 0.0, 0.5);
        let grab = take(&mut simulation, point, 0.3, 0.0);
        let region = Region::sphere(point.to_array(), radius);
        simulation.cut(StrokeSpec::remove(0, region)).unwrap();
        for step in 1..=4 {
            let to = point + DVec3::Z * (0.1 * f64::from(step));
            simulation.move_grab(grab, to).unwrap();
            simulation.step().unwrap();
            simulation.check().unwrap();
        }
        simulation.release(grab).unwrap();
        let before = simulation.positions().to_vec();
        let report = simulation.step().unwrap();
        assert_eq!(report.tets == 0, radius > 1.0);
        // The hand moved at 6 m/s what has no tets; nothing of the body, which only rounding moves.
        assert!(report.max_speed < Some(1e-5), "{:?}", report.max_speed);
        let mut around = vec![0; before.len()];
        let corners = simulation.mesh().tets.iter().flatten();
        corners.for_each(|p| around[p.index()] += 1);
        assert!(around.contains(&0));
        for p in (0..before.len()).filter(|&p| around[p] == 0) {
            assert_eq!(simulation.positions()[p], before[p]);
            assert_eq!(simulation.grab(before[p], 0.0, 0.0).unwrap(), None);
        }
        assert!(simulation.positions().iter().all(|x| x.is_finite()));
        simulation.check().unwrap();
    }
}

#[test]
fn a_grab_wakes_what_it_holds_while_it_moves() {
    let solver = "[solver]\nsleep = { speed = 0.05, time = 0.05 }\n";
    let bodies = body("box", 200, [0.0; 3]) + &body("box", 200, [3.0, 0.0, 0.0]);
    let mut simulation = simulation(&scene(&format!("{solver}{bodies}")));
    let asleep = |simulation: &mut Simulation| {
        let report = simulation.step().unwrap();
        [0, 1].map(|body: usize| report.bodies[body].asleep == Some(true))
    };
    let until_asleep = |simulation: &mut Simulation| {
        let sleeps = (0..400).any(|_| asleep(simulation) == [true; 2]);
        assert!(sleeps, "weightless boxes come to rest");
    };
    until_asleep(&mut simulation);
    let grab = take(&mut simulation, DVec3::ZERO, 2.0, 0.0);
    assert_eq!(asleep(&mut simulation), [false, true]);
    until_asleep(&mut simulation);
    for step in 1..=6 {
        let to = DVec3::X * (0.01 * f64::from(step));
        simulation.move_grab(grab, to).unwrap();
        assert_eq!(asleep(&mut simulation), [false, true]);
    }
    // A hand that says where it is and does not move lets it sleep.
    let still = |simulation: &mut Simulation| {
        simulation.move_grab(grab, DVec3::X * 0.06).unwrap();
        asleep(simulation) == [true; 2]
    };
    assert!((0..6).any(|_| still(&mut simulation)));
    simulation.release(grab).unwrap();
    assert_eq!(asleep(&mut simulation), [false, true]);
    let error = simulation.move_grab(grab, DVec3::ZERO).unwrap_err();
    assert!(error.to_string().contains("grab"), "{error}");
}

#[test]
fn impossible_grabs_are_refused_by_name() {
    let mut simulation = simulation(&free_box(Precision::F32));
    let nan = dvec3(0.0, f64::NAN, 0.0);
    let field = |error: Error| match error {
        Error::Value { field, .. } => field,
        other => panic!("{other}"),
    };
    for (point, radius, compliance, expected) in [
        (nan, 0.1, 0.0, "grab.point"),
        (DVec3::X * 1e10, 0.1, 0.0, "grab.point"),
        (DVec3::ZERO, -0.1, 0.0, "grab.radius"),
        (DVec3::ZERO, f64::NAN, 0.0, "grab.radius"),
        (DVec3::ZERO, 0.1, -1.0, "grab.compliance"),
        (DVec3::ZERO, 0.1, f64::INFINITY, "grab.compliance"),
    ] {
        let error = simulation.grab(point, radius, compliance).unwrap_err();
        assert_eq!(field(error), expected);
    }
    let grab = take(&mut simulation, DVec3::ZERO, 0.5, 0.0);
    for to in [nan, DVec3::splat(f64::INFINITY), DVec3::X * 1e10] {
        assert_eq!(
            field(simulation.move_grab(grab, to).unwrap_err()),
            "grab.to"
        );
    }
    simulation.release(grab).unwrap();
    assert_eq!(field(simulation.release(grab).unwrap_err()), "grab");
    assert_eq!(
        field(simulation.move_grab(grab, DVec3::ZERO).unwrap_err()),
        "grab"
    );
    // Its handle belongs to another grab now.
    let other = take(&mut simulation, DVec3::ZERO, 0.5, 0.0);
    assert_eq!(field(simulation.release(grab).unwrap_err()), "grab");
    simulation.release(other).unwrap();
    // A grab of another simulation, in a body that this one has not.
    let bodies = body("box", 200, [0.0; 3]) + &body("box", 200, [3.0, 0.0, 0.0]);
    let mut two = self::simulation(&scene(&bodies));
    let foreign = take(&mut two, dvec3(3.0, 0.0, 0.0), 0.5, 0.0);
    assert_eq!(field(simulation.release(foreign).unwrap_err()), "grab");

    let mut vbd = free_box(Precision::F64);
    vbd.solver = SolverSpec::of(Method::Vbd);
    let mut vbd = self::simulation(&vbd);
    take(&mut vbd, DVec3::ZERO, 0.5, 1e-3);
    vbd.step().unwrap();
}
