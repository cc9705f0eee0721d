//! DSATUR: always color the vertex with the fewest colors left (Brélaz 1979).
//!
//! The saturation of a vertex is the number of different colors around it. The vertex of largest
//! saturation, among these the one of highest priority, takes the smallest color that is free.
//! Exact on bipartite graphs. A vertex remembers the colors around it as bits; all rows are as long
//! as the colors used so far ask for and double when a longer one is needed. A heap holds an entry
//! for every saturation a vertex ever had; the outdated ones are skipped. Cost: O((vertices +
//! edges) log vertices) time, O(vertices * colors / 64 + edges) memory.

use std::collections::BinaryHeap;

use incise_graph::{ColorId, Coloring};

use crate::conflicts::UNCOLORED;
use crate::{Conflicts, priorities};

/// Colors the most constrained vertex first.
///
/// Proper, deterministic, labels without gaps, at most one color more than the largest degree; two colors whenever two
/// are enough. A graph and the incidence it came from give equal colorings. O((n + m) log n) for n vertices and m
/// edges: usually fewer colors than [`greedy`](crate::greedy()) in any order on lattices, at many times its cost.
///
/// ```
/// use incise_coloring::dsatur;
/// use incise_graph::ConstraintGraph;
///
/// // An even ring is bipartite.
/// let ring = ConstraintGraph::from_edges(6, &[(0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0)])?;
/// assert_eq!(dsatur(&ring).color_count(), 2);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn dsatur(conflicts: &impl Conflicts) -> Coloring {
    let graph = conflicts.graph();
    let priorities = priorities(&*graph);
    let mut colors = vec![UNCOLORED; graph.vertex_count()];
    let mut saturation = vec![0u32; colors.len()];
    let mut around = Rows::new(colors.len());
    let mut heap: BinaryHeap<(u32, u64, u32)> = (0..)
        .zip(&priorities)
        .map(|(v, &key)| (0, key, v))
        .collect();
    while let Some((known, _, v)) = heap.pop() {
        let at = v as usize;
        if colors[at] != UNCOLORED || known != saturation[at] {
            continue;
        }
        let color = around.first_gap(at);
        colors[at] = ColorId::new(color);
        for &u in graph.neighbors(at) {
            let next = u as usize;
            if colors[next] == UNCOLORED && around.insert(next, color) {
                saturation[next] += 1;
                heap.push((saturation[next], priorities[next], u));
            }
        }
    }
    Coloring::new(colors)
}

/// A set of colors per vertex, a bit per color.
#[derive(Debug)]
struct Rows {
    /// Words per row.
    stride: usize,
    words: Vec<u64>,
}

impl Rows {
    fn new(rows: usize) -> Self {
        Self {
            stride: 1,
            words: vec![0; rows],
        }
    }

    /// The smallest number that is not in row `row`.
    fn first_gap(&self, row: usize) -> usize {
        let words = &self.words[row * self.stride..(row + 1) * self.stride];
        let full = words.iter().take_while(|&&word| word == u64::MAX).count();
        full * 64
            + words
                .get(full)
                .map_or(0, |word| word.trailing_ones() as usize)
    }

    /// Adds `color` to row `row`; false if it was there.
    fn insert(&mut self, row: usize, color: usize) -> bool {
        while color / 64 >= self.stride {
            self.double();
        }
        let word = &mut self.words[row * self.stride + color / 64];
        let before = *word;
        *word |= 1 << (color % 64);
        before != *word
    }

    fn double(&mut self) {
        let mut words = Vec::with_capacity(2 * self.words.len());
        for row in self.words.chunks_exact(self.stride) {
            words.extend_from_slice(row);
            words.resize(words.len() + self.stride, 0);
        }
        self.words = words;
        self.stride *= 2;
    }
}
