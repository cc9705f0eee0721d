//! [`StarData`]: the tets and constraints of each particle, in the order in which VBD visits particles.
//!
//! Particles that share a tet must not move at the same time. So particles play the part that constraints play in
//! XPBD: each is a constraint on its tets ([`Solver::star_incidence`]), any coloring algorithm colors them, and a
//! schedule lists them. A tet has four particles, so there are at least 4 colors; on tet meshes there are 6 to 10, a
//! fifth of what the tets themselves need. Cost: 32 bytes a tet and corner in single precision, 56 in double, read once
//! a sweep from front to back.

use incise_graph::{Clustering, ColorId, Coloring, DisjointSets, GraphError, Incidence, Schedule};
use rayon::prelude::*;

use super::constraints::ConstraintTerms;
use super::corner_term::{CornerTerm, takes_part};
use super::row_slices::row_slices;
use crate::constraints::ScalarConstraint;
use crate::{Float, Solver, XpbdError};

/// The tets and constraints of each particle, sorted by the particles of a schedule.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct StarData<R: Float> {
    /// Particles in solving order.
    pub(super) order: Vec<u32>,
    /// The end of each color in `order`, after a 0.
    pub(super) colors: Vec<usize>,
    /// The end of the terms of each particle of `order`, after a 0.
    pub(super) offsets: Vec<usize>,
    pub(super) terms: Vec<CornerTerm<R>>,
    /// The tet of each term.
    pub(super) tets: Vec<u32>,
    /// The particles of each tet.
    pub(super) corners: Vec<[u32; 4]>,
    /// Particle -> its position in the order.
    pub(super) row_of: Vec<u32>,
    /// Of each row, where it was before the last update if neither its terms nor the order of its neighbors has changed
    /// since, else `u32::MAX`. Empty after a rebuild.
    pub(super) kept: Vec<u32>,
    /// Of each row before the last update, where it is now. Empty after a rebuild.
    pub(super) moved: Vec<u32>,
    /// The ends of the terms before the last update.
    pub(super) offsets_before: Vec<usize>,
    /// Number of updates and rebuilds.
    pub(super) revision: u64,
    /// The edge of a cube with the mean rest volume of a tet, in m: the scale of negligible lengths.
    pub(super) size: f64,
    /// Distances, volumes and attachments.
    pub(super) constraints: ConstraintTerms<R>,
}

impl<R: Float> Default for StarData<R> {
    fn default() -> Self {
        Self {
            order: Vec::new(),
            colors: Vec::new(),
            offsets: Vec::new(),
            terms: Vec::new(),
            tets: Vec::new(),
            corners: Vec::new(),
            row_of: Vec::new(),
            kept: Vec::new(),
            moved: Vec::new(),
            offsets_before: Vec::new(),
            revision: 0,
            size: 0.0,
            constraints: ConstraintTerms::default(),
        }
    }
}

impl<R: Float> StarData<R> {
    /// Rebuilds the stars in place after tets have changed, given the [`Solver::star_incidence`] of the present tets,
    /// and reuses memory. O(tets).
    ///
    /// # Errors
    /// Those of [`Schedule::check`]; nothing has changed then.
    pub(super) fn rebuild(
        &mut self,
        solver: &Solver<R>,
        incidence: &Incidence,
        schedule: &Schedule,
    ) -> Result<(), GraphError> {
        schedule.check(incidence)?;
        self.order.clear();
        self.order.extend(schedule.order());
        self.colors.clear();
        self.colors.push(0);
        for color in 0..schedule.color_count() {
            let end = self.colors[color] + schedule.color_constraints(color).count();
            self.colors.push(end);
        }
        self.offsets.clear();
        self.offsets.push(0);
        let list = &solver.tets.list;
        // What comes after the tets are distances and volumes.
        let tets_of = |p: u32| {
            let elements = incidence.particles_of(p as usize).iter();
            elements.map_while(|&t| Some((t, list.get(t as usize)?)))
        };
        let mut end = 0;
        for &p in &self.order {
            end += tets_of(p).filter(|(_, tet)| takes_part(tet)).count();
            self.offsets.push(end);
        }
        self.terms.resize(end, CornerTerm::default());
        self.tets.resize(end, 0);
        let slices = row_slices(&self.offsets, &mut self.terms).into_iter();
        let slices: Vec<_> = slices
            .zip(row_slices(&self.offsets, &mut self.tets))
            .collect();
        let order = &self.order;
        slices
            .into_par_iter()
            .for_each(|((rows, terms), (_, tets))| {
                let elements = order[rows].iter().flat_map(|&p| {
                    tets_of(p).filter_map(move |(t, tet)| {
                        let corner = tet.particles.iter().position(|&corner| corner == p)?;
                        Some((CornerTerm::new(&tet.to_f64(), corner)?, t))
                    })
                });
                for ((term, tet), element) in terms.iter_mut().zip(tets).zip(elements) {
                    (*term, *tet) = element;
                }
            });
        self.corners.clear();
        self.corners.extend(list.iter().map(|tet| tet.particles));
        self.row_of.clear();
        self.row_of.resize(self.order.len(), 0);
        for (row, &p) in (0u32..).zip(&self.order) {
            self.row_of[p as usize] = row;
        }
        self.kept.clear();
        self.moved.clear();
        self.revision += 1;
        self.measure(solver);
        self.constraints.rebuild(solver, &self.order, incidence);
        Ok(())
    }

    /// Takes the mean size of the tets. O(tets).
    pub(super) fn measure(&mut self, solver: &Solver<R>) {
        let volume = solver.tets.rest_volumes.iter().sum::<f64>();
        self.size = (6.0 * volume / solver.tet_count().max(1) as f64)
            .max(0.0)
            .cbrt();
    }

    /// Compares everything with stars rebuilt from the tets with the colors at hand, to the bit. O(tets).
    ///
    /// # Errors
    /// [`XpbdError::Layout`] with the first particle that differs, or the colors if they are improper.
    pub(super) fn check(&self, solver: &Solver<R>) -> Result<(), XpbdError> {
        let schedule = Schedule::new(&Clustering::none(self.order.len()), &self.coloring());
        let mut rebuilt = Self::default();
        let what = "particle coloring";
        rebuilt
            .rebuild(solver, &solver.star_incidence(), &schedule)
            .map_err(|source| XpbdError::Schedule { what, source })?;
        let differs = |what, number| Err(XpbdError::Layout { what, number });
        if self.order != rebuilt.order || self.row_of != rebuilt.row_of {
            return differs("order of particles", 0);
        }
        if self.corners != rebuilt.corners || self.size.to_bits() != rebuilt.size.to_bits() {
            return differs("list of tets", 0);
        }
        for row in 0..self.order.len() {
            let tets = |data: &Self| data.tets[data.offsets[row]..data.offsets[row + 1]].to_vec();
            let is_same = self.of(row) == rebuilt.of(row) && tets(self) == tets(&rebuilt);
            if self.offsets[row + 1] != rebuilt.offsets[row + 1] || !is_same {
                return differs("star", self.order[row] as usize);
            }
        }
        Ok(())
    }

    /// The color of each particle.
    pub(super) fn coloring(&self) -> Coloring {
        let mut colors = vec![ColorId(0); self.order.len()];
        for (color, rows) in (0u32..).zip(self.colors.windows(2)) {
            for &p in &self.order[rows[0]..rows[1]] {
                colors[p as usize] = ColorId(color);
            }
        }
        Coloring::new(colors)
    }

    /// Bytes of all arrays.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.order)
            + size_of_val(&*self.colors)
            + size_of_val(&*self.offsets)
            + size_of_val(&*self.terms)
            + size_of_val(&*self.tets)
            + size_of_val(&*self.corners)
            + size_of_val(&*self.row_of)
            + size_of_val(&*self.kept)
            + size_of_val(&*self.moved)
            + size_of_val(&*self.offsets_before)
            + self.constraints.bytes()
    }

    /// The terms of the particle at a position in the order.
    #[inline]
    pub(super) fn of(&self, row: usize) -> &[CornerTerm<R>] {
        &self.terms[self.offsets[row]..self.offsets[row + 1]]
    }

    /// The smallest particle of each particle's connected part of the body. O(tets).
    pub(super) fn parts(&self, solver: &Solver<R>) -> Vec<u32> {
        let mut sets = DisjointSets::new(self.order.len());
        for tet in &solver.tets.list {
            let [a, others @ ..] = tet.particles;
            for b in others {
                sets.unite(a, b);
            }
        }
        for (row, &p) in self.order.iter().enumerate() {
            for q in self.constraints.neighbors(row) {
                sets.unite(p, q);
            }
        }
        sets.roots()
    }

    /// Tests whether the numbers of particles, tets and constraints are those of a solver.
    pub(super) fn fits(&self, solver: &Solver<R>) -> bool {
        self.order.len() == solver.particle_count()
            && self.corners.len() == solver.tet_count()
            && self.constraints.fits(solver)
    }
}

impl<R: Float> Solver<R> {
    /// Returns the tets, distances and volume constraints of each particle. Particle p is constraint p of the result;
    /// its particles are the tets, then the distances, then the volume constraints. Color and schedule this for
    /// [`VertexStars`](crate::VertexStars): particles of one color share none of them. O(tets + constraints).
    ///
    /// # Panics
    /// With more than 2^30 tets.
    #[must_use]
    pub fn star_incidence(&self) -> Incidence {
        let mut offsets = vec![0u32; self.particle_count() + 1];
        self.each_element(|_, corners| {
            for &p in corners {
                offsets[p as usize + 1] += 1;
            }
        });
        for p in 0..self.particle_count() {
            offsets[p + 1] += offsets[p];
        }
        let mut next = offsets.clone();
        let mut elements = vec![0; offsets[self.particle_count()] as usize];
        let count = self.each_element(|element, corners| {
            for &p in corners {
                elements[next[p as usize] as usize] = element;
                next[p as usize] += 1;
            }
        });
        Incidence::new(count, offsets, elements).expect("the lists are sorted and in range")
    }

    /// Visits tets, distances and volumes with their number and their particles, each once; returns how many there are.
    /// Volumes that their schedule does not name (those of tets that a cut has removed) have none.
    fn each_element(&self, mut visit: impl FnMut(u32, &[u32])) -> usize {
        let mut number = 0u32;
        let mut visit = |corners: &[u32]| {
            let mut distinct = [0; 4];
            let mut count = 0;
            // An element that names a particle twice counts once.
            for &p in corners {
                if !distinct[..count].contains(&p) {
                    distinct[count] = p;
                    count += 1;
                }
            }
            visit(number, &distinct[..count]);
            number += 1;
        };
        for tet in &self.tets.list {
            visit(&tet.particles);
        }
        for distance in &self.constraints.distances.list {
            visit(&distance.particles());
        }
        let volumes = &self.constraints.volumes;
        let mut scheduled = vec![false; volumes.list.len()];
        for index in volumes.schedule.order() {
            scheduled[index as usize] = true;
        }
        for (volume, scheduled) in volumes.list.iter().zip(scheduled) {
            let particles = volume.particles();
            visit(if scheduled { &particles } else { &[] });
        }
        number as usize
    }
}
