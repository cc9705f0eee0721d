//! [`Renderer`]: a device if there is one, else the processor.

use incise::Simulation;

#[cfg(feature = "gpu")]
use crate::GpuRenderer;
use crate::{Camera, Image, RenderError, RenderScene, Style, software_picture};

/// Draws on a device or on the processor.
#[derive(Debug)]
#[non_exhaustive]
pub enum Renderer {
    /// On a device.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuRenderer>),
    /// On the processor.
    Software,
}

impl Renderer {
    /// A device's if there is a real one that can, else the processor's, with the reason. Opening a device takes some
    /// hundred milliseconds. A device that is a processor in disguise is slower than the processor itself: it draws only if
    /// the environment names it, by `WGPU_ADAPTER_NAME`.
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

    /// The device that a simulation is computed on, so that its positions need not leave it; for one that is not on a device,
    /// or on one that cannot draw, as [`Renderer::open`].
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

    /// Whether a simulation has to be [read back](Simulation::read_back) for a picture of the present: it is on a device,
    /// and not drawn from there. Until a step after the render scene was made or reset, no simulation is drawn from a device.
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

    /// What it draws on, in words.
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

    /// Draws a picture, of the present if the simulation was read back where [`Renderer::needs_read_back`] says so.
    ///
    /// # Errors
    /// If a side of the picture is 0 or too large; if a device is lost or out of memory.
    ///
    /// # Panics
    /// If the render scene does not follow the simulation.
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
            Self::Software => software_picture(render_scene, simulation, camera, style, size),
        }
    }
}

/// Whether it makes sense to look for a real device. Loading drivers takes a tenth of a second, and those that find nothing
/// complain on the terminal; on Linux a GPU shows in the file system.
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
