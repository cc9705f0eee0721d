//! [`FrameReport`]: counts, times and quantities of a frame, as one line of JSON.
//!
//! Only quantities that were computed appear.

use std::time::Duration;

use glam::DVec3;
use incise_cutting::CutDelta;
use incise_xpbd::Softened;
use serde::Serialize;

use crate::scene::{Method, SolverSpec};
pub use crate::substeps::{Choice, Shortfall};
use crate::warning::Warning;

/// Report on a frame: counts, times, and the quantities that the scene requests.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameReport {
    /// Number of the frame, from 0.
    pub frame: u64,
    /// Simulated time at the end of the frame in s.
    pub time_s: f64,
    /// Number of particles.
    pub particles: usize,
    /// Number of tets.
    pub tets: usize,
    /// Number of clusters with at least one tet.
    pub clusters: usize,
    /// Number of colors of the schedule; the largest if bodies are solved separately.
    pub colors: usize,
    /// Number of pieces: sets of tets connected through shared particles.
    pub pieces: usize,
    /// Counts of the frame's cuts, if there were any.
    pub cut: Option<CutReport>,
    /// Pieces detached in this frame, in order; absent if none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub detached: Vec<DetachedReport>,
    /// Wall time by stage.
    pub ms: Milliseconds,
    /// Residuals of the last substep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<ResidualReport>,
    /// Energies in J.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergyReport>,
    /// Volume in m³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// Volume over volume at rest, minus 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_error: Option<f64>,
    /// The smallest volume of a tet as a fraction of its volume at rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_volume_ratio: Option<f64>,
    /// The largest speed of a particle in m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_speed: Option<f64>,
    /// Tets without volume or turned inside out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverted_tets: Option<usize>,
    /// The largest `E Δt² / (ρ h²)` of a tet, had none been softened: accurate up to about 0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa: Option<f64>,
    /// The tets softened to keep the limit of kappa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub softened: Option<SoftenedReport>,
    /// Substeps and kappa by body, in the order of the scene; in all frames if `substeps` is `auto` for a body or
    /// bodies may sleep, otherwise where kappa is reported.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyReport>,
    /// Contacts, in a scene that declares contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactReport>,
    /// Forces: on attachments, on the ground, on colliders, on grabs, on solid blades, on what fixed particles are fixed to,
    /// then between bodies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<ForceReport>,
    /// Number of particles that were put back because they would have become Inf or NaN; absent if none. From a device
    /// it is known only in frames that read data back (for a blade or a reported quantity), for all frames since the
    /// last one.
    #[serde(skip_serializing_if = "is_zero")]
    pub repaired: usize,
    /// Warnings about the frame; absent if none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
    /// Number of islands whose clusters and colors were rebuilt in the background and replaced in this frame; absent if
    /// none.
    #[serde(skip_serializing_if = "is_zero")]
    pub reclustered: usize,
    /// Compute device: `cpu` or `gpu`.
    pub backend: &'static str,
    /// Precision of the solver: `f32` or `f64`.
    pub precision: &'static str,
}

impl FrameReport {
    /// Returns the warnings about the frame; empty in most frames.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

fn is_none(milliseconds: &f64) -> bool {
    *milliseconds == 0.0
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The method that solves a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ChosenMethod {
    /// Gauss-Seidel.
    GaussSeidel,
    /// Jacobi, as the scene names it.
    Jacobi,
    /// Chebyshev, as the scene names it.
    Chebyshev,
    /// VBD, as the scene names it.
    Vbd,
    /// VBD with a coarse correction after each sweep.
    TwoLevelVbd,
}

impl ChosenMethod {
    /// The method of settings; `auto` is replaced before.
    pub(crate) fn of(spec: &SolverSpec) -> Self {
        match spec.method {
            Method::Auto | Method::GaussSeidel => Self::GaussSeidel,
            Method::Jacobi => Self::Jacobi,
            Method::Chebyshev => Self::Chebyshev,
            Method::Vbd if spec.two_level => Self::TwoLevelVbd,
            Method::Vbd => Self::Vbd,
        }
    }
}

/// A body's substeps and kappa, or those of bodies that are joined and therefore solved together.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BodyReport {
    /// Numbers of the bodies in the scene; one unless distances or contact join several.
    pub bodies: Vec<usize>,
    /// Substeps of a frame.
    pub substeps: u32,
    /// Chosen method; only if substeps or method are `auto`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<ChosenMethod>,
    /// Iterations of a substep, for VBD the largest number; only if substeps or method are `auto`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u32>,
    /// Whether the body sleeps, in a scene where bodies may sleep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asleep: Option<bool>,
    /// Details of the choice by `auto`; its keys are written among those of the body.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub choice: Option<Choice>,
    /// The largest `E Δt² / (ρ h²)` of a tet, had none been softened; where kappa is reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa: Option<f64>,
    /// The largest `E Δt² / (ρ h²)` of a tet before the cut of this frame, had none been softened; where kappa is
    /// reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa_before_cut: Option<f64>,
    /// The largest kappa of the tets that the cut of this frame has made, had none been softened.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa_of_new_tets: Option<f64>,
    /// The tets softened to keep the limit of kappa; where kappa is reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub softened: Option<SoftenedReport>,
}

/// Counts and quality of the cuts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CutReport {
    /// Number of tets that were cut.
    pub tets_cut: usize,
    /// Number of tets that cut tets were split into.
    pub tets_created: usize,
    /// Number of new particles, on edges and as copies.
    pub particles_created: usize,
    /// Number of particles that the cut surface was snapped to.
    pub snapped: usize,
    /// Parts too small to come off, which stayed with the other side of a cut; absent if none. A moving blade may find
    /// one in several frames.
    #[serde(skip_serializing_if = "is_zero")]
    pub crumbs: usize,
    /// Particles of earlier cuts that the improvement after a stroke took out; absent if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub collapsed: usize,
    /// Tets that these took with them, whose volume others have now; absent if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub tets_merged: usize,
    /// Edges inside that the improvement after a stroke flipped away; absent if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub flipped: usize,
    /// The smallest volume of a new tet as a fraction of the one it was cut from.
    pub worst_volume_ratio: f64,
    /// Number of removed tets; absent if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub tets_removed: usize,
    /// The smallest and the largest dihedral angle of a new tet at rest in degrees; absent if none is new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dihedral: Option<[f64; 2]>,
    /// Work in J of the parting by blades with a toughness: toughness times new area of the cut at rest; absent if there is
    /// none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub work: Option<f64>,
}

/// What the blade of a stroke has parted against the toughness of the tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub struct CutWork {
    /// Work in J that the edge has done on its way through tissue: the force at the edge times the way, summed up. It differs
    /// from `toughness · area` by what the edge is ahead of the open cut, or the cut of the edge: less than a tet.
    pub work: f64,
    /// Area of the cut in m² at rest, of one of its sides.
    pub area: f64,
}

impl CutReport {
    /// Returns whether strokes or removals have changed the mesh, not only its improvement after strokes.
    #[must_use]
    pub fn has_cut(&self) -> bool {
        self.tets_cut + self.particles_created + self.tets_removed > 0
    }

    /// Adds what a stroke changed.
    pub(crate) fn add(&mut self, delta: &CutDelta) {
        if delta.is_improvement() {
            self.collapsed += delta.collapsed;
            self.flipped += delta.flipped;
            self.tets_merged += delta.deleted.len();
            return;
        }
        self.tets_cut += delta.removed.len();
        self.tets_created += delta.added.len();
        self.particles_created += delta.points.len() + delta.copies.len();
        self.snapped += delta.snapped;
        self.crumbs += delta.crumbs;
        self.tets_removed += delta.deleted.len();
        self.worst_volume_ratio = self.worst_volume_ratio.min(delta.worst_volume_ratio);
        let range = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.max(d)];
        self.dihedral = match (self.dihedral, delta.dihedral) {
            (Some(known), Some(new)) => Some(range(known, new)),
            (known, new) => known.or(new),
        };
    }
}

impl Default for CutReport {
    fn default() -> Self {
        Self {
            tets_cut: 0,
            tets_created: 0,
            particles_created: 0,
            snapped: 0,
            crumbs: 0,
            collapsed: 0,
            flipped: 0,
            tets_merged: 0,
            tets_removed: 0,
            worst_volume_ratio: 1.0,
            dihedral: None,
            work: None,
        }
    }
}

/// A part that was detached from a piece and is a new piece.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Deserialize))]
pub struct DetachedReport {
    /// The number of the new piece.
    pub piece: u32,
    /// The piece it was part of, which keeps the rest.
    pub from: u32,
    /// Its tets.
    pub tets: usize,
    /// Its volume at rest in m³.
    pub volume: f64,
    /// Its mass in kg.
    pub mass: f64,
}

/// A piece: tets connected through shared particles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PieceReport {
    /// Number of the piece, which never changes.
    pub id: u32,
    /// The piece it was detached from; absent for pieces from before all cuts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent: Option<u32>,
    /// The number of its body in the scene.
    pub body: usize,
    /// Its tets.
    pub tets: usize,
    /// Its volume at rest in m³.
    pub volume: f64,
    /// Its mass in kg.
    pub mass: f64,
}

/// Wall time by stage in ms; 0 for stages that did not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Milliseconds {
    /// Cutting the mesh, updating its pieces, and applying the cut to the solver.
    pub cut: f64,
    /// Updating clusters.
    pub cluster: f64,
    /// Coloring new clusters.
    pub color: f64,
    /// Sorting the schedule.
    pub schedule: f64,
    /// Sending to a device.
    pub upload: f64,
    /// Solving. On a device: submitting the frame, after waiting for the frame before the last one; the device
    /// continues asynchronously.
    pub solve: f64,
    /// Finding and coloring contacts, where contact is declared: the time of the slowest island.
    #[serde(skip_serializing_if = "is_none")]
    pub contact: f64,
    /// Waiting for a device and reading back, if a blade or a reported quantity needs it.
    pub readback: f64,
    /// Everything else: positions and reported quantities.
    pub other: f64,
    /// The whole frame.
    pub total: f64,
}

/// Residuals of the last substep. VBD has no multipliers, and therefore no primal and dual ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ResidualReport {
    /// Primal residual in kg·m: the part of the equations of motion that XPBD leaves out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primal: Option<f64>,
    /// `primal` as a part of the weight's norm times the square of the substep; absent without gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primal_relative: Option<f64>,
    /// Dual residual, without unit: the error of the constraints that XPBD iterates on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dual: Option<f64>,
    /// Root mean square of the dual residual over all constraints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dual_rms: Option<f64>,
    /// Unbalanced force of the implicit step in N, from positions alone. For XPBD it includes forces of colliders; for
    /// VBD it does not.
    pub force: f64,
    /// `force` as a part of the weight's norm; absent without gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_relative: Option<f64>,
    /// Potential in J that the implicit step minimizes.
    pub potential: f64,
}

/// Counts and depths of the contacts of a frame. Depths are in mean edge lengths of the surface at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ContactReport {
    /// Contacts that could press in the frame: vertices near triangles, and pairs across fresh cuts.
    pub candidates: usize,
    /// Contacts that pressed; in a frame that was solved in parts, those of its last part.
    pub active: usize,
    /// Number of colors of the contacts, pairs and vertices together, in the island with the most.
    pub colors: usize,
    /// Largest depth of an overlap at the end of the frame; 0 if there is none.
    pub max_depth: f64,
    /// 99th percentile of the depths of contacts that press or overlap.
    pub depth_p99: f64,
    /// Vertices deep in another body or piece from which no way out was found. They are not pushed out.
    pub buried: usize,
}

/// Counts of the contacts of an island after a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct ContactCounts {
    pub(crate) candidates: usize,
    pub(crate) active: usize,
    pub(crate) colors: usize,
    pub(crate) buried: usize,
}

impl ContactReport {
    /// Of counts of islands and all depths of those that press or overlap.
    pub(crate) fn new(counts: impl Iterator<Item = ContactCounts>, mut depths: Vec<f64>) -> Self {
        depths.sort_unstable_by(f64::total_cmp);
        let mut report = Self {
            max_depth: depths.last().copied().unwrap_or(0.0),
            // The smallest that at least 99 of 100 do not exceed.
            depth_p99: match (99 * depths.len()).div_ceil(100) {
                0 => 0.0,
                rank => depths[rank - 1],
            },
            ..Self::default()
        };
        for counts in counts {
            report.candidates += counts.candidates;
            report.active += counts.active;
            report.colors = report.colors.max(counts.colors);
            report.buried += counts.buried;
        }
        report
    }
}

/// The force between two pieces that touch: [`Simulation::contacts`](crate::Simulation::contacts).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContactForce {
    /// The numbers of the pieces.
    pub pieces: [u32; 2],
    /// The numbers of their bodies in the scene.
    pub bodies: [usize; 2],
    /// The force in N on the second piece with friction, the mean of the last frame. The first has its opposite.
    pub force: DVec3,
    /// The torque of that force about the origin of the world in N·m.
    pub torque: DVec3,
}

/// The mean force of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Force {
    /// The force in N.
    #[serde(serialize_with = "components")]
    pub force: DVec3,
    /// The torque about `point` in N·m.
    #[serde(serialize_with = "components")]
    pub torque: DVec3,
    /// The point in m that the torque is about.
    #[serde(serialize_with = "components")]
    pub point: DVec3,
}

impl Force {
    /// Moves the torque from the origin of the world to a point.
    pub(crate) fn new(force: incise_xpbd::Force, point: DVec3) -> Self {
        Self {
            force: force.force,
            torque: force.torque_about(point),
            point,
        }
    }
}

fn components<S: serde::Serializer>(v: &DVec3, serializer: S) -> Result<S::Ok, S::Error> {
    v.to_array().serialize(serializer)
}

/// What a force acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ForceKind {
    /// An attachment.
    Attachment,
    /// The ground of the scene.
    Ground,
    /// A collider.
    Collider,
    /// A grab.
    Grab,
    /// The solid blade of a stroke.
    Blade,
    /// What the fixed particles of a body are fixed to.
    Fixed,
    /// A body, from another one that touches it.
    Contact,
}

/// The mean force of a frame and what it acts on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ForceReport {
    /// What the force acts on.
    pub kind: ForceKind,
    /// Its number: attachments and colliders in the order of the scene and then of addition, grabs in the order of their
    /// bodies, blades by stroke, bodies in the order of the scene; 0 for the ground.
    pub index: usize,
    /// The body that a contact force comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other: Option<usize>,
    /// The force.
    #[serde(flatten)]
    pub force: Force,
}

/// Energies in J.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EnergyReport {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Elastic energy.
    pub elastic: f64,
    /// Gravitational energy, relative to the origin.
    pub gravity: f64,
}

/// Tets that `kappa_limit` has made softer than their material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SoftenedReport {
    /// Number of softened tets.
    pub tets: usize,
    /// Share of the softened tets in the volume at rest.
    pub volume_fraction: f64,
    /// Largest factor by which the stiffness of a tet was divided.
    pub strongest: f64,
}

impl From<Softened> for SoftenedReport {
    fn from(softened: Softened) -> Self {
        let Softened {
            tets,
            volume_fraction,
            strongest,
        } = softened;
        Self {
            tets,
            volume_fraction,
            strongest,
        }
    }
}

/// A duration in ms.
pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
