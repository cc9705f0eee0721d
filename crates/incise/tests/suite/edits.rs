//! What a program changes between frames: colliders, gravity, impulses; rays and events.

use incise::cutting::FaceTag;
use incise::mesh::glam::DVec3;
use incise::meshing::{Shape, generate};
use incise::scene::{ColliderSpec, Precision, SolverSpec, StrokeSpec};
use incise::{Body, Event, Simulation, SimulationBuilder};

fn ball(center: DVec3) -> ColliderSpec {
    ColliderSpec::sphere(center.to_array(), 0.2).with_friction(0.3)
}

fn box_of_jelly() -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.solver(SolverSpec::default().with(|spec| spec.precision = Precision::F64));
    builder.add_body(Body::new(generate(Shape::Box, 300).unwrap()).young_modulus(1e5));
    builder
}

fn frames(simulation: &mut Simulation, count: usize) {
    for _ in 0..count {
        simulation.step().unwrap();
    }
}

/// A collider with a velocity of its own, one that is sent from frame to frame, and one that is added later and sent push
/// alike, up to rounding; then what was sent stays.
#[test]
fn a_collider_that_is_sent_is_one_with_that_velocity() {
    let start = DVec3::new(0.0, 0.0, 0.75);
    let velocity = DVec3::new(0.0, 0.1, -1.0);
    let pushed = {
        let mut builder = box_of_jelly();
        builder.add_collider(
            ColliderSpec::sphere(start.to_array(), 0.2)
                .with_friction(0.3)
                .with_velocity(velocity.to_array()),
        );
        let mut simulation = builder.build().unwrap();
        let rest = simulation.positions().to_vec();
        frames(&mut simulation, 10);
        let way = simulation.positions().iter().zip(&rest);
        assert!(way.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) > 0.02);
        simulation.positions().to_vec()
    };
    for is_added_later in [false, true] {
        let mut builder = box_of_jelly();
        let known = (!is_added_later).then(|| builder.add_collider(ball(start)));
        let mut simulation = builder.build().unwrap();
        let handle = known.unwrap_or_else(|| simulation.add_collider(&ball(start)).unwrap());
        let mut to = start;
        for frame in 1..=10 {
            to = start + velocity * (f64::from(frame) * simulation.time_step());
            // Of several the last one counts.
            simulation.move_collider(handle, DVec3::splat(7.0)).unwrap();
            simulation.move_collider(handle, to).unwrap();
            simulation.step().unwrap();
            assert!(simulation.collider_position(handle).unwrap().distance(to) < 1e-15);
        }
        for (a, b) in simulation.positions().iter().zip(&pushed) {
            assert!(a.distance(*b) < 1e-9, "{a} {b}");
        }
        frames(&mut simulation, 2);
        assert!(simulation.collider_position(handle).unwrap().distance(to) < 1e-15);
    }
}

/// What was removed is no obstacle; other handles still name what they named, and come back with a snapshot.
#[test]
fn handles_stay_valid_after_other_removals() {
    let mut builder = box_of_jelly();
    builder.ground(-2.0, 0.0);
    let first = builder.add_collider(ball(DVec3::X * 3.0));
    let second = builder.add_collider(ball(DVec3::Y * 3.0));
    let mut simulation = builder.build().unwrap();
    let before = simulation.snapshot().unwrap();
    simulation.remove_collider(first).unwrap();
    assert!(simulation.remove_collider(first).is_err());
    assert!(simulation.move_collider(first, DVec3::ZERO).is_err());
    assert!(simulation.set_collider(first, &ball(DVec3::ZERO)).is_err());
    assert_eq!(
        simulation.collider_position(second).unwrap(),
        DVec3::Y * 3.0
    );
    let third = simulation.add_collider(&ball(DVec3::Z * 3.0)).unwrap();
    assert!(![first, second].contains(&third));
    simulation
        .set_collider(second, &ball(DVec3::Z * -3.0))
        .unwrap();
    assert_eq!(
        simulation.collider_position(second).unwrap(),
        DVec3::Z * -3.0
    );
    simulation.restore(&before).unwrap();
    assert_eq!(simulation.collider_position(first).unwrap(), DVec3::X * 3.0);
    assert_eq!(
        simulation.collider_position(second).unwrap(),
        DVec3::Y * 3.0
    );
    assert!(simulation.collider_position(third).is_err());
    let fourth = simulation.add_collider(&ball(DVec3::ZERO)).unwrap();
    assert_ne!(third, fourth, "a void handle is not given again");
}

#[test]
fn bad_changes_are_refused_and_nothing_moves() {
    let mut builder = box_of_jelly();
    let handle = builder.add_collider(ball(DVec3::X * 3.0));
    let mut simulation = builder.build().unwrap();
    let nan = DVec3::splat(f64::NAN);
    assert!(simulation.set_gravity(Some(nan)).is_err());
    assert!(simulation.move_collider(handle, nan).is_err());
    assert!(simulation.add_collider(&ball(nan)).is_err());
    assert!(simulation.set_collider(handle, &ball(nan)).is_err());
    assert!(
        simulation
            .apply_impulse(DVec3::ZERO, -1.0, DVec3::X)
            .is_err()
    );
    assert!(simulation.apply_impulse(nan, 1.0, DVec3::X).is_err());
    assert!(
        simulation
            .apply_impulse(DVec3::ZERO, 1.0, DVec3::X * 1e300)
            .is_err()
    );
    assert!(
        !simulation
            .apply_impulse(DVec3::X * 9.0, 1.0, DVec3::X)
            .unwrap()
    );
    let before = simulation.positions().to_vec();
    frames(&mut simulation, 3);
    for (a, b) in simulation.positions().iter().zip(&before) {
        assert!(a.distance(*b) < 1e-12, "{a} {b}");
    }
    assert_eq!(
        simulation.collider_position(handle).unwrap(),
        DVec3::X * 3.0
    );
}

/// A free body falls as implicit Euler falls, from when gravity is turned on; a snapshot brings weightlessness back.
#[test]
fn gravity_can_be_turned_on_and_comes_back_with_a_snapshot() {
    let mut simulation = box_of_jelly().build().unwrap();
    let before = simulation.snapshot().unwrap();
    let height = |simulation: &Simulation| simulation.positions()[0].z;
    let start = height(&simulation);
    simulation.set_gravity(Some(DVec3::NEG_Z)).unwrap();
    frames(&mut simulation, 10);
    let fallen = height(&simulation) - start;
    let time = 10.0 * simulation.time_step();
    assert!(
        (fallen / (-0.5 * time * time) - 1.0).abs() < 0.15,
        "{fallen}"
    );
    // It is not forgotten when other settings change.
    let spec = simulation
        .solver_spec()
        .clone()
        .with(|spec| spec.iterations = 2);
    simulation.set_solver(&spec).unwrap();
    let last = height(&simulation);
    simulation.step().unwrap();
    assert!(height(&simulation) - last < -0.9 * time * simulation.time_step());
    simulation.restore(&before).unwrap();
    frames(&mut simulation, 5);
    assert!((height(&simulation) - start).abs() < 1e-12);
}

/// The momentum of the body is the impulse, wherever it is applied.
#[test]
fn an_impulse_is_the_momentum_it_gives() {
    for radius in [0.3, 9.0] {
        let mut simulation = box_of_jelly().build().unwrap();
        let center = |simulation: &Simulation| {
            let mesh = simulation.mesh();
            let mut sum = DVec3::ZERO;
            let mut mass = 0.0;
            for t in 0..mesh.tets.len() {
                let volume = mesh.volume(incise::mesh::TetId::new(t));
                for p in mesh.tets[t] {
                    sum += simulation.positions()[p.index()] * (250.0 * volume);
                    mass += 250.0 * volume;
                }
            }
            (sum / mass, mass)
        };
        let (before, mass) = center(&simulation);
        let impulse = DVec3::new(30.0, 0.0, 40.0);
        let corner = simulation.positions()[0];
        assert!(simulation.apply_impulse(corner, radius, impulse).unwrap());
        frames(&mut simulation, 20);
        let way = center(&simulation).0 - before;
        let expected = impulse / mass * (20.0 * simulation.time_step());
        assert!(
            way.distance(expected) < 1e-6 * expected.length(),
            "{way} {expected}"
        );
    }
}

/// A cut through: it begins, a piece comes off, it ends; and a ray then finds the face that it laid bare.
#[test]
fn events_tell_a_cut_from_its_begin_to_its_end() {
    let mut simulation = box_of_jelly().build().unwrap();
    simulation
        .cut(StrokeSpec::plane(1, [0.07, 0.0, 0.0], [1.0, 0.0, 0.0]))
        .unwrap();
    simulation.step().unwrap();
    assert!(simulation.events().is_empty());
    simulation.step().unwrap();
    let events = simulation.events().to_vec();
    let [
        Event::CutBegan { stroke: 0 },
        Event::PieceDetached(piece),
        Event::CutEnded { stroke: 0 },
    ] = events[..]
    else {
        panic!("{events:?}");
    };
    assert_eq!(piece, simulation.report().detached[0]);
    simulation.step().unwrap();
    assert!(simulation.events().is_empty());

    // A blade in hand: nothing happens before it meets the body, and it ends when it is taken away.
    let blade = |z: f64| [DVec3::new(-9.0, 0.02, z), DVec3::new(9.0, 0.02, z)];
    let stroke = simulation.begin_stroke(&blade(3.0), 0.1).unwrap();
    simulation.step().unwrap();
    assert!(simulation.events().is_empty(), "{:?}", simulation.events());
    for z in [2.0, 0.3, 0.1] {
        simulation.move_blade(stroke, &blade(z)).unwrap();
        simulation.step().unwrap();
        let began = simulation.events().contains(&Event::CutBegan { stroke });
        assert_eq!(began, z == 0.3);
        assert!(!simulation.events().contains(&Event::CutEnded { stroke }));
    }
    simulation.end_stroke(stroke).unwrap();
    simulation.step().unwrap();
    assert!(simulation.events().contains(&Event::CutEnded { stroke }));
}

/// The six volumes that a line has with the edges of a triangle tell whether it goes through: no division, no plane.
fn goes_through(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let to = corners.map(|x| x - origin);
    let sides = [0, 1, 2].map(|i| direction.dot(to[i].cross(to[(i + 1) % 3])));
    let inside = sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0);
    let total: f64 = sides.iter().sum();
    if !inside || total == 0.0 {
        return None;
    }
    let point = (to[2] * sides[0] + to[0] * sides[1] + to[1] * sides[2]) / total;
    let distance = point.dot(direction) / direction.length_squared();
    (distance > 0.0).then_some(distance)
}

/// On two halves that have drifted apart, so that rays meet outer and cut faces.
#[test]
fn a_ray_meets_the_first_triangle() {
    let mut simulation = box_of_jelly().build().unwrap();
    simulation
        .cut(StrokeSpec::plane(0, [0.07, 0.0, 0.0], [1.0, 0.0, 0.0]))
        .unwrap();
    simulation.step().unwrap();
    simulation
        .set_velocities(|x| DVec3::X * 5.0 * (x.x - 0.07).signum())
        .unwrap();
    frames(&mut simulation, 5);
    let positions = simulation.positions();
    let (mut hits, mut cut) = (0, 0);
    for k in 0..400 {
        let angle = 0.37 * f64::from(k);
        let origin = DVec3::new(angle.cos(), angle.sin(), (1.7 * angle).sin()) * 2.0;
        let aim = DVec3::new(
            (2.3 * angle).sin(),
            (3.1 * angle).cos(),
            (0.9 * angle).sin(),
        ) * 0.6;
        let direction = aim - origin;
        let triangles = simulation.boundary();
        let corners = triangles.map(|t| t.particles.map(|p| positions[p.index()]));
        let distances = corners.filter_map(|corners| goes_through(corners, origin, direction));
        let nearest = distances.min_by(f64::total_cmp);
        let hit = simulation.ray_cast(origin, direction);
        assert_eq!(hit.is_some(), nearest.is_some(), "{origin} {direction}");
        let (Some(hit), Some(nearest)) = (hit, nearest) else {
            continue;
        };
        // Two ways to compute one number of size 1.
        assert!((hit.distance - nearest).abs() < 1e-9, "{hit:?} {nearest}");
        assert!(hit.point.distance(origin + direction * nearest) < 1e-9);
        let of_tet = simulation.mesh().tets[hit.tet.index()];
        assert!(hit.particles.iter().all(|p| of_tet.contains(p)));
        // From outside, the first face looks at the ray.
        assert!(hit.normal.dot(direction) < 0.0 && hit.normal.is_normalized());
        hits += 1;
        cut += usize::from(hit.tag != FaceTag::Outer);
    }
    assert!(hits > 60 && cut > 5, "{hits} hits, {cut} on cut faces");
    assert!(
        simulation
            .ray_cast(DVec3::splat(9.0), DVec3::ZERO)
            .is_none()
    );
}
