//! `cargo xtask coloring`: all clusterings and colorings on all meshes, with the lower bound and the times.
//!
//! Colors: the lower bound is the largest number of clusters at a particle. Balance: equal numbers of colors, balanced.
//! Algorithms: rounds, neighbor visits, and times from particles and from a graph, on one thread and on all. Every
//! coloring is verified from the particles alone before its row is written.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::ensure;
use clap::Args;
use comfy_table::Table;
use incise::clustering::{Method, cluster};
use incise::coloring::{Algorithm, Colored, Conflicts, Order, Shortcuts, balance, color, greedy};
use incise::graph::{Coloring, ColoringMetrics, ConstraintGraph, Incidence};
use incise::mesh::glam::DVec3;
use incise::mesh::{TetMesh, kuhn_box};

use crate::models::models;
use crate::table;

#[derive(Debug, Args)]
pub(crate) struct ColoringArguments {
    /// Small generated meshes only: a minute instead of many.
    #[arg(long)]
    quick: bool,
    /// Take the .vtk meshes of this folder instead of generated ones. Lattices are always among the meshes.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Time the algorithms on meshes of at least so many tets, the lattices left out.
    #[arg(long, value_name = "N", default_value_t = 80_000)]
    time_from: usize,
    /// Time the algorithms on meshes of at most so many tets.
    #[arg(long, value_name = "N", default_value_t = 120_000)]
    time_to: usize,
    /// Write the tables to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

const CLUSTERINGS: [&str; 7] = [
    "none",
    "serial:5",
    "serial:10",
    "greedy-k:5",
    "greedy-k:10",
    "pressure:5",
    "pressure:10",
];

/// Constraints of a mesh.
struct Case {
    name: String,
    incidence: Incidence,
}

impl Case {
    fn new(name: String, mesh: &TetMesh) -> anyhow::Result<Self> {
        let tets = mesh.tets.iter().copied();
        let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
        Ok(Self { name, incidence })
    }
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn coloring(arguments: &ColoringArguments) -> anyhow::Result<()> {
    let mut cases = Vec::new();
    for model in models(arguments.models.as_deref(), usize::MAX, arguments.quick)? {
        cases.push(Case::new(model.name, &model.mesh)?);
    }
    let bodies = cases.len();
    let sides: &[usize] = if arguments.quick { &[6] } else { &[12, 26] };
    for &side in sides {
        let name = format!("Kuhn lattice {side}^3");
        cases.push(Case::new(name, &kuhn_box([side; 3], DVec3::ONE))?);
    }
    let mut text = format!("## Colors\n\n{}\n", colors(&cases)?);
    text += &format!("\n## Balance\n\n{}\n", balanced(&cases)?);
    for case in &cases[..bodies] {
        let tets = case.incidence.constraint_count();
        if arguments.quick || (arguments.time_from..=arguments.time_to).contains(&tets) {
            for clustering in ["none", "serial:5"] {
                let heading = format!("{}, {clustering}", case.name);
                text += &format!("\n## {heading}\n\n{}\n", algorithms(case, clustering)?);
            }
        }
    }
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// Numbers of colors and the bound, for the orders from the literature and the default.
fn colors(cases: &[Case]) -> anyhow::Result<Table> {
    let mut table = table([
        "mesh",
        "clustering",
        "clusters",
        "bound",
        "largest first",
        "mcs",
        "smallest last",
        "auto",
        "above the bound",
    ]);
    for case in cases {
        for name in CLUSTERINGS {
            let clustering = cluster(name.parse::<Method>()?, &case.incidence);
            let clusters = case.incidence.quotient(&clustering);
            let graph = ConstraintGraph::from_incidence(&clusters);
            let orders = [
                Order::LargestFirst,
                Order::MaximumCardinality,
                Order::SmallestLast,
            ];
            let mut counts = Vec::new();
            for order in orders {
                counts.push(verified(&clusters, &greedy(&graph, order))?);
            }
            let auto = color(Algorithm::Auto, &clusters, 0)?.coloring;
            let auto = verified(&clusters, &auto)?;
            let bound = clusters.clique_bound();
            let mut row = vec![
                case.name.clone(),
                name.to_owned(),
                clustering.occupied().to_string(),
                bound.to_string(),
            ];
            row.extend(counts.into_iter().map(|count| count.to_string()));
            row.push(auto.to_string());
            row.push((auto - bound).to_string());
            table.add_row(row);
        }
    }
    Ok(table)
}

/// Number of colors of a coloring after its check by the particles.
fn verified(clusters: &Incidence, coloring: &Coloring) -> anyhow::Result<usize> {
    coloring.verify_incidence(clusters)?;
    Ok(coloring.color_count())
}

/// The default coloring before and after balancing, by clusters and by tets.
fn balanced(cases: &[Case]) -> anyhow::Result<Table> {
    let mut table = table([
        "mesh",
        "clustering",
        "colors",
        "range",
        "balanced",
        "std",
        "balanced",
        "range in tets",
        "balanced",
        "ms",
    ]);
    for case in cases {
        for name in CLUSTERINGS {
            let clustering = cluster(name.parse::<Method>()?, &case.incidence);
            let clusters = case.incidence.quotient(&clustering);
            let start = color(Algorithm::Auto, &clusters, 0)?.coloring;
            let mut even = start.clone();
            let clock = Instant::now();
            balance(&clusters, &mut even, &vec![1; clusters.constraint_count()]);
            let ms = clock.elapsed().as_secs_f64() * 1e3;
            let mut by_tets = start.clone();
            balance(&clusters, &mut by_tets, clustering.sizes());
            for coloring in [&even, &by_tets] {
                let count = verified(&clusters, coloring)?;
                ensure!(count == start.color_count(), "balancing changed the colors");
            }
            let [before, after] = [&start, &even].map(ColoringMetrics::by_vertices);
            let [before_tets, after_tets] = [&start, &by_tets]
                .map(|coloring| ColoringMetrics::by_weights(coloring, clustering.sizes()));
            table.add_row([
                case.name.clone(),
                name.to_owned(),
                before.colors.to_string(),
                before.range.to_string(),
                after.range.to_string(),
                format!("{:.1}", before.std),
                format!("{:.2}", after.std),
                before_tets.range.to_string(),
                after_tets.range.to_string(),
                format!("{ms:.1}"),
            ]);
        }
    }
    Ok(table)
}

/// All algorithms and all combinations of shortcuts on one mesh.
fn algorithms(case: &Case, clustering: &str) -> anyhow::Result<Table> {
    let threads = std::thread::available_parallelism()?.get();
    let all = format!("{threads} threads");
    let mut table = table([
        "algorithm",
        "colors",
        "rounds",
        "looks at neighbors",
        "ms from particles",
        "ms from graph",
        all.as_str(),
    ]);
    let clustering = cluster(clustering.parse::<Method>()?, &case.incidence);
    let clusters = case.incidence.quotient(&clustering);
    let graph = ConstraintGraph::from_incidence(&clusters);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let combinations = Shortcuts::COMBINATIONS.into_iter().map(Algorithm::Scgc);
    let known: Vec<Algorithm> = Algorithm::ALL.into_iter().collect();
    let more = combinations.filter(|algorithm| !known.contains(algorithm));
    for algorithm in known.iter().copied().chain(more) {
        let (from_particles, particles) = one.install(|| timed(algorithm, &clusters))?;
        let (from_graph, single) = one.install(|| timed(algorithm, &graph))?;
        let (_, parallel) = timed(algorithm, &graph)?;
        let count = verified(&clusters, &from_particles.coloring)?;
        from_graph.coloring.verify(&graph)?;
        let visits = from_graph.edge_visits;
        table.add_row([
            algorithm.to_string(),
            count.to_string(),
            from_graph.rounds.to_string(),
            visits.map_or("-".to_owned(), |visits| visits.to_string()),
            format!("{particles:.1}"),
            format!("{single:.1}"),
            // Threads do not speed up the sequential algorithms.
            visits.map_or("-".to_owned(), |_| format!("{parallel:.1}")),
        ]);
    }
    Ok(table)
}

/// A coloring and the shortest of three times, in milliseconds.
fn timed(algorithm: Algorithm, conflicts: &impl Conflicts) -> anyhow::Result<(Colored, f64)> {
    let mut shortest = f64::INFINITY;
    let mut result = None;
    for _ in 0..3 {
        let clock = Instant::now();
        let colored = color(algorithm, conflicts, 0)?;
        shortest = shortest.min(clock.elapsed().as_secs_f64() * 1e3);
        result = Some(colored);
    }
    let result = result.ok_or_else(|| anyhow::anyhow!("nothing was run"))?;
    Ok((result, shortest))
}
