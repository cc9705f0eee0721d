//! What one vertex does in a round of [`scgc`](crate::scgc()): look for a neighbor that stops it,
//! tell the neighbors, renew what it holds.
//!
//! A search is a small record that lies next to those of the other undecided vertices, so that a
//! round streams through them. It remembers the neighbor that stopped the vertex last. That neighbor
//! most likely still stops it, even if the best color has changed, so a round looks there first and,
//! four times in five, nowhere else.
//!
//! The list of higher neighbors is part of the memory too. Entries that need no more looks, being
//! decided or removed by shortcut 2, are swapped out of it; those in front of a mark are known not
//! to hold the best color; the entry at the mark is the one that stopped the vertex. All of it is
//! written by the vertex itself only.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use crate::higher::Higher;
use crate::palette::Palettes;
use crate::{Conflicts, Shortcuts, priorities};

/// Why a vertex could be colored.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Rule {
    DependencyFree,
    Shortcut1,
    Shortcut2,
    Shortcut3,
}

/// Where the search of one undecided vertex stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    /// The vertex.
    pub(crate) v: u32,
    /// Its best color.
    best: u32,
    /// The neighbor that stopped it last; itself before the first search.
    blocker: u32,
    /// Entries of its list still to wait for.
    left: u32,
    /// Leading entries known not to stop `passed_for`.
    passed: u32,
    /// The best color when the list was last walked.
    passed_for: u32,
    /// Edges removed by shortcut 2.
    pub(crate) removed: u32,
}

/// Everything the rounds share.
#[derive(Debug)]
pub(crate) struct State<'c, C> {
    conflicts: &'c C,
    shortcuts: Shortcuts,
    /// Vertex -> its range in `higher`.
    offsets: Vec<usize>,
    /// Neighbors of higher priority; each list is reordered by its own vertex.
    higher: Vec<AtomicU32>,
    palettes: Palettes,
}

impl<'c, C: Conflicts> State<'c, C> {
    /// The state before the first round, and the searches of all vertices.
    pub(crate) fn new(conflicts: &'c C, shortcuts: Shortcuts) -> (Self, Vec<Search>) {
        let higher = Higher::new(conflicts, &priorities(conflicts));
        let search = |(v, left)| Search {
            v,
            best: 0,
            blocker: v,
            left,
            passed: 0,
            passed_for: 0,
            removed: 0,
        };
        let searches = (0..).zip(higher.counts()).map(search).collect();
        let state = Self {
            conflicts,
            shortcuts,
            palettes: Palettes::new(higher.counts().map(|count| count + 1)),
            offsets: higher.offsets,
            higher: higher.values.into_iter().map(AtomicU32::new).collect(),
        };
        (state, searches)
    }

    /// First pass: may the vertex take its best color, and by which rule? Reads what others hold;
    /// writes the search and the list only. Adds the entries looked at to `visits`.
    pub(crate) fn search(&self, search: &mut Search, visits: &mut u64) -> Option<Rule> {
        let Search {
            v, best, blocker, ..
        } = *search;
        if blocker != v && matches!(self.look(blocker, v, best), Look::Stops) {
            *visits += 1;
            return None;
        }
        let list = &self.higher[self.offsets[v as usize]..self.offsets[v as usize + 1]];
        if search.passed_for != best {
            swap(list, 0, search.passed);
            search.passed = 0;
            search.passed_for = best;
        }
        while search.passed < search.left {
            *visits += 1;
            let u = list[search.passed as usize].load(Relaxed);
            match self.look(u, v, best) {
                Look::Stops => {
                    search.blocker = u;
                    return None;
                }
                Look::Passes => search.passed += 1,
                gone => {
                    search.left -= 1;
                    swap(list, search.passed, search.left);
                    search.removed += u32::from(matches!(gone, Look::Disjoint));
                }
            }
        }
        Some(self.rule(&list[..search.left as usize], best, search.removed > 0))
    }

    /// How the neighbor `u` of higher priority affects `v`, whose best color is `best`.
    fn look(&self, u: u32, v: u32, best: u32) -> Look {
        let Some(other) = self.palettes.pending(u) else {
            return Look::Decided;
        };
        let Shortcuts { one, two, three } = self.shortcuts;
        let smaller = best < other;
        debug_assert!(
            !smaller || !self.palettes.contains(u, best),
            "shortcut 3 holds only where shortcut 1 does"
        );
        let passes = (three && smaller) || (one && !self.palettes.contains(u, best));
        // With shortcut 1 on, a neighbor that is not passed holds the best color of v.
        if two && (passes || !one) && self.palettes.disjoint(u, v) {
            Look::Disjoint
        } else if passes {
            Look::Passes
        } else {
            Look::Stops
        }
    }

    /// The cheapest rule that colors a vertex that still waits for `waiting`.
    fn rule(&self, waiting: &[AtomicU32], best: u32, removed: bool) -> Rule {
        let mut others = waiting
            .iter()
            .filter_map(|u| self.palettes.pending(u.load(Relaxed)))
            .peekable();
        if others.peek().is_some() {
            if self.shortcuts.three && others.all(|other| best < other) {
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
    pub(crate) fn publish(&self, v: u32) {
        let color = self.palettes.decide(v);
        self.conflicts
            .visit_neighbors(v, |u| self.palettes.remove(u, color));
    }

    /// Third pass: renews palette and best color of the vertex if it is still undecided, and
    /// returns whether it is.
    pub(crate) fn renew(&self, search: &mut Search) -> bool {
        let v = search.v;
        if self.palettes.pending(v).is_none() {
            return false;
        }
        if self.shortcuts.two {
            // Each neighbor still waited for can take one color away, so one more than those is
            // enough.
            self.palettes.keep_first(v, search.left + 1);
        }
        search.best = self.palettes.renew(v);
        true
    }

    /// The visits it takes to tell every color to every neighbor.
    pub(crate) fn telling(&self) -> u64 {
        2 * self.higher.len() as u64
    }

    /// The colors of all vertices, once they are decided.
    pub(crate) fn into_colors(self) -> impl Iterator<Item = u32> {
        self.palettes.into_colors()
    }
}

/// What a search finds at an edge.
enum Look {
    /// The neighbor is colored.
    Decided,
    /// It shares no color: shortcut 2.
    Disjoint,
    /// It cannot take the best color: shortcut 1 or 3.
    Passes,
    /// It may take the best color.
    Stops,
}

/// Swaps two entries, if both exist.
#[inline]
fn swap(list: &[AtomicU32], a: u32, b: u32) {
    if let (Some(a), Some(b)) = (list.get(a as usize), list.get(b as usize)) {
        let kept = a.load(Relaxed);
        a.store(b.load(Relaxed), Relaxed);
        b.store(kept, Relaxed);
    }
}
