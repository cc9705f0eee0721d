//! [`Parts`]: which parts of a piece have come off, found by searches that stop as soon as they can.
//!
//! A search starts at each particle where the piece may have separated. All advance in lockstep, one particle a round,
//! from a particle to the particles of the tets around it. Searches that meet become one. A search with nothing left to
//! find has found a complete part; once a single search is left the others are all parts, and what that one would still
//! find is the rest. Mostly the rest is the largest part, else that search goes on to the end. So a slit costs the way
//! around its front, and a part that comes off a few times its own size, however large the rest is.
//!
//! Walking from star to star costs some ten times as much for a tet as a pass over all tets in order. So once the
//! searches have looked at tets a quarter as often as the body has tets, they are given up and the pieces are counted
//! from scratch, which costs about as much again.
//!
//! Source: parallel search from both ends of a deleted edge, as in Y. Shiloach and S. Even, "An On-Line Edge-Deletion
//! Problem", 1981. Cost: O(seeds + parts × the largest part that came off), at most O(seeds + tets). A piece cut in
//! places far from each other at once has searches in all of them that must meet, which mostly ends in a count.

use std::cmp::Reverse;

use incise_mesh::{ParticleId, TetId};

use crate::CuttableMesh;
use crate::index::index;

const NONE: u32 = u32::MAX;

/// Searches and what they have found. Kept from cut to cut so that a cut asks for no memory that another has freed.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Parts {
    /// By particle: the search that found it first.
    search_of: Vec<u32>,
    /// All particles found, each in one list of one search.
    found: Vec<Found>,
    searches: Vec<Search>,
    /// The tets that came off: those of a part together, ascending.
    tets: Vec<TetId>,
    /// Where in `tets` each part ends.
    ends: Vec<usize>,
    /// How often the tets around a particle were looked at, a tet at a time.
    pub(crate) visited_tets: usize,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Found {
    particle: ParticleId,
    next: u32,
}

/// A first-in first-out list through [`Found::next`].
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct List {
    first: u32,
    last: u32,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Search {
    /// The search it has become one with, or itself.
    parent: u32,
    /// Particles whose tets have not been looked at.
    open: List,
    done: List,
}

impl Parts {
    /// Finds what came off the piece of `tets` tets that all of `seeds` were on. Each part of it holds a seed; seeds are
    /// different and none is without tets. Afterwards [`Parts::iter`] lists the parts.
    ///
    /// What is left is not among them: the part with the most tets, of equal ones the one with the lowest tet.
    pub(crate) fn find(&mut self, cuttable: &CuttableMesh, seeds: &[ParticleId], tets: usize) {
        self.tets.clear();
        self.ends.clear();
        self.search_of.resize(cuttable.mesh().positions.len(), NONE);
        let mut going: Vec<u32> = seeds.iter().map(|&seed| self.start(seed)).collect();
        let mut ended: Vec<u32> = Vec::new();
        let most = self.visited_tets + cuttable.mesh().tets.len() / 4;
        while going.len() > 1 && self.visited_tets <= most {
            for &search in &going {
                // Others may have become one with it in this round.
                if self.searches[search as usize].parent == search {
                    self.advance(cuttable, search);
                }
            }
            going.retain(|&search| {
                let Search { parent, open, .. } = self.searches[search as usize];
                if parent == search && open.first == NONE {
                    ended.push(search);
                }
                parent == search && open.first != NONE
            });
        }
        if going.len() > 1 {
            self.count(cuttable, seeds);
        } else {
            for &search in &ended {
                self.gather(cuttable, search);
            }
            let rest = tets - self.tets.len();
            if self.iter().any(|part| part.len() >= rest) {
                for &search in &going {
                    while self.searches[search as usize].open.first != NONE {
                        self.advance(cuttable, search);
                    }
                    self.gather(cuttable, search);
                }
                self.keep_largest();
            }
        }
        for found in self.found.drain(..) {
            self.search_of[found.particle.index()] = NONE;
        }
        self.searches.clear();
    }

    /// The tets of each part that came off, ascending within a part.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[TetId]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.tets[start..end])
    }

    fn start(&mut self, seed: ParticleId) -> u32 {
        let search = index(self.searches.len());
        let empty = List {
            first: NONE,
            last: NONE,
        };
        self.searches.push(Search {
            parent: search,
            open: empty,
            done: empty,
        });
        self.find_particle(search, seed);
        search
    }

    /// Notes a particle that no search has found.
    fn find_particle(&mut self, search: u32, particle: ParticleId) {
        self.search_of[particle.index()] = search;
        let one = index(self.found.len());
        self.found.push(Found {
            particle,
            next: NONE,
        });
        let open = self.searches[search as usize].open;
        self.searches[search as usize].open = self.joined(open, List::of(one));
    }

    /// Looks at the tets around the next particle of a search.
    fn advance(&mut self, cuttable: &CuttableMesh, mut search: u32) {
        let Search { open, done, .. } = self.searches[search as usize];
        let next = open.first;
        let Found {
            particle,
            next: then,
        } = self.found[next as usize];
        self.found[next as usize].next = NONE;
        let last = if then == NONE { NONE } else { open.last };
        self.searches[search as usize].open = List { first: then, last };
        self.searches[search as usize].done = self.joined(done, List::of(next));
        for tet in cuttable.around(particle) {
            self.visited_tets += 1;
            for corner in cuttable.mesh().tets[tet.index()] {
                match self.search_of[corner.index()] {
                    NONE => self.find_particle(search, corner),
                    other => search = self.unite(search, other),
                }
            }
        }
    }

    /// Makes two searches one; the lower number becomes that of both.
    fn unite(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return a;
        }
        let (low, high) = (a.min(b), a.max(b));
        let [one, other] = [low, high].map(|search| self.searches[search as usize]);
        self.searches[high as usize].parent = low;
        self.searches[low as usize].open = self.joined(one.open, other.open);
        self.searches[low as usize].done = self.joined(one.done, other.done);
        low
    }

    fn root(&mut self, mut search: u32) -> u32 {
        while self.searches[search as usize].parent != search {
            let parent = self.searches[search as usize].parent;
            let grandparent = self.searches[parent as usize].parent;
            self.searches[search as usize].parent = grandparent;
            search = grandparent;
        }
        search
    }

    fn joined(&mut self, a: List, b: List) -> List {
        if a.first == NONE {
            return b;
        }
        if b.first == NONE {
            return a;
        }
        self.found[a.last as usize].next = b.first;
        List {
            first: a.first,
            last: b.last,
        }
    }

    /// Lists the tets of a search that has ended: each around the lowest of its corners.
    fn gather(&mut self, cuttable: &CuttableMesh, search: u32) {
        let start = self.tets.len();
        let mut next = self.searches[search as usize].done.first;
        while next != NONE {
            let found = self.found[next as usize];
            for tet in cuttable.around(found.particle) {
                self.visited_tets += 1;
                let corners = cuttable.mesh().tets[tet.index()];
                if corners.iter().all(|&corner| found.particle <= corner) {
                    self.tets.push(tet);
                }
            }
            next = found.next;
        }
        self.tets[start..].sort_unstable();
        self.ends.push(self.tets.len());
    }

    /// Lists the tets of all parts with a seed but the largest, found by a count of the whole body.
    fn count(&mut self, cuttable: &CuttableMesh, seeds: &[ParticleId]) {
        let pieces = cuttable.mesh().pieces();
        let sizes = pieces.sizes();
        let first_tets = seeds.iter().filter_map(|&p| cuttable.around(p).next());
        let mut parts: Vec<usize> = first_tets
            .map(|tet| pieces.labels[tet.index()] as usize)
            .collect();
        parts.sort_unstable();
        parts.dedup();
        // Labels ascend with the lowest tet.
        let largest = parts
            .iter()
            .copied()
            .max_by_key(|&part| (sizes[part], Reverse(part)));
        parts.retain(|&part| Some(part) != largest);
        // Where the next tet of each part goes.
        let mut slot = vec![usize::MAX; pieces.count];
        let mut end = 0;
        for part in parts {
            slot[part] = end;
            end += sizes[part];
            self.ends.push(end);
        }
        self.tets.resize(end, TetId(0));
        for (&label, tet) in pieces.labels.iter().zip((0..).map(TetId)) {
            let slot = &mut slot[label as usize];
            if *slot != usize::MAX {
                self.tets[*slot] = tet;
                *slot += 1;
            }
        }
        self.visited_tets += pieces.labels.len();
    }

    /// Takes the largest part off the list of those that came off.
    fn keep_largest(&mut self) {
        let parts = self.iter().enumerate();
        let rank = |tets: &[TetId]| (tets.len(), Reverse(tets[0]));
        let Some((largest, tets)) = parts.max_by_key(|(_, tets)| rank(tets)) else {
            return;
        };
        let size = tets.len();
        let end = self.ends.remove(largest);
        self.tets.drain(end - size..end);
        for end in &mut self.ends[largest..] {
            *end -= size;
        }
    }
}

impl List {
    fn of(one: u32) -> Self {
        Self {
            first: one,
            last: one,
        }
    }
}
