//! [`Simulation`]: a scene in motion.
//!
//! One frame: strokes that are due cut the mesh; their deltas go to solver, clusters, colors and schedule; the solver
//! advances; the report is made. A frame without a cut touches only the solver.

use std::time::Instant;

use glam::DVec3;
use incise_cutting::CuttableMesh;
use incise_graph::{Clustering, Coloring, Schedule};
use incise_mesh::{Surface, TetMesh};
use incise_xpbd::{KappaLimit, StepSettings};
use rayon::ThreadPool;

use crate::backend::{AnySolver, each};
use crate::body::Bodies;
use crate::handle::Handle;
use crate::limits::{coordinates, value, within};
use crate::plan::Plan;
use crate::report::{
    CutReport, EnergyReport, FrameReport, Milliseconds, ResidualReport, SoftenedReport,
    milliseconds,
};
use crate::scene::{Precision, Quantity, StrokeSpec};
use crate::strokes::Timeline;
use crate::volume::BodyVolumes;
use crate::{Error, Scene, collider, link};

/// A scene in motion.
///
/// # Example
/// ```
/// use incise::{Scene, Simulation};
///
/// let scene = Scene::from_toml(
///     r#"
///     [world]
///     gravity = [0.0, 0.0, -9.81]
///     [[body]]
///     shape = { kind = "sphere", tets = 500 }
///     [[stroke]]
///     kind = "plane"
///     frame = 2
///     point = [0.05, 0.0, 0.0]
///     normal = [1.0, 0.0, 0.0]
///     "#,
/// )?;
/// let mut simulation = Simulation::new(&scene)?;
/// for _ in 0..4 {
///     let report = simulation.step()?;
///     println!("{} pieces, {:.2} ms", report.pieces, report.ms.total);
/// }
/// assert_eq!(simulation.report().pieces, 2);
/// # Ok::<(), incise::Error>(())
/// ```
#[derive(Debug)]
pub struct Simulation {
    settings: StepSettings,
    quantities: Vec<Quantity>,
    every: u64,
    precision: Precision,
    cuttable: CuttableMesh,
    solver: AnySolver,
    plan: Plan,
    timeline: Timeline,
    handles: Vec<Handle>,
    volumes: Option<BodyVolumes>,
    positions: Vec<DVec3>,
    /// Whether a particle lies on a cut; empty before the first.
    on_cut: Vec<bool>,
    initial_volume: f64,
    pieces: usize,
    next_frame: u64,
    report: FrameReport,
    pool: Option<ThreadPool>,
}

impl Simulation {
    /// Sets a scene up, on as many threads as rayon's global pool has.
    ///
    /// # Errors
    /// If a value of the scene lies outside its range or a mesh cannot be read or is broken.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Self::build(scene, None)
    }

    /// The same on a number of threads of its own. The result is the same to the bit for any number.
    ///
    /// # Errors
    /// As [`Simulation::new`], and if the threads cannot be started.
    pub fn with_threads(scene: &Scene, threads: usize) -> Result<Self, Error> {
        if threads == 0 {
            return Err(value("threads", threads, "at least 1"));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| Error::Threads {
            threads,
            message: error.to_string(),
        })?;
        Self::build(scene, Some(pool))
    }

    fn build(scene: &Scene, pool: Option<ThreadPool>) -> Result<Self, Error> {
        let settings = settings(scene)?;
        if scene.report.every == 0 {
            return Err(value("report.every", 0, "at least 1"));
        }
        let precision = scene.solver.precision;
        let mut timeline = Timeline::new(match precision {
            Precision::F32 => 1e-5,
            Precision::F64 => 1e-9,
        });
        for stroke in &scene.stroke {
            timeline.add(stroke.clone())?;
        }
        let bodies = Bodies::new(scene)?;
        let cuttable = CuttableMesh::new(bodies.mesh.clone()).map_err(|source| Error::Cut {
            field: "body".into(),
            source,
        })?;
        let kappa_limit = kappa_limit(scene, &settings)?;
        let mut solver = AnySolver::new(precision, kappa_limit, &bodies, &cuttable)?;
        let handles = hold(scene, &bodies, &mut solver)?;
        connect(scene, &bodies, &mut solver)?;
        let make_plan = || Plan::new(scene, cuttable.mesh());
        let plan = match &pool {
            Some(pool) => pool.install(make_plan),
            None => make_plan(),
        }?;
        let volumes = BodyVolumes::new(scene)?;
        if let Some(volumes) = &volumes {
            volumes.constrain(&mut solver, &cuttable, &plan.schedule)?;
        }
        let mut simulation = Self {
            settings,
            quantities: scene.report.quantities.clone(),
            every: scene.report.every,
            precision,
            initial_volume: cuttable.mesh().total_volume(),
            pieces: cuttable.mesh().pieces().count,
            positions: Vec::new(),
            on_cut: Vec::new(),
            cuttable,
            solver,
            plan,
            timeline,
            handles,
            volumes,
            next_frame: 0,
            report: FrameReport::default(),
            pool,
        };
        simulation.solver.positions(&mut simulation.positions);
        simulation.count();
        Ok(simulation)
    }

    /// Adds a stroke. A plane whose frame has come cuts at the start of the next step.
    ///
    /// # Errors
    /// If a value of the stroke lies outside its range.
    pub fn cut(&mut self, stroke: StrokeSpec) -> Result<(), Error> {
        self.timeline.add(stroke)
    }

    /// Advances by one frame and reports on it.
    ///
    /// # Errors
    /// If a stroke cannot be carried out; the body is then as it was before that stroke.
    pub fn step(&mut self) -> Result<&FrameReport, Error> {
        // The pool is taken out so that the closure may borrow the rest.
        match self.pool.take() {
            Some(pool) => {
                let result = pool.install(|| self.frame());
                self.pool = Some(pool);
                result?;
            }
            None => self.frame()?,
        }
        Ok(&self.report)
    }

    fn frame(&mut self) -> Result<(), Error> {
        let _span = tracing::debug_span!("incise::frame", frame = self.next_frame).entered();
        let start = Instant::now();
        let mut ms = Milliseconds::default();
        let cut = self.carry_out_strokes(&mut ms)?;

        let before_solve = Instant::now();
        for handle in &self.handles {
            handle.advance(self.next_frame, &mut self.solver);
        }
        let wants = |quantity| {
            self.next_frame.is_multiple_of(self.every) && self.quantities.contains(&quantity)
        };
        let residual = wants(Quantity::Residual);
        let (schedule, settings) = (&self.plan.schedule, &self.settings);
        let step = each!(&mut self.solver, solver => if residual {
            solver.step_keeping_residuals(schedule, settings)
        } else {
            solver.step(schedule, settings)
        });
        let step = step.map_err(|source| Error::Xpbd {
            field: "solver".into(),
            source,
        })?;
        collider::advance(&mut self.settings);
        ms.solve = milliseconds(before_solve.elapsed());

        self.report = FrameReport {
            frame: self.next_frame,
            time_s: (self.next_frame + 1) as f64 * self.settings.time_step,
            cut,
            repaired: step.repaired,
            ..FrameReport::default()
        };
        self.measure();
        self.solver.positions(&mut self.positions);
        self.count();
        ms.total = milliseconds(start.elapsed());
        ms.other = ms.total - ms.cut - ms.cluster - ms.color - ms.schedule - ms.solve;
        self.report.ms = ms;
        self.next_frame += 1;
        Ok(())
    }

    /// Cuts what is due and lets everybody follow.
    fn carry_out_strokes(&mut self, ms: &mut Milliseconds) -> Result<Option<CutReport>, Error> {
        let start = Instant::now();
        let Self {
            timeline,
            cuttable,
            positions,
            solver,
            plan,
            volumes,
            pieces,
            on_cut,
            ..
        } = self;
        let mut report: Option<CutReport> = None;
        let mut counting = 0.0;
        timeline.advance(self.next_frame, cuttable, positions, |cuttable, delta| {
            solver.follow(delta, cuttable);
            plan.follow(delta, ms)?;
            if let Some(volumes) = volumes {
                volumes.follow(solver, delta, cuttable, &plan.schedule)?;
            }
            report.get_or_insert_default().add(delta);
            on_cut.resize(delta.particles_before, false);
            on_cut.resize(delta.particles_after(), true);
            for source in &delta.copies {
                on_cut[source.index()] = true;
            }
            if !delta.copies.is_empty() {
                let start = Instant::now();
                *pieces = cuttable.mesh().pieces().count;
                counting += milliseconds(start.elapsed());
            }
            Ok(())
        })?;
        ms.cut = milliseconds(start.elapsed()) - ms.cluster - ms.color - ms.schedule - counting;
        Ok(report)
    }

    /// Computes the quantities that this frame reports.
    fn measure(&mut self) {
        if !self.report.frame.is_multiple_of(self.every) {
            return;
        }
        let substep_time = self.settings.substep_time();
        let report = &mut self.report;
        each!(&self.solver, solver => for quantity in &self.quantities {
            match quantity {
                Quantity::Residual => {
                    let load = self.settings.gravity.map(|g| solver.load(g));
                    report.residual = solver
                        .residuals(substep_time)
                        .map(|r| ResidualReport::new(&r, load, substep_time));
                }
                Quantity::Energy => {
                    let energy = solver.energy(self.settings.gravity);
                    report.energy = Some(EnergyReport {
                        kinetic: energy.kinetic,
                        elastic: energy.elastic,
                        gravity: energy.gravity,
                    });
                }
                Quantity::Volume => {
                    let volume = solver.volume();
                    report.volume = Some(volume.total);
                    report.volume_error = Some(volume.total / volume.rest - 1.0);
                    report.min_volume_ratio = Some(volume.min_ratio);
                    report.inverted_tets = Some(volume.inverted);
                }
                Quantity::Speed => report.max_speed = Some(solver.max_speed()),
                Quantity::Kappa => {
                    report.kappa = Some(solver.kappa(substep_time));
                    report.softened = Some(solver.softened().into());
                }
            }
        });
    }

    /// Fills in the counts.
    fn count(&mut self) {
        let report = &mut self.report;
        report.particles = self.cuttable.mesh().positions.len();
        report.tets = self.cuttable.mesh().tets.len();
        report.clusters = self.plan.clustering.occupied();
        report.colors = self.plan.schedule.color_count();
        report.pieces = self.pieces;
        report.backend = "cpu";
        report.precision = self.precision.name();
    }

    /// The report on the last frame; before the first, only its counts mean something.
    #[must_use]
    pub fn report(&self) -> &FrameReport {
        &self.report
    }

    /// The present positions of all particles in m.
    #[must_use]
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// The mesh at rest, with all cuts made so far.
    #[must_use]
    pub fn mesh(&self) -> &TetMesh {
        self.cuttable.mesh()
    }

    /// The boundary triangles, outer and cut, as the mesh is now. O(n log n).
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.cuttable.mesh().surface()
    }

    /// Whether each particle lies where a stroke cut; empty before the first cut. A boundary triangle with all three
    /// is part of a cut face.
    #[must_use]
    pub fn on_cut(&self) -> &[bool] {
        &self.on_cut
    }

    /// The clusters of tets.
    #[must_use]
    pub fn clustering(&self) -> &Clustering {
        &self.plan.clustering
    }

    /// The colors of the clusters.
    #[must_use]
    pub fn coloring(&self) -> &Coloring {
        self.plan.coloring()
    }

    /// The order of solving.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.plan.schedule
    }

    /// The largest `E Δt² / (ρ h²)` of a tet, had none been softened: up to about 0.5 the motion is accurate.
    #[must_use]
    pub fn kappa(&self) -> f64 {
        each!(&self.solver, solver => solver.kappa(self.settings.substep_time()))
    }

    /// The tets that are softer than their material to keep the scene's limit of kappa.
    #[must_use]
    pub fn softened(&self) -> SoftenedReport {
        each!(&self.solver, solver => solver.softened()).into()
    }

    /// Recomputes everything derived and compares: the mesh, the lists around its particles, volume, masses, clusters,
    /// colors, schedule, pieces. O(n log n); for tests and on request.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] or [`Error::Cut`] name the first difference.
    pub fn check(&self) -> Result<(), Error> {
        self.cuttable.check().map_err(|source| Error::Cut {
            field: "mesh".into(),
            source,
        })?;
        let mesh = self.cuttable.mesh();
        let volume = mesh.total_volume();
        if (volume - self.initial_volume).abs() > 1e-12 * self.initial_volume {
            let initial = self.initial_volume;
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

fn kappa_limit(scene: &Scene, settings: &StepSettings) -> Result<Option<KappaLimit>, Error> {
    let kappa = scene.solver.kappa_limit;
    if kappa.is_nan() || kappa <= 0.0 {
        return Err(value("solver.kappa_limit", kappa, "positive"));
    }
    let substep_time = settings.substep_time();
    Ok(kappa.is_finite().then_some(KappaLimit {
        kappa,
        substep_time,
    }))
}

fn settings(scene: &Scene) -> Result<StepSettings, Error> {
    let settings = StepSettings {
        time_step: scene.solver.time_step,
        substeps: scene.solver.substeps,
        iterations: scene.solver.iterations,
        method: incise_xpbd::Method::GaussSeidel,
        form: incise_xpbd::Form::Block,
        relaxation: scene.solver.relaxation,
        gravity: scene
            .world
            .gravity
            .map(|g| coordinates("world.gravity", g))
            .transpose()?,
        colliders: collider::colliders(scene)?,
    };
    settings.check().map_err(|source| Error::Xpbd {
        field: "solver".into(),
        source,
    })?;
    within("solver.time_step", settings.time_step, 1e-9, 1e3)?;
    Ok(settings)
}

/// Checks the handles of a scene and takes hold.
fn hold(scene: &Scene, bodies: &Bodies, solver: &mut AnySolver) -> Result<Vec<Handle>, Error> {
    let mut handles = Vec::with_capacity(scene.handle.len());
    for (i, spec) in scene.handle.iter().enumerate() {
        let field = format!("handle[{i}]");
        let particles = |body| bodies.particles_of(body);
        let mut handle = Handle::new(&field, spec, |body| Some(particles(body)?.0))?;
        let first = particles(handle.body()).map_or(0, |(_, first)| first);
        handle.attach(&field, solver, first)?;
        handles.push(handle);
    }
    Ok(handles)
}

/// Checks the links of a scene and ties them.
fn connect(scene: &Scene, bodies: &Bodies, solver: &mut AnySolver) -> Result<(), Error> {
    let links = scene.link.iter().enumerate();
    let links: Result<Vec<_>, Error> = links
        .map(|(i, spec)| link::link(&format!("link[{i}]"), spec, |b| bodies.particles_of(b)))
        .collect();
    link::connect(solver, &links?)
}
