//! Common code of the tables of motion: a body and its method, advanced frame by frame.

use incise::graph::Schedule;
use incise::mesh::TetMesh;
use incise::xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Real, Solver, StepSettings, VbdSettings,
    VertexStars,
};

use super::body::{schedule, stars};

/// A method with its settings.
#[derive(Clone, Debug)]
pub(crate) enum Recipe {
    Xpbd {
        clustering: &'static str,
        settings: StepSettings,
    },
    Vbd(VbdSettings),
    /// VBD with a coarse correction after each sweep.
    Corrected(VbdSettings),
}

/// A body advanced by a recipe.
pub(crate) struct Runner<R: Real> {
    pub(crate) solver: Solver<R>,
    recipe: Recipe,
    tools: Tools<R>,
}

/// Precomputed data of a recipe.
enum Tools<R: Real> {
    Schedule(Schedule),
    VertexStars(Box<VertexStars<R>>, Option<Box<CoarseCorrection<R>>>),
}

impl<R: Real> Runner<R> {
    pub(crate) fn new(solver: Solver<R>, mesh: &TetMesh, recipe: &Recipe) -> anyhow::Result<Self> {
        let tools = match recipe {
            Recipe::Xpbd { clustering, .. } => Tools::Schedule(schedule(mesh, clustering)?),
            Recipe::Vbd(_) => Tools::VertexStars(Box::new(stars(&solver)?), None),
            Recipe::Corrected(_) => {
                let stars = stars(&solver)?;
                let correction =
                    CoarseCorrection::new(&stars, CoarseCorrectionSettings::default())?;
                Tools::VertexStars(Box::new(stars), Some(Box::new(correction)))
            }
        };
        Ok(Self {
            solver,
            recipe: recipe.clone(),
            tools,
        })
    }

    /// Advances by a frame; returns the number of particles reset because they were not finite.
    pub(crate) fn frame(&mut self) -> anyhow::Result<usize> {
        let (solver, recipe) = (&mut self.solver, &self.recipe);
        let repaired = match (recipe, &mut self.tools) {
            (Recipe::Xpbd { settings, .. }, Tools::Schedule(schedule)) => {
                solver.step(schedule, settings)?.repaired
            }
            (
                Recipe::Vbd(settings) | Recipe::Corrected(settings),
                Tools::VertexStars(stars, correction),
            ) => match correction {
                Some(correction) => {
                    solver
                        .step_vbd_two_level(stars, correction, settings)?
                        .repaired
                }
                None => solver.step_vbd(stars, settings)?.repaired,
            },
            _ => unreachable!("the tools are made for the recipe"),
        };
        Ok(repaired)
    }
}
