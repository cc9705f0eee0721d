//! The side panel: counts of the body, stage times of a frame, and solver settings.

use std::path::PathBuf;

use eframe::egui::{
    Button, Checkbox, Color32, ComboBox, Grid, Key, RichText, ScrollArea, Slider, TextEdit, Ui,
};
use incise_render::{ColorBy, Legend, Style};

use crate::frame_clock::FrameClock;
use crate::help::Action;
use crate::session::Session;
use crate::settings::{self, SettingChange};
use crate::tool::Tool;

/// State of the window that the panel shows and changes, beside the scene.
#[derive(Debug)]
pub(crate) struct Controls<'a> {
    pub(crate) running: bool,
    pub(crate) tool: Tool,
    pub(crate) style: &'a mut Style,
    pub(crate) clock: &'a mut FrameClock,
    /// True if a GPU can be chosen.
    pub(crate) has_gpu: bool,
    /// The text of the field for a file.
    pub(crate) file: &'a mut String,
    /// True if pinned and attached particles are marked.
    pub(crate) shows_supports: &'a mut bool,
    /// Notes about the backend and the renderer.
    pub(crate) notes: &'a [String],
}

/// Commands given in the panel.
#[derive(Debug, Default)]
pub(crate) struct UiCommands {
    pub(crate) actions: Vec<Action>,
    pub(crate) change: Option<SettingChange>,
    /// A file to open.
    pub(crate) file: Option<PathBuf>,
    /// True if a dialog shall ask for a file.
    pub(crate) asks_for_file: bool,
    /// New state of the checkbox for residuals, if it was changed.
    pub(crate) measure: Option<bool>,
}

/// Shows the panel; without a scene only the field to open a file.
pub(crate) fn show(
    ui: &mut Ui,
    session: Option<&mut Session>,
    controls: &mut Controls<'_>,
) -> UiCommands {
    let mut commands = UiCommands::default();
    ScrollArea::vertical().show(ui, |ui| {
        ui.add_space(4.0);
        files(ui, controls, &mut commands);
        ui.separator();
        let mut note = None;
        if let Some(session) = session {
            ui.heading(&session.name);
            buttons(ui, session, controls, &mut commands);
            ui.separator();
            tools(ui, session, controls, &mut commands);
            ui.separator();
            look(ui, session, controls);
            ui.separator();
            counts(ui, session, controls, &mut commands);
            session.view.times.show(ui);
            ui.separator();
            ui.strong("Speed and accuracy");
            let on_gpu = session.view.on_device;
            commands.change = settings::show(ui, session.solver(), controls.has_gpu, on_gpu);
            effects(ui, session);
            ui.separator();
            note = session.view.backend_note.as_deref();
        }
        for note in controls.notes.iter().map(String::as_str).chain(note) {
            ui.label(note);
        }
    });
    commands
}

fn buttons(ui: &mut Ui, session: &Session, controls: &mut Controls<'_>, commands: &mut UiCommands) {
    ui.horizontal_wrapped(|ui| {
        let pause = if controls.running { "Pause" } else { "Resume" };
        for (text, action, on) in [
            (pause, Action::Pause, true),
            ("Step", Action::Step, !controls.running),
            ("Reset", Action::Reset, true),
            ("Undo", Action::Undo, session.view.undo_points > 0),
            ("Fit", Action::Fit, true),
            ("Help", Action::Help, true),
        ] {
            if ui.add_enabled(on, Button::new(text)).clicked() {
                commands.actions.push(action);
            }
        }
    });
    ui.add(
        Slider::new(&mut controls.clock.speed, 0.05..=2.0)
            .logarithmic(true)
            .text("Speed (x real time)"),
    )
    .on_hover_text("Simulated seconds per second, if the frame time allows it");
}

fn tools(
    ui: &mut Ui,
    session: &mut Session,
    controls: &mut Controls<'_>,
    commands: &mut UiCommands,
) {
    ui.horizontal(|ui| {
        for (tool, name) in [
            (Tool::Blade, "Cut"),
            (Tool::Grab, "Grab"),
            (Tool::Orbit, "Orbit"),
        ] {
            let mut chosen = controls.tool;
            if ui.selectable_value(&mut chosen, tool, name).clicked() {
                commands.actions.push(Action::Use(tool));
            }
        }
    });
    let tool_settings = &mut session.tool_settings;
    match controls.tool {
        Tool::Blade => {
            ui.add(
                Slider::new(&mut tool_settings.depth, 0.02..=1.0)
                    .text("Depth")
                    .custom_formatter(|depth, _| match depth {
                        depth if depth >= 1.0 => "Through".to_owned(),
                        depth => format!("{:.0}%", 100.0 * depth),
                    }),
            )
            .on_hover_text("Depth of the blade below the surface, in % of the body's size");
            ui.add(Slider::new(&mut tool_settings.snap, 0.0..=0.25).text("Snap (part of an edge)"))
                .on_hover_text(
                    "The cut moves to particles that are closer than this: better tets, a rougher cut",
                );
        }
        Tool::Grab => {
            ui.add(
                Slider::new(&mut tool_settings.radius, 0.01..=0.3)
                    .text("Radius (part of the size)"),
            )
            .on_hover_text("Particles within this distance of the pointer are pulled");
            ui.add(
                Slider::new(&mut tool_settings.compliance, 1e-5..=1.0)
                    .logarithmic(true)
                    .text("Compliance (m/N)"),
            )
            .on_hover_text("Softness of the grab of each particle: metres per newton");
        }
        Tool::Orbit => {}
    }
}

fn look(ui: &mut Ui, session: &Session, controls: &mut Controls<'_>) {
    let style = &mut *controls.style;
    ui.horizontal(|ui| {
        ComboBox::from_label("Color by")
            .selected_text(style.color_by.to_string())
            .show_ui(ui, |ui| {
                for by in ColorBy::ALL {
                    ui.selectable_value(&mut style.color_by, by, by.to_string());
                }
            });
        ui.checkbox(&mut style.wireframe, "Wireframe");
        ui.checkbox(&mut style.smooth, "Smooth");
    });
    ui.checkbox(
        controls.shows_supports,
        "Mark pinned and attached particles",
    );
    if let Some(legend) = &session.view.legend {
        bar(ui, legend);
    } else if style.color_by == ColorBy::Residual {
        ui.label(RichText::new("No residuals of tets yet (VBD has none)").small());
    }
}

/// The colors of a legend from low to high.
fn bar(ui: &mut Ui, legend: &Legend) {
    use eframe::egui::{Rect, Sense, vec2};

    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 10.0), Sense::hover());
    let parts = 48;
    for part in 0..parts {
        let [red, green, blue] = legend.color((f64::from(part) + 0.5) / f64::from(parts));
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let width = rect.width() / parts as f32;
        let left = rect.left() + width * part as f32;
        let strip =
            Rect::from_min_size([left, rect.top()].into(), vec2(width + 1.0, rect.height()));
        ui.painter()
            .rect_filled(strip, 0.0, Color32::from_rgb(red, green, blue));
    }
    let scale = if legend.logarithmic {
        ", logarithmic"
    } else {
        ""
    };
    let Legend {
        low, high, unit, ..
    } = legend;
    ui.label(
        RichText::new(format!(
            "{} to {} {unit}{scale}",
            number(*low),
            number(*high)
        ))
        .small(),
    );
}

fn number(value: f64) -> String {
    match value {
        value if value != 0.0 && !(1e-2..1e4).contains(&value.abs()) => format!("{value:.1e}"),
        value => format!("{value:.2}"),
    }
}

fn counts(ui: &mut Ui, session: &Session, controls: &Controls<'_>, commands: &mut UiCommands) {
    let report = &session.view.report;
    let mut rows = vec![
        (
            "Frame",
            format!("{} ({:.2} s)", report.frame, report.time_s),
        ),
        ("Tets", report.tets.to_string()),
        ("Particles", report.particles.to_string()),
        ("Pieces", report.pieces.to_string()),
        ("Clusters", report.clusters.to_string()),
        ("Colors", report.colors.to_string()),
        (
            "Frame time",
            format!(
                "{:.1} ms (budget {:.0} ms)",
                session.view.frame_ms,
                1e3 * session.solver().time_step,
            ),
        ),
        (
            "Speed",
            format!("{:.2}x real time", controls.clock.reached()),
        ),
    ];
    let measured = session.view.measured.as_ref();
    if let Some(residual) = measured.and_then(|report| report.residual) {
        let force = residual.force_relative.map_or_else(
            || format!("{} N", number(residual.force)),
            |relative| format!("{} x weight", number(relative)),
        );
        rows.push(("Unbalanced force", force));
    }
    if let Some(error) = measured.and_then(|report| report.volume_error) {
        rows.push(("Volume error", format!("{:.2}%", 100.0 * error)));
    }
    let inverted = measured.and_then(|report| report.inverted_tets);
    if let Some(inverted) = inverted.filter(|&count| count > 0) {
        rows.push(("Inverted tets", inverted.to_string()));
    }
    rows.push((
        "Backend",
        format!("{}, {}", report.backend.to_uppercase(), report.precision),
    ));
    Grid::new("counts")
        .num_columns(2)
        .spacing([16.0, 2.0])
        .show(ui, |ui| {
            for (name, value) in rows {
                ui.label(name);
                ui.label(RichText::new(value).strong());
                ui.end_row();
            }
        });
    // Displayed residuals have to be measured.
    let free = controls.style.color_by != ColorBy::Residual;
    let mut measures = session.measures();
    let mark = Checkbox::new(&mut measures, "Measure the residual (slower)");
    if ui.add_enabled(free, mark).changed() {
        commands.measure = Some(measures);
    }
}

/// A button for the dialog, and a field for a file name where there is none, as in a window of another machine.
fn files(ui: &mut Ui, controls: &mut Controls<'_>, commands: &mut UiCommands) {
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(controls.file).hint_text("Scene, mesh or surface file");
        if ui.button("Open...").clicked() {
            commands.asks_for_file = true;
        }
        if cfg!(target_family = "wasm") {
            ui.label("or drop a file onto the page");
            return;
        }
        let typed = ui.add(field.desired_width(180.0));
        let enter = typed.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        let on = !controls.file.trim().is_empty();
        if ui.add_enabled(on, Button::new("Open")).clicked() || (enter && on) {
            commands.file = Some(controls.file.trim().into());
        }
    });
}

fn effects(ui: &mut Ui, session: &Session) {
    for effect in session.view.effects.changes() {
        ui.label(RichText::new(&effect.what).strong());
        let mut text = effect.time();
        let residual = effect.residual();
        if !residual.is_empty() {
            text = format!("{text}; {residual}");
        }
        ui.label(RichText::new(text).small());
    }
}
