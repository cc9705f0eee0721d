//! Hands in a [`Simulation`]: blades whose future is not known, as a viewer, a haptic device or a controller moves them.
//!
//! What moves is told between two frames and carried out in the next one. Cost: that of the cut; on a device a frame with
//! a live blade waits for the positions.

use glam::DVec3;

use super::Simulation;
use crate::Error;

impl Simulation {
    /// Begins a stroke whose blade somebody moves, and returns its number: faces that it lays bare are tagged with it, as
    /// those of the scene's strokes are.
    ///
    /// `blade` is a polyline of at least two points in m: its first pose, taken at the start of the next frame, which
    /// does not cut yet. `snap` is the snap distance as in [`StrokeSpec`](crate::scene::StrokeSpec), from 0 to 0.25 of an
    /// edge; scenes take 0.1 by default.
    ///
    /// Such a stroke cuts as a sweep of the scene that comes by the same poses, to the bit. It is due in every frame
    /// until it ends: a blade that stands still cuts a body that moves through it. Several may be held at once, more
    /// than a tet apart where they cross.
    ///
    /// Cost: as [`incise_cutting::Sweep`]; on a device every frame fetches the positions while the stroke is held.
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
        self.timeline.begin(blade, snap)
    }

    /// Says where the blade of a stroke is at the start of the next frame; of several calls before a frame the last one
    /// holds. Until told again, it stays there.
    ///
    /// # Errors
    /// If the stroke was not begun by [`Simulation::begin_stroke`] or has ended, if the blade has another number of
    /// points than before, or if a coordinate is not finite or beyond 1e9 m. The blade stays where it was then.
    pub fn move_blade(&mut self, stroke: u32, blade: &[DVec3]) -> Result<(), Error> {
        self.timeline.move_blade(stroke, blade)
    }

    /// Ends a stroke: after the next frame if its blade was moved since the last one, so that no pose is lost, or else at
    /// once. A stroke that no frame has seen leaves nothing. In either case it can be moved no more.
    ///
    /// # Errors
    /// If the stroke was not begun by [`Simulation::begin_stroke`] or has ended.
    pub fn end_stroke(&mut self, stroke: u32) -> Result<(), Error> {
        self.timeline.end(stroke)
    }
}
