//! [`Device`]: the solver of an island on a GPU.
//!
//! Cuts and edits are made on the host's solver and then applied to the device. The state stays on the device until it
//! is requested, or after each part of a frame with contact. Cost: a submit a frame.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use incise_clustering::Method;
pub(crate) use incise_gpu::GpuContext;
use incise_gpu::{ClusterMapping, GpuOptions, GpuSolver};
use incise_graph::Schedule;
use incise_xpbd::{ErasedSolver, Pose, Solver, StepReport, StepSettings};
use web_time::Instant;

use crate::Error;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::{Backend, Quantity, SolverSpec};
use crate::solver_backend::{Measures, SolverBackend};

/// A device that is open, if one is.
pub(crate) type OpenDevice = Option<Arc<GpuContext>>;

/// Takes the open device or opens one, with its name; with `auto` none, and why, if there is no hardware device.
pub(crate) fn open(
    backend: Backend,
    open_device: &OpenDevice,
) -> Result<(OpenDevice, String), Error> {
    let open = || GpuContext::new(&GpuOptions::from_env()).map(Arc::new);
    match open_device.clone().map_or_else(open, Ok) {
        Ok(gpu) => {
            let adapter = gpu.adapter();
            if backend == Backend::Auto && adapter.software {
                let reason = format!("the only GPU is software ({})", adapter.name);
                return Ok((None, reason));
            }
            let name = format!("{} ({})", adapter.name, adapter.backend);
            Ok((Some(gpu), name))
        }
        Err(error) if backend == Backend::Auto => Ok((None, error.to_string())),
        Err(error) => Err(error.into()),
    }
}

/// A solver on a GPU.
#[derive(Debug)]
pub(crate) struct Device {
    pub(crate) solver: GpuSolver,
    /// Particles put back that were reported.
    reported: u32,
}

impl Device {
    pub(crate) fn new(
        gpu: &Arc<GpuContext>,
        solver: Solver<f32>,
        spec: &SolverSpec,
    ) -> Result<Self, Error> {
        Ok(Self {
            solver: GpuSolver::new(Arc::clone(gpu), solver, mapping(spec)?)?,
            reported: 0,
        })
    }

    /// Returns whether the solver is on a device and solves tets as the settings ask for.
    pub(crate) fn serves(&self, gpu: &Arc<GpuContext>, spec: &SolverSpec) -> Result<bool, Error> {
        Ok(Arc::ptr_eq(self.solver.gpu(), gpu) && self.solver.cluster_mapping() == mapping(spec)?)
    }

    /// The host's solver with the state of the last readback.
    pub(crate) fn cached_host(&self) -> &Solver<f32> {
        self.solver.cached_host()
    }

    /// Takes another solver to the device, in the memory of the present one.
    pub(crate) fn replace(&mut self, host: Solver<f32>) {
        self.solver.replace(host);
    }

    pub(crate) fn backend(&self) -> &dyn SolverBackend {
        self
    }

    pub(crate) fn backend_mut(&mut self) -> &mut dyn SolverBackend {
        self
    }
}

impl SolverBackend for Device {
    fn host(&self) -> &dyn ErasedSolver {
        self.solver.cached_host()
    }

    fn edit(&mut self) -> Result<&mut dyn ErasedSolver, Error> {
        Ok(self.solver.edit()?)
    }

    fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<StepReport, Error> {
        self.solver.step_part(schedule, settings, part, keep)?;
        Ok(StepReport::default())
    }

    fn lay_out(&mut self, schedule: &Schedule, ms: &mut Milliseconds) -> Result<(), Error> {
        let start = Instant::now();
        self.solver.send(schedule)?;
        ms.upload += milliseconds(start.elapsed());
        Ok(())
    }

    fn state(&mut self, gravity: Option<DVec3>, _: &[Quantity]) -> Result<Measures, Error> {
        let measures = self.solver.measure(gravity)?;
        Ok(Measures {
            energy: Some(measures.energy),
            sliver_energy: None,
            volume: Some(measures.volume),
            max_speed: Some(measures.max_speed),
        })
    }

    fn move_handle(&mut self, handle: u32, pose: Pose) {
        self.solver.move_handle(handle, pose);
    }

    fn read_back(&mut self) -> Result<usize, Error> {
        self.solver.host()?;
        Ok(self.take_repaired())
    }

    fn take_repaired(&mut self) -> usize {
        let repaired = self.solver.repaired();
        let fresh = repaired.wrapping_sub(self.reported) as usize;
        self.reported = repaired;
        fresh
    }

    fn check(&self, schedule: &Schedule) -> Result<(), Error> {
        Ok(self.solver.check(schedule)?)
    }
}

/// Returns whether a thread or a workgroup solves each cluster.
fn mapping(spec: &SolverSpec) -> Result<ClusterMapping, Error> {
    let method: Method = spec.clustering.parse()?;
    Ok(ClusterMapping::for_clusters_of(method.max_size().get()))
}
