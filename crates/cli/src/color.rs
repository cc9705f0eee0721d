//! `incise color`: clusters and colors the constraints of a mesh or the vertices of a graph.

mod input;
mod report;

use std::time::Instant;

use anyhow::anyhow;
use incise::clustering::Method;
use incise::coloring::{Algorithm, Conflicts, balance, color as color_by};
use incise::graph::{Clustering, Coloring, ColoringMetrics};
use incise::{clustering_suggestion, coloring_suggestion};

use crate::args::{BalanceName, ColorArguments, ColorBackendName};
use crate::failure::Failure;
use crate::print::print;
use input::{Format, Problem};
use report::{ColorReport, Times, table, write_csv};

pub(crate) fn color(arguments: &ColorArguments) -> Result<(), Failure> {
    let input = |error: anyhow::Error| Failure::Input(error);
    let algorithm: Algorithm = arguments
        .algorithm
        .parse()
        .map_err(|error| input(anyhow!("{error}{}", coloring_suggestion(&error))))?;
    let method: Method = arguments
        .clustering
        .parse()
        .map_err(|error| input(anyhow!("{error}{}", clustering_suggestion(&error))))?;

    let format = Format::of(&arguments.input);
    format.require(method).map_err(input)?;

    let mut clock = Clock(Instant::now());
    let source = format.read(&arguments.input)?;
    let read = clock.lap();
    let problem = source.problem().map_err(input)?;
    let graph = clock.lap();
    let clustering = problem.cluster(method);
    let (result, cluster, color) = match &problem {
        Problem::Mesh(incidence) => {
            let clusters = incidence.quotient(&clustering);
            let cluster = clock.lap();
            let result = colored(&clusters, algorithm, &clustering, arguments)?;
            (result, cluster, clock.lap())
        }
        Problem::Graph(graph) => {
            let clusters = graph.quotient(&clustering);
            let cluster = clock.lap();
            let result = colored(&clusters, algorithm, &clustering, arguments)?;
            (result, cluster, clock.lap())
        }
    };
    let Found {
        coloring,
        rounds,
        edge_visits,
    } = result;

    let proof = problem.check(&clustering, &coloring);
    let verified = proof.verified;
    let metrics = ColoringMetrics::by_vertices(&coloring);
    let report = ColorReport {
        input: arguments.input.display().to_string(),
        constraints: problem.vertex_count(),
        particles: problem.particle_count(),
        clusters: clustering.occupied(),
        edges: proof.edges,
        algorithm: algorithm.to_string(),
        clustering: method.to_string(),
        backend: match arguments.backend {
            ColorBackendName::Cpu => "cpu",
            ColorBackendName::Gpu => "gpu",
        },
        seed: arguments.seed,
        balanced: arguments.balance.map(BalanceName::name),
        colors: metrics.colors,
        max_clique: proof.clique,
        evenness: metrics.into(),
        by_constraints: ColoringMetrics::by_weights(&coloring, clustering.sizes()).into(),
        rounds,
        edge_visits,
        verified,
        ms: Times {
            read,
            graph,
            cluster,
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

/// A coloring with its time and statistics.
struct Found {
    coloring: Coloring,
    rounds: usize,
    edge_visits: Option<u64>,
}

/// Colors the clusters and balances the colors if requested.
fn colored(
    clusters: &impl Conflicts,
    algorithm: Algorithm,
    clustering: &Clustering,
    arguments: &ColorArguments,
) -> Result<Found, Failure> {
    let mut result = match arguments.backend {
        ColorBackendName::Cpu => {
            let result = color_by(algorithm, clusters, arguments.seed);
            let result = result.map_err(|error| Failure::Run(error.into()))?;
            Found {
                coloring: result.coloring,
                rounds: result.rounds,
                edge_visits: result.edge_visits,
            }
        }
        ColorBackendName::Gpu => on_gpu(algorithm, clusters, arguments.seed)?,
    };
    match arguments.balance {
        None => {}
        Some(BalanceName::Clusters) => {
            let one_each = vec![1; clusters.vertex_count()];
            balance(clusters, &mut result.coloring, &one_each);
        }
        Some(BalanceName::Constraints) => {
            balance(clusters, &mut result.coloring, clustering.sizes());
        }
    }
    Ok(result)
}

/// Colors the clusters on a GPU; the time includes the upload of the graph.
#[cfg(feature = "gpu")]
fn on_gpu(algorithm: Algorithm, clusters: &impl Conflicts, seed: u64) -> Result<Found, Failure> {
    use incise::gpu::coloring::{ColoringKernels, DeviceGraph, color};
    use incise::gpu::{GpuContext, GpuError, GpuOptions};

    let input = |error: GpuError| Failure::Input(error.into());
    let gpu = GpuContext::new(&GpuOptions::from_env()).map_err(input)?;
    let graph = DeviceGraph::new(&gpu, &clusters.graph()).map_err(input)?;
    let mut kernels = ColoringKernels::default();
    let result = color(&gpu, &mut kernels, algorithm, &graph, seed).map_err(input)?;
    Ok(Found {
        coloring: result.read(&gpu).map_err(input)?,
        rounds: result.rounds(),
        edge_visits: None,
    })
}

#[cfg(not(feature = "gpu"))]
fn on_gpu(_: Algorithm, _: &impl Conflicts, _: u64) -> Result<Found, Failure> {
    Err(Failure::Input(anyhow!(
        "this build has no GPU path: build with `--features gpu`, or use --backend cpu"
    )))
}

/// Stopwatch: milliseconds from lap to lap.
struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - self.0;
        self.0 = now;
        lap.as_secs_f64() * 1e3
    }
}
