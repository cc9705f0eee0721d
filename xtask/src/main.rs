//! Experiments and sweeps over incise: `cargo xtask --help`.
//!
//! One module per command. The only algorithms here are slow reference versions that results are compared with.

mod accuracy;
mod coloring;
mod comparison;
mod contact;
mod cutting;
mod defaults;
mod degradation;
mod experiment;
mod gpu;
#[cfg(test)]
mod links;
mod models;
mod overhead;
mod paper;
#[cfg(test)]
mod prose;
mod random;
mod solver;
mod stability;
mod stress;
mod sweep;
#[cfg(test)]
mod tidy;
mod viewer;
mod web;

use anyhow::Context;
use clap::{Parser, Subcommand};
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{Row, Table};

use experiment::{ExperimentArguments, MergeArguments};

/// Sweeps over incise.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// Runs an experiment.
type Run = fn(&ExperimentArguments) -> anyhow::Result<()>;

/// All experiments by the names of their pages, in the order in which `all` runs them.
const EXPERIMENTS: &[(&str, Run)] = &[
    ("paper-table1", |arguments| {
        paper::run(paper::What::Table1, arguments)
    }),
    ("paper-table2", |arguments| {
        paper::run(paper::What::Table2, arguments)
    }),
    ("paper-table3", |arguments| {
        paper::run(paper::What::Table3, arguments)
    }),
    ("paper-fig4", |arguments| {
        paper::run(paper::What::Fig4, arguments)
    }),
    ("paper-fig6", |arguments| {
        paper::run(paper::What::Fig6, arguments)
    }),
    ("paper-fig7", |arguments| {
        paper::run(paper::What::Fig7, arguments)
    }),
    ("paper-fig8", |arguments| {
        paper::run(paper::What::Fig8, arguments)
    }),
    ("paper-fig9", |arguments| {
        paper::run(paper::What::Fig9, arguments)
    }),
    ("paper-fig10", |arguments| {
        paper::run(paper::What::Fig10, arguments)
    }),
    ("paper-fig11", |arguments| {
        paper::run(paper::What::Fig11, arguments)
    }),
    ("paper-claims", |arguments| {
        paper::run(paper::What::Claims, arguments)
    }),
    ("accuracy", accuracy::accuracy),
    ("stability", stability::stability),
    ("defaults", defaults::all),
    ("overhead", overhead::run),
    ("comparison", comparison::usual),
    ("contact", contact::usual),
];

#[derive(Debug, Subcommand)]
enum Command {
    /// Run all experiments, and write a page of each and one of all.
    All(ExperimentArguments),
    /// Cluster and color meshes by all methods, and write tables.
    Coloring(coloring::ColoringArguments),
    /// Measure the cost of contact and the depth of stacks and piles, and write a page.
    Contact(contact::ContactArguments),
    /// Measure the cost of cuts by stage and mesh size, and the effect of snapping.
    Cutting(cutting::CuttingArguments),
    /// Default settings: errors against Newton's method, and bodies after cuts, under load and at rest.
    Defaults(defaults::DefaultsArguments),
    /// Check the kernels on a GPU, time colorings, iterations and frames there, and write a page and JSON.
    GpuSweep(gpu::GpuArguments),
    /// Repeat the tables and figures of the paper, its numbers and ours side by side.
    Paper(paper::PaperArguments),
    /// Collect the measurements of runs with --shard, and write the pages.
    Merge(MergeArguments),
    /// Measure the cost of unused features of a scene: instructions, bytes, dispatches.
    Overhead(overhead::OverheadArguments),
    /// Child process that `overhead` runs under valgrind.
    #[command(hide = true)]
    OverheadProbe(overhead::ProbeArguments),
    /// Compare this solver with other systems on one mesh, measured alternately.
    Comparison(comparison::ComparisonArguments),
    /// Compare cost and accuracy of the solver's methods.
    Solver(solver::SolverArguments),
    /// Make thousands of random strokes and check all derived data after each.
    StressCut(stress::StressArguments),
    /// Test bodies in extreme states, materials, steps and cuts: a matrix of outcomes, with an explanation for each
    /// body that does not recover.
    Stability(ExperimentArguments),
    /// Cut meshes, check all derived data and write a table.
    Sweep(sweep::SweepArguments),
    /// Measure errors against Newton's method and times for every setting of the solver.
    Accuracy(ExperimentArguments),
    /// Test the viewer with synthetic input on a virtual screen (needs Xvfb).
    ViewerSmoke(viewer::SmokeArguments),
    /// Build the viewer as a web page, test it in Chromium, serve it.
    Web(web::WebArguments),
    /// Cut a mesh with many small strokes, and measure clusters, colors and the solve time.
    Degradation(degradation::DegradationArguments),
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::All(arguments) => EXPERIMENTS.iter().try_for_each(|(_, run)| run(&arguments)),
        Command::Coloring(arguments) => coloring::coloring(&arguments),
        Command::Contact(arguments) => contact::run(&arguments),
        Command::Cutting(arguments) => cutting::cutting(&arguments),
        Command::Defaults(arguments) => defaults::defaults(&arguments),
        Command::GpuSweep(arguments) => gpu::sweep(&arguments),
        Command::Paper(arguments) => paper::paper(&arguments),
        Command::Merge(arguments) => experiment::merge(&arguments)?
            .iter()
            .try_for_each(|(name, of_this)| named(name)?(of_this)),
        Command::Overhead(arguments) => overhead::overhead(&arguments),
        Command::OverheadProbe(arguments) => overhead::probe(&arguments),
        Command::Comparison(arguments) => comparison::comparison(&arguments),
        Command::Solver(arguments) => solver::solver(&arguments),
        Command::StressCut(arguments) => stress::stress(&arguments),
        Command::Stability(arguments) => stability::stability(&arguments),
        Command::Sweep(arguments) => sweep::sweep(&arguments),
        Command::Accuracy(arguments) => accuracy::accuracy(&arguments),
        Command::ViewerSmoke(arguments) => viewer::smoke(&arguments),
        Command::Web(arguments) => web::web(&arguments),
        Command::Degradation(arguments) => degradation::degradation(&arguments),
    }
}

/// Finds the experiment of a page by name.
fn named(name: &str) -> anyhow::Result<Run> {
    let found = EXPERIMENTS.iter().find(|(known, _)| *known == name);
    found
        .map(|(_, run)| *run)
        .with_context(|| format!("there is no experiment {name:?}"))
}

/// An empty table in Markdown.
fn table(header: impl Into<Row>) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header(header);
    table
}
