//! [`Canvas`]: the picture of the body in the window.
//!
//! On a device that can simulate, the device draws the picture from the solver's buffers into a texture that the window
//! shows. Elsewhere the CPU draws, as for pictures of a run, and the window gets the pixels.

use std::sync::Arc;

use eframe::egui::{self, Color32, ColorImage, Rect, TextureHandle, TextureId, TextureOptions};
use eframe::egui_wgpu::RenderState;
use incise::gpu::{GpuContext, wgpu};
use incise_render::{GpuRenderer, Style, software_picture};

use crate::session::Session;

/// The renderer of the picture: the window's device or the CPU.
pub(crate) enum Canvas {
    /// The window's device.
    Device {
        state: RenderState,
        renderer: Box<GpuRenderer>,
        /// The window's id of the texture, and the texture's size.
        shown: Option<(TextureId, [u32; 2])>,
    },
    /// The CPU.
    Processor { texture: Option<TextureHandle> },
}

impl Canvas {
    /// Draws on the window's device if possible; otherwise the second part is the reason.
    pub(crate) fn new(
        state: Option<&RenderState>,
        gpu: Option<&Arc<GpuContext>>,
    ) -> (Self, Option<String>) {
        let processor = Self::Processor { texture: None };
        let (Some(state), Some(gpu)) = (state, gpu) else {
            return (processor, None);
        };
        match GpuRenderer::new(Arc::clone(gpu)) {
            Ok(renderer) => {
                let device = Self::Device {
                    state: state.clone(),
                    renderer: Box::new(renderer),
                    shown: None,
                };
                (device, None)
            }
            Err(error) => (processor, Some(format!("the CPU draws: {error}"))),
        }
    }

    /// True if the canvas draws from positions on the host.
    pub(crate) fn needs_positions(&self) -> bool {
        matches!(self, Self::Processor { .. })
    }

    /// Draws the session into a part of the window. Its simulation may be away unless it has a new state.
    pub(crate) fn show(
        &mut self,
        ui: &egui::Ui,
        rect: Rect,
        session: &mut Session,
        style: &Style,
    ) -> anyhow::Result<()> {
        let size = pixels(rect, ui.ctx().pixels_per_point());
        // Until other colors are there, the old ones stay.
        let style = &Style {
            color_by: session.view.shown,
            ..*style
        };
        let texture = match self {
            Self::Device {
                state,
                renderer,
                shown,
            } => {
                let is_new = session.take_new();
                let (scene, camera) = (&session.view.render_scene, &session.camera);
                let view = match session.simulation().filter(|_| is_new) {
                    Some(simulation) => renderer.draw(scene, simulation, camera, style, size)?,
                    None => renderer.redraw(scene, camera, style, size)?,
                };
                let mut known = state.renderer.write();
                let nearest = wgpu::FilterMode::Nearest;
                match *shown {
                    Some((id, old)) => {
                        if old != size {
                            let device = &state.device;
                            known.update_egui_texture_from_wgpu_texture(device, view, nearest, id);
                            *shown = Some((id, size));
                        }
                        id
                    }
                    None => {
                        let id = known.register_native_texture(&state.device, view, nearest);
                        *shown = Some((id, size));
                        id
                    }
                }
            }
            Self::Processor { texture } => {
                let picture = software_picture(
                    &session.view.render_scene,
                    &session.view.positions,
                    &session.camera,
                    style,
                    size,
                )?;
                let size = [picture.width as usize, picture.height as usize];
                let image = ColorImage::from_rgba_unmultiplied(size, &picture.rgba);
                match texture {
                    Some(texture) => texture.set(image, TextureOptions::NEAREST),
                    None => {
                        let context = ui.ctx();
                        *texture =
                            Some(context.load_texture("body", image, TextureOptions::NEAREST));
                    }
                }
                match texture {
                    Some(texture) => texture.id(),
                    None => return Ok(()),
                }
            }
        };
        let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        ui.painter().image(texture, rect, whole, Color32::WHITE);
        Ok(())
    }
}

/// The size of a part of the window in pixels, at least one each way.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "windows have some thousand pixels"
)]
fn pixels(rect: Rect, per_point: f32) -> [u32; 2] {
    let of = |points: f32| (points * per_point).round().clamp(1.0, 16384.0) as u32;
    [of(rect.width()), of(rect.height())]
}
