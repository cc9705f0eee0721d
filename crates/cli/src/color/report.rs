//! Output of `incise color`: a JSON object, a table, a CSV file.

use std::io::{BufWriter, Write};
use std::path::Path;

use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::graph::{Clustering, Coloring, ColoringMetrics};
use incise::mesh_io;
use serde::Serialize;

use crate::failure::Failure;

/// JSON object printed by `--json`.
#[derive(Debug, Serialize)]
pub(crate) struct ColorReport {
    pub(crate) input: String,
    pub(crate) constraints: usize,
    pub(crate) particles: usize,
    pub(crate) clusters: usize,
    pub(crate) edges: usize,
    pub(crate) algorithm: String,
    pub(crate) clustering: String,
    pub(crate) backend: &'static str,
    pub(crate) seed: u64,
    /// Measure by which the colors were balanced, if they were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) balanced: Option<&'static str>,
    pub(crate) colors: usize,
    pub(crate) max_clique: usize,
    /// Metrics in clusters; the fields are flattened into the object.
    #[serde(flatten)]
    pub(crate) evenness: Evenness,
    /// Metrics in constraints.
    pub(crate) by_constraints: Evenness,
    pub(crate) rounds: usize,
    /// Statistics of the algorithm, if it provides them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) edge_visits: Option<u64>,
    pub(crate) verified: bool,
    pub(crate) ms: Times,
}

/// Balance of the colors: the fields of [`ColoringMetrics`] with these names.
#[derive(Debug, Serialize)]
pub(crate) struct Evenness {
    std: f64,
    range: u64,
    chi2: f64,
    max_over_mean: f64,
    lanes_32: f64,
    lanes_256: f64,
}

impl From<ColoringMetrics> for Evenness {
    fn from(metrics: ColoringMetrics) -> Self {
        Self {
            std: metrics.std,
            range: metrics.range,
            chi2: metrics.chi2,
            max_over_mean: metrics.max_over_mean,
            lanes_32: metrics.lanes_32,
            lanes_256: metrics.lanes_256,
        }
    }
}

/// Milliseconds of each stage.
#[derive(Debug, Serialize)]
pub(crate) struct Times {
    pub(crate) read: f64,
    pub(crate) graph: f64,
    pub(crate) cluster: f64,
    pub(crate) color: f64,
}

/// Writes cluster and color of each constraint.
pub(crate) fn write_csv(
    path: &Path,
    clustering: &Clustering,
    coloring: &Coloring,
) -> Result<(), Failure> {
    mesh_io::write_atomically(path, |file| {
        let mut file = BufWriter::new(file);
        writeln!(file, "constraint,cluster,color")?;
        for (constraint, cluster) in clustering.labels().iter().enumerate() {
            writeln!(
                file,
                "{constraint},{cluster},{}",
                coloring.color(cluster.index())
            )?;
        }
        file.flush()
    })?;
    Ok(())
}

/// Report as a table for the terminal.
pub(crate) fn table(report: &ColorReport) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([report.input.as_str(), ""]);
    let even = &report.evenness;
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    if report.particles == 0 {
        row("vertices", report.constraints.to_string());
    } else {
        row(
            "constraints, particles",
            format!("{}, {}", report.constraints, report.particles),
        );
    }
    row(
        "clusters, edges between them",
        format!(
            "{}, {} ({})",
            report.clusters, report.edges, report.clustering
        ),
    );
    row(
        "colors",
        format!(
            "{} by {} in {} round(s)",
            report.colors, report.algorithm, report.rounds
        ),
    );
    row("lower bound on colors", report.max_clique.to_string());
    row(
        "class sizes: std, range, chi2",
        format!("{:.2}, {}, {:.2}", even.std, even.range, even.chi2),
    );
    row(
        "busy lanes in groups of 32, 256",
        format!(
            "{:.1}%, {:.1}%",
            even.lanes_32 * 100.0,
            even.lanes_256 * 100.0
        ),
    );
    row(
        "verified",
        if report.verified { "yes" } else { "NO" }.to_owned(),
    );
    let ms = &report.ms;
    row(
        "ms: read, graph, cluster, color",
        format!(
            "{:.1}, {:.1}, {:.1}, {:.1}",
            ms.read, ms.graph, ms.cluster, ms.color
        ),
    );
    table
}
