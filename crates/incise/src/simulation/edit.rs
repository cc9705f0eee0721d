//! Changes between frames: bodies, gravity, colliders, attachments, distances, impulses; and ray casts.
//!
//! Every island of bodies has a copy of the colliders in its settings, so a change goes to all of them. Cost: that of
//! the change; an impulse wakes the bodies and, on a device, reads the positions back.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use incise_xpbd::StepSettings;

use super::Simulation;
use super::builder::{Body, BodyHandle};
use super::state::{Removal, State};
use crate::attachment::{Attachment, AttachmentHandle};
use crate::backend::AnySolver;
use crate::collider::{self, ColliderHandle};
use crate::distance::DistanceHandle;
use crate::island::Island;
use crate::island_builder::IslandBuilder;
use crate::merged_mesh::MergedMesh;
use crate::method::settings;
use crate::ray::RayHit;
use crate::resolved_body::ResolvedBody;
use crate::scene::{AttachmentSpec, ColliderSpec, ContactPairs, ContactSpec, DistanceSpec};
use crate::validate::{LARGEST_COORDINATE, coordinates, value, within};
use crate::{Error, budget, contacts};

impl Simulation {
    /// Sets the acceleration of gravity in m/s² from the next frame on; `None` is no gravity. Wakes all bodies.
    ///
    /// # Errors
    /// If a component is not finite or beyond 1e9 m/s²; nothing has changed then.
    pub fn set_gravity(&mut self, gravity: Option<DVec3>) -> Result<(), Error> {
        if let Some(gravity) = gravity {
            coordinates("gravity", gravity.to_array())?;
        }
        self.state.gravity = gravity;
        for island in &mut self.state.islands {
            island.settings.gravity = gravity;
            island.wake();
        }
        Ok(())
    }

    /// Adds an obstacle from the next frame on. Bodies that overlap it are pushed out in the next substep.
    ///
    /// # Errors
    /// If a value lies outside its range; nothing has changed then.
    ///
    /// # Example
    /// A plate presses a soft ball and is removed.
    /// ```
    /// use incise::meshing::{Shape, generate};
    /// use incise::mesh::glam::DVec3;
    /// use incise::scene::ColliderSpec;
    /// use incise::{Body, Simulation};
    ///
    /// let mut builder = Simulation::builder();
    /// builder.ground(-0.5, 0.5);
    /// builder.add_body(Body::new(generate(Shape::Sphere, 300)?));
    /// let mut simulation = builder.build()?;
    /// let plate = simulation.add_collider(&ColliderSpec::plane([0.0, 0.0, 0.6], [0.0, 0.0, -1.0]))?;
    /// for frame in 1..=10 {
    ///     simulation.move_collider(plate, DVec3::Z * (0.6 - 0.03 * f64::from(frame)))?;
    ///     simulation.step()?;
    /// }
    /// let top = simulation.positions().iter().map(|x| x.z).fold(f64::MIN, f64::max);
    /// assert!(top < 0.301);
    /// simulation.remove_collider(plate)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add_collider(&mut self, collider: &ColliderSpec) -> Result<ColliderHandle, Error> {
        let added = collider::collider("collider", collider)?;
        let handle = self.state.colliders.add();
        for island in &mut self.state.islands {
            island.settings.colliders.push(added);
            island.wake();
        }
        Ok(handle)
    }

    /// Moves a collider in a straight line to a position during the next frame, where it stays. Of several calls before
    /// a frame the last one counts. Contacts use its velocity. The position is the point of a plane, the center of a
    /// sphere or a box, the middle of a capsule, in m.
    ///
    /// # Errors
    /// If the collider was removed, or a coordinate is not finite or beyond 1e9 m; nothing has changed then.
    pub fn move_collider(&mut self, handle: ColliderHandle, to: DVec3) -> Result<(), Error> {
        coordinates("collider.to", to.to_array())?;
        self.collider_index(handle)?;
        self.state.colliders.go_to(handle, to);
        Ok(())
    }

    /// Replaces shape, position, friction and velocity of a collider from the start of the next frame on.
    ///
    /// # Errors
    /// If the collider was removed, or a value lies outside its range; nothing has changed then.
    pub fn set_collider(
        &mut self,
        handle: ColliderHandle,
        collider: &ColliderSpec,
    ) -> Result<(), Error> {
        let index = self.collider_index(handle)?;
        let new = collider::collider("collider", collider)?;
        self.state.colliders.stay(handle);
        for island in &mut self.state.islands {
            island.settings.colliders[index] = new;
            island.wake();
        }
        Ok(())
    }

    /// Returns the position of a collider in m, as in [`Simulation::move_collider`].
    ///
    /// # Errors
    /// If the collider was removed.
    pub fn collider_position(&self, handle: ColliderHandle) -> Result<DVec3, Error> {
        let index = self.collider_index(handle)?;
        Ok(collider::position(
            &self.state.islands[0].settings.colliders[index].shape,
        ))
    }

    /// Removes a collider. Its handle becomes invalid.
    ///
    /// # Errors
    /// If it was removed before.
    pub fn remove_collider(&mut self, handle: ColliderHandle) -> Result<(), Error> {
        let index = self.collider_index(handle)?;
        self.state.colliders.remove(index);
        for island in &mut self.state.islands {
            island.settings.colliders.remove(index);
            if let Some(forces) = &mut island.forces
                && index < forces.colliders.len()
            {
                forces.colliders.remove(index);
            }
            island.wake();
        }
        Ok(())
    }

    pub(super) fn collider_index(&self, handle: ColliderHandle) -> Result<usize, Error> {
        let index = self.state.colliders.index(handle);
        index.ok_or_else(|| removed("collider", handle))
    }

    /// Changes friction, thickness, recovery time and self-contact of all contacts from the next frame on, and wakes
    /// sleeping bodies. O(bodies); the next frame searches for contacts.
    ///
    /// # Errors
    /// If a value lies outside its range, the scene was set up without contact or with other pairs of bodies, which are
    /// solved together for good; nothing has changed then.
    ///
    /// # Example
    /// ```
    /// use incise::scene::ContactSpec;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[contact]\n[[body]]\nshape = { kind = \"box\", tets = 200 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// simulation.set_contact(&ContactSpec::default().with(|contact| contact.friction = 0.0))?;
    /// simulation.step()?;
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn set_contact(&mut self, contact: &ContactSpec) -> Result<(), Error> {
        contacts::check(contact)?;
        let pairs = self
            .state
            .scene
            .contact
            .as_ref()
            .map(|before| &before.pairs);
        if pairs != Some(&contact.pairs) {
            let range = "the pairs that the simulation was set up with";
            return Err(value(
                "contact.pairs",
                format!("{:?}", contact.pairs),
                range,
            ));
        }
        for island in &mut self.state.islands {
            if let Some(contacts) = &mut island.constraints.contacts {
                contacts.set(contact)?;
            }
            island.wake();
        }
        let mut scene = (*self.state.scene).clone();
        scene.contact = Some(contact.clone());
        self.state.scene = Arc::new(scene);
        Ok(())
    }

    /// Attaches part of a body from the next frame on: the particles that lie at rest in the regions of the attachment.
    /// They stay in place until the attachment moves, by its path in the frames that it states, or by
    /// [`Simulation::move_attachment`]. O(particles of the body); with a compliance of 0 the next step rebuilds the
    /// layout of all tets. On a device the positions are read back.
    ///
    /// # Errors
    /// If the body does not exist, a value lies outside its range, another attachment or a grab holds one of the particles,
    /// or the device is lost; nothing has changed then.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::{DQuat, DVec3};
    /// use incise::scene::{AttachmentSpec, Region};
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"beam\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let end = Region::half_space([0.45, 0.0, 0.0], [1.0, 0.0, 0.0]);
    /// let attachment = simulation.add_attachment(&AttachmentSpec::new(0, vec![end]))?;
    /// for frame in 1..=10 {
    ///     let offset = DVec3::Z * 0.01 * f64::from(frame);
    ///     simulation.move_attachment(attachment, offset, DQuat::IDENTITY)?;
    ///     simulation.step()?;
    /// }
    /// let mesh = simulation.mesh().positions.iter();
    /// let lifted = mesh.zip(simulation.positions()).filter(|(rest, _)| rest.x >= 0.45);
    /// assert!(lifted.clone().count() > 3);
    /// assert!(lifted.clone().all(|(rest, x)| (x.z - rest.z - 0.1).abs() < 1e-6));
    /// simulation.remove_attachment(attachment)?;
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn add_attachment(&mut self, spec: &AttachmentSpec) -> Result<AttachmentHandle, Error> {
        let island = self.island_of("attachment.body", spec.body)?;
        self.read_back()?;
        let name = AttachmentHandle(self.state.next.attachment);
        let frame = self.state.clock.next_frame;
        self.state.islands[island].add_attachment(name, spec, frame)?;
        self.state.next.attachment += 1;
        Ok(name)
    }

    /// Moves an attachment during the next frame. The target pose is that of its particles when they were attached,
    /// rotated by `rotation` about their center and then displaced by `offset` in m. From then on its path has no
    /// effect, and it stays there until the next call. Moves of more than a tet or half a turn in a frame may invert
    /// tets for a while.
    ///
    /// # Errors
    /// If the attachment was removed, the offset is not finite or beyond 1e9 m, or the rotation is not of length 1; nothing
    /// has changed then.
    pub fn move_attachment(
        &mut self,
        handle: AttachmentHandle,
        offset: DVec3,
        rotation: DQuat,
    ) -> Result<(), Error> {
        coordinates("attachment.offset", offset.to_array())?;
        if !(rotation.is_finite() && (rotation.length() - 1.0).abs() < 1e-6) {
            return Err(value("attachment.rotation", rotation, "of length 1"));
        }
        self.attachment(handle)?.1.move_to(offset, rotation);
        Ok(())
    }

    /// Sets the compliance of an attachment for each of its particles, in m/N; 0 is rigid. The particles stay where
    /// they are at that moment. O(attached particles).
    ///
    /// # Errors
    /// If the attachment was removed, the compliance is not between 0 and 1e9, or the device is lost; nothing has changed
    /// then.
    pub fn set_attachment_compliance(
        &mut self,
        handle: AttachmentHandle,
        compliance: f64,
    ) -> Result<(), Error> {
        self.read_back()?;
        let (solver, attachment) = self.attachment(handle)?;
        attachment.set_compliance(solver, compliance)
    }

    /// Removes an attachment and releases its particles, including those that cuts have added. Its handle becomes
    /// invalid.
    ///
    /// # Errors
    /// If it was removed before, or the device is lost; nothing has changed then.
    pub fn remove_attachment(&mut self, handle: AttachmentHandle) -> Result<(), Error> {
        self.read_back()?;
        for island in &mut self.state.islands {
            if island.remove_attachment(handle)? {
                return Ok(());
            }
        }
        Err(removed("attachment", handle))
    }

    fn attachment(
        &mut self,
        handle: AttachmentHandle,
    ) -> Result<(&mut AnySolver, &mut Attachment), Error> {
        for island in &mut self.state.islands {
            let mut all = island.constraints.attachments.iter_mut();
            if let Some(attachment) = all.find(|attachment| attachment.name == handle) {
                return Ok((&mut island.solver, attachment));
            }
        }
        Err(removed("attachment", handle))
    }

    /// Adds a distance constraint (a suture, a rod or a spring) between two particles from the next frame on. On a device
    /// the positions are read back.
    ///
    /// Bodies that have separate solvers get a common one, with the most substeps that one of them needs, and stay
    /// together when the distance is removed. Numbers of particles, tets and pieces, handles, motion and cuts are kept.
    /// Measured forces and residuals begin again with the next frame. O(particles of the bodies + distances); where
    /// solvers are joined O(tets of both), with new clusters, colors and buffers on a device.
    ///
    /// # Errors
    /// If a body does not exist, a value lies outside its range, both ends are on one particle, a stroke is moving through
    /// bodies that have separate solvers, or the device is lost; nothing has changed then.
    ///
    /// # Example
    /// Two bodies fly apart until a suture holds them together.
    /// ```
    /// use incise::scene::{DistanceSpec, EndSpec};
    /// use incise::{Scene, Simulation};
    ///
    /// let body = |x: f64| format!("[[body]]\nshape = {{ kind = \"box\", tets = 200 }}\nposition = [{x}, 0.0, 0.0]\n");
    /// let scene = format!("[world]\ngravity = [0.0, 0.0, 0.0]\n{}{}", body(-1.0), body(1.0));
    /// let mut simulation = Simulation::new(&Scene::from_toml(&scene)?)?;
    /// simulation.set_velocities(|x| x.signum())?;
    /// simulation.step()?;
    /// let ends = [EndSpec::new(0, [-0.5, 0.0, 0.0]), EndSpec::new(1, [0.5, 0.0, 0.0])];
    /// let mut thread = DistanceSpec::new(ends[0], ends[1]);
    /// thread.length = Some(1.2);
    /// thread.tension_only = true;
    /// simulation.add_distance(&thread)?;
    /// for _ in 0..60 {
    ///     simulation.step()?;
    /// }
    /// let gap = |s: &Simulation| {
    ///     let half = s.positions().len() / 2;
    ///     let right = s.positions()[..half].iter().map(|x| x.x).fold(f64::MIN, f64::max);
    ///     let left = s.positions()[half..].iter().map(|x| x.x).fold(f64::MAX, f64::min);
    ///     left - right
    /// };
    /// assert!(gap(&simulation) < 1.3);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn add_distance(&mut self, spec: &DistanceSpec) -> Result<DistanceHandle, Error> {
        let from = self.island_of("distance.from.body", spec.from.body)?;
        let to = self.island_of("distance.to.body", spec.to.body)?;
        self.read_back()?;
        let name = DistanceHandle(self.state.next.distance);
        let add = |island: &mut Island| {
            let constraint = island.distance(spec)?;
            island.constraints.distances.add(name, constraint);
            island.update_distances()
        };
        if from == to {
            add(&mut self.state.islands[from])?;
        } else {
            let (into, other) = (from.min(to), from.max(to));
            let state = &self.state;
            let make = || state.joined(into, &state.islands[other]);
            let mut joined = match &self.pool {
                Some(pool) => pool.install(make),
                None => make(),
            }?;
            add(&mut joined)?;
            self.state.put_joined(into, other, joined);
            self.state.next.distance += 1;
            self.fit_budget()?;
            return Ok(name);
        }
        self.state.next.distance += 1;
        Ok(name)
    }

    /// Sets rest length in m and compliance in m/N of a distance constraint, for example to tighten a suture.
    /// O(distances of its bodies).
    ///
    /// # Errors
    /// If it was removed, a value lies outside its range, or the device is lost; nothing has changed then.
    pub fn set_distance(
        &mut self,
        handle: DistanceHandle,
        length: f64,
        compliance: f64,
    ) -> Result<(), Error> {
        let length = within("distance.length", length, 0.0, 2.0 * LARGEST_COORDINATE)?;
        let compliance = within("distance.compliance", compliance, 0.0, 1e9)?;
        self.read_back()?;
        for island in &mut self.state.islands {
            if let Some(constraint) = island.constraints.distances.get_mut(handle) {
                (constraint.length, constraint.compliance) = (length, compliance);
                return island.update_distances();
            }
        }
        Err(removed("distance", handle))
    }

    /// Removes a distance constraint. Its handle becomes invalid. O(distances of its bodies).
    ///
    /// # Errors
    /// If it was removed before, or the device is lost; nothing has changed then.
    pub fn remove_distance(&mut self, handle: DistanceHandle) -> Result<(), Error> {
        self.read_back()?;
        for island in &mut self.state.islands {
            if island.constraints.distances.remove(handle) {
                return island.update_distances();
            }
        }
        Err(removed("distance", handle))
    }

    /// Adds a body at rest from the next frame on. Its particles and tets get the next numbers. It has its own solver with
    /// the present settings; where contact is declared for all pairs of bodies it joins the others and touches them.
    /// O(tets) of the body; of all bodies if there was one or it joins them.
    ///
    /// Renderers must rebuild their skin from [`Simulation::boundary`]. On a device the positions are read back.
    ///
    /// # Errors
    /// If a value lies outside its range, the mesh is broken, the device is lost, or a stroke is moving through the
    /// bodies that it joins; nothing has changed then.
    ///
    /// # Example
    /// ```
    /// use incise::meshing::{Shape, generate};
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Body, Simulation};
    ///
    /// let mut builder = Simulation::builder();
    /// builder.gravity(DVec3::NEG_Z * 9.81).ground(0.0, 0.5);
    /// builder.add_body(Body::new(generate(Shape::Box, 300)?).position(DVec3::Z));
    /// let mut simulation = builder.build()?;
    /// simulation.step()?;
    /// let ball = Body::new(generate(Shape::Sphere, 300)?).position(DVec3::new(3.0, 0.0, 1.0));
    /// let ball = simulation.add_body(ball)?;
    /// assert_eq!(simulation.step()?.pieces, 2);
    /// simulation.remove_body(ball)?;
    /// assert_eq!(simulation.step()?.pieces, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add_body(&mut self, body: Body) -> Result<BodyHandle, Error> {
        self.read_back()?;
        let state = &self.state;
        let number = state.scene.body.len();
        let contact = state.scene.contact.as_ref();
        let touches = contact.is_some_and(|contact| contact.pairs == ContactPairs::All);
        if touches {
            state.timeline.check_join()?;
        }
        let field = format!("body[{number}]");
        let made = ResolvedBody::new(&field, &body.spec, Some(&body.mesh), state.solver.substeps)?;
        let joined = IslandBuilder::of_one(number, made)?;
        let mut scene = (*state.scene).clone();
        scene.body.push(body.spec);
        let present = state.present(scene.clone());
        let settings = StepSettings {
            gravity: state.gravity,
            colliders: state.islands[0].settings.colliders.clone(),
            ..settings(&present)?
        };
        let make = || {
            let device = &state.compute_device;
            let island = Island::new(&present, device, state.precision, settings, joined)?;
            // Where all bodies touch, the others are one island.
            let first = touches.then(|| &state.islands[0]);
            let whole = first.map(|first| first.joined_with(&island, &present, device));
            Ok::<_, Error>((island, whole.transpose()?))
        };
        let (island, whole) = match &self.pool {
            Some(pool) => pool.install(make),
            None => make(),
        }?;

        let state = &mut self.state;
        let islands = &mut state.islands;
        let merged = &mut state.dependents.merged;
        merged
            .get_or_insert_with(|| MergedMesh::of_one(&islands[0]))
            .add_island(&island);
        state.dependents.pieces.add_island(&island);
        islands.push(island);
        state.scene = Arc::new(scene);
        state.residuals_kept = false;
        if let Some(whole) = whole {
            let added = state.islands.len() - 1;
            state.put_joined(0, added, whole);
        }
        let state = &self.state;
        if !state.dependents.on_cut.is_empty() {
            let particles = self.mesh().positions.len();
            self.state.dependents.on_cut.resize(particles, false);
        }
        self.fit_budget()?;
        Ok(BodyHandle(number))
    }

    /// Removes a body with all its pieces at the start of the next frame. One of the [`Simulation::deltas`] then lists
    /// its tets. Its particles stay in [`Simulation::mesh`] without tets, and attachments and distances on them have no
    /// effect. The numbers of other bodies do not change. O(tets) of the bodies that are solved with it.
    ///
    /// # Errors
    /// If it was removed before.
    pub fn remove_body(&mut self, body: BodyHandle) -> Result<(), Error> {
        self.island_of("body", body.index())?;
        self.state.removed.push(Removal {
            body: body.index(),
            is_done: false,
        });
        Ok(())
    }

    /// The number of the island of a body.
    fn island_of(&self, field: &str, body: usize) -> Result<usize, Error> {
        if self
            .state
            .removed
            .iter()
            .any(|removal| removal.body == body)
        {
            return Err(removed(field, body));
        }
        let mut islands = self.state.islands.iter();
        let island = islands.position(|island| island.bodies.contains(&body));
        island.ok_or_else(|| value(field, body, "the number of a body, counted from 0"))
    }

    /// Adapts substeps to the time budget, if there is one.
    fn fit_budget(&mut self) -> Result<(), Error> {
        let State {
            islands, solver, ..
        } = &mut self.state;
        let Some(budget) = solver.budget_ms else {
            return Ok(());
        };
        let mut fit = || budget::fit(islands, solver, budget);
        match &self.pool {
            Some(pool) => pool.install(fit),
            None => fit(),
        }
    }

    /// Applies an impulse in N·s to the particles within a radius in m of a point: all of them change their velocity by
    /// the impulse over their total mass. Fixed and rigidly attached particles are left out. Wakes the bodies. Returns
    /// whether there were such particles. O(particles); on a device the positions are read back.
    ///
    /// # Errors
    /// If a component is not finite or beyond 1e9, the radius is not between 0 and 1e9 m, or the device is lost; nothing has changed then.
    pub fn apply_impulse(
        &mut self,
        point: DVec3,
        radius: f64,
        impulse: DVec3,
    ) -> Result<bool, Error> {
        coordinates("impulse.point", point.to_array())?;
        coordinates("impulse", impulse.to_array())?;
        within("impulse.radius", radius, 0.0, 1e9)?;
        self.read_back()?;
        let mut hit = Vec::new();
        let mut mass = 0.0;
        for (g, island) in self.state.islands.iter().enumerate() {
            let solver = island.solver.host();
            for p in 0..solver.particle_count() {
                let is_near = solver.position(p).distance(point) <= radius;
                if is_near && solver.is_free(p) {
                    mass += solver.mass(p);
                    hit.push((g, p));
                }
            }
        }
        if hit.is_empty() {
            return Ok(false);
        }
        let change = impulse / mass;
        coordinates("impulse over the mass it meets", change.to_array())?;
        for (g, p) in hit {
            let island = &mut self.state.islands[g];
            island.wake();
            let solver = island.solver.edit()?;
            solver.set_velocity(p, solver.velocity(p) + change);
        }
        Ok(true)
    }

    /// Returns the first intersection of a ray with the bodies, from either side of a boundary triangle, in the numbers
    /// of [`Simulation::mesh`]. The direction may have any length but 0. Uses [`Simulation::positions`]: on a device
    /// call [`Simulation::read_back`] first. O(boundary triangles).
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"box\", tets = 200 }")?;
    /// let simulation = Simulation::new(&scene)?;
    /// let hit = simulation.ray_cast(DVec3::new(0.1, 0.05, 5.0), DVec3::NEG_Z).expect("the box");
    /// assert!(hit.normal.distance(DVec3::Z) < 1e-9);
    /// assert!(simulation.ray_cast(DVec3::splat(5.0), DVec3::X).is_none());
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn ray_cast(&self, origin: DVec3, direction: DVec3) -> Option<RayHit> {
        RayHit::first(self.boundary(), self.positions(), origin, direction)
    }
}

/// Error for the handle of a removed item.
fn removed(field: &str, handle: impl std::fmt::Debug) -> Error {
    value(field, format!("{handle:?}"), "one that was not removed")
}
