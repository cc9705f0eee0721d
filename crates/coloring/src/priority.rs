//! The order in which vertices get to choose: most neighbors first, ties broken by a hash of the
//! number.
//!
//! Vertices with many neighbors have the least freedom, so they choose first; the hash scatters
//! equal degrees, so that chains of waiting neighbors stay short in the parallel algorithm. The
//! order is that of ECL-GC, which the paper's section 4.1 builds on: u comes before v if (degree,
//! hash, number) of u is the greater triple. Each step of the hash can be undone (an xor with a
//! shifted copy, a product with an odd constant), so different numbers never share a hash, the
//! first two entries decide alone, and a priority is one `u64`. Cost: O(1) each, O(n log n) for the
//! order.

use rayon::prelude::*;

use crate::Conflicts;

/// Returns a scrambled number, different for different `id`s. Integer arithmetic only, so it is
/// equal on every machine.
#[must_use]
pub fn hash(id: u32) -> u32 {
    const ODD: u32 = 0x045d_9f3b;
    let x = ((id >> 16) ^ id).wrapping_mul(ODD);
    let x = ((x >> 16) ^ x).wrapping_mul(ODD);
    (x >> 16) ^ x
}

/// Returns the priority of every vertex: degree in the high 32 bits, hash in the low ones. The
/// greater one goes first; no two are equal.
///
/// The cost is that of [`Conflicts::degrees`].
///
/// ```
/// use incise_coloring::priorities;
/// use incise_graph::ConstraintGraph;
///
/// let star = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
/// let priorities = priorities(&star);
/// assert!(priorities[1] > priorities[0], "the center goes first");
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn priorities(conflicts: &impl Conflicts) -> Vec<u64> {
    let degrees = conflicts.degrees();
    (0..)
        .zip(degrees)
        .map(|(v, degree)| (u64::from(degree) << 32) | u64::from(hash(v)))
        .collect()
}

/// Returns all vertices, highest priority first. O(n log n) beside the priorities.
#[must_use]
pub fn priority_order(conflicts: &impl Conflicts) -> Vec<u32> {
    let mut order: Vec<(u64, u32)> = priorities(conflicts).into_iter().zip(0..).collect();
    order.par_sort_unstable_by(|a, b| b.cmp(a));
    order.into_iter().map(|(_, v)| v).collect()
}

#[cfg(test)]
mod tests {
    use incise_graph::ConstraintGraph;

    use super::*;

    #[test]
    fn hash_is_pinned_and_never_collides() {
        assert_eq!([hash(0), hash(1), hash(2)], [0, 824515495, 1722258072]);
        let mut seen: Vec<u32> = (0..100_000).map(hash).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 100_000);
    }

    #[test]
    fn degree_decides_before_the_hash() {
        let graph = ConstraintGraph::from_edges(5, &[(3, 0), (3, 1), (3, 2), (1, 0)]).unwrap();
        let order = priority_order(&graph);
        assert_eq!((order[0], order[3], order[4]), (3, 2, 4));
        let keys = priorities(&graph);
        assert!(order.is_sorted_by(|&a, &b| keys[a as usize] > keys[b as usize]));
    }
}
