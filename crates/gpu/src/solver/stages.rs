//! [`Track`]: the commands of a frame stage by stage, and [`StageTimes`]: the time of each stage.
//!
//! Without timing a frame is one pass. With timing each change of the stage ends a pass, and the device writes the time
//! at both ends of every pass into query sets, which grow with the frame. Cost: nothing while off; otherwise a pass and
//! 16 bytes for each change of the stage, at least four per substep, and the idle time of the device between passes.

use wgpu::{BufferUsages, CommandEncoder, ComputePassTimestampWrites, QuerySet, SubmissionIndex};

use super::GpuSolver;
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Passes per query set, which holds both ends of each.
const PASSES: usize = wgpu::QUERY_SET_MAX_QUERIES as usize / 2;

/// The stage of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Predict,
    Solve,
    Other,
    Update,
    Damp,
}

/// Times of the stages of a frame on the device, in ms, summed over its substeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StageTimes {
    /// Prediction of positions from velocities.
    pub predict: f64,
    /// Solving tets.
    pub solve: f64,
    /// Handles, distances, volumes, contacts, colliders and clearing of multipliers.
    pub other: f64,
    /// Update of velocities.
    pub update: f64,
    /// Damping of velocities; 0 without a damped material.
    pub damp: f64,
}

impl StageTimes {
    /// The sum of all stages.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.predict + self.solve + self.other + self.update + self.damp
    }
}

/// Query sets and results of timed stages.
#[derive(Debug)]
pub(crate) struct Clock {
    sets: Vec<QuerySet>,
    /// Start and end of each pass, in ticks.
    stamps: Array<u64>,
    /// The stage of each pass of the last frame.
    stages: Vec<Stage>,
}

impl Clock {
    fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            sets: Vec::new(),
            stamps: Array::with_usage(gpu, "times of stages", 0, BufferUsages::QUERY_RESOLVE)?,
            stages: Vec::new(),
        })
    }

    /// Bytes on the device; a query has 8.
    pub(crate) fn bytes(&self) -> u64 {
        let set = u64::from(wgpu::QUERY_SET_MAX_QUERIES * wgpu::QUERY_SIZE);
        self.stamps.buffer().size() + set * self.sets.len() as u64
    }

    /// The queries for the next pass.
    fn next(&mut self, gpu: &GpuContext, stage: Stage) -> ComputePassTimestampWrites<'_> {
        let number = self.stages.len();
        self.stages.push(stage);
        if self.sets.len() <= number / PASSES {
            let descriptor = wgpu::QuerySetDescriptor {
                label: Some("times of stages"),
                ty: wgpu::QueryType::Timestamp,
                count: wgpu::QUERY_SET_MAX_QUERIES,
            };
            self.sets.push(gpu.device().create_query_set(&descriptor));
        }
        let first = queries(number % PASSES);
        ComputePassTimestampWrites {
            query_set: &self.sets[number / PASSES],
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        }
    }

    /// Records commands that write the times of all passes to the buffer.
    fn resolve(&mut self, gpu: &GpuContext, encoder: &mut CommandEncoder) -> Result<(), GpuError> {
        let passes = self.stages.len();
        self.stamps.resize(gpu, 2 * passes)?;
        for (set, start) in self.sets.iter().zip((0..passes).step_by(PASSES)) {
            let count = queries(PASSES.min(passes - start));
            let offset = (2 * start * size_of::<u64>()) as u64;
            encoder.resolve_query_set(set, 0..count, self.stamps.buffer(), offset);
        }
        Ok(())
    }

    /// Waits for the device and sums the times by stage.
    fn times(&self, gpu: &GpuContext) -> Result<Option<StageTimes>, GpuError> {
        if self.stages.is_empty() {
            return Ok(None);
        }
        let stamps = self.stamps.read(gpu)?;
        let milliseconds = f64::from(gpu.queue().get_timestamp_period()) * 1e-6;
        let mut times = StageTimes::default();
        for (stage, ends) in self.stages.iter().zip(stamps.chunks_exact(2)) {
            let sum = match stage {
                Stage::Predict => &mut times.predict,
                Stage::Solve => &mut times.solve,
                Stage::Other => &mut times.other,
                Stage::Update => &mut times.update,
                Stage::Damp => &mut times.damp,
            };
            // A device may reset its clock.
            *sum += ends[1].saturating_sub(ends[0]) as f64 * milliseconds;
        }
        Ok(Some(times))
    }
}

fn queries(passes: usize) -> u32 {
    u32::try_from(2 * passes).expect("a query set has few passes")
}

/// The commands of a frame.
#[derive(Debug)]
pub(crate) struct Track<'a> {
    gpu: &'a GpuContext,
    encoder: CommandEncoder,
    /// The open pass and its stage.
    pass: Option<(Stage, Recorder<'a>)>,
    clock: Option<&'a mut Clock>,
}

impl<'a> Track<'a> {
    pub(crate) fn new(gpu: &'a GpuContext, mut clock: Option<&'a mut Clock>) -> Self {
        if let Some(clock) = &mut clock {
            clock.stages.clear();
        }
        Self {
            gpu,
            encoder: gpu.encoder("frame"),
            pass: None,
            clock,
        }
    }

    /// The pass for dispatches of a stage: the open one, unless stages are timed and the stage differs.
    pub(crate) fn at(&mut self, stage: Stage) -> &mut Recorder<'a> {
        let Self {
            gpu,
            encoder,
            pass,
            clock,
        } = self;
        // A pass must end before the next one begins.
        *pass = pass
            .take()
            .filter(|(open, _)| clock.is_none() || *open == stage);
        let (_, recorder) = pass.get_or_insert_with(|| {
            let times = clock.as_mut().map(|clock| clock.next(gpu, stage));
            (stage, Recorder::new(gpu, encoder, "frame", times))
        });
        recorder
    }

    /// Ends the pass and returns the encoder, for commands outside of passes.
    pub(crate) fn between_passes(&mut self) -> &mut CommandEncoder {
        self.pass = None;
        &mut self.encoder
    }

    /// Submits the frame.
    pub(crate) fn submit(mut self) -> Result<SubmissionIndex, GpuError> {
        self.pass = None;
        if let Some(clock) = self.clock {
            clock.resolve(self.gpu, &mut self.encoder)?;
        }
        self.gpu.submit(self.encoder)
    }
}

impl GpuSolver {
    /// Turns timing of the stages of each step on the device on or off; off by default.
    ///
    /// Results stay bit-identical. A timed frame has a pass for each change of the stage instead of a single one, so
    /// the sum of its stages may exceed the time of an untimed frame.
    ///
    /// # Example
    /// ```
    /// # use std::sync::Arc;
    /// # use glam::DVec3;
    /// # use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};
    /// # use incise_graph::{Clustering, Coloring, Schedule};
    /// # use incise_xpbd::{Solver, StepSettings};
    /// # let gpu = match GpuContext::new(&GpuOptions::from_env()) {
    /// #     Ok(gpu) => Arc::new(gpu),
    /// #     Err(GpuError::NoAdapter { .. }) => return Ok(()),
    /// #     Err(other) => return Err(other.into()),
    /// # };
    /// # let schedule = Schedule::new(&Clustering::none(0), &Coloring::new(vec![]));
    /// # let timed = gpu.has_timestamps();
    /// let mut device = GpuSolver::new(gpu, Solver::new(&[DVec3::ZERO]), ClusterMapping::Threads)?;
    /// # if timed {
    /// device.time_stages(true)?;
    /// device.step(&schedule, &StepSettings::new(0.01))?;
    /// let times = device.stage_times()?.expect("the step was timed");
    /// println!("{:.3} ms, of which {:.3} on tets", times.total(), times.solve);
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`GpuError::NoTimestamps`] if the device does not support it; if it has no memory.
    pub fn time_stages(&mut self, on: bool) -> Result<(), GpuError> {
        let clock = self.frame.clock();
        match (on, clock.is_some()) {
            (false, _) => *clock = None,
            (true, true) => {}
            (true, false) if !self.gpu.has_timestamps() => return Err(GpuError::NoTimestamps),
            (true, false) => *clock = Some(Clock::new(&self.gpu)?),
        }
        Ok(())
    }

    /// Waits for the device and returns the times of the last step's stages; `None` unless it was
    /// [timed](GpuSolver::time_stages).
    ///
    /// # Errors
    /// If the device is lost.
    pub fn stage_times(&mut self) -> Result<Option<StageTimes>, GpuError> {
        match self.frame.clock() {
            Some(clock) => clock.times(&self.gpu),
            None => Ok(None),
        }
    }
}
