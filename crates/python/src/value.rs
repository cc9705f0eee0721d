//! Settings and reports: Python's dictionaries to TOML, and anything that serializes to Python's dictionaries.
//!
//! A dictionary of settings has the keys of a scene file and takes the same way as one: through TOML and
//! [`Scene::from_toml`], so that defaults, checks and suggestions for misspelled keys are those of scene files.

use incise::Scene;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde::Serialize;
use serde_json::Value as Json;
use toml::{Table, Value};

use crate::failure::refused;

/// A whole number as an argument. One that is out of range is an error with the name of the argument, not Python's
/// `OverflowError` without one.
#[derive(Clone, Debug)]
pub(crate) struct Whole<T>(Result<T, String>);

impl<T> From<T> for Whole<T> {
    fn from(number: T) -> Self {
        Self(Ok(number))
    }
}

impl<'a, 'py, T: FromPyObject<'a, 'py>> FromPyObject<'a, 'py> for Whole<T> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        match T::extract(object).map_err(Into::<PyErr>::into) {
            Ok(number) => Ok(number.into()),
            Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
                Ok(Self(Err(object.to_string())))
            }
            Err(error) => Err(error),
        }
    }
}

impl<T> Whole<T> {
    /// The number of an argument with a name.
    pub(crate) fn named(self, name: &str) -> PyResult<T> {
        self.0.map_err(|text| {
            let why = match text.starts_with('-') {
                true => "it must not be negative",
                false => "it is too large",
            };
            PyValueError::new_err(format!("{name} is {text}: {why}"))
        })
    }
}

/// The number of an argument that may be absent.
pub(crate) fn optional<T>(name: &str, number: Option<Whole<T>>) -> PyResult<Option<T>> {
    number.map(|number| number.named(name)).transpose()
}

/// A value of Python as TOML; `None` for Python's `None`. `place` is its key, for messages.
pub(crate) fn to_toml(place: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    if object.is_none() {
        return Ok(None);
    }
    let value = if object.is_instance_of::<PyBool>() {
        Value::Boolean(object.extract()?)
    } else if object.is_instance_of::<PyInt>() {
        Value::Integer(object.extract::<Whole<i64>>()?.named(place)?)
    } else if object.is_instance_of::<PyFloat>() {
        Value::Float(object.extract()?)
    } else if object.is_instance_of::<PyString>() {
        Value::String(object.extract()?)
    } else if let Ok(dictionary) = object.cast::<PyDict>() {
        Value::Table(table(place, dictionary)?)
    } else if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        let items = object.try_iter()?.enumerate();
        let items = items.map(|(i, item)| {
            let place = format!("{place}[{i}]");
            let missing = || PyValueError::new_err(format!("{place} is None"));
            to_toml(&place, &item?)?.ok_or_else(missing)
        });
        Value::Array(items.collect::<PyResult<_>>()?)
    } else if object.hasattr("tolist")? {
        // An array or a number of NumPy.
        return to_toml(place, &object.call_method0("tolist")?);
    } else if object.hasattr("__fspath__")? {
        return to_toml(place, &object.call_method0("__fspath__")?);
    } else {
        let kind = object.get_type().name()?;
        let message =
            format!("{place} is a {kind}: it must be a number, a string, a list or a dict");
        return Err(PyTypeError::new_err(message));
    };
    Ok(Some(value))
}

/// A dictionary as a table; keys whose value is `None` are left out.
pub(crate) fn table(place: &str, dictionary: &Bound<'_, PyDict>) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, value) in dictionary {
        let Ok(key) = key.extract::<String>() else {
            let message = format!("{place} has the key {}: keys are strings", key.repr()?);
            return Err(PyTypeError::new_err(message));
        };
        let inside = match place {
            "" => key.clone(),
            _ => format!("{place}.{key}"),
        };
        if let Some(value) = to_toml(&inside, &value)? {
            table.insert(key, value);
        }
    }
    Ok(table)
}

/// The scene of a table with its keys.
pub(crate) fn scene_of(table: &Table) -> PyResult<Scene> {
    let text = toml::to_string(table).map_err(|error| crate::failure::invalid(&error))?;
    Scene::from_toml(&text).map_err(|error| {
        // The line would be that of a text that the caller has never seen.
        refused(&match error {
            incise::Error::Parse { message, .. } => incise::Error::Parse {
                line: None,
                message,
            },
            other => other,
        })
    })
}

/// The scene with one part that is not a list, such as `solver`.
pub(crate) fn scene_with(key: &str, object: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let mut table = Table::new();
    if let Some(value) = to_toml(key, object)? {
        table.insert(key.to_owned(), value);
    }
    scene_of(&table)
}

/// The scene with one item of a list, such as a collider.
pub(crate) fn scene_with_one(key: &str, item: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let Some(item) = to_toml(key, item)? else {
        return Err(PyValueError::new_err(format!("{key} is None: give a dict")));
    };
    let mut table = Table::new();
    table.insert(key.to_owned(), Value::Array(vec![item]));
    scene_of(&table)
}

/// Anything that serializes as Python's dictionaries, lists and numbers. Floats keep their bits; Inf and NaN are `None`.
pub(crate) fn from_serde<'py>(
    py: Python<'py>,
    value: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let json = serde_json::to_value(value).map_err(|error| crate::failure::failed(&error))?;
    from_json(py, &json)
}

fn from_json<'py>(py: Python<'py>, json: &Json) -> PyResult<Bound<'py, PyAny>> {
    match json {
        Json::Null => Ok(py.None().into_bound(py)),
        Json::Bool(value) => value.into_bound_py_any(py),
        Json::Number(number) => match (number.as_u64(), number.as_i64()) {
            (Some(number), _) => number.into_bound_py_any(py),
            (None, Some(number)) => number.into_bound_py_any(py),
            (None, None) => number.as_f64().into_bound_py_any(py),
        },
        Json::String(text) => text.into_bound_py_any(py),
        Json::Array(items) => {
            let items = items.iter().map(|item| from_json(py, item));
            let items: Vec<_> = items.collect::<PyResult<_>>()?;
            PyList::new(py, items)?.into_bound_py_any(py)
        }
        Json::Object(items) => {
            let dictionary = PyDict::new(py);
            for (key, item) in items {
                dictionary.set_item(key, from_json(py, item)?)?;
            }
            dictionary.into_bound_py_any(py)
        }
    }
}

/// A table as Python's dictionary. Infinity stays infinity, unlike in JSON.
pub(crate) fn from_toml<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::String(text) => text.into_bound_py_any(py),
        Value::Integer(number) => number.into_bound_py_any(py),
        Value::Float(number) => number.into_bound_py_any(py),
        Value::Boolean(value) => value.into_bound_py_any(py),
        Value::Datetime(time) => time.to_string().into_bound_py_any(py),
        Value::Array(items) => {
            let items = items.iter().map(|item| from_toml(py, item));
            let items: Vec<_> = items.collect::<PyResult<_>>()?;
            PyList::new(py, items)?.into_bound_py_any(py)
        }
        Value::Table(items) => {
            let dictionary = PyDict::new(py);
            for (key, item) in items {
                dictionary.set_item(key, from_toml(py, item)?)?;
            }
            dictionary.into_bound_py_any(py)
        }
    }
}
