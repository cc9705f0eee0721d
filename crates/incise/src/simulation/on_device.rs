//! Simulations on an open GPU device, such as that of a renderer.

use std::sync::Arc;

use incise_gpu::{GpuContext, GpuSolver};

use super::{Simulation, SimulationBuilder};
use crate::backend::AnySolver;
use crate::{Error, Scene};

impl SimulationBuilder {
    /// Computes on an open GPU device, for example that of a renderer.
    pub fn device(&mut self, gpu: Arc<GpuContext>) -> &mut Self {
        self.device = Some(gpu);
        self
    }
}

impl Simulation {
    /// Creates a simulation of a scene on an open device, such as that of a renderer or of another simulation;
    /// `solver.backend` is ignored.
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::new`], and one if the device does not support the scene's settings.
    pub fn on_device(scene: &Scene, gpu: Arc<GpuContext>) -> Result<Self, Error> {
        let mut builder = SimulationBuilder::from_scene(scene.clone());
        builder.device(gpu);
        builder.build()
    }

    /// Offers an open device, typically that of a window. [`Simulation::set_solver`] uses it when it next moves the
    /// simulation to a device. Without an offer it uses a device that the simulation has left, or opens one as
    /// [`Simulation::new`] does.
    ///
    /// ```
    /// use std::sync::Arc;
    ///
    /// use incise::gpu::{GpuContext, GpuError, GpuOptions};
    /// use incise::scene::Backend;
    /// use incise::{Scene, Simulation};
    ///
    /// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
    ///     Ok(gpu) => Arc::new(gpu),
    ///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
    ///     Err(other) => return Err(other.into()),
    /// };
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.offer_device(gpu);
    /// simulation.step()?;
    /// let spec = simulation.solver_spec().clone().with(|solver| solver.backend = Backend::Gpu);
    /// simulation.set_solver(&spec)?;
    /// assert_eq!(simulation.step()?.backend, "gpu");
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn offer_device(&mut self, gpu: Arc<GpuContext>) {
        self.open_device = Some(gpu);
    }

    /// Returns the device solvers of the islands of bodies, for renderers; none on the CPU. [`Simulation::location_of`]
    /// maps particles to them.
    pub fn device_solvers(&self) -> impl Iterator<Item = &GpuSolver> + '_ {
        let islands = self.state.islands.iter();
        islands.filter_map(|island| match &island.solver {
            AnySolver::Device(device) => Some(&device.solver),
            _ => None,
        })
    }
}
