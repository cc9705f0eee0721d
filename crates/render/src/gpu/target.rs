//! [`Target`]: render textures of an image and readback of its pixels.

use std::sync::mpsc;

use incise::gpu::wgpu::{self, TextureFormat, TextureUsages};
use incise::gpu::{GpuContext, GpuError};

use super::buffer;
use crate::contact_shadow::SIDE;
use crate::{Image, RenderError};

pub(super) const COLOR: TextureFormat = TextureFormat::Rgba8UnormSrgb;
/// Format of stored colors: eight bits per channel without sRGB conversion.
const STORED: TextureFormat = TextureFormat::Rgba8Unorm;
pub(super) const DEPTH: TextureFormat = TextureFormat::Depth32Float;
/// Format of the contact shadow.
pub(super) const DARK: TextureFormat = TextureFormat::R8Unorm;
/// Samples per pixel.
pub(super) const SAMPLES: u32 = 4;

/// Textures of one size.
#[derive(Debug)]
pub(super) struct Target {
    pub(super) size: [u32; 2],
    pub(super) samples: wgpu::TextureView,
    pub(super) depth: wgpu::TextureView,
    pub(super) resolved: wgpu::TextureView,
    /// View of the resolved texture with stored colors, for windows that take them without conversion.
    pub(super) shown: wgpu::TextureView,
    texture: wgpu::Texture,
}

impl Target {
    pub(super) fn new(gpu: &GpuContext, size: [u32; 2]) -> Result<Self, RenderError> {
        let created = gpu.guarded(wgpu::ErrorFilter::OutOfMemory, |device| {
            let texture = |label, format, sample_count, usage, view_formats| {
                device.create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: extent(size),
                    mip_level_count: 1,
                    sample_count,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage,
                    view_formats,
                })
            };
            let drawn = TextureUsages::RENDER_ATTACHMENT;
            let shown = drawn | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
            [
                texture("samples", COLOR, SAMPLES, drawn, &[]),
                texture("depth", DEPTH, SAMPLES, drawn, &[]),
                texture("picture", COLOR, 1, shown, &[STORED]),
            ]
        });
        let [samples, depth, resolved] = created.map_err(|_| {
            let bytes = u64::from(size[0]) * u64::from(size[1]) * u64::from(8 * SAMPLES + 4);
            let what = "a picture";
            GpuError::OutOfMemory { what, bytes }
        })?;
        let view =
            |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self {
            size,
            samples: view(&samples),
            depth: view(&depth),
            resolved: view(&resolved),
            shown: resolved.create_view(&wgpu::TextureViewDescriptor {
                format: Some(STORED),
                usage: Some(TextureUsages::TEXTURE_BINDING),
                ..wgpu::TextureViewDescriptor::default()
            }),
            texture: resolved,
        })
    }

    /// Waits for the image and reads it; increments `readbacks`.
    pub(super) fn read(&self, gpu: &GpuContext, readbacks: &mut u64) -> Result<Image, RenderError> {
        let [width, height] = self.size;
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = u64::from(row) * u64::from(height);
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = buffer::create(gpu, "a picture on its way", usage, bytes)?;
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row),
            rows_per_image: None,
        };
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout,
            },
            extent(self.size),
        );
        let bytes = collect(gpu, encoder, &staging, readbacks)?;
        let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
        for line in bytes.chunks_exact(row as usize) {
            rgba.extend_from_slice(&line[..4 * width as usize]);
        }
        Ok(Image {
            width,
            height,
            rgba,
        })
    }
}

/// Waits for the first bytes of a buffer and reads them; increments the readback counter.
pub(super) fn read_buffer(
    gpu: &GpuContext,
    what: &'static str,
    from: &wgpu::Buffer,
    bytes: u64,
    readbacks: &mut u64,
) -> Result<Vec<u8>, RenderError> {
    if bytes == 0 {
        return Ok(Vec::new());
    }
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let staging = buffer::create(gpu, what, usage, bytes)?;
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(from, 0, &staging, 0, bytes);
    collect(gpu, encoder, &staging, readbacks)
}

/// Submits commands that fill a buffer, waits and reads it.
fn collect(
    gpu: &GpuContext,
    encoder: wgpu::CommandEncoder,
    staging: &wgpu::Buffer,
    readbacks: &mut u64,
) -> Result<Vec<u8>, RenderError> {
    *readbacks += 1;
    gpu.queue().submit([encoder.finish()]);
    let (sender, receiver) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver is gone if this function has returned.
        let _ = sender.send(result.map_err(|error| error.to_string()));
    });
    gpu.wait()?;
    let lost = |message: String| RenderError::from(GpuError::Lost { message });
    let mapped = receiver.recv().map_err(|error| lost(error.to_string()))?;
    mapped.map_err(lost)?;
    let range = staging.get_mapped_range(..);
    let range = range.map_err(|error| lost(error.to_string()))?;
    Ok(range.to_vec())
}

/// Two textures of the contact shadow, which is blurred from one into the other and back.
#[derive(Debug)]
pub(super) struct Dark {
    pub(super) views: [wgpu::TextureView; 2],
    pub(super) sampler: wgpu::Sampler,
}

impl Dark {
    pub(super) fn new(gpu: &GpuContext) -> Self {
        let device = gpu.device();
        let side = u32::try_from(SIDE).unwrap_or(1);
        let texture = |label| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent([side; 2]),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: DARK,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            views: [texture("contact shadow"), texture("blurred contact shadow")],
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("between texels"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
        }
    }
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}
