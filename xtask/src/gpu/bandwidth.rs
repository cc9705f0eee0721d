//! Memory bandwidth of the device, by copies between two buffers.
//!
//! Each byte is read once and written once. The buffers are larger than current caches, so a small body may exceed this
//! bandwidth.

use std::time::Instant;

use anyhow::ensure;
use incise::gpu::GpuContext;
use incise::gpu::wgpu::{BufferDescriptor, BufferUsages, CommandEncoderDescriptor};

use super::measure::{flush, ms_since};
use super::report::Bandwidth;

/// Bytes per buffer, unless the device or a test sets a lower limit.
const BYTES: u64 = 512 << 20;
const QUICK: u64 = 32 << 20;

/// Copies before a wait, an even number, and runs.
const COPIES: u32 = 10;
const RUNS: u32 = 10;

pub(crate) fn bandwidth(gpu: &GpuContext, quick: bool) -> anyhow::Result<Bandwidth> {
    let limit = gpu.device().limits().max_buffer_size;
    let bytes = if quick { QUICK } else { BYTES }.min(limit) / 256 * 256;
    let buffers = ["copied from", "copied to"].map(|label| {
        gpu.device().create_buffer(&BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    });
    let [a, b] = &buffers;
    let mut fastest = f64::INFINITY;
    for run in 0..=RUNS {
        let descriptor = CommandEncoderDescriptor::default();
        let mut encoder = gpu.device().create_command_encoder(&descriptor);
        for _ in 0..COPIES / 2 {
            encoder.copy_buffer_to_buffer(a, 0, b, 0, bytes);
            encoder.copy_buffer_to_buffer(b, 0, a, 0, bytes);
        }
        flush(gpu)?;
        let start = Instant::now();
        gpu.queue().submit([encoder.finish()]);
        gpu.wait()?;
        // The first clears the buffers, too.
        if run > 0 {
            fastest = fastest.min(ms_since(start));
        }
    }
    ensure!(fastest > 0.0, "copies take no time");
    Ok(Bandwidth {
        bytes,
        bytes_per_second: 2.0 * f64::from(COPIES) * bytes as f64 / (fastest * 1e-3),
    })
}
