//! Claims of the paper and their verdicts: each claim has a rule, decided from the rows of the tables and figures.
//!
//! Existing cells of the tables are used, missing ones measured. The rules apply to the implementations of the paper's
//! methods in this project, on a processor.

pub(super) mod rules;

use std::fs;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{fig4, fig7, fig8, fig11, table1, table2};
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part, Table};

/// A row of another experiment.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Evidence {
    Table1(table1::Row),
    Table2(table2::Row),
    Fig4(fig4::Row),
    Fig7(fig7::Row),
    Fig8(fig8::Row),
    Fig11(fig11::Row),
}

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Confirmed,
    Depends,
    NotConfirmed,
}

impl Verdict {
    /// Confirmed if all cases hold, not confirmed if none does, otherwise partly.
    fn of(holds: &[bool]) -> Self {
        match holds.iter().filter(|&&holds| holds).count() {
            0 => Self::NotConfirmed,
            count if count == holds.len() => Self::Confirmed,
            _ => Self::Depends,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Confirmed => "confirmed",
            Self::Depends => "depends",
            Self::NotConfirmed => "not confirmed",
        }
    }
}

/// A claim with its verdict.
pub(super) struct Claim {
    pub(super) claim: &'static str,
    rule: &'static str,
    pub(super) verdict: Verdict,
    measured: String,
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Evidence> {
    let mut cells = Vec::new();
    // In shards each would measure cells that another shard has; the page is made when all cells exist.
    if arguments.shard.is_none() {
        take(
            &mut cells,
            arguments,
            table1::experiment(arguments),
            Evidence::Table1,
        );
        take(
            &mut cells,
            arguments,
            table2::experiment(arguments),
            Evidence::Table2,
        );
        take(
            &mut cells,
            arguments,
            fig4::experiment(arguments),
            Evidence::Fig4,
        );
        take(
            &mut cells,
            arguments,
            fig7::experiment(arguments),
            Evidence::Fig7,
        );
        take(
            &mut cells,
            arguments,
            fig8::experiment(arguments),
            Evidence::Fig8,
        );
        take(
            &mut cells,
            arguments,
            fig11::experiment(arguments),
            Evidence::Fig11,
        );
    }
    Experiment {
        name: "paper-claims",
        cells,
        page,
    }
}

/// The part of a cell's file that is a row.
#[derive(Deserialize)]
struct Done<R> {
    row: R,
}

/// Adds the cells of an experiment, which reuse its measurements where they exist.
fn take<R: DeserializeOwned + 'static>(
    cells: &mut Vec<Cell<Evidence>>,
    arguments: &ExperimentArguments,
    experiment: Experiment<R>,
    wrap: fn(R) -> Evidence,
) {
    let name = experiment.name.trim_start_matches(super::PREFIX);
    for cell in experiment.cells {
        let file = arguments.out.join("cells").join(experiment.name);
        let file = file.join(format!("{}.json", cell.id));
        cells.push(Cell::new(format!("{name}-{}", cell.id), move || {
            Ok(wrap(match fs::read_to_string(&file) {
                Ok(text) => serde_json::from_str::<Done<R>>(&text)?.row,
                Err(_) => (cell.measure)()?,
            }))
        }));
    }
}

fn page(rows: &[Evidence]) -> anyhow::Result<Page> {
    let mut table = Table::new("", ["claim", "found", "rule", "measured"]);
    for claim in rules::claims(rows) {
        table.push([
            claim.claim.to_owned(),
            claim.verdict.words().to_owned(),
            claim.rule.to_owned(),
            claim.measured,
        ]);
    }
    Ok(Page {
        title: "The paper's claims".to_owned(),
        parts: vec![
            Part::Text(
                "Decided by code from the rows of the other pages: confirmed where the rule holds in all cases, not confirmed where \
                 in none, else it depends. All of it is measured on one thread of a processor, the paper's on a GPU: a claim \
                 about time that is not confirmed here may hold there."
                    .to_owned(),
            ),
            Part::Table(table),
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_count_cases() {
        assert_eq!(Verdict::of(&[true, true]), Verdict::Confirmed);
        assert_eq!(Verdict::of(&[true, false]), Verdict::Depends);
        assert_eq!(Verdict::of(&[false]), Verdict::NotConfirmed);
        // No cases confirm nothing.
        assert_eq!(Verdict::of(&[]), Verdict::NotConfirmed);
    }
}
