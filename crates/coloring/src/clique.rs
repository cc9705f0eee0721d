//! A large clique of a graph, found greedily: a lower bound on the colors.
//!
//! Incidence shows its cliques, a graph does not, and finding the largest is hard. But the graphs
//! of constraints are full of cliques, and from a vertex of one most of it can be had greedily:
//! go through its neighbors, those adjacent to most of the other neighbors first, and take each one
//! that is adjacent to all vertices taken so far. Good vertices to start from are those with many
//! neighbors, and those that got the last color of a greedy coloring, since each of them has a
//! neighbor of every other color. Cost: O(starts * degree squared), and one pass over the vertices.

use std::cmp::Reverse;

use incise_graph::{Coloring, ConstraintGraph};

/// Vertices from which a clique is grown at most.
const STARTS: usize = 64;

/// The size of the largest clique found from the vertices of largest degree.
pub(crate) fn clique_of_hubs(graph: &ConstraintGraph) -> usize {
    let mut starts: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    let by_degree = |&v: &u32| (Reverse(graph.degree(v as usize)), v);
    if starts.len() > STARTS {
        starts.select_nth_unstable_by_key(STARTS, by_degree);
        starts.truncate(STARTS);
    }
    starts.sort_unstable_by_key(by_degree);
    clique_from(graph, starts.into_iter())
}

/// The size of the largest clique found from vertices of the last color.
pub(crate) fn clique_of_last_color(graph: &ConstraintGraph, coloring: &Coloring) -> usize {
    let last = coloring.colors().iter().max();
    let all = (0..).zip(coloring.colors());
    let starts = all.filter(|(_, color)| Some(*color) == last);
    clique_from(graph, starts.map(|(v, _)| v).take(STARTS))
}

fn clique_from(graph: &ConstraintGraph, starts: impl Iterator<Item = u32>) -> usize {
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
    use incise_graph::ColorId;

    use super::*;

    #[test]
    fn hidden_cliques_are_found() {
        // A clique of ten, connected to a hub with many leaves.
        let mut edges: Vec<(u32, u32)> =
            (0..10).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        edges.extend((10..60).map(|leaf| (0, leaf)));
        let graph = ConstraintGraph::from_edges(70, &edges).unwrap();
        assert_eq!(clique_of_hubs(&graph), 10);
        // From a leaf there is only an edge, from a vertex of the clique all of it.
        let mut colors = vec![ColorId(0); 70];
        colors[30] = ColorId(1);
        let last =
            |colors: &[ColorId]| clique_of_last_color(&graph, &Coloring::new(colors.to_vec()));
        assert_eq!(last(&colors), 2);
        colors[9] = ColorId(2);
        assert_eq!(last(&colors), 10);
        let size = |vertices, edges: &[(u32, u32)]| {
            clique_of_hubs(&ConstraintGraph::from_edges(vertices, edges).unwrap())
        };
        assert_eq!((size(0, &[]), size(3, &[]), size(3, &[(0, 2)])), (0, 1, 2));
        // A ring of five has no triangle.
        assert_eq!(size(5, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]), 2);
    }
}
