//! Tests with cells that count their measurements.

use std::cell::Cell as Counter;
use std::path::PathBuf;
use std::rc::Rc;

use super::arguments::Shard;
use super::*;

fn arguments(out: PathBuf, shard: Option<&str>) -> ExperimentArguments {
    ExperimentArguments {
        quick: true,
        models: None,
        backend: Backend::Cpu,
        out,
        shard: shard.map(|s| s.parse().unwrap()),
        complete: false,
    }
}

fn squares(measured: &Rc<Counter<usize>>) -> Experiment<(f64, f64)> {
    Experiment {
        name: "squares",
        cells: (0..7)
            .map(|i| {
                let measured = measured.clone();
                Cell::new(format!("square-{i}"), move || {
                    measured.set(measured.get() + 1);
                    Ok((f64::from(i), f64::from(i * i)))
                })
            })
            .collect(),
        page: |rows| {
            let mut table = Table::new("Squares", ["x", "x²"]);
            for (x, y) in rows {
                table.push([x.to_string(), y.to_string()]);
            }
            let curve = |log| Plot {
                title: "Squares".to_owned(),
                x: Axis::linear("x"),
                y: Axis {
                    label: "x²".to_owned(),
                    log,
                },
                series: vec![Series {
                    name: "x²".to_owned(),
                    points: rows.to_vec(),
                    labels: rows.iter().map(|r| r.1.to_string()).collect(),
                    style: Style::Both,
                }],
            };
            Ok(Page {
                title: "Squares".to_owned(),
                parts: vec![
                    Part::Text("Some *squares*.".to_owned()),
                    Part::Table(table),
                    Part::Plot(curve(false)),
                    Part::Plot(curve(true)),
                ],
            })
        },
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("incise-xtask-{}-{name}", std::process::id()));
    fs::remove_dir_all(&folder).ok();
    folder
}

#[test]
fn a_continued_run_writes_all_files() {
    let out = folder("again");
    let measured = Rc::new(Counter::new(0));
    for _ in 0..2 {
        squares(&measured)
            .run(&arguments(out.clone(), None))
            .unwrap();
        assert_eq!(measured.get(), 7);
    }
    let text = fs::read_to_string(out.join("squares.md")).unwrap();
    assert!(text.starts_with("# Squares\n") && text.contains("| 6 ") && text.contains("| 36 "));
    assert!(text.contains("![Squares](squares-2.svg)"));
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("<td>36</td>") && page.contains("<em>squares</em>"));
    for plot in ["squares-1.svg", "squares-2.svg"] {
        let svg = fs::read_to_string(out.join(plot)).unwrap();
        assert!(svg.contains("polyline") && svg.contains("36"), "{plot}");
    }
    let mut other = arguments(out.clone(), None);
    other.quick = false;
    let refused = squares(&measured).run(&other).unwrap_err();
    assert!(refused.to_string().contains("choose another --out"));
    fs::remove_dir_all(out).unwrap();
}

#[test]
fn shards_have_every_cell_once_and_merge_into_the_same_page() {
    let [whole, first, second, gathered] = ["whole", "first", "second", "gathered"].map(folder);
    let measured = Rc::new(Counter::new(0));
    squares(&measured)
        .run(&arguments(whole.clone(), None))
        .unwrap();
    measured.set(0);
    for (out, shard) in [(&first, "1/2"), (&second, "2/2")] {
        squares(&measured)
            .run(&arguments(out.clone(), Some(shard)))
            .unwrap();
        assert!(!out.join("squares.md").exists());
    }
    assert_eq!(measured.get(), 7);
    let merged = merge(&MergeArguments::of(
        gathered.clone(),
        vec![first.clone(), second.clone()],
    ));
    let [(name, arguments)] = &merged.unwrap()[..] else {
        panic!("one experiment")
    };
    assert_eq!(name, "squares");
    squares(&measured).run(arguments).unwrap();
    assert_eq!(measured.get(), 7);
    let [a, b] =
        [&whole, &gathered].map(|out| fs::read_to_string(out.join("squares.json")).unwrap());
    assert_eq!(a, b);
    for out in [whole, first, second, gathered] {
        fs::remove_dir_all(out).unwrap();
    }
}

/// A share that was not run is noticed; nothing is measured instead of it unless that is wanted.
#[test]
fn a_missing_share_is_an_error() {
    let [first, gathered] = ["lonely", "incomplete"].map(folder);
    let measured = Rc::new(Counter::new(0));
    squares(&measured)
        .run(&arguments(first.clone(), Some("1/2")))
        .unwrap();
    measured.set(0);
    let merged = merge(&MergeArguments::of(gathered.clone(), vec![first.clone()]));
    let mut arguments = merged.unwrap().remove(0).1;
    let error = squares(&measured).run(&arguments).unwrap_err().to_string();
    assert!(
        error.contains("3 of 7 cells are missing") && error.contains("square-1"),
        "{error}"
    );
    assert!(error.contains("--partial"), "{error}");
    assert_eq!(measured.get(), 0);
    assert!(!gathered.join("squares.md").exists());
    arguments.complete = false;
    squares(&measured).run(&arguments).unwrap();
    assert_eq!(measured.get(), 3);
    for out in [first, gathered] {
        fs::remove_dir_all(out).unwrap();
    }
}

#[test]
fn shares_are_read_and_refused() {
    let shard: Shard = "2/5".parse().unwrap();
    assert_eq!(
        (0..10).filter(|&i| shard.has(i)).collect::<Vec<_>>(),
        [1, 6]
    );
    for wrong in ["", "0/5", "6/5", "1", "a/b", "1/0", "-1/2"] {
        assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
    }
}

#[test]
fn a_non_finite_number_fails_the_quick_form() {
    let folder = tempfile::tempdir().unwrap();
    let mut experiment = squares(&Rc::default());
    experiment
        .cells
        .push(Cell::new("square-nan", || Ok((7.0, f64::NAN))));
    let error = experiment
        .run(&arguments(folder.path().to_owned(), None))
        .unwrap_err();
    assert!(error.to_string().contains("NaN"), "{error}");
}
