//! Worn clusters and colors are rebuilt in the background, in frames that the scene alone determines.

use incise::{Scene, Simulation};

use crate::support::{body, scene, state, sweep};

/// A box crossed by short strokes, two frames apart, while it rests or, given `more`, moves.
fn strokes_into_a_box(solver: &str, more: &str) -> Scene {
    let strokes: String = (0..8_u32)
        .map(|i| {
            let x = -0.35 + 0.1 * f64::from(i);
            let first = u64::from(2 * i);
            sweep(
                [first, first + 2],
                [[x, -0.7, 0.7], [x + 0.03, 0.1, 0.7]],
                [0.0, 0.0, -1.0],
            )
        })
        .collect();
    let body = body("box", 3000, [0.0, 0.0, 0.0]);
    scene(&format!("[solver]\n{solver}\n{more}\n{body}{strokes}"))
}

fn renewals(simulation: &mut Simulation, frames: u64) -> Vec<u64> {
    let mut renewals = Vec::new();
    for _ in 0..frames {
        let report = simulation.step().unwrap();
        if report.reclustered > 0 {
            renewals.push(report.frame);
            simulation.check().unwrap();
        }
    }
    renewals
}

#[test]
fn a_worn_plan_is_renewed_and_follows_what_was_cut_meanwhile() {
    // Without merging the plan wears fast.
    let solver = "merge_clusters = false\nrecluster = { threshold = 1.1, frames = 3 }";
    let renewed = strokes_into_a_box(solver, "");
    let mut worn = renewed.clone();
    worn.solver.recluster = None;
    let (mut renewed, mut worn) = (
        Simulation::with_threads(&renewed, 1).unwrap(),
        Simulation::with_threads(&worn, 1).unwrap(),
    );
    let frames = renewals(&mut renewed, 24);
    assert!(frames.len() > 1, "renewed in {frames:?}");
    assert!(frames.windows(2).all(|pair| pair[1] - pair[0] >= 3));
    assert!(renewals(&mut worn, 24).is_empty());
    let (renewed, worn) = (renewed.report(), worn.report());
    // Nothing but rounding moves here.
    assert!(renewed.tets.abs_diff(worn.tets) < worn.tets / 50);
    assert!(
        renewed.clusters < worn.clusters && renewed.colors < worn.colors,
        "{} clusters and {} colors instead of {} and {}",
        renewed.clusters,
        renewed.colors,
        worn.clusters,
        worn.colors
    );
}

#[test]
fn threads_and_time_decide_nothing() {
    let solver = "recluster = { threshold = 1.02, frames = 2 }";
    let scene = strokes_into_a_box(solver, "[world]\ngravity = [0.0, 0.0, -9.81]");
    let mut one = Simulation::with_threads(&scene, 1).unwrap();
    let mut others = [2, 3].map(|threads| Simulation::with_threads(&scene, threads).unwrap());
    let mut renewals = 0;
    for frame in 0..20 {
        renewals += one.step().unwrap().reclustered;
        for other in &mut others {
            // More than enough for the thread to be done long before, or not at all.
            if frame % 3 == 0 {
                std::thread::sleep(std::time::Duration::from_millis(20));
            }
            other.step().unwrap();
            assert!(state(&one) == state(other), "frame {frame}");
        }
    }
    assert!(renewals > 0, "no plan was renewed: the test proves nothing");
}

#[test]
fn volume_constraints_take_the_new_order() {
    let mut scene = strokes_into_a_box("recluster = { threshold = 1.02, frames = 1 }", "");
    scene.body[0].volume_compliance = Some(0.0);
    let mut simulation = Simulation::with_threads(&scene, 1).unwrap();
    assert!(!renewals(&mut simulation, 20).is_empty());
}

#[test]
fn an_invalid_threshold_is_refused() {
    for threshold in ["1.0", "0.5", "-2.0", "inf", "nan"] {
        let scene = scene(&format!(
            "[solver]\nrecluster = {{ threshold = {threshold} }}\n{}",
            body("box", 100, [0.0; 3])
        ));
        let message = Simulation::new(&scene).unwrap_err().to_string();
        assert!(
            message.starts_with("solver.recluster.threshold is"),
            "{message}"
        );
    }
    let refused = Scene::from_toml("[solver]\nrecluster = { frames = 0 }");
    assert!(refused.is_err());
}

#[test]
fn absent_it_leaves_no_trace_in_a_scene() {
    let scene = scene(&body("box", 100, [0.0; 3]));
    let text = scene.to_toml().unwrap();
    assert!(!text.contains("recluster") && !text.contains("merge_clusters"));
    let with = Scene::from_toml("[solver]\nrecluster = {}").unwrap();
    let recluster = with.solver.recluster.unwrap();
    assert_eq!((recluster.threshold, recluster.frames.get()), (1.25, 10));
    assert_eq!(Scene::from_toml(&with.to_toml().unwrap()).unwrap(), with);
}
