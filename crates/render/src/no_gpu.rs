//! What stands for device renderers in a build without the feature `gpu`: none can exist.

use incise::Simulation;

use crate::{Camera, Image, RenderError, RenderScene, Style};

/// Renderer on a device.
#[derive(Debug)]
pub(crate) enum GpuRenderer {}

/// Returns the reason why there is no device renderer.
pub(crate) fn open() -> Result<GpuRenderer, String> {
    Err("this build draws on no GPU (feature `gpu`)".to_owned())
}

/// Returns that there is no device renderer.
pub(crate) fn open_for(_: &Simulation) -> Option<GpuRenderer> {
    None
}

/// Returns that no simulation is on a device.
pub(crate) fn is_on_device(_: &Simulation) -> bool {
    false
}

impl GpuRenderer {
    pub(crate) fn needs_read_back(&self, _: &RenderScene, _: &Simulation) -> bool {
        match *self {}
    }

    pub(crate) fn describe(&self) -> String {
        match *self {}
    }

    pub(crate) fn picture(
        &mut self,
        _: &RenderScene,
        _: &Simulation,
        _: &Camera,
        _: &Style,
        _: [u32; 2],
    ) -> Result<Image, RenderError> {
        match *self {}
    }
}
