//! A coloring that follows edits: cut a constraint out, put others in, recolor only these.
//!
//! Removing constraints never makes a coloring improper, so every vertex keeps its color. A vertex
//! that got new particles keeps its color unless a neighbor has it. A vertex left without a color
//! takes the smallest free color if the number of colors need not grow for it; else the first color
//! whose holders around can all move to another one; else what a short search makes room for (see
//! the module `search`); else a new color. Vertices with a new color are noted, and later edits
//! search for another color for them. So the work of a full coloring is spread over edits, near the
//! vertices that need it.
//!
//! The limit is the larger of two numbers, the colors of the last full coloring and the present
//! clique bound, plus the slack. So colors grow only where the constraints themselves grow denser,
//! or by the slack. Where even a longer search finds no color below the limit, all vertices are
//! recolored with [`auto`]. The last full coloring may be one of a denser scene, though: after
//! removing many constraints, call [`recolor`](Recoloring::recolor) at a quiet moment.
//!
//! Cost of an edit: the links of the edited vertices and of those at their particles, counted in
//! [`Recolored::visited`]; moving neighbors costs their neighborhoods in turn, and searches a fixed
//! number of steps. None of it depends on the size of the rest.

mod links;
mod search;
mod taken;

use std::borrow::Borrow;
use std::cmp::Reverse;
use std::collections::BTreeSet;

use incise_graph::{Classes, ColorId, Coloring, Incidence};

use crate::conflicts::UNCOLORED;
use crate::{ColoringError, auto};
use links::Links;
use search::LocalSearch;
use taken::Taken;

/// Steps of a search for a color below the accepted ones.
const SEARCH: usize = 100;

/// Steps of such searches in an edit.
const STEPS: usize = 300;

/// Steps of a search that saves a full coloring, where more colors are allowed: tens of steps are mostly enough.
const LAST_SEARCH: usize = 1000;

/// Steps of all searches in an edit.
const ALL_STEPS: usize = 5000;

/// Statistics of an edit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Recolored {
    /// Number of vertices that were colored by the edit, with an old or a new color; after a full
    /// coloring all of them.
    pub colored: usize,
    /// Number of vertices outside the edit that changed their color.
    pub displaced: usize,
    /// Number of steps of searches for a color.
    pub steps: usize,
    /// Number of links visited, the work of the edit, without a full coloring.
    pub visited: u64,
    /// Whether all vertices were recolored.
    pub full: bool,
    /// Number of colors after the edit.
    pub colors: usize,
    /// Clique bound after the edit.
    pub bound: usize,
}

/// A proper coloring of constraints or clusters that is updated by edits.
///
/// The caller chooses the numbers of vertices and particles, which may grow at any time. A vertex
/// without particles has color 0. Deterministic: equal edits give equal colors.
///
/// ```
/// use incise_coloring::Recoloring;
/// use incise_graph::Incidence;
///
/// // Two tets on a face. Tet 1 is cut: it goes, and three others come, one of them with its number.
/// let tets = Incidence::from_constraints(5, [[0u32, 1, 2, 3], [1, 2, 3, 4]])?;
/// let mut recoloring = Recoloring::new(&tets, 2);
/// let removed = [1, 2, 3, 4].map(|particle| (1, particle));
/// let children = [(1, [1, 2, 5, 4]), (2, [5, 2, 3, 4]), (3, [1, 5, 3, 4])];
/// let added: Vec<(u32, u32)> = children
///     .into_iter()
///     .flat_map(|(tet, particles)| particles.map(|particle| (tet, particle)))
///     .collect();
/// let report = recoloring.apply(&removed, &added)?;
/// assert_eq!((report.colored, report.full, report.colors), (3, false, 4));
/// recoloring.coloring().verify_incidence(&recoloring.incidence())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Recoloring {
    links: Links,
    coloring: Coloring,
    /// The colors at each particle; those of its vertices, except while an edit is under way.
    taken: Taken,
    /// The vertices that the last edit gave another color.
    changed: Vec<u32>,
    /// The number of vertices of each color; the last is not 0.
    sizes: Vec<u32>,
    /// The number of colors after the last full coloring.
    reference: usize,
    slack: usize,
    /// The vertices without particles.
    vacant: BTreeSet<u32>,
    /// Vertices that an edit leaves without a color, and the color that they had.
    waiting: Vec<(u32, ColorId)>,
    /// Those that cannot keep it, by the valences of their particles.
    by_bound: Vec<(Reverse<u64>, u32)>,
    /// Vertices that got a color beyond the accepted ones.
    excess: Vec<u32>,
    /// Number of searches, which seeds the next one.
    searches: u64,
    #[cfg_attr(feature = "serde", serde(skip))]
    search: LocalSearch,
}

impl Recoloring {
    /// Colors the constraints of `incidence` with [`auto`] and prepares for edits.
    ///
    /// Edits may add up to `slack` colors before all vertices are recolored: 0 keeps the number as
    /// low as full colorings do, `usize::MAX` never recolors all. The cost is that of [`auto`],
    /// plus O(sum over particles of valence squared) once.
    #[must_use]
    pub fn new(incidence: &Incidence, slack: usize) -> Self {
        let rows = (0..).take(incidence.constraint_count());
        let pairs = rows.flat_map(|v| {
            incidence
                .particles_of(v as usize)
                .iter()
                .map(move |&p| (v, p))
        });
        let coloring = auto(incidence).coloring;
        Self::linked(pairs, coloring, slack)
    }

    /// Starts from (vertex, particle) pairs that have a coloring; pairs may repeat, as in
    /// [`apply`](Self::apply). O(sum over particles of pairs squared).
    ///
    /// # Errors
    /// If the coloring is not proper or has another number of vertices than the pairs.
    ///
    /// ```
    /// use incise_coloring::Recoloring;
    /// use incise_graph::{ColorId, Coloring};
    ///
    /// // Two clusters of two springs each along the particles 0 to 4.
    /// let pairs = [(0, 0), (0, 1), (0, 1), (0, 2), (1, 2), (1, 3), (1, 3), (1, 4)];
    /// let coloring = Coloring::new(vec![ColorId(0), ColorId(1)]);
    /// let recoloring = Recoloring::with_coloring(pairs, coloring, 0)?;
    /// assert_eq!((recoloring.color_count(), recoloring.bound()), (2, 2));
    /// # Ok::<(), incise_coloring::ColoringError>(())
    /// ```
    pub fn with_coloring(
        pairs: impl IntoIterator<Item = (u32, u32)>,
        coloring: Coloring,
        slack: usize,
    ) -> Result<Self, ColoringError> {
        let recoloring = Self::linked(pairs, coloring, slack);
        recoloring
            .coloring
            .verify_incidence(&recoloring.links.incidence())?;
        Ok(recoloring)
    }

    fn linked(
        pairs: impl IntoIterator<Item = (u32, u32)>,
        coloring: Coloring,
        slack: usize,
    ) -> Self {
        let mut links = Links::default();
        // Also vertices at the end that have no particles.
        links.reserve_vertices(coloring.vertex_count());
        for (v, particle) in pairs {
            links.add(v, particle);
        }
        let mut recoloring = Self {
            links,
            coloring,
            taken: Taken::default(),
            changed: Vec::new(),
            sizes: Vec::new(),
            reference: 0,
            slack,
            vacant: BTreeSet::new(),
            waiting: Vec::new(),
            by_bound: Vec::new(),
            excess: Vec::new(),
            searches: 0,
            search: LocalSearch::default(),
        };
        let all = (0..).take(recoloring.links.vertex_count());
        let vacant = all.filter(|&v| !recoloring.links.has(v));
        recoloring.vacant = vacant.collect();
        recoloring.count();
        recoloring
    }

    /// Returns the colors, one for every vertex number up to the largest ever used.
    #[must_use]
    pub fn coloring(&self) -> &Coloring {
        &self.coloring
    }

    /// Returns the constraints of each color, ascending. Numbers without particles, such as those of removed
    /// constraints, are left out, while [`coloring`](Self::coloring) has a color for every number. O(vertices +
    /// colors).
    #[must_use]
    pub fn classes(&self) -> Classes {
        let is_present = |v| u32::try_from(v).is_ok_and(|v| self.links.has(v));
        self.coloring.classes_of(is_present)
    }

    /// Returns the number of colors, the largest label plus one. O(1).
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.sizes.len()
    }

    /// Returns the largest number of vertices at one particle, a lower bound on the number of
    /// colors. O(1).
    #[must_use]
    pub fn bound(&self) -> usize {
        self.links.bound()
    }

    /// Returns the largest number of colors that an edit may leave without recoloring all vertices.
    #[must_use]
    pub fn limit(&self) -> usize {
        self.accepted().saturating_add(self.slack)
    }

    /// Returns the present particles of all vertices. O(links log links).
    #[must_use]
    pub fn incidence(&self) -> Incidence {
        self.links.incidence()
    }

    /// Returns the vertices whose color may have changed in the last edit, and those added or
    /// removed by it, ascending; all vertices after a full coloring.
    #[must_use]
    pub fn changed(&self) -> &[u32] {
        &self.changed
    }

    /// Adds vertices up to a number of `vertices`; new ones have no particles and color 0. O(new
    /// vertices).
    pub fn reserve(&mut self, vertices: usize) {
        self.links.reserve_vertices(vertices);
        let before = self.coloring.vertex_count();
        for v in (0..).take(vertices).skip(before) {
            self.coloring.push(UNCOLORED);
            self.set(v, ColorId(0));
            self.vacant.insert(v);
        }
    }

    /// Adds constraints, each a slice of its particles by value or by reference, and colors them. Returns their numbers: the smallest that no
    /// constraint has. Cost: see the [report](Recolored).
    ///
    /// # Errors
    /// If a constraint has no particle. Nothing is changed then.
    ///
    /// ```
    /// use incise_coloring::Recoloring;
    /// use incise_graph::Incidence;
    ///
    /// let springs = Incidence::from_constraints(5, [[0u32, 1], [1, 2], [2, 3], [3, 4]])?;
    /// let mut recoloring = Recoloring::new(&springs, 1);
    /// recoloring.remove(&[1])?;
    /// assert_eq!(recoloring.classes().values().len(), 3);
    /// let (numbers, report) = recoloring.add([[1u32, 3], [0, 4]])?;
    /// assert_eq!((numbers, report.colored), (vec![1, 4], 2));
    /// for springs in recoloring.classes().iter() {
    ///     // These share no particle: solve them in parallel.
    ///     assert!(springs.len() <= 2);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add<P: Borrow<u32>>(
        &mut self,
        constraints: impl IntoIterator<Item = impl AsRef<[P]>>,
    ) -> Result<(Vec<u32>, Recolored), ColoringError> {
        let next = (0..).skip(self.links.vertex_count());
        let mut free = self.vacant.iter().copied().chain(next);
        let (mut numbers, mut added) = (Vec::new(), Vec::new());
        for (constraint, vertex) in constraints.into_iter().zip(&mut free) {
            let first = added.len();
            let particles = constraint
                .as_ref()
                .iter()
                .map(|particle| *particle.borrow());
            added.extend(particles.map(|particle| (vertex, particle)));
            if added.len() == first {
                let vertex = u32::try_from(numbers.len()).unwrap_or(u32::MAX);
                return Err(ColoringError::NoParticles { vertex });
            }
            numbers.push(vertex);
        }
        let report = self.apply(&[], &added)?;
        Ok((numbers, report))
    }

    /// Removes constraints by their numbers, which [`add`](Self::add) may give to others. The rest keep their colors.
    /// O(particles of the removed constraints).
    ///
    /// # Errors
    /// If a number is that of no constraint, or is given twice. Nothing is changed then.
    pub fn remove(&mut self, constraints: &[u32]) -> Result<Recolored, ColoringError> {
        let mut removed = Vec::new();
        for &vertex in constraints {
            if !self.links.has(vertex) {
                return Err(ColoringError::NoParticles { vertex });
            }
            let particles = self.links.repeated(vertex);
            removed.extend(particles.map(|particle| (vertex, particle)));
        }
        self.apply(&removed, &[])
    }

    /// Removes and adds (vertex, particle) pairs and colors the vertices that need a new color.
    ///
    /// This is [`add`](Self::add) and [`remove`](Self::remove) in one edit, for a caller that has numbers of its own;
    /// numbers that are skipped are vertices without particles. Removals come first. A vertex is removed by removing
    /// all its pairs, moved to a copy of a
    /// particle by removing one pair and adding another. Pairs may repeat: a cluster has one for
    /// each of its constraints at a particle. Cost: see the
    /// [report](Recolored); if [`limit`](Self::limit) is exceeded, that of [`recolor`](Self::recolor).
    ///
    /// # Errors
    /// If a removed pair does not exist. Nothing is changed then.
    pub fn apply(
        &mut self,
        removed: &[(u32, u32)],
        added: &[(u32, u32)],
    ) -> Result<Recolored, ColoringError> {
        let mut report = Recolored::default();
        self.changed.clear();
        self.unlink(removed)?;
        report.visited += (removed.len() + added.len()) as u64;
        self.link(added);
        // The pairs of one vertex often follow each other.
        for run in removed.chunk_by(|a, b| a.0 == b.0) {
            let v = run[0].0;
            if !self.links.has(v) {
                self.set(v, ColorId(0));
                self.changed.push(v);
                self.vacant.insert(v);
            }
        }
        let mut waiting = std::mem::take(&mut self.waiting);
        // Vertices that can keep their old color do so before any vertex takes another one.
        waiting.sort_unstable();
        waiting.retain(|&(v, old)| {
            report.visited += self.links.of(v).count() as u64;
            let keeps = old != UNCOLORED && self.taken.is_free(self.links.of(v), old);
            if keeps {
                report.colored += 1;
                self.set(v, old);
            }
            !keeps
        });
        // Those with the largest bound first.
        self.by_bound.clear();
        let by_bound = waiting.iter().map(|&(v, _)| {
            let degree_bound = self.links.degree_bound(v);
            (Reverse(degree_bound), v)
        });
        self.by_bound.extend(by_bound);
        self.by_bound.sort_unstable();
        for i in 0..self.by_bound.len() {
            self.place(self.by_bound[i].1, &mut report);
        }
        self.waiting = waiting;
        self.retry(&mut report);
        while self.sizes.last() == Some(&0) {
            self.sizes.pop();
        }
        report.colors = self.color_count();
        report.bound = self.bound();
        if report.colors > self.limit() {
            self.recolor();
            report.full = true;
            report.colored = self.coloring.vertex_count();
            report.colors = self.color_count();
        } else {
            self.changed.sort_unstable();
            self.changed.dedup();
        }
        Ok(report)
    }

    /// Recolors all vertices with [`auto`], at its cost.
    pub fn recolor(&mut self) {
        let incidence = self.links.incidence();
        self.coloring = auto(&incidence).coloring;
        self.excess.clear();
        self.count();
        self.changed.clear();
        self.changed.extend((0..).take(self.links.vertex_count()));
    }

    /// Counts the classes of a coloring that is all new, and notes its colors at the particles.
    fn count(&mut self) {
        self.taken = self.recomputed_taken();
        self.sizes = vec![0; self.coloring.color_count()];
        for color in self.coloring.colors() {
            self.sizes[color.index()] += 1;
        }
        self.reference = self.color_count();
    }

    /// The colors at each particle, from the links.
    fn recomputed_taken(&self) -> Taken {
        let mut taken = Taken::default();
        taken.reserve_particles(self.links.particle_count());
        for (v, &color) in (0..).zip(self.coloring.colors()) {
            taken.take(self.links.of(v), color);
        }
        taken
    }

    /// Recomputes all derived data from the links and compares. O(links log links).
    ///
    /// # Errors
    /// If two vertices of one color share a particle, or a derived count is wrong.
    pub fn check(&self) -> Result<(), ColoringError> {
        let incidence = self.links.incidence();
        self.coloring.verify_incidence(&incidence)?;
        let mut sizes = vec![0; self.coloring.color_count()];
        for color in self.coloring.colors() {
            sizes[color.index()] += 1;
        }
        let at_particles = self.taken.agrees_with(&self.recomputed_taken());
        let vacant = (0..).take(self.links.vertex_count());
        let vacant = vacant.filter(|&v| !self.links.has(v));
        let are_vacant = self.vacant.iter().copied().eq(vacant);
        if sizes == self.sizes && at_particles && are_vacant && self.links.counts_agree(&incidence)
        {
            Ok(())
        } else {
            Err(ColoringError::InconsistentCounts)
        }
    }

    /// Removes all pairs, or none.
    fn unlink(&mut self, removed: &[(u32, u32)]) -> Result<(), ColoringError> {
        for (done, &(vertex, particle)) in removed.iter().enumerate() {
            match self.links.remove(vertex, particle) {
                Some(false) => {}
                Some(true) => {
                    let color = self.coloring.color(vertex as usize);
                    self.taken.give_back(std::iter::once(particle), color);
                }
                None => {
                    for &(vertex, particle) in &removed[..done] {
                        self.links.add(vertex, particle);
                        let color = self.coloring.color(vertex as usize);
                        self.taken.take(std::iter::once(particle), color);
                    }
                    return Err(ColoringError::NoSuchPair { vertex, particle });
                }
            }
        }
        Ok(())
    }

    /// Adds pairs. Notes the vertices that came to new particles, each once, with the color that
    /// they had: they have none now.
    fn link(&mut self, added: &[(u32, u32)]) {
        self.waiting.clear();
        for run in added.chunk_by(|a, b| a.0 == b.0) {
            let v = run[0].0;
            let vertices = self.coloring.vertex_count();
            if vertices <= v as usize {
                // Numbers that are skipped have no particles.
                self.reserve(v as usize + 1);
                self.changed.extend((0..=v).skip(vertices));
            }
            // A vertex without particles has no color to keep, and its links are all of this run: they come first at
            // particles.
            let is_new = !self.links.has(v);
            if is_new {
                self.vacant.remove(&v);
            }
            for &(_, particle) in run {
                let known = if is_new {
                    self.links.repeat_last(v, particle)
                } else {
                    self.links.repeat(v, particle)
                };
                if known {
                    continue;
                }
                let color = self.coloring.color(v as usize);
                if color != UNCOLORED {
                    let old = if is_new { UNCOLORED } else { color };
                    self.waiting.push((v, old));
                    self.taken.give_back(self.links.of(v), color);
                    self.set(v, UNCOLORED);
                }
                self.links.insert(v, particle);
            }
        }
        self.taken.reserve_particles(self.links.particle_count());
    }

    /// Finds a color for an uncolored vertex.
    fn place(&mut self, v: u32, report: &mut Recolored) {
        report.colored += 1;
        self.changed.push(v);
        let color = self.smallest_free(v, report);
        let (accepted, limit) = (self.accepted(), self.limit());
        if color.index() >= accepted {
            let steps = SEARCH.min(STEPS.saturating_sub(report.steps));
            let last = LAST_SEARCH.min(ALL_STEPS.saturating_sub(report.steps));
            if self.displace(v, accepted, report)
                || self.search(v, accepted, steps, report)
                || color.index() >= limit && self.search(v, limit, last, report)
            {
                return;
            }
            self.excess.push(v);
        }
        self.set(v, color);
    }

    /// The smallest color that no neighbor of `v` has, nor `v` itself.
    fn smallest_free(&self, v: u32, report: &mut Recolored) -> ColorId {
        let particles = self.links.of(v);
        report.visited += particles.clone().count() as u64;
        self.taken.first_free(particles)
    }

    /// Gives `v` the first color below `accepted` whose holders around can all move to other colors
    /// below `accepted`.
    ///
    /// The holders of one color are not neighbors of each other, so none blocks another. `v` has no
    /// color yet, so it blocks none of them.
    fn displace(&mut self, v: u32, accepted: usize, report: &mut Recolored) -> bool {
        let mut around: Vec<(ColorId, u32)> = self
            .links
            .neighbors(v)
            .map(|u| (self.coloring.color(u as usize), u))
            .filter(|(color, _)| color.index() < accepted)
            .collect();
        report.visited += around.len() as u64;
        around.sort_unstable();
        around.dedup();
        for holders in around.chunk_by(|a, b| a.0 == b.0) {
            let color = holders[0].0;
            let moves: Option<Vec<(u32, ColorId)>> = holders
                .iter()
                .map(|&(_, u)| {
                    let other = self.smallest_free(u, report);
                    (other.index() < accepted).then_some((u, other))
                })
                .collect();
            if let Some(moves) = moves {
                report.displaced += moves.len();
                for (u, other) in moves {
                    self.taken.give_back(self.links.of(u), color);
                    self.set(u, other);
                    self.changed.push(u);
                }
                self.set(v, color);
                return true;
            }
        }
        false
    }

    /// Gives an uncolored `v` a color below `allowed` by moving others around it, in up to `steps` steps of a search.
    fn search(&mut self, v: u32, allowed: usize, steps: usize, report: &mut Recolored) -> bool {
        let mut search = std::mem::take(&mut self.search);
        let found = self.search_color(&mut search, v, allowed, steps, report);
        if found {
            report.displaced += search.moved().len().saturating_sub(1);
            self.changed.extend(search.moved());
        }
        self.search = search;
        found
    }

    /// Tries vertices again that got a color beyond the accepted ones: those first that have waited longest, and all that
    /// are beyond the limit, which may have fallen.
    fn retry(&mut self, report: &mut Recolored) {
        let (accepted, limit) = (self.accepted(), self.limit());
        let mut excess = std::mem::take(&mut self.excess);
        excess.retain(|&v| self.color_of(v).index() >= accepted);
        let mut tried = 0;
        for (i, &v) in excess.iter().enumerate() {
            let (color, steps) = (self.color_of(v), STEPS.saturating_sub(report.steps));
            // Others may have moved away from it since.
            if color.index() < accepted || (steps == 0 && color.index() < limit) {
                continue;
            }
            tried = i + 1;
            self.taken.give_back(self.links.of(v), color);
            self.set(v, UNCOLORED);
            let last = LAST_SEARCH.min(ALL_STEPS.saturating_sub(report.steps));
            let found = self.search(v, accepted, SEARCH.min(steps), report)
                || color.index() >= limit && self.search(v, limit, last, report);
            if !found {
                self.set(v, color);
            }
        }
        excess.rotate_left(tried);
        excess.retain(|&v| self.color_of(v).index() >= accepted);
        self.excess = excess;
    }

    /// The number of colors from which on a vertex gets no new one while others can make room: below this, more colors
    /// cost nothing that a full coloring would not cost, too.
    fn accepted(&self) -> usize {
        self.reference.max(self.bound())
    }

    fn color_of(&self, v: u32) -> ColorId {
        self.coloring.color(v as usize)
    }

    /// Gives a vertex that holds no color at its particles a color, or none, and counts it.
    fn set(&mut self, v: u32, color: ColorId) {
        let old = self.coloring.color(v as usize);
        if old != UNCOLORED {
            self.sizes[old.index()] -= 1;
        }
        if color != UNCOLORED {
            if self.sizes.len() <= color.index() {
                self.sizes.resize(color.index() + 1, 0);
            }
            self.sizes[color.index()] += 1;
            self.taken.take(self.links.of(v), color);
        }
        self.coloring.set(v as usize, color);
    }
}
