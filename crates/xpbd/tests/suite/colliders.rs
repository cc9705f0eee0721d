//! Colliders: their distances against brute force, contact and friction against closed forms.

use glam::{DQuat, DVec3, dvec3};
use incise_graph::Schedule;
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, ColliderShape, Material, Real, Solver, StepSettings, XpbdError};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, RUBBER, body, plain, within};

/// Loose particles of 1 kg.
fn dust<R: Real>(positions: &[DVec3]) -> Solver<R> {
    let mut solver = Solver::new(positions);
    (0..positions.len()).for_each(|p| solver.set_mass(p, 1.0));
    solver
}

fn step<R: Real>(solver: &mut Solver<R>, settings: &StepSettings) {
    let report = solver.step(&Schedule::default(), settings).unwrap();
    assert_eq!(report.repaired, 0);
}

fn point(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

fn rotation() -> impl Strategy<Value = DQuat> {
    (point(1.0), 0.1..3.0f64).prop_filter_map("no axis", |(axis, angle)| {
        Some(DQuat::from_axis_angle(axis.try_normalize()?, angle))
    })
}

fn shape() -> impl Strategy<Value = ColliderShape> {
    prop_oneof![
        (point(1.0), point(1.0))
            .prop_filter("no normal", |(_, normal)| normal.length() > 0.01)
            .prop_map(|(point, normal)| ColliderShape::Plane { point, normal }),
        (point(1.0), 0.01..1.0f64)
            .prop_map(|(center, radius)| ColliderShape::Sphere { center, radius }),
        (point(1.0), point(1.0), 0.01..1.0f64).prop_map(|(a, b, radius)| {
            let ends = [a, b];
            ColliderShape::Capsule { ends, radius }
        }),
        (point(1.0), prop::array::uniform3(0.01..1.0f64), rotation()).prop_map(
            |(center, half, rotation)| ColliderShape::Box {
                center,
                half_extents: DVec3::from_array(half),
                rotation,
            }
        ),
    ]
}

/// Points all over the surface of a shape, `n` along each direction, and how far any surface point within 4 of the
/// origin may be from the nearest of them.
fn samples(shape: &ColliderShape, n: usize) -> (Vec<DVec3>, f64) {
    let fraction = |i: usize| i as f64 / (n - 1) as f64;
    let mut points = Vec::new();
    match *shape {
        ColliderShape::Plane { point, normal } => {
            let (u, v) = normal.normalize().any_orthonormal_pair();
            for i in 0..n {
                for j in 0..n {
                    let [s, t] = [i, j].map(|k| 12.0 * (2.0 * fraction(k) - 1.0));
                    points.push(point + u * s + v * t);
                }
            }
            (points, 24.0 / (n - 1) as f64)
        }
        ColliderShape::Sphere { center, radius } => {
            let ends = [center; 2];
            samples(&ColliderShape::Capsule { ends, radius }, n)
        }
        ColliderShape::Capsule { ends, radius } => {
            let length = ends[0].distance(ends[1]);
            let axis = (ends[1] - ends[0]).try_normalize().unwrap_or(DVec3::Z);
            let (u, v) = axis.any_orthonormal_pair();
            for i in 0..n {
                let turn = std::f64::consts::TAU * fraction(i);
                let around = u * turn.cos() + v * turn.sin();
                for j in 0..n {
                    // Half of a meridian on each ball, and the side.
                    let slope = std::f64::consts::FRAC_PI_2 * fraction(j);
                    let (up, out) = (axis * slope.sin(), around * slope.cos());
                    points.push(ends[1] + (out + up) * radius);
                    points.push(ends[0] + (out - up) * radius);
                    points.push(ends[0] + axis * length * fraction(j) + around * radius);
                }
            }
            (points, (7.0 * radius + length) / (n - 1) as f64)
        }
        ColliderShape::Box {
            center,
            half_extents,
            rotation,
        } => {
            for i in 0..n {
                for j in 0..n {
                    let [s, t] = [i, j].map(|k| 2.0 * fraction(k) - 1.0);
                    for side in [-1.0, 1.0] {
                        for local in [dvec3(side, s, t), dvec3(t, side, s), dvec3(s, t, side)] {
                            points.push(center + rotation * (local * half_extents));
                        }
                    }
                }
            }
            (points, 4.0 * half_extents.max_element() / (n - 1) as f64)
        }
    }
}

/// Whether a point is inside, by the definition of the shape.
fn inside(shape: &ColliderShape, x: DVec3) -> bool {
    match *shape {
        ColliderShape::Plane { point, normal } => normal.dot(x - point) < 0.0,
        ColliderShape::Sphere { center, radius } => x.distance(center) < radius,
        ColliderShape::Capsule { ends, radius } => {
            // The distance to the segment falls, then rises: thirds close in on the smallest one.
            let at = |t: f64| x.distance(ends[0].lerp(ends[1], t));
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..200 {
                let third = (high - low) / 3.0;
                if at(low + third) < at(high - third) {
                    high -= third;
                } else {
                    low += third;
                }
            }
            at(low) < radius
        }
        ColliderShape::Box {
            center,
            half_extents,
            rotation,
        } => {
            let local = rotation.inverse() * (x - center);
            local.abs().cmplt(half_extents).all()
        }
    }
}

proptest! {
    /// The nearest of many points on the surface is farther than the surface by at most their spacing.
    #[test]
    fn distances_are_those_to_the_nearest_of_many_points(shape in shape(), x in point(2.0)) {
        let (distance, normal) = Collider::new(shape).distance(x);
        let (points, spacing) = samples(&shape, 60);
        let nearest = points.iter().map(|p| p.distance(x)).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest >= distance.abs() - 1e-12, "{nearest} {distance}");
        prop_assert!(nearest <= distance.abs() + spacing, "{nearest} {distance} {spacing}");
        // Within rounding of the surface, either side is right.
        prop_assert!(distance.abs() < 1e-12 || (distance < 0.0) == inside(&shape, x));
        // Following the normal back leads to the surface; rounding only.
        let (left, _) = Collider::new(shape).distance(x - normal * distance);
        prop_assert!(left.abs() < 1e-12, "{left}");
    }

    /// A distance grows at most as fast as one moves, and the normal is its slope where it has one.
    #[test]
    fn distances_are_lipschitz_and_normals_their_slopes(
        shape in shape(),
        x in point(2.0),
        y in point(2.0),
    ) {
        let collider = Collider::new(shape);
        let ((a, normal), (b, _)) = (collider.distance(x), collider.distance(y));
        prop_assert!((a - b).abs() <= x.distance(y) + 1e-12);
        prop_assert!((normal.length() - 1.0).abs() < 1e-12);
        // Along the normal it grows by what one moves, also from the ridges inside, which have several normals; only
        // not from a point nearer to a ridge than the step, and outwards there is none.
        let step = 1e-6;
        let (c, _) = collider.distance(x + normal * step);
        prop_assert!((c - a - step).abs() < 1e-9, "{c} {a}");
    }
}

#[test]
fn points_without_a_nearest_one_have_a_normal_all_the_same() {
    let turned = DQuat::from_rotation_x(0.3);
    let ends = [DVec3::NEG_X, dvec3(3.0, 1.0, 0.0)];
    for (shape, x, depth) in [
        (
            ColliderShape::Sphere {
                center: DVec3::ONE,
                radius: 0.5,
            },
            DVec3::ONE,
            0.5,
        ),
        (
            ColliderShape::Capsule { ends, radius: 0.25 },
            ends[0].lerp(ends[1], 0.5),
            0.25,
        ),
        (
            ColliderShape::Capsule {
                ends: [DVec3::ONE; 2],
                radius: 0.25,
            },
            DVec3::ONE,
            0.25,
        ),
        (
            ColliderShape::Box {
                center: DVec3::ONE,
                half_extents: DVec3::splat(0.5),
                rotation: turned,
            },
            DVec3::ONE,
            0.5,
        ),
        (
            ColliderShape::Box {
                center: DVec3::ONE,
                half_extents: dvec3(5.0, 5.0, 1e-9),
                rotation: turned,
            },
            DVec3::ONE,
            1e-9,
        ),
    ] {
        let collider = Collider::new(shape);
        let (distance, normal) = collider.distance(x);
        within("depth", (distance + depth).abs(), 1e-15);
        within("length", (normal.length() - 1.0).abs(), 1e-15);
        assert_eq!(collider.distance(x), (distance, normal));
        // In both precisions a particle there comes out.
        pushed_out::<f32>(collider, x, 1e-6);
        pushed_out::<f64>(collider, x, 1e-15);
    }
}

fn pushed_out<R: Real>(collider: Collider, x: DVec3, tolerance: f64) {
    let mut solver = dust::<R>(&[x]);
    // As long as the time in which a depth decays: all of it is taken back at once.
    let settings = StepSettings {
        colliders: vec![collider],
        ..StepSettings::new(0.02)
    };
    step(&mut solver, &settings);
    within(
        "outside",
        collider.distance(solver.position(0)).0.abs(),
        tolerance,
    );
}

#[test]
fn bad_colliders_are_refused_by_name() {
    let sphere = |radius| ColliderShape::Sphere {
        center: DVec3::ZERO,
        radius,
    };
    let boxed = |half_extents, rotation| ColliderShape::Box {
        center: DVec3::ZERO,
        half_extents,
        rotation,
    };
    let mut table = vec![
        (
            "collider normal",
            ColliderShape::Plane {
                point: DVec3::ZERO,
                normal: DVec3::ZERO,
            },
        ),
        (
            "collider half_extents",
            boxed(dvec3(1.0, 0.0, 1.0), DQuat::IDENTITY),
        ),
        (
            "collider half_extents",
            boxed(dvec3(1.0, 1.0, f64::NAN), DQuat::IDENTITY),
        ),
        (
            "collider rotation",
            boxed(DVec3::ONE, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        ),
        (
            "collider center",
            ColliderShape::Sphere {
                center: DVec3::INFINITY,
                radius: 1.0,
            },
        ),
        (
            "collider end",
            ColliderShape::Capsule {
                ends: [DVec3::ZERO, DVec3::NAN],
                radius: 1.0,
            },
        ),
    ];
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        table.push(("collider radius", sphere(radius)));
        let ends = [DVec3::ZERO, DVec3::X];
        table.push(("collider radius", ColliderShape::Capsule { ends, radius }));
    }
    let mut colliders: Vec<(&str, Collider)> = table
        .into_iter()
        .map(|(what, shape)| (what, Collider::new(shape)))
        .collect();
    let velocity = DVec3::NAN;
    let good = Collider::new(sphere(1.0));
    colliders.push(("collider velocity", Collider { velocity, ..good }));
    for friction in [-1.0, f64::NAN] {
        colliders.push(("collider friction", Collider { friction, ..good }));
    }
    for (name, collider) in colliders {
        let settings = StepSettings {
            colliders: vec![good, collider],
            ..StepSettings::new(0.01)
        };
        let Err(XpbdError::Setting { what, .. }) = settings.check() else {
            panic!("{collider:?} is taken");
        };
        assert_eq!(what, name);
    }
}

/// A block on a plane tilted by `angle`: how far its center of mass has slid down after 0.5 s, and its speed.
fn slide(angle: f64, friction: f64) -> [f64; 2] {
    let turn = DQuat::from_rotation_y(angle);
    let mut mesh = kuhn_box([4, 4, 2], dvec3(0.4, 0.4, 0.2));
    mesh.positions.iter_mut().for_each(|x| *x = turn * *x);
    let damping = 2e-3;
    let mut solver = body::<f64>(&mesh, Material { damping, ..RUBBER });
    let plane = ColliderShape::Plane {
        point: DVec3::ZERO,
        normal: turn * DVec3::Z,
    };
    let mut settings = StepSettings {
        substeps: 4,
        gravity: Some(turn * GRAVITY),
        colliders: vec![Collider {
            friction,
            ..Collider::new(plane)
        }],
        ..StepSettings::new(4e-3)
    };
    let schedule = plain(&mesh);
    // It settles while gravity is straight into the plane.
    for _ in 0..150 {
        solver.step(&schedule, &settings).unwrap();
    }
    settings.gravity = Some(GRAVITY);
    let down = turn * DVec3::X;
    let mass: f64 = (0..solver.particle_count()).map(|p| solver.mass(p)).sum();
    let mean = |of: &dyn Fn(usize) -> DVec3| {
        let sum: DVec3 = (0..solver.particle_count())
            .map(|p| of(p) * solver.mass(p))
            .sum();
        sum.dot(down) / mass
    };
    let start = mean(&|p| solver.position(p));
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, DVec3::ZERO);
    }
    for _ in 0..125 {
        solver.step(&schedule, &settings).unwrap();
    }
    let mean = |of: &dyn Fn(usize) -> DVec3| {
        let sum: DVec3 = (0..solver.particle_count())
            .map(|p| of(p) * solver.mass(p))
            .sum();
        sum.dot(down) / mass
    };
    [
        mean(&|p| solver.position(p)) - start,
        mean(&|p| solver.velocity(p)),
    ]
}

/// Coulomb: it slides with `g (sin - μ cos)` where the tangent exceeds μ, and stays otherwise. The block shears by some
/// millimeters when the pull along the plane begins; what it slides in half a second is ten centimeters and more.
#[test]
fn a_block_slides_down_where_the_tangent_exceeds_the_friction() {
    for (angle, friction) in [(0.3f64, 0.1), (0.5, 0.3), (0.3, 0.0)] {
        let [way, speed] = slide(angle, friction);
        let acceleration = -GRAVITY.z * (angle.sin() - friction * angle.cos());
        within("speed", (speed / (acceleration * 0.5) - 1.0).abs(), 0.05);
        within("way", (way / (acceleration * 0.125) - 1.0).abs(), 0.1);
    }
    for (angle, friction) in [(0.3f64, 0.4), (0.5, 0.65)] {
        let [way, speed] = slide(angle, friction);
        within("way of one that sticks", way.abs(), 0.01);
        within("speed of one that sticks", speed.abs(), 0.01);
    }
}

/// A particle thrown from a ball's top without friction leaves the ball where energy says: at two thirds of the height
/// above the center. First order in the substep.
#[test]
fn a_particle_leaves_a_ball_at_two_thirds_of_its_height() {
    let leaves = |substeps: u32| {
        let mut solver = dust::<f64>(&[dvec3(0.01, 0.0, (1.0f64 - 1e-4).sqrt())]);
        let ball = ColliderShape::Sphere {
            center: DVec3::ZERO,
            radius: 1.0,
        };
        let settings = StepSettings {
            substeps,
            gravity: Some(GRAVITY),
            colliders: vec![Collider::new(ball)],
            ..StepSettings::new(1e-3)
        };
        while solver.position(0).length() < 1.0 + 1e-6 {
            step(&mut solver, &settings);
        }
        solver.position(0).z
    };
    within("height", (leaves(10) - 2.0 / 3.0).abs(), 0.01);
}

/// A soft ball on a hard one, on a capsule, on a turned box: it comes to rest, and nothing ever ends a frame inside.
fn rests<R: Real>(tolerance: f64) {
    let turned = DQuat::from_rotation_x(0.1) * DQuat::from_rotation_z(0.7);
    let shapes = [
        ColliderShape::Sphere {
            center: DVec3::NEG_Z * 10.0,
            radius: 10.0,
        },
        ColliderShape::Capsule {
            ends: [dvec3(-5.0, 0.01, -1.0), dvec3(5.0, 0.01, -1.0)],
            radius: 1.0,
        },
        ColliderShape::Box {
            center: DVec3::NEG_Z * 0.5,
            half_extents: dvec3(3.0, 2.0, 0.5),
            rotation: turned,
        },
    ];
    for shape in shapes {
        let mesh = kuhn_box([3, 3, 3], DVec3::splat(0.3));
        let damping = 2e-3;
        let mut solver = body::<R>(&mesh, Material { damping, ..RUBBER });
        for p in 0..solver.particle_count() {
            solver.set_position(p, solver.position(p) - dvec3(0.15, 0.15, -0.03));
        }
        let collider = Collider {
            friction: 0.8,
            ..Collider::new(shape)
        };
        let settings = StepSettings {
            substeps: 10,
            gravity: Some(GRAVITY),
            colliders: vec![collider],
            ..StepSettings::new(0.016)
        };
        let schedule = plain(&mesh);
        for _ in 0..300 {
            solver.step(&schedule, &settings).unwrap();
            for p in 0..solver.particle_count() {
                let depth = -collider.distance(solver.position(p)).0;
                within("depth", depth, tolerance);
            }
        }
        let height = (0..solver.particle_count())
            .map(|p| solver.position(p).z)
            .fold(f64::NEG_INFINITY, f64::max);
        assert!(height > 0.2, "{shape:?}: it fell to {height}");
        within("speed at the end", solver.max_speed(), 0.1);
    }
}

/// Particles are put on the surface; what remains is rounding of numbers of the size of 10 m.
#[test]
fn bodies_rest_on_every_shape_and_do_not_enter() {
    rests::<f64>(1e-14);
    rests::<f32>(4e-6);
}

/// Between two planes that make a groove a particle ends at the bottom, outside of both up to what is left after taking
/// turns: each turn leaves the square of the cosine of the angle between the normals.
#[test]
fn a_particle_in_a_groove_ends_outside_of_both_walls() {
    for tilt in [0.3f64, 0.8, 1.2] {
        let wall = |sign: f64| {
            let normal = dvec3(sign * tilt.sin(), 0.0, tilt.cos());
            let point = DVec3::ZERO;
            Collider::new(ColliderShape::Plane { point, normal })
        };
        let walls = [wall(1.0), wall(-1.0)];
        let mut noise = Noise(5);
        let start: Vec<DVec3> = (0..100).map(|_| noise.vector()).collect();
        let mut solver = dust::<f64>(&start);
        let settings = StepSettings {
            substeps: 4,
            gravity: Some(GRAVITY),
            colliders: walls.to_vec(),
            ..StepSettings::new(0.016)
        };
        for _ in 0..50 {
            step(&mut solver, &settings);
        }
        // 32 rounds leave cos(2 · 1.2)^64 or less of a depth below a meter, that is 1e-8.
        for p in 0..start.len() {
            for wall in walls {
                within("depth", -wall.distance(solver.position(p)).0, 1e-8);
            }
        }
    }
}

/// A moving wall takes particles along and hits its place at the end of the frame.
#[test]
fn a_moving_wall_pushes_and_drags() {
    let floor = Collider {
        friction: 10.0,
        velocity: dvec3(1.0, 0.0, 0.5),
        ..Collider::ground(0.0, 0.0)
    };
    let mut solver = dust::<f64>(&[DVec3::ZERO]);
    let mut settings = StepSettings {
        substeps: 5,
        gravity: Some(GRAVITY),
        colliders: vec![floor],
        ..StepSettings::new(0.01)
    };
    for frame in 1..=100 {
        step(&mut solver, &settings);
        settings.colliders[0] = settings.colliders[0].moved(0.01);
        within(
            "height",
            (solver.position(0).z - 0.005 * f64::from(frame)).abs(),
            1e-12,
        );
    }
    // Stuck to it but for the first substeps.
    within("dragged", (solver.position(0).x - 1.0).abs(), 0.02);
    within(
        "velocity",
        solver.velocity(0).distance(floor.velocity),
        1e-9,
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Anything finite at all, in single precision.
    #[test]
    fn any_collider_leaves_any_particle_finite(
        shapes in prop::collection::vec((shape(), -30..30i32, 0.0..1e3f64, point(1e3)), 1..4),
        particles in prop::collection::vec((point(1.0), -45..38i32), 1..20),
        gravity in -3..30i32,
    ) {
        let colliders = shapes.into_iter().map(|(shape, size, friction, velocity)| {
            let size = 10f64.powi(size);
            let shape = match shape {
                ColliderShape::Plane { point, normal } =>
                    ColliderShape::Plane { point: point * size, normal: normal * size },
                ColliderShape::Sphere { center, radius } =>
                    ColliderShape::Sphere { center: center * size, radius: radius * size },
                ColliderShape::Capsule { ends, radius } =>
                    ColliderShape::Capsule { ends: ends.map(|x| x * size), radius: radius * size },
                ColliderShape::Box { center, half_extents, rotation } =>
                    ColliderShape::Box { center: center * size, half_extents: half_extents * size, rotation },
            };
            Collider { shape, friction, velocity }
        });
        let start: Vec<DVec3> = particles.iter().map(|(x, size)| *x * 10f64.powi(*size)).collect();
        let mut solver = dust::<f32>(&start);
        let settings = StepSettings {
            substeps: 2,
            iterations: 2,
            gravity: Some(DVec3::NEG_Z * 10f64.powi(gravity)),
            colliders: colliders.collect(),
            ..StepSettings::new(0.1)
        };
        for _ in 0..3 {
            solver.step(&Schedule::default(), &settings).unwrap();
        }
        for p in 0..start.len() {
            prop_assert!(solver.position(p).is_finite() && solver.velocity(p).is_finite());
        }
    }
}

/// A particle that is inside from the start comes out at its depth over 20 ms, whatever the substep, and goes on at that
/// speed; what a moving collider adds to the depth is taken back in full.
fn comes_out_slowly<R: Real>(tolerance: f64) {
    const DEPTH: f64 = 0.04;
    let [point, normal] = [dvec3(0.3, 0.1, 0.2), dvec3(1.0, 2.0, 2.0) / 3.0];
    for (speed, substeps) in [(0.0, 1), (0.0, 20), (0.5, 5), (0.5, 20)] {
        let shape = ColliderShape::Plane { point, normal };
        let mut collider = Collider {
            velocity: normal * speed,
            ..Collider::new(shape)
        };
        let mut solver = dust::<R>(&[point - normal * DEPTH]);
        for frame in 1..=6 {
            let settings = StepSettings {
                substeps,
                colliders: vec![collider],
                ..StepSettings::new(0.01)
            };
            step(&mut solver, &settings);
            collider = collider.moved(0.01);
            let time = 0.01 * f64::from(frame);
            let (distance, _) = collider.distance(solver.position(0));
            let expected = DEPTH * (time / 0.02 - 1.0);
            within("distance", (distance - expected).abs(), tolerance);
        }
    }
}

#[test]
fn particles_inside_from_the_start_come_out_slowly() {
    comes_out_slowly::<f64>(1e-14);
    comes_out_slowly::<f32>(1e-6);
}
