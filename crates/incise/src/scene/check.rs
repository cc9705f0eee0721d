//! [`check`]: checks ranges of settings that do not depend on meshes.

use super::Scene;
use crate::Error;
use crate::validate::{value, within};

/// Checks the ranges of solver settings, without looking at bodies.
pub(crate) fn check(scene: &Scene) -> Result<(), Error> {
    if let Some(accuracy) = scene.solver.accuracy
        && !(accuracy > 0.0 && accuracy <= 1.0)
    {
        return Err(value("solver.accuracy", accuracy, "above 0 and at most 1"));
    }
    if let Some(budget) = scene.solver.budget_ms
        && !(budget.is_finite() && budget > 0.0)
    {
        return Err(value("solver.budget_ms", budget, "positive and finite"));
    }
    let kappa = scene.solver.kappa_limit;
    if kappa.is_nan() || kappa <= 0.0 {
        return Err(value("solver.kappa_limit", kappa, "positive"));
    }
    if scene.solver.max_substeps == 0 {
        return Err(value("solver.max_substeps", 0, "at least 1"));
    }
    if let Some(recluster) = scene.solver.recluster {
        let threshold = recluster.threshold;
        // The first cut would exceed a threshold of 1.
        if !(threshold.is_finite() && threshold > 1.0) {
            return Err(value(
                "solver.recluster.threshold",
                threshold,
                "above 1 and finite",
            ));
        }
    }
    if let Some(sleep) = scene.solver.sleep {
        for (key, number) in [("speed", sleep.speed), ("time", sleep.time)] {
            if !(number.is_finite() && number > 0.0) {
                return Err(value(
                    format!("solver.sleep.{key}"),
                    number,
                    "positive and finite",
                ));
            }
        }
    }
    within("cutting.crumbs", scene.cutting.crumbs, 0.0, 100.0)?;
    Ok(())
}
