//! `incise advise`: results and errors. Tests check the order of times, never their values.

use serde_json::Value;

use crate::bad_input::{refused_in_a_sentence, sandbox};
use crate::support::Sandbox;

/// A small beam that Newton's method can do.
const BEAM: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
[[body]]
shape = { kind = "beam", tets = 250 }
young_modulus = 1e4
poisson_ratio = 0.3
fixed = [{ half_space = { point = [-0.4, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
"#;

fn ask(sandbox: &Sandbox, arguments: &[&str]) -> Value {
    let text = sandbox.good(
        &[
            &["advise", "scene.toml", "--json", "--frames", "3"],
            arguments,
        ]
        .concat(),
    );
    serde_json::from_str(&text).unwrap()
}

fn beam() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("scene.toml", BEAM);
    sandbox
}

/// The best is the most accurate within the budget, to what is left of the reference's error, and its lines run.
#[test]
fn the_best_setting_is_measured_and_can_be_pasted_in() {
    let sandbox = beam();
    let advice = ask(&sandbox, &["--budget-ms", "10000"]);
    assert_eq!(advice["reference"]["kind"], "newton");
    assert_eq!(advice["reference"]["why_not_newton"], Value::Null);
    let left = advice["reference"]["left"]["largest"].as_f64().unwrap();
    let rows = advice["measured"].as_array().unwrap();
    let best = &rows[usize::try_from(advice["best"].as_u64().unwrap()).unwrap()];
    let error = |row: &Value| row["error"]["largest"].as_f64().unwrap().max(left);
    assert!(rows.len() > 15, "{}", rows.len());
    assert!(rows.iter().all(|row| error(best) <= error(row)), "{advice}");
    assert_eq!(advice["next"], Value::Null);
    assert_eq!(
        rows.iter()
            .filter(|row| row["is_scene_setting"] == true)
            .count(),
        1
    );
    let lines = best["solver"].as_str().unwrap();
    sandbox.write("scene.toml", format!("{BEAM}{lines}"));
    sandbox.good(&["run", "scene.toml", "--frames", "1", "--quiet"]);
}

#[test]
fn an_unreachable_budget_is_reported() {
    let sandbox = beam();
    let advice = ask(&sandbox, &["--budget-ms", "1e-9"]);
    assert_eq!(advice["best"], Value::Null);
    assert!(advice["next"].is_u64(), "{advice}");
    let text = sandbox.good(&[
        "advise",
        "scene.toml",
        "--frames",
        "2",
        "--budget-ms",
        "1e-9",
    ]);
    assert!(text.contains("no measured setting meets"), "{text}");
    assert!(text.contains("[solver]"), "{text}");
}

/// Features that the reference does not support are named, and the solver is measured against itself.
#[test]
fn scenes_without_newton_are_compared_with_the_solver() {
    for (more, why) in [
        ("[world.ground]\nheight = -1.0\n", "a ground"),
        (
            "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0, 0, 0]\nnormal = [1, 0, 0]\n",
            "strokes after frame 0",
        ),
    ] {
        let sandbox = Sandbox::new();
        sandbox.write("scene.toml", format!("{BEAM}{more}"));
        let advice = ask(&sandbox, &["--budget-ms", "1000"]);
        assert_eq!(advice["reference"]["kind"], "xpbd");
        let reason = advice["reference"]["why_not_newton"].as_str().unwrap();
        assert!(reason.contains(why), "{reason}");
    }
}

#[test]
fn bad_questions_are_refused() {
    let sandbox = sandbox();
    refused_in_a_sentence(
        &sandbox,
        &["advise", "scene.toml", "--budget-ms", "0"],
        &["budget-ms is 0", "positive"],
    );
    refused_in_a_sentence(
        &sandbox,
        &["advise", "none.toml", "--budget-ms", "5"],
        &["none.toml"],
    );
    for arguments in [
        &["advise", "scene.toml"][..],
        &["advise", "scene.toml", "--budget-ms", "soon"],
        &["advise", "scene.toml", "--budget-ms", "5", "--frames", "0"],
    ] {
        assert_eq!(sandbox.incise(arguments).code, 2, "{arguments:?}");
    }
}
