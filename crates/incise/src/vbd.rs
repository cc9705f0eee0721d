//! [`Vbd`]: data of an island that is solved by VBD, and its update after a cut.
//!
//! VBD visits particles, so these have their own colors; tets, clusters and their colors are kept for reports and
//! renderers. After a cut particles keep their colors; only new ones, and those that now share a tet with one of their
//! color, are colored again. Cost: O(tets) after each cut, since the stars of all particles are rebuilt and all tets
//! are checked.

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
    /// The color of each particle, and how many there were when all were colored.
    colors: Vec<Option<u32>>,
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
            colors: numbers(&coloring),
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

    /// Updates stars, colors and correction after the solver has applied a cut.
    pub(crate) fn sync(&mut self, solver: &Solver<R>, ms: &mut Milliseconds) -> Result<(), Error> {
        let start = Instant::now();
        let incidence = solver.star_incidence();
        let mut coloring = recolor(&mut self.colors, &incidence);
        if coloring.color_count() > self.color_count + MORE_COLORS {
            coloring = auto(&incidence).coloring;
            self.colors = numbers(&coloring);
            self.color_count = coloring.color_count();
        }
        let schedule = schedule(&coloring);
        ms.color += milliseconds(start.elapsed());
        let start = Instant::now();
        self.stars.rebuild(solver, &incidence, &schedule)?;
        if let Some(correction) = &mut self.correction {
            correction.sync(&self.stars);
        }
        ms.schedule += milliseconds(start.elapsed());
        Ok(())
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

/// The number of each color.
fn numbers(coloring: &Coloring) -> Vec<Option<u32>> {
    coloring
        .colors()
        .iter()
        .map(|color| Some(color.0))
        .collect()
}

/// Colors particles after a cut: those without a color and one of each pair that is in conflict get the smallest color
/// that is free. `incidence` is that of the stars, with particles as constraints on tets. O(pairs).
fn recolor(colors: &mut Vec<Option<u32>>, incidence: &Incidence) -> Coloring {
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
    CoarseCorrection::new(stars, settings).map_err(|source| Error::Xpbd {
        field: "solver".into(),
        source,
    })
}
