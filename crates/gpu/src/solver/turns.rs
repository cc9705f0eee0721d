//! [`Turns`]: what an iteration of a frame is told beside the settings: which it is, in which substep, and how far
//! Chebyshev's leap goes.
//!
//! They are all in one buffer before the frame begins, and a dispatch sees its own by a dynamic offset. Only scenes with
//! colliders, handles or Jacobi iterations need them. Cost: 256 bytes an iteration of a frame, sent when settings change.

use incise_xpbd::{Method, StepSettings};
use wgpu::{Buffer, BufferUsages};

use super::gpu_types::Turn;
use crate::array::Array;
use crate::kernel::STRIDE;
use crate::{GpuContext, GpuError};

/// The turns of a frame.
#[derive(Debug)]
pub(crate) struct Turns {
    array: Array<[Turn; PER_STRIDE]>,
    sent: Option<(u32, u32, Method)>,
}

/// Turns that would fit where one is.
const PER_STRIDE: usize = STRIDE as usize / size_of::<Turn>();

impl Turns {
    pub(crate) fn buffer(&self) -> &Buffer {
        self.array.buffer()
    }

    /// Sends the turns of a frame unless they are there; keeps none unless the frame `asks` for them.
    pub(crate) fn follow(
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
            Some(turns) => turns,
            None => this.insert(Self {
                array: Array::with_usage(gpu, "turns", 0, BufferUsages::UNIFORM)?,
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
        let turn = |substep, (iteration, &weight)| {
            let mut turns = [Turn::default(); PER_STRIDE];
            turns[0] = Turn {
                substep,
                iteration,
                weight,
                unused: 0,
            };
            turns
        };
        let turns: Vec<_> = (0..substeps)
            .flat_map(|substep| (0..).zip(&weights).map(move |at| turn(substep, at)))
            .collect();
        all.array.replace(gpu, &turns)?;
        all.sent = Some((substeps, iterations, method));
        Ok(())
    }
}

/// Where the turn of an iteration is, in bytes.
pub(crate) fn offset(settings: &StepSettings, substep: u32, iteration: u32) -> u32 {
    let number = u64::from(substep) * u64::from(settings.iterations) + u64::from(iteration);
    // More than a buffer holds are refused when they are sent; without turns the offset is not used.
    u32::try_from(number * u64::from(STRIDE)).unwrap_or(u32::MAX)
}

/// How far each iteration of a substep leaps; 0 is not at all. Twin: `Jacobi::extrapolate` of incise-xpbd.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the device computes in single precision"
)]
fn weights(method: Method, iterations: u32) -> Vec<f32> {
    let Method::Chebyshev {
        spectral_radius,
        delay,
    } = method
    else {
        return vec![0.0; iterations as usize];
    };
    let square = spectral_radius * spectral_radius;
    let mut weight = 1.0;
    (1..=iterations)
        .map(|made| {
            if made <= delay {
                return 0.0;
            }
            weight = match made == delay + 1 {
                true => 2.0 / (2.0 - square),
                false => 4.0 / (4.0 - square * weight),
            };
            weight as f32
        })
        .collect()
}
