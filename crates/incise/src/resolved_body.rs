//! [`ResolvedBody`]: a body of a scene with mesh, materials and fixed particles, all values checked.

use glam::DVec3;
use incise_mesh::TetMesh;
use incise_meshing::{Shape, generate};
use incise_xpbd::Material;

use crate::region::{particles, tets};
use crate::scene::{BodySpec, MaterialSpec, Substeps};
use crate::validate::{LARGEST_COORDINATE, coordinates, value, within};
use crate::{Error, Scene};

/// A body in the world.
#[derive(Debug)]
pub(crate) struct ResolvedBody {
    pub(crate) mesh: TetMesh,
    /// The first is that of all tets that no other one claims.
    pub(crate) materials: Vec<Material>,
    /// For each tet the index of its material.
    pub(crate) material_of: Vec<u16>,
    /// For each particle whether it is fixed.
    pub(crate) fixed: Vec<bool>,
    /// The regions that contain nothing of it, by their place in the scene.
    pub(crate) empty_regions: Vec<String>,
    /// Compliance of the volume constraints; `None` without them.
    pub(crate) volume_compliance: Option<f64>,
    pub(crate) substeps: Substeps,
    /// At the start, in m/s.
    pub(crate) velocity: DVec3,
}

impl ResolvedBody {
    /// The bodies of a scene, whose meshes are in memory or named by the scene.
    pub(crate) fn all(scene: &Scene, meshes: &[Option<TetMesh>]) -> Result<Vec<Self>, Error> {
        if scene.body.is_empty() {
            return Err(value("body", "missing", "at least one [[body]]"));
        }
        let bodies = scene.body.iter().zip(meshes).enumerate();
        bodies
            .map(|(i, (spec, mesh))| {
                Self::new(
                    &format!("body[{i}]"),
                    spec,
                    mesh.as_ref(),
                    scene.solver.substeps,
                )
            })
            .collect()
    }

    /// The body of a spec; `substeps` are those of a body that does not name its own.
    pub(crate) fn new(
        field: &str,
        spec: &BodySpec,
        mesh: Option<&TetMesh>,
        substeps: Substeps,
    ) -> Result<Self, Error> {
        let own = MaterialSpec::default();
        let mut materials = vec![material(field, spec, &own)?];
        within(&format!("{field}.scale"), spec.scale, 1e-9, 1e9)?;
        if spec.substeps == Some(Substeps::Fixed(0)) {
            return Err(value(format!("{field}.substeps"), 0, "at least 1"));
        }
        let volume_compliance = spec
            .volume_compliance
            .map(|c| within(&format!("{field}.volume_compliance"), c, 0.0, 1e9))
            .transpose()?;
        let velocity = coordinates(&format!("{field}.velocity"), spec.velocity)?;
        let position = coordinates(&format!("{field}.position"), spec.position)?;
        let mut mesh = load(field, spec, mesh)?;
        for x in &mut mesh.positions {
            *x = *x * spec.scale + position;
            if x.abs().max_element() > LARGEST_COORDINATE {
                return Err(value(
                    format!("{field}.scale"),
                    spec.scale,
                    "such that the body stays within 1e9 m",
                ));
            }
        }
        let mut empty_regions = Vec::new();
        let mut fixed = vec![false; mesh.positions.len()];
        for (i, region) in spec.fixed.iter().enumerate() {
            let field = format!("{field}.fixed[{i}]");
            let inside = particles(&field, region, &mesh.positions)?;
            for &p in &inside {
                fixed[p] = true;
            }
            if inside.is_empty() {
                empty_regions.push(field);
            }
        }
        let mut material_of = vec![0; mesh.tets.len()];
        for (i, part) in spec.material.iter().enumerate() {
            let field = format!("{field}.material[{i}]");
            let index = u16::try_from(materials.len())
                .map_err(|_| value(&field, "one too many", "at most 65,535 a body"))?;
            materials.push(material(&field, spec, part)?);
            for (j, region) in part.regions.iter().enumerate() {
                let field = format!("{field}.regions[{j}]");
                let inside = tets(&field, region, &mesh)?;
                for &t in &inside {
                    material_of[t] = index;
                }
                if inside.is_empty() {
                    empty_regions.push(field);
                }
            }
        }
        Ok(Self {
            mesh,
            materials,
            material_of,
            fixed,
            empty_regions,
            volume_compliance,
            substeps: spec.substeps.unwrap_or(substeps),
            velocity,
        })
    }
}

/// The material of a part of a body, all values checked.
fn material(field: &str, body: &BodySpec, part: &MaterialSpec) -> Result<Material, Error> {
    let material = Material {
        young_modulus: part.young_modulus.unwrap_or(body.young_modulus),
        poisson_ratio: part.poisson_ratio.unwrap_or(body.poisson_ratio),
        density: part.density.unwrap_or(body.density),
        damping: part.damping.unwrap_or(body.damping),
    };
    material.check().map_err(Error::xpbd(field))?;
    for (key, number, low, high) in [
        ("young_modulus", material.young_modulus, 1e-6, 1e15),
        ("density", material.density, 1e-6, 1e9),
        ("damping", material.damping, 0.0, 1e6),
    ] {
        within(&format!("{field}.{key}"), number, low, high)?;
    }
    Ok(material)
}

/// The body's mesh, checked.
fn load(field: &str, spec: &BodySpec, in_memory: Option<&TetMesh>) -> Result<TetMesh, Error> {
    let key = |key: &str| format!("{field}.{key}");
    let (field, mesh) = match (in_memory, &spec.mesh, &spec.shape) {
        (Some(mesh), None, None) => (key("mesh"), mesh.clone()),
        (None, Some(path), None) => {
            let field = key("mesh");
            match incise_mesh_io::read(path) {
                Ok(mesh) => (field, mesh),
                Err(source) => return Err(Error::MeshFile { field, source }),
            }
        }
        (None, None, Some(shape)) => {
            let field = key("shape");
            let kind = Shape::from_name(&shape.kind);
            match kind.and_then(|kind| generate(kind, shape.tets)) {
                Ok(mesh) => (field, mesh),
                Err(source) => return Err(Error::Shape { field, source }),
            }
        }
        (_, Some(_), _) | (_, _, Some(_)) => {
            return Err(value(field, "given mesh and shape", "given only one"));
        }
        (None, None, None) => {
            let range = "given either mesh or shape";
            return Err(value(field, "without a mesh", range));
        }
    };
    match mesh.check() {
        Ok(()) => Ok(mesh),
        Err(source) => Err(Error::Mesh { field, source }),
    }
}
