//! [`Device`]: the solver of a group on a GPU.
//!
//! Cuts and edits are made on the host's solver, which the device follows; the state is on the device until somebody
//! asks. Cost: a submit a frame.

use std::sync::Arc;

use incise_clustering::Method;
use incise_gpu::{Form, GpuContext, GpuSolver};
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
        let method: Method = spec.clustering.parse()?;
        let form = Form::for_clusters_of(method.max_size().get());
        Ok(Self {
            solver: GpuSolver::new(Arc::clone(gpu), solver, form)?,
            told: 0,
        })
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

    /// Makes the state known here; returns how many particles had to be put back since the last time.
    pub(crate) fn read_back(&mut self) -> Result<usize, Error> {
        self.solver.host()?;
        Ok(self.news())
    }

    /// The same as far as is known here.
    pub(crate) fn news(&mut self) -> usize {
        let repaired = self.solver.repaired();
        let news = repaired.wrapping_sub(self.told) as usize;
        self.told = repaired;
        news
    }
}
