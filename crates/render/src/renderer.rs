//! [`Renderer`]: a device renderer if there is one, else the software renderer.

use incise::Simulation;

#[cfg(feature = "gpu")]
use crate::GpuRenderer;
use crate::{Camera, Image, RenderError, RenderScene, Style, software_picture};

/// Renderer on a device or on the processor.
#[derive(Debug)]
#[non_exhaustive]
pub enum Renderer {
    /// Device renderer.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuRenderer>),
    /// Software renderer.
    Software,
}

impl Renderer {
    /// Opens a device renderer if a hardware device supports it, else the software renderer, with the reason. Opening a
    /// device takes some hundred milliseconds. A device emulated by the processor is slower than the software renderer;
    /// it is used only if `WGPU_ADAPTER_NAME` names it.
    #[must_use]
    pub fn open() -> (Self, Option<String>) {
        #[cfg(feature = "gpu")]
        return match Self::on_device() {
            Ok(renderer) => (Self::Gpu(Box::new(renderer)), None),
            Err(reason) => (Self::Software, Some(reason)),
        };
        #[cfg(not(feature = "gpu"))]
        {
            let reason = "this build draws on no GPU (feature `gpu`)".to_owned();
            (Self::Software, Some(reason))
        }
    }

    #[cfg(feature = "gpu")]
    fn on_device() -> Result<GpuRenderer, String> {
        use incise::gpu::{GpuContext, GpuOptions};

        let options = GpuOptions::from_env();
        if options.adapter.is_none() && !may_have_gpu() {
            return Err("there is no GPU".to_owned());
        }
        let gpu = GpuContext::new(&options).map_err(|error| error.to_string())?;
        let adapter = gpu.adapter();
        if adapter.software && options.adapter.is_none() {
            return Err(format!("the only GPU is software ({})", adapter.name));
        }
        GpuRenderer::new(gpu.into()).map_err(|error| error.to_string())
    }

    /// Opens a renderer on the device that a simulation runs on, so that its positions stay there. For a simulation
    /// that runs on no device, or on one that cannot draw, equivalent to [`Renderer::open`].
    #[must_use]
    pub fn for_simulation(simulation: &Simulation) -> (Self, Option<String>) {
        #[cfg(feature = "gpu")]
        if let Some(solver) = simulation.device_solvers().next()
            && let Ok(renderer) = GpuRenderer::new(std::sync::Arc::clone(solver.gpu()))
        {
            return (Self::Gpu(Box::new(renderer)), None);
        }
        #[cfg(not(feature = "gpu"))]
        let _ = simulation;
        Self::open()
    }

    /// True if drawing the current state needs a [readback](Simulation::read_back) of the simulation first: it runs on
    /// a device and is not drawn from there. Before the first step after the render scene was created or reset, no
    /// simulation is drawn from a device.
    #[must_use]
    pub fn needs_read_back(&self, render_scene: &RenderScene, simulation: &Simulation) -> bool {
        match self {
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.needs_read_back(render_scene, simulation),
            #[cfg(feature = "gpu")]
            Self::Software => simulation.device_solvers().next().is_some(),
            #[cfg(not(feature = "gpu"))]
            Self::Software => {
                let _ = (render_scene, simulation);
                false
            }
        }
    }

    /// Description of the device or processor that draws.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => {
                let adapter = renderer.gpu().adapter();
                format!("{} ({})", adapter.name, adapter.backend)
            }
            Self::Software => "the processor".to_owned(),
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
        match self {
            #[cfg(feature = "gpu")]
            Self::Gpu(renderer) => renderer.picture(render_scene, simulation, camera, style, size),
            Self::Software => {
                software_picture(render_scene, simulation.positions(), camera, style, size)
            }
        }
    }
}

/// True if a hardware device may exist. Loading drivers takes a tenth of a second, and drivers without a device print
/// warnings; on Linux a GPU is visible in the file system.
#[cfg(feature = "gpu")]
fn may_have_gpu() -> bool {
    const NODES: [&str; 6] = [
        "/dev/dri",
        "/dev/nvidiactl",
        "/dev/dxg",
        "/dev/nvhost-gpu",
        "/dev/kgsl-3d0",
        "/dev/mali0",
    ];
    !cfg!(target_os = "linux") || NODES.iter().any(|node| std::path::Path::new(node).exists())
}
