//! [`Attachments`]: particles that are attached to moving handles, such as an instrument's jaws or a bone.
//!
//! A handle goes from pose to pose, one a frame; in between, its position is interpolated linearly and its rotation
//! along the shortest arc. An attached particle has an anchor in the handle's frame. With a compliance of 0 it is there
//! at the end of every substep, to the bit, whatever pulls on it: it moves as a fixed particle does, by itself only.
//! With a compliance it is pulled there by a spring of rest length 0, `C = x - target` in all three directions at once.
//!
//! Source: Macklin, Müller, Chentanez 2016 (compliance, damping). Cost: 40 operations an attachment.

use glam::DVec3;
use rayon::prelude::*;

use super::ConstraintKind;
use crate::float::{finite, load, store, weight};
use crate::particles::{PARALLEL_PARTICLES, Particles, number};
use crate::substep::{Factors, Substep};
use crate::{Float, Pose, XpbdError};

/// Attachment of a particle to a handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttachmentData {
    /// The particle.
    pub particle: u32,
    /// The number of the handle.
    pub handle: u32,
    /// Position in the handle's frame in m.
    pub anchor: DVec3,
    /// Compliance in m/N; 0 is rigid.
    pub compliance: f64,
    /// Damping time in s.
    pub damping: f64,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Handle {
    /// At the start and at the end of the frame.
    from: Pose,
    to: Pose,
    /// At the end of the substep.
    now: Pose,
}

impl Handle {
    /// A handle at rest.
    fn at(pose: Pose) -> Self {
        Self {
            from: pose,
            to: pose,
            now: pose,
        }
    }
}

/// A particle's anchor on a handle.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Attachment<R: Float> {
    pub(crate) particle: u32,
    pub(crate) handle: u32,
    /// The anchor in the handle's frame.
    anchor: DVec3,
    /// Compliance in m/N; 0 is rigid.
    pub(crate) compliance: f64,
    pub(crate) damping: f64,
    /// The anchor in the world at the end of the substep and at its start.
    pub(crate) target: R::Vector,
    pub(crate) before: R::Vector,
    /// 0 at the start of every substep.
    multiplier: R::Vector,
}

/// All handles and the particles attached to them.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
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
    fn find(&self, particle: usize) -> Result<usize, usize> {
        self.list
            .binary_search_by_key(&particle, |a| a.particle as usize)
    }

    /// Appends other handles, and their attachments to particles from a number on.
    pub(crate) fn append_all(&mut self, other: &Self, first_particle: u32) {
        let first = number(self.handles.len());
        self.handles.extend(&other.handles);
        self.list
            .extend(other.list.iter().map(|attachment| Attachment {
                particle: first_particle + attachment.particle,
                handle: first + attachment.handle,
                ..*attachment
            }));
    }

    /// Number of handles.
    pub(crate) fn handle_count(&self) -> usize {
        self.handles.len()
    }

    /// Of each particle on a spring: its handle, mass times the motion that the spring gave it in the substep, and
    /// where the spring is fastened, relative to the origin.
    pub(crate) fn pulls(&self) -> impl Iterator<Item = (u32, DVec3, DVec3)> + '_ {
        self.soft().map(|attachment| {
            let [impulse, target] = [attachment.multiplier, attachment.target].map(R::to_dvec3);
            (attachment.handle, impulse, target)
        })
    }

    pub(crate) fn get(&self, particle: usize) -> Option<&Attachment<R>> {
        self.find(particle).ok().map(|i| &self.list[i])
    }

    /// Whether some attachment is not rigid.
    pub(crate) fn is_soft(&self) -> bool {
        self.list.iter().any(|a| a.compliance > 0.0)
    }

    /// The attachments that are not rigid.
    pub(crate) fn soft(&self) -> impl Iterator<Item = &Attachment<R>> {
        self.list.iter().filter(|a| a.compliance > 0.0)
    }

    /// Whether a particle is attached rigidly.
    pub(crate) fn holds(&self, particle: usize) -> bool {
        self.get(particle).is_some_and(|a| a.compliance == 0.0)
    }

    /// All attachments, ascending by particle.
    pub(crate) fn list(&self) -> impl ExactSizeIterator<Item = AttachmentData> + '_ {
        self.list.iter().map(|attachment| AttachmentData {
            particle: attachment.particle,
            handle: attachment.handle,
            anchor: attachment.anchor,
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
                anchor: a.anchor.lerp(b.anchor, parameter),
                compliance: a.compliance.max(b.compliance),
                damping: a.damping.max(b.damping),
                target: a.target + (b.target - a.target) * R::from_f64(parameter),
                ..a
            };
            self.append(attachment, particle);
        }
    }

    /// Detaches the particles from number `count` on.
    pub(crate) fn truncate(&mut self, count: usize) {
        let kept = self.find(count).unwrap_or_else(|index| index);
        self.list.truncate(kept);
    }

    fn append(&mut self, attachment: Attachment<R>, particle: usize) {
        let particle = number(particle);
        self.list.push(Attachment {
            particle,
            ..attachment
        });
    }

    /// Adds a handle and returns its number.
    pub(crate) fn add_handle(&mut self, pose: Pose) -> u32 {
        self.handles.push(Handle::at(pose));
        number(self.handles.len() - 1)
    }

    /// The present pose of a handle.
    pub(crate) fn pose(&self, handle: u32) -> Pose {
        self.handles[handle as usize].from
    }

    /// Sets the pose of a handle at the end of the next frame.
    pub(crate) fn move_handle(&mut self, handle: u32, pose: Pose) {
        self.handles[handle as usize].to = pose;
    }

    /// Puts a handle at a pose at once.
    pub(crate) fn set_handle(&mut self, handle: u32, pose: Pose) {
        self.handles[handle as usize] = Handle::at(pose);
    }

    /// Sets the compliance of all attachments to a handle; returns their particles.
    pub(crate) fn set_compliance(
        &mut self,
        handle: u32,
        compliance: f64,
    ) -> Result<Vec<usize>, XpbdError> {
        check("attachment compliance", compliance)?;
        let list = self.list.iter_mut().filter(|a| a.handle == handle);
        Ok(list
            .map(|attachment| {
                attachment.compliance = compliance;
                attachment.particle as usize
            })
            .collect())
    }

    /// Attaches a particle to a handle as both are now, in place of another attachment.
    pub(crate) fn attach(
        &mut self,
        particles: &Particles<R>,
        particle: usize,
        handle: u32,
        [compliance, damping]: [f64; 2],
    ) -> Result<(), XpbdError> {
        check("attachment compliance", compliance)?;
        check("attachment damping", damping)?;
        let pose = self.pose(handle);
        let (x, world) = (particles.vector(particle), particles.position(particle));
        let attachment = Attachment {
            particle: number(particle),
            handle,
            anchor: pose.rotation.conjugate() * (world - pose.position),
            compliance,
            damping,
            target: x,
            before: x,
            multiplier: R::Vector::default(),
        };
        match self.find(particle) {
            Ok(index) => self.list[index] = attachment,
            Err(index) => self.list.insert(index, attachment),
        }
        Ok(())
    }

    /// Detaches a particle; returns whether it was attached.
    pub(crate) fn detach(&mut self, particle: usize) -> bool {
        let index = self.find(particle);
        if let Ok(index) = index {
            self.list.remove(index);
        }
        index.is_ok()
    }

    /// Moves handles and rigidly attached particles to their poses at a fraction of the frame; returns how many
    /// particles could not be moved because their target is out of the range of numbers.
    pub(crate) fn move_rigid_attachments(
        &mut self,
        particles: &Particles<R>,
        fraction: f64,
    ) -> usize {
        let Self { handles, list } = self;
        for handle in handles.iter_mut() {
            handle.now = handle.from.toward(&handle.to, fraction);
        }
        let mut lost = 0;
        for attachment in list {
            attachment.before = attachment.target;
            attachment.multiplier = R::Vector::default();
            let pose = &handles[attachment.handle as usize].now;
            let target = R::from_dvec3(pose.apply(attachment.anchor) - particles.origin);
            if !finite::<R>(target) {
                lost += 1;
                continue;
            }
            attachment.target = target;
            let p = attachment.particle as usize;
            if attachment.compliance == 0.0 && !particles.fixed[p] {
                store::<R>(&particles.cells[p], target);
            }
        }
        lost
    }

    /// Gives particles that are attached rigidly the velocity of their motion in a substep.
    pub(crate) fn update_rigid_attachments(&self, particles: &mut Particles<R>, per_time: R) {
        for attachment in &self.list {
            let p = attachment.particle as usize;
            if attachment.compliance == 0.0 && !particles.fixed[p] {
                let velocity = (particles.vector(p) - particles.previous[p]) * per_time;
                if finite::<R>(velocity) {
                    particles.velocities[p] = velocity;
                }
            }
        }
    }
}

impl<R: Float> ConstraintKind<R> for Attachments<R> {
    fn begin(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        self.move_rigid_attachments(particles, substep.fraction)
    }

    /// Pulls particles to their handles that are attached with a compliance. Each moves only its own particle.
    fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) {
        if self.list.is_empty() {
            return;
        }
        self.list
            .par_iter_mut()
            .with_min_len(PARALLEL_PARTICLES)
            .for_each(|attachment| attachment.solve(particles, &substep.factors));
    }

    fn end(&mut self, particles: &mut Particles<R>, substep: &Substep<'_, R>) {
        self.update_rigid_attachments(particles, substep.factors.per_time);
    }

    /// The handles have arrived.
    fn end_frame(&mut self) {
        for handle in &mut self.handles {
            handle.from = handle.to;
        }
    }

    fn shift(&mut self, by: R::Vector) {
        for attachment in &mut self.list {
            attachment.target = attachment.target - by;
            attachment.before = attachment.before - by;
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.handles) + size_of_val(&*self.list)
    }
}

impl<R: Float> Attachment<R> {
    #[inline]
    fn solve(&mut self, particles: &Particles<R>, factors: &Factors<R>) {
        let p = self.particle as usize;
        let cell = &particles.cells[p];
        let inverse_mass = weight::<R>(cell);
        if inverse_mass <= R::ZERO {
            return;
        }
        let x = load::<R>(cell);
        let compliance = R::from_f64(self.compliance) / factors.time_squared;
        let damping = R::from_f64(self.damping) * factors.per_time;
        let away = x - self.target;
        let motion = away - (particles.previous[p] - self.before);
        let residual = away + self.multiplier * compliance + motion * damping;
        let share = factors.relaxation / ((R::ONE + damping) * inverse_mass + compliance);
        let change = -(residual * share);
        if finite::<R>(change) {
            store::<R>(cell, x + change * inverse_mass);
            self.multiplier += change;
        }
    }
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
