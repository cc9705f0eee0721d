//! [`Session`]: a simulation that is shown and edited in the window.
//!
//! It holds what belongs to a loaded scene: the simulation, what is drawn of it, the strokes that can be taken back, the
//! blade and the hand in use. Input comes as pixels; what it means in space is decided here.

mod interaction;

use std::collections::VecDeque;
use std::time::Instant;

use anyhow::Context;
use incise::mesh::glam::DVec3;
use incise::report::FrameReport;
use incise::scene::{Quantity, ReportSpec, SolverSpec};
use incise::{Grab, Scene, Simulation, Snapshot};
use incise_render::{Camera, ColorBy, Legend, RenderScene};

use self::interaction::Line;
use crate::history::{History, UndoPoint};
use crate::knobs::SettingChange;
use crate::load::Loaded;
use crate::setting_effects::SettingEffects;
use crate::times::Times;
use crate::tool::Grip;

/// Residuals are measured every so many frames.
const EVERY: u64 = 5;

/// A hand in use.
#[derive(Clone, Copy, Debug)]
struct Hold {
    grab: Grab,
    /// How far from the eye along the camera's direction, in m.
    depth: f64,
    /// Where it pulls to.
    to: DVec3,
}

/// A simulation at work.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) name: String,
    pub(crate) scene: Scene,
    pub(crate) simulation: Simulation,
    pub(crate) painting: RenderScene,
    pub(crate) camera: Camera,
    pub(crate) grip: Grip,
    pub(crate) times: Times,
    pub(crate) effects: SettingEffects,
    /// Time of the last frame until it was done, on a device too, in ms.
    pub(crate) frame_ms: f64,
    /// What the colors mean, if they stand for numbers.
    pub(crate) legend: Option<Legend>,
    /// What is shown by the colors.
    shown: ColorBy,
    /// The last report that measured the body.
    pub(crate) measured: Option<FrameReport>,
    /// Whether residuals are measured.
    measures: bool,
    start: Snapshot,
    history: History,
    /// Drawn lines that the body has not met to the end, oldest first.
    lines: VecDeque<Line>,
    hold: Option<Hold>,
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
        let painting = RenderScene::new(&simulation, &scene);
        let [low, high] = painting.bounds(&simulation);
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
            painting,
            camera: Camera::fit(low, high),
            grip: Grip::default(),
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
            hold: None,
            extent: (high - low).length(),
        };
        session.measure(true)?;
        Ok(session)
    }

    /// Whether residuals are measured.
    pub(crate) fn measures(&self) -> bool {
        self.measures
    }

    /// Has residuals measured or not.
    pub(crate) fn measure(&mut self, on: bool) -> anyhow::Result<()> {
        let mut report = ReportSpec::default();
        if on {
            report = ReportSpec {
                every: EVERY,
                quantities: vec![Quantity::Residual, Quantity::Volume],
            };
        }
        self.simulation.set_report(report)?;
        (self.measures, self.measured) = (on, None);
        Ok(())
    }

    /// Advances by one frame. If that fails, blades are taken away, and what is drawn is what is there.
    pub(crate) fn step(&mut self) -> anyhow::Result<()> {
        let result = self.frame();
        if result.is_err() {
            self.drop_lines();
            self.painting.reset(&self.simulation);
        }
        result
    }

    fn frame(&mut self) -> anyhow::Result<()> {
        let frame = self.simulation.next_frame();
        if self.scripted.contains(&frame) {
            let moment = self.moment(true)?;
            self.history.keep(moment);
        }
        self.move_blade()?;
        let start = Instant::now();
        let report = self.simulation.step()?.clone();
        self.wait()?;
        self.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        self.painting.sync(&self.simulation);
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
            self.painting.set_blade(blade.as_deref());
        }
    }

    /// Waits for the device, so that times are those of its work.
    fn wait(&self) -> anyhow::Result<()> {
        match self.simulation.device_solvers().next() {
            Some(solver) => Ok(solver.gpu().wait()?),
            None => Ok(()),
        }
    }

    pub(crate) fn report(&self) -> &FrameReport {
        self.simulation.report()
    }

    /// Colors the body for the present frame; as tissue where residuals are to be shown and none is known yet.
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
            .painting
            .color(&mut self.simulation, by, residuals.as_deref());
        (self.legend, self.shown) = (painted?, by);
        Ok(())
    }

    /// Sees the whole body.
    pub(crate) fn fit(&mut self) {
        let [low, high] = self.painting.bounds(&self.simulation);
        let fitted = Camera::fit(low, high);
        (self.camera.target, self.camera.distance) = (fitted.target, fitted.distance);
    }

    /// The present moment, with what hands are doing in it.
    fn moment(&mut self, scripted: bool) -> anyhow::Result<UndoPoint> {
        Ok(UndoPoint {
            snapshot: self.simulation.snapshot()?,
            scripted,
            stroke: self.lines.front().and_then(|line| line.stroke),
            grab: self.hold.map(|hold| hold.grab),
        })
    }

    /// The strokes that can be taken back.
    pub(crate) fn strokes(&self) -> usize {
        self.history.len()
    }

    /// Goes back to before the last stroke; tells whether that one will begin again by itself, and nothing if there is
    /// none.
    pub(crate) fn undo(&mut self) -> anyhow::Result<Option<bool>> {
        let Some(moment) = self.history.take() else {
            return Ok(None);
        };
        self.go_to(&moment)?;
        Ok(Some(moment.scripted))
    }

    /// Goes back to the first frame.
    pub(crate) fn reset(&mut self) -> anyhow::Result<()> {
        let start = UndoPoint {
            snapshot: self.start.clone(),
            scripted: false,
            stroke: None,
            grab: None,
        };
        self.history.clear();
        self.go_to(&start)
    }

    /// Goes to another time, with the knobs as they are now and empty hands.
    fn go_to(&mut self, moment: &UndoPoint) -> anyhow::Result<()> {
        self.drop_lines();
        self.let_go();
        let spec = self.simulation.solver_spec().clone();
        self.simulation.restore(&moment.snapshot)?;
        // The stroke and the grab of that moment are active again, but no input ends them: end them here.
        if let Some(stroke) = moment.stroke {
            self.simulation.end_stroke(stroke)?;
        }
        if let Some(grab) = moment.grab {
            self.simulation.release(grab)?;
        }
        let turned = self.simulation.set_solver(&spec);
        let measured = self.measure(self.measures);
        // Whatever the knobs say, the body is another one.
        self.repaint()?;
        turned?;
        measured
    }

    /// Redraws from the host's state; a device's state is drawn again after the next step.
    fn repaint(&mut self) -> anyhow::Result<()> {
        self.simulation.read_back()?;
        self.painting.reset(&self.simulation);
        (self.legend, self.shown) = (None, ColorBy::Tissue);
        Ok(())
    }

    /// Takes a turned knob over.
    pub(crate) fn turn(&mut self, turn: &SettingChange) -> anyhow::Result<()> {
        let SettingChange {
            knob,
            from,
            to,
            spec,
        } = turn;
        self.simulation
            .set_solver(spec)
            .with_context(|| format!("{knob} stays at {from}"))?;
        self.effects.turned(knob, from, to);
        self.repaint()
    }

    pub(crate) fn solver(&self) -> &SolverSpec {
        self.simulation.solver_spec()
    }
}

#[cfg(test)]
mod tests;
