//! Table 2: colors, their distribution and times by algorithm, on four models.
//!
//! The paper says "following constraint graph clustering", prints cluster counts that fit no single Ks (5.5 to 9 tets a
//! cluster), and color counts twice those of its Table 1 and Figure 9, which are near those of unclustered graphs. So
//! three readings are run: no clusters, clusters of the size that fits Table 1 best (Ks = 5 beside the seed), and the
//! same halfway through a cut without merging, where new clusters crowd around the blade.

use incise::Simulation;
use incise::clustering::{Method, cluster};
use serde::{Deserialize, Serialize};

use super::colorings::{ALGORITHMS, Colored, ITERATIONS, Problem, occupied};
use super::compared::{compared, header, mean, number};
use super::paper_mesh::{PaperMesh, incidence};
use super::printed;
use super::scene::cut_at_rest;
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part, Table};

/// Frames of the stroke, of which the reading in the midst of a cut takes the state after half.
const FRAMES: u64 = 60;

/// Reading of the paper: the graph that is colored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Reading {
    Unclustered,
    Clustered,
    Cut,
}

impl Reading {
    const ALL: [Self; 3] = [Self::Unclustered, Self::Clustered, Self::Cut];

    fn id(self) -> &'static str {
        match self {
            Self::Unclustered => "unclustered",
            Self::Clustered => "clustered",
            Self::Cut => "cut",
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Unclustered => "unclustered",
            Self::Clustered => "clustered, 5 beside the seed",
            Self::Cut => "the same, halfway through a cut",
        }
    }

    fn clustering(self) -> &'static str {
        match self {
            Self::Unclustered => "none",
            Self::Clustered | Self::Cut => "serial-loose:5",
        }
    }
}

/// One model in one reading.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) body: String,
    pub(super) reading: Reading,
    pub(super) tets: usize,
    pub(super) clusters: usize,
    /// Largest number of clusters at a particle: a lower bound of the number of colors.
    pub(super) bound: usize,
    /// Mean of the frames that cut.
    pub(super) cut_ms: f64,
    /// In the order of [`ALGORITHMS`].
    pub(super) colored: Vec<Colored>,
}

impl Row {
    pub(super) fn of(&self, algorithm: &str) -> Option<&Colored> {
        self.colored.iter().find(|c| c.algorithm == algorithm)
    }
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let mut cells = Vec::new();
    for model in &printed::TABLE_2 {
        for reading in Reading::ALL {
            let (name, arguments) = (model.body, arguments.clone());
            let id = format!("{}-{}", name.replace('_', "-"), reading.id());
            cells.push(Cell::new(id, move || measure(name, reading, &arguments)));
        }
    }
    Experiment {
        name: "paper-table2",
        cells,
        page,
    }
}

fn measure(name: &str, reading: Reading, arguments: &ExperimentArguments) -> anyhow::Result<Row> {
    let body = PaperMesh::named(name)?;
    let mut mesh = body.mesh(arguments)?;
    let clustering = reading.clustering();
    let scene = cut_at_rest(body, &mesh, arguments, clustering, FRAMES, 1)?;
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let mut clusters = cluster(clustering.parse::<Method>()?, &incidence(&mesh)?);
    let mut cut = Vec::new();
    let mut taken = false;
    for frame in 0..FRAMES + 2 {
        let report = simulation.step()?;
        if report.cut.is_some() {
            cut.push(report.ms.cut);
        }
        // Halfway, or at the first later frame in which the blade cuts the body.
        if reading == Reading::Cut && !taken && frame >= FRAMES / 2 && !cut.is_empty() {
            taken = true;
            mesh = simulation.mesh().clone();
            clusters = occupied(&simulation.clustering())?;
        }
    }
    anyhow::ensure!(!cut.is_empty(), "the blade missed {name}");
    let problem = Problem::new(&incidence(&mesh)?, clusters);
    Ok(Row {
        body: name.to_owned(),
        reading,
        tets: mesh.tets.len(),
        clusters: problem.clustering.occupied(),
        bound: problem.clusters.clique_bound(),
        cut_ms: mean(cut),
        colored: problem.measure(&mesh, &ALGORITHMS)?,
    })
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(format!(
        "The paper's models by the paper's algorithms, then by ours beyond it. Absolute times are of other machines: an RTX \
         3090 there, one thread of a processor here. What is compared is the ratio between methods, so each time also stands \
         as a multiple of SCGC's. Times are the shortest of up to three, taken in turns; `color` starts from the graph, for \
         `auto` from lists of particles; `solve` is a step of {ITERATIONS} iterations in the paper's form; `cut` the mean of \
         the frames in which a blade cuts. Frames a second are of cut, color and solve one after the other, which is how the \
         paper's come about (1000 / (10 + 1.2 + 4.3) is its 65).\n\n\
         Three readings, since the caption (\"following clustering\") and the counts contradict each other: the paper's \
         cluster counts are those of no single Ks, its colors twice those of its clustered graphs in Table 1 and Figure 9."
    ))];
    for reading in Reading::ALL {
        parts.push(Part::Text(format!("## Reading: {}", reading.words())));
        let of_this: Vec<&Row> = rows.iter().filter(|row| row.reading == reading).collect();
        parts.push(Part::Table(distribution(&of_this)));
        parts.push(Part::Table(times(&of_this)));
    }
    parts.push(Part::Text(
        "## What is meant by STD, range and chi-squared\n\nThe paper gives no formulas. Of SCGC's coloring, by clusters and by \
         tets, in all the ways there are:"
            .to_owned(),
    ));
    parts.push(Part::Table(definitions(rows)));
    parts.push(Part::Text(nearest_reading(rows)));
    Ok(Page {
        title: "Table 2: colorings by algorithm".to_owned(),
        parts,
    })
}

/// Values of the paper for a body and an algorithm.
fn paper(
    body: &str,
    algorithm: &str,
) -> (Option<&'static printed::Model>, Option<printed::Colored>) {
    let model = printed::TABLE_2.iter().find(|model| model.body == body);
    let rows = model.into_iter().flat_map(|model| model.rows);
    let row = rows.into_iter().find(|row| row.algorithm == algorithm);
    (model, row)
}

fn distribution(rows: &[&Row]) -> Table {
    let mut head = vec!["model".to_owned(), "algorithm".to_owned()];
    head.extend(header("tets"));
    head.extend(header("clusters"));
    head.push("bound".to_owned());
    for what in ["colors", "STD", "range", "chi2"] {
        head.extend(header(what));
    }
    let mut table = Table::new("Colors and the sizes of their classes in clusters", head);
    for row in rows {
        for colored in &row.colored {
            let (model, paper) = paper(&row.body, &colored.algorithm);
            let mut cells = vec![row.body.clone(), colored.algorithm.clone()];
            cells.extend(compared(model.map(|m| m.tets as f64), row.tets as f64));
            cells.extend(compared(
                model.map(|m| m.clusters as f64),
                row.clusters as f64,
            ));
            cells.push(row.bound.to_string());
            cells.extend(compared(paper.map(|p| p.colors), colored.colors as f64));
            cells.extend(compared(paper.map(|p| p.std), colored.std));
            cells.extend(compared(paper.map(|p| p.range), colored.range as f64));
            cells.extend(compared(paper.map(|p| p.chi2), colored.chi2));
            table.push(cells);
        }
    }
    table
}

fn times(rows: &[&Row]) -> Table {
    let mut head = vec!["model".to_owned(), "algorithm".to_owned()];
    for what in ["cut ms", "color ms", "solve ms", "frames a second"] {
        head.extend(header(what));
    }
    for what in ["color", "solve"] {
        head.push(format!("{what} in SCGC's, paper"));
        head.push("ours".to_owned());
    }
    let mut table = Table::new("Times", head);
    for row in rows {
        let scgc = row.of("scgc");
        for colored in &row.colored {
            let (model, paper_row) = paper(&row.body, &colored.algorithm);
            let (_, paper_scgc) = paper(&row.body, "scgc");
            let mut cells = vec![row.body.clone(), colored.algorithm.clone()];
            cells.extend(compared(model.map(|m| m.cut_ms), row.cut_ms));
            cells.extend(compared(paper_row.map(|p| p.color_ms), colored.color_ms));
            cells.extend(compared(paper_row.map(|p| p.solve_ms), colored.solve_ms));
            cells.extend(compared(paper_row.map(|p| p.fps), colored.fps(row.cut_ms)));
            let both = paper_row.zip(paper_scgc);
            let printed = |ratio: Option<f64>| ratio.map_or_else(String::new, number);
            cells.push(printed(both.map(|(p, scgc)| p.color_ms / scgc.color_ms)));
            cells.push(printed(scgc.map(|scgc| colored.color_ms / scgc.color_ms)));
            cells.push(printed(both.map(|(p, scgc)| p.solve_ms / scgc.solve_ms)));
            cells.push(printed(scgc.map(|scgc| colored.solve_ms / scgc.solve_ms)));
            table.push(cells);
        }
    }
    table
}

fn definitions(rows: &[Row]) -> Table {
    let mut table = Table::new(
        "",
        [
            "model",
            "reading",
            "colors, paper",
            "ours",
            "STD, paper",
            "of all clusters (k)",
            "of a sample (k - 1)",
            "in tets",
            "range, paper",
            "in clusters",
            "in tets",
            "chi2, paper",
            "over k - 1",
            "not divided",
            "in tets, over k - 1",
        ],
    );
    for row in rows {
        let Some(scgc) = row.of("scgc") else { continue };
        let (_, paper) = paper(&row.body, "scgc");
        let printed = |value: fn(printed::Colored) -> f64| {
            paper.map_or_else(String::new, |paper| number(value(paper)))
        };
        table.push([
            row.body.clone(),
            row.reading.words().to_owned(),
            printed(|p| p.colors),
            scgc.colors.to_string(),
            printed(|p| p.std),
            number(scgc.std),
            number(scgc.sample_std()),
            number(scgc.tets[0]),
            printed(|p| p.range),
            scgc.range.to_string(),
            number(scgc.tets[1]),
            printed(|p| p.chi2),
            number(scgc.chi2),
            number(scgc.chi2_sum()),
            number(scgc.tets[2]),
        ]);
    }
    table
}

/// Reading closest to the paper's values for SCGC, by the mean factor between them.
fn nearest_reading(rows: &[Row]) -> String {
    type Value = (
        &'static str,
        fn(&Row, &Colored) -> f64,
        fn(&printed::Model, printed::Colored) -> f64,
    );
    const VALUES: [Value; 4] = [
        (
            "clusters",
            |row, _| row.clusters as f64,
            |m, _| m.clusters as f64,
        ),
        ("colors", |_, c| c.colors as f64, |_, p| p.colors),
        ("STD", |_, c| c.std, |_, p| p.std),
        ("range", |_, c| c.range as f64, |_, p| p.range),
    ];
    let mut text = "Mean factor, up or down, between SCGC's numbers and the paper's:\n".to_owned();
    for (what, ours, theirs) in VALUES {
        let mut factors = Vec::new();
        for reading in Reading::ALL {
            let of_this = rows.iter().filter(|row| row.reading == reading);
            let logs = of_this.filter_map(|row| {
                let (model, paper) = paper(&row.body, "scgc");
                let ratio = ours(row, row.of("scgc")?) / theirs(model?, paper?);
                Some(ratio.ln().abs())
            });
            factors.push((mean(logs).exp(), reading));
        }
        factors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let list: Vec<String> = factors
            .iter()
            .map(|(factor, reading)| format!("{} {factor:.2}", reading.words()))
            .collect();
        text += &format!("\n- {what}: {}", list.join("; "));
    }
    text
}
