//! From the bodies of a scene to one mesh with materials and fixed particles.
//!
//! All bodies share one mesh, so that a stroke cuts whatever it meets and one schedule covers everything.

use glam::DVec3;
use incise_mesh::generate::{Shape, generate};
use incise_mesh::{MeshError, ParticleId, TetMesh, io};
use incise_xpbd::Material;

use crate::scene::{BodySpec, Region};
use crate::{Error, Scene};

/// Coordinates beyond this many meters are taken for a mistake; squares and cubes stay finite in single precision.
const LARGEST_COORDINATE: f64 = 1e9;

/// All bodies of a scene as one mesh.
pub(crate) struct Bodies {
    pub(crate) mesh: TetMesh,
    pub(crate) materials: Vec<Material>,
    /// For each tet the number of its body, which is that of its material.
    pub(crate) body_of: Vec<u16>,
    pub(crate) fixed: Vec<bool>,
}

impl Bodies {
    pub(crate) fn new(scene: &Scene) -> Result<Self, Error> {
        if scene.body.is_empty() {
            return Err(value("body", "missing", "at least one [[body]]"));
        }
        let mut bodies = Self {
            mesh: TetMesh::default(),
            materials: Vec::new(),
            body_of: Vec::new(),
            fixed: Vec::new(),
        };
        for (i, spec) in scene.body.iter().enumerate() {
            bodies.add(&format!("body[{i}]"), spec)?;
        }
        Ok(bodies)
    }

    fn add(&mut self, field: &str, spec: &BodySpec) -> Result<(), Error> {
        let material = Material {
            young_modulus: spec.young_modulus,
            poisson_ratio: spec.poisson_ratio,
            density: spec.density,
            damping: spec.damping,
        };
        material.check().map_err(|source| Error::Xpbd {
            field: field.to_owned(),
            source,
        })?;
        if !(spec.scale.is_finite() && spec.scale > 0.0) {
            return Err(value(
                format!("{field}.scale"),
                spec.scale,
                "positive and finite",
            ));
        }
        finite(&format!("{field}.position"), spec.position)?;
        let mesh = load(spec).map_err(|source| Error::Mesh {
            field: field.to_owned(),
            source,
        })?;
        mesh.check().map_err(|source| Error::Mesh {
            field: field.to_owned(),
            source,
        })?;

        let body = u16::try_from(self.materials.len())
            .map_err(|_| value("body", "too many", "at most 65,536"))?;
        let first = self.mesh.positions.len();
        for x in mesh.positions {
            let x = x * spec.scale + DVec3::from_array(spec.position);
            if x.abs().max_element() > LARGEST_COORDINATE {
                return Err(value(
                    format!("{field}.scale"),
                    spec.scale,
                    "such that the body stays within 1e9 m",
                ));
            }
            self.mesh.positions.push(x);
        }
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        self.mesh
            .tets
            .extend(mesh.tets.iter().map(|tet| tet.map(shifted)));
        self.body_of.resize(self.mesh.tets.len(), body);
        self.materials.push(material);
        self.fixed.resize(self.mesh.positions.len(), false);
        for (i, region) in spec.fixed.iter().enumerate() {
            self.fix(&format!("{field}.fixed[{i}]"), region, first)?;
        }
        Ok(())
    }

    /// Fixes the particles from `first` on that lie in a region.
    fn fix(&mut self, field: &str, region: &Region, first: usize) -> Result<(), Error> {
        let positions = &self.mesh.positions[first..];
        let mut fix = |inside: &dyn Fn(DVec3) -> bool| {
            for (fixed, x) in self.fixed[first..].iter_mut().zip(positions) {
                *fixed |= inside(*x);
            }
        };
        match region {
            Region::HalfSpace { point, normal } => {
                let (point, normal) = (finite(field, *point)?, finite(field, *normal)?);
                if normal == DVec3::ZERO {
                    return Err(value(format!("{field}.normal"), "zero", "a direction"));
                }
                fix(&|x| normal.dot(x - point) >= 0.0);
            }
            Region::Box { low, high } => {
                let (low, high) = (finite(field, *low)?, finite(field, *high)?);
                fix(&|x| x.cmpge(low).all() && x.cmple(high).all());
            }
            Region::Sphere { center, radius } => {
                let center = finite(field, *center)?;
                if !(radius.is_finite() && *radius >= 0.0) {
                    return Err(value(
                        format!("{field}.radius"),
                        radius,
                        "at least 0 and finite",
                    ));
                }
                fix(&|x| x.distance(center) <= *radius);
            }
            Region::Particles(particles) => {
                for &p in particles {
                    let count = self.fixed.len() - first;
                    let fixed = self.fixed[first..].get_mut(p as usize);
                    *fixed.ok_or_else(|| {
                        value(
                            field,
                            p,
                            format!("below {count}, the body's number of particles"),
                        )
                    })? = true;
                }
            }
        }
        Ok(())
    }
}

fn load(spec: &BodySpec) -> Result<TetMesh, MeshError> {
    match (&spec.mesh, &spec.shape) {
        (Some(path), _) => io::read(path),
        (None, Some(shape)) => generate(Shape::from_name(&shape.kind)?, shape.tets),
        (None, None) => Err(MeshError::Empty),
    }
}

/// An error about a value of the scene.
pub(crate) fn value(
    field: impl Into<String>,
    value: impl ToString,
    range: impl Into<String>,
) -> Error {
    Error::Value {
        field: field.into(),
        value: value.to_string(),
        range: range.into(),
    }
}

/// The vector, if it is finite.
pub(crate) fn finite(field: &str, v: [f64; 3]) -> Result<DVec3, Error> {
    match v.into_iter().find(|c| !c.is_finite()) {
        Some(component) => Err(value(field, component, "finite")),
        None => Ok(DVec3::from_array(v)),
    }
}
