//! `solver.budget_ms`: chooses substeps and method for a time budget of a frame.
//!
//! Copies of the solvers run a few frames to measure the cost of a substep of Gauss-Seidel and of a frame of two-level
//! VBD. All islands together may use [`SHARE`] of the budget, each in proportion to the cost of its accuracy. The
//! search for contacts is measured, too: it comes once a frame, whatever the substeps. Without a stated accuracy the rest buys more substeps. After cuts the cost grows with the number of tets, and substeps are
//! reduced if they no longer fit. The choice depends on measured times, so results differ from run to run. Cost: a few
//! frames at the start.

use incise_xpbd::StepSettings;
use web_time::Instant;

use crate::Error;
use crate::backend::AnySolver;
use crate::compute_device::ComputeDevice;
use crate::island::{Budget, Island, adopt};
use crate::island_builder::demands;
use crate::method::{tet_solve, with_vbd};
use crate::report::{Milliseconds, milliseconds};
use crate::scene::SolverSpec;
use crate::substeps::{Shortfall, choose};

/// The part of the budget that solving may take; the rest is for cuts, positions and reports.
const SHARE: f64 = 0.75;

/// The expected error below which more substeps are of no use.
const FINEST: f64 = 0.01;

/// Frames that are measured after a first one, of which the fastest counts.
const FRAMES: u32 = 3;

/// Finds the contacts of a copy of an island at its present positions, hands them to a copy of its solver, and tells the
/// milliseconds of a frame that takes; none without contact.
fn detect(island: &Island, solver: &mut AnySolver) -> Result<f64, Error> {
    let Some(mut contacts) = island.constraints.contacts.clone() else {
        return Ok(0.0);
    };
    let Island {
        cuttable,
        pieces,
        settings,
        ..
    } = island;
    let (time, mut fastest) = (settings.time_step, f64::INFINITY);
    for frame in 0..=FRAMES {
        // Bodies that move are searched for in nearly all frames.
        contacts.search_again();
        contacts.begin_frame(solver, cuttable, pieces, time, settings.substeps);
        contacts.update(solver, cuttable, pieces, 0, time)?;
        if frame > 0 {
            fastest = fastest.min(contacts.take_milliseconds());
        }
    }
    Ok(fastest)
}

/// Milliseconds of a frame of a copy of an island's solver with some settings, the search for contacts left out.
fn measure(island: &Island, spec: &SolverSpec, settings: &StepSettings) -> Result<f64, Error> {
    let mut solver = island.solver.clone();
    solver.backend_mut().end_vbd();
    detect(island, &mut solver)?;
    solver.prepare(spec, &ComputeDevice::default())?;
    let (backend, schedule) = (solver.backend_mut(), &island.partition.schedule);
    backend.lay_out(schedule, &mut Milliseconds::default())?;
    let mut fastest = f64::INFINITY;
    for frame in 0..=FRAMES {
        let start = Instant::now();
        backend.step(schedule, settings, 0..settings.substeps, false)?;
        if frame > 0 {
            fastest = fastest.min(milliseconds(start.elapsed()));
        }
    }
    Ok(fastest)
}

/// Fits the substeps of all islands that leave them open into a budget in milliseconds.
pub(crate) fn fit(islands: &mut [Island], spec: &SolverSpec, budget: f64) -> Result<(), Error> {
    // A frame of each island, and of one substep, as chosen by accuracy.
    let mut costs = Vec::with_capacity(islands.len());
    for island in islands.iter() {
        let settings = &island.settings;
        let few = StepSettings {
            substeps: settings.substeps.min(4),
            ..settings.clone()
        };
        let of_one = measure(island, &island.spec, &few)? / f64::from(few.substeps);
        costs.push((of_one, of_one * f64::from(settings.substeps)));
    }
    // A number that a scene names, of a joined body too, stays, and so does VBD.
    let open = |island: &Island| island.judged.leaves_substeps_open && !island.chose_vbd();
    let of = |wanted: bool| -> f64 {
        let each = islands.iter().zip(&costs);
        let those = each.filter(|(island, _)| open(island) == wanted);
        those.map(|(_, cost)| cost.1).sum()
    };
    let mut detection = 0.0;
    for island in islands.iter() {
        detection += detect(island, &mut island.solver.clone())?;
    }
    let factor = (SHARE * budget - detection - of(false)).max(0.0) / of(true);
    for (island, (of_one, whole_cost)) in islands.iter_mut().zip(costs) {
        if !open(island) {
            continue;
        }
        let limits = Budget {
            per_tet: of_one / island.cuttable.mesh().tets.len().max(1) as f64,
            share: whole_cost * factor,
        };
        island.judged.budget = Some(limits);
        let most = limits
            .most(island.cuttable.mesh().tets.len())
            .min(spec.max_substeps);
        let needed = island.settings.substeps;
        let finest = finest_substeps(island, spec);
        let substeps = match spec.accuracy {
            Some(_) => needed.min(most),
            None => most.min(finest.max(needed)),
        };
        island.take_substeps(substeps);
        let missed = island
            .judged
            .choice
            .is_some_and(|choice| choice.shortfall == Some(Shortfall::Budget));
        if missed && island.judged.leaves_method_open {
            try_vbd(island, spec, limits.share)?;
        }
        island.judge_settings();
    }
    Ok(())
}

/// The substeps for [`FINEST`].
fn finest_substeps(island: &Island, spec: &SolverSpec) -> u32 {
    let finest = SolverSpec {
        accuracy: Some(FINEST),
        ..spec.clone()
    };
    let tets = demands(&finest, &island.solver, island.cuttable.mesh(), |_| true);
    choose(tets, spec.max_substeps, tet_solve(spec.tet_solve)).substeps
}

/// Two-level VBD in place of too few substeps, if a frame of it fits and promises a smaller error.
fn try_vbd(island: &mut Island, spec: &SolverSpec, share: f64) -> Result<(), Error> {
    let Some(choice) = island.judged.choice else {
        return Ok(());
    };
    let (own, chosen) = with_vbd(spec, choice);
    if choice.expected_error <= chosen.expected_error {
        return Ok(());
    }
    let mut settings = island.settings.clone();
    adopt(&mut settings, &own);
    if measure(island, &own, &settings)? > share {
        return Ok(());
    }
    island.solver.backend_mut().end_vbd();
    island.solver.prepare(&own, &ComputeDevice::default())?;
    island.settings = settings;
    island.judged.choice = Some(chosen);
    island.spec = own;
    island.judged.budget = None;
    Ok(())
}
