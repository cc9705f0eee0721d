//! [`color`]: the colorings of this crate by the names that those of `incise-coloring` have.

use incise_coloring::{Algorithm, Shortcuts, VivaceOptions};

use super::{
    ColoringKernels, DeviceColoring, DeviceGraph, ecl_gc, jones_plassmann, scgc, vivace, wlc,
};
use crate::{GpuContext, GpuError};

/// Colors by the given algorithm: the coloring that [`incise_coloring::color`] gives, bit for bit.
///
/// `seed` chooses the random numbers of `vivace`.
///
/// # Errors
/// [`GpuError::Unsupported`] for algorithms other than `jones-plassmann`, `ecl-gc`, `scgc` with all
/// shortcuts, `vivace` and `wlc`; errors of the device.
///
/// ```
/// use incise_gpu::coloring::{ColoringKernels, DeviceGraph, color};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::ConstraintGraph;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Ok(gpu) => gpu,
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     Err(other) => return Err(other.into()),
/// };
/// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
/// let graph = DeviceGraph::new(&gpu, &path)?;
/// let mut kernels = ColoringKernels::default();
/// let coloring = color(&gpu, &mut kernels, "scgc".parse()?, &graph, 0)?;
/// coloring.read(&gpu)?.verify(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn color(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    algorithm: Algorithm,
    graph: &DeviceGraph,
    seed: u64,
) -> Result<DeviceColoring, GpuError> {
    match algorithm {
        Algorithm::Scgc(Shortcuts::NONE) => jones_plassmann(gpu, kernels, graph),
        Algorithm::Scgc(Shortcuts::ALL) => scgc(gpu, kernels, graph),
        Algorithm::EclGc => ecl_gc(gpu, kernels, graph),
        Algorithm::Vivace(factor) => {
            let options = VivaceOptions {
                shrinking: u32::try_from(factor.get()).unwrap_or(u32::MAX),
                seed,
                ..VivaceOptions::default()
            };
            vivace(gpu, kernels, graph, options)
        }
        Algorithm::Wlc(chunk) => wlc(gpu, kernels, graph, chunk),
        _ => Err(GpuError::Unsupported {
            what: "colorings other than jones-plassmann, ecl-gc, scgc, vivace and wlc",
        }),
    }
}
