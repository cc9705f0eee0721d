//! What a program changes between frames: gravity, colliders, impulses; and what it asks, by rays.
//!
//! Every group of bodies has the colliders of the world among its settings, so a change goes to all of them. Cost: that of
//! the change; an impulse wakes what sleeps and, on a device, fetches the positions.

use glam::DVec3;

use super::Simulation;
use crate::Error;
use crate::backend::{each, each_mut};
use crate::collider::{self, ColliderHandle};
use crate::limits::{coordinates, value, within};
use crate::ray::{RayHit, first_hit};
use crate::scene::ColliderSpec;

impl Simulation {
    /// Sets the acceleration of gravity in m/s² from the next frame on; `None` is weightlessness. Wakes what sleeps.
    ///
    /// # Errors
    /// If a component is not finite or beyond 1e9 m/s²; nothing has changed then.
    pub fn set_gravity(&mut self, gravity: Option<DVec3>) -> Result<(), Error> {
        if let Some(gravity) = gravity {
            coordinates("gravity", gravity.to_array())?;
        }
        self.gravity = gravity;
        for group in &mut self.groups {
            group.settings.gravity = gravity;
            group.wake();
        }
        Ok(())
    }

    /// Adds an obstacle from the next frame on. Bodies may be in its way: they are pushed out in the next substep.
    ///
    /// # Errors
    /// If a value lies outside its range; nothing has changed then.
    ///
    /// # Example
    /// A plate comes down on a ball of jelly and is taken away again.
    /// ```
    /// use incise::mesh::generate::{Shape, generate};
    /// use incise::mesh::glam::DVec3;
    /// use incise::scene::ColliderSpec;
    /// use incise::{Body, Simulation};
    ///
    /// let mut builder = Simulation::builder();
    /// builder.ground(-0.5, 0.5);
    /// builder.add_body(Body::new(generate(Shape::Sphere, 300)?));
    /// let mut simulation = builder.build()?;
    /// let plate = simulation.add_collider(&ColliderSpec::Plane {
    ///     point: [0.0, 0.0, 0.6],
    ///     normal: [0.0, 0.0, -1.0],
    ///     friction: 0.2,
    ///     velocity: [0.0; 3],
    /// })?;
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
        let handle = self.colliders.add();
        for group in &mut self.groups {
            group.settings.colliders.push(added);
            group.wake();
        }
        Ok(handle)
    }

    /// Has a collider go to a place in a straight line during the next frame and stay there; of several calls before a
    /// frame the last one holds. Bodies that it touches feel its velocity. The place is that of the point of a plane,
    /// the center of a sphere or a box, the middle of a capsule, in m.
    ///
    /// # Errors
    /// If the collider was removed, or a coordinate is not finite or beyond 1e9 m; nothing has changed then.
    pub fn move_collider(&mut self, handle: ColliderHandle, to: DVec3) -> Result<(), Error> {
        coordinates("collider.to", to.to_array())?;
        self.collider_place(handle)?;
        self.colliders.go_to(handle, to);
        Ok(())
    }

    /// Makes a collider another one: shape, place, friction and velocity, from the start of the next frame on.
    ///
    /// # Errors
    /// If the collider was removed, or a value lies outside its range; nothing has changed then.
    pub fn set_collider(
        &mut self,
        handle: ColliderHandle,
        collider: &ColliderSpec,
    ) -> Result<(), Error> {
        let place = self.collider_place(handle)?;
        let new = collider::collider("collider", collider)?;
        self.colliders.stay(handle);
        for group in &mut self.groups {
            group.settings.colliders[place] = new;
            group.wake();
        }
        Ok(())
    }

    /// Where a collider is, in the sense of [`Simulation::move_collider`].
    ///
    /// # Errors
    /// If the collider was removed.
    pub fn collider_position(&self, handle: ColliderHandle) -> Result<DVec3, Error> {
        let place = self.collider_place(handle)?;
        Ok(collider::position(
            &self.groups[0].settings.colliders[place].shape,
        ))
    }

    /// Takes a collider away. Its handle is void from then on.
    ///
    /// # Errors
    /// If it was removed before.
    pub fn remove_collider(&mut self, handle: ColliderHandle) -> Result<(), Error> {
        let place = self.collider_place(handle)?;
        self.colliders.remove(place);
        for group in &mut self.groups {
            group.settings.colliders.remove(place);
            group.wake();
        }
        Ok(())
    }

    fn collider_place(&self, handle: ColliderHandle) -> Result<usize, Error> {
        let unknown = || {
            value(
                "collider",
                format!("{handle:?}"),
                "one that was not removed",
            )
        };
        self.colliders.place(handle).ok_or_else(unknown)
    }

    /// Gives what lies within a radius in m of a point an impulse in N·s, and wakes what sleeps: all particles there change
    /// their velocity by the same amount, the impulse over their mass. What is fixed or rigidly attached takes no part. Returns whether
    /// something was there. O(particles); on a device the positions are fetched.
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
        for (g, group) in self.groups.iter().enumerate() {
            each!(&group.solver, solver => {
                for p in 0..solver.particle_count() {
                    let is_near = solver.position(p).distance(point) <= radius;
                    if is_near && solver.is_free(p) {
                        mass += solver.mass(p);
                        hit.push((g, p));
                    }
                }
            });
        }
        if hit.is_empty() {
            return Ok(false);
        }
        let change = impulse / mass;
        coordinates("impulse over the mass it meets", change.to_array())?;
        for (g, p) in hit {
            let group = &mut self.groups[g];
            group.wake();
            each_mut!(&mut group.solver, solver => {
                solver.set_velocity(p, solver.velocity(p) + change);
            });
        }
        Ok(true)
    }

    /// Where a ray meets the bodies first, on whichever side of a boundary triangle, in the numbers of
    /// [`Simulation::mesh`]. The direction may have any length but 0. On a device [`Simulation::read_back`] first: positions are those
    /// of [`Simulation::positions`]. O(boundary triangles).
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
        first_hit(self.boundary(), self.positions(), origin, direction)
    }
}
