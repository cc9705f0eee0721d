//! Vivace: random colors, kept where no neighbor has an equal one (Fratarcangeli, Tibaldo and Pellacini 2016).
//!
//! Twin of [`incise_coloring::vivace`]: random numbers are the twin's hash of seed, vertex and round. Cost: three
//! dispatches per round, each over the edges of the uncolored vertices.

use bytemuck::{Pod, Zeroable};
use incise_coloring::{Tie, VivaceOptions};
use wgpu::BufferUsages;

use super::kernels::{ColoringKernels, VIVACE_KEEP, VIVACE_PICK, VIVACE_RENEW, VIVACE_START};
use super::labels::compacted;
use super::rounds::{HEADER, Rounds, worklists};
use super::{DeviceColoring, DeviceGraph};
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Options of a coloring, laid out like `VivaceSettings` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct VivaceSettings {
    pub(crate) seed_low: u32,
    pub(crate) seed_high: u32,
    pub(crate) shrinking: u32,
    pub(crate) highest_of_all: u32,
}

impl VivaceSettings {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the two halves of the seed are wanted"
    )]
    fn of(options: VivaceOptions) -> Self {
        Self {
            seed_low: options.seed as u32,
            seed_high: (options.seed >> 32) as u32,
            shrinking: options.shrinking,
            highest_of_all: u32::from(options.tie == Tie::HighestOfAll),
        }
    }
}

/// Colors by Vivace: every vertex draws random colors until none of its neighbors has drawn an equal one.
///
/// Coloring and number of rounds equal those of [`incise_coloring::vivace`], bit for bit.
///
/// # Errors
/// [`GpuError::Stalled`] if vertices are left without a color after the rounds allowed. If the device is lost or has no
/// room for the work arrays.
///
/// # Panics
/// If the shrinking factor is 0.
///
/// ```
/// use incise_coloring::VivaceOptions;
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, vivace};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::ConstraintGraph;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let triangle = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2), (2, 0)])?;
/// let graph = DeviceGraph::new(&gpu, &triangle)?;
/// let options = VivaceOptions::default();
/// let coloring = vivace(&gpu, &mut ColoringKernels::default(), &graph, options)?;
/// let twin = incise_coloring::vivace(&triangle, options)?;
/// assert_eq!(coloring.read(&gpu)?, twin.coloring);
/// assert_eq!(coloring.rounds(), twin.stats.rounds);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn vivace(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &DeviceGraph,
    options: VivaceOptions,
) -> Result<DeviceColoring, GpuError> {
    assert!(options.shrinking > 0, "the shrinking factor is 0");
    let vertices = graph.vertex_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    // The result is the array of last picks.
    let array = Array::zeros(gpu, "colors", vertices)?;
    let words = size_of::<VivaceSettings>() / size_of::<u32>();
    let settings = kernels.array_for(gpu, "settings of vivace", words, BufferUsages::UNIFORM)?;
    let values = [VivaceSettings::of(options)];
    kernels.write(gpu, "settings of vivace", bytemuck::cast_slice(&values));
    let palettes = kernels.array(gpu, "palettes", graph.palette_words())?;
    let colored = kernels.array(gpu, "colored", vertices)?;
    let work = worklists(gpu, kernels, vertices)?;
    let (parts, picked) = (graph.parts.buffer(), array.buffer());
    let (offsets, neighbors) = (graph.offsets.buffer(), graph.neighbors.buffer());
    let start = [parts, &work, &settings, offsets, &palettes, &colored];
    let pick = [parts, &work, &settings, offsets, &palettes, picked];
    let keep = [
        parts, &work, &settings, offsets, neighbors, picked, &colored,
    ];
    let renew = [
        parts, &work, offsets, neighbors, picked, &colored, &palettes,
    ];
    let rounds = Rounds {
        algorithm: "vivace",
        vertices,
        max_rounds: options.max_rounds,
        clear: vec![(&work, HEADER)],
        first: vec![kernels.bind(gpu, &VIVACE_START, &start)?],
        round: vec![
            kernels.bind(gpu, &VIVACE_PICK, &pick)?,
            kernels.bind(gpu, &VIVACE_KEEP, &keep)?,
            kernels.bind(gpu, &VIVACE_RENEW, &renew)?,
        ],
    };
    let work = rounds.run(gpu, kernels, &graph.parts)?;
    compacted(gpu, kernels, graph, array, work.rounds as usize)
}
