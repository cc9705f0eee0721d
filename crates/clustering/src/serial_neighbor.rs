//! Serial neighbor clustering: each constraint not yet in a cluster starts one with its free
//! neighbors (paper section 4.2, Algorithm 2).
//!
//! One pass over the vertices in index order, without a search beyond the neighbors of the seed.
//! The paper leaves two points open. The choice of free neighbors (line 8) is here the first ones
//! in index order, so that the result is determined. The limit Ks here includes the seed: the
//! algorithm selects "up to (Ks-1)" neighbors beside it. The counts of the paper's Table 1 imply
//! the looser reading, Ks neighbors beside the seed (1972 clusters of Ks = 5 hold 11,367 tets);
//! that is this function with Ks + 1, and `serial-loose:Ks` by name.
//!
//! Every cluster consists of its seed and neighbors of its seed. The quality depends on the
//! numbering of the constraints: neighbors should have close numbers.
//!
//! Building the graph costs far more than clustering it, so the algorithm also runs [directly on
//! incidence](serial_neighbor_incidence). The free constraints on a particle ascend, so a seed
//! needs at most the first Ks - 1 of them, and because seeds ascend too, the clustered ones at the
//! front of a list are skipped permanently. Cost: O(vertices + edges) from a graph, far less from
//! incidence.

use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering, ConstraintGraph, Incidence};

/// Clusters of a vertex and up to `max_size - 1` of its free neighbors, vertex after vertex.
///
/// `max_size` is the paper's Ks, a strict limit; with 1 every vertex stays alone. Clusters are
/// numbered in the order of their seeds. Deterministic, O(vertices + edges).
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
    // Line 1: no vertex is in a cluster. Lines 3-4: each vertex that is still in none starts one.
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

/// [`serial_neighbor`] of the constraint graph of `incidence`, with identical labels, without
/// building the graph.
///
/// Deterministic. At most O(sum over particles of valence squared), in practice near O(entries *
/// `max_size`).
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::{serial_neighbor, serial_neighbor_incidence};
/// use incise_graph::{ConstraintGraph, Incidence};
///
/// let springs = Incidence::from_constraints(9, (0u32..8).map(|i| [i, i + 1]))?;
/// let three = NonZeroUsize::MIN.saturating_add(2);
/// let graph = ConstraintGraph::from_incidence(&springs);
/// assert_eq!(serial_neighbor_incidence(&springs, three), serial_neighbor(&graph, three));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[expect(
    clippy::missing_panics_doc,
    reason = "the labels are in range, no input makes it panic"
)]
#[must_use]
pub fn serial_neighbor_incidence(incidence: &Incidence, max_size: NonZeroUsize) -> Clustering {
    let room = max_size.get() - 1;
    let mut labels = vec![ClusterId::NONE; incidence.constraint_count()];
    // The number of leading constraints of each particle's list that are clustered.
    let mut passed = vec![0; incidence.particle_count()];
    let mut free = Vec::new();
    let mut clusters = 0;
    for seed in 0..labels.len() {
        if labels[seed] != ClusterId::NONE {
            continue;
        }
        let cluster = ClusterId(clusters);
        clusters += 1;
        labels[seed] = cluster;
        if room == 0 {
            continue;
        }
        let is_free = |c: &u32| labels[*c as usize] == ClusterId::NONE;
        for &p in incidence.particles_of(seed) {
            let passed = &mut passed[p as usize];
            let list = &incidence.constraints_of(p as usize)[*passed..];
            let clustered = list.iter().position(is_free).unwrap_or(list.len());
            *passed += clustered;
            let rest = list[clustered..].iter().copied();
            free.extend(rest.filter(is_free).take(room));
        }
        free.sort_unstable();
        free.dedup();
        for c in free.drain(..).take(room) {
            labels[c as usize] = cluster;
        }
    }
    Clustering::from_labels(labels).expect("there are at most as many clusters as constraints")
}
