//! [`Vbd`]: data of an island that is solved by VBD, and its update after a cut.
//!
//! VBD visits particles, so these have their own colors; tets, clusters and their colors are kept for reports and
//! renderers. After a cut particles keep their colors; only new ones, and those that now share a tet with one of their
//! color, are colored again. Cost after a cut: O(changed stars), and a copy of the others.

use incise_coloring::auto;
use incise_graph::{Clustering, ColorId, Coloring, Incidence, Schedule};
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Integrator, Real, Solver, StepReport, StepSettings,
    VbdReport, VertexStars,
};
use web_time::Instant;

use crate::report::{Milliseconds, milliseconds};
use crate::scene::SolverSpec;
use crate::{Error, method};

/// Aggregates of a body: factoring more of them would cost more than they gain. A few dozen let a slender body bend.
const AGGREGATES: usize = 24;

/// The size of an aggregate below which more of them gain nothing.
const SMALLEST: usize = 12;

/// Reduction of the residual of a correction by conjugate gradients. A smaller one costs more iterations and gains
/// little, because the forces change within a step.
const REDUCTION: f64 = 0.1;

/// Colors that cuts may add before all particles are colored again.
const MORE_COLORS: usize = 3;

/// The state of VBD beside that of the solver.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "save", serde(bound = ""))]
pub(crate) struct Vbd<R: Real> {
    stars: VertexStars<R>,
    /// Number of colors when all particles were colored.
    color_count: usize,
    /// Coarse correction, for two-level VBD.
    correction: Option<CoarseCorrection<R>>,
    /// Accuracy at which rounds end early.
    accuracy: Option<f64>,
    integrator: Integrator,
    /// Report of the last frame.
    pub(crate) last: VbdReport,
}

impl<R: Real> Vbd<R> {
    /// Colors the particles of a solver.
    pub(crate) fn new(solver: &Solver<R>, spec: &SolverSpec) -> Result<Self, Error> {
        let coloring = auto(&solver.star_incidence()).coloring;
        let stars = VertexStars::new(solver, &schedule(&coloring))?;
        let correction = spec
            .two_level
            .then(|| correction(&stars, solver))
            .transpose()?;
        Ok(Self {
            stars,
            color_count: coloring.color_count(),
            correction,
            accuracy: spec.accuracy,
            integrator: method::integrator(spec.integrator),
            last: VbdReport::default(),
        })
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> usize {
        self.stars.bytes() + self.correction.as_ref().map_or(0, CoarseCorrection::bytes)
    }

    /// Updates stars, colors and correction after tets of the solver have changed: those in `changed`, by their numbers
    /// now, if it is known which. Without it, and where [`VertexStars::update`] cannot follow, all are rebuilt.
    pub(crate) fn sync(
        &mut self,
        solver: &Solver<R>,
        changed: Option<&[u32]>,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let mut start = Instant::now();
        let is_updated = changed.is_some_and(|changed| self.stars.update(solver, changed));
        if !is_updated || self.stars.color_count() > self.color_count + MORE_COLORS {
            let incidence = solver.star_incidence();
            let mut coloring = recolor(&self.stars.coloring(), &incidence);
            if coloring.color_count() > self.color_count + MORE_COLORS {
                coloring = auto(&incidence).coloring;
                self.color_count = coloring.color_count();
            }
            ms.color += milliseconds(start.elapsed());
            start = Instant::now();
            self.stars
                .rebuild(solver, &incidence, &schedule(&coloring))?;
        }
        if let Some(correction) = &mut self.correction {
            correction.sync(&self.stars);
        }
        ms.schedule += milliseconds(start.elapsed());
        Ok(())
    }

    /// Compares stars, colors and the pattern of the correction with rebuilt ones.
    pub(crate) fn check(&self, solver: &Solver<R>) -> Result<(), incise_xpbd::XpbdError> {
        self.stars.check(solver)?;
        match &self.correction {
            Some(correction) => correction.check(&self.stars),
            None => Ok(()),
        }
    }

    /// Advances a solver by one frame.
    pub(crate) fn step(
        &mut self,
        solver: &mut Solver<R>,
        settings: &StepSettings,
        measure: bool,
    ) -> Result<StepReport, incise_xpbd::XpbdError> {
        let mut settings = method::vbd(settings);
        settings.accuracy = self.accuracy;
        settings.integrator = self.integrator;
        settings.measure = measure;
        self.last = match &mut self.correction {
            Some(correction) => solver.step_vbd_two_level(&mut self.stars, correction, &settings),
            None => solver.step_vbd(&mut self.stars, &settings),
        }?;
        Ok(StepReport {
            repaired: self.last.repaired,
            jittered: 0,
        })
    }
}

/// The particles in the order of their colors.
fn schedule(coloring: &Coloring) -> Schedule {
    Schedule::new(&Clustering::none(coloring.colors().len()), coloring)
}

/// Colors particles after a cut: those without a color and one of each pair that is in conflict get the smallest color
/// that is free. `incidence` is that of the stars, with particles as constraints on tets. O(pairs).
fn recolor(colors: &Coloring, incidence: &Incidence) -> Coloring {
    let mut colors: Vec<_> = colors.colors().iter().map(|color| Some(color.0)).collect();
    colors.resize(incidence.constraint_count(), None);
    for element in 0..incidence.particle_count() {
        let corners = incidence.constraints_of(element);
        for (k, &p) in corners.iter().enumerate() {
            let color = colors[p as usize];
            let meets = |&q: &u32| color.is_some() && colors[q as usize] == color;
            if corners[..k].iter().any(meets) {
                colors[p as usize] = None;
            }
        }
    }
    let mut taken = Vec::new();
    for p in 0..colors.len() {
        if colors[p].is_some() {
            continue;
        }
        taken.clear();
        for &element in incidence.particles_of(p) {
            let corners = incidence.constraints_of(element as usize).iter();
            taken.extend(corners.filter_map(|&q| colors[q as usize]));
        }
        colors[p] = (0..).find(|color| !taken.contains(color));
    }
    Coloring::new(colors.iter().map(|c| ColorId(c.unwrap_or(0))).collect())
}

fn correction<R: Real>(
    stars: &VertexStars<R>,
    solver: &Solver<R>,
) -> Result<CoarseCorrection<R>, Error> {
    let settings = CoarseCorrectionSettings {
        aggregate: (solver.particle_count() / AGGREGATES).max(SMALLEST),
        reduction: REDUCTION,
        ..CoarseCorrectionSettings::default()
    };
    CoarseCorrection::new(stars, settings).map_err(Error::xpbd("solver"))
}
