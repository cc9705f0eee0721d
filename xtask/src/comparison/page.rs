//! Page of the comparison: each system next to this solver.

use super::list::{PEERS, Peer};
use super::{Round, Row};
use crate::experiment::{Page, Part, Table};

const INTRODUCTION: &str = "\
Other systems beside our solver on the same beam of Kuhn cubes, with the same stiffness, density and substep of 1/1200 s, \
on one thread. Each is measured in turns with ours in the same precision; a time is the fastest of all rounds, a ratio \
that of both fastest, with the smallest and largest ratio of a round behind it. Ours solves clusters of ten tets (`pressure:10`) \
in split form, the defaults.

An iteration is a third of what a substep of four iterations takes more than one of one, a frame is 20 substeps of one. \
**Iterations of different methods are not worth the same**: energies, constraints and stopping rules differ, and no system \
here stops by a tolerance. The accuracy page has the error of our iterations. *Tip* is the position of the end of the \
beam after the run of each script, whose durations differ: it shows whether a run is plausible, not how accurate it \
is.";

pub(super) fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut times = Table::new(
        "Time on one thread",
        [
            "system",
            "version",
            "precision",
            "tets",
            "colors",
            "ms an iteration",
            "ns a tet",
            "ours: ms an iteration",
            "ratio to ours",
            "ms a frame",
            "ours: ms a frame",
            "ratio to ours",
            "tip in m",
        ],
    );
    let mut what = Table::new(
        "What is compared",
        ["system", "solves", "not the same as ours in", "note"],
    );
    for row in rows {
        let peer = PEERS.iter().find(|peer| peer.id == row.id);
        let Some(peer) = peer else { continue };
        if let Some(line) = line(peer, row) {
            times.push(line);
        }
        what.push([
            peer.id.to_owned(),
            peer.what.to_owned(),
            peer.caveat.to_owned(),
            note(row),
        ]);
    }
    let mut parts = vec![Part::Text(INTRODUCTION.to_owned())];
    if times.rows.is_empty() {
        parts.push(Part::Text("No other system could be run.".to_owned()));
    } else {
        parts.push(Part::Table(times));
    }
    parts.push(Part::Table(what));
    Ok(Page {
        title: "Other systems beside ours".to_owned(),
        parts,
    })
}

fn note(row: &Row) -> String {
    let last = row.rounds.last().map(|round| &round.peer);
    let said = last.and_then(|peer| peer.note.clone());
    let lost = last
        .is_some_and(|peer| peer.finite == Some(false) || peer.max_abs.is_some_and(|x| x > 2.0));
    let lost = lost.then(|| "the beam diverged: unstable at this substep".to_owned());
    let missing = row.missing.as_ref().map(|why| format!("not run: {why}"));
    let all = [missing, said, lost].into_iter().flatten();
    all.collect::<Vec<_>>().join("; ")
}

/// Times of a system; `None` if it was not run.
fn line(peer: &Peer, row: &Row) -> Option<[String; 13]> {
    let last = &row.rounds.last()?.peer;
    let of = |value: fn(&Round) -> Option<f64>| -> Option<Vec<f64>> {
        row.rounds.iter().map(value).collect()
    };
    let iteration = of(|round| Some(round.peer.ms_per_iter));
    let our_iteration = of(|round| Some(round.ours.ms_per_iter));
    let frame = of(|round| round.peer.ms_frame_20sub_1it);
    let our_frame = of(|round| Some(round.ours.ms_frame));
    let ms = |values: &Option<Vec<f64>>| {
        values
            .as_deref()
            .map_or("-".to_owned(), |v| format!("{:.3}", least(v)))
    };
    let per_tet = iteration
        .as_deref()
        .map(|v| least(v) * 1e6 / last.tets as f64);
    Some([
        peer.id.to_owned(),
        last.version.clone().unwrap_or_else(|| "-".to_owned()),
        last.precision.clone(),
        last.tets.to_string(),
        last.colors
            .map_or("-".to_owned(), |colors| colors.to_string()),
        ms(&iteration),
        per_tet.map_or("-".to_owned(), |ns| format!("{ns:.1}")),
        ms(&our_iteration),
        ratio(&iteration, &our_iteration),
        ms(&frame),
        ms(&our_frame),
        ratio(&frame, &our_frame),
        last.tip.map_or("-".to_owned(), |tip| format!("{tip:.4}")),
    ])
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Ratio of the times to those of this solver, by the fastest of each and per round.
fn ratio(theirs: &Option<Vec<f64>>, ours: &Option<Vec<f64>>) -> String {
    let (Some(theirs), Some(ours)) = (theirs, ours) else {
        return "-".to_owned();
    };
    let rounds = || theirs.iter().zip(ours).map(|(theirs, ours)| theirs / ours);
    let smallest = rounds().fold(f64::INFINITY, f64::min);
    let largest = rounds().fold(0.0, f64::max);
    let both = least(theirs) / least(ours);
    format!("{both:.1} ({smallest:.1} to {largest:.1})")
}

#[cfg(test)]
mod tests {
    use super::super::ours::Ours;
    use super::super::output::result;
    use super::*;

    fn round(theirs: f64, ours: f64) -> Round {
        let text = format!(
            "{{\"peer\":\"x\",\"tets\":1000,\"precision\":\"f32\",\"ms_per_iter\":{theirs},\"max_abs\":9.0}}"
        );
        Round {
            peer: result(&text).unwrap(),
            ours: Ours {
                tets: 1000,
                colors: 5,
                ms_per_iter: ours,
                ms_frame: 20.0 * ours,
            },
        }
    }

    /// Each system is in the table: with its ratios if it ran, otherwise with the reason.
    #[test]
    fn every_system_is_on_the_page() {
        let mut rows: Vec<Row> = PEERS
            .iter()
            .map(|peer| Row {
                id: peer.id.to_owned(),
                missing: Some("no package".to_owned()),
                rounds: Vec::new(),
            })
            .collect();
        rows[0].missing = None;
        rows[0].rounds = vec![round(0.04, 0.01), round(0.06, 0.02)];
        let page = page(&rows).unwrap();
        let tables: Vec<&Table> = page
            .parts
            .iter()
            .filter_map(|part| match part {
                Part::Table(table) => Some(table),
                _ => None,
            })
            .collect();
        let [times, what] = tables[..] else {
            panic!("two tables")
        };
        assert_eq!(times.rows.len(), 1);
        assert_eq!(times.rows[0][6], "40.0");
        assert_eq!(times.rows[0][8], "4.0 (3.0 to 4.0)");
        assert_eq!(times.rows[0][11], "-");
        assert_eq!(what.rows.len(), PEERS.len());
        assert!(what.rows[0][3].contains("unstable"));
        assert_eq!(what.rows[1][3], "not run: no package");
    }
}
