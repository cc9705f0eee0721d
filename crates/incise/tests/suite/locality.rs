//! The work of a frame follows the cut: what a cut does not touch stays as it is.

use std::collections::BTreeMap;

use incise::Simulation;

use crate::support::{body, plane, scene, simulation, sweep};

/// For each cluster with members: these and its color.
fn clusters(simulation: &Simulation) -> BTreeMap<usize, (Vec<u32>, u32)> {
    let members = simulation.clustering().members();
    let colors = simulation.coloring();
    members
        .iter()
        .enumerate()
        .filter(|(_, members)| !members.is_empty())
        .map(|(cluster, members)| (cluster, (members.to_vec(), colors.color(cluster).0)))
        .collect()
}

fn cut_sphere() -> Simulation {
    let strokes = plane(2, [0.21, 0.0, 0.0], [1.0, 0.1, 0.0])
        + &sweep(
            [4, 7],
            [[-0.1, -0.6, 0.6], [-0.1, 0.6, 0.6]],
            [0.0, 0.0, -0.8],
        );
    simulation(&scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{strokes}",
        body("sphere", 1200, [0.0, 0.0, 0.0])
    )))
}

#[test]
fn a_frame_without_a_cut_leaves_the_plan_alone() {
    let mut simulation = cut_sphere();
    let mut quiet = 0;
    for _ in 0..9 {
        let plan = |s: &Simulation| {
            (
                s.clustering().into_owned(),
                s.coloring().into_owned(),
                s.schedule().into_owned(),
            )
        };
        let (before, mesh) = (plan(&simulation), simulation.mesh().clone());
        let report = simulation.step().unwrap().clone();
        if report.cut.is_none() {
            quiet += 1;
            assert_eq!(before, plan(&simulation), "frame {}", report.frame);
            assert_eq!(mesh, *simulation.mesh());
            let ms = report.ms;
            assert_eq!(
                [ms.cluster, ms.color, ms.schedule],
                [0.0; 3],
                "stages that did not happen took time"
            );
        }
    }
    assert_eq!(quiet, 5);
}

#[test]
fn a_cut_keeps_members_and_color_of_untouched_clusters() {
    let mut simulation = cut_sphere();
    let mut cuts = 0;
    for _ in 0..9 {
        let (before, mesh) = (clusters(&simulation), simulation.mesh().clone());
        let Some(cut) = simulation.step().unwrap().cut else {
            continue;
        };
        cuts += 1;
        let after = clusters(&simulation);
        let now = simulation.mesh();
        // A tet was cut if its number holds another volume now, which no relinked or untouched tet does.
        let was_cut = |t: u32| {
            let id = incise::mesh::TetId(t);
            now.volume(id) != mesh.volume(id)
        };
        let lost: usize = (0..u32::try_from(mesh.tets.len()).unwrap())
            .filter(|t| was_cut(*t))
            .count();
        assert!(lost > 0 && lost <= cut.tets_cut);
        let mut untouched = 0;
        for (cluster, (members, color)) in &before {
            let kept: Vec<u32> = members.iter().copied().filter(|t| !was_cut(*t)).collect();
            if kept.len() == members.len() {
                untouched += 1;
                assert_eq!(
                    after.get(cluster),
                    Some(&(kept, *color)),
                    "cluster {cluster}"
                );
            } else if let Some((members, now)) = after.get(cluster).filter(|_| !kept.is_empty()) {
                // What remains of a cluster that lost tets keeps its color too.
                assert_eq!((members, now), (&kept, color), "cluster {cluster}");
            }
        }
        assert!(
            untouched > before.len() / 3,
            "{untouched} of {}",
            before.len()
        );
    }
    assert!(cuts >= 3);
}

#[test]
fn what_the_first_report_counts_is_the_scene() {
    let simulation = cut_sphere();
    let report = simulation.report();
    assert_eq!(report.tets, simulation.mesh().tets.len());
    assert_eq!(report.particles, simulation.positions().len());
    assert_eq!(report.clusters, simulation.clustering().occupied());
    assert_eq!(report.colors, simulation.schedule().color_count());
    assert_eq!(report.pieces, 1);
}
