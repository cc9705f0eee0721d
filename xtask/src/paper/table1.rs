//! Table 1: serial neighbor clustering and Greedy K-Neighbor by cluster size.
//!
//! Two readings of the paper's Algorithm 2: Ks counts the seed, as the algorithm says, or not, as its printed counts
//! imply (1972 clusters of 5 cannot hold 11,367 tets). Greedy K-Neighbor (Ton-That et al. 2023) is a reconstruction
//! that keeps scores in a heap where the paper speaks of frequent breadth-first searches.

use std::time::Instant;

use incise::clustering::{Method, cluster, serial_neighbor};
use incise::graph::{Clustering, ConstraintGraph, Schedule};
use serde::{Deserialize, Serialize};

use super::colorings::{ITERATIONS, Problem, one_thread, solve_ms};
use super::compared::{compared, header};
use super::paper_mesh::{PaperMesh, incidence};
use super::printed;
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part, Table};

/// The paper's, then ours beyond it. `graph-serial` is `serial` through the constraint graph, built first.
const METHODS: [&str; 5] = [
    "greedy-k",
    "serial",
    "serial-loose",
    "graph-serial",
    "pressure",
];
const SIZES: [u32; 5] = [5, 10, 15, 20, 25];
/// Rounds of turns; the fastest counts.
const ROUNDS: usize = 3;

/// All methods with clusters of one size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) tets: usize,
    pub(super) size: u32,
    pub(super) clustered: Vec<Clustered>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Clustered {
    pub(super) method: String,
    pub(super) clusters: usize,
    pub(super) largest: usize,
    /// By SCGC.
    pub(super) colors: usize,
    pub(super) bound: usize,
    pub(super) cluster_ms: f64,
    pub(super) color_ms: f64,
    pub(super) solve_ms: f64,
}

impl Clustered {
    /// Frames a second of solving and recoloring.
    pub(super) fn fps(&self) -> f64 {
        1e3 / (self.color_ms + self.solve_ms)
    }
}

impl Row {
    pub(super) fn of(&self, method: &str) -> Option<&Clustered> {
        self.clustered.iter().find(|c| c.method == method)
    }
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let cell = |size| {
        let arguments = arguments.clone();
        Cell::new(format!("size-{size}"), move || measure(size, &arguments))
    };
    Experiment {
        name: "paper-table1",
        cells: SIZES.map(cell).into(),
        page,
    }
}

fn measure(size: u32, arguments: &ExperimentArguments) -> anyhow::Result<Row> {
    let mesh = PaperMesh::named("liver_11k")?.mesh(arguments)?;
    let incidence = incidence(&mesh)?;
    let mut best: Vec<Option<(Clustering, f64)>> = vec![None; METHODS.len()];
    one_thread(|| {
        for _ in 0..ROUNDS {
            for (name, best) in METHODS.iter().zip(&mut best) {
                let start = Instant::now();
                let clustering = if *name == "graph-serial" {
                    let method: Method = format!("serial:{size}").parse()?;
                    serial_neighbor(
                        &ConstraintGraph::from_incidence(&incidence),
                        method.max_size(),
                    )
                } else {
                    cluster(format!("{name}:{size}").parse()?, &incidence)
                };
                let ms = start.elapsed().as_secs_f64() * 1e3;
                if best.as_ref().is_none_or(|(_, known)| ms < *known) {
                    *best = Some((clustering, ms));
                }
            }
        }
        Ok(())
    })?;
    let (mut problems, mut colorings, mut schedules) = (Vec::new(), Vec::new(), Vec::new());
    for (clustering, ms) in best.into_iter().flatten() {
        let problem = Problem::new(&incidence, clustering);
        for (coloring, color_ms) in problem.colorings(&["scgc"])? {
            schedules.push(Schedule::new(&problem.clustering, &coloring));
            colorings.push((coloring.color_count(), color_ms));
        }
        problems.push((problem, ms));
    }
    let solve = solve_ms(&mesh, &schedules)?;
    let rows = METHODS.iter().zip(&problems).zip(&colorings).zip(solve);
    Ok(Row {
        tets: mesh.tets.len(),
        size,
        clustered: rows
            .map(
                |(((method, (problem, ms)), &(colors, color_ms)), solve_ms)| Clustered {
                    method: (*method).to_owned(),
                    clusters: problem.clustering.occupied(),
                    largest: problem.clustering.max_size(),
                    colors,
                    bound: problem.clusters.clique_bound(),
                    cluster_ms: *ms,
                    color_ms,
                    solve_ms,
                },
            )
            .collect(),
    })
}

/// The paper's row for a method of ours: both readings of its own algorithm stand beside the same.
fn paper(size: u32, method: &str) -> Option<&'static printed::Clustered> {
    let method = match method {
        "serial-loose" | "graph-serial" => "serial",
        method => method,
    };
    let mut rows = printed::TABLE_1.iter();
    rows.find(|row| row.size == size && row.method == method)
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut head = vec![
        "size".to_owned(),
        "method".to_owned(),
        "largest cluster".to_owned(),
    ];
    for what in ["clusters", "colors"] {
        head.extend(header(what));
    }
    head.push("bound".to_owned());
    head.extend(header("cluster ms"));
    head.push("Greedy K's time over it, paper".to_owned());
    head.push("ours".to_owned());
    head.push("color ms".to_owned());
    head.push("solve ms".to_owned());
    head.extend(header("frames a second"));
    let mut table = Table::new("", head);
    for row in rows {
        let greedy = row.of("greedy-k").map_or(f64::NAN, |c| c.cluster_ms);
        for c in &row.clustered {
            let printed = paper(row.size, &c.method);
            let printed_greedy = paper(row.size, "greedy-k");
            let mut cells = vec![
                row.size.to_string(),
                c.method.clone(),
                c.largest.to_string(),
            ];
            cells.extend(compared(printed.map(|p| p.clusters), c.clusters as f64));
            cells.extend(compared(printed.map(|p| p.colors), c.colors as f64));
            cells.push(c.bound.to_string());
            cells.extend(compared(printed.map(|p| p.cluster_ms), c.cluster_ms));
            let ratio = printed
                .zip(printed_greedy)
                .map(|(p, g)| g.cluster_ms / p.cluster_ms);
            let [theirs, ours, _] = compared(ratio, greedy / c.cluster_ms);
            cells.extend([theirs, ours]);
            cells.push(format!("{:.3}", c.color_ms));
            cells.push(format!("{:.3}", c.solve_ms));
            cells.extend(compared(printed.map(|p| p.fps), c.fps()));
            table.push(cells);
        }
    }
    let tets = rows.first().map_or(0, |row| row.tets);
    Ok(Page {
        title: "Table 1: clusterings by size".to_owned(),
        parts: vec![
            Part::Text(format!(
                "The liver of {tets} tets (the paper's: 11,367), one thread, the shortest of {ROUNDS} times in turns; the \
                 paper's times are of another machine, so it is the ratio of Greedy K-Neighbor's time to each that is \
                 compared. Colors are SCGC's. Frames a second are of coloring and a step of {ITERATIONS} iterations, nothing \
                 else; the paper does not say what its frames hold.\n\n\
                 `serial` is Algorithm 2 with Ks counting the seed; `serial-loose` takes Ks neighbors beside it, which the \
                 paper's cluster counts need: at least 11,367 / 5 = 2274 clusters of 5, and it prints 1972. Greedy K exceeds \
                 its size there, too (414 clusters of 25 hold 10,350 tets at most). `greedy-k` is a reconstruction of \
                 Ton-That et al. with a heap instead of searches. `serial` and `pressure` work from lists of particles; \
                 `graph-serial` is `serial` over the constraint graph, which is built first, as in the paper."
            )),
            Part::Table(table),
        ],
    })
}
