//! Summary table at the end of a run.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table};
use incise::FrameReport;
use incise::report::{BodyReport, Milliseconds, Shortfall, SoftenedReport};

/// Name of a stage and a function that returns its time.
type Stage = (&'static str, fn(&Milliseconds) -> f64);
const STAGES: [Stage; 8] = [
    ("cut", |ms| ms.cut),
    ("cluster", |ms| ms.cluster),
    ("color", |ms| ms.color),
    ("schedule", |ms| ms.schedule),
    ("contact", |ms| ms.contact),
    ("solve", |ms| ms.solve),
    ("other", |ms| ms.other),
    ("total", |ms| ms.total),
];

/// Times and counts of all frames of a run.
#[derive(Debug)]
pub(crate) struct Summary {
    times: Vec<Milliseconds>,
    cutting: Vec<Milliseconds>,
    tets_before: usize,
    worst_volume_ratio: f64,
    repaired: usize,
    last: FrameReport,
}

impl Summary {
    /// Starts the summary; `before` is the report before the first frame.
    pub(crate) fn new(before: &FrameReport) -> Self {
        Self {
            times: Vec::new(),
            cutting: Vec::new(),
            tets_before: before.tets,
            worst_volume_ratio: 1.0,
            repaired: 0,
            last: before.clone(),
        }
    }

    pub(crate) fn add(&mut self, report: &FrameReport) {
        self.times.push(report.ms);
        if let Some(cut) = &report.cut {
            if cut.has_cut() {
                self.cutting.push(report.ms);
            }
            self.worst_volume_ratio = self.worst_volume_ratio.min(cut.worst_volume_ratio);
        }
        self.repaired += report.repaired;
        // Contacts are counted in the frames that are reported.
        let contact = report.contact.or(self.last.contact);
        self.last = report.clone();
        self.last.contact = contact;
    }

    /// Formats the times by stage, then the counts.
    pub(crate) fn table(&self, kappa: [f64; 2], softened: &SoftenedReport) -> String {
        let mut stages = Table::new();
        stages.load_style(UTF8_FULL_CONDENSED);
        stages.set_header(["ms per frame", "median", "worst", "median with a cut"]);
        for (name, stage) in STAGES {
            if name == "contact" && self.last.contact.is_none() {
                continue;
            }
            let [all, cutting] = [&self.times, &self.cutting].map(|times| sorted(times, stage));
            let row = [
                name.to_owned(),
                middle(&all),
                all.last().map_or("-".into(), ms),
                middle(&cutting),
            ];
            stages.add_row(row);
        }
        let mut counts = Table::new();
        counts.load_style(UTF8_FULL_CONDENSED);
        let total: f64 = self.times.iter().map(|ms| ms.total).sum();
        let frames = self.times.len();
        counts.add_row([
            "frames".to_owned(),
            format!("{frames} ({} with a cut)", self.cutting.len()),
        ]);
        counts.add_row([
            "frames per second".to_owned(),
            format!("{:.1}", 1e3 * frames as f64 / total),
        ]);
        counts.add_row([
            "tets at start, end".to_owned(),
            format!("{}, {}", self.tets_before, self.last.tets),
        ]);
        counts.add_row(["particles".to_owned(), self.last.particles.to_string()]);
        counts.add_row(["pieces".to_owned(), self.last.pieces.to_string()]);
        if let Some(contact) = &self.last.contact {
            counts.add_row([
                "contacts that press, and deepest at the end".to_owned(),
                format!(
                    "{}, {:.1}% of an edge",
                    contact.active,
                    100.0 * contact.max_depth
                ),
            ]);
        } else if self.last.pieces > 1 {
            counts.add_row([
                "contacts".to_owned(),
                "none: without [contact] pieces pass through each other".to_owned(),
            ]);
        }
        counts.add_row([
            "clusters, colors".to_owned(),
            format!("{}, {}", self.last.clusters, self.last.colors),
        ]);
        if self.worst_volume_ratio < 1.0 {
            counts.add_row([
                "smallest child of a cut (part of its tet's volume)".to_owned(),
                format!("{:.2e}", self.worst_volume_ratio),
            ]);
        }
        for body in &self.last.bodies {
            counts.add_row([substeps_of(&body.bodies), substeps(body)]);
        }
        counts.add_row([
            "kappa at start, end".to_owned(),
            format!("{:.2}, {:.2}", kappa[0], kappa[1]),
        ]);
        counts.add_row([
            "tets softened to the kappa limit".to_owned(),
            format!(
                "{} ({:.2}% of the volume, up to {:.0} times)",
                softened.tets,
                100.0 * softened.volume_fraction,
                softened.strongest
            ),
        ]);
        if self.repaired > 0 {
            counts.add_row([
                "repaired particles (result not reliable)".to_owned(),
                self.repaired.to_string(),
            ]);
        }
        for table in [&mut stages, &mut counts] {
            for column in table.column_iter_mut().skip(1) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        format!("{stages}\n{counts}")
    }
}

/// Row name of the substeps of the given bodies.
fn substeps_of(bodies: &[usize]) -> String {
    let numbers: Vec<String> = bodies.iter().map(ToString::to_string).collect();
    format!("substeps of body {}", numbers.join(", "))
}

/// Formats the number of substeps, with the reason if more are needed.
fn substeps(body: &BodyReport) -> String {
    let substeps = body.substeps;
    match body.choice {
        Some(choice) => match choice.shortfall {
            Some(Shortfall::Cap | Shortfall::Growth) => {
                format!("{substeps} (limited; {} needed)", choice.substeps_wanted)
            }
            Some(Shortfall::Sliver) => format!(
                "{substeps} ({} needed by {} slivers)",
                choice.substeps_wanted, choice.sliver_tets
            ),
            _ => substeps.to_string(),
        },
        None => substeps.to_string(),
    }
}

fn sorted(times: &[Milliseconds], stage: fn(&Milliseconds) -> f64) -> Vec<f64> {
    let mut times: Vec<f64> = times.iter().map(stage).collect();
    times.sort_by(f64::total_cmp);
    times
}

fn middle(sorted: &[f64]) -> String {
    sorted.get(sorted.len() / 2).map_or("-".into(), ms)
}

fn ms(value: &f64) -> String {
    format!("{value:.3}")
}
