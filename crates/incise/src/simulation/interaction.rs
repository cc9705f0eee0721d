//! Interactive input of a [`Simulation`]: blades, grabs and velocities that a viewer, a haptic device or a controller
//! sets frame by frame.
//!
//! Calls between two frames take effect in the next one. Cost: that of cuts and of handles. On a device a frame with a
//! live blade waits for the positions, and so do [`Simulation::grab`] and [`Simulation::release`]; moving a grab does
//! not.

use glam::DVec3;

use super::Simulation;
use crate::scene::SolidBladeSpec;
use crate::validate::{coordinates, value, within};
use crate::{Error, Grab, solid_blade};

impl Simulation {
    /// Begins a stroke whose blade is moved frame by frame, and returns its number. Faces that it opens are tagged with
    /// this number, as those of the scene's strokes are.
    ///
    /// `blade` is a polyline of at least two points in m: its first pose, taken at the start of the next frame, which
    /// does not cut yet. `snap` is the snap distance as in [`StrokeSpec`](crate::scene::StrokeSpec), from 0 to 0.25 of an
    /// edge; scenes take 0.1 by default.
    ///
    /// The stroke cuts bit-identically to a sweep of the scene with the same poses. It is active in every frame until
    /// it ends: a blade that does not move cuts a body that moves through it. Several strokes may be active at once if
    /// they stay more than a tet apart where they cross.
    ///
    /// Cost: that of [`incise_cutting::Sweep`]; on a device every frame reads the positions back while a stroke is
    /// active.
    ///
    /// # Errors
    /// If the blade has fewer than two different points, if a coordinate is not finite or beyond 1e9 m, or if `snap` lies
    /// outside its range.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"box\", tets = 200 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let blade = |z: f64| [DVec3::new(-1.0, 0.03, z), DVec3::new(1.0, 0.03, z)];
    /// let stroke = simulation.begin_stroke(&blade(0.6), 0.1)?;
    /// simulation.step()?;
    /// for z in [0.3, 0.0, -0.3, -0.6] {
    ///     simulation.move_blade(stroke, &blade(z))?;
    ///     simulation.step()?;
    /// }
    /// simulation.end_stroke(stroke)?;
    /// assert_eq!(simulation.report().pieces, 2);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn begin_stroke(&mut self, blade: &[DVec3], snap: f64) -> Result<u32, Error> {
        self.state.timeline.begin(blade, snap, None)
    }

    /// Begins a stroke as [`Simulation::begin_stroke`] does, with a blade that has a body: it pushes the sides of its cut
    /// apart, and [`Simulation::blade_force`] is what it feels. The blade is straight. Its body lies behind the edge, against
    /// the direction in which the blade moves first; a blade that is drawn back keeps its direction.
    ///
    /// The body follows the cut: in a frame it moves from the blade's last pose to its present one. The cut itself takes no
    /// force, unless the blade has a toughness; then the tissue gives before the edge, and the cut is made a frame later, as
    /// far as the edge has passed.
    ///
    /// # Errors
    /// Those of [`Simulation::begin_stroke`]; if the blade has more than two points or a value of its body lies outside its
    /// range; on a GPU; and if a body is solved by VBD.
    pub fn begin_solid_stroke(
        &mut self,
        blade: &[DVec3],
        snap: f64,
        solid: &SolidBladeSpec,
    ) -> Result<u32, Error> {
        self.check_solid()?;
        let stroke = self.state.timeline.begin(blade, snap, Some(solid))?;
        self.keep_off_vbd();
        Ok(stroke)
    }

    /// Refuses solid blades where a body or the device knows none.
    pub(super) fn check_solid(&self) -> Result<(), Error> {
        let is_gpu = self.state.compute_device.is_gpu();
        let mut islands = self.state.islands.iter();
        islands.try_for_each(|island| solid_blade::check("stroke", island.spec.method, is_gpu))
    }

    /// Keeps `auto` from choosing VBD, which has no solid blades.
    pub(super) fn keep_off_vbd(&mut self) {
        for island in &mut self.state.islands {
            island.judged.leaves_method_open = false;
        }
    }

    /// Sets the blade of a stroke for the start of the next frame. Of several calls before a frame the last one counts.
    /// Without a call the blade stays in place.
    ///
    /// # Errors
    /// If the stroke was not begun by [`Simulation::begin_stroke`] or has ended, if the blade has another number of
    /// points than before, or if a coordinate is not finite or beyond 1e9 m. The blade stays where it was then.
    pub fn move_blade(&mut self, stroke: u32, blade: &[DVec3]) -> Result<(), Error> {
        self.state.timeline.move_blade(stroke, blade)
    }

    /// Ends a stroke: after the next frame if its blade was moved since the last one, otherwise at once. A stroke
    /// without a frame leaves nothing. The stroke cannot be moved after this call.
    ///
    /// # Errors
    /// If the stroke was not begun by [`Simulation::begin_stroke`] or has ended.
    pub fn end_stroke(&mut self, stroke: u32) -> Result<(), Error> {
        self.state.timeline.end(stroke, &self.state.islands)
    }

    /// Grabs the body at a point, to move it interactively; `None` if there is no particle to grab.
    ///
    /// Grabs the particles that are within `radius` m of `point` now and belong to the piece of the nearest one. Fixed
    /// particles and those of attachments or other grabs are left out, also in the search for the nearest one.
    ///
    /// `compliance` applies to each particle, in m/N, as in [`AttachmentSpec`](crate::scene::AttachmentSpec): 0 is
    /// rigid; with a large one the body can move away from the grab.
    ///
    /// Wakes the body. A cut through the grabbed part leaves both sides grabbed.
    ///
    /// O(particles); with a compliance of 0 the next step costs O(tets) more. On a device the positions are read back.
    ///
    /// # Errors
    /// If a coordinate is not finite or beyond 1e9 m, `radius` or `compliance` is not from 0 to 1e9, or
    /// the device is lost.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"sphere\", tets = 300 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let top = simulation.positions().iter().copied().fold(DVec3::ZERO, |a, b| if b.z > a.z { b } else { a });
    /// let grab = simulation.grab(top, 0.1, 0.0)?.expect("a particle is there");
    /// for step in 1..=5 {
    ///     simulation.move_grab(grab, top + DVec3::Z * (0.02 * f64::from(step)))?;
    ///     simulation.step()?;
    /// }
    /// simulation.release(grab)?;
    /// assert!(simulation.positions().iter().any(|x| x.z > top.z + 0.09));
    /// assert!(simulation.grab(DVec3::splat(50.0), 0.1, 0.0)?.is_none());
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn grab(
        &mut self,
        point: DVec3,
        radius: f64,
        compliance: f64,
    ) -> Result<Option<Grab>, Error> {
        coordinates("grab.point", point.to_array())?;
        within("grab.radius", radius, 0.0, 1e9)?;
        within("grab.compliance", compliance, 0.0, 1e9)?;
        self.read_back()?;
        let islands = self.state.islands.iter().enumerate();
        let nearest = islands.filter_map(|(g, island)| {
            let (distance, particle) = island.nearest(point, radius)?;
            Some((distance, g, particle))
        });
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, g, particle)) = nearest else {
            return Ok(None);
        };
        let grab = Grab(self.state.next.grab);
        self.state.islands[g].grab(grab, particle, point, radius, compliance)?;
        self.state.next.grab += 1;
        Ok(Some(grab))
    }

    /// Sets the target of a grabbed point for the end of the next frame. Of several calls before a frame the last one
    /// counts. Without a call the point stays in place.
    ///
    /// The grabbed particles move there in a straight line without rotation. A jump of more than a tet in a frame may
    /// invert tets for a while. O(grabs of the body), without waiting for a device.
    ///
    /// # Errors
    /// If the grab was released, or if a coordinate is not finite or beyond 1e9 m. The grab does not move then.
    pub fn move_grab(&mut self, grab: Grab, to: DVec3) -> Result<(), Error> {
        coordinates("grab.to", to.to_array())?;
        let mut islands = self.state.islands.iter_mut();
        match islands.any(|island| island.move_grab(grab, to)) {
            true => Ok(()),
            false => Err(unknown(grab)),
        }
    }

    /// Releases a grab. Its particles keep the velocity of the grab in the last frame.
    ///
    /// Particles that cuts added to the grab are released, too. O(particles attached to handles); after a grab with a
    /// compliance of 0 the next step costs O(tets) more. On a device the positions are read back.
    ///
    /// # Errors
    /// If the grab was released before, or the device is lost.
    pub fn release(&mut self, grab: Grab) -> Result<(), Error> {
        for island in &mut self.state.islands {
            if island.release(grab)? {
                return Ok(());
            }
        }
        Err(unknown(grab))
    }

    /// Sets the velocity in m/s of each free particle as a function of its position in m, and wakes all bodies.
    ///
    /// Without a call bodies begin at rest. The next frame starts with these velocities. O(particles); on a device the
    /// positions are read back.
    ///
    /// # Errors
    /// If a velocity is not finite or a component is beyond 1e9 m/s, in which case all stay as they were; or if the device
    /// is lost.
    ///
    /// # Example
    /// A box moves at 2 m/s. For a spinning one use `|x| rate.cross(x - center)`.
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{Scene, Simulation};
    ///
    /// let scene = Scene::from_toml(
    ///     "[world]\ngravity = [0.0, 0.0, 0.0]\n[[body]]\nshape = { kind = \"box\", tets = 200 }",
    /// )?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let start = simulation.positions()[0];
    /// simulation.set_velocities(|_| DVec3::X * 2.0)?;
    /// for _ in 0..10 {
    ///     simulation.step()?;
    /// }
    /// let way = DVec3::X * 2.0 * 10.0 * simulation.time_step();
    /// assert!(simulation.positions()[0].distance(start + way) < 1e-4);
    /// # Ok::<(), incise::Error>(())
    /// ```
    pub fn set_velocities(&mut self, velocity: impl Fn(DVec3) -> DVec3) -> Result<(), Error> {
        self.read_back()?;
        for island in &self.state.islands {
            let solver = island.solver.host();
            for p in 0..solver.particle_count() {
                coordinates("velocity", velocity(solver.position(p)).to_array())?;
            }
        }
        for island in &mut self.state.islands {
            island.wake();
            let solver = island.solver.edit()?;
            for p in 0..solver.particle_count() {
                if !solver.is_fixed(p) {
                    solver.set_velocity(p, velocity(solver.position(p)));
                }
            }
        }
        Ok(())
    }
}

fn unknown(grab: Grab) -> Error {
    value("grab", format!("{grab:?}"), "one that was not released")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Precision;
    use crate::{Scene, Simulation};

    #[test]
    fn a_thousand_grabs_take_two_handles() {
        let body = "[[body]]\nshape = { kind = \"box\", tets = 200 }";
        for precision in [Precision::F32, Precision::F64] {
            let mut scene = Scene::from_toml(body).unwrap();
            scene.solver.precision = precision;
            let mut simulation = Simulation::new(&scene).unwrap();
            for number in 0..500 {
                let last = simulation.mesh().positions.len() - 1;
                let [one, other] = [0, last].map(|p| {
                    let point = simulation.positions()[p];
                    let grab = simulation.grab(point, 0.1, 1e-3 * f64::from(number % 2));
                    grab.unwrap().expect("opposite corners are free")
                });
                simulation.move_grab(other, DVec3::Y).unwrap();
                // A frame now and then, while both are held, one is, or none.
                let step_at = |simulation: &mut Simulation, turn: i32| {
                    if number % 50 == turn {
                        simulation.step().unwrap();
                    }
                };
                step_at(&mut simulation, 0);
                simulation.release(one).unwrap();
                step_at(&mut simulation, 7);
                simulation.release(other).unwrap();
                step_at(&mut simulation, 9);
            }
            // The handles go back in a frame: their ways do not add up.
            simulation.step().unwrap();
            let solver = simulation.state.islands[0].solver.host();
            let handles = (0..).take(solver.handle_count());
            let at = handles.map(|handle| solver.handle(handle).position);
            assert_eq!(at.collect::<Vec<_>>(), [DVec3::ZERO; 2]);
            assert!((0..solver.particle_count()).all(|p| solver.handle_of(p).is_none()));
            simulation.check().unwrap();
        }
    }
}
