//! [`Attachment`]: part of a body that is held and moved, for example by an instrument or a bone.
//!
//! The particles of an attachment keep their positions in a moving frame. Its path gives the frame's pose at the start
//! of every frame of the simulation, until a program moves the attachment. The frame's origin is the center of the
//! path's rotation, so particles move on circles between two frames as well. Cost: a pass over the body's particles to
//! attach, and one over all attached particles to detach.

use glam::{DQuat, DVec3};
use incise_xpbd::Pose;

use crate::Error;
use crate::backend::AnySolver;
use crate::collider::rotation;
use crate::region::particles;
use crate::scene::{AttachmentSpec, along};
use crate::text::counted;
use crate::validate::{coordinates, value, within};

/// What supports a particle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Support {
    /// Nothing: the solver moves it.
    #[default]
    Free,
    /// It is pinned where it was at the start.
    Pinned,
    /// An attachment or a grab.
    Attached,
}

/// Handle of an attachment of a simulation, valid until the attachment is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub struct AttachmentHandle(pub(crate) u32);

impl AttachmentHandle {
    /// The handle of the attachment of a scene with this index.
    pub(crate) fn of_scene(index: usize) -> Self {
        Self(u32::try_from(index).expect("attachments are numbered in 32 bits"))
    }
}

/// Source of an attachment's motion.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
enum Motion {
    /// Its path.
    Path,
    /// A program. `moved` is whether it moves in the next frame.
    Program { to: Pose, moved: bool },
}

/// An attachment, checked.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Attachment {
    pub(crate) name: AttachmentHandle,
    /// Its key in the scene.
    field: String,
    spec: AttachmentSpec,
    /// The origin of its frame before the first move, in m.
    origin: DVec3,
    motion: Motion,
    /// The particles that are attached at first, as numbered in their island of bodies.
    particles: Vec<usize>,
    /// Center of these particles when they were attached, in m.
    middle: DVec3,
    /// Center of these particles in the frame, in m.
    center: DVec3,
    /// The number of its frame in the solver.
    pub(crate) number: u32,
}

impl Attachment {
    /// Checks an attachment. `positions` are those of its body's particles at rest, and `number_of` gives the number of
    /// each in its island.
    pub(crate) fn new(
        name: AttachmentHandle,
        field: String,
        spec: &AttachmentSpec,
        positions: &[DVec3],
        number_of: impl Fn(usize) -> usize,
    ) -> Result<Self, Error> {
        let [first, last] = spec.frames;
        if first >= last {
            let range = "two frames, the second after the first";
            let frames = format!("{:?}", spec.frames);
            return Err(value(format!("{field}.frames"), frames, range));
        }
        if spec.path.len() < 2 {
            let count = counted(spec.path.len(), "point");
            return Err(value(format!("{field}.path"), count, "at least two"));
        }
        for &offset in &spec.path {
            coordinates(&format!("{field}.path"), offset)?;
        }
        let mut origin = DVec3::ZERO;
        if let Some(turn) = spec.rotation {
            let field = format!("{field}.rotation");
            rotation(&field, turn.axis, turn.angle_degrees)?;
            origin = coordinates(&format!("{field}.center"), turn.center)?;
            if turn.angle_degrees.abs() / (last - first) as f64 >= 180.0 {
                let range = "below 180 a frame";
                let field = format!("{field}.angle_degrees");
                return Err(value(field, turn.angle_degrees, range));
            }
        }
        check_compliance(&field, spec.compliance)?;
        let mut held = Vec::new();
        for (i, region) in spec.regions.iter().enumerate() {
            let inside = particles(&format!("{field}.regions[{i}]"), region, positions)?;
            held.extend(inside.into_iter().map(&number_of));
        }
        held.sort_unstable();
        held.dedup();
        Ok(Self {
            name,
            field,
            spec: spec.clone(),
            origin,
            motion: Motion::Path,
            particles: held,
            middle: DVec3::ZERO,
            center: DVec3::ZERO,
            number: 0,
        })
    }

    /// Takes other numbers where its island's particles and frames follow those of another one.
    pub(crate) fn renumber(&mut self, first_particle: usize, first_frame: u32) {
        for particle in &mut self.particles {
            *particle += first_particle;
        }
        self.number += first_frame;
    }

    /// Its key in the scene; `attachment` if a program added it.
    pub(crate) fn field(&self) -> &str {
        &self.field
    }

    /// Whether it holds no particle.
    pub(crate) fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// Attaches the particles at the start of a frame, to a frame of the solver that is `spare` or a new one; on an error
    /// none of them.
    pub(crate) fn attach(
        &mut self,
        frame: u64,
        solver: &mut AnySolver,
        spare: Option<u32>,
    ) -> Result<(), Error> {
        let field = &self.field;
        let (pose, compliance) = (self.pose(frame), self.spec.compliance);
        let solver = solver.edit()?;
        if (self.particles.iter()).any(|&p| solver.handle_of(p).is_some()) {
            let what = "a region with a particle of another attachment";
            let range = "particles that nothing else holds";
            return Err(value(format!("{field}.regions"), what, range));
        }
        self.number = match spare {
            Some(number) => {
                solver.set_handle(number, pose);
                number
            }
            None => solver.add_handle(pose),
        };
        for &p in &self.particles {
            self.middle += solver.position(p) / self.particles.len() as f64;
            let attached = solver.attach(p, self.number, compliance, 0.0);
            attached.map_err(Error::xpbd(field))?;
        }
        self.center = pose.rotation.conjugate() * (self.middle - pose.position);
        Ok(())
    }

    /// Where its frame has carried the center of the particles that were attached at first, in m.
    pub(crate) fn center(&self, solver: &AnySolver) -> DVec3 {
        solver.host().handle(self.number).apply(self.center)
    }

    /// Detaches all its particles, those that cuts made too.
    pub(crate) fn detach(&self, solver: &mut AnySolver) -> Result<(), Error> {
        solver.edit()?.detach_all(self.number);
        Ok(())
    }

    /// Sets the compliance of all its particles in m/N, those that cuts made too; they stay where they are.
    pub(crate) fn set_compliance(
        &mut self,
        solver: &mut AnySolver,
        compliance: f64,
    ) -> Result<(), Error> {
        check_compliance(&self.field, compliance)?;
        self.spec.compliance = compliance;
        let set = solver.edit()?.set_compliance(self.number, compliance);
        set.map_err(Error::xpbd(&self.field))
    }

    /// Goes within the next frame to where its particles, had they stayed as they were when they were attached, are turned
    /// by `rotation` about their center and then displaced by `offset`.
    pub(crate) fn move_to(&mut self, offset: DVec3, rotation: DQuat) {
        let arm = self.origin - self.middle;
        let to = Pose {
            position: self.middle + offset + rotation * arm,
            rotation,
        };
        let moved = match self.motion {
            Motion::Path => true,
            // What is held stays awake only while it really moves.
            Motion::Program { to: before, moved } => moved || before != to,
        };
        self.motion = Motion::Program { to, moved };
    }

    /// Notes that a frame has been made.
    pub(crate) fn arrive(&mut self) {
        if let Motion::Program { moved, .. } = &mut self.motion {
            *moved = false;
        }
    }

    /// Whether it moves in a frame.
    pub(crate) fn moves(&self, frame: u64) -> bool {
        match self.motion {
            Motion::Path => self.pose(frame) != self.pose(frame.saturating_add(1)),
            Motion::Program { moved, .. } => moved,
        }
    }

    /// Tells the solver where the frame is at the end of a frame of the simulation.
    pub(crate) fn advance(&self, frame: u64, solver: &mut AnySolver) {
        let pose = self.pose(frame.saturating_add(1));
        solver.backend_mut().move_handle(self.number, pose);
    }

    /// Returns the pose of the attachment's frame at the start of a frame of the simulation.
    pub(crate) fn pose(&self, frame: u64) -> Pose {
        if let Motion::Program { to, .. } = self.motion {
            return to;
        }
        let [first, last] = self.spec.frames;
        let elapsed = (frame.clamp(first, last) - first) as f64 / (last - first) as f64;
        let rotation = self.spec.rotation.map_or(DQuat::IDENTITY, |turn| {
            let axis = DVec3::from_array(turn.axis);
            let axis = (axis / axis.abs().max_element()).normalize();
            DQuat::from_axis_angle(axis, (elapsed * turn.angle_degrees).to_radians())
        });
        let way = along(&self.spec.path, elapsed) - DVec3::from_array(self.spec.path[0]);
        Pose {
            position: self.origin + way,
            rotation,
        }
    }
}

fn check_compliance(field: &str, compliance: f64) -> Result<(), Error> {
    within(&format!("{field}.compliance"), compliance, 0.0, 1e9)?;
    Ok(())
}
