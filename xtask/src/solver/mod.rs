//! `cargo xtask solver`: what the methods of the solver cost and what they are worth, as tables.

mod beam;
mod body;
mod convergence;
mod rest;
mod runner;
mod stability;
mod trade;

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct SolverArguments {
    /// Small bodies and few iterations: a minute instead of many. For tests; the figures mean nothing.
    #[arg(long)]
    quick: bool,
    /// Take the liver of this folder (`liver_11k.vtk`) instead of a generated one.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Only this table.
    #[arg(long, value_enum)]
    only: Option<Part>,
    /// Write the tables to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// A table, or several that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Iterations and milliseconds to a residual, by method.
    Convergence,
    /// Errors of a falling beam beside milliseconds per frame, and its error at rest by kappa.
    Trade,
    /// What becomes of a beam in extreme states, materials and steps.
    Stability,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn solver(arguments: &SolverArguments) -> anyhow::Result<()> {
    let text = tables(arguments)?;
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

fn tables(arguments: &SolverArguments) -> anyhow::Result<String> {
    let mut parts = Vec::new();
    let wanted = |part| arguments.only.is_none_or(|only| only == part);
    if wanted(Part::Convergence) {
        let mesh = body::liver(arguments.models.as_deref(), arguments.quick)?;
        parts.push(convergence::convergence(&mesh, arguments.quick)?);
    }
    if wanted(Part::Trade) {
        parts.push(trade::trade(arguments.quick)?);
    }
    if wanted(Part::Stability) {
        parts.push(stability::stability(arguments.quick)?);
    }
    Ok(parts.join("\n"))
}
