//! `incise color`: the promised keys, rows in the order of the input, and a coloring verified by code of this file.

use std::collections::{HashMap, HashSet};

use serde_json::Value;

use crate::support::{Sandbox, keys, names};

const KEYS: &str = "input, constraints, particles, clusters, edges, algorithm, clustering, backend, seed, colors, \
                    max_clique, std, range, chi2, max_over_mean, lanes_32, lanes_256, by_constraints, rounds, verified, ms";

const EVENNESS: &str = "std, range, chi2, max_over_mean, lanes_32, lanes_256";

/// The particles of the tets of a legacy VTK file as this program writes it.
fn tets(vtk: &str) -> Vec<[usize; 4]> {
    let mut lines = vtk.lines().skip_while(|line| !line.starts_with("CELLS "));
    let count: usize = lines
        .next()
        .unwrap()
        .split(' ')
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    let tets = lines.take(count).map(|line| {
        let numbers: Vec<usize> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        assert_eq!(numbers[0], 4);
        [numbers[1], numbers[2], numbers[3], numbers[4]]
    });
    tets.collect()
}

/// Cluster and color of each constraint; asserts header and order.
pub(crate) fn rows(csv: &str) -> Vec<(usize, usize)> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("constraint,cluster,color"));
    let rows = lines.enumerate().map(|(i, line)| {
        let numbers: Vec<usize> = line.split(',').map(|word| word.parse().unwrap()).collect();
        assert_eq!((numbers.len(), numbers[0]), (3, i), "{line}");
        (numbers[1], numbers[2])
    });
    rows.collect()
}

/// Two tets of different clusters that share a particle have different colors; a cluster has one color.
fn assert_proper(tets: &[[usize; 4]], rows: &[(usize, usize)]) {
    assert_eq!(tets.len(), rows.len());
    let mut color_of = HashMap::new();
    for &(cluster, color) in rows {
        assert_eq!(
            *color_of.entry(cluster).or_insert(color),
            color,
            "cluster {cluster} has two colors"
        );
    }
    let mut owner = HashMap::new();
    for (tet, &(cluster, color)) in tets.iter().zip(rows) {
        for &particle in tet {
            let first = *owner.entry((particle, color)).or_insert(cluster);
            assert_eq!(
                first, cluster,
                "clusters {first} and {cluster} share particle {particle} and color {color}"
            );
        }
    }
}

/// The figures of a report on how even the colors are, computed again from the rows.
pub(crate) fn assert_evenness(report: &Value, rows: &[(usize, usize)]) {
    let close = |value: &Value, expected: f64| {
        let value = value.as_f64().unwrap();
        // Sums of a few thousand small whole numbers, in another order.
        assert!(
            (value - expected).abs() <= 1e-9 * expected.abs().max(1.0),
            "{value} is not {expected} in {report}"
        );
    };
    let by_cluster: HashSet<(usize, usize)> = rows.iter().copied().collect();
    let colors_of_clusters: Vec<usize> = by_cluster.iter().map(|row| row.1).collect();
    let colors_of_constraints: Vec<usize> = rows.iter().map(|row| row.1).collect();
    for (figures, colors) in [
        (report, colors_of_clusters),
        (&report["by_constraints"], colors_of_constraints),
    ] {
        let mut sizes = HashMap::new();
        for color in &colors {
            *sizes.entry(color).or_insert(0usize) += 1;
        }
        let sizes: Vec<usize> = sizes.into_values().collect();
        let (total, k) = (colors.len() as f64, sizes.len() as f64);
        let mean = total / k;
        let max = *sizes.iter().max().unwrap();
        let squares: f64 = sizes.iter().map(|&n| (n as f64 - mean).powi(2)).sum();
        let lanes = |width: usize| {
            let lanes: usize = sizes.iter().map(|n| n.div_ceil(width) * width).sum();
            total / lanes as f64
        };
        assert_eq!(figures["range"], max - sizes.iter().min().unwrap());
        close(&figures["std"], (squares / k).sqrt());
        close(&figures["chi2"], squares / mean / (k - 1.0));
        close(&figures["max_over_mean"], max as f64 / mean);
        close(&figures["lanes_32"], lanes(32));
        close(&figures["lanes_256"], lanes(256));
    }
}

#[test]
fn colorings_are_proper_and_reported_truly() {
    let sandbox = Sandbox::with_mesh();
    sandbox.good(&["mesh", "generate", "torus", "--tets", "1200", "torus.node"]);
    sandbox.good(&["mesh", "convert", "torus.node", "torus.vtk"]);
    for (file, source) in [("box.vtk", "box.vtk"), ("torus.ele", "torus.vtk")] {
        let tets = tets(&sandbox.read(source));
        for clustering in ["none", "serial:5", "serial:10"] {
            let mut all = Vec::new();
            for algorithm in ["greedy", "scgc", "scgc:2", "jones-plassmann", "ecl-gc"] {
                let report: Value = serde_json::from_str(&sandbox.good(&[
                    "color",
                    file,
                    "--algorithm",
                    algorithm,
                    "--clustering",
                    clustering,
                    "--csv",
                    "colors.csv",
                    "--json",
                ]))
                .unwrap();
                let rows = rows(&sandbox.read("colors.csv"));
                assert_proper(&tets, &rows);
                assert_evenness(&report, &rows);
                let clusters: HashSet<usize> = rows.iter().map(|row| row.0).collect();
                let colors: HashSet<usize> = rows.iter().map(|row| row.1).collect();
                assert_eq!(report["constraints"], tets.len());
                assert_eq!(report["clusters"], clusters.len());
                assert_eq!(report["colors"], colors.len());
                assert!(report["max_clique"].as_u64() <= report["colors"].as_u64());
                assert_eq!(
                    (&report["algorithm"], &report["clustering"]),
                    (&algorithm.into(), &clustering.into())
                );
                assert_eq!(
                    (&report["verified"], &report["backend"]),
                    (&true.into(), &"cpu".into())
                );
                assert_eq!(report["input"], file);
                let limit = clustering
                    .strip_prefix("serial:")
                    .map_or(1, |limit| limit.parse().unwrap());
                let mut sizes = HashMap::new();
                for (cluster, _) in &rows {
                    *sizes.entry(cluster).or_insert(0) += 1;
                }
                assert!(sizes.values().all(|size| *size <= limit), "{clustering}");
                all.push(rows);
            }
            let same = all.iter().all(|rows| *rows == all[0]);
            assert!(
                same,
                "greedy and the parallel ones differ with {clustering}"
            );
        }
    }
}

/// Every algorithm returns a proper coloring, verified by this file, and balancing keeps the number of colors.
#[test]
fn every_algorithm_and_clustering_can_be_named() {
    let sandbox = Sandbox::with_mesh();
    let tets = tets(&sandbox.read("box.vtk"));
    let color = |arguments: &[&str]| {
        let all = [
            &["color", "box.vtk", "--json", "--csv", "colors.csv"],
            arguments,
        ]
        .concat();
        let report: Value = serde_json::from_str(&sandbox.good(&all)).unwrap();
        let rows = rows(&sandbox.read("colors.csv"));
        assert_proper(&tets, &rows);
        assert_evenness(&report, &rows);
        assert_eq!(report["verified"], true);
        assert!(report["rounds"].as_u64() >= Some(1));
        report
    };
    for algorithm in [
        "auto",
        "vivace",
        "vivace:4",
        "wlc",
        "wlc:10",
        "mcs",
        "greedy:natural",
        "greedy:random",
        "greedy:degree-bound",
        "greedy:smallest-last",
        "dsatur",
        "iterated-greedy:20",
        "tabu:500",
    ] {
        let report = color(&["--algorithm", algorithm, "--seed", "3"]);
        assert_eq!(report["algorithm"], algorithm);
    }
    for clustering in [
        "none",
        "serial:5",
        "serial-loose:5",
        "greedy-k:5",
        "pressure:5",
    ] {
        let plain = color(&["--clustering", clustering]);
        let even = color(&["--clustering", clustering, "--balance"]);
        assert_eq!(
            (&even["colors"], &even["balanced"]),
            (&plain["colors"], &"clusters".into())
        );
        assert!(even["range"].as_u64() <= plain["range"].as_u64().map(|range| range.min(2)));
        let even = color(&["--clustering", clustering, "--balance=constraints"]);
        let chi2 = |report: &Value| report["by_constraints"]["chi2"].as_f64().unwrap();
        assert!(chi2(&even) <= chi2(&plain));
    }
}

#[test]
fn the_object_has_exactly_the_promised_keys() {
    let sandbox = Sandbox::with_mesh();
    let text = sandbox.good(&["color", "box.vtk", "--seed", "7", "--json"]);
    assert_eq!(text.lines().count(), 1);
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(keys(&report), names(KEYS));
    assert_eq!(keys(&report["by_constraints"]), names(EVENNESS));
    assert_eq!(keys(&report["ms"]), names("read, graph, cluster, color"));
    assert_eq!(
        (&report["seed"], &report["clustering"], &report["algorithm"]),
        (&7.into(), &"none".into(), &"auto".into())
    );
    assert!(!text.contains("null"), "{text}");
    assert_eq!(sandbox.names("."), ["box.vtk"]);
}

#[test]
fn without_json_there_is_a_table() {
    let table = Sandbox::with_mesh().good(&["color", "box.vtk", "--clustering", "serial:5"]);
    for part in [
        "box.vtk",
        "colors",
        "by auto",
        "(serial:5)",
        "constraints, particles",
        "busy lanes",
        "verified",
        "yes",
    ] {
        assert!(table.contains(part), "{part} is not in\n{table}");
    }
}
