//! `cargo xtask stability`: outcomes of bodies in extreme states, materials, steps and cuts, by method, precision and
//! backend.
//!
//! The matrix tests shape and finiteness, not accuracy: no value may ever be infinite or NaN, and each body that does
//! not return to its shape is explained. Rows: `extremes` and `cuts`; columns: `methods`.

mod cuts;
mod explain;
mod extremes;
mod methods;
mod outcome;
mod page;
mod picture;
mod rigid;
mod run;

use std::cell::OnceCell;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::ensure;
use incise::gpu::{GpuContext, GpuOptions};
use rayon::prelude::*;

use crate::experiment::{Backend, Cell, Experiment, ExperimentArguments};
use cuts::Cut;
use methods::Column;
use outcome::{Row, Verdict};

/// Runs the experiment. The columns of a row are measured in parallel, because there are no timings.
pub(crate) fn stability(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    experiment(arguments.quick, arguments.backend)?.run_and_check(arguments, check)
}

/// Checks conditions of all cells, independent of the verdict: finite, explained if not green, momentum conserved by
/// constraints.
///
/// # Errors
/// On the first outcome that violates one.
fn check(rows: &[Row]) -> anyhow::Result<()> {
    for row in rows {
        for outcome in &row.outcomes {
            ensure!(outcome.not_finite.is_none(), "{}: {outcome:?}", row.id);
            let is_fine = outcome.verdict(row.is_state) == Verdict::Fine;
            let is_explained = is_fine || explain::explain(row, outcome).is_some();
            ensure!(is_explained, "no explanation: {}: {outcome:?}", row.id);
            // Constraints keep momentum but for rounding, measured: 1e-5. VBD keeps it to the accuracy of its solution.
            let drift = outcome.momentum_drift.unwrap_or(0.0);
            let is_kept = !outcome.column.method.is_xpbd() || drift < 1e-3;
            ensure!(is_kept, "momentum: {}: {outcome:?}", row.id);
        }
    }
    Ok(())
}

/// A device that is opened by the first cell that needs it.
type Device = Rc<OnceCell<Arc<GpuContext>>>;

fn experiment(quick: bool, backend: Backend) -> anyhow::Result<Experiment<Row>> {
    let columns = Column::all(backend == Backend::Gpu);
    let device = Device::default();
    let mut cells = Vec::new();
    for extreme in extremes::extremes(quick)? {
        let (columns, device) = (columns.clone(), device.clone());
        cells.push(Cell::new(extreme.id.clone(), move || {
            let gpu = open(&device, backend)?;
            // A simulation always starts at rest.
            let is_state = extreme.gravity().is_none();
            let outcomes = columns.par_iter();
            let outcomes = outcomes.filter(|&&column| !is_state || column != Column::DEFAULTS);
            let outcomes = outcomes.map(|&column| run::run(&extreme, column, gpu));
            Ok(Row {
                id: extreme.id.clone(),
                name: extreme.name.clone(),
                is_state,
                outcomes: outcomes.collect::<anyhow::Result<_>>()?,
            })
        }));
    }
    // Thirty cuts leave thousands of slivers in a body of the quick form: minutes in the columns of many sweeps.
    let cuts = Cut::ALL.into_iter();
    for cut in cuts.filter(|&cut| !quick || !matches!(cut, Cut::AtRest(30) | Cut::UnderLoad(30))) {
        let (columns, device) = (columns.clone(), device.clone());
        cells.push(Cell::new(cut.id(), move || {
            let gpu = open(&device, backend)?;
            let outcomes = columns.par_iter();
            let outcomes = outcomes.map(|&column| cuts::run(cut, column, gpu, quick));
            Ok(Row {
                id: cut.id(),
                name: cut.name(quick),
                is_state: false,
                outcomes: outcomes.collect::<anyhow::Result<_>>()?,
            })
        }));
    }
    Ok(Experiment {
        name: "stability",
        cells,
        page: page::page,
    })
}

/// Device shared by all cells, if the backend is a GPU.
fn open(device: &Device, backend: Backend) -> anyhow::Result<Option<&Arc<GpuContext>>> {
    if backend == Backend::Cpu {
        return Ok(None);
    }
    if let Some(gpu) = device.get() {
        return Ok(Some(gpu));
    }
    let gpu = Arc::new(GpuContext::new(&GpuOptions::from_env())?);
    Ok(Some(device.get_or_init(|| gpu)))
}

#[cfg(test)]
mod tests;
