//! `Body`: a mesh with its material and its pinned particles.
//!
//! Cost: a copy of the mesh when a simulation is set up.

use std::sync::Arc;

use incise::mesh::TetMesh;
use incise::scene::{BodySpec, Region};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyType};
use toml::{Table, Value};

use crate::array;
use crate::mesh::Mesh;
use crate::value::{scene_of, to_toml};

/// A soft body: a mesh at rest, a material and pinned particles.
///
/// Parameters
/// ----------
/// mesh : Mesh, (points, tets), path, or a mesh of meshio or PyVista
///     Shape at rest, coordinates in m.
/// young_modulus : float
///     Young's modulus in Pa.
/// poisson_ratio : float
///     Poisson's ratio, at least 0 and below 0.5.
/// density : float
///     Mass density in kg/m³.
/// damping : float
///     Damping time in s; 0 is none.
/// scale, position : float, (3,) array-like
///     Factor on the coordinates of the mesh, then position of its origin in m.
/// velocity : (3,) array-like, optional
///     Velocity at the start in m/s, of all particles that are not pinned.
/// pinned : optional
///     Particles that do not move: numbers of points of shape (k,), truth values of shape (n,), a function from points of
///     shape (n, 3) in the coordinates of the mesh to truth values of shape (n,), or a region or list of regions in the
///     world, as in a scene: ``{"half_space": {"point": [0, 0, 0], "normal": [1, 0, 0]}}``, ``box``, ``sphere``.
/// material : list of dict, optional
///     Parts with another material: ``{"regions": [...], "young_modulus": 1e6}``; the last one counts.
/// volume_compliance : float, optional
///     An additional volume constraint of each tet: one over a bulk modulus in 1/Pa; 0 is incompressible.
/// substeps : int or "auto", optional
///     Substeps of this body in place of the solver's.
///
/// Raises ``ValueError`` for invalid arrays and keys. Ranges of values and the mesh are checked when a simulation is set up.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Body {
    mesh: Arc<TetMesh>,
    spec: BodySpec,
}

impl Body {
    /// The body of the facade.
    pub(crate) fn to_rust(&self) -> incise::Body {
        let mesh = TetMesh::clone(&self.mesh);
        incise::Body::new(mesh).with(|spec| *spec = self.spec.clone())
    }

    /// What a function takes as bodies: one of them or an iterable.
    pub(crate) fn from_argument(object: &Bound<'_, PyAny>) -> PyResult<Vec<incise::Body>> {
        if let Ok(body) = object.cast::<Self>() {
            return Ok(vec![body.get().to_rust()]);
        }
        let bodies = object.try_iter()?;
        bodies
            .map(|body| Ok(body?.cast::<Self>()?.get().to_rust()))
            .collect()
    }
}

#[pymethods]
impl Body {
    #[new]
    #[pyo3(signature = (
        mesh, *, young_modulus=1e5, poisson_ratio=0.45, density=1000.0, damping=0.0, scale=1.0, position=None, velocity=None,
        pinned=None, material=None, volume_compliance=None, substeps=None,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn python_new(
        mesh: &Bound<'_, PyAny>,
        young_modulus: f64,
        poisson_ratio: f64,
        density: f64,
        damping: f64,
        scale: f64,
        position: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        pinned: Option<&Bound<'_, PyAny>>,
        material: Option<&Bound<'_, PyAny>>,
        volume_compliance: Option<f64>,
        substeps: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = mesh.py();
        let mesh = Mesh::from_argument(mesh)?;
        let mut keys = Table::new();
        for (key, number) in [
            ("young_modulus", Some(young_modulus)),
            ("poisson_ratio", Some(poisson_ratio)),
            ("density", Some(density)),
            ("damping", Some(damping)),
            ("scale", Some(scale)),
            ("volume_compliance", volume_compliance),
        ] {
            if let Some(number) = number {
                keys.insert(key.to_owned(), number.into());
            }
        }
        for (key, object) in [("material", material), ("substeps", substeps)] {
            if let Some(object) = object
                && let Some(value) = to_toml(key, object)?
            {
                keys.insert(key.to_owned(), value);
            }
        }
        for (key, object) in [("position", position), ("velocity", velocity)] {
            if let Some(object) = object {
                let vector = array::vector(key, object)?.to_array();
                keys.insert(key.to_owned(), vector.to_vec().into());
            }
        }
        let mut particles = None;
        if let Some(pinned) = pinned.filter(|pinned| !pinned.is_none()) {
            match regions(pinned)? {
                Some(regions) => {
                    keys.insert("fixed".to_owned(), regions);
                }
                None if pinned.is_callable() => {
                    let chosen = pinned.call1((array::from_vectors(py, &mesh.positions)?,))?;
                    particles = Some(array::selection("pinned", &chosen, mesh.positions.len())?);
                }
                None => {
                    particles = Some(array::selection("pinned", pinned, mesh.positions.len())?);
                }
            }
        }
        let mut spec = spec_of(keys)?;
        spec.fixed.extend(particles.map(Region::Particles));
        Ok(Self { mesh, spec })
    }

    /// The mesh at rest, without scale and position.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh {
            mesh: self.mesh.clone(),
        }
    }

    /// Makes a body of what ``pickle`` keeps.
    #[classmethod]
    fn _from_toml(_: &Bound<'_, PyType>, mesh: &Bound<'_, Mesh>, text: &str) -> PyResult<Self> {
        let keys = toml::from_str(text).map_err(|error| crate::failure::invalid(&error))?;
        Ok(Self {
            mesh: mesh.get().mesh.clone(),
            spec: spec_of(keys)?,
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Mesh, String))> {
        let make = slf.get_type().getattr("_from_toml")?;
        let keys = toml::to_string(&slf.get().spec);
        let keys = keys.map_err(|error| crate::failure::failed(&error))?;
        Ok((make, (slf.get().mesh(), keys)))
    }

    fn __repr__(&self) -> String {
        format!(
            "<incise.Body of {} tets, E = {} Pa, nu = {}, {} kg/m³>",
            self.mesh.tets.len(),
            self.spec.young_modulus,
            self.spec.poisson_ratio,
            self.spec.density
        )
    }
}

/// The keys of a body, read as those of a scene.
fn spec_of(keys: Table) -> PyResult<BodySpec> {
    let mut scene = Table::new();
    scene.insert("body".to_owned(), Value::Array(vec![Value::Table(keys)]));
    Ok(scene_of(&scene)?.body.swap_remove(0))
}

/// Regions, if the argument is a dictionary or a list of some.
fn regions(object: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    if object.is_instance_of::<PyDict>() {
        let region = to_toml("pinned", object)?;
        return Ok(region.map(|region| Value::Array(vec![region])));
    }
    if let Ok(list) = object.cast::<PyList>()
        && list
            .iter()
            .next()
            .is_some_and(|item| item.is_instance_of::<PyDict>())
    {
        return to_toml("pinned", object);
    }
    Ok(None)
}
