//! The window's device: one for drawing and, if it can, for simulating.
//!
//! An adapter with the limits that the kernels need gets a device that solver and renderer share, so that results are
//! drawn without leaving it. A less capable one (OpenGL of an old driver) only shows the window: the CPU then simulates and
//! draws, and the panel shows a note.

use std::sync::Arc;

use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use incise::gpu::{GpuContext, wgpu};

/// How the window opens its device.
pub(crate) fn configuration() -> WgpuConfiguration {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    let lesser = Arc::clone(&setup.device_descriptor);
    setup.device_descriptor = Arc::new(move |adapter| {
        if can_simulate(adapter) {
            GpuContext::descriptor(adapter)
        } else {
            lesser(adapter)
        }
    });
    WgpuConfiguration {
        wgpu_setup: WgpuSetup::CreateNew(setup),
        ..WgpuConfiguration::default()
    }
}

/// Tests whether an adapter has the limits that the kernels need.
fn can_simulate(adapter: &wgpu::Adapter) -> bool {
    wgpu::Limits::default().check_limits(&adapter.limits())
}

/// The window's device for simulating and drawing, or the reason why it cannot be used.
pub(crate) fn share(state: &RenderState) -> Result<Arc<GpuContext>, String> {
    if can_simulate(&state.adapter) {
        let (device, queue) = (state.device.clone(), state.queue.clone());
        return Ok(Arc::new(GpuContext::from_device(device, queue)));
    }
    let info = state.adapter.get_info();
    Err(format!(
        "{} ({}) does not support the kernels; the CPU simulates and draws",
        info.name, info.backend
    ))
}
