//! Greedy K-neighbor clustering equals a version that recounts at every step, bit for bit.

use std::num::NonZeroUsize;

use incise_clustering::greedy_k_neighbor;
use incise_graph::{ClusterId, Incidence};
use proptest::prelude::*;

use crate::inputs::{awkward, incidences};

/// The number of particles that two constraints share.
fn shared(incidence: &Incidence, c: usize, d: usize) -> usize {
    let others = incidence.particles_of(d);
    incidence
        .particles_of(c)
        .iter()
        .filter(|p| others.contains(p))
        .count()
}

/// The method with a recount for every decision.
fn recounted(incidence: &Incidence, k: usize) -> Vec<ClusterId> {
    let constraints = incidence.constraint_count();
    let mut labels = vec![ClusterId::NONE; constraints];
    let mut queue: Vec<usize> = Vec::new();
    for cluster in (0..).map(ClusterId) {
        let waiting = queue.iter().copied().chain(0..constraints);
        let Some(seed) = waiting.into_iter().find(|&c| labels[c] == ClusterId::NONE) else {
            break;
        };
        let mut members = vec![seed];
        labels[seed] = cluster;
        while members.len() < k {
            let score = |d: usize| {
                members
                    .iter()
                    .map(|&c| shared(incidence, c, d))
                    .sum::<usize>()
            };
            let free = (0..constraints).filter(|&d| labels[d] == ClusterId::NONE && score(d) > 0);
            let Some(next) = free.rev().max_by_key(|&d| score(d)) else {
                break;
            };
            labels[next] = cluster;
            members.push(next);
        }
        // Former candidates in the order in which they became candidates.
        for &c in &members {
            for &p in incidence.particles_of(c) {
                let on_p = (0..constraints)
                    .filter(|&d| incidence.particles_of(d).contains(&p))
                    .filter(|&d| labels[d] == ClusterId::NONE);
                queue.extend(on_p);
            }
        }
    }
    labels
}

proptest! {
    #[test]
    fn equals_recounting(incidence in incidences(), k in 1usize..20) {
        let clustering = greedy_k_neighbor(&incidence, NonZeroUsize::new(k).unwrap());
        prop_assert_eq!(clustering.labels(), recounted(&incidence, k));
    }
}

#[test]
fn equals_recounting_on_awkward_inputs() {
    for incidence in awkward() {
        if incidence.constraint_count() > 300 {
            continue; // Too slow to recount.
        }
        for k in [1, 2, 5, 31, 1000] {
            let clustering = greedy_k_neighbor(&incidence, NonZeroUsize::new(k).unwrap());
            assert_eq!(clustering.labels(), recounted(&incidence, k));
        }
    }
}
