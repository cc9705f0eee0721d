//! [`Session`]: a simulation that is shown and edited in the window.
//!
//! A session owns all data of a loaded scene: the simulation, its render scene, undo points, the blade and the grab in
//! use. Input comes in pixels and is converted to world space here.

mod interaction;

use std::collections::VecDeque;

use anyhow::Context;
use incise::mesh::glam::DVec3;
use incise::report::FrameReport;
use incise::scene::{Quantity, ReportSpec, SolverSpec};
use incise::{Grab, Scene, Simulation, Snapshot};
use incise_render::{Camera, ColorBy, Legend, RenderScene};
use web_time::Instant;

use self::interaction::Line;
use crate::history::{History, UndoPoint};
use crate::load::Loaded;
use crate::setting_effects::SettingEffects;
use crate::settings::SettingChange;
use crate::times::Times;
use crate::tool::ToolSettings;

/// Interval in frames between measurements of residuals.
const EVERY: u64 = 5;

/// A grab in use.
#[derive(Clone, Copy, Debug)]
struct ActiveGrab {
    grab: Grab,
    /// Depth of the target along the camera's direction in m.
    depth: f64,
    /// Target of the grab.
    to: DVec3,
}

/// A loaded simulation with its view and tools.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) name: String,
    pub(crate) scene: Scene,
    pub(crate) simulation: Simulation,
    pub(crate) render_scene: RenderScene,
    pub(crate) camera: Camera,
    pub(crate) tool_settings: ToolSettings,
    pub(crate) times: Times,
    pub(crate) effects: SettingEffects,
    /// Time of the last frame in ms, until the device had finished.
    pub(crate) frame_ms: f64,
    /// The scale of the colors, if they represent numbers.
    pub(crate) legend: Option<Legend>,
    /// The quantity that the colors show.
    shown: ColorBy,
    /// The last report that measured the body.
    pub(crate) measured: Option<FrameReport>,
    /// True if residuals are measured.
    measures: bool,
    start: Snapshot,
    history: History,
    /// Drawn lines that are not cut to their end, oldest first.
    lines: VecDeque<Line>,
    active_grab: Option<ActiveGrab>,
    /// Result of the last input, for the status line.
    pub(crate) message: Option<&'static str>,
    /// The diagonal of all bodies when they were loaded, in m.
    extent: f64,
    /// First frames of the scene's own strokes.
    scripted: Vec<u64>,
}

impl Session {
    pub(crate) fn new(loaded: Loaded) -> anyhow::Result<Self> {
        let Loaded {
            name,
            scene,
            mut simulation,
        } = loaded;
        let render_scene = RenderScene::new(&simulation, &scene);
        let [low, high] = render_scene.bounds(&simulation);
        let start = simulation.snapshot()?;
        let mut session = Self {
            name,
            scripted: scene
                .stroke
                .iter()
                .map(|stroke| stroke.first_frame())
                .collect(),
            scene,
            simulation,
            render_scene,
            camera: Camera::fit(low, high),
            tool_settings: ToolSettings::default(),
            times: Times::default(),
            effects: SettingEffects::default(),
            frame_ms: 0.0,
            legend: None,
            shown: ColorBy::Tissue,
            measured: None,
            measures: false,
            start,
            history: History::default(),
            lines: VecDeque::new(),
            active_grab: None,
            message: None,
            extent: (high - low).length(),
        };
        session.measure(true)?;
        Ok(session)
    }

    /// True if residuals are measured.
    pub(crate) fn measures(&self) -> bool {
        self.measures
    }

    /// Turns the measurement of residuals on or off.
    pub(crate) fn measure(&mut self, on: bool) -> anyhow::Result<()> {
        let mut report = ReportSpec::default();
        if on {
            report = ReportSpec::default().with(|spec| {
                spec.every = EVERY;
                spec.quantities = vec![Quantity::Residual, Quantity::Volume];
            });
        }
        self.simulation.set_report(report)?;
        (self.measures, self.measured) = (on, None);
        Ok(())
    }

    /// Advances by one frame. If that fails, drawn lines are dropped and the whole body is drawn again.
    pub(crate) fn step(&mut self) -> anyhow::Result<()> {
        let result = self.frame();
        if result.is_err() {
            self.drop_lines();
            self.render_scene.reset(&self.simulation);
        }
        result
    }

    fn frame(&mut self) -> anyhow::Result<()> {
        let frame = self.simulation.next_frame();
        if self.scripted.contains(&frame) {
            let point = self.undo_point(true)?;
            self.history.push(point);
        }
        self.move_blade()?;
        let start = Instant::now();
        let report = self.simulation.step()?.clone();
        self.wait()?;
        self.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        self.render_scene.sync(&self.simulation);
        self.show_scripted_blade(frame);
        self.times.note(report.frame, report.ms);
        self.effects.note(&report, self.frame_ms);
        if report.cut.is_some() {
            self.note_cut();
        }
        if report.residual.is_some() {
            self.measured = Some(report);
        }
        Ok(())
    }

    /// Shows the blade of the scene's own strokes in a frame, unless a line is being drawn or cut.
    fn show_scripted_blade(&mut self, frame: u64) {
        if self.lines.is_empty() && !self.scripted.is_empty() {
            let strokes = self.scene.stroke.iter();
            let blade = strokes.filter_map(|stroke| stroke.blade_at(frame)).next();
            self.render_scene.set_blade(blade.as_deref());
        }
    }

    /// Waits for the device, so that times are those of its work.
    fn wait(&self) -> anyhow::Result<()> {
        match self.simulation.device_solvers().next() {
            Some(solver) => Ok(solver.gpu().wait()?),
            None => Ok(()),
        }
    }

    /// True in a scene with strokes of its own that has not begun.
    pub(crate) fn waits_for_start(&self) -> bool {
        self.simulation.next_frame() == 0 && !self.scripted.is_empty()
    }

    pub(crate) fn report(&self) -> &FrameReport {
        self.simulation.report()
    }

    /// Colors the body for the present frame; as tissue while no residual has been measured.
    pub(crate) fn color(&mut self, by: ColorBy) -> anyhow::Result<()> {
        let residuals = match by {
            ColorBy::Residual => self.simulation.residuals_of_tets(),
            _ => None,
        };
        let by = match (by, &residuals) {
            // Between two measured frames the colors of the last one stay.
            (ColorBy::Residual, None) if self.shown == by => return Ok(()),
            (ColorBy::Residual, None) => ColorBy::Tissue,
            _ => by,
        };
        let painted = self
            .render_scene
            .color(&mut self.simulation, by, residuals.as_deref());
        (self.legend, self.shown) = (painted?, by);
        Ok(())
    }

    /// Fits the view to the body.
    pub(crate) fn fit(&mut self) {
        let [low, high] = self.render_scene.bounds(&self.simulation);
        let fitted = Camera::fit(low, high);
        (self.camera.target, self.camera.distance) = (fitted.target, fitted.distance);
    }

    /// The present state with the stroke and the grab in use.
    fn undo_point(&mut self, scripted: bool) -> anyhow::Result<UndoPoint> {
        Ok(UndoPoint {
            snapshot: self.simulation.snapshot()?,
            scripted,
            stroke: self.lines.front().and_then(|line| line.stroke),
            grab: self.active_grab.map(|active| active.grab),
        })
    }

    /// Number of strokes and resets that can be undone.
    pub(crate) fn undo_points(&self) -> usize {
        self.history.len()
    }

    /// Undoes the last stroke or reset; returns true for a stroke that is part of the scene and begins again, and `None` if
    /// there is nothing to undo.
    pub(crate) fn undo(&mut self) -> anyhow::Result<Option<bool>> {
        let Some(point) = self.history.pop() else {
            return Ok(None);
        };
        self.go_to(&point)?;
        Ok(Some(point.scripted))
    }

    /// Resets to the first frame. The state before can be restored by [`Session::undo`].
    pub(crate) fn reset(&mut self) -> anyhow::Result<()> {
        if self.simulation.next_frame() > 0 {
            let before = self.undo_point(false)?;
            self.history.push(before);
        }
        let start = UndoPoint {
            snapshot: self.start.clone(),
            scripted: false,
            stroke: None,
            grab: None,
        };
        self.go_to(&start)
    }

    /// Restores the state of an undo point with the present solver settings and without a blade or grab.
    fn go_to(&mut self, point: &UndoPoint) -> anyhow::Result<()> {
        self.drop_lines();
        self.release();
        let spec = self.simulation.solver_spec().clone();
        self.simulation.restore(&point.snapshot)?;
        // The stroke and the grab of that state are active again, but no input ends them: end them here.
        if let Some(stroke) = point.stroke {
            self.simulation.end_stroke(stroke)?;
        }
        if let Some(grab) = point.grab {
            self.simulation.release(grab)?;
        }
        let changed = self.simulation.set_solver(&spec);
        let measured = self.measure(self.measures);
        // The body has changed even if the settings could not be kept.
        self.repaint()?;
        changed?;
        measured
    }

    /// Redraws from the host's state; the device's state is drawn again after the next step.
    fn repaint(&mut self) -> anyhow::Result<()> {
        self.simulation.read_back()?;
        self.render_scene.reset(&self.simulation);
        (self.legend, self.shown) = (None, ColorBy::Tissue);
        Ok(())
    }

    /// Applies a changed setting.
    pub(crate) fn change_setting(&mut self, change: &SettingChange) -> anyhow::Result<()> {
        let SettingChange {
            setting,
            from,
            to,
            spec,
        } = change;
        self.simulation
            .set_solver(spec)
            .with_context(|| format!("{setting} not changed, it stays at {from}"))?;
        self.effects.note_change(setting, from, to);
        self.repaint()
    }

    pub(crate) fn solver(&self) -> &SolverSpec {
        self.simulation.solver_spec()
    }
}

#[cfg(test)]
mod tests;
