//! Residuals: how well a step has solved its equations.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::kuhn_box;
use incise_xpbd::{Real, Residuals, Solver, StepSettings, TetSolve};

use crate::body::{GRAVITY, RUBBER, body, disturb, plain, substep, within};

/// The residuals of one disturbed substep with that many iterations.
fn residuals(kappa: f64, iterations: u32) -> Residuals {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let mut solver = body::<f64>(&mesh, RUBBER);
    disturb(&mut solver, 0.05, 11);
    let settings = StepSettings {
        iterations,
        ..substep(&solver, kappa)
    };
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    solver.residuals(settings.substep_time()).unwrap()
}

/// Iterating solves for the constraints alone. Measured at kappa 0.3: the dual residual falls to 1e-14 of what two
/// iterations leave, the primal one stays where it is to four digits. That is XPBD's missing half, and why substeps
/// are the way to accuracy.
#[test]
fn iterations_drive_the_dual_residual_to_zero_but_not_the_primal_one() {
    let runs = [2, 8, 32, 128].map(|n| residuals(0.3, n));
    for pair in runs.windows(2) {
        within("dual", pair[1].dual / pair[0].dual, 0.1);
    }
    within("dual in the end", runs[3].dual / runs[0].dual, 1e-13);
    within("primal", (runs[3].primal / runs[0].primal - 1.0).abs(), 0.1);
}

#[test]
fn residuals_exist_only_after_a_step_that_keeps_them() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let mut solver = body::<f32>(&mesh, RUBBER);
    let settings = StepSettings {
        iterations: 3,
        gravity: Some(GRAVITY),
        ..substep(&solver, 0.3)
    };
    let time = settings.substep_time();
    assert_eq!(solver.residuals(time), None);
    solver.step(&plain(&mesh), &settings).unwrap();
    assert_eq!(solver.residuals(time), None);
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    assert!(solver.residuals(time).is_some());
    solver.step(&plain(&mesh), &settings).unwrap();
    assert_eq!(solver.residuals(time), None);
    // A cut makes them stale: there are more particles than were kept.
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    solver.push_copy(0);
    assert_eq!(solver.residuals(time), None);
}

/// Keeping residuals costs memory and time, never a different result.
#[test]
fn keeping_residuals_does_not_change_the_step() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    for (substeps, iterations) in [(1, 1), (3, 1), (2, 4)] {
        let run = |keep: bool| {
            let mut solver = body::<f32>(&mesh, RUBBER);
            disturb(&mut solver, 0.05, 12);
            let settings = StepSettings {
                substeps,
                iterations,
                gravity: Some(GRAVITY),
                ..substep(&solver, 0.3)
            };
            let step = if keep {
                Solver::step_keeping_residuals
            } else {
                Solver::step
            };
            step(&mut solver, &plain(&mesh), &settings).unwrap();
            crate::body::positions(&solver)
        };
        assert_eq!(run(false), run(true));
    }
}

/// A step from rest without forces has nothing left of either.
#[test]
fn rest_has_no_residuals() {
    let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
    let mut solver = body::<f64>(&mesh, RUBBER);
    let settings = substep(&solver, 0.3);
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    let residuals = solver.residuals(settings.substep_time()).unwrap();
    within("dual", residuals.dual, 1e-12);
    within("primal", residuals.primal, 1e-12);
}

/// A disturbed body whose particles at x = 0 are held, after one substep that keeps its residuals.
fn kept<R: Real>(kappa: f64, iterations: u32) -> (Solver<R>, f64) {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.005, 11);
    for p in 0..mesh.positions.len() {
        solver.set_fixed(p, mesh.positions[p].x == 0.0);
    }
    let settings = StepSettings {
        iterations,
        gravity: Some(GRAVITY),
        ..substep(&solver, kappa)
    };
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    (solver, settings.substep_time())
}

/// The slope of the potential at every particle that moves: central differences, positions put back to the bit.
fn slope<R: Real>(solver: &mut Solver<R>, time: f64, step: f64) -> Vec<DVec3> {
    let mut slopes = Vec::new();
    for p in (0..solver.particle_count())
        .filter(|&p| !solver.is_fixed(p))
        .collect::<Vec<_>>()
    {
        let x = solver.position(p);
        let slope = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let [low, high] = [-step, step].map(|s| {
                solver.set_position(p, x + axis * s);
                let at = solver.position(p).dot(axis);
                (at, solver.residuals(time).unwrap().potential)
            });
            (high.1 - low.1) / (high.0 - low.0)
        });
        solver.set_position(p, x);
        slopes.push(DVec3::from_array(slope));
    }
    slopes
}

fn length(vectors: &[DVec3]) -> f64 {
    vectors
        .iter()
        .map(|v| v.length_squared())
        .sum::<f64>()
        .sqrt()
}

/// Steps of 1e-6 m against tets of 0.1 m leave 1e-10 of truncation and 1e-16 / 1e-5 of rounding. In single precision a
/// step must be many last digits long, and 1e-3 m leave 1e-4 of truncation.
#[test]
fn the_force_residual_is_the_slope_of_the_potential() {
    for kappa in [0.01, 1.0, 100.0] {
        let (mut solver, time) = kept::<f64>(kappa, 3);
        let force = solver.residuals(time).unwrap().force;
        let slope = length(&slope(&mut solver, time, 1e-6));
        within("f64", (slope / force - 1.0).abs(), 1e-8);
        let (mut solver, time) = kept::<f32>(kappa, 3);
        let force = solver.residuals(time).unwrap().force;
        let slope = length(&self::slope(&mut solver, time, 1e-3));
        within("f32", (slope / force - 1.0).abs(), 1e-3);
    }
}

/// The elastic part of the potential is the elastic energy that the body reports; where nothing was corrected, that is
/// all there is.
#[test]
fn the_potential_is_inertia_and_elastic_energy() {
    let (solver, time) = kept::<f64>(0.3, 1);
    let potential = solver.residuals(time).unwrap().potential;
    let elastic = solver.energy(None).elastic;
    assert!(0.0 < elastic && elastic < potential);
    // The corrections moved each particle by Δt times the change of its speed beyond gravity's.
    let inertia: f64 = (0..solver.particle_count())
        .filter(|&p| !solver.is_fixed(p))
        .map(|p| 0.5 * solver.mass(p) * (solver.velocity(p) - GRAVITY * time).length_squared())
        .sum();
    within("sum", (potential / (elastic + inertia) - 1.0).abs(), 1e-10);
}

/// A step that is solved: the free corner of a box is moved to where the slope of the potential is zero, by Newton's
/// method on differences of the potential alone. There the force residual is, too: measured 4e-12 of what XPBD left.
#[test]
fn a_solved_step_has_no_force_residual() {
    let mesh = kuhn_box([1, 1, 1], DVec3::splat(0.1));
    let mut solver = body::<f64>(&mesh, RUBBER);
    (1..8).for_each(|p| solver.set_fixed(p, true));
    solver.set_position(0, dvec3(-0.03, 0.02, -0.01));
    let settings = StepSettings {
        gravity: Some(GRAVITY),
        tet_solve: TetSolve::Block,
        ..substep(&solver, 30.0)
    };
    let time = settings.substep_time();
    solver
        .step_keeping_residuals(&plain(&mesh), &settings)
        .unwrap();
    let before = solver.residuals(time).unwrap();
    for _ in 0..50 {
        let x = solver.position(0);
        let gradient = slope(&mut solver, time, 1e-6)[0];
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            solver.set_position(0, x + axis * 1e-6);
            let high = slope(&mut solver, time, 1e-6)[0];
            solver.set_position(0, x);
            (high - gradient) / 1e-6
        });
        let curvature = glam::DMat3::from_cols(columns[0], columns[1], columns[2]);
        solver.set_position(0, x - curvature.inverse() * gradient);
    }
    let after = solver.residuals(time).unwrap();
    let load = solver.load(GRAVITY);
    assert!(before.force > 100.0 * load);
    within("force", after.force / before.force, 1e-6);
    within("potential", after.potential, before.potential);
}

/// A body crushed by iterating a step far too large satisfies its constraints, without a third of its volume.
/// The dual residual calls that solved; the force residual does not: a thousand times the weight is missing.
#[test]
fn a_collapsed_body_cannot_hide_from_the_force_residual() {
    let mesh = kuhn_box([8, 2, 2], dvec3(0.5, 0.125, 0.125));
    let mut solver = body::<f64>(&mesh, RUBBER);
    for p in 0..mesh.positions.len() {
        solver.set_fixed(p, mesh.positions[p].x == 0.0);
    }
    let settings = StepSettings {
        gravity: Some(GRAVITY),
        tet_solve: TetSolve::Block,
        ..StepSettings::new(1.0 / 60.0)
    };
    for iterations in [100, 100, 100, 3000] {
        let settings = StepSettings {
            iterations,
            ..settings.clone()
        };
        solver
            .step_keeping_residuals(&plain(&mesh), &settings)
            .unwrap();
    }
    let residuals = solver.residuals(settings.substep_time()).unwrap();
    let volume = solver.volume();
    // Measured 0.70, 4e-9 and 2560 times the weight.
    within("volume", volume.total / volume.rest, 0.8);
    within("dual", residuals.dual_rms, 1e-6);
    assert!(residuals.force > 1000.0 * solver.load(GRAVITY));
}

/// One iteration of a substep is a step of backward Euler up to a part of the order of kappa. Measured with half the
/// kappa each time: 0.72, 0.64, 0.58, 0.54 of the force residual.
#[test]
fn the_force_residual_of_a_substep_vanishes_with_kappa() {
    let left = [0.1, 0.05, 0.025, 0.0125, 0.00625].map(|kappa| {
        let (solver, time) = kept::<f64>(kappa, 1);
        solver.residuals(time).unwrap().force
    });
    for pair in left.windows(2) {
        within("half the kappa", pair[1] / pair[0], 0.8);
    }
    within("in the end", left[4] / left[3], 0.6);
}

/// Root mean square, sum and number of constraints are consistent.
#[test]
fn the_mean_of_the_dual_residual_counts_constraints() {
    let (solver, time) = kept::<f64>(0.3, 1);
    let residuals = solver.residuals(time).unwrap();
    let count = 2.0 * solver.tet_count() as f64;
    within(
        "mean",
        (residuals.dual_rms * count.sqrt() / residuals.dual - 1.0).abs(),
        1e-14,
    );
}

/// Positions at the limit of what a double holds: the residuals are the largest double, not infinite.
#[test]
fn residuals_too_large_to_represent_are_the_largest_double() {
    let (mut solver, time) = kept::<f64>(0.3, 1);
    (20..30).for_each(|p| solver.set_position(p, DVec3::splat(1e300) * p as f64));
    let residuals = solver.residuals(time).unwrap();
    assert_eq!((residuals.force, residuals.potential), (f64::MAX, f64::MAX));
    assert_eq!((residuals.dual, residuals.primal), (f64::MAX, f64::MAX));
}

/// A tet too flat to take part has no energy, whatever its corners do, and what is held does not count as load.
#[test]
fn skipped_tets_are_not_measured() {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y];
    let mut solver = Solver::<f64>::new(&rest);
    let rubber = solver.add_material(RUBBER).unwrap();
    solver.push_tet([0, 1, 2, 3], rest, rubber);
    solver.set_position(3, DVec3::ONE);
    assert_eq!(solver.energy(None).elastic, 0.0);
    assert_eq!(solver.load(GRAVITY), 0.0);
    (0..4).for_each(|p| solver.set_mass(p, 2.0));
    solver.set_fixed(0, true);
    within(
        "load",
        (solver.load(DVec3::X) - 12.0_f64.sqrt()).abs(),
        1e-14,
    );
}

/// The parts of the dual residual: they sum up to it, and are there when it is.
#[test]
fn residuals_of_tets_are_the_parts_of_the_dual_one() {
    fn check<R: Real>() {
        let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
        let mut solver = body::<R>(&mesh, RUBBER);
        disturb(&mut solver, 0.05, 13);
        let settings = substep(&solver, 0.3);
        let time = settings.substep_time();
        assert_eq!(solver.residuals_of_tets(time), None);
        solver
            .step_keeping_residuals(&plain(&mesh), &settings)
            .unwrap();
        let of_tets = solver.residuals_of_tets(time).unwrap();
        assert_eq!(of_tets.len(), mesh.tets.len());
        assert!(of_tets.iter().all(|&left| left > 0.0));
        let dual = solver.residuals(time).unwrap().dual;
        let sum: f64 = of_tets.iter().map(|left| left * left).sum();
        // Both are sums of 96 squares in double precision, in another order.
        within("sum", (sum.sqrt() / dual - 1.0).abs(), 1e-13);
        solver.step(&plain(&mesh), &settings).unwrap();
        assert_eq!(solver.residuals_of_tets(time), None);
    }
    check::<f32>();
    check::<f64>();
}

/// A tet too flat to take part has nothing left, whatever its corners do; one that alone is pulled has all.
#[test]
fn only_tets_that_take_part_have_residuals() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let far = corners.map(|x| x + 5.0 * DVec3::X);
    let mut solver = Solver::<f64>::new(&[corners, far].concat());
    solver.add_material(RUBBER).unwrap();
    solver.push_tet([0, 1, 2, 3], corners, 0);
    solver.push_tet([4, 5, 6, 7], far, 0);
    // The same particles, flat at rest.
    solver.push_tet(
        [0, 1, 2, 3],
        [corners[0], corners[1], corners[2], dvec3(1.0, 1.0, 0.0)],
        0,
    );
    (0..8).for_each(|p| solver.set_mass(p, 40.0));
    solver.set_position(3, 2.0 * DVec3::Z);
    let colors = Coloring::new([0, 0, 1].map(ColorId).to_vec());
    let schedule = Schedule::new(&Clustering::none(3), &colors);
    let settings = StepSettings::new(1e-3);
    solver.step_keeping_residuals(&schedule, &settings).unwrap();
    let of_tets = solver.residuals_of_tets(settings.substep_time()).unwrap();
    // The one at rest is solved to rounding, 1e-16 times a few operations.
    assert!(of_tets[0] > 1e-6 && of_tets[1] < 1e-12, "{of_tets:?}");
    assert_eq!(of_tets[2], 0.0);
}
