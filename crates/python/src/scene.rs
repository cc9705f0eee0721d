//! Scenes as dictionaries and files, and `advise`.
//!
//! A dictionary has the keys of a scene file (`docs/scene.md`). Cost: that of reading.

use std::path::PathBuf;

use incise::Scene;
use incise::advise::{AdviseSettings, advise as search, default_frames};
use incise::scene::location;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::compute::compute;
use crate::failure::{failed, invalid, refused, refused_at};
use crate::value::{Whole, from_serde, from_toml, optional, scene_of, table};

/// A scene and the file that it came from.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) scene: Scene,
    path: Option<PathBuf>,
}

impl Source {
    /// What a function takes as a scene: a dictionary or the path of a file.
    pub(crate) fn from_argument(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(dictionary) = object.cast::<PyDict>() {
            let scene = scene_of(&table("", dictionary)?)?;
            return Ok(Self { scene, path: None });
        }
        let path: PathBuf = object.extract()?;
        let scene = Scene::load(&path).map_err(|error| match error {
            incise::Error::Parse { .. } => refused_at(Some(path.display().to_string()), &error),
            _ => refused(&error),
        })?;
        let path = Some(path);
        Ok(Self { scene, path })
    }

    /// The exception for an error of this scene, with file and line if it came from a file.
    pub(crate) fn refused(&self, error: &incise::Error) -> PyErr {
        let place = self.path.as_ref().and_then(|path| location(path, error));
        refused_at(place, error)
    }
}

/// A scene as a dictionary, with its defaults.
pub(crate) fn dictionary<'py>(py: Python<'py>, scene: &Scene) -> PyResult<Bound<'py, PyAny>> {
    let value = toml::Value::try_from(scene).map_err(|error| failed(&error))?;
    from_toml(py, &value)
}

/// Reads a scene file as a dict, with the defaults of its keys and with the paths of mesh files relative to the file.
///
/// Change it and pass it to ``Simulation.from_scene`` or ``advise``. Raises ``FileNotFoundError``, or ``ValueError`` with the
/// line of an unknown key and the nearest known one.
#[pyfunction]
#[pyo3(signature = (path, /))]
pub(crate) fn load_scene<'py>(
    py: Python<'py>,
    path: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    dictionary(py, &Source::from_argument(path)?.scene)
}

/// The built-in scene of the command line as a dict: a liver that is held at one side and sliced by a moving blade.
#[pyfunction]
pub(crate) fn built_in_scene(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    dictionary(py, &Scene::built_in())
}

/// A scene, a dict or the path of a file, as TOML: the text of a scene file.
#[pyfunction]
#[pyo3(signature = (scene, /))]
pub(crate) fn scene_to_toml(scene: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = Source::from_argument(scene)?.scene.to_toml();
    text.map_err(|error| refused(&error))
}

/// Measures time and error of solver settings for a scene on this machine, and recommends settings for a time budget.
///
/// Parameters
/// ----------
/// scene : dict or path
///     The scene, with the keys of a scene file.
/// budget_ms : float
///     Time budget of a frame in ms.
/// frames : int, optional
///     Number of measured frames; by default those of strokes and attachments and half a second, at most 100.
/// threads : int, optional
///     Number of threads; by default all.
///
/// Returns a dict with ``measured``, a list of settings by rising time: ``name``, ``solver`` (TOML), ``ms``, ``error``
/// (``motion``, ``largest``, ``end``, ``volume`` in %); ``best``, the index of the most accurate one within the budget or
/// None; ``reference`` and ``left_out``. Takes from seconds to minutes; other threads of Python go on.
#[pyfunction]
#[pyo3(signature = (scene, budget_ms, *, frames=None, threads=None))]
pub(crate) fn advise<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    budget_ms: f64,
    frames: Option<Whole<u32>>,
    threads: Option<Whole<usize>>,
) -> PyResult<Bound<'py, PyAny>> {
    let source = Source::from_argument(scene)?;
    let frames = optional("frames", frames)?;
    let frames = frames.unwrap_or_else(|| default_frames(&source.scene));
    let mut question = AdviseSettings::new(budget_ms, frames);
    question.threads = optional("threads", threads)?;
    let advice = compute(py, || search(&source.scene, &question))?;
    let advice = advice.map_err(|error| source.refused(&error))?;
    let result = from_serde(py, &advice)?;
    for measured in result.get_item("measured")?.try_iter()? {
        let measured = measured?;
        let text: String = measured.get_item("solver")?.extract()?;
        let table: toml::Value = toml::from_str(&text).map_err(|error| invalid(&error))?;
        let settings = table.get("solver").unwrap_or(&table);
        measured.set_item("settings", from_toml(py, settings)?)?;
    }
    Ok(result)
}
