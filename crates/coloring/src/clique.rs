//! A large clique of a graph, found greedily: a lower bound on the colors.
//!
//! Incidence shows its cliques, a graph does not, and finding the largest is hard. But the graphs
//! of constraints are full of cliques, and from a vertex of one most of it can be had greedily:
//! take the neighbors in order of how many other neighbors they know, each that knows everybody
//! taken so far. Tried from the vertices of largest degree only. Cost: O(vertices + starts * degree
//! squared).

use std::cmp::Reverse;

use incise_graph::ConstraintGraph;

/// Vertices from which a clique is grown.
const STARTS: usize = 64;

/// The size of the largest clique found.
pub(crate) fn greedy_clique(graph: &ConstraintGraph) -> usize {
    let mut starts: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    let by_degree = |&v: &u32| (Reverse(graph.degree(v as usize)), v);
    if starts.len() > STARTS {
        starts.select_nth_unstable_by_key(STARTS, by_degree);
        starts.truncate(STARTS);
    }
    starts.sort_unstable_by_key(by_degree);
    let mut best = 0;
    // For each vertex the start that last looked at it, and how many of the clique know it.
    let mut near = vec![u32::MAX; graph.vertex_count()];
    let mut known = vec![0; graph.vertex_count()];
    for v in starts {
        let neighbors = graph.neighbors(v as usize);
        if neighbors.len() < best {
            continue;
        }
        near[v as usize] = v;
        for &u in neighbors {
            near[u as usize] = v;
            known[u as usize] = 1;
        }
        let friends = |&u: &u32| {
            let all = graph.neighbors(u as usize).iter();
            all.filter(|&&w| near[w as usize] == v).count()
        };
        let mut order: Vec<(usize, u32)> = neighbors.iter().map(|u| (friends(u), *u)).collect();
        order.sort_unstable_by_key(|&(friends, u)| (Reverse(friends), u));
        let mut size = 1;
        for (_, u) in order {
            if known[u as usize] == size {
                size += 1;
                for &w in graph.neighbors(u as usize) {
                    known[w as usize] += 1;
                }
            }
        }
        best = best.max(size);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_cliques_are_found() {
        // A clique of ten that hangs on a hub with many leaves.
        let mut edges: Vec<(u32, u32)> =
            (0..10).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        edges.extend((10..60).map(|leaf| (0, leaf)));
        let graph = ConstraintGraph::from_edges(70, &edges).unwrap();
        assert_eq!(greedy_clique(&graph), 10);
        let size = |vertices, edges: &[(u32, u32)]| {
            greedy_clique(&ConstraintGraph::from_edges(vertices, edges).unwrap())
        };
        assert_eq!((size(0, &[]), size(3, &[]), size(3, &[(0, 2)])), (0, 1, 2));
        // A ring of five has no triangle.
        assert_eq!(size(5, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]), 2);
    }
}
