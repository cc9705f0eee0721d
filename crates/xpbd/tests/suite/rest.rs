//! A body at rest stays there up to the documented kappa; above it, the documented behavior is checked.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetId, kuhn_box};
use incise_xpbd::{KappaLimit, Real, Solver, StepSettings, TetSolve};

use crate::body::{RUBBER, body, largest_distance, plain, positions, substep, within};

/// Length of a cell: 1 m would hide a mistake of units.
const CELL: f64 = 0.0625;

/// The largest displacement in cells after a substep, and the largest in `count` substeps.
fn drift<R: Real>(kappa: f64, count: usize) -> [f64; 2] {
    drift_of::<R>(TetSolve::Split, kappa, count)
}

fn drift_of<R: Real>(tet_solve: TetSolve, kappa: f64, count: usize) -> [f64; 2] {
    let mesh = kuhn_box([8, 2, 2], dvec3(8.0, 2.0, 2.0) * CELL);
    let mut solver = body::<R>(&mesh, RUBBER);
    let (schedule, settings) = (plain(&mesh), substep(&solver, kappa));
    let settings = StepSettings {
        tet_solve,
        ..settings
    };
    let start = positions(&solver);
    let mut largest = [0.0; 2];
    for n in 0..count {
        solver.step(&schedule, &settings).unwrap();
        let distance = largest_distance(&positions(&solver), &start) / CELL;
        largest[0] = if n == 0 { distance } else { largest[0] };
        largest[1] = f64::max(largest[1], distance);
    }
    largest
}

/// Up to kappa 1 the last digit is all that moves, for good.
#[test]
fn rest_is_kept_up_to_kappa_one() {
    for kappa in [1e-3, 1e-2, 1e-1, 0.5, 1.0] {
        // Measured at most 1.9e-16, 9.3e-16, 2.8e-8, 6.5e-7 of a cell.
        let [first, worst] = drift::<f64>(kappa, 1000);
        within(&format!("f64, kappa {kappa}, first"), first, 1e-15);
        within(&format!("f64, kappa {kappa}, all"), worst, 1e-13);
        let [first, worst] = drift::<f32>(kappa, 1000);
        within(&format!("f32, kappa {kappa}, first"), first, 1e-6);
        within(&format!("f32, kappa {kappa}, all"), worst, 1e-5);
    }
}

/// Between 1 and 2 the rest state is still bounded, but trembles: rounding is amplified by 1e4.
#[test]
fn rest_trembles_up_to_kappa_two() {
    for kappa in [1.5, 2.0] {
        // Measured at most 5e-12 and 2.1e-3 of a cell.
        within("f64", drift::<f64>(kappa, 1000)[1], 1e-10);
        within("f32", drift::<f32>(kappa, 1000)[1], 1e-2);
    }
}

/// The split form keeps a body at rest at any kappa. The block form is explicit in shear, so from kappa 4 on such a
/// body becomes unstable, cells moving by many of their lengths, from kappa 100 on in its first substep; it stays
/// finite.
#[test]
fn rest_is_kept_at_any_kappa_by_the_split_form_alone() {
    for kappa in [2.0, 4.0, 1e1, 1e2, 1e4, 1e6] {
        let [double, single] = [drift::<f64>(kappa, 1000)[1], drift::<f32>(kappa, 1000)[1]];
        within(&format!("f64, kappa {kappa}"), double, 1e-13);
        within(&format!("f32, kappa {kappa}"), single, 1e-4);
        if kappa >= 4.0 {
            for worst in [
                drift_of::<f64>(TetSolve::Block, kappa, 1000)[1],
                drift_of::<f32>(TetSolve::Block, kappa, 1000)[1],
            ] {
                assert!(worst.is_finite() && worst > 1.0, "kappa {kappa}: {worst}");
            }
        }
    }
}

/// The guard against that: tets softened to kappa 1 stay at rest where the unsoftened break up (see above), and it is
/// said what was softened. Without a limit nothing is.
#[test]
fn the_kappa_limit_keeps_a_stiff_body_at_rest() {
    let mesh = kuhn_box([8, 2, 2], dvec3(8.0, 2.0, 2.0) * CELL);
    let mut solver = body::<f32>(&mesh, RUBBER);
    let (schedule, settings) = (plain(&mesh), substep(&solver, 100.0));
    assert_eq!(solver.softened().tets, 0);

    let substep_time = settings.substep_time();
    solver.limit_kappa(Some(KappaLimit {
        kappa: 1.0,
        substep_time,
    }));
    for t in 0..solver.tet_count() {
        solver.replace_tet(t, solver.tet_particles(t), mesh.corners(TetId::new(t)));
    }
    let softened = solver.softened();
    assert_eq!(softened.tets, solver.tet_count());
    assert!((softened.volume_fraction - 1.0).abs() < 1e-12);
    assert!(
        (softened.strongest / 100.0 - 1.0).abs() < 1e-5,
        "{}",
        softened.strongest
    );

    let start = positions(&solver);
    for _ in 0..1000 {
        solver.step(&schedule, &settings).unwrap();
    }
    within(
        "drift",
        largest_distance(&positions(&solver), &start) / CELL,
        1e-5,
    );
}

/// One tet is solved exactly whatever the stiffness: both multipliers are the ones at rest and their pushes cancel.
/// The pushes themselves grow with kappa, so the rounding left is kappa times the last digit, here at most 4 times:
/// below 1e-6 of the tet up to kappa 2 in single precision, below 1e-13 up to kappa 100 in double precision. It is not
/// the solve that is lacking then, but the positions: two opposite pushes of kappa times the tet's size are added.
#[test]
fn one_tet_at_rest_is_solved_exactly_at_any_kappa() {
    for kappa in [1e-3, 1.0, 1e2, 1e3, 1e6] {
        within(
            "f64",
            tet_displacement::<f64>(kappa),
            4.0 * f64::EPSILON * f64::max(kappa, 1.0),
        );
        let epsilon = f64::from(f32::EPSILON);
        within(
            "f32",
            tet_displacement::<f32>(kappa),
            4.0 * epsilon * f64::max(kappa, 1.0),
        );
    }
}

/// The largest displacement of a corner of a unit tet at rest in one substep.
fn tet_displacement<R: Real>(kappa: f64) -> f64 {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mut solver = Solver::<R>::new(&rest);
    solver.add_material(RUBBER).unwrap();
    solver.push_tet([0, 1, 2, 3], rest, 0);
    for p in 0..4 {
        solver.set_mass(p, RUBBER.density / 24.0);
    }
    let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    let settings = substep(&solver, kappa);
    solver.step(&schedule, &settings).unwrap();
    largest_distance(&positions(&solver), &rest)
}
