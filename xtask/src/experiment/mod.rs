//! [`Experiment`]: cells that are measured one by one, and the page that is made of them.
//!
//! Each cell is written as it is done, so that a run that was broken off continues where it was, and so that the cells
//! of a long run can be shared out among machines: `--shard 2/5` measures every fifth one, and `cargo xtask merge`
//! gathers what came of it. A page is a function of the rows alone.

mod arguments;
mod machine;
mod merge;
mod page;
mod plot;
mod write;

use std::fs;
use std::path::Path;
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

/// Independent measurements and what is made of them.
pub(crate) struct Experiment<R> {
    /// Names the files.
    pub(crate) name: &'static str,
    pub(crate) cells: Vec<Cell<R>>,
    /// Makes the page of all rows, which come in the order of the cells.
    pub(crate) page: fn(&[R]) -> anyhow::Result<Page>,
}

/// A measurement that depends on no other.
pub(crate) struct Cell<R> {
    /// In lower case, digits, dots and dashes; differs from that of all other cells of the experiment.
    pub(crate) id: String,
    pub(crate) measure: Box<dyn Fn() -> anyhow::Result<R>>,
}

/// The file of a cell.
#[derive(Debug, Serialize, Deserialize)]
struct Done<R> {
    machine: Machine,
    row: R,
}

impl<R: Serialize + DeserializeOwned> Experiment<R> {
    /// Measures the cells that are not there yet, and writes the page unless this is one shard of several.
    pub(crate) fn run(self, arguments: &ExperimentArguments) -> anyhow::Result<()> {
        self.run_and_check(arguments, |_| Ok(()))
    }

    /// Measures like [`Experiment::run`]; the quick form then fails where a table has NaN or `check` finds a
    /// row that must not occur.
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
        let bar = progress(self.name, mine.len());
        let mut done = Vec::new();
        for (_, cell) in mine {
            bar.set_message(cell.id.clone());
            done.push(cell.done(&folder, &here)?);
            bar.inc(1);
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

    /// What a file has of the cell, or else its measurement, written to that file.
    fn done(&self, folder: &Path, here: &Machine) -> anyhow::Result<Done<R>> {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || ".-".contains(c);
        ensure!(
            !self.id.is_empty() && self.id.chars().all(plain),
            "{:?} is no name of a cell",
            self.id
        );
        let path = folder.join(format!("{}.json", self.id));
        if let Ok(text) = fs::read_to_string(&path) {
            return serde_json::from_str(&text).with_context(|| {
                format!(
                    "{} holds no such cell, remove it or give another --out",
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

/// A bar on the standard error, which shows nothing where that is no terminal.
fn progress(name: &'static str, cells: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {elapsed} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(cells as u64)
        .with_style(style)
        .with_prefix(name);
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}

/// The middle of some values; 0 of none.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
