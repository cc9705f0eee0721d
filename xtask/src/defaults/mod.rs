//! `cargo xtask defaults`: accuracy and stability of scenes with default settings.
//!
//! Four parts: default scenes compared with Newton's method, with their warnings; a stiff organ with stated accuracies;
//! bodies under load after cuts, from soft to rigid; bodies at rest after cuts. The top of the page counts the results
//! beyond their limits.

mod cut;
mod newton;
mod organ;
mod page;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use clap::{Args, ValueEnum};
use incise::FrameReport;
use incise::mesh_io;
use incise::meshing::Shape;
use incise::scene::Precision;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::experiment::{Cell, Experiment, ExperimentArguments};
use cut::{CutBody, LoadRow, RestRow, Strokes};
use newton::{Case, Load, NewtonRow};
use organ::OrganRow;

/// The codes of the warnings of a run.
type Warned = BTreeSet<String>;

/// Result of a cell.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) enum Row {
    Newton(Vec<NewtonRow>),
    Organ(OrganRow),
    Load(Vec<LoadRow>),
    Rest(Vec<RestRow>),
    /// A body whose mesh is missing.
    Skipped(String),
}

/// The runs of a cell are measured in parallel; only the organ is timed, and a cell of it has one run.
pub(crate) fn all(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    experiment(arguments, None)?.run_and_check(arguments, check)
}

#[derive(Debug, Args)]
pub(crate) struct DefaultsArguments {
    #[command(flatten)]
    experiment: ExperimentArguments,
    /// Measure one part only, and write its page.
    #[arg(long, value_enum)]
    only: Option<Only>,
}

/// A part of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Only {
    /// Default scenes against Newton's method.
    Newton,
    /// A stiff organ: time and error of an accuracy.
    Organ,
    /// Bodies under load after cuts.
    Load,
    /// Bodies at rest after cuts.
    Rest,
}

pub(crate) fn defaults(arguments: &DefaultsArguments) -> anyhow::Result<()> {
    let experiment = experiment(&arguments.experiment, arguments.only)?;
    experiment.run_and_check(&arguments.experiment, check)
}

/// Checks the limits of the quick form: they are less strict than those of the page, which counts misses.
///
/// # Errors
/// On the first row that misses one.
fn check(rows: &[Row]) -> anyhow::Result<()> {
    for row in rows {
        match row {
            Row::Newton(rows) => {
                for row in rows {
                    let error = row.settled.unwrap_or(0.0);
                    // Soft, compressible and fixed: the range in which the error law was measured.
                    let is_plain = row.young_modulus < 1e6 && row.poisson_ratio < 0.4;
                    let is_warned = !is_plain && !row.warned.is_empty();
                    ensure!(error <= 0.1 || is_warned, "{row:?}");
                }
            }
            Row::Organ(row) => {
                let [error, reference] = row.error;
                ensure!(error < row.accuracy + reference, "{row:?}");
            }
            Row::Load(rows) => {
                for row in rows {
                    ensure!(row.is_bounded() && row.softened == 0, "{row:?}");
                }
            }
            Row::Rest(rows) => {
                for row in rows {
                    ensure!(row.passes(), "{row:?}");
                }
            }
            Row::Skipped(_) => {}
        }
    }
    Ok(())
}

fn experiment(
    arguments: &ExperimentArguments,
    only: Option<Only>,
) -> anyhow::Result<Experiment<Row>> {
    let wanted = |part| only.is_none_or(|only| only == part);
    let quick = arguments.quick;
    let folder = arguments.out.join("defaults-scenes");
    fs::create_dir_all(&folder)?;
    let mut cells = Vec::new();
    if wanted(Only::Newton) {
        cells.extend(newton_cells(quick, &folder));
    }
    if wanted(Only::Organ) {
        cells.extend(organ_cells(quick, &folder));
    }
    let file = arguments.models.as_ref();
    let file = file.map(|models| models.join("liver_11k.vtk"));
    let file = file.filter(|file| file.exists());
    if wanted(Only::Load) {
        cells.extend(load_cells(quick, &folder));
    }
    if wanted(Only::Rest) {
        cells.extend(rest_cells(quick, &folder, file));
    }
    Ok(Experiment {
        name: "defaults",
        cells,
        page: page::page,
    })
}

fn newton_cells(quick: bool, folder: &Path) -> Vec<Cell<Row>> {
    let shapes = [Shape::Beam, Shape::Box, Shape::Liver];
    let (shapes, tets): (&[Shape], usize) = if quick {
        (&shapes[..1], 200)
    } else {
        (&shapes, 300)
    };
    let (stiffnesses, ratios): (&[f64], &[f64]) = if quick {
        (&[1e5, 1e9], &[0.3, 0.4999])
    } else {
        (&[1e3, 1e5, 1e7, 1e9], &[0.0, 0.3, 0.45, 0.49, 0.4999])
    };
    let mut cells = Vec::new();
    for &shape in shapes {
        for load in Load::ALL {
            for &young_modulus in stiffnesses {
                let (ratios, folder) = (ratios.to_vec(), folder.to_owned());
                let id = format!("{shape}-{}-{young_modulus:.0e}", load.name());
                cells.push(Cell::new(id, move || {
                    let rows = ratios.par_iter().map(|&poisson_ratio| {
                        let case = Case {
                            shape,
                            tets,
                            load,
                            young_modulus,
                            poisson_ratio,
                        };
                        newton::measure(case, &folder)
                    });
                    Ok(Row::Newton(rows.collect::<anyhow::Result<_>>()?))
                }));
            }
        }
    }
    cells
}

fn organ_cells(quick: bool, folder: &Path) -> Vec<Cell<Row>> {
    let (tets, accuracies): (usize, &[f64]) = if quick {
        (600, &[0.05])
    } else {
        (11_000, &[0.1, 0.05, 0.02])
    };
    let cell = |(accuracy, strokes): (f64, usize)| {
        let folder = folder.to_owned();
        Cell::new(format!("organ-{accuracy}-{strokes}"), move || {
            organ::measure(tets, strokes, accuracy, &folder).map(Row::Organ)
        })
    };
    let runs = accuracies
        .iter()
        .flat_map(|&accuracy| [(accuracy, 0), (accuracy, organ::STROKES)]);
    runs.map(cell).collect()
}

/// Mesh of a body as a file for scenes.
fn file_of(body: &CutBody, folder: &Path) -> anyhow::Result<Option<PathBuf>> {
    if let CutBody::File(path) = body {
        return Ok(path.clone());
    }
    let name: String = body.name().replace([' ', ','], "-");
    let path = folder.join(format!("{name}.vtk"));
    if let Some(mesh) = body.mesh()? {
        mesh_io::write(&path, &mesh)?;
    }
    Ok(Some(path))
}

fn load_cells(quick: bool, folder: &Path) -> Vec<Cell<Row>> {
    let before: &[i32] = if quick {
        &[3, 6, 12]
    } else {
        &[3, 4, 5, 6, 7, 8, 9, 10, 11, 12]
    };
    let (tets, lengths) = if quick {
        (600, [6, 80])
    } else {
        (11_000, [20, 120])
    };
    let with = |strokes: Strokes, snap: f64| move |&e: &i32| (strokes, snap, e);
    let without_snapping: &[i32] = if quick { before } else { &[3, 6, 9, 12] };
    let during: &[i32] = if quick { &[] } else { &[3, 6, 9, 12] };
    let scenes = [
        (before, with(Strokes::Before, 0.1)),
        (during, with(Strokes::During, 0.1)),
        (without_snapping, with(Strokes::Before, 0.0)),
    ];
    let cell = |(strokes, snap, exponent): (Strokes, f64, i32)| {
        let folder = folder.to_owned();
        let substeps: &[u32] = match (strokes, quick) {
            (Strokes::During, _) => &[20],
            (Strokes::Before, true) => &[5, 20],
            (Strokes::Before, false) => &[5, 20, 50],
        };
        let name = match strokes {
            Strokes::Before => "before",
            Strokes::During => "during",
        };
        Cell::new(format!("load-{name}-{snap}-1e{exponent}"), move || {
            let body = CutBody::Liver(tets);
            let Some(file) = file_of(&body, &folder)? else {
                return Ok(Row::Skipped(body.name()));
            };
            let runs: Vec<(Precision, u32)> = [Precision::F32, Precision::F64]
                .into_iter()
                .flat_map(|precision| substeps.iter().map(move |&n| (precision, n)))
                .collect();
            let rows = runs.par_iter().map(|&(precision, n)| {
                let young_modulus = 10f64.powi(exponent);
                let file = file.clone();
                cut::load(
                    &body,
                    file,
                    young_modulus,
                    n,
                    precision,
                    (strokes, snap),
                    lengths,
                )
            });
            Ok(Row::Load(rows.collect::<anyhow::Result<_>>()?))
        })
    };
    let scenes = scenes
        .into_iter()
        .flat_map(|(exponents, scene)| exponents.iter().map(scene));
    scenes.map(cell).collect()
}

fn rest_cells(quick: bool, folder: &Path, file: Option<PathBuf>) -> Vec<Cell<Row>> {
    let bodies = if quick {
        vec![CutBody::File(None), CutBody::Irregular(300)]
    } else {
        vec![
            CutBody::File(file),
            CutBody::Liver(5000),
            CutBody::Irregular(1000),
        ]
    };
    // Rounding takes some hundred frames to come to its level.
    let lengths = [if quick { 5 } else { 30 }, 500];
    let cell = |(number, body): (usize, CutBody)| {
        let folder = folder.to_owned();
        Cell::new(format!("rest-{number}"), move || {
            let Some(file) = file_of(&body, &folder)? else {
                return Ok(Row::Skipped(body.name()));
            };
            let runs: Vec<(Precision, f64)> = [Precision::F32, Precision::F64]
                .into_iter()
                .flat_map(|precision| [0.0, 0.1, 0.2].map(|snap| (precision, snap)))
                .collect();
            let rows = runs
                .par_iter()
                .map(|&(precision, snap)| cut::rest(&body, file.clone(), snap, precision, lengths));
            let rows = rows.collect::<anyhow::Result<Vec<_>>>()?;
            Ok(Row::Rest(rows.into_iter().flatten().collect()))
        })
    };
    bodies.into_iter().enumerate().map(cell).collect()
}

/// Adds the codes of a frame's warnings.
fn warnings(report: &FrameReport, to: &mut Warned) {
    for warning in report.warnings() {
        let code = serde_json::to_value(warning.code);
        let code = code.ok().and_then(|code| Some(code.as_str()?.to_owned()));
        to.insert(code.unwrap_or_else(|| format!("{:?}", warning.code)));
    }
}
