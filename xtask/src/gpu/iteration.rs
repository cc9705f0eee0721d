//! One iteration over the tets of a body: one thread per cluster, one workgroup per cluster, Jacobi.
//!
//! The time of an iteration is the difference between frames of many and of few iterations, over the difference of
//! their numbers, which excludes prediction and velocities. Multipliers are stored, as with more than one iteration.
//!
//! **Bytes.** What an iteration has to move at least: of each tet 64 bytes of rest shape, 16 of corners and 8 of
//! multipliers there and back; of each cluster its particles, 16 bytes there and back, once; where a workgroup solves
//! it, also its list of particles, 4 bytes each. Places without a tet, and what is fetched twice, are not counted, so
//! the share of the bandwidth is what is used well. Bodies that fit into a cache may go beyond 100 %.

use std::sync::Arc;
use std::time::Instant;

use incise::gpu::{ClusterMapping, GpuContext, GpuError, GpuSolver};
use incise::graph::Schedule;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::xpbd::{Material, Method, Solver, StepSettings};

use super::measure::{batch, ms_since};
use super::report::{PassRow, PassRun, ResidualPoint, Times};
use crate::solver::body::{body, scaled, schedule};

/// A solve method.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) name: &'static str,
    pub(crate) clustering: &'static str,
    pub(crate) form: ClusterMapping,
    /// Relaxation of Jacobi; `None` for other methods.
    jacobi: Option<f64>,
}

pub(crate) const WAYS: [Way; 8] = [
    Way::threads("threads, none", "none"),
    Way::threads("threads, serial:10", "serial:10"),
    Way::threads("threads, pressure:4", "pressure:4"),
    Way::threads("threads, pressure:10", "pressure:10"),
    Way::workgroups("workgroups, pressure:64", "pressure:64"),
    Way::workgroups("workgroups, pressure:128", "pressure:128"),
    Way::workgroups("workgroups, pressure:256", "pressure:256"),
    Way {
        jacobi: Some(0.1),
        ..Way::threads("threads, Jacobi 0.1", "serial:10")
    },
];

impl Way {
    const fn threads(name: &'static str, clustering: &'static str) -> Self {
        Self {
            name,
            clustering,
            form: ClusterMapping::Threads,
            jacobi: None,
        }
    }

    const fn workgroups(name: &'static str, clustering: &'static str) -> Self {
        Self {
            form: ClusterMapping::Workgroups,
            ..Self::threads(name, clustering)
        }
    }

    pub(crate) fn is_gauss_seidel(&self) -> bool {
        self.jacobi.is_none()
    }

    fn settings(self, time_step: f64, iterations: u32) -> StepSettings {
        let method = self.jacobi.map_or(Method::GaussSeidel, |_| Method::Jacobi);
        StepSettings {
            iterations,
            method,
            relaxation: self.jacobi.unwrap_or(1.0),
            gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
            ..StepSettings::new(time_step)
        }
    }
}

/// Iterations of the shorter frame, and additional iterations of the longer one.
const FEW: u32 = 4;
const MORE: u32 = 20;

/// Small, so that no body moves far from rest.
const TIME_STEP: f64 = 1e-4;

/// Iteration counts at which residuals are computed.
pub(crate) const CURVE: [u32; 5] = [1, 2, 5, 10, 20];

/// Time step of residuals in s.
const LARGE_STEP: f64 = 1.0 / 60.0;

const RUBBER: Material = Material {
    young_modulus: 1e5,
    poisson_ratio: 0.45,
    density: 1000.0,
    damping: 0.0,
};

/// Body 1 m long, fixed at its lowest x.
pub(crate) fn hanging(mesh: &TetMesh) -> anyhow::Result<Solver<f32>> {
    body(mesh, RUBBER, |x| x.x < 0.05)
}

/// All solve methods on a mesh; with residuals on request.
pub(crate) fn passes(
    gpu: &Arc<GpuContext>,
    name: &str,
    mesh: &TetMesh,
    repeats: u32,
    residuals: bool,
) -> anyhow::Result<Vec<PassRow>> {
    let mesh = scaled(mesh, 1.0);
    let mut rows = Vec::new();
    for way in WAYS {
        let schedule = schedule(&mesh, way.clustering)?;
        let outcome = run(gpu, &mesh, &schedule, way, repeats);
        let (run, mut note) = absent(outcome)?;
        let mut points = Vec::new();
        if residuals && run.is_some() {
            let curve = CURVE
                .iter()
                .map(|&n| residual(gpu, &mesh, &schedule, way, n));
            let (curve, why) = absent(curve.collect())?;
            (points, note) = (curve.unwrap_or_default(), why);
        }
        rows.push(PassRow {
            mesh: name.to_owned(),
            tets: mesh.tets.len(),
            particles: mesh.positions.len(),
            form: way.name.to_owned(),
            clusters: schedule.cluster_count(),
            colors: schedule.color_count(),
            run,
            residuals: points,
            note,
        });
    }
    Ok(rows)
}

/// Result, or the reason if the device does not support it.
pub(crate) fn absent<T>(outcome: anyhow::Result<T>) -> anyhow::Result<(Option<T>, String)> {
    match outcome {
        Ok(value) => Ok((Some(value), String::new())),
        Err(error) => match error.downcast_ref::<GpuError>() {
            Some(
                GpuError::TooLarge { .. }
                | GpuError::OutOfMemory { .. }
                | GpuError::Unsupported { .. }
                | GpuError::Block { .. },
            ) => Ok((None, error.to_string())),
            _ => Err(error),
        },
    }
}

fn run(
    gpu: &Arc<GpuContext>,
    mesh: &TetMesh,
    schedule: &Schedule,
    way: Way,
    repeats: u32,
) -> anyhow::Result<PassRun> {
    let host = hanging(mesh)?;
    let least_bytes = match way.jacobi {
        None => Some(least_bytes(schedule, way.form, |tet| {
            host.tet_particles(tet as usize)
        })),
        Some(_) => None,
    };
    let mut device = GpuSolver::new(Arc::clone(gpu), host, way.form)?;
    let [short, long] = [FEW, FEW + MORE].map(|iterations| way.settings(TIME_STEP, iterations));
    // Warm-up: compiles kernels and measures the time of a frame.
    frames(gpu, &mut device, schedule, &long, 1)?;
    let [_, once] = frames(gpu, &mut device, schedule, &long, 1)?;
    let count = batch(once);
    let (mut shorts, mut longs) = (Vec::new(), Vec::new());
    for _ in 0..repeats {
        shorts.push(frames(gpu, &mut device, schedule, &short, count)?);
        longs.push(frames(gpu, &mut device, schedule, &long, count)?);
    }
    let each = |part: usize| {
        let [short, long] = [&shorts, &longs].map(|runs| {
            let fastest = Times::of(runs.iter().map(|run| run[part]).collect());
            fastest.fastest
        });
        (long - short) / f64::from(MORE)
    };
    let differences = shorts.iter().zip(&longs);
    let differences = differences.map(|(short, long)| (long[1] - short[1]) / f64::from(MORE));
    let median = Times::of(differences.collect()).median;
    device.host()?;
    anyhow::ensure!(device.repaired() == 0, "{}: not finite", way.name);
    Ok(PassRun {
        dispatches: device.dispatches_per_pass(),
        times: Times {
            median,
            fastest: each(1),
        },
        recording: each(0),
        least_bytes,
        memory: device.bytes(),
    })
}

/// Time of a frame in ms, for recording it and in total, averaged over a number of frames.
fn frames(
    gpu: &GpuContext,
    device: &mut GpuSolver,
    schedule: &Schedule,
    settings: &StepSettings,
    count: u32,
) -> anyhow::Result<[f64; 2]> {
    gpu.wait()?;
    let start = Instant::now();
    for _ in 0..count {
        device.step(schedule, settings)?;
    }
    let recorded = ms_since(start);
    gpu.wait()?;
    Ok([recorded, ms_since(start)].map(|ms| ms / f64::from(count)))
}

/// Minimum bytes moved by a Gauss-Seidel iteration.
pub(crate) fn least_bytes(
    schedule: &Schedule,
    form: ClusterMapping,
    corners: impl Fn(u32) -> [u32; 4],
) -> u64 {
    let (mut tets, mut particles) = (0, 0);
    let mut of_cluster = Vec::new();
    for color in 0..schedule.color_count() {
        for &cluster in schedule.clusters(color) {
            let members = schedule.constraints(cluster);
            of_cluster.clear();
            of_cluster.extend(members.iter().flat_map(|&tet| corners(tet)));
            of_cluster.sort_unstable();
            of_cluster.dedup();
            tets += members.len() as u64;
            particles += of_cluster.len() as u64;
        }
    }
    let listed = match form {
        ClusterMapping::Threads => 0,
        ClusterMapping::Workgroups => 4,
    };
    tets * (64 + 16 + 2 * 8) + particles * (2 * 16 + listed)
}

/// Residuals of a large step from rest.
fn residual(
    gpu: &Arc<GpuContext>,
    mesh: &TetMesh,
    schedule: &Schedule,
    way: Way,
    iterations: u32,
) -> anyhow::Result<ResidualPoint> {
    let settings = way.settings(LARGE_STEP, iterations);
    let body = hanging(mesh)?;
    let kappa = body.kappa(LARGE_STEP);
    let mut device = GpuSolver::new(Arc::clone(gpu), body, way.form)?;
    device.step_keeping_residuals(schedule, &settings)?;
    let host = device.host()?;
    let load = host.load(settings.gravity.unwrap_or_default());
    let residuals = host.residuals(LARGE_STEP);
    let residuals = residuals.ok_or_else(|| anyhow::anyhow!("residuals were not kept"))?;
    Ok(ResidualPoint {
        iterations,
        kappa,
        dual: residuals.dual_rms,
        force: residuals.force / load,
    })
}

#[cfg(test)]
mod tests {
    use incise::graph::{ClusterId, Clustering, ColorId, Coloring};

    use super::*;

    /// Two tets that share a face are five particles in one cluster, and eight in two.
    #[test]
    fn bytes_of_two_tets() {
        let corners = |tet: u32| [[0, 1, 2, 3], [1, 2, 3, 4]][tet as usize];
        let together = Clustering::from_labels(vec![ClusterId(0); 2]).unwrap();
        let together = Schedule::new(&together, &Coloring::new(vec![ColorId(0)]));
        let apart = Coloring::new(vec![ColorId(0), ColorId(1)]);
        let apart = Schedule::new(&Clustering::none(2), &apart);
        assert_eq!(
            least_bytes(&together, ClusterMapping::Threads, corners),
            2 * 96 + 5 * 32
        );
        assert_eq!(
            least_bytes(&apart, ClusterMapping::Threads, corners),
            2 * 96 + 8 * 32
        );
        assert_eq!(
            least_bytes(&together, ClusterMapping::Workgroups, corners),
            2 * 96 + 5 * 36
        );
    }
}
