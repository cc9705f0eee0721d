//! From the bodies of a scene to one mesh with materials and fixed particles.
//!
//! All bodies share one mesh, so that a stroke cuts whatever it meets and one schedule covers everything.

use glam::DVec3;
use incise_mesh::generate::{Shape, generate};
use incise_mesh::{ParticleId, TetMesh, io};
use incise_xpbd::Material;

use crate::limits::{LARGEST_COORDINATE, coordinates, direction, value, within};
use crate::scene::{BodySpec, Region};
use crate::{Error, Scene};

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
        within(
            &format!("{field}.young_modulus"),
            spec.young_modulus,
            1e-6,
            1e15,
        )?;
        within(&format!("{field}.density"), spec.density, 1e-6, 1e9)?;
        within(&format!("{field}.damping"), spec.damping, 0.0, 1e6)?;
        within(&format!("{field}.scale"), spec.scale, 1e-9, 1e9)?;
        let position = coordinates(&format!("{field}.position"), spec.position)?;
        let mesh = load(field, spec)?;

        let body = u16::try_from(self.materials.len())
            .map_err(|_| value("body", "too many", "at most 65,536"))?;
        let first = self.mesh.positions.len();
        for x in mesh.positions {
            let x = x * spec.scale + position;
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
                let point = coordinates(&format!("{field}.half_space.point"), *point)?;
                let normal = direction(&format!("{field}.half_space.normal"), *normal)?;
                fix(&|x| normal.dot(x - point) >= 0.0);
            }
            Region::Box { low, high } => {
                let low = coordinates(&format!("{field}.box.low"), *low)?;
                let high = coordinates(&format!("{field}.box.high"), *high)?;
                if !low.cmple(high).all() {
                    let range = "such that low is at most high in all coordinates";
                    return Err(value(format!("{field}.box"), "inside out", range));
                }
                fix(&|x| x.cmpge(low).all() && x.cmple(high).all());
            }
            Region::Sphere { center, radius } => {
                let center = coordinates(&format!("{field}.sphere.center"), *center)?;
                if !(radius.is_finite() && *radius >= 0.0) {
                    let field = format!("{field}.sphere.radius");
                    return Err(value(field, radius, "at least 0 and finite"));
                }
                fix(&|x| x.distance(center) <= *radius);
            }
            Region::Particles(particles) => {
                for &p in particles {
                    let count = self.fixed.len() - first;
                    let fixed = self.fixed[first..].get_mut(p as usize);
                    *fixed.ok_or_else(|| {
                        let range = format!("below {count}, the body's number of particles");
                        value(format!("{field}.particles"), p, range)
                    })? = true;
                }
            }
        }
        Ok(())
    }
}

/// The body's mesh, sound.
fn load(field: &str, spec: &BodySpec) -> Result<TetMesh, Error> {
    let (key, mesh) = match (&spec.mesh, &spec.shape) {
        (Some(path), None) => ("mesh", io::read(path)),
        (None, Some(shape)) => {
            let kind = Shape::from_name(&shape.kind);
            ("shape", kind.and_then(|kind| generate(kind, shape.tets)))
        }
        (Some(_), Some(_)) => return Err(value(field, "given mesh and shape", "given only one")),
        (None, None) => {
            let range = "given either mesh or shape";
            return Err(value(field, "without a mesh", range));
        }
    };
    let checked = mesh.and_then(|mesh| mesh.check().map(|()| mesh));
    checked.map_err(|source| Error::Mesh {
        field: format!("{field}.{key}"),
        source,
    })
}
