//! Scenes on a GPU: the same as on the processor, and nothing fetched that was not requested.
//!
//! They need an adapter (Mesa's lavapipe will do) and skip with a line on stderr without one, unless
//! `INCISE_REQUIRE_GPU` is set: then they fail.

use std::io::{Write, stderr};
use std::sync::{Arc, OnceLock};

use incise::gpu::{GpuContext, GpuError, GpuOptions};
use incise::mesh::glam::DVec3;
use incise::report::FrameReport;
use incise::scene::{Backend, Method, Precision, Quantity};
use incise::{Error, Scene, Simulation};

static CONTEXT: OnceLock<Result<Arc<GpuContext>, GpuError>> = OnceLock::new();

/// The device of all tests, or `None` on a machine without one, which is said.
pub(crate) fn gpu(test: &str) -> Option<Arc<GpuContext>> {
    let open = || GpuContext::new(&GpuOptions::from_env()).map(Arc::new);
    match CONTEXT.get_or_init(open) {
        Ok(gpu) => Some(Arc::clone(gpu)),
        Err(error) => {
            let required = std::env::var_os("INCISE_REQUIRE_GPU").is_some();
            assert!(!required, "a GPU is required: {error}");
            // Not by `eprintln`, which is shown for tests that fail only.
            let line = format!("SKIPPED {test}: {error}\n");
            stderr().write_all(line.as_bytes()).unwrap();
            None
        }
    }
}

/// A device with a count of its own.
pub(crate) fn counting(gpu: &GpuContext) -> Arc<GpuContext> {
    Arc::new(GpuContext::from_device(
        gpu.device().clone(),
        gpu.queue().clone(),
    ))
}

fn scene(tets: usize, clustering: &str) -> Scene {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.body[0].shape = Some(incise::scene::ShapeSpec::new("liver", tets));
    scene.solver.clustering = clustering.into();
    // A third of what it has, for the sake of time.
    scene.solver.substeps = 10.into();
    scene
}

pub(crate) fn farthest(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f64::max)
}

/// Whether two frames made one cut: on lavapipe to the last bit, elsewhere with angles and volumes within rounding of the
/// positions that were cut.
pub(crate) fn is_one_cut(gpu: &GpuContext, one: &FrameReport, other: &FrameReport) -> bool {
    let exact = gpu.adapter().name.contains("llvmpipe");
    let near = |a: f64, b: f64| (a - b).abs() < 1e-3 * a.abs();
    match (one.cut, other.cut) {
        (Some(one), Some(other)) if !exact => {
            let angles = one.dihedral.into_iter().flatten();
            let mut angles = angles.zip(other.dihedral.into_iter().flatten());
            let mut rounded = other;
            rounded.worst_volume_ratio = one.worst_volume_ratio;
            rounded.dihedral = one.dihedral;
            rounded == one
                && near(one.worst_volume_ratio, other.worst_volume_ratio)
                && angles.all(|(a, b)| near(a, b))
        }
        (one, other) => one == other,
    }
}

/// The main job, frame by frame: the same cut, the same pieces, and the body where it is on the processor.
#[test]
fn the_cut_liver_is_the_same() {
    let Some(gpu) = gpu("the_cut_liver_is_the_same") else {
        return;
    };
    let scene = scene(3000, "serial:10");
    let mut here = Simulation::new(&scene).unwrap();
    let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    for frame in 0..120 {
        let one = here.step().unwrap().clone();
        let other = there.step().unwrap();
        assert_eq!(other.backend, "gpu");
        assert!(
            is_one_cut(&gpu, &one, other),
            "{frame}: {:?}, {:?}",
            one.cut,
            other.cut
        );
        assert_eq!(
            (one.tets, one.pieces),
            (other.tets, other.pieces),
            "{frame}"
        );
        assert_eq!(
            (one.colors, one.clusters),
            (other.colors, other.clusters),
            "{frame}"
        );
        if frame % 20 == 19 {
            there.check().unwrap();
            there.read_back().unwrap();
            let far = farthest(here.positions(), there.positions());
            // The liver has a length of 1.
            assert!(far < 1e-4, "frame {frame}: {far}");
        }
    }
    assert!(here.report().pieces > 1);
    assert_eq!(there.report().repaired, 0);
}

/// In tiles: another order of solving, so other positions, but the same laws.
#[test]
fn the_cut_liver_in_tiles_comes_apart_all_the_same() {
    let Some(gpu) = gpu("the_cut_liver_in_tiles_comes_apart_all_the_same") else {
        return;
    };
    let mut scene = scene(1000, "pressure:128");
    scene.solver.substeps = 20.into();
    scene.report.quantities = vec![Quantity::Volume, Quantity::Energy];
    let mut there = Simulation::on_device(&scene, gpu).unwrap();
    for frame in 0..120 {
        let report = there.step().unwrap();
        let (volume, inverted) = (report.volume_error.unwrap(), report.inverted_tets.unwrap());
        assert!(volume.abs() < 0.05, "{frame}: {volume}");
        // Slivers at the cut, while it opens and falls: some of a few thousand.
        assert!(inverted * 100 < report.tets, "{frame}: {inverted}");
        if report.cut.is_some() {
            there.check().unwrap();
        }
    }
    assert!(there.report().pieces > 1);
    there.read_back().unwrap();
    assert!(there.positions().iter().all(|x| x.is_finite()));
}

/// What moves between host and device in a frame without blade and report, and what a cut sends: bytes for each cut
/// tet, and how many times as much the whole body is.
fn traffic_of_a_stroke(gpu: &GpuContext, tets: usize, clustering: &str) -> (f64, f64) {
    let gpu = counting(gpu);
    let mut scene = scene(tets, clustering);
    // What is sent does not depend on them.
    scene.solver.substeps = 2.into();
    let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    there.step().unwrap();
    let whole = gpu.traffic().uploaded_bytes;
    let (mut cut, mut sent, mut most) = (0, 0, 0);
    for frame in 1..66 {
        let before = gpu.traffic();
        let report = there.step().unwrap();
        let spent = gpu.traffic().since(before);
        let mut strokes = scene.stroke.iter();
        if !strokes.any(|s| (s.first_frame()..=s.last_frame()).contains(&frame)) {
            assert_eq!((spent.readbacks, spent.uploaded_bytes), (0, 0), "{frame}");
            assert_eq!((spent.submits, spent.passes), (1, 1), "{frame}");
        }
        if let Some(report) = report.cut {
            cut += report.tets_cut;
            sent += spent.uploaded_bytes;
            most = most.max(spent.uploaded_bytes);
        }
    }
    assert!(cut > 100, "{cut}");
    (sent as f64 / cut as f64, whole as f64 / most as f64)
}

#[test]
fn frames_fetch_nothing_and_cuts_send_what_they_cut() {
    let Some(gpu) = gpu("frames_fetch_nothing_and_cuts_send_what_they_cut") else {
        return;
    };
    for clustering in ["serial:10", "pressure:128"] {
        let (small, _) = traffic_of_a_stroke(&gpu, 1500, clustering);
        let (large, share) = traffic_of_a_stroke(&gpu, 6000, clustering);
        // What a cut tet costs does not depend on the body.
        assert!(
            large < 1.5 * small,
            "{clustering}: {small} and {large} bytes a cut tet"
        );
        assert!(
            share > 3.0,
            "{clustering}: a {share}th of the body in one frame"
        );
    }
}

/// A report of energies, volume and speed reads the sums of some workgroups, of a large body as of a small one; only
/// residuals fetch the state.
#[test]
fn a_report_fetches_what_it_needs() {
    let Some(gpu) = gpu("a_report_fetches_what_it_needs") else {
        return;
    };
    let sums = [
        Quantity::Energy,
        Quantity::Volume,
        Quantity::Speed,
        Quantity::Kappa,
    ];
    for (tets, clustering, residual) in [
        (500, "serial:10", true),
        (500, "serial:10", false),
        (8000, "pressure:128", false),
    ] {
        let mut scene = scene(tets, clustering);
        scene.stroke.clear();
        scene.report.every = 5;
        scene.report.quantities = sums.to_vec();
        if residual {
            scene.report.quantities.push(Quantity::Residual);
        }
        let gpu = counting(&gpu);
        let mut here = Simulation::new(&scene).unwrap();
        let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        for frame in 0..11 {
            let reports = frame % 5 == 0;
            let before = gpu.traffic();
            let one = here.step().unwrap().clone();
            let other = there.step().unwrap().clone();
            let spent = gpu.traffic().since(before);
            assert_eq!(spent.readbacks > 0, reports);
            if !residual {
                // 48 bytes for each of 256 workgroups, and a count.
                assert!(spent.read_bytes <= 256 * 48 + 4, "{}", spent.read_bytes);
            }
            assert_eq!(other.energy.is_some(), reports);
            let close = |what, one: Option<f64>, other: Option<f64>, tolerance: f64| {
                let apart = one.zip(other).map_or(0.0, |(one, other)| one - other);
                assert_eq!((one.is_some(), other.is_some()), (reports, reports));
                assert!(apart.abs() <= tolerance, "{what}: {one:?} {other:?}");
            };
            // Frames of rounding in another order, and another order of solving in tiles: there only the size is right.
            let share = if tets == 500 { 1e-3 } else { 0.1 };
            let [of_one, of_other] =
                [&one, &other].map(|report| report.energy.as_ref().map(|energy| energy.kinetic));
            close("kinetic", of_one, of_other, share * of_one.unwrap_or(0.0));
            let speed = share * one.max_speed.unwrap_or(0.0);
            close("speed", one.max_speed, other.max_speed, speed);
            close("volume", one.volume_error, other.volume_error, 1e-2 * share);
            assert_eq!(one.inverted_tets, other.inverted_tets);
            if let (Some(one), Some(other)) = (one.residual, other.residual) {
                assert!(
                    (one.force / other.force - 1.0).abs() < 0.05,
                    "{one:?} {other:?}"
                );
            }
            assert_eq!(other.residual.is_some(), residual && reports);
            assert_eq!(one.kappa, other.kappa);
        }
    }
}

#[test]
fn unsupported_features_are_refused_and_auto_uses_the_cpu() {
    let mut doubled = scene(200, "serial:10");
    doubled.solver.precision = Precision::F64;
    let large = scene(200, "pressure:300");
    for (mut scene, field) in [(doubled, "solver.precision"), (large, "solver.clustering")] {
        scene.solver.backend = Backend::Gpu;
        let error = Simulation::new(&scene).unwrap_err();
        assert!(
            matches!(&error, Error::Value { field: f, .. } if f == field),
            "{error}"
        );
        scene.solver.backend = Backend::Auto;
        let mut simulation = Simulation::new(&scene).unwrap();
        assert!(simulation.backend_note().unwrap().contains(field));
        assert_eq!(simulation.step().unwrap().backend, "cpu");
    }
}

#[test]
fn auto_skips_software_adapters() {
    let Some(gpu) = gpu("auto_skips_software_adapters") else {
        return;
    };
    let mut scene = scene(200, "serial:10");
    scene.solver.backend = Backend::Auto;
    let mut simulation = Simulation::new(&scene).unwrap();
    let backend = simulation.step().unwrap().backend;
    assert_eq!(backend, if gpu.adapter().software { "cpu" } else { "gpu" });
    assert!(simulation.backend_note().is_some());
}

/// Every scene that the project ships, on both: what can be cut, held, linked, collided with.
#[test]
fn every_shipped_scene_moves_as_on_the_processor() {
    let Some(gpu) = gpu("every_shipped_scene_moves_as_on_the_processor") else {
        return;
    };
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures");
    let mut scenes = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "toml") {
            continue;
        }
        let mut scene = Scene::load(&path).unwrap();
        if scene.solver.method == Method::Vbd {
            continue;
        }
        scene.solver.precision = Precision::F32;
        let mut here = Simulation::new(&scene).unwrap();
        let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        let size = here
            .positions()
            .iter()
            .map(|x| x.length())
            .fold(0.0, f64::max);
        for frame in 0..30 {
            let one = here.step().unwrap().clone();
            let other = there.step().unwrap();
            assert_eq!(
                (one.tets, one.pieces),
                (other.tets, other.pieces),
                "{} {frame}",
                path.display()
            );
        }
        there.check().unwrap();
        there.read_back().unwrap();
        let far = farthest(here.positions(), there.positions());
        // Handles and links are rounded in their own way, and contacts carry it on.
        assert!(far < 1e-4 * size, "{}: {far} of {size}", path.display());
        scenes += 1;
    }
    assert!(scenes >= 4, "{scenes}");
}

/// Methods, volume constraints and materials, with a cut in the middle.
#[test]
fn other_methods_and_constraints_are_cut_on_a_gpu_too() {
    let Some(gpu) = gpu("other_methods_and_constraints_are_cut_on_a_gpu_too") else {
        return;
    };
    let of = |solver: &str, body: &str| {
        Scene::from_toml(&format!(
            r#"
            [world]
            gravity = [0.0, 0.0, -9.81]
            [solver]
            {solver}
            [[body]]
            shape = {{ kind = "beam", tets = 600 }}
            fixed = [{{ half_space = {{ point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]
            {body}
            [[body]]
            shape = {{ kind = "box", tets = 200 }}
            position = [0.0, 2.0, 0.0]
            [[stroke]]
            kind = "plane"
            frame = 4
            point = [0.05, 0.0, 0.0]
            normal = [1.0, 0.1, 0.0]
            "#
        ))
        .unwrap()
    };
    for (solver, body) in [
        ("method = \"jacobi\"\niterations = 8\nrelaxation = 0.05", ""),
        (
            "method = \"chebyshev\"\niterations = 15\nrelaxation = 0.05\nspectral_radius = 0.9",
            "",
        ),
        ("tet_solve = \"sequential\"", "damping = 0.01"),
        ("iterations = 3", "volume_compliance = 1e-7"),
        (
            "recluster = { threshold = 1.01, frames = 2 }\nsleep = { speed = 0.5, time = 0.1 }",
            "",
        ),
        (
            "clustering = \"pressure:64\"\nmerge_clusters = false",
            "volume_compliance = 0.0",
        ),
    ] {
        let scene = of(solver, body);
        let tiled = solver.contains("pressure");
        let mut here = Simulation::new(&scene).unwrap();
        let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
        for frame in 0..10 {
            let one = here.step().unwrap().clone();
            let other = there.step().unwrap();
            assert_eq!(
                (one.pieces, one.repaired),
                (other.pieces, other.repaired),
                "{solver} {frame}"
            );
            if other.cut.is_some() {
                there.check().unwrap();
            }
        }
        there.check().unwrap();
        there.read_back().unwrap();
        assert_eq!(here.report().pieces, 4);
        if !tiled {
            let far = farthest(here.positions(), there.positions());
            assert!(far < 1e-4, "{solver}: {far}");
        }
    }
}
