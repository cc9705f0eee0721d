//! `color` and `cluster`: constraints that are solved at the same time, for any incidence in NumPy arrays.
//!
//! Constraints are lists of particles: an array with a row for each, or CSR. The algorithms are those of `incise-coloring`
//! and `incise-clustering`.
//!
//! Cost: a copy of the arrays, and the algorithm.

use incise::clustering::{Method, cluster as cluster_constraints};
use incise::coloring::{Algorithm, balance as balance_classes, color as color_constraints};
use incise::graph::{Classes, Incidence};
use incise::{clustering_suggestion, coloring_suggestion};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::array;
use crate::compute::compute;
use crate::failure::{failed, invalid, sentence};
use crate::value::{Whole, optional};

/// The largest number of particles that the arrays may name.
const PARTICLES: usize = u32::MAX as usize;

/// Reads constraints: rows of particles, CSR as a pair of arrays, or a sparse matrix with `indptr` and `indices`.
fn incidence(object: &Bound<'_, PyAny>, particles: Option<Whole<usize>>) -> PyResult<Incidence> {
    let particles = optional("particles", particles)?;
    let limit = particles.unwrap_or(PARTICLES);
    let of = "the number of a particle";
    let (offsets, values) = match csr(object)? {
        Some((offsets, values)) => {
            let (offsets, shape) = array::indices("offsets", &offsets, PARTICLES, "an offset")?;
            let (values, inside) = array::indices("values", &values, limit, of)?;
            if shape.len() != 1 || inside.len() != 1 {
                let message =
                    "offsets and values must have one dimension each: shapes (m + 1,) and (k,)";
                return Err(PyValueError::new_err(message));
            }
            (offsets, values)
        }
        None => {
            let (values, shape) = array::indices("constraints", object, limit, of)?;
            let [rows, columns] = shape[..] else {
                return Err(PyValueError::new_err(format!(
                    "constraints has {} dimension(s): it must have shape (m, k), or be a pair (offsets, values)",
                    shape.len()
                )));
            };
            let offsets = (0..=rows).map(|row| u32::try_from(row * columns));
            let offsets = offsets
                .collect::<Result<_, _>>()
                .map_err(|error| invalid(&error))?;
            (offsets, values)
        }
    };
    let largest = values
        .iter()
        .max()
        .map_or(0, |largest| *largest as usize + 1);
    Incidence::new(particles.unwrap_or(largest), offsets, values).map_err(|error| invalid(&error))
}

/// Offsets and values, if the argument is CSR.
type Csr<'py> = Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>;

fn csr<'py>(object: &Bound<'py, PyAny>) -> PyResult<Csr<'py>> {
    if let Ok(pair) = object.cast::<PyTuple>() {
        if pair.len() != 2 {
            let message = format!(
                "constraints has {} parts: it must be a pair (offsets, values)",
                pair.len()
            );
            return Err(PyValueError::new_err(message));
        }
        return Ok(Some((pair.get_item(0)?, pair.get_item(1)?)));
    }
    let parts = (
        object.getattr_opt("indptr")?,
        object.getattr_opt("indices")?,
    );
    Ok(match parts {
        (Some(offsets), Some(values)) => Some((offsets, values)),
        _ => None,
    })
}

/// The arrays of classes.
fn members<'py>(py: Python<'py>, classes: &Classes) -> PyResult<Bound<'py, PyList>> {
    let classes = classes.iter();
    let classes = classes.map(|class| array::from_indices(py, class.iter().copied()));
    PyList::new(py, classes.collect::<PyResult<Vec<_>>>()?)
}

/// Offsets and values as a pair of arrays.
fn pair<'py>(
    py: Python<'py>,
    offsets: &[u32],
    values: &[u32],
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let offsets = array::from_indices(py, offsets.iter().copied())?;
    Ok((offsets, array::from_indices(py, values.iter().copied())?))
}

/// Colors of constraints: two constraints of one color share no particle. See ``color``.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Coloring {
    coloring: incise::graph::Coloring,
    bound: usize,
    rounds: usize,
}

#[pymethods]
impl Coloring {
    /// The color of each constraint, shape (m,), int64, read-only.
    #[getter]
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::from_indices(py, self.coloring.colors().iter().map(|color| color.0))
    }

    /// The constraints of each color, ascending: a list of arrays of shape (size,), int64, read-only.
    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        members(py, &self.coloring.classes())
    }

    /// ``classes`` as CSR: class ``c`` is ``values[offsets[c]:offsets[c + 1]]``.
    #[getter]
    fn csr<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let classes = self.coloring.classes();
        pair(py, classes.offsets(), classes.values())
    }

    /// A lower bound of the number of colors: the largest number of constraints at a particle.
    #[getter]
    fn bound(&self) -> usize {
        self.bound
    }

    /// Parallel rounds of the algorithm; 1 for a sequential one.
    #[getter]
    fn rounds(&self) -> usize {
        self.rounds
    }

    /// The number of colors.
    fn __len__(&self) -> usize {
        self.coloring.color_count()
    }

    fn __repr__(&self) -> String {
        let (vertices, colors) = (self.coloring.vertex_count(), self.coloring.color_count());
        format!("<incise.Coloring of {vertices} constraints in {colors} colors>")
    }
}

/// Clusters of constraints, each solved as one block. See ``cluster``.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Clustering {
    clustering: incise::graph::Clustering,
    quotient: Incidence,
}

#[pymethods]
impl Clustering {
    /// The cluster of each constraint, shape (m,), int64, read-only.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array::from_indices(py, self.clustering.labels().iter().map(|cluster| cluster.0))
    }

    /// The constraints of each cluster, ascending: a list of arrays of shape (size,), int64, read-only.
    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        members(py, &self.clustering.members())
    }

    /// ``classes`` as CSR: cluster ``c`` is ``values[offsets[c]:offsets[c + 1]]``.
    #[getter]
    fn csr<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let members = self.clustering.members();
        pair(py, members.offsets(), members.values())
    }

    /// The particles of each cluster as CSR: constraints of their own, which ``color`` takes.
    #[getter]
    fn quotient<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        pair(py, self.quotient.offsets(), self.quotient.values())
    }

    /// The number of clusters.
    fn __len__(&self) -> usize {
        self.clustering.cluster_count()
    }

    fn __repr__(&self) -> String {
        let (constraints, clusters) = (
            self.clustering.constraint_count(),
            self.clustering.cluster_count(),
        );
        format!("<incise.Clustering of {constraints} constraints in {clusters} clusters>")
    }
}

/// Colors constraints so that those of one color share no particle and can be solved at the same time.
///
/// Parameters
/// ----------
/// constraints : (m, k) array-like of int, (offsets, values), or sparse matrix
///     Particles of each constraint: a row for each; or CSR, where constraint ``c`` touches
///     ``values[offsets[c]:offsets[c + 1]]``, shapes (m + 1,) and (k,), for constraints of any arity; or an object with
///     ``indptr`` and ``indices``, such as a ``scipy.sparse.csr_array`` with a row for each constraint.
/// algorithm : str
///     ``auto``, ``scgc``, ``jones-plassmann``, ``ecl-gc``, ``vivace``, ``wlc``, ``mcs``, ``greedy``, ``dsatur``,
///     ``iterated-greedy`` or ``tabu``; some take a parameter, as in ``vivace:2``.
/// particles : int, optional
///     Number of particles; by default one more than the largest number in use.
/// seed : int
///     Chooses the random numbers of ``vivace``, ``greedy:random``, ``iterated-greedy`` and ``tabu``.
/// balance : bool
///     Evens out the sizes of the classes without an additional color.
///
/// Returns a ``Coloring``: always proper, and the same for any number of threads. Raises ``ValueError`` for particles that
/// do not exist, a constraint that names a particle twice, and unknown names.
#[pyfunction]
#[pyo3(
    signature = (constraints, algorithm="auto", *, particles=None, seed=Whole::from(0), balance=false),
    text_signature = "(constraints, algorithm='auto', *, particles=None, seed=0, balance=False)"
)]
pub(crate) fn color(
    py: Python<'_>,
    constraints: &Bound<'_, PyAny>,
    algorithm: &str,
    particles: Option<Whole<usize>>,
    seed: Whole<u64>,
    balance: bool,
) -> PyResult<Coloring> {
    let seed = seed.named("seed")?;
    let incidence = incidence(constraints, particles)?;
    let algorithm: Algorithm = algorithm.parse().map_err(|error| {
        PyValueError::new_err(format!(
            "{}{}",
            sentence(&error),
            coloring_suggestion(&error)
        ))
    })?;
    compute(py, || {
        let colored = color_constraints(algorithm, &incidence, seed);
        let mut colored = colored.map_err(|error| failed(&error))?;
        if balance {
            let weights = vec![1; incidence.constraint_count()];
            balance_classes(&incidence, &mut colored.coloring, &weights);
        }
        let verified = colored.coloring.verify_incidence(&incidence);
        verified.map_err(|error| PyRuntimeError::new_err(sentence(&error)))?;
        Ok(Coloring {
            coloring: colored.coloring,
            bound: incidence.clique_bound(),
            rounds: colored.rounds,
        })
    })?
}

/// Merges neighboring constraints into clusters, which need fewer colors.
///
/// Parameters
/// ----------
/// constraints : (m, k) array-like of int, (offsets, values), or sparse matrix
///     Particles of each constraint, as in ``color``.
/// method : str
///     ``serial:K``, ``serial-loose:K``, ``greedy-k:K`` or ``pressure:K`` with the largest size of a cluster, or ``none``.
/// particles : int, optional
///     Number of particles; by default one more than the largest number in use.
///
/// Returns a ``Clustering``; ``color(clustering.quotient)`` colors the clusters. Deterministic. Raises ``ValueError`` as
/// ``color`` does.
#[pyfunction]
#[pyo3(signature = (constraints, method="serial:10", *, particles=None))]
pub(crate) fn cluster(
    py: Python<'_>,
    constraints: &Bound<'_, PyAny>,
    method: &str,
    particles: Option<Whole<usize>>,
) -> PyResult<Clustering> {
    let incidence = incidence(constraints, particles)?;
    let method: Method = method.parse().map_err(|error| {
        PyValueError::new_err(format!(
            "{}{}",
            sentence(&error),
            clustering_suggestion(&error)
        ))
    })?;
    compute(py, || {
        let clustering = cluster_constraints(method, &incidence);
        let quotient = incidence.quotient(&clustering);
        Clustering {
            clustering,
            quotient,
        }
    })
}
