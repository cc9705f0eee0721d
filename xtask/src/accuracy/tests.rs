//! Tests that the quick run makes a complete page that agrees with its rows.

use std::fs;
use std::path::PathBuf;

use super::page::{front, page, sentence};
use super::*;

fn folder(name: &str) -> PathBuf {
    let folder =
        std::env::temp_dir().join(format!("incise-accuracy-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn setting(name: &str, ms: f64, error: f64) -> SettingRow {
    SettingRow {
        curve: "substeps".to_owned(),
        name: name.to_owned(),
        ms,
        error: Deviation {
            largest: error,
            ..Deviation::default()
        },
    }
}

fn scene_row(settings: Vec<SettingRow>) -> SceneRow {
    SceneRow {
        title: "a scene".to_owned(),
        tets: 1,
        frames: 1,
        substeps: 1,
        reference: ReferenceRow {
            steps: [1, 2, 4],
            errors: [Deviation::default(); 3],
            order: 1.0,
            left: Deviation {
                largest: 0.5,
                ..Deviation::default()
            },
        },
        settings,
        refused: Vec::new(),
        exchanges: vec![ExchangeRow {
            setting: "substeps".to_owned(),
            what: "Doubling".to_owned(),
            from: "a".to_owned(),
            to: "b".to_owned(),
        }],
        large: Vec::new(),
    }
}

#[test]
fn exchange_rates_are_ratios_of_rows() {
    let rows = [
        scene_row(vec![setting("a", 1.0, 8.0), setting("b", 2.0, 4.0)]),
        scene_row(vec![setting("a", 1.0, 8.0), setting("b", 3.0, 1.0)]),
        scene_row(vec![setting("a", 1.0, 8.0), setting("b", 4.0, 1e300)]),
        scene_row(vec![setting("a", 1.0, 8.0)]),
    ];
    assert_eq!(
        sentence(&rows, &rows[0].exchanges[0]).unwrap(),
        "- Doubling: lowers the error to 0.312 times (0.125 to 0.500), for 3.00 times the time (2.00 to 4.00); 1 of 3 scenes are lost."
    );
    assert!(sentence(&rows[3..], &rows[0].exchanges[0]).is_none());
}

/// Errors below the error of the reference count as equal: the faster setting wins.
#[test]
fn the_reference_bounds_measurable_errors() {
    let row = scene_row(vec![
        setting("a", 1.0, 8.0),
        setting("b", 2.0, 0.4),
        setting("c", 3.0, 0.1),
    ]);
    assert_eq!(front(&row), [0, 1]);
}

/// Runs two quick scenes, one with a handle, one cut: implicit Euler converges at its order, the error falls with
/// substeps, iterations of a large XPBD step do not converge to the step, those of VBD do.
#[test]
fn quick_scenes_agree_with_the_page() {
    let folder = folder("quick");
    let rows: Vec<SceneRow> = [Kind::HangingBeam(300), Kind::CutLiver]
        .map(|kind| measure(kind, &folder, true, false).unwrap())
        .into();
    for row in &rows {
        // First order, observed at steps that are not yet in the asymptotic range.
        assert!(
            (0.6..1.4).contains(&row.reference.order),
            "{:?}",
            row.reference
        );
        let error = |substeps: u32| {
            let name = format!("gauss-seidel {substeps} x 1 f64");
            let found = row.settings.iter().find(|s| s.name == name);
            found
                .unwrap_or_else(|| panic!("{name} was not measured"))
                .error
                .largest
        };
        let [n, m] = [row.substeps, 4 * row.substeps].map(error);
        assert!(
            m < 0.5 * n,
            "{}: {n} with n substeps, {m} with 4 n",
            row.title
        );
        let last = row.large.last().unwrap();
        let vbd = row.large.iter().filter_map(|l| l.vbd).next_back().unwrap();
        assert!(vbd.largest < 0.1 * last.xpbd.largest, "{last:?}, {vbd:?}");
    }
    let page = page(&rows).unwrap();
    assert!(page.parts.len() > 10);
    fs::remove_dir_all(folder).unwrap();
}

/// Every scene runs with the default settings and with the reference.
#[test]
fn the_reference_supports_all_scenes() {
    let folder = folder("scenes");
    for kind in Kind::ALL {
        let scene = kind.scene(&folder, true).unwrap();
        let motion = newton_motion(&scene, 1, 1).unwrap();
        let other = Motion::of(&scene, 1, Some(1)).unwrap();
        // Of a size: the same particles move to about the same places in a frame.
        let off = motion.deviation(&other).largest;
        assert!(off < 5.0, "{}: {off}", kind.id());
    }
    fs::remove_dir_all(folder).unwrap();
}
