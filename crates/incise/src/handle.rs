//! [`Handle`]: what holds parts of bodies and moves them, such as an instrument or a bone.
//!
//! A handle's frame has its origin in the center of its turn, so that particles go around it on circles between two
//! frames as well.

use glam::{DQuat, DVec3};
use incise_xpbd::Pose;

use crate::Error;
use crate::backend::{AnySolver, each_mut};
use crate::collider::rotation;
use crate::limits::{coordinates, value, within};
use crate::region::particles;
use crate::scene::{HandleSpec, along};

/// A handle, checked.
#[derive(Clone, Debug)]
pub(crate) struct Handle {
    /// Its key in the scene.
    field: String,
    spec: HandleSpec,
    center: DVec3,
    /// The particles it holds, as numbered in their group of bodies.
    particles: Vec<usize>,
    /// Its number in the solver.
    pub(crate) number: u32,
}

impl Handle {
    /// Checks a handle. `positions` are those of its body's particles at rest, which are numbered from `first_particle` on
    /// in their group.
    pub(crate) fn new(
        field: String,
        spec: &HandleSpec,
        positions: &[DVec3],
        first_particle: usize,
    ) -> Result<Self, Error> {
        let [first, last] = spec.frames;
        if first >= last {
            let range = "two frames, the second after the first";
            let frames = format!("{:?}", spec.frames);
            return Err(value(format!("{field}.frames"), frames, range));
        }
        if spec.path.len() < 2 {
            let count = format!("{} point(s)", spec.path.len());
            return Err(value(format!("{field}.path"), count, "at least two"));
        }
        for &offset in &spec.path {
            coordinates(&format!("{field}.path"), offset)?;
        }
        let mut center = DVec3::ZERO;
        if let Some(turn) = spec.turn {
            let field = format!("{field}.turn");
            rotation(&field, turn.axis, turn.angle_degrees)?;
            center = coordinates(&format!("{field}.center"), turn.center)?;
            if turn.angle_degrees.abs() / (last - first) as f64 >= 180.0 {
                let range = "below 180 a frame";
                let field = format!("{field}.angle_degrees");
                return Err(value(field, turn.angle_degrees, range));
            }
        }
        within(&format!("{field}.compliance"), spec.compliance, 0.0, 1e9)?;
        let mut held = Vec::new();
        for (i, region) in spec.holds.iter().enumerate() {
            let inside = particles(&format!("{field}.holds[{i}]"), region, positions)?;
            held.extend(inside.iter().map(|p| first_particle + p));
        }
        held.sort_unstable();
        held.dedup();
        Ok(Self {
            field,
            spec: spec.clone(),
            center,
            particles: held,
            number: 0,
        })
    }

    /// Takes hold.
    pub(crate) fn attach(&mut self, solver: &mut AnySolver) -> Result<(), Error> {
        let field = &self.field;
        let (pose, compliance) = (self.pose(0), self.spec.compliance);
        each_mut!(solver, solver => {
            self.number = solver.add_handle(pose);
            for &p in &self.particles {
                if solver.handle_of(p).is_some() {
                    let what = "a region with a particle of another handle";
                    let range = "what no other handle holds";
                    return Err(value(format!("{field}.holds"), what, range));
                }
                solver
                    .attach(p, self.number, compliance, 0.0)
                    .map_err(|source| Error::Xpbd { field: field.clone(), source })?;
            }
        });
        Ok(())
    }

    /// Whether it moves in a frame.
    pub(crate) fn moves(&self, frame: u64) -> bool {
        self.pose(frame) != self.pose(frame.saturating_add(1))
    }

    /// Tells the solver where the handle is at the end of a frame.
    pub(crate) fn advance(&self, frame: u64, solver: &mut AnySolver) {
        let pose = self.pose(frame.saturating_add(1));
        solver.move_handle(self.number, pose);
    }

    /// Where the handle is at the start of a frame.
    pub(crate) fn pose(&self, frame: u64) -> Pose {
        let [first, last] = self.spec.frames;
        let elapsed = (frame.clamp(first, last) - first) as f64 / (last - first) as f64;
        let rotation = self.spec.turn.map_or(DQuat::IDENTITY, |turn| {
            let axis = DVec3::from_array(turn.axis);
            let axis = (axis / axis.abs().max_element()).normalize();
            DQuat::from_axis_angle(axis, (elapsed * turn.angle_degrees).to_radians())
        });
        let way = along(&self.spec.path, elapsed) - DVec3::from_array(self.spec.path[0]);
        Pose {
            position: self.center + way,
            rotation,
        }
    }
}
