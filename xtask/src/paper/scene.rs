//! A body that is cut, as the paper cuts it: clusters that are never merged, blades that move on frame by frame.

use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::scene::{Scene, StrokeSpec, WorldSpec};

use super::colorings::ITERATIONS;
use super::paper_mesh::PaperMesh;
use crate::experiment::ExperimentArguments;

/// A body at rest without gravity, a large step of a few iterations, blades through it one after the other.
pub(super) fn cut_at_rest(
    body: PaperMesh,
    mesh: &TetMesh,
    arguments: &ExperimentArguments,
    clustering: &str,
    frames: u64,
    blades: u64,
) -> anyhow::Result<Scene> {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.world = WorldSpec::default();
    (scene.body[0].mesh, scene.body[0].shape) = (Some(body.file(arguments)?), None);
    scene.solver.substeps = 1.into();
    scene.solver.iterations = ITERATIONS;
    scene.solver.clustering = clustering.to_owned();
    scene.solver.merge_clusters = false;
    // The paper has no improvement of cut meshes.
    scene.cutting.improve = false;
    scene.stroke = strokes(mesh, scene.body[0].scale, frames, blades);
    Ok(scene)
}

/// So many blades from above through the body, side by side, in so many frames altogether.
pub(super) fn strokes(mesh: &TetMesh, scale: f64, frames: u64, blades: u64) -> Vec<StrokeSpec> {
    let low = mesh.positions.iter().copied().reduce(DVec3::min);
    let high = mesh.positions.iter().copied().reduce(DVec3::max);
    let (low, high) = (low.unwrap_or_default(), high.unwrap_or_default());
    let at = |x, y, z| (low + (high - low) * DVec3::new(x, y, z)) * scale;
    let way = at(0.0, 0.0, 0.0) - at(0.0, 0.0, 1.04);
    let stroke = |blade: u64| {
        let x = (blade + 1) as f64 / (blades + 1) as f64;
        let first = 1 + blade * frames / blades;
        // A little askew, so that no lattice is met along its planes.
        let ends = [at(x - 0.02, -0.2, 1.02), at(x + 0.013, 1.2, 1.02)];
        StrokeSpec::sweep(
            [first, (blade + 1) * frames / blades],
            ends.map(|end| end.to_array()).to_vec(),
            vec![[0.0; 3], way.to_array()],
        )
    };
    (0..blades).map(stroke).collect()
}
