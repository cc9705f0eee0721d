//! [`VertexStars`]: the tets around each particle, in the order in which VBD visits them.
//!
//! Particles that share a tet must not move at the same time. So particles play the part that constraints play in
//! XPBD: each is a constraint on its tets ([`Solver::star_incidence`]), any coloring algorithm colors them, and a
//! schedule lists them. A tet has four particles, so there are at least 4 colors; on tet meshes there are 6 to 10, a
//! fifth of what the tets themselves need. Cost: 32 bytes a tet and corner in single precision, 56 in double, read once
//! a sweep from front to back.

use incise_graph::{DisjointSets, GraphError, Incidence, Schedule};

use super::constraints::ConstraintTerms;
use super::corner_term::CornerTerm;
use super::history::History;
use super::viscosity::Viscosity;
use crate::constraints::ScalarConstraint;
use crate::{Float, Solver};

/// The tets around each particle, sorted by the particles of a schedule, for VBD.
///
/// Valid for the tets, distances and volume constraints of the solver when it was created. After a cut, or any other
/// change of these, update it with [`VertexStars::rebuild`]. Positions, velocities, masses, attachments and fixed
/// particles may change at any time.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct VertexStars<R: Float> {
    /// Particles in solving order.
    pub(super) order: Vec<u32>,
    /// Where each color ends in `order`, a 0 before the first.
    pub(super) colors: Vec<usize>,
    /// Where the terms of each particle of `order` end, a 0 before the first.
    pub(super) offsets: Vec<usize>,
    pub(super) terms: Vec<CornerTerm<R>>,
    /// The tet of each term.
    pub(super) tets: Vec<u32>,
    pub(super) tet_count: usize,
    /// The edge of a cube that holds the mean tet at rest, in m: what is small beside it is nothing.
    pub(super) size: f64,
    /// Velocities a substep ago, kept only for [`super::Guess::Adaptive`].
    pub(super) earlier: Vec<R::Vector>,
    /// Whether a start nearer to the last positions may save work: since a step was not calm, until such a start does
    /// not help.
    pub(super) try_start: bool,
    /// The smallest particle of each particle's connected part of the body, if known.
    pub(super) parts: Vec<u32>,
    /// Kept only for [`super::Integrator::Bdf2`].
    pub(super) history: History<R>,
    /// Distances, volumes and attachments.
    pub(super) constraints: ConstraintTerms<R>,
    /// Made by the first substep in which a material is damped.
    pub(super) viscosity: Option<Box<Viscosity<R>>>,
}

impl<R: Float> VertexStars<R> {
    /// Sorts the tets of a solver by the particles of a schedule. O(tets).
    ///
    /// # Errors
    /// If the schedule does not list every particle once, or has particles of one tet in one color
    /// ([`Schedule::check`] on [`Solver::star_incidence`]).
    pub fn new(solver: &Solver<R>, schedule: &Schedule) -> Result<Self, GraphError> {
        let mut stars = Self {
            order: Vec::new(),
            colors: Vec::new(),
            offsets: Vec::new(),
            terms: Vec::new(),
            tets: Vec::new(),
            tet_count: 0,
            size: 0.0,
            earlier: Vec::new(),
            try_start: true,
            parts: Vec::new(),
            history: History::default(),
            constraints: ConstraintTerms::default(),
            viscosity: None,
        };
        stars.rebuild(solver, &solver.star_incidence(), schedule)?;
        Ok(stars)
    }

    /// Rebuilds the stars in place after tets have changed, given the [`Solver::star_incidence`] of the present tets,
    /// and reuses memory. O(tets).
    ///
    /// # Errors
    /// Those of [`VertexStars::new`]; nothing has changed then.
    pub fn rebuild(
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
        self.terms.clear();
        self.tets.clear();
        for p in schedule.order() {
            for &t in incidence.particles_of(p as usize) {
                // What comes after the tets are distances and volumes.
                let Some(tet) = solver.tets.list.get(t as usize) else {
                    break;
                };
                let tet = tet.to_f64();
                let corner = tet.particles.iter().position(|&corner| corner == p);
                if let Some(term) = corner.and_then(|corner| CornerTerm::new(&tet, corner)) {
                    self.terms.push(term);
                    self.tets.push(t);
                }
            }
            self.offsets.push(self.terms.len());
        }
        self.tet_count = solver.tet_count();
        let volume = solver.tets.rest_volumes.iter().sum::<f64>();
        self.size = (6.0 * volume / self.tet_count.max(1) as f64)
            .max(0.0)
            .cbrt();
        self.parts.clear();
        self.try_start = true;
        self.constraints.rebuild(solver, &self.order, incidence);
        self.viscosity = None;
        Ok(())
    }

    /// Returns the bytes of all arrays. O(1).
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.order)
            + size_of_val(&*self.colors)
            + size_of_val(&*self.offsets)
            + size_of_val(&*self.terms)
            + size_of_val(&*self.tets)
            + size_of_val(&*self.earlier)
            + size_of_val(&*self.parts)
            + self.history.bytes()
            + self.constraints.bytes()
            + self.viscosity.as_ref().map_or(0, |v| v.bytes())
    }

    /// Returns the number of colors.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.colors.len() - 1
    }

    /// Returns the number of pairs of a particle and one of its tets, to which the cost of a sweep is proportional.
    #[must_use]
    pub fn pair_count(&self) -> usize {
        self.terms.len()
    }

    /// The terms of the particle at a place in the order.
    #[inline]
    pub(super) fn of(&self, place: usize) -> &[CornerTerm<R>] {
        &self.terms[self.offsets[place]..self.offsets[place + 1]]
    }

    /// The smallest particle of each particle's connected part of the body. O(tets), but nothing while the stars stay
    /// the same.
    pub(super) fn parts(&mut self, solver: &Solver<R>) -> &[u32] {
        if self.parts.len() != self.order.len() {
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
            self.parts = sets.roots();
        }
        &self.parts
    }

    /// Whether these are the stars of as many particles, tets and constraints.
    pub(super) fn fits(&self, solver: &Solver<R>) -> bool {
        self.order.len() == solver.particle_count()
            && self.tet_count == solver.tet_count()
            && self.constraints.fits(solver)
    }

    /// Prepares what is constant in a substep: constraints and viscosity.
    pub(super) fn begin(&mut self, solver: &Solver<R>, time: f64, penalty: f64) {
        self.constraints.begin(solver, time, penalty);
        if !solver.tets.is_damped() {
            self.viscosity = None;
            return;
        }
        let viscosity = self.viscosity.take();
        let mut viscosity = viscosity.unwrap_or_else(|| Box::new(Viscosity::new(self)));
        viscosity.fill(solver, self, time);
        self.viscosity = Some(viscosity);
    }
}

impl<R: Float> Solver<R> {
    /// Returns the tets, distances and volume constraints of each particle. Particle p is constraint p of the result;
    /// its particles are the tets, then the distances, then the volume constraints. Color and schedule this for
    /// [`VertexStars`]: particles of one color share none of them. O(tets + constraints).
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
