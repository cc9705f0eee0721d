//! Sweeps over incise: `cargo xtask --help`.
//!
//! One module per command; no algorithms of its own, except the slow ones that results are compared with.

mod models;
mod sweep;

use clap::{Parser, Subcommand};

/// Sweeps over incise.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Color and cut meshes, check everything and write tables.
    Sweep(sweep::SweepArguments),
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::Sweep(arguments) => sweep::sweep(&arguments),
    }
}
