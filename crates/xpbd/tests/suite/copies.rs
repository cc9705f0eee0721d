//! A copy of a solver continues bit-identically, and reports its size in bytes.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetId, kuhn_box};
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Collider, DistanceConstraint, Material, Method,
    Pose, Real, Solver, StepSettings, VbdSettings, VertexStars, VolumeConstraint,
};

use crate::body::{GRAVITY, RUBBER, body, disturb, plain};

/// A bar with every feature of a solver: held softly and rigidly, linked, with volumes, damped, fixed, softened.
fn everything<R: Real>() -> (Solver<R>, Schedule) {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let material = Material {
        damping: 1e-3,
        ..RUBBER
    };
    let mut solver = body::<R>(&mesh, material);
    let order = plain(&mesh);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.attach(0, handle, 0.0, 0.0).unwrap();
    solver.attach(1, handle, 1e-4, 0.01).unwrap();
    solver.set_fixed(2, true);
    let link = DistanceConstraint {
        particles: [3, 20],
        length: 0.1,
        compliance: 1e-5,
        damping: 0.0,
        tension_only: true,
    };
    let one = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    solver.set_distances(&[link], one).unwrap();
    let volumes: Vec<_> = (0..mesh.tets.len())
        .map(|t| {
            let rest = mesh.corners(TetId::new(t));
            VolumeConstraint::of_tet(mesh.tets[t].map(|p| p.0), rest, 1e-6)
        })
        .collect();
    solver.set_volumes(&volumes, order.clone()).unwrap();
    disturb(&mut solver, 0.01, 7);
    (solver, order)
}

/// Positions and velocities to the bit.
fn state<R: Real>(solver: &Solver<R>) -> Vec<[u64; 3]> {
    (0..solver.particle_count())
        .flat_map(|p| [solver.position(p), solver.velocity(p)])
        .map(|v| v.to_array().map(f64::to_bits))
        .collect()
}

fn goes_on<R: Real>(method: Method, iterations: u32) {
    let (mut solver, order) = everything::<R>();
    let settings = StepSettings {
        substeps: 2,
        iterations,
        method,
        relaxation: 0.2,
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(-0.02, 0.5)],
        ..StepSettings::new(2e-3)
    };
    let step = |solver: &mut Solver<R>, frame: u32| {
        solver.move_handle(0, Pose::at(DVec3::X * (1e-3 * f64::from(frame))));
        let report = solver.step_keeping_residuals(&order, &settings).unwrap();
        assert_eq!(report.repaired, 0);
    };
    (1..4).for_each(|frame| step(&mut solver, frame));
    let mut copy = solver.clone();
    let time = settings.substep_time();
    assert_eq!(copy.residuals(time), solver.residuals(time));
    assert_eq!(copy.residuals_of_tets(time), solver.residuals_of_tets(time));
    for frame in 4..7 {
        step(&mut solver, frame);
        step(&mut copy, frame);
        assert!(state(&solver) == state(&copy), "{method:?} {frame}");
    }
    copy.check_layout(&order).unwrap();
    // Nor do they share anything.
    let before = state(&solver);
    step(&mut copy, 7);
    assert!(state(&copy) != before && state(&solver) == before);
}

#[test]
fn a_copy_and_its_original_stay_bit_identical() {
    let chebyshev = Method::Chebyshev {
        spectral_radius: 0.9,
        chebyshev_start: 2,
    };
    for (method, iterations) in [
        (Method::GaussSeidel, 1),
        (Method::GaussSeidel, 3),
        (Method::Jacobi, 3),
        (chebyshev, 5),
    ] {
        goes_on::<f32>(method, iterations);
        goes_on::<f64>(method, iterations);
    }
}

/// A copy allocates the reported bytes, except for schedules and a few materials.
#[test]
fn the_reported_size_of_a_copy_is_right() {
    fn check<R: Real>() {
        let (solver, order) = everything::<R>();
        let mut copy = None;
        let asked = allocation_counter::measure(|| copy = Some(solver.clone()));
        let mut copied = None;
        let of_order = allocation_counter::measure(|| copied = Some(order.clone()));
        let bytes = i64::try_from(copy.unwrap().bytes()).unwrap();
        let rest = asked.bytes_current - bytes - of_order.bytes_current;
        // The schedule of the link and the one material.
        assert!((0..300).contains(&rest), "{rest} of {bytes}");
    }
    check::<f32>();
    check::<f64>();
}

#[test]
fn the_reported_size_of_vbd_state_is_right() {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut solver = body::<f32>(&mesh, RUBBER);
    let particles = u32::try_from(solver.particle_count()).unwrap();
    // No two particles have the same color, which is fine for few of them.
    let colors = Coloring::new((0..particles).map(ColorId).collect());
    let order = Schedule::new(&Clustering::none(particles as usize), &colors);
    let mut stars = VertexStars::new(&solver, &order).unwrap();
    let mut correction =
        CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
    let settings = VbdSettings::new(0.01, 2);
    solver
        .step_vbd_two_level(&mut stars, &mut correction, &settings)
        .unwrap();
    let mut copies = None;
    let asked = allocation_counter::measure(|| copies = Some((stars.clone(), correction.clone())));
    let bytes = i64::try_from(stars.bytes() + correction.bytes()).unwrap();
    assert_eq!(asked.bytes_current, bytes);
}
