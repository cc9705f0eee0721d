//! `Snapshot`: the state of a simulation, in memory or as bytes.
//!
//! Source of the format: `postcard`, behind a mark and a checksum, so that damaged bytes are refused before they are read.
//!
//! Cost: a copy of all arrays, 0.25 to 0.6 kB a tet; bytes cost one more.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};

use crate::compute::compute;
use crate::failure::failed;

/// What the bytes of a snapshot begin with.
const MARK: &[u8; 8] = b"incise\0\x01";

/// A copy of the state of a simulation, to undo cuts, to fork and to continue in another process.
///
/// ``Simulation.snapshot`` makes one; ``Simulation.restore`` and ``Simulation.from_snapshot`` take it, any number of times.
/// ``bytes(snapshot)`` and ``pickle`` keep it for the same version of this package.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Snapshot(pub(crate) incise::Snapshot);

#[pymethods]
impl Snapshot {
    /// Reads the bytes of a snapshot. Raises ``ValueError`` if they are damaged or of another version. Read only bytes from
    /// a source that you trust, as with ``pickle``.
    #[classmethod]
    #[pyo3(signature = (data, /))]
    fn from_bytes(_: &Bound<'_, PyType>, py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let refuse = |what: String| PyValueError::new_err(format!("the bytes {what}"));
        let Some((sum, state)) = data
            .strip_prefix(MARK)
            .and_then(|rest| rest.split_first_chunk())
        else {
            return Err(refuse("are not those of a snapshot".to_owned()));
        };
        if crc32fast::hash(state).to_le_bytes() != *sum {
            return Err(refuse(
                "of the snapshot are damaged: the checksum differs".to_owned(),
            ));
        }
        let read = compute(py, || postcard::from_bytes(state))?;
        read.map(Self).map_err(|error| {
            let version = env!("CARGO_PKG_VERSION");
            refuse(format!(
                "of the snapshot are not of version {version}: {error}"
            ))
        })
    }

    fn __bytes__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let state = compute(py, || postcard::to_stdvec(&self.0))?;
        let state = state.map_err(|error| failed(&error))?;
        let sum = crc32fast::hash(&state).to_le_bytes();
        let parts = [&MARK[..], &sum, &state];
        PyBytes::new_with(
            py,
            parts.iter().map(|part| part.len()).sum(),
            |mut bytes| {
                for part in parts {
                    let (place, rest) = bytes.split_at_mut(part.len());
                    place.copy_from_slice(part);
                    bytes = rest;
                }
                Ok(())
            },
        )
    }

    /// Approximate size in memory in bytes.
    #[getter]
    fn nbytes(&self) -> usize {
        self.0.bytes()
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let make = slf.get_type().getattr("from_bytes")?;
        Ok((make, (slf.get().__bytes__(slf.py())?,)))
    }

    fn __repr__(&self) -> String {
        format!("<incise.Snapshot of about {} bytes>", self.0.bytes())
    }
}
