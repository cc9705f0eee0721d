//! `incise run`: simulates a scene.

use std::collections::HashSet;
use std::path::Path;

use anyhow::anyhow;
use incise::scene::{Backend, Method, Precision, Quantity, location};
use incise::{Error, Scene, Simulation, Warning};
use incise_render::{Animation, ColorBy};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;

use crate::args::{BackendName, PrecisionName, RunArguments};
use crate::failure::Failure;
use crate::output::{Output, require_mesh_file, save_mesh};
use crate::pictures::Pictures;
use crate::print::{count, print};
use crate::summary::Summary;

/// Default number of frames.
const FRAMES: u64 = 200;

pub(crate) fn run(arguments: &RunArguments) -> Result<(), Failure> {
    // Drawing shares the threads of the simulation.
    in_pool(arguments.threads, || simulate(arguments))
}

/// A line for each stroke that begins after the last frame.
fn late_strokes(scene: &Scene, frames: u64) -> impl Iterator<Item = String> + '_ {
    let late = scene.stroke.iter().enumerate();
    let late = late.filter(move |(_, stroke)| stroke.first_frame() >= frames);
    late.map(|(number, stroke)| {
        let (first, enough) = (stroke.first_frame(), stroke.last_frame() + 1);
        format!("stroke[{number}] begins at frame {first}, after the last frame: --frames {enough} includes it")
    })
}

/// Runs a function on a pool of its own with this number of threads, or on the common one.
pub(crate) fn in_pool(
    threads: Option<u16>,
    work: impl FnOnce() -> Result<(), Failure> + Send,
) -> Result<(), Failure> {
    let Some(threads) = threads.map(usize::from) else {
        return work();
    };
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Error::Threads {
        threads,
        message: error.to_string(),
    })?;
    pool.install(work)
}

/// Simulates and draws on the current thread pool.
fn simulate(arguments: &RunArguments) -> Result<(), Failure> {
    if let Some(path) = &arguments.save_mesh {
        require_mesh_file(path)?;
    }
    if let Some(path) = &arguments.animation {
        Animation::check_path(path).map_err(|error| Failure::Input(error.into()))?;
    }
    let scene = scene(arguments)?;
    let frames = arguments.frames.unwrap_or_else(|| default_frames(&scene));
    let simulation = Simulation::new(&scene);
    let mut simulation = simulation.map_err(|error| located(error, arguments.scene.as_deref()))?;
    let pictures = Pictures::of(arguments, &scene, &simulation, frames)?;
    let folder = arguments.out.as_deref().unwrap_or(Path::new("out"));
    let jsonl = arguments.jsonl.as_deref();
    let mut output = Output::create(folder, jsonl, &scene, frames, pictures)?;

    let kappa = simulation.kappa();
    let mut summary = Summary::new(simulation.report());
    let mut checked = 0_usize;
    let progress = progress(frames, arguments.quiet);
    let mut warned = HashSet::new();
    let mut failed = None;
    for _ in 0..frames {
        let report = simulation
            .step()
            .map_err(|error| Failure::Run(error.into()))?;
        progress.set_message(format!(
            "{} tets, {} pieces, {} colors",
            report.tets, report.pieces, report.colors
        ));
        summary.add(report);
        for warning in report.warnings() {
            // The terminal shows each warning once per part of the scene; frames.jsonl has all of them.
            if warned.insert((warning.code, warning.location.clone())) && !arguments.quiet {
                progress.suspend(|| print_warning(warning));
            }
        }
        if !arguments.keep_going
            && let Some(warning) = report.warnings().iter().find(|w| w.is_failure())
        {
            failed = Some(anyhow!(
                "frame {}: {warning} (--keep-going ignores this)",
                report.frame
            ));
        }
        if let Some(cut) = report.cut.filter(|_| arguments.check) {
            simulation.check()?;
            checked += usize::from(cut.has_cut());
        }
        output.frame(&mut simulation).map_err(Failure::Run)?;
        progress.inc(1);
        if failed.is_some() {
            break;
        }
    }
    progress.finish_and_clear();
    // Positions have not been read back if the last frame has no surface.
    simulation
        .read_back()
        .map_err(|error| Failure::Run(error.into()))?;
    let drawn = output.finish(&simulation).map_err(Failure::Run)?;
    if let Some(path) = &arguments.save_mesh {
        save_mesh(path, &simulation).map_err(Failure::Run)?;
    }
    if !arguments.quiet {
        print(summary.table([kappa, simulation.kappa()], &simulation.softened()))?;
        if let Some(note) = simulation.backend_note() {
            print(note)?;
        }
        late_strokes(&scene, frames).try_for_each(print)?;
        if arguments.check {
            print(format_args!(
                "checked after {}: mesh, volume at rest, masses, clusters, colors, pieces",
                count(checked, "cut", "cuts")
            ))?;
        }
        print(format_args!("files are in {}", folder.display()))?;
        if let Some(drawn) = drawn {
            print(drawn)?;
        }
    }
    failed.map_or(Ok(()), |error| Err(Failure::Run(error)))
}

/// The number of frames of a run for which none is given.
pub(crate) fn default_frames(scene: &Scene) -> u64 {
    scene.frames_needed().max(FRAMES)
}

/// Prints a warning to stderr.
#[expect(clippy::print_stderr, reason = "warnings of a run go to stderr")]
pub(crate) fn print_warning(warning: &Warning) {
    eprintln!("warning: {warning}");
}

/// Loads a scene file, or the built-in scene.
pub(crate) fn load(path: Option<&Path>) -> Result<Scene, Failure> {
    let Some(path) = path else {
        return Ok(Scene::built_in());
    };
    Scene::load(path).map_err(|error| match error {
        // Other errors name the file themselves.
        Error::Parse { .. } => {
            Failure::Input(anyhow::Error::from(error).context(path.display().to_string()))
        }
        _ => error.into(),
    })
}

/// Adds the file and the line of the key to an error about a scene.
pub(crate) fn located(error: Error, path: Option<&Path>) -> Failure {
    match path.and_then(|path| location(path, &error)) {
        Some(location) => Failure::Input(anyhow::Error::from(error).context(location)),
        None => error.into(),
    }
}

/// Scene of a run, with the changes of the command line.
fn scene(arguments: &RunArguments) -> Result<Scene, Failure> {
    let mut scene = load(arguments.scene.as_deref())?;
    if let Some(mesh) = &arguments.mesh {
        let body = scene.body.first_mut();
        let body =
            body.ok_or_else(|| Failure::Input(anyhow!("--mesh needs a scene with a [[body]]")))?;
        body.mesh = Some(mesh.clone());
        body.shape = None;
    }
    // Without images their coloring has no effect.
    if arguments.draws() && arguments.color_by == ColorBy::Residual {
        if scene.solver.method == Method::Vbd {
            let why = "--color-by residual needs constraints: the scene is solved by vbd";
            return Err(Failure::Input(anyhow!(why)));
        }
        if scene.solver.method == Method::Auto {
            scene.solver.method = Method::GaussSeidel;
        }
        scene.report.every = 1;
        if !scene.report.quantities.contains(&Quantity::Residual) {
            scene.report.quantities.push(Quantity::Residual);
        }
    }
    match arguments.precision {
        Some(PrecisionName::F32) => scene.solver.precision = Precision::F32,
        Some(PrecisionName::F64) => scene.solver.precision = Precision::F64,
        None => {}
    }
    match arguments.backend {
        Some(BackendName::Cpu) => scene.solver.backend = Backend::Cpu,
        Some(BackendName::Gpu) => scene.solver.backend = Backend::Gpu,
        Some(BackendName::Auto) => scene.solver.backend = Backend::Auto,
        None => {}
    }
    Ok(scene)
}

fn progress(frames: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} frame {pos}/{len}  {msg}  {elapsed}");
    // An invalid template must not stop the simulation.
    ProgressBar::new(frames).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
