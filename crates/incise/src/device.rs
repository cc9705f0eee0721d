//! [`Device`]: the solver of an island on a GPU.
//!
//! Cuts and edits are made on the host's solver and then applied to the device. The state stays on the device until it
//! is requested. Cost: a submit a frame.

use std::sync::Arc;

use incise_clustering::Method;
use incise_gpu::{ClusterMapping, GpuContext, GpuSolver};
use incise_graph::Schedule;
use incise_xpbd::{Solver, StepReport, StepSettings};

use crate::Error;
use crate::scene::SolverSpec;

/// A solver on a GPU.
#[derive(Debug)]
pub(crate) struct Device {
    pub(crate) solver: GpuSolver,
    /// Particles put back that were told.
    told: u32,
}

impl Device {
    pub(crate) fn new(
        gpu: &Arc<GpuContext>,
        solver: Solver<f32>,
        spec: &SolverSpec,
    ) -> Result<Self, Error> {
        Ok(Self {
            solver: GpuSolver::new(Arc::clone(gpu), solver, form(spec)?)?,
            told: 0,
        })
    }

    /// Whether it is on a device and solves in the form that settings ask for.
    pub(crate) fn serves(&self, gpu: &Arc<GpuContext>, spec: &SolverSpec) -> Result<bool, Error> {
        Ok(Arc::ptr_eq(self.solver.gpu(), gpu) && self.solver.form() == form(spec)?)
    }

    /// Tells the device to advance by one frame.
    pub(crate) fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        keep: bool,
    ) -> Result<StepReport, Error> {
        if keep {
            self.solver.step_keeping_residuals(schedule, settings)?;
        } else {
            self.solver.step(schedule, settings)?;
        }
        Ok(StepReport::default())
    }

    /// Reads the state back to the host; returns how many particles had to be put back since the last call.
    pub(crate) fn read_back(&mut self) -> Result<usize, Error> {
        self.solver.host()?;
        Ok(self.news())
    }

    /// Returns how many particles had to be put back since the last call, as of the last readback or measurement.
    pub(crate) fn news(&mut self) -> usize {
        let repaired = self.solver.repaired();
        let news = repaired.wrapping_sub(self.told) as usize;
        self.told = repaired;
        news
    }
}

/// Returns whether a thread or a workgroup solves each cluster.
fn form(spec: &SolverSpec) -> Result<ClusterMapping, Error> {
    let method: Method = spec.clustering.parse()?;
    Ok(ClusterMapping::for_clusters_of(method.max_size().get()))
}
