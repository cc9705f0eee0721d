//! `cargo xtask gpu-sweep`: is the GPU path right, and what does it take?
//!
//! Checks first, then the bandwidth of copies, colorings, iterations, frames with a cut and without, and coloring after a
//! cut, all on the same device in the same run. What was found goes to a JSON file, and as tables to a page. On a
//! processor that plays a GPU the times say nothing about GPUs, and the page says so.

mod bandwidth;
mod checks;
mod coloring;
mod frame;
mod iteration;
mod measure;
mod page;
mod recoloring;
mod report;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use clap::Args;
use incise::gpu::coloring::ColoringKernels;
use incise::gpu::{GpuContext, GpuError, GpuOptions};
use incise::mesh::generate::Shape;

use crate::models::{Model, models};
use report::{Facts, Report};

#[derive(Debug, Args)]
pub(crate) struct GpuArguments {
    /// Small generated meshes and few runs: a minute on a software adapter. The figures mean little.
    #[arg(long)]
    quick: bool,
    /// Take the .vtk meshes of this folder instead of generated ones.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// The most tets of a body; else as many as fit, or 25,000 on a software adapter.
    #[arg(long, value_name = "N")]
    largest: Option<usize>,
    /// Do not run the workspace's tests, but the checks that are built in.
    #[arg(long)]
    no_tests: bool,
    /// End well without an adapter.
    #[arg(long)]
    allow_none: bool,
    /// The date on the page instead of today's.
    #[arg(long, value_name = "DATE")]
    date: Option<String>,
    /// Write both files to this folder.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out_dir: PathBuf,
    /// Write the page to this file instead of one named after the adapter.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the JSON to this file instead of one named after the adapter.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Tets of the smallest grown body, and how many times as many the next one has.
const SMALLEST: usize = 5_000;
const GROWTH: usize = 4;

/// Bytes of a tet's rest shape: the largest array, which says what cannot fit.
const REST_BYTES: u64 = 64;

/// The most tets on a software adapter, unless told otherwise.
const SOFTWARE_LARGEST: usize = 25_000;

#[expect(clippy::print_stdout, reason = "the page is the result of the command")]
pub(crate) fn sweep(arguments: &GpuArguments) -> anyhow::Result<()> {
    let gpu = match GpuContext::new(&GpuOptions::from_env()) {
        Ok(gpu) => Arc::new(gpu),
        Err(error @ GpuError::NoAdapter { .. }) if arguments.allow_none => {
            println!("nothing measured: {error}");
            return Ok(());
        }
        Err(error) => return Err(error).context("a GPU is needed (Mesa's lavapipe will do)"),
    };
    let report = report(&gpu, arguments)?;
    let page = page::page(&report)?;
    println!("{page}");
    let name = format!("gpu-{}", file_name(&report.facts.adapter));
    let path = |given: &Option<PathBuf>, ending: &str| match given {
        Some(path) => path.clone(),
        None => arguments.out_dir.join(format!("{name}.{ending}")),
    };
    write(&path(&arguments.out, "md"), &page)?;
    let json = serde_json::to_string_pretty(&report)?;
    write(&path(&arguments.json, "json"), &format!("{json}\n"))
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| path.display().to_string())
}

/// Letters and digits of a name, in lower case, with a hyphen for everything between.
fn file_name(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-").to_lowercase()
}

fn report(gpu: &Arc<GpuContext>, arguments: &GpuArguments) -> anyhow::Result<Report> {
    let facts = facts(gpu, arguments.date.clone());
    let repeats = if arguments.quick { 3 } else { 9 };
    let stroke_frames = if arguments.quick { 10 } else { 60 };
    let mut notes = Vec::new();
    let largest = arguments.largest.unwrap_or(match facts.software {
        true => {
            notes.push(format!(
                "A software adapter: bodies of at most {SOFTWARE_LARGEST} tets, unless `--largest` says otherwise."
            ));
            SOFTWARE_LARGEST
        }
        false => usize::MAX,
    });
    let mut models = models(arguments.models.as_deref(), largest, arguments.quick)?;
    models.retain(|model| model.mesh.tets.len() <= largest);
    let mut kernels = ColoringKernels::default();

    say("checks");
    let checks = checks::checks(gpu, &mut kernels, !arguments.no_tests)?;
    say("bandwidth");
    let bandwidth = bandwidth::bandwidth(gpu, arguments.quick)?;
    let (mut colorings, mut passes) = (Vec::new(), Vec::new());
    for (i, model) in models.iter().enumerate() {
        say(&format!("colorings of {}", model.name));
        colorings.extend(coloring::colorings(gpu, &mut kernels, model, repeats)?);
        say(&format!("iterations of {}", model.name));
        let (name, mesh) = (&model.name, &model.mesh);
        let residuals = i == 0 || i + 1 == models.len();
        passes.extend(iteration::passes(gpu, name, mesh, repeats, residuals)?);
    }
    let (mut frames, mut recolorings) = (Vec::new(), Vec::new());
    let mut frames_of = |model: &Model, notes: &mut Vec<String>| -> anyhow::Result<()> {
        say(&format!("frames of {}", model.name));
        let (rows, cut) = frame::frames(gpu, model, repeats, stroke_frames, notes)?;
        frames.extend(rows);
        if let Some(cut) = cut {
            let name = &model.name;
            let row = recoloring::recoloring(gpu, &mut kernels, name, &cut, repeats)?;
            recolorings.push(row);
        }
        Ok(())
    };
    for model in &models {
        frames_of(model, &mut notes)?;
    }
    let measured: Vec<usize> = models.iter().map(|model| model.mesh.tets.len()).collect();
    drop(models);
    let sizes = match arguments.quick {
        true => Vec::new(),
        false => grown(&measured, largest, facts.buffer_limit),
    };
    for tets in sizes {
        let model = Model::generated(Shape::Liver, tets)?;
        say(&format!("iterations of {tets} tets"));
        let rows = iteration::passes(gpu, &model.name, &model.mesh, repeats, false)?;
        let none = rows.iter().all(|row| row.run.is_none());
        passes.extend(rows);
        if none {
            break;
        }
        frames_of(&model, &mut notes)?;
    }
    Ok(Report {
        facts,
        checks,
        bandwidth,
        colorings,
        passes,
        frames,
        recolorings,
        notes,
    })
}

/// Tets of bodies beside the models: several times as many as before, as long as the limit of a buffer and that of the
/// user allow it, and one that nearly fills a buffer; none of about the size of a model.
fn grown(models: &[usize], largest: usize, buffer_limit: u64) -> Vec<usize> {
    let room = usize::try_from(buffer_limit / REST_BYTES).unwrap_or(usize::MAX);
    // Some places stay empty.
    let most = largest.min(room / 10 * 6);
    let next = |tets: &usize| tets.checked_mul(GROWTH);
    let mut sizes: Vec<usize> = std::iter::successors(Some(SMALLEST), next)
        .take_while(|&tets| tets <= most)
        .collect();
    if sizes.last().is_some_and(|&last| most / 3 * 2 > last) {
        sizes.push(most);
    }
    sizes.retain(|&tets| {
        !models
            .iter()
            .any(|&model| (tets / 3 * 2..tets / 2 * 3).contains(&model))
    });
    sizes
}

fn facts(gpu: &GpuContext, date: Option<String>) -> Facts {
    let adapter = gpu.adapter();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    Facts {
        date: date.unwrap_or_else(measure::today),
        command: format!("cargo xtask {}", arguments.join(" ")),
        adapter: adapter.name.clone(),
        driver: adapter.driver.clone(),
        backend: adapter.backend.clone(),
        software: adapter.software,
        buffer_limit: gpu.buffer_limit(),
        threads: rayon::current_num_threads(),
        debug: cfg!(debug_assertions),
    }
}

/// What comes now, since some of it takes long.
#[expect(clippy::print_stderr, reason = "progress of a long command")]
fn say(what: &str) {
    eprintln!("{what}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_after_adapters() {
        assert_eq!(
            file_name("llvmpipe (LLVM 15.0.6, 256 bits)"),
            "llvmpipe-llvm-15-0-6-256-bits"
        );
    }

    #[test]
    fn bodies_grow_to_the_limit() {
        let mebibytes = |count: u64| count << 20;
        assert_eq!(
            grown(&[], 25_000, mebibytes(128)),
            [5_000, 20_000, 25_000][..2]
        );
        assert_eq!(
            grown(&[11_363, 89_273], usize::MAX, mebibytes(128)),
            [5_000, 20_000, 320_000, 1_258_290]
        );
        assert_eq!(grown(&[], 100, mebibytes(128)), []);
    }
}
