//! Losing colors by a search over partial colorings (`PartialCol`, Blöchliger and Zufferey 2008).
//!
//! To do with k colors what took k + 1, the last class is uncolored. Then, again and again, one
//! uncolored vertex takes the color that the fewest neighbors have, and these become uncolored in
//! turn; they must not go back to that color for a while, or the search would run in circles. When
//! no vertex is left uncolored, k is done and k - 1 is next.
//!
//! In constraint graphs at most as many neighbors as a constraint has particles share a color, so
//! displacements stay small, and starts from a good coloring end after a few hundred steps where
//! the number can be reached at all. Cost: O(degree + k) a step.

use incise_graph::{ColorId, Coloring};

use crate::Conflicts;
use crate::conflicts::UNCOLORED;
use crate::random::Random;

/// Removes colors one after the other until `target` are left, with up to `steps` search steps for
/// each. Returns the number of steps.
///
/// The coloring must be proper and stays proper. The best result before the steps ran out is kept;
/// the number of colors never grows. Deterministic for a seed; a graph and the incidence it came
/// from give equal results. O(steps * (largest degree + colors)) for each color; from incidence the
/// degree counts shared particles.
///
/// # Panics
/// If the coloring has another number of vertices than `conflicts`.
///
/// ```
/// use incise_coloring::tabu;
/// use incise_graph::{ColorId, Coloring, ConstraintGraph};
///
/// // A ring of six with a color each; two are enough.
/// let ring = ConstraintGraph::from_edges(6, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)])?;
/// let mut coloring = Coloring::new((0..6).map(ColorId).collect());
/// tabu(&ring, &mut coloring, 2, 1000, 1);
/// coloring.verify(&ring)?;
/// assert_eq!(coloring.color_count(), 2);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn tabu(
    conflicts: &impl Conflicts,
    coloring: &mut Coloring,
    target: usize,
    steps: usize,
    seed: u64,
) -> usize {
    assert_eq!(
        coloring.vertex_count(),
        conflicts.vertex_count(),
        "one color per vertex"
    );
    let mut random = Random::new(seed);
    let mut made = 0;
    while coloring.color_count() > target.max(1) {
        let mut search = Search::new(conflicts, coloring, &mut random);
        let reached = search.run(steps);
        made += search.step;
        if !reached {
            break;
        }
        *coloring = Coloring::new(search.colors);
        // A class whose last vertex was displaced is a color lost, too.
        coloring.compact();
    }
    made
}

/// Steps that a displaced vertex keeps away from its old color: at least `TENURE`, up to as many
/// more, and a share of the uncolored ones, so that a search with many of them takes longer turns.
const TENURE: usize = 10;

/// The search for a coloring with one color less.
struct Search<'a, C> {
    conflicts: &'a C,
    random: &'a mut Random,
    /// The number of colors allowed.
    count: usize,
    colors: Vec<ColorId>,
    uncolored: Vec<u32>,
    step: usize,
    /// Vertex -> its row in `until`, if it was ever displaced.
    row: Vec<u32>,
    /// Rows of `count` entries: the step until which the vertex keeps away from the color.
    until: Vec<usize>,
    /// For each color the number of neighbors of the vertex at hand that have it.
    taken: Vec<u32>,
    /// Vertex -> the step at which it was last counted.
    stamp: Vec<usize>,
    displaced: Vec<u32>,
}

/// No row yet.
const NONE: u32 = u32::MAX;

impl<'a, C: Conflicts> Search<'a, C> {
    fn new(conflicts: &'a C, coloring: &Coloring, random: &'a mut Random) -> Self {
        let count = coloring.color_count() - 1;
        let mut colors = coloring.colors().to_vec();
        let uncolored: Vec<u32> = (0..)
            .zip(&colors)
            .filter(|(_, color)| color.index() == count)
            .map(|(v, _)| v)
            .collect();
        for &v in &uncolored {
            colors[v as usize] = UNCOLORED;
        }
        Self {
            conflicts,
            random,
            count,
            uncolored,
            step: 0,
            row: vec![NONE; colors.len()],
            until: Vec::new(),
            taken: vec![0; count],
            stamp: vec![usize::MAX; colors.len()],
            displaced: Vec::new(),
            colors,
        }
    }

    /// Searches for up to `steps` steps; returns whether every vertex got a color.
    fn run(&mut self, steps: usize) -> bool {
        while self.step < steps && !self.uncolored.is_empty() {
            let pick = self.random.below(self.uncolored.len());
            let v = self.uncolored[pick];
            self.count_taken(v);
            if let Some(color) = self.choose(v) {
                self.uncolored.swap_remove(pick);
                self.place(v, color);
            }
            self.step += 1;
        }
        self.uncolored.is_empty()
    }

    /// Counts the neighbors of `v` with each color.
    fn count_taken(&mut self, v: u32) {
        self.taken.fill(0);
        let (stamp, colors, taken) = (&mut self.stamp, &self.colors, &mut self.taken);
        self.conflicts.visit_neighbors(v, |u| {
            let u = u as usize;
            if stamp[u] != self.step {
                stamp[u] = self.step;
                if let Some(count) = taken.get_mut(colors[u].index()) {
                    *count += 1;
                }
            }
        });
    }

    /// The color taken least among those allowed, one of them at random; a free color always is.
    fn choose(&mut self, v: u32) -> Option<usize> {
        let row = self.row[v as usize];
        let mut best = None;
        let mut fewest = u32::MAX;
        let mut ties = 0;
        for color in 0..self.count {
            let taken = self.taken[color];
            if taken > fewest {
                continue;
            }
            let keeps_away =
                row != NONE && self.until[row as usize * self.count + color] > self.step;
            if keeps_away && taken > 0 {
                continue;
            }
            ties = if taken < fewest { 1 } else { ties + 1 };
            fewest = taken;
            if self.random.below(ties) == 0 {
                best = Some(color);
            }
        }
        best
    }

    /// Gives `color` to `v` and takes it from its neighbors.
    fn place(&mut self, v: u32, color: usize) {
        self.colors[v as usize] = ColorId::new(color);
        if self.taken[color] == 0 {
            return;
        }
        let (colors, displaced) = (&mut self.colors, &mut self.displaced);
        displaced.clear();
        self.conflicts.visit_neighbors(v, |u| {
            if colors[u as usize].index() == color {
                colors[u as usize] = UNCOLORED;
                displaced.push(u);
            }
        });
        // A walk through incidence meets them in another order than one through a graph.
        displaced.sort_unstable();
        for index in 0..self.displaced.len() {
            let u = self.displaced[index];
            self.uncolored.push(u);
            let turns = TENURE + self.random.below(TENURE) + self.uncolored.len() * 3 / 5;
            let row = &mut self.row[u as usize];
            if *row == NONE {
                // At most one row per vertex.
                *row = u32::try_from(self.until.len() / self.count).unwrap_or(NONE);
                self.until.resize(self.until.len() + self.count, 0);
            }
            self.until[*row as usize * self.count + color] = self.step + turns;
        }
    }
}

#[cfg(test)]
mod tests {
    use incise_graph::ConstraintGraph;

    use super::*;

    #[test]
    fn what_cannot_be_lost_stays() {
        let triangle = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2), (2, 0)]).unwrap();
        let start = Coloring::new([0, 1, 2].map(ColorId).to_vec());
        let mut coloring = start.clone();
        assert_eq!(tabu(&triangle, &mut coloring, 0, 500, 3), 500);
        assert_eq!(coloring, start);
        let edgeless = ConstraintGraph::from_edges(3, &[]).unwrap();
        tabu(&edgeless, &mut coloring, 0, 500, 3);
        assert_eq!(coloring.color_count(), 1);
        let none = ConstraintGraph::from_edges(0, &[]).unwrap();
        assert_eq!(tabu(&none, &mut Coloring::default(), 0, 500, 3), 0);
    }
}
