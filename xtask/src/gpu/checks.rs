//! Correctness checks before any timing: the tests of the workspace, or built-in checks.
//!
//! If cargo and the sources are present, their tests run and must find a GPU. Otherwise every coloring is compared with
//! its twin on a small body, and both forms of the solver with theirs.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use anyhow::{Context, ensure};
use incise::clustering::{Method, cluster};
use incise::coloring::{Order, color_within_clusters, greedy};
use incise::gpu::coloring::ColoringKernels;
use incise::gpu::{ClusterMapping, GpuContext, GpuSolver};
use incise::graph::{Clustering, ColorId, Coloring, Incidence, Schedule};
use incise::mesh::glam::DVec3;
use incise::mesh::{TetMesh, kuhn_box};
use incise::meshing::Shape;
use incise::xpbd::{Material, StepSettings};

use super::coloring::colorings;
use crate::models::Model;
use crate::solver::body::body;

/// Tests of the GPU path.
const TESTS: [&[&str]; 2] = [
    &["test", "-p", "incise-gpu"],
    &["test", "-p", "incise", "--features", "gpu", "gpu"],
];

/// Runs the checks and returns their description; `tests` allows those of the workspace.
pub(crate) fn checks(
    gpu: &Arc<GpuContext>,
    kernels: &mut ColoringKernels,
    tests: bool,
) -> anyhow::Result<String> {
    match workspace().filter(|_| tests) {
        Some(folder) => in_workspace(&folder),
        None => built_in(gpu, kernels),
    }
}

/// Workspace that contains the current folder.
fn workspace() -> Option<PathBuf> {
    let here = std::env::current_dir().ok()?;
    let folder = here
        .ancestors()
        .find(|folder| folder.join("crates/gpu/Cargo.toml").is_file())?;
    let asked = cargo().arg("--version").output();
    asked.ok().map(|_| folder.to_owned())
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

fn in_workspace(folder: &Path) -> anyhow::Result<String> {
    let mut passed = 0;
    for arguments in TESTS {
        let mut command = cargo();
        command
            .args(arguments)
            .current_dir(folder)
            .env("INCISE_REQUIRE_GPU", "1");
        let output = command.output().context("cargo cannot be started")?;
        let text = String::from_utf8_lossy(&output.stdout);
        ensure!(
            output.status.success(),
            "`cargo {}` failed:\n{text}\n{}",
            arguments.join(" "),
            String::from_utf8_lossy(&output.stderr)
        );
        let passed_here = passed_in(&text);
        ensure!(
            passed_here > 0,
            "`cargo {}` ran no test",
            arguments.join(" ")
        );
        passed += passed_here;
    }
    let commands = TESTS.map(|arguments| format!("`cargo {}`", arguments.join(" ")));
    Ok(format!(
        "{} with `INCISE_REQUIRE_GPU=1`: {passed} tests passed.",
        commands.join(" and ")
    ))
}

/// Number of passed tests in the output of the test program.
fn passed_in(text: &str) -> usize {
    let lines = text
        .lines()
        .filter_map(|line| line.strip_prefix("test result: ok. "));
    let counts = lines.filter_map(|line| line.split(' ').next()?.parse::<usize>().ok());
    counts.sum()
}

fn built_in(gpu: &Arc<GpuContext>, kernels: &mut ColoringKernels) -> anyhow::Result<String> {
    let model = Model::generated(Shape::Liver, 1500)?;
    let colored = colorings(gpu, kernels, &model, 1)?;
    let all = colored.iter().all(|row| row.run.is_some());
    ensure!(all, "the device has no room for a graph of 1500 tets");
    let mut farthest = 0.0_f64;
    for (clustering, form) in [
        ("serial:10", ClusterMapping::Threads),
        ("pressure:128", ClusterMapping::Workgroups),
    ] {
        farthest = farthest.max(apart(gpu, clustering, form)?);
    }
    Ok(format!(
        "Built-in checks, not the tests of the workspace: {} colorings of {} tets equal those of the host; ten frames of \
         both forms of the solver end within {farthest:.1e} m of the host, on a body of 1 m.",
        colored.len(),
        model.mesh.tets.len()
    ))
}

/// Distance between device and host in m after ten frames of a bending bar.
fn apart(gpu: &Arc<GpuContext>, clustering: &str, form: ClusterMapping) -> anyhow::Result<f64> {
    let mesh = kuhn_box([6, 3, 3], DVec3::new(1.0, 0.5, 0.5));
    let soft = Material {
        young_modulus: 1e5,
        poisson_ratio: 0.45,
        density: 1000.0,
        damping: 0.0,
    };
    let settings = StepSettings {
        substeps: 4,
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(0.016)
    };
    let (schedule, order) = orders(&mesh, clustering, form)?;
    let bar = || body(&mesh, soft, |x| x.x < 1e-9);
    let (mut device, mut host) = (GpuSolver::new(Arc::clone(gpu), bar()?, form)?, bar()?);
    for _ in 0..10 {
        device.step(&schedule, &settings)?;
        host.step(&order, &settings)?;
    }
    let there = device.host()?;
    let distances =
        (0..host.particle_count()).map(|p| there.position(p).distance(host.position(p)));
    let far = distances.fold(0.0, f64::max);
    let moved = mesh.positions.iter().enumerate();
    let moved = moved.map(|(p, x)| host.position(p).distance(*x));
    let moved = moved.fold(0.0, f64::max);
    // Rounding in a different order, over ten frames of a body that moves by centimeters.
    ensure!(
        far < 1e-5,
        "{clustering}: device and host are {far} m apart"
    );
    ensure!(
        moved > 1e-2,
        "{clustering}: the bar moves by {moved} m only"
    );
    Ok(far)
}

/// A schedule, and the order in which a device in that form solves its tets.
fn orders(
    mesh: &TetMesh,
    clustering: &str,
    form: ClusterMapping,
) -> anyhow::Result<(Schedule, Schedule)> {
    let tets = mesh.tets.iter().copied();
    let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
    let clusters = cluster(clustering.parse::<Method>()?, &incidence);
    let outer = greedy(&incidence.quotient(&clusters), Order::LargestFirst);
    let schedule = Schedule::new(&clusters, &outer);
    if form == ClusterMapping::Threads {
        return Ok((schedule.clone(), schedule));
    }
    let inner = color_within_clusters(&incidence, &clusters);
    let steps = inner.color_count();
    let mut both = Vec::new();
    for (cluster, step) in clusters.labels().iter().zip(inner.colors()) {
        let color = outer.color(cluster.index()).index() * steps + step.index();
        both.push(ColorId(u32::try_from(color)?));
    }
    let alone = Clustering::none(mesh.tets.len());
    Ok((schedule, Schedule::new(&alone, &Coloring::new(both))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passed_tests_are_counted() {
        let text = "running 3 tests\ntest result: ok. 3 passed; 0 failed\n\ntest result: ok. 40 passed; 0 failed\n";
        assert_eq!(passed_in(text), 43);
        assert_eq!(passed_in("test result: FAILED. 3 passed; 1 failed"), 0);
    }
}
