//! Figure 8: colors and time of a frame while a body is cut, by coloring algorithm.
//!
//! One course of cutting for all: clusters of 10, three blades, new clusters never merged. At some frames its clusters
//! are recolored by each algorithm and a step is solved in each order, as the paper does in every frame. Beside them
//! what the simulation itself does, which keeps colors and recolors only what was cut. The caption of Figure 6 has the
//! rows as liver, bunny, armadillo, the text as liver, armadillo, bunny; so both bodies are cut in 180 frames and
//! in 280.

use incise::Simulation;
use serde::{Deserialize, Serialize};

use super::colorings::{ITERATIONS, Problem, occupied};
use super::paper_mesh::{PaperMesh, incidence};
use super::scene::cut_at_rest;
use crate::experiment::{
    Axis, Cell, Experiment, ExperimentArguments, Page, Part, Plot, Series, Style, Table,
};

/// Bodies and frames in both readings.
const RUNS: [(&str, u64); 5] = [
    ("liver_11k", 220),
    ("bunny_19k", 180),
    ("armadillo_55k", 280),
    ("armadillo_55k", 180),
    ("bunny_19k", 280),
];
/// The paper's three, and ECL-GC, which it has in Table 2.
const ALGORITHMS: [&str; 4] = ["vivace", "wlc", "ecl-gc", "scgc"];
const BLADES: u64 = 3;
/// Frames at which all algorithms color.
const SAMPLES: u64 = 16;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) body: String,
    pub(super) frames: u64,
    /// Of each frame in which something was cut: number, colors as they are kept, ms of cutting to solving.
    kept: Vec<(u64, usize, f64)>,
    pub(super) samples: Vec<Sample>,
}

/// A frame as the paper would make it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Sample {
    frame: u64,
    tets: usize,
    clusters: usize,
    bound: usize,
    /// Of cutting and following clusters; the mean of the frames around.
    cut_ms: f64,
    /// By algorithm: colors, ms to color, ms to solve.
    colored: Vec<(usize, f64, f64)>,
}

impl Sample {
    /// Colors and ms of the frame of an algorithm.
    pub(super) fn of(&self, algorithm: &str) -> Option<(usize, f64)> {
        let place = ALGORITHMS.iter().position(|name| *name == algorithm)?;
        let (colors, color, solve) = self.colored[place];
        Some((colors, self.cut_ms + color + solve))
    }
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let cell = |(name, frames): (&'static str, u64)| {
        let arguments = arguments.clone();
        let id = format!("{name}-{frames}").replace('_', "-");
        Cell::new(id, move || measure(name, frames, &arguments))
    };
    Experiment {
        name: "paper-fig8",
        cells: RUNS.map(cell).into(),
        page,
    }
}

fn measure(name: &str, frames: u64, arguments: &ExperimentArguments) -> anyhow::Result<Row> {
    let body = PaperMesh::named(name)?;
    let mesh = body.mesh(arguments)?;
    let frames = if arguments.quick { frames / 5 } else { frames };
    let samples = if arguments.quick { 6 } else { SAMPLES };
    let scene = cut_at_rest(body, &mesh, arguments, "serial:10", frames, BLADES)?;
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let (mut kept, mut measured) = (Vec::new(), Vec::new());
    let mut cuts: Vec<f64> = Vec::new();
    for frame in 0..frames {
        let report = simulation.step()?;
        if report.cut.is_some() {
            let ms = report.ms;
            let stages = ms.cut + ms.cluster + ms.color + ms.schedule + ms.solve;
            kept.push((frame, report.colors, stages));
            cuts.push(ms.cut + ms.cluster);
        }
        // The last frame of each part.
        if (frame + 1) * samples / frames > frame * samples / frames {
            let mesh = simulation.mesh();
            let clusters = occupied(&simulation.clustering())?;
            let problem = Problem::new(&incidence(mesh)?, clusters);
            let colored = problem.measure(mesh, &ALGORITHMS)?;
            measured.push(Sample {
                frame,
                tets: mesh.tets.len(),
                clusters: problem.clustering.occupied(),
                bound: problem.clusters.clique_bound(),
                cut_ms: super::compared::mean(cuts.drain(..)),
                colored: colored
                    .iter()
                    .map(|c| (c.colors, c.color_ms, c.solve_ms))
                    .collect(),
            });
        }
    }
    anyhow::ensure!(!kept.is_empty(), "the blades missed {name}");
    Ok(Row {
        body: name.to_owned(),
        frames,
        kept,
        samples: measured,
    })
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(format!(
        "Three blades through bodies at rest, clusters of 10 that are never merged, as in the paper. By algorithm: the clusters \
         of that frame recolored, with the time of cutting (the mean of the frames that cut since the last point), \
         coloring from an existing graph, and {ITERATIONS} iterations. `kept`: what the simulation does, which colors \
         only what was cut; its time is that of all its stages. One thread.\n\n\
         The paper gives 220, 180 and 280 frames for its rows from top to bottom. Figure 6, of which they are said to be, has \
         liver, bunny, armadillo by its caption; the text lists liver, armadillo, bunny. So both are run in 180 and in 280."
    ))];
    let mut table = Table::new(
        "First and last quarter of the points, means",
        [
            "body",
            "frames",
            "algorithm",
            "colors, first",
            "last",
            "ms a frame, first",
            "last",
            "last / first",
            "colors below Vivace's, first",
        ],
    );
    for row in rows {
        let title = format!("{}, {} frames", row.body, row.frames);
        for (what, colors) in [("colors", true), ("ms a frame", false)] {
            let pick = |(count, ms): (usize, f64)| if colors { count as f64 } else { ms };
            let mut series: Vec<Series> = ALGORITHMS
                .iter()
                .map(|algorithm| Series {
                    name: (*algorithm).to_owned(),
                    points: row
                        .samples
                        .iter()
                        .filter_map(|s| Some((s.frame as f64, pick(s.of(algorithm)?))))
                        .collect(),
                    labels: Vec::new(),
                    style: Style::Both,
                })
                .collect();
            series.push(Series {
                name: "kept".to_owned(),
                points: row
                    .kept
                    .iter()
                    .map(|&(frame, colors, ms)| (frame as f64, pick((colors, ms))))
                    .collect(),
                labels: Vec::new(),
                style: Style::Line,
            });
            parts.push(Part::Plot(Plot {
                title: title.clone(),
                x: Axis::linear("frame"),
                y: Axis::linear(what),
                series,
            }));
        }
        let vivace = quarters(row, "vivace").0[0];
        for algorithm in ALGORITHMS {
            let (colors, ms) = quarters(row, algorithm);
            table.push([
                row.body.clone(),
                row.frames.to_string(),
                algorithm.to_owned(),
                format!("{:.1}", colors[0]),
                format!("{:.1}", colors[1]),
                format!("{:.3}", ms[0]),
                format!("{:.3}", ms[1]),
                format!("{:.2}", ms[1] / ms[0]),
                format!("{:.0} %", 100.0 * (1.0 - colors[0] / vivace)),
            ]);
        }
    }
    parts.insert(1, Part::Table(table));
    let head = ["body", "frame", "tets", "clusters", "bound"];
    let mut head: Vec<String> = head.map(str::to_owned).into();
    head.extend(ALGORITHMS.map(|name| format!("{name}: colors / ms")));
    let mut table = Table::new("All points", head);
    for row in rows {
        for sample in &row.samples {
            let counts = [sample.tets, sample.clusters, sample.bound];
            let mut cells = vec![
                format!("{}, {}", row.body, row.frames),
                sample.frame.to_string(),
            ];
            cells.extend(counts.map(|count| count.to_string()));
            cells.extend(ALGORITHMS.map(|algorithm| {
                let of = sample.of(algorithm);
                of.map_or_else(String::new, |(colors, ms)| format!("{colors} / {ms:.2}"))
            }));
            table.push(cells);
        }
    }
    parts.push(Part::Table(table));
    Ok(Page {
        title: "Figure 8: colors and frames while cutting".to_owned(),
        parts,
    })
}

/// Colors and ms of a frame, means over the first and the last quarter of the points.
pub(super) fn quarters(row: &Row, algorithm: &str) -> ([f64; 2], [f64; 2]) {
    let all: Vec<(usize, f64)> = row.samples.iter().filter_map(|s| s.of(algorithm)).collect();
    let quarter = all.len().div_ceil(4);
    let parts = [&all[..quarter], &all[all.len() - quarter..]];

    (
        parts.map(|part| super::compared::mean(part.iter().map(|&(colors, _)| colors as f64))),
        parts.map(|part| super::compared::mean(part.iter().map(|&(_, ms)| ms))),
    )
}
