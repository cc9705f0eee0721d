//! The constraints of a [`Solver`] besides its tets: attachments to handles, distances, volumes and contacts.

use incise_graph::{Coloring, Schedule};

use super::Solver;
use crate::constraints::{Distance, Distances, TetVolume, Volumes};
use crate::{
    AttachmentData, ContactLaw, ContactState, DistanceConstraint, DistanceData, FaceContact, Float,
    PairContact, Pose, VolumeConstraint, VolumeData, XpbdError,
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

    /// Puts a handle at a pose at once. Particles attached to it go there in the next substep.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation not of length 1.
    pub fn set_handle(&mut self, handle: u32, pose: Pose) {
        pose.check();
        self.constraints.attachments.set_handle(handle, pose);
    }

    /// The present pose of a handle.
    ///
    /// # Panics
    /// If the handle does not exist.
    #[must_use]
    pub fn handle(&self, handle: u32) -> Pose {
        self.constraints.attachments.pose(handle)
    }

    /// Attaches a particle, from where it is now, to a handle as that is now. A particle has one attachment: another
    /// one replaces the first.
    ///
    /// `compliance` is one over the stiffness in m/N, 0 is rigid; `damping` is a time in s, by which the motion
    /// relative to the handle is resisted times the stiffness (nothing with a compliance of 0). A fixed particle stays
    /// fixed. A cut attaches copies like their originals, and a particle between two others if both are attached to the
    /// same handle; with a compliance, each has a spring of its own.
    ///
    /// O(log n + attachments of higher particles).
    ///
    /// # Errors
    /// A negative or infinite compliance or damping.
    ///
    /// # Panics
    /// If the particle or the handle does not exist.
    ///
    /// # Example
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use incise_graph::{Coloring, Schedule};
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

    /// Sets the compliance of all particles on a handle in m/N, wherever they are now; 0 is rigid. O(attachments).
    ///
    /// # Errors
    /// A negative or infinite compliance.
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

    /// The handle that a particle is attached to.
    #[must_use]
    pub fn handle_of(&self, particle: usize) -> Option<u32> {
        self.constraints.attachments.get(particle).map(|a| a.handle)
    }

    /// All attachments, ascending by particle.
    pub fn attachments(&self) -> impl ExactSizeIterator<Item = AttachmentData> + '_ {
        self.constraints.attachments.list()
    }

    /// The poses of all handles at a fraction of the frame.
    pub fn handle_poses(&self, fraction: f64) -> impl ExactSizeIterator<Item = Pose> + '_ {
        self.constraints.attachments.poses(fraction)
    }

    /// Replaces all distance constraints; none at all takes neither memory nor time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`, which a coloring of any kind may have made.
    /// O(constraints).
    ///
    /// A cut leaves them on their particles: a copy of a particle has none of them.
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A kilogram on a spring of 10 N/m stretches it by `m g` times the compliance.
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
    ///     only_when_longer: false,
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

    /// Number of distance constraints.
    #[must_use]
    pub fn distance_count(&self) -> usize {
        self.constraints.distances.list.len()
    }

    /// A distance constraint as a kernel wants it.
    ///
    /// # Panics
    /// If the constraint does not exist.
    #[must_use]
    pub fn distance_data(&self, constraint: u32) -> DistanceData<R> {
        self.constraints.distances.list[constraint as usize].data()
    }

    /// The order in which distance constraints are solved, if there are any.
    #[must_use]
    pub fn distance_schedule(&self) -> Option<&Schedule> {
        self.constraints.distances.schedule()
    }

    /// Replaces all volume constraints; none at all takes neither memory nor time. They are solved after the tets of
    /// each iteration, in the order of their own `schedule`; where constraint `i` is that of tet `i`, the schedule of
    /// the tets fits. O(constraints).
    ///
    /// # Errors
    /// A value outside its range, a particle that does not exist, or a schedule that is not that of these constraints
    /// or lets two of them meet on a particle; nothing has changed then.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A flattened tet gets its volume back.
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

    /// Number of volume constraints.
    #[must_use]
    pub fn volume_count(&self) -> usize {
        self.constraints.volumes.list.len()
    }

    /// Replaces the volume constraint of an index, or appends one at the index after the last. The schedule has to be
    /// updated: see [`Solver::reschedule_volumes`].
    ///
    /// # Errors
    /// A value outside its range; nothing has changed then.
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

    /// Replaces the particles of a volume constraint by others that are copies of its own.
    ///
    /// # Panics
    /// If the constraint or a particle does not exist.
    pub fn relink_volume(&mut self, constraint: usize, particles: [u32; 4]) {
        self.check_particles(particles);
        self.constraints.volumes.list[constraint].particles = particles;
        self.note(|changes| changes.volumes = true);
    }

    /// Takes over the order of solving after edits; without volume constraints nothing happens. As with that of the
    /// tets, no two constraints of a color may share a particle ([`Schedule::check`]). O(constraints).
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

    /// A volume constraint as a kernel wants it.
    ///
    /// # Panics
    /// If the constraint does not exist.
    #[must_use]
    pub fn volume_data(&self, constraint: u32) -> VolumeData<R> {
        self.constraints.volumes.list[constraint as usize].data()
    }

    /// The order in which volume constraints are solved, if there are any.
    #[must_use]
    pub fn volume_schedule(&self) -> Option<&Schedule> {
        self.constraints.volumes.schedule()
    }

    /// Replaces all contacts: `pairs` of particles that were one before a cut, and vertices against triangles, `faces`.
    /// Each list comes with a color for each of its contacts; contacts of one color share no particle, except for colors
    /// from 16 on, which one thread solves together. They are solved after all other constraints but the colliders,
    /// pairs before faces; [`StepSettings::relaxation`](crate::StepSettings) does not scale them. Only
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
    /// let contact = FaceContact { particles: [0, 1, 2, 3], beyond: None, thickness: 0.0 };
    /// let law = ContactLaw { friction: 0.3, recovery_time: 0.02 };
    /// let (none, one) = (Coloring::new(vec![]), Coloring::new(vec![ColorId(0)]));
    /// let settings = StepSettings { substeps: 10, gravity: Some(DVec3::NEG_Z * 9.81), ..StepSettings::new(0.016) };
    /// for _ in 0..60 {
    ///     solver.set_contacts(&law, (&[], &none), (&[contact], &one))?;
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
        faces: (&[FaceContact], &Coloring),
    ) -> Result<(), XpbdError> {
        let count = self.particle_count();
        self.constraints.contacts.set(count, law, pairs, faces)
    }

    /// Removes all contacts and their memory; any method may step again.
    pub fn clear_contacts(&mut self) {
        self.constraints.contacts.clear();
    }

    /// Whether contacts were set, even if there are none at present.
    #[must_use]
    pub fn has_contacts(&self) -> bool {
        self.constraints.contacts.is_declared()
    }

    /// Number of pairs and number of faces.
    #[must_use]
    pub fn contact_counts(&self) -> [usize; 2] {
        self.constraints.contacts.counts()
    }

    /// Number of colors of pairs and of faces together.
    #[must_use]
    pub fn contact_color_count(&self) -> usize {
        self.constraints.contacts.color_count()
    }

    /// All contacts at the present positions with the forces of the last step since they were set, in solving order,
    /// pairs first. O(contacts).
    pub fn contacts(&self) -> impl Iterator<Item = ContactState> + '_ {
        self.constraints.contacts.states(&self.particles)
    }
}
