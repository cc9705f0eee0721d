//! `cargo xtask accuracy`: error and frame time of solver settings, by scene and setting.
//!
//! Errors are distances from a converged solution of the mesh by Newton's method in double precision, with its own
//! error stated; times are those of whole frames on one thread. The measurements use the code of `incise advise`
//! ([`incise::advise`]), so a user's scene is measured in the same way.

mod page;
mod scenes;
mod settings;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use incise::Scene;
use incise::advise::{Deviation, Motion, Reference, accurate_substeps, name, newton_motion, with};
use serde::{Deserialize, Serialize};

use crate::experiment::{Backend, Cell, Experiment, ExperimentArguments};
use scenes::{Kind, frames};
use settings::{large_step, large_vbd, settings};

/// Measurements of one scene.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct SceneRow {
    title: String,
    tets: usize,
    frames: u32,
    /// Number of substeps that brings kappa to 0.5.
    substeps: u32,
    reference: ReferenceRow,
    settings: Vec<SettingRow>,
    /// Settings that the scene cannot run with, and the reasons.
    refused: Vec<String>,
    exchanges: Vec<ExchangeRow>,
    /// One step per frame, iterated: distance from that step by Newton's method.
    large: Vec<LargeRow>,
}

/// Accuracy of the reference.
#[derive(Debug, Serialize, Deserialize)]
struct ReferenceRow {
    steps: [u32; 3],
    errors: [Deviation; 3],
    order: f64,
    left: Deviation,
}

/// A setting with its error and time.
#[derive(Debug, Serialize, Deserialize)]
struct SettingRow {
    curve: String,
    name: String,
    ms: f64,
    error: Deviation,
}

/// Two settings of a scene that differ in one parameter.
#[derive(Debug, Serialize, Deserialize)]
struct ExchangeRow {
    setting: String,
    what: String,
    from: String,
    to: String,
}

#[derive(Debug, Serialize, Deserialize)]
struct LargeRow {
    iterations: u32,
    /// In %: for XPBD, and for VBD with coarse correction where the scene supports it.
    xpbd: Deviation,
    vbd: Option<Deviation>,
}

pub(crate) fn accuracy(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    experiment(arguments)?.run(arguments)
}

fn experiment(arguments: &ExperimentArguments) -> anyhow::Result<Experiment<SceneRow>> {
    let folder = arguments.out.join("accuracy-scenes");
    fs::create_dir_all(&folder)?;
    let (quick, gpu) = (arguments.quick, arguments.backend == Backend::Gpu);
    let cells = Kind::ALL.map(|kind| {
        let folder: PathBuf = folder.clone();
        Cell::new(kind.id(), move || measure(kind, &folder, quick, gpu))
    });
    Ok(Experiment {
        name: "accuracy",
        cells: cells.into(),
        page: page::page,
    })
}

fn measure(kind: Kind, folder: &Path, quick: bool, gpu: bool) -> anyhow::Result<SceneRow> {
    let scene = kind.scene(folder, quick)?;
    let frames = frames(quick);
    let substeps = accurate_substeps(&scene)?;
    let reference = Reference::newton(&scene, frames, if quick { 2 } else { 4 })?;
    let settings = settings(substeps, gpu);
    let mut motions: Vec<Option<Motion>> = vec![None; settings.all.len()];
    let mut refused = vec![None; settings.all.len()];
    for _ in 0..if quick { 1 } else { 3 } {
        for (i, (_, spec)) in settings.all.iter().enumerate() {
            if refused[i].is_some() {
                continue;
            }
            match (
                Motion::of(&with(&scene, spec), frames, Some(1)),
                &mut motions[i],
            ) {
                (Ok(again), Some(motion)) => motion.keep_fastest(&again),
                (Ok(motion), first) => *first = Some(motion),
                (Err(error), _) => refused[i] = Some(format!("{}: {error}", name(spec))),
            }
        }
    }
    let rows = settings
        .all
        .iter()
        .zip(&motions)
        .filter_map(|((curve, spec), motion)| {
            let motion = motion.as_ref()?;
            Some(SettingRow {
                curve: (*curve).to_owned(),
                name: name(spec),
                ms: motion.ms_per_frame(),
                error: motion.deviation(&reference.motion),
            })
        });
    let rows: Vec<SettingRow> = rows.collect();
    let exchanges = settings.exchanges.iter().map(|exchange| ExchangeRow {
        setting: exchange.setting.to_owned(),
        what: exchange.what.to_owned(),
        from: name(&exchange.from),
        to: name(&exchange.to),
    });
    Ok(SceneRow {
        title: kind.title(),
        tets: tets(&scene)?,
        frames,
        substeps,
        reference: ReferenceRow {
            steps: reference.steps,
            errors: reference.errors,
            order: reference.order,
            left: reference.left,
        },
        exchanges: exchanges.collect(),
        settings: rows,
        refused: refused.into_iter().flatten().collect(),
        large: large(&scene, frames, quick)?,
    })
}

fn tets(scene: &Scene) -> anyhow::Result<usize> {
    Ok(incise::Simulation::with_threads(scene, 1)?
        .mesh()
        .tets
        .len())
}

/// Distance of one iterated step per frame from that step by Newton's method.
fn large(scene: &Scene, frames: u32, quick: bool) -> anyhow::Result<Vec<LargeRow>> {
    let newton = newton_motion(scene, frames, 1)?;
    let counts: &[u32] = if quick {
        &[1, 16, 256]
    } else {
        &[1, 4, 16, 64, 256, 1024]
    };
    let row = |&iterations: &u32| {
        let motion = |spec| Motion::of(&with(scene, &spec), frames, Some(1));
        let xpbd = motion(large_step(iterations))?;
        // VBD rounds are expensive, and few suffice. Scenes with links do not support VBD.
        let vbd = if iterations <= 16 && scene.distance.is_empty() {
            Some(motion(large_vbd(iterations))?.deviation(&newton))
        } else {
            None
        };
        Ok(LargeRow {
            iterations,
            xpbd: xpbd.deviation(&newton),
            vbd,
        })
    };
    let rows = counts
        .iter()
        .map(row)
        .collect::<Result<Vec<_>, incise::Error>>();
    rows.map_err(|error| anyhow!(error))
}
