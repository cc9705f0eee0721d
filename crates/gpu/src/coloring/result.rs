//! [`DeviceColoring`]: a coloring in device memory.

use incise_graph::{ColorId, Coloring};

use crate::array::Array;
use crate::{GpuContext, GpuError};

/// A coloring in device memory.
#[derive(Debug)]
pub struct DeviceColoring {
    pub(super) colors: Array<u32>,
    pub(super) color_count: usize,
    pub(super) rounds: usize,
}

impl DeviceColoring {
    /// The coloring of no vertices.
    pub(super) fn empty(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            colors: Array::zeros(gpu, "colors", 0)?,
            color_count: 0,
            rounds: 0,
        })
    }

    /// The number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.colors.len()
    }

    /// The number of colors, each of which is used.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.color_count
    }

    /// The number of rounds on this device.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.rounds
    }

    /// The buffer of colors, a `u32` per vertex, for later kernels. It may be larger than needed.
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.colors.buffer()
    }

    /// Waits for the device and reads the colors: 4 bytes per vertex.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn read(&self, gpu: &GpuContext) -> Result<Coloring, GpuError> {
        let colors = self.colors.read(gpu)?;
        Ok(Coloring::new(colors.into_iter().map(ColorId).collect()))
    }
}
