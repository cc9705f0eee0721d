//! [`Island`]: bodies that are solved together, with their solver, partition, attachments and cuts.
//!
//! Mostly a single body. Each island has its own mesh, solver, partition, substeps and origin. A stiff body therefore
//! does not slow down others, and a body moves bit-identically to a scene of its own. Cost: that of its parts.

mod join;
mod judged;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;
use incise_cutting::{
    CutDelta, CuttableMesh, ImproveOptions, ImproveQueue, PieceEvent, PieceTracker, StrokeRegistry,
    improve, remove_tets,
};
use incise_mesh::{Bounds, ParticleId, TetId, TetMesh, signed_volume};
use incise_xpbd::{
    Collider, ColliderShape, DistanceConstraint, KappaLimit, SolidBlade, StepReport, StepSettings,
};
use web_time::Instant;

pub(crate) use self::judged::Budget;
use self::judged::{Judged, accuracy_data};
use crate::attachment::{Attachment, AttachmentHandle};
use crate::backend::AnySolver;
use crate::compute_device::ComputeDevice;
use crate::contacts::Contacts;
use crate::distance::Distances;
use crate::forces::Measured;
use crate::grab::{Grab, Grabs};
use crate::island_builder::IslandBuilder;
use crate::masses::Masses;
use crate::method::{leaves_open, resolve};
use crate::partition::Partition;
use crate::recluster::Recluster;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::{
    AttachmentSpec, DistanceSpec, Method, Precision, Quantity, SolverSpec, Substeps,
};
use crate::sleep::SleepState;
use crate::volume::Volumes;
use crate::warning::Warning;
use crate::{Error, Scene, collider, distance};

/// What acts on the particles of an island besides its tets and gravity.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Constraints {
    pub(crate) attachments: Vec<Attachment>,
    /// Frames of removed attachments in the solver, for new ones.
    pub(crate) spare_frames: Vec<u32>,
    pub(crate) distances: Distances,
    /// The interactive grabs.
    pub(crate) grabs: Grabs,
    pub(crate) volumes: Option<Volumes>,
    /// In a scene with contact.
    pub(crate) contacts: Option<Box<Contacts>>,
    /// The solid blades of the frame that touch its cuts, with the numbers of their strokes.
    #[cfg_attr(feature = "save", serde(skip))]
    pub(crate) blades: Vec<(u32, SolidBlade)>,
    /// The work in J of the edges of these blades in the last frame.
    #[cfg_attr(feature = "save", serde(skip))]
    pub(crate) edge_work: Vec<f64>,
}

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
    pub(crate) masses: Masses,
    pub(crate) partition: Partition,
    /// Its colliders are where they are at the start of the next frame.
    pub(crate) settings: StepSettings,
    /// The settings of the solver as a scene says them, with the method that was chosen.
    #[cfg_attr(feature = "save", serde(with = "crate::saved::as_toml"))]
    pub(crate) spec: SolverSpec,
    pub(crate) constraints: Constraints,
    /// The forces of the last frame that measured them.
    pub(crate) forces: Option<Box<Measured>>,
    /// The present positions.
    pub(crate) positions: Vec<DVec3>,
    /// Its pieces, numbered within the island.
    pub(crate) pieces: PieceTracker,
    /// Volume at rest in m³ before all cuts.
    pub(crate) initial_volume: f64,
    /// Volume at rest in m³ that strokes have taken away.
    pub(crate) removed_volume: f64,
    pub(crate) judged: Judged,
    /// Whether it sleeps, in a scene where bodies may.
    pub(crate) sleep: Option<SleepState>,
    /// Background rebuild of the partition, in a scene with `recluster`.
    pub(crate) recluster: Option<Recluster>,
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

/// Tets that the improvement of a frame looks at, at least. Looking at one takes as long as some 40 Gauss-Seidel iterations
/// on one.
const IMPROVED_TETS: usize = 1000;
/// The improvement of a frame looks at one of so many tets of a larger island: a quarter of the time of 20 iterations.
const IMPROVED_PART: usize = 8;
/// With contact, the improvement of a frame does the work of so many frames, since contacts are searched for after each.
const FRAMES_AT_ONCE: usize = 4;

/// Bodies with their particles, which are consecutive.
fn bodies(joined: &IslandBuilder) -> impl Iterator<Item = (usize, Range<usize>)> {
    let mut end = 0;
    let of_bodies = joined.body_of_particle.chunk_by(|a, b| a == b);
    of_bodies.map(move |of_body| {
        let first = end;
        end += of_body.len();
        (of_body[0] as usize, first..end)
    })
}

/// The pressure of its own weight, in Young's moduli, that a body bears without a warning. Soft tissue has about 1. A box on
/// the ground loses a tenth of its volume at 1, a quarter at 2 and more than half at 4.
const LARGEST_WEIGHT: f64 = 2.0;

/// The warnings about bodies that collapse under their weight, mostly because lengths are not in m. O(particles).
fn too_heavy(
    scene: &Scene,
    settings: &StepSettings,
    joined: &IslandBuilder,
    mesh: &TetMesh,
) -> Vec<Warning> {
    let Some(gravity) = settings.gravity else {
        return Vec::new();
    };
    let warning = |(body, particles): (usize, Range<usize>)| {
        let spec = &scene.body[body];
        let positions = &mesh.positions[particles.clone()];
        let size = Bounds::around(positions.iter().copied()).size();
        let parts = spec.material.iter().filter_map(|part| part.young_modulus);
        let stiffest = parts.fold(spec.young_modulus, f64::max);
        let weight = spec.density * gravity.abs().dot(size) / stiffest;
        let moves = joined.fixed[particles].iter().any(|fixed| !fixed);
        (moves && weight > LARGEST_WEIGHT)
            .then(|| Warning::of_weight(body, size.max_element(), spec.scale, weight))
    };
    bodies(joined).filter_map(warning).collect()
}

/// How a scene names an obstacle of a solver: the ground comes first.
fn obstacle_name(scene: &Scene, number: usize) -> String {
    match number.checked_sub(usize::from(scene.world.ground.is_some())) {
        Some(number) => format!("collider[{number}]"),
        None => "the ground".into(),
    }
}

/// The width in m of an obstacle across the way in which bodies meet it; `None` for planes. A moving box goes along the
/// axis that is nearest to its velocity. One at rest counts as a plate that bodies come to lie on.
fn narrowest(collider: &Collider) -> Option<f64> {
    match collider.shape {
        ColliderShape::Plane { .. } => None,
        ColliderShape::Sphere { radius, .. } | ColliderShape::Capsule { radius, .. } => {
            Some(2.0 * radius)
        }
        ColliderShape::Box {
            half_extents,
            rotation,
            ..
        } => {
            let along = (rotation.normalize().inverse() * collider.velocity).abs();
            let ahead = if along == DVec3::ZERO {
                half_extents.min_position()
            } else {
                along.max_position()
            };
            let across = (0..3).filter(|&k| k != ahead);
            across.map(|k| 2.0 * half_extents[k]).reduce(f64::min)
        }
    }
}

/// The warnings about obstacles that fit between the particles of a body's surface. O(boundary triangles) if there are
/// obstacles other than planes.
fn thin_colliders(
    scene: &Scene,
    settings: &StepSettings,
    joined: &IslandBuilder,
    cuttable: &CuttableMesh,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let colliders = settings.colliders.iter().enumerate();
    let thin = colliders.filter_map(|(number, collider)| Some((number, narrowest(collider)?)));
    let thin: Vec<(usize, f64)> = thin.collect();
    if thin.is_empty() {
        return warnings;
    }
    let positions = &cuttable.mesh().positions;
    // By body the length of all edges and their number.
    let mut edges: BTreeMap<usize, (f64, u32)> = BTreeMap::new();
    for triangle in cuttable.boundary() {
        let corners = triangle.particles;
        let body = joined.body_of_particle[corners[0].index()] as usize;
        let [a, b, c] = corners.map(|p| positions[p.index()]);
        let (length, count) = edges.entry(body).or_default();
        *length += a.distance(b) + b.distance(c) + c.distance(a);
        *count += 3;
    }
    for (body, particles) in bodies(joined) {
        if joined.fixed[particles].iter().all(|fixed| *fixed) {
            continue;
        }
        let (length, count) = edges.get(&body).copied().unwrap_or_default();
        let edge = length / f64::from(count.max(1));
        let of_body = thin.iter().filter(|(_, thickness)| *thickness < edge);
        warnings.extend(of_body.map(|&(number, thickness)| {
            Warning::of_thin_collider(body, edge, &obstacle_name(scene, number), thickness)
        }));
    }
    warnings
}

/// The part of a body's size that a particle may start inside of a collider without a warning.
const STARTING_DEPTH: f64 = 0.01;

/// The warnings about bodies that start inside of a collider. O(particles · colliders).
fn starts_inside(
    scene: &Scene,
    settings: &StepSettings,
    joined: &IslandBuilder,
    mesh: &TetMesh,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    for (body, particles) in bodies(joined) {
        let positions = &mesh.positions[particles.clone()];
        let size = Bounds::around(positions.iter().copied()).size();
        let is_free = joined.fixed[particles].iter().map(|fixed| !fixed);
        let free = positions
            .iter()
            .zip(is_free)
            .filter(|(_, is_free)| *is_free);
        for (number, collider) in settings.colliders.iter().enumerate() {
            let depths = free.clone().map(|(&x, _)| -collider.distance(x).0);
            let depth = depths.fold(0.0, f64::max);
            if depth > STARTING_DEPTH * size.max_element() {
                let name = obstacle_name(scene, number);
                warnings.push(Warning::of_start_inside(body, depth, &name));
            }
        }
    }
    warnings
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
        let mut cuttable = CuttableMesh::new(mesh).map_err(Error::cut("body"))?;
        cuttable.record_opened_faces(scene.cutting.improve);
        let (mut solver, masses) = joined.solver(scene, precision, &cuttable)?;
        let (substeps, choice) = joined.substeps(scene, &solver, &cuttable);
        settings.substeps = substeps;
        let mut at_start = starts_inside(scene, &settings, &joined, cuttable.mesh());
        at_start.extend(too_heavy(scene, &settings, &joined, cuttable.mesh()));
        at_start.extend(thin_colliders(scene, &settings, &joined, &cuttable));
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
        let leaves_substeps_open = joined.substeps.iter().all(|s| *s == Substeps::Auto);
        let mut judged = Judged::new(choice, settings.substeps, cuttable.mesh());
        (judged.leaves_substeps_open, judged.leaves_method_open) = (leaves_substeps_open, is_open);
        let mut island = Self {
            recluster: recluster.map(Recluster::new),
            solver,
            partition,
            settings: settings.clone(),
            constraints: Constraints {
                attachments: joined.attachments,
                spare_frames: Vec::new(),
                distances: joined.distances,
                grabs: Grabs::default(),
                volumes,
                contacts,
                blades: Vec::new(),
                edge_work: Vec::new(),
            },
            forces: None,
            positions: Vec::new(),
            pieces: PieceTracker::new(&cuttable),
            initial_volume: cuttable.mesh().total_volume(),
            removed_volume: 0.0,
            cuttable,
            masses,
            bodies: joined.bodies,
            body_of: joined.body_of,
            judged,
            spec,
            sleep: scene.solver.sleep.map(SleepState::new),
        };
        island.solver.host().positions(&mut island.positions);
        island.judge_settings();
        let empty = joined.empty_regions.into_iter();
        island
            .judged
            .warnings
            .extend(empty.map(Warning::of_empty_region).chain(at_start));
        Ok(island)
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
            collider::advance(&mut self.settings);
            return Ok(StepReport::default());
        }
        // Its body was removed; its colliders are those of all islands and move on.
        if self.cuttable.mesh().tets.is_empty() {
            self.forces = None;
            if let Some(contacts) = &mut self.constraints.contacts {
                contacts.end(&mut self.solver)?;
            }
            collider::advance(&mut self.settings);
            return Ok(StepReport::default());
        }
        for attachment in &self.constraints.attachments {
            attachment.advance(frame, &mut self.solver);
        }
        self.solver.backend_mut().measure_forces(measuring_forces);
        if !self.constraints.blades.is_empty() {
            let blades = self
                .constraints
                .blades
                .iter()
                .map(|(_, blade)| blade.clone());
            self.set_blades(blades.collect())?;
        }
        let step = if self.constraints.contacts.is_some() {
            self.step_with_contact(keeping_residuals)
        } else {
            let (schedule, settings) = (&self.partition.schedule, &self.settings);
            let (backend, whole) = (self.solver.backend_mut(), 0..settings.substeps);
            backend.step(schedule, settings, whole, keeping_residuals)
        };
        // Also after an error: no blade may stay behind.
        if !self.constraints.blades.is_empty() {
            self.constraints.edge_work = self.solver.host().blade_work().to_vec();
            self.set_blades(Vec::new())?;
        }
        let step = step?;
        let strokes = self.constraints.blades.iter().map(|(stroke, _)| *stroke);
        let body_of_tet = |tet| self.body_of_tet(tet);
        let measured = measuring_forces
            .then(|| Measured::of(&self.solver, &self.cuttable, body_of_tet, strokes));
        self.forces = measured.flatten();
        self.judge_step();
        self.judge_inversion();
        collider::advance(&mut self.settings);
        self.constraints.grabs.arrive();
        for attachment in &mut self.constraints.attachments {
            attachment.arrive();
        }
        let time = self.settings.time_step;
        if let Some(rest) = self.sleep.as_mut().filter(|_| !moved) {
            let state = self.solver.backend_mut().state(None, &[Quantity::Speed])?;
            let falls_asleep = |speed| rest.count(speed, time);
            if state.max_speed.is_some_and(falls_asleep) {
                let solver = self.solver.edit()?;
                for p in 0..solver.particle_count() {
                    solver.set_velocity(p, DVec3::ZERO);
                }
            }
        }
        Ok(step)
    }

    /// Hands solid blades to the solver.
    fn set_blades(&mut self, blades: Vec<SolidBlade>) -> Result<(), Error> {
        let set = self.solver.edit()?.set_blades(blades);
        set.map_err(Error::xpbd("stroke.solid"))
    }

    /// A frame in parts, before each of which contacts are found.
    fn step_with_contact(&mut self, keeping_residuals: bool) -> Result<StepReport, Error> {
        let Self {
            constraints: Constraints { contacts, .. },
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
        let parts = contacts.begin_frame(solver, cuttable, pieces, time, substeps);
        let end = |part: u32| {
            let end = u64::from(substeps) * u64::from(part) / u64::from(parts);
            u32::try_from(end).unwrap_or(substeps)
        };
        for part in 0..parts {
            contacts.update(solver, cuttable, pieces, part, time / f64::from(parts))?;
            let (schedule, range) = (&partition.schedule, end(part)..end(part + 1));
            let backend = solver.backend_mut();
            let step = backend.step(schedule, settings, range, keeping_residuals)?;
            report.repaired += step.repaired + backend.read_back()?;
            report.jittered += step.jittered;
            contacts.note(solver, cuttable, pieces);
        }
        contacts.end_frame();
        contacts.judge_depth(cuttable, pieces, time);
        Ok(report)
    }

    /// The number of the body of a tet in the scene.
    pub(crate) fn body_of_tet(&self, tet: TetId) -> usize {
        let material = self.solver.host().material_of(tet.index());
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
        remove_tets(&mut self.cuttable, &tets, 0).map_err(Error::cut("body"))
    }

    /// For each material what its body, given by its number in the scene, asks for.
    pub(crate) fn asked<T>(&self, asks: impl Fn(usize) -> T) -> Vec<T> {
        let bodies = self.body_of.iter().map(|&body| self.bodies[body]);
        bodies.map(asks).collect()
    }

    /// Whether all tets have one density in kg/m³, and which.
    pub(crate) fn density(&self) -> Option<f64> {
        let materials = self.solver.host().materials();
        let first = materials.first()?.density;
        let same = materials.iter().all(|m| m.density == first);
        same.then_some(first)
    }

    /// The mass at rest in kg of each of its pieces that is wanted, by number. O(tets).
    pub(crate) fn masses(&self, wanted: impl Fn(u32) -> bool) -> BTreeMap<u32, f64> {
        let (mesh, solver) = (self.cuttable.mesh(), self.solver.host());
        let mut masses = BTreeMap::new();
        for t in (0..mesh.tets.len()).map(TetId::new) {
            let piece = self.pieces.piece_of(t);
            if wanted(piece) {
                let mass = solver.density_of(t.index()) * mesh.volume(t);
                *masses.entry(piece).or_insert(0.0) += mass;
            }
        }
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
        let spare = self.constraints.spare_frames.last().copied();
        attachment.attach(frame, &mut self.solver, spare)?;
        self.constraints.spare_frames.pop();
        if let Some(forces) = &mut self.forces {
            forces.forget(attachment.number);
        }
        self.constraints.attachments.push(attachment);
        self.wake();
        Ok(())
    }

    /// Releases the particles of an attachment and wakes the island; returns whether the attachment exists.
    pub(crate) fn remove_attachment(&mut self, name: AttachmentHandle) -> Result<bool, Error> {
        let Some(index) = self
            .constraints
            .attachments
            .iter()
            .position(|a| a.name == name)
        else {
            return Ok(false);
        };
        self.constraints.attachments[index].detach(&mut self.solver)?;
        self.constraints
            .spare_frames
            .push(self.constraints.attachments[index].number);
        self.constraints.attachments.remove(index);
        self.wake();
        Ok(true)
    }

    /// Hands changed distance constraints to the solver, and wakes it.
    pub(crate) fn update_distances(&mut self) -> Result<(), Error> {
        self.constraints.distances.hand_to(&mut self.solver)?;
        self.solver
            .backend_mut()
            .update_vbd(None, &mut Milliseconds::default())?;
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

    /// Whether a moving collider may reach it in the next frame. Positions on a device are not known, so there any may.
    fn is_reached(&self) -> bool {
        let colliders = self.settings.colliders.iter();
        let mut moving = colliders
            .filter(|collider| collider.velocity != DVec3::ZERO)
            .peekable();
        if moving.peek().is_none() || self.solver.is_on_device() {
            return moving.peek().is_some();
        }
        let bounds = Bounds::around(self.positions.iter().copied());
        let (middle, radius) = (
            bounds.low.midpoint(bounds.high),
            bounds.size().length() / 2.0,
        );
        let time = self.settings.time_step;
        moving.any(|collider| {
            let (distance, _) = collider.distance(middle);
            // What is no number is near.
            let is_far = distance > radius + collider.velocity.length() * time;
            !is_far
        })
    }

    /// Whether a handle or a grab moves in a frame, or a collider near it.
    fn is_moved(&self, frame: u64) -> bool {
        self.is_reached()
            || self
                .constraints
                .attachments
                .iter()
                .any(|attachment| attachment.moves(frame))
            || self.constraints.grabs.moves()
            || self
                .constraints
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
        let solver = self.solver.host();
        near.filter(|&(_, p)| {
            let free = !solver.is_fixed(p) && solver.handle_of(p).is_none();
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
        let grabs = &mut self.constraints.grabs;
        grabs.take(grab, &mut self.solver, &particles, point, compliance)?;
        if let (Some(forces), Some((handle, _))) =
            (&mut self.forces, self.constraints.grabs.held(grab))
        {
            forces.forget(handle);
        }
        self.wake();
        Ok(())
    }

    /// Sets the target of a grab for the end of the next frame; returns whether the grab exists.
    pub(crate) fn move_grab(&mut self, grab: Grab, to: DVec3) -> bool {
        self.constraints.grabs.move_to(&mut self.solver, grab, to)
    }

    /// Releases the particles of a grab and wakes the island; returns whether the grab exists.
    pub(crate) fn release(&mut self, grab: Grab) -> Result<bool, Error> {
        let is_held = self.constraints.grabs.release(&mut self.solver, grab)?;
        if is_held {
            self.wake();
        }
        Ok(is_held)
    }

    /// Improves the mesh around particles that strokes created. Particles stay that a constraint names, beside which one
    /// is held, or where materials meet. Later strokes can continue those in `registry`. Leaves in `queue` what is for the
    /// next frame.
    pub(crate) fn improve(
        &mut self,
        queue: &mut ImproveQueue,
        registry: &StrokeRegistry,
    ) -> Result<CutDelta, Error> {
        let Self {
            cuttable,
            positions,
            solver,
            constraints:
                Constraints {
                    distances,
                    contacts,
                    ..
                },
            ..
        } = self;
        let frames = contacts.as_ref().map_or(1, |_| FRAMES_AT_ONCE);
        let options = ImproveOptions {
            max_tets: frames * IMPROVED_TETS.max(cuttable.mesh().tets.len() / IMPROVED_PART),
            ..ImproveOptions::default()
        };
        let solver = solver.host();
        let is_locked = |mesh: &CuttableMesh, particle: ParticleId| {
            let mut around = mesh.around(particle);
            let Some(first) = around.next() else {
                return true;
            };
            let material = solver.material_of(first.index());
            let tets = mesh.around(particle);
            let mut corners = tets.flat_map(|tet| mesh.mesh().tets[tet.index()]);
            distances.holds(particle)
                || solver.handle_of(particle.index()).is_some()
                || around.any(|tet| solver.material_of(tet.index()) != material)
                || corners.any(|p| !solver.is_free(p.index()))
        };
        let improved = improve(cuttable, positions, queue, &options, registry, is_locked);
        improved.map_err(Error::cut("cutting.improve"))
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
        if delta.is_improvement() {
            // An improvement keeps the volume but for rounding.
            let volume =
                |corners: [ParticleId; 4]| signed_volume(corners.map(|p| positions[p.index()]));
            let before = delta.removed.iter().map(|tet| volume(tet.corners));
            let after = delta.added.iter().map(|tet| volume(tet.corners));
            self.removed_volume += before.sum::<f64>() - after.sum::<f64>();
        }
        let settings = &self.settings;
        for tet in delta.removed.iter().chain(&delta.deleted) {
            let data = accuracy_data(self.solver.host(), tet.tet.index(), settings);
            self.judged.outside.remove(data);
        }
        let masses = &mut self.masses;
        self.solver.apply_delta(delta, &self.cuttable, masses)?;
        let mut stiffest = 0.0_f64;
        for tet in &delta.added {
            let slot = delta.slot_after(tet.tet).index();
            let data = accuracy_data(self.solver.host(), slot, settings);
            stiffest = stiffest.max(data.1);
            self.judged.outside.add(data);
        }
        if let Some(noted) = &mut self.judged.cut_kappa {
            noted.new_tets = noted.new_tets.max(stiffest);
        }
        let events = self.pieces.apply_delta(&self.cuttable, delta);
        if let Some(contacts) = &mut self.constraints.contacts {
            contacts.apply_delta(&self.cuttable, delta);
        }
        self.partition.apply_delta(delta, &self.cuttable, ms)?;
        if let Some(recluster) = &mut self.recluster {
            recluster.note(delta);
        }
        if let Some(volumes) = &self.constraints.volumes {
            volumes.apply_delta(
                &mut self.solver,
                delta,
                &self.cuttable,
                &self.partition.schedule,
            )?;
        }
        let added = delta.added.iter().map(|tet| delta.slot_after(tet.tet));
        let relinked = delta.relinked.iter().map(|tet| delta.slot_after(tet.tet));
        let moved = delta.moved.iter().map(|tet| tet.to);
        let changed: Vec<u32> = added
            .chain(relinked)
            .chain(moved)
            .map(|tet| tet.0)
            .collect();
        self.solver.backend_mut().update_vbd(Some(&changed), ms)?;
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
        let Some(volumes) = &self.constraints.volumes else {
            return Ok(());
        };
        let (nothing, schedule) = (CutDelta::default(), &self.partition.schedule);
        volumes.apply_delta(&mut self.solver, &nothing, &self.cuttable, schedule)
    }

    /// The volume at rest in m³, without what was removed. O(1): the sum over all tets takes as long as many cuts.
    pub(crate) fn volume(&self) -> f64 {
        self.initial_volume - self.removed_volume
    }

    /// Recomputes everything derived and compares.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.cuttable.check().map_err(Error::cut("mesh"))?;
        let mesh = self.cuttable.mesh();
        let (initial, volume) = (self.initial_volume, mesh.total_volume());
        let farthest = |far: f64, x: &DVec3| far.max(x.abs().max_element());
        let far = mesh.positions.iter().fold(0.0, farthest) / initial.cbrt();
        // Far from the origin the positions of new particles are rounded by 1e-16 of the distance.
        let expected = self.volume();
        if (volume - expected).abs() > (1e-12 + 1e-15 * far) * initial {
            return Err(Error::Inconsistent(format!(
                "the volume at rest should be {expected} and is {volume}"
            )));
        }
        self.solver
            .check(&self.cuttable, &self.partition.schedule, &self.masses)?;
        self.constraints.grabs.check(&self.solver)?;
        if let Some(contacts) = &self.constraints.contacts {
            contacts.check(&self.cuttable)?;
        }
        self.partition.check(mesh)?;
        self.pieces
            .check(&self.cuttable)
            .map_err(|error| Error::Inconsistent(error.to_string()))
    }
}
