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
//! VBD has no impulses but forces: those at the end of each substep are taken for all of it, from the same balance. They
//! are right as far as the substep has converged. With BDF2 the momentum follows them only over several substeps.
//!
//! Source: Newton's second law; impulses of XPBD after Macklin, Müller, Chentanez 2016. Cost while measuring: a look at
//! the held corners of each tet, a pass over the held particles and the attachments a substep, and for VBD a pass over
//! the tets a substep on one thread. Nothing otherwise.

use glam::DVec3;

use crate::constraints::{Attachments, Colliders};
use crate::particles::{Particles, number};
use crate::{Float, Solver};

/// A force and its torque about the origin of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Force {
    /// The force in N.
    pub force: DVec3,
    /// The torque about the origin of the world in N·m.
    pub torque: DVec3,
}

impl Force {
    /// Returns the torque about another point in N·m.
    ///
    /// ```
    /// use glam::DVec3;
    /// use incise_xpbd::Force;
    ///
    /// // 2 N upwards at x = 3 m turn nothing about that point.
    /// let force = Force { force: DVec3::Z * 2.0, torque: DVec3::Y * -6.0 };
    /// assert_eq!(force.torque_about(DVec3::X * 3.0), DVec3::ZERO);
    /// ```
    #[must_use]
    pub fn torque_about(&self, point: DVec3) -> DVec3 {
        self.torque - point.cross(self.force)
    }

    /// Adds a force that acts at a point.
    pub(crate) fn add(&mut self, force: DVec3, at: DVec3) {
        self.force += force;
        self.torque += at.cross(force);
    }

    fn scaled(&self, factor: f64) -> Self {
        Self {
            force: self.force * factor,
            torque: self.torque * factor,
        }
    }
}

/// The mean forces of a frame, from the bodies on what holds them. See [`Solver::measure_forces`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forces {
    /// On each handle, by number.
    pub handles: Vec<Force>,
    /// On each collider, in the order of the settings.
    pub colliders: Vec<Force>,
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
    held: Vec<Held>,
    frame_time: f64,
}

impl ForceMeter {
    /// Begins a frame: finds the particles that are held.
    pub(crate) fn start<R: Float>(
        &mut self,
        particles: &Particles<R>,
        attachments: &Attachments<R>,
        colliders: usize,
        frame_time: f64,
    ) {
        self.frame_time = frame_time;
        self.handles.clear();
        self.handles
            .resize(attachments.handle_count(), Force::default());
        self.colliders.clear();
        self.colliders.resize(colliders, Force::default());
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

    /// Adds the impulses of springs and colliders of a substep of XPBD.
    pub(crate) fn take_moved<R: Float>(
        &mut self,
        particles: &Particles<R>,
        attachments: &Attachments<R>,
        colliders: &mut Colliders<R>,
        per_time: f64,
    ) {
        for (handle, impulse, target) in attachments.pulls() {
            self.add_handle(handle, impulse * -per_time, particles.origin + target);
        }
        colliders.take_pushes(&mut self.colliders, per_time);
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
    fn forces(&self) -> Forces {
        let per_time = 1.0 / self.frame_time;
        let mean = |impulses: &[Force]| impulses.iter().map(|i| i.scaled(per_time)).collect();
        let fixed = self.held.iter().filter(|held| held.handle.is_none());
        Forces {
            handles: mean(&self.handles),
            colliders: mean(&self.colliders),
            fixed: fixed
                .map(|held| (held.particle, held.impulse * per_time))
                .collect(),
        }
    }
}

impl<R: Float> Solver<R> {
    /// Measures forces in the frames to come, or ends that. A measured frame has the bits of any other. A solver that
    /// does not measure has neither memory nor a pass for it. A clone does not measure.
    ///
    /// # Example
    /// A particle of 2 kg hangs from a handle.
    /// ```
    /// use glam::{DVec3, dvec3};
    /// use incise_graph::Schedule;
    /// use incise_xpbd::{Pose, Solver, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    /// solver.set_mass(0, 2.0);
    /// let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    /// solver.attach(0, handle, 0.0, 0.0)?;
    /// solver.measure_forces(true);
    /// let gravity = Some(dvec3(0.0, 0.0, -9.81));
    /// solver.step(&Schedule::default(), &StepSettings { gravity, ..StepSettings::new(0.016) })?;
    /// let forces = solver.forces().expect("they are measured");
    /// assert!((forces.handles[0].force.z + 2.0 * 9.81).abs() < 1e-12);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn measure_forces(&mut self, measuring: bool) {
        if !measuring {
            self.stepper.meter = None;
        } else if self.stepper.meter.is_none() {
            self.stepper.meter = Some(Box::default());
        }
    }

    /// Returns the mean forces of the last frame, from the bodies on handles, colliders and fixed particles; `None`
    /// unless [`Solver::measure_forces`] was on and a frame has been made since. In a frame of several parts they are
    /// complete after the last part. O(handles + colliders + fixed particles).
    ///
    /// With XPBD the sum of all of them, together with those of contacts, is exactly what changes the momentum of the
    /// bodies beside gravity. With VBD it is so up to the residual of its substeps. Chebyshev's extrapolation moves
    /// particles by no force; its frames are refused while forces are measured.
    #[must_use]
    pub fn forces(&self) -> Option<Forces> {
        let meter = self.stepper.meter.as_ref()?;
        (meter.frame_time > 0.0).then(|| meter.forces())
    }
}
