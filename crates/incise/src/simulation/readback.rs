//! Reading the state of a [`Simulation`]: positions, reported quantities, readback from a device.
//!
//! On the CPU the state is available after each frame. On a device it stays there: reported sums are computed there,
//! and only data of all particles is read back. Cost: a pass for the reported quantities; a wait for the device if they
//! need it.

use glam::DVec3;
use incise_mesh::ParticleId;
use incise_xpbd::ErasedSolver;
use web_time::Instant;

use super::Simulation;
use crate::Error;
use crate::measure::{
    by_body, contact, energy, kappa, max_speed, residual, residuals_of_tets, softened, states,
    volume,
};
use crate::report::{ContactForce, FrameReport, Milliseconds, milliseconds};
use crate::scene::Quantity;

impl Simulation {
    /// Computes the quantities that this frame reports.
    pub(super) fn measure(&mut self, ms: &mut Milliseconds) -> Result<(), Error> {
        let kappa_too = self.wants(Quantity::Kappa);
        if kappa_too || self.chooses() || self.sleeps() {
            self.state.report.bodies = by_body(&mut self.state.islands, kappa_too);
        }
        if !self
            .state
            .report
            .frame
            .is_multiple_of(self.state.reporting.every)
        {
            return Ok(());
        }
        self.state.report.contact = contact(&self.state.islands);
        let start = Instant::now();
        let states = states(
            &mut self.state.islands,
            self.state.gravity,
            &self.state.reporting.quantities,
        )?;
        if self.state.compute_device.is_gpu() {
            let islands = self.state.islands.iter_mut();
            self.state.report.repaired += islands
                .map(|island| island.solver.backend_mut().take_repaired())
                .sum::<usize>();
            ms.readback += milliseconds(start.elapsed());
        }
        for quantity in &self.state.reporting.quantities {
            let report = &mut self.state.report;
            match quantity {
                Quantity::Residual => {
                    report.residual = residual(&self.state.islands, self.state.gravity);
                }
                Quantity::Energy => report.energy = Some(energy(&states)),
                Quantity::Volume => {
                    let volume = volume(&states);
                    report.volume = Some(volume.total);
                    // Nothing may be left.
                    let error = volume.total / volume.rest - 1.0;
                    report.volume_error = Some(if volume.rest > 0.0 { error } else { 0.0 });
                    report.min_volume_ratio = Some(volume.min_ratio);
                    report.inverted_tets = Some(volume.inverted);
                }
                Quantity::Speed => report.max_speed = Some(max_speed(&states)),
                // They are read off below: it takes all of the simulation.
                Quantity::Force => {}
                Quantity::Kappa => {
                    report.kappa = Some(kappa(&self.state.islands));
                    report.softened = Some(softened(&self.state.islands));
                }
            }
        }
        if self.state.forces_measured {
            self.state.report.forces = self.forces();
        }
        Ok(())
    }

    /// Makes the report what it is before the first frame.
    pub(super) fn report_before_the_first(&mut self) {
        self.state.report = FrameReport::default();
        self.count();
        if self.chooses() {
            self.state.report.bodies = by_body(&mut self.state.islands, false);
        }
    }

    /// Fills in the counts of the report.
    pub(super) fn count(&mut self) {
        let mesh = self.mesh();
        let (particles, tets) = (mesh.positions.len(), mesh.tets.len());
        let partitions = || self.state.islands.iter().map(|island| &island.partition);
        let clusters = partitions()
            .map(|partition| partition.clustering.occupied())
            .sum();
        let colors = partitions().map(|partition| partition.schedule.color_count());
        let colors = colors.max().unwrap_or(0);
        let report = &mut self.state.report;
        report.particles = particles;
        report.tets = tets;
        report.clusters = clusters;
        report.colors = colors;
        report.pieces = self
            .state
            .islands
            .iter()
            .map(|island| island.pieces.count())
            .sum();
        report.backend = self.state.compute_device.name();
        report.precision = self.state.precision.name();
    }

    /// Takes over state and positions; returns how many particles a device had to put back since the last time.
    pub(super) fn fetch(&mut self, ms: &mut Milliseconds) -> Result<usize, Error> {
        let start = Instant::now();
        let mut repaired = 0;
        for island in &mut self.state.islands {
            repaired += island.solver.backend_mut().read_back()?;
        }
        if self.state.compute_device.is_gpu() {
            ms.readback += milliseconds(start.elapsed());
        }
        self.collect_positions();
        Ok(repaired)
    }

    /// Updates [`Simulation::positions`] if the state is on a device: waits for it and reads the positions back. On the
    /// CPU they are always current, and nothing happens.
    ///
    /// A frame reads the state back by itself if a stroke is due, the mesh is to be improved, a body is removed, contact
    /// is declared or residuals are reported. In frames with contact `positions` keeps the state of the last call unless
    /// residuals are reported. Energies, volume and speed are summed on the device.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn read_back(&mut self) -> Result<(), Error> {
        if self.state.compute_device.is_gpu() {
            self.state.report.repaired += self.fetch(&mut Milliseconds::default())?;
        }
        Ok(())
    }

    /// Returns the velocities of all particles of [`Simulation::mesh`] in m/s; on a device those of the last
    /// [`Simulation::read_back`]. O(particles).
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     "[world]\ngravity = [0.0, 0.0, -10.0]\n[[body]]\nshape = { kind = \"box\", tets = 200 }",
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// let expected = DVec3::Z * -10.0 * simulation.time_step();
    /// assert!(simulation.velocities().iter().all(|v| (*v - expected).length() < 1e-4));
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn velocities(&self) -> Vec<DVec3> {
        self.of_particles(|solver, particle| solver.velocity(particle))
    }

    /// Returns the masses of all particles of [`Simulation::mesh`] in kg. A tet gives a quarter of its mass to each corner.
    /// In a scene with contact heavy corners of tets at cuts lend mass to light ones, so that what presses on a light corner
    /// does not throw it. The sum is the mass of the bodies; particles without tets have none. O(particles).
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     "[[body]]\nshape = { kind = \"box\", tets = 200 }\nvelocity = [2.0, 0.0, 0.0]",
    /// )?;
    /// let simulation = Simulation::new(&scene)?;
    /// let (masses, velocities) = (simulation.masses(), simulation.velocities());
    /// let mass: f64 = masses.iter().sum();
    /// assert!((mass / (1000.0 * simulation.mesh().total_volume()) - 1.0).abs() < 1e-9);
    /// let momentum: DVec3 = masses.iter().zip(&velocities).map(|(m, v)| *m * *v).sum();
    /// assert!((momentum / mass - DVec3::X * 2.0).length() < 1e-6);
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn masses(&self) -> Vec<f64> {
        self.of_particles(|solver, particle| solver.mass(particle))
    }

    /// A value of each particle of the mesh.
    fn of_particles<T>(&self, value: impl Fn(&dyn ErasedSolver, usize) -> T) -> Vec<T> {
        let particles = (0..self.mesh().positions.len()).map(ParticleId::new);
        let located = particles.map(|p| self.location_of(p));
        let islands = &self.state.islands;
        located
            .map(|(island, particle)| value(islands[island].solver.host(), particle))
            .collect()
    }

    /// Returns a note on the compute device: its name, or why `auto` took the CPU; `None` if the scene requests the
    /// CPU.
    #[must_use]
    pub fn backend_note(&self) -> Option<&str> {
        self.state.compute_device.note.as_deref()
    }

    /// The duration of a frame in s.
    #[must_use]
    pub fn time_step(&self) -> f64 {
        self.state.clock.time_step
    }

    /// Returns the number of the next frame, counted from 0.
    #[must_use]
    pub fn next_frame(&self) -> u64 {
        self.state.clock.next_frame
    }

    /// Returns the island of bodies that solves a particle of [`Simulation::mesh`], and the particle's number there.
    /// O(1).
    ///
    /// Bodies joined by distances or contact are one island, every other body is its own; islands are numbered in the order of
    /// their first bodies. On a device the island is the index of its solver in `Simulation::device_solvers`: a
    /// renderer that draws the whole mesh from the buffers of the solvers looks up its particles here, all of them once
    /// at the start and later those that [`Simulation::deltas`] append. The result for a particle changes only
    /// when islands are joined ([`Simulation::add_distance`], [`Simulation::add_body`]) or a snapshot is restored.
    ///
    /// # Panics
    /// If the particle does not exist.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::ParticleId;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     r#"
    ///     [[body]]
    ///     shape = { kind = "box", tets = 200 }
    ///     [[body]]
    ///     shape = { kind = "sphere", tets = 200 }
    ///     position = [3.0, 0.0, 0.0]
    ///     "#,
    /// )?;
    /// let simulation = Simulation::new(&scene)?;
    /// let last = ParticleId::new(simulation.mesh().positions.len() - 1);
    /// assert_eq!(simulation.location_of(ParticleId(0)), (0, 0));
    /// assert_eq!(simulation.location_of(last).0, 1);
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn location_of(&self, particle: ParticleId) -> (usize, usize) {
        let count = self.mesh().positions.len();
        assert!(particle.index() < count, "the mesh has {count} particles");
        match &self.state.dependents.merged {
            Some(merged) => merged.location(particle),
            None => (0, particle.index()),
        }
    }

    /// The forces between pieces that touched in the last frame, in a scene with contact, ascending by island and pieces.
    /// A piece that touches itself is not listed. O(pieces that touch).
    ///
    /// ```
    /// use incise::{Scene, Simulation};
    ///
    /// // A box lies on another one.
    /// let scene = Scene::from_toml(
    ///     r#"
    ///     [world]
    ///     gravity = [0.0, 0.0, -9.81]
    ///     ground = { height = 0.0 }
    ///     [contact]
    ///     [[body]]
    ///     shape = { kind = "box", tets = 200 }
    ///     position = [0.0, 0.0, 0.3]
    ///     damping = 0.02
    ///     [[body]]
    ///     shape = { kind = "box", tets = 200 }
    ///     position = [0.0, 0.0, 0.9]
    ///     damping = 0.02
    ///     "#,
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// for _ in 0..5 {
    ///     simulation.step()?;
    /// }
    /// println!("{:?}", simulation.contacts());
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn contacts(&self) -> Vec<ContactForce> {
        let islands = self.state.islands.iter().enumerate();
        let all = islands.flat_map(|(number, island)| {
            let touches = island
                .constraints
                .contacts
                .iter()
                .flat_map(|contacts| contacts.touches());
            touches.map(move |touch| (number, touch))
        });
        all.map(|(number, touch)| {
            let of_scene = touch
                .pieces
                .map(|piece| self.state.dependents.pieces.of_scene(number, piece));
            ContactForce {
                pieces: of_scene.map(|(id, _)| id),
                bodies: of_scene.map(|(_, body)| body),
                force: touch.force,
                torque: touch.torque,
            }
        })
        .collect()
    }

    /// Returns the residual of each tet of [`Simulation::mesh`] in the last substep: the norm of `C + α̃ λ` over its
    /// two constraints, without unit. The root of the sum of squares is the `dual` of the reported residuals. 0 for
    /// removed tets and sleeping bodies.
    ///
    /// `None` unless the last frame has reported [`Quantity::Residual`], after [`Simulation::set_solver`] until the
    /// next such frame, and for VBD, which has no multipliers. O(tets).
    ///
    /// ```
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     "[report]\nquantities = [\"residual\"]\n[[body]]\nshape = { kind = \"sphere\", tets = 300 }",
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// assert!(simulation.residuals_of_tets().is_none());
    /// simulation.step()?;
    /// let residuals = simulation.residuals_of_tets().expect("they are reported");
    /// assert_eq!(residuals.len(), simulation.mesh().tets.len());
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn residuals_of_tets(&self) -> Option<Vec<f64>> {
        if !self.state.residuals_kept {
            return None;
        }
        let islands = self.state.islands.iter().map(residuals_of_tets);
        let mut islands = islands.collect::<Option<Vec<_>>>()?;
        match &self.state.dependents.merged {
            Some(merged) => Some(merged.of_tets(&islands)),
            None => islands.pop(),
        }
    }

    /// Takes over the positions of the solvers.
    pub(super) fn collect_positions(&mut self) {
        for island in &mut self.state.islands {
            island.solver.host().positions(&mut island.positions);
        }
        if let Some(merged) = &mut self.state.dependents.merged {
            merged.collect_positions(&self.state.islands);
        }
    }
}
