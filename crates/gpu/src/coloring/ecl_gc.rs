//! ECL-GC in rounds: vertices with many neighbors first, then the others (Alabandi, Powers and Burtscher 2020).
//!
//! Twin of [`incise_coloring::ecl_gc`]. The original spins until all neighbors are colored; here a pass is a round. The
//! rules for colors from 32 on and for vertices with many or few neighbors are those of the twin. Cost: each pass
//! visits all edges of its undecided vertices.

use super::kernels::{
    ColoringKernels, ECL_GC_LARGE, ECL_GC_LARGE_START, ECL_GC_SMALL, ECL_GC_SMALL_START, HIGHER,
};
use super::rounds::{HEADER, Rounds, worklists};
use super::scgc::SEARCH_WORDS;
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Colors by ECL-GC.
///
/// The coloring equals those of [`incise_coloring::ecl_gc`] and [`scgc`](super::scgc()), bit for bit.
///
/// # Errors
/// If the device is lost or has no room for the work arrays.
///
/// ```
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, ecl_gc};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::{ConstraintGraph, Incidence};
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let fan = Incidence::from_constraints(41, (1u32..41).map(|i| [0, i]))?;
/// let fan = ConstraintGraph::from_incidence(&fan);
/// let graph = DeviceGraph::new(&gpu, &fan)?;
/// let coloring = ecl_gc(&gpu, &mut ColoringKernels::default(), &graph)?;
/// assert_eq!(coloring.read(&gpu)?, incise_coloring::ecl_gc(&fan).coloring);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn ecl_gc(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
) -> Result<DeviceColoring, GpuError> {
    let vertices = graph.vertex_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    let array = Array::zeros(gpu, "colors", vertices)?;
    let higher = kernels.array(gpu, "higher neighbors", graph.neighbors.len())?;
    let searches = kernels.array(gpu, "searches", SEARCH_WORDS * vertices)?;
    let palettes = kernels.array(gpu, "palettes", graph.palette_words())?;
    let words = kernels.array(gpu, "words", vertices)?;
    let waiting = kernels.array(gpu, "waiting", vertices)?;
    let work = worklists(gpu, kernels, vertices)?;
    let (parts, colors) = (graph.parts.buffer(), array.buffer());
    let (offsets, neighbors) = (graph.offsets.buffer(), graph.neighbors.buffer());

    let all = [
        parts, &work, offsets, neighbors, &higher, &searches, &palettes,
    ];
    let start = [parts, &work, offsets, colors];
    let pass = [parts, &work, offsets, &higher, &searches, &palettes, colors];
    let large = Rounds {
        algorithm: "ecl_gc",
        vertices,
        max_rounds: usize::MAX,
        clear: vec![(&work, HEADER)],
        first: vec![
            kernels.bind(gpu, &HIGHER, &all)?,
            kernels.bind(gpu, &ECL_GC_LARGE_START, &start)?,
        ],
        round: vec![kernels.bind(gpu, &ECL_GC_LARGE, &pass)?],
    };
    large.run(gpu, kernels, &graph.parts)?;

    let start = [parts, &work, offsets, &searches, colors, &words, &waiting];
    let pass = [parts, &work, offsets, &higher, &words, &waiting, colors];
    let small = Rounds {
        algorithm: "ecl_gc",
        vertices,
        max_rounds: usize::MAX,
        // The counts of rounds and colors continue.
        clear: vec![],
        first: vec![kernels.bind(gpu, &ECL_GC_SMALL_START, &start)?],
        round: vec![kernels.bind(gpu, &ECL_GC_SMALL, &pass)?],
    };
    let work = small.run(gpu, kernels, &graph.parts)?;
    Ok(work.into_coloring(array))
}
