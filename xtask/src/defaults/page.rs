//! Page of the experiment: counts of misses, then a table for each part.

use super::cut::{LoadRow, RestRow, Strokes};
use super::newton::{Load, NewtonRow};
use super::organ::OrganRow;
use super::{Row, Warned};
use crate::experiment::{Page, Part, Table};

/// Largest error without a warning.
const BAR: f64 = 0.1;
/// Warning about vibrations, and the largest error that their damping explains.
const DAMPED: &str = "vibrations_damped";
const ALL_OF_IT: f64 = 1.0;

const INTRODUCTION: &str = "\
Scenes with default settings: no key of `[solver]` is set, unless a table says so. A result that misses its bar is printed \
in bold and listed below. The text describes the full form; `--quick` runs fewer and smaller bodies.";

const NEWTON: &str = "\
## Default scenes against Newton

Bodies of 300 tets, longest side 0.2 m, density 1000 kg/m³, no damping, frames of 0.016 s.

- *Hanging*: held at the end of smallest x (15% of the length), gravity from the first frame on, 9.81 m/s² for \
E of at least 5e5 Pa and E / 5e5 Pa times that below, since softer bodies of this size collapse under their weight.
- *Pressed*: no gravity. The block and the liver are held at the bottom, a rigid handle moves the top down by 10% of the \
height; the beam is held at one end, a handle moves the other end down by 10% of the length. The handle's path is smooth \
and takes two periods of the slowest vibration, at least four frames.
- *Spinning*: free, no gravity, rigid rotation about z at the start, at √(0.24 E/ρ)/0.2 m and at most 10 rad/s.

*Settled*: mean positions over six periods and at least 48 frames (Hann window), since a default scene is not damped, against \
the equilibrium by Newton's method. The mean of a large swing can differ from the equilibrium. *Motion*: hanging, two periods from rest; pressed, the handle's motion and one more \
period; spinning, one turn; at least four frames. The reference is implicit Euler at 24 or more steps a period (at most 24 a \
frame), twice and four times as many, extrapolated twice; where the last extrapolation changed it by more than 2% of the \
motion the cell states that as \"ref ±\". Where a period is far below a frame (E = 1e9 Pa, pressed bodies from 1e7 Pa on) the \
reference damps the vibrations too, and what is compared is the slow motion. Error: root of the mean squared distance of all free particles, over that of the \
displacement, for the motion at least over that of the equilibrium, since frames may meet a vibration where it comes back to \
its start. The reference has the same mesh and energy, so the error of the mesh does not count.

Left out to keep the command below some ten minutes on two cores: E of 1e4, 1e6 and 1e8 Pa, Poisson's ratio 0.499.

Bar: at most 10%, or a warning that explains it: `vibrations_damped` explains no error of a settled state or of a turn, and \
none above 100%. Warnings are printed by code; **no warning** marks a miss.";

const ORGAN: &str = "\
## A stiff organ

A generated liver of 11,000 tets and 0.2 m, E = 1e7 Pa, Poisson's ratio 0.49, density 1000 kg/m³, under gravity. Its lowest \
tenth along x is held, a handle pulls its highest tenth by 3 cm in 30 frames of 0.01 s and then holds it; *cut*: from then on \
a blade is swept through three quarters of its height at six places, four frames each. Only the accuracy is given. Time: all \
threads, each frame the fastest of three runs, median of the frames of the pull but the first two, the slowest frame that cuts, the median of the last 20 of 60 \
frames. Error: of all 60 frames, root of the mean squared distance over that of the displacement, against 8 converged \
substeps a frame; those are off by about what 4 substeps differ from 8, stated as \"ref ±\". With strokes the particles of the \
uncut organ are compared; the reference is cut by its own motion, so that a few of its particles lie on the other side of a cut.

Bars: the error is at most the accuracy; with an accuracy of 5%, a frame of the pull without strokes takes 8 ms and the \
slowest frame that cuts 16 ms, whatever the machine.";

const LOAD: &str = "\
## Bodies under load after cuts

A generated liver of 11,000 tets and 0.25 m, Poisson's ratio 0.45, falls on a ground (friction 0.5) while 20 random \
rectangles cut it with a snap of 0.1 (the default) or 0, which leaves slivers thinner by orders, one in each of the first 20 frames; 120 frames of 0.01 s. *Before*: the ground is \
0.25 m below, so all strokes are made in free fall and the load follows. *During*: it is 0.05 m below, so half of the strokes \
cut the body while the ground deforms it. Precision and substeps are given, all else is default. At 1e3 Pa the body \
collapses under its weight.

Energy bounded: no particle put back, no divergence reported, kinetic energy in the last 50 frames, after the impact, less than what \
gravity has released. Bar: energy bounded, 0 softened tets. Speeds bounded, which is \
not part of the bar: the fastest particle is below ten times, and in the last 50 frames below three times, the speed of a \
fall from the top of the body to the ground. It is a corner of a sliver of some micrograms: where a substep does not \
resolve its stiffness, it is thrown back by its own size in a substep.";

const REST: &str = "\
## Bodies at rest after 30 strokes

Free bodies of 0.25 m, E = 1e5 Pa, no gravity. Thirty random rectangles cut them, one a frame; then they are left alone for \
500 frames. Bar: fastest particle below 1e-9 m/s in double and 1e-2 m/s in single precision, in the last 100 frames at \
most twice as fast as in the first 100, 0 inverted tets.";

pub(super) fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let (mut newton, mut organs) = (vec![], vec![]);
    let (mut load, mut rest, mut skipped) = (vec![], vec![], vec![]);
    for row in rows {
        match row {
            Row::Newton(rows) => newton.extend(rows),
            Row::Organ(row) => organs.push(row),
            Row::Load(rows) => load.extend(rows),
            Row::Rest(rows) => rest.extend(rows),
            Row::Skipped(name) => skipped.push(name),
        }
    }
    let mut parts = vec![
        Part::Text(INTRODUCTION.to_owned()),
        Part::Table(summary(&newton, &organs, &load, &rest)),
        Part::Text(misses(&newton, &organs, &load, &rest)),
    ];
    if !newton.is_empty() {
        parts.push(Part::Text(NEWTON.to_owned()));
        parts.extend(newton_tables(&newton));
    }
    if !organs.is_empty() {
        parts.push(Part::Text(ORGAN.to_owned()));
        parts.push(Part::Table(organ_table(&organs)));
    }
    if !load.is_empty() {
        parts.push(Part::Text(LOAD.to_owned()));
        parts.push(Part::Table(load_table(&load)));
    }
    if !rest.is_empty() || !skipped.is_empty() {
        parts.push(Part::Text(REST.to_owned()));
    }
    let mut table = rest_table(&rest);
    for name in skipped {
        let mut cells = vec![name.clone(), "skipped: no mesh, see --models".to_owned()];
        cells.resize(table.header.len(), "-".to_owned());
        table.push(cells);
    }
    if !table.rows.is_empty() {
        parts.push(Part::Table(table));
    }
    Ok(Page {
        title: "What default settings give".to_owned(),
        parts,
    })
}

/// Comparison of an error with the limit.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Standing {
    Within,
    Warned,
    Missed,
}

fn standing(error: f64, warned: &Warned) -> Standing {
    if error <= BAR {
        Standing::Within
    } else if warned.is_empty() {
        Standing::Missed
    } else {
        Standing::Warned
    }
}

/// Warnings of a row that explain an error of its motion.
fn reasons_for_motion(row: &NewtonRow) -> Warned {
    match row.load {
        Load::Hanging | Load::Pressed if row.motion <= ALL_OF_IT => row.warned.clone(),
        // A revolution is not a vibration; a vibration that is damped away has an error of its own.
        _ => reasons_for_state(row),
    }
}

/// Warnings of a row that explain an error of a settled state. Damped vibrations settle at the state of undamped ones.
fn reasons_for_state(row: &NewtonRow) -> Warned {
    let mut warned = row.warned.clone();
    warned.remove(DAMPED);
    warned
}

fn load_passes(row: &LoadRow) -> bool {
    row.is_bounded() && row.softened == 0
}

fn summary(
    newton: &[&NewtonRow],
    organs: &[&OrganRow],
    load: &[&LoadRow],
    rest: &[&RestRow],
) -> Table {
    let header = [
        "",
        "results",
        "within the bar",
        "over, with a warning",
        "missed",
    ];
    let mut table = Table::new("Results by part", header);
    let mut add = |name: &str, standings: Vec<Standing>| {
        // Only another part of the page was requested.
        if standings.is_empty() {
            return;
        }
        let count = |of| standings.iter().filter(|&&s| s == of).count();
        let missed = match count(Standing::Missed) {
            0 => "0".to_owned(),
            missed => format!("**{missed}**"),
        };
        table.push([
            name.to_owned(),
            standings.len().to_string(),
            count(Standing::Within).to_string(),
            count(Standing::Warned).to_string(),
            missed,
        ]);
    };
    for load in Load::ALL {
        let of = || newton.iter().filter(|row| row.load == load);
        let settled = of().filter_map(|row| Some(standing(row.settled?, &reasons_for_state(row))));
        let settled: Vec<Standing> = settled.collect();
        if !settled.is_empty() {
            add(&format!("{}, settled", load.name()), settled);
        }
        let motion = of().map(|row| standing(row.motion, &reasons_for_motion(row)));
        add(&format!("{}, motion", load.name()), motion.collect());
    }
    let passed = |passes: bool| {
        if passes {
            Standing::Within
        } else {
            Standing::Missed
        }
    };
    let organs = organs.iter().map(|row| row.misses());
    add(
        "a stiff organ",
        organs.map(|misses| passed(misses.is_empty())).collect(),
    );
    let load = load.iter().map(|row| passed(load_passes(row)));
    add("under load after cuts", load.collect());
    let rest = rest.iter().map(|row| passed(row.passes()));
    add("at rest after cuts", rest.collect());
    table
}

/// Results that miss their limits.
fn misses(
    newton: &[&NewtonRow],
    organs: &[&OrganRow],
    load: &[&LoadRow],
    rest: &[&RestRow],
) -> String {
    let mut lines = Vec::new();
    for row in newton {
        let mut add = |what: &str, error: f64, warned: &Warned| {
            if standing(error, warned) == Standing::Missed {
                lines.push(format!(
                    "- {} {}, E = {:.0e} Pa, Poisson's ratio {}: {what} {}, no warning ({}, {} substeps, {})",
                    row.shape,
                    row.load.name(),
                    row.young_modulus,
                    row.poisson_ratio,
                    percent(error),
                    row.method,
                    row.substeps,
                    row.precision
                ));
            }
        };
        if let Some(error) = row.settled {
            add("settled state off by", error, &reasons_for_state(row));
        }
        add("motion off by", row.motion, &reasons_for_motion(row));
    }
    for row in organs {
        for miss in row.misses() {
            lines.push(format!(
                "- organ, accuracy {}, {} strokes: {miss}",
                percent(row.accuracy),
                row.strokes
            ));
        }
    }
    for row in load.iter().filter(|row| !load_passes(row)) {
        lines.push(format!(
            "- strokes {} load, E = {:.0e} Pa, {} substeps, {}: kinetic energy {:.1e} of what gravity released, {} softened, {}",
            strokes(row),
            row.young_modulus, row.substeps, row.precision, row.kinetic_at_end, row.softened, warned_or_not(&row.warned)
        ));
    }
    for row in rest.iter().filter(|row| !row.passes()) {
        lines.push(format!(
            "- at rest, {}, {}, snap {}: {:.1e} then {:.1e} m/s, {} inverted",
            row.body, row.precision, row.snap, row.first, row.last, row.inverted
        ));
    }
    if lines.is_empty() {
        "No result misses its bar.".to_owned()
    } else {
        format!("**Missed:**\n\n{}", lines.join("\n"))
    }
}

fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    if percent >= 1e4 {
        format!("{percent:.0e}%")
    } else if percent >= 10.0 {
        format!("{percent:.0}%")
    } else {
        format!("{percent:.1}%")
    }
}

fn warned_or_not(warned: &Warned) -> String {
    if warned.is_empty() {
        "no warning".to_owned()
    } else {
        codes(warned)
    }
}

/// The codes of warnings.
fn codes(warned: &Warned) -> String {
    let codes: Vec<String> = warned.iter().map(|code| format!("`{code}`")).collect();
    codes.join(", ")
}

fn newton_tables(rows: &[&NewtonRow]) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut ratios: Vec<f64> = rows.iter().map(|row| row.poisson_ratio).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.dedup();
    let mut groups: Vec<(&str, Load)> = Vec::new();
    for row in rows {
        let group = (row.shape.as_str(), row.load);
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    for (shape, load) in groups {
        let of_group: Vec<&NewtonRow> = rows
            .iter()
            .filter(|row| row.shape == shape && row.load == load)
            .copied()
            .collect();
        let head = ["E in Pa".to_owned(), "error of".to_owned()];
        let columns = ratios.iter().map(|ratio| format!("ν = {ratio}"));
        let tets = of_group[0].tets;
        let caption = format!("{shape} ({tets} tets), {}", load.name());
        let mut table = Table::new(caption, head.into_iter().chain(columns));
        let mut stiffnesses: Vec<f64> = of_group.iter().map(|row| row.young_modulus).collect();
        stiffnesses.dedup();
        for young_modulus in stiffnesses {
            let of_row = |ratio: f64| {
                of_group
                    .iter()
                    .find(|row| row.young_modulus == young_modulus && row.poisson_ratio == ratio)
            };
            let mut add = |what: &str, text: &dyn Fn(&NewtonRow) -> String| {
                let cells = ratios
                    .iter()
                    .map(|&ratio| of_row(ratio).map_or(String::new(), |r| text(r)));
                let head = [format!("{young_modulus:.0e}"), what.to_owned()];
                table.push(head.into_iter().chain(cells));
            };
            if load != Load::Spinning {
                add("settled state", &|row| {
                    row.settled
                        .map_or(String::new(), |error| cell(error, &reasons_for_state(row)))
                });
            }
            add("motion", &|row| {
                let mut text = cell(row.motion, &reasons_for_motion(row));
                if row.reference > 0.02 {
                    text += &format!(", ref ±{}", percent(row.reference));
                }
                text
            });
            add("method, substeps, frames", &|row| {
                format!(
                    "{} {} {}, {}",
                    row.method, row.substeps, row.precision, row.frames
                )
            });
        }
        parts.push(Part::Table(table));
    }
    parts
}

/// Formats an error with its comparison to the limit.
fn cell(error: f64, warned: &Warned) -> String {
    let percent = percent(error);
    match standing(error, warned) {
        Standing::Missed => format!("**{percent}, over 10%, no warning**"),
        _ if warned.is_empty() => percent,
        _ => format!("{percent}, {}", codes(warned)),
    }
}

fn organ_table(rows: &[&OrganRow]) -> Table {
    let header = [
        "accuracy",
        "strokes",
        "tets",
        "method, substeps, precision",
        "pulled, ms a frame",
        "slowest frame that cuts",
        "last 20 frames",
        "error",
        "warnings",
    ];
    let mut table = Table::new("", header);
    for row in rows {
        let [first, last] = row.tets;
        let [error, reference] = row.error.map(percent);
        table.push([
            percent(row.accuracy),
            row.strokes.to_string(),
            if first == last {
                first.to_string()
            } else {
                format!("{first} to {last}")
            },
            format!("{} {} {}", row.method, row.substeps, row.precision),
            format!("{:.1}", row.pulled_ms),
            row.slowest_cut_ms
                .map_or("-".to_owned(), |ms| format!("{ms:.1}")),
            format!("{:.1}", row.last_ms),
            format!("{error}, ref ±{reference}"),
            codes(&row.warned),
        ]);
    }
    table
}

fn strokes(row: &LoadRow) -> &'static str {
    match row.strokes {
        Strokes::Before => "before",
        Strokes::During => "during",
    }
}

fn load_table(rows: &[&LoadRow]) -> Table {
    let header = [
        "strokes",
        "E in Pa",
        "substeps",
        "precision",
        "kappa",
        "snap",
        "tets",
        "largest speed, m/s",
        "in the last 50 frames",
        "kinetic energy there over released",
        "most inverted",
        "inverted at the end",
        "softened",
        "energy bounded",
        "speeds bounded",
        "warnings",
    ];
    let mut table = Table::new("", header);
    for row in rows {
        table.push([
            strokes(row).to_owned(),
            format!("{:.0e}", row.young_modulus),
            row.substeps.to_string(),
            row.precision.clone(),
            format!("{:.1e}", row.kappa),
            row.snap.to_string(),
            row.tets.to_string(),
            speed(row.fastest),
            speed(row.fastest_at_end),
            format!("{:.1e}", row.kinetic_at_end),
            row.most_inverted.to_string(),
            row.inverted.to_string(),
            row.softened.to_string(),
            if row.is_bounded() { "yes" } else { "**no**" }.to_owned(),
            if row.is_slow() { "yes" } else { "no" }.to_owned(),
            codes(&row.warned),
        ]);
    }
    table
}

fn speed(speed: f64) -> String {
    if speed < 1e3 {
        format!("{speed:.1}")
    } else {
        format!("{speed:.0e}")
    }
}

fn rest_table(rows: &[&RestRow]) -> Table {
    let header = [
        "body",
        "precision",
        "snap",
        "tets",
        "substeps",
        "fastest in the first 100 frames, m/s",
        "in the last 100",
        "most inverted",
        "bar",
        "warnings",
    ];
    let mut table = Table::new("", header);
    for row in rows {
        table.push([
            row.body.clone(),
            row.precision.clone(),
            row.snap.to_string(),
            row.tets.to_string(),
            row.substeps.to_string(),
            format!("{:.1e}", row.first),
            format!("{:.1e}", row.last),
            row.inverted.to_string(),
            if row.passes() { "kept" } else { "**missed**" }.to_owned(),
            codes(&row.warned),
        ]);
    }
    table
}
