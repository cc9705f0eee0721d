//! The tables of the page.

use comfy_table::Table;

use super::iteration::CURVE;
use super::report::{ColoringRun, PassRow, Report, Times};
use crate::table;

/// Content of an empty cell.
const DASH: &str = "-";

pub(super) fn iterations(report: &Report) -> Table {
    let mut table = table([
        "mesh",
        "tets",
        "mapping",
        "clusters",
        "colors",
        "dispatches",
        "ms",
        "fastest ms",
        "recording ms",
        "ns a tet",
        "GB/s",
        "share",
        "MiB",
    ]);
    for row in &report.passes {
        let mut cells = vec![
            row.mesh.clone(),
            row.tets.to_string(),
            row.form.clone(),
            row.clusters.to_string(),
            row.colors.to_string(),
        ];
        match row.run {
            Some(run) => {
                let per_second = run
                    .least_bytes
                    .map(|bytes| bytes as f64 / (run.times.fastest * 1e-3));
                let share = |rate: f64| 100.0 * rate / report.bandwidth.bytes_per_second;
                cells.extend([
                    run.dispatches.to_string(),
                    ms(run.times.median),
                    ms(run.times.fastest),
                    ms(run.recording),
                    format!("{:.2}", run.times.fastest * 1e6 / row.tets as f64),
                    or_dash(per_second, |rate| format!("{:.2}", rate * 1e-9)),
                    or_dash(per_second, |rate| format!("{:.1} %", share(rate))),
                    format!("{:.1}", mebi(run.memory)),
                ]);
            }
            None => cells.extend(missing(8)),
        }
        table.add_row(cells);
    }
    table
}

pub(super) fn compared(report: &Report) -> Table {
    let mut header: Vec<String> = ["mesh", "kappa", "mapping", "colors", "dispatches", "ms"]
        .map(str::to_owned)
        .to_vec();
    for what in ["dual", "force"] {
        header.extend(CURVE.map(|n| format!("{what} after {n}")));
    }
    let mut table = table(header);
    let has_curve = |row: &&PassRow| !row.residuals.is_empty();
    let meshes: Vec<&str> = report
        .passes
        .iter()
        .filter(has_curve)
        .map(|row| row.mesh.as_str())
        .collect();
    for row in &report.passes {
        if !meshes.contains(&row.mesh.as_str()) {
            continue;
        }
        let first = row.residuals.first();
        let mut cells = vec![
            format!("{}, {} tets", row.mesh, row.tets),
            or_dash(first, |point| format!("{:.1}", point.kappa)),
            row.form.clone(),
            row.colors.to_string(),
            or_dash(row.run, |run| run.dispatches.to_string()),
            or_dash(row.run, |run| ms(run.times.median)),
        ];
        let points = || row.residuals.iter();
        match first {
            Some(_) => {
                cells.extend(points().map(|point| format!("{:.2e}", point.dual)));
                cells.extend(points().map(|point| format!("{:.2e}", point.force)));
            }
            None => cells.extend(missing(2 * CURVE.len())),
        }
        table.add_row(cells);
    }
    table
}

pub(super) fn memory(report: &Report) -> Table {
    let mut table = table([
        "tets",
        "particles",
        "mapping",
        "MiB",
        "bytes a tet",
        "sent MiB",
        "laid out and sent ms",
    ]);
    for row in &report.memory {
        let mut cells = vec![
            row.tets.to_string(),
            row.particles.to_string(),
            row.form.clone(),
        ];
        match row.used {
            Some(used) => cells.extend([
                format!("{:.1}", mebi(used.bytes)),
                format!("{:.0}", used.bytes as f64 / row.tets as f64),
                format!("{:.1}", mebi(used.uploaded)),
                format!("{:.1}", used.sending),
            ]),
            None => cells.extend(missing(4)),
        }
        table.add_row(cells);
    }
    table
}

pub(super) fn frames(report: &Report) -> Table {
    let mut table = table([
        "mesh",
        "tets",
        "where",
        "in a row ms",
        "waited for ms",
        "frames with a cut",
        "tets cut",
        "ms",
        "largest ms",
        "read back",
        "cut",
        "cluster",
        "color",
        "schedule",
        "upload",
    ]);
    for row in &report.frames {
        let cutting = row.cutting;
        let mut cells = vec![
            row.mesh.clone(),
            row.tets.to_string(),
            row.place.clone(),
            ms(row.quiet.median),
            ms(row.waited.median),
            cutting.frames.to_string(),
            cutting.tets_cut.to_string(),
        ];
        let stages = [
            cutting.total,
            cutting.largest,
            cutting.readback,
            cutting.cut,
            cutting.cluster,
            cutting.color,
            cutting.schedule,
            cutting.upload,
        ];
        cells.extend(stages.map(ms));
        table.add_row(cells);
    }
    table
}

pub(super) fn colorings(report: &Report) -> Table {
    let mut table = table([
        "mesh",
        "clusters",
        "vertices",
        "edges",
        "algorithm",
        "colors",
        "rounds",
        "dispatches",
        "ms",
        "fastest ms",
        "upload ms",
        "MiB",
        "host ms",
    ]);
    for row in &report.colorings {
        let mut cells = vec![
            row.mesh.clone(),
            row.clustering.clone(),
            row.vertices.to_string(),
            row.edges.to_string(),
            row.algorithm.clone(),
        ];
        match row.run {
            Some(run) => {
                let Times { median, fastest } = run.times;
                cells.extend([run.colors, run.rounds].map(|count| count.to_string()));
                cells.push(run.dispatches.to_string());
                cells.extend([median, fastest, run.upload.times.median].map(ms));
                cells.push(format!("{:.1}", mebi(run.upload.bytes)));
            }
            None => cells.extend(missing(7)),
        }
        cells.push(ms(row.host_ms));
        table.add_row(cells);
    }
    table
}

pub(super) fn recolorings(report: &Report) -> Table {
    let mut table = table([
        "mesh",
        "tets",
        "clusters",
        "following",
        "its largest",
        "colors",
        "full coloring on the host",
        "colors",
        "particles of clusters",
        "their upload",
        "coloring",
        "making the graph",
        "its upload",
        "coloring",
        "colors",
        "reading back",
    ]);
    for row in &report.recolorings {
        let upload = |run: ColoringRun| ms(run.upload.times.median);
        let color = |run: ColoringRun| ms(run.times.median);
        let (particles, graph) = (row.from_incidence, row.from_graph);
        table.add_row([
            row.mesh.clone(),
            row.tets.to_string(),
            row.clusters.to_string(),
            ms(row.following),
            ms(row.following_largest),
            row.following_colors.to_string(),
            ms(row.host),
            row.host_colors.to_string(),
            ms(row.incidence),
            or_dash(particles, upload),
            or_dash(particles, color),
            ms(row.graph),
            or_dash(graph, upload),
            or_dash(graph, color),
            or_dash(particles, |run| run.colors.to_string()),
            ms(row.readback),
        ]);
    }
    table
}

fn ms(ms: f64) -> String {
    format!("{ms:.3}")
}

fn mebi(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", mebi(bytes))
}

fn or_dash<T>(value: Option<T>, show: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| DASH.to_owned(), show)
}

/// Empty cells.
fn missing(cells: usize) -> Vec<String> {
    vec![DASH.to_owned(); cells]
}
