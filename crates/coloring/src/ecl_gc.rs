//! ECL-GC: Jones and Plassmann with two shortcuts, as its authors coded it (Alabandi, Powers and
//! Burtscher 2020; version 1.2).
//!
//! The code splits the vertices by degree. Those with 32 neighbors or more come first. Each keeps a
//! bit per color it may still get, but shows its neighbors only two numbers, the smallest and the
//! largest color it may get; shortcut 1 becomes "my best color lies outside of your interval", and
//! since the largest color never changes, that is nearly always "my best color is smaller than
//! yours": the test that the paper calls shortcut 3. A vertex whose best color changed in a pass
//! waits for the next. There is no shortcut 2. The vertices with fewer neighbors follow, with the
//! palette in one word: shortcut 2 drops edges between disjoint palettes, and with each edge the
//! largest color left, and shortcut 1 is exact.
//!
//! Constraint graphs of tetrahedra have about 65 neighbors a vertex, so nearly all of the work is
//! done by the first half.
//!
//! The original lets threads spin and read what others are writing; here a pass reads what the pass
//! before left, so the statistics are the same on any machine. The colors are in either case:
//! priorities are those of [`priorities`], and no shortcut changes what a vertex gets. The limits
//! of the original (fewer than 65,535 neighbors of higher priority) are gone. Cost: every pass
//! looks at all edges of its undecided vertices.

use incise_graph::{ColorId, Coloring};
use rayon::prelude::*;

use crate::color_sets::ColorSets;
use crate::higher::Higher;
use crate::{Conflicts, priorities};

/// Result of [`ecl_gc`]: the coloring and statistics.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EclGc {
    /// The coloring, equal to that of [`greedy`](crate::greedy()), largest first.
    pub coloring: Coloring,
    /// Counts of passes and shortcuts.
    pub stats: EclGcStats,
}

/// Statistics of the two halves of ECL-GC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EclGcStats {
    /// Number of passes over vertices with 32 neighbors or more.
    pub large_rounds: usize,
    /// Number of passes over vertices with fewer than 32 neighbors.
    pub small_rounds: usize,
    /// Number of vertices that shortcut 1 colored while they still waited for a neighbor.
    pub shortcut1: usize,
    /// Number of edges dropped by shortcut 2.
    pub shortcut2: usize,
    /// Number of visits of neighbors of higher priority by undecided vertices.
    pub edge_visits: u64,
}

/// The degree from which on a vertex is large.
const LARGE: u64 = 32;

/// Vertices per task at least.
const GRAIN: usize = 256;

/// No color yet.
const NONE: u32 = u32::MAX;

/// Colors in parallel, in the current rayon thread pool.
///
/// Proper, equal to [`greedy`](crate::greedy()) with
/// [`Order::LargestFirst`](crate::Order::LargestFirst) bit for bit. Coloring and statistics do not
/// depend on the number of threads, nor on whether a graph is given or the incidence it came from.
/// O(passes * edges of undecided vertices), memory O(n + edges).
///
/// ```
/// use incise_coloring::{Order, ecl_gc, greedy};
/// use incise_graph::Incidence;
///
/// let fan = Incidence::from_constraints(41, (1u32..41).map(|i| [0, i]))?;
/// let result = ecl_gc(&fan);
/// assert_eq!(result.coloring, greedy(&fan, Order::LargestFirst));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn ecl_gc(conflicts: &impl Conflicts) -> EclGc {
    let priorities = priorities(conflicts);
    let higher = Higher::new(conflicts, &priorities);
    // The degree is the first half of the priority.
    let large: Vec<bool> = priorities.iter().map(|key| key >> 32 >= LARGE).collect();
    let mut stats = EclGcStats::default();
    let mut colors = vec![NONE; large.len()];
    run_large(&large, &higher, &mut colors, &mut stats);
    run_small(&large, &higher, &mut colors, &mut stats);
    EclGc {
        coloring: Coloring::new(colors.into_iter().map(ColorId).collect()),
        stats,
    }
}

/// The first half. A large vertex waits for large ones only, as degree comes first in the priority.
fn run_large(large: &[bool], higher: &Higher, colors: &mut [u32], stats: &mut EclGcStats) {
    let mut undecided: Vec<u32> = (0..)
        .take(large.len())
        .filter(|&v| large[v as usize])
        .collect();
    let counts: Vec<u32> = higher.counts().collect();
    // Small vertices have their palettes elsewhere.
    let sizes = counts.iter().zip(large);
    let sizes = sizes.map(|(count, &large)| if large { count + 1 } else { 1 });
    let palettes = ColorSets::new(sizes.map(|size| (size, size)));
    // The smallest color each may still get.
    let mut least = vec![0u32; colors.len()];
    while !undecided.is_empty() {
        stats.large_rounds += 1;
        // What is published is read only; a palette is written by its own vertex only.
        let outcomes: Vec<(u32, bool, bool)> = undecided
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&v| {
                let own = least[v as usize];
                let mut done = true;
                let mut shortcut = true;
                for &u in higher.of(v) {
                    let color = colors[u as usize];
                    if color == NONE {
                        done = false;
                        shortcut &= own < least[u as usize] || counts[u as usize] < own;
                    } else {
                        palettes.remove(v, color);
                    }
                }
                let best = palettes.first(v, own);
                (best, done || (shortcut && best == own), done)
            })
            .collect();
        for (&v, &(best, decided, done)) in undecided.iter().zip(&outcomes) {
            stats.edge_visits += u64::from(counts[v as usize]);
            least[v as usize] = best;
            if decided {
                colors[v as usize] = best;
                stats.shortcut1 += usize::from(!done);
            }
        }
        undecided.retain(|&v| colors[v as usize] == NONE);
    }
}

/// The palette of a small vertex and the neighbors that it still waits for, as bits of their
/// positions in its list.
#[derive(Clone, Copy)]
struct Small {
    palette: u32,
    active: u32,
}

/// The second half: palettes in one word. The palette of a decided vertex is its color.
fn run_small(large: &[bool], higher: &Higher, colors: &mut [u32], stats: &mut EclGcStats) {
    let mut state: Vec<Small> = (0..)
        .zip(large.iter().zip(higher.counts()))
        .map(|(v, (&large, count)): (u32, _)| {
            if large {
                // Colors from 32 on are out of the reach of small vertices.
                let color = colors[v as usize];
                let palette = 1u32.checked_shl(color).unwrap_or(0);
                return Small { palette, active: 0 };
            }
            Small {
                palette: u32::MAX >> (31 - count),
                active: !(u32::MAX << count),
            }
        })
        .collect();
    let mut undecided: Vec<u32> = (0..)
        .take(colors.len())
        .filter(|&v| colors[v as usize] == NONE)
        .collect();
    loop {
        undecided.retain(|&v| {
            let Small { palette, .. } = state[v as usize];
            let single = palette.count_ones() == 1;
            if single {
                colors[v as usize] = palette.trailing_zeros();
            }
            !single
        });
        if undecided.is_empty() {
            return;
        }
        stats.small_rounds += 1;
        let outcomes: Vec<(Small, Visits)> = undecided
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&v| visit_small(state[v as usize], higher.of(v), &state))
            .collect();
        for (&v, (small, visits)) in undecided.iter().zip(outcomes) {
            state[v as usize] = small;
            stats.edge_visits += u64::from(visits.edges);
            stats.shortcut1 += usize::from(visits.shortcut1);
            stats.shortcut2 += visits.shortcut2 as usize;
        }
    }
}

/// What a visit to a small vertex did.
struct Visits {
    edges: u32,
    shortcut1: bool,
    shortcut2: u32,
}

/// One pass of one small vertex over the neighbors it waits for.
fn visit_small(own: Small, higher: &[u32], state: &[Small]) -> (Small, Visits) {
    let Small {
        mut palette,
        mut active,
    } = own;
    let mut visits = Visits {
        edges: active.count_ones(),
        shortcut1: false,
        shortcut2: 0,
    };
    // What the neighbors may still get.
    let mut around = 0;
    let mut waiting = active;
    while waiting != 0 {
        let position = waiting.trailing_zeros();
        let edge = 1 << position;
        waiting &= !edge;
        let theirs = state[higher[position as usize] as usize].palette;
        around |= theirs;
        if palette & theirs == 0 {
            // One neighbor less can take a color away, so the largest one is not needed.
            palette &= !(1 << (31 - palette.leading_zeros()));
            active &= !edge;
            visits.shortcut2 += 1;
        } else if theirs.count_ones() == 1 {
            palette &= !theirs;
            active &= !edge;
        }
    }
    let best = palette & palette.wrapping_neg();
    if active != 0 && around & best == 0 {
        palette = best;
        active = 0;
        visits.shortcut1 = true;
    }
    (Small { palette, active }, visits)
}
