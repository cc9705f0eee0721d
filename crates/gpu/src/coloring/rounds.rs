//! Rounds over worklists, shared by all algorithms except [`wlc`](super::wlc()).
//!
//! Rounds are recorded in chunks. Each round is dispatched with as many workgroups as its worklist needs; `next.wgsl`
//! computes this number on the device. After a chunk the host reads the number of vertices left. Cost: two dispatches
//! per round and one wait per chunk.

use bytemuck::{Pod, Zeroable};
use wgpu::{Buffer, BufferUsages};

use super::DeviceColoring;
use super::kernels::{BoundKernel, ColoringKernels, NEXT, Round};
use crate::array::Array;
use crate::kernel::{Recorder, STRIDE};
use crate::{GpuContext, GpuError};

/// Rounds per submit.
const CHUNK: usize = 32;

/// `THREADS` in the shaders.
pub(super) const THREADS: usize = 64;

/// `Work` in the shaders, up to the lists.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Work {
    pub(crate) counts: [u32; 2],
    pub(crate) rounds: u32,
    pub(crate) colors: u32,
    pub(crate) rest: u32,
    pub(crate) window: u32,
}

/// Words in front of the lists; they are cleared before the first round.
pub(super) const HEADER: usize = size_of::<Work>() / size_of::<u32>();

/// The [`Round`] uniforms of even and odd rounds.
pub(super) fn parts(gpu: &GpuContext, vertices: usize) -> Result<Array<u32>, GpuError> {
    let stride = STRIDE as usize / size_of::<u32>();
    let usage = BufferUsages::UNIFORM;
    let parts = Array::with_usage(gpu, "parts of rounds", 2 * stride, usage)?;
    let vertices = u32::try_from(vertices).unwrap_or(u32::MAX);
    for (start, parity) in [(0, 0), (stride, 1)] {
        parts.write(
            gpu,
            start,
            bytemuck::cast_slice(&[Round { vertices, parity }]),
        );
    }
    Ok(parts)
}

/// The dispatches of one algorithm on one input.
#[derive(Debug)]
pub(super) struct Rounds<'a> {
    pub(super) algorithm: &'static str,
    /// The number of vertices, at least 2.
    pub(super) vertices: usize,
    /// Rounds after which vertices without a color are an error.
    pub(super) max_rounds: usize,
    /// Arrays to fill with zeros first, and their lengths in words.
    pub(super) clear: Vec<(&'a Buffer, usize)>,
    /// Kernels over all vertices to run first; the last of them fills the list.
    pub(super) first: Vec<BoundKernel>,
    /// Kernels over the list; the last of them fills the next list.
    pub(super) round: Vec<BoundKernel>,
}

/// The worklists of a graph with this many vertices, as a work array.
pub(super) fn worklists(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    vertices: usize,
) -> Result<Buffer, GpuError> {
    kernels.array(gpu, "worklists", HEADER + 2 * vertices)
}

impl Rounds<'_> {
    /// Runs the rounds until all vertices have a color. `parts` are the uniforms of the input.
    pub(super) fn run(
        self,
        gpu: &GpuContext,
        kernels: &mut ColoringKernels,
        parts: &Array<u32>,
    ) -> Result<Work, GpuError> {
        let work = worklists(gpu, kernels, self.vertices)?;
        let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT;
        let arguments = kernels.array_for(gpu, "arguments", 3, usage)?;
        let next = kernels.bind(gpu, &NEXT, &[parts.buffer(), &work, &arguments])?;
        let groups = self.vertices.div_ceil(THREADS);
        let mut recorded = 0;
        loop {
            let chunk = CHUNK.min(self.max_rounds - recorded);
            let mut encoder = gpu.encoder(self.algorithm);
            if recorded == 0 {
                for &(buffer, words) in &self.clear {
                    encoder.clear_buffer(buffer, 0, Some((words * size_of::<u32>()) as u64));
                }
            }
            let mut recorder = Recorder::new(gpu, &mut encoder, self.algorithm, None);
            if recorded == 0 {
                // The parity of an odd round, so that vertices put on the next list land on the first one.
                for BoundKernel { kernel, group } in &self.first {
                    recorder.dispatch(kernel, group, &[STRIDE], groups);
                }
                recorder.dispatch(&next.kernel, &next.group, &[STRIDE], 1);
            }
            for round in recorded..recorded + chunk {
                let part = [if round % 2 == 0 { 0 } else { STRIDE }];
                for BoundKernel { kernel, group } in &self.round {
                    recorder.dispatch_indirect(kernel, group, &part, &arguments, 0);
                }
                recorder.dispatch(&next.kernel, &next.group, &part, 1);
            }
            drop(recorder);
            gpu.submit(encoder)?;
            recorded += chunk;
            let words = kernels.read(gpu, "worklists", HEADER)?;
            let work: Work = bytemuck::cast_slice(&words)[0];
            let left = work.counts[recorded % 2] as usize;
            if left == 0 {
                return Ok(work);
            }
            // Every round removes a vertex from the list.
            if recorded == self.max_rounds || left > self.vertices.saturating_sub(recorded) {
                return Err(GpuError::Stalled {
                    algorithm: self.algorithm,
                    rounds: recorded,
                });
            }
        }
    }
}

impl Work {
    /// The coloring with these colors.
    pub(super) fn into_coloring(self, colors: Array<u32>) -> DeviceColoring {
        DeviceColoring {
            colors,
            color_count: self.colors as usize,
            rounds: self.rounds as usize,
        }
    }
}
