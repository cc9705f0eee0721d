//! [`ComputeDevice`]: the CPU or the GPU that computes a scene.
//!
//! `cpu` is this process, `gpu` a device or an error; `auto` takes a hardware device that supports the scene's
//! settings, and otherwise the CPU, with the reason. A software device is slower than the CPU path, so only `gpu` takes
//! it. Cost: opening a device takes some hundred milliseconds, once.

#[cfg(feature = "gpu")]
use std::sync::Arc;

#[cfg(feature = "gpu")]
use incise_gpu::{GpuContext, GpuOptions};

use crate::method::check_forces;
use crate::scene::{Backend, Method, Precision, StrokeSpec};
use crate::validate::value;
use crate::{Error, Scene, solid_blade};

/// A device that is open, if one is.
#[derive(Clone, Debug, Default)]
pub(crate) struct OpenDevice {
    #[cfg(feature = "gpu")]
    pub(crate) gpu: Option<Arc<GpuContext>>,
}

/// The CPU or the GPU that computes a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct ComputeDevice {
    #[cfg(feature = "gpu")]
    pub(crate) gpu: Option<Arc<GpuContext>>,
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
        Self::open(backend, open_device)
    }

    /// The device that it is, or else the other one.
    #[cfg(feature = "gpu")]
    pub(crate) fn or(&self, other: &OpenDevice) -> OpenDevice {
        OpenDevice {
            gpu: self.gpu.clone().or_else(|| other.gpu.clone()),
        }
    }

    /// There is none.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn or(&self, other: &OpenDevice) -> OpenDevice {
        other.clone()
    }

    fn cpu(reason: &str) -> Self {
        Self {
            #[cfg(feature = "gpu")]
            gpu: None,
            note: Some(format!("computed on the processor: {reason}")),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn open(backend: Backend, _: &OpenDevice) -> Result<Self, Error> {
        match backend {
            Backend::Gpu => Err(Error::NoGpuPath),
            _ => Ok(Self::cpu("this build has no GPU path (feature `gpu`)")),
        }
    }

    #[cfg(feature = "gpu")]
    fn open(backend: Backend, open_device: &OpenDevice) -> Result<Self, Error> {
        let open = || GpuContext::new(&GpuOptions::from_env()).map(Arc::new);
        match open_device.gpu.clone().map_or_else(open, Ok) {
            Ok(gpu) if backend == Backend::Auto && gpu.adapter().software => {
                let name = &gpu.adapter().name;
                Ok(Self::cpu(&format!("the only GPU is software ({name})")))
            }
            Ok(gpu) => Ok(Self::on(gpu)),
            Err(error) if backend == Backend::Auto => Ok(Self::cpu(&error.to_string())),
            Err(error) => Err(error.into()),
        }
    }

    /// On a device that is open.
    #[cfg(feature = "gpu")]
    pub(crate) fn on(gpu: Arc<GpuContext>) -> Self {
        let adapter = gpu.adapter();
        let note = format!("computed on {} ({})", adapter.name, adapter.backend);
        Self {
            note: Some(note),
            gpu: Some(gpu),
        }
    }

    /// Its name in a report.
    pub(crate) fn name(&self) -> &'static str {
        if self.is_gpu() { "gpu" } else { "cpu" }
    }

    /// Whether the state is elsewhere.
    pub(crate) fn is_gpu(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        return false;
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
