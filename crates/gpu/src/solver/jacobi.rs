//! [`Jacobi`]: Jacobi iterations, which correct all tets from the same positions, and their extrapolation.
//!
//! The kernels of the tets gather corrections color by color, so that every sum has a fixed order and no two threads
//! add to one particle at a time; a pass over the particles then adds the sums. Chebyshev keeps positions and
//! multipliers from the start of the previous iteration; its weights are in the uniforms. Only the thread mapping
//! gathers: a tile has its particles in workgroup memory, where a correction would take effect at once. Twin:
//! `jacobi.rs` of incise-xpbd.
//!
//! Cost: one dispatch per iteration, two with Chebyshev; 16 bytes per particle, with Chebyshev 16 more and 16 per tet
//! slot.

use incise_xpbd::{Method, StepSettings};
use wgpu::Buffer;

use super::body_buffers::BodyBuffers;
use super::kernels::{APPLY_CORRECTIONS, BoundKernel, EXTRAPOLATE_MULTIPLIERS, Kernels, Variant};
use super::layout::{ClusterMapping, THREADS};
use super::shared::Shared;
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Previous iterates for extrapolation.
#[derive(Debug)]
pub(crate) struct Jacobi {
    extrapolating: bool,
    /// Positions at the start of the previous iteration; empty without extrapolation.
    before: Array<[f32; 4]>,
    /// Tet slot -> multipliers at the start of this iteration and of the one before; empty without extrapolation.
    history: Array<[f32; 4]>,
}

impl Jacobi {
    /// Allocates memory for the settings; without Jacobi none is kept.
    pub(crate) fn prepare(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        body: &mut BodyBuffers,
        particles: usize,
        settings: &StepSettings,
    ) -> Result<(), GpuError> {
        if settings.method == Method::GaussSeidel {
            *this = None;
            return Ok(());
        }
        if body.layout.mapping == ClusterMapping::Workgroups {
            return Err(GpuError::Unsupported {
                what: "Jacobi iterations in workgroups (threads do them)",
            });
        }
        body.corrections.resize(gpu, particles)?;
        let jacobi = match this {
            Some(jacobi) => jacobi,
            None => this.insert(Self {
                extrapolating: false,
                before: Array::zeros(gpu, "iterates", 0)?,
                history: Array::zeros(gpu, "multipliers of iterates", 0)?,
            }),
        };
        jacobi.extrapolating = settings.method != Method::Jacobi;
        if jacobi.extrapolating {
            jacobi.before.resize(gpu, particles)?;
            jacobi.history.resize(gpu, body.multipliers.len())?;
        }
        Ok(())
    }

    pub(crate) fn bind(
        &self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        body: &BodyBuffers,
        shared: &Shared<'_>,
        keeps: bool,
    ) -> Result<JacobiKernels, GpuError> {
        let variant = Variant {
            keeps: self.extrapolating,
            ..Variant::default()
        };
        let buffers = [
            shared.settings,
            shared.uniforms,
            shared.particles,
            body.corrections.buffer(),
            self.before.buffer(),
        ];
        let apply = kernels.bind(gpu, &APPLY_CORRECTIONS, variant, &buffers)?;
        let mut extrapolate = None;
        if self.extrapolating && keeps {
            let buffers = [
                body.multipliers.buffer(),
                shared.uniforms,
                self.history.buffer(),
            ];
            let plain = Variant::default();
            let leap = kernels.bind(gpu, &EXTRAPOLATE_MULTIPLIERS, plain, &buffers)?;
            extrapolate = Some((leap, self.history.len().div_ceil(THREADS)));
        }
        Ok(JacobiKernels { apply, extrapolate })
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers = [self.before.buffer(), self.history.buffer()];
        buffers.into_iter().map(Buffer::size).sum()
    }
}

/// The kernels that end an iteration over the tets.
#[derive(Debug)]
pub(crate) struct JacobiKernels {
    apply: BoundKernel,
    /// Extrapolates multipliers, if they are kept.
    extrapolate: Option<(BoundKernel, usize)>,
}

impl JacobiKernels {
    /// Ends the iteration whose uniform is at `uniform`; `particles` is the number of workgroups over the particles.
    pub(crate) fn run(&self, pass: &mut Recorder<'_>, uniform: u32, particles: usize) {
        self.apply.run(pass, &[uniform], particles);
        if let Some((leap, groups)) = &self.extrapolate {
            leap.run(pass, &[uniform], *groups);
        }
    }
}
