//! [`IterationUniforms`]: per-iteration values: number, substep and weight of Chebyshev extrapolation.
//!
//! All of them are in one buffer before the frame begins, and a dispatch sees its own by a dynamic offset. Only scenes
//! with colliders, handles or Jacobi iterations need them. Cost: 256 bytes per iteration of a frame, sent when settings
//! change.

use incise_xpbd::{Method, StepSettings};
use wgpu::{Buffer, BufferUsages};

use super::gpu_types::IterationUniform;
use crate::array::Array;
use crate::kernel::STRIDE;
use crate::{GpuContext, GpuError};

/// The uniforms of a frame.
#[derive(Debug)]
pub(crate) struct IterationUniforms {
    array: Array<[IterationUniform; PER_STRIDE]>,
    sent: Option<(u32, u32, Method)>,
}

/// Uniforms that fit into the space of one.
const PER_STRIDE: usize = STRIDE as usize / size_of::<IterationUniform>();

impl IterationUniforms {
    pub(crate) fn buffer(&self) -> &Buffer {
        self.array.buffer()
    }

    /// Sends the uniforms of a frame unless the device has them; keeps none unless the frame `asks` for them.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        settings: &StepSettings,
        asks: bool,
    ) -> Result<(), GpuError> {
        if !asks {
            *this = None;
            return Ok(());
        }
        let all = match this {
            Some(uniforms) => uniforms,
            None => this.insert(Self {
                array: Array::with_usage(gpu, "uniforms", 0, BufferUsages::UNIFORM)?,
                sent: None,
            }),
        };
        let StepSettings {
            substeps,
            iterations,
            method,
            ..
        } = *settings;
        if all.sent == Some((substeps, iterations, method)) {
            return Ok(());
        }
        let weights = weights(method, iterations);
        let uniform = |substep, (iteration, &weight)| {
            let mut uniforms = [IterationUniform::default(); PER_STRIDE];
            uniforms[0] = IterationUniform {
                substep,
                iteration,
                weight,
                unused: 0,
            };
            uniforms
        };
        let uniforms: Vec<_> = (0..substeps)
            .flat_map(|substep| (0..).zip(&weights).map(move |at| uniform(substep, at)))
            .collect();
        all.array.replace(gpu, &uniforms)?;
        all.sent = Some((substeps, iterations, method));
        Ok(())
    }
}

/// The offset of an iteration's uniform, in bytes.
pub(crate) fn offset(settings: &StepSettings, substep: u32, iteration: u32) -> u32 {
    let number = u64::from(substep) * u64::from(settings.iterations) + u64::from(iteration);
    // Sending rejects more than fit into a buffer; without uniforms the offset is not used.
    u32::try_from(number * u64::from(STRIDE)).unwrap_or(u32::MAX)
}

/// The extrapolation weight of each iteration of a substep; 0 is none. Twin: `Jacobi::extrapolate` of incise-xpbd.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the device computes in single precision"
)]
fn weights(method: Method, iterations: u32) -> Vec<f32> {
    let Method::Chebyshev {
        spectral_radius,
        chebyshev_start,
    } = method
    else {
        return vec![0.0; iterations as usize];
    };
    let square = spectral_radius * spectral_radius;
    let mut weight = 1.0;
    (1..=iterations)
        .map(|made| {
            if made <= chebyshev_start {
                return 0.0;
            }
            weight = match made == chebyshev_start + 1 {
                true => 2.0 / (2.0 - square),
                false => 4.0 / (4.0 - square * weight),
            };
            weight as f32
        })
        .collect()
}
