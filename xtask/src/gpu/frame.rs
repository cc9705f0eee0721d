//! Whole frames of a scene, with and without a cut, on the device and on the host.
//!
//! The scene is the built-in one on another mesh, without its floor: a body fixed at one side falls, and a blade moves
//! down through its middle. Without a cut nothing is read back, so frames are timed many in a row, and each with a
//! wait, as needed to display every frame. A frame with a cut waits for the device itself, because the cut needs the
//! current positions; the wait for the end of the frame is added.

use std::sync::Arc;
use std::time::Instant;

use anyhow::ensure;
use incise::gpu::{GpuContext, GpuError};
use incise::report::FrameReport;
use incise::scene::StrokeSpec;
use incise::{Error, Scene, Simulation};

use super::measure::{batch, ms_since};
use super::report::{CuttingFrames, FrameRow, Times};
use crate::cutting::stroke;
use crate::experiment::median;
use crate::models::Model;

/// Compute devices and clusterings of a scene.
const PLACES: [(&str, bool, &str); 5] = [
    ("device, serial:10", true, "serial:10"),
    ("device, pressure:10", true, "pressure:10"),
    ("device, pressure:128", true, "pressure:128"),
    ("host, serial:10", false, "serial:10"),
    ("host, pressure:10", false, "pressure:10"),
];

const SUBSTEPS: u32 = 20;

/// Result of a stroke.
pub(crate) struct Cut {
    pub(crate) simulation: Simulation,
    /// Reports of the frames that cut.
    pub(crate) reports: Vec<FrameReport>,
}

/// Rows of a mesh, and the cut of the first of them.
pub(crate) fn frames(
    gpu: &Arc<GpuContext>,
    model: &Model,
    repeats: u32,
    stroke_frames: u32,
    notes: &mut Vec<String>,
) -> anyhow::Result<(Vec<FrameRow>, Option<Cut>)> {
    let (mut rows, mut first) = (Vec::new(), None);
    for (place, on_device, clustering) in PLACES {
        let scene = |frames| scene(model, clustering, frames);
        let device = on_device.then_some(gpu);
        let outcome = quiet(device, &scene(0), repeats)
            .and_then(|quiet| Ok((quiet, cut(device, &scene(stroke_frames))?)));
        let ([quiet, waited], (cutting, cut)) = match outcome {
            Ok(outcome) => outcome,
            Err(error) if is_full(&error) => {
                notes.push(format!("Frames of {}, {place}: {error}.", model.name));
                continue;
            }
            Err(other) => return Err(other),
        };
        rows.push(FrameRow {
            mesh: model.name.clone(),
            tets: model.mesh.tets.len(),
            place: place.to_owned(),
            substeps: SUBSTEPS,
            quiet,
            waited,
            cutting,
        });
        first.get_or_insert(cut);
    }
    Ok((rows, first))
}

/// True if the error means that the device is out of memory.
fn is_full(error: &anyhow::Error) -> bool {
    matches!(
        error.downcast_ref::<Error>(),
        Some(Error::Gpu(
            GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. }
        ))
    )
}

/// Scene, with a stroke of `stroke_frames` frames if not 0.
fn scene(model: &Model, clustering: &str, stroke_frames: u32) -> Scene {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.world.ground = None;
    model.put_into(&mut scene.body[0]);
    scene.solver.substeps = SUBSTEPS.into();
    scene.solver.clustering = clustering.to_owned();
    let scale = scene.body[0].scale;
    let (blade, way) = stroke(&model.mesh);
    scene.stroke = match stroke_frames {
        0 => Vec::new(),
        frames => vec![StrokeSpec::sweep(
            [1, 1 + u64::from(frames)],
            blade.map(|x| (x * scale).to_array()).to_vec(),
            vec![[0.0; 3], (way * scale).to_array()],
        )],
    };
    scene
}

fn simulation(gpu: Option<&Arc<GpuContext>>, scene: &Scene) -> anyhow::Result<Simulation> {
    Ok(match gpu {
        Some(gpu) => Simulation::on_device(scene, Arc::clone(gpu))?,
        None => Simulation::new(scene)?,
    })
}

/// Runs a frame and waits for the device.
fn step(gpu: Option<&Arc<GpuContext>>, simulation: &mut Simulation) -> anyhow::Result<f64> {
    let start = Instant::now();
    simulation.step()?;
    if let Some(gpu) = gpu {
        gpu.wait()?;
    }
    Ok(ms_since(start))
}

/// Frames without a cut: many in a row, and each waited for.
fn quiet(gpu: Option<&Arc<GpuContext>>, scene: &Scene, repeats: u32) -> anyhow::Result<[Times; 2]> {
    let mut simulation = simulation(gpu, scene)?;
    // Compiles kernels and lays out.
    step(gpu, &mut simulation)?;
    let once = step(gpu, &mut simulation)?;
    let count = batch(once);
    let (mut rows, mut waited) = (Vec::new(), Vec::new());
    for _ in 0..repeats {
        let start = Instant::now();
        for _ in 1..count {
            simulation.step()?;
        }
        step(gpu, &mut simulation)?;
        rows.push(ms_since(start) / f64::from(count));
        waited.push(step(gpu, &mut simulation)?);
    }
    Ok([rows, waited].map(Times::of))
}

/// Frames of a stroke.
fn cut(gpu: Option<&Arc<GpuContext>>, scene: &Scene) -> anyhow::Result<(CuttingFrames, Cut)> {
    let mut simulation = simulation(gpu, scene)?;
    let (mut reports, mut totals) = (Vec::new(), Vec::new());
    for _ in 0..scene.frames_needed() {
        let total = step(gpu, &mut simulation)?;
        let report = simulation.report();
        if report.cut.is_some() {
            reports.push(report.clone());
            totals.push(total);
        }
    }
    simulation.check()?;
    ensure!(!reports.is_empty(), "the blade missed");
    let stage = |of: fn(&FrameReport) -> f64| median(reports.iter().map(of));
    let cuts = reports.iter().filter_map(|report| report.cut);
    let cutting = CuttingFrames {
        frames: reports.len(),
        tets_cut: cuts.map(|cut| cut.tets_cut).sum(),
        largest: totals.iter().copied().fold(0.0, f64::max),
        total: median(totals),
        readback: stage(|report| report.ms.readback),
        cut: stage(|report| report.ms.cut),
        cluster: stage(|report| report.ms.cluster),
        color: stage(|report| report.ms.color),
        schedule: stage(|report| report.ms.schedule),
        upload: stage(|report| report.ms.upload),
    };
    Ok((
        cutting,
        Cut {
            simulation,
            reports,
        },
    ))
}
