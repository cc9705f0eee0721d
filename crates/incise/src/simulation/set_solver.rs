//! [`Simulation::set_solver`]: changes the solver settings of a running simulation.
//!
//! Mesh, cuts, positions, velocities, pieces, attachments, obstacles and strokes are kept. Substeps, softened tets,
//! partitions, data of VBD and the device depend on the settings: those that differ are rebuilt from the present body
//! as a new simulation would build them, and the others are kept. All steps that can fail come first, so an error
//! changes nothing.
//!
//! Cost: a pass over the tets for the time of a substep, the limit of kappa, and all that `auto` chooses substeps by;
//! a measurement of the bodies with a budget; otherwise nothing for iterations, relaxation, form and the methods of XPBD;
//! clustering and coloring for their keys; a copy of the solvers for VBD and for another device.

use rayon::prelude::*;

use incise_xpbd::{KappaLimit, StepSettings};

use super::Simulation;
use crate::backend::AnySolver;
use crate::budget;
use crate::compute_device::ComputeDevice;
use crate::island::{Island, adopt, kappa_limit};
use crate::island_builder::substeps;
use crate::method::{leaves_open, resolve, settings};
use crate::partition::{Partition, PartitionSettings};
use crate::recluster::Recluster;
use crate::scene::{Method, Precision, SolverSpec, Substeps};
use crate::sleep::SleepState;
use crate::substeps::Choice;
use crate::validate::value;
use crate::{Error, Scene, solid_blade};

/// Changes of an island by other settings; `None` is unchanged.
#[derive(Debug)]
struct ChangedSolver {
    settings: StepSettings,
    /// With the method that was chosen.
    spec: SolverSpec,
    /// Whether no body names a number of substeps.
    leaves_substeps_open: bool,
    /// Whether VBD may be chosen.
    leaves_method_open: bool,
    choice: Option<Choice>,
    /// The limit of kappa before and from now on.
    limits: [Option<KappaLimit>; 2],
    partition: Option<Partition>,
    /// With the limit from now on.
    solver: Option<AnySolver>,
}

impl Simulation {
    /// Returns the present solver settings: those of the scene, or of the last [`Simulation::set_solver`].
    #[must_use]
    pub fn solver_spec(&self) -> &SolverSpec {
        &self.state.solver
    }

    /// Changes the solver settings from the next frame on. Cuts, motion, attachments and grabs are kept. At frame 0 the
    /// result is bit-identical to a new simulation with these settings.
    ///
    /// * `time_step`: attachments and strokes are defined by frames, so they move faster or slower; obstacles keep
    ///   their velocities; the simulated time continues.
    /// * `substeps`, `max_substeps`: `auto` chooses again for the present tets if one of these, `time_step`, `accuracy`,
    ///   `budget_ms`, `method`, `iterations`, `relaxation`, `tet_solve`, `kappa_limit` or `backend` changes. Substeps that a
    ///   body sets itself stay.
    /// * `kappa_limit`, or another time of a substep: tets are softened to the new limit, and others get the stiffness
    ///   of their material.
    /// * `clustering`, `coloring`, `merge_clusters`: clusters and colors of all tets are rebuilt.
    /// * `recluster`: degradation counts from the last rebuild of clusters and colors. A pending rebuild is still
    ///   taken, unless it has other settings.
    /// * `backend`, and with `auto` also `method` and `clustering`: the state moves to a device or back. The device is
    ///   the present one, that of `offer_device`, one used before by this simulation, or a newly opened one.
    /// * `precision = "auto"`: the precision does not change after setup.
    /// * `preset`: has no effect here. Its defaults are applied when a scene is read.
    ///
    /// Any difference wakes all bodies. Equal settings change nothing.
    ///
    /// The cost depends on the changed keys (see the header of this module in the source); with a given number of
    /// substeps, `iterations`, `relaxation`, `tet_solve` and methods other than VBD cost nothing. With `auto` they cost a
    /// pass over the tets, and with `budget_ms` the bodies are measured again.
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::new`] for these settings, and one if `precision` differs. Nothing has
    /// changed then.
    ///
    /// # Example
    /// ```
    /// use incise::{Scene, Simulation, scene::{Method, SolverSpec}};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// let spec = simulation.solver_spec().clone().with(|solver| solver.iterations = 3);
    /// simulation.set_solver(&spec)?;
    /// simulation.step()?;
    /// simulation.set_solver(&SolverSpec::of(Method::Vbd))?;
    /// simulation.step()?;
    /// assert_eq!(simulation.solver_spec().method, Method::Vbd);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn set_solver(&mut self, solver: &SolverSpec) -> Result<(), Error> {
        if *solver == self.state.solver {
            return Ok(());
        }
        if solver.precision != Precision::Auto && solver.precision != self.state.precision {
            let range = format!(
                "{}, as when the simulation was set up",
                self.state.precision.name()
            );
            return Err(value("solver.precision", solver.precision.name(), range));
        }
        // Strokes are under way. Some methods and devices do not have every quantity of a report.
        let mut scene = Scene {
            solver: solver.clone(),
            stroke: Vec::new(),
            report: self.state.reporting.clone(),
            ..(*self.state.scene).clone()
        };
        if solver.method == Method::Auto && self.state.timeline.solid_field().is_some() {
            scene.solver.method = Method::GaussSeidel;
        }
        let settings = settings(&scene)?;
        crate::scene::check(&scene)?;
        let compute_device = self.compute_device_for(&scene)?;
        if let Some(stroke) = self.state.timeline.solid_field() {
            solid_blade::check(stroke, solver.method, compute_device.is_gpu())?;
        }
        if !is_light(&self.state.solver, solver) {
            self.read_back()?;
        }
        let changed = || {
            let islands = self.state.islands.par_iter();
            islands
                .map(|island| {
                    ChangedSolver::of(
                        island,
                        &self.state.solver,
                        &scene,
                        &settings,
                        &compute_device,
                    )
                })
                .collect::<Result<Vec<_>, Error>>()
        };
        let changed = match &self.pool {
            Some(pool) => pool.install(changed),
            None => changed(),
        }?;

        // Nothing fails from here on: what is on a device has been fetched.
        for (island, changed) in self.state.islands.iter_mut().zip(changed) {
            changed.take_effect(island)?;
            island.judge_settings();
        }
        if let Some(budget) = solver.budget_ms {
            let mut fit = || budget::fit(&mut self.state.islands, solver, budget);
            match &self.pool {
                Some(pool) => pool.install(fit),
                None => fit(),
            }?;
        }
        self.state.clock.set_time_step(settings.time_step);
        self.leave_device();
        self.state.compute_device = compute_device;
        self.state.solver = solver.clone();
        self.state.residuals_kept = false;
        if self.state.clock.next_frame == 0 {
            self.report_before_the_first();
        }
        Ok(())
    }

    /// Chooses the compute device for other settings.
    fn compute_device_for(&self, scene: &Scene) -> Result<ComputeDevice, Error> {
        let (before, after) = (&self.state.solver, &scene.solver);
        if (before.backend, before.method, &before.clustering)
            == (after.backend, after.method, &after.clustering)
        {
            return Ok(self.state.compute_device.clone());
        }
        let present = self.state.compute_device.gpu.as_ref();
        ComputeDevice::choose(scene, &present.or(self.open_device.as_ref()).cloned())
    }

    /// Keeps the present device open, unless another one is kept.
    pub(super) fn leave_device(&mut self) {
        if self.open_device.is_none() {
            self.open_device.clone_from(&self.state.compute_device.gpu);
        }
    }
}

/// Whether all changed settings are read by each step, without derived data.
fn is_light(before: &SolverSpec, after: &SolverSpec) -> bool {
    let is_vbd = |spec: &SolverSpec| spec.method == Method::Vbd;
    let light = SolverSpec {
        preset: before.preset,
        iterations: before.iterations,
        method: if is_vbd(before) == is_vbd(after) {
            before.method
        } else {
            after.method
        },
        tet_solve: before.tet_solve,
        relaxation: before.relaxation,
        spectral_radius: before.spectral_radius,
        chebyshev_start: before.chebyshev_start,
        recluster: before.recluster,
        sleep: before.sleep,
        ..after.clone()
    };
    light == *before
}

impl ChangedSolver {
    /// Computes the changes of an island for the settings of `scene`.
    fn of(
        island: &Island,
        before: &SolverSpec,
        scene: &Scene,
        settings: &StepSettings,
        compute_device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let after = &scene.solver;
        let mesh = island.cuttable.mesh();
        let mut settings = StepSettings {
            substeps: island.settings.substeps,
            gravity: island.settings.gravity,
            colliders: island.settings.colliders.clone(),
            ..settings.clone()
        };
        let mut choice = island.judged.choice;
        let asked = island.asked(|body| scene.body[body].substeps.unwrap_or(after.substeps));
        let chosen_anew = substeps_follow_from(before) != substeps_follow_from(after);
        if chosen_anew {
            (settings.substeps, choice) = substeps(&asked, after, &island.solver, mesh);
        }
        let is_open = leaves_open(scene, &asked, &settings, compute_device.is_gpu());
        let (own, choice) = match after.method {
            Method::Auto if chosen_anew => resolve(after, choice, is_open),
            // What was chosen stays, with everything else that differs.
            Method::Auto => {
                let SolverSpec {
                    method,
                    two_level,
                    substeps,
                    iterations,
                    ..
                } = island.spec.clone();
                let own = SolverSpec {
                    method,
                    two_level,
                    substeps,
                    iterations,
                    ..after.clone()
                };
                (own, choice)
            }
            _ => (after.clone(), choice),
        };
        if after.method == Method::Auto {
            adopt(&mut settings, &own);
        }
        let (before, after) = (&island.spec, &own);
        let limits = [
            kappa_limit(before, &island.settings),
            kappa_limit(after, &settings),
        ];
        let planned = |spec: &SolverSpec| {
            let SolverSpec {
                clustering,
                coloring,
                ..
            } = spec;
            (clustering.clone(), coloring.clone(), spec.merge_clusters)
        };
        let partition = (planned(before) != planned(after))
            .then(|| Partition::of(PartitionSettings::new(after)?, mesh))
            .transpose()?;
        let mut solver = None;
        if Self::needs_another_solver(island, before, after, limits, compute_device)? {
            let mut copy = island.solver.clone();
            copy.limit_kappa(limits[0], limits[1], mesh)?;
            copy.backend_mut().end_vbd();
            copy.prepare(after, compute_device)?;
            solver = Some(copy);
        }
        Ok(Self {
            settings,
            spec: own,
            leaves_substeps_open: asked.iter().all(|s| *s == Substeps::Auto),
            leaves_method_open: is_open,
            choice,
            limits,
            partition,
            solver,
        })
    }

    /// Whether the solver is on the wrong device or in the wrong form, or does not match what VBD needs.
    fn needs_another_solver(
        island: &Island,
        before: &SolverSpec,
        after: &SolverSpec,
        limits: [Option<KappaLimit>; 2],
        compute_device: &ComputeDevice,
    ) -> Result<bool, Error> {
        if !island.solver.is_on(compute_device, after)? {
            return Ok(true);
        }
        let prepared = |spec: &SolverSpec| {
            let accuracy = spec.accuracy.map(f64::to_bits);
            (spec.method, spec.two_level, spec.integrator, accuracy)
        };
        let softens = || limits[0] != limits[1] && limits.iter().any(|l| island.solver.exceeds(*l));
        Ok(after.method == Method::Vbd && (prepared(before) != prepared(after) || softens()))
    }

    fn take_effect(self, island: &mut Island) -> Result<(), Error> {
        let spec = self.spec;
        match self.solver {
            Some(solver) => island.solver = solver,
            None => {
                let [before, after] = self.limits;
                let mesh = island.cuttable.mesh();
                island.solver.limit_kappa(before, after, mesh)?;
                if spec.method != Method::Vbd {
                    island.solver.backend_mut().end_vbd();
                }
            }
        }
        let planned = self.partition.is_some();
        if let Some(partition) = self.partition {
            island.partition = partition;
            island.reschedule_volumes()?;
        }
        island.recluster = match (spec.recluster, island.recluster.take()) {
            (Some(spec), Some(old)) if !planned => Some(old.with(spec)),
            (spec, _) => spec.map(Recluster::new),
        };
        island.sleep = spec.sleep.map(SleepState::new);
        island.set_first_substeps(self.settings.substeps);
        island.settings = self.settings;
        island.judged.choice = self.choice;
        island.spec = spec;
        island.judged.leaves_substeps_open = self.leaves_substeps_open;
        island.judged.leaves_method_open = self.leaves_method_open;
        island.judged.budget = None;
        Ok(())
    }
}

/// Returns the settings that the choice of substeps depends on, for comparison.
fn substeps_follow_from(spec: &SolverSpec) -> impl PartialEq + use<> {
    (
        spec.time_step.to_bits(),
        spec.accuracy.map(f64::to_bits),
        (spec.method, spec.iterations, spec.relaxation.to_bits()),
        spec.kappa_limit.to_bits(),
        (spec.backend, spec.budget_ms.map(f64::to_bits)),
        spec.tet_solve,
        spec.substeps,
        spec.max_substeps,
    )
}
