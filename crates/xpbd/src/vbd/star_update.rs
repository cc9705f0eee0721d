//! [`StarData::update`]: updates stars and particle colors after a cut.
//!
//! A star changes if one of its tets has changed, was removed or is new. Only these stars are made again, and only
//! particles without a color, and one of each two that share a changed tet and have the same color, are colored again:
//! two particles that meet for the first time meet in a changed tet. All other rows are copied in blocks to where the new
//! order of the particles puts them, and [`StarData::kept`] tells where they were. The result is, to the bit, that of
//! [`StarData::rebuild`] with these colors.
//!
//! Cost: O(changed stars), and a copy of the rest.

use super::corner_term::{CornerTerm, takes_part};
use super::stars::StarData;
use crate::particles::number;
use crate::{Float, Solver};

/// No row, no color.
pub(super) const NONE: u32 = u32::MAX;

/// The changed stars, by particle.
struct Fresh<R> {
    /// The place of each particle in `ends`; [`NONE`] for stars that have not changed.
    index_of: Vec<u32>,
    /// The end of each changed star in `terms`, after a 0.
    ends: Vec<usize>,
    /// Tet and term, ascending by tet within a star.
    terms: Vec<(u32, CornerTerm<R>)>,
}

impl<R: Float> Fresh<R> {
    /// The terms of a particle if its star has changed.
    fn of(&self, particle: usize) -> Option<&[(u32, CornerTerm<R>)]> {
        let index = self.index_of[particle];
        (index != NONE)
            .then(|| &self.terms[self.ends[index as usize]..self.ends[index as usize + 1]])
    }
}

impl<R: Float> StarData<R> {
    /// Updates the stars after the tets `changed` have got other corners or rest shapes, or are new; tets from the present
    /// number on were removed. Returns false, and has changed nothing, if the stars have to be rebuilt: with distances or
    /// volumes, with fewer particles than before, or with a changed tet that has no energy.
    pub(super) fn update(&mut self, solver: &Solver<R>, changed: &[u32]) -> bool {
        let list = &solver.tets.list;
        let (before, count) = (self.order.len(), solver.particle_count());
        let mut changed: Vec<u32> = changed.to_vec();
        changed.sort_unstable();
        changed.dedup();
        changed.retain(|&t| (t as usize) < list.len());
        let has_energy = changed.iter().all(|&t| takes_part(&list[t as usize]));
        let constraints = solver.distance_count() + solver.volume_count();
        if constraints > 0 || !self.constraints.fits(solver) || count < before || !has_energy {
            return false;
        }
        // New tets between the old and the present number are in the list of the changed ones.
        let appended = (self.corners.len()..list.len()).map(number);
        if !appended.eq(changed
            .iter()
            .copied()
            .filter(|&t| t as usize >= self.corners.len()))
        {
            return false;
        }
        let fresh = self.fresh_stars(solver, &changed);
        let colors = self.recolored(solver, &changed, &fresh);
        self.reorder(&colors, &fresh);
        for &t in &changed {
            let corners = list[t as usize].particles;
            match self.corners.get_mut(t as usize) {
                Some(own) => *own = corners,
                None => self.corners.push(corners),
            }
        }
        self.corners.truncate(list.len());
        self.measure(solver);
        self.constraints.forget();
        true
    }

    /// The stars of all particles of changed and removed tets, and of new particles.
    fn fresh_stars(&self, solver: &Solver<R>, changed: &[u32]) -> Fresh<R> {
        let list = &solver.tets.list;
        let mut index_of = vec![NONE; solver.particle_count()];
        let mut particles: Vec<u32> = Vec::new();
        let mut touch = |p: u32| {
            let index = &mut index_of[p as usize];
            if *index == NONE {
                *index = number(particles.len());
                particles.push(p);
            }
            *index
        };
        let removed = (list.len()..self.corners.len()).map(number);
        for t in changed.iter().copied().chain(removed) {
            for &p in self.corners.get(t as usize).into_iter().flatten() {
                touch(p);
            }
        }
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for &t in changed {
            pairs.extend(list[t as usize].particles.map(|p| (touch(p), t)));
        }
        for p in self.order.len()..solver.particle_count() {
            touch(number(p));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let is_old = |t: u32| (t as usize) < list.len() && changed.binary_search(&t).is_err();
        let (mut ends, mut terms) = (vec![0], Vec::new());
        let mut next = 0;
        for (index, &p) in (0u32..).zip(&particles) {
            let start = terms.len();
            if let Some(&row) = self.row_of.get(p as usize) {
                let range = self.offsets[row as usize]..self.offsets[row as usize + 1];
                let own = self.tets[range.clone()].iter().copied();
                terms.extend(
                    own.zip(self.terms[range].iter().copied())
                        .filter(|(t, _)| is_old(*t)),
                );
            }
            while let Some(&(_, t)) = pairs.get(next).filter(|pair| pair.0 == index) {
                next += 1;
                let tet = &list[t as usize];
                let corner = tet.particles.iter().position(|&corner| corner == p);
                let term = corner.and_then(|corner| CornerTerm::new(&tet.to_f64(), corner));
                terms.extend(term.map(|term| (t, term)));
            }
            terms[start..].sort_unstable_by_key(|&(t, _)| t);
            ends.push(terms.len());
        }
        Fresh {
            index_of,
            ends,
            terms,
        }
    }

    /// The color of each particle: those without one, and one of each pair in conflict, get the smallest that is free.
    fn recolored(&self, solver: &Solver<R>, changed: &[u32], fresh: &Fresh<R>) -> Vec<u32> {
        let mut colors = vec![NONE; solver.particle_count()];
        for (color, rows) in (0u32..).zip(self.colors.windows(2)) {
            for &p in &self.order[rows[0]..rows[1]] {
                colors[p as usize] = color;
            }
        }
        let mut uncolored: Vec<u32> = (self.order.len()..colors.len()).map(number).collect();
        for &t in changed {
            let mut corners = solver.tets.list[t as usize].particles;
            corners.sort_unstable();
            for (k, &p) in corners.iter().enumerate() {
                let color = colors[p as usize];
                let is_taken = color != NONE
                    && corners[..k]
                        .iter()
                        .any(|&q| colors[q as usize] == color && q != p);
                if is_taken {
                    colors[p as usize] = NONE;
                    uncolored.push(p);
                }
            }
        }
        uncolored.sort_unstable();
        let mut taken = Vec::new();
        for p in uncolored {
            taken.clear();
            for (_, term) in fresh.of(p as usize).unwrap_or_default() {
                taken.extend(term.others.map(|q| colors[q as usize]));
            }
            colors[p as usize] = (0..).find(|color| !taken.contains(color)).unwrap_or(NONE);
        }
        colors
    }

    /// Sorts particles by color, then by number, and puts the stars into that order.
    fn reorder(&mut self, colors: &[u32], fresh: &Fresh<R>) {
        let color_count = colors
            .iter()
            .map(|&color| color as usize + 1)
            .max()
            .unwrap_or(0);
        // Rows whose blocks change: those of changed stars, and those around particles of another color.
        let mut is_kept: Vec<bool> = (0..colors.len())
            .map(|p| fresh.index_of[p] == NONE)
            .collect();
        for (color, rows) in (0u32..).zip(self.colors.windows(2)) {
            for &p in &self.order[rows[0]..rows[1]] {
                if colors[p as usize] != color {
                    for (_, term) in fresh.of(p as usize).unwrap_or_default() {
                        term.others
                            .iter()
                            .for_each(|&q| is_kept[q as usize] = false);
                    }
                }
            }
        }
        let mut ends = vec![0usize; color_count + 1];
        for &color in colors {
            ends[color as usize + 1] += 1;
        }
        for color in 0..color_count {
            ends[color + 1] += ends[color];
        }
        let mut next = ends.clone();
        let mut order = vec![0u32; colors.len()];
        let mut row_of = vec![0u32; colors.len()];
        for (p, &color) in (0u32..).zip(colors) {
            let row = &mut next[color as usize];
            order[*row] = p;
            row_of[p as usize] = number(*row);
            *row += 1;
        }
        let mut offsets = Vec::with_capacity(order.len() + 1);
        offsets.push(0);
        let more = self.terms.len() + fresh.terms.len();
        let (mut terms, mut tets) = (Vec::with_capacity(more), Vec::with_capacity(more));
        self.kept.clear();
        self.moved.clear();
        let rows = self.order.iter().map(|&p| row_of[p as usize]);
        self.moved.extend(rows);
        for &p in &order {
            let before = self.row_of.get(p as usize).copied();
            if let Some(star) = fresh.of(p as usize) {
                terms.extend(star.iter().map(|(_, term)| *term));
                tets.extend(star.iter().map(|(t, _)| *t));
            } else if let Some(row) = before {
                let range = self.offsets[row as usize]..self.offsets[row as usize + 1];
                terms.extend_from_slice(&self.terms[range.clone()]);
                tets.extend_from_slice(&self.tets[range]);
            }
            offsets.push(terms.len());
            let is_kept = is_kept[p as usize];
            self.kept.push(before.filter(|_| is_kept).unwrap_or(NONE));
        }
        self.colors = ends;
        self.order = order;
        self.row_of = row_of;
        self.offsets_before = std::mem::replace(&mut self.offsets, offsets);
        self.terms = terms;
        self.tets = tets;
        self.revision += 1;
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    use proptest::prelude::*;

    use super::*;
    use crate::vbd::matrix::Blocks;
    use crate::{DistanceConstraint, Material, VertexStars};

    /// A cube of eight cells with six tets each.
    fn cube() -> Solver<f64> {
        let place = |p: usize| DVec3::new((p % 3) as f64, (p / 3 % 3) as f64, (p / 9) as f64);
        let rest: Vec<DVec3> = (0..27).map(place).collect();
        let mut solver = Solver::new(&rest);
        let material = Material {
            young_modulus: 1e5,
            poisson_ratio: 0.3,
            density: 1e3,
            damping: 0.0,
        };
        solver.add_material(material).expect("a sound material");
        for cell in 0..8 {
            let first = cell % 2 + 3 * (cell / 2 % 2) + 9 * (cell / 4);
            for steps in [
                [1, 3, 9],
                [3, 9, 1],
                [9, 1, 3],
                [1, 9, 3],
                [9, 3, 1],
                [3, 1, 9],
            ] {
                let [a, b] = [first + steps[0], first + steps[0] + steps[1]];
                let mut corners = [first, a, b, first + 13].map(number);
                let [o, x, y, z] = corners.map(|p| solver.particles.local(p as usize));
                if (x - o).cross(y - o).dot(z - o) < 0.0 {
                    corners.swap(1, 2);
                }
                push(&mut solver, None, corners);
            }
        }
        solver
    }

    /// Puts a tet with the particles' positions as its rest shape in a slot, or appends it; returns its number.
    fn push(solver: &mut Solver<f64>, slot: Option<usize>, corners: [u32; 4]) -> u32 {
        let rest = corners.map(|p| solver.particles.local(p as usize));
        match slot {
            Some(t) => solver.replace_tet(t, corners, rest),
            None => solver.push_tet(corners, rest, 0),
        }
        number(slot.unwrap_or(solver.tet_count() - 1))
    }

    /// Splits an edge of a tet, gives it a copy of a corner, or removes it; returns the changed tets.
    fn edit(solver: &mut Solver<f64>, kind: u8, tet: usize, corner: usize) -> Vec<u32> {
        let corners = solver.tet_particles(tet);
        let new = number(solver.particle_count());
        let with_new = |corner: usize| {
            let mut corners = corners;
            corners[corner] = new;
            corners
        };
        match kind {
            0 => {
                let other = (corner + 1) % 4;
                solver.push_particle_between(
                    corners[corner] as usize,
                    corners[other] as usize,
                    0.4,
                );
                vec![
                    push(solver, Some(tet), with_new(corner)),
                    push(solver, None, with_new(other)),
                ]
            }
            1 => {
                solver.push_copy(corners[corner] as usize);
                solver.relink_tet(tet, with_new(corner));
                vec![number(tet)]
            }
            _ => {
                let last = solver.tet_count() - 1;
                solver.move_tet(last, tet);
                solver.truncate_tets(last);
                vec![number(tet)]
            }
        }
    }

    /// Stars with a color for each particle, and their matrix.
    fn stars(solver: &Solver<f64>) -> (VertexStars<f64>, Blocks<f64>) {
        let count = solver.particle_count();
        let coloring = Coloring::new((0u32..).take(count).map(ColorId).collect());
        let schedule = Schedule::new(&Clustering::none(count), &coloring);
        let stars = VertexStars::new(solver, &schedule).expect("all colors differ");
        let matrix = Blocks::new(&stars.data);
        (stars, matrix)
    }

    proptest! {
        /// After any edits stars and pattern are those of a rebuild, to the bit, and the colors are proper.
        #[test]
        fn updated_stars_are_rebuilt_ones(
            cuts in prop::collection::vec(
                prop::collection::vec((0..3u8, 0..1000usize, 0..4usize), 1..6),
                1..8,
            ),
        ) {
            let mut solver = cube();
            let (mut stars, mut matrix) = stars(&solver);
            for edits in cuts {
                let mut changed = Vec::new();
                for (kind, tet, corner) in edits {
                    let tet = tet % solver.tet_count();
                    changed.extend(edit(&mut solver, kind, tet, corner));
                }
                prop_assert!(stars.update(&solver, &changed));
                matrix.sync(&stars.data);
                stars.check(&solver).unwrap();
                matrix.check(&stars.data).unwrap();
            }
        }
    }

    /// Two particles of one color that come to share a tet: one is colored again, and rows next to it get another order.
    #[test]
    fn particles_that_meet_are_colored_again() {
        let mut solver = cube();
        let (mut stars, mut matrix) = stars(&solver);
        // Greedy colors, which are few.
        let mut colors = [NONE; 27];
        for p in 0..27 {
            let star = stars.data.of(stars.data.row_of[p] as usize);
            let taken: Vec<u32> = star
                .iter()
                .flat_map(|term| term.others.map(|q| colors[q as usize]))
                .collect();
            colors[p] = (0..)
                .find(|color| !taken.contains(color))
                .expect("colors do not end");
        }
        let coloring = Coloring::new(colors.iter().copied().map(ColorId).collect());
        let schedule = Schedule::new(&Clustering::none(27), &coloring);
        stars
            .rebuild(&solver, &solver.star_incidence(), &schedule)
            .expect("a proper coloring");
        matrix.sync(&stars.data);
        let far = (1..27)
            .find(|&p| colors[p] == colors[0])
            .expect("27 particles have fewer colors");
        let mut corners = solver.tet_particles(0);
        let away = corners.iter().position(|&p| p != 0).expect("four corners");
        corners[away] = number(far);
        solver.relink_tet(0, corners);
        assert!(stars.update(&solver, &[0]));
        matrix.sync(&stars.data);
        stars.check(&solver).unwrap();
        matrix.check(&stars.data).unwrap();
        let changed = (0..27)
            .filter(|&p| stars.coloring().color(p) != coloring.color(p))
            .count();
        assert_eq!(changed, 1);
    }

    /// What an update cannot follow is refused, and nothing has changed.
    #[test]
    fn other_changes_are_refused() {
        let mut solver = cube();
        let (mut stars, _) = stars(&solver);
        let corners = solver.tet_particles(0);
        push(&mut solver, None, corners);
        assert!(!stars.update(&solver, &[]), "a new tet is not named");
        solver.truncate_tets(48);
        stars.check(&solver).unwrap();
        let distance = DistanceConstraint {
            particles: [0, 26],
            length: 1.0,
            compliance: 0.0,
            damping: 0.0,
            tension_only: false,
        };
        let one = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
        solver.set_distances(&[distance], one).expect("sound");
        assert!(!stars.update(&solver, &[0]), "a distance joins particles");
    }
}
