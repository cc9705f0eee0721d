//! Closed forms, asked of whole scenes.

use incise::mesh::glam::{DVec3, dvec3};
use incise::scene::Precision;

use crate::support::{body, plane, scene, simulation};

#[test]
fn a_body_in_free_fall_follows_the_closed_form() {
    for (precision, tolerance) in [(Precision::F32, 2e-5), (Precision::F64, 1e-11)] {
        let mut scene = scene(&format!(
            "[world]\ngravity = [0.3, -0.2, -9.81]\n[report]\nquantities = [\"speed\", \"energy\"]\n{}",
            body("sphere", 300, [1.0, 2.0, 3.0])
        ));
        scene.solver.precision = precision;
        let substeps = 5;
        scene.solver.substeps = substeps.into();
        let mut simulation = simulation(&scene);
        let start = simulation.positions().to_vec();
        let substep = scene.solver.time_step / f64::from(substeps);
        for frame in 1..=20_u32 {
            let report = simulation.step().unwrap().clone();
            // Symplectic Euler: after n substeps of length h the way is g h² n (n + 1) / 2.
            let n = f64::from(frame * substeps);
            let way = 0.5 * substep * substep * n * (n + 1.0);
            let gravity = dvec3(0.3, -0.2, -9.81);
            for (x, from) in simulation.positions().iter().zip(&start) {
                let error = (*x - (*from + gravity * way)).length();
                assert!(error < tolerance, "{precision:?} frame {frame}: {error}");
            }
            let speed = gravity.length() * n * substep;
            assert!((report.max_speed.unwrap() - speed).abs() < 100.0 * tolerance * speed);
        }
    }
}

#[test]
fn without_forces_nothing_moves() {
    let mut scene = scene(&body("torus", 400, [0.0, 0.0, 0.0]));
    scene.solver.precision = Precision::F64;
    let mut simulation = simulation(&scene);
    let start = simulation.positions().to_vec();
    for _ in 0..10 {
        simulation.step().unwrap();
    }
    for (x, from) in simulation.positions().iter().zip(&start) {
        assert!((*x - *from).length() < 1e-12);
    }
}

#[test]
fn the_ground_stops_a_falling_body() {
    let mut simulation = simulation(&scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.55, friction = 0.5 }}\n{}damping = 0.002\n",
        body("box", 300, [0.0, 0.0, 0.0])
    )));
    for _ in 0..40 {
        simulation.step().unwrap();
        let lowest = simulation
            .positions()
            .iter()
            .map(|x| x.z)
            .fold(f64::INFINITY, f64::min);
        assert!(lowest >= -0.55 - 1e-6, "{lowest}");
    }
    let highest = simulation
        .positions()
        .iter()
        .map(|x| x.z)
        .fold(f64::NEG_INFINITY, f64::max);
    assert!(highest > 0.0, "the box has collapsed to {highest}");
}

/// A half that is cut loose falls, the half that is held stays.
#[test]
fn separated_pieces_fall() {
    let mut scene = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{}{}",
        body("box", 500, [0.0, 0.0, 0.0]),
        "fixed = [{ half_space = { point = [-0.2, 0, 0], normal = [-1, 0, 0] } }]\n",
        plane(0, [0.11, 0.0, 0.0], [1.0, 0.0, 0.0])
    ));
    // At 10 kPa it would sag by as much as it is long.
    scene.body[0].young_modulus = 1e5;
    let mut simulation = simulation(&scene);
    for _ in 0..30 {
        simulation.step().unwrap();
    }
    let pieces = simulation.mesh().pieces();
    assert_eq!(pieces.count, 2);
    let mut lowest = [f64::INFINITY; 2];
    let mut highest = [f64::NEG_INFINITY; 2];
    for (t, tet) in simulation.mesh().tets.iter().enumerate() {
        let piece = pieces.labels[t] as usize;
        for p in tet {
            let z = simulation.positions()[p.index()].z;
            lowest[piece] = lowest[piece].min(z);
            highest[piece] = highest[piece].max(z);
        }
    }
    lowest.sort_by(f64::total_cmp);
    highest.sort_by(f64::total_cmp);
    // After 0.48 s the way is 1.13 m.
    assert!(highest[0] < -0.4, "the loose half hangs at {highest:?}");
    assert!(lowest[1] > -0.7, "the held half fell to {lowest:?}");
}

/// A free body that spins about an axis of inertia keeps `1 / √(1 + 2 ω² Δt t)` of its angular momentum. Its velocity is
/// the chord of the last substep, by an angle θ: the next one turns it by `atan(sin θ / (2 - cos θ)) = θ (1 - θ²)` to
/// third order.
#[test]
fn spinning_bodies_slow_down_by_the_closed_form() {
    let (speed, frame, frames) = (6.0, 0.016, 500);
    let kept = |keys: &str| {
        let mut simulation = simulation(&scene(&format!(
            "[solver]\ntime_step = {frame}\nprecision = \"f64\"\n{keys}\n[report]\nquantities = [\"energy\"]\n\
             [[body]]\nshape = {{ kind = \"beam\", tets = 200 }}\nscale = 0.2\nyoung_modulus = 1e6\n"
        )));
        let mesh = simulation.mesh();
        let sum: DVec3 = mesh.positions.iter().sum();
        let center = sum / mesh.positions.len() as f64;
        let axis = DVec3::Z * speed;
        simulation
            .set_velocities(|x| axis.cross(x - center))
            .unwrap();
        let mut kinetic = Vec::new();
        for _ in 0..frames {
            let report = simulation.step().unwrap();
            kinetic.push(report.energy.unwrap().kinetic);
        }
        // The body turns nearly as a rigid one: the energy goes with the square of its angular momentum.
        (kinetic[frames - 1] / kinetic[0]).sqrt()
    };
    for substeps in [5, 20] {
        let substep = frame / f64::from(substeps);
        let left = |time: f64| 1.0 / (1.0 + 2.0 * speed * speed * substep * time).sqrt();
        let expected = left(frame * frames as f64) / left(frame);
        let kept = kept(&format!("substeps = {substeps}"));
        assert!(
            (kept / expected - 1.0).abs() < 0.02,
            "{substeps}: {kept} for {expected}"
        );
    }
}
