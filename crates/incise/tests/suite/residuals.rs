//! How far each tet is from solved: the parts of the dual residual that a frame reports.

use incise::scene::{Method, Quantity, ReportSpec, SleepSpec, SolverSpec};
use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation};

/// A beam that is held and cut, and a box beside it; residuals every second frame.
fn two_bodies() -> Scene {
    let beam = body("beam", 300, [0.0, 0.0, 0.0]);
    let cube = body("box", 200, [0.0, 2.0, 0.0]);
    let plane = plane(2, [-0.1, 0.0, 0.0], [1.0, 0.2, 0.0]);
    scene(&format!(
        "[report]\nevery = 2\nquantities = [\"residual\"]\n[world]\ngravity = [0.0, 0.0, -9.81]\n\
         {beam}fixed = [{{ half_space = {{ point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n\
         {cube}{plane}"
    ))
}

/// The root of the sum of their squares, and the dual residual of the report.
fn sums(simulation: &Simulation) -> Option<[f64; 2]> {
    let of_tets = simulation.residuals_of_tets()?;
    assert_eq!(of_tets.len(), simulation.mesh().tets.len());
    let sum: f64 = of_tets.iter().map(|left| left * left).sum();
    Some([sum.sqrt(), simulation.report().residual?.dual?])
}

#[test]
fn residuals_of_tets_sum_up_to_the_dual_residual() {
    for solver in [
        SolverSpec::default(),
        SolverSpec::of(Method::Jacobi),
        SolverSpec::of(Method::Chebyshev),
    ] {
        let mut scene = two_bodies();
        scene.solver = solver;
        let mut simulation = simulation(&scene);
        assert!(simulation.residuals_of_tets().is_none());
        for frame in 0..6 {
            simulation.step().unwrap();
            let Some([sum, dual]) = sums(&simulation) else {
                assert!(frame % 2 == 1, "{frame}");
                continue;
            };
            assert!(frame % 2 == 0 && dual > 0.0, "{frame}: {dual}");
            // Sums of about a thousand squares in double precision, in another order.
            assert!((sum / dual - 1.0).abs() < 1e-12, "{sum} {dual}");
        }
        assert!(simulation.report().tets > 500);
    }
}

/// Tets of the box fall freely: what is left there is rounding. Those of the beam come first.
#[test]
fn residuals_have_the_order_of_the_tets() {
    let mut scene = two_bodies();
    scene.solver.precision = incise::scene::Precision::F64;
    let mut simulation = simulation(&scene);
    (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    let residuals = simulation.residuals_of_tets().unwrap();
    let mesh = simulation.mesh();
    let [mut beam, mut cube] = [0.0_f64; 2];
    for (left, tet) in residuals.iter().zip(&mesh.tets) {
        let y = mesh.positions[tet[0].index()].y;
        let of_body = if y < 1.0 { &mut beam } else { &mut cube };
        *of_body = of_body.max(*left);
    }
    // After the cut the numbers of both bodies' tets are mixed.
    assert!(beam > 1e-6 && cube < 1e-12, "{beam} {cube}");
}

#[test]
fn sleeping_bodies_have_no_residuals() {
    let mut scene = two_bodies();
    scene.report.every = 1;
    scene.world.gravity = None;
    scene.stroke.clear();
    scene.solver.sleep = Some(SleepSpec::new(10.0, 0.02));
    let mut simulation = simulation(&scene);
    (0..3).for_each(|_| assert!(simulation.step().is_ok()));
    assert!(simulation.report().residual.is_none(), "a body is awake");
    let residuals = simulation.residuals_of_tets().unwrap();
    assert!(residuals.len() >= 490 && residuals.iter().all(|left| *left == 0.0));
}

#[test]
fn residuals_are_dropped_with_outdated_settings() {
    let mut simulation = simulation(&two_bodies());
    simulation.step().unwrap();
    let then = simulation.residuals_of_tets();
    let snapshot = simulation.snapshot().unwrap();
    let report = ReportSpec::default();
    simulation.set_report(report).unwrap();
    assert_eq!(simulation.residuals_of_tets(), then, "that frame had them");
    simulation.step().unwrap();
    assert!(simulation.residuals_of_tets().is_none());
    simulation.restore(&snapshot).unwrap();
    assert!(then.is_some() && simulation.residuals_of_tets() == then);
    let iterations = SolverSpec::default().with(|spec| spec.iterations = 2);
    simulation.set_solver(&iterations).unwrap();
    assert!(simulation.residuals_of_tets().is_none());
    simulation.set_solver(&SolverSpec::of(Method::Vbd)).unwrap();
    let always = ReportSpec::default().with(|spec| spec.quantities = vec![Quantity::Residual]);
    simulation.set_report(always).unwrap();
    assert!(simulation.step().unwrap().residual.is_some());
    assert!(simulation.residuals_of_tets().is_none(), "vbd has none");
}
