//! Greedy K-neighbor clustering: clusters grow by the constraint that shares most particles with
//! them.
//!
//! This is the method to which the paper compares its own (Ton-That, Kry and Andrews 2023),
//! reconstructed from descriptions, not from its source. A cluster repeatedly takes the free
//! constraint with the largest sum, over the members, of the number of particles shared with the
//! member. The next cluster starts next to the previous ones: at the oldest free constraint of a
//! queue of former candidates.
//!
//! Scores are updated incrementally: when `c` joins, every other constraint on each of its
//! particles gains one. Cost: O(K * arity * valence) score updates per cluster, each with the
//! logarithm of a heap.

use std::collections::VecDeque;
use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering, Incidence};

use crate::candidates::Candidates;

/// Clusters of up to `max_size` constraints that share as many particles as possible.
///
/// Every constraint is in one cluster. A cluster is connected: each member but the first shares a
/// particle with an earlier one. It has fewer than `max_size` members only if no adjacent
/// constraint was free.
///
/// Ties go to the smallest number. Former candidates are queued in the order in which they became
/// candidates: by the member that caused it, then by the position of the shared particle in that
/// member, then by number. If the queue is empty, the smallest free number starts. Deterministic.
/// O(sum over particles of valence squared, times log), independent of `max_size`.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::greedy_k_neighbor;
/// use incise_graph::{ClusterId, Incidence};
/// // Four tetrahedra: 0 and 2 share a triangle, so do 1 and 3; 0 and 1 share a particle.
/// let tets = [[0u32, 1, 2, 3], [3, 5, 6, 7], [1, 2, 3, 4], [5, 6, 7, 8]];
/// let incidence = Incidence::from_constraints(9, tets)?;
/// let clustering = greedy_k_neighbor(&incidence, NonZeroUsize::MIN.saturating_add(1));
/// assert_eq!(clustering.labels(), [0, 1, 0, 1].map(ClusterId));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[expect(
    clippy::missing_panics_doc,
    reason = "the labels are in range, no input makes it panic"
)]
#[must_use]
pub fn greedy_k_neighbor(incidence: &Incidence, max_size: NonZeroUsize) -> Clustering {
    let constraints = incidence.constraint_count();
    let mut labels = vec![ClusterId::NONE; constraints];
    let mut candidates = Candidates::new(constraints);
    let mut frontier = VecDeque::new();
    let mut unseen = 0..constraints;
    let mut clusters = 0;
    loop {
        let is_free = |c: &u32| labels[*c as usize] == ClusterId::NONE;
        let waiting = std::iter::from_fn(|| frontier.pop_front()).find(is_free);
        let Some(seed) = waiting.or_else(|| {
            let c = unseen.find(|&c| labels[c] == ClusterId::NONE)?;
            u32::try_from(c).ok()
        }) else {
            break;
        };
        let cluster = ClusterId(clusters);
        clusters += 1;
        let mut member = Some(seed);
        for size in 1.. {
            let Some(c) = member else { break };
            labels[c as usize] = cluster;
            for &p in incidence.particles_of(c as usize) {
                for &d in incidence.constraints_of(p as usize) {
                    if labels[d as usize] == ClusterId::NONE {
                        candidates.raise(d, 1);
                    }
                }
            }
            if size == max_size.get() {
                break;
            }
            member = candidates.best(|d| labels[d as usize] == ClusterId::NONE);
        }
        let leftovers = candidates.touched().iter().copied();
        frontier.extend(leftovers.filter(|&d| labels[d as usize] == ClusterId::NONE));
        candidates.clear();
    }
    Clustering::from_labels(labels).expect("there are at most as many clusters as constraints")
}
