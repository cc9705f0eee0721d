//! Files of a run: scene, frame reports, surfaces, images and the last mesh.
//!
//! Line files are written under a temporary name and renamed after the run has succeeded and all other files are
//! written; other files are written to a temporary file and renamed. A final name therefore always refers to a complete
//! file. Images and surfaces of an earlier run in the folder are removed at the start, so that all belong to one run.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{self, Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::Context;
use incise::cutting::FaceTag;
use incise::mesh::glam::DVec3;
use incise::mesh::{RepairOptions, Surface, TetMesh, repair};
use incise::mesh_io::{
    Field, Fields, MeshIoError, Values, write_atomically, write_pvd, write_vtp, write_vtu,
};
use incise::{Scene, Simulation};
use incise_render::stretch;

use crate::failure::Failure;
use crate::files::{require_file, save_every};
use crate::pictures::Pictures;

/// Line file that gets its final name at the end.
#[derive(Debug)]
struct Lines {
    path: PathBuf,
    temporary: PathBuf,
    file: Option<BufWriter<File>>,
}

impl Lines {
    fn create(path: &Path) -> anyhow::Result<Self> {
        require_file(path)?;
        let mut name = path.file_name().unwrap_or_default().to_owned();
        // Numbered, because two line files may have one final name.
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        name.push(format!(".partial-{}-{unique}", std::process::id()));
        let temporary = path.with_file_name(name);
        let file =
            File::create(&temporary).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            temporary,
            file: Some(BufWriter::new(file)),
        })
    }

    fn push(&mut self, line: &str) -> anyhow::Result<()> {
        if let Some(file) = &mut self.file {
            writeln!(file, "{line}")
                .with_context(|| format!("cannot write {}", self.path.display()))?;
        }
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<()> {
        if let Some(mut file) = self.file.take() {
            let written = file
                .flush()
                .and_then(|()| fs::rename(&self.temporary, &self.path));
            written.with_context(|| format!("cannot write {}", self.path.display()))?;
        }
        Ok(())
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // The run has already failed; this error is not reported too.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// Removes images and surfaces of an earlier run; files with other names stay.
fn remove_old_frames(folder: &Path) -> anyhow::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let is_ours = entry.file_name().to_str().is_some_and(is_of_frames);
        if is_ours && entry.file_type()?.is_file() {
            let path = entry.path();
            fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// True if a file name is one that a run gives to what it saves of its frames.
fn is_of_frames(name: &str) -> bool {
    let number = [("frame_", ".png"), ("surface_", ".vtp")]
        .iter()
        .find_map(|(start, end)| name.strip_prefix(start)?.strip_suffix(end));
    let is_number = |number: &str| number.len() >= 5 && number.bytes().all(|b| b.is_ascii_digit());
    name == "contact_sheet.png" || name == "surface.pvd" || number.is_some_and(is_number)
}

/// Scene with absolute paths, independent of the folder it is written to.
fn movable(scene: &Scene) -> anyhow::Result<Scene> {
    let mut scene = scene.clone();
    for mesh in scene.body.iter_mut().filter_map(|body| body.mesh.as_mut()) {
        *mesh = path::absolute(&*mesh)?;
    }
    Ok(scene)
}

/// Output files of a run.
#[derive(Debug)]
pub(crate) struct Output {
    folder: PathBuf,
    lines: Vec<Lines>,
    surfaces: Vec<(f64, String)>,
    pictures: Option<Pictures>,
    save_every: u64,
    last_frame: u64,
}

impl Output {
    /// Creates the folder and opens the files, so that paths that cannot be written fail before the run.
    pub(crate) fn create(
        folder: &Path,
        jsonl: Option<&Path>,
        scene: &Scene,
        frames: u64,
        mut pictures: Option<Pictures>,
    ) -> Result<Self, Failure> {
        // Outermost last.
        let missing: Vec<&Path> = folder.ancestors().take_while(|f| !f.exists()).collect();
        let mut open = || -> anyhow::Result<Vec<Lines>> {
            fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder {}", folder.display()))?;
            let mut lines = vec![Lines::create(&folder.join("frames.jsonl"))?];
            if let Some(path) = jsonl {
                lines.push(Lines::create(path)?);
            }
            if let Some(pictures) = &mut pictures {
                pictures.begin_animation()?;
            }
            let toml = movable(scene)?.to_toml()?;
            write_atomically(folder.join("scene.toml"), |file| {
                file.write_all(toml.as_bytes())
            })?;
            remove_old_frames(folder)?;
            Ok(lines)
        };
        let lines = open().map_err(|error| {
            for folder in missing {
                // `remove_dir` leaves folders that are missing or not empty.
                let _ = fs::remove_dir(folder);
            }
            Failure::Input(error)
        })?;
        Ok(Self {
            folder: folder.to_owned(),
            lines,
            surfaces: Vec::new(),
            pictures,
            save_every: save_every(frames),
            last_frame: frames - 1,
        })
    }

    /// Writes the line of a frame, and its surface and image if the frame is saved.
    pub(crate) fn frame(&mut self, simulation: &mut Simulation) -> anyhow::Result<()> {
        let report = simulation.report();
        let line = serde_json::to_string(report)?;
        for lines in &mut self.lines {
            lines.push(&line)?;
        }
        let frame = report.frame;
        let saved = frame.is_multiple_of(self.save_every) || frame == self.last_frame;
        if saved {
            let (time, name) = (report.time_s, format!("surface_{:05}.vtp", report.frame));
            simulation.read_back()?;
            write_surface(&self.folder.join(&name), simulation)?;
            self.surfaces.push((time, name));
        }
        if let Some(pictures) = &mut self.pictures {
            pictures.frame(simulation, saved, &self.folder)?;
        }
        Ok(())
    }

    /// Writes the final files and gives all files their final names; returns a line about the images.
    pub(crate) fn finish(self, simulation: &Simulation) -> anyhow::Result<Option<String>> {
        write_pvd(self.folder.join("surface.pvd"), &self.surfaces)?;
        let mesh = simulation.mesh();
        let numbers = |of: &dyn Fn(usize) -> u32| {
            (0..mesh.tets.len())
                .map(|t| f64::from(of(t)))
                .collect::<Vec<_>>()
        };
        let (clustering, coloring) = (simulation.clustering(), simulation.coloring());
        let cluster = |t: usize| clustering.labels()[t];
        let clusters = numbers(&|t| cluster(t).0);
        let colors = numbers(&|t| coloring.color(cluster(t).index()).0);
        let pieces = scalars(simulation.piece_numbers());
        let (used, positions, kept) = used_particles(simulation);
        let all_velocities = simulation.velocities();
        let velocities: Vec<DVec3> = kept.iter().map(|&p| all_velocities[p]).collect();
        let displacements: Vec<DVec3> = positions
            .iter()
            .zip(&used.positions)
            .map(|(now, rest)| *now - *rest)
            .collect();
        let on_cut = simulation.on_cut();
        let cut: Vec<f64> = kept
            .iter()
            .map(|&p| f64::from(u8::from(on_cut.get(p).copied().unwrap_or(false))))
            .collect();
        let stretches: Vec<f64> = (0..mesh.tets.len())
            .map(|t| stretch_of(simulation, t))
            .collect();
        let vectors = |name, values| Field {
            name,
            values: Values::Vectors(values),
        };
        let particles = [
            vectors("rest_position", &used.positions),
            vectors("displacement", &displacements),
            vectors("velocity", &velocities),
            Field {
                name: "cut",
                values: Values::Scalars(&cut),
            },
        ];
        let cells = [
            ("cluster", &clusters),
            ("color", &colors),
            ("piece", &pieces),
            ("stretch", &stretches),
        ]
        .map(|(name, values)| Field {
            name,
            values: Values::Scalars(values),
        });
        let fields = Fields {
            particles: &particles,
            cells: &cells,
        };
        write_vtu(self.folder.join("mesh.vtu"), &positions, &used.tets, fields)?;
        let said = self
            .pictures
            .map(|pictures| pictures.finish(&self.folder))
            .transpose()?;
        self.lines.into_iter().try_for_each(Lines::finish)?;
        Ok(said)
    }
}

/// Writes the surface of a frame with displacement (m) and velocity (m/s) of particles, and for each triangle whether it
/// is a cut face, its piece and the largest stretch of its tet.
fn write_surface(path: &Path, simulation: &Simulation) -> anyhow::Result<()> {
    let mut surface = Surface::default();
    let mut cut = Vec::new();
    for triangle in simulation.boundary() {
        surface.triangles.push(triangle.particles);
        surface.tets.push(triangle.tet);
        cut.push(f64::from(u8::from(matches!(triangle.tag, FaceTag::Cut(_)))));
    }
    let pieces = simulation.piece_numbers();
    let pieces = scalars(surface.tets.iter().map(|tet| pieces[tet.index()]));
    let stretches: Vec<f64> = surface
        .tets
        .iter()
        .map(|tet| stretch_of(simulation, tet.index()))
        .collect();
    let (rest, now) = (&simulation.mesh().positions, simulation.positions());
    let displacements: Vec<DVec3> = now.iter().zip(rest).map(|(x, rest)| *x - *rest).collect();
    let velocities = simulation.velocities();
    let particles =
        [("displacement", &displacements), ("velocity", &velocities)].map(|(name, values)| Field {
            name,
            values: Values::Vectors(values),
        });
    let cells =
        [("cut", &cut), ("piece", &pieces), ("stretch", &stretches)].map(|(name, values)| Field {
            name,
            values: Values::Scalars(values),
        });
    let fields = Fields {
        particles: &particles,
        cells: &cells,
    };
    Ok(write_vtp(path, &surface, now, fields)?)
}

/// Numbers as values of a field.
fn scalars(numbers: impl IntoIterator<Item = u32>) -> Vec<f64> {
    numbers.into_iter().map(f64::from).collect()
}

/// Largest principal stretch of a tet.
fn stretch_of(simulation: &Simulation, tet: usize) -> f64 {
    let mesh = simulation.mesh();
    let corners = mesh.tets[tet];
    let rest = corners.map(|p| mesh.positions[p.index()]);
    stretch(rest, corners.map(|p| simulation.positions()[p.index()]))
}

/// Extensions that [`save_mesh`] supports.
const MESH_ENDINGS: [&str; 4] = ["vtk", "vtu", "node", "ele"];

/// Returns an error for a path that [`save_mesh`] could not write after the run.
pub(crate) fn require_mesh_file(path: &Path) -> Result<(), Failure> {
    let ending = path.extension().unwrap_or_default();
    if !MESH_ENDINGS
        .iter()
        .any(|known| ending.eq_ignore_ascii_case(known))
    {
        return Err(MeshIoError::UnknownFormat {
            path: path.to_owned(),
            known: ".vtk, .vtu, .node, .ele",
        }
        .into());
    }
    require_file(path).map_err(Failure::Input)
}

/// Writes the rest mesh without the unused particles of removed tets. A `.vtu` file also has the deformed positions;
/// other formats cannot store them.
pub(crate) fn save_mesh(path: &Path, simulation: &Simulation) -> anyhow::Result<()> {
    let (mesh, positions, _) = used_particles(simulation);
    if path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("vtu"))
    {
        let particles = [Field {
            name: "position",
            values: Values::Vectors(&positions),
        }];
        let fields = Fields {
            particles: &particles,
            cells: &[],
        };
        write_vtu(path, &mesh.positions, &mesh.tets, fields)?;
    } else {
        incise::mesh_io::write(path, &mesh)?;
    }
    Ok(())
}

/// The rest mesh without the unused particles of removed tets, the deformed positions of its particles, and their numbers
/// in the simulation. Tets keep their numbers.
fn used_particles(simulation: &Simulation) -> (TetMesh, Vec<DVec3>, Vec<usize>) {
    let drop_unused = RepairOptions {
        drop_unused: true,
        ..RepairOptions::default()
    };
    let used = repair(simulation.mesh(), &drop_unused);
    let now = simulation.positions();
    let kept: Vec<usize> = used.particles.iter().map(|p| p.index()).collect();
    let positions = kept.iter().map(|&p| now[p]).collect();
    (used.mesh, positions, kept)
}
