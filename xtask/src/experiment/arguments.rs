//! Arguments of all experiments.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

use super::write::replace;

#[derive(Clone, Debug, Args)]
pub(crate) struct ExperimentArguments {
    /// Small bodies and few repeats: seconds instead of minutes. For tests; the figures mean nothing.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Take the meshes of this folder (`liver_11k.vtk` and the like) instead of generated ones.
    #[arg(long, value_name = "DIR")]
    pub(crate) models: Option<PathBuf>,
    /// Compute device where an experiment supports both.
    #[arg(long, value_enum, default_value_t = Backend::Cpu)]
    pub(crate) backend: Backend,
    /// Keep measurements, pages and pictures in this folder, and continue from what it holds.
    #[arg(long, value_name = "DIR", default_value = "out/experiments")]
    pub(crate) out: PathBuf,
    /// Measure one share of the cells only, as 2/5 for the second of five, and write no page: see `cargo xtask merge`.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    /// True if no cell may be missing.
    #[arg(skip)]
    pub(crate) complete: bool,
}

/// Compute device of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum Backend {
    /// The processor.
    Cpu,
    /// A GPU.
    Gpu,
}

/// One share of the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// True if the share contains the cell of this index.
    pub(super) fn has(self, place: usize) -> bool {
        place % self.count == self.index
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || format!("{text:?} is not a share: write one as in 2/5");
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let index: usize = index.parse().map_err(|_| wrong())?;
        let count: usize = count.parse().map_err(|_| wrong())?;
        if (1..=count).contains(&index) {
            Ok(Self {
                index: index - 1,
                count,
            })
        } else {
            Err(wrong())
        }
    }
}

/// Configuration that the cells of a folder were measured with.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Setup {
    pub(super) quick: bool,
    pub(super) models: Option<PathBuf>,
    pub(super) backend: Backend,
}

impl ExperimentArguments {
    /// Checks that a folder holds no cells of another configuration, by a file in it that stores the configuration.
    pub(super) fn agree_with(&self, file: &Path) -> anyhow::Result<()> {
        let setup = Setup {
            quick: self.quick,
            models: self.models.clone(),
            backend: self.backend,
        };
        match fs::read_to_string(file) {
            Ok(text) => {
                let before: Setup =
                    serde_json::from_str(&text).with_context(|| file.display().to_string())?;
                ensure!(
                    before == setup,
                    "{} holds cells measured with {before:?}, not with {setup:?}: choose another --out",
                    self.out.display()
                );
                Ok(())
            }
            Err(_) => replace(file, &serde_json::to_string_pretty(&setup)?),
        }
    }
}
