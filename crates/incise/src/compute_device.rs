//! [`ComputeDevice`]: the CPU or the GPU that computes a scene.
//!
//! `cpu` is this process, `gpu` a device or an error; `auto` takes a hardware device that supports the scene's
//! settings, and otherwise the CPU, with the reason. A software device is slower than the CPU path, so only `gpu` takes
//! it. Cost: opening a device takes some hundred milliseconds, once.

use crate::device::{OpenDevice, open};
use crate::method::check_forces;
use crate::scene::{Backend, Method, Precision, StrokeSpec};
use crate::validate::value;
use crate::{Error, Scene, solid_blade};

/// The CPU or the GPU that computes a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct ComputeDevice {
    /// The GPU; `None` is the CPU.
    pub(crate) gpu: OpenDevice,
    /// Explanation of the choice, for the user.
    pub(crate) note: Option<String>,
}

impl ComputeDevice {
    /// Chooses the compute device of a scene; an open device is used if there is one.
    pub(crate) fn choose(scene: &Scene, open_device: &OpenDevice) -> Result<Self, Error> {
        let backend = scene.solver.backend;
        if backend.is_cpu() {
            return Ok(Self::default());
        }
        if let Err(refused) = check(scene) {
            return match backend {
                Backend::Auto => Ok(Self::cpu(&refused.to_string())),
                _ => Err(refused),
            };
        }
        Ok(match open(backend, open_device)? {
            (None, reason) => Self::cpu(&reason),
            (gpu, name) => Self {
                gpu,
                note: Some(format!("computed on {name}")),
            },
        })
    }

    /// The CPU, and why.
    fn cpu(reason: &str) -> Self {
        Self {
            gpu: None,
            note: Some(format!("computed on the processor: {reason}")),
        }
    }

    /// Its name in a report.
    pub(crate) fn name(&self) -> &'static str {
        if self.is_gpu() { "gpu" } else { "cpu" }
    }

    /// Whether the state is elsewhere.
    pub(crate) fn is_gpu(&self) -> bool {
        self.gpu.is_some()
    }
}

/// Returns an error if the GPU path does not support a setting of the scene.
pub(crate) fn check(scene: &Scene) -> Result<(), Error> {
    let solver = &scene.solver;
    check_forces(&scene.report, solver.method, true)?;
    if let Some(stroke) = scene.stroke.iter().position(StrokeSpec::is_solid) {
        solid_blade::check(&format!("stroke[{stroke}]"), solver.method, true)?;
    }
    if solver.precision == Precision::F64 {
        return Err(value("solver.precision", "f64", "f32 on a GPU"));
    }
    if solver.method == Method::Vbd {
        let range = "gauss-seidel, jacobi or chebyshev on a GPU";
        return Err(value("solver.method", "vbd", range));
    }
    if let Some(budget) = solver.budget_ms {
        return Err(value("solver.budget_ms", budget, "absent on a GPU"));
    }
    let method: incise_clustering::Method = solver.clustering.parse()?;
    let limit = method.max_size().get();
    if limit > 256 {
        let range = "of at most 256 tets on a GPU";
        return Err(value("solver.clustering", &solver.clustering, range));
    }
    if limit > 32 && !matches!(solver.method, Method::Auto | Method::GaussSeidel) {
        let range = "of at most 32 tets with this method on a GPU";
        return Err(value("solver.clustering", &solver.clustering, range));
    }
    Ok(())
}
