//! The cases that all benches share, and the entry point of each bench file.
//!
//! A bench file is one call of [`run`] with what it measures on one case. Names are `crate/operation/case`, throughput
//! is counted in tets of the case's mesh, so that any two lines of the output compare, or where cost follows a cut, in
//! tets cut.

// A bench that cannot set its case up has nothing to measure; the panic says where.
#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use std::path::{Path, PathBuf};
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{Bencher, BenchmarkGroup, BenchmarkId, Criterion, Throughput};
use incise::graph::{ConstraintGraph, Incidence};
use incise::mesh::glam::DVec3;
use incise::mesh::{TetId, TetMesh, kuhn_box};
use incise::mesh_io;
use incise::meshing::{Shape, generate};

/// The environment variable that names a folder of further meshes.
pub const MODELS: &str = "INCISE_MODELS";

/// How far a blade moves in a frame, as a fraction of the body's height: a stroke of 20 frames.
pub const BLADE_STEP: f64 = 0.05;

/// Where a mesh comes from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A generated shape with about this many tets: irregular degrees, as bodies have.
    Shape(Shape, usize),
    /// A Kuhn grid with this many cells a side: all inner degrees are equal, the easiest case.
    Grid(usize),
    /// A mesh file.
    File(PathBuf),
}

impl Source {
    /// Generates or reads the mesh.
    ///
    /// # Panics
    /// If it cannot.
    #[must_use]
    pub fn mesh(&self) -> TetMesh {
        match self {
            Self::Shape(shape, tets) => generate(*shape, *tets).unwrap(),
            Self::Grid(cells) => kuhn_box([*cells; 3], DVec3::ONE),
            Self::File(path) => mesh_io::read(path).unwrap(),
        }
    }
}

/// A mesh to measure on.
#[derive(Clone, Debug)]
pub struct Case {
    /// The last part of the names of its measurements.
    pub name: String,
    /// Where it comes from.
    pub source: Source,
    /// The mesh.
    pub mesh: TetMesh,
}

impl Case {
    fn new(name: impl Into<String>, source: Source) -> Self {
        Self {
            name: name.into(),
            mesh: source.mesh(),
            source,
        }
    }

    /// Which particles each tet has.
    ///
    /// # Panics
    /// If the mesh is too large for the numbers of a graph.
    #[must_use]
    pub fn incidence(&self) -> Incidence {
        Incidence::from_constraints(self.mesh.positions.len(), self.mesh.tets.iter().copied())
            .unwrap()
    }

    /// Which tets share a particle.
    #[must_use]
    pub fn graph(&self) -> ConstraintGraph {
        ConstraintGraph::from_incidence(&self.incidence())
    }

    /// The corners of the mesh's bounding box.
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        let positions = &self.mesh.positions;
        let corner = |pick: fn(DVec3, DVec3) -> DVec3| positions.iter().copied().reduce(pick);
        [corner(DVec3::min), corner(DVec3::max)].map(Option::unwrap_or_default)
    }

    /// The point of the bounding box at these fractions of its sides.
    #[must_use]
    pub fn at(&self, fractions: [f64; 3]) -> DVec3 {
        let [low, high] = self.bounds();
        low + (high - low) * DVec3::from_array(fractions)
    }

    /// The center of the tet nearest to the center of the bounding box, which may itself lie outside of the body.
    fn heart(&self) -> DVec3 {
        let center = self.at([0.5; 3]);
        let middles = (0..self.mesh.tets.len()).map(|t| {
            let corners = self.mesh.corners(TetId::new(t));
            corners.into_iter().sum::<DVec3>() / 4.0
        });
        middles
            .min_by(|a, b| a.distance(center).total_cmp(&b.distance(center)))
            .unwrap_or_default()
    }

    /// A straight blade along y, longer than the body, a little askew so that it meets no row of particles of a grid
    /// at once: `frames` frames before it reaches the middle of the body from above, at [`BLADE_STEP`] a frame.
    #[must_use]
    pub fn blade(&self, frames: f64) -> [DVec3; 2] {
        let [low, high] = self.bounds();
        let size = high - low;
        [-1.0, 1.0].map(|end| {
            let offset = DVec3::new(0.03 * end, end, 0.02 * end + BLADE_STEP * frames);
            self.heart() + size * offset
        })
    }
}

/// Measures on all cases, one after the other: the generated ones, then the `.vtk` files of the folder that
/// [`MODELS`] names.
///
/// `bench` gets a [`Bench`] for each case. Options of the command line win over the small number of samples set here,
/// which keeps the whole run at a few minutes.
///
/// # Panics
/// If a mesh cannot be read.
pub fn run(crate_name: &str, bench: impl FnMut(&mut Bench<'_, '_>)) {
    run_with(crate_name, &[], bench);
}

/// Measures on the cases of [`run`] and on further ones, by name. Those are large: `--test`, which runs everything
/// once, leaves them out.
///
/// # Panics
/// If a mesh cannot be read.
pub fn run_with(
    crate_name: &str,
    large: &[(&str, Source)],
    mut bench: impl FnMut(&mut Bench<'_, '_>),
) {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .without_plots()
        .configure_from_args();
    let mut group = criterion.benchmark_group(crate_name);
    let mut measure = |case: Case| {
        group.throughput(Throughput::Elements(case.mesh.tets.len() as u64));
        bench(&mut Bench {
            group: &mut group,
            case: &case,
        });
    };
    measure(Case::new("liver-11k", Source::Shape(Shape::Liver, 11_000)));
    measure(Case::new("liver-50k", Source::Shape(Shape::Liver, 50_000)));
    measure(Case::new("grid-10k", Source::Grid(12)));
    if !std::env::args().any(|argument| argument == "--test") {
        for (name, source) in large {
            measure(Case::new(*name, source.clone()));
        }
    }
    for path in models() {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        measure(Case::new(name, Source::File(path)));
    }
    group.finish();
    criterion.final_summary();
}

/// The mesh files named, by name; prints a note if there are none.
#[expect(
    clippy::print_stderr,
    reason = "a skipped case must not look like a measured one"
)]
fn models() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os(MODELS) else {
        eprintln!("skipped: meshes from files, {MODELS} names no folder");
        return Vec::new();
    };
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!(
            "skipped: meshes from files, {MODELS} = {} is not a folder",
            Path::new(&folder).display()
        );
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "vtk"));
    paths.sort_unstable();
    paths
}

/// A case, and the criterion group of its measurements.
#[expect(missing_debug_implementations, reason = "criterion's groups have none")]
pub struct Bench<'a, 'c> {
    group: &'a mut BenchmarkGroup<'c, WallTime>,
    /// The case.
    pub case: &'a Case,
}

impl Bench<'_, '_> {
    /// Measures one operation. The closure defines an iteration for criterion.
    pub fn measure(
        &mut self,
        operation: &str,
        mut iteration: impl FnMut(&mut Bencher<'_, WallTime>),
    ) {
        let id = BenchmarkId::new(operation, &self.case.name);
        self.group.bench_function(id, &mut iteration);
    }

    /// Measures an operation whose throughput is counted in `elements` of its own, such as tets cut, not in the tets of
    /// the mesh.
    pub fn measure_per(
        &mut self,
        operation: &str,
        elements: usize,
        iteration: impl FnMut(&mut Bencher<'_, WallTime>),
    ) {
        self.group.throughput(Throughput::Elements(elements as u64));
        self.measure(operation, iteration);
        let tets = self.case.mesh.tets.len();
        self.group.throughput(Throughput::Elements(tets as u64));
    }
}
