//! [`Body`]: a body of a scene with its mesh, material and fixed particles, all values checked.

use glam::DVec3;
use incise_mesh::generate::{Shape, generate};
use incise_mesh::{TetMesh, io};
use incise_xpbd::Material;

use crate::limits::{LARGEST_COORDINATE, coordinates, direction, value, within};
use crate::scene::{BodySpec, Region, Substeps};
use crate::{Error, Scene};

/// A body in the world.
#[derive(Debug)]
pub(crate) struct Body {
    pub(crate) mesh: TetMesh,
    pub(crate) material: Material,
    /// For each particle whether it is fixed.
    pub(crate) fixed: Vec<bool>,
    pub(crate) substeps: Substeps,
}

impl Body {
    /// The bodies of a scene.
    pub(crate) fn all(scene: &Scene) -> Result<Vec<Self>, Error> {
        if scene.body.is_empty() {
            return Err(value("body", "missing", "at least one [[body]]"));
        }
        let bodies = scene.body.iter().enumerate();
        bodies
            .map(|(i, spec)| Self::new(&format!("body[{i}]"), spec, scene.solver.substeps))
            .collect()
    }

    /// The body of a spec; `substeps` are those of a body that does not name its own.
    fn new(field: &str, spec: &BodySpec, substeps: Substeps) -> Result<Self, Error> {
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
        if spec.substeps == Some(Substeps::Fixed(0)) {
            return Err(value(format!("{field}.substeps"), 0, "at least 1"));
        }
        let position = coordinates(&format!("{field}.position"), spec.position)?;
        let mut mesh = load(field, spec)?;
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
        let mut fixed = vec![false; mesh.positions.len()];
        for (i, region) in spec.fixed.iter().enumerate() {
            let field = format!("{field}.fixed[{i}]");
            fix(&field, region, &mesh.positions, &mut fixed)?;
        }
        Ok(Self {
            mesh,
            material,
            fixed,
            substeps: spec.substeps.unwrap_or(substeps),
        })
    }
}

/// Fixes the particles that lie in a region.
fn fix(field: &str, region: &Region, positions: &[DVec3], fixed: &mut [bool]) -> Result<(), Error> {
    let mut fix = |inside: &dyn Fn(DVec3) -> bool| {
        for (fixed, x) in fixed.iter_mut().zip(positions) {
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
            let count = fixed.len();
            for &p in particles {
                *fixed.get_mut(p as usize).ok_or_else(|| {
                    let range = format!("below {count}, the body's number of particles");
                    value(format!("{field}.particles"), p, range)
                })? = true;
            }
        }
    }
    Ok(())
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
