//! Figure 11: stages of the frame time while the liver is cut.

use std::time::Instant;

use incise::Simulation;
use incise::coloring::scgc;
use incise::graph::{ConstraintGraph, Schedule};
use serde::{Deserialize, Serialize};

use super::colorings::{ITERATIONS, occupied, one_thread, solve_ms};
use super::compared::{mean, number};
use super::paper_mesh::{PaperMesh, incidence};
use super::scene::cut_at_rest;
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part, Table};

const FRAMES: u64 = 220;
const BLADES: u64 = 3;
/// Interval of the cutting frames that are also measured in the paper's way.
const STRIDE: usize = 8;
const STAGES: [&str; 6] = ["cut", "cluster", "graph", "color", "schedule", "solve"];

/// Mean ms of the stages in the frames that cut.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    tets: usize,
    /// In the order of [`STAGES`].
    pub(super) paper: [f64; 6],
    ours: [f64; 6],
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let arguments = arguments.clone();
    Experiment {
        name: "paper-fig11",
        cells: vec![Cell::new("liver-11k", move || measure(&arguments))],
        page,
    }
}

fn measure(arguments: &ExperimentArguments) -> anyhow::Result<Row> {
    let body = PaperMesh::named("liver_11k")?;
    let mesh = body.mesh(arguments)?;
    let frames = if arguments.quick { FRAMES / 5 } else { FRAMES };
    let scene = cut_at_rest(body, &mesh, arguments, "serial:10", frames, BLADES)?;
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let (mut ours, mut paper) = (Vec::new(), Vec::new());
    for _ in 0..frames {
        let report = simulation.step()?;
        if report.cut.is_none() {
            continue;
        }
        let ms = report.ms;
        ours.push([ms.cut, ms.cluster, 0.0, ms.color, ms.schedule, ms.solve]);
        if ours.len() % STRIDE == 1 {
            let clusters = occupied(&simulation.clustering())?;
            let incidence = incidence(simulation.mesh())?;
            let (schedule, times) = one_thread(|| {
                let clock = Instant::now();
                let graph = ConstraintGraph::from_incidence(&incidence.quotient(&clusters));
                let built = clock.elapsed();
                let coloring = scgc(&graph).coloring;
                let colored = clock.elapsed();
                let schedule = Schedule::new(&clusters, &coloring);
                let times = [built, colored - built, clock.elapsed() - colored];
                Ok((schedule, times.map(|time| time.as_secs_f64() * 1e3)))
            })?;
            let solve = mean(solve_ms(simulation.mesh(), &[schedule])?);
            paper.push([ms.cut, ms.cluster, times[0], times[1], times[2], solve]);
        }
    }
    anyhow::ensure!(!paper.is_empty(), "the blades missed the liver");
    let means = |frames: &[[f64; 6]]| std::array::from_fn(|i| mean(frames.iter().map(|f| f[i])));
    Ok(Row {
        tets: mesh.tets.len(),
        paper: means(&paper),
        ours: means(&ours),
    })
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut head = vec!["frame".to_owned(), "sum, ms".to_owned()];
    for stage in STAGES {
        head.push(format!("{stage} ms"));
        head.push("share".to_owned());
    }
    let mut table = Table::new("", head);
    for row in rows {
        for (name, stages) in [
            ("as the paper makes it", &row.paper),
            ("as the simulation makes it", &row.ours),
        ] {
            let sum: f64 = stages.iter().sum();
            let mut cells = vec![name.to_owned(), number(sum)];
            for ms in stages {
                cells.push(format!("{ms:.3}"));
                cells.push(format!("{:.0} %", 100.0 * ms / sum));
            }
            table.push(cells);
        }
    }
    let tets = rows.first().map_or(0, |row| row.tets);
    Ok(Page {
        title: "Figure 11: the time of a frame by stages".to_owned(),
        parts: vec![
            Part::Text(format!(
                "Means of the frames in which a blade cuts the liver of {tets} tets, three blades in {FRAMES} frames, clusters of \
                 10 that are never merged, {ITERATIONS} iterations, one thread. As the paper makes a frame, the graph of all \
                 clusters is rebuilt and recolored by SCGC and the order of solving sorted again (every {STRIDE}th frame that \
                 cuts), in the sequential form; as the simulation makes it, only what was cut is colored and sorted, in the \
                 block form. The paper prints a diagram without numbers: cutting, coloring and solving take most."
            )),
            Part::Table(table),
        ],
    })
}
