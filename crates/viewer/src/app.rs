//! [`Viewer`]: the window.
//!
//! A frame of the window takes over what the simulation has done, handles input, draws picture, panel and overlays, and
//! starts the frames that are due by real time. It never waits for them. An error while simulating pauses the simulation
//! and opens a dialog.

use std::path::Path;
use std::sync::Arc;

use eframe::egui::{
    self, Align2, CentralPanel, Color32, Context, Frame, Panel, PointerButton, Pos2, Rect,
    Response, Sense, Shape, Stroke, Ui, Window,
};
use incise::Support;
use incise::gpu::GpuContext;
use incise::mesh::glam::DVec3;
use incise::scene::Backend;
use incise_render::Style;
use web_time::Instant;

use crate::canvas::Canvas;
use crate::frame_clock::FrameClock;
use crate::graphics;
use crate::help::{self, Action};
use crate::load::{Loading, Source};
use crate::open_dialog::OpenDialog;
use crate::panel::{self, Controls, UiCommands};
use crate::sentence::sentence;
use crate::session::Session;
use crate::tool::Tool;

/// An error to show: title and text.
struct ErrorDialog {
    title: &'static str,
    text: String,
}

impl ErrorDialog {
    fn new(title: &'static str, error: &anyhow::Error) -> Self {
        let text = sentence(error);
        Self { title, text }
    }
}

/// Title of the dialog if a file cannot be opened.
const LOAD_ERROR: &str = "Could not load file";

/// The window.
pub(crate) struct Viewer {
    canvas: Canvas,
    gpu: Option<Arc<GpuContext>>,
    backend: Backend,
    /// Tets to fill a surface with.
    tets: u32,
    notes: Vec<String>,
    session: Option<Session>,
    loading: Option<Loading>,
    /// The dialog for a file that is open.
    dialog: Option<OpenDialog>,
    /// The error shown in a dialog.
    error: Option<ErrorDialog>,
    style: Style,
    /// True if pinned and attached particles are marked.
    shows_supports: bool,
    tool: Tool,
    clock: FrameClock,
    running: bool,
    has_panel: bool,
    has_help: bool,
    /// Text of the field for a file name.
    file: String,
    /// True while the left button is down after it was pressed on the picture.
    tool_in_use: bool,
    /// The line being drawn, in points of the window.
    line: Vec<Pos2>,
}

impl Viewer {
    pub(crate) fn new(
        creation: &eframe::CreationContext<'_>,
        source: Source,
        backend: Backend,
        tets: u32,
        paused: bool,
    ) -> Self {
        let state = creation.wgpu_render_state.as_ref();
        let mut notes = Vec::new();
        let gpu = match state.map(graphics::share) {
            Some(Ok(gpu)) => Some(gpu),
            Some(Err(why)) => {
                notes.push(why);
                None
            }
            None => None,
        };
        let (canvas, note) = Canvas::new(state, gpu.as_ref());
        notes.extend(note);
        // A page cannot wait for results of the device: there it only draws.
        let gpu = gpu.filter(|_| cfg!(not(target_family = "wasm")));
        let mut viewer = Self {
            canvas,
            gpu,
            backend,
            tets,
            notes,
            session: None,
            loading: None,
            dialog: None,
            error: None,
            style: Style::default(),
            shows_supports: true,
            tool: Tool::default(),
            clock: FrameClock::default(),
            running: !paused,
            has_panel: true,
            has_help: false,
            file: String::new(),
            tool_in_use: false,
            line: Vec::new(),
        };
        viewer.load(&creation.egui_ctx, source);
        viewer
    }

    /// The device, which the threads of simulations keep while they use it.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn device(&self) -> std::sync::Weak<GpuContext> {
        self.gpu.as_ref().map(Arc::downgrade).unwrap_or_default()
    }

    fn load(&mut self, context: &Context, source: Source) {
        let (wake, gpu) = (context.clone(), self.gpu.clone());
        let wake = move || wake.request_repaint();
        self.loading = Some(Loading::start(source, self.backend, gpu, wake));
    }

    fn load_file(&mut self, context: &Context, path: &Path) {
        match Source::new(Some(path), self.tets) {
            Ok(source) => self.load(context, source),
            Err(error) => self.error = Some(ErrorDialog::new(LOAD_ERROR, &error)),
        }
    }

    /// Loads a file of the user of a page.
    #[cfg(target_family = "wasm")]
    fn read_file(
        &mut self,
        context: &Context,
        path: std::path::PathBuf,
        bytes: impl Future<Output = Result<Vec<u8>, String>> + 'static,
    ) {
        let wake = context.clone();
        let wake = move || wake.request_repaint();
        self.loading = Some(Loading::read(path, bytes, self.tets, wake));
    }

    /// Shows an error and pauses.
    fn fail(&mut self, error: &anyhow::Error) {
        self.error = Some(ErrorDialog::new("Simulation paused by an error", error));
        self.pause();
    }

    fn pause(&mut self) {
        self.running = false;
        self.clock.pause();
    }

    /// Takes over what the simulation has done since the last frame of the window.
    fn take_results(&mut self) {
        let Some(outcome) = self.session.as_mut().and_then(Session::poll) else {
            return;
        };
        // Without a pause the stroke would begin again at once.
        if outcome.restarts {
            self.pause();
        }
        // The simulation continues with its old settings.
        if let Some(error) = outcome.refused {
            self.error = Some(ErrorDialog::new("Setting not changed", &error));
        }
        if let Some(error) = outcome.error {
            self.fail(&error);
        }
    }

    fn take_files(&mut self, context: &Context) {
        let dropped = context.input(|input| input.raw.dropped_files.first().cloned());
        let chosen = self.dialog.as_ref().and_then(OpenDialog::poll);
        #[cfg(not(target_family = "wasm"))]
        {
            let chosen = chosen.as_ref().map(|file| file.path());
            if let Some(path) = dropped.as_ref().map(|file| file.path()).or(chosen) {
                self.load_file(context, path);
            }
        }
        #[cfg(target_family = "wasm")]
        {
            if let Some(file) = dropped {
                let path = file.path().to_owned();
                let bytes = async move { file.bytes_async().await };
                self.read_file(context, path, bytes);
            }
            if let Some(file) = chosen {
                let path = file.file_name().into();
                self.read_file(context, path, async move { Ok(file.read().await) });
            }
        }
        let Some(result) = self.loading.as_ref().and_then(Loading::poll) else {
            return;
        };
        self.loading = None;
        match result {
            Ok(session) => {
                context.send_viewport_cmd(egui::ViewportCommand::Title(format!(
                    "{} - incise",
                    session.name
                )));
                // A scene that cuts by itself would be over before it is seen.
                self.running &= !session.waits_for_start();
                self.session = Some(session);
                (self.tool_in_use, self.line) = (false, Vec::new());
                self.clock.pause();
            }
            // The open session stays.
            Err(error) => self.error = Some(ErrorDialog::new(LOAD_ERROR, &error)),
        }
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Pause => {
                self.running = !self.running;
                self.clock.pause();
            }
            Action::Step => {
                self.pause();
                self.with_session(Session::step);
            }
            Action::Reset => self.with_session(Session::reset),
            Action::Undo => self.with_session(Session::undo),
            Action::Use(tool) => {
                self.release();
                self.tool = tool;
                self.with_session(|session| session.message = None);
            }
            Action::Fit => self.with_session(Session::fit),
            Action::Wireframe => self.style.wireframe = !self.style.wireframe,
            Action::Smooth => self.style.smooth = !self.style.smooth,
            Action::Color(by) => self.style.color_by = by,
            Action::Panel => self.has_panel = !self.has_panel,
            Action::Help => self.has_help = !self.has_help,
            Action::Cancel => {
                self.release();
                (self.has_help, self.error) = (false, None);
            }
        }
    }

    fn release(&mut self) {
        self.tool_in_use = false;
        self.line.clear();
        self.with_session(Session::lift_blade);
        self.with_session(Session::release);
    }

    fn with_session(&mut self, act: impl FnOnce(&mut Session)) {
        if let Some(session) = &mut self.session {
            act(session);
        }
    }

    /// Applies mouse input on the picture.
    fn mouse(&mut self, response: &Response, rect: Rect) {
        let context = &response.ctx;
        let size = [f64::from(rect.width()), f64::from(rect.height())];
        let pixel = |at: Pos2| {
            let at = at - rect.min;
            [f64::from(at.x), f64::from(at.y)]
        };
        let Some(session) = &mut self.session else {
            return;
        };
        let by = |button| response.dragged_by(button);
        let delta = response.drag_delta();
        let part = |points: f32| f64::from(points) / size[1];
        // With one button, as on a trackpad, keys replace the others.
        let modifiers = context.input(|input| input.modifiers);
        let primary = by(PointerButton::Primary) && !self.tool_in_use;
        let pans = primary && modifiers.command;
        let orbits = by(PointerButton::Secondary)
            || (primary && !pans && (self.tool == Tool::Orbit || modifiers.shift));
        if orbits {
            session
                .camera
                .orbit(-4.0 * part(delta.x), 4.0 * part(delta.y));
        } else if pans || by(PointerButton::Middle) {
            session.camera.pan(part(delta.x), -part(delta.y));
        }
        if response.hovered() {
            let (wheel, pinch) =
                context.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            let factor = (-0.002 * f64::from(wheel)).exp() / f64::from(pinch);
            if factor != 1.0 {
                session.camera.zoom(factor);
            }
        }
        if self.tool == Tool::Orbit {
            return;
        }
        let primary = PointerButton::Primary;
        if response.drag_started_by(primary) && !orbits && !pans {
            let origin = context.input(|input| input.pointer.press_origin());
            let at = origin
                .or(response.interact_pointer_pos())
                .unwrap_or(rect.min);
            (self.tool_in_use, self.line) = (true, vec![at]);
            match self.tool {
                Tool::Blade => session.press_blade(pixel(at), size),
                _ => session.grab_at(pixel(at), size),
            }
        }
        if !self.tool_in_use {
            return;
        }
        let positions = pointer_positions(context);
        if self.tool == Tool::Blade {
            for at in positions {
                self.line.push(at);
                session.draw_blade(pixel(at), size);
            }
        } else if let Some(at) = positions.last() {
            session.pull(pixel(*at), size);
        }
        // The release of any button ends a drag, so the button itself decides.
        if !context.input(|input| input.pointer.button_down(primary)) {
            self.release();
        }
    }

    /// Starts the commands that wait and the frames that are due, unless the simulation is away.
    fn advance(&mut self, context: &Context, picks: bool) {
        let Some(session) = &mut self.session else {
            return;
        };
        let mut frames = 0;
        if self.running && session.can_step() {
            let (time_step, frame_ms) = (session.solver().time_step, session.view.frame_ms);
            frames = self.clock.take_due(Instant::now(), time_step, frame_ms);
        }
        let wake = context.clone();
        session.start(frames, picks || self.canvas.needs_positions(), move || {
            wake.request_repaint();
        });
    }

    fn picture(&mut self, ui: &mut Ui) {
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        self.mouse(&response, rect);
        let Some(session) = &mut self.session else {
            return;
        };
        session.color(self.style.color_by);
        // A state is drawn before the simulation leaves with it.
        let drawn = self.canvas.show(ui, rect, session, &self.style);
        if self.shows_supports {
            supports(ui, rect, session);
        }
        overlay(ui, rect, session, &self.line);
        if let Err(error) = drawn {
            self.fail(&error);
        }
        let picks = self.tool != Tool::Orbit && (response.hovered() || self.tool_in_use);
        self.advance(ui.ctx(), picks);
    }

    /// The text of the status line: the result of the last input, else the state and what the tool does.
    fn status(&self) -> String {
        let Some(session) = &self.session else {
            return "No body: drop a scene, a mesh or a closed surface onto the window".to_owned();
        };
        if let Some(message) = session.message {
            return message.to_owned();
        }
        let state = if self.running {
            "Running"
        } else if session.waits_for_start() {
            "Paused: press Space to start the scene"
        } else {
            "Paused: press Space to resume"
        };
        let tool = match self.tool {
            Tool::Blade if session.cuts() && !self.running => {
                "The line is cut when the simulation resumes"
            }
            Tool::Blade => "Drag across the body to cut",
            Tool::Grab => "Drag the body to pull it",
            Tool::Orbit => "Drag to orbit",
        };
        format!("{state}. {tool}; Shift and drag to orbit, Ctrl and drag to pan, scroll to zoom.")
    }

    fn windows(&mut self, context: &Context) {
        if let Some(loading) = &self.loading {
            Window::new("Loading")
                .title_bar(false)
                .resizable(false)
                .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
                .show(context, |ui| {
                    ui.horizontal(|ui| {
                        ui.spinner();
                        let seconds = loading.since.elapsed().as_secs();
                        ui.label(format!("{}, {seconds} s", loading.name));
                    });
                });
        }
        if context.input(|input| !input.raw.hovered_files.is_empty()) {
            Window::new("Drop")
                .title_bar(false)
                .resizable(false)
                .anchor(Align2::CENTER_CENTER, [0.0, 60.0])
                .show(context, |ui| {
                    ui.label("Drop to open: scene, tet mesh or closed surface");
                });
        }
        if let Some(error) = &self.error {
            let mut closed = false;
            Window::new(error.title)
                .collapsible(false)
                .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
                .show(context, |ui| {
                    ui.label(&error.text);
                    closed = ui.button("Close").clicked();
                });
            if closed {
                self.error = None;
            }
        }
        if self.has_help {
            help::show(context, &mut self.has_help);
        }
    }

    fn apply(&mut self, context: &Context, commands: UiCommands) {
        if let Some(path) = commands.file {
            self.load_file(context, &path);
        }
        if commands.asks_for_file {
            let wake = context.clone();
            self.dialog = Some(OpenDialog::open(move || wake.request_repaint()));
        }
        for action in commands.actions {
            self.act(action);
        }
        if let Some(on) = commands.measure {
            self.with_session(|session| session.measure(on));
        }
        if let Some(change) = commands.change {
            self.with_session(|session| session.change_setting(change));
        }
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.take_files(&context);
        self.take_results();
        // A key that is held down does not step faster than the simulation.
        let repeats = !self.session.as_ref().is_some_and(Session::is_busy);
        for action in help::actions(&context, repeats) {
            self.act(action);
        }
        let mut commands = UiCommands::default();
        if self.has_panel {
            let mut controls = Controls {
                running: self.running,
                tool: self.tool,
                style: &mut self.style,
                clock: &mut self.clock,
                has_gpu: self.gpu.is_some(),
                file: &mut self.file,
                shows_supports: &mut self.shows_supports,
                notes: &self.notes,
            };
            let session = self.session.as_mut();
            Panel::right("panel").exact_size(340.0).show(ui, |ui| {
                commands = panel::show(ui, session, &mut controls);
            });
        }
        self.apply(&context, commands);
        Panel::bottom("status").show(ui, |ui| ui.label(self.status()));
        CentralPanel::default()
            .frame(Frame::NONE)
            .show(ui, |ui| self.picture(ui));
        self.windows(&context);
        #[cfg(target_family = "wasm")]
        crate::page::publish(
            self.session.as_ref().map(|session| &session.view.report),
            self.error.as_ref().map(|error| error.text.as_str()),
        );
        // While the simulation is away, only input changes the picture; its return wakes the window.
        let session = self.session.as_ref();
        let waits = self.running && session.is_some_and(Session::can_step);
        if waits || self.loading.is_some() {
            context.request_repaint();
        }
    }
}

/// All pointer positions since the last frame while the left button was down, so that a fast stroke keeps its shape.
fn pointer_positions(context: &Context) -> Vec<Pos2> {
    context.input(|input| {
        let mut positions = Vec::new();
        for event in &input.raw.events {
            match event {
                egui::Event::PointerMoved(at) => positions.push(*at),
                egui::Event::PointerButton {
                    button: PointerButton::Primary,
                    pressed: true,
                    ..
                } => positions.clear(),
                egui::Event::PointerButton {
                    button: PointerButton::Primary,
                    pressed: false,
                    ..
                } => break,
                _ => {}
            }
        }
        positions
    })
}

/// Projection of points to the window.
fn projected(rect: Rect, session: &Session) -> impl Fn(DVec3) -> Option<Pos2> + '_ {
    let size = [f64::from(rect.width()), f64::from(rect.height())];
    move |point| {
        let at = session.camera.project(point, size)?;
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a window")]
        let at = rect.min + egui::vec2(at.x as f32, at.y as f32);
        Some(at)
    }
}

/// Marks pinned and attached particles on the side of the body that faces the camera.
fn supports(ui: &Ui, rect: Rect, session: &Session) {
    let view = &session.view;
    let supports = &view.supports;
    if supports.iter().all(|support| *support == Support::Free) {
        return;
    }
    let (positions, eye) = (&view.positions, session.camera.eye());
    let mut faces_eye = vec![false; positions.len()];
    for triangle in &view.boundary {
        let [a, b, c] = triangle.particles.map(|p| positions[p.index()]);
        if (b - a).cross(c - a).dot(eye - a) > 0.0 {
            for p in triangle.particles {
                faces_eye[p.index()] = true;
            }
        }
    }
    let (painter, project) = (ui.painter_at(rect), projected(rect, session));
    for ((&x, support), _) in positions
        .iter()
        .zip(supports)
        .zip(faces_eye)
        .filter(|mark| mark.1)
    {
        let color = match support {
            Support::Pinned => Color32::from_rgb(40, 40, 40),
            Support::Attached => Color32::from_rgb(30, 90, 190),
            _ => continue,
        };
        if let Some(at) = project(x) {
            painter.circle_filled(at, 2.0, color);
        }
    }
}

/// Draws the line of the blade, lines that wait to be cut, and the target of the grab.
fn overlay(ui: &Ui, rect: Rect, session: &Session, line: &[Pos2]) {
    let (painter, project) = (ui.painter_at(rect), projected(rect, session));
    let dashed = Stroke::new(1.5, Color32::from_rgb(190, 30, 30));
    for waiting in session.waiting_lines() {
        let points: Vec<Pos2> = waiting.into_iter().filter_map(&project).collect();
        painter.extend(Shape::dashed_line(&points, dashed, 8.0, 5.0));
    }
    if session.cuts() && line.len() > 1 {
        let thin = Stroke::new(1.5, Color32::from_rgb(190, 30, 30));
        painter.line(line.to_vec(), thin);
    }
    if let Some(at) = session.grab_target().and_then(project) {
        painter.circle_stroke(at, 7.0, Stroke::new(2.0, Color32::from_rgb(30, 90, 190)));
    }
}

#[cfg(test)]
mod tests {
    use eframe::egui::{Event, Key, Modifiers, RawInput, pos2, vec2};

    use super::*;
    use crate::load::TETS;

    /// A window without a screen or device that shows a block, paused.
    struct Screen {
        context: Context,
        viewer: Viewer,
    }

    impl Screen {
        fn new() -> Self {
            let context = Context::default();
            let text = "[[body]]\nshape = { kind = \"box\", tets = 600 }\nscale = 0.2\n";
            let source = Source::from_bytes(Path::new("block.toml"), text.into(), TETS).unwrap();
            let creation = eframe::CreationContext::_new_kittest(context.clone());
            let viewer = Viewer::new(&creation, source, Backend::Cpu, TETS, true);
            let mut screen = Self { context, viewer };
            while screen.viewer.session.is_none() {
                screen.frame(Vec::new());
            }
            screen
        }

        fn session(&mut self) -> &mut Session {
            self.viewer.session.as_mut().unwrap()
        }

        fn frame(&mut self, events: Vec<Event>) {
            let input = RawInput {
                screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(640.0, 400.0))),
                events,
                ..RawInput::default()
            };
            let mut frame = eframe::Frame::_new_kittest();
            let viewer = &mut self.viewer;
            let output = self
                .context
                .run_ui(input, |ui| eframe::App::ui(viewer, ui, &mut frame));
            output.drop_without_applying_deltas();
        }

        fn key(&mut self, key: Key) {
            self.frame(vec![Event::Key {
                key,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers: Modifiers::NONE,
            }]);
        }

        fn drag(&mut self, button: PointerButton, from: Pos2, to: Pos2) {
            let press = |pos, pressed| Event::PointerButton {
                pos,
                button,
                pressed,
                modifiers: Modifiers::NONE,
            };
            self.frame(vec![Event::PointerMoved(from)]);
            self.frame(vec![press(from, true)]);
            for i in 1_u8..=10 {
                let at = from + (to - from) * (f32::from(i) / 10.0);
                self.frame(vec![Event::PointerMoved(at)]);
            }
            self.frame(vec![press(to, false)]);
        }
    }

    #[test]
    fn the_window_responds_while_a_frame_is_computed() {
        let mut screen = Screen::new();
        let go = screen.session().send_away();
        screen.key(Key::Space);
        let before = screen.session().camera;
        screen.drag(
            PointerButton::Secondary,
            pos2(100.0, 200.0),
            pos2(180.0, 220.0),
        );
        assert_ne!(screen.session().camera, before);
        screen.session().camera = before;
        screen.key(Key::W);
        assert!(screen.viewer.style.wireframe && screen.viewer.running);
        screen.key(Key::P);
        assert!(!screen.viewer.has_panel);
        // A line across the body, which the simulation cuts when it is back.
        screen.drag(
            PointerButton::Primary,
            pos2(325.0, 20.0),
            pos2(325.0, 360.0),
        );
        assert!(screen.session().cuts());
        assert!(screen.session().simulation().is_none());
        assert_eq!(screen.session().view.next_frame, 0);
        go.send(()).unwrap();
        while screen.session().cuts() || screen.session().view.report.pieces < 2 {
            screen.frame(Vec::new());
        }
        assert!(screen.viewer.error.is_none());
        // Undo pauses only for strokes of the scene.
        screen.key(Key::U);
        while screen.session().view.report.pieces > 1 {
            screen.frame(Vec::new());
        }
        assert!(screen.viewer.running);
    }

    #[test]
    fn an_error_of_the_simulation_opens_a_dialog_and_pauses() {
        let mut screen = Screen::new();
        let gate = screen.session().send_away();
        screen.key(Key::Space);
        // Without its sender the wait fails.
        drop(gate);
        while screen.viewer.error.is_none() {
            screen.frame(Vec::new());
        }
        assert!(!screen.viewer.running);
        screen.key(Key::Escape);
        assert!(screen.viewer.error.is_none());
        screen.key(Key::Period);
        while screen.session().view.next_frame == 0 {
            screen.frame(Vec::new());
        }
    }

    #[test]
    fn another_body_is_opened_while_a_frame_is_computed() {
        let mut screen = Screen::new();
        let go = screen.session().send_away();
        screen.session().step();
        let text = "[[body]]\nshape = { kind = \"sphere\", tets = 300 }\n";
        let source = Source::from_bytes(Path::new("ball.toml"), text.into(), TETS).unwrap();
        let context = screen.context.clone();
        screen.viewer.load(&context, source);
        while screen.session().name != "ball.toml" {
            screen.frame(Vec::new());
        }
        screen.key(Key::Period);
        while screen.session().view.next_frame == 0 {
            screen.frame(Vec::new());
        }
        // The thread of the first body ends without a receiver.
        go.send(()).unwrap();
    }
}
