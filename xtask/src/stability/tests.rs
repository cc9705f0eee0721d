//! Tests on some rows of the quick matrix that do not depend on exact values.

use std::collections::BTreeSet;
use std::sync::Arc;

use incise::gpu::{GpuContext, GpuOptions};

use super::methods::{Column, Method, Precision};
use super::outcome::{Outcome, Row, Verdict};
use super::{experiment, extremes, page, picture, run};
use crate::experiment::{Backend, Part};

/// Rows of each kind; `.ci/run` measures all rows of the quick form and checks them.
fn some_rows() -> Vec<Row> {
    let experiment = experiment(true, Backend::Cpu).unwrap();
    let ids: BTreeSet<&str> = experiment.cells.iter().map(|c| c.id.as_str()).collect();
    assert_eq!(ids.len(), experiment.cells.len());
    let wanted = ["plane-free", "young-1e12", "mass-1e3", "cut-at-rest-1"];
    let cells = experiment.cells.iter();
    let cells = cells.filter(|cell| wanted.contains(&cell.id.as_str()));
    let rows: Vec<Row> = cells.map(|cell| (cell.measure)().unwrap()).collect();
    assert_eq!(rows.len(), wanted.len());
    rows
}

#[test]
fn rows_are_finite_explained_and_shown() {
    let rows = some_rows();
    super::check(&rows).unwrap();
    for row in &rows {
        let columns = 2 * Method::ALL.len() - 1 - usize::from(row.is_state);
        assert_eq!(row.outcomes.len(), columns, "{}", row.id);
    }
    let mut infinite = rows[0].clone();
    infinite.outcomes[3].not_finite = Some(2);
    super::check(&[infinite]).unwrap_err();
    // Numbers come back to the last digit but one; what is said of them is the same.
    let written = serde_json::to_string(&rows).unwrap();
    let again: Vec<Row> = serde_json::from_str(&written).unwrap();
    assert_eq!(picture::draw(&again), picture::draw(&rows));
    let page = page::page(&rows).unwrap();
    let in_words = page.parts.iter().find_map(|part| match part {
        Part::Table(table) if table.caption == "In words" => Some(table),
        _ => None,
    });
    let shown: Vec<&str> = in_words
        .unwrap()
        .rows
        .iter()
        .map(|row| row[0].as_str())
        .collect();
    let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(shown, names);
    let boxes = picture::draw(&rows).matches("<rect").count();
    let outcomes = rows.iter().map(|row| row.outcomes.len());
    assert_eq!(boxes, 1 + outcomes.sum::<usize>());
}

/// Substeps by kappa keep a fixed body stable in all states, for all of Poisson's ratios and all distances from the
/// origin.
#[test]
fn substeps_by_kappa_hold_a_body_together() {
    for extreme in extremes::extremes(true).unwrap() {
        let kept = [
            "rest",
            "plane",
            "mirrored",
            "scrambled",
            "stretched",
            "poisson",
            "far",
        ];
        if !kept.iter().any(|id| extreme.id.starts_with(id)) {
            continue;
        }
        let methods = [Method::Split, Method::Softened];
        let precisions = [Precision::F32, Precision::F64];
        for (method, precision) in methods.into_iter().flat_map(|m| precisions.map(|p| (m, p))) {
            let column = Column {
                method,
                precision,
                gpu: false,
            };
            let outcome = run::run(&extreme, column, None).unwrap();
            assert_eq!(outcome.inverted, 0, "{}", extreme.id);
            assert!(outcome.in_shape_from.is_some(), "{}", extreme.id);
        }
    }
}

/// A device goes through the same extremes; one frame, as software devices are slow.
#[test]
fn extremes_run_on_a_device() {
    let Ok(gpu) = GpuContext::new(&GpuOptions::from_env()) else {
        return; // A machine without one.
    };
    let gpu = Arc::new(gpu);
    let mut extremes = extremes::extremes(true).unwrap();
    extremes.retain(|e| ["scrambled-held", "young-1e12"].contains(&e.id.as_str()));
    assert_eq!(extremes.len(), 2);
    for extreme in &mut extremes {
        extreme.time = extreme.time_step;
        for method in [Method::Paper, Method::Jacobi] {
            let column = Column {
                method,
                precision: Precision::F32,
                gpu: true,
            };
            let outcome = run::run(extreme, column, Some(&gpu)).unwrap();
            assert_eq!((outcome.frames, outcome.not_finite), (1, None));
            assert!(!outcome.frozen);
        }
    }
}

fn fine() -> Outcome {
    Outcome {
        column: Column {
            method: Method::Block,
            precision: Precision::F64,
            gpu: false,
        },
        substeps: 1,
        kappa: 0.5,
        frames: 10,
        not_finite: None,
        energy_rise: 0.0,
        distance: Some(0.01),
        in_shape_from: Some(0.1),
        tets: 100,
        inverted: 0,
        volume: 1.01,
        momentum_drift: None,
        repaired: 0,
        softened: 0,
        frozen: false,
        refused: None,
        warned: false,
    }
}

/// Verdicts are ordered by severity and distinguishable.
#[test]
fn verdicts_name_the_worst() {
    let verdict = |change: &dyn Fn(&mut Outcome)| {
        let mut outcome = fine();
        change(&mut outcome);
        outcome.verdict(true)
    };
    assert_eq!(fine().verdict(true), Verdict::Fine);
    assert_eq!(verdict(&|o| o.distance = Some(0.5)), Verdict::Bent);
    assert_eq!(verdict(&|o| o.volume = 1.06), Verdict::Off);
    assert_eq!(verdict(&|o| o.volume = -0.9), Verdict::Collapsed);
    assert_eq!(verdict(&|o| o.inverted = 2), Verdict::FewInverted);
    assert_eq!(verdict(&|o| o.inverted = 3), Verdict::Inverted);
    assert_eq!(verdict(&|o| o.energy_rise = 1.5), Verdict::Gains);
    assert_eq!(verdict(&|o| o.repaired = 1), Verdict::Repaired);
    let all = |o: &mut Outcome| {
        (o.not_finite, o.volume, o.frozen) = (Some(3), 0.0, true);
    };
    assert_eq!(verdict(&all), Verdict::NotFinite);
    let mut bent = fine();
    bent.distance = Some(0.5);
    assert_eq!(bent.verdict(false), Verdict::Fine);
    assert_eq!(bent.words(true), "bent 50 %");
    bent.warned = true;
    assert_eq!(bent.words(true), "bent 50 %, warned");
}
