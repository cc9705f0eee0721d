//! Tests of the quick pages: they are complete, have the paper's rows, and correct values where these do not depend on
//! the machine.

use std::path::PathBuf;

use incise::coloring::{Order, greedy};
use incise::graph::Clustering;
use serde::de::DeserializeOwned;

use super::claims::{Evidence, Verdict};
use super::colorings::{ALGORITHMS, Problem, occupied};
use super::convergence::{PaperMethod, Setup, TIME_STEP, Trial, norm};
use super::paper_mesh::{PaperMesh, incidence};
use super::{What, printed, run};
use crate::experiment::{Backend, ExperimentArguments};

/// Arguments with a temporary folder, removed at the end.
struct Folder(ExperimentArguments);

impl Folder {
    fn new(name: &str) -> Self {
        let id = std::process::id();
        let out = std::env::temp_dir().join(format!("incise-paper-{name}-{id}"));
        Self(ExperimentArguments {
            quick: true,
            models: None,
            backend: Backend::Cpu,
            out,
            shard: None,
            complete: false,
        })
    }

    fn page(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.out.join(format!("{name}.md"))).unwrap()
    }

    fn rows<R: DeserializeOwned>(&self, name: &str) -> Vec<R> {
        let path: PathBuf = self.0.out.join(format!("{name}.json"));
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Errors of the removal are harmless in a temporary folder.
        let _ = std::fs::remove_dir_all(&self.0.out);
    }
}

/// The cells of the rows of a page that begin with these.
fn cells(page: &str, first: &[&str]) -> Vec<Vec<String>> {
    let rows = page.lines().filter_map(|line| line.strip_prefix('|'));
    let rows = rows.map(|row| row.split('|').map(|cell| cell.trim().to_owned()).collect());
    rows.filter(|row: &Vec<String>| row.iter().zip(first).all(|(cell, word)| cell == word))
        .collect()
}

/// Ratio of the two cells before it, to the precision of three digits.
fn is_ratio(row: &[String], place: usize) -> bool {
    let number = |i: usize| row[i].parse::<f64>().unwrap();
    let expected = number(place - 1) / number(place - 2);
    // Each of the three is rounded at the third digit, ratios below 1 to a thousandth.
    (number(place) / expected - 1.0).abs() < 0.02 || (number(place) - expected).abs() < 1e-3
}

#[test]
fn table_1_has_the_papers_rows() {
    let folder = Folder::new("table1");
    run(What::Table1, &folder.0).unwrap();
    let page = folder.page("paper-table1");
    for paper in &printed::TABLE_1 {
        let rows = cells(&page, &[&paper.size.to_string(), paper.method]);
        let [row] = &rows[..] else { panic!("{rows:?}") };
        // Size, method, largest; clusters and colors with their ratios.
        assert_eq!(row[3], paper.clusters.to_string());
        assert_eq!(row[6], paper.colors.to_string());
        assert!(is_ratio(row, 5) && is_ratio(row, 8), "{row:?}");
    }
    let mesh = PaperMesh::named("liver_11k")
        .unwrap()
        .mesh(&folder.0)
        .unwrap();
    let incidence = incidence(&mesh).unwrap();
    for row in folder.rows::<super::table1::Row>("paper-table1") {
        for method in ["greedy-k", "serial", "pressure"] {
            let found = row.of(method).unwrap();
            let method = format!("{method}:{}", row.size).parse().unwrap();
            let clustering = incise::clustering::cluster(method, &incidence);
            let clusters = incidence.quotient(&clustering);
            assert_eq!(found.clusters, clustering.occupied());
            assert!(found.largest <= row.size as usize);
            // SCGC is greedy in its order, whatever its shortcuts.
            let colors = greedy(&clusters, Order::LargestFirst).color_count();
            assert_eq!(found.colors, colors);
            assert!(found.bound <= found.colors);
        }
        // One algorithm, from particles and by the graph.
        let counts = ["serial", "graph-serial"].map(|name| row.of(name).unwrap().clusters);
        assert_eq!(counts[0], counts[1]);
    }
}

/// Table 2 and figure 4, and the claims that are decided from them.
#[test]
fn table_2_and_figure_4_have_the_papers_rows() {
    let folder = Folder::new("table2");
    run(What::Table2, &folder.0).unwrap();
    let page = folder.page("paper-table2");
    for model in &printed::TABLE_2 {
        for paper in &model.rows {
            // Two tables in each of three readings.
            let rows = cells(&page, &[model.body, paper.algorithm]);
            assert_eq!(rows.len(), 6, "{rows:?}");
            for row in rows.iter().step_by(2) {
                assert_eq!(row[9], paper.colors.to_string());
                assert!(
                    [4, 7, 11, 17].iter().all(|&place| is_ratio(row, place)),
                    "{row:?}"
                );
            }
            for row in rows.iter().skip(1).step_by(2) {
                assert_eq!(row[2], model.cut_ms.to_string());
                assert!(
                    [4, 7, 10, 13].iter().all(|&place| is_ratio(row, place)),
                    "{row:?}"
                );
            }
        }
    }
    let rows: Vec<super::table2::Row> = folder.rows("paper-table2");
    assert_eq!(rows.len(), 12);
    for row in &rows {
        let named: Vec<&str> = row.colored.iter().map(|c| c.algorithm.as_str()).collect();
        assert_eq!(named, ALGORITHMS);
        assert!(row.colored.iter().all(|c| c.colors >= row.bound));
        // ECL-GC, SCGC with and without its third shortcut and greedy are one coloring.
        let same = ["ecl-gc", "scgc", "scgc:12", "greedy"].map(|name| {
            let c = row.of(name).unwrap();
            (c.colors, c.range, c.std, c.chi2, c.tets)
        });
        assert!(same.iter().all(|c| *c == same[0]), "{same:?}");
    }
    // A body at rest has as many tets in both readings; a cut one more, and more clusters.
    for of_body in rows.chunks(3) {
        assert_eq!(of_body[0].tets, of_body[1].tets);
        assert!(of_body[2].tets > of_body[1].tets);
        assert!(of_body[2].clusters > of_body[1].clusters);
    }
    run(What::Fig4, &folder.0).unwrap();
    let fig4 = folder.page("paper-fig4");
    for (name, tets) in printed::FIGURE_4 {
        assert_eq!(cells(&fig4, &[name, &tets.to_string()]).len(), 2);
    }
    // Claims are decided from the cells that were measured, and nothing is measured again.
    std::fs::remove_dir_all(folder.0.out.join("meshes")).unwrap();
    let cells = super::claims::experiment(&folder.0).cells;
    let measured = ["table2-", "fig4-"];
    let cells = cells
        .iter()
        .filter(|cell| measured.iter().any(|prefix| cell.id.starts_with(prefix)));
    let evidence: Vec<Evidence> = cells.map(|cell| (cell.measure)().unwrap()).collect();
    assert!(evidence.len() > rows.len());
    assert!(!folder.0.out.join("meshes").exists());
    let claims = super::claims::rules::claims(&evidence);
    let verdict = |wanted: &str| {
        let found = claims.iter().find(|claim| claim.claim == wanted);
        found.unwrap_or_else(|| panic!("{wanted}")).verdict
    };
    assert_eq!(
        verdict("clustering lowers the number of colors (5.1)"),
        Verdict::Confirmed
    );
    // A theorem for every mesh.
    let same = "SCGC and ECL-GC find the same colors and distribution (Table 2)";
    assert_eq!(verdict(same), Verdict::Confirmed);
}

#[test]
fn figure_9_is_pictured() {
    let folder = Folder::new("fig9");
    run(What::Fig9, &folder.0).unwrap();
    let page = folder.page("paper-fig9");
    for paper in &printed::FIGURE_9 {
        for (algorithm, colors) in printed::FIGURE_9_ALGORITHMS.iter().zip(paper.colors) {
            let rows = cells(&page, &[paper.body, "serial:10", algorithm]);
            let [row] = &rows[..] else { panic!("{rows:?}") };
            assert_eq!(row[10], colors.to_string());
            assert!(
                [5, 8, 12].iter().all(|&place| is_ratio(row, place)),
                "{row:?}"
            );
        }
    }
    let drawings = printed::FIGURE_9.len() * printed::FIGURE_9_ALGORITHMS.len();
    for i in 1..=drawings {
        let svg = std::fs::read_to_string(folder.0.out.join(format!("paper-fig9-{i}.svg")));
        assert!(svg.unwrap().matches("<path").count() > 100);
    }
}

#[test]
fn table_3_has_the_papers_rows() {
    let folder = Folder::new("table3");
    run(What::Table3, &folder.0).unwrap();
    let table3 = folder.page("paper-table3");
    for paper in &printed::TABLE_3 {
        let rows = cells(&table3, &[]);
        let count = paper.iterations.to_string();
        // Once for each setup.
        assert_eq!(
            rows.iter().filter(|row| row[1] == count).count(),
            Setup::ALL.len()
        );
    }
}

/// The force whose spectrum is drawn is the one whose norm the solver reports.
#[test]
fn forces_have_the_norm_that_the_solver_reports() {
    let folder = Folder::new("forces");
    for solving in [PaperMethod::GaussSeidel(5), PaperMethod::Jacobi] {
        let trial = Trial::new(Setup::Gentle, solving, &folder.0).unwrap();
        let (solver, _) = trial.step(3).unwrap();
        let reported = solver.residuals(TIME_STEP).unwrap().force;
        let ratio = norm(&trial.forces(&solver).unwrap()) / reported;
        // Two implementations in double precision; forces cancel to a tenth of their parts.
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
}

/// Colors of a mesh with a known answer: all tets of a fan conflict.
#[test]
fn colors_of_a_clique() {
    let fan: Vec<[u32; 4]> = (0..9)
        .map(|i| [0, 3 * i + 1, 3 * i + 2, 3 * i + 3])
        .collect();
    let incidence = incise::graph::Incidence::from_constraints(28, fan).unwrap();
    let problem = Problem::new(&incidence, Clustering::none(9));
    for (coloring, _) in problem.colorings(&ALGORITHMS).unwrap() {
        assert_eq!(coloring.color_count(), 9);
    }
    // Clusters that have lost all members need no color.
    let mut clustering = Clustering::none(9);
    let last = clustering.labels()[8];
    clustering.remove(0);
    clustering.assign(0, last);
    let clustering = occupied(&clustering).unwrap();
    assert_eq!((clustering.cluster_count(), clustering.occupied()), (8, 8));
    let problem = Problem::new(&incidence, clustering);
    for (coloring, _) in problem.colorings(&["scgc", "auto"]).unwrap() {
        assert_eq!(coloring.color_count(), 8);
    }
}
