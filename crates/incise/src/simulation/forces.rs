//! Forces of the last frame: on attachments, colliders, grabs and fixed parts, and between bodies.
//!
//! Cost: nothing unless frames report [`Quantity::Force`](crate::scene::Quantity); then that of `incise_xpbd::Solver::measure_forces`, and a
//! look-up for a force that is read.

use super::Simulation;
use super::builder::BodyHandle;
use crate::attachment::AttachmentHandle;
use crate::collider::{self, ColliderHandle};
use crate::report::{CutWork, Force, ForceKind, ForceReport};
use crate::validate::value;
use crate::{Error, Grab};

impl Simulation {
    /// Returns the handles of all attachments: those of the scene in its order, then those that were added.
    #[must_use]
    pub fn attachments(&self) -> Vec<AttachmentHandle> {
        let islands = self.state.islands.iter();
        let names =
            islands.flat_map(|island| island.constraints.attachments.iter().map(|a| a.name));
        let mut names: Vec<_> = names.collect();
        names.sort_unstable();
        names
    }

    /// Returns the handles of all colliders: those of the scene in its order, then those that were added. The ground has
    /// none.
    #[must_use]
    pub fn colliders(&self) -> Vec<ColliderHandle> {
        self.state.colliders.all().collect()
    }

    /// Returns the handles of all bodies that were not removed: those of the scene in its order, then those that were
    /// added.
    #[must_use]
    pub fn bodies(&self) -> Vec<BodyHandle> {
        let removed = |body: &usize| self.state.removed.iter().any(|r| r.body == *body);
        let all = 0..self.state.scene.body.len();
        all.filter(|body| !removed(body)).map(BodyHandle).collect()
    }

    /// Returns the mean force of the last frame from the bodies on an attachment, with the torque about the center of its
    /// particles when they were attached, carried along by the attachment.
    ///
    /// The force is what a robot that holds the attachment has to bear: the weight of what hangs from it points down.
    /// It includes weight and inertia of the particles that are held. The opposite force acts on the body. O(attachments
    /// of the body).
    ///
    /// # Errors
    /// If the attachment was removed, or the last frame has not reported [`Quantity::Force`](crate::scene::Quantity) or was before the attachment.
    ///
    /// # Example
    /// A beam hangs from one end.
    /// ```
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     r#"
    ///     [report]
    ///     quantities = ["force"]
    ///     [world]
    ///     gravity = [0.0, 0.0, -9.81]
    ///     [[body]]
    ///     shape = { kind = "beam", tets = 300 }
    ///     [[attachment]]
    ///     regions = [{ half_space = { point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
    ///     frames = [0, 1]
    ///     path = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    ///     "#,
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.step()?;
    /// let attachment = simulation.attachments()[0];
    /// assert!(simulation.attachment_force(attachment)?.force.z < 0.0);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn attachment_force(&self, handle: AttachmentHandle) -> Result<Force, Error> {
        self.check_measured()?;
        for island in &self.state.islands {
            let mut all = island.constraints.attachments.iter();
            if let Some(attachment) = all.find(|attachment| attachment.name == handle) {
                let measured = island.forces.as_ref();
                let force = measured.and_then(|measured| measured.handle(attachment.number));
                let point = attachment.center(&island.solver);
                return force
                    .map(|force| Force::new(force, point))
                    .ok_or_else(|| too_new("attachment", handle));
            }
        }
        let range = "one that was not removed";
        Err(value("attachment", format!("{handle:?}"), range))
    }

    /// Returns the mean force of the last frame from all bodies on a collider, with the torque about its position: the
    /// point of a plane, the center of a sphere or a box, the middle of a capsule. O(bodies).
    ///
    /// # Errors
    /// If the collider was removed, or the last frame has not reported [`Quantity::Force`](crate::scene::Quantity) or was before the collider.
    pub fn collider_force(&self, handle: ColliderHandle) -> Result<Force, Error> {
        let index = self.collider_index(handle)?;
        self.force_on_collider(index)?
            .ok_or_else(|| too_new("collider", handle))
    }

    /// Returns the mean force of the last frame from all bodies on the ground of the scene, with the torque about the
    /// point of the ground below the origin of the world. O(bodies).
    ///
    /// # Errors
    /// If the scene has no ground, or the last frame has not reported [`Quantity::Force`](crate::scene::Quantity).
    pub fn ground_force(&self) -> Result<Force, Error> {
        let Some(index) = self.state.colliders.ground() else {
            return Err(value("world.ground", "absent", "there to bear a force"));
        };
        self.force_on_collider(index)?
            .ok_or_else(|| value("world.ground", "new", "there in the last frame"))
    }

    /// Returns the mean force of the last frame from the body on a grab, with the torque about the target of the grabbed
    /// point: what a hand or a haptic device feels. O(1).
    ///
    /// # Errors
    /// If the grab was released, or the last frame has not reported [`Quantity::Force`](crate::scene::Quantity) or was before the grab.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     "[report]\nquantities = [\"force\"]\n[[body]]\nshape = { kind = \"sphere\", tets = 300 }",
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let top = simulation.positions().iter().copied().fold(DVec3::ZERO, |a, b| if b.z > a.z { b } else { a });
    /// let grab = simulation.grab(top, 0.1, 1e-3)?.expect("a particle is there");
    /// simulation.move_grab(grab, top + DVec3::Z * 0.02)?;
    /// simulation.step()?;
    /// // The body pulls the hand back.
    /// assert!(simulation.grab_force(grab)?.force.z < 0.0);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn grab_force(&self, grab: Grab) -> Result<Force, Error> {
        self.check_measured()?;
        let mut islands = self.state.islands.iter();
        let held = islands.find_map(|island| Some((island, island.constraints.grabs.held(grab)?)));
        let Some((island, (number, point))) = held else {
            let range = "one that was not released";
            return Err(value("grab", format!("{grab:?}"), range));
        };
        let measured = island.forces.as_ref();
        let force = measured.and_then(|measured| measured.handle(number));
        force
            .map(|force| Force::new(force, point))
            .ok_or_else(|| too_new("grab", grab))
    }

    /// Returns the mean force of the last frame from all bodies on the solid blade of a stroke, with the torque about the
    /// middle of its edge: what presses it from both sides, and friction. O(bodies).
    ///
    /// # Errors
    /// If the stroke has no solid blade or had none in the last frame, or that frame has not reported
    /// [`Quantity::Force`](crate::scene::Quantity).
    pub fn blade_force(&self, stroke: u32) -> Result<Force, Error> {
        self.check_measured()?;
        let mut solids = self.state.timeline.solids().iter();
        let Some(blade) = solids.find(|blade| blade.stroke == stroke) else {
            let range = "the number of a stroke whose blade was solid in the last frame";
            return Err(value("stroke", stroke, range));
        };
        let mut islands = self.state.islands.iter();
        if islands.any(|island| island.forces.is_none() && !island.cuttable.mesh().tets.is_empty())
        {
            return Err(too_new("stroke", stroke));
        }
        let mut sum = incise_xpbd::Force::default();
        let measured = self.state.islands.iter().filter_map(|i| i.forces.as_ref());
        for force in measured.filter_map(|measured| measured.blades.get(&stroke)) {
            sum.force += force.force;
            sum.torque += force.torque;
        }
        Ok(Force::new(sum, blade.point))
    }

    /// Returns what the blade of a stroke has parted so far against its toughness, also after the stroke has ended. O(log
    /// strokes).
    ///
    /// # Errors
    /// If there is no such stroke, or its blade has no toughness.
    ///
    /// # Example
    /// ```
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     r#"
    ///     [[body]]
    ///     shape = { kind = "box", tets = 500 }
    ///     fixed = [{ half_space = { point = [0.4, 0.0, 0.0], normal = [1.0, 0.0, 0.0] } }]
    ///     [[stroke]]
    ///     kind = "sweep"
    ///     frames = [0, 60]
    ///     blade = [[-0.7, -1.0, 0.03], [-0.7, 1.0, 0.03]]
    ///     path = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    ///     solid = { thickness = 0.001, wedge_angle_degrees = 15.0, height = 0.1, toughness = 200.0 }
    ///     "#,
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// for _ in 0..62 {
    ///     simulation.step()?;
    /// }
    /// let parted = simulation.cut_work(0)?;
    /// assert!(parted.area > 0.2 && parted.work > 0.9 * 200.0 * parted.area);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn cut_work(&self, stroke: u32) -> Result<CutWork, Error> {
        let range = "the number of a stroke whose blade has a toughness";
        let work = self.state.timeline.work(stroke);
        work.ok_or_else(|| value("stroke", stroke, range))
    }

    /// Returns the mean force of the last frame from a body on what its fixed particles are fixed to, with the torque
    /// about the center of these particles. It includes their weight. Zero for a body without fixed particles. O(log
    /// bodies).
    ///
    /// # Errors
    /// If there is no such body, or the last frame has not reported [`Quantity::Force`](crate::scene::Quantity) or was before the body.
    pub fn fixed_force(&self, body: BodyHandle) -> Result<Force, Error> {
        self.check_measured()?;
        let body = body.index();
        let mut islands = self.state.islands.iter();
        let Some(island) = islands.find(|island| island.bodies.contains(&body)) else {
            return Err(value("body", body, "the number of a body, counted from 0"));
        };
        let Some(measured) = &island.forces else {
            return Err(too_new("body", body));
        };
        let force = measured.fixed.get(&body);
        Ok(force.map_or(Force::default(), |&(force, point)| Force::new(force, point)))
    }

    /// Returns the mean force of the last frame on body `a` from body `b` with friction, with the torque about the origin
    /// of the world. The force on `b` is the opposite. Contact measures forces in every frame, so reports need not ask
    /// for it. O(pieces that touch).
    ///
    /// # Errors
    /// If the scene has no contact, or the bodies are one.
    pub fn contact_force(&self, a: BodyHandle, b: BodyHandle) -> Result<Force, Error> {
        if self.state.scene.contact.is_none() {
            return Err(value("contact", "absent", "declared where bodies touch"));
        }
        if a == b {
            let range = "another body: the forces of a body on itself add up to nothing";
            return Err(value("body", b.index(), range));
        }
        let mut sum = Force::default();
        for contact in self.contacts() {
            // It acts on the second.
            let sign = if contact.bodies == [b.index(), a.index()] {
                1.0
            } else if contact.bodies == [a.index(), b.index()] {
                -1.0
            } else {
                continue;
            };
            sum.force += contact.force * sign;
            sum.torque += contact.torque * sign;
        }
        Ok(sum)
    }

    fn check_measured(&self) -> Result<(), Error> {
        if self.state.forces_measured {
            return Ok(());
        }
        let range = "with `force` in the last frame, to read forces after it";
        Err(value("report.quantities", "without `force`", range))
    }

    /// The sum over all islands for the collider of an index; `None` if a frame has not measured it.
    fn force_on_collider(&self, index: usize) -> Result<Option<Force>, Error> {
        self.check_measured()?;
        let settings = &self.state.islands[0].settings;
        let point = collider::position(&settings.colliders[index].shape);
        let mut sum = incise_xpbd::Force::default();
        for island in &self.state.islands {
            // Nothing is left that could touch.
            if island.cuttable.mesh().tets.is_empty() {
                continue;
            }
            let measured = island.forces.as_ref();
            let Some(force) = measured.and_then(|measured| measured.colliders.get(index)) else {
                return Ok(None);
            };
            sum.force += force.force;
            sum.torque += force.torque;
        }
        Ok(Some(Force::new(sum, point)))
    }

    /// All forces of the frame, as reports have them.
    pub(super) fn forces(&self) -> Vec<ForceReport> {
        let mut all = Vec::new();
        let mut add = |kind, index, other, force: Result<Force, Error>| {
            // What has not been in a frame has no force.
            all.extend(force.ok().map(|force| ForceReport {
                kind,
                index,
                other,
                force,
            }));
        };
        let islands = &self.state.islands;
        for name in self.attachments() {
            let force = self.attachment_force(name);
            add(ForceKind::Attachment, name.0 as usize, None, force);
        }
        if self.state.colliders.ground().is_some() {
            add(ForceKind::Ground, 0, None, self.ground_force());
        }
        for handle in self.colliders() {
            let force = self.collider_force(handle);
            add(ForceKind::Collider, handle.number(), None, force);
        }
        let grabs = islands
            .iter()
            .flat_map(|island| island.constraints.grabs.all_held());
        for (index, grab) in grabs.enumerate() {
            add(ForceKind::Grab, index, None, self.grab_force(grab));
        }
        for blade in self.state.timeline.solids() {
            let force = self.blade_force(blade.stroke);
            add(ForceKind::Blade, blade.stroke as usize, None, force);
        }
        let fixed = islands.iter().filter_map(|island| island.forces.as_ref());
        let mut fixed: Vec<_> = fixed.flat_map(|measured| measured.fixed.keys()).collect();
        fixed.sort_unstable();
        for &body in fixed {
            let force = self.fixed_force(BodyHandle(body));
            add(ForceKind::Fixed, body, None, force);
        }
        let mut touching: Vec<_> = self.contacts().iter().map(|c| c.bodies).collect();
        touching
            .iter_mut()
            .for_each(|bodies| bodies.sort_unstable());
        touching.sort_unstable();
        touching.dedup();
        for [a, b] in touching.into_iter().filter(|[a, b]| a != b) {
            let force = self.contact_force(BodyHandle(a), BodyHandle(b));
            add(ForceKind::Contact, a, Some(b), force);
        }
        all
    }
}

/// Error for what came after the last frame that measured forces.
fn too_new(field: &str, handle: impl std::fmt::Debug) -> Error {
    let range = "in a frame that reports `force` before its force is read";
    value(field, format!("{handle:?}"), range)
}
