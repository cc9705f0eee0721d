//! `incise color` on graph files: colorings proved proper by the edges that this file wrote, and numbers of colors
//! within what is known of the graphs.

use std::fmt::Write;

use serde_json::Value;

use crate::color::{assert_evenness, rows};
use crate::support::Sandbox;

/// A graph with vertices from 0, and the least number of colors that it can have.
struct Known {
    vertices: usize,
    edges: Vec<(usize, usize)>,
    chromatic: usize,
}

/// From one edge by `steps` constructions of Mycielski (1955): each needs one color more and makes no triangle.
fn mycielski(steps: usize) -> Known {
    let (mut n, mut edges) = (2, vec![(0, 1)]);
    for _ in 0..steps {
        let mut more = edges.clone();
        for &(a, b) in &edges {
            more.extend([(a, n + b), (b, n + a)]);
        }
        more.extend((0..n).map(|v| (n + v, 2 * n)));
        (n, edges) = (2 * n + 1, more);
    }
    Known {
        vertices: n,
        edges,
        chromatic: steps + 2,
    }
}

/// Squares of a board of 5 by 5, adjacent if a queen goes from one to the other; 5 is prime to 6, so 5 colors do.
fn queens() -> Known {
    let mut edges = Vec::new();
    for a in 0..25usize {
        for b in 0..a {
            let (x, y) = ((a % 5).abs_diff(b % 5), (a / 5).abs_diff(b / 5));
            if x == 0 || y == 0 || x == y {
                edges.push((a, b));
            }
        }
    }
    Known {
        vertices: 25,
        edges,
        chromatic: 5,
    }
}

fn complete(n: usize) -> Known {
    Known {
        vertices: n,
        edges: (0..n).flat_map(|a| (0..a).map(move |b| (a, b))).collect(),
        chromatic: n,
    }
}

/// Each edge in both directions, and so counted in the header, as in many published files.
fn dimacs(graph: &Known) -> String {
    let mut text = format!(
        "c made by a test\np edge {} {}\n",
        graph.vertices,
        2 * graph.edges.len()
    );
    for (a, b) in &graph.edges {
        let (a, b) = (a + 1, b + 1);
        write!(text, "e {a} {b}\ne {b} {a}\n").unwrap();
    }
    text
}

/// The Laplacian, lower triangle.
fn matrix_market(graph: &Known) -> String {
    let mut text = format!(
        "%%MatrixMarket matrix coordinate integer symmetric\n% made by a test\n{0} {0} {1}\n",
        graph.vertices,
        graph.vertices + graph.edges.len()
    );
    for v in 0..graph.vertices {
        let degree = graph.edges.iter().filter(|e| e.0 == v || e.1 == v).count();
        writeln!(text, "{0} {0} {degree}", v + 1).unwrap();
    }
    for (a, b) in &graph.edges {
        writeln!(text, "{} {} -1", a.max(b) + 1, a.min(b) + 1).unwrap();
    }
    text
}

#[test]
fn known_graphs_get_enough_colors_and_not_too_many() {
    let sandbox = Sandbox::new();
    for (name, graph, clique) in [
        ("mycielski3", mycielski(2), 2),
        ("mycielski5", mycielski(4), 2),
        ("queen5_5", queens(), 5),
        ("k33", complete(33), 33),
        ("k1", complete(1), 1),
    ] {
        let degree = |v: usize| graph.edges.iter().filter(|e| e.0 == v || e.1 == v).count();
        let most = (0..graph.vertices).map(degree).max().unwrap() + 1;
        sandbox.write(&format!("{name}.col"), dimacs(&graph));
        sandbox.write(&format!("{name}.MTX"), matrix_market(&graph));
        let default = sandbox.good(&["color", &format!("{name}.col"), "--json"]);
        let default: Value = serde_json::from_str(&default).unwrap();
        assert_eq!(default["colors"], graph.chromatic, "{name}");
        let mut all = Vec::new();
        for file in [format!("{name}.col"), format!("{name}.MTX")] {
            for algorithm in ["scgc", "greedy"] {
                let arguments = [
                    "color",
                    &file,
                    "--algorithm",
                    algorithm,
                    "--csv",
                    "colors.csv",
                    "--json",
                ];
                let report: Value = serde_json::from_str(&sandbox.good(&arguments)).unwrap();
                let rows = rows(&sandbox.read("colors.csv"));
                assert_eq!(rows.len(), graph.vertices);
                for &(a, b) in &graph.edges {
                    assert_ne!(rows[a].1, rows[b].1, "{file}: {a} and {b}");
                }
                let colors = rows.iter().map(|row| row.1).max().unwrap() + 1;
                assert!(
                    (graph.chromatic..=most).contains(&colors),
                    "{file}: {colors}"
                );
                assert_eq!(report["input"], file.as_str());
                assert_eq!(report["colors"], colors);
                assert_eq!(report["constraints"], graph.vertices);
                assert_eq!(report["clusters"], graph.vertices);
                assert_eq!(report["edges"], graph.edges.len());
                assert_eq!(report["particles"], 0);
                assert_eq!(report["max_clique"], clique);
                assert_eq!(report["verified"], true);
                if colors > 1 {
                    assert_evenness(&report, &rows);
                }
                all.push(rows);
            }
        }
        assert!(all.iter().all(|rows| *rows == all[0]), "{name}");
    }
}

#[test]
fn graphs_are_clustered_serially() {
    let sandbox = Sandbox::new();
    let graph = mycielski(5);
    sandbox.write("graph.col", dimacs(&graph));
    let text = sandbox.good(&[
        "color",
        "graph.col",
        "--clustering",
        "serial:3",
        "--csv",
        "colors.csv",
        "--json",
    ]);
    let report: Value = serde_json::from_str(&text).unwrap();
    let rows = rows(&sandbox.read("colors.csv"));
    for &(a, b) in &graph.edges {
        assert!(rows[a].0 == rows[b].0 || rows[a].1 != rows[b].1, "{a}, {b}");
    }
    let clusters = rows.iter().map(|row| row.0).max().unwrap() + 1;
    assert!(clusters < graph.vertices);
    assert_eq!(report["clusters"], clusters);
    assert_eq!(report["verified"], true);
    assert_evenness(&report, &rows);
    let table = sandbox.good(&["color", "graph.col"]);
    assert!(
        table.contains("vertices") && !table.contains("particles"),
        "{table}"
    );
}

#[test]
fn graphs_without_edges_or_vertices() {
    let sandbox = Sandbox::new();
    sandbox.write("none.col", "p edge 0 0\n");
    sandbox.write(
        "loose.mtx",
        "%%MatrixMarket matrix coordinate pattern general\n70 70 0\n",
    );
    for (file, vertices, colors) in [("none.col", 0, 0), ("loose.mtx", 70, 1)] {
        for algorithm in ["scgc", "greedy"] {
            let text = sandbox.good(&[
                "color",
                file,
                "--algorithm",
                algorithm,
                "--csv",
                "colors.csv",
                "--json",
            ]);
            let report: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(rows(&sandbox.read("colors.csv")).len(), vertices);
            assert_eq!(report["colors"], colors);
            assert_eq!(report["max_clique"], colors);
            assert_eq!(report["verified"], true);
        }
    }
}
