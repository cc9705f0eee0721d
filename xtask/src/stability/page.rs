//! Page of the matrix: an image, a table in words, recovery times by method, and explanations.

use super::explain::explain;
use super::methods::{Column, Method};
use super::outcome::{Color, Outcome, Row, Verdict};
use super::picture;
use crate::experiment::{Page, Part, Table};

const INTRODUCTION: &str = "\
A beam of 1 m × 0.25 m × 0.25 m, E = 1e6 Pa, Poisson's ratio 0.45, with one thing changed in each row. Extremes of state \
are left alone without gravity, one end held or none; all others are held at one end and fall from rest. Those of cutting \
are scenes with a softer beam (E = 1e4 Pa), in which everything is recomputed and compared after each stroke.

*default* is a simulation with an empty `[solver]` table, which chooses method, substeps and precision; `warned` means \
that it gave a warning. A simulation starts at rest, so this column has no extremes of state. *split* is XPBD in split \
form by as many substeps of one iteration as bring kappa to 0.5, at most 200, nothing softened; *softened* is the block form with the same substeps, tets that are still too stiff softened to kappa 1. \
All others take a frame in one step of 20 iterations: *block*, XPBD in \
block form; *paper*, one constraint of a tet after the other, relaxation 0.8, clusters of 10; *Jacobi* and *Chebyshev* \
(spectral radius 0.9) with relaxation 0.1; *vbd*, 20 sweeps; *corrected*, 5 sweeps, a correction of the whole body after each.

After every frame positions, velocities, energies and volumes are checked. Green: in shape. Yellow: `3 inverted`, tets \
that are, at most 2 %; `volume 1.07`, over that at rest; `energy 3e1`, its ratio to the energy at the start (elastic \
energy, and the work of gravity over the length of the body); `bent 20 %`, root of the mean squared \
distance from the shape at rest, up to a rigid motion, over the length of the body; `7 repaired`, particles that would \
not have been finite and were put back. Red: more tets inverted; `collapsed 0.2`, less than half the volume or more than \
twice; `frozen`, nothing moved; yellow too: `refused`, a value is out of its range; `NOT FINITE`. The table does not measure accuracy.";

pub(super) fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![
        Part::Text(INTRODUCTION.to_owned()),
        Part::Text(summary(rows)),
        Part::Picture {
            caption: "The matrix".to_owned(),
            svg: picture::draw(rows),
        },
        Part::Table(words(rows)),
        Part::Text(reasons(rows)),
        Part::Table(recovery(rows)),
        Part::Table(methods(rows)),
    ];
    parts.retain(|part| !matches!(part, Part::Text(text) if text.is_empty()));
    Ok(Page {
        title: "Stability at the extremes".to_owned(),
        parts,
    })
}

fn all(rows: &[Row]) -> impl Iterator<Item = (&Row, &Outcome)> {
    let outcomes = |row| {
        let row: &Row = row;
        row.outcomes.iter().map(move |outcome| (row, outcome))
    };
    rows.iter().flat_map(outcomes)
}

/// Summary of all rows.
fn summary(rows: &[Row]) -> String {
    let count = all(rows).count();
    let infinite = all(rows).filter(|(_, o)| o.not_finite.is_some()).count();
    let colored = |color| {
        let verdicts = all(rows).map(|(row, o)| o.verdict(row.is_state));
        verdicts.filter(|v| v.color() == color).count()
    };
    let frames: usize = all(rows).map(|(_, o)| o.frames).sum();
    format!(
        "Of {count} runs of {frames} frames in all **{infinite}** had a number that was not finite. {} are green, {} \
         yellow, {} red.",
        colored(Color::Green),
        colored(Color::Yellow),
        colored(Color::Red)
    )
}

/// Outcomes by row and method, with equal ones merged.
fn words(rows: &[Row]) -> Table {
    let head = Method::ALL.iter().map(|method| method.name());
    let mut table = Table::new("In words", ["extreme"].into_iter().chain(head));
    for row in rows {
        let cells = Method::ALL.map(|method| {
            let said: Vec<(Column, String)> = row
                .outcomes
                .iter()
                .filter(|outcome| outcome.column.method == method)
                .map(|outcome| (outcome.column, outcome.words(row.is_state)))
                .collect();
            if said.iter().all(|(_, words)| *words == said[0].1) {
                said.first()
                    .map_or("–".to_owned(), |(_, words)| words.clone())
            } else {
                let said = said
                    .iter()
                    .map(|(column, words)| format!("{} {words}", column.place()));
                said.collect::<Vec<_>>().join("; ")
            }
        });
        table.push([row.name.clone()].into_iter().chain(cells));
    }
    table
}

/// Outcomes that are not green, by explanation.
fn reasons(rows: &[Row]) -> String {
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for (row, outcome) in all(rows) {
        if outcome.verdict(row.is_state) == Verdict::Fine {
            continue;
        }
        let text = explain(row, outcome).map_or("**Not explained.**", |e| e.text);
        let cell = format!("{} ({})", row.name, outcome.column.method.name());
        match reasons.iter_mut().find(|(known, _)| *known == text) {
            Some((_, cells)) if cells.contains(&cell) => {}
            Some((_, cells)) => cells.push(cell),
            None => reasons.push((text, vec![cell])),
        }
    }
    let list = reasons
        .iter()
        .map(|(text, cells)| format!("- {text}\n  *Seen in:* {}.\n", cells.join("; ")));
    format!(
        "## Reasons for results that are not green\n\n{}",
        list.collect::<String>()
    )
}

/// Recovery times of bodies that start deformed, and their distance from the rest shape at the end.
fn recovery(rows: &[Row]) -> Table {
    let head = Method::ALL.iter().map(|method| method.name());
    let caption = "Recovery in double precision: seconds until no tet is inverted and the volume is right for good, and \
        the distance from the shape at rest at the end, in % of the length";
    let mut table = Table::new(caption, ["state"].into_iter().chain(head));
    for row in rows.iter().filter(|row| row.is_state) {
        let cells = Method::ALL.map(|method| {
            let of_method = |o: &&Outcome| o.column.method == method && o.column.place() == "f64";
            let outcome = row.outcomes.iter().find(of_method);
            outcome.map_or("–".to_owned(), |outcome| {
                let time = match outcome.in_shape_from {
                    Some(time) => format!("{time:.2} s"),
                    None => "never".to_owned(),
                };
                let distance = outcome.distance.map(|d| format!(", {:.1} %", 100.0 * d));
                time + &distance.unwrap_or_default()
            })
        });
        table.push([row.name.clone()].into_iter().chain(cells));
    }
    table
}

/// Worst verdict of each column.
fn methods(rows: &[Row]) -> Table {
    let mut table = Table::new(
        "By method",
        [
            "method",
            "green",
            "yellow",
            "red",
            "largest rise of energy",
            "largest drift of momentum",
            "repaired",
            "most softened tets",
        ],
    );
    for column in Row::columns(rows) {
        let mine = || all(rows).filter(|(_, o)| o.column == column);
        let colored = |color| {
            let verdicts = mine().map(|(row, o)| o.verdict(row.is_state));
            verdicts.filter(|v| v.color() == color).count().to_string()
        };
        let largest = |value: &dyn Fn(&Outcome) -> f64| {
            let largest = mine().map(|(_, o)| value(o)).fold(0.0, f64::max);
            format!("{largest:.0e}")
        };
        table.push([
            format!("{}, {}", column.method.name(), column.place()),
            colored(Color::Green),
            colored(Color::Yellow),
            colored(Color::Red),
            largest(&|o| o.energy_rise),
            largest(&|o| o.momentum_drift.unwrap_or(0.0)),
            mine().map(|(_, o)| o.repaired).sum::<usize>().to_string(),
            mine()
                .map(|(_, o)| o.softened)
                .max()
                .unwrap_or(0)
                .to_string(),
        ]);
    }
    table
}
