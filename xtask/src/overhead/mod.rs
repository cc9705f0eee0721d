//! `cargo xtask overhead`: cost of features that a scene does not use.
//!
//! Each feature is declared in an otherwise bare scene, once idle and once in use, in two sizes. The page lists the
//! differences to the bare scene: instructions, branches, bytes, and device traffic. The bare scene itself is compared
//! with a handwritten loop over the solver alone, which has no features of the library.

mod callgrind;
mod features;
mod measure;
mod page;
mod probe;

use clap::Args;
use serde::{Deserialize, Serialize};

use crate::experiment::{Cell, Experiment, ExperimentArguments};
use features::{Case, State, cases};
use measure::{Gpu, Measured, measure};
use probe::Way;
pub(crate) use probe::{ProbeArguments, probe};

#[derive(Debug, Args)]
pub(crate) struct OverheadArguments {
    #[command(flatten)]
    experiment: ExperimentArguments,
    /// Leave out what valgrind counts.
    #[arg(long)]
    no_valgrind: bool,
}

/// A scene in all sizes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    feature: String,
    state: String,
    /// Feature whose base this is compared with.
    base: String,
    what: String,
    /// Version of valgrind, if instructions were counted.
    valgrind: Option<String>,
    /// By ascending size.
    sizes: Vec<Measured>,
}

impl Row {
    fn id(&self) -> String {
        features::id(&self.feature, &self.state)
    }
}

/// Bare scene as a handwritten loop, and that loop without a body.
const BY_HAND: [(Way, &str); 2] = [
    (Way::Hand, "the solver alone"),
    (Way::Empty, "the solver alone, without a body"),
];

#[expect(
    clippy::print_stderr,
    reason = "missing measurements are announced before the run"
)]
pub(crate) fn overhead(arguments: &OverheadArguments) -> anyhow::Result<()> {
    let valgrind = match arguments.no_valgrind {
        true => None,
        false => callgrind::version(),
    };
    if valgrind.is_none() && !arguments.no_valgrind {
        eprintln!(
            "valgrind is not installed (Debian: apt-get install valgrind): instructions are not counted, only bytes, \
            allocations and data sent to a GPU"
        );
    }
    experiment(arguments.experiment.quick, &valgrind).run(&arguments.experiment)
}

/// Runs this experiment as part of `all`.
pub(crate) fn run(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    overhead(&OverheadArguments {
        experiment: arguments.clone(),
        no_valgrind: false,
    })
}

fn experiment(quick: bool, valgrind: &Option<String>) -> Experiment<Row> {
    // Quick: the smallest sizes that distinguish a constant from a cost per element.
    let tets: &'static [usize] = if quick { &[200, 400] } else { &[800, 3200] };
    let gpu = Gpu::default();
    let mut cells = Vec::new();
    let cases = cases();
    let bare = cases[0];
    let all = BY_HAND.map(|(way, what)| (Case { what, ..bare }, way));
    let all = all
        .into_iter()
        .chain(cases.into_iter().map(|case| (case, Way::Facade)));
    for (case, way) in all {
        let (gpu, valgrind) = (gpu.clone(), valgrind.clone());
        let feature = match way {
            Way::Facade => case.feature,
            Way::Hand | Way::Empty => way.name(),
        };
        let id = match way {
            Way::Facade => case.id(),
            Way::Hand | Way::Empty => format!("by-{feature}"),
        };
        cells.push(Cell::new(id, move || {
            let whole = !quick || of_a_quick_run(&case);
            let count = valgrind.is_some() && whole;
            let gpu = whole.then_some(&gpu);
            let measured = tets
                .iter()
                .map(|&tets| measure(&case.scene(tets), way, count, gpu));
            Ok(Row {
                feature: feature.to_owned(),
                state: case.state.name().to_owned(),
                base: case.base.to_owned(),
                what: case.what.to_owned(),
                valgrind: valgrind.clone(),
                sizes: measured.collect::<anyhow::Result<_>>()?,
            })
        }));
    }
    Experiment {
        name: "overhead",
        cells,
        page: page::page,
    }
}

/// True if a quick run counts the instructions and device traffic of the case; bytes are counted for all cases.
fn of_a_quick_run(case: &Case) -> bool {
    case.state == State::Base || ["gravity", "attachment"].contains(&case.feature)
}

#[cfg(test)]
mod tests;
