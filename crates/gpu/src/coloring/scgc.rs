//! Shortcut graph coloring (paper section 4.1, Algorithm 1) with all three shortcuts.
//!
//! Twin of [`incise_coloring::scgc`]. Lists of higher neighbors and palettes are built on the device first. Cost: each
//! edge is visited three times, and once more for each smallest color that its lower vertex passes over.

use super::kernels::{ALL, ColoringKernels, HIGHER, SCGC};
use super::rounds::{HEADER, Rounds, worklists};
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Words of `Search` in the shaders.
pub(crate) const SEARCH_WORDS: usize = 3;

/// Colors with all shortcuts: a vertex is colored as soon as no neighbor of higher priority can take its color.
///
/// The coloring is that of [`incise_coloring::scgc`], bit for bit.
///
/// # Errors
/// If the device is lost or has no room for the work arrays.
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
/// let path = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 3)])?;
/// let graph = DeviceGraph::new(&gpu, &path)?;
/// let coloring = scgc(&gpu, &mut ColoringKernels::default(), &graph)?;
/// assert_eq!(coloring.read(&gpu)?, incise_coloring::scgc(&path).coloring);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn scgc(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
) -> Result<DeviceColoring, GpuError> {
    let vertices = graph.vertex_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    let colors = Array::zeros(gpu, "colors", vertices)?;
    let higher = kernels.array(gpu, "higher neighbors", graph.neighbors.len())?;
    let searches = kernels.array(gpu, "searches", SEARCH_WORDS * vertices)?;
    let palettes = kernels.array(gpu, "palettes", graph.palette_words())?;
    let work = worklists(gpu, kernels, vertices)?;
    let parts = graph.parts.buffer();
    let (offsets, neighbors) = (graph.offsets.buffer(), graph.neighbors.buffer());
    let buffers = [
        parts,
        &work,
        offsets,
        neighbors,
        &higher,
        &searches,
        &palettes,
        colors.buffer(),
    ];
    let rounds = Rounds {
        algorithm: "scgc",
        vertices,
        max_rounds: usize::MAX,
        clear: vec![(&work, HEADER)],
        first: vec![
            kernels.bind(gpu, &HIGHER, &buffers[..7])?,
            kernels.bind(gpu, &ALL, &[parts, &work, colors.buffer()])?,
        ],
        round: vec![kernels.bind(gpu, &SCGC, &buffers)?],
    };
    let work = rounds.run(gpu, kernels, &graph.parts)?;
    Ok(work.into_coloring(colors))
}
