//! Opening of device renderers, for [`Renderer`](crate::Renderer).

use std::sync::Arc;

use incise::Simulation;
use incise::gpu::{GpuContext, GpuOptions};

use super::GpuRenderer;

/// Opens a renderer on a hardware device, or on the one that `WGPU_ADAPTER_NAME` names.
///
/// # Errors
/// The reason, if no device can draw.
pub(crate) fn open() -> Result<GpuRenderer, String> {
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

/// Opens a renderer on the device of a simulation; `None` without one that can draw.
pub(crate) fn open_for(simulation: &Simulation) -> Option<GpuRenderer> {
    let solver = simulation.device_solvers().next()?;
    GpuRenderer::new(Arc::clone(solver.gpu())).ok()
}

/// True if the state of a simulation is on a device.
pub(crate) fn is_on_device(simulation: &Simulation) -> bool {
    simulation.device_solvers().next().is_some()
}

impl GpuRenderer {
    /// Name and interface of the device.
    pub(crate) fn describe(&self) -> String {
        let adapter = self.gpu.adapter();
        format!("{} ({})", adapter.name, adapter.backend)
    }
}

/// True if a hardware device may exist. Loading drivers takes a tenth of a second, and drivers without a device print
/// warnings; on Linux a GPU is visible in the file system.
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
