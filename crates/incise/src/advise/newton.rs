//! [`Newton`]: a scene solved by implicit Euler and Newton's method, if the reference supports its features.
//!
//! `incise-reference` supports tets, fixed particles and gravity. A rigid attachment becomes a moving fixed particle,
//! on the path of the solver within a frame. Strokes of frame 0 act before any motion, so the reference gets the body
//! after them. A distance constraint without length and compliance merges two particles. Everything else (obstacles,
//! damping, springs, later strokes) is an error.
//!
//! Source: `incise-reference`. Cost: some sparse factorizations a step.

use glam::DVec3;
use incise_reference::{Material, ReferenceBody, ReferenceError};
use incise_xpbd::Pose;

use super::motion::{Motion, volume};
use crate::distance::Distances;
use crate::island::Island;
use crate::{Error, Scene, Simulation};

/// A scene that the reference solver supports.
#[derive(Debug)]
pub(super) struct Newton {
    simulation: Simulation,
    parts: Vec<Part>,
    time_step: f64,
    gravity: DVec3,
    /// Number of particles before all cuts.
    particles: usize,
}

/// An island of bodies as a body of the reference solver.
#[derive(Debug)]
struct Part {
    mesh_at_rest: Vec<DVec3>,
    tets: Vec<[u32; 4]>,
    materials: Vec<Material>,
    fixed: Vec<bool>,
    /// Particle -> particle of the reference's body: the lower of two particles that a distance constraint merges.
    seat: Vec<u32>,
    /// Attached particles: attachment, particle, and its position in the attachment's frame.
    held: Vec<(usize, usize, DVec3)>,
}

/// Returns the first feature of a scene that the reference does not support, in words that complete "the scene has".
pub(super) fn obstacle(scene: &Scene) -> Option<&'static str> {
    let links = |f: fn(&crate::scene::DistanceSpec) -> bool| scene.distance.iter().any(f);
    let later = |stroke: &crate::scene::StrokeSpec| stroke.last_frame() > 0;
    [
        (scene.world.ground.is_some(), "a ground"),
        (!scene.collider.is_empty(), "colliders"),
        (scene.contact.is_some(), "contact"),
        (scene.stroke.iter().any(later), "strokes after frame 0"),
        (scene.body.iter().any(|b| b.damping > 0.0), "damping"),
        (
            scene.body.iter().any(|b| b.volume_compliance.is_some()),
            "volume constraints",
        ),
        (
            scene.attachment.iter().any(|h| h.compliance > 0.0),
            "soft handles",
        ),
        (
            links(|l| l.compliance > 0.0 || l.length.is_some_and(|l| l > 0.0)),
            "links that are not stitches of no length",
        ),
    ]
    .into_iter()
    .find_map(|(there, what)| there.then_some(what))
}

impl Newton {
    /// Prepares a scene without obstacles.
    pub(super) fn new(scene: &Scene) -> Result<Self, Error> {
        let mut scene = scene.clone();
        scene.solver = crate::scene::SolverSpec {
            time_step: scene.solver.time_step,
            precision: crate::scene::Precision::F64,
            ..crate::scene::SolverSpec::default()
        };
        let mut simulation = Simulation::with_threads(&scene, 1)?;
        let particles = simulation.positions().len();
        simulation.cut_now()?;
        let parts = simulation.islands().iter().map(Part::new);
        Ok(Self {
            parts: parts.collect::<Result<_, _>>()?,
            simulation,
            time_step: scene.solver.time_step,
            gravity: DVec3::from_array(scene.world.gravity.unwrap_or_default()),
            particles,
        })
    }

    /// The motion over some frames of `steps` steps each.
    pub(super) fn motion(&self, frames: u32, steps: u32) -> Result<Motion, ReferenceError> {
        let mesh = self.simulation.mesh();
        let mut motion = Motion::still(mesh, self.particles);
        let mut bodies = self
            .parts
            .iter()
            .map(Part::body)
            .collect::<Result<Vec<_>, _>>()?;
        let mut positions = mesh.positions.clone();
        for frame in 0..u64::from(frames) {
            let all = self
                .parts
                .iter()
                .zip(self.simulation.islands())
                .zip(&mut bodies);
            for (g, ((part, island), body)) in all.enumerate() {
                let poses: Vec<[Pose; 2]> = island
                    .constraints
                    .attachments
                    .iter()
                    .map(|attachment| [frame, frame + 1].map(|f| attachment.pose(f)))
                    .collect();
                for step in 1..=steps {
                    let fraction = f64::from(step) / f64::from(steps);
                    for &(handle, p, place) in &part.held {
                        let [from, to] = &poses[handle];
                        body.positions[part.seat[p] as usize] =
                            from.toward(to, fraction).apply(place);
                    }
                    body.step(self.time_step / f64::from(steps), self.gravity)?;
                }
                for (p, &seat) in part.seat.iter().enumerate() {
                    positions[self.simulation.particle(g, p)] = body.positions[seat as usize];
                }
            }
            motion.push(&positions[..self.particles], volume(mesh, &positions));
        }
        Ok(motion)
    }
}

impl Part {
    fn new(island: &Island) -> Result<Self, Error> {
        let mesh = island.cuttable.mesh();
        let count = mesh.positions.len();
        let solver = island.solver.host();
        let materials = (0..mesh.tets.len()).map(|t| {
            let material = &solver.materials()[usize::from(solver.material_of(t))];
            Material {
                young_modulus: material.young_modulus,
                poisson_ratio: material.poisson_ratio,
                density: material.density,
            }
        });
        let mut seat = seats(&island.constraints.distances, count);
        let mut at_rest = Vec::new();
        let mut fixed: Vec<bool> = Vec::new();
        let mut held = Vec::new();
        for p in 0..count {
            let root = seat[p] as usize;
            if root < p {
                seat[p] = seat[root];
            } else {
                seat[p] = u32::try_from(at_rest.len()).expect("no more than there are particles");
                at_rest.push(mesh.positions[p]);
                fixed.push(false);
            }
            let seat = seat[p] as usize;
            fixed[seat] |= solver.is_fixed(p);
            if let Some(number) = solver.handle_of(p).filter(|_| !solver.is_fixed(p)) {
                let attachments = &island.constraints.attachments;
                let handle = attachments.iter().position(|a| a.number == number);
                let handle = handle.expect("attachments of an island hold its particles");
                let pose = attachments[handle].pose(0);
                let place = pose.rotation.inverse() * (mesh.positions[p] - pose.position);
                fixed[seat] = true;
                held.push((handle, p, place));
            }
        }
        let corners = |tet: &[incise_mesh::ParticleId; 4]| tet.map(|p| seat[p.index()]);
        Ok(Self {
            tets: mesh.tets.iter().map(corners).collect(),
            materials: materials.collect(),
            mesh_at_rest: at_rest,
            fixed,
            held,
            seat,
        })
    }

    fn body(&self) -> Result<ReferenceBody, ReferenceError> {
        let mut body = ReferenceBody::new(&self.mesh_at_rest, &self.tets, |t| self.materials[t])?;
        body.fixed.clone_from(&self.fixed);
        Ok(body)
    }
}

/// Particle -> lowest particle that rigid distance constraints merge it with.
fn seats(distances: &Distances, particles: usize) -> Vec<u32> {
    let mut seat: Vec<u32> = (0..).take(particles).collect();
    // Lower numbers travel along the links until none moves: stitches make short chains.
    loop {
        let mut moved = false;
        for [a, b] in distances.ends() {
            let lowest = seat[a as usize].min(seat[b as usize]);
            for p in [a, b] {
                moved |= seat[p as usize] != lowest;
                seat[p as usize] = lowest;
            }
        }
        if !moved {
            return seat;
        }
    }
}
