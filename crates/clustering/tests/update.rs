//! Local updates keep counts, the size limit and all unrelated clusters.

use std::num::NonZeroUsize;

use incise_clustering::{serial_neighbor, update_local};
use incise_coloring::{Recoloring, scgc};
use incise_graph::{ClusterId, ConstraintGraph, Incidence, Schedule};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

/// A row of `n` springs.
fn row(n: u32) -> Vec<Vec<u32>> {
    (0..n).map(|i| vec![i, i + 1]).collect()
}

proptest! {
    #[test]
    fn only_the_edit_changes(
        removed in btree_set(0u32..40, 0..20),
        pieces in vec(0u32..9, 20),
        ks in 1usize..6,
    ) {
        let limit = NonZeroUsize::new(ks).unwrap();
        let incidence = Incidence::from_constraints(41, row(40)).unwrap();
        let mut clustering = serial_neighbor(&ConstraintGraph::from_incidence(&incidence), limit);
        let before = clustering.clone();
        let removed: Vec<u32> = removed.into_iter().collect();
        // Each removed constraint is replaced by a group; the first of the group reuses its number.
        let (mut offsets, mut values, mut next) = (vec![0], Vec::new(), 40);
        for (&c, &count) in removed.iter().zip(&pieces) {
            for piece in 0..count {
                values.push(if piece == 0 { c } else { next });
                next += u32::from(piece > 0);
            }
            offsets.push(u32::try_from(values.len()).unwrap());
        }
        let new = update_local(&mut clustering, &removed, &offsets, &values, limit).unwrap();
        clustering.check().unwrap();
        prop_assert!(clustering.max_size() <= ks);
        for c in (0..40).filter(|&c| !removed.contains(&c)) {
            prop_assert_eq!(clustering.cluster_of(c as usize), before.cluster_of(c as usize));
        }
        let members = clustering.members();
        let clusters: Vec<Vec<u32>> = new.iter().map(|k| members.members(k.index()).to_vec()).collect();
        prop_assert_eq!(clusters.iter().map(Vec::len).sum::<usize>(), values.len());
        let parts = |&count: &u32| (count as usize).div_ceil(ks);
        let expected: usize = pieces.iter().take(removed.len()).map(parts).sum();
        prop_assert_eq!(new.len(), expected);
        for (group, &c) in offsets.windows(2).zip(&removed) {
            // No new cluster mixes two groups.
            let group = &values[group[0] as usize..group[1] as usize];
            for members in &clusters {
                let inside = members.iter().filter(|m| group.contains(m)).count();
                prop_assert!(inside == 0 || inside == members.len(), "group of {}", c);
            }
        }
    }

    /// All steps after a cut: edit, quotient, recolor the new clusters only, schedule.
    #[test]
    fn a_cut_spring_row_stays_solvable(cut in 0u32..40, ks in 1usize..6) {
        let limit = NonZeroUsize::new(ks).unwrap();
        let mut springs = row(40);
        let incidence = Incidence::from_constraints(44, springs.clone()).unwrap();
        let graph = ConstraintGraph::from_incidence(&incidence);
        let mut clustering = serial_neighbor(&graph, limit);
        let coloring = scgc(&graph.quotient(&clustering)).coloring;
        let pairs = |c: usize, k: ClusterId, springs: &[Vec<u32>]| {
            let particles = springs[c].clone();
            particles.into_iter().map(move |p| (k.0, p))
        };
        let labels = clustering.labels().to_vec();
        let all: Vec<(u32, u32)> = (0..40).flat_map(|c| pairs(c, labels[c], &springs)).collect();
        let mut recoloring = Recoloring::with_coloring(all, coloring, 1).unwrap();
        let cut = cut as usize;
        let removed: Vec<(u32, u32)> = pairs(cut, labels[cut], &springs).collect();
        // One spring becomes four in a chain through three new particles.
        let number = u32::try_from(cut).unwrap();
        springs[cut] = vec![number, 41];
        springs.extend([vec![41, 42], vec![42, 43], vec![43, number + 1]]);
        let after = Incidence::from_constraints(44, springs.clone()).unwrap();
        let values = [number, 40, 41, 42];
        update_local(&mut clustering, &[number], &[0, 4], &values, limit).unwrap();
        let labels = clustering.labels();
        let new = values.map(|c| c as usize);
        let added: Vec<(u32, u32)> = new.into_iter().flat_map(|c| pairs(c, labels[c], &springs)).collect();
        recoloring.apply(&removed, &added).unwrap();
        recoloring.check().unwrap();
        let coloring = recoloring.coloring();
        coloring.verify_incidence(&after.quotient(&clustering)).unwrap();
        Schedule::new(&clustering, coloring).check(&after).unwrap();
    }
}
