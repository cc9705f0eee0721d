//! [`Solver`]: owns the particles, tets and other constraints of a simulation, and applies the edits of a cut.
//!
//! Constraints keep the numbers of the mesh's tets; each step gets the order of solving as a [`Schedule`]. Topology
//! changes are single edits (a new particle on an edge, a copy, a replaced tet), each in constant time. They mark the
//! data that the next step must update, so the cost of a cut follows the cut.
//!
//! A clone has all data that decides the results of the next steps: particles, tets, materials, constraints, data for
//! residuals. It leaves out data that a step derives: the layout, which is the largest part, and working memory. The
//! first step of a clone rebuilds the layout, O(tets).

mod constraints;
mod forces;

use std::ops::Range;

use glam::DVec3;
use incise_graph::Schedule;

use crate::constraints::{ConstraintKind, Constraints};
use crate::degeneracy_jitter::jitter;
use crate::float::{finite, store};
use crate::floating_origin::{frame_of, recenter};
use crate::particles::{Particles, number};
use crate::stepper::Stepper;
use crate::tets::TetSet;
use crate::{Changes, Float, KappaLimit, Material, StepReport, StepSettings, XpbdError};

/// A solver with its state in one precision: particles, tets, materials, constraints.
///
/// # Example
/// A tet falls freely for one frame.
/// ```
/// use glam::DVec3;
/// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
/// use incise_xpbd::{Material, Solver, StepSettings};
///
/// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let material = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
/// let mut solver = Solver::<f64>::new(&rest);
/// solver.add_material(material)?;
/// solver.push_tet([0, 1, 2, 3], rest, 0);
/// for p in 0..4 {
///     solver.set_mass(p, 1000.0 / 6.0 / 4.0);
/// }
/// let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
/// let settings = StepSettings { gravity: Some(DVec3::NEG_Z), ..StepSettings::new(0.1) };
/// solver.step(&schedule, &settings)?;
/// assert!((solver.position(0).z + 0.01).abs() < 1e-12); // z = -g t², the closed form of one step
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct Solver<R: Float> {
    pub(crate) particles: Particles<R>,
    pub(crate) tets: TetSet<R>,
    pub(crate) constraints: Constraints<R>,
    pub(crate) stepper: Stepper<R>,
    /// What edits have changed, while changes are tracked.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) changes: Option<Changes>,
}

/// Makes a copy whose next steps are bit-identical to those of the original. The copy does not track changes: see
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
            particles: self.particles.clone(),
            tets: self.tets.clone(),
            constraints: self.constraints.clone(),
            stepper: self.stepper.clone(),
            changes: None,
        }
    }
}

impl<R: Float> Solver<R> {
    /// Creates a solver with particles at rest at `positions`, without mass and constraints.
    ///
    /// Positions are kept relative to [`Solver::origin`], which is chosen from them, so the precision does not depend
    /// on the distance from the origin of the world.
    ///
    /// # Panics
    /// If a position is not finite in this precision.
    #[must_use]
    pub fn new(positions: &[DVec3]) -> Self {
        let (origin, size) = frame_of(positions);
        let mut solver = Self {
            particles: Particles::new(origin, size),
            tets: TetSet::default(),
            constraints: Constraints::default(),
            stepper: Stepper::default(),
            changes: None,
        };
        for &x in positions {
            solver
                .particles
                .push(R::from_dvec3(x - origin), R::Vector::default(), false);
        }
        solver
    }

    /// Returns a solver with the particles, tets, materials and handles of this one and then those of another one, whose
    /// numbers follow. Positions, velocities, masses and attachments are kept; single precision rounds the positions
    /// once, since their origin is chosen again. Distances, volumes, contacts, the limit of kappa of the other one and
    /// residuals are left out. O(both).
    ///
    /// # Panics
    /// If both have more than 65,536 materials.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_xpbd::Solver;
    ///
    /// let mut one = Solver::<f64>::new(&[DVec3::ZERO]);
    /// let mut other = Solver::<f64>::new(&[DVec3::X, DVec3::Y]);
    /// one.set_mass(0, 1.0);
    /// other.set_velocity(1, DVec3::Z);
    /// let both = one.joined_with(&other);
    /// assert_eq!(both.particle_count(), 3);
    /// assert_eq!((both.position(2), both.velocity(2)), (DVec3::Y, DVec3::Z));
    /// ```
    #[must_use]
    pub fn joined_with(&self, other: &Self) -> Self {
        let (mut all, mut of_other) = (Vec::new(), Vec::new());
        self.positions(&mut all);
        other.positions(&mut of_other);
        all.append(&mut of_other);
        let (origin, size) = frame_of(&all);
        let mut particles = Particles::new(origin, size);
        for from in [&self.particles, &other.particles] {
            let shift = from.origin - origin;
            for p in 0..from.len() {
                let x = R::from_dvec3(from.local(p) + shift);
                let added = particles.push(x, from.velocities[p], from.fixed[p]);
                let [a, b, c] = R::components(x);
                particles.cells[added] = R::particle([a, b, c, from.weight(p)]);
                particles.masses[added] = from.masses[p];
            }
        }
        let mut tets = self.tets.clone();
        let first = number(self.particles.len());
        let first_material = u16::try_from(tets.materials.len());
        let material = |m: &u16| {
            let number = first_material.ok().and_then(|first| first.checked_add(*m));
            number.expect("at most 65,536 materials")
        };
        tets.materials.extend(&other.tets.materials);
        tets.material_of
            .extend(other.tets.material_of.iter().map(material));
        tets.rest_volumes.extend(&other.tets.rest_volumes);
        tets.list.extend(other.tets.list.iter().map(|tet| {
            let mut tet = *tet;
            tet.particles = tet.particles.map(|p| first + p);
            tet
        }));
        let mut constraints = Constraints::default();
        for (from, first) in [(self, 0), (other, first)] {
            let mut attachments = from.constraints.attachments.clone();
            attachments.shift(R::from_dvec3(origin - from.particles.origin));
            constraints.attachments.append_all(&attachments, first);
        }
        Self {
            particles,
            tets,
            constraints,
            stepper: Stepper::default(),
            changes: None,
        }
    }

    /// Returns the number of particles.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.particles.len()
    }

    /// Returns the number of tets.
    #[must_use]
    pub fn tet_count(&self) -> usize {
        self.tets.len()
    }

    /// Adds a material and returns its number.
    ///
    /// # Errors
    /// If the material does not pass [`Material::check`].
    ///
    /// # Panics
    /// With more than 65,536 materials.
    pub fn add_material(&mut self, material: Material) -> Result<u16, XpbdError> {
        material.check()?;
        self.tets.materials.push(material);
        self.tets.layout.forget();
        self.note(|changes| changes.all_tets = true);
        Ok(u16::try_from(self.tets.materials.len() - 1).expect("at most 65,536 materials"))
    }

    /// Appends a tet with its rest shape. Its mass is not added to the particles: see [`Solver::set_mass`].
    ///
    /// # Panics
    /// If a particle or the material does not exist.
    pub fn push_tet(&mut self, particles: [u32; 4], rest: [DVec3; 4], material: u16) {
        self.check_particles(particles);
        let tet = self.tets.push(particles, rest, material);
        self.note_tet(tet);
    }

    /// Replaces a tet by one of the same material.
    ///
    /// # Panics
    /// If the tet or a particle does not exist.
    pub fn replace_tet(&mut self, tet: usize, particles: [u32; 4], rest: [DVec3; 4]) {
        self.check_particles(particles);
        self.tets.replace(tet, particles, rest);
        self.note_tet(tet);
    }

    /// Replaces the particles of a tet by copies of them.
    ///
    /// # Panics
    /// If the tet or a particle does not exist.
    pub fn relink_tet(&mut self, tet: usize, particles: [u32; 4]) {
        self.check_particles(particles);
        self.tets.list[tet].particles = particles;
        self.note_tet(tet);
    }

    /// Copies a tet with its material over another one. The copied tet remains; remove it by [`Solver::truncate_tets`]
    /// or replace it. O(1).
    ///
    /// # Panics
    /// If one of the tets does not exist.
    pub fn move_tet(&mut self, from: usize, to: usize) {
        self.tets.copy_to(from, to);
        self.note_tet(to);
    }

    /// Removes the last tets until there are `count`; nothing happens if there are fewer. Schedules must not name the
    /// removed tets. O(tets removed).
    ///
    /// # Example
    /// Tets are kept dense: the last one moves to the index of a deleted one.
    /// ```
    /// # use glam::DVec3;
    /// # use incise_xpbd::{Material, Solver};
    /// # let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// # let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE]);
    /// # let rubber = Material { young_modulus: 1e4, poisson_ratio: 0.4, density: 1e3, damping: 0.0 };
    /// # solver.add_material(rubber)?;
    /// for tet in [[0, 1, 2, 3], [1, 4, 2, 3], [1, 4, 2, 3]] {
    ///     solver.push_tet(tet, rest, 0);
    /// }
    /// solver.move_tet(2, 0);
    /// solver.truncate_tets(2);
    /// assert_eq!((solver.tet_count(), solver.tet_particles(0)), (2, [1, 4, 2, 3]));
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn truncate_tets(&mut self, count: usize) {
        for tet in count..self.tets.len() {
            self.note_tet(tet);
        }
        self.tets.truncate(count);
    }

    /// Removes the last particles until there are `count`, with their attachments; nothing happens if there are fewer.
    /// Tets and other constraints must not use them when the next step begins. O(particles removed).
    pub fn truncate_particles(&mut self, count: usize) {
        self.particles.truncate(count);
        self.constraints.attachments.truncate(count);
        self.note(|changes| changes.attachments = true);
    }

    pub(crate) fn check_particles(&self, particles: [u32; 4]) {
        let exists = |&p: &u32| (p as usize) < self.particles.len();
        assert!(particles.iter().all(exists), "the particles of a tet exist");
    }

    /// Returns whether the solver computes in single precision.
    #[must_use]
    pub fn is_single(&self) -> bool {
        size_of::<R>() == size_of::<f32>()
    }

    /// Returns the materials by number.
    #[must_use]
    pub fn materials(&self) -> &[Material] {
        &self.tets.materials
    }

    /// Returns the material of a number.
    ///
    /// # Panics
    /// If the material does not exist.
    #[must_use]
    pub fn material(&self, material: u16) -> &Material {
        &self.tets.materials[usize::from(material)]
    }

    /// Returns the number of a tet's material.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn material_of(&self, tet: usize) -> u16 {
        self.tets.material_of[tet]
    }

    /// Returns the mass density at rest of a tet's material in kg/m³.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn density_of(&self, tet: usize) -> f64 {
        self.tets.material(tet).density
    }

    /// Returns the particles of a tet.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn tet_particles(&self, tet: usize) -> [u32; 4] {
        self.tets.list[tet].particles
    }

    /// Appends a particle on the edge from `a` to `b`, without mass. Position and velocity are interpolated. The
    /// particle is fixed if both ends are, and attached if both are attached to the same handle.
    ///
    /// # Panics
    /// If an end does not exist or the position is not finite.
    pub fn push_particle_between(&mut self, a: usize, b: usize, parameter: f64) {
        let t = R::from_f64(parameter);
        let Self {
            particles,
            constraints,
            ..
        } = self;
        let [x, y] = [a, b].map(|p| particles.vector(p));
        let [u, v] = [a, b].map(|p| particles.velocities[p]);
        let fixed = particles.fixed[a] && particles.fixed[b];
        let last = particles.push(x + (y - x) * t, u + (v - u) * t, fixed);
        constraints.attachments.between([a, b], parameter, last);
        self.note_particle(last);
        self.note(|changes| changes.attachments = true);
    }

    /// Appends a copy of a particle with its state and attachment, without mass.
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn push_copy(&mut self, of: usize) {
        let particles = &mut self.particles;
        let (x, velocity) = (particles.vector(of), particles.velocities[of]);
        let last = particles.push(x, velocity, particles.fixed[of]);
        self.constraints.attachments.copy(of, last);
        self.note_particle(last);
        self.note(|changes| changes.attachments = true);
    }

    /// Sets the mass of a particle in kg. A particle without mass does not move. The next step looks at all tets;
    /// [`Solver::set_mass_in_star`] avoids this.
    ///
    /// # Panics
    /// If the particle does not exist or the mass is negative or not finite.
    pub fn set_mass(&mut self, particle: usize, mass: f64) {
        self.put_mass(particle, mass);
        self.set_weight(particle);
    }

    /// Sets the mass of a particle in kg, given its star: the tets that it is a corner of. The next step then looks
    /// only at these tets. Additional tets do no harm; a missing one is solved with the old mass, which
    /// [`Solver::check_layout`] detects. O(tets of the star).
    ///
    /// # Panics
    /// If the particle does not exist or the mass is negative or not finite.
    pub fn set_mass_in_star(
        &mut self,
        particle: usize,
        mass: f64,
        star: impl IntoIterator<Item = usize>,
    ) {
        self.put_mass(particle, mass);
        if self.update_weight(particle) {
            star.into_iter().for_each(|tet| self.note_tet(tet));
        }
    }

    fn put_mass(&mut self, particle: usize, mass: f64) {
        assert!(
            mass.is_finite() && mass >= 0.0,
            "a mass is finite and not negative"
        );
        self.particles.masses[particle] = mass;
    }

    /// Fixes a particle at its position, or releases it.
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn set_fixed(&mut self, particle: usize, fixed: bool) {
        self.particles.fixed[particle] = fixed;
        if fixed {
            self.particles.velocities[particle] = R::Vector::default();
        }
        self.set_weight(particle);
    }

    /// Updates what depends on the mass of a particle and on what holds it.
    pub(crate) fn set_weight(&mut self, particle: usize) {
        if self.update_weight(particle) {
            self.tets.layout.forget();
            self.note(|changes| changes.all_tets = true);
        }
    }

    /// Recomputes the inverse mass of a particle; returns whether it has changed.
    fn update_weight(&mut self, particle: usize) -> bool {
        self.note_particle(particle);
        let attached = self.constraints.attachments.holds(particle);
        self.particles.update_weight(particle, attached)
    }

    /// Returns whether a particle is fixed.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn is_fixed(&self, particle: usize) -> bool {
        self.particles.fixed[particle]
    }

    /// Returns whether forces move a particle: it is neither fixed nor rigidly attached, and has a mass.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn is_free(&self, particle: usize) -> bool {
        self.particles.is_free(particle)
    }

    /// Returns the mass of a particle in kg.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn mass(&self, particle: usize) -> f64 {
        self.particles.masses[particle]
    }

    /// Returns the position of a particle in the world in m.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn position(&self, particle: usize) -> DVec3 {
        self.particles.position(particle)
    }

    /// Moves a particle to a position in the world in m.
    ///
    /// # Panics
    /// If the particle does not exist or the position is not finite in this precision.
    pub fn set_position(&mut self, particle: usize, position: DVec3) {
        let x = R::from_dvec3(position - self.particles.origin);
        assert!(finite::<R>(x), "positions are finite");
        store::<R>(&self.particles.cells[particle], x);
        self.note_particle(particle);
    }

    /// Returns the velocity of a particle in m/s.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn velocity(&self, particle: usize) -> DVec3 {
        R::to_dvec3(self.particles.velocities[particle])
    }

    /// Sets the velocity of a particle in m/s.
    ///
    /// # Panics
    /// If the particle does not exist or the velocity is not finite in this precision.
    pub fn set_velocity(&mut self, particle: usize, velocity: DVec3) {
        let v = R::from_dvec3(velocity);
        assert!(finite::<R>(v), "velocities are finite");
        self.particles.velocities[particle] = v;
        self.note_particle(particle);
    }

    /// Writes the positions of all particles in the world in m to `out`.
    pub fn positions(&self, out: &mut Vec<DVec3>) {
        out.clear();
        out.extend((0..self.particles.len()).map(|p| self.position(p)));
    }

    /// Writes the velocities of all particles in m/s to `out`.
    pub fn velocities(&self, out: &mut Vec<DVec3>) {
        out.clear();
        let velocities = self.particles.velocities.iter();
        out.extend(velocities.map(|&v| R::to_dvec3(v)));
    }

    /// Writes to `out` for each particle whether no force moves it: the opposite of [`Solver::is_free`].
    pub fn held(&self, out: &mut Vec<bool>) {
        out.clear();
        out.extend((0..self.particles.len()).map(|p| !self.is_free(p)));
    }

    /// Returns the point in m that positions are kept relative to, in the solver's precision. [`crate::Solver::step`]
    /// moves it when the body has moved by more than twice its size.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.particles.origin
    }

    /// Returns the bytes of the arrays of a clone: particles, tets, attachments and other constraints, without their
    /// schedules. O(1).
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.particles.bytes()
            + self.tets.bytes()
            + self.constraints.bytes()
            + self.stepper.last.bytes()
    }

    /// Notes a change while changes are tracked.
    pub(crate) fn note(&mut self, change: impl FnOnce(&mut Changes)) {
        if let Some(changes) = &mut self.changes {
            change(changes);
        }
    }

    /// Notes that the corners, the rest shape or the masses of a tet have changed.
    fn note_tet(&mut self, tet: usize) {
        self.tets.layout.touch(tet);
        self.note(|changes| changes.tets.push(number(tet)));
    }

    /// Notes that a particle is new or has another state or mass.
    fn note_particle(&mut self, particle: usize) {
        self.note(|changes| changes.particles.push(number(particle)));
    }

    /// Softens every new tet whose [`Solver::kappa`] at `substep_time` exceeds `kappa`, so that it equals the limit;
    /// `None` ends this.
    ///
    /// For the block and sequential forms: cuts leave tets too small for any affordable substep, which would collapse
    /// and move their neighbors. [`Solver::softened`] counts the softened tets.
    pub fn limit_kappa(&mut self, limit: Option<KappaLimit>) {
        self.tets.kappa_limit = limit;
    }

    /// Checks that the layout of the next step with this schedule agrees bit for bit with schedule, tets and masses.
    /// A step updates the layout only by changes; this check finds missing ones, in particular of
    /// [`Solver::set_mass_in_star`]. O(tets); for tests and on request.
    ///
    /// # Errors
    /// [`XpbdError::Layout`] with the first difference.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn check_layout(&self, schedule: &Schedule) -> Result<(), XpbdError> {
        let lanes = self.stepper.lanes();
        self.tets.check_layout(&self.particles, schedule, lanes)
    }

    /// Puts the tets into the order of a schedule, unless they are.
    pub(crate) fn update_layout(&mut self, schedule: &Schedule) {
        let lanes = self.stepper.lanes();
        self.tets.update_layout(&self.particles, schedule, lanes);
    }

    /// Gives a body that has moved on by more than twice its size a new origin.
    pub(crate) fn recenter(&mut self) {
        if let Some(shift) = recenter(&mut self.particles) {
            self.constraints.shift(shift);
        }
    }

    /// Prepares the state for a step of XPBD: a new origin for a body that has moved on, a little width for one on an
    /// exact line; returns how many particles the latter moved.
    pub(crate) fn prepare(&mut self) -> usize {
        self.recenter();
        jitter(&self.particles, &self.tets)
    }

    /// Some substeps of a frame of XPBD.
    pub(crate) fn frame(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<StepReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step").entered();
        self.check_step(settings, &part)?;
        self.update_layout(schedule);
        let jittered = if part.start == 0 { self.prepare() } else { 0 };
        let Self {
            particles,
            tets,
            constraints,
            stepper,
            ..
        } = self;
        let repaired = stepper.frame(particles, tets, constraints, settings, part, keep);
        Ok(StepReport { repaired, jittered })
    }

    /// Checks that some substeps of a frame with these settings can be made, as a step does first; for a device that
    /// solves on its own.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`], the part ends before it begins or beyond the frame, or the
    /// method does not solve what the solver has.
    pub fn check_step(&self, settings: &StepSettings, part: &Range<u32>) -> Result<(), XpbdError> {
        settings.check()?;
        if part.start > part.end || part.end > settings.substeps {
            return Err(XpbdError::Setting {
                what: "end of the part",
                value: f64::from(part.end),
                range: "at least its start and at most the substeps",
            });
        }
        if self.constraints.contacts.is_declared() {
            settings.method.check_contacts()?;
        }
        if self.stepper.meter.is_some() {
            settings.method.check_forces()?;
        }
        Ok(())
    }
}
