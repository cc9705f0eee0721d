//! [`Snapshot`]: a simulation at one moment, to come back to, as a viewer does that takes cuts back.
//!
//! It is a copy of everything that decides what comes next: meshes, cuts, pieces, solvers, plans, handles, obstacles,
//! strokes under way. What follows from the rest is left out and made anew: the layout of the solvers, and what a device
//! has. (Undoing a [`CutDelta`](incise_cutting::CutDelta) takes back a mesh; it does not take back where the body has
//! moved since, which is why cuts are taken back this way.)
//!
//! Cost: a copy of all arrays, 0.25 to 0.4 kB a tet, with VBD up to 0.6; the first step after coming back lays out
//! all tets, and sends a device everything.

use std::sync::Arc;

use glam::DVec3;

use super::Simulation;
use crate::collider::Colliders;
use crate::group::Group;
use crate::limits::value;
use crate::pieces::PieceNumbers;
use crate::place::Place;
use crate::recluster::Recluster;
use crate::report::FrameReport;
use crate::scene::{Quantity, ReportSpec, SolverSpec};
use crate::strokes::Timeline;
use crate::whole::Whole;
use crate::{Error, Scene};

/// A simulation at one moment: see [`Simulation::snapshot`].
#[derive(Clone, Debug)]
pub struct Snapshot {
    scene: Arc<Scene>,
    solver: SolverSpec,
    time_step: f64,
    epoch: (u64, f64),
    gravity: Option<DVec3>,
    colliders: Colliders,
    quantities: Vec<Quantity>,
    every: u64,
    place: Place,
    /// With their solvers on the processor.
    groups: Vec<Group>,
    whole: Option<Whole>,
    pieces: PieceNumbers,
    timeline: Timeline,
    on_cut: Vec<bool>,
    next_frame: u64,
    report: FrameReport,
    residuals_kept: bool,
}

/// Bytes of a tet in what a cut needs: corners, the lists of the stars around its corners, the links of its faces.
const CUTTING: usize = 16 + 32 + 16;
/// Bytes of a particle there: its position at rest, the head of its list.
const CUTTING_PARTICLE: usize = 24 + 4;
/// About the bytes of a tet in clusters, colors and schedule; with clusters of 10 it is 54, with smaller ones more.
const PLAN: usize = 58;
/// Bytes of a tet in the lists of pieces.
const PIECES: usize = 4;
/// Bytes of a particle's present position.
const POSITION: usize = 24;

impl Snapshot {
    /// About the bytes that it takes, for who keeps a budget: solvers and the whole to the byte, the rest by what a tet
    /// and a particle take there. Off by a fifth at most in the scenes of the tests; what strokes remember of earlier
    /// cuts is the least certain. O(bodies + particles).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let groups = self.groups.iter().map(Group::bytes);
        let particles = |group: &Group| group.positions.len();
        let particles = self.groups.iter().map(particles).sum();
        let on_cut = self.on_cut.iter().filter(|on_cut| **on_cut).count();
        groups.sum::<usize>()
            + self.whole.as_ref().map_or(0, Whole::bytes)
            + self.timeline.bytes(particles, on_cut)
            + self.on_cut.len()
    }
}

impl Group {
    /// About the bytes of a copy; a plan in the making counts as one.
    fn bytes(&self) -> usize {
        let mesh = self.cuttable.mesh();
        let (particles, tets) = (mesh.positions.len(), mesh.tets.len());
        let pending = self.recluster.as_ref().is_some_and(Recluster::is_pending);
        let plans = 1 + usize::from(pending);
        self.solver.bytes()
            + tets * (CUTTING + PIECES + plans * PLAN)
            + particles * (CUTTING_PARTICLE + POSITION)
    }
}

impl Simulation {
    /// The present moment, to come back to with [`Simulation::restore`].
    ///
    /// A state on a device is fetched. Clusters that are made in the background are waited for; they are taken in the
    /// frame in which they would be. O(particles + tets).
    ///
    /// # Errors
    /// If the device is lost.
    ///
    /// # Example
    /// A cut is taken back.
    /// ```
    /// use incise::{Scene, Simulation, scene::StrokeSpec};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// let before = simulation.snapshot()?;
    /// simulation.cut(StrokeSpec::Plane {
    ///     frame: 0,
    ///     point: [0.01, 0.0, 0.0],
    ///     normal: [1.0, 0.0, 0.0],
    ///     snap: 0.1,
    /// })?;
    /// assert_eq!(simulation.step()?.pieces, 2);
    /// simulation.restore(&before)?;
    /// assert_eq!(simulation.report().pieces, 1);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn snapshot(&mut self) -> Result<Snapshot, Error> {
        self.read_back()?;
        for group in &mut self.groups {
            if let Some(recluster) = &mut group.recluster {
                recluster.settle()?;
            }
        }
        // Whoever adds a field says here whether it belongs to a moment.
        let Self {
            scene,
            solver,
            time_step,
            epoch,
            gravity,
            colliders,
            // Of the scene, which does not change.
            precision: _,
            quantities,
            every,
            place,
            // Of the simulation, whatever the moment.
            at_hand: _,
            groups,
            whole,
            pieces,
            timeline,
            on_cut,
            // Of the last frame only.
            deltas: _,
            events: _,
            next_frame,
            report,
            residuals_kept,
            pool: _,
        } = self;
        Ok(Snapshot {
            scene: Arc::clone(scene),
            solver: solver.clone(),
            time_step: *time_step,
            epoch: *epoch,
            gravity: *gravity,
            colliders: colliders.clone(),
            quantities: quantities.clone(),
            every: *every,
            place: place.clone(),
            groups: groups.clone(),
            whole: whole.clone(),
            pieces: pieces.clone(),
            timeline: timeline.clone(),
            on_cut: on_cut.clone(),
            next_frame: *next_frame,
            report: report.clone(),
            residuals_kept: *residuals_kept,
        })
    }

    /// Comes back to a moment: what follows is to the bit what would have followed then, on a device on the same device
    /// and driver. The snapshot can be used again.
    ///
    /// Everything goes back: also what [`Simulation::retune`] and [`Simulation::set_report`] have set and the number of the
    /// next frame. Strokes added since are gone, and who computes is who computed then. Grabs and strokes begun since are
    /// void: their numbers may come to name later ones. Whoever wants to keep the present settings of the solver hands a
    /// copy of [`Simulation::solver_spec`] to `retune` afterwards. [`Simulation::deltas`] is empty: renderers and recorders
    /// begin anew from [`Simulation::boundary`], and find other buffers in the solvers of a device. O(particles + tets).
    ///
    /// # Errors
    /// If the snapshot is of a simulation of another scene, or the device is lost or out of memory; nothing has changed
    /// then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), Error> {
        if !is_same(&self.scene, &snapshot.scene) {
            let range = "of a simulation of the same scene";
            return Err(value("the snapshot", "of another scene", range));
        }
        // What is under way on a device ends here, with its count of repairs.
        self.read_back()?;
        let groups = snapshot.groups.clone();
        #[cfg(feature = "gpu")]
        let groups = match &snapshot.place.gpu {
            Some(gpu) => take_over(&mut self.groups, groups, gpu, &snapshot.solver)?,
            None => groups,
        };
        let Snapshot {
            scene,
            solver,
            time_step,
            epoch,
            gravity,
            colliders,
            quantities,
            every,
            place,
            groups: _,
            whole,
            pieces,
            timeline,
            on_cut,
            next_frame,
            report,
            residuals_kept,
        } = snapshot;
        self.scene = Arc::clone(scene);
        self.solver = solver.clone();
        self.time_step = *time_step;
        self.epoch = *epoch;
        self.gravity = *gravity;
        self.colliders.restore(colliders);
        self.quantities.clone_from(quantities);
        self.every = *every;
        self.leave_device();
        self.place = place.clone();
        self.groups = groups;
        self.whole.clone_from(whole);
        self.pieces = pieces.clone();
        self.timeline = timeline.clone();
        self.on_cut.clone_from(on_cut);
        self.deltas.clear();
        self.events.clear();
        self.next_frame = *next_frame;
        self.report = report.clone();
        self.residuals_kept = *residuals_kept;
        Ok(())
    }

    /// Sets what is reported from the next frame on, and how often.
    ///
    /// # Errors
    /// If `every` is 0; nothing has changed then.
    pub fn set_report(&mut self, report: ReportSpec) -> Result<(), Error> {
        if report.every == 0 {
            return Err(value("report.every", 0, "at least 1"));
        }
        self.every = report.every;
        self.quantities = report.quantities;
        Ok(())
    }
}

/// Whether two simulations were set up with the same bodies and all around them; how they are computed and what they
/// report may differ.
fn is_same(a: &Arc<Scene>, b: &Arc<Scene>) -> bool {
    let of_one = Arc::ptr_eq(a, b);
    of_one
        || (
            &a.world,
            &a.body,
            &a.collider,
            &a.handle,
            &a.link,
            &a.stroke,
        ) == (
            &b.world,
            &b.body,
            &b.collider,
            &b.handle,
            &b.link,
            &b.stroke,
        ) && a.solver.precision == b.solver.precision
}

/// Takes the solvers of `new` groups, which are on the processor, to a device; where `old` ones are there already, they
/// lend their kernels and memory.
///
/// # Errors
/// If the device is lost or out of memory; the old groups are as they were.
#[cfg(feature = "gpu")]
fn take_over(
    old: &mut [Group],
    mut new: Vec<Group>,
    gpu: &Arc<crate::gpu::GpuContext>,
    spec: &SolverSpec,
) -> Result<Vec<Group>, Error> {
    use crate::backend::AnySolver;
    let mut lent = Vec::with_capacity(new.len());
    for (old, new) in old.iter().zip(&mut new) {
        let lends = match &old.solver {
            AnySolver::Device(device) => device.serves(gpu, spec)?,
            _ => false,
        };
        if !lends {
            new.solver.take_to(gpu, spec)?;
        }
        lent.push(lends);
    }
    for ((old, new), lent) in old.iter_mut().zip(&mut new).zip(lent) {
        if lent {
            std::mem::swap(&mut old.solver, &mut new.solver);
            if let (AnySolver::Device(device), AnySolver::Single(backend)) =
                (&mut new.solver, &mut old.solver)
            {
                let host = std::mem::replace(&mut backend.solver, incise_xpbd::Solver::new(&[]));
                device.solver.replace(host);
            }
        }
    }
    Ok(new)
}
