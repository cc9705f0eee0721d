//! [`GpuSolver`]: XPBD on the device.
//!
//! Tets, masses, materials, attachments and colliders are edited in a [`Solver`] on the host; the device has a copy of
//! them and the state. A step is recorded as one pass and submitted once: predict, move rigid attachments to their
//! handles, solve color by color, solve compliant attachments, distances, volumes and contacts, project to colliders, update
//! and damp velocities, substep by substep. Features that a scene does not use take no memory and no dispatch. A step reads
//! nothing back: results come from calls that wait for the device ([`GpuSolver::host`], [`GpuSolver::measure`]).
//!
//! Twin: `Solver::step` of incise-xpbd, with the same schedule and [`ClusterMapping::Threads`]. Positions agree up to
//! the rounding of sums, which shader compilers may reorder or fuse. Cost: one dispatch per color and two or three per
//! substep, with damping another one per color, and one for each other feature of the scene; uploads only after edits
//! and for handles and colliders that move.

mod attachments;
mod body_buffers;
mod check;
mod colliders;
mod colors;
mod contacts;
mod frame;
mod gpu_types;
mod iterations;
mod jacobi;
mod kernels;
mod layout;
mod measure;
mod scalar_constraints;
#[cfg(test)]
mod shaders;
mod shared;
mod slots;
mod stages;
mod tile;

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use incise_graph::Schedule;
use incise_xpbd::{Changes, Pose, Solver, StepSettings};
use wgpu::SubmissionIndex;

pub(crate) use kernels::SOURCES;
pub use layout::ClusterMapping;
pub use measure::Measures;
pub use stages::StageTimes;

pub(crate) use gpu_types::{
    Attachment, ContactUniform, DispatchRange, IterationUniform, ParticlePatch, ParticleSums,
    Settings, TetPatch, TetSums, Units,
};

use crate::array::Array;
use crate::{GpuContext, GpuError};
use body_buffers::BodyBuffers;
use frame::{Frame, Scene};
use kernels::Kernels;
use measure::Measuring;

/// Frames that may be unfinished on the device when another one is recorded.
const FRAMES_IN_FLIGHT: usize = 2;

/// A body that is solved on a device.
///
/// # Example
/// A tet hangs from one corner.
/// ```
/// use std::sync::Arc;
///
/// use glam::DVec3;
/// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
/// use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};
/// use incise_xpbd::{Material, Solver, StepSettings};
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Ok(gpu) => Arc::new(gpu),
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     Err(other) => return Err(other.into()),
/// };
/// let rest = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::NEG_Z];
/// let mut solver = Solver::<f32>::new(&rest);
/// let rubber = Material { young_modulus: 1e5, poisson_ratio: 0.45, density: 1000.0, damping: 0.0 };
/// solver.add_material(rubber)?;
/// solver.push_tet([0, 1, 2, 3], rest, 0);
/// (0..4).for_each(|p| solver.set_mass(p, 1000.0 / 6.0 / 4.0));
/// solver.set_fixed(0, true);
///
/// let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
/// let gravity = Some(DVec3::new(0.0, 0.0, -9.81));
/// let settings = StepSettings { substeps: 4, gravity, ..StepSettings::new(0.016) };
/// let mut device = GpuSolver::new(gpu, solver, ClusterMapping::Threads)?;
/// for _ in 0..10 {
///     device.step(&schedule, &settings)?;
/// }
/// let solver = device.host()?;
/// assert_eq!(solver.position(0), DVec3::ZERO);
/// assert!(solver.position(1).z < -0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GpuSolver {
    gpu: Arc<GpuContext>,
    host: Solver<f32>,
    /// True if the device has advanced since the host last had its state.
    ahead: bool,
    kernels: Kernels,
    body: BodyBuffers,
    frame: Frame,
    repaired: Array<u32>,
    /// Particles reset by the device, as last reported to the host.
    known_repaired: u32,
    /// `Some` from the first measurement on.
    measuring: Option<Measuring>,
    /// The last frames, oldest first.
    in_flight: VecDeque<SubmissionIndex>,
}

impl GpuSolver {
    /// Moves a solver to the device; its data are sent with the first step.
    ///
    /// # Errors
    /// If the device has no memory or rejects a command.
    pub fn new(
        gpu: Arc<GpuContext>,
        mut solver: Solver<f32>,
        mapping: ClusterMapping,
    ) -> Result<Self, GpuError> {
        solver.track_changes();
        Ok(Self {
            body: BodyBuffers::new(&gpu, mapping)?,
            frame: Frame::new(&gpu)?,
            repaired: Array::zeros(&gpu, "count of repairs", 1)?,
            known_repaired: 0,
            measuring: None,
            in_flight: VecDeque::new(),
            kernels: Kernels::default(),
            ahead: false,
            host: solver,
            gpu,
        })
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Arc<GpuContext> {
        &self.gpu
    }

    /// The unit of the device that solves a cluster.
    #[must_use]
    pub fn cluster_mapping(&self) -> ClusterMapping {
        self.body.layout.mapping
    }

    /// Advances by one frame of `settings.time_step`; returns after the submit, before the device is done. Waits first
    /// until the device is done with the frame before the last one, which limits the frames in flight.
    ///
    /// After an [update](Schedule::update) of the schedule or an edit of the solver, only the changes are sent. Another
    /// schedule rebuilds the layout.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`]; if they ask for Jacobi or Chebyshev iterations in
    /// [`ClusterMapping::Workgroups`] or with contacts; if a cluster is larger than the mapping allows; if the device is
    /// lost or out of memory.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    ///
    /// # Determinism
    /// Bit-identical on the same device and driver.
    pub fn step(&mut self, schedule: &Schedule, settings: &StepSettings) -> Result<(), GpuError> {
        self.advance(schedule, settings, 0..settings.substeps, false)
    }

    /// Advances by one frame like [`GpuSolver::step`] and keeps the data that [`Solver::residuals`] needs of the last
    /// substep; [`GpuSolver::host`] then has them.
    ///
    /// # Errors
    /// Those of [`GpuSolver::step`].
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn step_keeping_residuals(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> Result<(), GpuError> {
        self.advance(schedule, settings, 0..settings.substeps, true)
    }

    /// Advances by some of the substeps of a frame, numbered from 0, like [`Solver::step_part`], so that contacts can be
    /// set again within the frame. All parts of a frame in their order are, to the bit, that frame, as long as nothing
    /// changes in between. With `keep_residuals` the part that ends the frame keeps what [`Solver::residuals`] needs.
    ///
    /// # Errors
    /// Those of [`GpuSolver::step`], and if the part ends before it begins or beyond the frame.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn step_part(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep_residuals: bool,
    ) -> Result<(), GpuError> {
        self.advance(schedule, settings, part, keep_residuals)
    }

    fn advance(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<(), GpuError> {
        let _span = tracing::debug_span!("gpu::step").entered();
        self.host.check_step(settings, &part)?;
        let ends = part.end == settings.substeps;
        // A caller that is faster than the device waits here; otherwise memory runs out.
        while self.in_flight.len() >= FRAMES_IN_FLIGHT {
            let oldest = self.in_flight.pop_front();
            oldest.map_or(Ok(()), |oldest| self.gpu.wait_for(oldest))?;
        }
        self.send_changes(schedule, part.start == 0)?;
        let Self {
            gpu,
            host,
            kernels,
            body,
            frame,
            repaired,
            ..
        } = self;
        let scene = Scene {
            gpu,
            kernels,
            body,
            host,
            repaired,
        };
        let submission = frame.record(scene, settings, part, keep && ends)?;
        self.in_flight.push_back(submission);
        self.ahead = true;
        if ends {
            self.host.end_frame();
        }
        Ok(())
    }

    /// Sends changes by edits and schedule, which a step does otherwise. To measure the cost of a cut, call this before
    /// the step.
    ///
    /// # Errors
    /// If a cluster is larger than the mapping allows; if the device is lost or out of memory.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn send(&mut self, schedule: &Schedule) -> Result<(), GpuError> {
        self.send_changes(schedule, true)
    }

    /// `begins` says that a frame does, which may move the origin.
    fn send_changes(&mut self, schedule: &Schedule, begins: bool) -> Result<(), GpuError> {
        if begins && !self.ahead {
            self.host.prepare_state();
        }
        let changes = self.host.take_changes();
        let Self {
            gpu,
            host,
            kernels,
            body,
            ..
        } = self;
        if let Some(measuring) = &mut self.measuring {
            measuring.stale |= changes != Changes::default();
        }
        let synced = body.sync(gpu, kernels, host, schedule, &changes);
        // After a failed update the state of the device is undefined. Edits wait for the device, so it is not ahead of
        // them.
        if synced.is_err() && !self.ahead {
            self.host.track_changes();
        }
        synced
    }

    /// The solver with the state of the device; waits for the device if it has advanced.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn host(&mut self) -> Result<&Solver<f32>, GpuError> {
        self.read_back()?;
        Ok(&self.host)
    }

    /// The solver with the state of the device, to edit; the next step sends the changes.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn edit(&mut self) -> Result<&mut Solver<f32>, GpuError> {
        self.read_back()?;
        Ok(&mut self.host)
    }

    /// Replaces the host's solver; the next step sends all of it, including its state. Kernels and memory are kept. The
    /// state of the device and its count of repairs are lost unless [`GpuSolver::host`] is called before. O(particles +
    /// tets) in the next step.
    pub fn replace(&mut self, mut solver: Solver<f32>) {
        solver.track_changes();
        self.host = solver;
        self.ahead = false;
    }

    /// Sets the pose of a handle at the end of the next frame, like [`Solver::move_handle`], without waiting for the
    /// device.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation is not of length 1.
    pub fn move_handle(&mut self, handle: u32, pose: Pose) {
        self.host.move_handle(handle, pose);
    }

    /// The host's copy of the solver: topology, masses and materials are up to date, the state only if
    /// [`GpuSolver::host`] was called since the last step.
    #[must_use]
    pub fn cached_host(&self) -> &Solver<f32> {
        &self.host
    }

    fn read_back(&mut self) -> Result<(), GpuError> {
        if !self.ahead {
            return Ok(());
        }
        let _span = tracing::debug_span!("gpu::read_back").entered();
        let count = self.host.particle_count();
        let gpu = &*self.gpu;
        let mut encoder = gpu.encoder("read back");
        let positions = self.body.particles.copy_out(gpu, &mut encoder, count)?;
        let velocities = self.body.velocities.copy_out(gpu, &mut encoder, count)?;
        let repaired = self.repaired.copy_out(gpu, &mut encoder, 1)?;
        let last = self
            .frame
            .copy_last_substep(gpu, &mut encoder, &self.body)?;
        let impulses = match &self.body.contacts {
            Some(contacts) => contacts.copy_impulses(gpu, &mut encoder)?,
            None => None,
        };
        let submission = gpu.submit(encoder)?;
        let impulses = impulses.map(|impulses| impulses.handed_over(&submission));
        let positions = positions.handed_over(&submission);
        let velocities = velocities.handed_over(&submission);
        let repaired = repaired.handed_over(&submission);
        let last = last.map(|last| {
            (
                last.predicted.handed_over(&submission),
                last.multipliers.handed_over(&submission),
                last.tet_solve,
            )
        });
        let (positions, velocities) = (positions.collect(gpu)?, velocities.collect(gpu)?);
        self.host.load_state(&positions, &velocities);
        self.known_repaired = repaired.collect(gpu)?[0];
        if let (Some(contacts), Some(impulses)) = (&self.body.contacts, impulses) {
            contacts.load(&mut self.host, &impulses.collect(gpu)?);
        }
        if let Some((predicted, multipliers, tet_solve)) = last {
            let (predicted, multipliers) = (predicted.collect(gpu)?, multipliers.collect(gpu)?);
            let slot = |tet| self.body.layout.tet_slot(tet);
            let of_tet = |tet| slot(tet).map_or([0.0; 2], |tet_slot| multipliers[tet_slot]);
            let multipliers: Vec<_> = (0..self.host.tet_count()).map(of_tet).collect();
            self.host
                .load_last_substep(&predicted, &multipliers, tet_solve);
        }
        self.ahead = false;
        Ok(())
    }

    /// The number of particles that would have become infinite or NaN and were reset instead, counted once for each
    /// substep, up to the last call of [`GpuSolver::host`] or [`GpuSolver::measure`].
    #[must_use]
    pub fn repaired(&self) -> u32 {
        self.known_repaired
    }

    /// The buffer of positions, for renderers: 16 bytes per particle, position relative to [`Solver::origin`] in m and
    /// inverse mass. A cut may replace the buffer by a larger one.
    #[must_use]
    pub fn positions(&self) -> &wgpu::Buffer {
        self.body.particles.buffer()
    }

    /// Bytes of device memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let measuring = self.measuring.as_ref().map_or(0, Measuring::bytes);
        self.body.bytes() + self.frame.bytes() + measuring
    }

    /// Dispatches of one pass over the tets.
    #[must_use]
    pub fn dispatches_per_pass(&self) -> usize {
        self.body.colors.runs.len()
    }
}
