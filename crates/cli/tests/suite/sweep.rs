//! `incise sweep`: the rows are those of single runs, for any number of shares.

use serde_json::Value;

use crate::support::{SCENE, Sandbox};

const STUDY: [&str; 8] = [
    "sweep",
    "scene.toml",
    "--set",
    "solver.substeps=2,4",
    "--set",
    "body[0].young_modulus=1e4,2e4,5e4",
    "--frames",
    "3",
];

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write(
        "scene.toml",
        format!("[report]\nevery = 1\nquantities = [\"energy\", \"volume\"]\n{SCENE}"),
    );
    sandbox
}

/// Header and rows of a table without quoted fields.
fn table(text: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let mut lines = text
        .lines()
        .map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    (lines.next().unwrap(), lines.collect())
}

/// The table without times.
fn without_times(text: &str) -> Vec<Vec<String>> {
    let (header, rows) = table(text);
    let kept = |row: &Vec<String>| -> Vec<String> {
        let pairs = row.iter().zip(&header);
        pairs
            .filter(|(_, name)| !name.starts_with("ms."))
            .map(|(field, _)| field.clone())
            .collect()
    };
    rows.iter().map(kept).collect()
}

#[test]
fn rows_are_those_of_single_runs() {
    let sandbox = sandbox();
    let outcome = sandbox.incise(&[&STUDY[..], &["--out", "study"]].concat());
    assert_eq!(outcome.code, 0, "{outcome:?}");
    // Not on a terminal: a line for each cell.
    assert_eq!(outcome.stderr.lines().count(), 6, "{outcome:?}");
    assert!(
        outcome
            .stderr
            .contains("cell 1/6: solver.substeps=2 body[0].young_modulus=1e4"),
        "{outcome:?}"
    );
    let (header, rows) = table(&sandbox.read("study/sweep.csv"));
    assert_eq!(
        header[..3],
        ["solver.substeps", "body[0].young_modulus", "outcome"]
    );
    assert_eq!(rows.len(), 6);
    let column = |name: &str| header.iter().position(|known| known == name).unwrap();
    for row in &rows {
        let scene = sandbox.read("scene.toml").replace(
            "young_modulus = 1e4",
            &format!("young_modulus = {}", row[1]),
        ) + &format!("[solver]\nsubsteps = {}\n", row[0]);
        sandbox.write("one.toml", scene);
        let run = "run one.toml --frames 3 --quiet --no-pictures --out one";
        sandbox.good(&run.split(' ').collect::<Vec<_>>());
        let frames = sandbox.read("one/frames.jsonl");
        let last: Value = serde_json::from_str(frames.lines().last().unwrap()).unwrap();
        for name in [
            "tets",
            "pieces",
            "energy.kinetic",
            "energy.elastic",
            "volume_error",
        ] {
            let expected = name.split('.').fold(&last, |value, part| &value[part]);
            assert_eq!(row[column(name)], expected.to_string(), "{name}");
        }
        assert_eq!(row[2], "complete");
        assert!(row[column("ms.total.worst")].parse::<f64>().unwrap() > 0.0);
    }
}

/// A box falls on the edge of another one and tips over it: the last force is that of the last frame, 0 where nothing
/// touches any more, and the largest is that of all frames.
#[test]
fn forces_have_their_last_and_their_largest_value() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "scene.toml",
        r#"
[world]
gravity = [0, 0, -9.81]
ground = { height = -0.1 }
[contact]
[report]
every = 1
quantities = ["force"]
[[body]]
shape = { kind = "box", tets = 200 }
scale = 0.2
[[body]]
shape = { kind = "box", tets = 200 }
scale = 0.2
position = [0.16, 0, 0.201]
"#,
    );
    let study = "sweep scene.toml --set solver.substeps=8,16 --frames 30 --quiet --out study";
    sandbox.good(&study.split(' ').collect::<Vec<_>>());
    let (header, rows) = table(&sandbox.read("study/sweep.csv"));
    let column = |name: &str| header.iter().position(|known| known == name).unwrap();
    for row in &rows {
        sandbox.write(
            "one.toml",
            sandbox.read("scene.toml") + &format!("[solver]\nsubsteps = {}\n", row[0]),
        );
        let run = "run one.toml --frames 30 --quiet --no-pictures --out one";
        sandbox.good(&run.split(' ').collect::<Vec<_>>());
        let text = sandbox.read("one/frames.jsonl");
        let frames: Vec<Value> = text
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        for (name, kind, of_bodies) in [
            ("force.ground.0", "ground", false),
            ("force.contact.0.1", "contact", true),
        ] {
            let vectors: Vec<[f64; 3]> = frames
                .iter()
                .map(|frame| {
                    let forces = frame["forces"].as_array().unwrap();
                    let entry = forces.iter().find(|force| force["kind"] == kind);
                    assert!(entry.is_none_or(|entry| entry.get("other").is_some() == of_bodies));
                    [0, 1, 2]
                        .map(|k| entry.map_or(0.0, |force| force["force"][k].as_f64().unwrap()))
                })
                .collect();
            let field = |part: &str| {
                row[column(&format!("{name}.{part}"))]
                    .parse::<f64>()
                    .unwrap()
            };
            assert_eq!(["x", "y", "z"].map(field), vectors[29], "{name}");
            let amounts = vectors
                .iter()
                .map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
            let largest = amounts.fold(0.0, f64::max);
            assert!(
                largest > 0.0 && (field("largest") / largest - 1.0).abs() < 1e-12,
                "{name}"
            );
            if of_bodies {
                assert_eq!(vectors[29], [0.0; 3], "the boxes still touch");
            }
        }
    }
}

#[test]
fn shares_give_the_table_of_one_run() {
    let sandbox = sandbox();
    sandbox.good(&[&STUDY[..], &["--out", "whole", "--quiet"]].concat());
    for share in ["1/3", "3/3"] {
        let out = format!("share{}", &share[..1]);
        sandbox.good(&[&STUDY[..], &["--out", &out, "--shard", share, "--quiet"]].concat());
        assert!(!sandbox.path(&out).join("sweep.csv").exists());
    }
    let merge = [
        &STUDY[..],
        &["--out", "all", "--quiet", "--merge", "share1", "share3"],
    ]
    .concat();
    let missing = sandbox.incise(&merge);
    assert_eq!(missing.code, 1);
    assert!(
        missing
            .stderr
            .contains("2 of 6 cells are missing, the first is cell 1")
            && missing.stderr.contains("--partial"),
        "{missing:?}"
    );
    assert!(!sandbox.path("all/sweep.csv").exists());
    sandbox.good(&[&merge[..], &["--partial"]].concat());
    assert_eq!(table(&sandbox.read("all/sweep.csv")).1.len(), 4);
    sandbox.good(
        &[
            &STUDY[..],
            &["--out", "share2", "--shard", "2/3", "--quiet"],
        ]
        .concat(),
    );
    sandbox.good(&[&merge[..], &["share2"]].concat());
    let [whole, all] = ["whole", "all"].map(|out| sandbox.read(&format!("{out}/sweep.csv")));
    assert_eq!(without_times(&whole), without_times(&all));
    // A finished study is not run again, and another one not mixed with it.
    let before = sandbox.list();
    sandbox.good(&[&STUDY[..], &["--out", "whole", "--quiet"]].concat());
    assert!(before == sandbox.list());
    let other = sandbox.incise(&[&STUDY[..7], &["4", "--out", "whole"]].concat());
    assert_eq!(other.code, 2);
    assert!(other.stderr.contains("is of another study"), "{other:?}");
}

#[test]
fn wrong_studies_are_refused() {
    let sandbox = sandbox();
    for (set, part) in [
        ("solver.substep=4", "substeps"),
        ("solver.substeps", "give a key and values"),
        ("solver.substeps=4,", "give a key and values"),
        ("body.young_modulus=1", "write body[0].young_modulus"),
        ("body[1].young_modulus=1", "body has 1 entry"),
        ("solver.method=jacoby", "jacobi"),
        ("body[0].young_modulus=-1", "body[0].young_modulus is -1"),
    ] {
        let outcome = sandbox.incise(&["sweep", "scene.toml", "--set", set, "--out", "study"]);
        assert_eq!(outcome.code, 2, "{set}: {outcome:?}");
        assert_eq!(outcome.stderr.lines().count(), 1, "{set}: {outcome:?}");
        assert!(outcome.stderr.contains(part), "{set}: {outcome:?}");
    }
    let twice = "sweep scene.toml --set solver.substeps=1 --set solver.substeps=2";
    let outcome = sandbox.incise(&twice.split(' ').collect::<Vec<_>>());
    assert!(outcome.stderr.contains("give a key once"), "{outcome:?}");
    let outcome = sandbox.incise(&[&STUDY[..], &["--merge", "none"]].concat());
    assert!(outcome.stderr.contains("none has no cells"), "{outcome:?}");
}

/// A cell that diverges has its reason in the table, and the others go on.
#[test]
fn a_failed_cell_is_a_row() {
    let sandbox = Sandbox::new();
    let explosive = "[solver]\ntet_solve = \"block\"\nprecision = \"f32\"\n";
    sandbox.write("scene.toml", format!("{explosive}{SCENE}"));
    let study = "sweep scene.toml --set solver.time_step=1e-3,1e3 --frames 2 --quiet --out study";
    sandbox.good(&study.split(' ').collect::<Vec<_>>());
    let (_, rows) = table(&sandbox.read("study/sweep.csv"));
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[0][1], "complete");
}
