//! [`Array`]: numbers of one type in device memory that can grow, be patched and be read back.
//!
//! Capacity grows by factors of three halves, so growth sometimes costs a copy on the device and never an upload. All
//! transferred bytes are counted. Cost: O(values written or read).

use std::marker::PhantomData;
use std::sync::mpsc;

use bytemuck::{AnyBitPattern, NoUninit};
use wgpu::{Buffer, BufferUsages, SubmissionIndex};

use crate::traffic::count;
use crate::{GpuContext, GpuError};

/// Bytes of the smallest buffer: a binding must not be empty.
const SMALLEST: u64 = 256;

/// An array of numbers on the device.
#[derive(Debug)]
pub(crate) struct Array<T> {
    what: &'static str,
    buffer: Buffer,
    len: usize,
    usage: BufferUsages,
    of: PhantomData<T>,
}

impl<T: NoUninit + AnyBitPattern> Array<T> {
    /// An array of `len` zeros in a storage buffer.
    pub(crate) fn zeros(
        gpu: &GpuContext,
        what: &'static str,
        len: usize,
    ) -> Result<Self, GpuError> {
        Self::with_usage(gpu, what, len, BufferUsages::STORAGE)
    }

    /// An array of `len` zeros in a buffer for `usage` and for copies from and to it.
    pub(crate) fn with_usage(
        gpu: &GpuContext,
        what: &'static str,
        len: usize,
        usage: BufferUsages,
    ) -> Result<Self, GpuError> {
        let usage = usage | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let buffer = buffer(gpu, what, bytes::<T>(len), usage)?;
        Ok(Self {
            what,
            buffer,
            len,
            usage,
            of: PhantomData,
        })
    }

    /// An array of these values.
    pub(crate) fn new(
        gpu: &GpuContext,
        what: &'static str,
        values: &[T],
    ) -> Result<Self, GpuError> {
        let array = Self::zeros(gpu, what, values.len())?;
        array.write(gpu, 0, values);
        Ok(array)
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn buffer(&self) -> &Buffer {
        &self.buffer
    }

    /// Overwrites values from the index `start` on, before the next submit.
    ///
    /// # Panics
    /// If the values reach past the end.
    pub(crate) fn write(&self, gpu: &GpuContext, start: usize, values: &[T]) {
        assert!(
            start + values.len() <= self.len,
            "{}: past the end",
            self.what
        );
        if values.is_empty() {
            return;
        }
        let data: &[u8] = bytemuck::cast_slice(values);
        gpu.queue()
            .write_buffer(&self.buffer, bytes::<T>(start), data);
        count(&gpu.counters().uploaded_bytes, data.len() as u64);
    }

    /// Changes the length; existing values stay, added ones are zeros or values that were cut off before.
    pub(crate) fn resize(&mut self, gpu: &GpuContext, len: usize) -> Result<(), GpuError> {
        let needed = bytes::<T>(len);
        if needed > self.buffer.size() {
            let limit = gpu.buffer_limit();
            let roomy = (self.buffer.size() / 2 * 3).clamp(needed, limit.max(needed));
            let larger = buffer(gpu, self.what, roomy, self.usage)?;
            let mut encoder = gpu.encoder(self.what);
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &larger, 0, self.buffer.size());
            gpu.submit(encoder)?;
            self.buffer = larger;
        }
        self.len = len;
        Ok(())
    }

    /// Replaces all values.
    pub(crate) fn replace(&mut self, gpu: &GpuContext, values: &[T]) -> Result<(), GpuError> {
        if bytes::<T>(values.len()) > self.buffer.size() {
            let roomy = bytes::<T>(values.len() + values.len() / 2).min(gpu.buffer_limit());
            let size = roomy.max(bytes::<T>(values.len()));
            self.buffer = buffer(gpu, self.what, size, self.usage)?;
        }
        self.len = values.len();
        self.write(gpu, 0, values);
        Ok(())
    }

    /// Waits for the device and reads all values.
    pub(crate) fn read(&self, gpu: &GpuContext) -> Result<Vec<T>, GpuError> {
        self.read_first(gpu, self.len)
    }

    /// Waits for the device and reads the first values.
    pub(crate) fn read_first(&self, gpu: &GpuContext, len: usize) -> Result<Vec<T>, GpuError> {
        assert!(len <= self.len, "{}: past the end", self.what);
        match len {
            0 => Ok(Vec::new()),
            _ => self.stage(gpu, len)?.collect(gpu),
        }
    }

    /// Starts a copy of the first values that the host can wait for later.
    pub(crate) fn stage(&self, gpu: &GpuContext, len: usize) -> Result<Staging<T>, GpuError> {
        let mut encoder = gpu.encoder(self.what);
        let copy = self.copy_out(gpu, &mut encoder, len)?;
        Ok(copy.handed_over(&gpu.submit(encoder)?))
    }

    /// Records such a copy without submitting it, so that several can be submitted together.
    pub(crate) fn copy_out(
        &self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        len: usize,
    ) -> Result<Copy<T>, GpuError> {
        let size = aligned::<T>(len);
        let staging = match gpu.spare(size) {
            Some(spare) => spare,
            None => {
                let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
                buffer(gpu, self.what, size, usage)?
            }
        };
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &staging, 0, size);
        Ok(Copy {
            buffer: staging,
            len,
            of: PhantomData,
        })
    }
}

/// A recorded copy that is not submitted yet.
#[derive(Debug)]
pub(crate) struct Copy<T> {
    buffer: Buffer,
    len: usize,
    of: PhantomData<T>,
}

impl<T: NoUninit + AnyBitPattern> Copy<T> {
    /// Marks the copy as part of this submission.
    pub(crate) fn handed_over(self, submission: &SubmissionIndex) -> Staging<T> {
        let (sender, receiver) = mpsc::channel();
        let wanted = ..aligned::<T>(self.len);
        self.buffer
            .map_async(wgpu::MapMode::Read, wanted, move |result| {
                // The receiver is gone if the staging buffer was dropped.
                let _ = sender.send(result.map_err(|error| error.to_string()));
            });
        Staging {
            buffer: self.buffer,
            len: self.len,
            submission: submission.clone(),
            receiver,
            of: PhantomData,
        }
    }
}

/// A submitted copy to the host.
#[derive(Debug)]
pub(crate) struct Staging<T> {
    buffer: Buffer,
    len: usize,
    submission: SubmissionIndex,
    receiver: mpsc::Receiver<Result<(), String>>,
    of: PhantomData<T>,
}

impl<T: NoUninit + AnyBitPattern> Staging<T> {
    /// Waits for the copy and returns its values.
    pub(crate) fn collect(self, gpu: &GpuContext) -> Result<Vec<T>, GpuError> {
        gpu.wait_for(self.submission.clone())?;
        let mapped = self.receiver.recv();
        self.values(gpu, mapped.map_err(|error| lost(&error))?)
    }

    fn values(&self, gpu: &GpuContext, mapped: Result<(), String>) -> Result<Vec<T>, GpuError> {
        mapped.map_err(|message| GpuError::Lost { message })?;
        let view = self
            .buffer
            .slice(..aligned::<T>(self.len))
            .get_mapped_range();
        let view = view.map_err(|error| lost(&error))?;
        // The view has the alignment of bytes.
        let data = &view[..usize::try_from(bytes::<T>(self.len)).unwrap_or(usize::MAX)];
        let values = bytemuck::pod_collect_to_vec::<u8, T>(data);
        count(&gpu.counters().readbacks, 1);
        count(&gpu.counters().read_bytes, bytes::<T>(self.len));
        drop(view);
        self.buffer.unmap();
        gpu.keep(self.buffer.clone());
        Ok(values)
    }
}

fn lost(error: &dyn std::error::Error) -> GpuError {
    GpuError::Lost {
        message: error.to_string(),
    }
}

/// Bytes to copy for `len` values: a multiple of the alignment of copies.
fn aligned<T>(len: usize) -> u64 {
    bytes::<T>(len).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT)
}

fn bytes<T>(len: usize) -> u64 {
    (len * size_of::<T>()) as u64
}

/// Creates a buffer, or returns the error of the device.
fn buffer(
    gpu: &GpuContext,
    what: &'static str,
    bytes: u64,
    usage: BufferUsages,
) -> Result<Buffer, GpuError> {
    gpu.check()?;
    let limit = gpu.buffer_limit();
    if bytes > limit {
        return Err(GpuError::TooLarge { what, bytes, limit });
    }
    let created = gpu.guarded(wgpu::ErrorFilter::OutOfMemory, |device| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes
                .max(SMALLEST)
                .next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
            usage,
            mapped_at_creation: false,
        })
    });
    let buffer = created.map_err(|_| GpuError::OutOfMemory { what, bytes })?;
    count(&gpu.counters().buffers, 1);
    Ok(buffer)
}
