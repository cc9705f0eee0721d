//! [`Session`]: a simulation that is shown and edited in the window.
//!
//! It owns all data of a loaded scene. The window has the camera, the tools and a [`View`] to draw and to pick in;
//! the [`Engine`] with the simulation is away on a thread while it works. Commands that are given meanwhile wait, in order,
//! and are executed before the next step. Input comes in pixels and is converted to world space here.

mod engine;
mod interaction;

use std::collections::VecDeque;

use anyhow::anyhow;
use incise::mesh::glam::DVec3;
use incise::scene::SolverSpec;
use incise::{Scene, Simulation};
use incise_render::{Camera, ColorBy};

use self::engine::{Command, Engine, FrameInput, Job};
pub(crate) use self::engine::{Outcome, View};
use self::interaction::{Line, Pull};
use crate::settings::SettingChange;
use crate::tool::ToolSettings;
use crate::worker::Worker;

/// A loaded simulation with its view and tools.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) name: String,
    pub(crate) camera: Camera,
    pub(crate) tool_settings: ToolSettings,
    /// What the last job left to show.
    pub(crate) view: View,
    /// Result of the last input, for the status line.
    pub(crate) message: Option<&'static str>,
    worker: Worker<Engine, (View, Outcome)>,
    /// Commands for the next job.
    waiting: Vec<Command>,
    /// Settings that were chosen and are not in use yet.
    chosen: Option<SolverSpec>,
    /// True if residuals are measured.
    measures: bool,
    color_by: ColorBy,
    /// True until the state of the view was drawn.
    is_new: bool,
    /// Drawn lines that are not cut to their end, oldest first.
    lines: VecDeque<Line>,
    /// The blade under the pointer.
    blade: Option<[DVec3; 2]>,
    pull: Option<Pull>,
    /// The diagonal of all bodies when they were loaded, in m.
    extent: f64,
    /// True if the scene has strokes of its own.
    is_scripted: bool,
}

impl Session {
    pub(crate) fn new(name: String, scene: &Scene, simulation: Simulation) -> anyhow::Result<Self> {
        let engine = Engine::new(scene, simulation)?;
        let view = engine.view();
        let [low, high] = view.bounds;
        Ok(Self {
            name,
            camera: Camera::fit(low, high),
            tool_settings: ToolSettings::default(),
            view,
            message: None,
            worker: Worker::new(engine),
            waiting: Vec::new(),
            chosen: None,
            measures: true,
            color_by: ColorBy::Tissue,
            is_new: true,
            lines: VecDeque::new(),
            blade: None,
            pull: None,
            extent: (high - low).length(),
            is_scripted: !scene.stroke.is_empty(),
        })
    }

    /// True if the simulation can make a step: it is here, and no undo waits that may end the run.
    pub(crate) fn can_step(&self) -> bool {
        let mut waiting = self.waiting.iter();
        self.worker.here().is_some() && !waiting.any(|command| matches!(command, Command::Undo))
    }

    /// True while commands wait or are executed.
    pub(crate) fn is_busy(&self) -> bool {
        self.worker.here().is_none() || !self.waiting.is_empty()
    }

    /// Starts the commands that wait and some frames, unless the simulation is away; `wake` is called when they are done.
    /// `reads_back` is true if positions are needed here, and not only on a device.
    pub(crate) fn start(
        &mut self,
        frames: usize,
        reads_back: bool,
        wake: impl FnOnce() + Send + 'static,
    ) {
        if self.worker.here().is_none() {
            return;
        }
        for _ in 0..frames {
            self.step();
        }
        let lacks_positions = reads_back && !self.view.is_read_back;
        if self.waiting.is_empty() && !lacks_positions {
            return;
        }
        let commands = std::mem::take(&mut self.waiting);
        let job = Job {
            commands,
            reads_back,
        };
        self.worker.start(move |engine| engine.run(job), wake);
    }

    /// Takes over the results of a job that is done.
    pub(crate) fn poll(&mut self) -> Option<Outcome> {
        let result = self.worker.poll()?;
        Some(self.take_over(result))
    }

    fn take_over(&mut self, result: Result<(View, Outcome), String>) -> Outcome {
        let outcome = match result {
            Ok((view, outcome)) => {
                (self.view, self.is_new) = (view, true);
                outcome
            }
            Err(panic) => {
                if let Some(engine) = self.worker.here_mut() {
                    engine.distrust();
                }
                let error = anyhow!("{panic}").context(
                    "internal error in the simulation; reset it or undo the last cut to go on",
                );
                Outcome {
                    error: Some(error),
                    ..Outcome::default()
                }
            }
        };
        if outcome.error.is_some() {
            self.drop_lines();
            self.waiting
                .retain(|command| !matches!(command, Command::Step(_)));
        }
        let mut waiting = self.waiting.iter();
        if outcome.missed && !waiting.any(|command| matches!(command, Command::Grab { .. })) {
            self.pull = None;
            self.message = Some("Pinned or attached here: grab a free part");
        }
        let mut waiting = self.waiting.iter();
        if !waiting.any(|command| matches!(command, Command::Set(_))) {
            self.chosen = None;
        }
        self.show_blade();
        outcome
    }

    /// The simulation, unless it is away.
    pub(crate) fn simulation(&self) -> Option<&Simulation> {
        self.worker.here().map(Engine::simulation)
    }

    /// True if the simulation is here with a state that was not drawn yet; the next call returns false.
    pub(crate) fn take_new(&mut self) -> bool {
        self.worker.here().is_some() && std::mem::take(&mut self.is_new)
    }

    /// True if residuals are measured.
    pub(crate) fn measures(&self) -> bool {
        self.measures
    }

    /// Turns the measurement of residuals on or off.
    pub(crate) fn measure(&mut self, on: bool) {
        self.measures = on;
        self.waiting
            .retain(|command| !matches!(command, Command::Measure(_)));
        self.waiting.push(Command::Measure(on));
    }

    /// Chooses what the colors show; displayed residuals are measured.
    pub(crate) fn color(&mut self, by: ColorBy) {
        if by == ColorBy::Residual && !self.measures {
            self.measure(true);
        }
        if by != self.color_by {
            self.color_by = by;
            self.waiting
                .retain(|command| !matches!(command, Command::Color(_)));
            self.waiting.push(Command::Color(by));
        }
    }

    /// Advances by one frame.
    pub(crate) fn step(&mut self) {
        let input = FrameInput {
            blade: self.next_motion(),
            target: self.pull.map(|pull| pull.to),
        };
        self.waiting.push(Command::Step(input));
    }

    /// True in a scene with strokes of its own that has not begun.
    pub(crate) fn waits_for_start(&self) -> bool {
        self.view.next_frame == 0 && self.is_scripted
    }

    /// Fits the view to the body.
    pub(crate) fn fit(&mut self) {
        let [low, high] = self.view.bounds;
        let fitted = Camera::fit(low, high);
        (self.camera.target, self.camera.distance) = (fitted.target, fitted.distance);
    }

    /// Undoes the last stroke or reset, if there is one.
    pub(crate) fn undo(&mut self) {
        if self.view.undo_points > 0 || self.is_busy() {
            self.drop_input();
            self.waiting.push(Command::Undo);
        }
    }

    /// Resets to the first frame. The state before can be restored by [`Session::undo`].
    pub(crate) fn reset(&mut self) {
        self.drop_input();
        if !matches!(self.waiting.last(), Some(Command::Reset)) {
            self.waiting.push(Command::Reset);
        }
    }

    /// Drops lines and the grab; the engine drops them before it restores another state.
    fn drop_input(&mut self) {
        self.drop_lines();
        self.pull = None;
    }

    /// Changes a setting. Waiting changes of the same setting, as from a drag of a slider, are one.
    pub(crate) fn change_setting(&mut self, mut change: SettingChange) {
        self.chosen = Some(change.spec.clone());
        if let Some(Command::Set(last)) = self.waiting.last_mut()
            && last.setting == change.setting
        {
            std::mem::swap(&mut last.from, &mut change.from);
            *last = change;
            return;
        }
        self.waiting.push(Command::Set(change));
    }

    /// The settings, with those that were chosen while the simulation was away.
    pub(crate) fn solver(&self) -> &SolverSpec {
        self.chosen.as_ref().unwrap_or(&self.view.solver)
    }
}

#[cfg(test)]
mod tests;
