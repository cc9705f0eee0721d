//! Tests a cell of the quick form, and synthetic rows: the page shows each miss, and the check of the quick form
//! rejects it.

use std::fs;

use super::*;
use crate::experiment::{Backend, Part};

/// One cell from its scenes to its page; `.ci/run` measures all cells of the quick form and checks its bars.
#[test]
fn a_cell_is_measured_checked_and_shown() {
    let out = std::env::temp_dir().join(format!("incise-defaults-{}", std::process::id()));
    fs::create_dir_all(&out).unwrap();
    let arguments = ExperimentArguments {
        quick: true,
        models: None,
        backend: Backend::Cpu,
        out: out.clone(),
        shard: None,
        complete: false,
    };
    let cells = experiment(&arguments, None).unwrap().cells;
    let cell = cells.iter().find(|c| c.id == "beam-hanging-1e5").unwrap();
    let rows = vec![(cell.measure)().unwrap()];
    let [Row::Newton(measured)] = &rows[..] else {
        panic!("{rows:?}")
    };
    // A Poisson's ratio of 0.3 needs no warning, one of 0.4999 does.
    let warned: Vec<bool> = measured.iter().map(|row| !row.warned.is_empty()).collect();
    assert_eq!(warned, [false, true], "{measured:?}");
    assert!(measured[0].settled.unwrap() < 0.1, "{measured:?}");
    check(&rows).unwrap();
    let page = page::page(&rows).unwrap();
    // A summary, and the cases of this load.
    let tables = page.parts.iter();
    let tables = tables.filter(|part| matches!(part, Part::Table(_)));
    assert_eq!(tables.count(), 2);
    fs::remove_dir_all(out).unwrap();
}

fn text(rows: &[Row]) -> String {
    format!("{:?}", page::page(rows).unwrap().parts)
}

/// A spinning body with an error of its motion.
fn newton_row(motion: f64, warned: &[&str]) -> NewtonRow {
    NewtonRow {
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
    }
}

/// The quick form rejects an error above 10% without a warning, and an unexpected warning.
#[test]
fn the_quick_form_refuses_errors_without_a_reason() {
    let case = |young_modulus, settled, warned: &[&str]| NewtonRow {
        young_modulus,
        settled: Some(settled),
        ..newton_row(0.0, warned)
    };
    for (row, is_refused) in [
        (case(1e5, 0.09, &[]), false),
        (case(1e5, 0.11, &[]), true),
        (case(1e5, 0.11, &["inaccurate"]), true),
        (case(1e9, 0.11, &["inaccurate"]), false),
        (case(1e9, 0.11, &[]), true),
    ] {
        let text = format!("{row:?}");
        assert_eq!(
            check(&[Row::Newton(vec![row])]).is_err(),
            is_refused,
            "{text}"
        );
    }
}

/// Each kind of miss is counted, listed and marked.
#[test]
fn the_page_shows_what_misses_its_bar() {
    let newton = |motion, warned: &[&str]| Row::Newton(vec![newton_row(motion, warned)]);
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
    let organ = |accuracy, pulled_ms, slowest_cut_ms: Option<f64>, error: f64| {
        Row::Organ(OrganRow {
            accuracy,
            strokes: if slowest_cut_ms.is_some() { 6 } else { 0 },
            tets: [1, 1],
            method: String::new(),
            substeps: 1,
            precision: String::new(),
            pulled_ms,
            slowest_cut_ms,
            last_ms: 1.0,
            error: [error, 0.0],
            warned: Warned::new(),
        })
    };
    for (row, is_missed) in [
        (organ(0.05, 7.9, None, 0.049), false),
        (organ(0.05, 8.1, None, 0.049), true),
        (organ(0.05, 7.9, None, 0.051), true),
        (organ(0.05, 9.0, Some(15.9), 0.01), false),
        (organ(0.05, 7.9, Some(16.1), 0.01), true),
        (organ(0.02, 9.0, Some(17.0), 0.01), false),
        (organ(0.02, 9.0, None, 0.021), true),
        (newton(0.099, &[]), false),
        (newton(0.5, &["diverged"]), false),
        (newton(0.101, &[]), true),
        (rest(1.9e-12, 0), false),
        (rest(2.1e-12, 0), true),
        (rest(1e-12, 1), true),
    ] {
        // The quick form has limits for settled states, for rest and for the error of the organ, not for times.
        let is_refused = match &row {
            Row::Organ(row) => row.error[0] > row.accuracy,
            row => is_missed && matches!(row, Row::Rest(_)),
        };
        assert_eq!(
            check(std::slice::from_ref(&row)).is_err(),
            is_refused,
            "{row:?}"
        );
        let text = text(&[row]);
        assert_eq!(text.contains("Missed:"), is_missed, "{text}");
        assert_eq!(text.contains("No result misses"), !is_missed, "{text}");
    }
}
