//! NumPy arrays in and out.
//!
//! Arrays are read and made by calls of NumPy and through `bytes`, so that this crate needs neither unsafe code nor NumPy's
//! C interface, and one wheel serves all versions of NumPy. An input is any array-like of the right shape, of any memory
//! layout; its numbers are copied once. An output is a read-only array on a `bytes` object of its own, which keeps the
//! memory alive: it stays valid and unchanged while the simulation goes on.
//!
//! Cost: a copy of the numbers.

use incise::mesh::glam::DVec3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyModule};

/// An error that names an argument.
fn wrong(name: &str, what: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{name} {what}"))
}

/// The text of a shape, as Python prints it.
fn text(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}

/// An argument as an array with its shape; `kinds` are the kinds of numbers that it may have.
fn array<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
    kinds: &str,
    what: &str,
) -> PyResult<(Bound<'py, PyAny>, Vec<usize>)> {
    let numpy = PyModule::import(object.py(), "numpy")?;
    let array = numpy.call_method1("asarray", (object,));
    let array = array.map_err(|error| wrong(name, format_args!("is not an array: {error}")))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    // An empty list has the type of floats.
    if !kinds.contains(&kind) && !shape.contains(&0) {
        return Err(wrong(
            name,
            format_args!("has dtype {dtype}: it must be {what}"),
        ));
    }
    Ok((array, shape))
}

/// The numbers of an array, row by row.
fn numbers<const N: usize, T>(
    array: &Bound<'_, PyAny>,
    dtype: &str,
    read: fn([u8; N]) -> T,
) -> PyResult<Vec<T>> {
    let numpy = PyModule::import(array.py(), "numpy")?;
    let bytes = numpy
        .call_method1("asarray", (array, dtype))?
        .call_method0("tobytes")?;
    let (numbers, _) = bytes.cast::<PyBytes>()?.as_bytes().as_chunks();
    Ok(numbers.iter().map(|number| read(*number)).collect())
}

fn floats(name: &str, object: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let (array, shape) = array(name, object, "fiu", "real numbers")?;
    Ok((numbers(&array, "=f8", f64::from_ne_bytes)?, shape))
}

/// A vector of three numbers.
pub(crate) fn vector(name: &str, object: &Bound<'_, PyAny>) -> PyResult<DVec3> {
    match floats(name, object)? {
        (numbers, shape) if shape == [3] => Ok(DVec3::from_slice(&numbers)),
        (_, shape) => Err(wrong(
            name,
            format_args!("has shape {}: it must be (3,)", text(&shape)),
        )),
    }
}

/// Points or vectors: an array of shape (n, 3).
pub(crate) fn vectors(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<DVec3>> {
    let (numbers, shape) = floats(name, object)?;
    if shape.len() != 2 || shape[1] != 3 {
        let what = format!("has shape {}: it must be (n, 3)", text(&shape));
        return Err(wrong(name, what));
    }
    let (rows, _) = numbers.as_chunks();
    Ok(rows.iter().map(|row| DVec3::from_array(*row)).collect())
}

/// Whole numbers from 0 to below a limit, with the shape of their array; `of` says what they number.
pub(crate) fn indices(
    name: &str,
    object: &Bound<'_, PyAny>,
    limit: usize,
    of: &str,
) -> PyResult<(Vec<u32>, Vec<usize>)> {
    let (array, shape) = array(name, object, "iu", "whole numbers")?;
    let numbers = numbers(&array, "=i8", i64::from_ne_bytes)?;
    let index = |(at, &number): (usize, &i64)| {
        let index = u32::try_from(number).ok();
        index.filter(|i| (*i as usize) < limit).ok_or_else(|| {
            let name = format!("{name}{}", place(at, &shape));
            let range = range(limit);
            wrong(&name, format_args!("is {number}: it must be {range}, {of}"))
        })
    };
    let indices: PyResult<_> = numbers.iter().enumerate().map(index).collect();
    Ok((indices?, shape))
}

/// The place of a number in an array, as in `[5, 2]`.
fn place(at: usize, shape: &[usize]) -> String {
    match shape {
        [_, columns] => format!("[{}, {}]", at / columns, at % columns),
        _ => format!("[{at}]"),
    }
}

fn range(limit: usize) -> String {
    match limit {
        0 => "absent, since there is nothing".to_owned(),
        _ => format!("from 0 to {}", limit - 1),
    }
}

/// Rows of `N` whole numbers: an array of shape (n, N).
pub(crate) fn rows<const N: usize>(
    name: &str,
    object: &Bound<'_, PyAny>,
    limit: usize,
    of: &str,
) -> PyResult<Vec<[u32; N]>> {
    let (indices, shape) = indices(name, object, limit, of)?;
    if shape.len() != 2 || shape[1] != N {
        let what = format!("has shape {}: it must be (n, {N})", text(&shape));
        return Err(wrong(name, what));
    }
    Ok(indices.as_chunks().0.to_vec())
}

/// Numbers of particles: of an array of numbers, or where an array of truth values has one for each particle.
pub(crate) fn selection(name: &str, object: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<u32>> {
    let (array, shape) = array(name, object, "iub", "whole numbers or truth values")?;
    if shape.len() != 1 {
        let what = format!("has shape {}: it must be (n,)", text(&shape));
        return Err(wrong(name, what));
    }
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind != "b" {
        return Ok(indices(name, object, count, "the number of a point")?.0);
    }
    if shape != [count] {
        let what = format!(
            "has shape {}: it must be ({count},), a truth value for each point",
            text(&shape)
        );
        return Err(wrong(name, what));
    }
    let chosen = array.call_method0("nonzero")?.get_item(0)?;
    Ok(indices(name, &chosen, count, "the number of a point")?.0)
}

/// A read-only array on the bytes of some numbers.
fn on_bytes<'py, const N: usize>(
    py: Python<'py>,
    shape: &[usize],
    dtype: &str,
    numbers: impl Iterator<Item = [u8; N]>,
) -> PyResult<Bound<'py, PyAny>> {
    let size = N * shape.iter().product::<usize>();
    let bytes = PyBytes::new_with(py, size, |bytes| {
        let (places, _) = bytes.as_chunks_mut();
        for (place, number) in places.iter_mut().zip(numbers) {
            *place = number;
        }
        Ok(())
    })?;
    let numpy = PyModule::import(py, "numpy")?;
    let shape = pyo3::types::PyTuple::new(py, shape)?;
    numpy.call_method1("ndarray", (shape, dtype, bytes))
}

/// Points or vectors as a read-only array of shape (n, 3), float64.
pub(crate) fn from_vectors<'py>(py: Python<'py>, vectors: &[DVec3]) -> PyResult<Bound<'py, PyAny>> {
    let numbers = vectors.iter().flat_map(|x| x.to_array());
    on_bytes(
        py,
        &[vectors.len(), 3],
        "=f8",
        numbers.map(f64::to_ne_bytes),
    )
}

/// A vector as a read-only array of shape (3,), float64.
pub(crate) fn from_vector(py: Python<'_>, vector: DVec3) -> PyResult<Bound<'_, PyAny>> {
    on_bytes(
        py,
        &[3],
        "=f8",
        vector.to_array().into_iter().map(f64::to_ne_bytes),
    )
}

/// Numbers as a read-only array of shape (n,), float64.
pub(crate) fn from_floats<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    on_bytes(
        py,
        &[numbers.len()],
        "=f8",
        numbers.iter().map(|x| x.to_ne_bytes()),
    )
}

/// Whole numbers as a read-only array of shape (n,), int64, the type of NumPy's own indices.
pub(crate) fn from_indices(
    py: Python<'_>,
    numbers: impl ExactSizeIterator<Item = u32>,
) -> PyResult<Bound<'_, PyAny>> {
    let shape = [numbers.len()];
    on_bytes(
        py,
        &shape,
        "=i8",
        numbers.map(|i| i64::from(i).to_ne_bytes()),
    )
}

/// Rows of whole numbers as a read-only array of shape (n, N), int64.
pub(crate) fn from_rows<const N: usize>(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = [u32; N]>,
) -> PyResult<Bound<'_, PyAny>> {
    let shape = [rows.len(), N];
    on_bytes(
        py,
        &shape,
        "=i8",
        rows.flatten().map(|i| i64::from(i).to_ne_bytes()),
    )
}

/// Signed whole numbers as a read-only array of shape (n,), int64.
pub(crate) fn from_signed(
    py: Python<'_>,
    numbers: impl ExactSizeIterator<Item = i64>,
) -> PyResult<Bound<'_, PyAny>> {
    let shape = [numbers.len()];
    on_bytes(py, &shape, "=i8", numbers.map(i64::to_ne_bytes))
}
