//! Errors as Python's exceptions.
//!
//! Invalid input is a `ValueError`, a missing file a `FileNotFoundError` and another error of the system an `OSError`; a
//! failed run is a `RuntimeError`. The message is the sentence of the error with its causes, as the command line prints it.

use std::error::Error as StdError;
use std::io;

use incise::Error;
use incise::mesh_io::MeshIoError;
use pyo3::PyErr;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyRuntimeError, PyValueError};

/// The error and its causes in one line. A cause whose text is part of the message is left out.
pub(crate) fn sentence(error: &dyn StdError) -> String {
    let mut sentence = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let text = cause.to_string();
        if !sentence.contains(&text) {
            sentence = format!("{sentence}: {text}");
        }
        next = cause.source();
    }
    sentence.replace('\n', " ")
}

/// The exception for a file that cannot be read or written.
fn of_system(source: &io::Error, message: String) -> PyErr {
    match source.kind() {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(message),
        _ => PyOSError::new_err(message),
    }
}

/// The exception for invalid input, with a place in front of the sentence.
pub(crate) fn refused_at(place: Option<String>, error: &Error) -> PyErr {
    let message = match place {
        Some(place) => format!("{place}: {}", sentence(error)),
        None => sentence(error),
    };
    match error {
        Error::Read { source, .. }
        | Error::MeshFile {
            source: MeshIoError::Io { source, .. },
            ..
        } => of_system(source, message),
        Error::Inconsistent(_) | Error::Threads { .. } => PyRuntimeError::new_err(message),
        _ => PyValueError::new_err(message),
    }
}

/// The exception for invalid input.
pub(crate) fn refused(error: &Error) -> PyErr {
    refused_at(None, error)
}

/// The exception for a mesh file that cannot be read or written.
pub(crate) fn refused_file(error: &MeshIoError) -> PyErr {
    match error {
        MeshIoError::Io { source, .. } => of_system(source, sentence(error)),
        _ => PyValueError::new_err(sentence(error)),
    }
}

/// The exception for any other invalid value.
pub(crate) fn invalid(error: &dyn StdError) -> PyErr {
    PyValueError::new_err(sentence(error))
}

/// The exception for a failed run.
pub(crate) fn failed(error: &dyn StdError) -> PyErr {
    PyRuntimeError::new_err(sentence(error))
}
