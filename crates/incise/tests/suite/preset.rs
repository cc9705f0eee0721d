//! Presets are other defaults: what a scene names itself stays.

use incise::Scene;
use incise::scene::{Method, Preset, SolverSpec, TetSolve};

use crate::support::{body, scene, simulation};

fn solver(keys: &str) -> SolverSpec {
    scene(&format!("[solver]\n{keys}")).solver
}

#[test]
fn the_paper_preset_is_the_papers_setting() {
    let paper = solver("preset = \"paper\"");
    assert_eq!(paper, SolverSpec::paper(Method::GaussSeidel));
    assert_eq!((paper.time_step, paper.substeps), (0.016, 1.into()));
    assert_eq!((paper.iterations, paper.relaxation), (500, 0.8));
    assert_eq!(paper.tet_solve, TetSolve::Sequential);
    assert_eq!(
        (paper.clustering.as_str(), paper.coloring.as_str()),
        ("serial:10", "scgc")
    );
    assert_eq!(paper.kappa_limit, f64::INFINITY);
}

#[test]
fn the_paper_preset_knows_the_other_methods() {
    for (name, method, form, relaxation) in [
        ("jacobi", Method::Jacobi, TetSolve::Sequential, 0.1),
        ("chebyshev", Method::Chebyshev, TetSolve::Sequential, 0.1),
        ("vbd", Method::Vbd, TetSolve::Split, 1.0),
    ] {
        let paper = solver(&format!("method = \"{name}\"\npreset = \"paper\""));
        assert_eq!(paper, SolverSpec::paper(method));
        assert_eq!((paper.tet_solve, paper.relaxation), (form, relaxation));
        assert_eq!((paper.iterations, paper.method), (500, method));
    }
    let given = solver("preset = \"paper\"\nmethod = \"jacobi\"\ntet_solve = \"block\"");
    assert_eq!((given.tet_solve, given.relaxation), (TetSolve::Block, 0.1));
}

#[test]
fn named_keys_override_the_preset_wherever_they_stand() {
    for keys in [
        "preset = \"paper\"\nrelaxation = 1.0\nsubsteps = \"auto\"",
        "relaxation = 1.0\nsubsteps = \"auto\"\npreset = \"paper\"",
    ] {
        let given = solver(keys);
        let mut expected = SolverSpec::paper(Method::GaussSeidel);
        // Also a key whose value is that of the plain defaults.
        expected.relaxation = SolverSpec::default().relaxation;
        expected.substeps = incise::scene::Substeps::Auto;
        assert_eq!(given, expected);
    }
}

#[test]
fn a_preset_survives_a_round_trip_and_is_refused_if_unknown() {
    let given = scene("[solver]\npreset = \"paper\"\niterations = 7");
    assert_eq!(given.solver.preset, Some(Preset::Paper));
    assert_eq!(scene(&given.to_toml().unwrap()), given);
    let error = Scene::from_toml("[solver]\npreset = \"papre\"").unwrap_err();
    assert!(
        error.to_string().contains("did you mean 'paper'"),
        "{error}"
    );
    let error = Scene::from_toml("[solver]\npreset = \"paper\"\niteratons = 2").unwrap_err();
    assert!(error.to_string().contains("'iterations'"), "{error}");
}

#[test]
fn the_papers_setting_runs() {
    let text = format!(
        "[solver]\npreset = \"paper\"\niterations = 5\n{}",
        body("box", 200, [0.0; 3])
    );
    let mut simulation = simulation(&scene(&text));
    assert_eq!(simulation.step().unwrap().repaired, 0);
    simulation.check().unwrap();
}
