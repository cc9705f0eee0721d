//! Compaction of colors on the device, with the result of
//! [`Coloring::compact`](incise_graph::Coloring::compact).
//!
//! Algorithms that repair or draw colors may leave some colors unused. Cost: O(vertices + colors),
//! and one wait to read the number of colors.

use super::kernels::{ColoringKernels, LABELS_MARK, LABELS_NUMBER, LABELS_RENAME};
use super::rounds::THREADS;
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Renames colors, in order, to numbers without gaps.
pub(super) fn compacted(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
    array: Array<u32>,
    rounds: usize,
) -> Result<DeviceColoring, GpuError> {
    // A color is not larger than a degree.
    let words = 1 + graph.vertex_count();
    let names = kernels.array(gpu, "names of colors", words)?;
    let (parts, colors) = (graph.parts.buffer(), array.buffer());
    let mark = kernels.bind(gpu, &LABELS_MARK, &[parts, &names, colors])?;
    let number = kernels.bind(gpu, &LABELS_NUMBER, &[parts, &names])?;
    let rename = kernels.bind(gpu, &LABELS_RENAME, &[parts, &names, colors])?;
    let groups = graph.vertex_count().div_ceil(THREADS);
    let mut encoder = gpu.encoder("labels");
    encoder.clear_buffer(&names, 0, Some((words * size_of::<u32>()) as u64));
    let mut recorder = Recorder::new(gpu, &mut encoder, "labels", None);
    for (bound, groups) in [(mark, groups), (number, 1), (rename, groups)] {
        recorder.dispatch(&bound.kernel, &bound.group, &[0], groups);
    }
    drop(recorder);
    gpu.submit(encoder)?;
    let count = kernels.read(gpu, "names of colors", 1)?[0];
    Ok(DeviceColoring {
        colors: array,
        color_count: count as usize,
        rounds,
    })
}
