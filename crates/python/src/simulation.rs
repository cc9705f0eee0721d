//! `Simulation`: the facade's simulation behind a lock.
//!
//! Every call that computes releases the interpreter first and takes the lock then, so that a thread never waits for a frame
//! while it holds the interpreter. A call from another thread waits until the frame is over. No object of Python is made or
//! called while the lock is held.
//!
//! Cost: that of the facade's functions, and copies of the arrays.

use std::sync::{Mutex, MutexGuard, PoisonError};

use incise::mesh::glam::{DQuat, DVec3};
use incise::report::{ContactForce, Force};
use incise::scene::{Region, SolidBladeSpec, StrokeSpec};
use incise::{BodyHandle, Event, SimulationBuilder};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use toml::{Table, Value};

use crate::array::{self, vector, vectors};
use crate::body::Body;
use crate::compute::compute;
use crate::failure::{failed, refused};
use crate::handles::{Attachment, Collider, Distance, Grab};
use crate::mesh::Mesh;
use crate::scene::Source;
use crate::snapshot::Snapshot;
use crate::surface::{Surface, TrackedSkin, tag};
use crate::value::{
    Whole, from_serde, from_toml, optional, scene_of, scene_with, scene_with_one, to_toml,
};

/// A simulation with the skin that `surface` keeps.
#[derive(Debug)]
struct State {
    simulation: incise::Simulation,
    /// From the first call of `surface` on.
    skin: Option<TrackedSkin>,
}

impl State {
    fn step(&mut self) -> Result<(), incise::Error> {
        let step = self.simulation.step().map(|_| ());
        match (&step, &mut self.skin) {
            (Ok(()), Some(skin)) => skin.apply_deltas(&self.simulation),
            (Ok(()), None) => {}
            // Some of the cuts may have been made.
            (Err(_), skin) => *skin = None,
        }
        step
    }

    fn body(&self, number: usize) -> PyResult<BodyHandle> {
        let mut bodies = self.simulation.bodies().into_iter();
        bodies.find(|body| body.index() == number).ok_or_else(|| {
            let message =
                format!("body is {number}: it must be the number of a body that was not removed");
            PyValueError::new_err(message)
        })
    }
}

/// Soft bodies that move, and are cut, frame by frame.
///
/// Parameters
/// ----------
/// bodies : Body or iterable of Body
///     Bodies, numbered from 0 in this order.
/// gravity : (3,) array-like, optional
///     Acceleration in m/s²; without it there is none.
/// ground : float or dict, optional
///     A floor: its height in m, or ``{"height": 0.0, "friction": 0.5}``. Up is z.
/// contact : bool or dict, optional
///     Contact between bodies, their pieces and the sides of cuts: True, or ``{"friction": 0.3, ...}``.
/// solver, cutting : dict, optional
///     Settings with the keys of a scene file, such as ``{"time_step": 0.016, "substeps": 8, "precision": "f64"}``.
/// report : list of str or dict, optional
///     Quantities of reports: ``residual``, ``energy``, ``volume``, ``speed``, ``kappa``, ``force``; or
///     ``{"every": 10, "quantities": [...]}``.
/// colliders, attachments, distances, strokes : list of dict, optional
///     Obstacles, held parts, sutures and cuts, with the keys of a scene file.
/// threads : int, optional
///     Number of threads; by default those of the process. Results are bit-identical for any number.
///
/// Frames take ``time_step`` seconds, 0.016 by default. Functions may be called from several threads; a call waits until
/// the running frame is over. Raises ``ValueError`` for invalid values and meshes.
#[pyclass(frozen, module = "incise")]
#[derive(Debug)]
pub(crate) struct Simulation {
    state: Mutex<State>,
}

impl Simulation {
    fn new(simulation: incise::Simulation) -> Self {
        let skin = None;
        Self {
            state: Mutex::new(State { simulation, skin }),
        }
    }

    /// Computes with the state, while other threads of Python go on.
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut State) -> R + Send,
    ) -> PyResult<R> {
        compute(py, || match self.state.lock() {
            Ok(mut state) => Ok(change(&mut state)),
            Err(poisoned) => Err(lost(poisoned)),
        })?
    }

    /// `with` for what the facade may refuse.
    fn try_with<R: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut incise::Simulation) -> Result<R, incise::Error> + Send,
    ) -> PyResult<R> {
        let result = self.with(py, |state| change(&mut state.simulation))?;
        result.map_err(|error| refused(&error))
    }
}

/// The exception after a defect has ended a call within the lock.
fn lost(_: PoisonError<MutexGuard<'_, State>>) -> PyErr {
    PyRuntimeError::new_err(
        "an earlier call ended in a panic: the state cannot be trusted, set up a new simulation",
    )
}

/// The next frame, unless one is given.
fn frame_or_next(state: &State, frame: Option<u64>) -> u64 {
    frame.unwrap_or_else(|| state.simulation.next_frame())
}

/// A force as a dictionary of arrays.
fn force_dict(py: Python<'_>, force: Force) -> PyResult<Bound<'_, PyDict>> {
    let dictionary = PyDict::new(py);
    dictionary.set_item("force", array::from_vector(py, force.force)?)?;
    dictionary.set_item("torque", array::from_vector(py, force.torque)?)?;
    dictionary.set_item("point", array::from_vector(py, force.point)?)?;
    Ok(dictionary)
}

/// An event as a dictionary.
fn event_dict<'py>(py: Python<'py>, event: &Event) -> PyResult<Bound<'py, PyDict>> {
    let dictionary = PyDict::new(py);
    let kind = match event {
        Event::CutBegan { stroke } => {
            dictionary.set_item("stroke", stroke)?;
            "cut_began"
        }
        Event::PieceDetached(piece) => {
            let piece = from_serde(py, piece)?;
            dictionary.update(piece.cast::<PyDict>()?.as_mapping())?;
            "piece_detached"
        }
        Event::CutEnded { stroke } => {
            dictionary.set_item("stroke", stroke)?;
            "cut_ended"
        }
        Event::ContactBegan { pieces, bodies } => {
            dictionary.set_item("pieces", *pieces)?;
            dictionary.set_item("bodies", *bodies)?;
            "contact_began"
        }
        Event::ContactEnded { pieces, bodies } => {
            dictionary.set_item("pieces", *pieces)?;
            dictionary.set_item("bodies", *bodies)?;
            "contact_ended"
        }
        other => {
            let message = format!("the event {other:?} has no form in Python");
            return Err(PyRuntimeError::new_err(message));
        }
    };
    dictionary.set_item("kind", kind)?;
    Ok(dictionary)
}

/// A setting that may be a number or a truth value in place of a dictionary.
fn short(key: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    Ok(match (key, to_toml(key, object)?) {
        ("contact", Some(Value::Boolean(declared))) => declared.then(|| Value::Table(Table::new())),
        ("ground", Some(Value::Float(height))) => Some(Value::Table(Table::from_iter([(
            "height".to_owned(),
            height.into(),
        )]))),
        ("ground", Some(Value::Integer(height))) => {
            #[expect(clippy::cast_precision_loss, reason = "heights are small")]
            let height = Value::Float(height as f64);
            Some(Value::Table(Table::from_iter([(
                "height".to_owned(),
                height,
            )])))
        }
        ("report", Some(quantities @ Value::Array(_))) => Some(Value::Table(Table::from_iter([(
            "quantities".to_owned(),
            quantities,
        )]))),
        (_, value) => value,
    })
}

fn build(
    py: Python<'_>,
    mut builder: SimulationBuilder,
    threads: Option<Whole<usize>>,
) -> PyResult<Result<Simulation, incise::Error>> {
    if let Some(threads) = optional("threads", threads)? {
        builder.threads(threads);
    }
    Ok(compute(py, || builder.build())?.map(Simulation::new))
}

/// A region for cuts, as a dictionary with the keys of a scene.
fn region(object: &Bound<'_, PyAny>) -> PyResult<Region> {
    let Some(value) = to_toml("region", object)? else {
        return Err(PyValueError::new_err("region is None: give a dict"));
    };
    value.try_into().map_err(|error: toml::de::Error| {
        PyValueError::new_err(format!("region: {}", error.message()))
    })
}

/// The body of a blade, as a dictionary with the keys of a scene.
fn solid_blade(object: &Bound<'_, PyAny>) -> PyResult<Option<SolidBladeSpec>> {
    let Some(value) = to_toml("solid", object)? else {
        return Ok(None);
    };
    let solid = value.try_into();
    solid.map(Some).map_err(|error: toml::de::Error| {
        PyValueError::new_err(format!("solid: {}", error.message()))
    })
}

/// Points of a polyline as a scene has them.
fn triples(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    Ok(vectors(name, object)?
        .into_iter()
        .map(|x| x.to_array())
        .collect())
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (
        bodies, *, gravity=None, ground=None, contact=None, solver=None, report=None, colliders=None, attachments=None,
        distances=None, strokes=None, cutting=None, threads=None,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn python_new(
        py: Python<'_>,
        bodies: &Bound<'_, PyAny>,
        gravity: Option<&Bound<'_, PyAny>>,
        ground: Option<&Bound<'_, PyAny>>,
        contact: Option<&Bound<'_, PyAny>>,
        solver: Option<&Bound<'_, PyAny>>,
        report: Option<&Bound<'_, PyAny>>,
        colliders: Option<&Bound<'_, PyAny>>,
        attachments: Option<&Bound<'_, PyAny>>,
        distances: Option<&Bound<'_, PyAny>>,
        strokes: Option<&Bound<'_, PyAny>>,
        cutting: Option<&Bound<'_, PyAny>>,
        threads: Option<Whole<usize>>,
    ) -> PyResult<Self> {
        let mut scene = Table::new();
        let mut world = Table::new();
        if let Some(gravity) = gravity {
            let gravity = vector("gravity", gravity)?.to_array();
            world.insert("gravity".to_owned(), gravity.to_vec().into());
        }
        if let Some(ground) = ground
            && let Some(value) = short("ground", ground)?
        {
            world.insert("ground".to_owned(), value);
        }
        scene.insert("world".to_owned(), Value::Table(world));
        for (key, object) in [
            ("contact", contact),
            ("solver", solver),
            ("report", report),
            ("collider", colliders),
            ("attachment", attachments),
            ("distance", distances),
            ("stroke", strokes),
            ("cutting", cutting),
        ] {
            if let Some(object) = object
                && let Some(value) = short(key, object)?
            {
                scene.insert(key.to_owned(), value);
            }
        }
        let mut builder = SimulationBuilder::from_scene(scene_of(&scene)?);
        for body in Body::from_argument(bodies)? {
            builder.add_body(body);
        }
        build(py, builder, threads)?.map_err(|error| refused(&error))
    }

    /// A simulation of a scene: the path of a scene file, or a dict with its keys. Files of meshes are relative to the scene
    /// file; in a dict, to the current folder.
    ///
    /// Bit-identical to ``incise run`` of the same scene. Raises ``ValueError`` with file, line and key.
    #[classmethod]
    #[pyo3(signature = (scene, *, threads=None))]
    fn from_scene(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        scene: &Bound<'_, PyAny>,
        threads: Option<Whole<usize>>,
    ) -> PyResult<Self> {
        let source = Source::from_argument(scene)?;
        let builder = SimulationBuilder::from_scene(source.scene.clone());
        build(py, builder, threads)?.map_err(|error| source.refused(&error))
    }

    /// A simulation of the text of a scene file.
    #[classmethod]
    #[pyo3(signature = (text, *, threads=None))]
    fn from_toml(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        text: &str,
        threads: Option<Whole<usize>>,
    ) -> PyResult<Self> {
        let scene = incise::Scene::from_toml(text).map_err(|error| refused(&error))?;
        let builder = SimulationBuilder::from_scene(scene);
        build(py, builder, threads)?.map_err(|error| refused(&error))
    }

    /// A simulation that continues from a snapshot bit-identically, on the threads of the process.
    #[classmethod]
    #[pyo3(signature = (snapshot, /))]
    fn from_snapshot(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        snapshot: &Bound<'_, Snapshot>,
    ) -> PyResult<Self> {
        let snapshot = snapshot.get();
        let simulation = compute(py, || incise::Simulation::from_snapshot(&snapshot.0))?;
        simulation.map(Self::new).map_err(|error| refused(&error))
    }

    /// Advances by one frame and returns its report, see ``report``. Other threads of Python go on meanwhile.
    ///
    /// Raises ``RuntimeError`` if a cut cannot be carried out.
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let step = self.with(py, |state| {
            state.step().map(|()| state.simulation.report().clone())
        })?;
        from_serde(py, &step.map_err(|error| failed(&error))?)
    }

    /// Advances by ``frames`` frames and returns their reports. Ctrl-C ends it between two frames.
    #[pyo3(signature = (frames, /))]
    fn run<'py>(&self, py: Python<'py>, frames: Whole<usize>) -> PyResult<Bound<'py, PyList>> {
        let frames = frames.named("frames")?;
        let reports = PyList::empty(py);
        for _ in 0..frames {
            reports.append(self.step(py)?)?;
            py.check_signals()?;
        }
        Ok(reports)
    }

    /// The report of the last frame as a dict: ``frame``, ``time_s``, ``particles``, ``tets``, ``clusters``, ``colors``,
    /// ``pieces``, ``cut`` (dict or None), ``ms`` (times by stage), ``warnings`` (list, if any) and the quantities asked for:
    /// ``energy`` in J, ``volume`` in m³, ``forces`` in N. The keys are those of ``incise run --jsonl``.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let report = self.with(py, |state| state.simulation.report().clone())?;
        from_serde(py, &report)
    }

    /// Positions of all particles in m, shape (n, 3), float64: a read-only copy that stays valid. Cuts add particles at the
    /// end and keep the numbers of the others.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let positions = self.try_with(py, |simulation| {
            simulation.read_back()?;
            Ok(simulation.positions().to_vec())
        })?;
        array::from_vectors(py, &positions)
    }

    /// Velocities of all particles in m/s, shape (n, 3), float64, in the order of ``positions``: a read-only copy that stays
    /// valid.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let velocities = self.try_with(py, |simulation| {
            simulation.read_back()?;
            Ok(simulation.velocities())
        })?;
        array::from_vectors(py, &velocities)
    }

    /// Masses of all particles in kg, shape (n,), float64, in the order of ``positions``: a read-only copy that stays valid.
    /// In a scene with contact heavy corners of tets at cuts lend mass to light ones, so these are not quarters of the tets.
    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let masses = self.with(py, |state| state.simulation.masses())?;
        array::from_floats(py, &masses)
    }

    /// The mesh at rest of all bodies with all cuts made so far. A removal of tets leaves unused points.
    #[getter]
    fn mesh(&self, py: Python<'_>) -> PyResult<Mesh> {
        let mesh = self.with(py, |state| state.simulation.mesh().clone())?;
        Ok(Mesh { mesh: mesh.into() })
    }

    /// Numbers of the four particles of each tet, shape (m, 4), int64, read-only.
    #[getter]
    fn tets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let tets = self.with(py, |state| state.simulation.mesh().tets.clone())?;
        array::from_rows(py, tets.iter().map(|tet| tet.map(|p| p.0)))
    }

    /// The boundary of all bodies with present positions, outer surface and cut faces, as a ``Surface``. From the first call
    /// on it is updated by cuts, and each call has the ranges that changed since the one before it; all of it has changed
    /// after ``restore`` and ``add_body``.
    fn surface(&self, py: Python<'_>) -> PyResult<Surface> {
        let data = self.with(py, |state| {
            state.simulation.read_back()?;
            let simulation = &state.simulation;
            let skin = state
                .skin
                .get_or_insert_with(|| TrackedSkin::new(simulation));
            Ok(skin.read(simulation.positions()))
        })?;
        Surface::new(py, data.map_err(|error: incise::Error| refused(&error))?)
    }

    /// The pieces of all bodies, ascending: a list of dicts with ``id``, ``parent`` (if it was detached from one), ``body``,
    /// ``tets``, ``volume`` at rest in m³ and ``mass`` in kg.
    #[getter]
    fn pieces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pieces = self.with(py, |state| state.simulation.pieces())?;
        from_serde(py, &pieces)
    }

    /// The number of the piece of each tet, shape (m,), int64, read-only.
    #[getter]
    fn piece_numbers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers = self.with(py, |state| state.simulation.piece_numbers())?;
        array::from_indices(py, numbers.into_iter())
    }

    /// The events of the last frame in order: dicts with ``kind`` (``cut_began``, ``piece_detached``, ``cut_ended``,
    /// ``contact_began``, ``contact_ended``) and ``stroke``, or the keys of the piece, or ``pieces`` and ``bodies``.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let events = self.with(py, |state| state.simulation.events().to_vec())?;
        events.iter().map(|event| event_dict(py, event)).collect()
    }

    /// The cluster of each tet and the color of each cluster that the solver uses: arrays of shape (m,) and (k,), int64. With
    /// several bodies that are solved apart, clusters are numbered body by body.
    #[getter]
    fn partition<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (clusters, colors) = self.with(py, |state| {
            let clustering = state.simulation.clustering();
            let coloring = state.simulation.coloring();
            let clusters: Vec<u32> = clustering.labels().iter().map(|label| label.0).collect();
            let colors: Vec<u32> = coloring.colors().iter().map(|color| color.0).collect();
            (clusters, colors)
        })?;
        let clusters = array::from_indices(py, clusters.into_iter())?;
        Ok((clusters, array::from_indices(py, colors.into_iter())?))
    }

    /// Residual of each tet in the last substep, shape (m,), float64, without unit; None unless the last frame has reported
    /// ``residual``, and for VBD.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let residuals = self.with(py, |state| state.simulation.residuals_of_tets())?;
        residuals
            .map(|numbers| array::from_floats(py, &numbers))
            .transpose()
    }

    /// The number of the next frame, from 0.
    #[getter]
    fn next_frame(&self, py: Python<'_>) -> PyResult<u64> {
        self.with(py, |state| state.simulation.next_frame())
    }

    /// Duration of a frame in s.
    #[getter]
    fn time_step(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |state| state.simulation.time_step())
    }

    /// The numbers of all bodies that were not removed.
    #[getter]
    fn bodies(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        let bodies = self.with(py, |state| state.simulation.bodies())?;
        Ok(bodies.into_iter().map(BodyHandle::index).collect())
    }

    /// The handles of all obstacles but the ground.
    #[getter]
    fn colliders(&self, py: Python<'_>) -> PyResult<Vec<Collider>> {
        let handles = self.with(py, |state| state.simulation.colliders())?;
        Ok(handles.into_iter().map(Collider).collect())
    }

    /// The handles of all attachments.
    #[getter]
    fn attachments(&self, py: Python<'_>) -> PyResult<Vec<Attachment>> {
        let handles = self.with(py, |state| state.simulation.attachments())?;
        Ok(handles.into_iter().map(Attachment).collect())
    }

    /// Adds a cut: a dict with the keys of a stroke in a scene file. ``frame`` is by default the next one.
    #[pyo3(signature = (stroke, /))]
    fn cut(&self, py: Python<'_>, stroke: &Bound<'_, PyDict>) -> PyResult<()> {
        let mut keys = crate::value::table("stroke", stroke)?;
        let kind = keys.get("kind").and_then(Value::as_str);
        if kind != Some("sweep") && !keys.contains_key("frame") {
            let next = i64::try_from(self.next_frame(py)?);
            let next = next.map_err(|error| crate::failure::invalid(&error))?;
            keys.insert("frame".to_owned(), next.into());
        }
        let list = Value::Array(vec![Value::Table(keys)]);
        let mut scene = scene_of(&Table::from_iter([("stroke".to_owned(), list)]))?;
        let stroke = scene.stroke.swap_remove(0);
        self.try_with(py, |simulation| simulation.cut(stroke))
    }

    /// Cuts along the whole plane through ``point`` in m with ``normal`` of any length, at the start of ``frame``, by default
    /// the next one. ``snap`` is the snap distance, 0 to 0.25 of an edge.
    #[pyo3(signature = (point, normal, *, frame=None, snap=0.1))]
    fn cut_plane(
        &self,
        py: Python<'_>,
        point: &Bound<'_, PyAny>,
        normal: &Bound<'_, PyAny>,
        frame: Option<Whole<u64>>,
        snap: f64,
    ) -> PyResult<()> {
        let frame = optional("frame", frame)?;
        let (point, normal) = (vector("point", point)?, vector("normal", normal)?);
        let cut = self.with(py, |state| {
            let frame = frame_or_next(state, frame);
            let stroke = StrokeSpec::plane(frame, point.to_array(), normal.to_array());
            state.simulation.cut(stroke.with_snap(snap))
        })?;
        cut.map_err(|error| refused(&error))
    }

    /// Cuts along a triangle surface, open or closed, at the start of ``frame``, by default the next one. ``points`` has shape
    /// (n, 3) in m, ``triangles`` shape (k, 3).
    #[pyo3(signature = (points, triangles, *, frame=None, snap=0.1))]
    fn cut_triangles(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        frame: Option<Whole<u64>>,
        snap: f64,
    ) -> PyResult<()> {
        let frame = optional("frame", frame)?;
        let points = triples("points", points)?;
        let of = "the number of a point";
        let triangles = array::rows::<3>("triangles", triangles, points.len(), of)?;
        let cut = self.with(py, |state| {
            let stroke = StrokeSpec::surface(frame_or_next(state, frame), points, triangles);
            state.simulation.cut(stroke.with_snap(snap))
        })?;
        cut.map_err(|error| refused(&error))
    }

    /// Cuts with a blade that moves along a path, from the start of the first of ``frames`` to the start of the second.
    /// ``blade`` is a polyline of shape (k, 3) in m, ``path`` has its offsets at equal times, shape (p, 3) in m.
    ///
    /// ``solid`` gives the blade a body that pushes the sides apart: ``{"thickness": 0.002, "wedge_angle_degrees": 20,
    /// "height": 0.1}``.
    #[pyo3(signature = (blade, path, frames, *, snap=0.1, solid=None))]
    fn cut_sweep(
        &self,
        py: Python<'_>,
        blade: &Bound<'_, PyAny>,
        path: &Bound<'_, PyAny>,
        frames: &Bound<'_, PyAny>,
        snap: f64,
        solid: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (blade, path) = (triples("blade", blade)?, triples("path", path)?);
        let frames: [u64; 2] = frames.extract().map_err(|_| {
            PyValueError::new_err(
                "frames must be a pair of whole numbers: the first and the last frame",
            )
        })?;
        let solid = solid.map(solid_blade).transpose()?.flatten();
        let stroke = match solid {
            Some(solid) => StrokeSpec::solid_sweep(frames, blade, path, solid),
            None => StrokeSpec::sweep(frames, blade, path),
        };
        self.try_with(py, |simulation| simulation.cut(stroke.with_snap(snap)))
    }

    /// Cuts a region out as a piece of its own, at the start of ``frame``, by default the next one: ``{"sphere": {"center":
    /// [0, 0, 0], "radius": 0.1}}``, ``box`` or ``half_space``.
    #[pyo3(signature = (region, *, frame=None, snap=0.1))]
    fn punch(
        &self,
        py: Python<'_>,
        region: &Bound<'_, PyAny>,
        frame: Option<Whole<u64>>,
        snap: f64,
    ) -> PyResult<()> {
        let frame = optional("frame", frame)?;
        let region = self::region(region)?;
        let cut = self.with(py, |state| {
            let stroke = StrokeSpec::punch(frame_or_next(state, frame), region);
            state.simulation.cut(stroke.with_snap(snap))
        })?;
        cut.map_err(|error| refused(&error))
    }

    /// Removes the tets whose centers lie in a region, at the start of ``frame``, by default the next one.
    #[pyo3(signature = (region, *, frame=None))]
    fn remove(
        &self,
        py: Python<'_>,
        region: &Bound<'_, PyAny>,
        frame: Option<Whole<u64>>,
    ) -> PyResult<()> {
        let frame = optional("frame", frame)?;
        let region = self::region(region)?;
        let cut = self.with(py, |state| {
            let stroke = StrokeSpec::remove(frame_or_next(state, frame), region);
            state.simulation.cut(stroke)
        })?;
        cut.map_err(|error| refused(&error))
    }

    /// Begins a stroke with a live blade, a polyline of shape (k, 3) in m, and returns its number. This first pose does not
    /// cut; ``move_blade`` moves it, and each frame cuts what the blade passes. ``solid`` as in ``cut_sweep``.
    #[pyo3(signature = (blade, *, snap=0.1, solid=None))]
    fn begin_stroke(
        &self,
        py: Python<'_>,
        blade: &Bound<'_, PyAny>,
        snap: f64,
        solid: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let blade = vectors("blade", blade)?;
        let solid = solid.map(solid_blade).transpose()?.flatten();
        self.try_with(py, |simulation| match solid {
            Some(solid) => simulation.begin_solid_stroke(&blade, snap, &solid),
            None => simulation.begin_stroke(&blade, snap),
        })
    }

    /// Sets the blade of a stroke for the start of the next frame: shape (k, 3) in m, with the points it began with.
    #[pyo3(signature = (stroke, blade))]
    fn move_blade(
        &self,
        py: Python<'_>,
        stroke: Whole<u32>,
        blade: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let stroke = stroke.named("stroke")?;
        let blade = vectors("blade", blade)?;
        self.try_with(py, |simulation| simulation.move_blade(stroke, &blade))
    }

    /// Ends a stroke: after the next frame if its blade was moved since the last one, otherwise at once.
    #[pyo3(signature = (stroke))]
    fn end_stroke(&self, py: Python<'_>, stroke: Whole<u32>) -> PyResult<()> {
        let stroke = stroke.named("stroke")?;
        self.try_with(py, |simulation| simulation.end_stroke(stroke))
    }

    /// Grabs the particles within ``radius`` m of ``point`` that belong to the piece of the nearest one. Returns a ``Grab``,
    /// or None if there is nothing to grab. ``compliance`` in m/N for each particle; 0 is rigid.
    #[pyo3(signature = (point, radius, *, compliance=0.0))]
    fn grab(
        &self,
        py: Python<'_>,
        point: &Bound<'_, PyAny>,
        radius: f64,
        compliance: f64,
    ) -> PyResult<Option<Grab>> {
        let point = vector("point", point)?;
        let grab = self.try_with(py, |simulation| simulation.grab(point, radius, compliance));
        Ok(grab?.map(Grab))
    }

    /// Sets where a grabbed point is at the end of the next frame, in m. Until the next call it stays there.
    #[pyo3(signature = (grab, to))]
    fn move_grab(&self, py: Python<'_>, grab: Grab, to: &Bound<'_, PyAny>) -> PyResult<()> {
        let to = vector("to", to)?;
        self.try_with(py, |simulation| simulation.move_grab(grab.0, to))
    }

    /// Releases a grab. Its particles keep their velocity.
    #[pyo3(signature = (grab))]
    fn release(&self, py: Python<'_>, grab: Grab) -> PyResult<()> {
        self.try_with(py, |simulation| simulation.release(grab.0))
    }

    /// Sets the velocity of each free particle at ``x`` to ``linear + cross(angular, x - center)``: m/s, rad/s and m.
    #[pyo3(signature = (linear, *, angular=None, center=None))]
    fn set_velocities(
        &self,
        py: Python<'_>,
        linear: &Bound<'_, PyAny>,
        angular: Option<&Bound<'_, PyAny>>,
        center: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let linear = vector("linear", linear)?;
        let angular = angular.map_or(Ok(DVec3::ZERO), |angular| vector("angular", angular))?;
        let center = center.map_or(Ok(DVec3::ZERO), |center| vector("center", center))?;
        self.try_with(py, |simulation| {
            simulation.set_velocities(|x| linear + angular.cross(x - center))
        })
    }

    /// Applies an impulse in N·s to the particles within ``radius`` m of ``point``. Returns whether there were any.
    #[pyo3(signature = (point, radius, impulse))]
    fn apply_impulse(
        &self,
        py: Python<'_>,
        point: &Bound<'_, PyAny>,
        radius: f64,
        impulse: &Bound<'_, PyAny>,
    ) -> PyResult<bool> {
        let (point, impulse) = (vector("point", point)?, vector("impulse", impulse)?);
        self.try_with(py, |simulation| {
            simulation.apply_impulse(point, radius, impulse)
        })
    }

    /// The first intersection of a ray with the bodies: a dict with ``point`` in m, ``normal``, ``distance`` in lengths of
    /// ``direction``, ``tet``, ``particles`` of the triangle and its ``tag`` as in ``Surface.tags``; None if there is none.
    #[pyo3(signature = (origin, direction))]
    fn ray_cast<'py>(
        &self,
        py: Python<'py>,
        origin: &Bound<'py, PyAny>,
        direction: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let (origin, direction) = (vector("origin", origin)?, vector("direction", direction)?);
        let hit = self.try_with(py, |simulation| {
            simulation.read_back()?;
            Ok(simulation.ray_cast(origin, direction))
        })?;
        let Some(hit) = hit else { return Ok(None) };
        let dictionary = PyDict::new(py);
        dictionary.set_item("point", array::from_vector(py, hit.point)?)?;
        dictionary.set_item("normal", array::from_vector(py, hit.normal)?)?;
        dictionary.set_item("distance", hit.distance)?;
        dictionary.set_item("tet", hit.tet.0)?;
        dictionary.set_item("particles", PyTuple::new(py, hit.particles.map(|p| p.0))?)?;
        dictionary.set_item("tag", tag(hit.tag))?;
        Ok(Some(dictionary))
    }

    /// Sets the acceleration of gravity in m/s² from the next frame on; None is no gravity.
    #[pyo3(signature = (gravity))]
    fn set_gravity(&self, py: Python<'_>, gravity: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let gravity = gravity
            .map(|gravity| vector("gravity", gravity))
            .transpose()?;
        self.try_with(py, |simulation| simulation.set_gravity(gravity))
    }

    /// The solver settings as a dict with the keys of a scene file.
    #[getter]
    fn solver<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let spec = self.with(py, |state| state.simulation.solver_spec().clone())?;
        let value = Value::try_from(&spec).map_err(|error| failed(&error))?;
        from_toml(py, &value)
    }

    /// Changes solver settings from the next frame on: a dict with the keys to change, such as ``{"substeps": 8}``.
    #[pyo3(signature = (settings, /))]
    fn set_solver(&self, py: Python<'_>, settings: &Bound<'_, PyDict>) -> PyResult<()> {
        let changes = crate::value::table("solver", settings)?;
        let spec = self.with(py, |state| state.simulation.solver_spec().clone())?;
        let mut keys = Table::try_from(&spec).map_err(|error| failed(&error))?;
        keys.extend(changes);
        let scene = scene_of(&Table::from_iter([(
            "solver".to_owned(),
            Value::Table(keys),
        )]))?;
        self.try_with(py, |simulation| simulation.set_solver(&scene.solver))
    }

    /// Sets the quantities of reports from the next frame on: a list of names, or a dict with ``every`` and ``quantities``.
    #[pyo3(signature = (report, /))]
    fn set_report(&self, py: Python<'_>, report: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut table = Table::new();
        if let Some(value) = short("report", report)? {
            table.insert("report".to_owned(), value);
        }
        let scene = scene_of(&table)?;
        self.try_with(py, |simulation| simulation.set_report(scene.report))
    }

    /// Changes friction, thickness, recovery time and self-contact of all contacts: a dict with the keys of a scene file. The
    /// simulation must have been set up with contact.
    #[pyo3(signature = (contact, /))]
    fn set_contact(&self, py: Python<'_>, contact: &Bound<'_, PyAny>) -> PyResult<()> {
        let contact = scene_with("contact", contact)?.contact.unwrap_or_default();
        self.try_with(py, |simulation| simulation.set_contact(&contact))
    }

    /// Adds a body at rest from the next frame on and returns its number.
    #[pyo3(signature = (body, /))]
    fn add_body(&self, py: Python<'_>, body: &Bound<'_, Body>) -> PyResult<usize> {
        let body = body.get().to_rust();
        let added = self.with(py, |state| {
            let added = state.simulation.add_body(body);
            if added.is_ok() {
                state.skin = None;
            }
            added
        })?;
        added
            .map(BodyHandle::index)
            .map_err(|error| refused(&error))
    }

    /// Removes a body with all its pieces at the start of the next frame. Its particles stay, without tets.
    #[pyo3(signature = (body, /))]
    fn remove_body(&self, py: Python<'_>, body: Whole<usize>) -> PyResult<()> {
        let body = body.named("body")?;
        self.with(py, |state| {
            let body = state.body(body)?;
            let removed = state.simulation.remove_body(body);
            removed.map_err(|error| refused(&error))
        })?
    }

    /// Adds an obstacle, a dict with the keys of a scene file: ``{"kind": "sphere", "center": [0, 0, 1], "radius": 0.2}``,
    /// ``plane``, ``capsule`` or ``box``.
    #[pyo3(signature = (collider, /))]
    fn add_collider(&self, py: Python<'_>, collider: &Bound<'_, PyAny>) -> PyResult<Collider> {
        let scene = scene_with_one("collider", collider)?;
        let added = self.try_with(py, |simulation| simulation.add_collider(&scene.collider[0]));
        added.map(Collider)
    }

    /// Moves an obstacle in a straight line to a position in m during the next frame.
    #[pyo3(signature = (collider, to))]
    fn move_collider(
        &self,
        py: Python<'_>,
        collider: Collider,
        to: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let to = vector("to", to)?;
        self.try_with(py, |simulation| simulation.move_collider(collider.0, to))
    }

    /// Replaces shape, position, friction and velocity of an obstacle: a dict as in ``add_collider``.
    #[pyo3(signature = (collider, spec))]
    fn set_collider(
        &self,
        py: Python<'_>,
        collider: Collider,
        spec: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let scene = scene_with_one("collider", spec)?;
        self.try_with(py, |simulation| {
            simulation.set_collider(collider.0, &scene.collider[0])
        })
    }

    /// Position of an obstacle in m, shape (3,): the point of a plane, the center of a sphere or box, the middle of a capsule.
    #[pyo3(signature = (collider))]
    fn collider_position<'py>(
        &self,
        py: Python<'py>,
        collider: Collider,
    ) -> PyResult<Bound<'py, PyAny>> {
        let position = self.try_with(py, |simulation| simulation.collider_position(collider.0))?;
        array::from_vector(py, position)
    }

    /// Removes an obstacle.
    #[pyo3(signature = (collider))]
    fn remove_collider(&self, py: Python<'_>, collider: Collider) -> PyResult<()> {
        self.try_with(py, |simulation| simulation.remove_collider(collider.0))
    }

    /// Holds part of a body from the next frame on, a dict with the keys of a scene file: ``{"body": 0, "regions": [...]}``.
    #[pyo3(signature = (attachment, /))]
    fn add_attachment(
        &self,
        py: Python<'_>,
        attachment: &Bound<'_, PyAny>,
    ) -> PyResult<Attachment> {
        let scene = scene_with_one("attachment", attachment)?;
        let added = self.try_with(py, |simulation| {
            simulation.add_attachment(&scene.attachment[0])
        });
        added.map(Attachment)
    }

    /// Moves an attachment during the next frame: its particles as they were attached, rotated about their center by the
    /// unit quaternion ``rotation`` (x, y, z, w), if any, then displaced by ``offset`` in m.
    #[pyo3(signature = (attachment, offset, *, rotation=None))]
    fn move_attachment(
        &self,
        py: Python<'_>,
        attachment: Attachment,
        offset: &Bound<'_, PyAny>,
        rotation: Option<(f64, f64, f64, f64)>,
    ) -> PyResult<()> {
        let offset = vector("offset", offset)?;
        let rotation =
            rotation.map_or(DQuat::IDENTITY, |(x, y, z, w)| DQuat::from_xyzw(x, y, z, w));
        self.try_with(py, |simulation| {
            simulation.move_attachment(attachment.0, offset, rotation)
        })
    }

    /// Sets the compliance of an attachment for each of its particles in m/N; 0 is rigid.
    #[pyo3(signature = (attachment, compliance))]
    fn set_attachment_compliance(
        &self,
        py: Python<'_>,
        attachment: Attachment,
        compliance: f64,
    ) -> PyResult<()> {
        self.try_with(py, |simulation| {
            simulation.set_attachment_compliance(attachment.0, compliance)
        })
    }

    /// Removes an attachment and releases its particles.
    #[pyo3(signature = (attachment))]
    fn remove_attachment(&self, py: Python<'_>, attachment: Attachment) -> PyResult<()> {
        self.try_with(py, |simulation| simulation.remove_attachment(attachment.0))
    }

    /// Adds a suture, spring or rod, a dict with the keys of a scene file: ``{"from": {"body": 0, "point": [0, 0, 0]},
    /// "to": {"body": 1, "point": [1, 0, 0]}, "length": 0.5}``.
    #[pyo3(signature = (distance, /))]
    fn add_distance(&self, py: Python<'_>, distance: &Bound<'_, PyAny>) -> PyResult<Distance> {
        let scene = scene_with_one("distance", distance)?;
        let added = self.try_with(py, |simulation| simulation.add_distance(&scene.distance[0]));
        added.map(Distance)
    }

    /// Sets rest length in m and compliance in m/N of a suture, spring or rod.
    #[pyo3(signature = (distance, length, *, compliance=0.0))]
    fn set_distance(
        &self,
        py: Python<'_>,
        distance: Distance,
        length: f64,
        compliance: f64,
    ) -> PyResult<()> {
        self.try_with(py, |simulation| {
            simulation.set_distance(distance.0, length, compliance)
        })
    }

    /// Removes a suture, spring or rod.
    #[pyo3(signature = (distance))]
    fn remove_distance(&self, py: Python<'_>, distance: Distance) -> PyResult<()> {
        self.try_with(py, |simulation| simulation.remove_distance(distance.0))
    }

    /// Mean force of the last frame from the bodies on an attachment: a dict with ``force`` in N and ``torque`` in N·m about
    /// ``point`` in m, shape (3,) each. The last frame must have reported ``force``, here and in the other functions.
    #[pyo3(signature = (attachment))]
    fn attachment_force<'py>(
        &self,
        py: Python<'py>,
        attachment: Attachment,
    ) -> PyResult<Bound<'py, PyDict>> {
        force_dict(
            py,
            self.try_with(py, |simulation| simulation.attachment_force(attachment.0))?,
        )
    }

    /// Mean force of the last frame from all bodies on an obstacle, as in ``attachment_force``.
    #[pyo3(signature = (collider))]
    fn collider_force<'py>(
        &self,
        py: Python<'py>,
        collider: Collider,
    ) -> PyResult<Bound<'py, PyDict>> {
        force_dict(
            py,
            self.try_with(py, |simulation| simulation.collider_force(collider.0))?,
        )
    }

    /// Mean force of the last frame from all bodies on the ground, as in ``attachment_force``.
    fn ground_force<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        force_dict(
            py,
            self.try_with(py, |simulation| simulation.ground_force())?,
        )
    }

    /// Mean force of the last frame from the body on a grab: what a hand or a haptic device feels, as in
    /// ``attachment_force``.
    #[pyo3(signature = (grab))]
    fn grab_force<'py>(&self, py: Python<'py>, grab: Grab) -> PyResult<Bound<'py, PyDict>> {
        force_dict(
            py,
            self.try_with(py, |simulation| simulation.grab_force(grab.0))?,
        )
    }

    /// Mean force of the last frame from all bodies on the solid blade of a stroke, as in ``attachment_force``.
    #[pyo3(signature = (stroke))]
    fn blade_force<'py>(
        &self,
        py: Python<'py>,
        stroke: Whole<u32>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let stroke = stroke.named("stroke")?;
        force_dict(
            py,
            self.try_with(py, |simulation| simulation.blade_force(stroke))?,
        )
    }

    /// Mean force of the last frame from a body on what its pinned particles are fixed to, as in ``attachment_force``.
    #[pyo3(signature = (body))]
    fn fixed_force<'py>(
        &self,
        py: Python<'py>,
        body: Whole<usize>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let body = body.named("body")?;
        let force = self.with(py, |state| {
            let force = state.simulation.fixed_force(state.body(body)?);
            force.map_err(|error| refused(&error))
        })?;
        force_dict(py, force?)
    }

    /// Mean force of the last frame on body ``a`` from body ``b``, torque about the origin, as in ``attachment_force``; in a
    /// simulation with contact.
    #[pyo3(signature = (a, b))]
    fn contact_force<'py>(
        &self,
        py: Python<'py>,
        a: Whole<usize>,
        b: Whole<usize>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let a = a.named("a")?;
        let b = b.named("b")?;
        let force = self.with(py, |state| {
            let force = state
                .simulation
                .contact_force(state.body(a)?, state.body(b)?);
            force.map_err(|error| refused(&error))
        })?;
        force_dict(py, force?)
    }

    /// Forces between pieces that touched in the last frame: dicts with ``pieces``, ``bodies``, ``force`` in N on the second
    /// one and ``torque`` in N·m about the origin.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let contacts = self.with(py, |state| state.simulation.contacts())?;
        let dictionary = |contact: ContactForce| {
            let dictionary = PyDict::new(py);
            dictionary.set_item("pieces", contact.pieces)?;
            dictionary.set_item("bodies", contact.bodies)?;
            dictionary.set_item("force", array::from_vector(py, contact.force)?)?;
            dictionary.set_item("torque", array::from_vector(py, contact.torque)?)?;
            Ok(dictionary)
        };
        contacts.into_iter().map(dictionary).collect()
    }

    /// What the blade of a stroke has parted so far against its toughness: work in J and area in m².
    #[pyo3(signature = (stroke))]
    fn cut_work(&self, py: Python<'_>, stroke: Whole<u32>) -> PyResult<(f64, f64)> {
        let stroke = stroke.named("stroke")?;
        let parted = self.try_with(py, |simulation| simulation.cut_work(stroke))?;
        Ok((parted.work, parted.area))
    }

    /// Copies the present state, for ``restore`` and ``from_snapshot``.
    fn snapshot(&self, py: Python<'_>) -> PyResult<Snapshot> {
        let snapshot = self.try_with(py, |simulation| simulation.snapshot())?;
        Ok(Snapshot(snapshot))
    }

    /// Restores the state of a snapshot; the simulation continues bit-identically. Handles of what was added later are
    /// invalid.
    #[pyo3(signature = (snapshot, /))]
    fn restore(&self, py: Python<'_>, snapshot: &Bound<'_, Snapshot>) -> PyResult<()> {
        let snapshot = snapshot.get();
        let restored = self.with(py, |state| {
            state.skin = None;
            state.simulation.restore(&snapshot.0)
        })?;
        restored.map_err(|error| refused(&error))
    }

    /// Recomputes all derived data and compares: mesh, masses, clusters, colors, schedule, pieces. Slow; for tests. Raises
    /// ``RuntimeError`` with the first difference.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let checked = self.with(py, |state| state.simulation.check())?;
        checked.map_err(|error| failed(&error))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Snapshot,))> {
        let make = slf.get_type().getattr("from_snapshot")?;
        Ok((make, (slf.get().snapshot(slf.py())?,)))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |state| {
            let report = state.simulation.report();
            format!(
                "<incise.Simulation of {} tets in {} piece(s), next frame {}>",
                report.tets,
                report.pieces,
                state.simulation.next_frame()
            )
        })
    }
}
