//! [`Experiment`]: independently measured cells, and the page made from them.
//!
//! Each cell is written when it is done, so that an interrupted run can continue, and so that the cells of a long run
//! can be distributed over machines: `--shard 2/5` measures every fifth cell, and `cargo xtask merge` collects the
//! results. A page is a function of the rows alone.

mod arguments;
mod machine;
mod merge;
mod page;
mod plot;
mod write;

use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

pub(crate) use arguments::{Backend, ExperimentArguments};
use machine::Machine;
pub(crate) use machine::today;
pub(crate) use merge::{MergeArguments, merge};
pub(crate) use page::{Page, Part, Table};
pub(crate) use plot::{Axis, Plot, Series, Style};

/// Independent measurements and the page made from them.
pub(crate) struct Experiment<R> {
    /// Name of the experiment and of its files.
    pub(crate) name: &'static str,
    pub(crate) cells: Vec<Cell<R>>,
    /// Makes the page from all rows, which are in the order of the cells.
    pub(crate) page: fn(&[R]) -> anyhow::Result<Page>,
}

/// An independent measurement.
pub(crate) struct Cell<R> {
    /// Unique id in lower case letters, digits, dots and dashes.
    pub(crate) id: String,
    pub(crate) measure: Box<dyn Fn() -> anyhow::Result<R>>,
}

/// File of a cell.
#[derive(Debug, Serialize, Deserialize)]
struct Done<R> {
    machine: Machine,
    row: R,
}

impl<R: Serialize + DeserializeOwned> Experiment<R> {
    /// Measures the missing cells, and writes the page unless this is one of several shards.
    pub(crate) fn run(self, arguments: &ExperimentArguments) -> anyhow::Result<()> {
        self.run_and_check(arguments, |_| Ok(()))
    }

    /// Measures like [`Experiment::run`]; the quick form then fails if a table has NaN or `check` rejects a row.
    pub(crate) fn run_and_check(
        self,
        arguments: &ExperimentArguments,
        check: impl Fn(&[R]) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let folder = arguments.out.join("cells").join(self.name);
        fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        arguments.agree_with(&folder.join("setup.json"))?;
        let here = Machine::here();
        let mine: Vec<(usize, &Cell<R>)> = self
            .cells
            .iter()
            .enumerate()
            .filter(|(place, _)| arguments.shard.is_none_or(|shard| shard.has(*place)))
            .collect();
        let missing: Vec<&str> = mine
            .iter()
            .filter(|(_, cell)| !cell.file(&folder).exists())
            .map(|(_, cell)| cell.id.as_str())
            .collect();
        ensure!(
            !arguments.complete || missing.is_empty(),
            "{}: {} of {} cells are missing ({}): merge the folder of their share, or give --partial to measure them here",
            self.name,
            missing.len(),
            mine.len(),
            missing.join(", ")
        );
        let bar = progress(self.name, mine.len());
        let mut done = Vec::new();
        for (_, cell) in mine {
            bar.set_message(cell.id.clone());
            done.push(cell.done(&folder, &here)?);
            bar.inc(1);
            log_line(&format!(
                "{}: {}/{} {}",
                self.name,
                bar.position(),
                bar.length().unwrap_or(0),
                cell.id
            ));
        }
        bar.finish_and_clear();
        if arguments.shard.is_some() {
            return Ok(());
        }
        let mut machines: Vec<Machine> = done.iter().map(|d| d.machine.clone()).collect();
        machines.sort();
        machines.dedup();
        let rows: Vec<R> = done.into_iter().map(|d| d.row).collect();
        let page = (self.page)(&rows)?;
        write::write(&arguments.out, self.name, &page, &machines, &rows)?;
        if arguments.quick {
            ensure!(!page.has_nan(), "{}: a table has NaN", self.name);
            check(&rows)?;
        }
        Ok(())
    }
}

impl<R: Serialize + DeserializeOwned> Cell<R> {
    pub(crate) fn new(
        id: impl Into<String>,
        measure: impl Fn() -> anyhow::Result<R> + 'static,
    ) -> Self {
        Self {
            id: id.into(),
            measure: Box::new(measure),
        }
    }

    /// The file of the cell.
    fn file(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.json", self.id))
    }

    /// Reads the cell from its file, or measures it and writes the file.
    fn done(&self, folder: &Path, here: &Machine) -> anyhow::Result<Done<R>> {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || ".-".contains(c);
        ensure!(
            !self.id.is_empty() && self.id.chars().all(plain),
            "{:?} is not the name of a cell",
            self.id
        );
        let path = self.file(folder);
        if let Ok(text) = fs::read_to_string(&path) {
            return serde_json::from_str(&text).with_context(|| {
                format!(
                    "{} is not a result of this cell: remove it or choose another --out",
                    path.display()
                )
            });
        }
        let row = (self.measure)().with_context(|| format!("cell {}", self.id))?;
        let done = Done {
            machine: here.clone(),
            row,
        };
        write::replace(&path, &serde_json::to_string_pretty(&done)?)?;
        Ok(done)
    }
}

/// Prints a line to stderr if it is not a terminal, as in the log of a cluster, where no bar is shown.
#[expect(clippy::print_stderr, reason = "progress goes to stderr")]
fn log_line(line: &str) {
    if !std::io::stderr().is_terminal() {
        eprintln!("{line}");
    }
}

/// Progress bar on stderr; hidden if stderr is not a terminal.
fn progress(name: &'static str, cells: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {elapsed} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(cells as u64)
        .with_style(style)
        .with_prefix(name);
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}

/// Median of some values; 0 of none.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
