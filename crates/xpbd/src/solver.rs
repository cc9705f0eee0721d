//! [`Solver`]: the particles and tet constraints of a simulation, and how a cut edits them.
//!
//! Constraints keep the numbers of the mesh's tets; the order of solving is a [`Schedule`]'s business and comes from
//! outside with every step. Topology changes arrive as single edits (a new particle between two others, a copy, a tet
//! replaced), each in constant time, and mark what the next step has to look at, so that a cut costs what it touches.

use fearless_simd::Level;
use glam::DVec3;

use crate::attachment::Attachments;
use crate::collider::Obstacle;
use crate::distance::Distance;
use crate::float::{finite, load, store, weight};
use crate::jacobi::Jacobi;
use crate::layout::Layout;
use crate::neo_hookean::TetConstraint;
use crate::origin::frame_of;
use crate::scalar::Constraints;
use crate::volume::TetVolume;
use crate::{Changes, Float, KappaLimit, Material, TetSolve, XpbdError};

/// The state of a simulation in one precision.
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
pub struct Solver<R: Float> {
    /// What positions are relative to.
    pub(crate) origin: DVec3,
    /// The longest side of the bounding box at the start in m.
    pub(crate) size: f64,
    /// Position and inverse mass of each particle, together in one cache line part.
    pub(crate) particles: Vec<R::Particle>,
    pub(crate) previous: Vec<R::Vector>,
    pub(crate) velocities: Vec<R::Vector>,
    pub(crate) masses: Vec<f64>,
    pub(crate) fixed: Vec<bool>,
    pub(crate) tets: Vec<TetConstraint<R>>,
    /// Volumes at rest in m³.
    pub(crate) volumes: Vec<f64>,
    pub(crate) material_of: Vec<u16>,
    pub(crate) materials: Vec<Material>,
    pub(crate) kappa_limit: Option<KappaLimit>,
    /// What edits have changed, if somebody follows.
    pub(crate) changes: Option<Changes>,
    /// The tets in solving order.
    pub(crate) layout: Layout<R>,
    /// The instructions that this processor has.
    pub(crate) level: Level,
    /// By place in the layout; only while a step has more than one iteration or is asked for its residuals.
    pub(crate) multipliers: Vec<R::Atomic>,
    /// The multipliers of each tet after the last substep, for residuals, and the constraints that they belong to.
    pub(crate) kept: Vec<[R; 2]>,
    pub(crate) kept_form: TetSolve,
    /// Copies of the velocities that threads may share, while some material is damped.
    pub(crate) shared_velocities: Vec<R::Particle>,
    pub(crate) jacobi: Option<Jacobi<R>>,
    /// The colliders of the present substep.
    pub(crate) obstacles: Vec<Obstacle<R>>,
    /// Positions before the constraints are solved, kept only for residuals.
    pub(crate) predicted: Vec<R::Vector>,
    pub(crate) attachments: Attachments<R>,
    pub(crate) distances: Option<Constraints<R, Distance<R>>>,
    pub(crate) volume_constraints: Option<Constraints<R, TetVolume<R>>>,
}

impl<R: Float> Solver<R> {
    /// Particles at rest at `positions`, without mass and without constraints.
    ///
    /// Positions are kept relative to [`Solver::origin`], which is chosen from them: the precision is that of a body at
    /// the origin of the world.
    ///
    /// # Panics
    /// If a position is not finite in this precision.
    #[must_use]
    pub fn new(positions: &[DVec3]) -> Self {
        let (origin, size) = frame_of(positions);
        let mut solver = Self {
            origin,
            size,
            particles: Vec::new(),
            previous: Vec::new(),
            velocities: Vec::new(),
            masses: Vec::new(),
            fixed: Vec::new(),
            tets: Vec::new(),
            volumes: Vec::new(),
            kappa_limit: None,
            changes: None,
            material_of: Vec::new(),
            materials: Vec::new(),
            layout: Layout::default(),
            level: Level::new(),
            multipliers: Vec::new(),
            kept: Vec::new(),
            kept_form: TetSolve::default(),
            shared_velocities: Vec::new(),
            jacobi: None,
            obstacles: Vec::new(),
            predicted: Vec::new(),
            attachments: Attachments::default(),
            distances: None,
            volume_constraints: None,
        };
        for &x in positions {
            solver.push_particle(R::from_dvec3(x - origin), R::Vector::default(), false);
        }
        solver
    }

    /// Number of particles.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.particles.len()
    }

    /// Number of tets.
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
        self.materials.push(material);
        self.layout.forget();
        self.note(|changes| changes.all_tets = true);
        Ok(u16::try_from(self.materials.len() - 1).expect("at most 65,536 materials"))
    }

    /// Appends a tet with its rest shape. Its mass is not added to the particles: see [`Solver::set_mass`].
    ///
    /// # Panics
    /// If a particle or the material does not exist.
    pub fn push_tet(&mut self, particles: [u32; 4], rest: [DVec3; 4], material: u16) {
        let constraint = self.constraint(particles, rest, material);
        self.tets.push(constraint);
        self.volumes.push(signed_volume(rest));
        self.material_of.push(material);
        self.note_tet(self.tets.len() - 1);
    }

    /// Gives a tet's place to another tet of the same material.
    ///
    /// # Panics
    /// If the tet or a particle does not exist.
    pub fn replace_tet(&mut self, tet: usize, particles: [u32; 4], rest: [DVec3; 4]) {
        self.tets[tet] = self.constraint(particles, rest, self.material_of[tet]);
        self.volumes[tet] = signed_volume(rest);
        self.note_tet(tet);
    }

    /// Hangs a tet on other particles that are copies of its own.
    ///
    /// # Panics
    /// If the tet or a particle does not exist.
    pub fn relink_tet(&mut self, tet: usize, particles: [u32; 4]) {
        self.check_particles(particles);
        self.tets[tet].particles = particles;
        self.note_tet(tet);
    }

    /// Gives a tet's place to another one, with its material; the other one stays where it is, to be taken away by
    /// [`Solver::truncate_tets`] or replaced. O(1).
    ///
    /// # Panics
    /// If one of them does not exist.
    pub fn move_tet(&mut self, from: usize, to: usize) {
        self.tets[to] = self.tets[from];
        self.volumes[to] = self.volumes[from];
        self.material_of[to] = self.material_of[from];
        self.note_tet(to);
    }

    /// Takes the last tets away until there are `count`; nothing happens if there are no more. Schedules must not name
    /// them any more. O(tets taken away).
    ///
    /// # Example
    /// Tets are kept dense: the last one takes the place of one that is deleted.
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
        self.volumes.truncate(count);
        self.material_of.truncate(count);
    }

    /// Takes the last particles away until there are `count`, with what attaches them; nothing happens if there are no
    /// more. No tet and no constraint may hang on them when the next step begins. O(particles taken away).
    pub fn truncate_particles(&mut self, count: usize) {
        self.particles.truncate(count);
        self.previous.truncate(count);
        self.velocities.truncate(count);
        self.masses.truncate(count);
        self.fixed.truncate(count);
        self.attachments.truncate(count);
        self.note(|changes| changes.attachments = true);
    }

    fn constraint(&self, particles: [u32; 4], rest: [DVec3; 4], material: u16) -> TetConstraint<R> {
        self.check_particles(particles);
        let material = &self.materials[usize::from(material)];
        let mut tet = TetConstraint::new(particles, rest, material);
        if let Some(limit) = self.kappa_limit {
            let kappa = tet.kappa(material, limit.substep_time);
            if kappa > limit.kappa {
                tet.soften(kappa / limit.kappa);
            }
        }
        tet
    }

    pub(crate) fn check_particles(&self, particles: [u32; 4]) {
        let exists = |&p: &u32| (p as usize) < self.particles.len();
        assert!(particles.iter().all(exists), "the particles of a tet exist");
    }

    /// Whether the solver computes in single precision.
    #[must_use]
    pub fn is_single(&self) -> bool {
        size_of::<R>() == size_of::<f32>()
    }

    /// The materials, by number.
    #[must_use]
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The material of a number.
    ///
    /// # Panics
    /// If the material does not exist.
    #[must_use]
    pub fn material(&self, material: u16) -> &Material {
        &self.materials[usize::from(material)]
    }

    /// The material of a tet.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn material_of(&self, tet: usize) -> u16 {
        self.material_of[tet]
    }

    /// The mass density at rest of a tet's material in kg/m³.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn density_of(&self, tet: usize) -> f64 {
        self.materials[usize::from(self.material_of[tet])].density
    }

    /// The particles of a tet.
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn tet_particles(&self, tet: usize) -> [u32; 4] {
        self.tets[tet].particles
    }

    /// Appends a particle on the edge from `a` to `b`: position and velocity are interpolated, and it is fixed if both
    /// ends are, attached if both are attached to the same handle. It has no mass yet.
    ///
    /// # Panics
    /// If an end does not exist or the parameter puts the particle nowhere finite.
    pub fn push_particle_between(&mut self, a: usize, b: usize, parameter: f64) {
        let t = R::from_f64(parameter);
        let [x, y] = [a, b].map(|p| self.vector(p));
        let [u, v] = [self.velocities[a], self.velocities[b]];
        self.push_particle(
            x + (y - x) * t,
            u + (v - u) * t,
            self.fixed[a] && self.fixed[b],
        );
        let last = self.particles.len() - 1;
        self.attachments.between([a, b], parameter, last);
        self.note(|changes| changes.attachments = true);
    }

    /// Appends a particle in the state of another one, attached to what that is attached to. It has no mass yet.
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn push_copy(&mut self, of: usize) {
        self.push_particle(self.vector(of), self.velocities[of], self.fixed[of]);
        let last = self.particles.len() - 1;
        self.attachments.copy(of, last);
        self.note(|changes| changes.attachments = true);
    }

    fn push_particle(&mut self, x: R::Vector, velocity: R::Vector, fixed: bool) {
        assert!(finite::<R>(x), "positions are finite");
        let [a, b, c] = R::components(x);
        self.particles.push(R::particle([a, b, c, R::ZERO]));
        self.previous.push(x);
        self.velocities.push(velocity);
        self.masses.push(0.0);
        self.fixed.push(fixed);
        self.note_particle(self.masses.len() - 1);
    }

    /// Sets the mass of a particle in kg. A particle without mass does not move. As it is not known which tets have the
    /// particle, the next step goes through all: see [`Solver::set_mass_in_star`].
    ///
    /// # Panics
    /// If the particle does not exist or the mass is negative or not finite.
    pub fn set_mass(&mut self, particle: usize, mass: f64) {
        self.put_mass(particle, mass);
        self.set_weight(particle);
    }

    /// The same where the star of the particle is known, the tets that it is a corner of, so that the next step has to
    /// look at no others. Tets named without need do no harm; one that is left out is solved with the old mass, which
    /// [`Solver::check_layout`] finds. O(tets of the star).
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
        self.masses[particle] = mass;
    }

    /// Fixes a particle where it is, or lets it go.
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn set_fixed(&mut self, particle: usize, fixed: bool) {
        self.fixed[particle] = fixed;
        if fixed {
            self.velocities[particle] = R::Vector::default();
        }
        self.set_weight(particle);
    }

    /// Follows a change of mass or of what holds a particle.
    pub(crate) fn set_weight(&mut self, particle: usize) {
        if self.update_weight(particle) {
            self.layout.forget();
            self.note(|changes| changes.all_tets = true);
        }
    }

    /// Computes the inverse mass of a particle anew; returns whether it is another one.
    fn update_weight(&mut self, particle: usize) -> bool {
        self.note_particle(particle);
        let inverse = R::from_f64(1.0 / self.masses[particle]);
        // A mass so small that its inverse overflows belongs to a speck that could only do harm if it moved.
        let held = self.fixed[particle] || self.attachments.holds(particle);
        let free = !held && inverse.is_finite();
        let [x, y, z, before] = R::read(&self.particles[particle]);
        let weight = if free { inverse } else { R::ZERO };
        R::write(&self.particles[particle], [x, y, z, weight]);
        weight != before
    }

    /// Whether a particle is fixed.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn is_fixed(&self, particle: usize) -> bool {
        self.fixed[particle]
    }

    /// Whether forces move a particle: it is neither fixed nor rigidly attached, and has a mass.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn is_free(&self, particle: usize) -> bool {
        weight::<R>(&self.particles[particle]) > R::ZERO
    }

    /// The mass of a particle in kg.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn mass(&self, particle: usize) -> f64 {
        self.masses[particle]
    }

    /// The position of a particle in the world in m.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn position(&self, particle: usize) -> DVec3 {
        self.origin + self.local(particle)
    }

    /// The position of a particle relative to the origin.
    pub(crate) fn local(&self, particle: usize) -> DVec3 {
        R::to_dvec3(self.vector(particle))
    }

    /// Moves a particle to a position in the world in m.
    ///
    /// # Panics
    /// If the particle does not exist or the position is not finite in this precision.
    pub fn set_position(&mut self, particle: usize, position: DVec3) {
        let x = R::from_dvec3(position - self.origin);
        assert!(finite::<R>(x), "positions are finite");
        store::<R>(&self.particles[particle], x);
        self.note_particle(particle);
    }

    /// The velocity of a particle in m/s.
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn velocity(&self, particle: usize) -> DVec3 {
        R::to_dvec3(self.velocities[particle])
    }

    /// Sets the velocity of a particle in m/s.
    ///
    /// # Panics
    /// If the particle does not exist or the velocity is not finite in this precision.
    pub fn set_velocity(&mut self, particle: usize, velocity: DVec3) {
        let v = R::from_dvec3(velocity);
        assert!(finite::<R>(v), "velocities are finite");
        self.velocities[particle] = v;
        self.note_particle(particle);
    }

    /// Writes the positions of all particles in the world in m to `out`.
    pub fn positions(&self, out: &mut Vec<DVec3>) {
        out.clear();
        out.extend((0..self.particles.len()).map(|p| self.position(p)));
    }

    #[inline]
    pub(crate) fn vector(&self, particle: usize) -> R::Vector {
        load::<R>(&self.particles[particle])
    }
}

fn signed_volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}
