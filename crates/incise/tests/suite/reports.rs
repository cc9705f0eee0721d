//! Only quantities that were computed appear; what a scene does not name is not computed.

use std::collections::BTreeSet;

use incise::{FrameReport, Simulation};
use serde_json::Value;

use crate::support::{body, plane, scene, simulation};

const ALWAYS: [&str; 12] = [
    "bodies",
    "frame",
    "time_s",
    "particles",
    "tets",
    "clusters",
    "colors",
    "pieces",
    "cut",
    "ms",
    "backend",
    "precision",
];

fn keys(value: &Value) -> BTreeSet<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

fn set(names: &[&'static str]) -> BTreeSet<&'static str> {
    names.iter().copied().collect()
}

fn json(report: &FrameReport) -> Value {
    serde_json::from_str(&serde_json::to_string(report).unwrap()).unwrap()
}

/// The keys that every report of `cut_sphere` has: frame 1 detaches a piece.
fn always(frame: u64) -> BTreeSet<&'static str> {
    let came_off: &[_] = if frame == 1 { &["detached"] } else { &[] };
    &set(&ALWAYS) | &set(came_off)
}

/// A sphere in gravity, cut in frame 1.
fn cut_sphere(report: &str) -> Simulation {
    simulation(&scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{report}\n{}{}",
        body("sphere", 300, [0.0, 0.0, 0.0]),
        plane(1, [0.0, 0.0, 0.05], [0.0, 0.1, 1.0])
    )))
}

#[test]
fn without_a_report_there_are_counts_and_times() {
    let mut simulation = cut_sphere("");
    for frame in 0..3_u64 {
        let report = json(simulation.step().unwrap());
        assert_eq!(keys(&report), always(frame));
        let times = [
            "cut", "cluster", "color", "schedule", "upload", "solve", "readback", "other", "total",
        ];
        assert_eq!(keys(&report["ms"]), set(&times));
        assert_eq!(report["frame"], frame);
        assert_eq!(report["backend"], "cpu");
        assert_eq!(report["precision"], "f32");
        if frame == 1 {
            let cut = [
                "tets_cut",
                "tets_created",
                "particles_created",
                "snapped",
                "worst_volume_ratio",
                "dihedral",
            ];
            assert_eq!(keys(&report["cut"]), set(&cut));
            let came_off = ["piece", "from", "tets", "volume", "mass"];
            assert_eq!(keys(&report["detached"][0]), set(&came_off));
        } else {
            assert_eq!(report["cut"], Value::Null);
        }
    }
}

#[test]
fn each_quantity_has_its_own_keys() {
    for (quantity, names) in [
        ("residual", &["residual"][..]),
        ("energy", &["energy"]),
        (
            "volume",
            &[
                "volume",
                "volume_error",
                "min_volume_ratio",
                "inverted_tets",
            ],
        ),
        ("speed", &["max_speed"]),
        ("kappa", &["kappa", "softened", "bodies"]),
    ] {
        let mut simulation = cut_sphere(&format!("[report]\nquantities = [\"{quantity}\"]"));
        for frame in 0..3 {
            assert_eq!(
                keys(&json(simulation.step().unwrap())),
                &always(frame) | &set(names),
                "{quantity}"
            );
        }
    }
}

#[test]
fn inner_objects_have_the_promised_keys() {
    let mut simulation = cut_sphere(
        "[report]\nquantities = [\"residual\", \"energy\", \"kappa\", \"speed\", \"volume\"]",
    );
    simulation.step().unwrap();
    let report = json(simulation.step().unwrap());
    assert_eq!(
        keys(&report["residual"]),
        set(&[
            "primal",
            "primal_relative",
            "dual",
            "dual_rms",
            "force",
            "force_relative",
            "potential"
        ])
    );
    assert_eq!(
        keys(&report["energy"]),
        set(&["kinetic", "elastic", "gravity"])
    );
    assert_eq!(
        keys(&report["softened"]),
        set(&["tets", "volume_fraction", "strongest"])
    );
    // No number may turn into null, which is what JSON makes of NaN and infinity.
    let nulls = report
        .to_string()
        .replace("\"shortfall\":null", "")
        .matches("null")
        .count();
    assert_eq!(nulls, 0, "{report}");
}

#[test]
fn every_n_frames_means_only_those() {
    let mut simulation = cut_sphere("[report]\nevery = 3\nquantities = [\"residual\", \"speed\"]");
    for frame in 0..8 {
        let report = json(simulation.step().unwrap());
        let due: &[_] = if frame % 3 == 0 {
            &["residual", "max_speed"]
        } else {
            &[]
        };
        let expected = &always(frame) | &set(due);
        assert_eq!(keys(&report), expected, "frame {frame}");
    }
}

#[test]
fn reporting_does_not_change_the_result() {
    let mut plain = cut_sphere("");
    let mut reporting = cut_sphere(
        "[report]\nquantities = [\"residual\", \"energy\", \"kappa\", \"speed\", \"volume\"]",
    );
    for _ in 0..4 {
        plain.step().unwrap();
        reporting.step().unwrap();
    }
    assert_eq!(plain.positions(), reporting.positions());
}

#[test]
fn counts_and_time_are_those_of_the_mesh() {
    let mut simulation = cut_sphere("");
    for frame in 1..4_u32 {
        let report = simulation.step().unwrap().clone();
        assert!((report.time_s - 0.016 * f64::from(frame)).abs() < 1e-12);
        assert_eq!(report.tets, simulation.mesh().tets.len());
        assert_eq!(report.particles, simulation.positions().len());
        assert_eq!(report.pieces, simulation.mesh().pieces().count);
        let ms = report.ms;
        let stages = ms.cut
            + ms.cluster
            + ms.color
            + ms.schedule
            + ms.upload
            + ms.solve
            + ms.readback
            + ms.other;
        assert!(
            (stages / ms.total - 1.0).abs() < 1e-9,
            "stages do not add up to the total: {ms:?}"
        );
    }
}
