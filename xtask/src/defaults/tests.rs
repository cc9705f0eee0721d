//! The quick form, all of it: every body stays bounded and at rest, and the page shows each miss.

use std::fs;

use super::*;
use crate::experiment::{Backend, Part};

#[test]
fn the_quick_form_holds_its_bars() {
    let out = std::env::temp_dir().join(format!("incise-defaults-{}", std::process::id()));
    fs::create_dir_all(&out).unwrap();
    let arguments = ExperimentArguments {
        quick: true,
        models: None,
        backend: Backend::Cpu,
        out: out.clone(),
        shard: None,
    };
    let cells = experiment(&arguments, None).unwrap().cells;
    let rows: Vec<Row> = cells.iter().map(|c| (c.measure)().unwrap()).collect();
    let (mut errors, mut skipped) = (0, 0);
    for row in &rows {
        match row {
            Row::Newton(rows) => {
                for row in rows {
                    // Soft, compressible and held: what the law of the error was measured for.
                    if row.young_modulus < 1e6 && row.poisson_ratio < 0.4 {
                        let settled = row.settled.unwrap_or(0.0);
                        assert!(settled < 0.1, "{row:?}");
                        errors += 1;
                    }
                    let error = row.settled.unwrap_or(0.0);
                    assert!(error <= 0.1 || !row.warned.is_empty(), "{row:?}");
                }
            }
            Row::Organ(row) => {
                if let Some([error, reference]) = row.error {
                    assert!(error < row.accuracy + reference, "{row:?}");
                }
            }
            Row::Load(rows) => {
                for row in rows {
                    assert!(row.is_bounded() && row.softened == 0, "{row:?}");
                }
            }
            Row::Rest(rows) => {
                for row in rows {
                    assert!(row.passes(), "{row:?}");
                }
            }
            Row::Skipped(_) => skipped += 1,
        }
    }
    assert_eq!((errors, skipped), (3, 1));
    let page = page::page(&rows).unwrap();
    let tables = page.parts.iter();
    let tables = tables.filter(|part| matches!(part, Part::Table(_)));
    assert_eq!(tables.count(), 1 + 3 + 1 + 2);
    fs::remove_dir_all(out).unwrap();
}

fn text(rows: &[Row]) -> String {
    format!("{:?}", page::page(rows).unwrap().parts)
}

/// Each kind of miss is counted, listed and marked.
#[test]
fn the_page_shows_what_misses_its_bar() {
    let newton = |motion, warned: &[&str]| {
        Row::Newton(vec![NewtonRow {
            shape: "beam".to_owned(),
            load: Load::Spinning,
            young_modulus: 1e5,
            poisson_ratio: 0.3,
            tets: 1,
            method: "gauss-seidel".to_owned(),
            substeps: 7,
            precision: "f32".to_owned(),
            frames: 4,
            period: 1.0,
            settled: None,
            motion,
            reference: 0.0,
            warned: warned.iter().map(|&code| code.to_owned()).collect(),
        }])
    };
    let rest = |last, inverted| {
        Row::Rest(vec![RestRow {
            body: "a body".to_owned(),
            precision: "f64".to_owned(),
            snap: 0.1,
            tets: 1,
            substeps: 1,
            first: 1e-12,
            last,
            inverted,
            warned: Warned::new(),
        }])
    };
    for (row, is_missed) in [
        (newton(0.099, &[]), false),
        (newton(0.5, &["diverged"]), false),
        (newton(0.101, &[]), true),
        (rest(1.9e-12, 0), false),
        (rest(2.1e-12, 0), true),
        (rest(1e-12, 1), true),
    ] {
        let text = text(&[row]);
        assert_eq!(text.contains("Missed:"), is_missed, "{text}");
        assert_eq!(text.contains("No result misses"), !is_missed, "{text}");
    }
}
