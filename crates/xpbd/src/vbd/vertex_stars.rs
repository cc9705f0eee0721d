//! [`VertexStars`]: the state of VBD beside that of the solver.
//!
//! It consists of the stars of all particles ([`StarData`]) and what VBD remembers from one substep to the next.

use incise_graph::{Coloring, GraphError, Incidence, Schedule};

use super::history::History;
use super::stars::StarData;
use super::viscosity::Viscosity;
use crate::{Float, Solver, XpbdError};

/// The tets around each particle, sorted by the particles of a schedule, for VBD.
///
/// Valid for the tets, distances and volume constraints of the solver when it was created. After a cut, or any other
/// change of these, update it with [`VertexStars::rebuild`]. Positions, velocities, masses, attachments and fixed
/// particles may change at any time.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct VertexStars<R: Float> {
    pub(super) data: StarData<R>,
    /// Velocities a substep ago, kept only for [`super::Guess::Adaptive`].
    pub(super) earlier: Vec<R::Vector>,
    /// Whether a start nearer to the last positions may save work: since a step was not calm, until such a start does
    /// not help.
    pub(super) try_start: bool,
    /// The smallest particle of each particle's connected part of the body, if known.
    pub(super) parts: Vec<u32>,
    /// Kept only for [`super::Integrator::Bdf2`].
    pub(super) history: History<R>,
    /// Created by the first substep in which a material is damped.
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
            data: StarData::default(),
            earlier: Vec::new(),
            try_start: true,
            parts: Vec::new(),
            history: History::default(),
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
        self.data.rebuild(solver, incidence, schedule)?;
        self.parts.clear();
        self.try_start = true;
        self.viscosity = None;
        Ok(())
    }

    /// Updates the stars after a cut that has changed or appended the tets `changed`, by their numbers now, and removed
    /// those from the present number on. Particles keep their colors; new ones, and those that now share a tet with one
    /// of their color, get the smallest color that is free.
    ///
    /// Returns false, and has changed nothing, if the stars must be rebuilt: with distances or volumes, with fewer
    /// particles than before, or if tets were appended that `changed` does not name.
    ///
    /// Deterministic. Cost: O(changed stars), and a copy of the rest.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{Material, Solver, VertexStars};
    ///
    /// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
    /// let mut solver = Solver::<f64>::new(&rest);
    /// solver.add_material(Material { young_modulus: 1e5, poisson_ratio: 0.3, density: 1e3, damping: 0.0 })?;
    /// solver.push_tet([0, 1, 2, 3], [rest[0], rest[1], rest[2], rest[3]], 0);
    /// let colors = Coloring::new([0, 1, 2, 3, 0].map(ColorId).to_vec());
    /// let mut stars = VertexStars::new(&solver, &Schedule::new(&Clustering::none(5), &colors))?;
    /// solver.push_tet([1, 4, 2, 3], [rest[1], rest[4], rest[2], rest[3]], 0);
    /// assert!(stars.update(&solver, &[1]));
    /// assert_eq!(stars.pair_count(), 8);
    /// stars.check(&solver)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn update(&mut self, solver: &Solver<R>, changed: &[u32]) -> bool {
        if !self.data.update(solver, changed) {
            return false;
        }
        self.parts.clear();
        self.try_start = true;
        self.viscosity = None;
        true
    }

    /// Compares the stars with those rebuilt from the tets with the colors at hand, to the bit. O(tets).
    ///
    /// # Errors
    /// [`XpbdError::Layout`] names the first difference, [`XpbdError::Schedule`] particles of one color in a tet.
    pub fn check(&self, solver: &Solver<R>) -> Result<(), XpbdError> {
        self.data.check(solver)
    }

    /// Returns the bytes of all arrays. O(1).
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.data.bytes()
            + size_of_val(&*self.earlier)
            + size_of_val(&*self.parts)
            + self.history.bytes()
            + self.viscosity.as_ref().map_or(0, |v| v.bytes())
    }

    /// Returns the number of colors.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.data.colors.len() - 1
    }

    /// Returns the color of each particle. O(particles).
    #[must_use]
    pub fn coloring(&self) -> Coloring {
        self.data.coloring()
    }

    /// Returns the number of pairs of a particle and one of its tets, to which the cost of a sweep is proportional.
    #[must_use]
    pub fn pair_count(&self) -> usize {
        self.data.terms.len()
    }

    /// The smallest particle of each particle's connected part of the body. O(tets) once after a change of the stars.
    pub(super) fn parts(&mut self, solver: &Solver<R>) -> &[u32] {
        if self.parts.len() != self.data.order.len() {
            self.parts = self.data.parts(solver);
        }
        &self.parts
    }

    /// Prepares constraints and viscosity, which are constant in a substep.
    pub(super) fn begin(&mut self, solver: &Solver<R>, time: f64, penalty: f64) {
        self.data.constraints.begin(solver, time, penalty);
        if !solver.tets.is_damped() {
            self.viscosity = None;
            return;
        }
        let viscosity = self.viscosity.take();
        let mut viscosity = viscosity.unwrap_or_else(|| Box::new(Viscosity::new(&self.data)));
        viscosity.fill(solver, &self.data, time);
        self.viscosity = Some(viscosity);
    }
}
