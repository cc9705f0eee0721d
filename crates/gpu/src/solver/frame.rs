//! [`Frame`]: a step as one pass of dispatches.
//!
//! Everything that differs from substep to substep is in buffers before the pass begins, so it needs no break. Twin:
//! `Solver::substep` of incise-xpbd. Cost: recording a third of a microsecond a dispatch.

use std::sync::Arc;

use incise_xpbd::{Form as Solving, Method, Solver, StepSettings};
use wgpu::{BindGroup, Buffer, BufferUsages};

use super::body::Body;
use super::kernels::{CLEAR_MULTIPLIERS, Kernels, PREDICT, UPDATE_VELOCITIES, Variant, solve};
use super::layout::{Form, THREADS};
use super::numbers::Settings;
use crate::array::{Array, Staging};
use crate::kernel::{Kernel, Recorder};
use crate::{GpuContext, GpuError};

/// What a step needs beside the body.
#[derive(Debug)]
pub(crate) struct Frame {
    settings: Array<Settings>,
    sent: Option<Settings>,
    /// Positions before the constraints of the last substep; empty unless a step keeps them.
    predicted: Array<[f32; 4]>,
    /// Whether the last step kept what residuals need.
    kept: bool,
}

impl Frame {
    pub(crate) fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            settings: Array::with_usage(gpu, "settings", 1, BufferUsages::UNIFORM)?,
            sent: None,
            predicted: Array::zeros(gpu, "predicted positions", 0)?,
            kept: false,
        })
    }

    /// Records a step and hands it over.
    #[expect(
        clippy::too_many_arguments,
        reason = "the parts of a solver, borrowed one by one"
    )]
    pub(crate) fn record(
        &mut self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        body: &mut Body,
        host: &Solver<f32>,
        repaired: &Array<u32>,
        settings: &StepSettings,
        keep: bool,
    ) -> Result<(), GpuError> {
        refuse(host, settings)?;
        self.send_settings(gpu, body, host, settings);
        let keeps = keep || settings.iterations > 1;
        if keeps {
            body.multipliers.resize(gpu, body.layout.place_count())?;
        }
        if keep {
            self.predicted.resize(gpu, host.particle_count())?;
        }
        self.kept = keep;
        let bound = Bound::new(
            gpu,
            kernels,
            body,
            host,
            &self.settings,
            repaired,
            settings,
            keeps,
        )?;
        let mut encoder = gpu.encoder("frame");
        let mut pass = Recorder::new(gpu, &mut encoder, "frame", None);
        let particles = host.particle_count().div_ceil(THREADS);
        for substep in 1..=settings.substeps {
            bound.predict.run(&mut pass, &[], particles);
            if let Some(clear) = &bound.clear {
                clear.run(&mut pass, &[], body.layout.place_count().div_ceil(THREADS));
            }
            if keep && substep == settings.substeps {
                drop(pass);
                let bytes = (host.particle_count() * size_of::<[f32; 4]>()) as u64;
                let (from, to) = (body.particles.buffer(), self.predicted.buffer());
                encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
                pass = Recorder::new(gpu, &mut encoder, "frame", None);
            }
            for _ in 0..settings.iterations {
                for run in &body.colors.runs {
                    let solve = if run.tail { &bound.tail } else { &bound.solve };
                    solve.run(&mut pass, &[run.offset], run.groups);
                }
            }
            bound.update.run(&mut pass, &[], particles);
        }
        drop(pass);
        gpu.submit(encoder)
    }

    /// Sends the settings if they are others.
    fn send_settings(
        &mut self,
        gpu: &GpuContext,
        body: &Body,
        host: &Solver<f32>,
        settings: &StepSettings,
    ) {
        let time = settings.substep_time();
        let gravity = settings.gravity.unwrap_or_default() * time;
        let mut material = [0.0; 4];
        if host.is_uniform() && host.tet_count() > 0 {
            material[..3].copy_from_slice(&host.tet_data(0).constants);
        }
        let depth = match body.layout.form {
            Form::Threads => body.layout.depth(),
            Form::Workgroups => 0,
        };
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the device computes in single precision"
        )]
        let values = Settings {
            gravity: gravity.as_vec3().to_array(),
            time: time as f32,
            time_squared: (time * time) as f32,
            per_time: (1.0 / time) as f32,
            relaxation: settings.relaxation as f32,
            one: 1.0,
            steep: Solver::<f32>::STEEP as f32,
            particles: index(host.particle_count()),
            depth: index(depth),
            places: index(body.layout.place_count()),
            material,
        };
        if self.sent != Some(values) {
            self.settings.write(gpu, 0, &[values]);
            self.sent = Some(values);
        }
    }

    /// Starts to read what residuals need, if the last step kept it.
    #[expect(
        clippy::type_complexity,
        reason = "predicted positions and multipliers"
    )]
    pub(crate) fn stage_last_substep(
        &self,
        gpu: &GpuContext,
        body: &Body,
    ) -> Result<Option<(Staging<[f32; 4]>, Staging<[f32; 2]>)>, GpuError> {
        if !self.kept {
            return Ok(None);
        }
        let predicted = self.predicted.stage(gpu, self.predicted.len())?;
        let multipliers = body.multipliers.stage(gpu, body.multipliers.len())?;
        Ok(Some((predicted, multipliers)))
    }
}

/// What the device does not do.
fn refuse(host: &Solver<f32>, settings: &StepSettings) -> Result<(), GpuError> {
    let unsupported = |what| Err(GpuError::Unsupported { what });
    if settings.method != Method::GaussSeidel {
        return unsupported("other methods than Gauss-Seidel");
    }
    if !settings.colliders.is_empty() {
        return unsupported("colliders");
    }
    if host.attachments().len() > 0 {
        return unsupported("handles");
    }
    if host.distance_count() > 0 || host.volume_count() > 0 {
        return unsupported("distance and volume constraints");
    }
    Ok(())
}

/// A kernel with its buffers.
struct BoundKernel {
    kernel: Arc<Kernel>,
    group: BindGroup,
}

impl BoundKernel {
    fn new(gpu: &GpuContext, kernel: Arc<Kernel>, buffers: &[&Buffer]) -> Self {
        let group = kernel.bind(gpu, buffers);
        Self { kernel, group }
    }

    fn run(&self, pass: &mut Recorder<'_>, offsets: &[u32], groups: usize) {
        pass.dispatch(&self.kernel, &self.group, offsets, groups);
    }
}

/// The kernels of a step.
struct Bound {
    predict: BoundKernel,
    /// Where multipliers are kept.
    clear: Option<BoundKernel>,
    solve: BoundKernel,
    tail: BoundKernel,
    update: BoundKernel,
}

impl Bound {
    #[expect(
        clippy::too_many_arguments,
        reason = "the parts of a solver, borrowed one by one"
    )]
    fn new(
        gpu: &GpuContext,
        kernels: &mut Kernels,
        body: &Body,
        host: &Solver<f32>,
        constants: &Array<Settings>,
        repaired: &Array<u32>,
        settings: &StepSettings,
        keeps: bool,
    ) -> Result<Self, GpuError> {
        let constants = constants.buffer();
        let (particles, previous) = (body.particles.buffer(), body.previous.buffer());
        let velocities = body.velocities.buffer();
        let variant = Variant {
            damped: host.is_damped(),
            sequential: settings.form == Solving::Sequential,
            keeps,
            jacobi: false,
            various: !host.is_uniform(),
        };
        let last = match body.layout.form {
            Form::Threads => body.corrections.buffer(),
            Form::Workgroups => body.tiles.buffer(),
        };
        let tets = [
            constants,
            body.colors.parts.array.buffer(),
            particles,
            body.corners.buffer(),
            body.rest.buffer(),
            body.constants.buffer(),
            previous,
            body.multipliers.buffer(),
            body.colors.lists.array.buffer(),
            last,
        ];
        let mut solving = |tail| {
            let kernel = kernels.solving(gpu, solve(body.layout.form, tail), variant)?;
            Ok::<_, GpuError>(BoundKernel::new(gpu, kernel, &tets))
        };
        let (solve, tail) = (solving(false)?, solving(true)?);
        let mut plain = |source, buffers: &[&Buffer]| {
            let kernel = kernels.plain(gpu, source)?;
            Ok::<_, GpuError>(BoundKernel::new(gpu, kernel, buffers))
        };
        Ok(Self {
            predict: plain(&PREDICT, &[constants, particles, previous, velocities])?,
            clear: match keeps {
                true => Some(plain(
                    &CLEAR_MULTIPLIERS,
                    &[constants, body.multipliers.buffer()],
                )?),
                false => None,
            },
            solve,
            tail,
            update: plain(
                &UPDATE_VELOCITIES,
                &[
                    constants,
                    particles,
                    previous,
                    velocities,
                    repaired.buffer(),
                ],
            )?,
        })
    }
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("particles and places are numbered by 32 bits")
}
