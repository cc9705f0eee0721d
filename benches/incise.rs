//! Whole frames of a simulation, including cuts, partition and thirty substeps: one without a cut, one in which a plane
//! cuts the body through, and one in which a moving blade passes its middle.
//!
//! World, material and solver are those of the built-in scene; the threads are those of `RAYON_NUM_THREADS`, else all
//! cores.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use std::path::PathBuf;

use criterion::BatchSize;
use incise::scene::{Region, StrokeSpec};
use incise::{Scene, Simulation, mesh_io};
use incise_benches::Case;

fn main() {
    let folder = tempfile::tempdir().unwrap();
    incise_benches::run("incise", |bench| {
        let case = bench.case;
        let path = folder.path().join("case.vtk");
        mesh_io::write(&path, &case.mesh).unwrap();
        let scene = scene(case, path);

        let mut simulation = Simulation::new(&scene).unwrap();
        bench.measure("frame", |b| b.iter(|| simulation.step().unwrap().frame));

        for (name, stroke) in [("frame-plane", plane(case)), ("frame-sweep", sweep(case))] {
            let mut scene = scene.clone();
            scene.stroke.push(stroke);
            bench.measure(name, |b| {
                b.iter_batched_ref(
                    || {
                        let mut simulation = Simulation::new(&scene).unwrap();
                        // The blade takes its first pose, which does not cut yet.
                        simulation.step().unwrap();
                        simulation
                    },
                    |simulation| {
                        let report = simulation.step().unwrap();
                        assert!(report.cut.is_some(), "the measured frame cuts");
                    },
                    BatchSize::PerIteration,
                );
            });
        }
    });
}

/// The factor that brings a case to the 25 cm of the built-in liver.
fn scale(case: &Case) -> f64 {
    let [low, high] = case.bounds();
    0.25 / (high - low).max_element()
}

/// The built-in scene with the case as its body, held at its low end in x, and without strokes.
fn scene(case: &Case, path: PathBuf) -> Scene {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.stroke.clear();
    scene.solver.substeps = 30.into();
    let body = &mut scene.body[0];
    body.shape = None;
    body.mesh = Some(path);
    body.scale = scale(case);
    body.fixed = vec![Region::half_space(
        (case.at([0.2, 0.5, 0.5]) * scale(case)).to_array(),
        [-1.0, 0.0, 0.0],
    )];
    scene
}

fn plane(case: &Case) -> StrokeSpec {
    StrokeSpec::plane(
        1,
        (case.at([0.48, 0.5, 0.5]) * scale(case)).to_array(),
        [1.0, 0.03, 0.02],
    )
}

/// A stroke that starts just above the middle of the body, as if it had come from above.
fn sweep(case: &Case) -> StrokeSpec {
    let scale = scale(case);
    let [start, end] = [0.5, -9.5].map(|frames| case.blade(frames));
    StrokeSpec::sweep(
        [0, 10],
        start.map(|x| (x * scale).to_array()).to_vec(),
        vec![[0.0; 3], ((end[0] - start[0]) * scale).to_array()],
    )
}
