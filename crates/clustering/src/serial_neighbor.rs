//! Serial neighbor clustering: each constraint not yet in a cluster starts one with its free
//! neighbors (paper section 4.2, Algorithm 2).
//!
//! One pass over the vertices in index order, no search beyond the neighbors of the seed. The paper
//! leaves two things open. Which free neighbors are selected (line 8): here the first ones in index
//! order, so that the result is determined. And whether Ks counts the seed: the algorithm selects
//! "up to (Ks-1)" neighbors beside it, so here a cluster never has more than Ks members, seed
//! included.
//!
//! Every cluster lies within its seed and the neighbors of its seed. How good the clusters are
//! depends on the numbering of the constraints: neighbors should have close numbers. Cost:
//! O(vertices + edges).

use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering, ConstraintGraph};

/// Clusters of a vertex and up to `max_size - 1` of its free neighbors, vertex after vertex.
///
/// `max_size` is the paper's Ks, a strict limit; with 1 every vertex stays alone. The number of a
/// cluster is the order in which its seed comes up. Deterministic, O(vertices + edges).
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::serial_neighbor;
/// use incise_graph::{ClusterId, ConstraintGraph};
///
/// // A star with center 4: seed 0 takes the center, the other leaves find no free neighbor.
/// let star = ConstraintGraph::from_edges(5, &[(4, 0), (4, 1), (4, 2), (4, 3)])?;
/// let clustering = serial_neighbor(&star, NonZeroUsize::MIN.saturating_add(2));
/// assert_eq!(clustering.labels(), [0, 1, 2, 3, 0].map(ClusterId));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[expect(
    clippy::missing_panics_doc,
    reason = "the labels are in range, no input makes it panic"
)]
#[must_use]
pub fn serial_neighbor(graph: &ConstraintGraph, max_size: NonZeroUsize) -> Clustering {
    // Line 1: nobody is in a cluster. Lines 3-4: each vertex that still is not starts one.
    let mut labels = vec![ClusterId::NONE; graph.vertex_count()];
    let mut clusters = 0;
    for seed in 0..labels.len() {
        if labels[seed] != ClusterId::NONE {
            continue;
        }
        // Lines 5-6.
        let cluster = ClusterId(clusters);
        clusters += 1;
        labels[seed] = cluster;
        // Lines 7-10: neighbors ascend, so the first free ones are those with the smallest numbers.
        let mut room = max_size.get() - 1;
        for &u in graph.neighbors(seed) {
            if room == 0 {
                break;
            }
            let label = &mut labels[u as usize];
            if *label == ClusterId::NONE {
                *label = cluster;
                room -= 1;
            }
        }
    }
    Clustering::from_labels(labels).expect("there are at most as many clusters as vertices")
}
