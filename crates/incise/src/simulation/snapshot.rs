//! [`Snapshot`]: a copy of the state of a simulation, to undo cuts, to fork and, with the feature `save`, to continue
//! from a file.
//!
//! It has all data that decides the future: meshes, cuts, pieces, solvers, partitions, attachments, colliders, active
//! strokes. Data that can be derived is rebuilt: the layout of the solvers, and buffers on a device. Types are written
//! by derived serde code, field by field; settings, which leave out defaults, as TOML (`saved.rs`). (Undoing a
//! [`CutDelta`](incise_cutting::CutDelta) restores a mesh but not the motion since, so cuts are undone by snapshots.)
//!
//! Cost: a copy of all arrays, 0.25 to 0.4 kB a tet, with VBD up to 0.6; the first step after a restore rebuilds the
//! layout and sends a device all data.

use std::sync::Arc;

use super::Simulation;
use super::state::{Dependents, State};
use crate::backend::AnySolver;
use crate::compute_device::ComputeDevice;
use crate::device::{GpuContext, OpenDevice};
use crate::island::Island;
use crate::merged_mesh::MergedMesh;
use crate::method::check_forces;
use crate::recluster::Recluster;
use crate::report::FrameReport;
use crate::scene::{Quantity, ReportSpec, SolverSpec};
use crate::validate::value;
use crate::{Error, Scene};

/// A copy of the state of a simulation, to undo, fork or save: see [`Simulation::snapshot`].
#[derive(Clone, Debug)]
pub struct Snapshot(State);

/// Bytes of a tet in what a cut needs: corners, the lists of the stars around its corners, the links of its faces.
const CUTTING: usize = 16 + 32 + 16;
/// Bytes of a particle there: its position at rest, the head of its list.
const CUTTING_PARTICLE: usize = 24 + 4;
/// About the bytes of a tet in clusters, colors and schedule; with clusters of 10 it is 54, with smaller ones more.
const PARTITION: usize = 58;
/// Bytes of a tet in the lists of pieces.
const PIECES: usize = 4;
/// Bytes of a particle's present position.
const POSITION: usize = 24;

impl Snapshot {
    /// Returns the approximate size in bytes, for memory budgets: exact for solvers and the merged mesh, estimated for
    /// the rest, and off by a fifth at most in the scenes of the tests. O(bodies + particles).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let State {
            islands,
            dependents: Dependents { merged, on_cut, .. },
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
            .constraints
            .contacts
            .as_ref()
            .map_or(0, |contacts| contacts.bytes());
        self.solver.backend().bytes()
            + self.masses.bytes()
            + contacts
            + tets * (CUTTING + PIECES + partitions * PARTITION)
            + particles * (CUTTING_PARTICLE + POSITION)
    }
}

impl Simulation {
    /// Copies the present state, for [`Simulation::restore`] and [`Simulation::from_snapshot`].
    ///
    /// A state on a device is read back. A background rebuild of clusters is waited for; it is still taken in its own
    /// frame. O(particles + tets).
    ///
    /// # Errors
    /// If the device is lost.
    ///
    /// # Example
    /// Undoes a cut.
    /// ```
    /// use incise::{Scene, Simulation, scene::StrokeSpec};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// let before = simulation.snapshot()?;
    /// simulation.cut(StrokeSpec::plane(0, [0.01, 0.0, 0.0], [1.0, 0.0, 0.0]))?;
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

    /// Restores the state of a snapshot. The simulation continues bit-identically, on a device if device and driver are
    /// the same. The snapshot can be used again.
    ///
    /// Everything is restored: bodies, colliders, the settings of [`Simulation::set_solver`] and
    /// [`Simulation::set_report`], and the number of the next frame. Strokes added later are gone; handles of grabs and
    /// strokes begun later are invalid, and numbers of strokes may be reused. To keep the present solver settings, pass a
    /// copy of [`Simulation::solver_spec`] to `set_solver` afterwards. [`Simulation::deltas`] is empty: renderers and
    /// recorders must rebuild from [`Simulation::boundary`], and buffers of device solvers change. With a snapshot of
    /// another simulation, this one continues that one. O(particles + tets).
    ///
    /// # Errors
    /// If the device is lost or out of memory; nothing has changed then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), Error> {
        // What is under way on a device ends here, with its count of repairs.
        self.read_back()?;
        let mut state = snapshot.0.clone();
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

    /// Creates a new simulation that continues from a snapshot bit-identically, on a device if device and driver are
    /// the same. It uses the threads of rayon's global pool.
    ///
    /// With the feature `save` a snapshot can be written to a file in any binary format of serde, such as `postcard`,
    /// and read in another process by the same version of this crate. A snapshot from a file has no device: one is
    /// opened if the solver settings request it. [`Simulation::report`] has the counts; measured quantities come with
    /// the next frame. O(particles + tets).
    ///
    /// # Errors
    /// If the device cannot be opened or is out of memory, or if the parts of the state contradict each other, as in a
    /// damaged file.
    ///
    /// # Panics
    /// If a damaged file refers to particles or tets that do not exist.
    ///
    /// # Example
    /// Two simulations continue from one state.
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
            // The body of a blade is on the CPU.
            if state.timeline.solid_field().is_none() {
                let scene = state.present(Scene::clone(&state.scene));
                state.compute_device = ComputeDevice::choose(&scene, &OpenDevice::default())?;
            }
        }
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

    /// Sets the reported quantities and their interval from the next frame on. Wakes all bodies if forces are reported
    /// for the first time, since sleeping bodies have none.
    ///
    /// # Errors
    /// If `every` is 0, or forces are reported on a GPU or with method `chebyshev`; nothing has changed then.
    pub fn set_report(&mut self, report: ReportSpec) -> Result<(), Error> {
        if report.every == 0 {
            return Err(value("report.every", 0, "at least 1"));
        }
        let is_gpu = self.state.compute_device.is_gpu();
        check_forces(&report, self.state.solver.method, is_gpu)?;
        let asks = |report: &ReportSpec| report.quantities.contains(&Quantity::Force);
        if asks(&report) && !asks(&self.state.reporting) {
            self.state.islands.iter_mut().for_each(Island::wake);
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
fn take_over(
    old: &mut [Island],
    mut new: Vec<Island>,
    gpu: &Arc<GpuContext>,
    spec: &SolverSpec,
) -> Result<Vec<Island>, Error> {
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
                device.replace(host);
            }
        }
    }
    Ok(new)
}
