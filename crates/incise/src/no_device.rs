//! What stands for devices in a build without the feature `gpu`: none can exist, so no function of one is reached.

use std::sync::Arc;

use incise_xpbd::Solver;

use crate::Error;
use crate::scene::{Backend, SolverSpec};
use crate::solver_backend::SolverBackend;

/// An open device.
#[derive(Debug)]
pub(crate) enum GpuContext {}

/// A device that is open, if one is.
pub(crate) type OpenDevice = Option<Arc<GpuContext>>;

/// A solver on a device.
#[derive(Debug)]
pub(crate) enum Device {}

/// Returns why there is no device, as an error if one is required.
pub(crate) fn open(backend: Backend, _: &OpenDevice) -> Result<(OpenDevice, String), Error> {
    let reason = "this build has no GPU path (feature `gpu`)";
    match backend {
        Backend::Gpu => Err(Error::NoGpuPath),
        _ => Ok((None, reason.to_owned())),
    }
}

impl Device {
    pub(crate) fn new(
        gpu: &Arc<GpuContext>,
        _: Solver<f32>,
        _: &SolverSpec,
    ) -> Result<Self, Error> {
        match **gpu {}
    }

    pub(crate) fn serves(&self, _: &Arc<GpuContext>, _: &SolverSpec) -> Result<bool, Error> {
        match *self {}
    }

    pub(crate) fn cached_host(&self) -> &Solver<f32> {
        match *self {}
    }

    pub(crate) fn replace(&mut self, _: Solver<f32>) {
        match *self {}
    }

    pub(crate) fn backend(&self) -> &dyn SolverBackend {
        match *self {}
    }

    pub(crate) fn backend_mut(&mut self) -> &mut dyn SolverBackend {
        match *self {}
    }
}
