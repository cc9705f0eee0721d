//! `cargo xtask merge`: collects the cells of several runs and writes the pages.
//!
//! Complete experiments need no measurement: running their command with the merged folder writes the page. Cells that
//! are missing in all folders are an error that names them, or with `--partial` are measured here.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use clap::Args;

use super::ExperimentArguments;
use super::arguments::Setup;

#[derive(Debug, Args)]
pub(crate) struct MergeArguments {
    /// Folder to collect in.
    out: PathBuf,
    /// Folders given as `--out` to the runs with `--shard`.
    #[arg(required = true)]
    from: Vec<PathBuf>,
    /// Measure the cells that no folder has, instead of failing.
    #[arg(long)]
    partial: bool,
}

#[cfg(test)]
impl MergeArguments {
    pub(super) const fn of(out: PathBuf, from: Vec<PathBuf>) -> Self {
        let partial = false;
        Self { out, from, partial }
    }
}

/// Copies all cells to one folder; returns their experiments, with the arguments that make their pages.
pub(crate) fn merge(
    arguments: &MergeArguments,
) -> anyhow::Result<Vec<(String, ExperimentArguments)>> {
    let mut experiments: Vec<(String, ExperimentArguments)> = Vec::new();
    for from in &arguments.from {
        let cells = from.join("cells");
        let entries =
            fs::read_dir(&cells).with_context(|| format!("{} holds no cells", from.display()))?;
        for entry in entries {
            let folder = entry?.path();
            let name = folder
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let setup: Setup = serde_json::from_str(
                &fs::read_to_string(folder.join("setup.json"))
                    .with_context(|| folder.display().to_string())?,
            )?;
            let to = arguments.out.join("cells").join(&name);
            fs::create_dir_all(&to)?;
            let of_this = ExperimentArguments {
                quick: setup.quick,
                models: setup.models,
                backend: setup.backend,
                out: arguments.out.clone(),
                shard: None,
                complete: !arguments.partial,
            };
            of_this.agree_with(&to.join("setup.json"))?;
            for file in fs::read_dir(&folder)? {
                let file = file?.path();
                let target = to.join(file.file_name().unwrap_or_default());
                if target.exists() {
                    ensure!(
                        target.ends_with("setup.json") || fs::read(&file)? == fs::read(&target)?,
                        "{} and {} are two results of one cell: remove one",
                        file.display(),
                        target.display()
                    );
                } else {
                    fs::copy(&file, &target)?;
                }
            }
            if !experiments.iter().any(|(known, _)| *known == name) {
                experiments.push((name, of_this));
            }
        }
    }
    if experiments.is_empty() {
        bail!("there are no cells in these folders");
    }
    experiments.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(experiments)
}
