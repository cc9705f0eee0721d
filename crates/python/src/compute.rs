//! `compute`: a computation without the interpreter, on the threads of the process.
//!
//! The threads of the pool are started by the first computation. A process that is forked later has a copy of the pool without
//! its threads and would wait for them forever, so it gets an error in place of that.
//!
//! Cost: a comparison.

use std::process;
use std::sync::OnceLock;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Computes while other threads of Python go on.
///
/// # Errors
/// `RuntimeError` if this process was forked from one that had computed before.
pub(crate) fn compute<R: Send>(
    py: Python<'_>,
    computation: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    let here = process::id();
    if *FIRST.get_or_init(|| here) == here {
        return Ok(py.detach(computation));
    }
    Err(PyRuntimeError::new_err(
        "this process was forked from one that has computed before, and has no copy of its threads: start processes by \
         `spawn`, as in multiprocessing.get_context(\"spawn\"), or with joblib or Dask",
    ))
}
