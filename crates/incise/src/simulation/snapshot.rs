//! [`Snapshot`]: a simulation at one moment, to undo cuts, to fork and, with the feature `save`, to continue from a file.
//!
//! It is a copy of all that decides what comes next: meshes, cuts, pieces, solvers, partitions, handles, colliders, strokes
//! under way. What follows from the rest is left out and rebuilt: the layout of the solvers, and buffers on a device.
//! Types are written by derived serde code, field by field; settings, which leave out defaults, as TOML (`saved.rs`).
//! (Undoing a [`CutDelta`](incise_cutting::CutDelta) takes back a mesh; it does not take back where the body has
//! moved since, which is why cuts are taken back this way.)
//!
//! Cost: a copy of all arrays, 0.25 to 0.4 kB a tet, with VBD up to 0.6; the first step after coming back lays out
//! all tets, and sends a device everything.

#[cfg(feature = "gpu")]
use std::sync::Arc;

use super::Simulation;
use super::state::State;
use crate::compute_device::{ComputeDevice, OpenDevice};
use crate::island::Island;
use crate::merged_mesh::MergedMesh;
use crate::recluster::Recluster;
use crate::report::FrameReport;
use crate::scene::ReportSpec;
use crate::validate::value;
use crate::{Error, Scene};

/// A simulation at one moment: see [`Simulation::snapshot`].
#[derive(Clone, Debug)]
pub struct Snapshot(State);

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
    /// About the bytes that it takes, for memory budgets: solvers and the merged mesh to the byte, the rest by what a tet and
    /// a particle take there. Off by a fifth at most in the scenes of the tests; what strokes remember of earlier
    /// cuts is the least certain. O(bodies + particles).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let State {
            islands,
            merged,
            on_cut,
            timeline,
            ..
        } = &self.0;
        let particles = islands.iter().map(|island| island.positions.len()).sum();
        let cut = on_cut.iter().filter(|on_cut| **on_cut).count();
        islands.iter().map(Island::bytes).sum::<usize>()
            + merged.as_ref().map_or(0, MergedMesh::bytes)
            + timeline.bytes(particles, cut)
            + on_cut.len()
    }
}

/// Written as the version of this crate and the state; reading refuses what another version wrote.
#[cfg(feature = "save")]
impl serde::Serialize for Snapshot {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (Version, &self.0).serialize(serializer)
    }
}

#[cfg(feature = "save")]
impl<'de> serde::Deserialize<'de> for Snapshot {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (Version, state) = serde::Deserialize::deserialize(deserializer)?;
        Ok(Self(state))
    }
}

/// The version of this crate, which must be the one that wrote a snapshot.
#[cfg(feature = "save")]
struct Version;

#[cfg(feature = "save")]
impl Version {
    const NAME: &str = concat!("incise ", env!("CARGO_PKG_VERSION"));
}

#[cfg(feature = "save")]
impl serde::Serialize for Version {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::NAME.serialize(serializer)
    }
}

#[cfg(feature = "save")]
impl<'de> serde::Deserialize<'de> for Version {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        if name == Self::NAME {
            return Ok(Self);
        }
        let message = format!("a snapshot of `{name}` cannot be read by `{}`", Self::NAME);
        Err(serde::de::Error::custom(message))
    }
}

impl Island {
    /// About the bytes of a copy; a partition in the making counts as one.
    fn bytes(&self) -> usize {
        let mesh = self.cuttable.mesh();
        let (particles, tets) = (mesh.positions.len(), mesh.tets.len());
        let pending = self.recluster.as_ref().is_some_and(Recluster::is_pending);
        let partitions = 1 + usize::from(pending);
        let contacts = self
            .contacts
            .as_ref()
            .map_or(0, |contacts| contacts.bytes());
        self.solver.backend().bytes()
            + contacts
            + tets * (CUTTING + PIECES + partitions * PLAN)
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
        for island in &mut self.state.islands {
            if let Some(recluster) = &mut island.recluster {
                recluster.settle()?;
            }
        }
        Ok(Snapshot(self.state.clone()))
    }

    /// Goes to the moment of a snapshot: what follows is to the bit what followed then, on a device on the same device
    /// and driver. The snapshot can be used again.
    ///
    /// Everything goes back: bodies, colliders, the settings of [`Simulation::set_solver`] and [`Simulation::set_report`], and
    /// the number of the next frame. Strokes added since are gone. Grabs and strokes begun since are void: their numbers
    /// may come to name later ones. To keep the present settings of the solver, hand a copy of
    /// [`Simulation::solver_spec`] to `set_solver` afterwards. [`Simulation::deltas`] is empty: renderers and recorders start
    /// again from [`Simulation::boundary`], and find other buffers in the solvers of a device. A snapshot of another
    /// simulation makes this one continue that one. O(particles + tets).
    ///
    /// # Errors
    /// If the device is lost or out of memory; nothing has changed then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), Error> {
        // What is under way on a device ends here, with its count of repairs.
        self.read_back()?;
        let mut state = snapshot.0.clone();
        #[cfg(feature = "gpu")]
        if let Some(gpu) = state.compute_device.gpu.clone() {
            let islands = std::mem::take(&mut state.islands);
            state.islands = take_over(&mut self.state.islands, islands, &gpu, &state.solver)?;
        }
        state.colliders.keep_numbers_of(&self.state.colliders);
        state.next.keep_numbers_of(self.state.next);
        self.leave_device();
        self.state = state;
        self.deltas.clear();
        self.events.clear();
        Ok(())
    }

    /// Makes a simulation of its own that continues from the moment of a snapshot: what follows is to the bit what
    /// followed then, on a device on the same device and driver. It runs on as many threads as rayon's global pool has.
    ///
    /// With the feature `save` a snapshot can be written to a file by any binary format of serde, such as `postcard`,
    /// and read in another process, by the same version of this crate. A snapshot that was read has no device: one is
    /// opened if the settings of the solver ask for it. [`Simulation::report`] counts what there is; its measures come
    /// with the next frame. O(particles + tets).
    ///
    /// # Errors
    /// If the device cannot be opened or is out of memory, or if the parts of the state contradict each other, as in a
    /// damaged file.
    ///
    /// # Panics
    /// A damaged file can name particles or tets that do not exist.
    ///
    /// # Example
    /// Two hands continue from the same moment.
    /// ```
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut one = Simulation::new(&scene)?;
    /// one.step()?;
    /// let mut other = Simulation::from_snapshot(&one.snapshot()?)?;
    /// one.step()?;
    /// other.step()?;
    /// assert_eq!(one.positions(), other.positions());
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn from_snapshot(snapshot: &Snapshot) -> Result<Self, Error> {
        let mut state = snapshot.0.clone();
        // Every other choice leaves a note.
        if !state.compute_device.is_gpu() && state.compute_device.note.is_none() {
            let scene = Scene {
                solver: state.solver.clone(),
                ..Scene::clone(&state.scene)
            };
            state.compute_device = ComputeDevice::choose(&scene, &OpenDevice::default())?;
        }
        #[cfg(feature = "gpu")]
        if let Some(gpu) = state.compute_device.gpu.clone() {
            let islands = std::mem::take(&mut state.islands);
            state.islands = take_over(&mut [], islands, &gpu, &state.solver)?;
        }
        let mut simulation = Self {
            state,
            open_device: OpenDevice::default(),
            deltas: Vec::new(),
            events: Vec::new(),
            pool: None,
        };
        simulation.check()?;
        if simulation.state.report == FrameReport::default() {
            simulation.report_before_the_first();
        }
        Ok(simulation)
    }

    /// Sets what is reported from the next frame on, and how often.
    ///
    /// # Errors
    /// If `every` is 0; nothing has changed then.
    pub fn set_report(&mut self, report: ReportSpec) -> Result<(), Error> {
        if report.every == 0 {
            return Err(value("report.every", 0, "at least 1"));
        }
        self.state.reporting = report;
        Ok(())
    }
}

/// Takes the solvers of `new` islands, which are on the processor, to a device; where `old` ones are there already, they
/// lend their kernels and memory.
///
/// # Errors
/// If the device is lost or out of memory; the old islands are as they were.
#[cfg(feature = "gpu")]
fn take_over(
    old: &mut [Island],
    mut new: Vec<Island>,
    gpu: &Arc<crate::gpu::GpuContext>,
    spec: &crate::scene::SolverSpec,
) -> Result<Vec<Island>, Error> {
    use crate::backend::AnySolver;
    let mut lent = Vec::with_capacity(new.len());
    for (i, new) in new.iter_mut().enumerate() {
        let lends = match old.get(i).map(|old| &old.solver) {
            Some(AnySolver::Device(device)) => device.serves(gpu, spec)?,
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
