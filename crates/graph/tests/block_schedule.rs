//! The check of a block schedule agrees with comparing everything that runs together.

use incise_graph::{BlockSchedule, ClusterId, Clustering, ColorId, Coloring, Incidence};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

proptest! {
    #[test]
    fn check_agrees_with_all_pairs(
        rows in vec((btree_set(0u32..40, 0..=3), 0u32..5, 0u32..5), 1..12),
        outer in vec(0u32..4, 5),
    ) {
        let incidence =
            Incidence::from_constraints(40, rows.iter().map(|row| row.0.iter().copied())).unwrap();
        let last = u32::try_from(rows.len() - 1).unwrap();
        let labels: Vec<u32> = rows.iter().map(|row| row.1.min(last)).collect();
        let clustering =
            Clustering::from_labels(labels.iter().copied().map(ClusterId).collect()).unwrap();
        let outer: Vec<ColorId> =
            outer.into_iter().take(clustering.cluster_count()).map(ColorId).collect();
        let inner: Vec<ColorId> = rows.iter().map(|row| ColorId(row.2)).collect();
        let schedule = BlockSchedule::new(
            &clustering,
            &Coloring::new(outer.clone()),
            &Coloring::new(inner.clone()),
        );
        let color = |c: usize| outer[labels[c] as usize];
        let mut proper = true;
        for c in 0..rows.len() {
            for d in 0..c {
                let together = if labels[c] == labels[d] {
                    inner[c] == inner[d]
                } else {
                    color(c) == color(d)
                };
                proper &= !together || rows[c].0.is_disjoint(&rows[d].0);
            }
        }
        prop_assert_eq!(schedule.check(&incidence).is_ok(), proper);
        let mut expected: Vec<usize> = (0..rows.len()).collect();
        expected.sort_by_key(|&c| (color(c), labels[c], inner[c], c));
        let found: Vec<usize> = (0..schedule.color_count())
            .flat_map(|color| schedule.blocks(color))
            .flat_map(|block| schedule.steps(block))
            .flat_map(|step| schedule.constraints(step).iter().map(|&c| c as usize))
            .collect();
        prop_assert_eq!(found, expected);
    }
}
