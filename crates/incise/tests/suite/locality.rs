//! The work of a frame follows the cut: what a cut does not touch stays as it is.

use std::collections::{BTreeMap, BTreeSet};

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

fn cut_sphere(tets: usize) -> Simulation {
    let strokes = plane(2, [0.21, 0.0, 0.0], [1.0, 0.1, 0.0])
        + &sweep(
            [4, 7],
            [[-0.1, -0.6, 0.6], [-0.1, 0.6, 0.6]],
            [0.0, 0.0, -0.8],
        );
    simulation(&scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{strokes}",
        body("sphere", tets, [0.0, 0.0, 0.0])
    )))
}

#[test]
fn a_frame_without_a_cut_leaves_the_plan_alone() {
    let mut simulation = cut_sphere(1200);
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

/// How many clusters away from a cut tet a change may reach: one next to it takes over what the cut left small, is
/// small itself and merged with the next, which moves a neighbor to another color.
const REACH: usize = 3;

#[test]
fn a_cut_changes_only_clusters_near_it() {
    let mut simulation = cut_sphere(20_000);
    let mut cuts = 0;
    for _ in 0..9 {
        let (before, mesh) = (clusters(&simulation), simulation.mesh().clone());
        let labels = simulation.clustering().labels().to_vec();
        let Some(cut) = simulation.step().unwrap().cut else {
            continue;
        };
        cuts += 1;
        let after = clusters(&simulation);
        let now = simulation.mesh();
        // A tet was cut if its number holds another volume now, which no relinked or untouched tet does.
        let was_cut = |t: &usize| {
            let id = incise::mesh::TetId::new(*t);
            now.volume(id) != mesh.volume(id)
        };
        let mut reached: BTreeSet<usize> = (0..mesh.tets.len()).filter(was_cut).collect();
        assert!(!reached.is_empty() && reached.len() <= cut.tets_cut);
        for _ in 0..=REACH {
            let near = reached.iter().flat_map(|&t| mesh.tets[t]);
            let near: BTreeSet<_> = near.collect();
            let touches = |t: &usize| mesh.tets[*t].iter().any(|p| near.contains(p));
            let tets = (0..mesh.tets.len()).filter(touches);
            let there: BTreeSet<_> = tets.map(|t| labels[t]).collect();
            reached = (0..labels.len())
                .filter(|&t| there.contains(&labels[t]))
                .collect();
        }
        let changed: Vec<usize> = before
            .iter()
            .filter(|(cluster, was)| after.get(cluster) != Some(was))
            .map(|(cluster, _)| *cluster)
            .collect();
        for cluster in &changed {
            let tet = before[cluster].0[0] as usize;
            assert!(reached.contains(&tet), "cluster {cluster} is far away");
        }
        assert!(
            reached.len() < labels.len() && changed.len() < before.len() / 2,
            "{} of {} clusters changed",
            changed.len(),
            before.len()
        );
    }
    assert!(cuts >= 3);
}

#[test]
fn the_first_report_counts_the_scene() {
    let simulation = cut_sphere(1200);
    let report = simulation.report();
    assert_eq!(report.tets, simulation.mesh().tets.len());
    assert_eq!(report.particles, simulation.positions().len());
    assert_eq!(report.clusters, simulation.clustering().occupied());
    assert_eq!(report.colors, simulation.schedule().color_count());
    assert_eq!(report.pieces, 1);
}
