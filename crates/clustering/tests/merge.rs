//! Merging keeps counts, the size limit and distant clusters, and leaves no pair that would fit.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use incise_clustering::{MergeLists, Moved, merge_small, serial_neighbor_incidence};
use incise_graph::{ClusterId, Clustering, Incidence};
use proptest::prelude::*;

use crate::inputs::{awkward, incidences};

/// The constraints that share a particle with `c`.
fn neighbors(incidence: &Incidence, c: u32) -> BTreeSet<u32> {
    let particles = incidence.particles_of(c as usize).iter();
    let mut near: BTreeSet<u32> = particles
        .flat_map(|&p| incidence.constraints_of(p as usize))
        .copied()
        .collect();
    near.remove(&c);
    near
}

/// Merges with constraints linked if they share a particle.
fn merge(
    clustering: &mut Clustering,
    incidence: &Incidence,
    loose: &[u32],
    seeds: &[u32],
    limit: usize,
) -> MergeLists {
    let limit = NonZeroUsize::new(limit).unwrap();
    let mut lists = MergeLists::default();
    merge_small(&mut lists, clustering, loose, seeds, limit, |c| {
        neighbors(incidence, c)
    });
    lists
}

/// The constraints connected to `c` within its cluster, by brute force.
fn part(clustering: &Clustering, incidence: &Incidence, c: u32) -> BTreeSet<u32> {
    let mut part = BTreeSet::from([c]);
    loop {
        let around: BTreeSet<u32> = part
            .iter()
            .flat_map(|&c| neighbors(incidence, c))
            .filter(|&d| clustering.cluster_of(d as usize) == clustering.cluster_of(c as usize))
            .chain([c])
            .collect();
        if around.len() == part.len() {
            return part;
        }
        part = around;
    }
}

proptest! {
    #[test]
    fn merging_keeps_its_guarantees(
        incidence in incidences(),
        labels in prop::collection::vec(0u32..30, 60),
        seeds in prop::collection::vec(0usize..60, 0..20),
        ks in 1usize..9,
        past_the_end in any::<bool>(),
    ) {
        let count = incidence.constraint_count();
        // Any labels, but no cluster above the limit: a constraint whose cluster is full is in none.
        let mut sizes = vec![0; 30.max(count)];
        let labels: Vec<ClusterId> = (0..count)
            .map(|c| {
                let label = labels[c] as usize % count;
                sizes[label] += 1;
                if sizes[label] <= ks { ClusterId::new(label) } else { ClusterId::NONE }
            })
            .collect();
        let loose: Vec<u32> = (0..).zip(&labels).filter(|(_, k)| **k == ClusterId::NONE).map(|(c, _)| c).collect();
        let mut before = Clustering::from_labels(labels).unwrap();
        if past_the_end {
            // Loose constraints at the end may be past the end of the clustering.
            let known = before.labels().iter().rposition(|&k| k != ClusterId::NONE);
            before.truncate(known.map_or(0, |c| c + 1));
        }
        let seeds: Vec<u32> = seeds
            .into_iter()
            .filter(|&c| c < before.constraint_count())
            .map(|c| u32::try_from(c).unwrap())
            .collect();
        let mut after = before.clone();
        let lists = merge(&mut after, &incidence, &loose, &seeds, ks);

        after.check().unwrap();
        prop_assert!(after.max_size() <= ks);
        prop_assert!((0..count).all(|c| after.cluster_of(c).is_some()));
        prop_assert!(after.occupied() <= before.occupied() + loose.len());
        let was = |c: usize| before.labels().get(c).copied().unwrap_or(ClusterId::NONE);
        let expected: Vec<Moved> = (0..)
            .zip(after.labels())
            .map(|(constraint, is)| (constraint, was(constraint as usize), is))
            .filter(|(_, was, is)| was != *is && *was != ClusterId::NONE)
            .map(|(constraint, from, _)| Moved { constraint, from })
            .collect();
        prop_assert_eq!(lists.moved(), &expected);
        let mut assigned = lists.assigned().to_vec();
        assigned.sort_unstable();
        prop_assert_eq!(&assigned, &loose);

        // Reused lists give the result of new ones.
        let (mut again, mut lists) = (before.clone(), lists);
        let limit = NonZeroUsize::new(ks).unwrap();
        merge_small(&mut lists, &mut again, &loose, &seeds, limit, |c| neighbors(&incidence, c));
        prop_assert_eq!(&again, &after);
        prop_assert_eq!(lists.moved(), &expected);

        // Each moved constraint can be reached along links and clusters from a seed or a loose constraint.
        let mut reached: BTreeSet<u32> = loose.iter().chain(&seeds).copied().collect();
        loop {
            let mut more = reached.clone();
            more.extend(reached.iter().flat_map(|&c| neighbors(&incidence, c)));
            let clusters: BTreeSet<ClusterId> =
                more.iter().map(|&c| was(c as usize)).filter(|&k| k != ClusterId::NONE).collect();
            more.extend((0..).take(count).filter(|&c| clusters.contains(&was(c as usize))));
            if more.len() == reached.len() {
                break;
            }
            reached = more;
        }
        for moved in &expected {
            prop_assert!(reached.contains(&moved.constraint));
        }
    }
}

proptest! {
    /// If every cluster is connected, no loose constraint and no seed ends up in a small cluster that fits into a
    /// linked one.
    #[test]
    fn fitting_clusters_are_merged(
        incidence in incidences(),
        chosen in prop::collection::vec(0usize..60, 0..20),
        single in prop::collection::vec(0usize..60, 0..20),
        start in 1usize..4,
        ks in 3usize..9,
    ) {
        let mut clustering = serial_neighbor_incidence(&incidence, NonZeroUsize::new(start).unwrap());
        let count = incidence.constraint_count();
        let of = |list: &[usize]| -> Vec<u32> {
            (0..).take(count).filter(|&c| list.contains(&(c as usize))).collect()
        };
        let (mut seeds, mut loose) = (of(&chosen), of(&single));
        // Whole clusters become loose, so that the others stay connected.
        let gone: BTreeSet<_> = loose.iter().filter_map(|&c| clustering.cluster_of(c as usize)).collect();
        loose = (0..).take(count).filter(|&c| {
            clustering.cluster_of(c as usize).is_some_and(|k| gone.contains(&k))
        }).collect();
        for &c in &loose {
            clustering.remove(c as usize);
        }
        merge(&mut clustering, &incidence, &loose, &seeds, ks);
        seeds.extend(&loose);
        for &seed in &seeds {
            let own = clustering.cluster_of(seed as usize).unwrap();
            let size = clustering.size(own);
            for c in part(&clustering, &incidence, seed) {
                for d in neighbors(&incidence, c) {
                    let other = clustering.cluster_of(d as usize).unwrap();
                    let fits = other != own && size <= ks / 2 && size + clustering.size(other) <= ks;
                    prop_assert!(!fits, "{own} fits into {other}");
                }
            }
        }
    }
}

#[test]
fn loose_constraints_become_full_clusters_or_nearly_so() {
    for incidence in awkward() {
        let count = incidence.constraint_count();
        for ks in [1, 2, 5, 10] {
            let mut clustering = Clustering::default();
            let loose: Vec<u32> = (0..).take(count).collect();
            merge(&mut clustering, &incidence, &loose, &[], ks);
            clustering.check().unwrap();
            assert!(clustering.max_size() <= ks);
            // Each cluster is one part: merging never joins unlinked constraints.
            for c in loose {
                let own = clustering.cluster_of(c as usize).unwrap();
                assert_eq!(part(&clustering, &incidence, c).len(), clustering.size(own));
            }
        }
    }
    let row = Incidence::from_constraints(301, (0u32..300).map(|i| [i, i + 1])).unwrap();
    let mut clustering = Clustering::default();
    // From one end or from both: at most the last cluster is a remainder.
    for loose in [(0..300).collect::<Vec<u32>>(), (0..300).rev().collect()] {
        clustering.clone_from(&Clustering::default());
        merge(&mut clustering, &row, &loose, &[], 10);
        assert_eq!(clustering.occupied(), 30);
    }
}

/// Two adjacent triangles; a cut has separated the left one from the right ones.
#[test]
fn clusters_do_not_cross_a_cut() {
    let incidence = Incidence::from_constraints(7, [[0u32, 1, 2], [3, 4, 5], [3, 4, 6]]).unwrap();
    let mut clustering = Clustering::default();
    merge(&mut clustering, &incidence, &[0, 1, 2], &[], 4);
    assert_eq!(clustering.labels(), [0, 1, 1].map(ClusterId));
    let mut clustering = Clustering::from_labels([0, 1, 2].map(ClusterId).to_vec()).unwrap();
    let lists = merge(&mut clustering, &incidence, &[], &[0, 1], 4);
    let from = ClusterId(1);
    let expected = Moved {
        constraint: 1,
        from,
    };
    assert_eq!(lists.moved(), [expected]);
    assert_eq!(clustering.sizes(), [1, 0, 2]);
}

/// A cluster of four that a cut has separated: each half joins its own side.
#[test]
fn parts_of_a_cluster_are_handled_separately() {
    let rows = [
        [0u32, 1],
        [1, 2],
        [5, 6],
        [6, 7],
        [2, 3],
        [3, 4],
        [7, 8],
        [8, 9],
    ];
    let incidence = Incidence::from_constraints(10, rows).unwrap();
    let labels = [0, 0, 0, 0, 1, 1, 2, 2].map(ClusterId).to_vec();
    let mut clustering = Clustering::from_labels(labels).unwrap();
    // The cluster in parts is larger than half of the limit; its neighbors are not, and it has room for one of them.
    let lists = merge(&mut clustering, &incidence, &[], &[4, 6], 6);
    let moved = [4, 5].map(|constraint| Moved {
        constraint,
        from: ClusterId(1),
    });
    assert_eq!(lists.moved(), moved);
    let labels = [0, 0, 0, 0, 1, 1, 2, 2].map(ClusterId).to_vec();
    let mut clustering = Clustering::from_labels(labels).unwrap();
    merge(&mut clustering, &incidence, &[], &[0, 2], 8);
    assert_eq!(clustering.labels(), [1, 1, 2, 2, 1, 1, 2, 2].map(ClusterId));
    assert_eq!(clustering.occupied(), 2);
}

/// A remnant grows into loose constraints before these form clusters of their own.
#[test]
fn small_clusters_grow_first() {
    let row = Incidence::from_constraints(11, (0u32..10).map(|i| [i, i + 1])).unwrap();
    let mut labels = vec![ClusterId::NONE; 10];
    labels[..2].fill(ClusterId(0));
    labels[8..].fill(ClusterId(1));
    let mut clustering = Clustering::from_labels(labels).unwrap();
    let lists = merge(&mut clustering, &row, &[2, 3, 4, 5, 6, 7], &[], 5);
    assert_eq!(clustering.sizes()[..2], [5, 5]);
    assert!(lists.moved().is_empty());
}

/// The neighbor with more links wins.
#[test]
fn more_links_count_more() {
    let links: [&[u32]; 5] = [&[2, 3, 4], &[], &[0, 3], &[0, 2], &[0]];
    let labels = [0, 1, 2, 2, 3].map(ClusterId).to_vec();
    let mut clustering = Clustering::from_labels(labels).unwrap();
    let limit = NonZeroUsize::new(3).unwrap();
    let mut lists = MergeLists::default();
    merge_small(&mut lists, &mut clustering, &[], &[0], limit, |c| {
        links[c as usize].iter().copied()
    });
    assert_eq!(clustering.sizes(), [0, 1, 3, 1]);
}
