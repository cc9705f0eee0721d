//! [`State`]: the state of a simulation that changes with time.
//!
//! A snapshot is a copy of it, and a simulation with this state continues bit-identically. Data that can be derived is
//! left out and rebuilt: the layout of the solvers, and buffers on a device. Cost of a copy: O(particles + tets).

use std::sync::Arc;

use glam::DVec3;
use incise_cutting::{BoundaryTriangle, CutDelta, FaceTag};
use web_time::Instant;

use crate::attachment::AttachmentHandle;
use crate::blade_sides::touching;
use crate::collider::Colliders;
use crate::compute_device::ComputeDevice;
use crate::distance::DistanceHandle;
use crate::island::Island;
use crate::merged_mesh::MergedMesh;
use crate::pieces::PieceNumbers;
use crate::report::{CutReport, DetachedReport, FrameReport, Milliseconds, milliseconds};
use crate::scene::{Method, Precision, ReportSpec, SolverSpec};
use crate::strokes::Timeline;
use crate::{Error, Scene};

/// State of a simulation that changes with time. A copy has its solvers on the processor.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct State {
    /// The scene with all bodies, as each was added.
    #[cfg_attr(feature = "save", serde(with = "crate::saved::as_toml"))]
    pub(super) scene: Arc<Scene>,
    /// The settings of the solver as they are now.
    #[cfg_attr(feature = "save", serde(with = "crate::saved::as_toml"))]
    pub(super) solver: SolverSpec,
    pub(super) precision: Precision,
    #[cfg_attr(feature = "save", serde(skip))]
    pub(super) compute_device: ComputeDevice,
    pub(super) clock: Clock,
    pub(super) gravity: Option<DVec3>,
    /// The names of the colliders in the settings of all islands.
    pub(super) colliders: Colliders,
    pub(super) next: NextNumbers,
    /// Bodies that were removed, or will be at the start of the next frame.
    pub(super) removed: Vec<Removal>,
    pub(super) reporting: ReportSpec,
    /// In the order of their first bodies.
    pub(super) islands: Vec<Island>,
    pub(super) dependents: Dependents,
    pub(super) timeline: Timeline,
    #[cfg_attr(feature = "save", serde(skip))]
    pub(super) report: FrameReport,
    /// Whether the solvers have the residuals of the last frame.
    pub(super) residuals_kept: bool,
    /// Whether the islands have the forces of the last frame.
    pub(super) forces_measured: bool,
}

/// A body that a program removed.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Removal {
    /// Its number in the scene.
    pub(super) body: usize,
    /// Whether its tets are gone.
    pub(super) is_done: bool,
}

/// Results of the strokes and removals of a frame.
pub(super) struct Cut<'a> {
    /// The number of the frame.
    pub(super) number: u64,
    /// Whether kappa is noted, and if so, whether that before the cut too.
    pub(super) notes_kappa: Option<bool>,
    pub(super) deltas: &'a mut Vec<CutDelta>,
    pub(super) detached: &'a mut Vec<DetachedReport>,
    pub(super) report: Option<CutReport>,
    /// Milliseconds that noting kappa took.
    pub(super) measuring: f64,
}

/// Data of all islands together that depend on their meshes.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Dependents {
    /// All islands as one mesh, if there are several.
    pub(super) merged: Option<MergedMesh>,
    pub(super) pieces: PieceNumbers,
    /// Whether a particle lies on a cut; empty before the first.
    pub(super) on_cut: Vec<bool>,
}

impl Dependents {
    /// Applies the delta of the island of a number to all that depends on its mesh.
    fn apply_delta(
        &mut self,
        number: usize,
        island: &mut Island,
        delta: &CutDelta,
        cut: &mut Cut<'_>,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        if let Some(before) = cut.notes_kappa {
            let start = Instant::now();
            island.note_kappa(before);
            cut.measuring += milliseconds(start.elapsed());
        }
        let events = island.apply_delta(delta, ms)?;
        self.pieces
            .apply_delta(number, island, &events, cut.detached);
        cut.report.get_or_insert_default().add(delta);
        let of_merged = self
            .merged
            .as_mut()
            .map(|merged| merged.apply_delta(number, delta));
        let delta = of_merged.as_ref().unwrap_or(delta);
        self.on_cut.resize(delta.particles_after(), false);
        let bare = |triangle: &&BoundaryTriangle| triangle.tag != FaceTag::Outer;
        for triangle in delta.surface_added.iter().filter(bare) {
            for p in triangle.particles {
                self.on_cut[p.index()] = true;
            }
        }
        cut.deltas.push(delta.clone());
        Ok(())
    }
}

impl State {
    /// Returns islands `into` and `other`, of which `into` has the lower number, as one with present settings; changes
    /// nothing. O(tets of both), as clusters, colors and layout are made again.
    pub(super) fn joined(&self, into: usize, other: &Island) -> Result<Island, Error> {
        self.timeline.check_join()?;
        let scene = self.present(Scene::clone(&self.scene));
        self.islands[into].joined_with(other, &scene, &self.compute_device)
    }

    /// A scene with the settings of the present: solver and reports as they are now, no strokes of the start. While a solid
    /// blade is on its way, `auto` does not choose VBD.
    pub(super) fn present(&self, scene: Scene) -> Scene {
        let mut solver = self.solver.clone();
        if solver.method == Method::Auto && self.timeline.solid_field().is_some() {
            solver.method = Method::GaussSeidel;
        }
        Scene {
            solver,
            report: self.reporting.clone(),
            stroke: Vec::new(),
            ..scene
        }
    }

    /// Puts the island that two became in place of the first, and lets all numbers follow. No number that the outside
    /// knows changes.
    pub(super) fn put_joined(&mut self, into: usize, other: usize, joined: Island) {
        let particles = self.islands[into].positions.len();
        self.islands.remove(other);
        self.islands[into] = joined;
        self.dependents.pieces.join(into, other);
        if let Some(merged) = &mut self.dependents.merged {
            merged.join(into, other);
            // Single precision has rounded them to another origin.
            merged.collect_positions(&self.islands);
        }
        self.timeline.join(into, other, particles);
        self.residuals_kept = false;
        self.forces_measured = false;
    }

    /// Whether the next frame may change a mesh.
    pub(super) fn changes_meshes(&self) -> bool {
        self.timeline.is_due(self.clock.next_frame) || self.removed.iter().any(|r| !r.is_done)
    }

    /// Removes the tets of bodies that are to be removed, then carries out the strokes that are due.
    pub(super) fn carry_out(
        &mut self,
        cut: &mut Cut<'_>,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let Self {
            removed,
            timeline,
            islands,
            dependents,
            ..
        } = self;
        for removal in removed.iter_mut().filter(|removal| !removal.is_done) {
            let of_body = |island: &Island| island.bodies.contains(&removal.body);
            let Some(number) = islands.iter().position(of_body) else {
                continue;
            };
            let island = &mut islands[number];
            let delta = island.remove_tets_of(removal.body)?;
            removal.is_done = true;
            if !delta.is_empty() {
                timeline.apply_delta(number, island, &delta);
                dependents.apply_delta(number, island, &delta, cut, ms)?;
            }
        }
        timeline.advance(cut.number, islands, |number, island, delta| {
            dependents.apply_delta(number, island, delta, cut, ms)
        })?;
        if let (Some(report), Some(work)) = (&mut cut.report, timeline.take_new_work()) {
            report.work = Some(work);
        }
        for island in islands {
            let had_blades = !island.constraints.blades.is_empty();
            island.constraints.blades = touching(island, timeline.solids());
            // What a blade has held apart closes.
            if had_blades && island.constraints.blades.is_empty() {
                island.wake();
            }
            for (stroke, _) in &island.constraints.blades {
                timeline.note_touch(*stroke);
            }
        }
        Ok(())
    }
}

/// The numbers of the next handles; none is given twice.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct NextNumbers {
    pub(super) attachment: u32,
    pub(super) distance: u32,
    pub(super) grab: u64,
}

impl NextNumbers {
    /// Those after all handles of a scene.
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            attachment: AttachmentHandle::of_scene(scene.attachment.len()).0,
            distance: DistanceHandle::of_scene(scene.distance.len()).0,
            grab: 0,
        }
    }

    /// Gives no number that another simulation has given.
    pub(super) fn keep_numbers_of(&mut self, other: Self) {
        self.attachment = self.attachment.max(other.attachment);
        self.distance = self.distance.max(other.distance);
        self.grab = self.grab.max(other.grab);
    }
}

/// The number of the next frame, and the simulated time of every frame.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Clock {
    /// Length of a frame in s.
    pub(super) time_step: f64,
    /// The frame since which frames have this length, and the simulated time in s at its start.
    epoch: (u64, f64),
    pub(super) next_frame: u64,
}

impl Clock {
    /// A clock before the first frame.
    pub(super) fn new(time_step: f64) -> Self {
        Self {
            time_step,
            epoch: (0, 0.0),
            next_frame: 0,
        }
    }

    /// The simulated time in s at the start of a frame that is not before the last change of the time step.
    pub(super) fn time_at(&self, frame: u64) -> f64 {
        let (first, start) = self.epoch;
        start + (frame - first) as f64 * self.time_step
    }

    /// Sets the length of the frames to come in s.
    pub(super) fn set_time_step(&mut self, time_step: f64) {
        if time_step.to_bits() != self.time_step.to_bits() {
            self.epoch = (self.next_frame, self.time_at(self.next_frame));
            self.time_step = time_step;
        }
    }
}
