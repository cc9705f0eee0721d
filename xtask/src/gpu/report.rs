//! What a sweep found, as the JSON file has it and the page is made from.

use serde::{Deserialize, Serialize};

/// A sweep.
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
    /// What was left out, and why.
    pub(crate) notes: Vec<String>,
}

/// Where and how it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Facts {
    pub(crate) date: String,
    pub(crate) command: String,
    pub(crate) adapter: String,
    pub(crate) driver: String,
    pub(crate) backend: String,
    pub(crate) software: bool,
    /// The most bytes that a kernel sees of one buffer.
    pub(crate) buffer_limit: u64,
    /// Threads of the host.
    pub(crate) threads: usize,
    /// Whether the host's code was compiled without optimization for speed.
    pub(crate) debug: bool,
}

/// Times in ms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Times {
    pub(crate) median: f64,
    pub(crate) fastest: f64,
}

/// What copying from buffer to buffer reaches.
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
    /// Absent if the device has no room for the graph.
    pub(crate) run: Option<ColoringRun>,
    /// What the twin takes on the host, once.
    pub(crate) host_ms: f64,
}

/// What a coloring on the device took and gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ColoringRun {
    pub(crate) colors: usize,
    pub(crate) rounds: usize,
    pub(crate) dispatches: u64,
    pub(crate) times: Times,
    pub(crate) upload: Upload,
}

/// What it took to bring the input to the device.
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
    /// Absent if the device cannot.
    pub(crate) run: Option<PassRun>,
    /// By iterations, where they were asked for.
    pub(crate) residuals: Vec<ResidualPoint>,
    /// Why something is absent.
    pub(crate) note: String,
}

/// What a pass takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PassRun {
    pub(crate) dispatches: usize,
    /// Of an iteration.
    pub(crate) times: Times,
    /// What the host takes to record an iteration, in ms.
    pub(crate) recording: f64,
    /// Bytes that an iteration has to move at least; absent where that is not counted.
    pub(crate) least_bytes: Option<u64>,
    /// Bytes of device memory, with multipliers.
    pub(crate) memory: u64,
}

/// Residuals after some iterations of a large step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResidualPoint {
    pub(crate) iterations: u32,
    /// Of the step: `E Δt² / (ρ h²)` of the worst tet.
    pub(crate) kappa: f64,
    /// Root of the mean square of what the constraints are off.
    pub(crate) dual: f64,
    /// The force that is left, over the weight.
    pub(crate) force: f64,
}

/// A body on the device, in one form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MemoryRow {
    pub(crate) tets: usize,
    pub(crate) particles: usize,
    pub(crate) form: String,
    /// Absent if it does not fit.
    pub(crate) used: Option<MemoryUse>,
    /// Why something is absent.
    pub(crate) note: String,
}

/// What a body takes on the device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MemoryUse {
    /// Of device memory, without multipliers.
    pub(crate) bytes: u64,
    /// Sent once.
    pub(crate) uploaded: u64,
    /// What laying out and sending takes, in ms, once.
    pub(crate) sending: f64,
}

/// Frames of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FrameRow {
    pub(crate) mesh: String,
    pub(crate) tets: usize,
    /// Where and with which clusters.
    pub(crate) place: String,
    pub(crate) substeps: u32,
    /// Many frames in a row before a wait.
    pub(crate) quiet: Times,
    /// Waited for, each.
    pub(crate) waited: Times,
    pub(crate) cutting: CuttingFrames,
}

/// Frames with a cut, each waited for: medians in ms.
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

/// Coloring after a cut: what a frame does, and a full coloring, on the host and on the device. In ms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RecoloringRow {
    pub(crate) mesh: String,
    /// After the stroke.
    pub(crate) tets: usize,
    pub(crate) clusters: usize,
    /// What following a frame's cut takes on the host.
    pub(crate) following: f64,
    pub(crate) following_largest: f64,
    pub(crate) following_colors: usize,
    /// What the host takes to list the particles of clusters, which any full coloring needs.
    pub(crate) incidence: f64,
    /// A full coloring on the host, by `auto`.
    pub(crate) host: f64,
    pub(crate) host_colors: usize,
    /// A full coloring on the device from the particles of clusters.
    pub(crate) from_incidence: Option<ColoringRun>,
    /// What the host takes to make a graph.
    pub(crate) graph: f64,
    /// A full coloring on the device from the graph.
    pub(crate) from_graph: Option<ColoringRun>,
    /// Reading the colors back.
    pub(crate) readback: f64,
}
