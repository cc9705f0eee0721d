//! [`LocalSearch`]: makes room for vertices without a free color by moving others around them.
//!
//! The search over partial colorings of [`tabu`](crate::tabu()) (`PartialCol`, Blöchliger and Zufferey 2008), started
//! from a proper coloring with a few uncolored vertices: one of them takes the color that the fewest of its particles
//! have taken, the holders of this color around it lose it and are uncolored in turn, and keep away from it for a while.
//! Vertices are dense only near a cut, so the search spreads into regions with room and mostly ends after some tens of
//! steps. A failed search leaves the coloring as it was.
//!
//! Steps are counted, not timed, so the result is the same on every machine. Cost: O(particles of the vertex * colors)
//! a step, whatever the size of the rest.

use incise_graph::ColorId;

use super::{Recolored, Recoloring};
use crate::conflicts::UNCOLORED;
use crate::random::Random;

/// Steps that a vertex keeps away from a color that it lost: at least so many, up to twice as many.
const TENURE: usize = 10;

/// Working memory of a search.
#[derive(Clone, Debug, Default)]
pub(super) struct LocalSearch {
    uncolored: Vec<u32>,
    /// Vertices in the order in which they changed, and their colors before.
    log: Vec<(u32, ColorId)>,
    /// A vertex, a color that it lost, and the step until which it keeps away from it.
    tabu: Vec<(u32, ColorId, usize)>,
    /// For each color at how many particles of the vertex at hand it is taken.
    taken: Vec<u32>,
    holders: Vec<u32>,
}

impl LocalSearch {
    /// The vertices that the last successful search has given another color, each once.
    pub(super) fn moved(&self) -> impl ExactSizeIterator<Item = u32> {
        self.log.iter().map(|(v, _)| *v)
    }
}

impl Recoloring {
    /// Searches a color below `allowed` for an uncolored vertex in up to `steps` steps; returns whether it has one.
    pub(super) fn search_color(
        &mut self,
        search: &mut LocalSearch,
        v: u32,
        allowed: usize,
        steps: usize,
        report: &mut Recolored,
    ) -> bool {
        self.searches += 1;
        let mut random = Random::new(self.searches);
        search.uncolored.clear();
        search.uncolored.push(v);
        search.log.clear();
        search.tabu.clear();
        let mut step = 0;
        while step < steps && !search.uncolored.is_empty() {
            let pick = random.below(search.uncolored.len());
            let v = search.uncolored[pick];
            report.visited += self.links.of(v).count() as u64;
            if let Some(color) = self.choose(search, v, allowed, step, &mut random) {
                search.uncolored.swap_remove(pick);
                self.eject(search, v, color);
                for &u in &search.holders {
                    let until = step + TENURE + random.below(TENURE);
                    search.tabu.push((u, color, until));
                }
                search.log.push((v, UNCOLORED));
                self.set(v, color);
            }
            step += 1;
        }
        report.steps += step;
        // A stable sort: the entries of a vertex stay in the order of time.
        search.log.sort_by_key(|(u, _)| *u);
        let done = search.uncolored.is_empty();
        if !done {
            self.take_back(search);
        }
        search.log.dedup_by_key(|(u, _)| *u);
        done
    }

    /// The color that the fewest particles of a vertex have taken, of those that it may have at a step.
    fn choose(
        &self,
        search: &mut LocalSearch,
        v: u32,
        allowed: usize,
        step: usize,
        random: &mut Random,
    ) -> Option<ColorId> {
        let LocalSearch { taken, tabu, .. } = search;
        taken.clear();
        taken.resize(allowed, 0);
        self.taken.count(self.links.of(v), taken);
        // Older ones have ended.
        let recent = tabu
            .iter()
            .rev()
            .take_while(|(.., until)| until + TENURE > step);
        for (_, color, _) in recent.filter(|(u, _, until)| *u == v && *until > step) {
            taken[color.index()] = u32::MAX;
        }
        let least = taken
            .iter()
            .copied()
            .min()
            .filter(|least| *least < u32::MAX)?;
        let ties = taken.iter().filter(|count| **count == least).count();
        let pick = random.below(ties);
        let mut colors = (0..allowed).filter(|&color| taken[color] == least);
        colors.nth(pick).map(ColorId::new)
    }

    /// Takes a color from all neighbors of a vertex that have it.
    fn eject(&mut self, search: &mut LocalSearch, v: u32, color: ColorId) {
        search.holders.clear();
        for p in self.links.of(v) {
            if !self.taken.is_free(std::iter::once(p), color) {
                let holder = self
                    .links
                    .at(p)
                    .find(|&u| self.coloring.color(u as usize) == color);
                search.holders.extend(holder);
            }
        }
        search.holders.sort_unstable();
        search.holders.dedup();
        for &u in &search.holders {
            search.log.push((u, color));
            self.taken.give_back(self.links.of(u), color);
            self.set(u, UNCOLORED);
            search.uncolored.push(u);
        }
    }

    /// Gives all vertices the colors from before the search.
    fn take_back(&mut self, search: &mut LocalSearch) {
        for &(u, _) in &search.log {
            let color = self.coloring.color(u as usize);
            if color != UNCOLORED {
                self.taken.give_back(self.links.of(u), color);
                self.set(u, UNCOLORED);
            }
        }
        // The first entry of each vertex has the color that it had at the start.
        for run in search.log.chunk_by(|a, b| a.0 == b.0) {
            let (u, color) = run[0];
            if color != UNCOLORED {
                self.set(u, color);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Vertices at three of `particles` particles each, colored by first fit in their order.
    fn crowded(rows: &[[u32; 3]]) -> Recoloring {
        let mut recoloring =
            Recoloring::linked([], incise_graph::Coloring::new(Vec::new()), usize::MAX);
        for (v, row) in (0..).zip(rows) {
            let mut particles = row.to_vec();
            particles.sort_unstable();
            particles.dedup();
            let pairs: Vec<(u32, u32)> = particles.into_iter().map(|p| (v, p)).collect();
            recoloring.apply(&[], &pairs).unwrap();
        }
        recoloring
    }

    proptest! {
        /// A search leaves a proper coloring below the allowed number of colors with the vertex in it, or all as it was.
        #[test]
        fn all_or_nothing(
            rows in prop::collection::vec(prop::array::uniform3(0_u32..24), 2..60),
            pick in any::<prop::sample::Index>(), fewer in 0_usize..4, steps in 0_usize..60,
        ) {
            let mut recoloring = crowded(&rows);
            let v = u32::try_from(pick.index(rows.len())).unwrap();
            let color = recoloring.color_of(v);
            let allowed = recoloring.color_count().saturating_sub(fewer).max(1);
            let beyond = recoloring.coloring.colors().iter().any(|c| c.index() >= allowed);
            recoloring.taken.give_back(recoloring.links.of(v), color);
            recoloring.set(v, UNCOLORED);
            let before = recoloring.clone();
            let mut search = LocalSearch::default();
            let mut report = Recolored::default();
            let found = recoloring.search_color(&mut search, v, allowed, steps, &mut report);
            prop_assert!(report.steps <= steps);
            if found {
                prop_assert!(recoloring.color_of(v).index() < allowed);
                recoloring.coloring.verify_incidence(&recoloring.links.incidence()).unwrap();
                prop_assert!(recoloring.taken.agrees_with(&recoloring.recomputed_taken()));
                // Only the named vertices have moved, and none beyond what is allowed.
                let moved: Vec<u32> = search.moved().collect();
                for u in (0..).take(rows.len()) {
                    let (old, new) = (before.color_of(u), recoloring.color_of(u));
                    prop_assert!(old == new || moved.contains(&u));
                    prop_assert!(old == new || new.index() < allowed);
                }
            } else {
                prop_assert!(recoloring.coloring == before.coloring);
                prop_assert!(recoloring.taken.agrees_with(&before.taken));
                prop_assert_eq!(&recoloring.sizes, &before.sizes);
                recoloring.set(v, color);
                recoloring.check().unwrap();
            }
            // With all colors and room for the vertex the first step finds it.
            if fewer == 0 && steps > 0 && !beyond {
                prop_assert!(found);
            }
        }
    }

    /// Two colors are enough for a path whose ends were colored from different sides; the search swaps one of them.
    #[test]
    fn a_path_is_turned() {
        // Edges of a path of vertices 0 - 1 - 2 - 3 - 4 as particles.
        let pairs = [
            (0, 0),
            (1, 0),
            (1, 1),
            (2, 1),
            (2, 2),
            (3, 2),
            (3, 3),
            (4, 3),
        ];
        let colors = [0, 1, 2, 0, 1].map(ColorId).to_vec();
        let mut recoloring =
            Recoloring::with_coloring(pairs, incise_graph::Coloring::new(colors), 0).unwrap();
        recoloring
            .taken
            .give_back(recoloring.links.of(2), ColorId(2));
        recoloring.set(2, UNCOLORED);
        let mut report = Recolored::default();
        assert!(recoloring.search_color(&mut LocalSearch::default(), 2, 2, 50, &mut report));
        let colors = [0, 1, 2, 3, 4].map(|v| recoloring.color_of(v).0);
        assert!(
            colors == [0, 1, 0, 1, 0] || colors == [1, 0, 1, 0, 1],
            "{colors:?}"
        );
    }
}
