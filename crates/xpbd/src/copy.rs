//! Copies of a [`Solver`], to come back to, and what they weigh.
//!
//! A copy has all that decides what the next steps compute, to the bit: particles, tets, materials, what is held, the
//! other constraints, what was kept for residuals. It leaves out what a step makes anew by itself: the layout, which is
//! the largest part and follows from tets and schedule, and lists of work. Cost: a pass over particles and tets; the
//! first step of a copy lays the tets out, O(tets).

use crate::layout::Layout;
use crate::{Float, Solver};

/// A copy that goes on as the original would, to the bit. Nobody follows its changes yet: see
/// [`Solver::track_changes`].
///
/// ```
/// use glam::DVec3;
/// use incise_graph::Schedule;
/// use incise_xpbd::{Solver, StepSettings};
///
/// let mut solver = Solver::<f32>::new(&[DVec3::ZERO]);
/// solver.set_mass(0, 1.0);
/// let before = solver.clone();
/// let falling = StepSettings { gravity: Some(DVec3::NEG_Z), ..StepSettings::new(0.1) };
/// solver.step(&Schedule::default(), &falling)?;
/// assert!(solver.position(0).z < 0.0 && before.position(0).z == 0.0);
/// # Ok::<(), incise_xpbd::XpbdError>(())
/// ```
impl<R: Float> Clone for Solver<R> {
    fn clone(&self) -> Self {
        Self {
            origin: self.origin,
            size: self.size,
            particles: self
                .particles
                .iter()
                .map(|particle| R::particle(R::read(particle)))
                .collect(),
            previous: self.previous.clone(),
            velocities: self.velocities.clone(),
            masses: self.masses.clone(),
            fixed: self.fixed.clone(),
            tets: self.tets.clone(),
            volumes: self.volumes.clone(),
            material_of: self.material_of.clone(),
            materials: self.materials.clone(),
            kappa_limit: self.kappa_limit,
            changes: None,
            layout: Layout::default(),
            level: self.level,
            multipliers: Vec::new(),
            kept: self.kept.clone(),
            kept_form: self.kept_form,
            shared_velocities: Vec::new(),
            jacobi: None,
            obstacles: Vec::new(),
            predicted: self.predicted.clone(),
            attachments: self.attachments.clone(),
            distances: self.distances.clone(),
            volume_constraints: self.volume_constraints.clone(),
        }
    }
}

impl<R: Float> Solver<R> {
    /// Bytes of the arrays that a copy has: those of particles, tets, attachments and other constraints, without their
    /// schedules. O(1).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let of_particles = size_of_val(&*self.particles)
            + size_of_val(&*self.previous)
            + size_of_val(&*self.velocities)
            + size_of_val(&*self.masses)
            + size_of_val(&*self.fixed);
        let of_tets = size_of_val(&*self.tets)
            + size_of_val(&*self.volumes)
            + size_of_val(&*self.material_of);
        let of_last_substep = size_of_val(&*self.kept) + size_of_val(&*self.predicted);
        let distances = self.distances.as_ref();
        let volumes = self.volume_constraints.as_ref();
        of_particles
            + of_tets
            + of_last_substep
            + self.attachments.bytes()
            + distances.map_or(0, |distances| size_of_val(&*distances.list))
            + volumes.map_or(0, |volumes| size_of_val(&*volumes.list))
    }
}
