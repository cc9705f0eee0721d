//! [`DeviceGraph`]: a graph in device memory.
//!
//! Offsets and neighbors are stored as on the host. Degrees, priorities and all other inputs of a coloring are computed
//! on the device for each coloring. Cost: one upload of 4 bytes per vertex and 8 per edge.

use incise_graph::ConstraintGraph;

use super::rounds::parts;
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// A conflict graph in device memory, ready to be colored.
///
/// ```
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, scgc};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::ConstraintGraph;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let ring = ConstraintGraph::from_edges(5, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)])?;
/// let graph = DeviceGraph::new(&gpu, &ring)?;
/// let mut kernels = ColoringKernels::default();
/// let coloring = scgc(&gpu, &mut kernels, &graph)?;
/// assert_eq!(coloring.color_count(), 3);
/// coloring.read(&gpu)?.verify(&ring)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct DeviceGraph {
    vertices: usize,
    pub(super) offsets: Array<u32>,
    pub(super) neighbors: Array<u32>,
    /// Uniforms of even and odd rounds.
    pub(super) parts: Array<u32>,
}

impl DeviceGraph {
    /// Uploads a graph. O(vertices + edges).
    ///
    /// # Errors
    /// If the device has no room for it.
    pub fn new(gpu: &GpuContext, graph: &ConstraintGraph) -> Result<Self, GpuError> {
        Ok(Self {
            vertices: graph.vertex_count(),
            offsets: Array::new(gpu, "offsets of a graph", graph.offsets())?,
            neighbors: Array::new(gpu, "neighbors of a graph", graph.values())?,
            parts: parts(gpu, graph.vertex_count())?,
        })
    }

    /// The number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// Words of the palettes: a bit per color, for degree + 1 colors per vertex. See `palettes.wgsl`.
    pub(super) fn palette_words(&self) -> usize {
        self.neighbors.len() / 32 + self.vertices + 1
    }
}
