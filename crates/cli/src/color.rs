//! `incise color`: clusters and colors the constraints of a mesh or the vertices of a graph.

mod input;
mod report;

use std::time::Instant;

use anyhow::anyhow;
use incise::clustering::{Method, cluster};
use incise::coloring::{Algorithm, Order, greedy, scgc};
use incise::graph::ColoringMetrics;

use crate::args::ColorArguments;
use crate::failure::Failure;
use crate::print::print;
use crate::run::require_cpu;
use input::Format;
use report::{ColorReport, Times, table, write_csv};

pub(crate) fn color(arguments: &ColorArguments) -> Result<(), Failure> {
    require_cpu(arguments.backend)?;
    let input = |error: anyhow::Error| Failure::Input(error);
    let algorithm =
        Algorithm::from_name(&arguments.algorithm).map_err(|error| input(error.into()))?;
    let method: Method = arguments
        .clustering
        .parse()
        .map_err(|error| input(anyhow::Error::from_boxed(Box::new(error))))?;

    let format = Format::of(&arguments.input);
    format.require(method).map_err(input)?;

    let mut clock = Clock(Instant::now());
    let source = format.read(&arguments.input)?;
    let read = clock.lap();
    let problem = source.problem().map_err(input)?;
    let constraints = problem.graph();
    let graph = clock.lap();
    let clustering = cluster(method, constraints);
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

    let proof = problem.check(&clustering, &coloring);
    let verified = proof.verified;
    let metrics = ColoringMetrics::by_vertices(&coloring);
    let report = ColorReport {
        input: arguments.input.display().to_string(),
        constraints: constraints.vertex_count(),
        particles: problem.particle_count(),
        clusters: clustering.occupied(),
        edges: clusters.edge_count(),
        algorithm: algorithm.name(),
        clustering: method.to_string(),
        backend: "cpu",
        seed: arguments.seed,
        colors: metrics.colors,
        max_clique: proof.clique,
        evenness: metrics.into(),
        by_constraints: ColoringMetrics::by_weights(&coloring, clustering.sizes()).into(),
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
