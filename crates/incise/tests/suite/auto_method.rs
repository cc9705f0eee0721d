//! What `method = "auto"` and `budget_ms` choose, and what follows from it.

use incise::report::{ChosenMethod, Shortfall};
use incise::scene::{ContactSpec, GroundSpec, Method, Precision};
use incise::{Scene, Simulation, Warning, WarningCode};

use crate::support::{body, plane, scene, simulation, state};

/// A held beam of a stiffness in gravity, with keys of `[solver]`.
fn beam(modulus: &str, keys: &str) -> Scene {
    scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n[solver]\ntime_step = 0.01\n{keys}\n\
         [[body]]\nshape = {{ kind = \"beam\", tets = 300 }}\nscale = 0.4\nyoung_modulus = {modulus}\n\
         poisson_ratio = 0.45\n\
         fixed = [{{ half_space = {{ point = [-0.19, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n"
    ))
}

fn chosen(simulation: &Simulation) -> (ChosenMethod, u32, u32) {
    let body = &simulation.report().bodies[0];
    (
        body.method.unwrap(),
        body.substeps,
        body.iterations.unwrap(),
    )
}

fn lowest(simulation: &Simulation) -> f64 {
    let heights = simulation.positions().iter().map(|x| x.z);
    heights.fold(f64::INFINITY, f64::min)
}

#[test]
fn stiff_bodies_are_solved_by_vbd_and_soft_ones_are_not() {
    let soft = simulation(&beam("1e4", ""));
    assert_eq!(soft.report().precision, "f32");
    let (method, substeps, iterations) = chosen(&soft);
    assert_eq!((method, iterations), (ChosenMethod::GaussSeidel, 1));
    assert!(substeps > 1 && substeps < 200);
    let mut stiff = simulation(&beam("1e9", ""));
    assert_eq!(chosen(&stiff), (ChosenMethod::TwoLevelVbd, 1, 20));
    let choice = stiff.report().bodies[0].choice.unwrap();
    assert_eq!(choice.shortfall, None);
    assert!(choice.substeps_wanted > 200 && choice.expected_error <= 0.1);
    let report = stiff.step().unwrap();
    assert_eq!(report.precision, "f64");
    let codes: Vec<_> = report.warnings().iter().map(|w| w.code).collect();
    assert_eq!(codes, [WarningCode::VibrationsDamped]);
}

/// A beam of jelly in weak gravity moves by less than single precision resolves in a substep, which the same beam does not
/// in earth's.
#[test]
fn weak_gravity_takes_double_precision() {
    let mut scene = beam("1e4", "accuracy = 0.1");
    let precision = |scene: &Scene| {
        let mut simulation = simulation(scene);
        simulation.step().unwrap().precision
    };
    assert_eq!(precision(&scene), "f32");
    scene.world.gravity = Some([0.0, 0.0, -0.005]);
    assert_eq!(precision(&scene), "f64");
}

/// A stiff body hits the ground in a frame that VBD does not solve in its rounds: the body gains no energy, and a scene
/// that names an accuracy is told.
#[test]
fn an_impact_unsolved_by_vbd_is_reported() {
    let mut simulation = simulation(&scene(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = { height = 0.0, friction = 0.3 }\n\
         [solver]\ntime_step = 0.01\nmethod = \"vbd\"\ntwo_level = true\naccuracy = 0.05\n\
         integrator = \"implicit-euler\"\n[report]\nquantities = [\"energy\"]\n\
         [[body]]\nshape = { kind = \"liver\", tets = 1500 }\nscale = 0.1\nyoung_modulus = 1e8\n\
         poisson_ratio = 0.3\nposition = [0.0, 0.0, 0.2]\n",
    ));
    let (mut last, mut told) = (f64::INFINITY, false);
    for frame in 0..30 {
        let report = simulation.step().unwrap();
        let energy = report.energy.unwrap();
        let now = energy.kinetic + energy.elastic + energy.gravity;
        // The rounds end at an error of 5%, so a little of what was lost may come back.
        assert!(now < last + 1e-4, "{frame}: {now} after {last}");
        last = now;
        assert_eq!(report.precision, "f64");
        let codes = report.warnings().iter().map(|w| w.code);
        let warns = codes
            .into_iter()
            .any(|code| code == WarningCode::NotConverged);
        assert!(
            !warns || frame > 10,
            "in free fall there is nothing to solve"
        );
        told |= warns;
    }
    assert!(told);
}

/// Numbers and methods that a scene names are kept.
#[test]
fn named_keys_are_not_overridden() {
    for keys in [
        "substeps = 5",
        "method = \"gauss-seidel\"",
        "iterations = 2",
        "tet_solve = \"block\"",
        "kappa_limit = 1.0",
        "relaxation = 0.9",
    ] {
        let mut simulation = simulation(&beam("1e9", keys));
        let report = simulation.step().unwrap();
        let vbd =
            |body: &incise::report::BodyReport| body.method == Some(ChosenMethod::TwoLevelVbd);
        assert!(!report.bodies.iter().any(vbd), "{keys}");
    }
    let mut grounded = beam("1e9", "");
    grounded.world.ground = Some(GroundSpec::default().with(|spec| {
        spec.height = -1.0;
        spec.friction = 0.0;
    }));
    assert_eq!(
        chosen(&simulation(&grounded)).0,
        ChosenMethod::GaussSeidel,
        "colliders"
    );
    let mut own = beam("1e9", "");
    own.body[0].substeps = Some(7.into());
    assert!(simulation(&own).report().bodies.is_empty());
}

/// The settled sag of a stiff beam by the chosen method is that of VBD with many rounds, to 1%; and the choice is to the bit
/// the method that it names.
#[test]
fn the_choice_is_accurate_at_rest() {
    let settle = |keys: &str| {
        let mut scene = beam("1e8", keys);
        scene.body[0].damping = 0.01;
        let mut simulation = simulation(&scene);
        let before = lowest(&simulation);
        (0..60).for_each(|_| drop(simulation.step().unwrap().clone()));
        (before - lowest(&simulation), simulation)
    };
    let (sag, chosen) = settle("");
    let vbd = "method = \"vbd\"\ntwo_level = true\nprecision = \"f64\"\niterations = ";
    let (exact, _) = settle(&format!("{vbd}12"));
    assert!(exact > 1e-5, "{exact}");
    assert!((sag / exact - 1.0).abs() < 0.01, "{sag} for {exact}");
    let (_, named) = settle(&format!("{vbd}20\naccuracy = 0.1"));
    assert!(state(&chosen) == state(&named));
}

/// A stiff body next to a soft one: each has its own method, and a cut, a `set_solver` and a snapshot keep that.
#[test]
fn bodies_have_their_own_methods() {
    let stiff =
        body("sphere", 200, [0.0, 2.0, 0.0]).replace("young_modulus = 1e4", "young_modulus = 1e9");
    let scene = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{stiff}{}",
        body("sphere", 200, [0.0; 3]),
        plane(2, [0.0, 0.0, 0.05], [0.0, 0.1, 1.0])
    ));
    let mut simulation = simulation(&scene);
    let methods = |simulation: &Simulation| -> Vec<ChosenMethod> {
        let bodies = simulation.report().bodies.iter();
        bodies.map(|body| body.method.unwrap()).collect()
    };
    let both = [ChosenMethod::GaussSeidel, ChosenMethod::TwoLevelVbd];
    for _ in 0..5 {
        simulation.step().unwrap();
        assert_eq!(methods(&simulation), both);
        simulation.check().unwrap();
    }
    let snapshot = simulation.snapshot().unwrap();
    let run = |simulation: &mut Simulation| {
        (0..5).for_each(|_| drop(simulation.step().unwrap().clone()));
        state(simulation)
    };
    let first = run(&mut simulation);
    simulation.restore(&snapshot).unwrap();
    assert!(run(&mut simulation) == first);
    let mut spec = simulation.solver_spec().clone();
    spec.method = Method::GaussSeidel;
    simulation.set_solver(&spec).unwrap();
    simulation.step().unwrap();
    assert_eq!(methods(&simulation), [ChosenMethod::GaussSeidel; 2]);
    let capped = simulation.report().bodies[1].choice.unwrap();
    assert_eq!(capped.shortfall, Some(Shortfall::Cap));
    spec.method = Method::Auto;
    simulation.set_solver(&spec).unwrap();
    simulation.step().unwrap();
    assert_eq!(methods(&simulation), both);
}

/// A body that moves over many frames stays with substeps where those nearly reach the accuracy: a step of VBD a frame
/// would be less accurate.
#[test]
fn bodies_that_move_slowly_keep_their_substeps() {
    let mut simulation = simulation(&beam("1e4", "accuracy = 0.01\nmax_substeps = 40"));
    let report = simulation.step().unwrap();
    let body = &report.bodies[0];
    let choice = body.choice.unwrap();
    assert_eq!(choice.shortfall, Some(Shortfall::Cap));
    assert!(choice.expected_error > 0.01 && choice.expected_error < 0.1);
    assert_eq!(body.method.unwrap(), ChosenMethod::GaussSeidel);
    let codes: Vec<_> = report.warnings().iter().map(|w| w.code).collect();
    assert!(codes.contains(&WarningCode::SubstepsCapped), "{codes:?}");
}

/// The fix in the warning is VBD only where VBD can solve the scene: it refuses contact.
#[test]
fn warnings_do_not_advise_vbd_for_scenes_with_contact() {
    for (contact, advises_vbd) in [(None, true), (Some(ContactSpec::default()), false)] {
        let mut scene = beam("1e4", "accuracy = 0.01\nmax_substeps = 40");
        scene.contact = contact;
        let mut simulation = simulation(&scene);
        let report = simulation.step().unwrap();
        let is_capped = |warning: &&Warning| warning.code == WarningCode::SubstepsCapped;
        let warning = report.warnings().iter().find(is_capped).unwrap();
        assert!(warning.message.contains("max_substeps"), "{warning}");
        assert_eq!(warning.message.contains("vbd"), advises_vbd, "{warning}");
    }
}

/// A generous budget buys what more accuracy takes, a stated accuracy takes no more than it needs, and a budget for less
/// than one substep leaves one and says so. Times differ from machine to machine, so nothing else is asserted of them.
#[test]
fn a_budget_decides_substeps() {
    let substeps = |keys: &str| {
        let mut simulation = simulation(&beam("1e4", keys));
        let report = simulation.step().unwrap();
        let codes: Vec<_> = report.warnings().iter().map(|w| w.code).collect();
        (
            report.bodies[0].substeps,
            report.bodies[0].choice.unwrap(),
            codes,
        )
    };
    let needed = substeps("").0;
    let (rich, choice, codes) = substeps("budget_ms = 1e5");
    assert!(rich > needed && codes.is_empty(), "{rich} {codes:?}");
    assert!(choice.expected_error < 0.1);
    assert_eq!(substeps("budget_ms = 1e5\naccuracy = 0.1").0, needed);
    let (poor, choice, codes) = substeps("budget_ms = 1e-6\nmethod = \"gauss-seidel\"");
    assert_eq!((poor, choice.shortfall), (1, Some(Shortfall::Budget)));
    assert!(choice.expected_error > 0.1);
    assert!(codes.contains(&WarningCode::BudgetTooSmall), "{codes:?}");
    // More tets after a cut do not exceed a budget that is already too small.
    let mut cut = beam("1e4", "budget_ms = 1e-6");
    cut.stroke = scene(&plane(1, [0.0; 3], [1.0, 0.2, 0.1])).stroke;
    let mut simulation = simulation(&cut);
    for _ in 0..3 {
        assert_eq!(simulation.step().unwrap().bodies[0].substeps, 1);
    }
    assert_eq!(simulation.report().pieces, 2);
}

#[test]
fn a_budget_must_be_a_time() {
    for budget in ["0.0", "-1.0", "inf", "nan"] {
        let scene = beam("1e4", &format!("budget_ms = {budget}"));
        let error = Simulation::with_threads(&scene, 1).unwrap_err();
        assert!(error.to_string().contains("solver.budget_ms"), "{error}");
    }
    let scene = beam("1e4", "precision = \"f64\"\nbudget_ms = 1e5");
    let mut simulation = simulation(&scene);
    assert_eq!(scene.solver.precision, Precision::F64);
    assert_eq!(simulation.step().unwrap().precision, "f64");
}
