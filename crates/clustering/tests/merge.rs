//! Merging keeps the books, the limit and what is far away, and leaves no pair that would fit.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use incise_clustering::{Moved, merge_small, serial_neighbor_incidence};
use incise_graph::{ClusterId, Clustering, Incidence};
use proptest::prelude::*;

use crate::inputs::{awkward, incidences};

/// Merges with the incidence's own lists, each turned around if asked.
fn merge(
    clustering: &mut Clustering,
    incidence: &Incidence,
    seeds: &[u32],
    limit: usize,
    reversed: bool,
) -> Vec<Moved> {
    let turned = |row: &[u32]| {
        let mut row = row.to_vec();
        if reversed {
            row.reverse();
        }
        row
    };
    let limit = NonZeroUsize::new(limit).unwrap();
    merge_small(
        clustering,
        seeds,
        limit,
        |c| turned(incidence.particles_of(c as usize)),
        |p| turned(incidence.constraints_of(p as usize)),
    )
}

/// The distinct particles of a cluster.
fn particles(clustering: &Clustering, incidence: &Incidence, cluster: ClusterId) -> BTreeSet<u32> {
    let members = clustering.members();
    let members = members.members(cluster.index()).iter();
    members
        .flat_map(|&c| incidence.particles_of(c as usize).to_vec())
        .collect()
}

/// The constraints that hang together with `c` within its cluster, by brute force.
fn part(clustering: &Clustering, incidence: &Incidence, c: u32) -> BTreeSet<u32> {
    let mut part = BTreeSet::from([c]);
    loop {
        let around: BTreeSet<u32> = part
            .iter()
            .flat_map(|&c| incidence.particles_of(c as usize))
            .flat_map(|&p| incidence.constraints_of(p as usize))
            .copied()
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
    fn what_merging_promises(
        incidence in incidences(),
        labels in prop::collection::vec(0u32..30, 60),
        seeds in prop::collection::vec(0usize..60, 0..20),
        ks in 1usize..9,
    ) {
        let count = incidence.constraint_count();
        // Any labels, but no cluster above the limit: who finds a cluster full is in none.
        let mut sizes = vec![0; 30.max(count)];
        let labels: Vec<ClusterId> = (0..count)
            .map(|c| {
                let label = labels[c] as usize % count;
                sizes[label] += 1;
                if sizes[label] <= ks { ClusterId::new(label) } else { ClusterId::NONE }
            })
            .collect();
        let before = Clustering::from_labels(labels).unwrap();
        let mut seeds: Vec<u32> = seeds
            .into_iter()
            .filter(|&c| c < count)
            .map(|c| u32::try_from(c).unwrap())
            .collect();
        let mut after = before.clone();
        let moved = merge(&mut after, &incidence, &seeds, ks, false);

        after.check().unwrap();
        prop_assert!(after.max_size() <= ks);
        prop_assert_eq!(after.cluster_count(), before.cluster_count());
        prop_assert!(after.occupied() <= before.occupied());
        let expected: Vec<Moved> = (0..)
            .zip(before.labels().iter().zip(after.labels()))
            .filter(|(_, (was, is))| was != is)
            .map(|(constraint, (was, _))| Moved { constraint, from: *was })
            .collect();
        prop_assert_eq!(&moved, &expected);

        // The order in which seeds and neighbors are listed does not count.
        let mut again = before.clone();
        seeds.reverse();
        prop_assert_eq!(&merge(&mut again, &incidence, &seeds, ks, true), &moved);
        prop_assert_eq!(&again, &after);

        // Clusters change only where clusters of seeds and their neighbors hang together.
        let mut reached: BTreeSet<ClusterId> =
            seeds.iter().filter_map(|&c| before.cluster_of(c as usize)).collect();
        loop {
            let near: BTreeSet<u32> =
                reached.iter().flat_map(|&k| particles(&before, &incidence, k)).collect();
            let more: BTreeSet<ClusterId> = near
                .iter()
                .flat_map(|&p| incidence.constraints_of(p as usize))
                .filter_map(|&c| before.cluster_of(c as usize))
                .chain(reached.iter().copied())
                .collect();
            if more.len() == reached.len() {
                break;
            }
            reached = more;
        }
        for moved in &moved {
            prop_assert!(reached.contains(&moved.from));
        }
    }
}

proptest! {
    /// Where every cluster hangs together, no seed is left in a small cluster beside one that has room for it.
    #[test]
    fn whatever_fits_is_merged(
        incidence in incidences(),
        seeds in prop::collection::vec(0usize..60, 0..20),
        start in 1usize..4,
        ks in 3usize..9,
    ) {
        let mut clustering = serial_neighbor_incidence(&incidence, NonZeroUsize::new(start).unwrap());
        let count = incidence.constraint_count();
        let seeds: Vec<u32> = (0..).take(count).filter(|&c| seeds.contains(&(c as usize))).collect();
        merge(&mut clustering, &incidence, &seeds, ks, false);
        for &seed in &seeds {
            let own = clustering.cluster_of(seed as usize).unwrap();
            let size = clustering.size(own);
            let particles = particles(&clustering, &incidence, own);
            for &d in particles.iter().flat_map(|&p| incidence.constraints_of(p as usize)) {
                let other = clustering.cluster_of(d as usize).unwrap();
                let fits = other != own && size <= ks / 2 && size + clustering.size(other) <= ks;
                prop_assert!(!fits, "{own} fits into {other}");
            }
        }
    }
}

#[test]
fn single_constraints_become_full_clusters_or_nearly_so() {
    for incidence in awkward() {
        let count = incidence.constraint_count();
        for ks in [1, 2, 5, 10] {
            let mut clustering = Clustering::none(count);
            let seeds: Vec<u32> = (0..).take(count).collect();
            merge(&mut clustering, &incidence, &seeds, ks, false);
            clustering.check().unwrap();
            assert!(clustering.max_size() <= ks);
            // Each cluster is one part: merging never joins what shares nothing.
            for c in 0..u32::try_from(count).unwrap() {
                let own = clustering.cluster_of(c as usize).unwrap();
                assert_eq!(part(&clustering, &incidence, c).len(), clustering.size(own));
            }
        }
    }
    let row = Incidence::from_constraints(301, (0u32..300).map(|i| [i, i + 1])).unwrap();
    let mut clustering = Clustering::none(300);
    let seeds: Vec<u32> = (0..300).collect();
    merge(&mut clustering, &row, &seeds, 10, false);
    // No two neighbors fit into one cluster of 10, so each pair of neighbors holds more.
    assert!(clustering.occupied() < 60, "{}", clustering.occupied());
}

/// Two triangles side by side; a cut has parted the left one from the right ones.
#[test]
fn nothing_is_merged_across_a_cut() {
    let incidence = Incidence::from_constraints(7, [[0u32, 1, 2], [3, 4, 5], [3, 4, 6]]).unwrap();
    let mut clustering = Clustering::none(3);
    let moved = merge(&mut clustering, &incidence, &[0, 1], 4, false);
    let from = ClusterId(2);
    assert_eq!(
        moved,
        [Moved {
            constraint: 2,
            from
        }]
    );
    assert_eq!(clustering.sizes(), [1, 2, 0]);
}

/// A cluster of four that a cut brought apart: each half joins its own side.
#[test]
fn parts_of_a_cluster_go_their_own_ways() {
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
    let moved = merge(&mut clustering, &incidence, &[0, 2], 4, false);
    assert_eq!(moved.len(), 4);
    // Of two clusters of one size the smaller number is kept.
    assert_eq!(clustering.labels(), [1, 1, 0, 0, 1, 1, 0, 0].map(ClusterId));
    assert_eq!(clustering.occupied(), 2);
}

/// The neighbor on a face wins over one on an edge.
#[test]
fn a_face_counts_more_than_an_edge() {
    let rows = [[0u32, 1, 2, 3], [2, 3, 4, 5], [1, 2, 3, 6]];
    let incidence = Incidence::from_constraints(7, rows).unwrap();
    let mut clustering = Clustering::none(3);
    merge(&mut clustering, &incidence, &[0], 2, false);
    assert_eq!(clustering.sizes(), [2, 1, 0]);
}
