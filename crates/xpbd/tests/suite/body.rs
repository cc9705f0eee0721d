//! Helpers shared by the tests: bodies made of boxes, their schedules, seeded noise.

use glam::DVec3;
use incise_clustering::cluster;
use incise_coloring::color;
use incise_graph::{Incidence, Schedule};
use incise_mesh::{TetId, TetMesh};
use incise_xpbd::{Material, Real, Solver, StepReport, StepSettings, TetSolve};

/// Rubber with a round density.
pub(crate) const RUBBER: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.45,
    density: 1000.0,
    damping: 0.0,
};

/// The gravity of the tests that have one.
pub(crate) const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// A body at rest, a quarter of each tet's mass on each of its corners.
pub(crate) fn body<R: Real>(mesh: &TetMesh, material: Material) -> Solver<R> {
    let mut solver = Solver::new(&mesh.positions);
    let material_number = solver.add_material(material).unwrap();
    let mut masses = vec![0.0; mesh.positions.len()];
    for t in 0..mesh.tets.len() {
        let corners = mesh.tets[t].map(|p| p.0);
        let rest = mesh.corners(TetId::new(t));
        solver.push_tet(corners, rest, material_number);
        for p in corners {
            masses[p as usize] += material.density * mesh.volume(TetId::new(t)) / 4.0;
        }
    }
    for (p, &mass) in masses.iter().enumerate() {
        solver.set_mass(p, mass);
    }
    solver
}

/// The schedule of a mesh by a coloring algorithm and a clustering method such as `none` or `serial:10`.
pub(crate) fn schedule(mesh: &TetMesh, coloring: &str, clustering: &str) -> Schedule {
    let corners = mesh.tets.iter().map(|tet| tet.map(|p| p.0));
    let incidence = Incidence::from_constraints(mesh.positions.len(), corners).unwrap();
    let clusters = cluster(clustering.parse().unwrap(), &incidence);
    let quotient = incidence.quotient(&clusters);
    let colored = color(coloring.parse().unwrap(), &quotient, 0).unwrap();
    let schedule = Schedule::new(&clusters, &colored.coloring);
    schedule.check(&incidence).unwrap();
    schedule
}

/// The plain schedule: greedy, without clusters.
pub(crate) fn plain(mesh: &TetMesh) -> Schedule {
    schedule(mesh, "greedy", "none")
}

/// One substep of one iteration of the time that gives the largest tet this `kappa`.
pub(crate) fn substep<R: Real>(solver: &Solver<R>, kappa: f64) -> StepSettings {
    StepSettings::new((kappa / solver.kappa(1.0)).sqrt())
}

/// The number of frames that fill `time`.
#[expect(
    clippy::cast_possible_truncation,
    reason = "tests take some thousand frames"
)]
pub(crate) fn frames(time: f64, settings: &StepSettings) -> usize {
    (time / settings.time_step).ceil() as usize
}

/// The ways of solving by XPBD. VBD has its own suite of extremes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Method {
    /// Colored Gauss-Seidel, both constraints of a tet at once.
    GaussSeidel,
    /// Colored Gauss-Seidel, the constraints of a tet one after the other.
    Sequential,
    /// Corrections added up, the paper's relaxation.
    Jacobi,
    /// Corrections added up, the paper's relaxation, extrapolated.
    Chebyshev,
}

impl Method {
    /// All of them: none may leave the finite numbers.
    pub(crate) const ALL: [Self; 4] = [
        Self::GaussSeidel,
        Self::Sequential,
        Self::Jacobi,
        Self::Chebyshev,
    ];

    /// Those that are accurate with one iteration a substep: they must recover from every collapse.
    pub(crate) const ACCURATE: [Self; 2] = [Self::GaussSeidel, Self::Sequential];

    /// Takes a frame, keeping residuals where the method has them.
    pub(crate) fn step<R: Real>(
        self,
        solver: &mut Solver<R>,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> StepReport {
        let mut settings = settings.clone();
        match self {
            Self::GaussSeidel => {}
            Self::Sequential => settings.tet_solve = TetSolve::Sequential,
            Self::Jacobi => {
                settings.method = incise_xpbd::Method::Jacobi;
                settings.relaxation = 0.1;
            }
            Self::Chebyshev => {
                settings.method = incise_xpbd::Method::Chebyshev {
                    spectral_radius: 0.99,
                    chebyshev_start: 3,
                };
                settings.relaxation = 0.1;
            }
        }
        solver.step_keeping_residuals(schedule, &settings).unwrap()
    }
}

/// Takes `count` frames; none may need a repair.
pub(crate) fn advance<R: Real>(
    solver: &mut Solver<R>,
    schedule: &Schedule,
    settings: &StepSettings,
    count: usize,
) {
    for _ in 0..count {
        assert_eq!(solver.step(schedule, settings).unwrap().repaired, 0);
    }
}

/// Sets all velocities to zero whenever the kinetic energy has passed a peak, so that a body comes to rest; where does
/// not depend on it.
#[derive(Default)]
pub(crate) struct KineticDamping {
    last: f64,
}

impl KineticDamping {
    /// Checks the state after a step; returns whether it is past a peak.
    pub(crate) fn apply<R: Real>(&mut self, solver: &mut Solver<R>) -> bool {
        let now = solver.energy(None).kinetic;
        let past = now < self.last;
        self.last = if past { 0.0 } else { now };
        if past {
            for p in 0..solver.particle_count() {
                solver.set_velocity(p, DVec3::ZERO);
            }
        }
        past
    }
}

/// The positions of all particles.
pub(crate) fn positions<R: Real>(solver: &Solver<R>) -> Vec<DVec3> {
    let mut out = Vec::new();
    solver.positions(&mut out);
    out
}

/// The largest distance between two lists of points.
pub(crate) fn largest_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distances = a.iter().zip(b).map(|(x, y)| x.distance(*y));
    distances.fold(0.0, f64::max)
}

/// Fails unless `value` is a number of at most `tolerance`.
#[track_caller]
pub(crate) fn within(what: &str, value: f64, tolerance: f64) {
    assert!(
        value <= tolerance,
        "{what}: {value:e} is more than {tolerance:e}"
    );
}

/// Seeded noise (`SplitMix64`), the same everywhere.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Uniform in -1 .. 1.
    pub(crate) fn scalar(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in the cube from -1 to 1.
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.scalar(), self.scalar(), self.scalar())
    }
}

/// Displaces every particle by noise of at most `amount` in each coordinate.
pub(crate) fn disturb<R: Real>(solver: &mut Solver<R>, amount: f64, seed: u64) {
    let mut noise = Noise(seed);
    for p in 0..solver.particle_count() {
        solver.set_position(p, solver.position(p) + noise.vector() * amount);
    }
}
