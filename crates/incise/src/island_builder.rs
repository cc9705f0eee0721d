//! [`IslandBuilder`]: the bodies of an island as one mesh, with attachments and distances in its numbers.
//!
//! Particles and tets are numbered body by body in the order of the scene. Attachments and distances, which a scene
//! gives by bodies and points, are translated here. Cost: O(particles + tets).

use std::ops::Range;

use glam::DVec3;
use incise_cutting::CuttableMesh;
use incise_mesh::{ParticleId, TetId, TetMesh};
use incise_xpbd::{ErasedSolver, Material};

use crate::accuracy::{DEFAULT_ACCURACY, largest_kappas};
use crate::attachment::{Attachment, AttachmentHandle};
use crate::backend::AnySolver;
use crate::distance::{DistanceHandle, Distances};
use crate::masses::Masses;
use crate::method::tet_solve;
use crate::resolved_body::ResolvedBody;
use crate::scene::{Precision, SolverSpec, Substeps};
use crate::substeps::{Choice, TetDemand, choose};
use crate::validate::{existing, value};
use crate::volume::Volumes;
use crate::{Error, Scene, distance};

/// Error message for too many materials.
pub(crate) const TOO_MANY: &str =
    "at most 65,536 bodies and parts of other materials that are solved together";

/// The bodies of an island before it is set up.
#[derive(Debug, Default)]
pub(crate) struct IslandBuilder {
    /// Their numbers in the scene, ascending.
    pub(crate) bodies: Vec<usize>,
    pub(crate) mesh: TetMesh,
    pub(crate) materials: Vec<Material>,
    /// For each material the index of its body in `bodies`.
    pub(crate) body_of: Vec<usize>,
    /// For each tet the number of its material.
    pub(crate) material_of: Vec<u16>,
    pub(crate) fixed: Vec<bool>,
    /// For each particle the number of its body in the scene.
    pub(crate) body_of_particle: Vec<u32>,
    /// See [`ResolvedBody::empty_regions`].
    pub(crate) empty_regions: Vec<String>,
    pub(crate) attachments: Vec<Attachment>,
    pub(crate) distances: Distances,
    /// Volume compliance of each material's body.
    volume_compliances: Vec<Option<f64>>,
    pub(crate) substeps: Vec<Substeps>,
    /// The particles of each body that moves at the start, and its velocity in m/s.
    velocities: Vec<(Range<usize>, DVec3)>,
}

impl IslandBuilder {
    /// The islands of a scene, in the order of their first bodies; `island_of` says which body goes to which. The bodies of
    /// links exist.
    pub(crate) fn all(
        scene: &Scene,
        bodies: Vec<ResolvedBody>,
        island_of: &[usize],
    ) -> Result<Vec<Self>, Error> {
        let islands = island_of.iter().max().map_or(0, |last| last + 1);
        let mut all: Vec<Self> = (0..islands).map(|_| Self::default()).collect();
        // The particles of each body in its island.
        let mut ranges = Vec::with_capacity(bodies.len());
        for (number, (body, &island)) in bodies.into_iter().zip(island_of).enumerate() {
            let first = all[island].mesh.positions.len();
            all[island].add(number, body)?;
            ranges.push(first..all[island].mesh.positions.len());
        }
        let (mut attachments, mut distances) = (Vec::new(), Vec::new());
        let particles = |body: usize| {
            let range: Range<usize> = ranges[body].clone();
            let first = range.start;
            (&all[island_of[body]].mesh.positions[range], first)
        };
        for (i, spec) in scene.attachment.iter().enumerate() {
            let (name, field) = (AttachmentHandle::of_scene(i), format!("attachment[{i}]"));
            existing(&format!("{field}.body"), spec.body, island_of.len())?;
            let (positions, first) = particles(spec.body);
            let attachment = Attachment::new(name, field.clone(), spec, positions, |p| first + p)?;
            attachments.push((island_of[spec.body], field, attachment));
        }
        for (i, spec) in scene.distance.iter().enumerate() {
            let field = format!("distance[{i}]");
            let constraint = distance::constraint(&field, spec, |end| {
                let (positions, first) = particles(end.body);
                distance::nearest(end.point, positions).map(|(x, p)| (x, first + p))
            })?;
            let name = DistanceHandle::of_scene(i);
            distances.push((island_of[spec.from.body], name, constraint));
        }
        for (island, field, attachment) in attachments {
            if attachment.is_empty() {
                all[island].empty_regions.push(field + ".regions");
            }
            all[island].attachments.push(attachment);
        }
        for (island, name, constraint) in distances {
            all[island].distances.add(name, constraint);
        }
        Ok(all)
    }

    /// A body alone.
    pub(crate) fn of_one(number: usize, body: ResolvedBody) -> Result<Self, Error> {
        let mut joined = Self::default();
        joined.add(number, body)?;
        Ok(joined)
    }

    /// Appends a body of the scene.
    fn add(&mut self, number: usize, body: ResolvedBody) -> Result<(), Error> {
        let first = self.mesh.positions.len();
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        self.mesh.positions.extend(body.mesh.positions);
        let tets = body.mesh.tets.iter().map(|tet| tet.map(shifted));
        self.mesh.tets.extend(tets);
        let known = self.materials.len();
        let of_island = |material: u16| u16::try_from(known + usize::from(material));
        for &material in &body.material_of {
            let material = of_island(material);
            let material = material.map_err(|_| value("body", "too many", TOO_MANY))?;
            self.material_of.push(material);
        }
        for material in body.materials {
            self.materials.push(material);
            self.body_of.push(self.bodies.len());
            self.volume_compliances.push(body.volume_compliance);
            self.substeps.push(body.substeps);
        }
        if body.velocity != DVec3::ZERO {
            let particles = first..self.mesh.positions.len();
            self.velocities.push((particles, body.velocity));
        }
        self.bodies.push(number);
        let id = u32::try_from(number).map_err(|_| value("body", "too many", TOO_MANY))?;
        self.body_of_particle.resize(self.mesh.positions.len(), id);
        self.fixed.extend(body.fixed);
        self.empty_regions.extend(body.empty_regions);
        Ok(())
    }

    /// The volume constraints of the island, if a body asks for them.
    pub(crate) fn volumes(&self) -> Option<Volumes> {
        Volumes::new(self.volume_compliances.clone())
    }

    /// The solver of an island whose mesh is `cuttable`, without what hangs on its particles, and the masses of these.
    pub(crate) fn solver(
        &self,
        scene: &Scene,
        precision: Precision,
        cuttable: &CuttableMesh,
    ) -> Result<(AnySolver, Masses), Error> {
        let mesh = cuttable.mesh();
        let mut any = AnySolver::of_particles(precision, &mesh.positions);
        let solver = any.edit()?;
        for material in &self.materials {
            let added = solver.add_material(*material);
            added.map_err(Error::xpbd("body"))?;
        }
        for (t, tet) in mesh.tets.iter().enumerate() {
            let rest = mesh.corners(TetId::new(t));
            solver.push_tet(tet.map(|p| p.0), rest, self.material_of[t]);
        }
        let masses = Masses::new(cuttable, solver, scene.contact.is_some());
        for (p, &fixed) in self.fixed.iter().enumerate() {
            if fixed {
                solver.set_fixed(p, true);
            }
        }
        for (particles, velocity) in &self.velocities {
            for p in particles.clone().filter(|&p| !self.fixed[p]) {
                solver.set_velocity(p, *velocity);
            }
        }
        Ok((any, masses))
    }

    /// The substeps of the island: the most that a body asks for. Where it is left open, also how they were chosen.
    pub(crate) fn substeps(
        &self,
        scene: &Scene,
        solver: &AnySolver,
        cuttable: &CuttableMesh,
    ) -> (u32, Option<Choice>) {
        substeps(&self.substeps, &scene.solver, solver, cuttable.mesh())
    }
}

/// The substeps of an island whose materials ask for these, and how they were chosen where that is left open.
pub(crate) fn substeps(
    asked: &[Substeps],
    spec: &SolverSpec,
    solver: &AnySolver,
    mesh: &TetMesh,
) -> (u32, Option<Choice>) {
    let fixed = |substeps: &Substeps| match substeps {
        Substeps::Fixed(substeps) => *substeps,
        Substeps::Auto => 1,
    };
    let most = asked.iter().map(fixed).max().unwrap_or(1);
    if !asked.contains(&Substeps::Auto) {
        return (most, None);
    }
    let choice = choose(
        demands(spec, solver, mesh, |material| {
            asked[usize::from(material)] == Substeps::Auto
        }),
        spec.max_substeps,
        tet_solve(spec.tet_solve),
    );
    (most.max(choice.substeps), Some(choice))
}

/// Whether all corners of a tet are fixed, so that nothing is solved for it and it has no error.
pub(crate) fn is_all_fixed(solver: &dyn ErasedSolver, tet: usize) -> bool {
    let corners = solver.tet_particles(tet);
    corners.iter().all(|&p| solver.is_fixed(p as usize))
}

/// Returns the demands on substeps of the tets of some materials that can move, for the accuracy of a scene.
pub(crate) fn demands(
    spec: &SolverSpec,
    solver: &AnySolver,
    mesh: &TetMesh,
    concerns: impl Fn(u16) -> bool,
) -> Vec<TetDemand> {
    let accuracy = spec.accuracy.unwrap_or(DEFAULT_ACCURACY);
    let solver = solver.host();
    let materials = solver.materials();
    let limits = largest_kappas(accuracy, materials, tet_solve(spec.tet_solve));
    let all = (0..mesh.tets.len()).map(|t| (t, solver.material_of(t)));
    all.filter(|&(t, material)| concerns(material) && !is_all_fixed(solver, t))
        .map(|(t, material)| TetDemand {
            kappa: solver.kappa_of(t, spec.time_step),
            largest_kappa: limits[usize::from(material)],
            poisson_ratio: materials[usize::from(material)].poisson_ratio,
            volume: mesh.volume(TetId::new(t)),
        })
        .collect()
}
