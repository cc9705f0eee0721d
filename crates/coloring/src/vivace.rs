//! Vivace: each vertex picks a color at random, and keeps it if no neighbor has the same
//! (Fratarcangeli, Tibaldo and Pellacini 2016).
//!
//! A vertex of degree d starts with the colors 0 to d / s, rounded down, where s is the shrinking
//! factor: 1 gives few rounds and many colors (the paper's baseline), 4 the other way round. In
//! every round each uncolored vertex picks one of its colors. Where neighbors picked the same, a
//! tie rule says which vertex keeps it; all others try again without the colors that their
//! neighbors now have. A vertex that runs out is fed: it gets the next color that no neighbor has.
//!
//! All colors below the fed one are taken around the vertex, so no color is ever larger than the
//! degree, and palettes of degree + 1 bits are enough.
//!
//! Randomness is a hash of seed, vertex and round, and a round reads only what the round before
//! left, so the result depends on the seed and on nothing else. Cost: O(edges of uncolored
//! vertices) a round, memory O(n + edges).

use incise_graph::{ColorId, Coloring, ConstraintGraph};
use rayon::prelude::*;

use crate::color_sets::ColorSets;
use crate::random::scramble;
use crate::{ColoringError, Conflicts};

/// Rule for the vertex that keeps a color which neighbors picked, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Tie {
    /// The vertex with the highest number among neighbors that picked the same color.
    #[default]
    HighestOfSame,
    /// Only a vertex with a higher number than all uncolored neighbors: fewer vertices a round, so
    /// slower.
    HighestOfAll,
}

/// Settings of [`vivace`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VivaceOptions {
    /// The shrinking factor s, from 1: a palette starts with degree / s + 1 colors.
    pub shrinking: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Rule for the vertex that keeps a color which neighbors picked, too.
    pub tie: Tie,
    /// Largest number of rounds; vertices without a color after them are an error.
    pub max_rounds: usize,
}

impl Default for VivaceOptions {
    /// s = 1, seed 0, [`Tie::HighestOfSame`], no limit to the rounds.
    fn default() -> Self {
        Self {
            shrinking: 1,
            seed: 0,
            tie: Tie::default(),
            max_rounds: usize::MAX,
        }
    }
}

/// Result of [`vivace`]: the coloring and statistics.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Vivace {
    /// The coloring, labels without gaps.
    pub coloring: Coloring,
    /// Counts of rounds and colors.
    pub stats: VivaceStats,
}

/// Statistics of [`vivace`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct VivaceStats {
    /// Number of rounds until every vertex had a color.
    pub rounds: usize,
    /// The largest label plus one before gaps were closed. The paper seems to count these.
    pub labels: usize,
    /// Number of times that a vertex ran out of colors.
    pub refills: usize,
    /// The neighbors of the uncolored vertices, summed over the rounds. A round looks at each of them
    /// up to three times.
    pub edge_visits: u64,
}

/// Vertices per task at least.
const GRAIN: usize = 256;

/// No color yet, or none picked.
const NONE: u32 = u32::MAX;

/// Colors at random in parallel, in the current rayon thread pool.
///
/// Proper, at most one color more than the largest degree. Deterministic for a seed: equal results on any machine, with
/// any number of threads, from a graph or the incidence it came from. O(edges of uncolored vertices) a round; the
/// number of rounds is random, tens at most on meshes.
///
/// # Errors
/// [`ColoringError::TooManyRounds`] if vertices are left without a color after the rounds allowed. It never stalls: a
/// vertex without colors left gets new ones before the next round, in which the highest of the uncolored vertices keeps
/// what it picks.
///
/// # Panics
/// If the shrinking factor is 0.
///
/// ```
/// use incise_coloring::{VivaceOptions, vivace};
/// use incise_graph::ConstraintGraph;
///
/// let triangle = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2), (2, 0)])?;
/// let result = vivace(&triangle, VivaceOptions::default())?;
/// result.coloring.verify(&triangle)?;
/// assert_eq!(result.coloring.color_count(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn vivace(conflicts: &impl Conflicts, options: VivaceOptions) -> Result<Vivace, ColoringError> {
    assert!(options.shrinking > 0, "the shrinking factor is 0");
    let graph = conflicts.graph();
    let mut state = State::new(&graph, options);
    let mut stats = VivaceStats::default();
    let mut uncolored: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    while !uncolored.is_empty() {
        if stats.rounds == options.max_rounds {
            return Err(ColoringError::TooManyRounds {
                rounds: stats.rounds,
                uncolored: uncolored.len(),
            });
        }
        state.pick(&uncolored, stats.rounds as u64);
        let keeps: Vec<bool> = uncolored
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&v| state.keeps(v))
            .collect();
        stats.rounds += 1;
        let degrees = uncolored.iter().map(|&v| graph.degree(v as usize) as u64);
        stats.edge_visits += degrees.sum::<u64>();
        for (&v, _) in uncolored.iter().zip(&keeps).filter(|(_, keeps)| **keeps) {
            state.colors[v as usize] = state.picked[v as usize];
        }
        uncolored.retain(|&v| state.colors[v as usize] == NONE);
        stats.refills += state.renew(&uncolored);
    }
    let mut coloring = Coloring::new(state.colors.into_iter().map(ColorId).collect());
    stats.labels = coloring.color_count();
    coloring.compact();
    Ok(Vivace { coloring, stats })
}

/// Everything the rounds share.
struct State<'g> {
    graph: &'g ConstraintGraph,
    options: VivaceOptions,
    palettes: ColorSets,
    colors: Vec<u32>,
    /// What each vertex picked in this round.
    picked: Vec<u32>,
}

impl<'g> State<'g> {
    fn new(graph: &'g ConstraintGraph, options: VivaceOptions) -> Self {
        let degrees = graph.degrees();
        let rooms = degrees
            .iter()
            .map(|degree| (degree + 1, degree / options.shrinking + 1));
        let palettes = ColorSets::new(rooms);
        Self {
            graph,
            options,
            palettes,
            colors: vec![NONE; degrees.len()],
            picked: vec![NONE; degrees.len()],
        }
    }

    /// Lets every uncolored vertex that has colors pick one.
    fn pick(&mut self, uncolored: &[u32], round: u64) {
        let picks: Vec<u32> = uncolored
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&v| {
                let count = self.palettes.count(v);
                if count == 0 {
                    return NONE;
                }
                let draw = scramble(scramble(self.options.seed ^ (round << 32)) ^ u64::from(v));
                // Below `count`, by the high half.
                let place = ((draw >> 32) * u64::from(count)) >> 32;
                self.palettes.nth(v, u32::try_from(place).unwrap_or(0))
            })
            .collect();
        for (&v, pick) in uncolored.iter().zip(picks) {
            self.picked[v as usize] = pick;
        }
    }

    /// True if `v` keeps the color that it picked.
    fn keeps(&self, v: u32) -> bool {
        let own = self.picked[v as usize];
        if own == NONE {
            return false;
        }
        let neighbors = self.graph.neighbors(v as usize).iter().copied();
        let mut uncolored = neighbors.filter(|&u| self.colors[u as usize] == NONE);
        let same = |u: u32| self.picked[u as usize] == own;
        match self.options.tie {
            Tie::HighestOfSame => !uncolored.any(|u| same(u) && u > v),
            Tie::HighestOfAll => !uncolored.clone().any(same) || !uncolored.any(|u| u > v),
        }
    }

    /// Takes the new colors of neighbors from the palettes and feeds those that are out of colors;
    /// returns how many.
    fn renew(&mut self, uncolored: &[u32]) -> usize {
        uncolored
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&v| {
                let neighbors = self.graph.neighbors(v as usize);
                let around = || neighbors.iter().map(|&u| self.colors[u as usize]);
                for color in around().filter(|&color| color != NONE) {
                    self.palettes.remove(v, color);
                }
                if self.palettes.count(v) > 0 {
                    return 0;
                }
                // All colors up to the last one it had are taken, so this one is the next.
                let mut taken: Vec<u32> = around().filter(|&color| color != NONE).collect();
                taken.sort_unstable();
                taken.dedup();
                let next = (0..)
                    .zip(&taken)
                    .take_while(|(color, taken)| color == *taken);
                let next = u32::try_from(next.count()).unwrap_or(NONE);
                self.palettes.insert(v, next);
                1
            })
            .sum()
    }
}
