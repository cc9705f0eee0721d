//! [`VBD`]: what a group that is solved by VBD keeps, and how it follows a cut.
//!
//! VBD visits particles, so these have colors of their own; tets, clusters and their colors stay as they are for
//! everybody who asks for them. Cost: O(tets) after each cut, as the stars of all particles are sorted anew.

use std::time::Instant;

use incise_coloring::auto;
use incise_graph::{Clustering, Schedule};
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Real, Solver, StepReport, StepSettings, VbdReport,
    VertexStars,
};

use crate::report::{Milliseconds, milliseconds};
use crate::{Error, method};

/// Aggregates of a large body: factoring more of them would cost more than they gain.
const AGGREGATES: usize = 50;

/// The state of VBD beside that of the solver.
#[derive(Clone, Debug)]
pub(crate) struct Vbd<R: Real> {
    stars: VertexStars<R>,
    /// Where corrections are asked for.
    correction: Option<CoarseCorrection<R>>,
    /// What the last frame said of itself.
    pub(crate) last: VbdReport,
}

impl<R: Real> Vbd<R> {
    /// Colors the particles of a solver; `two_level` asks for the coarse correction.
    pub(crate) fn new(solver: &Solver<R>, two_level: bool) -> Result<Self, Error> {
        let stars = VertexStars::new(solver, &schedule(solver, &mut Milliseconds::default()))?;
        let correction = two_level.then(|| correction(&stars, solver)).transpose()?;
        Ok(Self {
            stars,
            correction,
            last: VbdReport::default(),
        })
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> usize {
        self.stars.bytes() + self.correction.as_ref().map_or(0, CoarseCorrection::bytes)
    }

    /// Follows a cut, after the solver has.
    pub(crate) fn follow(
        &mut self,
        solver: &Solver<R>,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let schedule = schedule(solver, ms);
        let start = Instant::now();
        self.stars.rebuild(solver, &schedule)?;
        if let Some(old) = &mut self.correction {
            *old = correction(&self.stars, solver)?;
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
        settings.measure = measure;
        self.last = match &mut self.correction {
            Some(correction) => solver.step_vbd_two_level(&mut self.stars, correction, &settings),
            None => solver.step_vbd(&mut self.stars, &settings),
        }?;
        Ok(StepReport {
            repaired: self.last.repaired,
            unfolded: 0,
        })
    }
}

/// The particles in the order of their colors.
fn schedule<R: Real>(solver: &Solver<R>, ms: &mut Milliseconds) -> Schedule {
    let start = Instant::now();
    let coloring = auto(&solver.star_incidence()).coloring;
    ms.color += milliseconds(start.elapsed());
    Schedule::new(&Clustering::none(solver.particle_count()), &coloring)
}

fn correction<R: Real>(
    stars: &VertexStars<R>,
    solver: &Solver<R>,
) -> Result<CoarseCorrection<R>, Error> {
    let small = CoarseCorrectionSettings::default();
    let settings = CoarseCorrectionSettings {
        aggregate: small.aggregate.max(solver.particle_count() / AGGREGATES),
        ..small
    };
    CoarseCorrection::new(stars, settings).map_err(|source| Error::Xpbd {
        field: "solver".into(),
        source,
    })
}
