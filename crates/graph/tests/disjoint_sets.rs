//! Disjoint sets compared with sets that are merged by relabeling.

use incise_graph::DisjointSets;
use proptest::prelude::*;

proptest! {
    /// Labels: all members of one set take the label of the other.
    #[test]
    fn sets_are_those_of_labels(pairs in prop::collection::vec((0u32..40, 0u32..40), 0..60)) {
        let mut sets = DisjointSets::new(40);
        let mut labels: Vec<u32> = (0..40).collect();
        for (a, b) in pairs {
            let (from, to) = (labels[a as usize], labels[b as usize]);
            prop_assert_eq!(sets.unite(a, b), from != to);
            for label in &mut labels {
                if *label == from.max(to) {
                    *label = from.min(to);
                }
            }
            prop_assert_eq!(sets.root(a), labels[a as usize]);
        }
        prop_assert_eq!(sets.roots(), labels);
    }
}

#[test]
fn no_numbers_have_no_roots() {
    assert!(DisjointSets::new(0).roots().is_empty());
    assert!(DisjointSets::default().roots().is_empty());
}
