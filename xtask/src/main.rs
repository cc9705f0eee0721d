//! Sweeps over incise: `cargo xtask --help`.
//!
//! One module per command; no algorithms of its own, except the slow ones that results are compared with.

mod accuracy;
mod coloring;
mod comparison;
mod cutting;
mod defaults;
mod degradation;
mod experiment;
mod gpu;
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
];

#[derive(Debug, Subcommand)]
enum Command {
    /// Run all experiments, and write a page of each and one of all.
    All(ExperimentArguments),
    /// Cluster and color meshes in every way there is, and write tables.
    Coloring(coloring::ColoringArguments),
    /// What a cut costs by stage and size of the mesh, and what snapping trades.
    Cutting(cutting::CuttingArguments),
    /// Default settings: errors against Newton's method, and bodies after cuts, under load and at rest.
    Defaults(defaults::DefaultsArguments),
    /// Check the kernels on a GPU, time colorings, iterations and frames there, and write a page and JSON.
    GpuSweep(gpu::GpuArguments),
    /// Repeat the tables and figures of the paper, its numbers and ours side by side.
    Paper(paper::PaperArguments),
    /// Gather what runs with --shard have measured, and write the pages.
    Merge(MergeArguments),
    /// What a scene pays for what it does not use: instructions, bytes, dispatches.
    Overhead(overhead::OverheadArguments),
    /// What `overhead` runs under valgrind.
    #[command(hide = true)]
    OverheadProbe(overhead::ProbeArguments),
    /// Our solver next to other systems on the same mesh, each in turns with ours.
    Comparison(comparison::ComparisonArguments),
    /// Compare the methods of the solver: what they cost and what they are worth.
    Solver(solver::SolverArguments),
    /// Make random strokes by the thousand and check everything after each.
    StressCut(stress::StressArguments),
    /// What becomes of bodies in extreme states, materials, steps and cuts: a matrix, and why what does not recover
    /// does not.
    Stability(ExperimentArguments),
    /// Cut meshes, check everything and write a table.
    Sweep(sweep::SweepArguments),
    /// What accuracy costs: errors against Newton's method beside times, for every knob of the solver.
    Accuracy(ExperimentArguments),
    /// Use the viewer with a synthetic hand on a screen without a monitor, and check what it shows (needs Xvfb).
    ViewerSmoke(viewer::SmokeArguments),
    /// Cut a mesh many times in small strokes, and see what becomes of clusters, colors and the time to solve.
    Degradation(degradation::DegradationArguments),
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::All(arguments) => EXPERIMENTS.iter().try_for_each(|(_, run)| run(&arguments)),
        Command::Coloring(arguments) => coloring::coloring(&arguments),
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
        Command::Degradation(arguments) => degradation::degradation(&arguments),
    }
}

/// The experiment whose page has a name.
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
