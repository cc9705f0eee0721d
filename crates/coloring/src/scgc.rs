//! Shortcut graph coloring: all vertices at once, round by round (paper section 4.1, Algorithm 1).
//!
//! Every vertex waits for its neighbors of higher priority and then takes the smallest color they
//! left (Jones and Plassmann 1993). Shortcuts let it go earlier when the neighbors it still waits
//! for cannot take that color anyway. Write A(v) for the colors v may still get and best(v) for the
//! smallest of them. In a round, v is colored best(v) if each neighbor u of higher priority
//!
//! - is colored (line 4), or
//! - does not hold best(v) in A(u): shortcut 1 (lines 6-7), or
//! - was found to share no color with v: shortcut 2 (lines 8-10), which removes the edge for good,
//!   and with it one color that v could have needed, the largest, or
//! - has best(u) > best(v): shortcut 3 (lines 11-12).
//!
//! Palettes only shrink, so a test that held keeps holding for the same best color, and v gets
//! exactly what the sequential [`greedy`](crate::greedy()) gives it, whichever shortcuts are on.
//!
//! **Shortcut 3 colors nothing that shortcut 1 would not color in the same round**: if best(v) is
//! smaller than the smallest color in A(u), it is not in A(u). The paper presents shortcut 3 as
//! finding more parallelism; with exact palettes it is the cheaper test, one comparison instead of
//! a look into a palette. Beside shortcut 1 it is used as that, and saves neither a round nor the
//! visit of an edge; debug builds assert the implication at every edge it passes. Alone, it gets
//! most of what shortcut 1 gets, and no vertex looks into the palette of another.
//!
//! **Rounds.** A round decides on the palettes the previous round left, then publishes the new
//! colors, then renews what the undecided vertices hold: three parallel passes, in each of which no
//! task reads what another writes. So the result and the statistics are the same for any number of
//! threads.
//!
//! **Work.** Only undecided vertices are visited. A vertex remembers the neighbor that stopped it and looks there
//! first: as long as that neighbor is in the way, a round costs it one test. Each new color is sent to each neighbor
//! once. Together: every edge twice for the notification, once for each best color that its lower vertex gets past,
//! plus the number of undecided vertices summed over the rounds. Memory: a number per edge and 36 bytes per vertex, and
//! palettes beyond 64 colors. Shortcut 2 is tested on the edges a search passes, not on all of them; it takes part in
//! few decisions. A sequential pass touches every edge twice in all, so on few cores [`greedy`](crate::greedy()) is the
//! faster of the two.

use incise_graph::{ColorId, Coloring};
use rayon::prelude::*;

use crate::search::{Rule, Search, State};
use crate::{Conflicts, Shortcuts};

/// Result of [`scgc`]: the coloring and statistics.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Scgc {
    /// The coloring, equal to that of [`greedy`](crate::greedy()).
    pub coloring: Coloring,
    /// Counts of rounds, work and rules.
    pub stats: ScgcStats,
}

/// Statistics of the rules of Algorithm 1. The four vertex counts add up to the number of vertices.
/// A vertex counts for the cheapest rule that holds for all its neighbors, in the order of the
/// fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ScgcStats {
    /// Number of parallel rounds until every vertex had a color.
    pub rounds: usize,
    /// Number of visits of neighbors of higher priority, plus two for every edge to notify the neighbors. An incidence
    /// gives the same number: repeated neighbors do not count.
    pub edge_visits: u64,
    /// Number of vertices that waited for all their neighbors of higher priority (line 4).
    pub dependency_free: usize,
    /// Number of vertices with no neighbor left to wait for, some of them removed by shortcut 2.
    pub shortcut2: usize,
    /// Number of vertices whose best color was smaller than that of every remaining neighbor.
    /// Shortcut 1 holds for each of them, too. 0 if shortcut 3 is off.
    pub shortcut3: usize,
    /// Number of vertices that shortcut 1 colored and shortcut 3 alone would not have.
    pub shortcut1: usize,
    /// Number of edges removed by shortcut 2.
    pub removed_edges: usize,
}

/// Colors in parallel, in the current rayon thread pool, with all three shortcuts.
///
/// Proper, equal to [`greedy`](crate::greedy()) in
/// [`LargestFirst`](crate::Order::LargestFirst) order bit for bit, at most one color more than the
/// largest degree. Coloring and statistics do not depend on the number of threads, and are the same
/// from a graph and from the incidence it came from.
///
/// Paper section 4.1, Algorithm 1. Shortcut 3 of the paper colors nothing that shortcut 1 would not
/// color in the same round when palettes are exact, as they are here; it serves as the cheap test
/// in front of shortcut 1.
///
/// Work: each edge twice, and once per best color that its lower vertex gets past, plus the number
/// of undecided vertices summed over the rounds. Memory O(vertices + edges).
///
/// ```
/// use incise_coloring::scgc;
/// use incise_graph::ConstraintGraph;
///
/// // A star: the center first, then all the others in one round.
/// let star = ConstraintGraph::from_edges(5, &[(0, 1), (0, 2), (0, 3), (0, 4)])?;
/// let result = scgc(&star);
/// assert_eq!((result.coloring.color_count(), result.stats.rounds), (2, 2));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn scgc(conflicts: &impl Conflicts) -> Scgc {
    scgc_with(conflicts, Shortcuts::ALL)
}

/// Colors in parallel without shortcuts: every vertex waits for all its neighbors of higher
/// priority (Jones and Plassmann 1993, with the priorities of ECL-GC instead of random ones).
///
/// Gives the coloring of [`scgc`] in several times as many rounds: their number is that of the
/// vertices on the longest chain of falling priorities. Work: each edge three times, plus the
/// number of undecided vertices summed over the rounds.
///
/// ```
/// use incise_coloring::{jones_plassmann, scgc};
/// use incise_graph::ConstraintGraph;
///
/// let edges: Vec<_> = (1..100).map(|i| (i - 1, i)).collect();
/// let path = ConstraintGraph::from_edges(100, &edges)?;
/// let (plain, short) = (jones_plassmann(&path), scgc(&path));
/// assert_eq!(plain.coloring, short.coloring);
/// assert!(plain.stats.rounds >= short.stats.rounds);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn jones_plassmann(conflicts: &impl Conflicts) -> Scgc {
    scgc_with(conflicts, Shortcuts::NONE)
}

/// Colors like [`scgc`] with some of the shortcuts. The coloring does not depend on the choice; see
/// [`Shortcuts`].
///
/// Adding a shortcut never adds a round, and adding shortcut 3 to shortcut 1 never saves one.
#[must_use]
pub fn scgc_with(conflicts: &impl Conflicts, shortcuts: Shortcuts) -> Scgc {
    let color = || in_chunks(conflicts, shortcuts, GRAIN);
    // From outside of a pool each parallel loop would wait for one of its threads.
    match conflicts.vertex_count() > GRAIN {
        true => rayon::scope(|_| color()),
        false => color(),
    }
}

/// Vertices per task at least: a visit takes nanoseconds, starting a task microseconds.
const GRAIN: usize = 512;

/// Runs the rounds with `grain` vertices per task, a number that must not change anything.
fn in_chunks(conflicts: &impl Conflicts, shortcuts: Shortcuts, grain: usize) -> Scgc {
    let (state, mut undecided) = State::new(conflicts, shortcuts);
    let mut stats = ScgcStats {
        edge_visits: state.telling(),
        ..ScgcStats::default()
    };
    while !undecided.is_empty() {
        let decisions: Vec<Decisions> = undecided
            .par_chunks_mut(grain)
            .map(|chunk| Decisions::of(&state, chunk))
            .collect();
        decisions
            .par_iter()
            .for_each(|part| part.vertices.iter().for_each(|&v| state.publish(v)));
        let left: Vec<Vec<Search>> = undecided
            .par_chunks_mut(grain)
            .map(|chunk| {
                let undecided = chunk.iter_mut().filter_map(|search| {
                    let search: &mut Search = search;
                    state.renew(search).then_some(*search)
                });
                undecided.collect()
            })
            .collect();
        let before = undecided.len();
        undecided.clear();
        undecided.extend(left.into_iter().flatten());
        debug_assert!(
            undecided.len() < before,
            "the undecided vertex of highest priority waits for none"
        );
        stats.rounds += 1;
        for part in decisions {
            stats.add(&part.stats);
        }
    }
    Scgc {
        coloring: Coloring::new(state.into_colors().map(ColorId).collect()),
        stats,
    }
}

/// What the vertices of one task decided in a round.
#[derive(Debug, Default)]
struct Decisions {
    vertices: Vec<u32>,
    stats: ScgcStats,
}

impl Decisions {
    fn of(state: &State<'_, impl Conflicts>, searches: &mut [Search]) -> Self {
        let mut decisions = Self::default();
        let stats = &mut decisions.stats;
        for search in searches {
            let Some(rule) = state.search(search, &mut stats.edge_visits) else {
                continue;
            };
            decisions.vertices.push(search.v);
            stats.removed_edges += search.removed as usize;
            *match rule {
                Rule::DependencyFree => &mut stats.dependency_free,
                Rule::Shortcut1 => &mut stats.shortcut1,
                Rule::Shortcut2 => &mut stats.shortcut2,
                Rule::Shortcut3 => &mut stats.shortcut3,
            } += 1;
        }
        decisions
    }
}

impl ScgcStats {
    /// Adds what another part of the vertices did in the same rounds.
    fn add(&mut self, part: &Self) {
        self.edge_visits += part.edge_visits;
        self.dependency_free += part.dependency_free;
        self.shortcut1 += part.shortcut1;
        self.shortcut2 += part.shortcut2;
        self.shortcut3 += part.shortcut3;
        self.removed_edges += part.removed_edges;
    }
}

#[cfg(test)]
mod tests {
    use incise_graph::Incidence;

    use super::*;
    use crate::{Order, greedy};

    /// The result depends neither on the size of the tasks nor on the number of threads.
    #[test]
    fn chunks_change_nothing() {
        let constraints = (0u32..900).map(|i| [i % 89, 89 + i % 97, 186 + i * i % 101]);
        let incidence = Incidence::from_constraints(287, constraints).unwrap();
        let oracle = greedy(&incidence, Order::LargestFirst);
        for shortcuts in Shortcuts::COMBINATIONS {
            let expected = in_chunks(&incidence, shortcuts, usize::MAX);
            assert_eq!(expected.coloring, oracle);
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                pool.build().unwrap().install(|| {
                    for grain in [1, 2, 7, 64, 900] {
                        assert_eq!(in_chunks(&incidence, shortcuts, grain), expected);
                    }
                });
            }
        }
    }
}
