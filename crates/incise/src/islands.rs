//! [`island_of_bodies`]: groups of bodies that are solved together.
//!
//! Bodies that no distance joins do not interact: each gets its own solver, schedule and substeps. Bodies joined
//! directly or through others are solved as one. Source: the islands of rigid body engines, found as connected
//! components by union-find. Cost: O(bodies + pairs).

use incise_graph::DisjointSets;

/// Returns for each of `bodies` bodies the number of its island; islands are numbered in the order of their first body.
/// `joined` lists pairs of bodies that must be solved together.
///
/// # Panics
/// If a pair names a body that does not exist.
pub(crate) fn island_of_bodies(bodies: usize, joined: &[[usize; 2]]) -> Vec<usize> {
    let mut sets = DisjointSets::new(bodies);
    for pair in joined {
        let [a, b] = pair.map(|body| u32::try_from(body).expect("bodies are numbered in 32 bits"));
        sets.unite(a, b);
    }
    let mut island_of: Vec<usize> = Vec::with_capacity(bodies);
    let mut count = 0;
    for (body, root) in sets.roots().into_iter().enumerate() {
        // The root is the first body of its island.
        let root = root as usize;
        let island = if root == body { count } else { island_of[root] };
        count += usize::from(root == body);
        island_of.push(island);
    }
    island_of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_bodies_share_an_island() {
        assert!(island_of_bodies(0, &[]).is_empty());
        assert_eq!(island_of_bodies(3, &[]), [0, 1, 2]);
        assert_eq!(island_of_bodies(3, &[[1, 1]]), [0, 1, 2]);
        assert_eq!(island_of_bodies(5, &[[4, 1], [3, 4]]), [0, 1, 2, 1, 1]);
        assert_eq!(island_of_bodies(4, &[[2, 3], [0, 1], [3, 0]]), [0; 4]);
    }
}
