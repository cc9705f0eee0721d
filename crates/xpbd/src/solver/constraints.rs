//! The constraints of a [`Solver`] besides its tets: attachments to handles, distances, volumes and contacts.

use incise_graph::{Coloring, GraphError, Schedule};

use super::Solver;
use crate::constraints::{Distance, Distances, TetVolume, Volumes};
use crate::{
    AttachmentData, ContactData, ContactFactors, ContactLaw, ContactRound, ContactState,
    DistanceConstraint, DistanceData, Float, PairContact, Pose, SolidBlade, StepSettings,
    SurfaceContact, VolumeConstraint, VolumeData, XpbdError,
};

impl<R: Float> Solver<R> {
    /// Adds a handle and returns its number.
    ///
    /// # Panics
    /// If the pose is not finite or its rotation not of length 1.
    pub fn add_handle(&mut self, pose: Pose) -> u32 {
        pose.check();
        self.constraints.attachments.add_handle(pose)
    }

    /// Sets the pose of a handle at the end of the next frame; it stays there until it is set again.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation not of length 1.
    pub fn move_handle(&mut self, handle: u32, pose: Pose) {
        pose.check();
        self.constraints.attachments.move_handle(handle, pose);
    }

    /// Sets the pose of a handle at once. Attached particles move there in the next substep.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation not of length 1.
    pub fn set_handle(&mut self, handle: u32, pose: Pose) {
        pose.check();
        self.constraints.attachments.set_handle(handle, pose);
    }

    /// Returns the present pose of a handle.
    ///
    /// # Panics
    /// If the handle does not exist.
    #[must_use]
    pub fn handle(&self, handle: u32) -> Pose {
        self.constraints.attachments.pose(handle)
    }

    /// Attaches a particle to a handle at the present positions of both. A particle has one attachment; another one
    /// replaces the first.
    ///
    /// `compliance` is one over the stiffness in m/N, 0 is rigid. `damping` is a time in s: the motion relative to the
    /// handle is resisted by it times the stiffness (no effect with a compliance of 0). A fixed particle stays fixed.
    /// Copies of particles by a cut are attached like their originals, and a particle on an edge if both ends are
    /// attached to the same handle; with a compliance, each has its own spring.
    ///
    /// O(log n + attachments of higher particles).
    ///
    /// # Errors
    /// If compliance or damping is negative or infinite.
    ///
    /// # Panics
    /// If the particle or the handle does not exist.
    ///
    /// # Example
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use incise_graph::{Coloring, GraphError, Schedule};
    /// use incise_xpbd::{Pose, Solver, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::X]);
    /// solver.set_mass(0, 1.0);
    /// let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    /// solver.attach(0, handle, 0.0, 0.0)?;
    /// let turned = Pose { position: DVec3::Z, rotation: DQuat::from_rotation_z(1.0) };
    /// solver.move_handle(handle, turned);
    /// solver.step(&Schedule::default(), &StepSettings { substeps: 3, ..StepSettings::new(0.016) })?;
    /// assert_eq!(solver.position(0), turned.apply(DVec3::X));
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn attach(
        &mut self,
        particle: usize,
        handle: u32,
        compliance: f64,
        damping: f64,
    ) -> Result<(), XpbdError> {
        let Self {
            particles,
            constraints,
            ..
        } = self;
        let spring = [compliance, damping];
        constraints
            .attachments
            .attach(particles, particle, handle, spring)?;
        self.note(|changes| changes.attachments = true);
        self.set_weight(particle);
        Ok(())
    }

    /// Sets the compliance of all particles of a handle in m/N at their present positions; 0 is rigid. O(attachments).
    ///
    /// # Errors
    /// If the compliance is negative or infinite.
    pub fn set_compliance(&mut self, handle: u32, compliance: f64) -> Result<(), XpbdError> {
        let attachments = &mut self.constraints.attachments;
        for particle in attachments.set_compliance(handle, compliance)? {
            self.set_weight(particle);
        }
        self.note(|changes| changes.attachments = true);
        Ok(())
    }

    /// Detaches a particle; it keeps its velocity. O(log n + attachments of higher particles).
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn detach(&mut self, particle: usize) {
        if self.constraints.attachments.detach(particle) {
            self.note(|changes| changes.attachments = true);
        }
        self.set_weight(particle);
    }

    /// Detaches all particles of a handle; they keep their velocities.
    ///
    /// O(attachments), and O(log n + attachments of higher particles) for each that is detached.
    pub fn detach_all(&mut self, handle: u32) {
        let attached = self.attachments().filter(|a| a.handle == handle);
        let particles: Vec<u32> = attached.map(|a| a.particle).collect();
        // The list of attachments closes up behind each of them.
        for p in particles.into_iter().rev() {
            self.detach(p as usize);
        }
    }

    /// Returns the number of handles.
    #[must_use]
    pub fn handle_count(&self) -> usize {
        self.constraints.attachments.handle_count()
    }

    /// Returns the handle that a particle is attached to.
    #[must_use]
    pub fn handle_of(&self, particle: usize) -> Option<u32> {
        self.constraints.attachments.get(particle).map(|a| a.handle)
    }

    /// Returns all attachments, ascending by particle.
    pub fn attachments(&self) -> impl ExactSizeIterator<Item = AttachmentData> + '_ {
        self.constraints.attachments.list()
    }

    /// Returns the poses of all handles at a fraction of the frame.
    pub fn handle_poses(&self, fraction: f64) -> impl ExactSizeIterator<Item = Pose> + '_ {
        self.constraints.attachments.poses(fraction)
    }

    /// Replaces all distance constraints; an empty list costs no memory and no time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`, from any coloring. O(constraints).
    ///
    /// A cut leaves them on their particles; copies of particles have none.
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A mass of 1 kg stretches a spring of 10 N/m by `m g` times the compliance.
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{DistanceConstraint, Solver, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::NEG_Z]);
    /// solver.set_mass(1, 1.0); // the other one has none and stays
    /// let spring = DistanceConstraint {
    ///     particles: [0, 1],
    ///     length: 1.0,
    ///     compliance: 0.1,
    ///     damping: 0.2,
    ///     tension_only: false,
    /// };
    /// let order = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// solver.set_distances(&[spring], order)?;
    /// let gravity = Some(DVec3::NEG_Z * 9.81);
    /// let settings = StepSettings { substeps: 4, gravity, ..StepSettings::new(0.016) };
    /// for _ in 0..1000 {
    ///     solver.step(&Schedule::default(), &settings)?;
    /// }
    /// assert!((solver.position(1).z + 1.0 + 9.81 * 0.1).abs() < 1e-6);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_distances(
        &mut self,
        constraints: &[DistanceConstraint],
        schedule: Schedule,
    ) -> Result<(), XpbdError> {
        let check = |(index, c): (usize, &DistanceConstraint)| c.check(index);
        constraints.iter().enumerate().try_for_each(check)?;
        let list = constraints.iter().map(Distance::new).collect();
        let count = self.particle_count();
        self.constraints.distances = Distances::new("distance", count, list, schedule)?;
        self.note(|changes| changes.distances = true);
        Ok(())
    }

    /// Returns the number of distance constraints.
    #[must_use]
    pub fn distance_count(&self) -> usize {
        self.constraints.distances.list.len()
    }

    /// Returns a distance constraint as plain numbers for a kernel.
    ///
    /// # Panics
    /// If the constraint does not exist.
    #[must_use]
    pub fn distance_data(&self, constraint: u32) -> DistanceData<R> {
        self.constraints.distances.list[constraint as usize].data()
    }

    /// Returns the order in which distance constraints are solved, if there are any.
    #[must_use]
    pub fn distance_schedule(&self) -> Option<&Schedule> {
        self.constraints.distances.schedule()
    }

    /// Replaces all volume constraints; an empty list costs no memory and no time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`. If constraint `i` is that of tet `i`, use the schedule of
    /// the tets. O(constraints).
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A flattened tet recovers its volume.
    /// ```
    /// use glam::{DVec3, dvec3};
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{Solver, StepSettings, VolumeConstraint};
    ///
    /// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// let mut solver = Solver::<f64>::new(&rest);
    /// (0..4).for_each(|p| solver.set_mass(p, 1.0));
    /// solver.set_position(3, dvec3(0.0, 0.0, 0.8));
    /// let order = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
    /// solver.set_volumes(&[VolumeConstraint::of_tet([0, 1, 2, 3], rest, 0.0)], order)?;
    /// let settings = StepSettings { iterations: 5, ..StepSettings::new(0.016) };
    /// solver.step(&Schedule::default(), &settings)?;
    /// let [a, b, c, d] = [0, 1, 2, 3].map(|p| solver.position(p));
    /// assert!(((b - a).cross(c - a).dot(d - a) - 1.0).abs() < 1e-9);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_volumes(
        &mut self,
        constraints: &[VolumeConstraint],
        schedule: Schedule,
    ) -> Result<(), XpbdError> {
        let check = |(index, c): (usize, &VolumeConstraint)| c.check(index);
        constraints.iter().enumerate().try_for_each(check)?;
        let list = constraints.iter().map(TetVolume::new).collect();
        let count = self.particle_count();
        self.constraints.volumes = Volumes::new("volume", count, list, schedule)?;
        self.note(|changes| changes.volumes = true);
        Ok(())
    }

    /// Returns the number of volume constraints.
    #[must_use]
    pub fn volume_count(&self) -> usize {
        self.constraints.volumes.list.len()
    }

    /// Replaces the volume constraint of an index, or appends one at the index after the last. Update the schedule
    /// afterwards: see [`Solver::reschedule_volumes`].
    ///
    /// # Errors
    /// If a value lies outside its range; nothing has changed then.
    ///
    /// # Panics
    /// If there are no volume constraints, the index or a particle does not exist.
    pub fn put_volume(
        &mut self,
        index: usize,
        constraint: VolumeConstraint,
    ) -> Result<(), XpbdError> {
        constraint.check(index)?;
        self.check_particles(constraint.particles);
        let volumes = &mut self.constraints.volumes;
        assert!(
            !volumes.list.is_empty(),
            "volume constraints are edited where there are some"
        );
        volumes.put(index, TetVolume::new(&constraint));
        self.note(|changes| changes.volumes = true);
        Ok(())
    }

    /// Replaces the particles of a volume constraint by copies of them.
    ///
    /// # Panics
    /// If the constraint or a particle does not exist.
    pub fn relink_volume(&mut self, constraint: usize, particles: [u32; 4]) {
        self.check_particles(particles);
        self.constraints.volumes.list[constraint].particles = particles;
        self.note(|changes| changes.volumes = true);
    }

    /// Sets the order of solving after edits; without volume constraints nothing happens. As for tets, no two
    /// constraints of a color may share a particle ([`Schedule::check`]). O(constraints).
    ///
    /// # Panics
    /// If the schedule names a constraint that does not exist.
    pub fn reschedule_volumes(&mut self, schedule: &Schedule) {
        let volumes = &mut self.constraints.volumes;
        if volumes.list.is_empty() {
            return;
        }
        let last = schedule.order().max();
        assert!(
            last.is_none_or(|c| (c as usize) < volumes.list.len()),
            "the schedule belongs to these volume constraints"
        );
        volumes.schedule.clone_from(schedule);
        self.note(|changes| changes.volumes = true);
    }

    /// Returns a volume constraint as plain numbers for a kernel.
    ///
    /// # Panics
    /// If the constraint does not exist.
    #[must_use]
    pub fn volume_data(&self, constraint: u32) -> VolumeData<R> {
        self.constraints.volumes.list[constraint as usize].data()
    }

    /// Returns the order in which volume constraints are solved, if there are any.
    #[must_use]
    pub fn volume_schedule(&self) -> Option<&Schedule> {
        self.constraints.volumes.schedule()
    }

    /// Replaces all contacts: `pairs` of particles that were one before a cut, and those between `surfaces`, of vertices with
    /// triangles and of edges with edges.
    /// Each list comes with a color for each of its contacts; contacts of one color share no particle. Colors from 16 on are
    /// solved by one thread. Contacts are solved after all other constraints but the colliders, pairs before surfaces; [`StepSettings::relaxation`](crate::StepSettings) does not scale them. Only
    /// [`Method::GaussSeidel`](crate::Method) solves contacts: a step by another method is an error from now on, until
    /// [`Solver::clear_contacts`].
    ///
    /// Contacts are detected by the caller, mostly once a frame: a step moves the particles of the contacts that it is
    /// given, and finds none itself. O(particles + contacts), and no allocation once the lists have grown.
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or colors that are not those of the contacts or let
    /// two of them meet on a particle; there are no contacts then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A particle falls on a triangle, which carries its weight.
    /// ```
    /// use glam::{DVec3, dvec3};
    /// use incise_graph::{ColorId, Coloring, Schedule};
    /// use incise_xpbd::{ContactLaw, FaceContact, Solver, StepSettings};
    ///
    /// let at = [dvec3(0.2, 0.2, 0.1), DVec3::ZERO, DVec3::X, DVec3::Y];
    /// let mut solver = Solver::<f64>::new(&at);
    /// solver.set_mass(0, 2.0); // the corners have none and stay
    /// let contact = FaceContact { particles: [0, 1, 2, 3], beyond: None, limit: None, thickness: 0.0 };
    /// let law = ContactLaw { friction: 0.3, recovery_time: 0.02 };
    /// let (none, one) = (Coloring::new(vec![]), Coloring::new(vec![ColorId(0)]));
    /// let settings = StepSettings { substeps: 10, gravity: Some(DVec3::NEG_Z * 9.81), ..StepSettings::new(0.016) };
    /// for _ in 0..60 {
    ///     solver.set_contacts(&law, (&[], &none), (&[contact.into()], &one))?;
    ///     solver.step(&Schedule::default(), &settings)?;
    /// }
    /// let lying = solver.contacts().next().expect("a contact");
    /// assert!(lying.depth.abs() < 1e-12);
    /// assert!((lying.pressure - 2.0 * 9.81).abs() < 1e-9);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_contacts(
        &mut self,
        law: &ContactLaw,
        pairs: (&[PairContact], &Coloring),
        surfaces: (&[SurfaceContact], &Coloring),
    ) -> Result<(), XpbdError> {
        let count = self.particle_count();
        self.note(|changes| changes.contacts = true);
        self.constraints.contacts.set(count, law, pairs, surfaces)
    }

    /// Removes all contacts and their memory; any method may step again.
    pub fn clear_contacts(&mut self) {
        self.note(|changes| changes.contacts = true);
        self.constraints.contacts.clear();
    }

    /// Returns all contacts as plain numbers for a kernel, in solving order, pairs first.
    pub fn contact_data(&self) -> impl Iterator<Item = ContactData<R>> + '_ {
        self.constraints.contacts.data()
    }

    /// Returns which contacts are solved together, round after round; a round without contacts is not listed.
    pub fn contact_rounds(&self) -> impl Iterator<Item = ContactRound> + '_ {
        self.constraints.contacts.rounds()
    }

    /// Returns what all contacts have in common in a step, if [contacts are set](Solver::has_contacts).
    #[must_use]
    pub fn contact_factors(&self, settings: &StepSettings) -> Option<ContactFactors<R>> {
        self.constraints.contacts.factors(settings)
    }

    /// Loads what contacts pressed in a frame or a part of one that was computed elsewhere, for [`Solver::contacts`]: of
    /// each contact in solving order the sum of its impulses on the vertex, and that of their normal parts, all in kg·m.
    ///
    /// # Panics
    /// If the number of impulses is not that of contacts.
    pub fn load_contact_impulses(&mut self, impulses: &[[R; 4]], settings: &StepSettings) {
        self.constraints.contacts.load(impulses, settings);
    }

    /// Returns whether contacts were set, even if there are none at present.
    #[must_use]
    pub fn has_contacts(&self) -> bool {
        self.constraints.contacts.is_declared()
    }

    /// Returns the number of pairs and that of contacts between surfaces.
    #[must_use]
    pub fn contact_counts(&self) -> [usize; 2] {
        self.constraints.contacts.counts()
    }

    /// Returns the number of colors of pairs and surfaces together.
    #[must_use]
    pub fn contact_color_count(&self) -> usize {
        self.constraints.contacts.color_count()
    }

    /// Returns all contacts at the present positions with the forces of the last step since they were set, in solving
    /// order, pairs first. O(contacts).
    pub fn contacts(&self) -> impl Iterator<Item = ContactState> + '_ {
        self.constraints.contacts.states(&self.particles)
    }

    /// Replaces all solid blades: set them before each frame that has some. An empty list costs no memory and no pass. They
    /// are solved after contacts and before colliders. Only methods of XPBD know them. O(listed particles).
    ///
    /// # Errors
    /// A value outside its range, or a particle that does not exist; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A blade moves between two particles at one place and pushes them 2 mm apart.
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::Schedule;
    /// use incise_xpbd::{Solver, SolidBlade, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::ZERO; 2]);
    /// (0..2).for_each(|p| solver.set_mass(p, 0.001));
    /// let edge = |x: f64| [DVec3::new(x, -0.1, 0.0), DVec3::new(x, 0.1, 0.0)];
    /// let blade = SolidBlade {
    ///     edge: [edge(-0.01), edge(0.02)],
    ///     front: DVec3::X,
    ///     thickness: 0.002,
    ///     wedge_angle: 0.5,
    ///     height: 0.1,
    ///     friction: 0.0,
    ///     sides: vec![(0, true), (1, false)],
    ///     toughness: 0.0,
    ///     uncut: Vec::new(),
    /// };
    /// solver.set_blades(vec![blade])?;
    /// solver.step(&Schedule::default(), &StepSettings { substeps: 30, ..StepSettings::new(0.016) })?;
    /// // `edge × front` is -z.
    /// assert!(solver.position(0).z <= -0.001 && solver.position(1).z >= 0.001);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn set_blades(&mut self, blades: Vec<SolidBlade>) -> Result<(), XpbdError> {
        for blade in &blades {
            blade.check()?;
            let sides = blade.sides.iter().map(|&(particle, _)| particle);
            let uncut = blade.uncut.iter().flat_map(|point| point.particles);
            for (constraint, particle) in sides.chain(uncut).enumerate() {
                let particles = self.particle_count();
                if particle as usize >= particles {
                    let source = GraphError::ParticleOutOfRange {
                        constraint,
                        particle,
                        particles,
                    };
                    return Err(XpbdError::Schedule {
                        what: "blade",
                        source,
                    });
                }
            }
        }
        self.constraints.blades.set(blades);
        Ok(())
    }

    /// Returns for each solid blade the work in J that its edge has done since the blades were set to pass through uncut
    /// tissue: force times way, of all its edge points. 0 without a toughness.
    #[must_use]
    pub fn blade_work(&self) -> &[f64] {
        self.constraints.blades.work()
    }
}
