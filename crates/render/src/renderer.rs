//! [`Renderer`]: a device renderer if there is one, else the software renderer.

use incise::Simulation;

use crate::gpu::{self, GpuRenderer};
use crate::{Camera, Image, RenderError, RenderScene, Style, software_picture};

/// Renderer on a device or on the processor.
#[derive(Debug)]
pub struct Renderer {
    /// The device renderer; `None` is the software renderer.
    gpu: Option<Box<GpuRenderer>>,
}

impl Renderer {
    /// Opens a device renderer if a hardware device supports it, else the software renderer, with the reason. Opening a
    /// device takes some hundred milliseconds. A device emulated by the processor is slower than the software renderer;
    /// it is used only if `WGPU_ADAPTER_NAME` names it.
    #[must_use]
    pub fn open() -> (Self, Option<String>) {
        match gpu::open() {
            Ok(renderer) => (Self::on_device(renderer), None),
            Err(reason) => (Self { gpu: None }, Some(reason)),
        }
    }

    fn on_device(renderer: GpuRenderer) -> Self {
        Self {
            gpu: Some(Box::new(renderer)),
        }
    }

    /// Opens a renderer on the device that a simulation runs on, so that its positions stay there. For a simulation
    /// that runs on no device, or on one that cannot draw, equivalent to [`Renderer::open`].
    #[must_use]
    pub fn for_simulation(simulation: &Simulation) -> (Self, Option<String>) {
        match gpu::open_for(simulation) {
            Some(renderer) => (Self::on_device(renderer), None),
            None => Self::open(),
        }
    }

    /// True if drawing the current state needs a [readback](Simulation::read_back) of the simulation first: it runs on
    /// a device and is not drawn from there. Before the first step after the render scene was created or reset, no
    /// simulation is drawn from a device.
    #[must_use]
    pub fn needs_read_back(&self, render_scene: &RenderScene, simulation: &Simulation) -> bool {
        match &self.gpu {
            Some(renderer) => renderer.needs_read_back(render_scene, simulation),
            None => gpu::is_on_device(simulation),
        }
    }

    /// Description of the device or processor that draws.
    #[must_use]
    pub fn describe(&self) -> String {
        match &self.gpu {
            Some(renderer) => renderer.describe(),
            None => "the processor".to_owned(),
        }
    }

    /// Draws an image; of the current state if the simulation was read back where [`Renderer::needs_read_back`] says
    /// so.
    ///
    /// # Errors
    /// If a side of the image is 0 or too large; if a device is lost or out of memory.
    ///
    /// # Panics
    /// If the render scene does not match the simulation.
    pub fn picture(
        &mut self,
        render_scene: &RenderScene,
        simulation: &Simulation,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<Image, RenderError> {
        match &mut self.gpu {
            Some(renderer) => renderer.picture(render_scene, simulation, camera, style, size),
            None => software_picture(render_scene, simulation.positions(), camera, style, size),
        }
    }
}
