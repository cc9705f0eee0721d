//! `cargo xtask gpu-sweep`: checks and times the GPU path.
//!
//! Checks first, then the bandwidth of copies, colorings, iterations, frames with and without a cut, and coloring after
//! a cut, all on one device in one run. The results go to a JSON file, and as tables to a page. On a software adapter
//! the times say nothing about GPUs, and the page says so.

mod bandwidth;
mod checks;
mod coloring;
mod frame;
mod iteration;
pub(crate) mod measure;
mod memory;
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
use incise::meshing::Shape;

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
    /// Only these tables, beside the bandwidth.
    #[arg(long, value_enum, value_delimiter = ',')]
    only: Vec<Part>,
    /// The most tets of a body; else 5 million or as many as fit, or 25,000 on a software adapter.
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

/// Tables that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Every algorithm on every mesh.
    Coloring,
    /// An iteration in every form, with residuals.
    Iteration,
    /// Device memory of bodies of 10,000 to a million tets.
    Memory,
    /// Frames with a cut and without, and coloring after a cut.
    Frame,
}

/// Tets of the bodies in the memory table.
const MEMORY: [usize; 3] = [10_000, 100_000, 1_000_000];

/// Tets of the smallest generated body, and growth factor to the next one.
const SMALLEST: usize = 5_000;
const GROWTH: usize = 4;

/// Bytes of a tet's rest shape: the largest array, which limits the size of a body.
const REST_BYTES: u64 = 64;

/// Default limits of tets, on a software adapter and on others: beyond them the host takes minutes for a body.
const SOFTWARE_LARGEST: usize = 25_000;
const LARGEST: usize = 5_000_000;

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
    println!("{}", page::page(&report)?);
    save(&report, arguments)
}

/// Writes page and JSON.
fn save(report: &Report, arguments: &GpuArguments) -> anyhow::Result<()> {
    let name = format!("gpu-{}", file_name(&report.facts.adapter));
    let path = |given: &Option<PathBuf>, ending: &str| match given {
        Some(path) => path.clone(),
        None => arguments.out_dir.join(format!("{name}.{ending}")),
    };
    std::fs::create_dir_all(&arguments.out_dir)
        .with_context(|| arguments.out_dir.display().to_string())?;
    write(&path(&arguments.out, "md"), &page::page(report)?)?;
    let json = serde_json::to_string_pretty(report)?;
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
    let mut kernels = ColoringKernels::default();
    say("checks");
    let checks = checks::checks(gpu, &mut kernels, !arguments.no_tests)?;
    say("bandwidth");
    let mut report = Report {
        bandwidth: bandwidth::bandwidth(gpu, arguments.quick)?,
        checks,
        colorings: Vec::new(),
        passes: Vec::new(),
        memory: Vec::new(),
        frames: Vec::new(),
        recolorings: Vec::new(),
        notes: Vec::new(),
        facts,
    };
    let mut sweep = Sweep {
        gpu,
        kernels,
        repeats: if arguments.quick { 3 } else { 9 },
        stroke_frames: if arguments.quick { 10 } else { 60 },
        only: &arguments.only,
    };
    let largest = match arguments.largest {
        Some(largest) => largest,
        None if report.facts.software => {
            report.notes.push(format!(
                "A software adapter: timed bodies have at most {SOFTWARE_LARGEST} tets, unless `--largest` says otherwise."
            ));
            SOFTWARE_LARGEST
        }
        None => LARGEST,
    };
    let mut models = models(arguments.models.as_deref(), largest, arguments.quick)?;
    models.retain(|model| model.mesh.tets.len() <= largest);
    for (i, model) in models.iter().enumerate() {
        sweep.colorings(model, &mut report)?;
        let residuals = i == 0 || i + 1 == models.len();
        sweep.passes(model, residuals, &mut report)?;
        sweep.frames(model, &mut report)?;
        // What is cut off later leaves what was measured so far.
        save(&report, arguments)?;
    }
    if sweep.wants(Part::Memory) {
        let sizes: &[usize] = if arguments.quick { &[1500] } else { &MEMORY };
        for &tets in sizes {
            say(&format!("memory of {tets} tets"));
            report.memory.extend(memory::memory(gpu, tets)?);
        }
        save(&report, arguments)?;
    }
    let measured: Vec<usize> = models.iter().map(|model| model.mesh.tets.len()).collect();
    drop(models);
    if arguments.quick || !(sweep.wants(Part::Iteration) || sweep.wants(Part::Frame)) {
        return Ok(report);
    }
    for tets in grown(&measured, largest, report.facts.buffer_limit) {
        let model = Model::generated(Shape::Liver, tets)?;
        sweep.passes(&model, false, &mut report)?;
        sweep.frames(&model, &mut report)?;
        save(&report, arguments)?;
    }
    Ok(report)
}

/// Configuration shared by all bodies.
struct Sweep<'a> {
    gpu: &'a Arc<GpuContext>,
    kernels: ColoringKernels,
    repeats: u32,
    stroke_frames: u32,
    only: &'a [Part],
}

impl Sweep<'_> {
    fn wants(&self, part: Part) -> bool {
        self.only.is_empty() || self.only.contains(&part)
    }

    fn colorings(&mut self, model: &Model, report: &mut Report) -> anyhow::Result<()> {
        if !self.wants(Part::Coloring) {
            return Ok(());
        }
        say(&format!("colorings of {}", model.name));
        let rows = coloring::colorings(self.gpu, &mut self.kernels, model, self.repeats)?;
        report.colorings.extend(rows);
        Ok(())
    }

    fn passes(&self, model: &Model, residuals: bool, report: &mut Report) -> anyhow::Result<()> {
        if !self.wants(Part::Iteration) {
            return Ok(());
        }
        let Model { name, mesh, .. } = model;
        say(&format!("iterations of {name}, {} tets", mesh.tets.len()));
        let rows = iteration::passes(self.gpu, name, mesh, self.repeats, residuals)?;
        report.passes.extend(rows);
        Ok(())
    }

    fn frames(&mut self, model: &Model, report: &mut Report) -> anyhow::Result<()> {
        if !self.wants(Part::Frame) {
            return Ok(());
        }
        let Model { name, mesh, .. } = model;
        say(&format!("frames of {name}, {} tets", mesh.tets.len()));
        let notes = &mut report.notes;
        let (rows, cut) = frame::frames(self.gpu, model, self.repeats, self.stroke_frames, notes)?;
        report.frames.extend(rows);
        if let Some(cut) = cut {
            let (gpu, kernels) = (self.gpu, &mut self.kernels);
            let row = recoloring::recoloring(gpu, kernels, name, &cut, self.repeats)?;
            report.recolorings.push(row);
        }
        Ok(())
    }
}

/// Tets of generated bodies in addition to the models: growing by a factor up to the limit of a buffer and that of the
/// user, and one that nearly fills a buffer; sizes close to a model's are skipped.
fn grown(models: &[usize], largest: usize, buffer_limit: u64) -> Vec<usize> {
    let room = usize::try_from(buffer_limit / REST_BYTES).unwrap_or(usize::MAX);
    // Margin for empty slots.
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
        date: date.unwrap_or_else(crate::experiment::today),
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

/// Prints the next step.
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
        assert!(grown(&[], 100, mebibytes(128)).is_empty());
    }
}
