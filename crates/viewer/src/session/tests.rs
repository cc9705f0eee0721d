//! A session without a window: lines are drawn, bodies cut, pulled and restored.

use incise::scene::{Method, Substeps};

use super::*;

const SIZE: [f64; 2] = [800.0, 600.0];

/// A floating block, viewed in a window.
fn session(strokes: &str) -> Session {
    let scene =
        format!("[[body]]\nshape = {{ kind = \"box\", tets = 600 }}\nscale = 0.2\n{strokes}");
    let scene = Scene::from_toml(&scene).unwrap();
    let simulation = Simulation::new(&scene).unwrap();
    let loaded = Loaded {
        name: "block".to_owned(),
        scene,
        simulation,
    };
    Session::new(loaded).unwrap()
}

/// A stroke of the scene that begins in frame 2.
const PLANE: &str = r#"
[[stroke]]
kind = "plane"
frame = 2
point = [0.01, 0, 0]
normal = [1, 0, 0]
"#;

fn to_vbd() -> SettingChange {
    SettingChange {
        setting: "Method",
        from: String::new(),
        to: String::new(),
        spec: SolverSpec::of(Method::Vbd),
    }
}

/// Draws from the top of the window to its bottom and steps until all of it has been cut.
fn cut(session: &mut Session) {
    session.press_blade([410.0, 20.0], SIZE).unwrap();
    for step in 1..=20 {
        session
            .draw_blade([410.0, 20.0 + 28.0 * f64::from(step)], SIZE)
            .unwrap();
    }
    session.lift_blade();
    while session.cuts() {
        session.step().unwrap();
    }
}

#[test]
fn a_drawn_line_cuts_and_is_undone() {
    let mut session = session("");
    session.step().unwrap();
    let tets = session.report().tets;
    cut(&mut session);
    assert_eq!((session.report().pieces, session.undo_points()), (2, 1));
    session.simulation.check().unwrap();
    assert_eq!(session.undo().unwrap(), Some(false));
    assert_eq!((session.report().pieces, session.report().tets), (1, tets));
    assert_eq!(session.undo().unwrap(), None);
    // A cut that was undone can be repeated.
    cut(&mut session);
    assert_eq!(session.report().pieces, 2);
    let frame = session.simulation.next_frame();
    session.reset().unwrap();
    assert_eq!(
        (session.simulation.next_frame(), session.report().pieces),
        (0, 1)
    );
    // A reset is undone; one of the first frame is nothing to undo.
    session.reset().unwrap();
    assert_eq!(session.undo_points(), 2);
    assert_eq!(session.undo().unwrap(), Some(false));
    assert_eq!(
        (session.simulation.next_frame(), session.report().pieces),
        (frame, 2)
    );
    assert_eq!(session.undo().unwrap(), Some(false));
    assert_eq!(session.report().pieces, 1);
}

#[test]
fn lines_drawn_while_paused_are_cut_in_order() {
    let mut session = session("");
    for x in [330.0, 470.0] {
        session.press_blade([x, 20.0], SIZE).unwrap();
        session.draw_blade([x, 580.0], SIZE).unwrap();
        session.lift_blade();
    }
    // A finished line is not continued.
    session.draw_blade([20.0, 580.0], SIZE).unwrap();
    assert_eq!((session.report().pieces, session.undo_points()), (1, 0));
    while session.cuts() {
        session.step().unwrap();
    }
    assert_eq!((session.report().pieces, session.undo_points()), (3, 2));
    session.undo().unwrap();
    assert_eq!(session.report().pieces, 2);
    session.undo().unwrap();
    assert_eq!(session.report().pieces, 1);
}

#[test]
fn a_line_beside_the_body_adds_no_undo_point() {
    let mut session = session("");
    session.press_blade([10.0, 20.0], SIZE).unwrap();
    session.draw_blade([10.0, 580.0], SIZE).unwrap();
    session.lift_blade();
    while session.cuts() {
        session.step().unwrap();
    }
    assert_eq!((session.report().pieces, session.undo_points()), (1, 0));
}

#[test]
fn undo_releases_the_grab_of_its_state() {
    let mut session = session(PLANE);
    assert!(session.grab_at([400.0, 300.0], SIZE).unwrap());
    for step in 1..=4 {
        let x = 400.0 + 5.0 * f64::from(step);
        session.pull([x, 300.0], SIZE).unwrap();
        session.step().unwrap();
    }
    session.release();
    session.change_setting(&to_vbd()).unwrap();
    // The grab was soft at that time, which VBD does not support.
    assert_eq!(session.undo().unwrap(), Some(true));
    assert_eq!((session.report().pieces, session.grab_target()), (1, None));
    session.step().unwrap();
    assert_eq!(session.solver().method, Method::Vbd);
    // No grab is left: the body can be grabbed at the same point.
    assert!(session.grab_at([400.0, 300.0], SIZE).unwrap());
}

#[test]
fn a_scene_that_cuts_waits_for_its_start() {
    let mut scripted = session(PLANE);
    assert!(scripted.waits_for_start() && !session("").waits_for_start());
    scripted.step().unwrap();
    assert!(!scripted.waits_for_start());
}

#[test]
fn waiting_lines_are_shown_where_they_were_drawn() {
    let mut session = session("");
    let drawn = [[330.0, 20.0], [330.0, 300.0], [470.0, 300.0]];
    session.press_blade(drawn[0], SIZE).unwrap();
    for pixel in &drawn[1..] {
        session.draw_blade(*pixel, SIZE).unwrap();
    }
    session.lift_blade();
    let lines: Vec<Vec<DVec3>> = session.waiting_lines().collect();
    assert_eq!((lines.len(), lines[0].len()), (1, 3));
    for (point, pixel) in lines[0].iter().zip(drawn) {
        let at = session.camera.project(*point, SIZE).unwrap();
        assert!((at.x - pixel[0]).hypot(at.y - pixel[1]) < 1e-6);
    }
    while session.cuts() {
        session.step().unwrap();
    }
    assert_eq!(session.waiting_lines().count(), 0);
}

#[test]
fn what_is_pinned_cannot_be_grabbed_and_says_so() {
    let fixed = "fixed = [{ half_space = { point = [0, 0, 0.2], normal = [0, 0, -1] } }]";
    let mut session = session(fixed);
    assert!(!session.grab_at([400.0, 300.0], SIZE).unwrap());
    assert!(
        session
            .message
            .is_some_and(|text| text.starts_with("Pinned"))
    );
    assert!(!session.grab_at([2.0, 2.0], SIZE).unwrap());
    assert!(
        session
            .message
            .is_some_and(|text| text.starts_with("Nothing"))
    );
}

#[test]
fn a_shallow_stroke_does_not_go_through() {
    let mut session = session("");
    session.tool_settings.depth = 0.15;
    let tets = session.simulation.mesh().tets.len();
    cut(&mut session);
    assert_eq!(session.report().pieces, 1);
    assert!(session.report().tets > tets, "it cuts, though");
}

#[test]
fn undo_of_a_scene_stroke_reports_its_restart() {
    let mut session = session(PLANE);
    for _ in 0..4 {
        session.step().unwrap();
    }
    assert_eq!(session.report().pieces, 2);
    assert_eq!(session.undo().unwrap(), Some(true));
    assert_eq!(
        (session.report().pieces, session.simulation.next_frame()),
        (1, 2)
    );
}

#[test]
fn a_grab_pulls_the_body() {
    let mut session = session("");
    let middle = |session: &Session| {
        let positions = session.simulation.positions();
        positions.iter().sum::<DVec3>() / positions.len() as f64
    };
    let before = middle(&session);
    assert!(
        !session.grab_at([2.0, 2.0], SIZE).unwrap(),
        "nothing is there"
    );
    assert!(session.grab_at([400.0, 300.0], SIZE).unwrap());
    let from = session.grab_target().unwrap();
    for step in 1..=30 {
        session
            .pull([400.0 + 4.0 * f64::from(step), 300.0], SIZE)
            .unwrap();
        session.step().unwrap();
    }
    let pulled = session.grab_target().unwrap() - from;
    let right = session.camera.right();
    assert!(pulled.dot(right) > 0.9 * pulled.length(), "to the right");
    let moved = (middle(&session) - before).dot(right);
    assert!(
        moved > 0.2 * pulled.length(),
        "{moved} of {}",
        pulled.length()
    );
    session.release();
    assert_eq!(session.grab_target(), None);
}

#[test]
fn settings_change_on_a_cut_body() {
    let mut session = session("");
    cut(&mut session);
    let change = |to: &str, spec: SolverSpec| SettingChange {
        setting: "Setting",
        from: "here".to_owned(),
        to: to.to_owned(),
        spec,
    };
    let spec = session.solver().clone().with(|spec| {
        spec.substeps = Substeps::Fixed(9);
        spec.iterations = 3;
        spec.clustering = "serial:4".to_owned();
    });
    let this = change("there", spec.clone());
    session.change_setting(&this).unwrap();
    session.step().unwrap();
    assert_eq!(session.solver(), &spec);
    assert_eq!(
        session.effects.changes().next().unwrap().what,
        "Setting here to there"
    );
    assert_eq!(session.report().pieces, 2);
    // An invalid setting keeps its value.
    let impossible = SolverSpec::of(Method::Jacobi).with(|spec| spec.relaxation = -1.0);
    let this = change("nowhere", impossible);
    let refused = format!("{:#}", session.change_setting(&this).unwrap_err());
    assert!(
        refused.starts_with("Setting not changed, it stays at here"),
        "{refused}"
    );
    assert_eq!(session.solver(), &spec);
    // Reset keeps the settings.
    session.reset().unwrap();
    assert_eq!(session.solver(), &spec);
    session.step().unwrap();
}

#[test]
fn all_colors_can_be_shown_at_any_time() {
    let mut session = session("");
    let residual = ColorBy::Residual;
    // Before the first frame no colors are available, and no others are shown.
    session.color(ColorBy::Stretch).unwrap();
    assert!(session.legend.is_some());
    session.color(residual).unwrap();
    assert!(session.legend.is_none());
    // Frame 0 is measured, the next ones are not: its colors stay, also on new surfaces.
    session.step().unwrap();
    session.color(residual).unwrap();
    assert!(session.legend.is_some());
    cut(&mut session);
    session.color(residual).unwrap();
    assert!(session.legend.is_some());
    session.measure(false).unwrap();
    for by in ColorBy::ALL.into_iter().chain(ColorBy::ALL) {
        session.step().unwrap();
        session.color(by).unwrap();
    }
    session.change_setting(&to_vbd()).unwrap();
    session.measure(true).unwrap();
    session.step().unwrap();
    session.color(residual).unwrap();
    assert!(session.legend.is_none(), "vbd has none by tets");
}
