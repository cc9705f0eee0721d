//! [`Pose`] and attachments: particles that hang on moving handles, such as an instrument's jaws or a bone.
//!
//! A handle goes from pose to pose, one a frame; in between, its position is interpolated linearly and its rotation
//! along the shortest arc. An attached particle has a place in the handle's frame. With a compliance of 0 it is there at
//! the end of every substep, to the bit, whatever pulls on it: it moves as a fixed particle does, by itself only. With a
//! compliance it is pulled there by a spring of rest length 0, `C = x - target` in all three directions at once.
//!
//! Source: Macklin, Müller, Chentanez 2016 (compliance, damping). Cost: 40 operations an attachment.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::float::{finite, load, store, weight};
use crate::step::Factors;
use crate::step::PARALLEL_PARTICLES;
use crate::{AttachmentData, Float, Solver, XpbdError};

/// Where a handle is and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position in m.
    pub position: DVec3,
    /// Rotation, of length 1.
    pub rotation: DQuat,
}

impl Pose {
    /// At a position, not turned.
    #[must_use]
    pub fn at(position: DVec3) -> Self {
        Self {
            position,
            rotation: DQuat::IDENTITY,
        }
    }

    /// Where a point of the handle's frame is in the world.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.position + self.rotation * point
    }

    /// The pose at a fraction of the way to another one; that one itself at 1.
    #[must_use]
    pub fn toward(&self, to: &Self, fraction: f64) -> Self {
        if fraction >= 1.0 || self == to {
            return *to;
        }
        Self {
            position: self.position.lerp(to.position, fraction),
            rotation: self.rotation.slerp(to.rotation, fraction),
        }
    }

    fn check(&self) {
        let sound = self.position.is_finite() && self.rotation.is_finite();
        assert!(
            sound && (self.rotation.length() - 1.0).abs() < 1e-6,
            "poses are finite and their rotations of length 1"
        );
    }
}

#[derive(Clone, Copy, Debug)]
struct Handle {
    /// At the start and at the end of the frame.
    from: Pose,
    to: Pose,
    /// At the end of the substep.
    now: Pose,
}

/// A particle's place on a handle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attachment<R: Float> {
    pub(crate) particle: u32,
    handle: u32,
    /// The place in the handle's frame.
    place: DVec3,
    /// In m/N; 0 is rigid.
    pub(crate) compliance: f64,
    pub(crate) damping: f64,
    /// Where the place is in the world at the end of the substep, and at its start.
    pub(crate) target: R::Vector,
    pub(crate) before: R::Vector,
    /// 0 at the start of every substep.
    multiplier: R::Vector,
}

/// All handles and what hangs on them.
#[derive(Clone, Debug)]
pub(crate) struct Attachments<R: Float> {
    handles: Vec<Handle>,
    /// Ascending by particle, at most one each.
    list: Vec<Attachment<R>>,
}

impl<R: Float> Default for Attachments<R> {
    fn default() -> Self {
        Self {
            handles: Vec::new(),
            list: Vec::new(),
        }
    }
}

impl<R: Float> Attachments<R> {
    /// Bytes of both lists.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.handles) + size_of_val(&*self.list)
    }

    fn find(&self, particle: usize) -> Result<usize, usize> {
        self.list
            .binary_search_by_key(&particle, |a| a.particle as usize)
    }

    fn get(&self, particle: usize) -> Option<&Attachment<R>> {
        self.find(particle).ok().map(|i| &self.list[i])
    }

    /// Follows a new origin.
    pub(crate) fn shift(&mut self, by: R::Vector) {
        for attachment in &mut self.list {
            attachment.target = attachment.target - by;
            attachment.before = attachment.before - by;
        }
    }

    /// Whether some attachment is not rigid.
    pub(crate) fn is_soft(&self) -> bool {
        self.list.iter().any(|a| a.compliance > 0.0)
    }

    /// The attachments that are not rigid.
    pub(crate) fn soft(&self) -> impl Iterator<Item = &Attachment<R>> {
        self.list.iter().filter(|a| a.compliance > 0.0)
    }

    /// Whether a particle is where its handle says, whatever pulls on it.
    pub(crate) fn holds(&self, particle: usize) -> bool {
        self.get(particle).is_some_and(|a| a.compliance == 0.0)
    }

    /// What hangs on handles.
    pub(crate) fn list(&self) -> impl ExactSizeIterator<Item = AttachmentData> + '_ {
        self.list.iter().map(|attachment| AttachmentData {
            particle: attachment.particle,
            handle: attachment.handle,
            place: attachment.place,
            compliance: attachment.compliance,
            damping: attachment.damping,
        })
    }

    /// The poses of all handles at a fraction of the frame.
    pub(crate) fn poses(&self, fraction: f64) -> impl ExactSizeIterator<Item = Pose> + '_ {
        let handles = self.handles.iter();
        handles.map(move |handle| handle.from.toward(&handle.to, fraction))
    }

    /// Attaches the last particle as `of` is, if it is.
    pub(crate) fn copy(&mut self, of: usize, copy: usize) {
        if let Some(&attachment) = self.get(of) {
            self.append(attachment, copy);
        }
    }

    /// Attaches the last particle if both ends are attached to the same handle.
    pub(crate) fn between(&mut self, [a, b]: [usize; 2], parameter: f64, particle: usize) {
        let (Some(&a), Some(b)) = (self.get(a), self.get(b)) else {
            return;
        };
        if a.handle == b.handle {
            let attachment = Attachment {
                place: a.place.lerp(b.place, parameter),
                compliance: a.compliance.max(b.compliance),
                damping: a.damping.max(b.damping),
                target: a.target + (b.target - a.target) * R::from_f64(parameter),
                ..a
            };
            self.append(attachment, particle);
        }
    }

    /// Lets go of particles from number `count` on.
    pub(crate) fn truncate(&mut self, count: usize) {
        let kept = self.find(count).unwrap_or_else(|place| place);
        self.list.truncate(kept);
    }

    fn append(&mut self, attachment: Attachment<R>, particle: usize) {
        let particle = number(particle);
        self.list.push(Attachment {
            particle,
            ..attachment
        });
    }
}

fn number(particle: usize) -> u32 {
    u32::try_from(particle).expect("particles are numbered by 32 bits")
}

fn check(what: &'static str, value: f64) -> Result<(), XpbdError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(XpbdError::Setting {
        what,
        value,
        range: "at least 0 and finite",
    })
}

impl<R: Float> Solver<R> {
    /// Adds a handle and returns its number.
    ///
    /// # Panics
    /// If the pose is not finite or its rotation not of length 1.
    pub fn add_handle(&mut self, pose: Pose) -> u32 {
        pose.check();
        let handles = &mut self.attachments.handles;
        handles.push(Handle {
            from: pose,
            to: pose,
            now: pose,
        });
        number(handles.len() - 1)
    }

    /// Puts a handle at a pose at once. Particles attached to it go there in the next substep.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation not of length 1.
    pub fn set_handle(&mut self, handle: u32, pose: Pose) {
        pose.check();
        self.attachments.handles[handle as usize] = Handle {
            from: pose,
            to: pose,
            now: pose,
        };
    }

    /// Says where a handle is at the end of the next frame; until told again, it stays there.
    ///
    /// # Panics
    /// If the handle does not exist, the pose is not finite or its rotation not of length 1.
    pub fn move_handle(&mut self, handle: u32, pose: Pose) {
        pose.check();
        self.attachments.handles[handle as usize].to = pose;
    }

    /// The present pose of a handle.
    ///
    /// # Panics
    /// If the handle does not exist.
    #[must_use]
    pub fn handle(&self, handle: u32) -> Pose {
        self.attachments.handles[handle as usize].from
    }

    /// Attaches a particle, from where it is now, to a handle as that is now. A particle hangs on one handle: another
    /// attachment replaces the first.
    ///
    /// `compliance` is one over the stiffness in m/N, 0 is rigid; `damping` is a time in s, by which the motion relative
    /// to the handle is resisted times the stiffness (nothing with a compliance of 0). A fixed particle stays fixed. A
    /// cut attaches copies like their originals, and a particle between two others if both hang on the same handle; with
    /// a compliance, each has a spring of its own.
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
    /// use incise_graph::Schedule;
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
        check("attachment compliance", compliance)?;
        check("attachment damping", damping)?;
        let pose = self.attachments.handles[handle as usize].from;
        let (x, world) = (self.vector(particle), self.position(particle));
        let attachment = Attachment {
            particle: number(particle),
            handle,
            place: pose.rotation.conjugate() * (world - pose.position),
            compliance,
            damping,
            target: x,
            before: x,
            multiplier: R::Vector::default(),
        };
        let list = &mut self.attachments.list;
        match list.binary_search_by_key(&attachment.particle, |a| a.particle) {
            Ok(place) => list[place] = attachment,
            Err(place) => list.insert(place, attachment),
        }
        self.note(|changes| changes.attachments = true);
        self.set_weight(particle);
        Ok(())
    }

    /// Sets the compliance of all particles on a handle in m/N, wherever they are now; 0 is rigid. O(attachments).
    ///
    /// # Errors
    /// A negative or infinite compliance.
    pub fn set_compliance(&mut self, handle: u32, compliance: f64) -> Result<(), XpbdError> {
        check("attachment compliance", compliance)?;
        let list = self.attachments.list.iter_mut();
        let mut changed = Vec::new();
        for attachment in list.filter(|attachment| attachment.handle == handle) {
            attachment.compliance = compliance;
            changed.push(attachment.particle as usize);
        }
        for particle in changed {
            self.set_weight(particle);
        }
        self.note(|changes| changes.attachments = true);
        Ok(())
    }

    /// Lets a particle go; it keeps its velocity. O(log n + attachments of higher particles).
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn detach(&mut self, particle: usize) {
        if let Ok(place) = self.attachments.find(particle) {
            self.attachments.list.remove(place);
            self.note(|changes| changes.attachments = true);
        }
        self.set_weight(particle);
    }

    /// The handle that a particle hangs on.
    #[must_use]
    pub fn handle_of(&self, particle: usize) -> Option<u32> {
        self.attachments.get(particle).map(|a| a.handle)
    }

    /// Brings handles and what they hold rigidly to where they are at a fraction of the frame; returns how many
    /// particles could not follow out of the range of numbers.
    pub(crate) fn move_held(&mut self, fraction: f64) -> usize {
        let Self {
            attachments: Attachments { handles, list },
            particles,
            fixed,
            origin,
            ..
        } = self;
        for handle in handles.iter_mut() {
            handle.now = handle.from.toward(&handle.to, fraction);
        }
        let mut lost = 0;
        for attachment in list {
            attachment.before = attachment.target;
            attachment.multiplier = R::Vector::default();
            let pose = &handles[attachment.handle as usize].now;
            let target = R::from_dvec3(pose.apply(attachment.place) - *origin);
            if !finite::<R>(target) {
                lost += 1;
                continue;
            }
            attachment.target = target;
            let p = attachment.particle as usize;
            if attachment.compliance == 0.0 && !fixed[p] {
                store::<R>(&particles[p], target);
            }
        }
        lost
    }

    /// Gives particles that are held rigidly the velocity of their motion in a substep.
    pub(crate) fn update_held(&mut self, per_time: R) {
        for attachment in &self.attachments.list {
            let p = attachment.particle as usize;
            if attachment.compliance == 0.0 && !self.fixed[p] {
                let velocity = (self.vector(p) - self.previous[p]) * per_time;
                if finite::<R>(velocity) {
                    self.velocities[p] = velocity;
                }
            }
        }
    }

    /// Ends a frame: the handles have arrived.
    pub(crate) fn arrive(&mut self) {
        for handle in &mut self.attachments.handles {
            handle.from = handle.to;
        }
    }

    /// Pulls particles to their handles that hang on them by a compliance. Each moves only its own particle.
    pub(crate) fn solve_attachments(&mut self, factors: &Factors<R>) {
        let Self {
            attachments: Attachments { list, .. },
            particles,
            previous,
            ..
        } = self;
        if list.is_empty() {
            return;
        }
        list.par_iter_mut()
            .with_min_len(PARALLEL_PARTICLES)
            .for_each(|attachment| {
                let p = attachment.particle as usize;
                let inverse_mass = weight::<R>(&particles[p]);
                if inverse_mass <= R::ZERO {
                    return;
                }
                let x = load::<R>(&particles[p]);
                let compliance = R::from_f64(attachment.compliance) / factors.time_squared;
                let damping = R::from_f64(attachment.damping) * factors.per_time;
                let away = x - attachment.target;
                let motion = away - (previous[p] - attachment.before);
                let residual = away + attachment.multiplier * compliance + motion * damping;
                let share = factors.relaxation / ((R::ONE + damping) * inverse_mass + compliance);
                let change = -(residual * share);
                if finite::<R>(change) {
                    store::<R>(&particles[p], x + change * inverse_mass);
                    attachment.multiplier += change;
                }
            });
    }
}
