//! [`Simulation`]: advances a scene frame by frame.
//!
//! One frame: strokes that are due cut the meshes; solver, clusters, colors and schedule apply their deltas; the
//! solvers advance, islands of bodies in parallel; the report is made. A frame without a cut runs only the solvers.

mod builder;
mod edit;
mod forces;
mod interaction;
#[cfg(feature = "gpu")]
mod on_device;
mod readback;
mod set_solver;
mod snapshot;
mod state;

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;
use incise_cutting::{BoundaryTriangle, CutDelta};
use incise_graph::{Clustering, Coloring, Schedule};
use incise_mesh::{Surface, TetMesh};
use rayon::ThreadPool;
use rayon::prelude::*;
use web_time::Instant;

use crate::attachment::Support;
use crate::budget;
use crate::collider::Colliders;
use crate::compute_device::ComputeDevice;
use crate::device::OpenDevice;
use crate::island::Island;
use crate::island_builder::IslandBuilder;
use crate::islands::island_of_bodies;
use crate::measure::{kappa, softened};
use crate::merged_mesh::MergedMesh;
use crate::method::settings;
use crate::pieces::PieceNumbers;
use crate::report::{
    CutReport, DetachedReport, FrameReport, Milliseconds, PieceReport, SoftenedReport, milliseconds,
};
use crate::resolved_body::ResolvedBody;
use crate::scene::{Precision, Quantity, StrokeSpec};
use crate::strokes::Timeline;
use crate::text::counted;
use crate::validate::value;
use crate::warning::{Warning, WarningCode};
use crate::{Error, Event, Scene, collider, contacts, distance, unused_keys};

pub use builder::{Body, BodyHandle, SimulationBuilder};
pub use snapshot::Snapshot;

use state::{Clock, Cut, Dependents, NextNumbers, State};

/// Tets of a scene whose frames begin with a change to the thread pool, some 30 µs: a hundredth of their time, with 20
/// substeps.
const MANY_TETS: usize = 10_000;

/// A running simulation of a scene: bodies, cuts and solvers, advanced frame by frame.
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
    /// All that changes with time.
    state: State,
    /// The devices that are open, for settings that ask for one.
    open_device: OpenDevice,
    /// Deltas of the last frame's strokes.
    deltas: Vec<CutDelta>,
    /// Events of the last frame.
    events: Vec<Event>,
    pool: Option<ThreadPool>,
}

impl Simulation {
    /// Creates a simulation of a scene, on the threads of rayon's global pool.
    ///
    /// # Errors
    /// If a value of the scene lies outside its range or a mesh cannot be read or is broken.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        SimulationBuilder::from_scene(scene.clone()).build()
    }

    /// Starts a simulation without a scene file: bodies are meshes in memory.
    #[must_use]
    pub fn builder() -> SimulationBuilder {
        SimulationBuilder::default()
    }

    /// Creates a simulation of a scene on its own pool of `threads` threads. Results are bit-identical for any number
    /// of threads.
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::new`], and one if the threads cannot be started.
    pub fn with_threads(scene: &Scene, threads: usize) -> Result<Self, Error> {
        let mut builder = SimulationBuilder::from_scene(scene.clone());
        builder.threads(threads);
        builder.build()
    }

    /// Sets up a scene; `meshes` has for each body its mesh, unless the scene names a file or a shape.
    pub(crate) fn build(
        scene: Scene,
        meshes: &[Option<TetMesh>],
        compute_device: ComputeDevice,
        pool: Option<ThreadPool>,
    ) -> Result<Self, Error> {
        let scene = &scene;
        let settings = settings(scene)?;
        if scene.report.every == 0 {
            return Err(value("report.every", 0, "at least 1"));
        }
        crate::scene::check(scene)?;
        let bodies = ResolvedBody::all(scene, meshes)?;
        let mut joined = distance::pairs(scene, bodies.len())?;
        joined.extend(contacts::pairs(scene, bodies.len())?);
        let island_of = island_of_bodies(bodies.len(), &joined);
        let several = island_of.iter().any(|&island| island > 0);
        let merged = several.then(|| MergedMesh::new(&bodies, &island_of));
        let joined = IslandBuilder::all(scene, bodies, &island_of)?;
        let make_islands = |precision: Precision, joined: Vec<IslandBuilder>| {
            let make = || {
                let islands = joined.into_par_iter();
                islands
                    .map(|joined| {
                        Island::new(scene, &compute_device, precision, settings.clone(), joined)
                    })
                    .collect::<Result<Vec<_>, _>>()
            };
            match &pool {
                Some(pool) => pool.install(make),
                None => make(),
            }
        };
        let mut precision = match scene.solver.precision {
            Precision::Auto => Precision::F32,
            given => given,
        };
        let mut islands = make_islands(precision, joined)?;
        let short = || {
            let mut islands = islands.iter();
            islands.any(|island| island.is_too_short_for_f32() || island.must_converge())
        };
        if scene.solver.precision == Precision::Auto && !compute_device.is_gpu() && short() {
            precision = Precision::F64;
            let bodies = ResolvedBody::all(scene, meshes)?;
            islands = make_islands(precision, IslandBuilder::all(scene, bodies, &island_of)?)?;
        }
        if let Some(budget) = scene.solver.budget_ms {
            let mut fit = || budget::fit(&mut islands, &scene.solver, budget);
            match &pool {
                Some(pool) => pool.install(fit),
                None => fit(),
            }?;
        }
        let tolerance = match precision {
            Precision::F32 | Precision::Auto => 1e-5,
            Precision::F64 => 1e-9,
        };
        let mut timeline = Timeline::new(tolerance, scene);
        for stroke in &scene.stroke {
            timeline.add(stroke)?;
        }
        let mut simulation = Self {
            state: State {
                scene: Arc::new(scene.clone()),
                solver: scene.solver.clone(),
                precision,
                compute_device,
                clock: Clock::new(settings.time_step),
                gravity: settings.gravity,
                colliders: Colliders::new(scene),
                next: NextNumbers::new(scene),
                removed: Vec::new(),
                reporting: scene.report.clone(),
                dependents: Dependents {
                    merged,
                    pieces: PieceNumbers::new(&islands),
                    on_cut: Vec::new(),
                },
                islands,
                timeline,
                report: FrameReport::default(),
                residuals_kept: false,
                forces_measured: false,
            },
            open_device: OpenDevice::default(),
            deltas: Vec::new(),
            events: Vec::new(),
            pool,
        };
        simulation.collect_positions();
        simulation.report_before_the_first();
        Ok(simulation)
    }

    /// Carries out the strokes of the frame to come, and nothing else.
    #[cfg(feature = "advise")]
    pub(crate) fn cut_now(&mut self) -> Result<(), Error> {
        self.carry_out_strokes(&mut Vec::new(), &mut Milliseconds::default())?;
        Ok(())
    }

    #[cfg(feature = "advise")]
    pub(crate) fn islands(&self) -> &[Island] {
        &self.state.islands
    }

    /// The number in the merged mesh of a particle of an island.
    pub(crate) fn particle(&self, island: usize, particle: usize) -> usize {
        match &self.state.dependents.merged {
            Some(merged) => merged.particle(island, particle),
            None => particle,
        }
    }

    /// Adds a stroke. A stroke whose frame has passed cuts at the start of the next step.
    ///
    /// # Errors
    /// If a value of the stroke lies outside its range, or its blade is solid on a GPU or where a body is solved by VBD.
    pub fn cut(&mut self, stroke: StrokeSpec) -> Result<(), Error> {
        if stroke.is_solid() {
            self.check_solid()?;
        }
        self.state.timeline.add(&stroke)?;
        if stroke.is_solid() {
            self.keep_off_vbd();
        }
        Ok(())
    }

    /// Advances by one frame and reports on it.
    ///
    /// A scene of 10,000 tets or more is computed on a thread of the present rayon pool, also when called from outside of it,
    /// so that what is local to the calling thread, such as a subscriber of `tracing`, is not seen there.
    ///
    /// # Errors
    /// If a stroke cannot be carried out (bodies that it has not cut yet are unchanged), or the device is lost or out of
    /// memory.
    pub fn step(&mut self) -> Result<&FrameReport, Error> {
        // The pool is taken out so that the closure may borrow the rest.
        match self.pool.take() {
            Some(pool) => {
                let result = pool.install(|| self.frame());
                self.pool = Some(pool);
                result?;
            }
            // From outside of a pool each parallel loop would wait for one of its threads.
            None if self.is_large() => rayon::scope(|_| self.frame())?,
            None => self.frame()?,
        }
        Ok(&self.state.report)
    }

    /// Whether a frame takes so long that reaching the thread pool is a small part of it.
    fn is_large(&self) -> bool {
        let islands = self.state.islands.iter();
        let tets: usize = islands
            .map(|island| island.cuttable.mesh().tets.len())
            .sum();
        tets >= MANY_TETS
    }

    fn frame(&mut self) -> Result<(), Error> {
        let _span =
            tracing::debug_span!("incise::frame", frame = self.state.clock.next_frame).entered();
        let start = Instant::now();
        let mut ms = Milliseconds::default();
        let mut detached = Vec::new();
        let mut repaired = 0;
        if self.state.compute_device.is_gpu() && self.state.changes_meshes() {
            repaired += self.fetch(&mut ms)?;
        }
        let cut = self.carry_out_strokes(&mut detached, &mut ms)?;
        self.events = self.state.timeline.take_events();
        let ended = |event: &Event| matches!(event, Event::CutEnded { .. });
        let first_end = self
            .events
            .iter()
            .position(ended)
            .unwrap_or(self.events.len());
        let detached_now = detached.iter().copied().map(Event::PieceDetached);
        self.events.splice(first_end..first_end, detached_now);
        if cut.is_some() {
            self.judge_cuts();
        }
        let mut reclustered = 0;
        for island in &mut self.state.islands {
            reclustered +=
                usize::from(island.renew_partition(self.state.clock.next_frame, &mut ms)?);
        }

        let before_solve = Instant::now();
        let (frame, residual) = (self.state.clock.next_frame, self.wants(Quantity::Residual));
        let force = self.wants(Quantity::Force);
        // What falls asleep keeps the forces that it sleeps with.
        let measures = force || (self.sleeps() && self.reports(Quantity::Force));
        let moves = self.state.colliders.take_moves();
        for island in &mut self.state.islands {
            for &(place, to) in &moves {
                collider::send(
                    &mut island.settings.colliders[place],
                    to,
                    self.state.clock.time_step,
                );
            }
        }
        let islands = self.state.islands.par_iter_mut();
        let solved = islands
            .map(|island| {
                let step = island.step(frame, residual, measures);
                step.map(|step| step.repaired)
            })
            .try_reduce(|| 0, |a, b| Ok(a + b));
        for island in &mut self.state.islands {
            for &(place, to) in &moves {
                collider::arrive(&mut island.settings.colliders[place], to);
            }
        }
        repaired += solved?;
        for island in &mut self.state.islands {
            let works = std::mem::take(&mut island.constraints.edge_work);
            for ((stroke, _), work) in island.constraints.blades.iter().zip(works) {
                self.state.timeline.add_work(*stroke, work);
            }
        }
        ms.solve = milliseconds(before_solve.elapsed());
        self.collect_contacts(&mut ms);
        self.state.residuals_kept = residual;
        self.state.forces_measured = force;

        // A device measures what it has; residuals need positions and multipliers of all.
        if !self.state.compute_device.is_gpu() || residual {
            repaired += self.fetch(&mut ms)?;
        }
        self.state.report = FrameReport {
            frame: self.state.clock.next_frame,
            time_s: self.state.clock.time_at(self.state.clock.next_frame + 1),
            cut,
            detached,
            repaired,
            reclustered,
            ..FrameReport::default()
        };
        self.measure(&mut ms)?;
        self.count();
        self.collect_warnings();
        ms.total = milliseconds(start.elapsed());
        ms.other = ms.total
            - (ms.cut
                + ms.cluster
                + ms.color
                + ms.schedule
                + ms.upload
                + ms.contact
                + ms.solve
                + ms.readback);
        self.state.report.ms = ms;
        self.state.clock.next_frame += 1;
        Ok(())
    }

    /// Collects the contact times of all islands and the contacts that began and ended.
    fn collect_contacts(&mut self, ms: &mut Milliseconds) {
        let State {
            islands,
            dependents: Dependents { pieces, .. },
            ..
        } = &mut self.state;
        for (number, island) in islands.iter_mut().enumerate() {
            let Some(contacts) = &mut island.constraints.contacts else {
                continue;
            };
            ms.contact = ms.contact.max(contacts.take_milliseconds());
            for change in contacts.take_changes() {
                let of_scene = change.pieces.map(|piece| pieces.of_scene(number, piece));
                let (pieces, bodies) = (of_scene.map(|(id, _)| id), of_scene.map(|(_, body)| body));
                self.events.push(if change.begins {
                    Event::ContactBegan { pieces, bodies }
                } else {
                    Event::ContactEnded { pieces, bodies }
                });
            }
            for (bodies, depth) in contacts.take_starts_inside() {
                let bodies = bodies.map(|body| body as usize);
                let warning = Warning::of_start_inside_each_other(bodies, depth);
                island.judged.warnings.push(warning);
            }
            if let Some(overlap) = contacts.take_overlap() {
                let of_scene = overlap.pieces.map(|piece| pieces.of_scene(number, piece));
                let warning = overlap.warning(of_scene);
                island.judged.warnings.push(warning);
            }
        }
        ms.contact = ms.contact.min(ms.solve);
        ms.solve -= ms.contact;
    }

    /// Lets islands that were cut choose substeps again where that is due.
    fn judge_cuts(&mut self) {
        let State {
            islands,
            scene,
            solver,
            ..
        } = &mut self.state;
        for island in islands {
            let asked = island.asked(|body| scene.body[body].substeps.unwrap_or(solver.substeps));
            island.judge_cut(&asked);
        }
    }

    /// Puts the warnings of all islands into the report, and looks for divergence.
    fn collect_warnings(&mut self) {
        let elapsed = self.state.report.time_s;
        for missed in self.state.timeline.take_missed() {
            let bodies = self.state.islands.iter().flat_map(Island::boxes);
            let near = bodies.map(|(body, bounds)| (missed.reach.distance(&bounds), body, bounds));
            let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let nearest = nearest.map(|(_, body, bounds)| (body, bounds));
            let warning = Warning::of_missed_stroke(missed, nearest);
            self.state.report.warnings.push(warning);
        }
        if self.state.clock.next_frame == 0 {
            let has_ground = self.state.scene.world.ground.is_some();
            if has_ground && self.state.gravity.is_none() {
                self.state.report.warnings.push(Warning::of_no_gravity());
            }
            let of_keys = unused_keys::warnings(&self.state.solver, &self.state.islands);
            self.state.report.warnings.extend(of_keys);
        }
        let of_strokes = self.state.timeline.take_warnings();
        self.state.report.warnings.extend(of_strokes);
        for island in &mut self.state.islands {
            self.state
                .report
                .warnings
                .append(&mut island.judged.warnings);
            let speed = match self.state.compute_device.gpu {
                Some(_) => self.state.report.max_speed.unwrap_or(0.0),
                None => island.solver.host().max_speed(),
            };
            if island.is_absurd(speed, elapsed) {
                let message = format!(
                    "the solution has diverged: a particle moves at {speed:.1e} m/s; check method, relaxation and substeps"
                );
                let warning = Warning::new(WarningCode::Diverged, &island.bodies, message);
                self.state.report.warnings.push(warning);
            }
        }
        if self.state.report.repaired > 0 {
            let bodies: Vec<usize> = self
                .state
                .islands
                .iter()
                .flat_map(|g| g.bodies.clone())
                .collect();
            let message = format!(
                "{} would have become infinite and were put back: use more substeps",
                counted(self.state.report.repaired, "particle")
            );
            let warning = Warning::new(WarningCode::Repaired, &bodies, message);
            self.state.report.warnings.push(warning);
        }
    }

    /// Whether the next frame reports a quantity.
    fn wants(&self, quantity: Quantity) -> bool {
        self.state
            .clock
            .next_frame
            .is_multiple_of(self.state.reporting.every)
            && self.reports(quantity)
    }

    /// Whether some frames report a quantity.
    fn reports(&self, quantity: Quantity) -> bool {
        self.state.reporting.quantities.contains(&quantity)
    }

    /// Whether substeps are chosen for a body.
    fn chooses(&self) -> bool {
        self.state
            .islands
            .iter()
            .any(|island| island.judged.choice.is_some())
    }

    /// Whether bodies may sleep.
    fn sleeps(&self) -> bool {
        self.state
            .islands
            .iter()
            .any(|island| island.sleep.is_some())
    }

    /// Removes bodies and cuts what is due, with all that depends on the meshes; adds what comes off to `detached`.
    fn carry_out_strokes(
        &mut self,
        detached: &mut Vec<DetachedReport>,
        ms: &mut Milliseconds,
    ) -> Result<Option<CutReport>, Error> {
        let start = Instant::now();
        let wants_kappa = self.wants(Quantity::Kappa);
        let notes_kappa = wants_kappa || self.chooses();
        let Self { state, deltas, .. } = self;
        deltas.clear();
        let mut cut = Cut {
            number: state.clock.next_frame,
            notes_kappa: notes_kappa.then_some(wants_kappa),
            deltas,
            detached,
            report: None,
            measuring: 0.0,
        };
        state.carry_out(&mut cut, ms)?;
        let Cut {
            report, measuring, ..
        } = cut;
        let others = ms.cluster + ms.color + ms.schedule + ms.upload + measuring;
        ms.cut = milliseconds(start.elapsed()) - others;
        Ok(report)
    }

    /// Returns the report on the last frame. Before the first frame only its counts and the chosen substeps are valid.
    #[must_use]
    pub fn report(&self) -> &FrameReport {
        &self.state.report
    }

    /// Returns the positions of all particles in m, in the numbers of [`Simulation::mesh`]. If the state is on a
    /// device, these are the positions of the last [`Simulation::read_back`].
    #[must_use]
    pub fn positions(&self) -> &[DVec3] {
        match &self.state.dependents.merged {
            Some(merged) => &merged.positions,
            None => &self.state.islands[0].positions,
        }
    }

    /// Returns the mesh at rest of all bodies, with all cuts made so far.
    ///
    /// At the start particles and tets are numbered body by body in the order of the scene. Cuts do not change numbers:
    /// the first child of a cut tet takes over its number; other new tets and new particles get the next ones, stroke
    /// by stroke and within a stroke body by body. A removal moves the last tets into the gaps and leaves particles without
    /// tets; [`repair`](incise_mesh::repair) with `drop_unused` makes a mesh without them.
    #[must_use]
    pub fn mesh(&self) -> &TetMesh {
        match &self.state.dependents.merged {
            Some(merged) => &merged.mesh,
            None => self.state.islands[0].cuttable.mesh(),
        }
    }

    /// Returns the boundary triangles of the present mesh, outer and cut. O(n log n).
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.mesh().surface()
    }

    /// Returns for each particle what supports it, in the numbers of [`Simulation::mesh`]. O(particles).
    ///
    /// # Example
    /// ```
    /// use incise::meshing::{Shape, generate};
    /// use incise::{Body, Simulation, Support};
    ///
    /// let mut builder = Simulation::builder();
    /// builder.add_body(Body::new(generate(Shape::Beam, 300)?).pinned(|x| x.x < -0.45));
    /// let simulation = builder.build()?;
    /// let is_pinned = |x: f64| if x < -0.45 { Support::Pinned } else { Support::Free };
    /// for (x, support) in simulation.mesh().positions.iter().zip(simulation.supports()) {
    ///     assert_eq!(support, is_pinned(x.x));
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn supports(&self) -> Vec<Support> {
        let mut supports = vec![Support::Free; self.mesh().positions.len()];
        for (g, island) in self.state.islands.iter().enumerate() {
            let solver = island.solver.host();
            for p in 0..solver.particle_count() {
                let support = match (solver.is_fixed(p), solver.handle_of(p)) {
                    (true, _) => Support::Pinned,
                    (false, Some(_)) => Support::Attached,
                    (false, None) => continue,
                };
                supports[self.particle(g, p)] = support;
            }
        }
        supports
    }

    /// Returns the events of the last frame: cuts that began, pieces that were detached, cuts that ended; then contacts
    /// that began and ended.
    #[must_use]
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Returns the topology changes of the last frame's strokes in order, in the numbers of [`Simulation::mesh`], for
    /// renderers ([`incise_cutting::Skin`]), recorders and other users of the mesh.
    #[must_use]
    pub fn deltas(&self) -> &[CutDelta] {
        &self.deltas
    }

    /// Returns the boundary triangles with their kind: outer surface, or the number of the stroke that opened it,
    /// counted from 0 in the order of the scene, of [`Simulation::cut`] and of [`Simulation::begin_stroke`]. No pass
    /// over the mesh.
    pub fn boundary(&self) -> impl Iterator<Item = BoundaryTriangle> + '_ {
        let islands = self.state.islands.iter().enumerate();
        islands.flat_map(move |(g, island)| {
            let triangles = island.cuttable.boundary();
            triangles.map(move |triangle| match &self.state.dependents.merged {
                Some(merged) => merged.triangle(g, &triangle),
                None => triangle,
            })
        })
    }

    /// Returns for each particle whether it is on a cut face; empty before the first cut. Triangles of the outer
    /// surface at the rim of a cut can have three such particles, too; [`Simulation::boundary`] tells them apart.
    #[must_use]
    pub fn on_cut(&self) -> &[bool] {
        &self.state.dependents.on_cut
    }

    /// Returns the pieces of all bodies by ascending number, with tets, volume, mass and the piece each was detached
    /// from.
    ///
    /// Before all cuts pieces are numbered body by body (joined bodies at the place of the first of them), those of a
    /// body by their first tets. Detached pieces get the next numbers, stroke by stroke and within a stroke body by
    /// body. The part of a split piece with the most tets keeps its number, see
    /// [`PieceTracker::apply_delta`](incise_cutting::PieceTracker::apply_delta). No number is used twice. O(pieces,
    /// including former ones).
    #[must_use]
    pub fn pieces(&self) -> Vec<PieceReport> {
        self.state.dependents.pieces.report(&self.state.islands)
    }

    /// Returns the piece number of each tet of [`Simulation::mesh`], as in [`Simulation::pieces`]. O(tets).
    #[must_use]
    pub fn piece_numbers(&self) -> Vec<u32> {
        let State {
            islands,
            dependents: Dependents { merged, pieces, .. },
            ..
        } = &self.state;
        let islands = islands.iter().enumerate();
        let mut of_islands: Vec<Vec<u32>> = islands
            .map(|(number, island)| pieces.of_tets(number, island).collect())
            .collect();
        match merged {
            Some(merged) => merged.of_tets(&of_islands),
            None => of_islands.swap_remove(0),
        }
    }

    /// Returns the clusters of tets. With several islands of bodies they are merged in O(tets), and clusters of an
    /// island are numbered after those of the islands before it, so a cut can change their numbers.
    #[must_use]
    pub fn clustering(&self) -> Cow<'_, Clustering> {
        match &self.state.dependents.merged {
            Some(merged) => Cow::Owned(merged.partition(&self.state.islands).0),
            None => Cow::Borrowed(&self.state.islands[0].partition.clustering),
        }
    }

    /// Returns the colors of the clusters. With several islands of bodies they are merged: O(tets).
    #[must_use]
    pub fn coloring(&self) -> Cow<'_, Coloring> {
        match &self.state.dependents.merged {
            Some(merged) => Cow::Owned(merged.partition(&self.state.islands).1),
            None => Cow::Borrowed(self.state.islands[0].partition.coloring()),
        }
    }

    /// Returns the order of solving. With several islands of bodies the schedules are merged, O(tets); islands do not
    /// wait for each other.
    #[must_use]
    pub fn schedule(&self) -> Cow<'_, Schedule> {
        match &self.state.dependents.merged {
            Some(merged) => {
                let (clustering, coloring) = merged.partition(&self.state.islands);
                Cow::Owned(Schedule::new(&clustering, &coloring))
            }
            None => Cow::Borrowed(&self.state.islands[0].partition.schedule),
        }
    }

    /// Returns the largest kappa of a tet that can move, `E Δt² / (ρ h²)`, without softening. Up to about 0.5 the motion is accurate.
    /// Δt is the substep of the tet's body.
    #[must_use]
    pub fn kappa(&self) -> f64 {
        kappa(&self.state.islands)
    }

    /// Returns the number and volume of tets that `kappa_limit` has made softer than their material.
    #[must_use]
    pub fn softened(&self) -> SoftenedReport {
        softened(&self.state.islands)
    }

    /// Recomputes all derived data and compares: the mesh, the lists around its particles, volume, masses, clusters,
    /// colors, schedule, pieces. O(n log n); for tests and on request. A device receives changes with the next step, so
    /// call this after a step, not before the first one or between [`Simulation::grab`] or [`Simulation::release`] and
    /// the next.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] or [`Error::Cut`] name the first difference.
    pub fn check(&self) -> Result<(), Error> {
        self.state.islands.iter().try_for_each(Island::check)?;
        self.state.dependents.pieces.check(&self.state.islands)?;
        self.state
            .dependents
            .merged
            .as_ref()
            .map_or(Ok(()), |merged| merged.check(&self.state.islands))
    }
}
