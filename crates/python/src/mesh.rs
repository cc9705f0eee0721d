//! `Mesh`: points and tets, from arrays, files, shapes and the meshes of other packages.
//!
//! Cost: a copy of the arrays.

use std::path::PathBuf;
use std::sync::Arc;

use incise::mesh::{ParticleId, RepairOptions, TetMesh, TriangleSurface, repair};
use incise::meshing::{MeshingError, Shape, Solid};
use incise::{mesh_io, meshing, shape_suggestion};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple, PyType};

use crate::array;
use crate::compute::compute;
use crate::failure::{invalid, refused_file};
use crate::value::Whole;

/// A tetrahedral mesh at rest.
///
/// ``Mesh(points, tets)`` takes ``points`` of shape (n, 3) in m and ``tets`` of shape (m, 4): four numbers of points each,
/// with positive volume ``dot(cross(b - a, c - a), d - a)``. Any array-like is taken, in any memory layout, and copied.
///
/// A mesh does not change. ``Mesh.wrap`` takes the meshes of meshio and PyVista, ``Mesh.load`` a file, ``Mesh.generate`` a
/// shape, ``Mesh.tetrahedralize`` a closed surface.
///
/// Raises ``ValueError`` for arrays of another shape or type and for numbers of points that do not exist.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Mesh {
    pub(crate) mesh: Arc<TetMesh>,
}

impl Mesh {
    fn new(mesh: TetMesh) -> Self {
        Self {
            mesh: Arc::new(mesh),
        }
    }

    fn of(points: &Bound<'_, PyAny>, tets: &Bound<'_, PyAny>) -> PyResult<Self> {
        let positions = array::vectors("points", points)?;
        let tets = array::rows::<4>("tets", tets, positions.len(), "the number of a point")?;
        let tets = tets.into_iter().map(|tet| tet.map(ParticleId)).collect();
        Ok(Self::new(TetMesh { positions, tets }))
    }

    /// What a function takes as a mesh: a `Mesh`, points and tets, a file, or the mesh of another package.
    pub(crate) fn from_argument(object: &Bound<'_, PyAny>) -> PyResult<Arc<TetMesh>> {
        if let Ok(mesh) = object.cast::<Self>() {
            return Ok(mesh.get().mesh.clone());
        }
        if let Ok(pair) = object.cast::<PyTuple>()
            && pair.len() == 2
        {
            return Ok(Self::of(&pair.get_item(0)?, &pair.get_item(1)?)?.mesh);
        }
        if object.is_instance_of::<PyString>() || object.hasattr("__fspath__")? {
            return Ok(Self::load(object.py(), object.extract()?)?.mesh);
        }
        Ok(wrap(object)?.mesh)
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (points, tets))]
    fn python_new(points: &Bound<'_, PyAny>, tets: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::of(points, tets)
    }

    /// The tets of a mesh of meshio or PyVista, or of anything with ``points`` and ``cells_dict``.
    ///
    /// Vertices, lines and triangles are left out. Raises ``ValueError`` if the mesh has no tets, or other cells with a
    /// volume, which would be lost; split those into tets first (PyVista: ``mesh.triangulate()``).
    #[classmethod]
    #[pyo3(name = "wrap", signature = (mesh, /))]
    fn python_wrap(_: &Bound<'_, PyType>, mesh: &Bound<'_, PyAny>) -> PyResult<Self> {
        wrap(mesh)
    }

    /// Reads a file: ``.vtk``, ``.vtu``, ``.msh`` (Gmsh), ``.node``/``.ele`` (TetGen) or ``.mesh`` (Medit), by its ending.
    ///
    /// Raises ``FileNotFoundError`` or ``OSError`` if it cannot be read, ``ValueError`` with file and line if it is damaged.
    #[staticmethod]
    #[pyo3(signature = (path, /))]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let mesh = compute(py, || mesh_io::read(path))?;
        mesh.map(Self::new).map_err(|error| refused_file(&error))
    }

    /// Writes a file; the format is that of its ending, as in ``load``. An existing file is replaced.
    #[pyo3(signature = (path, /))]
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = compute(py, || mesh_io::write(path, &self.mesh))?;
        written.map_err(|error| refused_file(&error))
    }

    /// A shape by name with about ``tets`` tets (within 2 %) and a longest side of 1 m: ``sphere``, ``box``, ``beam``,
    /// ``torus``, ``plate``, ``liver``, ``bunny``, ``armadillo``, ``gear``, ``shell`` or ``pair``.
    #[staticmethod]
    #[pyo3(signature = (shape, tets))]
    fn generate(py: Python<'_>, shape: &str, tets: Whole<usize>) -> PyResult<Self> {
        let tets = tets.named("tets")?;
        let mesh = compute(py, || meshing::generate(Shape::from_name(shape)?, tets))?;
        mesh.map(Self::new).map_err(|error| unmeshed(&error))
    }

    /// Fills a closed triangle surface with about ``tets`` tets (within 2 %).
    ///
    /// ``points`` has shape (n, 3) in m, ``triangles`` shape (k, 3). Parts thinner than a tet are lost. Raises ``ValueError``
    /// for a surface that is not closed, and if there is no such mesh with this number of tets.
    #[staticmethod]
    #[pyo3(signature = (points, triangles, tets))]
    fn tetrahedralize(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        tets: Whole<usize>,
    ) -> PyResult<Self> {
        let tets = tets.named("tets")?;
        let positions = array::vectors("points", points)?;
        let of = "the number of a point";
        let triangles = array::rows::<3>("triangles", triangles, positions.len(), of)?;
        let triangles = triangles.into_iter().map(|t| t.map(ParticleId)).collect();
        let surface = TriangleSurface {
            positions,
            triangles,
        };
        let mesh = compute(py, || {
            meshing::tetrahedralize(&Solid::new(&surface)?, tets, 0)
        })?;
        mesh.map(Self::new).map_err(|error| unmeshed(&error))
    }

    /// Points in m, shape (n, 3), float64, read-only. A copy.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::from_vectors(py, &self.mesh.positions)
    }

    /// Numbers of the four points of each tet, shape (m, 4), int64, read-only. A copy.
    #[getter]
    fn tets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::from_rows(py, self.mesh.tets.iter().map(|tet| tet.map(|p| p.0)))
    }

    /// Volume in m³: the sum over all tets, where inverted ones count negative.
    #[getter]
    fn volume(&self) -> f64 {
        self.mesh.total_volume()
    }

    /// Numbers of the three points of each boundary triangle, counterclockwise seen from outside, shape (t, 3), int64.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        // It sorts the faces of tets, whose corners exist.
        let surface = compute(py, || self.mesh.surface())?;
        array::from_rows(py, surface.triangles.iter().map(|t| t.map(|p| p.0)))
    }

    /// Raises ``ValueError`` with the first fault unless the mesh can be simulated: finite points, tets of positive volume,
    /// no overlapping tets. Setting up a simulation checks this, too.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let checked = compute(py, || self.mesh.check())?;
        checked.map_err(|error| invalid(&error))
    }

    /// A mesh without the faults that ``check`` names: coincident points merged, inverted tets flipped, flat and duplicate
    /// tets, unused points and all pieces but the largest removed.
    fn repair(&self, py: Python<'_>) -> PyResult<Self> {
        let repaired = compute(py, || repair(&self.mesh, &RepairOptions::ALL))?;
        Ok(Self::new(repaired.mesh))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Parts<'py>)> {
        let (py, mesh) = (slf.py(), slf.get());
        Ok((slf.get_type(), (mesh.points(py)?, mesh.tets(py)?)))
    }

    fn __repr__(&self) -> String {
        let TetMesh { positions, tets } = &*self.mesh;
        format!(
            "<incise.Mesh of {} points and {} tets>",
            positions.len(),
            tets.len()
        )
    }
}

/// The arguments that make an equal mesh.
type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The exception for a mesh that could not be made.
fn unmeshed(error: &MeshingError) -> PyErr {
    PyValueError::new_err(format!(
        "{}{}",
        crate::failure::sentence(error),
        shape_suggestion(error)
    ))
}

/// The keys under which packages keep tets: meshio's name, and the number of VTK, which is PyVista's.
const TETS: [&str; 2] = ["tetra", "10"];

/// Cells without a volume, by meshio's name and by the number of VTK. Names may end in the number of points of a cell.
fn is_flat(kind: &str) -> bool {
    match kind.parse::<u32>() {
        Ok(number) => matches!(number, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 68..=70),
        Err(_) => ["vertex", "line", "triangle", "quad", "polygon"]
            .iter()
            .any(|name| kind.starts_with(name)),
    }
}

/// The tets of the mesh of another package.
fn wrap(mesh: &Bound<'_, PyAny>) -> PyResult<Mesh> {
    let (Some(points), Some(cells)) =
        (mesh.getattr_opt("points")?, mesh.getattr_opt("cells_dict")?)
    else {
        let kind = mesh.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "{kind} is no mesh: give an incise.Mesh, a pair (points, tets), the path of a file, or a mesh with `points` \
             and `cells_dict` (meshio, PyVista)"
        )));
    };
    let (mut tets, mut kinds) = (None, Vec::new());
    for (key, rows) in cells.cast::<PyDict>()? {
        let kind = key.str()?.to_string();
        if TETS.contains(&kind.as_str()) {
            tets = Some(rows);
        } else {
            kinds.push(kind);
        }
    }
    let solid: Vec<&str> = kinds
        .iter()
        .map(String::as_str)
        .filter(|kind| !is_flat(kind))
        .collect();
    if !solid.is_empty() {
        return Err(PyValueError::new_err(format!(
            "the mesh has cells of type {} beside tets: split them into tets first",
            solid.join(", ")
        )));
    }
    match tets {
        Some(tets) => Mesh::of(&points, &tets),
        None => Err(PyValueError::new_err(format!(
            "the mesh has no tets, only cells of type {}: fill a closed surface with Mesh.tetrahedralize",
            if kinds.is_empty() {
                "none".to_owned()
            } else {
                kinds.join(", ")
            }
        ))),
    }
}
