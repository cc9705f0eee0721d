//! Figure 4: time to color and colors by algorithm on nine bodies, unclustered and clustered.

use incise::clustering::{Method, cluster};
use serde::{Deserialize, Serialize};

use super::colorings::Problem;
use super::paper_mesh::{PaperMesh, incidence};
use super::printed;
use crate::experiment::{
    Axis, Cell, Experiment, ExperimentArguments, Page, Part, Plot, Series, Style, Table,
};

/// The paper's, then ours.
const ALGORITHMS: [&str; 7] = ["vivace", "wlc", "mcs", "greedy", "ecl-gc", "scgc", "auto"];
pub(super) const CLUSTERINGS: [&str; 2] = ["none", "serial:10"];

/// A body in one clustering.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) body: String,
    /// In the paper.
    printed_tets: usize,
    pub(super) tets: usize,
    pub(super) clustering: String,
    clusters: usize,
    bound: usize,
    pub(super) colored: Vec<Colored>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Colored {
    pub(super) algorithm: String,
    pub(super) colors: usize,
    pub(super) ms: f64,
}

impl Row {
    pub(super) fn of(&self, algorithm: &str) -> Option<&Colored> {
        self.colored.iter().find(|c| c.algorithm == algorithm)
    }
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let mut cells = Vec::new();
    for (name, tets) in printed::FIGURE_4 {
        for clustering in CLUSTERINGS {
            let arguments = arguments.clone();
            let id = format!("{name}-{clustering}").replace(['_', ':'], "-");
            cells.push(Cell::new(id, move || {
                measure(name, tets, clustering, &arguments)
            }));
        }
    }
    Experiment {
        name: "paper-fig4",
        cells,
        page,
    }
}

fn measure(
    name: &str,
    printed_tets: usize,
    clustering: &str,
    arguments: &ExperimentArguments,
) -> anyhow::Result<Row> {
    let mesh = PaperMesh::named(name)?.mesh(arguments)?;
    let incidence = incidence(&mesh)?;
    let problem = Problem::new(
        &incidence,
        cluster(clustering.parse::<Method>()?, &incidence),
    );
    let colorings = problem.colorings(&ALGORITHMS)?;
    let colored = ALGORITHMS.iter().zip(&colorings);
    Ok(Row {
        body: name.to_owned(),
        printed_tets,
        tets: mesh.tets.len(),
        clustering: clustering.to_owned(),
        clusters: problem.clustering.occupied(),
        bound: problem.clusters.clique_bound(),
        colored: colored
            .map(|(algorithm, (coloring, ms))| Colored {
                algorithm: (*algorithm).to_owned(),
                colors: coloring.color_count(),
                ms: *ms,
            })
            .collect(),
    })
}

/// Plotted quantity of a coloring.
type Quantity = fn(&Colored) -> f64;

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(
        "Figure 4 has curves without numbers; ours are drawn in its plots. One thread, the shortest of up to three \
        times in turns, from an existing graph; `auto` from lists of particles. The paper's MCS and greedy ran on a \
        processor, \
         its other four on a GPU: on one thread, the parallel algorithms pay for rounds that gain them nothing."
            .to_owned(),
    )];
    for clustering in CLUSTERINGS {
        let of_this: Vec<&Row> = rows
            .iter()
            .filter(|row| row.clustering == clustering)
            .collect();
        let quantities: [(&str, bool, Quantity); 2] = [
            ("ms to color", true, |c| c.ms),
            ("colors", false, |c| c.colors as f64),
        ];
        for family in ["liver", "armadillo", "sphere"] {
            for (what, log, value) in quantities {
                let series = ALGORITHMS.iter().map(|algorithm| Series {
                    name: (*algorithm).to_owned(),
                    points: of_this
                        .iter()
                        .filter(|row| row.body.starts_with(family))
                        .filter_map(|row| Some((row.tets as f64, value(row.of(algorithm)?))))
                        .collect(),
                    labels: Vec::new(),
                    style: Style::Both,
                });
                parts.push(Part::Plot(Plot {
                    title: format!("{family}, clusters: {clustering}"),
                    x: Axis::log("tets"),
                    y: Axis {
                        label: what.to_owned(),
                        log,
                    },
                    series: series.collect(),
                }));
            }
        }
    }
    let head = [
        "model",
        "tets, paper",
        "ours",
        "clustering",
        "clusters",
        "bound",
    ];
    let mut head: Vec<String> = head.map(str::to_owned).into();
    for algorithm in ALGORITHMS {
        head.push(format!("{algorithm}: colors"));
        head.push("ms".to_owned());
    }
    let mut table = Table::new("", head);
    for row in rows {
        let mut cells = vec![
            row.body.clone(),
            row.printed_tets.to_string(),
            row.tets.to_string(),
            row.clustering.clone(),
            row.clusters.to_string(),
            row.bound.to_string(),
        ];
        for colored in &row.colored {
            cells.push(colored.colors.to_string());
            cells.push(format!("{:.2}", colored.ms));
        }
        table.push(cells);
    }
    parts.push(Part::Table(table));
    Ok(Page {
        title: "Figure 4: time to color and colors".to_owned(),
        parts,
    })
}
