//! `solver.budget_ms`: substeps and method from the time that a frame may take.
//!
//! Copies of the solvers take a few frames, which tells what a substep of Gauss-Seidel and a frame of two-level VBD cost
//! here. All groups together may use [`SHARE`] of the budget; what each gets goes with what its accuracy needs. Without a
//! stated accuracy what is left over buys more substeps. After cuts the cost grows with the number of tets, and substeps
//! are reduced where they no longer fit. The choice depends on the speed of the machine, unlike everything else here:
//! results differ from run to run. Cost: a few frames at the start.

use std::time::Instant;

use incise_xpbd::StepSettings;

use crate::Error;
use crate::group::{Budget, Group, adopt};
use crate::joined::demands;
use crate::method::{tet_solve, with_vbd};
use crate::place::Place;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::SolverSpec;
use crate::substeps::{Missed, choose};

/// The part of the budget that solving may take; the rest is for cuts, positions and reports.
const SHARE: f64 = 0.75;

/// The expected error below which more substeps are of no use.
const FINEST: f64 = 0.01;

/// Frames that are measured after a first one, of which the fastest counts.
const FRAMES: u32 = 3;

/// Milliseconds of a frame of a copy of a group's solver with some settings.
fn measure(group: &Group, spec: &SolverSpec, settings: &StepSettings) -> Result<f64, Error> {
    let mut solver = group.solver.clone();
    solver.end_vbd();
    solver.prepare(spec, &Place::default())?;
    solver.lay_out(&group.plan.schedule, &mut Milliseconds::default())?;
    let mut fastest = f64::INFINITY;
    for frame in 0..=FRAMES {
        let start = Instant::now();
        solver.step(&group.plan.schedule, settings, false)?;
        if frame > 0 {
            fastest = fastest.min(milliseconds(start.elapsed()));
        }
    }
    Ok(fastest)
}

/// Fits the substeps of all groups that leave them open into a budget in milliseconds.
pub(crate) fn fit(groups: &mut [Group], spec: &SolverSpec, budget: f64) -> Result<(), Error> {
    // A frame of each group, and of one substep, as chosen by accuracy.
    let mut costs = Vec::with_capacity(groups.len());
    for group in groups.iter() {
        let settings = &group.settings;
        let few = StepSettings {
            substeps: settings.substeps.min(4),
            ..settings.clone()
        };
        let of_one = measure(group, &group.spec, &few)? / f64::from(few.substeps);
        costs.push((of_one, of_one * f64::from(settings.substeps)));
    }
    // A number that a scene names, of a joined body too, stays, and so does VBD.
    let open = |group: &Group| group.leaves_substeps_open && !group.chose_vbd();
    let of = |wanted: bool| -> f64 {
        let each = groups.iter().zip(&costs);
        let those = each.filter(|(group, _)| open(group) == wanted);
        those.map(|(_, cost)| cost.1).sum()
    };
    let factor = (SHARE * budget - of(false)).max(0.0) / of(true);
    for (group, (of_one, whole_cost)) in groups.iter_mut().zip(costs) {
        if !open(group) {
            continue;
        }
        let limits = Budget {
            per_tet: of_one / group.cuttable.mesh().tets.len().max(1) as f64,
            share: whole_cost * factor,
        };
        group.budget = Some(limits);
        let most = limits
            .most(group.cuttable.mesh().tets.len())
            .min(spec.max_substeps);
        let needed = group.settings.substeps;
        let finest = finest_substeps(group, spec);
        let substeps = match spec.accuracy {
            Some(_) => needed.min(most),
            None => most.min(finest.max(needed)),
        };
        group.take_substeps(substeps);
        let missed = group
            .choice
            .is_some_and(|choice| choice.missed == Some(Missed::Budget));
        if missed && group.leaves_method_open {
            try_vbd(group, spec, limits.share)?;
        }
        group.judge_settings();
    }
    Ok(())
}

/// The substeps for [`FINEST`].
fn finest_substeps(group: &Group, spec: &SolverSpec) -> u32 {
    let finest = SolverSpec {
        accuracy: Some(FINEST),
        ..spec.clone()
    };
    let tets = demands(&finest, &group.solver, group.cuttable.mesh(), |_| true);
    choose(tets, spec.max_substeps, tet_solve(spec.tet_solve)).substeps
}

/// Two-level VBD in place of too few substeps, if a frame of it fits and promises a smaller error.
fn try_vbd(group: &mut Group, spec: &SolverSpec, share: f64) -> Result<(), Error> {
    let Some(choice) = group.choice else {
        return Ok(());
    };
    let (own, chosen) = with_vbd(spec, choice);
    if choice.expected_error <= chosen.expected_error {
        return Ok(());
    }
    let mut settings = group.settings.clone();
    adopt(&mut settings, &own);
    if measure(group, &own, &settings)? > share {
        return Ok(());
    }
    group.solver.end_vbd();
    group.solver.prepare(&own, &Place::default())?;
    group.settings = settings;
    group.choice = Some(chosen);
    group.spec = own;
    group.budget = None;
    Ok(())
}
