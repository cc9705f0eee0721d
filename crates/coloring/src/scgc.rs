//! Shortcut graph coloring: all vertices at once, round by round (paper section 4.1, Algorithm 1).
//!
//! Every vertex waits for its neighbors of higher priority and then takes the smallest color they
//! left (Jones and Plassmann). Shortcuts let it go earlier when the neighbors it still waits for
//! cannot take that color anyway. Write A(v) for the colors v may still get and best(v) for the
//! smallest of them. In a round, v is colored best(v) if each neighbor u of higher priority
//!
//! - is colored (line 4), or
//! - does not hold best(v) in A(u): shortcut 1 (lines 6-7), or
//! - was found to share no color with v: shortcut 2 (lines 8-10), which removes the edge for good,
//!   and with it one color that v could have needed, the largest, or
//! - has best(u) > best(v): shortcut 3 (lines 11-12).
//!
//! Palettes only shrink, so a test that held keeps holding for the same best color, and v gets
//! exactly what the sequential [`greedy`](crate::greedy()) gives it in
//! [`Order::LargestFirst`](crate::Order::LargestFirst). Each shortcut can be turned off
//! ([`Shortcuts`]); with none of them this is the algorithm of Jones and Plassmann (1993).
//!
//! **Shortcut 3 colors nothing that shortcut 1 would not color in the same round**: if best(v) is
//! smaller than the smallest color in A(u), it is not in A(u). The paper presents shortcut 3 as
//! finding more parallelism; with exact palettes it is the cheaper test, one comparison instead of
//! a look into a palette, and alone it finds nearly as much. With both on it stands in front of
//! shortcut 1, and debug builds assert the implication at every vertex that has to wait.
//!
//! **Rounds.** A round decides on the palettes the previous round left, then publishes the new
//! colors, then renews what the undecided vertices hold, three parallel passes with nobody reading
//! what another writes. So the result and the number of rounds are the same for any number of
//! threads.
//!
//! **Work.** Only undecided vertices are visited. A vertex remembers the neighbor that stopped it
//! and, while its best color stands, looks there first: as long as that neighbor is in the way, a
//! round costs it one test. Each new color is told to each neighbor once. Together: every edge once
//! per published color and once per best color its lower vertex goes through, plus the number of
//! undecided vertices summed over the rounds; memory O(n + edges), of which palettes are about a
//! bit per edge. With shortcut 1 on, shortcut 2 is tested on the edges a search passes, not on all
//! of them: a neighbor without a common color does not stop the search. A sequential pass touches
//! every edge once, so on few cores [`greedy`](crate::greedy()) is the faster of the two, and from
//! incidence, whose edges have to be listed first, by far.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use incise_graph::{ColorId, Coloring, ConstraintGraph};
use rayon::prelude::*;

use crate::palette::Palettes;
use crate::{Conflicts, priorities};

/// Which of the three shortcuts are on.
///
/// ```
/// use incise_coloring::{Shortcuts, scgc, scgc_with};
/// use incise_graph::Incidence;
///
/// let springs = Incidence::from_constraints(9, (0u32..8).map(|i| [i, i + 1]))?;
/// for shortcuts in Shortcuts::combinations() {
///     assert_eq!(scgc_with(&springs, shortcuts).coloring, scgc(&springs).coloring);
/// }
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shortcuts {
    /// Shortcut 1: do not wait for a neighbor that cannot take the best color.
    pub one: bool,
    /// Shortcut 2: never wait for a neighbor without a common color.
    pub two: bool,
    /// Shortcut 3: do not wait for a neighbor whose best color is larger.
    pub three: bool,
}

impl Shortcuts {
    /// None: Jones and Plassmann.
    pub const NONE: Self = Self {
        one: false,
        two: false,
        three: false,
    };
    /// All three: the paper's Algorithm 1.
    pub const ALL: Self = Self {
        one: true,
        two: true,
        three: true,
    };

    /// All eight combinations, from `NONE` to `ALL`.
    pub fn combinations() -> impl Iterator<Item = Self> {
        (0..8).map(|bits| Self {
            one: bits & 1 != 0,
            two: bits & 2 != 0,
            three: bits & 4 != 0,
        })
    }
}

/// A coloring and how it came about.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Scgc {
    /// The coloring, equal to that of [`greedy`](crate::greedy()), largest first.
    pub coloring: Coloring,
    /// Rounds and rules.
    pub stats: ScgcStats,
}

/// What each rule of Algorithm 1 did. The four vertex counts add up to the number of vertices; a
/// vertex counts for the cheapest rule that holds for all its neighbors, in the order of the
/// fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ScgcStats {
    /// Parallel rounds until every vertex had a color.
    pub rounds: usize,
    /// Vertices that waited for all their neighbors of higher priority (line 4).
    pub dependency_free: usize,
    /// Vertices with no neighbor left to wait for, some of them removed by shortcut 2.
    pub shortcut2: usize,
    /// Vertices whose best color was smaller than that of every neighbor left. Shortcut 1 holds for
    /// each of them too, and counts them if shortcut 3 is off.
    pub shortcut3: usize,
    /// Vertices that shortcut 1 colored and shortcut 3 alone would not have.
    pub shortcut1: usize,
    /// Edges removed by shortcut 2.
    pub removed_edges: usize,
    /// How often an undecided vertex looked at a neighbor of higher priority.
    pub edge_visits: u64,
}

/// Colors in parallel, in the current rayon thread pool, with all shortcuts.
///
/// Proper, equal to [`greedy`](crate::greedy()) with
/// [`Order::LargestFirst`](crate::Order::LargestFirst) bit for bit, at most one color more than the
/// largest degree. Coloring and statistics do not depend on the number of threads, nor on whether a
/// graph is given or the incidence it came from, whose edges are listed first.
///
/// Paper section 4.1, Algorithm 1. Shortcut 3 of the paper colors nothing that shortcut 1 would not
/// color in the same round when palettes are exact, as they are here; it serves as the cheap test
/// in front of shortcut 1.
///
/// Work: each edge once per published color and once per best color that its lower vertex goes
/// through, plus the number of undecided vertices summed over the rounds. Memory O(n + edges).
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

/// Colors in parallel as [`scgc`] does, without any shortcut: each vertex waits until all its
/// neighbors of higher priority have a color (Jones and Plassmann 1993).
///
/// The same colors in several times as many rounds: as many as the longest chain of neighbors with
/// falling priorities.
///
/// ```
/// use incise_coloring::{jones_plassmann, scgc};
/// use incise_graph::ConstraintGraph;
///
/// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
/// assert_eq!(jones_plassmann(&path).coloring, scgc(&path).coloring);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn jones_plassmann(conflicts: &impl Conflicts) -> Scgc {
    scgc_with(conflicts, Shortcuts::NONE)
}

/// Colors in parallel as [`scgc`] does, with any combination of shortcuts: the same colors in other
/// numbers of rounds.
#[must_use]
pub fn scgc_with(conflicts: &impl Conflicts, shortcuts: Shortcuts) -> Scgc {
    in_chunks(&conflicts.graph(), shortcuts, GRAIN)
}

/// The algorithm with tasks of at least `grain` vertices.
fn in_chunks(graph: &ConstraintGraph, shortcuts: Shortcuts, grain: usize) -> Scgc {
    let state = State::new(graph, shortcuts, grain);
    let mut stats = ScgcStats::default();
    let mut undecided: Vec<u32> = (0..).take(graph.vertex_count()).collect();
    while !undecided.is_empty() {
        let decided: Vec<(u32, Rule)> = undecided
            .par_iter()
            .with_min_len(grain)
            .filter_map(|&v| state.decide(v).map(|rule| (v, rule)))
            .collect();
        debug_assert!(
            !decided.is_empty(),
            "the undecided vertex of highest priority waits for nobody"
        );
        decided
            .par_iter()
            .with_min_len(grain)
            .for_each(|&(v, _)| state.publish(v));
        undecided = undecided
            .par_iter()
            .with_min_len(grain)
            .copied()
            .filter(|&v| state.renew(v))
            .collect();
        stats.rounds += 1;
        for (_, rule) in decided {
            *match rule {
                Rule::DependencyFree => &mut stats.dependency_free,
                Rule::Shortcut1 => &mut stats.shortcut1,
                Rule::Shortcut2 => &mut stats.shortcut2,
                Rule::Shortcut3 => &mut stats.shortcut3,
            } += 1;
        }
    }
    stats.removed_edges = state
        .waits
        .iter()
        .map(|wait| wait.removed.load(Relaxed) as usize)
        .sum();
    let visits = state.waits.iter().map(|wait| wait.visits.load(Relaxed));
    stats.edge_visits = visits.map(u64::from).sum();
    let colors = state
        .color
        .into_iter()
        .map(|color| ColorId(color.into_inner()))
        .collect();
    Scgc {
        coloring: Coloring::new(colors),
        stats,
    }
}

/// Vertices per task at least: a visit takes nanoseconds, starting a task microseconds.
const GRAIN: usize = 512;

/// No color yet.
const NONE: u32 = u32::MAX;

/// Why a vertex could be colored.
#[derive(Clone, Copy, Debug)]
enum Rule {
    DependencyFree,
    Shortcut1,
    Shortcut2,
    Shortcut3,
}

/// The search of one vertex for a neighbor that stops it; written by that vertex only.
#[derive(Debug)]
struct Wait {
    /// Entries of its list still to wait for; decided and removed ones are moved out as they are
    /// met.
    left: AtomicU32,
    /// Leading entries known not to hold `best`.
    passed: AtomicU32,
    /// The best color for which `passed` is true.
    best: AtomicU32,
    /// Edges removed by shortcut 2.
    removed: AtomicU32,
    /// The value of `left` for which the palette was last shortened.
    fitted: AtomicU32,
    /// Neighbors looked at so far.
    visits: AtomicU32,
}

/// Everything the rounds share.
#[derive(Debug)]
struct State<'g> {
    graph: &'g ConstraintGraph,
    shortcuts: Shortcuts,
    /// Vertex -> its range in `higher`.
    offsets: Vec<u32>,
    /// Neighbors of higher priority; each list is reordered by its own vertex.
    higher: Vec<AtomicU32>,
    waits: Vec<Wait>,
    palettes: Palettes,
    best: Vec<AtomicU32>,
    color: Vec<AtomicU32>,
}

impl<'g> State<'g> {
    fn new(graph: &'g ConstraintGraph, shortcuts: Shortcuts, grain: usize) -> Self {
        let rank = &priorities(graph);
        let higher_of = |v: usize| {
            graph
                .neighbors(v)
                .iter()
                .filter(move |&&u| rank[u as usize] > rank[v])
        };
        let counts: Vec<u32> = (0..rank.len())
            .into_par_iter()
            .with_min_len(grain)
            .map(|v| higher_of(v).map(|_| 1).sum())
            .collect();
        let mut offsets = vec![0];
        offsets.extend(counts.iter().scan(0, |end, &count| {
            *end += count;
            Some(*end)
        }));
        let higher: Vec<AtomicU32> = (0..graph.edge_count()).map(|_| AtomicU32::new(0)).collect();
        (0..rank.len())
            .into_par_iter()
            .with_min_len(grain)
            .for_each(|v| {
                for (slot, &u) in higher[offsets[v] as usize..].iter().zip(higher_of(v)) {
                    slot.store(u, Relaxed);
                }
            });
        let wait = |&count: &u32| Wait {
            left: AtomicU32::new(count),
            passed: AtomicU32::new(0),
            best: AtomicU32::new(0),
            removed: AtomicU32::new(0),
            fitted: AtomicU32::new(count),
            visits: AtomicU32::new(0),
        };
        Self {
            graph,
            shortcuts,
            waits: counts.iter().map(wait).collect(),
            palettes: Palettes::new(counts.iter().map(|&count| count + 1)),
            best: counts.iter().map(|_| AtomicU32::new(0)).collect(),
            color: counts.iter().map(|_| AtomicU32::new(NONE)).collect(),
            offsets,
            higher,
        }
    }

    fn best(&self, v: u32) -> u32 {
        self.best[v as usize].load(Relaxed)
    }

    fn is_decided(&self, v: u32) -> bool {
        self.color[v as usize].load(Relaxed) != NONE
    }

    /// First pass: may `v` take its best color, and by which rule? Reads colors, palettes and best
    /// colors; writes the search of `v` only.
    fn decide(&self, v: u32) -> Option<Rule> {
        let list =
            &self.higher[self.offsets[v as usize] as usize..self.offsets[v as usize + 1] as usize];
        let wait = &self.waits[v as usize];
        let best = self.best(v);
        let mut left = wait.left.load(Relaxed);
        let mut passed = if wait.best.load(Relaxed) == best {
            wait.passed.load(Relaxed)
        } else {
            0
        };
        let mut stopped = false;
        let mut visits = 0;
        while passed < left && !stopped {
            visits += 1;
            let u = list[passed as usize].load(Relaxed);
            let decided = self.is_decided(u);
            let passes = !decided && self.passes(u, best);
            // What shortcut 1 does not let pass has the best color in common.
            let shortcut2 = self.shortcuts.two && (passes || !self.shortcuts.one);
            if decided || (shortcut2 && self.palettes.disjoint(u, v)) {
                left -= 1;
                list[passed as usize].store(list[left as usize].load(Relaxed), Relaxed);
                if !decided {
                    wait.removed.fetch_add(1, Relaxed);
                }
            } else if passes {
                passed += 1;
            } else {
                stopped = true;
            }
        }
        wait.visits.fetch_add(visits, Relaxed);
        wait.left.store(left, Relaxed);
        wait.passed.store(passed, Relaxed);
        wait.best.store(best, Relaxed);
        (!stopped).then(|| self.rule(&list[..left as usize], best, wait.removed.load(Relaxed) > 0))
    }

    /// Do the shortcuts see that undecided `u` cannot take `color`? The comparison is shortcut 3,
    /// the look into the palette shortcut 1.
    fn passes(&self, u: u32, color: u32) -> bool {
        let larger = color < self.best(u);
        let three = self.shortcuts.three && larger;
        let one = three || (self.shortcuts.one && !self.palettes.contains(u, color));
        debug_assert!(
            !larger || !self.palettes.contains(u, color),
            "shortcut 3 holds only where shortcut 1 does"
        );
        one
    }

    /// The cheapest rule that colors a vertex whose remaining list is `list`.
    fn rule(&self, list: &[AtomicU32], best: u32, removed: bool) -> Rule {
        let mut waiting = list
            .iter()
            .map(|u| u.load(Relaxed))
            .filter(|&u| !self.is_decided(u))
            .peekable();
        if waiting.peek().is_some() {
            if self.shortcuts.three && waiting.all(|u| best < self.best(u)) {
                Rule::Shortcut3
            } else {
                Rule::Shortcut1
            }
        } else if removed {
            Rule::Shortcut2
        } else {
            Rule::DependencyFree
        }
    }

    /// Second pass: `v` takes its best color and tells its neighbors. Those of higher priority
    /// cannot get that color, so telling them changes nothing and no priority has to be compared.
    fn publish(&self, v: u32) {
        let color = self.best(v);
        self.color[v as usize].store(color, Relaxed);
        for &u in self.graph.neighbors(v as usize) {
            self.palettes.remove(u, color);
        }
    }

    /// Third pass: renews palette and best color of `v` if it is still undecided, and returns
    /// whether it is.
    fn renew(&self, v: u32) -> bool {
        if self.is_decided(v) {
            return false;
        }
        let wait = &self.waits[v as usize];
        let left = wait.left.load(Relaxed);
        if wait.fitted.swap(left, Relaxed) != left {
            // Each neighbor still waited for can take one color away, so one more than those is
            // enough.
            self.palettes.keep_first(v, left + 1);
        }
        self.best[v as usize].store(self.palettes.first(v, self.best(v)), Relaxed);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of cliques, two sizes of degrees.
    fn rings() -> ConstraintGraph {
        let clique =
            |first: u32| (0..5).flat_map(move |b| (0..b).map(move |a| (first + a, first + b)));
        let mut edges: Vec<(u32, u32)> = (0..40).flat_map(|i| clique(5 * i)).collect();
        edges.extend((0..200).map(|v| (v, (v + 7) % 200)));
        ConstraintGraph::from_edges(200, &edges).unwrap()
    }

    #[test]
    fn chunks_change_nothing() {
        let graph = rings();
        for shortcuts in Shortcuts::combinations() {
            let whole = in_chunks(&graph, shortcuts, usize::MAX);
            for grain in [1, 2, 7, 64] {
                assert_eq!(in_chunks(&graph, shortcuts, grain), whole);
            }
        }
    }
}
