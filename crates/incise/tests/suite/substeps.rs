//! Substeps chosen for each body: enough and no more, capped, not ruled by slivers, and all of it reported.

use incise::report::{BodyReport, Shortfall};
use incise::scene::{Precision, Substeps};
use incise::{Scene, Simulation, WarningCode};
use serde_json::Value;

use crate::support::{body, plane, scene, simulation, state};

const AUTO: &str = "[solver]\nsubsteps = \"auto\"\n";

fn with_modulus(body: &str, modulus: &str) -> String {
    body.replace("young_modulus = 1e4", &format!("young_modulus = {modulus}"))
}

fn bodies(simulation: &Simulation) -> &[BodyReport] {
    &simulation.report().bodies
}

/// A fine sphere and a stiff one next to it.
fn soft_and_stiff() -> [String; 2] {
    let stiff = body("sphere", 300, [0.0, 2.0, 0.0]);
    [body("sphere", 300, [0.0; 3]), with_modulus(&stiff, "1.6e5")]
}

#[test]
fn each_body_gets_the_fewest_sufficient_substeps() {
    let scene = scene(&format!("{AUTO}{}", soft_and_stiff().concat()));
    let simulation = simulation(&scene);
    let [soft, stiff] = bodies(&simulation) else {
        panic!("two bodies")
    };
    assert_eq!((&soft.bodies[..], &stiff.bodies[..]), (&[0][..], &[1][..]));
    for (number, report) in [soft, stiff].into_iter().enumerate() {
        let mut alone = scene.clone();
        alone.body = vec![scene.body[number].clone()];
        let choice = report.choice.unwrap();
        assert_eq!((choice.shortfall, choice.sliver_tets), (None, 0));
        assert_eq!(choice.substeps_wanted, report.substeps);
        // With the number itself kappa is low enough, with one fewer it is not.
        let kappa = |substeps: u32| {
            alone.solver.substeps = substeps.into();
            Simulation::with_threads(&alone, 1).unwrap().kappa()
        };
        let kappas = [report.substeps, report.substeps - 1].map(kappa);
        assert!(kappas[0] <= 0.5 && kappas[1] > 0.5, "{kappas:?}");
    }
    // Sixteen times as stiff is four times as many, but for rounding up.
    let quadruple = 4 * soft.substeps;
    assert!((quadruple - 3..=quadruple).contains(&stiff.substeps));
    assert!(simulation.kappa() <= 0.5);
}

#[test]
fn bodies_of_different_stiffness_move_to_the_bit_as_alone() {
    let world = "[world]\ngravity = [0.0, 0.0, -9.81]\nground = { height = -0.55 }\n";
    let run = |bodies: &str| {
        let mut simulation = simulation(&scene(&format!("{world}{AUTO}{bodies}")));
        (0..8).for_each(|_| drop(simulation.step().unwrap().clone()));
        simulation
    };
    let two = soft_and_stiff();
    let together = run(&two.concat());
    let alone = two.each_ref().map(|body| run(body));
    let joined: Vec<_> = alone.iter().flat_map(|s| s.positions().to_vec()).collect();
    assert!(together.positions() == joined);
    assert_ne!(bodies(&together)[0].substeps, bodies(&together)[1].substeps);
}

#[test]
fn a_body_may_name_its_own() {
    let two = [
        body("box", 200, [0.0; 3]) + "substeps = 3\n",
        body("box", 200, [0.0, 2.0, 0.0]) + "substeps = \"auto\"\n",
        body("box", 200, [0.0, 4.0, 0.0]),
    ];
    let of = |solver: &str| {
        let simulation = simulation(&scene(&format!("{solver}{}", two.concat())));
        let numbers = bodies(&simulation).iter();
        numbers
            .map(|body| (body.substeps, body.choice.is_some()))
            .collect::<Vec<_>>()
    };
    let chosen = of(AUTO)[2].0;
    assert_eq!(of(AUTO), [(3, false), (chosen, true), (chosen, true)]);
    assert_eq!(
        of("[solver]\nsubsteps = 9\n"),
        [(3, false), (chosen, true), (9, false)]
    );
}

#[test]
fn the_cap_is_kept_and_reported_and_the_result_finite() {
    for (modulus, precision) in [
        ("1e7", Precision::F32),
        ("1e12", Precision::F32),
        ("1e12", Precision::F64),
    ] {
        let sphere = with_modulus(&body("sphere", 200, [0.0; 3]), modulus);
        let mut scene = scene(&format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n{AUTO}method = \"gauss-seidel\"\nmax_substeps = 8\n{sphere}"
        ));
        scene.solver.precision = precision;
        let mut simulation = simulation(&scene);
        for _ in 0..4 {
            let report = simulation.step().unwrap();
            let body = &report.bodies[0];
            let choice = body.choice.unwrap();
            assert_eq!((body.substeps, choice.shortfall), (8, Some(Shortfall::Cap)));
            assert!(choice.substeps_wanted > 8);
            assert_eq!(report.repaired, 0);
        }
        assert!(simulation.positions().iter().all(|x| x.is_finite()));
        // Nothing is softened, and what the cap leaves undone is a warning.
        assert_eq!(simulation.softened().tets, 0);
        assert!(bodies(&simulation)[0].choice.unwrap().expected_error > 0.1);
    }
}

/// A box with one tet that was squeezed flat at the surface.
fn with_sliver(folder: &std::path::Path) -> String {
    use incise::mesh::glam::DVec3;
    let mut mesh = incise::mesh::kuhn_box([6, 6, 6], DVec3::ONE);
    // A flat tet on a face of the box: three of its corners and a point just outside.
    let surface = mesh.surface();
    let triangle = surface.triangles[0];
    let [a, b, c] = triangle.map(|p| mesh.positions[p.index()]);
    let normal = (b - a).cross(c - a).normalize();
    mesh.positions.push((a + b + c) / 3.0 + 1e-3 * normal);
    let tip = incise::mesh::ParticleId::new(mesh.positions.len() - 1);
    mesh.tets.push([triangle[0], triangle[1], triangle[2], tip]);
    mesh.orient_positively();
    incise::mesh_io::write(folder.join("sliver.vtk"), &mesh).unwrap();
    format!(
        "[[body]]\nmesh = {:?}\nyoung_modulus = 1e4\n",
        folder.join("sliver.vtk")
    )
}

#[test]
fn a_sliver_does_not_decide_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{AUTO}{}", with_sliver(folder.path()));
    let mut simulation = simulation(&scene(&text));
    let report = bodies(&simulation)[0].clone();
    let choice = report.choice.unwrap();
    assert_eq!(choice.shortfall, Some(Shortfall::Sliver));
    assert_eq!(choice.sliver_tets, 1);
    assert!(choice.sliver_volume_fraction > 0.0 && choice.sliver_volume_fraction < 1e-3);
    assert!(choice.substeps_wanted > 20 * report.substeps);
    // It is not softened, and the body rests all the same.
    assert_eq!(simulation.softened().tets, 0);
    let start = simulation.positions().to_vec();
    for _ in 0..5 {
        assert_eq!(simulation.step().unwrap().repaired, 0);
    }
    for (x, from) in simulation.positions().iter().zip(&start) {
        assert!(x.distance(*from) < 1e-5);
    }
}

fn cut_scene(report: &str, solver: &str) -> Scene {
    let cut = plane(1, [0.013, 0.0, 0.0], [1.0, 0.2, 0.0]);
    let bodies = body("sphere", 400, [0.0; 3]) + &body("sphere", 300, [3.0, 0.0, 0.0]);
    scene(&format!("{report}{solver}{bodies}{cut}"))
}

#[test]
fn a_cut_shows_what_it_did_to_kappa() {
    let report = "[report]\nquantities = [\"kappa\"]\n";
    let mut simulation = simulation(&cut_scene(report, AUTO));
    let before = simulation.step().unwrap().clone();
    assert!(
        before
            .bodies
            .iter()
            .all(|body| { body.kappa_before_cut.is_none() && body.kappa_of_new_tets.is_none() })
    );
    let cut = simulation.step().unwrap().clone();
    assert!(cut.cut.is_some());
    let body = &cut.bodies[0];
    assert!(body.substeps >= before.bodies[0].substeps);
    let ratio = f64::from(before.bodies[0].substeps) / f64::from(body.substeps);
    let kappa_before = before.bodies[0].kappa.unwrap() * ratio * ratio;
    assert!((body.kappa_before_cut.unwrap() / kappa_before - 1.0).abs() < 1e-12);
    assert!(before.bodies[0].choice.unwrap().expected_error <= 0.1);
    // Children are smaller than their parent, so the stiffest is a new one.
    assert!((body.kappa_of_new_tets.unwrap() / body.kappa.unwrap() - 1.0).abs() < 1e-12);
    assert!(body.kappa > body.kappa_before_cut);
    assert_eq!(body.softened.unwrap().tets, 0);
    assert_eq!(cut.kappa, body.kappa);
    // The other body was not met.
    assert_eq!(cut.bodies[1].kappa_before_cut, None);
    assert_eq!(cut.bodies[1].kappa, before.bodies[1].kappa);
    let after = simulation.step().unwrap();
    assert_eq!(after.bodies[0].kappa_before_cut, None);
    assert_eq!(after.bodies[0].substeps, body.substeps);
    simulation.check().unwrap();
}

#[test]
fn the_keys_of_a_body_are_the_promised_ones() {
    let keys = |scene: &Scene| {
        let mut simulation = simulation(scene);
        simulation.step().unwrap();
        let report = serde_json::to_value(simulation.step().unwrap()).unwrap();
        let bodies = report.get("bodies").cloned().unwrap_or(Value::Null);
        let Some(body) = bodies.get(0) else {
            return Vec::new();
        };
        let keys = body.as_object().unwrap().keys().cloned();
        let mut keys: Vec<String> = keys.collect();
        keys.sort_unstable();
        keys
    };
    let kappa = "[report]\nquantities = [\"kappa\"]\n";
    let mut asked = vec![
        "bodies",
        "kappa",
        "kappa_before_cut",
        "kappa_of_new_tets",
        "softened",
        "substeps",
    ];
    let choice = [
        "expected_error",
        "iterations",
        "method",
        "shortfall",
        "sliver_tets",
        "sliver_volume_fraction",
        "substeps_wanted",
    ];
    let five = "[solver]\nsubsteps = 5\n";
    assert_eq!(keys(&cut_scene("", five)), Vec::<String>::new());
    assert_eq!(keys(&cut_scene(kappa, five)), asked);
    asked.extend(choice);
    asked.sort_unstable();
    assert_eq!(keys(&cut_scene(kappa, AUTO)), asked);
    let mut chosen = vec!["bodies", "kappa_of_new_tets", "substeps"];
    chosen.extend(choice);
    chosen.sort_unstable();
    assert_eq!(keys(&cut_scene("", AUTO)), chosen);
}

/// A chosen number gives what the same number gives when it is named.
#[test]
fn auto_is_the_number_it_chooses() {
    let mut named = cut_scene("", AUTO);
    // Cuts may raise a chosen number, but no named one.
    named.stroke.clear();
    let mut auto = simulation(&named);
    for (body, report) in named.body.iter_mut().zip(bodies(&auto)) {
        body.substeps = Some(Substeps::Fixed(report.substeps));
    }
    let mut named = simulation(&named);
    for _ in 0..4 {
        auto.step().unwrap();
        named.step().unwrap();
    }
    assert!(state(&auto) == state(&named));
}

/// A stiff body that is fixed throughout does not move, so it asks for nothing.
#[test]
fn a_fixed_body_asks_for_no_substeps() {
    let fixed = |region: &str| {
        let stiff = with_modulus(&body("box", 200, [0.0; 3]), "1e9");
        let scene = scene(&format!("{AUTO}{stiff}fixed = [{region}]\n"));
        let mut simulation = simulation(&scene);
        let report = simulation.step().unwrap();
        let (choice, warnings) = (report.bodies[0].choice.unwrap(), report.warnings().len());
        (choice, warnings, simulation.kappa())
    };
    let all = "{ half_space = { point = [9, 0, 0], normal = [-1, 0, 0] } }";
    let (choice, warnings, kappa) = fixed(all);
    assert_eq!((choice.substeps_wanted, choice.shortfall), (1, None));
    assert_eq!((choice.expected_error, warnings, kappa), (0.0, 0, 0.0));
    // Half of it can move.
    let half = "{ half_space = { point = [0, 0, 0], normal = [-1, 0, 0] } }";
    let (choice, warnings, kappa) = fixed(half);
    assert!(choice.substeps_wanted > 100, "{choice:?}");
    assert!(warnings > 0 && kappa > 0.5);
}

/// A cut leaves tets that need five times the substeps of the start, and cuts at most double them: the report has the error
/// of the number taken, and the warning names a setting that helps.
#[test]
fn limited_growth_after_a_cut_is_reported() {
    let text = r#"
        [world]
        gravity = [0.0, 0.0, -9.81]
        [[body]]
        shape = { kind = "box", tets = 1500 }
        scale = 0.2
        young_modulus = 5e4
        [[stroke]]
        kind = "plane"
        frame = 1
        point = [0.0, 0.0, 0.02]
        normal = [0.2, 0.1, 1.0]
    "#;
    let mut simulation = simulation(&Scene::from_toml(text).unwrap());
    let before = simulation.step().unwrap().bodies[0].clone();
    assert_eq!(before.choice.unwrap().shortfall, None);
    let report = simulation.step().unwrap();
    let (after, choice) = (&report.bodies[0], report.bodies[0].choice.unwrap());
    assert_eq!(after.substeps, 2 * before.substeps);
    assert!(choice.substeps_wanted > after.substeps);
    assert_eq!(choice.shortfall, Some(Shortfall::Growth));
    assert!(choice.expected_error > 0.1, "{choice:?}");
    // One warning, with the volume of these tets: most of the body is solved as well as before.
    let codes: Vec<_> = report.warnings().iter().map(|w| w.code).collect();
    assert_eq!(codes, [WarningCode::OutsideAccuracy]);
    let [warning] = report.warnings() else {
        unreachable!("one code")
    };
    assert!(warning.message.contains("set substeps = "), "{warning}");
    assert!(!warning.message.contains("max_substeps"), "{warning}");
}
