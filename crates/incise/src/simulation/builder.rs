//! [`SimulationBuilder`]: a simulation from meshes in memory.
//!
//! A program with its own meshes needs no scene file: it adds bodies, obstacles, attachments and strokes. The builder
//! holds a [`Scene`] and the meshes in memory, so both ways give bit-identical simulations. Cost: that of the
//! simulation.

use glam::DVec3;
use incise_mesh::TetMesh;

use crate::attachment::AttachmentHandle;
use crate::collider::ColliderHandle;
use crate::compute_device::ComputeDevice;
use crate::device::OpenDevice;
use crate::distance::DistanceHandle;
use crate::scene::{
    AttachmentSpec, Backend, BodySpec, ColliderSpec, ContactSpec, CuttingSpec, DistanceSpec,
    GroundSpec, MaterialSpec, Region, ReportSpec, SolverSpec, StrokeSpec,
};
use crate::validate::value;
use crate::{Error, Scene, Simulation};

/// A body that is added to a [`SimulationBuilder`]: a mesh in memory, its material and its pinned particles.
///
/// Young's modulus is 1e5 Pa, Poisson's ratio 0.45, density 1000 kg/m³ and damping 0 unless they are set.
#[derive(Clone, Debug)]
pub struct Body {
    pub(super) mesh: TetMesh,
    pub(super) spec: BodySpec,
}

impl Body {
    /// A body whose shape at rest is a mesh in m. The mesh is checked when the simulation is built.
    #[must_use]
    pub fn new(mesh: TetMesh) -> Self {
        Self {
            mesh,
            spec: BodySpec::default(),
        }
    }

    /// Sets Young's modulus in Pa.
    #[must_use]
    pub fn young_modulus(mut self, young_modulus: f64) -> Self {
        self.spec.young_modulus = young_modulus;
        self
    }

    /// Sets Poisson's ratio, at least 0 and below 0.5.
    #[must_use]
    pub fn poisson_ratio(mut self, poisson_ratio: f64) -> Self {
        self.spec.poisson_ratio = poisson_ratio;
        self
    }

    /// Sets the mass density in kg/m³.
    #[must_use]
    pub fn density(mut self, density: f64) -> Self {
        self.spec.density = density;
        self
    }

    /// Sets the damping time in s: see [`Material::damping`](crate::xpbd::Material::damping).
    #[must_use]
    pub fn damping(mut self, damping: f64) -> Self {
        self.spec.damping = damping;
        self
    }

    /// Gives parts of the body another material, such as a tumor: tets by their centers or by their numbers
    /// ([`Region::Tets`]). Where parts overlap, the last one counts.
    #[must_use]
    pub fn material(mut self, part: MaterialSpec) -> Self {
        self.spec.material.push(part);
        self
    }

    /// Sets the position of the mesh's origin in m.
    #[must_use]
    pub fn position(mut self, position: DVec3) -> Self {
        self.spec.position = position.to_array();
        self
    }

    /// Sets the velocity at the start in m/s, of all particles that are not fixed.
    #[must_use]
    pub fn velocity(mut self, velocity: DVec3) -> Self {
        self.spec.velocity = velocity.to_array();
        self
    }

    /// Sets a factor on the coordinates of the mesh.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.spec.scale = scale;
        self
    }

    /// Pins the particles at whose position, in the coordinates of the mesh, the predicate holds: they do not move.
    #[must_use]
    pub fn pinned(self, is_pinned: impl Fn(DVec3) -> bool) -> Self {
        let positions = (0..).zip(&self.mesh.positions);
        let particles: Vec<u32> = positions
            .filter(|(_, x)| is_pinned(**x))
            .map(|(p, _)| p)
            .collect();
        self.pinned_particles(particles)
    }

    /// Pins particles by their indices in the mesh: they do not move.
    #[must_use]
    pub fn pinned_particles(mut self, particles: impl IntoIterator<Item = u32>) -> Self {
        let particles = Region::Particles(particles.into_iter().collect());
        self.spec.fixed.push(particles);
        self
    }

    /// Returns the body after a change of its keys in a scene, for those without a method of their own: regions of pinned
    /// particles in the world, substeps, compliance of the volume. The geometry stays that of the mesh: a body that names a
    /// file or a shape as well is an error when the simulation is built.
    ///
    /// ```
    /// use incise::meshing::{Shape, generate};
    /// use incise::scene::{Quantity, Region, ReportSpec};
    /// use incise::{Body, Simulation};
    ///
    /// let body = Body::new(generate(Shape::Beam, 300)?).with(|body| {
    ///     body.fixed.push(Region::half_space([-0.45, 0.0, 0.0], [-1.0, 0.0, 0.0]));
    ///     body.substeps = Some(7.into());
    /// });
    /// let mut builder = Simulation::builder();
    /// builder.add_body(body);
    /// builder.report(ReportSpec::default().with(|report| report.quantities = vec![Quantity::Kappa]));
    /// let mut simulation = builder.build()?;
    /// assert_eq!(simulation.step()?.bodies[0].substeps, 7);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut BodySpec)) -> Self {
        change(&mut self.spec);
        self
    }
}

/// The index of a body of a simulation, in the order in which bodies were added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle(pub(super) usize);

impl BodyHandle {
    /// Returns the index, which reports, attachments and distances use as `body`.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// Builder of a simulation from meshes in memory; see [`Simulation::builder`].
///
/// # Example
/// A soft bar that is fixed at one end and cut through.
/// ```
/// use incise::meshing::{Shape, generate};
/// use incise::mesh::glam::DVec3;
/// use incise::scene::StrokeSpec;
/// use incise::{Body, Simulation};
///
/// let bar = generate(Shape::Beam, 400)?; // or a `TetMesh` of your own
/// let mut builder = Simulation::builder();
/// builder.gravity(DVec3::new(0.0, 0.0, -9.81));
/// builder.add_body(Body::new(bar).young_modulus(2e5).pinned(|x| x.x < -0.4));
/// builder.add_stroke(StrokeSpec::plane(2, [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]));
/// let mut simulation = builder.build()?;
/// for _ in 0..4 {
///     simulation.step()?;
/// }
/// assert_eq!(simulation.report().pieces, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SimulationBuilder {
    scene: Scene,
    /// For each body of the scene its mesh, unless the scene names a file or a shape.
    meshes: Vec<Option<TetMesh>>,
    threads: Option<usize>,
    pub(super) device: OpenDevice,
}

impl SimulationBuilder {
    /// Starts from a scene: its bodies, if it has any, come before those that are added.
    #[must_use]
    pub fn from_scene(scene: Scene) -> Self {
        Self {
            meshes: vec![None; scene.body.len()],
            scene,
            ..Self::default()
        }
    }

    /// Sets the acceleration of gravity in m/s²; without it there is none.
    pub fn gravity(&mut self, gravity: DVec3) -> &mut Self {
        self.scene.world.gravity = Some(gravity.to_array());
        self
    }

    /// Adds a horizontal floor at a height in m, with a coefficient of friction.
    pub fn ground(&mut self, height: f64, friction: f64) -> &mut Self {
        self.scene.world.ground = Some(GroundSpec { height, friction });
        self
    }

    /// Enables contact between bodies, between their pieces, between the sides of cuts, and of a body with itself.
    pub fn contact(&mut self, contact: ContactSpec) -> &mut Self {
        self.scene.contact = Some(contact);
        self
    }

    /// Sets what all cuts have in common: crumbs, and improvement of the mesh where strokes cut what others have cut.
    pub fn cutting(&mut self, cutting: CuttingSpec) -> &mut Self {
        self.scene.cutting = cutting;
        self
    }

    /// Sets the solver settings. The defaults choose method, substeps and precision for an error of 10% of the motion.
    pub fn solver(&mut self, solver: SolverSpec) -> &mut Self {
        self.scene.solver = solver;
        self
    }

    /// Sets the quantities that frames report besides times and counts.
    pub fn report(&mut self, report: ReportSpec) -> &mut Self {
        self.scene.report = report;
        self
    }

    /// Computes on a number of threads of its own instead of rayon's global pool. The result is bit-identical for any
    /// number.
    pub fn threads(&mut self, threads: usize) -> &mut Self {
        self.threads = Some(threads);
        self
    }

    /// Adds a body. Its values are checked by [`SimulationBuilder::build`].
    pub fn add_body(&mut self, body: Body) -> BodyHandle {
        let handle = BodyHandle(self.scene.body.len());
        self.scene.body.push(body.spec);
        self.meshes.push(Some(body.mesh));
        handle
    }

    /// Adds an obstacle. [`Simulation::move_collider`] moves it.
    pub fn add_collider(&mut self, collider: ColliderSpec) -> ColliderHandle {
        let handle = ColliderHandle::of_scene(self.scene.collider.len());
        self.scene.collider.push(collider);
        handle
    }

    /// Adds an attachment: part of a body that is held and moved, by its path or by [`Simulation::move_attachment`].
    pub fn add_attachment(&mut self, attachment: AttachmentSpec) -> AttachmentHandle {
        let handle = AttachmentHandle::of_scene(self.scene.attachment.len());
        self.scene.attachment.push(attachment);
        handle
    }

    /// Adds a distance constraint between two bodies or parts of one, which [`Simulation::set_distance`] changes.
    pub fn add_distance(&mut self, distance: DistanceSpec) -> DistanceHandle {
        let handle = DistanceHandle::of_scene(self.scene.distance.len());
        self.scene.distance.push(distance);
        handle
    }

    /// Adds a stroke: a cut that is known beforehand. [`Simulation::cut`] adds strokes while the simulation runs.
    pub fn add_stroke(&mut self, stroke: StrokeSpec) -> &mut Self {
        self.scene.stroke.push(stroke);
        self
    }

    /// Builds the simulation.
    ///
    /// # Errors
    /// If there is no body, a value lies outside its range, a mesh is invalid or cannot be read, a pinned particle does
    /// not exist, the threads cannot be started, or the device does not support the settings.
    pub fn build(self) -> Result<Simulation, Error> {
        let mut scene = self.scene;
        if self.device.is_some() {
            scene.solver.backend = Backend::Gpu;
        }
        let pool = self.threads.map(thread_pool).transpose()?;
        let compute_device = ComputeDevice::choose(&scene, &self.device)?;
        Simulation::build(scene, &self.meshes, compute_device, pool)
    }
}

fn thread_pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    if threads == 0 {
        return Err(value("threads", threads, "at least 1"));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::Threads {
        threads,
        message: error.to_string(),
    })
}
