//! [`AnySolver`]: the solver of an island in either precision or on a device, and its update after a cut.
//!
//! Functions that depend on the device or the method are in [`SolverBackend`]. Edits and measurements are those of the
//! [`ErasedSolver`] behind it, in either precision.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_graph::Schedule;
use incise_mesh::{ParticleId, TetId, TetMesh};
use incise_xpbd::{ErasedSolver, KappaLimit, Pose, Real, Solver, StepReport, StepSettings};
use web_time::Instant;

use crate::Error;
use crate::compute_device::ComputeDevice;
use crate::device::{Device, GpuContext};
use crate::masses::Masses;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::{Method, Precision, Quantity, SolverSpec};
use crate::solver_backend::{LastSubstep, Measures, SolverBackend};
use crate::vbd::Vbd;

/// A solver in one of both precisions.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum AnySolver {
    Single(Backend<f32>),
    Double(Backend<f64>),
    #[cfg_attr(feature = "save", serde(skip))]
    Device(Box<Device>),
}

/// A solver with the data of its method.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "save", serde(bound = ""))]
pub(crate) struct Backend<R: Real> {
    pub(crate) solver: Solver<R>,
    /// In a scene that is solved by VBD.
    vbd: Option<Vbd<R>>,
}

/// A copy is on the processor: of a solver on a device, with the state that was last read back.
impl Clone for AnySolver {
    fn clone(&self) -> Self {
        match self {
            Self::Single(backend) => Self::Single(backend.clone()),
            Self::Double(backend) => Self::Double(backend.clone()),
            Self::Device(device) => Self::Single(Backend::new(device.cached_host().clone())),
        }
    }
}

impl AnySolver {
    pub(crate) fn backend(&self) -> &dyn SolverBackend {
        match self {
            Self::Single(backend) => backend,
            Self::Double(backend) => backend,
            Self::Device(device) => device.backend(),
        }
    }

    pub(crate) fn backend_mut(&mut self) -> &mut dyn SolverBackend {
        match self {
            Self::Single(backend) => backend,
            Self::Double(backend) => backend,
            Self::Device(device) => device.backend_mut(),
        }
    }

    /// The solver on the CPU, to be read: [`SolverBackend::host`].
    pub(crate) fn host(&self) -> &dyn ErasedSolver {
        self.backend().host()
    }

    /// The solver on the CPU, to be edited: [`SolverBackend::edit`].
    pub(crate) fn edit(&mut self) -> Result<&mut dyn ErasedSolver, Error> {
        self.backend_mut().edit()
    }

    /// A solver with particles, and nothing else yet.
    pub(crate) fn of_particles(precision: Precision, positions: &[DVec3]) -> Self {
        match precision {
            Precision::F32 | Precision::Auto => Self::Single(Backend::new(Solver::new(positions))),
            Precision::F64 => Self::Double(Backend::new(Solver::new(positions))),
        }
    }

    /// A solver on the processor with the particles, tets and handles of this one and then those of another one, without
    /// other constraints and the data of a method: see [`Solver::joined_with`]. Uses the last readback of a device.
    pub(crate) fn joined_with(&self, other: &Self) -> Result<Self, Error> {
        if let (Self::Double(one), Self::Double(other)) = (self, other) {
            let both = one.solver.joined_with(&other.solver);
            return Ok(Self::Double(Backend::new(both)));
        }
        let (Some(one), Some(other)) = (self.single(), other.single()) else {
            let what = "bodies in different precisions are joined";
            return Err(Error::Inconsistent(what.into()));
        };
        Ok(Self::Single(Backend::new(one.joined_with(other))))
    }

    /// The solver in single precision, if it is in that.
    fn single(&self) -> Option<&Solver<f32>> {
        match self {
            Self::Single(backend) => Some(&backend.solver),
            Self::Double(_) => None,
            Self::Device(device) => Some(device.cached_host()),
        }
    }

    /// Applies a cut to particles, tets and masses. Costs what the cut touched.
    pub(crate) fn apply_delta(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        masses: &mut Masses,
    ) -> Result<(), Error> {
        let mesh = cuttable.mesh();
        let solver = self.edit()?;
        for point in &delta.points {
            let [a, b] = point.ends.map(ParticleId::index);
            solver.push_particle_between(a, b, point.parameter);
        }
        for source in &delta.copies {
            solver.push_copy(source.index());
        }
        let mut added: Vec<_> = delta.added.iter().collect();
        added.sort_unstable_by_key(|tet| tet.tet);
        for tet in added {
            let corners = tet.corners.map(|p| p.0);
            let rest = tet.corners.map(|p| mesh.positions[p.index()]);
            if tet.tet.index() < solver.tet_count() {
                solver.replace_tet(tet.tet.index(), corners, rest);
            } else {
                solver.push_tet(corners, rest, solver.material_of(tet.parent.index()));
            }
        }
        for tet in &delta.relinked {
            solver.relink_tet(tet.tet.index(), tet.after.map(|p| p.0));
        }
        for tet in &delta.moved {
            solver.move_tet(tet.from.index(), tet.to.index());
        }
        solver.truncate_tets(delta.tets_after());
        masses.apply_delta(delta, cuttable, solver);
        // Particles that lost all their tets stay where they are.
        for p in delta.deleted.iter().flat_map(|tet| tet.corners) {
            if cuttable.around(p).next().is_none() {
                solver.set_velocity(p.index(), DVec3::ZERO);
            }
        }
        Ok(())
    }

    /// Prepares for the method and the device of the scene, once the tets are what they are.
    pub(crate) fn prepare(
        &mut self,
        spec: &SolverSpec,
        compute_device: &ComputeDevice,
    ) -> Result<(), Error> {
        match &compute_device.gpu {
            Some(gpu) => self.take_to(gpu, spec),
            None => self.backend_mut().prepare(spec),
        }
    }

    /// Takes a solver in single precision to a device.
    pub(crate) fn take_to(
        &mut self,
        gpu: &Arc<GpuContext>,
        spec: &SolverSpec,
    ) -> Result<(), Error> {
        // Any other one will do: it is replaced at once.
        let single = std::mem::replace(self, Self::Double(Backend::new(Solver::new(&[]))));
        if let Self::Single(Backend { solver, .. }) = single {
            *self = Self::Device(Box::new(Device::new(gpu, solver, spec)?));
        }
        Ok(())
    }

    /// Softens every tet, present and to come, that exceeds the limit, and no other one. Tets that were softened to an
    /// earlier limit are rebuilt from their rest shapes. O(tets), or O(1) if the limit stays the same.
    pub(crate) fn limit_kappa(
        &mut self,
        before: Option<KappaLimit>,
        limit: Option<KappaLimit>,
        mesh: &TetMesh,
    ) -> Result<(), Error> {
        if before == limit {
            return Ok(());
        }
        let solver = self.edit()?;
        solver.limit_kappa(limit);
        for t in 0..solver.tet_count() {
            if exceeds(solver, t, before) || exceeds(solver, t, limit) {
                solver.replace_tet(t, solver.tet_particles(t), mesh.corners(TetId::new(t)));
            }
        }
        Ok(())
    }

    /// Whether a limit softens a tet. O(tets).
    pub(crate) fn exceeds(&self, limit: Option<KappaLimit>) -> bool {
        let solver = self.host();
        limit.is_some() && (0..solver.tet_count()).any(|t| exceeds(solver, t, limit))
    }

    /// Whether the solver is on a device.
    pub(crate) fn is_on_device(&self) -> bool {
        matches!(self, Self::Device(_))
    }

    /// Whether the solver is on a device with the cluster mapping of the settings.
    pub(crate) fn is_on(
        &self,
        compute_device: &ComputeDevice,
        spec: &SolverSpec,
    ) -> Result<bool, Error> {
        match (self, &compute_device.gpu) {
            (Self::Device(device), Some(gpu)) => device.serves(gpu, spec),
            (Self::Device(_), None) | (_, Some(_)) => Ok(false),
            (_, None) => Ok(true),
        }
    }

    /// Recomputes masses, corners and what a step would solve, and compares; for tests and on request.
    pub(crate) fn check(
        &self,
        cuttable: &CuttableMesh,
        schedule: &Schedule,
        masses: &Masses,
    ) -> Result<(), Error> {
        let (mesh, solver) = (cuttable.mesh(), self.host());
        let sizes = (solver.particle_count(), solver.tet_count());
        if sizes != (mesh.positions.len(), mesh.tets.len()) {
            let what = "the solver has another size than the mesh";
            return Err(Error::Inconsistent(what.into()));
        }
        for (t, tet) in mesh.tets.iter().enumerate() {
            if solver.tet_particles(t) != tet.map(|p| p.0) {
                let what = format!("tet {t} has other particles in the solver");
                return Err(Error::Inconsistent(what));
            }
        }
        masses.check(cuttable, solver)?;
        let layout = solver.check_layout(schedule);
        layout.map_err(|error| Error::Inconsistent(error.to_string()))?;
        self.backend().check(schedule)
    }
}

impl<R: Real> Backend<R> {
    fn new(solver: Solver<R>) -> Self {
        Self { solver, vbd: None }
    }
}

impl<R: Real> SolverBackend for Backend<R> {
    fn host(&self) -> &dyn ErasedSolver {
        &self.solver
    }

    fn edit(&mut self) -> Result<&mut dyn ErasedSolver, Error> {
        Ok(&mut self.solver)
    }

    fn prepare(&mut self, spec: &SolverSpec) -> Result<(), Error> {
        if spec.method == Method::Vbd {
            self.vbd = Some(Vbd::new(&self.solver, spec)?);
        }
        Ok(())
    }

    fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<StepReport, Error> {
        let Self { solver, vbd } = self;
        let step = match vbd {
            Some(vbd) => vbd.step(solver, settings, keep),
            None => solver.step_part(schedule, settings, part, keep),
        };
        step.map_err(Error::xpbd("solver"))
    }

    fn lay_out(&mut self, schedule: &Schedule, ms: &mut Milliseconds) -> Result<(), Error> {
        let start = Instant::now();
        if self.vbd.is_none() {
            self.solver.lay_out(schedule);
        }
        ms.schedule += milliseconds(start.elapsed());
        Ok(())
    }

    fn state(
        &mut self,
        gravity: Option<DVec3>,
        quantities: &[Quantity],
    ) -> Result<Measures, Error> {
        let (solver, asks) = (&self.solver, |quantity| quantities.contains(&quantity));
        Ok(Measures {
            energy: asks(Quantity::Energy).then(|| solver.energy(gravity)),
            sliver_energy: asks(Quantity::Energy).then(|| solver.sliver_energy()),
            volume: asks(Quantity::Volume).then(|| solver.volume()),
            max_speed: asks(Quantity::Speed).then(|| solver.max_speed()),
        })
    }

    fn last_substep(&self, substep_time: f64) -> Option<LastSubstep> {
        match &self.vbd {
            Some(vbd) => Some(LastSubstep::Vbd {
                force: vbd.last.force?,
                potential: vbd.last.potential?,
            }),
            None => (self.solver.residuals(substep_time)).map(LastSubstep::Constraints),
        }
    }

    fn measure_forces(&mut self, measuring: bool) {
        self.solver.measure_forces(measuring);
    }

    fn move_handle(&mut self, handle: u32, pose: Pose) {
        self.solver.move_handle(handle, pose);
    }

    fn bytes(&self) -> usize {
        self.solver.bytes() + self.vbd.as_ref().map_or(0, Vbd::bytes)
    }

    fn update_vbd(&mut self, changed: Option<&[u32]>, ms: &mut Milliseconds) -> Result<(), Error> {
        let Self { solver, vbd } = self;
        vbd.as_mut()
            .map_or(Ok(()), |vbd| vbd.sync(solver, changed, ms))
    }

    fn vbd_error(&self) -> Option<f64> {
        self.vbd.as_ref().and_then(|vbd| vbd.last.error)
    }

    fn end_vbd(&mut self) {
        self.vbd = None;
    }

    fn check(&self, _: &Schedule) -> Result<(), Error> {
        let checked = self.vbd.as_ref().map(|vbd| vbd.check(&self.solver));
        checked
            .unwrap_or(Ok(()))
            .map_err(|error| Error::Inconsistent(error.to_string()))
    }
}

/// Whether a tet is too stiff for a limit.
fn exceeds(solver: &dyn ErasedSolver, tet: usize, limit: Option<KappaLimit>) -> bool {
    limit.is_some_and(|limit| solver.kappa_of(tet, limit.substep_time) > limit.kappa)
}
