//! From the bodies of a scene to one mesh with materials and fixed particles.
//!
//! All bodies share one mesh, so that a stroke cuts whatever it meets and one schedule covers everything.

use glam::DVec3;
use incise_mesh::generate::{Shape, generate};
use incise_mesh::{ParticleId, TetMesh, io};
use incise_xpbd::Material;

use crate::limits::{LARGEST_COORDINATE, coordinates, value, within};
use crate::region::particles;
use crate::scene::BodySpec;
use crate::{Error, Scene};

/// All bodies of a scene as one mesh.
pub(crate) struct Bodies {
    pub(crate) mesh: TetMesh,
    pub(crate) materials: Vec<Material>,
    /// For each tet the number of its body, which is that of its material.
    pub(crate) body_of: Vec<u16>,
    pub(crate) fixed: Vec<bool>,
    /// The first particle of each body, and the end.
    starts: Vec<usize>,
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
            starts: vec![0],
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
            let field = format!("{field}.fixed[{i}]");
            for p in particles(&field, region, &self.mesh.positions[first..])? {
                self.fixed[first + p] = true;
            }
        }
        self.starts.push(self.mesh.positions.len());
        Ok(())
    }

    /// The positions at rest of a body's particles and the number of the first of them.
    pub(crate) fn particles_of(&self, body: usize) -> Option<(&[DVec3], usize)> {
        let (start, end) = (*self.starts.get(body)?, *self.starts.get(body + 1)?);
        Some((&self.mesh.positions[start..end], start))
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
