//! WLC: color first, repair later, with worklists (Chen, Li and Yang 2017).
//!
//! Twin of [`incise_coloring::wlc`]. A round processes its worklist in consecutive chunks, each of which sees the
//! choices of those before it; a step of three dispatches processes one chunk. List and chunk are tracked on the
//! device, so the steps of several rounds are submitted at once. Cost: O(edges of the worklist) per round, three
//! dispatches per chunk.

use std::num::NonZeroUsize;

use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

use super::kernels::{ColoringKernels, WLC_CHOOSE, WLC_GATHER, WLC_LOSE, WLC_START};
use super::labels::compacted;
use super::rounds::THREADS;
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Smallest and largest number of steps per submit; between them it is the number of chunks of the worklist.
const STEPS: [usize; 2] = [32, 2048];

/// Work state of a coloring, laid out like `WlcWork` in the shaders up to the list.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct WlcWork {
    pub(crate) begin: u32,
    pub(crate) count: u32,
    pub(crate) done: u32,
    pub(crate) lost: u32,
    pub(crate) chunk: u32,
    pub(crate) rounds: u32,
}

/// Words in front of the list.
const HEADER: usize = size_of::<WlcWork>() / size_of::<u32>();

/// Colors speculatively, `chunk` vertices at the same time.
///
/// Coloring and number of rounds equal those of [`incise_coloring::wlc`], bit for bit. Small chunks are slow here: each
/// takes three dispatches, one after the other.
///
/// # Errors
/// If the device is lost or has no room for the work arrays.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, wlc};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::ConstraintGraph;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let path = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 3)])?;
/// let graph = DeviceGraph::new(&gpu, &path)?;
/// let all = NonZeroUsize::MAX;
/// let coloring = wlc(&gpu, &mut ColoringKernels::default(), &graph, all)?;
/// assert_eq!(coloring.read(&gpu)?, incise_coloring::wlc(&path, all).coloring);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn wlc(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
    chunk: NonZeroUsize,
) -> Result<DeviceColoring, GpuError> {
    let vertices = graph.vertex_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    let chunk = chunk.get().min(vertices);
    let array = Array::zeros(gpu, "colors", vertices)?;
    let settings = kernels.array_for(gpu, "settings of wlc", 1, BufferUsages::UNIFORM)?;
    let value = u32::try_from(chunk).unwrap_or(u32::MAX);
    kernels.write(gpu, "settings of wlc", &[value]);
    let work = kernels.array(gpu, "worklist of wlc", HEADER + 2 * vertices)?;
    let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT;
    let arguments = kernels.array_for(gpu, "arguments", 3, usage)?;
    let picked = kernels.array(gpu, "picked", vertices)?;
    let lost = kernels.array(gpu, "lost", chunk)?;
    let (parts, colors) = (graph.parts.buffer(), array.buffer());
    let (offsets, neighbors) = (graph.offsets.buffer(), graph.neighbors.buffer());
    let buffers = [parts, &work, &settings, &arguments, &picked, colors];
    let start = kernels.bind(gpu, &WLC_START, &buffers)?;
    let buffers = [parts, &work, offsets, neighbors, &picked, colors];
    let choose = kernels.bind(gpu, &WLC_CHOOSE, &buffers)?;
    let buffers = [parts, &work, offsets, neighbors, &picked, &lost];
    let lose = kernels.bind(gpu, &WLC_LOSE, &buffers)?;
    let buffers = [parts, &work, &arguments, &lost, &picked, colors];
    let gather = kernels.bind(gpu, &WLC_GATHER, &buffers)?;

    // Each round halves the list or the chunk, and in chunks of one vertex there are no conflicts.
    let max_rounds = vertices.ilog2() + chunk.ilog2() + 3;
    let mut remaining = vertices.div_ceil(chunk);
    let mut before = None;
    loop {
        let mut encoder = gpu.encoder("wlc");
        let mut recorder = Recorder::new(gpu, &mut encoder, "wlc", None);
        if before.is_none() {
            let groups = vertices.div_ceil(THREADS);
            recorder.dispatch(&start.kernel, &start.group, &[0], groups);
        }
        for _ in 0..remaining.clamp(STEPS[0], STEPS[1]) {
            recorder.dispatch_indirect(&choose.kernel, &choose.group, &[0], &arguments, 0);
            recorder.dispatch_indirect(&lose.kernel, &lose.group, &[0], &arguments, 0);
            recorder.dispatch(&gather.kernel, &gather.group, &[0], 1);
        }
        drop(recorder);
        gpu.submit(encoder)?;
        let words = kernels.read(gpu, "worklist of wlc", HEADER)?;
        let state: WlcWork = bytemuck::cast_slice(&words)[0];
        let rounds = state.rounds as usize;
        if state.count == 0 {
            return compacted(gpu, kernels, graph, array, rounds);
        }
        // Every step processes a chunk of the list.
        let now = Some((state.rounds, state.done));
        if state.rounds > max_rounds || before == now {
            return Err(GpuError::Stalled {
                algorithm: "wlc",
                rounds,
            });
        }
        before = now;
        remaining = (state.count - state.done).div_ceil(state.chunk) as usize;
    }
}
