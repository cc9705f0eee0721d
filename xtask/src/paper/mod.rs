//! `cargo xtask paper`: tables and figures of the paper, with its values next to the measured ones.
//!
//! One module per table or figure, each an experiment. The paper's values are data in `printed`, its bodies are in
//! `paper_mesh`. Where the paper is ambiguous, every reading is run and the page says so.

mod claims;
mod colorings;
mod compared;
mod convergence;
mod fig10;
mod fig11;
mod fig4;
mod fig6;
mod fig7;
mod fig8;
mod fig9;
mod painter;
mod paper_mesh;
mod printed;
mod scene;
mod table1;
mod table2;
mod table3;
#[cfg(test)]
mod tests;

use clap::{Args, ValueEnum};

use crate::experiment::{Backend, ExperimentArguments};

#[derive(Debug, Args)]
pub(crate) struct PaperArguments {
    /// Table or figure to run.
    #[arg(value_enum)]
    what: What,
    #[command(flatten)]
    experiment: ExperimentArguments,
}

/// A table or figure of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum What {
    /// Serial neighbor clustering and Greedy K-Neighbor.
    Table1,
    /// Colors, their distribution and times by algorithm.
    Table2,
    /// Iterations and milliseconds to a residual.
    Table3,
    /// Time to color and colors by algorithm and size.
    Fig4,
    /// Pictures of bodies that are cut.
    Fig6,
    /// Residuals over 500 iterations.
    Fig7,
    /// Colors and times of frames while cutting.
    Fig8,
    /// Pictures of colored bodies, and their colors.
    Fig9,
    /// Power density spectra of the residual.
    Fig10,
    /// The time of a frame by stages.
    Fig11,
    /// Claims of the paper and their verdicts; uses the measurements of the others.
    Claims,
    /// All of these.
    All,
}

/// Prefix of the names of the experiments.
const PREFIX: &str = "paper-";

pub(crate) fn paper(arguments: &PaperArguments) -> anyhow::Result<()> {
    anyhow::ensure!(
        arguments.experiment.backend == Backend::Cpu,
        "the paper's tables and figures are measured on the processor; for colorings, iterations and frames on a GPU see cargo \
         xtask gpu-sweep"
    );
    run(arguments.what, &arguments.experiment)
}

/// Runs the experiment of a table or figure; always on the processor, even if others of `all` run on a GPU.
pub(crate) fn run(what: What, arguments: &ExperimentArguments) -> anyhow::Result<()> {
    match what {
        What::Table1 => table1::experiment(arguments).run(arguments),
        What::Table2 => table2::experiment(arguments).run(arguments),
        What::Table3 => table3::experiment(arguments).run(arguments),
        What::Fig4 => fig4::experiment(arguments).run(arguments),
        What::Fig6 => fig6::experiment(arguments).run(arguments),
        What::Fig7 => fig7::experiment(arguments).run(arguments),
        What::Fig8 => fig8::experiment(arguments).run(arguments),
        What::Fig10 => fig10::experiment(arguments).run(arguments),
        What::Claims => claims::experiment(arguments).run(arguments),
        What::Fig11 => fig11::experiment(arguments).run(arguments),
        What::Fig9 => fig9::experiment(arguments).run(arguments),
        What::All => What::value_variants()
            .iter()
            .filter(|&&what| what != What::All)
            .try_for_each(|&what| run(what, arguments)),
    }
}
