//! WLC: color first, repair later, with worklists (Chen, Li and Yang 2017, data-driven speculative
//! greedy; after Gebremedhin and Manne 2000).
//!
//! All vertices of a worklist take the smallest color that their neighbors do not have, at the same
//! time, so neighbors may take the same. Of two such neighbors the one with the lower number loses
//! its color and goes to the next worklist. The original finds losers while others are still losing
//! theirs, so its result depends on timing; here a vertex loses if it has a higher neighbor of the
//! same color when all have chosen.
//!
//! On a machine whose threads all run at once, neighbors make the same choice and few win: a
//! clique loses all but one of its vertices in every round. Real machines take a worklist in
//! pieces, and later pieces see what earlier ones chose. The size of a piece is a parameter here,
//! the *chunk*: 1 is sequential first fit, the whole worklist is the worst case. Not in the
//! original: after a round in which more than half of the worklist lost, the chunk is halved, so
//! that no clique takes more rounds than about two logarithms of its size. Cost: O(edges of the
//! worklist) a round; O(log vertices + log chunk) rounds.

use std::num::NonZeroUsize;

use incise_graph::{ColorId, Coloring};
use rayon::prelude::*;

use crate::Conflicts;
use crate::conflicts::UNCOLORED;
use crate::first_fit::FirstFit;

/// Result of [`wlc`]: the coloring and statistics.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Wlc {
    /// The coloring.
    pub coloring: Coloring,
    /// Counts of rounds and repairs.
    pub stats: WlcStats,
}

/// Statistics of [`wlc`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WlcStats {
    /// Number of worklists until one was empty.
    pub rounds: usize,
    /// Number of times that a vertex lost its color.
    pub conflicts: usize,
    /// The neighbors of the vertices of all worklists, counted twice: to choose and, at most, to
    /// compare.
    pub edge_visits: u64,
}

/// Vertices per task at least.
const GRAIN: usize = 64;

/// Colors speculatively in parallel, in the current rayon thread pool. `chunk` vertices choose at
/// the same time, fewer after rounds with many conflicts.
///
/// Proper, labels without gaps, at most one color more than the largest degree. The result depends on the chunk, but
/// not on the number of threads; a graph and the incidence it came from give equal results. O(edges of the worklist) a
/// round.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_coloring::wlc;
/// use incise_graph::ConstraintGraph;
///
/// let path = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 3)])?;
/// let one = wlc(&path, NonZeroUsize::MIN);
/// assert_eq!((one.coloring.color_count(), one.stats.rounds), (2, 1));
/// let all = wlc(&path, NonZeroUsize::MAX);
/// all.coloring.verify(&path)?;
/// assert!(all.stats.conflicts > 0);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn wlc(conflicts: &impl Conflicts, chunk: NonZeroUsize) -> Wlc {
    let graph = conflicts.graph();
    let mut colors = vec![UNCOLORED; graph.vertex_count()];
    let mut stats = WlcStats::default();
    let mut worklist: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    let mut size = chunk.get().min(worklist.len());
    while !worklist.is_empty() {
        stats.rounds += 1;
        let mut losers = Vec::new();
        for chunk in worklist.chunks(size) {
            let chosen: Vec<ColorId> = chunk
                .par_iter()
                .with_min_len(GRAIN)
                .map_init(FirstFit::default, |first_fit, &v| {
                    let neighbors = graph.neighbors(v as usize);
                    let taken = neighbors.iter().map(|&u| colors[u as usize]);
                    first_fit.choose(neighbors.len(), taken)
                })
                .collect();
            for (&v, color) in chunk.iter().zip(chosen) {
                colors[v as usize] = color;
            }
            let lost: Vec<u32> = chunk
                .par_iter()
                .with_min_len(GRAIN)
                .copied()
                .filter(|&v| {
                    let own = colors[v as usize];
                    let neighbors = graph.neighbors(v as usize);
                    let higher = &neighbors[neighbors.partition_point(|&u| u < v)..];
                    higher.iter().any(|&u| colors[u as usize] == own)
                })
                .collect();
            for &v in &lost {
                colors[v as usize] = UNCOLORED;
            }
            let degrees = chunk.iter().map(|&v| graph.degree(v as usize) as u64);
            stats.edge_visits += 2 * degrees.sum::<u64>();
            losers.extend(lost);
        }
        stats.conflicts += losers.len();
        if losers.len() > worklist.len() / 2 {
            // With one vertex a chunk, no vertex loses, so this ends.
            size = (size / 2).max(1);
        }
        worklist = losers;
    }
    let mut coloring = Coloring::new(colors);
    coloring.compact();
    Wlc { coloring, stats }
}
