//! [`Readback`]: positions on their way to the host, for renderers and recorders that do not wait.
//!
//! They are copied aside on the device, so that it may go on. Memory: 32 bytes a particle, half of it on the device, for
//! each readback that is alive. Cost: 16 bytes a particle over the wire.

use std::sync::Arc;

use glam::DVec3;

use super::GpuSolver;
use crate::array::Staging;
use crate::{GpuContext, GpuError};

/// The positions at the time when it was begun.
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
/// # let solver = Solver::new(&[DVec3::ONE]);
/// # let schedule = Schedule::new(&Clustering::none(0), &Coloring::new(vec![]));
/// # let settings = StepSettings::new(0.01);
/// # let mut device = GpuSolver::new(gpu, solver, ClusterMapping::Threads)?;
/// device.step(&schedule, &settings)?;
/// let mut frame = device.begin_readback()?;
/// device.step(&schedule, &settings)?;
/// while frame.try_positions()?.is_none() {
///     // Draw the frame before once more.
/// }
/// assert_eq!(frame.wait()?, [DVec3::ONE]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Readback {
    gpu: Arc<GpuContext>,
    origin: DVec3,
    state: State,
}

#[derive(Debug)]
enum State {
    Underway(Staging<[f32; 4]>),
    Arrived(Vec<DVec3>),
}

impl GpuSolver {
    /// Has the positions copied aside, without waiting; steps and edits may follow. If the host has the state of now, they
    /// are there at once.
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    pub fn begin_readback(&self) -> Result<Readback, GpuError> {
        let count = self.host.particle_count();
        let state = if self.ahead && count > 0 {
            State::Underway(self.body.particles.stage(&self.gpu, count)?)
        } else {
            let mut positions = Vec::new();
            self.host.positions(&mut positions);
            State::Arrived(positions)
        };
        Ok(Readback {
            gpu: Arc::clone(&self.gpu),
            origin: self.host.origin(),
            state,
        })
    }
}

impl Readback {
    /// The positions of all particles in the world in m, if they have arrived; does not wait.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn try_positions(&mut self) -> Result<Option<&[DVec3]>, GpuError> {
        if let State::Underway(staging) = &self.state
            && let Some(local) = staging.try_collect(&self.gpu)?
        {
            self.state = State::Arrived(in_world(&local, self.origin));
        }
        Ok(match &self.state {
            State::Arrived(positions) => Some(positions),
            State::Underway(_) => None,
        })
    }

    /// Waits for the positions of all particles in the world in m, not for what the device was told afterwards.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn wait(self) -> Result<Vec<DVec3>, GpuError> {
        match self.state {
            State::Arrived(positions) => Ok(positions),
            State::Underway(staging) => Ok(in_world(&staging.collect(&self.gpu)?, self.origin)),
        }
    }
}

fn in_world(local: &[[f32; 4]], origin: DVec3) -> Vec<DVec3> {
    let place = |&[x, y, z, _]: &[f32; 4]| origin + DVec3::from_array([x, y, z].map(f64::from));
    local.iter().map(place).collect()
}
