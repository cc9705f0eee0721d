//! [`Island`]: bodies that are solved together, with their solver, partition, attachments and cuts.
//!
//! Mostly a single body. Each island has its own mesh, solver, partition, substeps and origin. A stiff body therefore
//! does not slow down others, and a body moves bit-identically to a scene of its own. Cost: that of its parts.

mod join;

use std::collections::BTreeMap;
use std::time::Instant;

use glam::DVec3;
use incise_cutting::{
    CutDelta, CuttableMesh, ImproveOptions, PieceEvent, PieceTracker, StrokeRegistry, improve,
    remove_tets,
};
use incise_mesh::{Bounds, ParticleId, TetId, signed_volume};
use incise_xpbd::{
    DistanceConstraint, KappaLimit, Real, SolidBlade, Solver, StepReport, StepSettings,
    shortest_substep_of_f32,
};

use crate::accuracy::{DEFAULT_ACCURACY, OutsideVolume, largest_kappas};
use crate::attachment::{Attachment, AttachmentHandle};
use crate::backend::{AnySolver, each, each_mut};
use crate::compute_device::ComputeDevice;
use crate::contacts::Contacts;
use crate::distance::Distances;
use crate::forces::Measured;
use crate::grab::{Grab, Grabs};
use crate::island_builder::{IslandBuilder, demands, substeps};
use crate::method::{leaves_open, resolve, tet_solve};
use crate::partition::Partition;
use crate::recluster::Recluster;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::{
    AttachmentSpec, DistanceSpec, Method, Precision, Quantity, SolverSpec, Substeps,
};
use crate::sleep::SleepState;
use crate::substeps::{Choice, Shortfall, evaluate};
use crate::volume::Volumes;
use crate::warning::{self, Warning, WarningCode};
use crate::{Error, Scene, collider, distance};

/// Bodies that are solved together. A copy has the state as it is known here, and its solver on the processor.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Island {
    /// The numbers of its bodies in the scene, ascending.
    pub(crate) bodies: Vec<usize>,
    /// For each material of the solver the index of its body in `bodies`.
    body_of: Vec<usize>,
    /// Mesh at rest; its particles and tets are numbered within the island.
    pub(crate) cuttable: CuttableMesh,
    pub(crate) solver: AnySolver,
    pub(crate) partition: Partition,
    /// Its colliders are where they are at the start of the next frame.
    pub(crate) settings: StepSettings,
    /// The settings of the solver as a scene says them, with the method that was chosen.
    #[cfg_attr(feature = "save", serde(with = "crate::saved::as_toml"))]
    pub(crate) spec: SolverSpec,
    /// Whether no body of it names a number of substeps.
    pub(crate) leaves_substeps_open: bool,
    /// Whether VBD may be chosen for it.
    pub(crate) leaves_method_open: bool,
    pub(crate) attachments: Vec<Attachment>,
    /// Frames of removed attachments in the solver, for new ones.
    spare_frames: Vec<u32>,
    pub(crate) distances: Distances,
    /// The solid blades of the frame that touch its cuts, with the numbers of their strokes.
    #[cfg_attr(feature = "save", serde(skip))]
    pub(crate) blades: Vec<(u32, SolidBlade)>,
    /// The forces of the last frame that measured them.
    pub(crate) forces: Option<Box<Measured>>,
    /// In a scene with contact.
    pub(crate) contacts: Option<Box<Contacts>>,
    /// The interactive grabs.
    pub(crate) grabs: Grabs,
    volumes: Option<Volumes>,
    /// The present positions.
    pub(crate) positions: Vec<DVec3>,
    /// Its pieces, numbered within the island.
    pub(crate) pieces: PieceTracker,
    /// Volume at rest in m³ before all cuts.
    pub(crate) initial_volume: f64,
    /// Volume at rest in m³ that strokes have taken away.
    pub(crate) removed_volume: f64,
    /// Choice of substeps, if the scene leaves it open.
    #[cfg_attr(feature = "save", serde(with = "crate::substeps::saved"))]
    pub(crate) choice: Option<Choice>,
    /// The substeps before all cuts.
    first_substeps: u32,
    /// Cost and time limit, in a scene with a budget.
    pub(crate) budget: Option<Budget>,
    /// The longest side of the box around its bodies at rest in m.
    size: f64,
    /// Volume that is solved less accurately than the accuracy wanted.
    pub(crate) outside: OutsideVolume,
    /// Whether the last frame of VBD missed the accuracy wanted.
    misses_accuracy: bool,
    /// Warnings for the next report.
    pub(crate) warnings: Vec<Warning>,
    /// Change of kappa by the last cut, if it is reported.
    pub(crate) cut_kappa: Option<CutKappa>,
    /// Whether it sleeps, in a scene where bodies may.
    pub(crate) sleep: Option<SleepState>,
    /// Background rebuild of the partition, in a scene with `recluster`.
    pub(crate) recluster: Option<Recluster>,
}

/// Cost of an island and its share of a time budget.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Budget {
    /// Milliseconds of a substep for each tet.
    pub(crate) per_tet: f64,
    /// Milliseconds of a frame.
    pub(crate) share: f64,
}

impl Budget {
    /// The most substeps that fit with a number of tets, at least 1.
    pub(crate) fn most(self, tets: usize) -> u32 {
        whole(self.share / (self.per_tet * tets.max(1) as f64))
    }
}

/// The number rounded down to a positive integer.
fn whole(number: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and 0 becomes 1"
    )]
    let whole = number as u32;
    whole.max(1)
}

/// Change of kappa by cuts.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct CutKappa {
    /// The largest of a tet before.
    pub(crate) before: Option<f64>,
    /// The largest of a tet that was made.
    pub(crate) new_tets: f64,
}

/// The limit of kappa that settings ask for, if it is one.
pub(crate) fn kappa_limit(solver: &SolverSpec, settings: &StepSettings) -> Option<KappaLimit> {
    let limit = KappaLimit {
        kappa: solver.kappa_limit,
        substep_time: settings.substep_time(),
    };
    limit.kappa.is_finite().then_some(limit)
}

/// Puts what `auto` chose into the settings of a step: the iterations, and the substep of VBD.
pub(crate) fn adopt(settings: &mut StepSettings, spec: &SolverSpec) {
    settings.iterations = spec.iterations;
    if let (Method::Vbd, Substeps::Fixed(substeps)) = (spec.method, spec.substeps) {
        settings.substeps = substeps;
    }
}

/// The part of a body's volume outside the accuracy wanted from which a warning is given.
const OUTSIDE_FRACTION: f64 = 0.01;
/// Tets that the improvement of a frame looks at, at least. Looking at one takes as long as some 40 Gauss-Seidel iterations
/// on one.
const IMPROVED_TETS: usize = 1000;
/// The improvement of a frame looks at one of so many tets of a larger island: a quarter of the time of 20 iterations.
const IMPROVED_PART: usize = 8;

/// Cuts raise a chosen number of substeps to at most so many times what it was before them: a live scene must not become
/// slower without end.
const MOST_GROWTH: u32 = 2;

/// Factor by which gravity may be weaker than on earth and still decide the precision.
const WEAKEST: f64 = 1e4;

/// The longest side of the box around points, 0 without points.
fn longest_side(points: &[DVec3]) -> f64 {
    let (low, high) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| {
            (low.min(*x), high.max(*x))
        });
    (high - low).max_element().max(0.0)
}

/// Material, kappa and volume of a tet.
fn accuracy_data<R: Real>(
    solver: &Solver<R>,
    tet: usize,
    settings: &StepSettings,
) -> (u16, f64, f64) {
    (
        solver.material_of(tet),
        solver.kappa_of(tet, settings.substep_time()),
        solver.rest_volume(tet),
    )
}

impl Island {
    pub(crate) fn new(
        scene: &Scene,
        compute_device: &ComputeDevice,
        precision: Precision,
        mut settings: StepSettings,
        mut joined: IslandBuilder,
    ) -> Result<Self, Error> {
        let mesh = std::mem::take(&mut joined.mesh);
        let cuttable = CuttableMesh::new(mesh).map_err(|source| Error::Cut {
            field: "body".into(),
            source,
        })?;
        let mut solver = joined.solver(precision, &cuttable)?;
        let (substeps, choice) = joined.substeps(scene, &solver, &cuttable);
        settings.substeps = substeps;
        let is_open = leaves_open(scene, &joined.substeps, &settings, compute_device.is_gpu());
        let (spec, choice) = resolve(&scene.solver, choice, is_open);
        if scene.solver.method == Method::Auto {
            adopt(&mut settings, &spec);
        }
        let limit = kappa_limit(&scene.solver, &settings);
        solver.limit_kappa(None, limit, cuttable.mesh())?;
        for attachment in &mut joined.attachments {
            attachment.attach(0, &mut solver, None)?;
        }
        if !joined.distances.is_empty() {
            joined.distances.hand_to(&mut solver)?;
        }
        let contacts = match &scene.contact {
            Some(spec) => {
                let bodies = std::mem::take(&mut joined.body_of_particle);
                Some(Box::new(Contacts::new(spec, &cuttable, bodies)?))
            }
            None => None,
        };
        let partition = Partition::new(scene, cuttable.mesh())?;
        let volumes = joined.volumes();
        if let Some(volumes) = &volumes {
            volumes.constrain(&mut solver, &cuttable, &partition.schedule)?;
        }
        solver.prepare(&spec, compute_device)?;
        let recluster = scene.solver.recluster;
        let size = longest_side(&cuttable.mesh().positions);
        let mut island = Self {
            recluster: recluster.map(Recluster::new),
            solver,
            partition,
            settings: settings.clone(),
            attachments: joined.attachments,
            spare_frames: Vec::new(),
            distances: joined.distances,
            blades: Vec::new(),
            forces: None,
            contacts,
            grabs: Grabs::default(),
            volumes,
            positions: Vec::new(),
            pieces: PieceTracker::new(&cuttable),
            initial_volume: cuttable.mesh().total_volume(),
            removed_volume: 0.0,
            cuttable,
            bodies: joined.bodies,
            body_of: joined.body_of,
            choice,
            first_substeps: settings.substeps,
            budget: None,
            spec,
            leaves_substeps_open: joined.substeps.iter().all(|s| *s == Substeps::Auto),
            leaves_method_open: is_open,
            size,
            outside: OutsideVolume::default(),
            misses_accuracy: false,
            warnings: Vec::new(),
            cut_kappa: None,
            sleep: scene.solver.sleep.map(SleepState::new),
        };
        island.solver.positions(&mut island.positions);
        island.judge_settings();
        let empty = joined.empty_regions.into_iter();
        island.warnings.extend(empty.map(Warning::of_empty_region));
        Ok(island)
    }

    /// Whether VBD was chosen for it.
    pub(crate) fn chose_vbd(&self) -> bool {
        self.choice.is_some_and(|choice| choice.by_vbd)
    }

    /// Whether two-level VBD has an accuracy to reach. Single precision may not resolve it: the strains of a stiff body in
    /// free fall are rounding.
    pub(crate) fn must_converge(&self) -> bool {
        self.spec.method == Method::Vbd && self.spec.two_level && self.spec.accuracy.is_some()
    }

    /// Judges the accuracy of the present settings and notes warnings. O(tets log tets).
    pub(crate) fn judge_settings(&mut self) {
        self.warnings.clear();
        self.misses_accuracy = false;
        if self.is_too_short_for_f32() && each!(&self.solver, solver => solver.is_single()) {
            let shortest = self.shortest_substep_of_f32();
            let message = format!(
                "a substep of {:.1e} s is too short for single precision, which needs {shortest:.1e} s: set precision = \"f64\"",
                self.settings.substep_time()
            );
            self.warn(WarningCode::ShortSubstepF32, message);
        }
        if let Some(choice) = self.choice.filter(|_| self.chose_vbd()) {
            let warning = warning::of_vbd(&self.bodies, &choice, &self.spec);
            self.warnings.push(warning);
        }
        let spec = &self.spec;
        if spec.method != Method::GaussSeidel {
            self.outside = OutsideVolume::default();
            return;
        }
        let form = tet_solve(spec.tet_solve);
        let accuracy = spec.accuracy.unwrap_or(DEFAULT_ACCURACY);
        let substeps = self.settings.substeps;
        let mesh = self.cuttable.mesh();
        let mut judged = evaluate(
            demands(spec, &self.solver, mesh, |_| true),
            |_| substeps,
            form,
        );
        let limit = self.choice.and_then(|choice| choice.shortfall);
        if let Some(Shortfall::Budget | Shortfall::Growth) = limit {
            judged.shortfall = limit;
        }
        let chosen = self.choice.is_some();
        self.warnings.extend(warning::of_substeps(
            &self.bodies,
            &judged,
            chosen,
            spec.accuracy,
        ));
        let softened = each!(&self.solver, solver => solver.softened());
        if softened.tets > 0 {
            let message = format!(
                "{} of {} tets ({:.1}% of the volume) are softened to kappa_limit",
                softened.tets,
                self.cuttable.mesh().tets.len(),
                100.0 * softened.volume_fraction
            );
            self.warn(WarningCode::Softened, message);
        }
        self.outside = each!(&self.solver, solver => {
            let limits = largest_kappas(accuracy, solver.materials(), form);
            let tets = (0..solver.tet_count()).map(|t| accuracy_data(solver, t, &self.settings));
            OutsideVolume::new(limits, tets)
        });
    }

    fn warn(&mut self, code: WarningCode, message: String) {
        self.warnings
            .push(Warning::new(code, &self.bodies, message));
    }

    /// Whether the substep is too short for single precision.
    pub(crate) fn is_too_short_for_f32(&self) -> bool {
        self.settings.substep_time() < 0.999 * self.shortest_substep_of_f32()
    }

    /// The shortest substep of single precision in s: under weak gravity bodies move more slowly than its rule supposes.
    fn shortest_substep_of_f32(&self) -> f64 {
        let gravity = self.settings.gravity.map_or(0.0, |g| g.length());
        let weakness = if gravity > 0.0 {
            (9.81 / gravity).clamp(1.0, WEAKEST)
        } else {
            1.0
        };
        shortest_substep_of_f32(self.size) * weakness.sqrt()
    }

    /// Takes a number of substeps, from which cuts raise it.
    pub(crate) fn set_substeps(&mut self, substeps: u32) {
        self.settings.substeps = substeps;
        self.first_substeps = substeps;
    }

    /// Takes a number of substeps, with the error to expect of it.
    pub(crate) fn take_substeps(&mut self, substeps: u32) {
        let form = tet_solve(self.spec.tet_solve);
        let tets = demands(&self.spec, &self.solver, self.cuttable.mesh(), |_| true);
        let mut choice = evaluate(tets, |_| substeps, form);
        if choice.shortfall == Some(Shortfall::Cap) {
            choice.shortfall = Some(Shortfall::Budget);
        }
        self.choice = Some(choice);
        self.set_substeps(substeps);
    }

    /// After cuts: takes fewer substeps where they no longer fit the budget. Tells whether that is so.
    fn keep_budget(&mut self) -> bool {
        let Some(budget) = self.budget.filter(|_| self.spec.method != Method::Vbd) else {
            return false;
        };
        let most = budget.most(self.cuttable.mesh().tets.len());
        if self.settings.substeps <= most {
            return false;
        }
        self.take_substeps(most);
        self.judge_settings();
        true
    }

    /// Takes over substeps that settings have changed: cuts raise them from there.
    pub(crate) fn set_first_substeps(&mut self, substeps: u32) {
        if substeps != self.settings.substeps {
            self.first_substeps = substeps;
        }
    }

    /// After cuts: chooses substeps again where too much of the body is outside the accuracy, or warns.
    pub(crate) fn judge_cut(&mut self, asked: &[Substeps]) {
        if self.keep_budget() {
            return;
        }
        let fraction = self.outside.outside / self.cuttable.mesh().total_volume();
        if self.spec.method != Method::GaussSeidel
            || fraction <= OUTSIDE_FRACTION
            || self.outside.outside <= 2.0 * self.outside.at_choice
        {
            return;
        }
        let before = self.settings.substeps;
        if self.choice.is_some() && self.budget.is_none() && !self.spec.kappa_limit.is_finite() {
            let (chosen, choice) = substeps(asked, &self.spec, &self.solver, self.cuttable.mesh());
            let most = MOST_GROWTH.saturating_mul(self.first_substeps);
            let taken = chosen.min(most).max(before);
            self.settings.substeps = taken;
            let ratio = f64::from(before) / f64::from(self.settings.substeps);
            if let Some(noted) = &mut self.cut_kappa {
                // Kappa goes with the square of the substep.
                noted.before = noted.before.map(|kappa| kappa * ratio * ratio);
                noted.new_tets *= ratio * ratio;
            }
            self.choice = match choice {
                Some(_) if taken < chosen => {
                    let form = tet_solve(self.spec.tet_solve);
                    let mesh = self.cuttable.mesh();
                    let tets = demands(&self.spec, &self.solver, mesh, |_| true);
                    let mut limited = evaluate(tets, |_| taken, form);
                    limited.shortfall = Some(Shortfall::Growth);
                    Some(limited)
                }
                choice => choice,
            };
            self.judge_settings();
        }
        self.outside.at_choice = self.outside.outside;
        let fraction = self.outside.outside / self.cuttable.mesh().total_volume();
        if fraction > OUTSIDE_FRACTION {
            let message = format!(
                "after cuts {:.1}% of the volume is in tets too small for the accuracy wanted with {} substeps",
                100.0 * fraction,
                self.settings.substeps
            );
            self.warn(WarningCode::OutsideAccuracy, message);
        }
    }

    /// Whether a speed in m/s is beyond anything that the material, gravity and moving parts can cause.
    pub(crate) fn is_absurd(&self, speed: f64, elapsed: f64) -> bool {
        let wave = each!(&self.solver, solver => {
            let waves = solver.materials().iter().map(|m| (m.young_modulus / m.density).sqrt());
            waves.fold(0.0, f64::max)
        });
        let fall = self.settings.gravity.map_or(0.0, |g| g.length() * elapsed);
        let plausible = 100.0 * wave + 2.0 * fall + 10.0 * self.size / self.settings.time_step;
        speed.is_nan() || speed > plausible
    }

    /// Returns whether the island sleeps: it is not solved until it is woken.
    pub(crate) fn asleep(&self) -> bool {
        self.sleep.is_some_and(|sleep| sleep.asleep())
    }

    /// Wakes it, in a scene where bodies may sleep.
    pub(crate) fn wake(&mut self) {
        if let Some(rest) = &mut self.sleep {
            rest.wake();
        }
    }

    /// Advances by the frame of a number, unless it sleeps. What moves a handle or a collider wakes it.
    pub(crate) fn step(
        &mut self,
        frame: u64,
        keeping_residuals: bool,
        measuring_forces: bool,
    ) -> Result<StepReport, Error> {
        let moved = self.sleep.is_some() && self.is_moved(frame);
        if moved {
            self.wake();
        }
        if self.asleep() {
            return Ok(StepReport::default());
        }
        // Its body was removed; its colliders are those of all islands and move on.
        if self.cuttable.mesh().tets.is_empty() {
            self.forces = None;
            if let Some(contacts) = &mut self.contacts {
                contacts.end(&mut self.solver)?;
            }
            collider::advance(&mut self.settings);
            return Ok(StepReport::default());
        }
        for attachment in &self.attachments {
            attachment.advance(frame, &mut self.solver);
        }
        self.solver.backend_mut().measure_forces(measuring_forces);
        if !self.blades.is_empty() {
            let blades = self.blades.iter().map(|(_, blade)| blade.clone());
            self.set_blades(blades.collect())?;
        }
        let step = if self.contacts.is_some() {
            self.step_with_contact(keeping_residuals)
        } else {
            let (schedule, settings) = (&self.partition.schedule, &self.settings);
            let backend = self.solver.backend_mut();
            backend.step(schedule, settings, keeping_residuals)
        };
        // Also after an error: no blade may stay behind.
        if !self.blades.is_empty() {
            self.set_blades(Vec::new())?;
        }
        let step = step?;
        let strokes = self.blades.iter().map(|(stroke, _)| *stroke);
        let body_of_tet = |tet| self.body_of_tet(tet);
        let measured = measuring_forces
            .then(|| Measured::of(&self.solver, &self.cuttable, body_of_tet, strokes));
        self.forces = measured.flatten();
        self.judge_step();
        collider::advance(&mut self.settings);
        self.grabs.arrive();
        for attachment in &mut self.attachments {
            attachment.arrive();
        }
        let time = self.settings.time_step;
        if let Some(rest) = self.sleep.as_mut().filter(|_| !moved) {
            let state = self.solver.backend_mut().state(None, &[Quantity::Speed])?;
            let falls_asleep = |speed| rest.count(speed, time);
            if state.max_speed.is_some_and(falls_asleep) {
                each_mut!(&mut self.solver, solver => {
                    for p in 0..solver.particle_count() {
                        solver.set_velocity(p, DVec3::ZERO);
                    }
                });
            }
        }
        Ok(step)
    }

    /// Hands solid blades to the solver.
    fn set_blades(&mut self, blades: Vec<SolidBlade>) -> Result<(), Error> {
        each_mut!(&mut self.solver, solver => {
            let set = solver.set_blades(blades);
            set.map_err(|source| Error::Xpbd { field: "stroke.solid".into(), source })
        })
    }

    /// A frame in parts, before each of which contacts are found.
    fn step_with_contact(&mut self, keeping_residuals: bool) -> Result<StepReport, Error> {
        let Self {
            contacts,
            solver,
            cuttable,
            pieces,
            partition,
            settings,
            ..
        } = self;
        let mut report = StepReport::default();
        let Some(contacts) = contacts else {
            return Ok(report);
        };
        // Contacts are found here, from the state at the start of the frame.
        report.repaired += solver.backend_mut().read_back()?;
        let (time, substeps) = (settings.time_step, settings.substeps);
        let parts = contacts.begin_frame(solver, time, substeps);
        let end = |part: u32| {
            let end = u64::from(substeps) * u64::from(part) / u64::from(parts);
            u32::try_from(end).unwrap_or(substeps)
        };
        for part in 0..parts {
            contacts.update(solver, cuttable, pieces, time / f64::from(parts))?;
            let (schedule, range) = (&partition.schedule, end(part)..end(part + 1));
            let backend = solver.backend_mut();
            let step = backend.step_part(schedule, settings, range, keeping_residuals)?;
            report.repaired += step.repaired;
            report.jittered += step.jittered;
            contacts.note(solver, cuttable, pieces);
        }
        contacts.end_frame();
        contacts.judge_depth(cuttable, pieces, time);
        Ok(report)
    }

    /// Warns when VBD begins to miss the accuracy wanted.
    fn judge_step(&mut self) {
        let error = self.solver.backend().vbd_error();
        let (Some(wanted), Some(error)) = (self.spec.accuracy, error) else {
            return;
        };
        let misses = error > wanted;
        if misses && !self.misses_accuracy {
            let message = format!(
                "{} rounds of two-level VBD leave an estimated error of {:.0}% of the motion, where {:.0}% are wanted; use \
                 more, smaller frames or a Poisson's ratio farther from 0.5",
                self.settings.iterations,
                100.0 * error.min(1e6),
                100.0 * wanted
            );
            self.warn(WarningCode::NotConverged, message);
        }
        self.misses_accuracy = misses;
    }

    /// The number of the body of a tet in the scene.
    pub(crate) fn body_of_tet(&self, tet: TetId) -> usize {
        let material = each!(&self.solver, solver => solver.material_of(tet.index()));
        self.bodies[self.body_of[usize::from(material)]]
    }

    /// The box of each body that has tets, with its number in the scene. O(tets).
    pub(crate) fn boxes(&self) -> BTreeMap<usize, Bounds> {
        let mut boxes = BTreeMap::new();
        for (tet, corners) in self.cuttable.mesh().tets.iter().enumerate() {
            let corners = Bounds::around(corners.map(|p| self.positions[p.index()]));
            let body = self.body_of_tet(TetId::new(tet));
            let bounds = boxes.entry(body).or_insert(Bounds::EMPTY);
            *bounds = bounds.union(corners);
        }
        boxes
    }

    /// Removes all tets of a body from the mesh; what depends on the mesh takes the delta.
    pub(crate) fn remove_tets_of(&mut self, body: usize) -> Result<CutDelta, Error> {
        let all = (0..self.cuttable.mesh().tets.len()).map(TetId::new);
        let tets: Vec<TetId> = all.filter(|&t| self.body_of_tet(t) == body).collect();
        remove_tets(&mut self.cuttable, &tets, 0).map_err(|source| Error::Cut {
            field: "body".into(),
            source,
        })
    }

    /// For each material what its body, given by its number in the scene, asks for.
    pub(crate) fn asked<T>(&self, asks: impl Fn(usize) -> T) -> Vec<T> {
        let bodies = self.body_of.iter().map(|&body| self.bodies[body]);
        bodies.map(asks).collect()
    }

    /// Whether all tets have one density in kg/m³, and which.
    pub(crate) fn density(&self) -> Option<f64> {
        each!(&self.solver, solver => {
            let first = solver.materials().first()?.density;
            let same = solver.materials().iter().all(|m| m.density == first);
            same.then_some(first)
        })
    }

    /// The mass at rest in kg of each of its pieces that is wanted, by number. O(tets).
    pub(crate) fn masses(&self, wanted: impl Fn(u32) -> bool) -> BTreeMap<u32, f64> {
        let mesh = self.cuttable.mesh();
        let mut masses = BTreeMap::new();
        each!(&self.solver, solver => {
            for t in (0..mesh.tets.len()).map(TetId::new) {
                let piece = self.pieces.piece_of(t);
                if wanted(piece) {
                    *masses.entry(piece).or_insert(0.0) += solver.density_of(t.index()) * mesh.volume(t);
                }
            }
        });
        masses
    }

    /// The particles of a body of the island with their positions at rest.
    pub(crate) fn particles_of(&self, body: usize) -> (Vec<usize>, Vec<DVec3>) {
        let mesh = self.cuttable.mesh();
        let all = 0..mesh.positions.len();
        // A particle that has lost all its tets is of no body.
        let is_of = |p: &usize| {
            let tet = self.cuttable.around(ParticleId::new(*p)).next();
            tet.is_some_and(|tet| self.bodies.len() == 1 || self.body_of_tet(tet) == body)
        };
        let numbers: Vec<usize> = all.filter(is_of).collect();
        let positions = numbers.iter().map(|&p| mesh.positions[p]).collect();
        (numbers, positions)
    }

    /// Attaches part of a body of the island at the start of a frame, and wakes it.
    pub(crate) fn add_attachment(
        &mut self,
        name: AttachmentHandle,
        spec: &AttachmentSpec,
        frame: u64,
    ) -> Result<(), Error> {
        let (numbers, positions) = self.particles_of(spec.body);
        let field = "attachment".to_owned();
        let mut attachment = Attachment::new(name, field, spec, &positions, |p| numbers[p])?;
        let spare = self.spare_frames.last().copied();
        attachment.attach(frame, &mut self.solver, spare)?;
        self.spare_frames.pop();
        if let Some(forces) = &mut self.forces {
            forces.forget(attachment.number);
        }
        self.attachments.push(attachment);
        self.wake();
        Ok(())
    }

    /// Releases the particles of an attachment and wakes the island; returns whether the attachment exists.
    pub(crate) fn remove_attachment(&mut self, name: AttachmentHandle) -> Result<bool, Error> {
        let Some(index) = self.attachments.iter().position(|a| a.name == name) else {
            return Ok(false);
        };
        self.attachments[index].detach(&mut self.solver)?;
        self.spare_frames.push(self.attachments[index].number);
        self.attachments.remove(index);
        self.wake();
        Ok(true)
    }

    /// Hands changed distance constraints to the solver, and wakes it.
    pub(crate) fn update_distances(&mut self) -> Result<(), Error> {
        self.distances.hand_to(&mut self.solver)?;
        self.solver
            .backend_mut()
            .update_vbd(&mut Milliseconds::default())?;
        self.wake();
        Ok(())
    }

    /// The constraint of a spec whose bodies are both in the island.
    pub(crate) fn distance(&self, spec: &DistanceSpec) -> Result<DistanceConstraint, Error> {
        distance::constraint("distance", spec, |end| {
            let (numbers, positions) = self.particles_of(end.body);
            let (x, p) = distance::nearest(end.point, &positions)?;
            Some((x, numbers[p]))
        })
    }

    /// Whether a handle, a hand or a collider moves in a frame.
    fn is_moved(&self, frame: u64) -> bool {
        let mut colliders = self.settings.colliders.iter();
        colliders.any(|collider| collider.velocity != DVec3::ZERO)
            || self
                .attachments
                .iter()
                .any(|attachment| attachment.moves(frame))
            || self.grabs.moves()
            || self
                .blades
                .iter()
                .any(|(_, blade)| blade.edge[0] != blade.edge[1])
    }

    /// The nearest particle to a point within a radius that can be held, and its squared distance.
    pub(crate) fn nearest(&self, point: DVec3, radius: f64) -> Option<(f64, usize)> {
        let near = self.holdable(point, radius);
        // The first of those at the same distance.
        near.min_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// The particles within a radius around a point that can be held, with their squared distances: neither fixed nor on
    /// a handle, and corner of a tet.
    fn holdable(&self, point: DVec3, radius: f64) -> impl Iterator<Item = (f64, usize)> + '_ {
        let distances = self
            .positions
            .iter()
            .map(move |x| x.distance_squared(point));
        let near = distances
            .zip(0..)
            .filter(move |(d, _)| *d <= radius * radius);
        near.filter(|&(_, p)| {
            let free = each!(&self.solver, solver => {
                !solver.is_fixed(p) && solver.handle_of(p).is_none()
            });
            free && self.piece_of(p).is_some()
        })
    }

    /// The piece of a particle, unless it has lost all its tets.
    pub(crate) fn piece_of(&self, particle: usize) -> Option<u32> {
        let mut around = self.cuttable.around(ParticleId::new(particle));
        around.next().map(|tet| self.pieces.piece_of(tet))
    }

    /// Grabs the free particles within a radius around a point that belong to the piece of the particle `nearest`.
    /// Wakes the island.
    pub(crate) fn grab(
        &mut self,
        grab: Grab,
        nearest: usize,
        point: DVec3,
        radius: f64,
        compliance: f64,
    ) -> Result<(), Error> {
        let piece = self.piece_of(nearest);
        let near = self.holdable(point, radius).map(|(_, p)| p);
        let particles: Vec<usize> = near.filter(|&p| self.piece_of(p) == piece).collect();
        let Self { grabs, solver, .. } = self;
        grabs.take(grab, solver, &particles, point, compliance)?;
        if let (Some(forces), Some((handle, _))) = (&mut self.forces, self.grabs.held(grab)) {
            forces.forget(handle);
        }
        self.wake();
        Ok(())
    }

    /// Sets the target of a grab for the end of the next frame; returns whether the grab exists.
    pub(crate) fn move_grab(&mut self, grab: Grab, to: DVec3) -> bool {
        self.grabs.move_to(&mut self.solver, grab, to)
    }

    /// Releases the particles of a grab and wakes the island; returns whether the grab exists.
    pub(crate) fn release(&mut self, grab: Grab) -> Result<bool, Error> {
        let is_held = self.grabs.release(&mut self.solver, grab)?;
        if is_held {
            self.wake();
        }
        Ok(is_held)
    }

    /// Improves the mesh around particles that strokes created. Particles stay that a constraint names, beside which one
    /// is held, or where materials meet; those inside that strokes have passed, so that later strokes can continue there;
    /// and all of the boundary in a scene with contact. Leaves in `near` what is for the next frame.
    pub(crate) fn improve(
        &mut self,
        near: &mut Vec<ParticleId>,
        registry: &StrokeRegistry,
    ) -> Result<CutDelta, Error> {
        let Self {
            cuttable,
            positions,
            solver,
            distances,
            contacts,
            ..
        } = self;
        let options = ImproveOptions {
            keeps_boundary: contacts.is_some(),
            max_tets: IMPROVED_TETS.max(cuttable.mesh().tets.len() / IMPROVED_PART),
            ..ImproveOptions::default()
        };
        let improved = each!(solver, solver => {
            let is_locked = |mesh: &CuttableMesh, particle: ParticleId| {
                let mut around = mesh.around(particle);
                let Some(first) = around.next() else {
                    return true;
                };
                let material = solver.material_of(first.index());
                let corners = mesh.around(particle).flat_map(|tet| mesh.mesh().tets[tet.index()]);
                distances.holds(particle)
                    || (registry.is_on_surface(particle) && mesh.is_inside(particle))
                    || solver.handle_of(particle.index()).is_some()
                    || around.any(|tet| solver.material_of(tet.index()) != material)
                    || corners.into_iter().any(|p| !solver.is_free(p.index()))
            };
            improve(cuttable, positions, near, &options, is_locked)
        });
        improved.map_err(|source| Error::Cut {
            field: "cutting.improve".into(),
            source,
        })
    }

    /// Applies a delta to solver, pieces, clusters, colors, schedule and volume constraints, and wakes the island.
    /// Returns the events of its pieces.
    pub(crate) fn apply_delta(
        &mut self,
        delta: &CutDelta,
        ms: &mut Milliseconds,
    ) -> Result<Vec<PieceEvent>, Error> {
        self.wake();
        let positions = &self.cuttable.mesh().positions;
        for tet in &delta.deleted {
            self.removed_volume += signed_volume(tet.corners.map(|p| positions[p.index()]));
        }
        if delta.collapsed > 0 {
            // An improvement keeps the volume but for rounding.
            let volume =
                |corners: [ParticleId; 4]| signed_volume(corners.map(|p| positions[p.index()]));
            let before = delta.removed.iter().map(|tet| volume(tet.corners));
            let after = delta.added.iter().map(|tet| volume(tet.corners));
            self.removed_volume += before.sum::<f64>() - after.sum::<f64>();
        }
        let settings = &self.settings;
        for tet in delta.removed.iter().chain(&delta.deleted) {
            let data =
                each!(&self.solver, solver => accuracy_data(solver, tet.tet.index(), settings));
            self.outside.remove(data);
        }
        self.solver.apply_delta(delta, &self.cuttable)?;
        let mut stiffest = 0.0_f64;
        for tet in &delta.added {
            let slot = delta.slot_after(tet.tet).index();
            let data = each!(&self.solver, solver => accuracy_data(solver, slot, settings));
            stiffest = stiffest.max(data.1);
            self.outside.add(data);
        }
        if let Some(noted) = &mut self.cut_kappa {
            noted.new_tets = noted.new_tets.max(stiffest);
        }
        let events = self.pieces.apply_delta(&self.cuttable, delta);
        if let Some(contacts) = &mut self.contacts {
            contacts.apply_delta(&self.cuttable, delta);
        }
        self.partition.apply_delta(delta, &self.cuttable, ms)?;
        if let Some(recluster) = &mut self.recluster {
            recluster.note(delta);
        }
        if let Some(volumes) = &self.volumes {
            volumes.apply_delta(
                &mut self.solver,
                delta,
                &self.cuttable,
                &self.partition.schedule,
            )?;
        }
        self.solver.backend_mut().update_vbd(ms)?;
        self.solver
            .backend_mut()
            .lay_out(&self.partition.schedule, ms)?;
        Ok(events)
    }

    /// Renews clusters, colors and schedule if that is due in the frame of a number, after its strokes; tells whether it
    /// was.
    pub(crate) fn renew_partition(
        &mut self,
        frame: u64,
        ms: &mut Milliseconds,
    ) -> Result<bool, Error> {
        let Some(recluster) = &mut self.recluster else {
            return Ok(false);
        };
        let start = Instant::now();
        let renewed = recluster.advance(frame, &mut self.partition, &self.cuttable)?;
        if renewed {
            self.reschedule_volumes()?;
        }
        ms.cluster += milliseconds(start.elapsed());
        Ok(renewed)
    }

    /// Updates volume constraints for another partition.
    pub(crate) fn reschedule_volumes(&mut self) -> Result<(), Error> {
        let Some(volumes) = &self.volumes else {
            return Ok(());
        };
        let (nothing, schedule) = (CutDelta::default(), &self.partition.schedule);
        volumes.apply_delta(&mut self.solver, &nothing, &self.cuttable, schedule)
    }

    /// Makes [`Island::apply_delta`] note the largest kappa of the tets that the cuts of a frame create, and if wanted
    /// that of all tets before the first cut, which is O(tets).
    pub(crate) fn note_kappa(&mut self, before: bool) {
        if self.cut_kappa.is_none() {
            self.cut_kappa = Some(CutKappa {
                before: before.then(|| self.kappa()),
                new_tets: 0.0,
            });
        }
    }

    /// The largest kappa of a tet, had none been softened. O(tets).
    pub(crate) fn kappa(&self) -> f64 {
        each!(&self.solver, solver => solver.kappa(self.settings.substep_time()))
    }

    /// Recomputes everything derived and compares.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.cuttable.check().map_err(|source| Error::Cut {
            field: "mesh".into(),
            source,
        })?;
        let mesh = self.cuttable.mesh();
        let (initial, volume) = (self.initial_volume, mesh.total_volume());
        let farthest = |far: f64, x: &DVec3| far.max(x.abs().max_element());
        let far = mesh.positions.iter().fold(0.0, farthest) / initial.cbrt();
        // Far from the origin the positions of new particles are rounded by 1e-16 of the distance.
        let expected = initial - self.removed_volume;
        if (volume - expected).abs() > (1e-12 + 1e-15 * far) * initial {
            return Err(Error::Inconsistent(format!(
                "the volume at rest should be {expected} and is {volume}"
            )));
        }
        self.solver
            .check(&self.cuttable, &self.partition.schedule)?;
        self.grabs.check(&self.solver)?;
        if let Some(contacts) = &self.contacts {
            contacts.check(&self.cuttable)?;
        }
        self.partition.check(mesh)?;
        self.pieces
            .check(&self.cuttable)
            .map_err(|error| Error::Inconsistent(error.to_string()))
    }
}
