//! Jones-Plassmann without shortcuts, largest degree first (Jones and Plassmann 1993, with the priorities of ECL-GC).
//!
//! Twin of [`incise_coloring::jones_plassmann`]. Cost: each edge is visited twice; the number of rounds is the length
//! of the longest chain of falling priorities.

use super::kernels::{ALL, ColoringKernels, JONES_PLASSMANN};
use super::rounds::{HEADER, Rounds, worklists};
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Colors without shortcuts: every vertex waits for all its neighbors of higher priority.
///
/// The coloring is that of [`incise_coloring::jones_plassmann`], bit for bit.
///
/// # Errors
/// If the device is lost or has no room for the work arrays.
///
/// ```
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, jones_plassmann};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::ConstraintGraph;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let star = ConstraintGraph::from_edges(4, &[(0, 1), (0, 2), (0, 3)])?;
/// let graph = DeviceGraph::new(&gpu, &star)?;
/// let coloring = jones_plassmann(&gpu, &mut ColoringKernels::default(), &graph)?;
/// assert_eq!(coloring.color_count(), 2);
/// assert_eq!(coloring.read(&gpu)?, incise_coloring::jones_plassmann(&star).coloring);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn jones_plassmann(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
) -> Result<DeviceColoring, GpuError> {
    let vertices = graph.vertex_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    let colors = Array::zeros(gpu, "colors", vertices)?;
    let passed = kernels.array(gpu, "passed neighbors", vertices)?;
    let work = worklists(gpu, kernels, vertices)?;
    let parts = graph.parts.buffer();
    let (offsets, neighbors) = (graph.offsets.buffer(), graph.neighbors.buffer());
    let all = kernels.bind(gpu, &ALL, &[parts, &work, colors.buffer()])?;
    let buffers = [parts, &work, offsets, neighbors, colors.buffer(), &passed];
    let round = kernels.bind(gpu, &JONES_PLASSMANN, &buffers)?;
    let rounds = Rounds {
        algorithm: "jones_plassmann",
        vertices,
        max_rounds: usize::MAX,
        clear: vec![(&work, HEADER), (&passed, vertices)],
        first: vec![all],
        round: vec![round],
    };
    let work = rounds.run(gpu, kernels, &graph.parts)?;
    Ok(work.into_coloring(colors))
}
