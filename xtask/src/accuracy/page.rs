//! Page of `cargo xtask accuracy`, generated from the rows alone: sentences by parameter, and for each scene a plot,
//! the Pareto-optimal settings, and all settings.

use incise::advise::non_dominated;

use super::{ExchangeRow, SceneRow, SettingRow};
use crate::experiment::{Axis, Page, Part, Plot, Series, Style, Table};
use crate::solver::digits;

/// Largest plotted error, in % of the body's size.
const USELESS: f64 = 100.0;

pub(super) fn page(rows: &[SceneRow]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(INTRODUCTION.to_owned()), references(rows)];
    parts.push(Part::Text(format!(
        "## Effect of each setting\n\nOver all scenes: the median, and in brackets the smallest and the largest. n is the number of substeps that brings kappa to 0.5. Errors of {USELESS} % and more count as lost.\n\n{}\n",
        knobs(rows).join("\n")
    )));
    parts.push(Part::Text("## One large step, iterated".to_owned()));
    parts.push(Part::Text(large_step(rows)));
    for row in rows.iter().filter(|row| !row.large.is_empty()) {
        parts.push(Part::Plot(large_plot(row)));
    }
    for row in rows {
        scene(row, &mut parts);
    }
    Ok(Page {
        title: "Speed and accuracy".to_owned(),
        parts,
    })
}

const INTRODUCTION: &str = "Errors of positions are root mean square distances of all particles from the reference, \
in % of the longest side of the body; *largest* is the largest of all frames, *at the end* that of the last one; *of \
the motion*, \
which is what `accuracy` bounds, is that of all frames together, in % of the distance of the particles from their start. \
The error of the volume is the largest of all frames, in % of the volume at rest. The reference is computed for the \
same tets, so errors of the mesh do not count: implicit Euler by Newton's method with sparse Cholesky factorizations \
in double precision, at three step sizes, extrapolated to small steps. Times are of whole frames of 1/60 s on \
one thread, or on a GPU, including the readback of the positions. Settings are measured in turns for three rounds, \
and the fastest time of each frame counts. A press is a prescribed motion of held particles and a cut is made before \
anything moves, because the reference supports neither contacts nor later cuts. The layers are two bodies joined by \
distances; in the reference they are one body.";

/// Accuracy of the references.
fn references(rows: &[SceneRow]) -> Part {
    let mut table = Table::new(
        "The references: estimate of their own error, and order of convergence of implicit Euler",
        [
            "scene",
            "tets",
            "n",
            "steps a frame",
            "errors of the three runs in %",
            "order",
            "left, positions in %",
            "left, volume in %",
        ],
    );
    for row in rows {
        let reference = &row.reference;
        table.push([
            row.title.clone(),
            row.tets.to_string(),
            row.substeps.to_string(),
            reference.steps.map(|n| n.to_string()).join(", "),
            reference.errors.map(|e| digits(e.largest)).join(", "),
            digits(reference.order),
            digits(reference.left.largest),
            digits(reference.left.volume),
        ]);
    }
    Part::Table(table)
}

/// One sentence for each exchange, in the order of the first scene, with a heading for each parameter.
fn knobs(rows: &[SceneRow]) -> Vec<String> {
    let mut sentences: Vec<String> = Vec::new();
    let mut last = "";
    for exchange in rows.first().map_or(&[][..], |row| &row.exchanges) {
        let Some(sentence) = sentence(rows, exchange) else {
            continue;
        };
        if last != exchange.knob {
            sentences.push(format!("\n**{}**\n", exchange.knob));
            last = &exchange.knob;
        }
        sentences.push(sentence);
    }
    sentences
}

/// Describes the effect of changing a parameter in all scenes; `None` if no scene has both settings.
pub(super) fn sentence(rows: &[SceneRow], exchange: &ExchangeRow) -> Option<String> {
    let (mut errors, mut times) = (Vec::new(), Vec::new());
    let (mut lost, mut saved) = (0, 0);
    for row in rows {
        let same = row
            .exchanges
            .iter()
            .find(|other| other.what == exchange.what);
        let ends = same.and_then(|e| Some((find(row, &e.from)?, find(row, &e.to)?)));
        let Some((from, to)) = ends else { continue };
        times.push(to.ms / from.ms);
        match (from.error.largest < USELESS, to.error.largest < USELESS) {
            (true, true) => errors.push(to.error.largest / from.error.largest),
            (true, false) => lost += 1,
            (false, true) => saved += 1,
            (false, false) => {}
        }
    }
    if times.is_empty() {
        return None;
    }
    let mut text = format!("- {}:", exchange.what);
    if let Some([low, median, high]) = spread(&mut errors) {
        let verb = match median {
            ..0.98 => "lowers the error to",
            ..1.02 => "leaves the error at",
            _ => "raises the error to",
        };
        text += &format!(
            " {verb} {} times ({} to {})",
            digits(median),
            digits(low),
            digits(high)
        );
    } else {
        text += " no scene has a usable motion before and after";
    }
    if let Some([low, median, high]) = spread(&mut times) {
        text += &format!(
            ", for {} times the time ({} to {})",
            digits(median),
            digits(low),
            digits(high)
        );
    }
    if lost > 0 {
        text += &format!("; {lost} of {} scenes are lost", times.len());
    }
    if saved > 0 {
        text += &format!("; {saved} of {} scenes are saved", times.len());
    }
    Some(text + ".")
}

fn find<'a>(row: &'a SceneRow, name: &str) -> Option<&'a SettingRow> {
    row.settings.iter().find(|setting| setting.name == name)
}

/// Smallest, median and largest value.
fn spread(values: &mut [f64]) -> Option<[f64; 3]> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    let middle = |n: usize| 0.5 * (values[(n - 1) / 2] + values[n / 2]);
    (n > 0).then(|| [values[0], middle(n), values[n - 1]])
}

/// Result of one step per frame, from its last rows.
fn large_step(rows: &[SceneRow]) -> String {
    let mut text = "XPBD drops a part of the equations of motion, so with one substep a frame its iterations do not lead to \
        the solution of that step; vbd with coarse correction solves the same step. Distances from the solution of \
        the step by Newton's method in double precision:\n\n"
        .to_owned();
    for row in rows {
        let Some(last) = row.large.last() else {
            continue;
        };
        let first = &row.large[0];
        let vbd = row
            .large
            .iter()
            .rev()
            .find_map(|l| Some((l.iterations, l.vbd?)));
        text += &format!(
            "- {}: XPBD is {} % off after {} iteration and {} % after {}",
            row.title,
            digits(first.xpbd.largest),
            first.iterations,
            digits(last.xpbd.largest),
            last.iterations
        );
        if let Some((rounds, vbd)) = vbd {
            text += &format!(
                "; vbd is {} % off after {rounds} rounds",
                digits(vbd.largest)
            );
        }
        text += ".\n";
    }
    text
}

fn large_plot(row: &SceneRow) -> Plot {
    let points = |error: fn(&super::LargeRow) -> Option<f64>| {
        let points = row.large.iter();
        points
            .filter_map(|l| Some((f64::from(l.iterations), error(l)?)))
            .collect()
    };
    let series = |name: &str, points| Series {
        name: name.to_owned(),
        points,
        labels: Vec::new(),
        style: Style::Both,
    };
    let mut all = vec![series("XPBD", points(|l| Some(l.xpbd.largest)))];
    let vbd: Vec<_> = points(|l| Some(l.vbd?.largest));
    if !vbd.is_empty() {
        all.push(series("vbd with coarse correction", vbd));
    }
    Plot {
        title: format!("{}: one step a frame", row.title),
        x: Axis::log("iterations"),
        y: Axis::log("distance from the step by Newton's method in %"),
        series: all,
    }
}

fn scene(row: &SceneRow, parts: &mut Vec<Part>) {
    parts.push(Part::Text(format!("## {}", row.title)));
    let front = front(row);
    parts.push(Part::Plot(plot(row, &front)));
    let mut table = Table::new(
        format!(
            "Settings that no other one dominates ({} tets, {} frames, n = {})",
            row.tets, row.frames, row.substeps
        ),
        HEADER,
    );
    for &i in &front {
        table.push(cells(&row.settings[i]));
    }
    parts.push(Part::Table(table));
    let mut table = Table::new("All settings", HEADER);
    for setting in &row.settings {
        table.push(cells(setting));
    }
    parts.push(Part::Table(table));
    if !row.refused.is_empty() {
        let refused = row.refused.join("\n- ");
        parts.push(Part::Text(format!(
            "This scene cannot be run with:\n\n- {refused}\n"
        )));
    }
}

/// Indices of the Pareto-optimal settings. Errors below the error of the reference count as equal to it.
pub(super) fn front(row: &SceneRow) -> Vec<usize> {
    let floor = row.reference.left.largest;
    let point = |s: &SettingRow| [s.ms, s.error.largest.max(floor)];
    let points: Vec<[f64; 2]> = row.settings.iter().map(point).collect();
    non_dominated(&points)
}

const HEADER: [&str; 6] = [
    "setting",
    "ms a frame",
    "error, of the motion, in %",
    "error, largest, in %",
    "at the end",
    "of the volume",
];

fn cells(setting: &SettingRow) -> [String; 6] {
    let error = setting.error;
    [
        setting.name.clone(),
        digits(setting.ms),
        digits(error.motion),
        digits(error.largest),
        digits(error.end),
        digits(error.volume),
    ]
}

fn plot(row: &SceneRow, front: &[usize]) -> Plot {
    let drawn = |s: &&SettingRow| s.error.largest < USELESS;
    let point = |s: &SettingRow| (s.ms, s.error.largest);
    let mut curves: Vec<&str> = Vec::new();
    for setting in &row.settings {
        if !curves.contains(&setting.curve.as_str()) {
            curves.push(&setting.curve);
        }
    }
    let useful = |&&i: &&usize| row.settings[i].error.largest < USELESS;
    let front: Vec<&SettingRow> = front
        .iter()
        .filter(useful)
        .map(|&i| &row.settings[i])
        .collect();
    let mut series = vec![Series {
        name: "not dominated".to_owned(),
        points: front.iter().map(|s| point(s)).collect(),
        labels: front.iter().map(|s| s.name.clone()).collect(),
        style: Style::Both,
    }];
    for curve in curves {
        let points = row
            .settings
            .iter()
            .filter(|s| s.curve == curve)
            .filter(drawn);
        series.push(Series {
            name: curve.to_owned(),
            points: points.map(point).collect(),
            labels: Vec::new(),
            style: if curve.starts_with("substeps") || curve == "accuracy" {
                Style::Both
            } else {
                Style::Points
            },
        });
    }
    series.retain(|series| !series.points.is_empty());
    Plot {
        title: row.title.clone(),
        x: Axis::log("ms a frame"),
        y: Axis::log("largest error of positions in % of the size"),
        series,
    }
}
