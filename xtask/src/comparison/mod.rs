//! `cargo xtask comparison`: this solver and other systems on one mesh, measured alternately within one run.
//!
//! Scripts in a given folder run the other systems; they are copied to the output folder and run there, because they
//! write next to themselves. A system that is not installed has a row that says so. One thread each.

mod list;
mod ours;
mod output;
mod page;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use clap::Args;
use serde::{Deserialize, Serialize};

use crate::experiment::{Cell, Experiment, ExperimentArguments};
use list::{PEERS, Peer, Program};
use ours::{Ours, ours};
use output::{PeerResult, result};

/// Default folder of the scripts.
const FOLDER: &str = "../shared/peers";
/// Default Python interpreter.
const PYTHON: &str = "python3";

#[derive(Debug, Args)]
pub(crate) struct ComparisonArguments {
    #[command(flatten)]
    experiment: ExperimentArguments,
    /// The folder of the scripts that run other systems.
    #[arg(long, value_name = "DIR", default_value = FOLDER)]
    peers: PathBuf,
    /// The Python that has the other systems' packages.
    #[arg(long, value_name = "FILE", default_value = PYTHON)]
    python: PathBuf,
}

/// Measurements of another system and of this solver.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    id: String,
    /// Reason for missing rounds.
    missing: Option<String>,
    rounds: Vec<Round>,
}

/// One measurement of each, one directly after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Round {
    peer: PeerResult,
    ours: Ours,
}

/// Extent of the measurements.
#[derive(Clone, Copy, Debug)]
struct Extent {
    size: &'static str,
    cells: [usize; 3],
    frames: u32,
    rounds: u32,
    /// True if systems that compile for minutes are included.
    compiles: bool,
}

const FULL: Extent = Extent {
    size: "11k",
    cells: [30, 8, 8],
    frames: 40,
    rounds: 3,
    compiles: true,
};
const QUICK: Extent = Extent {
    size: "1k",
    cells: [16, 4, 4],
    frames: 3,
    rounds: 1,
    compiles: false,
};

/// Runs this experiment as part of `all`, if the scripts are in the default folder.
#[expect(clippy::print_stderr, reason = "lists what is left out")]
pub(crate) fn usual(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    let peers = PathBuf::from(FOLDER);
    if !peers.join("scene.py").is_file() {
        eprintln!("comparison: left out, {FOLDER} has no scripts that run other systems");
        return Ok(());
    }
    comparison(&ComparisonArguments {
        experiment: arguments.clone(),
        peers,
        python: PathBuf::from(PYTHON),
    })
}

pub(crate) fn comparison(arguments: &ComparisonArguments) -> anyhow::Result<()> {
    let from = &arguments.peers;
    ensure!(
        from.join("scene.py").is_file(),
        "{} has no scene.py: name the folder of the scripts that run other systems with --peers DIR (they need Python \
         packages, see the README there, and --python FILE for the Python that has them)",
        from.display()
    );
    let folder = arguments.experiment.out.join("comparison-run");
    let folder = copy(from, &folder)?;
    let extent = if arguments.experiment.quick {
        QUICK
    } else {
        FULL
    };
    let cells = PEERS.iter().map(|peer| {
        let (folder, python) = (folder.clone(), arguments.python.clone());
        Cell::new(peer.id, move || row(peer, extent, &folder, &python))
    });
    let experiment = Experiment {
        name: "comparison",
        cells: cells.collect(),
        page: page::page,
    };
    experiment.run(&arguments.experiment)
}

/// Copies the scripts to a folder and returns its absolute path.
fn copy(from: &Path, to: &Path) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(to).with_context(|| to.display().to_string())?;
    for entry in fs::read_dir(from)? {
        let path = entry?.path();
        let wanted = path
            .extension()
            .is_some_and(|ending| ending == "py" || ending == "cpp");
        if let Some(name) = path.file_name().filter(|_| wanted) {
            // `fs::copy` would also copy the read-only flag.
            let target = to.join(name);
            fs::write(&target, fs::read(&path)?).with_context(|| target.display().to_string())?;
        }
    }
    Ok(to.canonicalize()?)
}

fn row(peer: &Peer, extent: Extent, folder: &Path, python: &Path) -> anyhow::Result<Row> {
    let mut row = Row {
        id: peer.id.to_owned(),
        missing: match extent.compiles || !peer.compiles {
            true => prepare(peer, folder, python),
            false => {
                Some("left out of a quick run: its kernels take minutes to compile".to_owned())
            }
        },
        rounds: Vec::new(),
    };
    for _ in 0..extent.rounds {
        if row.missing.is_some() {
            break;
        }
        let ours = ours(extent.cells, extent.frames, peer.precision)?;
        match run(peer, extent, folder, python) {
            Ok(peer) => row.rounds.push(Round { peer, ours }),
            Err(error) => row.missing = Some(format!("{error:#}")),
        }
    }
    Ok(row)
}

/// Builds or finds a system; returns a description of the missing part.
fn prepare(peer: &Peer, folder: &Path, python: &Path) -> Option<String> {
    match peer.program {
        Program::Cpp(name) => {
            let output = Command::new("g++")
                .args(["-O3", "-march=native", "-std=c++20", "-pthread"])
                .args([&format!("{name}.cpp"), "-o", name])
                .current_dir(folder)
                .output();
            match output {
                Err(error) => Some(format!("g++ cannot be run: {error}")),
                Ok(output) if !output.status.success() => {
                    Some(format!("g++ does not build {name}.cpp"))
                }
                Ok(_) => None,
            }
        }
        Program::Python { module, .. } => {
            let output = Command::new(python)
                .args(["-c", &format!("import {module}")])
                .current_dir(folder)
                .output();
            match output {
                Err(error) => Some(format!("{} cannot be run: {error}", python.display())),
                Ok(output) if !output.status.success() => {
                    Some(format!("{} has no package {module}", python.display()))
                }
                Ok(_) => None,
            }
        }
    }
}

fn run(peer: &Peer, extent: Extent, folder: &Path, python: &Path) -> anyhow::Result<PeerResult> {
    let frames = extent.frames.to_string();
    let mut command = match peer.program {
        Program::Cpp(name) => {
            let mut command = Command::new(folder.join(name));
            let precision = peer.precision.name();
            // Repeats are frames of one iteration: short, so there are more of them.
            let repeats = (5 * extent.frames).to_string();
            command.args([extent.size, precision, "block", "1", &repeats]);
            command
        }
        Program::Python {
            script, arguments, ..
        } => {
            let mut command = Command::new(python);
            command.args([script, "--size", extent.size, "--frames", &frames]);
            command.args(arguments);
            command
        }
    };
    let output = command
        .current_dir(folder)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("WARP_CACHE_PATH", folder.join("warp"))
        .output()
        .context("cannot be run")?;
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    let last = errors
        .lines()
        .last()
        .unwrap_or("nothing on the standard error");
    ensure!(output.status.success(), "it failed: {last}");
    result(&text)
}
