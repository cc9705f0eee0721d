//! For each vertex its neighbors of higher priority: those it may have to wait for.
//!
//! Half of the edges, each at its lower end. Built straight from the input, so that incidence never
//! has to become a full graph. A neighbor met several times is kept once, and lists ascend but for
//! their head, so that a graph and the incidence it came from give the same lists. The head is the
//! neighbor of lowest priority: in all likelihood the last to be colored, hence the one to look at
//! first. Cost: one walk over all neighbors, and sorting the lists, which is one pass over them
//! when they come sorted, as they do from a graph.

use rayon::prelude::*;

use crate::Conflicts;

/// Ragged lists: vertex -> neighbors of higher priority.
#[derive(Debug)]
pub(crate) struct Higher {
    /// Edges of an incidence are not limited to 2^32.
    pub(crate) offsets: Vec<usize>,
    pub(crate) values: Vec<u32>,
}

/// Vertices per task at least.
const GRAIN: usize = 512;

impl Higher {
    /// The lists under `priorities`, one per vertex and no two equal; greater is higher.
    pub(crate) fn new(conflicts: &impl Conflicts, priorities: &[u64]) -> Self {
        // A few large pieces: their lists are copied together in the end.
        let piece = priorities
            .len()
            .div_ceil(4 * rayon::current_num_threads())
            .max(GRAIN);
        let vertices: Vec<u32> = (0..).take(priorities.len()).collect();
        let pieces: Vec<(Vec<usize>, Vec<u32>)> = vertices
            .par_chunks(piece)
            .map(|vertices| Self::piece(conflicts, priorities, vertices))
            .collect();
        let mut offsets = Vec::with_capacity(priorities.len() + 1);
        offsets.push(0);
        let mut values = Vec::with_capacity(pieces.iter().map(|(_, values)| values.len()).sum());
        for (ends, part) in pieces {
            let start = values.len();
            offsets.extend(ends.into_iter().map(|end| start + end));
            values.extend_from_slice(&part);
        }
        Self { offsets, values }
    }

    /// The ends of the lists of a few vertices, and the lists.
    fn piece(
        conflicts: &impl Conflicts,
        priorities: &[u64],
        vertices: &[u32],
    ) -> (Vec<usize>, Vec<u32>) {
        let mut ends = Vec::with_capacity(vertices.len());
        let mut values = Vec::new();
        let mut list = Vec::new();
        for &v in vertices {
            let own = priorities[v as usize];
            let mut lowest = (u64::MAX, v);
            list.clear();
            conflicts.visit_neighbors(v, |u| {
                let other = priorities[u as usize];
                if other > own {
                    list.push(u);
                    lowest = lowest.min((other, u));
                }
            });
            list.sort_unstable();
            list.dedup();
            if let Some(head) = list.iter().position(|&u| u == lowest.1) {
                list.swap(0, head);
            }
            values.extend_from_slice(&list);
            ends.push(values.len());
        }
        (ends, values)
    }

    /// The neighbors of `v` that are higher.
    pub(crate) fn of(&self, v: u32) -> &[u32] {
        &self.values[self.offsets[v as usize]..self.offsets[v as usize + 1]]
    }

    /// The length of each list.
    pub(crate) fn counts(&self) -> impl Iterator<Item = u32> {
        self.offsets.windows(2).map(|pair| {
            u32::try_from(pair[1] - pair[0]).expect("a vertex has fewer neighbors than vertices")
        })
    }
}

#[cfg(test)]
mod tests {
    use incise_graph::{ConstraintGraph, Incidence};

    use super::*;
    use crate::priorities;

    #[test]
    fn both_inputs_give_the_same_lists() {
        // Constraints that share up to four particles.
        let constraints =
            (0u32..3000).map(|i| [i % 700, 700 + i % 13, 720 + i % 11, 740 + i % 400]);
        let incidence = Incidence::from_constraints(1140, constraints).unwrap();
        let graph = ConstraintGraph::from_incidence(&incidence);
        let rank = priorities(&graph);
        let lists = Higher::new(&incidence, &rank);
        assert_eq!(lists.values.len(), graph.edge_count());
        let same = Higher::new(&graph, &rank);
        assert_eq!(
            (&lists.offsets, &lists.values),
            (&same.offsets, &same.values)
        );
        for v in (0..).take(graph.vertex_count()) {
            let list = lists.of(v);
            assert!(list.iter().all(|&u| rank[u as usize] > rank[v as usize]));
            let lowest = list.iter().min_by_key(|&&u| rank[u as usize]);
            assert_eq!(list.first(), lowest);
        }
    }
}
