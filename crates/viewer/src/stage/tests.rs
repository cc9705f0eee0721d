//! A stage without a window: lines are drawn, bodies cut, pulled and brought back.

use incise::scene::{Method, Substeps};

use super::*;

const SIZE: [f64; 2] = [800.0, 600.0];

/// A block that floats, seen in a window.
fn stage(strokes: &str) -> Stage {
    let scene =
        format!("[[body]]\nshape = {{ kind = \"box\", tets = 600 }}\nscale = 0.2\n{strokes}");
    let scene = Scene::from_toml(&scene).unwrap();
    let simulation = Simulation::new(&scene).unwrap();
    let loaded = Loaded {
        name: "block".to_owned(),
        scene,
        simulation,
    };
    Stage::new(loaded).unwrap()
}

/// A stroke of the scene that comes in frame 2.
const PLANE: &str = r#"
[[stroke]]
kind = "plane"
frame = 2
point = [0.01, 0, 0]
normal = [1, 0, 0]
"#;

fn to_vbd() -> Turn {
    Turn {
        knob: "method",
        from: String::new(),
        to: String::new(),
        spec: SolverSpec::of(Method::Vbd),
    }
}

/// Draws from the top of the window to its bottom and waits until the body has met all of it.
fn cut(stage: &mut Stage) {
    stage.press_blade([410.0, 20.0], SIZE).unwrap();
    for step in 1..=20 {
        stage
            .draw_blade([410.0, 20.0 + 28.0 * f64::from(step)], SIZE)
            .unwrap();
    }
    stage.lift_blade();
    while stage.cuts() {
        stage.step().unwrap();
    }
}

#[test]
fn a_drawn_line_cuts_and_is_taken_back() {
    let mut stage = stage("");
    stage.step().unwrap();
    let tets = stage.report().tets;
    cut(&mut stage);
    assert_eq!((stage.report().pieces, stage.strokes()), (2, 1));
    stage.simulation.check().unwrap();
    assert_eq!(stage.undo().unwrap(), Some(false));
    assert_eq!((stage.report().pieces, stage.report().tets), (1, tets));
    assert_eq!(stage.undo().unwrap(), None);
    // A cut that was taken back can be made again.
    cut(&mut stage);
    assert_eq!(stage.report().pieces, 2);
    stage.reset().unwrap();
    assert_eq!((stage.simulation.next_frame(), stage.strokes()), (0, 0));
}

#[test]
fn lines_drawn_while_time_stands_still_are_cut_one_after_the_other() {
    let mut stage = stage("");
    for x in [330.0, 470.0] {
        stage.press_blade([x, 20.0], SIZE).unwrap();
        stage.draw_blade([x, 580.0], SIZE).unwrap();
        stage.lift_blade();
    }
    // A finished line is not drawn on.
    stage.draw_blade([20.0, 580.0], SIZE).unwrap();
    assert_eq!((stage.report().pieces, stage.strokes()), (1, 0));
    while stage.cuts() {
        stage.step().unwrap();
    }
    assert_eq!((stage.report().pieces, stage.strokes()), (3, 2));
    stage.undo().unwrap();
    assert_eq!(stage.report().pieces, 2);
    stage.undo().unwrap();
    assert_eq!(stage.report().pieces, 1);
}

#[test]
fn a_line_beside_the_body_is_nothing_to_take_back() {
    let mut stage = stage("");
    stage.press_blade([10.0, 20.0], SIZE).unwrap();
    stage.draw_blade([10.0, 580.0], SIZE).unwrap();
    stage.lift_blade();
    while stage.cuts() {
        stage.step().unwrap();
    }
    assert_eq!((stage.report().pieces, stage.strokes()), (1, 0));
}

#[test]
fn what_was_held_at_a_moment_is_free_when_it_comes_back() {
    let mut stage = stage(PLANE);
    assert!(stage.take([400.0, 300.0], SIZE).unwrap());
    for step in 1..=4 {
        let x = 400.0 + 5.0 * f64::from(step);
        stage.pull([x, 300.0], SIZE).unwrap();
        stage.step().unwrap();
    }
    stage.let_go();
    stage.turn(&to_vbd()).unwrap();
    // Held softly at that time, which VBD does not know.
    assert_eq!(stage.undo().unwrap(), Some(true));
    assert_eq!((stage.report().pieces, stage.hand()), (1, None));
    stage.step().unwrap();
    assert_eq!(stage.solver().method, Method::Vbd);
    // Nothing hangs on a handle any more: the same place can be taken again.
    assert!(stage.take([400.0, 300.0], SIZE).unwrap());
}

#[test]
fn a_shallow_stroke_does_not_go_through() {
    let mut stage = stage("");
    stage.grip.depth = 0.15;
    let tets = stage.simulation.mesh().tets.len();
    cut(&mut stage);
    assert_eq!(stage.report().pieces, 1);
    assert!(stage.report().tets > tets, "it cuts, though");
}

#[test]
fn a_stroke_of_the_scene_is_taken_back_and_would_begin_again() {
    let mut stage = stage(PLANE);
    for _ in 0..4 {
        stage.step().unwrap();
    }
    assert_eq!(stage.report().pieces, 2);
    assert_eq!(stage.undo().unwrap(), Some(true));
    assert_eq!(
        (stage.report().pieces, stage.simulation.next_frame()),
        (1, 2)
    );
}

#[test]
fn the_hand_pulls_what_it_holds() {
    let mut stage = stage("");
    let middle = |stage: &Stage| {
        let positions = stage.simulation.positions();
        positions.iter().sum::<DVec3>() / positions.len() as f64
    };
    let before = middle(&stage);
    assert!(!stage.take([2.0, 2.0], SIZE).unwrap(), "nothing is there");
    assert!(stage.take([400.0, 300.0], SIZE).unwrap());
    let from = stage.hand().unwrap();
    for step in 1..=30 {
        stage
            .pull([400.0 + 4.0 * f64::from(step), 300.0], SIZE)
            .unwrap();
        stage.step().unwrap();
    }
    let pulled = stage.hand().unwrap() - from;
    let right = stage.camera.right();
    assert!(pulled.dot(right) > 0.9 * pulled.length(), "to the right");
    let moved = (middle(&stage) - before).dot(right);
    assert!(
        moved > 0.2 * pulled.length(),
        "{moved} of {}",
        pulled.length()
    );
    stage.let_go();
    assert_eq!(stage.hand(), None);
}

#[test]
fn knobs_are_turned_on_a_body_that_is_cut() {
    let mut stage = stage("");
    cut(&mut stage);
    let turn = |to: &str, spec: SolverSpec| Turn {
        knob: "knob",
        from: "here".to_owned(),
        to: to.to_owned(),
        spec,
    };
    let spec = SolverSpec {
        substeps: Substeps::Fixed(9),
        iterations: 3,
        clustering: "serial:4".to_owned(),
        ..stage.solver().clone()
    };
    let this = turn("there", spec.clone());
    stage.turn(&this).unwrap();
    stage.step().unwrap();
    assert_eq!(stage.solver(), &spec);
    assert_eq!(
        stage.effects.turns().next().unwrap().what,
        "knob here to there"
    );
    assert_eq!(stage.report().pieces, 2);
    // A knob that cannot be turned stays where it was.
    let impossible = SolverSpec {
        relaxation: -1.0,
        ..SolverSpec::of(Method::Jacobi)
    };
    let this = turn("nowhere", impossible);
    let refused = format!("{:#}", stage.turn(&this).unwrap_err());
    assert!(refused.starts_with("knob stays at here"), "{refused}");
    assert_eq!(stage.solver(), &spec);
    // A jump in time leaves knobs as they are.
    stage.reset().unwrap();
    assert_eq!(stage.solver(), &spec);
    stage.step().unwrap();
}

#[test]
fn all_colors_can_be_shown_at_any_time() {
    let mut stage = stage("");
    let residual = ColorBy::Residual;
    // Nothing is known before the first frame, and nothing else is shown in its place.
    stage.color(ColorBy::Stretch).unwrap();
    assert!(stage.legend.is_some());
    stage.color(residual).unwrap();
    assert!(stage.legend.is_none());
    // Frame 0 is measured, the next ones are not: its colors stay, also on what they cut.
    stage.step().unwrap();
    stage.color(residual).unwrap();
    assert!(stage.legend.is_some());
    cut(&mut stage);
    stage.color(residual).unwrap();
    assert!(stage.legend.is_some());
    stage.measure(false).unwrap();
    for by in ColorBy::ALL.into_iter().chain(ColorBy::ALL) {
        stage.step().unwrap();
        stage.color(by).unwrap();
    }
    stage.turn(&to_vbd()).unwrap();
    stage.measure(true).unwrap();
    stage.step().unwrap();
    stage.color(residual).unwrap();
    assert!(stage.legend.is_none(), "vbd has none by tets");
}
