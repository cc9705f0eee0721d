//! [`FrameReport`]: what a frame did, as one line of JSON.
//!
//! Only quantities that were computed appear.

use std::time::Duration;

use incise_cutting::CutDelta;
use incise_xpbd::Softened;
use serde::Serialize;

use crate::scene::{Method, SolverSpec};
pub use crate::substeps::{Choice, Missed};
use crate::warning::Warning;

/// What a frame did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameReport {
    /// Number of the frame, from 0.
    pub frame: u64,
    /// Simulated time at its end in s.
    pub time_s: f64,
    /// Particles.
    pub particles: usize,
    /// Tets.
    pub tets: usize,
    /// Clusters with at least one tet.
    pub clusters: usize,
    /// Colors.
    pub colors: usize,
    /// Pieces: sets of tets connected through shared particles.
    pub pieces: usize,
    /// What was cut, if anything.
    pub cut: Option<CutReport>,
    /// What came off in this frame, in the order in which it did; absent if nothing.
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
    /// By body what its substeps and its kappa are, in the order of the scene; in all frames if `substeps` is `auto` for
    /// a body or bodies may sleep, else where kappa is reported, else absent.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyReport>,
    /// Particles that had to be put back because they would have become infinite; absent if none. From a device they
    /// are known in the frames that ask it for something (a blade, a quantity of the state), for all frames since.
    #[serde(skip_serializing_if = "is_zero")]
    pub repaired: usize,
    /// What must be known about the frame; absent if nothing. See [`Warning`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
    /// Islands of joined bodies whose clusters and colors were rebuilt in the background and taken in this frame; absent
    /// if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub reclustered: usize,
    /// Where it was computed: `cpu` or `gpu`.
    pub backend: &'static str,
    /// In which precision: `f32` or `f64`.
    pub precision: &'static str,
}

impl FrameReport {
    /// What must be known about the frame; empty in most frames.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
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
    /// The numbers of the bodies in the scene; mostly one.
    pub bodies: Vec<usize>,
    /// Substeps of a frame.
    pub substeps: u32,
    /// The method, where substeps or method are `auto`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<ChosenMethod>,
    /// Iterations of a substep, for VBD the most of them, where substeps or method are `auto`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u32>,
    /// Whether it is at rest and not solved, in a scene where bodies may sleep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asleep: Option<bool>,
    /// How they were chosen, if `auto` was to: its keys are among those of the body.
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

/// What a frame's strokes cut.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CutReport {
    /// Tets that were cut.
    pub tets_cut: usize,
    /// Tets they were cut into.
    pub tets_created: usize,
    /// New particles, on edges and as copies.
    pub particles_created: usize,
    /// Particles the surface was bent to.
    pub snapped: usize,
    /// Parts too small to come off, which stayed with the other side of a cut; absent if none. A moving blade may find
    /// one in several frames.
    #[serde(skip_serializing_if = "is_zero")]
    pub crumbs: usize,
    /// The smallest volume of a new tet as a fraction of the one it was cut from.
    pub worst_volume_ratio: f64,
    /// Tets that were taken away; absent if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub tets_removed: usize,
    /// The smallest and the largest dihedral angle of a new tet at rest in degrees; absent if none is new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dihedral: Option<[f64; 2]>,
}

impl CutReport {
    /// Adds what a stroke changed.
    pub(crate) fn add(&mut self, delta: &CutDelta) {
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
            tets_removed: 0,
            worst_volume_ratio: 1.0,
            dihedral: None,
        }
    }
}

/// A part that came off a piece and is a piece of its own from now on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Deserialize))]
pub struct DetachedReport {
    /// The number of the new piece.
    pub piece: u32,
    /// The piece that it came off, which keeps the rest.
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
    /// Its number, which it keeps.
    pub id: u32,
    /// The piece that it came off; absent for those that were there before all cuts.
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

/// Wall time by stage in ms; stages that did not happen took none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Cutting the mesh, following its pieces and handing the cut to the solver.
    pub cut: f64,
    /// Updating clusters.
    pub cluster: f64,
    /// Coloring new clusters.
    pub color: f64,
    /// Sorting the schedule.
    pub schedule: f64,
    /// Sending to a device.
    pub upload: f64,
    /// Solving. On a device: telling it what to do, after waiting for the frame before the last one if that is not done; it
    /// works on by itself.
    pub solve: f64,
    /// Waiting for a device and fetching from it, where that is needed: for a blade, for a reported quantity.
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
    /// What XPBD drops, in kg·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primal: Option<f64>,
    /// `primal` as a part of the weight's norm times the square of the substep; absent without gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primal_relative: Option<f64>,
    /// What it iterates on, without unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dual: Option<f64>,
    /// Its root mean square over all constraints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dual_rms: Option<f64>,
    /// The unbalanced force of the implicit step in N, from positions alone. XPBD counts that of colliders as
    /// unbalanced; VBD leaves out what they bear.
    pub force: f64,
    /// `force` as a part of the weight's norm; absent without gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_relative: Option<f64>,
    /// The energy in J that the implicit step would make least.
    pub potential: f64,
}

/// Energies in J.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyReport {
    /// Of motion.
    pub kinetic: f64,
    /// Of deformation.
    pub elastic: f64,
    /// Of height, relative to the origin.
    pub gravity: f64,
}

/// Tets that are softer than their material, because no substep of this length could follow them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SoftenedReport {
    /// How many.
    pub tets: usize,
    /// Their share of the volume at rest.
    pub volume_fraction: f64,
    /// The largest factor by which one's stiffness was divided.
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
