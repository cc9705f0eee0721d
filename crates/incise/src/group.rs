//! [`Group`]: bodies that are solved together, with all that moves and cuts them.
//!
//! Mostly a single body. A group has its own mesh, solver, plan and substeps, so a stiff body makes no other one wait,
//! each is precise around its own origin, and a body moves to the bit as it would alone in the scene. Cost: that of its
//! parts.

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_mesh::{ParticleId, TetMesh};
use incise_xpbd::{KappaLimit, Material, StepReport, StepSettings};

use crate::backend::{AnySolver, each};
use crate::body::Body;
use crate::plan::Plan;
use crate::report::Milliseconds;
use crate::{Error, Scene};

/// Bodies that are solved together.
#[derive(Debug)]
pub(crate) struct Group {
    /// Mesh at rest; its particles and tets are numbered within the group.
    pub(crate) cuttable: CuttableMesh,
    pub(crate) solver: AnySolver,
    pub(crate) plan: Plan,
    pub(crate) settings: StepSettings,
    /// The present positions.
    pub(crate) positions: Vec<DVec3>,
    /// Number of pieces.
    pub(crate) pieces: usize,
    /// Volume at rest in m³ before all cuts.
    pub(crate) initial_volume: f64,
}

/// The bodies of a group as one mesh.
#[derive(Debug, Default)]
pub(crate) struct Joined {
    pub(crate) mesh: TetMesh,
    pub(crate) materials: Vec<Material>,
    /// For each tet the number of its material, which is that of its body within the group.
    pub(crate) material_of: Vec<u16>,
    pub(crate) fixed: Vec<bool>,
}

impl Joined {
    /// Appends a body.
    pub(crate) fn add(&mut self, body: Body) -> Result<(), Error> {
        let number = u16::try_from(self.materials.len())
            .map_err(|_| crate::limits::value("body", "too many", "at most 65,536"))?;
        let first = self.mesh.positions.len();
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        self.mesh.positions.extend(body.mesh.positions);
        let tets = body.mesh.tets.iter().map(|tet| tet.map(shifted));
        self.mesh.tets.extend(tets);
        self.material_of.resize(self.mesh.tets.len(), number);
        self.materials.push(body.material);
        self.fixed.extend(body.fixed);
        Ok(())
    }
}

impl Group {
    pub(crate) fn new(
        scene: &Scene,
        settings: StepSettings,
        mut joined: Joined,
    ) -> Result<Self, Error> {
        let mesh = std::mem::take(&mut joined.mesh);
        let cuttable = CuttableMesh::new(mesh).map_err(|source| Error::Cut {
            field: "body".into(),
            source,
        })?;
        let kappa = scene.solver.kappa_limit;
        let limit = kappa.is_finite().then(|| KappaLimit {
            kappa,
            substep_time: settings.substep_time(),
        });
        let solver = AnySolver::new(scene.solver.precision, limit, &joined, &cuttable)?;
        let plan = Plan::new(scene, cuttable.mesh())?;
        let mut group = Self {
            solver,
            plan,
            settings,
            positions: Vec::new(),
            pieces: cuttable.mesh().pieces().count,
            initial_volume: cuttable.mesh().total_volume(),
            cuttable,
        };
        group.solver.positions(&mut group.positions);
        Ok(group)
    }

    /// Advances by one frame.
    pub(crate) fn step(&mut self, keeping_residuals: bool) -> Result<StepReport, Error> {
        let (schedule, settings) = (&self.plan.schedule, &self.settings);
        let step = each!(&mut self.solver, solver => if keeping_residuals {
            solver.step_keeping_residuals(schedule, settings)
        } else {
            solver.step(schedule, settings)
        });
        step.map_err(|source| Error::Xpbd {
            field: "solver".into(),
            source,
        })
    }

    /// Lets solver, clusters, colors and schedule follow a cut of the mesh. The pieces are counted by
    /// [`Group::count_pieces`].
    pub(crate) fn follow(&mut self, delta: &CutDelta, ms: &mut Milliseconds) -> Result<(), Error> {
        self.solver.follow(delta, &self.cuttable);
        self.plan.follow(delta, ms)
    }

    /// Counts the pieces anew. O(tets).
    pub(crate) fn count_pieces(&mut self) {
        self.pieces = self.cuttable.mesh().pieces().count;
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
        if (volume - initial).abs() > (1e-12 + 1e-15 * far) * initial {
            return Err(Error::Inconsistent(format!(
                "the volume at rest was {initial} and is {volume}"
            )));
        }
        self.solver.check(&self.cuttable)?;
        self.plan.check(mesh)?;
        let pieces = mesh.pieces().count;
        if pieces != self.pieces {
            return Err(Error::Inconsistent(format!(
                "{} pieces were counted, there are {pieces}",
                self.pieces
            )));
        }
        Ok(())
    }
}
