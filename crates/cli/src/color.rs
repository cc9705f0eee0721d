//! `incise color`: clusters and colors the constraints of a mesh.

use std::io::Write;
use std::time::Instant;

use anyhow::{Context, anyhow};
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::clustering::{Method, cluster};
use incise::coloring::{Algorithm, Order, greedy, scgc};
use incise::graph::{Clustering, Coloring, ColoringMetrics, ConstraintGraph, Incidence};
use incise::mesh::io;
use serde::Serialize;

use crate::args::ColorArguments;
use crate::failure::Failure;
use crate::print::print;
use crate::run::require_cpu;

/// The object that `--json` prints.
#[derive(Debug, Serialize)]
struct ColorReport {
    input: String,
    constraints: usize,
    particles: usize,
    clusters: usize,
    edges: usize,
    algorithm: &'static str,
    clustering: String,
    backend: &'static str,
    seed: u64,
    colors: usize,
    max_clique: usize,
    std: f64,
    range: u64,
    chi2: f64,
    rounds: usize,
    verified: bool,
    ms: Times,
}

#[derive(Debug, Serialize)]
struct Times {
    read: f64,
    graph: f64,
    cluster: f64,
    color: f64,
}

pub(crate) fn color(arguments: &ColorArguments) -> Result<(), Failure> {
    require_cpu(arguments.backend)?;
    let input = |error: anyhow::Error| Failure::Input(error);
    let algorithm =
        Algorithm::from_name(&arguments.algorithm).map_err(|error| input(error.into()))?;
    let method: Method = arguments
        .clustering
        .parse()
        .map_err(|error| input(anyhow::Error::from_boxed(Box::new(error))))?;

    let mut clock = Clock(Instant::now());
    let mesh = io::read(&arguments.input)?;
    mesh.check()
        .with_context(|| arguments.input.display().to_string())
        .map_err(input)?;
    let read = clock.lap();
    let incidence = Incidence::from_constraints(mesh.positions.len(), mesh.tets.iter().copied());
    let incidence = incidence.map_err(|error| input(error.into()))?;
    let constraints = ConstraintGraph::from_incidence(&incidence);
    let graph = clock.lap();
    let clustering = cluster(method, &incidence);
    let clusters = constraints.quotient(&clustering);
    let clustered = clock.lap();
    let (coloring, rounds) = match algorithm {
        Algorithm::Scgc => {
            let result = scgc(&clusters);
            (result.coloring, result.stats.rounds)
        }
        // One pass after the other: a single round.
        _ => (greedy(&clusters, Order::LargestFirst), 1),
    };
    let color = clock.lap();

    let quotient = incidence.quotient(&clustering);
    let verified = coloring.verify_incidence(&quotient).is_ok();
    let metrics = ColoringMetrics::by_vertices(&coloring);
    let report = ColorReport {
        input: arguments.input.display().to_string(),
        constraints: incidence.constraint_count(),
        particles: incidence.particle_count(),
        clusters: clustering.occupied(),
        edges: clusters.edge_count(),
        algorithm: algorithm.name(),
        clustering: method.to_string(),
        backend: "cpu",
        seed: arguments.seed,
        colors: metrics.colors,
        max_clique: quotient.clique_bound(),
        std: metrics.std,
        range: metrics.range,
        chi2: metrics.chi2,
        rounds,
        verified,
        ms: Times {
            read,
            graph,
            cluster: clustered,
            color,
        },
    };
    if let Some(path) = &arguments.csv {
        write_csv(path, &clustering, &coloring)?;
    }
    if arguments.json {
        let json = serde_json::to_string(&report).map_err(|error| Failure::Run(error.into()))?;
        print(json)?;
    } else {
        print(table(&report))?;
    }
    if verified {
        Ok(())
    } else {
        Err(Failure::Run(anyhow!(
            "the coloring is not proper: this is a defect of incise, please report it"
        )))
    }
}

/// Milliseconds from lap to lap.
struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - self.0;
        self.0 = now;
        lap.as_secs_f64() * 1e3
    }
}

fn write_csv(
    path: &std::path::Path,
    clustering: &Clustering,
    coloring: &Coloring,
) -> Result<(), Failure> {
    io::write_atomically(path, |file| {
        let mut file = std::io::BufWriter::new(file);
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

fn table(report: &ColorReport) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([report.input.as_str(), ""]);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row(
        "constraints, particles",
        format!("{}, {}", report.constraints, report.particles),
    );
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
    row(
        "lower bound: clusters at one particle",
        report.max_clique.to_string(),
    );
    row(
        "class sizes: std, range, chi2",
        format!("{:.2}, {}, {:.2}", report.std, report.range, report.chi2),
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
