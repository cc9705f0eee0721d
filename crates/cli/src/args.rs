//! The arguments of every command.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use incise_render::{ColorBy, LARGEST_SIDE};

use crate::share::Share;

/// Cuts soft bodies in real time.
#[derive(Debug, Parser)]
#[command(
    name = "incise",
    version,
    about = "Cuts soft bodies in real time",
    long_about = "Cuts soft bodies in real time.\n\nWithout a command, runs the built-in scene: a generated liver, \
                  held at one side, sliced by a moving blade over 200 frames. Files go to out/.",
    after_help = "Example: incise run scene.toml --mesh liver.vtk --frames 100 --out result"
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Simulate a scene and write reports, surfaces and images.
    Run(RunArguments),
    /// Find the most accurate solver settings for a time budget on this machine.
    Advise(AdviseArguments),
    /// Cluster and color the constraints of a mesh or the vertices of a graph.
    Color(ColorArguments),
    /// Print the keys of scene files, or validate a scene.
    Scene(SceneArguments),
    /// Run a scene for all combinations of values of its keys, and write one table.
    Sweep(SweepArguments),
    /// Inspect, convert and generate meshes.
    #[command(after_help = "Example: incise mesh generate liver --tets 5000 liver.vtk")]
    Mesh {
        #[command(subcommand)]
        command: MeshCommand,
    },
    /// Print completions for a shell.
    #[command(after_help = "Example: incise completions bash > /etc/bash_completion.d/incise")]
    Completions {
        /// The shell.
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Write manual pages, one for each command.
    #[command(after_help = "Example: incise man /usr/local/share/man/man1")]
    Man {
        /// Folder of the pages.
        folder: PathBuf,
    },
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example: incise scene --check scene.toml\nExample: incise scene --defaults > scene.toml"
)]
#[group(required = true, multiple = false)]
pub(crate) struct SceneArguments {
    /// Print a commented scene with every default.
    #[arg(long)]
    pub(crate) defaults: bool,
    /// Print the JSON Schema of scene files.
    #[arg(long)]
    pub(crate) schema: bool,
    /// Print the reference of all keys in Markdown.
    #[arg(long)]
    pub(crate) reference: bool,
    /// Validate a scene without running it.
    #[arg(long, value_name = "FILE")]
    pub(crate) check: Option<PathBuf>,
}

#[derive(Debug, Default, Args)]
#[command(
    after_help = "Example: incise run --mesh liver.vtk --precision f64 --threads 2 --frames 160 --check"
)]
pub(crate) struct RunArguments {
    /// The scene file; without one, the built-in liver.
    pub(crate) scene: Option<PathBuf>,
    /// Use this mesh for the scene's first body.
    #[arg(long, value_name = "FILE")]
    pub(crate) mesh: Option<PathBuf>,
    /// Number of frames [default: 200, or more if a stroke ends later].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Compute device; auto takes a hardware GPU if one supports the scene [default: that of the scene].
    #[arg(long, value_enum)]
    pub(crate) backend: Option<BackendName>,
    /// Floating-point precision [default: that of the scene].
    #[arg(long, value_enum)]
    pub(crate) precision: Option<PrecisionName>,
    /// Number of threads, at most 1024 [default: one for each core]. It does not change the result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Folder for the scene, frame reports, surfaces, images and the last mesh.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: Option<PathBuf>,
    /// Also write one JSON object per frame to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) jsonl: Option<PathBuf>,
    /// Write the last rest mesh to this file; a .vtu file also has the deformed positions.
    #[arg(long, value_name = "FILE")]
    pub(crate) save_mesh: Option<PathBuf>,
    /// Write no images and no contact sheet.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    /// Write an animation: .gif, or .png for an animated PNG.
    #[arg(long, value_name = "FILE", alias = "film")]
    pub(crate) animation: Option<PathBuf>,
    /// Images of the animation for each second, shown at this rate [default: about 25].
    #[arg(long, value_name = "N", value_parser = rate, requires = "animation")]
    pub(crate) fps: Option<f64>,
    /// Width and height of images in pixels [default: 640x480].
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Camera: azimuth and elevation in degrees, and zoom; at zoom 1 the bodies fit the image at the start [default:
    /// -60,22,1, and the camera steps back where bodies would leave the image].
    #[arg(long, value_name = "AZIMUTH,ELEVATION[,ZOOM]", value_parser = view, allow_hyphen_values = true)]
    pub(crate) view: Option<[f64; 3]>,
    /// Quantity that colors show in images: tissue, color, cluster, piece, stretch or residual. With residual every frame
    /// reports it.
    #[arg(long, value_name = "NAME", default_value_t)]
    pub(crate) color_by: ColorBy,
    /// Draw the edges of triangles.
    #[arg(long)]
    pub(crate) wireframe: bool,
    /// Validate all derived data after every cut (slow).
    #[arg(long)]
    pub(crate) check: bool,
    /// Continue if the solution diverges; without this the run ends there with exit code 1.
    #[arg(long)]
    pub(crate) keep_going: bool,
    /// Print only errors; warnings are in frames.jsonl.
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl RunArguments {
    /// Tests whether any image is requested.
    pub(crate) fn draws(&self) -> bool {
        !self.no_pictures || self.animation.is_some()
    }
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example: incise sweep scene.toml --set solver.substeps=4,8,16 --set body[0].young_modulus=1e4,1e5 --out study\n\n\
    The table is sweep.csv: the values of the keys, the outcome, the last reported value of each quantity, \
    forces with their largest amount, and times in ms. \
    Machines share a study by --shard; see docs/cluster.md."
)]
pub(crate) struct SweepArguments {
    /// The scene file.
    pub(crate) scene: PathBuf,
    /// A key of the scene and its values, separated by commas. Several keys give all combinations.
    #[arg(long, value_name = "KEY=A,B,C", required = true)]
    pub(crate) set: Vec<String>,
    /// Number of frames of each run [default: 200, or more if a stroke ends later].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Folder of the results; a study continues from what it holds.
    #[arg(long, value_name = "DIR", default_value = "out/sweep")]
    pub(crate) out: PathBuf,
    /// Run one share of the combinations, as 2/5 for the second of five, and write no table.
    #[arg(long, value_name = "I/N", conflicts_with = "merge")]
    pub(crate) shard: Option<Share>,
    /// Run nothing: collect the shares in these folders, and write the table. A missing combination is an error.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    pub(crate) merge: Vec<PathBuf>,
    /// Write the table without missing combinations.
    #[arg(long, requires = "merge")]
    pub(crate) partial: bool,
    /// Number of threads, at most 1024 [default: one for each core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print only errors.
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// A size, as in `960x720`.
fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(width, height)| {
        let side = |text: &str| text.parse().ok();
        Some([side(width)?, side(height)?])
    });
    let fits = |sides: &[u32; 2]| sides.iter().all(|side| (1..=LARGEST_SIDE).contains(side));
    sides
        .filter(fits)
        .ok_or_else(|| format!("two numbers from 1 to {LARGEST_SIDE}, as in 960x720, are needed"))
}

/// A rate of images. Times of an image from 0.01 s to 10 s are supported.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok();
    rate.filter(|rate| (0.1..=100.0).contains(rate))
        .ok_or_else(|| "a number from 0.1 to 100 is needed".to_owned())
}

/// A camera as in `-60,22` or `-60,22,1.5`.
fn view(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let view = match numbers.unwrap_or_default()[..] {
        [azimuth, elevation] => Some([azimuth, elevation, 1.0]),
        [azimuth, elevation, zoom] => Some([azimuth, elevation, zoom]),
        _ => None,
    };
    let fits = |view: &[f64; 3]| {
        let [azimuth, elevation, zoom] = view;
        azimuth.is_finite() && elevation.abs() <= 90.0 && (1e-3..=1e3).contains(zoom)
    };
    view.filter(fits).ok_or_else(|| {
        "degrees around, degrees from -90 to 90 and a zoom from 0.001 to 1000, as in -60,22,1.5, are needed"
            .to_owned()
    })
}

#[derive(Debug, Args)]
#[command(after_help = "Example: incise advise scene.toml --budget-ms 8\n\n\
    Errors are measured against a converged solution of the same scene: by Newton's method, or by the solver itself with \
    a fine substep if the scene has contacts, damping, springs or cuts after frame 0. The output names the reference and \
    its own error, and gives the [solver] table for the scene file.")]
pub(crate) struct AdviseArguments {
    /// The scene file; without one, the built-in liver.
    pub(crate) scene: Option<PathBuf>,
    /// Largest computing time of a frame in ms.
    #[arg(long, value_name = "X")]
    pub(crate) budget_ms: f64,
    /// Number of frames that are measured, from the first on [default: half a second and all strokes and attachments, at
    /// most 100].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) frames: Option<u32>,
    /// Number of threads, at most 1024 [default: one for each core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print one JSON object instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example: incise color liver.vtk --clustering serial:5 --csv colors.csv --json\n\
                  Example: incise color queen8_8.col --algorithm greedy"
)]
pub(crate) struct ColorArguments {
    /// A tetrahedral mesh, or a graph: Matrix Market .mtx or DIMACS .col.
    pub(crate) input: PathBuf,
    /// The coloring: auto, scgc, jones-plassmann, ecl-gc, vivace, wlc, mcs, greedy, dsatur, iterated-greedy or tabu.
    ///
    /// Some take a parameter: scgc:13 for shortcuts 1 and 3 only, vivace:4 for the shrinking factor, wlc:64 for the
    /// chunk, greedy:ORDER with natural, random, largest-first, degree-bound or smallest-last, iterated-greedy:PASSES,
    /// tabu:STEPS.
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(crate) algorithm: String,
    /// The clustering: none, serial:K, serial-loose:K, greedy-k:K or pressure:K.
    #[arg(long, value_name = "NAME", default_value = "none")]
    pub(crate) clustering: String,
    /// Compute device; gpu supports jones-plassmann, ecl-gc, scgc, vivace and wlc.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: ColorBackendName,
    /// Seed of vivace, greedy:random, iterated-greedy and tabu; the others use none.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Balance the colors by clusters or by constraints without adding any.
    #[arg(long, value_enum, value_name = "BY", num_args = 0..=1, require_equals = true, default_missing_value = "clusters")]
    pub(crate) balance: Option<BalanceName>,
    /// Write the cluster and color of each constraint (of a graph: of each vertex) to this CSV file.
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum MeshCommand {
    /// Check a mesh and print its statistics; of a surface, whether it can be filled.
    #[command(after_help = "Example: incise mesh info liver.vtk --json")]
    Info {
        /// The mesh.
        file: PathBuf,
        /// Print one JSON object instead of tables.
        #[arg(long)]
        json: bool,
        /// Young's modulus in Pa, for the number of substeps.
        #[arg(long, value_name = "E", default_value_t = 1e5)]
        young_modulus: f64,
        /// Mass density in kg/m³, for the number of substeps.
        #[arg(long, value_name = "RHO", default_value_t = 1000.0)]
        density: f64,
        /// Time of a frame in s, for the number of substeps.
        #[arg(long, value_name = "DT", default_value_t = 0.016)]
        time_step: f64,
    },
    /// Convert a mesh or a surface between formats, which the file endings determine. Surface formats (.obj, .stl, .ply,
    /// .off, .glb, .gltf) get the boundary of a mesh.
    #[command(after_help = "Example: incise mesh convert liver.node liver.vtu")]
    Convert {
        /// The mesh to read.
        input: PathBuf,
        /// The file to write.
        output: PathBuf,
        /// Merge coincident particles, remove degenerate and duplicate tets, reorient inverted ones, keep the largest piece
        /// and its particles; prints the changes.
        #[arg(long)]
        repair: bool,
    },
    /// Fill a closed triangle surface with tets.
    #[command(
        after_help = "Example: incise mesh tetrahedralize heart.stl heart.vtk --tets 20000\n\n\
        Edges and corners are rounded to the size of a tet, and thinner parts are lost; the output gives the distances."
    )]
    Tetrahedralize {
        /// The surface: .obj, .stl, .ply, .off, .glb or .gltf. Texture coordinates become values of particles.
        surface: PathBuf,
        /// The mesh to write.
        output: PathBuf,
        /// Wanted number of tets; the result is within 2%.
        #[arg(long, value_name = "N")]
        tets: usize,
        /// Number of times that tets deep inside may be doubled in size, which leaves more for the surface.
        #[arg(long, value_name = "N", default_value_t = 0)]
        levels: u32,
    },
    /// Generate a shape of longest side 1.
    #[command(after_help = "Example: incise mesh generate torus --tets 5000 torus.vtk")]
    Generate {
        /// box, beam, sphere, torus, plate, liver, bunny, armadillo, gear, shell or pair.
        shape: String,
        /// Wanted number of tets; the result is within 2%.
        #[arg(long, value_name = "N")]
        tets: usize,
        /// The file to write.
        output: PathBuf,
    },
}

/// Measure of the size of a color when colors are balanced.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum BalanceName {
    /// Number of clusters: the parallelism of a color.
    Clusters,
    /// Number of constraints: the work of a color.
    Constraints,
}

impl BalanceName {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Clusters => "clusters",
            Self::Constraints => "constraints",
        }
    }
}

/// Compute device of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(crate) enum BackendName {
    /// The CPU.
    Cpu,
    /// A GPU; an error if there is none.
    Gpu,
    /// A hardware GPU if one supports the scene, else the CPU.
    Auto,
}

/// Compute device of a coloring.
#[derive(Clone, Copy, Debug, Default, PartialEq, ValueEnum)]
pub(crate) enum ColorBackendName {
    /// The CPU.
    #[default]
    Cpu,
    /// A GPU; an error if there is none.
    Gpu,
}

/// Floating-point precision.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PrecisionName {
    /// Single: 32 bits.
    F32,
    /// Double: 64 bits.
    F64,
}
