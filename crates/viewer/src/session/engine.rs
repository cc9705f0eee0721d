//! [`Engine`]: the simulation with its undo points, blade and grab. It executes commands and steps.
//!
//! It has no window and knows no pixels. While it works it is on a thread of its own; the window meanwhile shows the
//! [`View`] that the engine returned last.

use anyhow::{Context, anyhow};
use incise::cutting::BoundaryTriangle;
use incise::mesh::glam::DVec3;
use incise::report::FrameReport;
use incise::scene::{Quantity, ReportSpec, SolverSpec, StrokeSpec};
use incise::{Grab, Scene, Simulation, Snapshot, Support};
use incise_render::{ColorBy, Legend, RenderScene};
use web_time::Instant;

use crate::history::{History, UndoPoint};
use crate::setting_effects::SettingEffects;
use crate::settings::SettingChange;
use crate::times::Times;

/// Interval in frames between measurements of residuals.
const EVERY: u64 = 5;

/// A motion of the blade in a frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum BladeMotion {
    /// Begins a stroke with a snap distance, as a fraction of an edge.
    Begin([DVec3; 2], f64),
    Move([DVec3; 2]),
    End,
}

/// Input of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameInput {
    pub(super) blade: Option<BladeMotion>,
    /// Target of the grab.
    pub(super) target: Option<DVec3>,
}

/// A change of the simulation.
#[derive(Debug)]
pub(super) enum Command {
    /// Advances by one frame.
    Step(FrameInput),
    /// Grabs particles around a point.
    Grab {
        point: DVec3,
        radius: f64,
        compliance: f64,
    },
    /// Releases the grab.
    Release,
    Undo,
    Reset,
    Set(SettingChange),
    /// Turns the measurement of residuals on or off.
    Measure(bool),
    Color(ColorBy),
    /// Waits for a message.
    #[cfg(test)]
    Wait(std::sync::mpsc::Receiver<()>),
    #[cfg(test)]
    Panic,
}

/// What to do before the next picture.
#[derive(Debug, Default)]
pub(super) struct Job {
    pub(super) commands: Vec<Command>,
    /// True if the window needs positions that a device has.
    pub(super) reads_back: bool,
}

/// The result of a job for the user.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    /// The first error; later steps of the job were not made.
    pub(crate) error: Option<anyhow::Error>,
    /// The error of a setting that keeps its value.
    pub(crate) refused: Option<anyhow::Error>,
    /// True if a stroke of the scene was undone, which begins again with the next step.
    pub(crate) restarts: bool,
    /// True if there was nothing to grab.
    pub(crate) missed: bool,
}

/// What the window shows of a simulation.
#[derive(Clone, Debug)]
pub(crate) struct View {
    pub(crate) render_scene: RenderScene,
    /// Positions of all particles; on a device those of the last time they were read back.
    pub(crate) positions: Vec<DVec3>,
    /// True if the positions are those of the last frame.
    pub(crate) is_read_back: bool,
    pub(crate) boundary: Vec<BoundaryTriangle>,
    pub(crate) bounds: [DVec3; 2],
    pub(crate) supports: Vec<Support>,
    pub(crate) report: FrameReport,
    /// The last report that measured the body.
    pub(crate) measured: Option<FrameReport>,
    pub(crate) next_frame: u64,
    pub(crate) times: Times,
    pub(crate) effects: SettingEffects,
    /// Time of the last frame in ms, until the device had finished.
    pub(crate) frame_ms: f64,
    /// The scale of the colors, if they represent numbers.
    pub(crate) legend: Option<Legend>,
    /// The quantity that the colors show.
    pub(crate) shown: ColorBy,
    pub(crate) solver: SolverSpec,
    /// True if the simulation runs on a device.
    pub(crate) on_device: bool,
    pub(crate) backend_note: Option<String>,
    /// Number of strokes and resets that can be undone.
    pub(crate) undo_points: usize,
}

/// A stroke in progress.
#[derive(Debug)]
struct ActiveStroke {
    number: u32,
    /// The undo point before the stroke, until it has cut something.
    before: Option<UndoPoint>,
}

/// A simulation with all that its commands need.
#[derive(Debug)]
pub(super) struct Engine {
    simulation: Simulation,
    view: View,
    /// The quantity that the colors shall show.
    color_by: ColorBy,
    measures: bool,
    start: Snapshot,
    history: History,
    stroke: Option<ActiveStroke>,
    grab: Option<Grab>,
    /// Strokes of the scene.
    strokes: Vec<StrokeSpec>,
    /// True after a panic, until another state is restored.
    is_broken: bool,
}

impl Engine {
    pub(super) fn new(scene: &Scene, mut simulation: Simulation) -> anyhow::Result<Self> {
        let start = simulation.snapshot()?;
        let mut engine = Self {
            view: View {
                render_scene: RenderScene::new(&simulation, scene),
                positions: Vec::new(),
                is_read_back: true,
                boundary: Vec::new(),
                bounds: [DVec3::ZERO; 2],
                supports: Vec::new(),
                report: FrameReport::default(),
                measured: None,
                next_frame: 0,
                times: Times::default(),
                effects: SettingEffects::default(),
                frame_ms: 0.0,
                legend: None,
                shown: ColorBy::Tissue,
                solver: simulation.solver_spec().clone(),
                on_device: false,
                backend_note: None,
                undo_points: 0,
            },
            simulation,
            color_by: ColorBy::Tissue,
            measures: false,
            start,
            history: History::default(),
            stroke: None,
            grab: None,
            strokes: scene.stroke.clone(),
            is_broken: false,
        };
        engine.measure(true)?;
        engine.update_view(true)?;
        Ok(engine)
    }

    /// Refuses all commands after a panic, until another state is restored.
    pub(super) fn distrust(&mut self) {
        (self.is_broken, self.stroke, self.grab) = (true, None, None);
    }

    /// The simulation, to be drawn from its device.
    pub(super) fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The view of the present state.
    pub(super) fn view(&self) -> View {
        self.view.clone()
    }

    /// Executes the commands of a job in order. After an error no further step is made.
    pub(super) fn run(&mut self, job: Job) -> (View, Outcome) {
        let mut outcome = Outcome::default();
        for command in job.commands {
            let result = match command {
                Command::Undo => self.undo().map(|restarts| outcome.restarts |= restarts),
                Command::Reset => self.reset(),
                Command::Step(_) if outcome.error.is_some() => Ok(()),
                _ if self.is_broken => Err(anyhow!(
                    "the simulation is in an unknown state: reset it or undo the last cut"
                )),
                Command::Step(input) => self.step(&input),
                Command::Grab {
                    point,
                    radius,
                    compliance,
                } => self.grab(point, radius, compliance).map(|grabbed| {
                    outcome.missed = !grabbed;
                }),
                Command::Release => {
                    self.release();
                    Ok(())
                }
                Command::Set(change) => {
                    outcome.refused = self.change_setting(&change).err().or(outcome.refused);
                    Ok(())
                }
                Command::Measure(on) => self.measure(on),
                Command::Color(by) => {
                    self.color_by = by;
                    Ok(())
                }
                #[cfg(test)]
                Command::Wait(gate) => gate.recv().map_err(Into::into),
                #[cfg(test)]
                Command::Panic => panic!("a test panics"),
            };
            outcome.error = outcome.error.or(result.err());
        }
        if outcome.error.is_some() {
            self.end_stroke();
        }
        // The window keeps what it showed before a panic.
        if !self.is_broken {
            outcome.error = outcome.error.or(self.update_view(job.reads_back).err());
        }
        (self.view(), outcome)
    }

    /// Turns the measurement of residuals on or off.
    fn measure(&mut self, on: bool) -> anyhow::Result<()> {
        let mut report = ReportSpec::default();
        if on {
            report = ReportSpec::default().with(|spec| {
                spec.every = EVERY;
                spec.quantities = vec![Quantity::Residual, Quantity::Volume];
            });
        }
        self.simulation.set_report(report)?;
        (self.measures, self.view.measured) = (on, None);
        Ok(())
    }

    /// Advances by one frame. If that fails, the whole body is drawn again.
    fn step(&mut self, input: &FrameInput) -> anyhow::Result<()> {
        let result = self.frame(input);
        if result.is_err() {
            self.view.render_scene.reset(&self.simulation);
        }
        result
    }

    fn frame(&mut self, input: &FrameInput) -> anyhow::Result<()> {
        let frame = self.simulation.next_frame();
        if self
            .strokes
            .iter()
            .any(|stroke| stroke.first_frame() == frame)
        {
            let point = self.undo_point(true)?;
            self.history.push(point);
        }
        if let (Some(grab), Some(target)) = (self.grab, input.target) {
            self.simulation.move_grab(grab, target)?;
        }
        self.move_blade(input.blade)?;
        let start = Instant::now();
        let report = self.simulation.step()?.clone();
        self.wait()?;
        let view = &mut self.view;
        view.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        view.render_scene.sync(&self.simulation);
        let mut blades = self
            .strokes
            .iter()
            .filter_map(|stroke| stroke.blade_at(frame));
        view.render_scene.set_blade(blades.next().as_deref());
        view.times.note(report.frame, report.ms);
        view.effects.note(&report, view.frame_ms);
        if report.cut.is_some()
            && let Some(before) = self.stroke.as_mut().and_then(|stroke| stroke.before.take())
        {
            self.history.push(before);
        }
        if report.residual.is_some() {
            view.measured = Some(report);
        }
        Ok(())
    }

    /// Waits for the device, so that times are those of its work.
    fn wait(&self) -> anyhow::Result<()> {
        match self.simulation.device_solvers().next() {
            Some(solver) => Ok(solver.gpu().wait()?),
            None => Ok(()),
        }
    }

    fn move_blade(&mut self, motion: Option<BladeMotion>) -> anyhow::Result<()> {
        match motion {
            Some(BladeMotion::Begin(ends, snap)) => {
                self.end_stroke();
                let before = Some(self.undo_point(false)?);
                let number = self.simulation.begin_stroke(&ends, snap)?;
                self.stroke = Some(ActiveStroke { number, before });
            }
            Some(BladeMotion::Move(ends)) => {
                if let Some(stroke) = &self.stroke {
                    self.simulation.move_blade(stroke.number, &ends)?;
                }
            }
            Some(BladeMotion::End) => self.end_stroke(),
            None => {}
        }
        Ok(())
    }

    fn end_stroke(&mut self) {
        if let Some(stroke) = self.stroke.take() {
            // Undo may have ended it already.
            let _ = self.simulation.end_stroke(stroke.number);
        }
    }

    /// Grabs the body; returns false if no particle is free there.
    fn grab(&mut self, point: DVec3, radius: f64, compliance: f64) -> anyhow::Result<bool> {
        self.release();
        self.grab = self.simulation.grab(point, radius, compliance)?;
        Ok(self.grab.is_some())
    }

    fn release(&mut self) {
        if let Some(grab) = self.grab.take() {
            // Undo may have released it already.
            let _ = self.simulation.release(grab);
        }
    }

    /// The present state with the stroke and the grab in use.
    fn undo_point(&mut self, scripted: bool) -> anyhow::Result<UndoPoint> {
        Ok(UndoPoint {
            snapshot: self.simulation.snapshot()?,
            scripted,
            stroke: self.stroke.as_ref().map(|stroke| stroke.number),
            grab: self.grab,
        })
    }

    /// Undoes the last stroke or reset, if there is one; returns true for a stroke that is part of the scene and begins
    /// again.
    fn undo(&mut self) -> anyhow::Result<bool> {
        match self.history.pop() {
            Some(point) => self.go_to(&point).map(|()| point.scripted),
            None => {
                self.end_stroke();
                self.release();
                Ok(false)
            }
        }
    }

    /// Resets to the first frame. The state before can be restored by an undo, unless it is unknown.
    fn reset(&mut self) -> anyhow::Result<()> {
        if self.simulation.next_frame() > 0 && !self.is_broken {
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
        self.end_stroke();
        self.release();
        let spec = self.simulation.solver_spec().clone();
        self.simulation.restore(&point.snapshot)?;
        self.is_broken = false;
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
        self.view.render_scene.set_blade(None);
        changed?;
        measured
    }

    /// Applies a changed setting.
    fn change_setting(&mut self, change: &SettingChange) -> anyhow::Result<()> {
        let SettingChange {
            setting,
            from,
            to,
            spec,
        } = change;
        self.simulation
            .set_solver(spec)
            .with_context(|| format!("{setting} not changed, it stays at {from}"))?;
        self.view.effects.note_change(setting, from, to);
        self.repaint()
    }

    /// Redraws from the host's state; the device's state is drawn again after the next step.
    fn repaint(&mut self) -> anyhow::Result<()> {
        self.simulation.read_back()?;
        self.view.render_scene.reset(&self.simulation);
        (self.view.legend, self.view.shown) = (None, ColorBy::Tissue);
        Ok(())
    }

    /// Colors the body for the present frame; as tissue while no residual has been measured.
    fn color(&mut self) -> anyhow::Result<()> {
        let residuals = match self.color_by {
            ColorBy::Residual => self.simulation.residuals_of_tets(),
            _ => None,
        };
        let by = match (self.color_by, &residuals) {
            // Between two measured frames the colors of the last one stay.
            (ColorBy::Residual, None) if self.view.shown == ColorBy::Residual => return Ok(()),
            (ColorBy::Residual, None) => ColorBy::Tissue,
            (by, _) => by,
        };
        let painted = self
            .view
            .render_scene
            .color(&mut self.simulation, by, residuals.as_deref());
        (self.view.legend, self.view.shown) = (painted?, by);
        Ok(())
    }

    /// Brings the view up to date.
    fn update_view(&mut self, reads_back: bool) -> anyhow::Result<()> {
        let colored = self.color();
        let read = if reads_back {
            self.simulation.read_back()
        } else {
            Ok(())
        };
        let (view, simulation) = (&mut self.view, &self.simulation);
        view.positions.clear();
        view.positions.extend_from_slice(simulation.positions());
        view.boundary.clear();
        view.boundary.extend(simulation.boundary());
        view.bounds = view.render_scene.bounds(simulation);
        view.supports = simulation.supports();
        view.report.clone_from(simulation.report());
        view.next_frame = simulation.next_frame();
        view.solver.clone_from(simulation.solver_spec());
        view.on_device = simulation.device_solvers().next().is_some();
        view.is_read_back = reads_back || !view.on_device;
        view.backend_note = simulation.backend_note().map(str::to_owned);
        view.undo_points = self.history.len();
        colored?;
        Ok(read?)
    }
}
