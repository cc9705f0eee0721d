//! [`Source`]: a file or scene to open, and [`Loading`]: the thread that opens it.
//!
//! A mesh without a scene is scaled to the size of an organ and placed on a table, z up, with its lowest part pinned; a
//! closed surface is filled with tets first. Setting up a million tets takes seconds, so a thread does it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use anyhow::{Context, anyhow};
use incise::gpu::GpuContext;
use incise::mesh::glam::DVec3;
use incise::meshing::Solid;
use incise::scene::{Backend, GroundSpec, location};
use incise::{Body, Scene, SimulationBuilder};
use incise::{mesh_io, meshing};
use web_time::Instant;

use crate::session::Session;

/// Default number of tets to fill a surface with.
pub(crate) const TETS: u32 = 11_000;

/// The longest side of a mesh that comes without a scene, in m.
const SIZE: f64 = 0.25;

/// Young's modulus of such a mesh in Pa: it carries its weight and deforms when pulled.
const STIFFNESS: f64 = 4e4;

/// A simulation to load.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    /// A scene, its file and its name.
    Scene(Box<Scene>, Option<PathBuf>, String),
    /// A mesh or a surface without a scene.
    Mesh(MeshSource),
}

/// A mesh or a surface to load.
#[derive(Clone, Debug)]
pub(crate) struct MeshSource {
    path: PathBuf,
    /// The contents of the file, if they are in memory.
    bytes: Option<Vec<u8>>,
    /// Tets to fill a surface with.
    tets: u32,
}

impl Source {
    /// The source in a file, or the built-in scene.
    ///
    /// A scene is read here, so that its errors are shown at once; a mesh file only has to exist.
    pub(crate) fn new(path: Option<&Path>, tets: u32) -> anyhow::Result<Self> {
        let Some(path) = path else {
            let name = "built-in liver".to_owned();
            return Ok(Self::Scene(Box::new(Scene::built_in()), None, name));
        };
        if is_scene(path) {
            let scene = Scene::load(path).with_context(|| path.display().to_string())?;
            let file = Some(path.to_owned());
            return Ok(Self::Scene(Box::new(scene), file, name_of(path)));
        }
        if !path.is_file() {
            return Err(anyhow!("{}: file not found", path.display()));
        }
        Ok(Self::Mesh(MeshSource {
            path: path.to_owned(),
            bytes: None,
            tets,
        }))
    }

    /// The source in the contents of a file, which need not exist.
    #[cfg(any(test, target_family = "wasm"))]
    pub(crate) fn from_bytes(path: &Path, bytes: Vec<u8>, tets: u32) -> anyhow::Result<Self> {
        if !is_scene(path) {
            return Ok(Self::Mesh(MeshSource {
                path: path.to_owned(),
                bytes: Some(bytes),
                tets,
            }));
        }
        let text = String::from_utf8(bytes).with_context(|| path.display().to_string())?;
        let scene = Scene::from_toml(&text).with_context(|| path.display().to_string())?;
        Ok(Self::Scene(Box::new(scene), None, name_of(path)))
    }

    /// The name for the title.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Scene(_, _, name) => name.clone(),
            Self::Mesh(mesh) => name_of(&mesh.path),
        }
    }

    /// Adds the line of the scene file to an error about a key.
    fn locate(&self, error: incise::Error) -> anyhow::Error {
        let location = match self {
            Self::Scene(_, Some(path), _) => location(path, &error),
            _ => None,
        };
        match location {
            Some(location) => anyhow::Error::new(error).context(location),
            None => error.into(),
        }
    }

    /// The scene, and a builder of its simulation on the CPU.
    fn open(&self) -> anyhow::Result<(Scene, SimulationBuilder)> {
        match self {
            Self::Scene(scene, ..) => {
                let mut scene = (**scene).clone();
                // The renderer can only draw from the window's device.
                scene.solver.backend = Backend::Cpu;
                Ok((scene.clone(), SimulationBuilder::from_scene(scene)))
            }
            Self::Mesh(mesh) => scene_around(mesh),
        }
    }
}

fn is_scene(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// A scene with a mesh on a table; a surface is filled with tets.
fn scene_around(source: &MeshSource) -> anyhow::Result<(Scene, SimulationBuilder)> {
    let MeshSource { path, bytes, tets } = source;
    let mesh = if mesh_io::is_surface(path) {
        let surface = match bytes {
            Some(bytes) => mesh_io::parse_surface(path, bytes)?,
            None => mesh_io::read_surface(path)?,
        };
        let solid = Solid::new(&surface).with_context(|| path.display().to_string())?;
        meshing::tetrahedralize(&solid, *tets as usize, 0)
            .with_context(|| path.display().to_string())?
    } else {
        match bytes {
            Some(bytes) => mesh_io::parse_file(path, bytes)?.mesh,
            None => mesh_io::read(path)?,
        }
    };
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let [low, high] = mesh
        .positions
        .iter()
        .fold(start, |[low, high], x| [low.min(*x), high.max(*x)]);
    let scale = SIZE / (high - low).max_element();
    if !scale.is_finite() {
        return Err(anyhow!("{}: the mesh has no extent", path.display()));
    }
    let mut scene = Scene::built_in();
    scene.stroke.clear();
    scene.body.clear();
    let table = GroundSpec::default().with(|spec| spec.friction = 0.5);
    scene.world.ground = Some(table);
    let pinned_below = low.z + 0.1 * (high.z - low.z);
    let middle = (low + high) / 2.0;
    let body = Body::new(mesh)
        .scale(scale)
        .position(DVec3::new(-middle.x, -middle.y, -low.z) * scale)
        .young_modulus(STIFFNESS)
        .pinned(|x| x.z <= pinned_below);
    let mut builder = SimulationBuilder::from_scene(scene.clone());
    builder.add_body(body);
    Ok((scene, builder))
}

/// A simulation that is being loaded.
#[derive(Debug)]
pub(crate) struct Loading {
    pub(crate) name: String,
    pub(crate) since: Instant,
    receiver: Receiver<anyhow::Result<Session>>,
}

impl Loading {
    /// Starts to load, or loads where there are no threads; `wake` is called when it is done. `gpu` is the window's device, if it can simulate.
    pub(crate) fn start(
        source: Source,
        backend: Backend,
        gpu: Option<Arc<GpuContext>>,
        wake: impl FnOnce() + Send + 'static,
    ) -> Self {
        let (sender, receiver) = channel();
        let name = source.name();
        let since = Instant::now();
        let work = move || {
            // The receiver may be gone.
            let _ = sender.send(load(&source, backend, gpu));
            wake();
        };
        if cfg!(target_family = "wasm") {
            work();
        } else {
            std::thread::spawn(work);
        }
        Self {
            name,
            since,
            receiver,
        }
    }

    /// Loads a file of the user of a page once its contents have been read; `wake` is called when it is done.
    #[cfg(target_family = "wasm")]
    pub(crate) fn read(
        path: PathBuf,
        bytes: impl Future<Output = Result<Vec<u8>, String>> + 'static,
        tets: u32,
        wake: impl FnOnce() + 'static,
    ) -> Self {
        let (sender, receiver) = channel();
        let (name, since) = (name_of(&path), Instant::now());
        wasm_bindgen_futures::spawn_local(async move {
            let loaded = bytes
                .await
                .map_err(|why| anyhow!("{}: {why}", path.display()))
                .and_then(|bytes| Source::from_bytes(&path, bytes, tets))
                .and_then(|source| load(&source, Backend::Cpu, None));
            // The receiver may be gone.
            let _ = sender.send(loaded);
            wake();
        });
        Self {
            name,
            since,
            receiver,
        }
    }

    /// The loaded session or the error, once the thread has ended.
    pub(crate) fn poll(&self) -> Option<anyhow::Result<Session>> {
        match self.receiver.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(anyhow!("{}: loading failed", self.name))),
        }
    }
}

fn load(
    source: &Source,
    backend: Backend,
    gpu: Option<Arc<GpuContext>>,
) -> anyhow::Result<Session> {
    let (mut scene, mut builder) = source.open()?;
    // Threads of its own: the window draws on those of the global pool while the simulation steps.
    if !cfg!(target_family = "wasm") {
        builder.threads(std::thread::available_parallelism().map_or(1, usize::from));
    }
    let mut simulation = builder.build().map_err(|error| source.locate(error))?;
    if let Some(gpu) = gpu {
        simulation.offer_device(gpu);
        if backend != Backend::Cpu {
            scene.solver.backend = backend;
            let set = simulation.set_solver(&scene.solver);
            set.map_err(|error| source.locate(error))?;
        }
    }
    Session::new(source.name(), &scene, simulation)
}

#[cfg(test)]
mod tests {
    use incise::mesh::{TriangleSurface, kuhn_box};

    use super::*;

    #[test]
    fn a_mesh_alone_is_an_organ_on_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("body.vtk");
        let mesh = kuhn_box([4, 2, 6], DVec3::new(40.0, 20.0, 60.0));
        mesh_io::write(&path, &mesh).unwrap();
        let loaded = load(&Source::new(Some(&path), TETS).unwrap(), Backend::Cpu, None).unwrap();
        let positions = &loaded.view.positions;
        let high = positions.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
        let low = positions.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
        // The solver's positions are in single precision.
        assert!((high - low - DVec3::new(4.0, 2.0, 6.0) * SIZE / 6.0).length() < 1e-7);
        assert!(low.z.abs() < 1e-7 && (low.x + high.x).abs() < 1e-7);
        assert_eq!(loaded.name, "body.vtk");
    }

    #[test]
    fn files_in_memory_are_read_as_those_on_disk() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = kuhn_box([2; 3], DVec3::ONE);
        let surface = TriangleSurface::boundary_of(&mesh);
        let (a, b, c) = (
            folder.path().join("a.vtk"),
            folder.path().join("b.stl"),
            folder.path().join("c.toml"),
        );
        mesh_io::write(&a, &mesh).unwrap();
        mesh_io::write_surface(&b, &surface).unwrap();
        std::fs::write(&c, "[[body]]\nshape = { kind = \"box\", tets = 300 }\n").unwrap();
        for path in [a, b, c] {
            let bytes = std::fs::read(&path).unwrap();
            let on_disk = Source::new(Some(&path), 500).unwrap();
            let in_memory = Source::from_bytes(&path, bytes, 500).unwrap();
            let [left, right] = [on_disk, in_memory].map(|source| {
                let loaded = load(&source, Backend::Cpu, None).unwrap();
                (loaded.name, loaded.view.positions)
            });
            assert_eq!(left, right);
        }
    }

    #[test]
    fn a_surface_is_filled() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("body.stl");
        let mesh = kuhn_box([2; 3], DVec3::ONE);
        mesh_io::write_surface(&path, &TriangleSurface::boundary_of(&mesh)).unwrap();
        let loaded = load(&Source::new(Some(&path), 2000).unwrap(), Backend::Cpu, None).unwrap();
        let tets = loaded.view.report.tets;
        assert!((1000..4000).contains(&tets), "{tets}");
    }

    #[test]
    fn errors_of_a_scene_name_file_line_and_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        let text = "[[body]]\nshape = { kind = \"box\", tets = 10 }\n\nyoung_modulus = -1.0\n";
        std::fs::write(&path, text).unwrap();
        let source = Source::new(Some(&path), TETS).unwrap();
        let error = format!("{:#}", load(&source, Backend::Cpu, None).unwrap_err());
        assert!(
            error.contains("scene.toml: line 4: body[0].young_modulus"),
            "{error}"
        );
    }

    #[test]
    fn errors_name_the_file() {
        let missing = Source::new(Some(Path::new("missing.vtk")), TETS).unwrap_err();
        assert!(missing.to_string().contains("missing.vtk"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("broken.vtk");
        std::fs::write(&path, "nothing").unwrap();
        let source = Source::new(Some(&path), TETS).unwrap();
        let error = load(&source, Backend::Cpu, None).unwrap_err();
        assert!(format!("{error:#}").contains("broken.vtk"));
    }
}
