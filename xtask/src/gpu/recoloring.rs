//! Colors after a cut: the incremental update on the host, as in a frame, next to a full coloring on the device.
//!
//! The body is that of the frames, after its stroke. For a full coloring the host has to list the particles of the
//! clusters and upload them; a graph has to be built as well.

use std::time::Instant;

use incise::coloring::{auto, scgc};
use incise::gpu::GpuContext;
use incise::gpu::coloring::ColoringKernels;
use incise::graph::{ConstraintGraph, Incidence};

use super::coloring::{compared, from_graph, from_incidence};
use super::frame::Cut;
use super::measure::{ms_since, timed};
use super::report::RecoloringRow;
use crate::experiment::median;

pub(crate) fn recoloring(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    name: &str,
    cut: &Cut,
    repeats: u32,
) -> anyhow::Result<RecoloringRow> {
    let Cut {
        simulation,
        reports,
    } = cut;
    let mesh = simulation.mesh();
    let tets = mesh.tets.iter().copied();
    let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
    let clustering = simulation.clustering();
    let quotient = || Ok::<_, anyhow::Error>(incidence.quotient(&clustering));
    let (clusters, listing) = timed(repeats, quotient)?;
    let (all, host) = timed(repeats, || Ok::<_, anyhow::Error>(auto(&clusters).coloring))?;
    let start = Instant::now();
    let graph = ConstraintGraph::from_incidence(&clusters);
    let making = ms_since(start);
    let twin = scgc(&graph).coloring;
    let outcome = from_incidence(gpu, kernels, &clusters, repeats);
    let mut readback = 0.0;
    if let Ok((coloring, _)) = &outcome {
        let (_, times) = timed(repeats, || coloring.read(gpu))?;
        readback = times.median;
    }
    let by_incidence = compared(gpu, outcome, &twin, "scgc from particles after a cut")?;
    let outcome = from_graph(gpu, kernels, &graph, repeats);
    let by_graph = compared(gpu, outcome, &twin, "scgc after a cut")?;
    let following = || reports.iter().map(|report| report.ms.color);
    Ok(RecoloringRow {
        mesh: name.to_owned(),
        tets: mesh.tets.len(),
        clusters: clustering.occupied(),
        following: median(following()),
        following_largest: following().fold(0.0, f64::max),
        following_colors: simulation.report().colors,
        incidence: listing.median,
        host: host.median,
        host_colors: all.color_count(),
        from_incidence: by_incidence,
        graph: making,
        from_graph: by_graph,
        readback,
    })
}
