//! [`Buffer`]: array in device memory that is replaced as a whole.

use std::marker::PhantomData;

use bytemuck::NoUninit;
use incise::gpu::wgpu::{self, BufferUsages};
use incise::gpu::{GpuContext, GpuError};

/// Growable array in device memory; it grows to 1.5 times the needed size.
#[derive(Debug)]
pub(super) struct Buffer<T> {
    what: &'static str,
    usage: BufferUsages,
    buffer: wgpu::Buffer,
    len: usize,
    /// Bytes written since its creation.
    sent: u64,
    of: PhantomData<T>,
}

impl<T: NoUninit> Buffer<T> {
    /// Creates an empty buffer.
    pub(super) fn new(
        gpu: &GpuContext,
        what: &'static str,
        usage: BufferUsages,
    ) -> Result<Self, GpuError> {
        let usage = usage | BufferUsages::COPY_DST;
        Ok(Self {
            what,
            usage,
            // No binding may be empty, and the largest element has a few dozen bytes.
            buffer: create(gpu, what, usage, 256)?,
            len: 0,
            sent: 0,
            of: PhantomData,
        })
    }

    /// Replaces all values.
    pub(super) fn replace(&mut self, gpu: &GpuContext, values: &[T]) -> Result<(), GpuError> {
        self.resize(gpu, values.len())?;
        if !values.is_empty() {
            let bytes: &[u8] = bytemuck::cast_slice(values);
            self.sent += bytes.len() as u64;
            gpu.queue().write_buffer(&self.buffer, 0, bytes);
        }
        Ok(())
    }

    /// Makes room for `len` values; contents are lost if the buffer has to grow.
    pub(super) fn resize(&mut self, gpu: &GpuContext, len: usize) -> Result<(), GpuError> {
        let bytes = (len * size_of::<T>()) as u64;
        if bytes > self.buffer.size() {
            let roomy = (bytes + bytes / 2).next_multiple_of(4);
            let size = roomy.min(limit(gpu, self.usage)).max(bytes);
            self.buffer = create(gpu, self.what, self.usage, size)?;
        }
        self.len = len;
        Ok(())
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn sent(&self) -> u64 {
        self.sent
    }

    pub(super) fn raw(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

/// Size limit of a buffer in bytes: buffers that no shader binds, such as readback buffers, may exceed the binding
/// limit.
fn limit(gpu: &GpuContext, usage: BufferUsages) -> u64 {
    if usage.intersects(BufferUsages::STORAGE | BufferUsages::UNIFORM) {
        gpu.buffer_limit()
    } else {
        gpu.device().limits().max_buffer_size
    }
}

/// Creates a buffer after a check of its size.
pub(super) fn create(
    gpu: &GpuContext,
    what: &'static str,
    usage: BufferUsages,
    bytes: u64,
) -> Result<wgpu::Buffer, GpuError> {
    gpu.check()?;
    let limit = limit(gpu, usage);
    if bytes > limit {
        return Err(GpuError::TooLarge { what, bytes, limit });
    }
    let created = gpu.guarded(wgpu::ErrorFilter::OutOfMemory, |device| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
            usage,
            mapped_at_creation: false,
        })
    });
    created.map_err(|_| GpuError::OutOfMemory { what, bytes })
}
