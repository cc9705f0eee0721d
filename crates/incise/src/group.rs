//! [`Group`]: bodies that are solved together, with all that moves and cuts them.
//!
//! Mostly a single body. A group has its own mesh, solver, plan and substeps, so a stiff body makes no other one wait,
//! each is precise around its own origin, and a body moves to the bit as it would alone in the scene. Cost: that of its
//! parts.

use std::time::Instant;

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh, PieceEvent, PieceTracker};
use incise_mesh::signed_volume;
use incise_xpbd::{KappaLimit, StepReport, StepSettings};

use crate::backend::{AnySolver, each, each_mut};
use crate::grab::Hand;
use crate::handle::Handle;
use crate::joined::Joined;
use crate::place::Place;
use crate::plan::Plan;
use crate::recluster::Recluster;
use crate::report::{Milliseconds, milliseconds};
use crate::scene::{Quantity, SolverSpec};
use crate::sleep::Rest;
use crate::substeps::Choice;
use crate::volume::Volumes;
use crate::{Error, Scene, collider, link};

/// Bodies that are solved together. A copy has the state as it is known here, and its solver on the processor.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// The numbers of its bodies in the scene, ascending.
    pub(crate) bodies: Vec<usize>,
    /// Mesh at rest; its particles and tets are numbered within the group.
    pub(crate) cuttable: CuttableMesh,
    pub(crate) solver: AnySolver,
    pub(crate) plan: Plan,
    /// Its colliders are where they are at the start of the next frame.
    pub(crate) settings: StepSettings,
    pub(crate) handles: Vec<Handle>,
    /// What somebody holds.
    pub(crate) hand: Hand,
    volumes: Option<Volumes>,
    /// The present positions.
    pub(crate) positions: Vec<DVec3>,
    /// Its pieces, numbered within the group.
    pub(crate) pieces: PieceTracker,
    /// Volume at rest in m³ before all cuts.
    pub(crate) initial_volume: f64,
    /// Volume at rest in m³ that strokes have taken away.
    pub(crate) removed_volume: f64,
    /// What was chosen, if the scene left it open.
    pub(crate) choice: Option<Choice>,
    /// What the last cut did to kappa, if that is to be reported.
    pub(crate) cut_kappa: Option<CutKappa>,
    /// Whether it sleeps, in a scene where bodies may.
    pub(crate) rest: Option<Rest>,
    /// What renews the plan, in a scene where plans are renewed.
    pub(crate) recluster: Option<Recluster>,
}

/// What cuts did to kappa.
#[derive(Clone, Copy, Debug)]
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

impl Group {
    pub(crate) fn new(
        scene: &Scene,
        place: &Place,
        mut settings: StepSettings,
        mut joined: Joined,
    ) -> Result<Self, Error> {
        let mesh = std::mem::take(&mut joined.mesh);
        let cuttable = CuttableMesh::new(mesh).map_err(|source| Error::Cut {
            field: "body".into(),
            source,
        })?;
        let mut solver = AnySolver::new(scene.solver.precision, &joined, &cuttable)?;
        let (substeps, choice) = joined.substeps(scene, &solver, &cuttable);
        settings.substeps = substeps;
        let limit = kappa_limit(&scene.solver, &settings);
        solver.limit_kappa(None, limit, cuttable.mesh())?;
        for handle in &mut joined.handles {
            handle.attach(&mut solver)?;
        }
        link::connect(&mut solver, &joined.links)?;
        let plan = Plan::new(scene, cuttable.mesh())?;
        let volumes = joined.volumes();
        if let Some(volumes) = &volumes {
            volumes.constrain(&mut solver, &cuttable, &plan.schedule)?;
        }
        solver.prepare(&scene.solver, place)?;
        let recluster = scene.solver.recluster;
        let mut group = Self {
            recluster: recluster.map(Recluster::new),
            solver,
            plan,
            settings,
            handles: joined.handles,
            hand: Hand::default(),
            volumes,
            positions: Vec::new(),
            pieces: PieceTracker::new(&cuttable),
            initial_volume: cuttable.mesh().total_volume(),
            removed_volume: 0.0,
            cuttable,
            bodies: joined.bodies,
            choice,
            cut_kappa: None,
            rest: scene.solver.sleep.map(Rest::new),
        };
        group.solver.positions(&mut group.positions);
        Ok(group)
    }

    /// Whether it is not solved until it is woken.
    pub(crate) fn asleep(&self) -> bool {
        self.rest.is_some_and(|rest| rest.asleep())
    }

    /// Wakes it, in a scene where bodies may sleep.
    pub(crate) fn wake(&mut self) {
        if let Some(rest) = &mut self.rest {
            rest.wake();
        }
    }

    /// Advances by the frame of a number, unless it sleeps. What moves a handle or a collider wakes it.
    pub(crate) fn step(
        &mut self,
        frame: u64,
        keeping_residuals: bool,
    ) -> Result<StepReport, Error> {
        let moved = self.rest.is_some() && self.is_moved(frame);
        if moved {
            self.wake();
        }
        if self.asleep() {
            return Ok(StepReport::default());
        }
        for handle in &self.handles {
            handle.advance(frame, &mut self.solver);
        }
        let (schedule, settings) = (&self.plan.schedule, &self.settings);
        let step = self.solver.step(schedule, settings, keeping_residuals)?;
        collider::advance(&mut self.settings);
        self.hand.arrive();
        let time = self.settings.time_step;
        if let Some(rest) = self.rest.as_mut().filter(|_| !moved) {
            let state = self.solver.state(None, &[Quantity::Speed])?;
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

    /// Whether a handle, a hand or a collider moves in a frame.
    fn is_moved(&self, frame: u64) -> bool {
        let mut colliders = self.settings.colliders.iter();
        colliders.any(|collider| collider.velocity != DVec3::ZERO)
            || self.handles.iter().any(|handle| handle.moves(frame))
            || self.hand.moves()
    }

    /// Lets solver, pieces, clusters, colors, schedule and volume constraints follow a cut of the mesh, and wakes it.
    /// Returns what happened to its pieces.
    pub(crate) fn follow(
        &mut self,
        delta: &CutDelta,
        ms: &mut Milliseconds,
    ) -> Result<Vec<PieceEvent>, Error> {
        self.wake();
        let positions = &self.cuttable.mesh().positions;
        for tet in &delta.deleted {
            self.removed_volume += signed_volume(tet.corners.map(|p| positions[p.index()]));
        }
        self.solver.follow(delta, &self.cuttable);
        let events = self.pieces.follow(&self.cuttable, delta);
        self.plan.follow(delta, &self.cuttable, ms)?;
        if let Some(recluster) = &mut self.recluster {
            recluster.note(delta);
        }
        if let Some(volumes) = &self.volumes {
            volumes.follow(&mut self.solver, delta, &self.cuttable, &self.plan.schedule)?;
        }
        self.solver.update_vbd(ms)?;
        self.solver.lay_out(&self.plan.schedule, ms)?;
        Ok(events)
    }

    /// Renews clusters, colors and schedule if that is due in the frame of a number, after its strokes; tells whether it
    /// was.
    pub(crate) fn renew_plan(&mut self, frame: u64, ms: &mut Milliseconds) -> Result<bool, Error> {
        let Some(recluster) = &mut self.recluster else {
            return Ok(false);
        };
        let start = Instant::now();
        let renewed = recluster.advance(frame, &mut self.plan, &self.cuttable)?;
        if renewed {
            self.reschedule_volumes()?;
        }
        ms.cluster += milliseconds(start.elapsed());
        Ok(renewed)
    }

    /// Lets volume constraints follow another plan.
    pub(crate) fn reschedule_volumes(&mut self) -> Result<(), Error> {
        let Some(volumes) = &self.volumes else {
            return Ok(());
        };
        let (nothing, schedule) = (CutDelta::default(), &self.plan.schedule);
        volumes.follow(&mut self.solver, &nothing, &self.cuttable, schedule)
    }

    /// Notes the largest kappa before the first cut of a frame. O(tets).
    pub(crate) fn note_kappa_before(&mut self) {
        if self.cut_kappa.is_none() {
            self.cut_kappa = Some(CutKappa {
                before: Some(self.kappa()),
                new_tets: 0.0,
            });
        }
    }

    /// Notes the largest kappa of the tets that a cut has made. Costs what the cut touched.
    pub(crate) fn note_kappa_of(&mut self, delta: &CutDelta) {
        let time = self.settings.substep_time();
        let kappas = delta
            .added
            .iter()
            .map(|tet| each!(&self.solver, solver => solver.kappa_of(tet.tet.index(), time)));
        let largest = kappas.fold(0.0, f64::max);
        let noted = self.cut_kappa.get_or_insert(CutKappa {
            before: None,
            new_tets: 0.0,
        });
        noted.new_tets = noted.new_tets.max(largest);
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
        self.solver.check(&self.cuttable, &self.plan.schedule)?;
        self.hand.check(&self.solver)?;
        self.plan.check(mesh)?;
        self.pieces
            .check(&self.cuttable)
            .map_err(|error| Error::Inconsistent(error.to_string()))
    }
}
