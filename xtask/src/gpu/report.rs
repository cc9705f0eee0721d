//! Results of a sweep, as stored in the JSON file and used by the page.

use serde::{Deserialize, Serialize};

/// Results of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Report {
    pub(crate) facts: Facts,
    pub(crate) checks: String,
    pub(crate) bandwidth: Bandwidth,
    pub(crate) colorings: Vec<ColoringRow>,
    pub(crate) passes: Vec<PassRow>,
    pub(crate) memory: Vec<MemoryRow>,
    pub(crate) frames: Vec<FrameRow>,
    pub(crate) recolorings: Vec<RecoloringRow>,
    /// Omitted parts, with reasons.
    pub(crate) notes: Vec<String>,
}

/// Machine and configuration of the measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Facts {
    pub(crate) date: String,
    pub(crate) command: String,
    pub(crate) adapter: String,
    pub(crate) driver: String,
    pub(crate) backend: String,
    pub(crate) software: bool,
    /// Largest buffer binding in bytes.
    pub(crate) buffer_limit: u64,
    /// Threads of the host.
    pub(crate) threads: usize,
    /// True if the host's code was compiled without optimization for speed.
    pub(crate) debug: bool,
}

/// Times in ms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Times {
    pub(crate) median: f64,
    pub(crate) fastest: f64,
}

/// Bandwidth of copies between buffers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bandwidth {
    /// Bytes of each buffer.
    pub(crate) bytes: u64,
    /// Bytes read and written per second, from the fastest run.
    pub(crate) bytes_per_second: f64,
}

/// A coloring of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ColoringRow {
    pub(crate) mesh: String,
    pub(crate) tets: usize,
    pub(crate) clustering: String,
    pub(crate) vertices: usize,
    pub(crate) edges: usize,
    pub(crate) algorithm: String,
    /// `None` if the graph does not fit the device.
    pub(crate) run: Option<ColoringRun>,
    /// Time of the twin on the host in ms, one run.
    pub(crate) host_ms: f64,
}

/// Time and result of a coloring on the device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ColoringRun {
    pub(crate) colors: usize,
    pub(crate) rounds: usize,
    pub(crate) dispatches: u64,
    pub(crate) times: Times,
    pub(crate) upload: Upload,
}

/// Cost of the upload of the input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Upload {
    pub(crate) bytes: u64,
    pub(crate) times: Times,
}

/// A pass over the tets of a body, in one form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PassRow {
    pub(crate) mesh: String,
    pub(crate) tets: usize,
    pub(crate) particles: usize,
    pub(crate) form: String,
    pub(crate) clusters: usize,
    pub(crate) colors: usize,
    /// `None` if the device does not support it.
    pub(crate) run: Option<PassRun>,
    /// Residuals by iterations, if requested.
    pub(crate) residuals: Vec<ResidualPoint>,
    /// Reason for a missing value.
    pub(crate) note: String,
}

/// Cost of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PassRun {
    pub(crate) dispatches: usize,
    /// Time of an iteration.
    pub(crate) times: Times,
    /// Time of the host to record an iteration, in ms.
    pub(crate) recording: f64,
    /// Minimum bytes moved by an iteration; `None` if not counted.
    pub(crate) least_bytes: Option<u64>,
    /// Device memory in bytes, with multipliers.
    pub(crate) memory: u64,
}

/// Residuals after some iterations of a large step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResidualPoint {
    pub(crate) iterations: u32,
    /// Kappa of the step, `E Δt² / (ρ h²)`, for the worst tet.
    pub(crate) kappa: f64,
    /// Root mean square of the constraint residuals.
    pub(crate) dual: f64,
    /// Unbalanced force over the weight.
    pub(crate) force: f64,
}

/// A body on the device, in one form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MemoryRow {
    pub(crate) tets: usize,
    pub(crate) particles: usize,
    pub(crate) form: String,
    /// `None` if it does not fit.
    pub(crate) used: Option<MemoryUse>,
    /// Reason for a missing value.
    pub(crate) note: String,
}

/// Resources of a body on the device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MemoryUse {
    /// Device memory in bytes, without multipliers.
    pub(crate) bytes: u64,
    /// Bytes uploaded once.
    pub(crate) uploaded: u64,
    /// Time of layout and upload in ms, once.
    pub(crate) sending: f64,
}

/// Frames of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FrameRow {
    pub(crate) mesh: String,
    pub(crate) tets: usize,
    /// Compute device and clustering.
    pub(crate) place: String,
    pub(crate) substeps: u32,
    /// Time per frame with many frames before a wait.
    pub(crate) quiet: Times,
    /// Time per frame with a wait for each.
    pub(crate) waited: Times,
    pub(crate) cutting: CuttingFrames,
}

/// Frames with a cut, with a wait for each: medians in ms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CuttingFrames {
    pub(crate) frames: usize,
    pub(crate) tets_cut: usize,
    pub(crate) total: f64,
    pub(crate) largest: f64,
    pub(crate) readback: f64,
    pub(crate) cut: f64,
    pub(crate) cluster: f64,
    pub(crate) color: f64,
    pub(crate) schedule: f64,
    pub(crate) upload: f64,
}

/// Coloring after a cut, in ms: the update of a frame, and full colorings on the host and on the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RecoloringRow {
    pub(crate) mesh: String,
    /// Number of tets after the stroke.
    pub(crate) tets: usize,
    pub(crate) clusters: usize,
    /// Time of the host to update the colors after a frame's cut.
    pub(crate) following: f64,
    pub(crate) following_largest: f64,
    pub(crate) following_colors: usize,
    /// Time of the host to list the particles of clusters, which any full coloring needs.
    pub(crate) incidence: f64,
    /// A full coloring on the host, by `auto`.
    pub(crate) host: f64,
    pub(crate) host_colors: usize,
    /// A full coloring on the device from the particles of clusters.
    pub(crate) from_incidence: Option<ColoringRun>,
    /// Time of the host to build a graph.
    pub(crate) graph: f64,
    /// A full coloring on the device from the graph.
    pub(crate) from_graph: Option<ColoringRun>,
    /// Time to read the colors back.
    pub(crate) readback: f64,
}
