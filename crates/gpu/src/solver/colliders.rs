//! [`Colliders`]: the colliders of all substeps of a frame on the device.
//!
//! The host computes the poses at the end of each substep in its own precision; the kernel only computes nearest
//! points. All colliders are sent together, and only if their values differ from those on the device: colliders at rest
//! are sent once. Cost: 88 bytes per collider and substep.

use incise_xpbd::{Solver, StepSettings};

use super::kernels::{BoundKernel, Kernels, PROJECT_TO_COLLIDERS, Variant};
use super::shared::Shared;
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// The colliders of a frame.
#[derive(Debug)]
pub(crate) struct Colliders {
    array: Array<[f32; 22]>,
    /// The values on the device, and scratch memory for new ones.
    sent: Vec<[f32; 22]>,
    next: Vec<[f32; 22]>,
}

impl Colliders {
    /// Sends the colliders of a frame unless the device has them; without colliders no memory is kept.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        host: &Solver<f32>,
        settings: &StepSettings,
    ) -> Result<(), GpuError> {
        if settings.colliders.is_empty() {
            *this = None;
            return Ok(());
        }
        let colliders = match this {
            Some(colliders) => colliders,
            None => this.insert(Self {
                array: Array::zeros(gpu, "colliders", 0)?,
                sent: Vec::new(),
                next: Vec::new(),
            }),
        };
        colliders.next.clear();
        for substep in 1..=settings.substeps {
            let elapsed = f64::from(substep) * settings.substep_time();
            let data = host.collider_data(settings, elapsed);
            colliders.next.extend(data);
        }
        if colliders.next != colliders.sent {
            colliders.array.replace(gpu, &colliders.next)?;
            std::mem::swap(&mut colliders.next, &mut colliders.sent);
        }
        Ok(())
    }

    /// The kernel that projects particles to the surfaces of the colliders.
    pub(crate) fn bind(
        &self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        shared: &Shared<'_>,
    ) -> Result<BoundKernel, GpuError> {
        let buffers = [
            shared.settings,
            shared.uniforms,
            shared.particles,
            shared.previous,
            self.array.buffer(),
        ];
        kernels.bind(gpu, &PROJECT_TO_COLLIDERS, Variant::default(), &buffers)
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.array.buffer().size()
    }
}
