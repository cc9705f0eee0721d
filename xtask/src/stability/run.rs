//! Runs a body through an extreme and monitors it after every frame.

use std::sync::Arc;

use anyhow::Context;
use incise::gpu::{ClusterMapping, GpuContext, GpuSolver};
use incise::mesh::glam::DVec3;
use incise::xpbd::{Real, Solver};

use super::cuts;
use super::extremes::Extreme;
use super::methods::{Column, Precision};
use super::outcome::{Outcome, VOLUME_TOLERANCE};
use super::rigid;
use crate::solver::body::schedule;
use crate::solver::runner::{Recipe, Runner};

/// Runs the body of an extreme in a column; columns on a device need one.
pub(crate) fn run(
    extreme: &Extreme,
    column: Column,
    gpu: Option<&Arc<GpuContext>>,
) -> anyhow::Result<Outcome> {
    match (gpu.filter(|_| column.gpu), column.precision) {
        (Some(gpu), _) => on_device(extreme, column, gpu),
        (None, Precision::Auto) => simulate(extreme, column),
        (None, Precision::F32) => on_processor::<f32>(extreme, column),
        (None, Precision::F64) => on_processor::<f64>(extreme, column),
    }
}

/// Runs it as a simulation, which selects method, substeps and precision.
fn simulate(extreme: &Extreme, column: Column) -> anyhow::Result<Outcome> {
    let mut simulation = match extreme.simulation(column.method.spec(column)) {
        Ok(simulation) => simulation,
        Err(error) => {
            return Ok(Outcome {
                refused: Some(error.to_string()),
                ..Outcome::new(column)
            });
        }
    };
    let start = simulation.positions().to_vec();
    let mut watch = cuts::Watch::new(column, extreme.work());
    watch.outcome.frozen = true;
    for _ in 0..extreme.frames() {
        simulation.step().context("the default settings")?;
        watch.outcome.frozen &= simulation.positions() == start;
        if !watch.look(&simulation)? {
            break;
        }
    }
    Ok(watch.outcome)
}

fn on_processor<R: Real>(extreme: &Extreme, column: Column) -> anyhow::Result<Outcome> {
    let (solver, recipe, mut watch) = start::<R>(extreme, column)?;
    let mut runner = Runner::new(solver, &extreme.mesh, &recipe)?;
    for _ in 0..extreme.frames() {
        let repaired = runner.frame()?;
        if !watch.look(&runner.solver, repaired) {
            break;
        }
    }
    Ok(watch.outcome)
}

fn on_device(extreme: &Extreme, column: Column, gpu: &Arc<GpuContext>) -> anyhow::Result<Outcome> {
    let (solver, recipe, mut watch) = start::<f32>(extreme, column)?;
    let Recipe::Xpbd {
        clustering,
        settings,
    } = recipe
    else {
        anyhow::bail!("{} does not run on a device", column.method.name());
    };
    let schedule = schedule(&extreme.mesh, clustering)?;
    let mut body = GpuSolver::new(gpu.clone(), solver, ClusterMapping::Threads)?;
    let mut before = 0;
    for _ in 0..extreme.frames() {
        body.step(&schedule, &settings)?;
        body.host()?;
        let repaired = (body.repaired() - before) as usize;
        before = body.repaired();
        if !watch.look(body.cached_host(), repaired) {
            break;
        }
    }
    Ok(watch.outcome)
}

/// Body at its start, its runner and its monitor.
fn start<R: Real>(
    extreme: &Extreme,
    column: Column,
) -> anyhow::Result<(Solver<R>, Recipe, Watch<'_>)> {
    let kappa = extreme.solver::<f64>(None)?.kappa(extreme.time_step);
    let own = extreme.substeps.filter(|_| column.method.has_substeps());
    let substeps = own.unwrap_or_else(|| column.method.substeps(kappa));
    let time = extreme.time_step / f64::from(substeps);
    let solver = extreme.solver::<R>(column.method.limit(time))?;
    let recipe = column
        .method
        .recipe(extreme.time_step, substeps, extreme.gravity());
    let mut watch = Watch::new(extreme, column, &solver);
    watch.outcome.substeps = substeps;
    watch.outcome.kappa = kappa / f64::from(substeps).powi(2);
    Ok((solver, recipe, watch))
}

/// Monitors a body after every frame.
struct Watch<'a> {
    extreme: &'a Extreme,
    outcome: Outcome,
    start: Vec<DVec3>,
    now: Vec<DVec3>,
    energy_at_start: f64,
    /// Unit of energies in J.
    unit: f64,
    /// Largest norm of the total momentum, and largest sum of the momentum magnitudes.
    momentum: [f64; 2],
}

impl<'a> Watch<'a> {
    fn new<R: Real>(extreme: &'a Extreme, column: Column, solver: &Solver<R>) -> Self {
        let mut start = Vec::new();
        solver.positions(&mut start);
        let gravity = extreme.gravity();
        let energy = solver.energy(gravity);
        Self {
            extreme,
            now: start.clone(),
            start,
            energy_at_start: energy.kinetic + energy.elastic + energy.gravity,
            unit: (energy.elastic + extreme.work()).max(f64::MIN_POSITIVE),
            momentum: [0.0; 2],
            outcome: Outcome {
                tets: solver.tet_count(),
                softened: solver.softened().tets,
                frozen: true,
                ..Outcome::new(column)
            },
        }
    }

    /// Records the state of the body; `false` if it is not finite.
    fn look<R: Real>(&mut self, solver: &Solver<R>, repaired: usize) -> bool {
        let outcome = &mut self.outcome;
        outcome.frames += 1;
        outcome.repaired += repaired;
        solver.positions(&mut self.now);
        let energy = solver.energy(self.extreme.gravity());
        let volume = solver.volume();
        let velocities = || (0..solver.particle_count()).map(|p| (p, solver.velocity(p)));
        let sum = energy.kinetic + energy.elastic + energy.gravity;
        let numbers = [sum, volume.total, volume.min_ratio];
        let finite = self.now.iter().all(|x| x.is_finite())
            && velocities().all(|(_, v)| v.is_finite())
            && numbers.iter().all(|n| n.is_finite());
        if !finite {
            outcome.not_finite = Some(outcome.frames);
            return false;
        }
        let rise = (sum - self.energy_at_start) / self.unit;
        outcome.energy_rise = outcome.energy_rise.max(rise);
        outcome.volume = volume.total / volume.rest;
        outcome.inverted = volume.inverted;
        outcome.frozen &= self.extreme.held && self.now == self.start;
        let in_shape = volume.inverted == 0 && (outcome.volume - 1.0).abs() <= VOLUME_TOLERANCE;
        outcome.in_shape_from = match in_shape {
            true => outcome
                .in_shape_from
                .or(Some(outcome.frames as f64 * self.extreme.time_step)),
            false => None,
        };
        if !self.extreme.held && self.extreme.gravity().is_none() {
            let momenta = || velocities().map(|(p, v)| v * solver.mass(p));
            let (all, each) = (
                momenta().sum::<DVec3>().length(),
                momenta().map(DVec3::length).sum::<f64>(),
            );
            self.momentum = [self.momentum[0].max(all), self.momentum[1].max(each)];
            outcome.momentum_drift = Some(self.momentum[0] / self.momentum[1].max(1e-300));
        }
        if outcome.frames == self.extreme.frames() {
            let distance = rigid::distance(&self.extreme.mesh.positions, &self.now);
            outcome.distance = Some(distance);
        }
        true
    }
}
