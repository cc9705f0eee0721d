//! [`Forces`]: what a frame exerts on the handles, colliders and fixed particles that hold the bodies.
//!
//! Every correction of a constraint is an impulse: it moves a particle of mass m by `Δx`, so it gives the particle the
//! momentum `m Δx / Δt`. The meter sums up these impulses over the substeps of a frame, with the opposite sign, and the
//! force is their sum over the time of the frame. Nothing is fitted or estimated afterwards: the momentum of a body
//! changes by gravity minus these forces, to rounding.
//!
//! A collider and a spring move their particles themselves, so their impulses are there to be summed up. A particle
//! that is fixed or rigidly attached is moved by no constraint. Its constraints offer it an impulse all the same,
//! `∇C Δλ`, which the solver drops because the inverse mass is 0. While forces are measured, these refused impulses are
//! kept per particle: they are what the holder feels, together with the weight of the held particle and minus the
//! change of its momentum.
//!
//! VBD has no impulses but forces: those at the end of each substep are taken for all of it, from the same balance.
//! They are as accurate as the substep has converged. With BDF2 the momentum follows them only over several substeps.
//!
//! Source: Newton's second law; impulses of XPBD after Macklin, Müller, Chentanez 2016. Cost while measuring: a look at
//! the held corners of each tet, a pass over the held particles and the attachments a substep, and for VBD a pass over
//! the tets a substep on one thread. Nothing otherwise.

use glam::DVec3;

use crate::constraints::Constraints;
use crate::force::Force;
use crate::particles::{Particles, number};
use crate::{Float, StepSettings};

/// The mean forces of a frame, from the bodies on what holds them. See [`crate::Solver::measure_forces`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forces {
    /// On each handle, by number.
    pub handles: Vec<Force>,
    /// On each collider, in the order of the settings.
    pub colliders: Vec<Force>,
    /// On each solid blade, in the order in which they were set.
    pub blades: Vec<Force>,
    /// On each fixed particle in N, ascending by particle. Each acts where its particle is.
    pub fixed: Vec<(u32, DVec3)>,
}

/// A particle that forces do not move.
#[derive(Clone, Copy, Debug)]
struct Held {
    particle: u32,
    /// The handle that it is rigidly attached to; `None` if it is fixed.
    handle: Option<u32>,
    /// Velocity in m/s before the substep.
    before: DVec3,
    /// The impulse on what fixes it in N·s.
    impulse: DVec3,
}

/// Sums up the impulses of a frame.
#[derive(Debug, Default)]
pub(crate) struct ForceMeter {
    /// In N·s.
    handles: Vec<Force>,
    /// In N·s.
    colliders: Vec<Force>,
    /// In N·s.
    blades: Vec<Force>,
    held: Vec<Held>,
    frame_time: f64,
}

impl ForceMeter {
    /// Whether a frame has been measured.
    pub(crate) fn has_frame(&self) -> bool {
        self.frame_time > 0.0
    }

    /// Begins a frame: finds the particles that are held.
    pub(crate) fn start<R: Float>(
        &mut self,
        particles: &Particles<R>,
        constraints: &Constraints<R>,
        settings: &StepSettings,
    ) {
        let attachments = &constraints.attachments;
        let counts = [
            attachments.handle_count(),
            settings.colliders.len(),
            constraints.blades.count(),
        ];
        let lists = [&mut self.handles, &mut self.colliders, &mut self.blades];
        for (list, count) in lists.into_iter().zip(counts) {
            list.clear();
            list.resize(count, Force::default());
        }
        self.frame_time = settings.time_step;
        self.held.clear();
        for p in 0..particles.len() {
            let handle = if particles.fixed[p] {
                None
            } else {
                match attachments.get(p) {
                    Some(attachment) if attachment.compliance == 0.0 => Some(attachment.handle),
                    _ => continue,
                }
            };
            self.held.push(Held {
                particle: number(p),
                handle,
                before: DVec3::ZERO,
                impulse: DVec3::ZERO,
            });
        }
    }

    /// Begins a substep.
    pub(crate) fn begin<R: Float>(&mut self, particles: &Particles<R>) {
        for held in &mut self.held {
            held.before = R::to_dvec3(particles.velocities[held.particle as usize]);
        }
    }

    /// Adds an impulse in N·s on the holder of the held particle at a place of the list.
    fn add_held<R: Float>(&mut self, index: usize, impulse: DVec3, particles: &Particles<R>) {
        let held = &mut self.held[index];
        match held.handle {
            None => held.impulse += impulse,
            Some(handle) => {
                let at = particles.position(held.particle as usize);
                self.handles[handle as usize].add(impulse, at);
            }
        }
    }

    /// Adds what the particles that are held were refused since the last time, which is an impulse in N·s times
    /// `1 / factor`.
    pub(crate) fn take_refused<R: Float>(&mut self, particles: &Particles<R>, factor: f64) {
        for index in 0..self.held.len() {
            let cell = &particles.refused[self.held[index].particle as usize];
            let [x, y, z, _] = R::read(cell);
            R::write(cell, [R::ZERO; 4]);
            let impulse = R::to_dvec3(R::vector(x, y, z)) * factor;
            self.add_held(index, impulse, particles);
        }
    }

    /// Adds the impulses of springs, blades and colliders of a substep of XPBD.
    pub(crate) fn take_moved<R: Float>(
        &mut self,
        particles: &Particles<R>,
        constraints: &mut Constraints<R>,
        per_time: f64,
    ) {
        for (handle, impulse, target) in constraints.attachments.pulls() {
            self.add_handle(handle, impulse * -per_time, particles.origin + target);
        }
        constraints.blades.take_pushes(&mut self.blades, per_time);
        constraints
            .colliders
            .take_pushes(&mut self.colliders, per_time);
    }

    /// Adds an impulse in N·s on a handle.
    pub(crate) fn add_handle(&mut self, handle: u32, impulse: DVec3, at: DVec3) {
        self.handles[handle as usize].add(impulse, at);
    }

    /// Adds an impulse in N·s on a collider.
    pub(crate) fn add_collider(&mut self, collider: usize, impulse: DVec3, at: DVec3) {
        self.colliders[collider].add(impulse, at);
    }

    /// Adds the force in N of the constraints on each held particle over a substep.
    pub(crate) fn add_forces<R: Float>(
        &mut self,
        particles: &Particles<R>,
        forces: &[DVec3],
        time: f64,
    ) {
        for index in 0..self.held.len() {
            let force = forces[self.held[index].particle as usize];
            self.add_held(index, force * time, particles);
        }
    }

    /// Ends a substep: adds the weight of what is held and takes off the change of its momentum.
    pub(crate) fn end<R: Float>(
        &mut self,
        particles: &Particles<R>,
        gravity: Option<DVec3>,
        time: f64,
    ) {
        let fall = gravity.unwrap_or(DVec3::ZERO) * time;
        for index in 0..self.held.len() {
            let held = &self.held[index];
            let p = held.particle as usize;
            let change = R::to_dvec3(particles.velocities[p]) - held.before;
            let impulse = (fall - change) * particles.masses[p];
            self.add_held(index, impulse, particles);
        }
    }

    /// The mean forces of the frame.
    pub(crate) fn forces(&self) -> Forces {
        let per_time = 1.0 / self.frame_time;
        let mean = |impulses: &[Force]| impulses.iter().map(|i| i.scaled(per_time)).collect();
        let fixed = self.held.iter().filter(|held| held.handle.is_none());
        Forces {
            handles: mean(&self.handles),
            colliders: mean(&self.colliders),
            blades: mean(&self.blades),
            fixed: fixed
                .map(|held| (held.particle, held.impulse * per_time))
                .collect(),
        }
    }
}
