//! Figure 6: pictures of bodies that are cut.
//!
//! The built-in scene with each of the paper's three bodies: held at one side, gravity, a blade from above. Cut faces
//! have a tint of their own.

use incise::cutting::FaceTag;
use incise::scene::StrokeSpec;
use incise::{Scene, Simulation};
use serde::{Deserialize, Serialize};

use super::painter::{Triangle, picture};
use super::paper_mesh::PaperMesh;
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part};

const BODIES: [&str; 3] = ["liver_11k", "bunny_19k", "armadillo_55k"];
/// Frames that are pictured: in the midst of the cut, soon after, and later.
const FRAMES: [u64; 3] = [36, 66, 84];
const SKIN: [u8; 3] = [196, 120, 104];
const CUT: [u8; 3] = [240, 200, 90];

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    body: String,
    /// Frame, tets, pieces and drawing.
    pictures: Vec<(u64, usize, usize, String)>,
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let cell = |name: &'static str| {
        let arguments = arguments.clone();
        Cell::new(name.replace('_', "-"), move || measure(name, &arguments))
    };
    Experiment {
        name: "paper-fig6",
        cells: BODIES.map(cell).into(),
        page,
    }
}

fn measure(name: &str, arguments: &ExperimentArguments) -> anyhow::Result<Row> {
    let mut scene = Scene::built_in();
    scene.contact = None;
    scene.stroke = vec![StrokeSpec::sweep(
        [4, 64],
        vec![[0.02, -0.25, 0.14], [0.03, 0.25, 0.14]],
        vec![[0.0; 3], [0.0, 0.0, -0.4]],
    )];
    let file = PaperMesh::named(name)?.file(arguments)?;
    (scene.body[0].mesh, scene.body[0].shape) = (Some(file), None);
    let mut simulation = Simulation::with_threads(&scene, 1)?;
    let mut pictures = Vec::new();
    for frame in 0..=FRAMES[2] {
        simulation.step()?;
        if FRAMES.contains(&frame) {
            let positions = simulation.positions();
            let triangles: Vec<Triangle> = simulation
                .boundary()
                .map(|triangle| Triangle {
                    corners: triangle.particles.map(|p| positions[p.index()]),
                    rgb: if triangle.tag == FaceTag::Outer {
                        SKIN
                    } else {
                        CUT
                    },
                })
                .collect();
            let report = simulation.report();
            pictures.push((frame, report.tets, report.pieces, picture(&triangles)));
        }
    }
    Ok(Row {
        body: name.to_owned(),
        pictures,
    })
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(
        "The built-in scene with the paper's bodies. Cut faces are yellow.".to_owned(),
    )];
    for row in rows {
        for (frame, tets, pieces, svg) in &row.pictures {
            parts.push(Part::Picture {
                caption: format!("{}, frame {frame}: {tets} tets, pieces: {pieces}", row.body),
                svg: svg.clone(),
            });
        }
    }
    Ok(Page {
        title: "Figure 6: bodies that are cut".to_owned(),
        parts,
    })
}
