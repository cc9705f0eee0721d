//! [`VertexStars`]: the state of VBD beside that of the solver.
//!
//! It consists of the stars of all particles ([`StarData`]) and what VBD remembers from one substep to the next.

use incise_graph::{GraphError, Incidence, Schedule};

use super::history::History;
use super::stars::StarData;
use super::viscosity::Viscosity;
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
