//! Page of the experiment: undeclared features, declared but idle ones, and those in use.

use anyhow::{Context, ensure};

use super::Row;
use super::callgrind::Counts;
use super::features::{BARE, State};
use super::measure::{Device, FRAMES, Measured};
use crate::experiment::{Page, Part, Table};

/// A feature with functions of its own. What a bare frame spends in them is the cost of a feature that is not declared.
struct Feature {
    name: &'static str,
    /// Parts of the names of its functions.
    functions: &'static [&'static str],
    /// The case in which they run: functions that are renamed would cost nothing without a word.
    seen_in: &'static str,
}

const FEATURES: [Feature; 12] = [
    Feature {
        name: "attachments",
        functions: &["xpbd::constraints::attachments", "incise::attachment"],
        seen_in: "attachment-used",
    },
    Feature {
        name: "distances, volume constraints",
        functions: &["xpbd::constraints::scalar"],
        seen_in: "distance-used",
    },
    Feature {
        name: "colliders, ground",
        functions: &[
            "xpbd::constraints::colliders",
            "xpbd::collider",
            "incise::collider",
        ],
        seen_in: "collider-used",
    },
    Feature {
        name: "contact",
        functions: &[
            "xpbd::constraints::contacts",
            "incise::contacts",
            "incise_contact",
        ],
        seen_in: "contact-used",
    },
    Feature {
        name: "Jacobi, Chebyshev",
        functions: &["xpbd::jacobi"],
        seen_in: "jacobi-used",
    },
    Feature {
        name: "VBD",
        functions: &["xpbd::vbd", "incise::vbd"],
        seen_in: "vbd-used",
    },
    Feature {
        name: "strokes, pieces",
        functions: &[
            "incise::strokes",
            "incise::pieces",
            "incise_cutting",
            "xpbd::constraints::blades",
        ],
        seen_in: "blade-used",
    },
    Feature {
        name: "clusters, colors, reclustering",
        functions: &[
            "incise::partition",
            "incise::recluster",
            "incise_clustering",
            "incise_coloring",
        ],
        seen_in: "recluster-idle",
    },
    Feature {
        name: "reports",
        functions: &["incise::measure", "xpbd::measure", "xpbd::residuals"],
        seen_in: "report-residual-used",
    },
    Feature {
        name: "bodies far from the origin",
        functions: &["xpbd::floating_origin"],
        seen_in: "bare-base",
    },
    Feature {
        name: "bodies on a line",
        functions: &["xpbd::degeneracy_jitter"],
        seen_in: "bare-base",
    },
    Feature {
        name: "the largest speed, for the warning of divergence",
        functions: &["ErasedSolver>::max_speed"],
        seen_in: "bare-base",
    },
];

/// The copy of positions that every frame makes is inlined into this function.
const POSITIONS: &str = "SpecExtend";

const INTRODUCTION: &str = "\
Costs of features that a scene does not declare, declares without using, and uses. The scene is a beam that \
floats at rest, in 2 substeps of 1 iteration; nothing acts on it, nothing is held, reported or limited.

*Undeclared* cannot be measured by leaving a key out: that is the bare scene itself. Three things are measured instead. \
The bare scene is compared with a hand-written loop over the same mesh and schedule: `incise_xpbd::Solver::step` and a copy of \
the positions. That loop has no scenes, strokes, pieces, reports, sleep or attachments. The additional cost of the \
scene must be a constant but for one pass over the particles, the largest speed, by which a motion that diverges is a \
warning. The compiler blurs it, since it makes one copy of the solver for the facade and another for the hand-written \
loop, which differ by some instructions a particle. Second, \
the solver's own step without a body: it contains all checks for undeclared constraints, which run once a substep or \
once a frame, so it is an upper bound. Third, the instructions of a bare frame by function, summed over the modules \
that \
belong to one feature alone; what the compiler has inlined elsewhere is in the first two only.

Not covered: a branch within the loops over particles and tets, which both loops share. By reading: three for each \
block of 4 to 16 tets, the same every time (whether multipliers are kept, whether corrections are collected as Jacobi \
does, whether materials differ); for each particle, whether it is held, and whether there is gravity. And bytes that the \
solver holds whatever a scene declares: a byte a particle for being fixed, two a tet for its material, eight a tet for \
its volume at rest. Two passes a frame are for what no scene declares: the largest speed, and the bounding box, by which \
a body that moves far away keeps its precision. Any simulation can be cut at any time, so each keeps neighbors, boundary \
and pieces of its mesh, \
and clusters and colors that can be updated.

Instructions are Callgrind's, on one thread, mean of 4 frames after the first 3; on a processor as valgrind \
shows it, with AVX 2 at most. Bytes are those held on the heap, capacity included. They are not times: a pass over \
memory costs more than its instructions.";

pub(crate) fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(INTRODUCTION.to_owned())];
    let valgrind = rows.iter().find_map(|row| row.valgrind.as_deref());
    parts.push(Part::Text(match valgrind {
        Some(version) => format!("Instructions counted by {version}."),
        None => "Valgrind was not installed, so no instructions were counted.".to_owned(),
    }));
    let find = |feature: &str| {
        let row = rows.iter().find(|row| row.feature == feature);
        row.with_context(|| format!("{feature} was not measured"))
    };
    let (bare, hand, empty) = (find(BARE)?, find("hand")?, find("empty")?);
    parts.push(Part::Table(undeclared(bare, hand, empty)));
    for feature in &FEATURES {
        check_names(feature, rows)?;
    }
    parts.push(Part::Table(modules(bare)));
    let declared = [
        declared_table("Declared and idle", rows, State::Idle),
        declared_table("Declared and at work", rows, State::Used),
    ];
    parts.extend(
        declared
            .into_iter()
            .map(|table| table.map(Part::Table))
            .collect::<Result<Vec<_>, _>>()?,
    );
    parts.push(Part::Table(device_table(rows)?));
    Ok(Page {
        title: "Cost of features that a scene does not use".to_owned(),
        parts,
    })
}

/// Bare scene next to the handwritten loops.
fn undeclared(bare: &Row, hand: &Row, empty: &Row) -> Table {
    let mut table = Table::new(
        "Nothing declared",
        [
            "tets",
            "particles",
            "",
            "instructions a frame",
            "branches a frame",
            "allocations a frame",
            "bytes",
        ],
    );
    let mut push = |of: &Measured, name: &str, values: [String; 4]| {
        let [instructions, branches, allocations, bytes] = values;
        table.push([
            of.tets.to_string(),
            of.particles.to_string(),
            name.to_owned(),
            instructions,
            branches,
            allocations,
            bytes,
        ]);
    };
    let all = |m: &Measured| {
        [
            show(instructions(m)),
            show(branches(m)),
            per_frame(m.memory.allocations),
            m.memory.bytes.to_string(),
        ]
    };
    for (bare, hand) in bare.sizes.iter().zip(&hand.sizes) {
        push(bare, "scene", all(bare));
        push(hand, "by hand", all(hand));
        push(
            bare,
            "scene, beyond the hand-written loop",
            [
                show(minus(instructions(bare), instructions(hand))),
                show(minus(branches(bare), branches(hand))),
                (bare.memory.allocations as i64 - hand.memory.allocations as i64).to_string(),
                (bare.memory.bytes - hand.memory.bytes).to_string(),
            ],
        );
        push(
            bare,
            "of that, neighbors, boundary and pieces",
            [
                "".into(),
                "".into(),
                "".into(),
                bare.memory.ready_to_cut.to_string(),
            ],
        );
    }
    if let Some(empty) = empty.sizes.first() {
        push(empty, "by hand, without a body", all(empty));
    }
    table
}

/// An error if the functions of a feature do not run where it is in use: they have other names then.
fn check_names(feature: &Feature, rows: &[Row]) -> anyhow::Result<()> {
    let case = rows.iter().find(|row| row.id() == feature.seen_in);
    let counts = case.and_then(|row| row.sizes.last()?.counts.as_ref());
    let Some(counts) = counts else {
        return Ok(());
    };
    ensure!(
        counts.of(feature.functions) > 0,
        "{}: no function of {:?} runs in {}",
        feature.name,
        feature.functions,
        feature.seen_in
    );
    Ok(())
}

/// The instructions of a bare frame in modules of features that are not declared.
fn modules(bare: &Row) -> Table {
    let mut header = vec!["feature".to_owned()];
    header.extend(bare.sizes.iter().map(|m| format!("{} tets", m.tets)));
    let mut table = Table::new(
        "Instructions of a bare frame in functions of features that it does not declare",
        header,
    );
    let mut push = |name: &str, of: &dyn Fn(&Counts) -> u64| {
        let mut row = vec![name.to_owned()];
        row.extend(bare.sizes.iter().map(|m| {
            let counted = m.counts.as_ref();
            show(counted.map(|counts| of(counts) as f64 / f64::from(FRAMES)))
        }));
        table.push(row);
    };
    for feature in &FEATURES {
        push(feature.name, &|counts| counts.of(feature.functions));
    }
    push("functions of the facade alone", &|counts| {
        counts.of(&["incise::"])
    });
    push("clocks for the report's times", &|counts| {
        counts.of(&["Timespec", "clock_gettime", "time::Instant"])
    });
    push("for comparison: the copy of positions", &|counts| {
        counts.of(&[POSITIONS])
    });
    table
}

/// A scene next to its base, in every size.
fn pairs<'a>(
    rows: &'a [Row],
    row: &'a Row,
) -> anyhow::Result<impl Iterator<Item = (&'a Measured, &'a Measured)>> {
    let base = rows.iter().find(|base| base.feature == row.base);
    let base = base.with_context(|| format!("{} was not measured", row.base))?;
    Ok(row.sizes.iter().zip(&base.sizes))
}

pub(super) fn declared_table(caption: &str, rows: &[Row], state: State) -> anyhow::Result<Table> {
    let mut table = Table::new(
        format!("{caption}: additional cost of a frame over its base, at the larger size"),
        [
            "feature",
            "what",
            "instructions",
            "in % of the base's",
            "branches",
            "instructions a particle more",
            "allocations",
            "bytes",
            "bytes a particle",
        ],
    );
    for row in rows.iter().filter(|row| row.state == state.name()) {
        let differences: Vec<_> = pairs(rows, row)?.collect();
        let Some(&(here, base)) = differences.last() else {
            continue;
        };
        let more = minus(instructions(here), instructions(base));
        let part = more
            .zip(instructions(base))
            .map(|(more, all)| 100.0 * more / all);
        // The difference between the sizes cancels constants.
        let slope = match differences[..] {
            [(small, small_base), .., (large, large_base)] => {
                let more = |a, b| minus(instructions(a), instructions(b));
                let particles = large.particles as f64 - small.particles as f64;
                minus(more(large, large_base), more(small, small_base)).map(|d| d / particles)
            }
            _ => None,
        };
        let bytes = here.memory.bytes - base.memory.bytes;
        let name = match row.base.as_str() {
            BARE => row.feature.clone(),
            base => format!("{} (beside {base})", row.feature),
        };
        table.push([
            name,
            row.what.clone(),
            show(more),
            part.map_or("-".to_owned(), |part| format!("{part:.3}")),
            show(minus(branches(here), branches(base))),
            slope.map_or("-".to_owned(), |slope| format!("{slope:.2}")),
            (here.memory.allocations as i64 - base.memory.allocations as i64).to_string(),
            bytes.to_string(),
            format!("{:.1}", bytes as f64 / here.particles as f64),
        ]);
    }
    Ok(table)
}

/// Table of device traffic.
fn device_table(rows: &[Row]) -> anyhow::Result<Table> {
    let mut table = Table::new(
        "On a GPU: data sent for a bare frame, and additional data of other scenes, at the larger size",
        [
            "feature",
            "state",
            "dispatches",
            "passes",
            "submits",
            "bytes sent",
            "reads",
            "bytes read",
            "bytes held",
        ],
    );
    for row in rows {
        let Some((here, base)) = pairs(rows, row)?.last() else {
            continue;
        };
        let Some(device) = here.device else { continue };
        let of = |device: Device| {
            [
                device.dispatches,
                device.passes,
                device.submits,
                device.uploaded,
                device.readbacks,
                device.read,
            ]
        };
        let is_base = row.state == State::Base.name();
        let base = base.device.filter(|_| !is_base);
        let mut line = vec![row.feature.clone(), row.state.clone()];
        let before = base.map_or([0; 6], of);
        let more = of(device).into_iter().zip(before);
        line.extend(more.map(|(here, base)| {
            let each = (here as f64 - base as f64) / f64::from(FRAMES);
            if each == each.round() {
                format!("{each:.0}")
            } else {
                format!("{each:.2}")
            }
        }));
        let held = device.bytes as i64 - base.map_or(0, |base| base.bytes as i64);
        line.push(held.to_string());
        table.push(line);
    }
    if table.rows.is_empty() {
        table.push(["no device"].into_iter().chain(["-"; 8]));
    }
    Ok(table)
}

fn instructions(measured: &Measured) -> Option<f64> {
    let counts = measured.counts.as_ref()?;
    Some(counts.instructions as f64 / f64::from(FRAMES))
}

fn branches(measured: &Measured) -> Option<f64> {
    let counts = measured.counts.as_ref()?;
    Some(counts.branches as f64 / f64::from(FRAMES))
}

fn minus(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    Some(a? - b?)
}

fn show(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.0}"))
}

fn per_frame(count: u64) -> String {
    (count as f64 / f64::from(FRAMES)).to_string()
}
