//! Colors within clusters, compared with a check of all pairs.

use incise_coloring::color_within_clusters;
use incise_graph::{ClusterId, Clustering, ColorId, Incidence};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

/// The definition, pair by pair.
fn by_pairs(incidence: &Incidence, clustering: &Clustering) -> Vec<ColorId> {
    let mut colors: Vec<ColorId> = Vec::new();
    for c in 0..incidence.constraint_count() {
        let cluster = clustering.cluster_of(c);
        let collides = |d: &usize| {
            let shared = incidence.particles_of(*d);
            cluster.is_some()
                && clustering.cluster_of(*d) == cluster
                && incidence.particles_of(c).iter().any(|p| shared.contains(p))
        };
        let taken: Vec<ColorId> = (0..c).filter(collides).map(|d| colors[d]).collect();
        let color = (0..).map(ColorId).find(|color| !taken.contains(color));
        colors.push(color.unwrap());
    }
    colors
}

proptest! {
    #[test]
    fn equals_the_definition(
        rows in vec((btree_set(0u32..12, 0..=4).prop_map(Vec::from_iter), 0u32..4), 0..60),
        removed in 0usize..60,
    ) {
        let constraints = rows.iter().map(|(row, _)| row);
        let incidence = Incidence::from_constraints(12, constraints).unwrap();
        let mut labels: Vec<ClusterId> = rows
            .iter()
            .map(|&(_, k)| ClusterId(k.min(u32::try_from(rows.len() - 1).unwrap())))
            .collect();
        if let Some(label) = labels.get_mut(removed) {
            *label = ClusterId::NONE;
        }
        let clustering = Clustering::from_labels(labels).unwrap();
        let colors = color_within_clusters(&incidence, &clustering);
        prop_assert_eq!(colors.colors(), &by_pairs(&incidence, &clustering)[..]);
    }
}

/// Fans of one cluster whose colors end beside the border of a window, next to one that starts
/// again at color 0.
#[test]
fn windows() {
    for n in [1u32, 63, 64, 65, 127, 128, 129, 500] {
        let incidence = Incidence::from_constraints(1, (0..n + 2).map(|_| [0u32])).unwrap();
        let mut labels = vec![ClusterId(0); n as usize];
        labels.extend([ClusterId(1); 2]);
        let clustering = Clustering::from_labels(labels).unwrap();
        let expected: Vec<ColorId> = (0..n).chain(0..2).map(ColorId).collect();
        assert_eq!(
            color_within_clusters(&incidence, &clustering).colors(),
            expected
        );
    }
}

#[test]
fn nothing() {
    let none = Incidence::from_constraints(0, [[0u32; 0]; 0]).unwrap();
    let colors = color_within_clusters(&none, &Clustering::none(0));
    assert_eq!(colors.vertex_count(), 0);
}
