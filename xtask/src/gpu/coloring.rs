//! Colorings on the device: every algorithm, every mesh, clustered and not, each equal to its twin on the host.
//!
//! A coloring ends when the host knows the number of colors, so each takes at least one round trip. The upload of the
//! graph is timed separately: in a frame it would already be on the device.

use std::num::NonZeroUsize;
use std::time::Instant;

use anyhow::ensure;
use incise::clustering::{Method, cluster};
use incise::coloring::{self as host, VivaceOptions};
use incise::gpu::coloring::{
    self as device, ColoringKernels, DeviceColoring, DeviceGraph, DeviceIncidence,
};
use incise::gpu::{GpuContext, GpuError};
use incise::graph::{Coloring, ConstraintGraph, Incidence};

use super::measure::{flush, ms_since, timed};
use super::report::{ColoringRow, ColoringRun, Upload};
use crate::models::Model;

/// Clusterings whose quotients are colored.
pub(crate) const CLUSTERINGS: [&str; 2] = ["none", "serial:10"];

/// A graph coloring algorithm.
#[derive(Clone, Copy, Debug)]
enum Algorithm {
    Scgc,
    JonesPlassmann,
    EclGc,
    Vivace(u32),
    /// Number of vertices processed concurrently.
    Wlc(usize),
}

const ALGORITHMS: [(&str, Algorithm); 7] = [
    ("scgc", Algorithm::Scgc),
    ("jones-plassmann", Algorithm::JonesPlassmann),
    ("ecl-gc", Algorithm::EclGc),
    ("vivace", Algorithm::Vivace(1)),
    ("vivace:4", Algorithm::Vivace(4)),
    ("wlc, 2048 at a time", Algorithm::Wlc(2048)),
    ("wlc, all at a time", Algorithm::Wlc(usize::MAX)),
];

impl Algorithm {
    fn there(
        self,
        gpu: &GpuContext,
        kernels: &mut ColoringKernels,
        graph: &DeviceGraph,
    ) -> Result<DeviceColoring, GpuError> {
        match self {
            Self::Scgc => device::scgc(gpu, kernels, graph),
            Self::JonesPlassmann => device::jones_plassmann(gpu, kernels, graph),
            Self::EclGc => device::ecl_gc(gpu, kernels, graph),
            Self::Vivace(shrinking) => device::vivace(gpu, kernels, graph, options(shrinking)),
            Self::Wlc(size) => device::wlc(gpu, kernels, graph, chunk(size)),
        }
    }

    fn here(self, graph: &ConstraintGraph) -> anyhow::Result<Coloring> {
        Ok(match self {
            Self::Scgc => host::scgc(graph).coloring,
            Self::JonesPlassmann => host::jones_plassmann(graph).coloring,
            Self::EclGc => host::ecl_gc(graph).coloring,
            Self::Vivace(shrinking) => host::vivace(graph, options(shrinking))?.coloring,
            Self::Wlc(size) => host::wlc(graph, chunk(size)).coloring,
        })
    }
}

fn options(shrinking: u32) -> VivaceOptions {
    VivaceOptions {
        shrinking,
        ..VivaceOptions::default()
    }
}

fn chunk(size: usize) -> NonZeroUsize {
    NonZeroUsize::new(size).unwrap_or(NonZeroUsize::MAX)
}

/// All rows of a mesh.
pub(crate) fn colorings(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    model: &Model,
    repeats: u32,
) -> anyhow::Result<Vec<ColoringRow>> {
    let tets = model.mesh.tets.iter().copied();
    let incidence = Incidence::from_constraints(model.mesh.positions.len(), tets)?;
    let mut rows = Vec::new();
    for clustering in CLUSTERINGS {
        let clusters = cluster(clustering.parse::<Method>()?, &incidence);
        let vertices = incidence.quotient(&clusters);
        let graph = ConstraintGraph::from_incidence(&vertices);
        let mut add = |algorithm: &str, twin: Timed, outcome| -> anyhow::Result<()> {
            rows.push(ColoringRow {
                mesh: model.name.clone(),
                tets: model.mesh.tets.len(),
                clustering: clustering.to_owned(),
                vertices: graph.vertex_count(),
                edges: graph.edge_count(),
                algorithm: algorithm.to_owned(),
                run: compared(gpu, outcome, &twin.0, &format!("{algorithm}, {clustering}"))?,
                host_ms: twin.1,
            });
            Ok(())
        };
        let twin = on_host(|| Ok(host::scgc(&vertices).coloring))?;
        let outcome = from_incidence(gpu, kernels, &vertices, repeats);
        add("scgc from particles", twin, outcome)?;
        let uploaded = upload(gpu, repeats, || DeviceGraph::new(gpu, &graph));
        for (name, algorithm) in ALGORITHMS {
            let twin = on_host(|| algorithm.here(&graph))?;
            let outcome = match &uploaded {
                Ok((there, upload)) => {
                    let run = || algorithm.there(gpu, kernels, there);
                    measured(gpu, *upload, repeats, run)
                }
                Err(error) => Err(error.clone()),
            };
            add(name, twin, outcome)?;
        }
    }
    Ok(rows)
}

/// A coloring and the time it took, in ms.
type Timed = (Coloring, f64);

/// Result of a coloring on the device.
type Outcome = Result<(DeviceColoring, ColoringRun), GpuError>;

fn on_host(color: impl FnOnce() -> anyhow::Result<Coloring>) -> anyhow::Result<Timed> {
    let start = Instant::now();
    let coloring = color()?;
    Ok((coloring, ms_since(start)))
}

/// Uploads an input to the device.
fn upload<T>(
    gpu: &GpuContext,
    repeats: u32,
    make: impl Fn() -> Result<T, GpuError>,
) -> Result<(T, Upload), GpuError> {
    let before = gpu.traffic();
    let (there, times) = timed(repeats, || {
        let there = make()?;
        flush(gpu)?;
        Ok::<_, GpuError>(there)
    })?;
    let bytes = gpu.traffic().since(before).uploaded_bytes / u64::from(repeats + 1);
    Ok((there, Upload { bytes, times }))
}

fn measured(
    gpu: &GpuContext,
    upload: Upload,
    repeats: u32,
    mut run: impl FnMut() -> Result<DeviceColoring, GpuError>,
) -> Outcome {
    let before = gpu.traffic();
    let (coloring, times) = timed(repeats, || {
        let coloring = run()?;
        gpu.wait()?;
        Ok::<_, GpuError>(coloring)
    })?;
    let dispatches = gpu.traffic().since(before).dispatches / u64::from(repeats + 1);
    let run = ColoringRun {
        colors: coloring.color_count(),
        rounds: coloring.rounds(),
        dispatches,
        times,
        upload,
    };
    Ok((coloring, run))
}

/// Colors from particles, with the upload.
pub(crate) fn from_incidence(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    vertices: &Incidence,
    repeats: u32,
) -> Outcome {
    let (there, upload) = upload(gpu, repeats, || DeviceIncidence::new(gpu, vertices))?;
    let run = || device::scgc_incidence(gpu, kernels, &there);
    measured(gpu, upload, repeats, run)
}

/// Colors from a graph, with the upload.
pub(crate) fn from_graph(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    graph: &ConstraintGraph,
    repeats: u32,
) -> Outcome {
    let (there, upload) = upload(gpu, repeats, || DeviceGraph::new(gpu, graph))?;
    let run = || device::scgc(gpu, kernels, &there);
    measured(gpu, upload, repeats, run)
}

/// Runs the coloring if it fits the device; an error if it differs from its twin.
pub(crate) fn compared(
    gpu: &GpuContext,
    outcome: Outcome,
    twin: &Coloring,
    what: &str,
) -> anyhow::Result<Option<ColoringRun>> {
    match outcome {
        Ok((coloring, run)) => {
            ensure!(
                coloring.read(gpu)? == *twin,
                "{what}: the device gives another coloring than the host"
            );
            Ok(Some(run))
        }
        Err(GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. }) => Ok(None),
        Err(other) => Err(other.into()),
    }
}
