//! Editing without a window: lines are drawn, bodies cut, pulled and restored, also while the simulation is away.

use std::sync::mpsc::{Sender, channel};

use incise::scene::{Method, Substeps};

use super::*;

const SIZE: [f64; 2] = [800.0, 600.0];

/// A floating block, viewed in a window.
fn session(strokes: &str) -> Session {
    let scene =
        format!("[[body]]\nshape = {{ kind = \"box\", tets = 600 }}\nscale = 0.2\n{strokes}");
    let scene = Scene::from_toml(&scene).unwrap();
    let simulation = Simulation::new(&scene).unwrap();
    Session::new("block".to_owned(), &scene, simulation).unwrap()
}

impl Session {
    /// Executes what waits and takes over the results of what is executed.
    fn finish(&mut self) -> Outcome {
        let mut outcome = Outcome::default();
        while self.is_busy() {
            self.start(0, true, || ());
            let result = self.worker.wait().unwrap();
            let next = self.take_over(result);
            outcome.error = outcome.error.or(next.error);
            outcome.refused = outcome.refused.or(next.refused);
            outcome.restarts |= next.restarts;
            outcome.missed |= next.missed;
        }
        outcome
    }

    /// Executes what waits; no error is expected.
    fn succeed(&mut self) -> Outcome {
        let outcome = self.finish();
        assert!(
            outcome.error.is_none() && outcome.refused.is_none(),
            "{outcome:?}"
        );
        outcome
    }

    /// Makes a step and waits for it.
    fn advance(&mut self) {
        self.step();
        self.succeed();
    }

    /// Undoes; returns true if a stroke of the scene begins again.
    fn take_back(&mut self) -> bool {
        self.undo();
        self.succeed().restarts
    }

    fn set(&mut self, change: &SettingChange) {
        self.change_setting(change.clone());
        self.succeed();
    }

    /// Grabs under a pixel; returns true if there is something to grab.
    fn grabs(&mut self, pixel: [f64; 2]) -> bool {
        self.grab_at(pixel, SIZE);
        self.succeed();
        self.grab_target().is_some()
    }

    fn colors(&mut self, by: ColorBy) {
        self.color(by);
        self.succeed();
    }

    fn check(&self) {
        self.simulation().unwrap().check().unwrap();
    }

    /// Sends the simulation away until a message is sent.
    pub(crate) fn send_away(&mut self) -> Sender<()> {
        let (sender, gate) = channel();
        self.waiting.push(Command::Wait(gate));
        self.start(0, true, || ());
        sender
    }
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
    draw(session);
    while session.cuts() {
        session.advance();
    }
}

fn draw(session: &mut Session) {
    session.press_blade([410.0, 20.0], SIZE);
    for step in 1..=20 {
        session.draw_blade([410.0, 20.0 + 28.0 * f64::from(step)], SIZE);
    }
    session.lift_blade();
}

#[test]
fn a_drawn_line_cuts_and_is_undone() {
    let mut session = session("");
    session.advance();
    let tets = session.view.report.tets;
    cut(&mut session);
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (2, 1)
    );
    session.check();
    assert!(!session.take_back());
    assert_eq!(
        (session.view.report.pieces, session.view.report.tets),
        (1, tets)
    );
    assert_eq!(session.view.undo_points, 0);
    session.take_back();
    // A cut that was undone can be repeated.
    cut(&mut session);
    assert_eq!(session.view.report.pieces, 2);
    let frame = session.view.next_frame;
    session.reset();
    session.succeed();
    assert_eq!(
        (session.view.next_frame, session.view.report.pieces),
        (0, 1)
    );
    // A reset is undone; one of the first frame is nothing to undo.
    session.reset();
    session.succeed();
    assert_eq!(session.view.undo_points, 2);
    assert!(!session.take_back());
    assert_eq!(
        (session.view.next_frame, session.view.report.pieces),
        (frame, 2)
    );
    assert!(!session.take_back());
    assert_eq!(session.view.report.pieces, 1);
}

#[test]
fn lines_drawn_while_paused_are_cut_in_order() {
    let mut session = session("");
    for x in [330.0, 470.0] {
        session.press_blade([x, 20.0], SIZE);
        session.draw_blade([x, 580.0], SIZE);
        session.lift_blade();
    }
    // A finished line is not continued.
    session.draw_blade([20.0, 580.0], SIZE);
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (1, 0)
    );
    while session.cuts() {
        session.advance();
    }
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (3, 2)
    );
    session.take_back();
    assert_eq!(session.view.report.pieces, 2);
    session.take_back();
    assert_eq!(session.view.report.pieces, 1);
}

#[test]
fn a_line_beside_the_body_adds_no_undo_point() {
    let mut session = session("");
    session.press_blade([10.0, 20.0], SIZE);
    session.draw_blade([10.0, 580.0], SIZE);
    session.lift_blade();
    while session.cuts() {
        session.advance();
    }
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (1, 0)
    );
}

#[test]
fn undo_releases_the_grab_of_its_state() {
    let mut session = session(PLANE);
    assert!(session.grabs([400.0, 300.0]));
    for step in 1..=4 {
        let x = 400.0 + 5.0 * f64::from(step);
        session.pull([x, 300.0], SIZE);
        session.advance();
    }
    session.release();
    session.set(&to_vbd());
    // The grab was soft at that time, which VBD does not support.
    assert!(session.take_back());
    assert_eq!(
        (session.view.report.pieces, session.grab_target()),
        (1, None)
    );
    session.advance();
    assert_eq!(session.solver().method, Method::Vbd);
    // No grab is left: the body can be grabbed at the same point.
    assert!(session.grabs([400.0, 300.0]));
}

#[test]
fn a_scene_that_cuts_waits_for_its_start() {
    let mut scripted = session(PLANE);
    assert!(scripted.waits_for_start() && !session("").waits_for_start());
    scripted.advance();
    assert!(!scripted.waits_for_start());
}

#[test]
fn waiting_lines_are_shown_where_they_were_drawn() {
    let mut session = session("");
    let drawn = [[330.0, 20.0], [330.0, 300.0], [470.0, 300.0]];
    session.press_blade(drawn[0], SIZE);
    for pixel in &drawn[1..] {
        session.draw_blade(*pixel, SIZE);
    }
    session.lift_blade();
    let lines: Vec<Vec<DVec3>> = session.waiting_lines().collect();
    assert_eq!((lines.len(), lines[0].len()), (1, 3));
    for (point, pixel) in lines[0].iter().zip(drawn) {
        let at = session.camera.project(*point, SIZE).unwrap();
        assert!((at.x - pixel[0]).hypot(at.y - pixel[1]) < 1e-6);
    }
    while session.cuts() {
        session.advance();
    }
    assert_eq!(session.waiting_lines().count(), 0);
}

#[test]
fn what_is_pinned_cannot_be_grabbed_and_says_so() {
    let fixed = "fixed = [{ half_space = { point = [0, 0, 0.2], normal = [0, 0, -1] } }]";
    let mut session = session(fixed);
    assert!(!session.grabs([400.0, 300.0]));
    assert!(
        session
            .message
            .is_some_and(|text| text.starts_with("Pinned"))
    );
    assert!(!session.grabs([2.0, 2.0]));
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
    let tets = session.view.report.tets;
    cut(&mut session);
    assert_eq!(session.view.report.pieces, 1);
    assert!(session.view.report.tets > tets, "it cuts, though");
}

#[test]
fn undo_of_a_scene_stroke_reports_its_restart() {
    let mut session = session(PLANE);
    for _ in 0..4 {
        session.advance();
    }
    assert_eq!(session.view.report.pieces, 2);
    assert!(session.take_back());
    assert_eq!(
        (session.view.report.pieces, session.view.next_frame),
        (1, 2)
    );
}

#[test]
fn a_grab_pulls_the_body() {
    let mut session = session("");
    let middle = |session: &Session| {
        let positions = &session.view.positions;
        positions.iter().sum::<DVec3>() / positions.len() as f64
    };
    let before = middle(&session);
    assert!(!session.grabs([2.0, 2.0]), "nothing is there");
    assert!(session.grabs([400.0, 300.0]));
    let from = session.grab_target().unwrap();
    for step in 1..=30 {
        session.pull([400.0 + 4.0 * f64::from(step), 300.0], SIZE);
        session.advance();
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
    session.set(&this);
    session.advance();
    assert_eq!(session.solver(), &spec);
    assert_eq!(
        session.view.effects.changes().next().unwrap().what,
        "Setting here to there"
    );
    assert_eq!(session.view.report.pieces, 2);
    // An invalid setting keeps its value.
    let impossible = SolverSpec::of(Method::Jacobi).with(|spec| spec.relaxation = -1.0);
    let this = change("nowhere", impossible);
    session.change_setting(this);
    let refused = format!("{:#}", session.finish().refused.unwrap());
    assert!(
        refused.starts_with("Setting not changed, it stays at here"),
        "{refused}"
    );
    assert_eq!(session.solver(), &spec);
    // Reset keeps the settings.
    session.reset();
    session.succeed();
    assert_eq!(session.solver(), &spec);
    session.advance();
}

#[test]
fn all_colors_can_be_shown_at_any_time() {
    let mut session = session("");
    let residual = ColorBy::Residual;
    // Before the first frame no colors are available, and no others are shown.
    session.colors(ColorBy::Stretch);
    assert!(session.view.legend.is_some());
    session.colors(residual);
    assert!(session.view.legend.is_none());
    // Frame 0 is measured, the next ones are not: its colors stay, also on new surfaces.
    session.advance();
    session.colors(residual);
    assert!(session.view.legend.is_some());
    cut(&mut session);
    session.colors(residual);
    assert!(session.view.legend.is_some());
    session.measure(false);
    for by in ColorBy::ALL.into_iter().chain(ColorBy::ALL) {
        session.advance();
        session.colors(by);
    }
    session.set(&to_vbd());
    session.measure(true);
    session.advance();
    session.colors(residual);
    assert!(session.view.legend.is_none(), "vbd has none by tets");
}

/// Positions after some frames of a scripted scene through the session, and through the simulation alone.
#[test]
fn the_thread_changes_no_bit() {
    let scene = format!("[[body]]\nshape = {{ kind = \"box\", tets = 600 }}\nscale = 0.2\n{PLANE}");
    let scene = Scene::from_toml(&scene).unwrap();
    let mut alone = Simulation::new(&scene).unwrap();
    let mut session = session(PLANE);
    for _ in 0..4 {
        session.start(3, true, || ());
        session.succeed();
        for _ in 0..3 {
            alone.step().unwrap();
        }
    }
    assert_eq!(session.view.report.pieces, 2);
    assert_eq!(session.view.next_frame, 12);
    assert_eq!(session.view.positions, alone.positions());
}

#[test]
fn commands_that_are_given_while_the_simulation_is_away_apply_in_order() {
    let mut session = session("");
    session.advance();
    let go = session.send_away();
    assert!(session.poll().is_none() && !session.can_step());
    // Neither the view nor the tools wait.
    let (before, tets) = (session.camera, session.view.report.tets);
    session.camera.orbit(0.1, 0.0);
    session.fit();
    assert_ne!(session.camera, before);
    session.camera = before;
    let spec = session.solver().clone();
    for substeps in [6, 7, 8] {
        session.change_setting(SettingChange {
            setting: "Substeps",
            from: (substeps - 1).to_string(),
            to: substeps.to_string(),
            spec: spec
                .clone()
                .with(|spec| spec.substeps = Substeps::Fixed(substeps)),
        });
    }
    // The next change is one of the settings that were chosen.
    let spec = session.solver().clone().with(|spec| spec.iterations = 3);
    assert_eq!(spec.substeps, Substeps::Fixed(8));
    session.change_setting(SettingChange {
        setting: "Iterations",
        from: "1".to_owned(),
        to: "3".to_owned(),
        spec: spec.clone(),
    });
    session.grab_at([400.0, 300.0], SIZE);
    for x in 0..100 {
        session.pull([400.0 + f64::from(x), 300.0], SIZE);
        session.start(1, true, || ());
    }
    assert_eq!(session.waiting.len(), 3, "{:?}", session.waiting);
    assert_ne!(session.view.solver, spec);
    go.send(()).unwrap();
    session.succeed();
    assert_eq!((&session.view.solver, session.view.next_frame), (&spec, 1));
    let effects = session.view.effects.changes().map(|effect| &*effect.what);
    assert_eq!(
        effects.collect::<Vec<_>>(),
        ["Iterations 1 to 3", "Substeps 5 to 8"]
    );
    session.advance();
    session.release();
    assert_eq!(session.grab_target(), None);
    session.succeed();
    assert_eq!(session.view.report.tets, tets);
    session.check();
}

#[test]
fn a_line_drawn_while_the_simulation_is_away_is_cut_when_it_is_back() {
    let mut session = session("");
    session.advance();
    let go = session.send_away();
    draw(&mut session);
    assert_eq!(session.waiting_lines().count(), 1);
    // A straight line is a pose at each end, however long the simulation is away.
    assert_eq!(
        session
            .waiting_lines()
            .map(|line| line.len())
            .sum::<usize>(),
        2
    );
    go.send(()).unwrap();
    session.succeed();
    while session.cuts() {
        session.advance();
    }
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (2, 1)
    );
    session.check();
}

#[test]
fn a_cut_is_undone_and_the_body_reset_while_the_simulation_is_away() {
    let mut session = session("");
    session.advance();
    cut(&mut session);
    let frame = session.view.next_frame;
    let go = session.send_away();
    // A line that was begun is dropped by the undo that follows, one drawn after it is cut.
    session.press_blade([330.0, 20.0], SIZE);
    session.undo();
    assert!(!session.cuts() && !session.can_step());
    session.press_blade([470.0, 20.0], SIZE);
    session.draw_blade([470.0, 580.0], SIZE);
    session.lift_blade();
    go.send(()).unwrap();
    session.succeed();
    assert_eq!(session.view.report.pieces, 1);
    assert!(session.view.next_frame < frame);
    while session.cuts() {
        session.advance();
    }
    assert_eq!(
        (session.view.report.pieces, session.view.undo_points),
        (2, 1)
    );
    let frame = session.view.next_frame;
    let go = session.send_away();
    session.step();
    session.reset();
    session.reset();
    go.send(()).unwrap();
    session.succeed();
    assert_eq!(
        (session.view.next_frame, session.view.report.pieces),
        (0, 1)
    );
    // The state that is restored is that after the step.
    session.take_back();
    assert_eq!(
        (session.view.next_frame, session.view.report.pieces),
        (frame + 1, 2)
    );
    session.check();
}

#[test]
fn a_panic_is_an_error_and_another_state_can_be_restored() {
    let mut session = session("");
    session.advance();
    cut(&mut session);
    let before = session.view.next_frame;
    session.waiting.push(Command::Panic);
    session.step();
    let error = format!("{:#}", session.finish().error.unwrap());
    assert!(
        error.contains("internal error") && error.contains("a test panics"),
        "{error}"
    );
    assert_eq!(session.view.next_frame, before);
    // What it left cannot be trusted.
    session.step();
    let error = format!("{:#}", session.finish().error.unwrap());
    assert!(error.contains("unknown state"), "{error}");
    session.take_back();
    assert_eq!(session.view.report.pieces, 1);
    session.advance();
    session.check();
    session.waiting.push(Command::Panic);
    session.finish();
    session.reset();
    session.succeed();
    assert_eq!((session.view.next_frame, session.view.undo_points), (0, 0));
    session.advance();
}

#[test]
fn a_session_that_is_dropped_while_its_simulation_is_away_ends_its_thread() {
    let mut session = session("");
    let (sender, gate) = channel::<()>();
    session.waiting.push(Command::Wait(gate));
    let (woken, wakes) = channel();
    session.start(0, true, move || woken.send(()).unwrap());
    drop(session);
    sender.send(()).unwrap();
    wakes.recv().unwrap();
    // The simulation goes with the thread, and with it the end of the gate.
    assert!(sender.send(()).is_err());
}
