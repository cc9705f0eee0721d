//! `cargo xtask sweep`: cuts meshes, checks all derived data and writes a table.
//!
//! The built-in stroke on every mesh, once through the body at rest without snapping, where the number of pieces is
//! known from the signs of the particles, and once in the built-in scene. After every cut all derived data is
//! recomputed and compared, and at the end the rest volume is compared with that at the start.

use std::path::PathBuf;

use anyhow::ensure;
use clap::Args;
use comfy_table::Table;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::scene::{Precision, StrokeSpec};
use incise::{Scene, Simulation};

use crate::models::{Model, models};
use crate::table;

#[derive(Debug, Args)]
pub(crate) struct SweepArguments {
    /// Small generated meshes only: a minute instead of many.
    #[arg(long)]
    quick: bool,
    /// Take the .vtk meshes of this folder instead of generated ones.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Leave out meshes with more tets.
    #[arg(long, value_name = "N", default_value_t = 60_000)]
    cut_at_most: usize,
    /// Write the table to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn sweep(arguments: &SweepArguments) -> anyhow::Result<()> {
    let models = models(arguments.models.as_deref(), usize::MAX, arguments.quick)?;
    let small: Vec<&Model> = models
        .iter()
        .filter(|m| m.mesh.tets.len() <= arguments.cut_at_most)
        .collect();
    let text = format!("## Cutting\n\n{}\n", cutting(&small)?);
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

fn cutting(models: &[&Model]) -> anyhow::Result<Table> {
    let mut table = table([
        "mesh",
        "scene",
        "cuts checked",
        "tets before",
        "tets after",
        "pieces",
        "expected",
        "volume at rest changed by",
        "worst volume ratio",
        "ms per frame (median)",
    ]);
    for model in models {
        let mut scene = Scene::built_in();
        scene.solver.precision = Precision::F64;
        model.put_into(&mut scene.body[0]);
        run(&mut table, model, "built-in", &scene, None)?;

        // At rest nothing moves, so the stroke is a plane and the signs of the particles tell the pieces.
        scene.world = incise::scene::WorldSpec::default();
        let expected = match &mut scene.stroke[0] {
            StrokeSpec::Sweep {
                blade, path, snap, ..
            } => {
                *snap = 0.0;
                let [a, b, from, to] =
                    [blade[0], blade[1], path[0], path[1]].map(DVec3::from_array);
                let normal = (b - a).cross(to - from);
                let scale = scene.body[0].scale;
                pieces_by_sign(&model.mesh, |x| normal.dot(x * scale - a) > 0.0)
            }
            _ => anyhow::bail!("the built-in stroke is a sweep"),
        };
        run(
            &mut table,
            model,
            "at rest, no snapping",
            &scene,
            Some(expected),
        )?;
    }
    Ok(table)
}

/// Runs the scene to the end of its strokes and adds a row; fails where a check does.
fn run(
    table: &mut Table,
    model: &Model,
    name: &str,
    scene: &Scene,
    expected: Option<usize>,
) -> anyhow::Result<()> {
    let mut simulation = Simulation::new(scene)?;
    let (tets, volume) = (
        simulation.mesh().tets.len(),
        simulation.mesh().total_volume(),
    );
    let (mut checked, mut worst, mut times) = (0, 1.0_f64, Vec::new());
    for _ in 0..scene.frames_needed() + 10 {
        let report = simulation.step()?;
        times.push(report.ms.total);
        if let Some(cut) = report.cut {
            worst = worst.min(cut.worst_volume_ratio);
            checked += 1;
            simulation.check()?;
        }
    }
    times.sort_by(f64::total_cmp);
    let pieces = simulation.report().pieces;
    ensure!(
        expected.is_none_or(|expected| expected == pieces),
        "{}, {name}: {pieces} pieces",
        model.name
    );
    let faces = simulation.mesh().face_pieces().count;
    ensure!(
        faces == pieces,
        "{}, {name}: {faces} pieces by faces, {pieces} by particles",
        model.name
    );
    table.add_row([
        model.name.clone(),
        name.to_owned(),
        checked.to_string(),
        tets.to_string(),
        simulation.mesh().tets.len().to_string(),
        pieces.to_string(),
        expected.map_or("-".to_owned(), |pieces| pieces.to_string()),
        format!(
            "{:.0e}",
            (simulation.mesh().total_volume() / volume - 1.0).abs()
        ),
        format!("{worst:.1e}"),
        format!("{:.1}", times[times.len() / 2]),
    ]);
    Ok(())
}

/// The number of pieces that a plane cuts a mesh into, by joining particles of one side along edges: each side of each
/// tet holds a particle, so nothing has to be split to count.
fn pieces_by_sign(mesh: &TetMesh, side: impl Fn(DVec3) -> bool) -> usize {
    let sides: Vec<bool> = mesh.positions.iter().map(|&x| side(x)).collect();
    let mut label: Vec<usize> = (0..sides.len()).collect();
    let mut changed = true;
    while changed {
        changed = false;
        for tet in &mesh.tets {
            let corners = tet.map(|p| p.index());
            for a in corners {
                for b in corners {
                    if sides[a] == sides[b] && label[b] < label[a] {
                        label[a] = label[b];
                        changed = true;
                    }
                }
            }
        }
    }
    let mut used: Vec<usize> = mesh
        .tets
        .iter()
        .flatten()
        .map(|p| label[p.index()])
        .collect();
    used.sort_unstable();
    used.dedup();
    used.len()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Runs the scenes in `fixtures/` with all checks and compares the number of pieces at the end with the expected
    /// one.
    #[test]
    fn fixtures_run() {
        for (name, frames, pieces) in [
            ("beam", 3, 1),
            ("colliders", 60, 1),
            ("crossing", 62, 4),
            ("attachments", 82, 2),
            ("distances", 20, 2),
            ("two_bodies", 5, 4),
        ] {
            let path =
                Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../fixtures/{name}.toml"));
            let mut simulation = Simulation::new(&Scene::load(&path).unwrap()).unwrap();
            for _ in 0..frames {
                if simulation.step().unwrap().cut.is_some() {
                    simulation.check().unwrap();
                }
            }
            assert_eq!(simulation.report().pieces, pieces, "{name}");
        }
    }
}
