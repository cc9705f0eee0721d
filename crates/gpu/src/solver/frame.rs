//! [`Frame`]: a step as one pass of dispatches.
//!
//! All values that differ between substeps are in buffers before the pass begins, so the pass is
//! not interrupted. Twin: `Solver::substep` of incise-xpbd. Cost: well below a microsecond to
//! record a dispatch.

use std::ops::Range;

use incise_xpbd::{Solver, StepSettings, TetSolve};
use wgpu::{Buffer, BufferUsages, SubmissionIndex};

use super::attachments::{AttachmentKernels, Attachments};
use super::body_buffers::BodyBuffers;
use super::colliders::Colliders;
use super::contacts::ContactKernels;
use super::gpu_types::Settings;
use super::iterations::{self, IterationUniforms};
use super::jacobi::{Jacobi, JacobiKernels};
use super::kernels::{
    BoundKernel, CLEAR, Kernels, PREDICT, UPDATE_VELOCITIES, Variant, damp_tets, solve_tets,
};
use super::layout::{ClusterMapping, THREADS};
use super::scalar_constraints::ScalarKernels;
use super::shared::Shared;
use super::stages::{Clock, Stage::*, Track};
use crate::array::{Array, Copy};
use crate::index::index;
use crate::{GpuContext, GpuError};

/// Data of a step beside the body.
#[derive(Debug)]
pub(crate) struct Frame {
    settings: Array<Settings>,
    sent: Option<Settings>,
    /// Uniforms of iterations, if a kernel needs them.
    uniforms: Option<IterationUniforms>,
    /// Colliders, if there are any.
    colliders: Option<Colliders>,
    /// Data of Jacobi iterations, if these are selected.
    jacobi: Option<Jacobi>,
    /// Positions before the constraints of the last substep; empty unless a step keeps them.
    predicted: Array<[f32; 4]>,
    /// The form of the tet solve, if the last step kept the data for residuals.
    kept: Option<TetSolve>,
    /// Timestamps, if stages are timed.
    clock: Option<Clock>,
}

/// Inputs and outputs of a step beside the frame.
#[derive(Debug)]
pub(crate) struct Scene<'a> {
    pub(crate) gpu: &'a GpuContext,
    pub(crate) kernels: &'a mut Kernels,
    pub(crate) body: &'a mut BodyBuffers,
    pub(crate) host: &'a Solver<f32>,
    pub(crate) repaired: &'a Array<u32>,
}

impl Frame {
    pub(crate) fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            settings: Array::with_usage(gpu, "settings", 1, BufferUsages::UNIFORM)?,
            sent: None,
            uniforms: None,
            colliders: None,
            jacobi: None,
            predicted: Array::zeros(gpu, "predicted positions", 0)?,
            kept: None,
            clock: None,
        })
    }

    /// Records and submits some substeps of a frame; returns the index to wait for.
    pub(crate) fn record(
        &mut self,
        scene: Scene<'_>,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<SubmissionIndex, GpuError> {
        let Scene { gpu, host, .. } = scene;
        let keeps = keep || settings.iterations > 1;
        self.prepare(gpu, scene.body, host, settings, keeps)?;
        let begins = match &mut scene.body.contacts {
            Some(contacts) => contacts.prepare(gpu, host, settings, part.start)?,
            None => false,
        };
        if keep {
            self.predicted.resize(gpu, host.particle_count())?;
        }
        self.kept = keep.then_some(settings.tet_solve);
        let passes = self.bind(
            gpu,
            scene.kernels,
            scene.body,
            host,
            scene.repaired,
            settings,
            keeps,
            begins,
        )?;
        let body = &*scene.body;
        let mut track = Track::new(gpu, self.clock.as_mut());
        let particles = host.particle_count().div_ceil(THREADS);
        if let Some(contacts) = &passes.contacts {
            contacts.begin_frame(track.at(Other));
        }
        for substep in part {
            let start = iterations::offset(settings, substep, 0);
            passes.predict.run(track.at(Predict), &[], particles);
            if let Some(handles) = &passes.handles {
                handles.move_rigid_attachments(track.at(Other), start);
            }
            if let Some(clear) = &passes.clear {
                let words = 2 * body.layout.tet_slot_count();
                clear.run(track.at(Other), &[], words.div_ceil(THREADS));
            }
            for scalars in &passes.scalars {
                scalars.begin(track.at(Other));
            }
            if let Some(contacts) = &passes.contacts {
                contacts.begin_substep(track.at(Other));
            }
            if keep && substep + 1 == settings.substeps {
                let bytes = (host.particle_count() * size_of::<[f32; 4]>()) as u64;
                let (from, to) = (body.particles.buffer(), self.predicted.buffer());
                let encoder = track.between_passes();
                encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
            }
            for iteration in 0..settings.iterations {
                let uniform = iterations::offset(settings, substep, iteration);
                let [one, several] = &passes.solve;
                body.colors.run(track.at(Solve), one, several);
                if let Some(jacobi) = &passes.jacobi {
                    jacobi.run(track.at(Solve), uniform, particles);
                }
                if let Some(handles) = &passes.handles {
                    handles.solve(track.at(Other), uniform);
                }
                for scalars in &passes.scalars {
                    scalars.solve(track.at(Other));
                }
                if let Some(contacts) = &passes.contacts {
                    contacts.solve(track.at(Other));
                }
                if let Some(project) = &passes.project {
                    project.run(track.at(Other), &[uniform], particles);
                }
            }
            passes.update.run(track.at(Update), &[], particles);
            if let Some(handles) = &passes.handles {
                handles.update_rigid_attachments(track.at(Other));
            }
            if let Some([one, several]) = &passes.damp {
                body.colors.run(track.at(Damp), one, several);
            }
        }
        track.submit()
    }

    /// Sends the data of the frame, unless the device has them.
    fn prepare(
        &mut self,
        gpu: &GpuContext,
        body: &mut BodyBuffers,
        host: &Solver<f32>,
        settings: &StepSettings,
        keeps: bool,
    ) -> Result<(), GpuError> {
        self.send_settings(gpu, body, host, settings);
        if keeps {
            body.multipliers.resize(gpu, body.layout.tet_slot_count())?;
        }
        Jacobi::prepare(&mut self.jacobi, gpu, body, host.particle_count(), settings)?;
        Colliders::sync(&mut self.colliders, gpu, host, settings)?;
        if let Some(handles) = &mut body.attachments {
            handles.prepare(gpu, host, settings)?;
        }
        if settings.iterations > 1 {
            for scalars in body.distances.iter_mut().chain(&mut body.volumes) {
                scalars.keep_multipliers(gpu)?;
            }
        }
        let asks = self.colliders.is_some() || body.attachments.is_some() || self.jacobi.is_some();
        IterationUniforms::sync(&mut self.uniforms, gpu, settings, asks)
    }

    /// Sends the settings if they have changed.
    fn send_settings(
        &mut self,
        gpu: &GpuContext,
        body: &BodyBuffers,
        host: &Solver<f32>,
        settings: &StepSettings,
    ) {
        let time = settings.substep_time();
        let gravity = settings.gravity.unwrap_or_default() * time;
        let mut material = [0.0; 4];
        if host.is_uniform() && host.tet_count() > 0 {
            material[..3].copy_from_slice(&host.tet_data(0).constants);
        }
        let depth = match body.layout.mapping {
            ClusterMapping::Threads => body.layout.depth(),
            ClusterMapping::Workgroups => 0,
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
            half: 0.5,
            max_cofactor_norm: Solver::<f32>::MAX_COFACTOR_NORM as f32,
            particles: index(host.particle_count()),
            depth: index(depth),
            colliders: index(settings.colliders.len()),
            handles: index(
                body.attachments
                    .as_ref()
                    .map_or(0, Attachments::handle_count),
            ),
            rigid: index(
                body.attachments
                    .as_ref()
                    .map_or(0, Attachments::rigid_count),
            ),
            soft: index(body.attachments.as_ref().map_or(0, Attachments::soft_count)),
            material,
        };
        if self.sent != Some(values) {
            self.settings.write(gpu, 0, &[values]);
            self.sent = Some(values);
        }
    }

    /// The timestamps of stages; `None` unless requested.
    pub(crate) fn clock(&mut self) -> &mut Option<Clock> {
        &mut self.clock
    }

    /// The settings of the last step, on the device.
    pub(crate) fn settings(&self) -> &Buffer {
        self.settings.buffer()
    }

    /// Bytes of the frame's data on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let uniforms = self
            .uniforms
            .as_ref()
            .map_or(0, |uniforms| uniforms.buffer().size());
        let colliders = self.colliders.as_ref().map_or(0, Colliders::bytes);
        let jacobi = self.jacobi.as_ref().map_or(0, Jacobi::bytes);
        let always = self.settings.buffer().size() + self.predicted.buffer().size();
        let clock = self.clock.as_ref().map_or(0, Clock::bytes);
        always + uniforms + colliders + jacobi + clock
    }

    /// Records copies of the data for residuals, if the last step kept them.
    pub(crate) fn copy_last_substep(
        &self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        body: &BodyBuffers,
    ) -> Result<Option<LastSubstep>, GpuError> {
        let Some(tet_solve) = self.kept else {
            return Ok(None);
        };
        let (predicted, multipliers) = (&self.predicted, &body.multipliers);
        Ok(Some(LastSubstep {
            predicted: predicted.copy_out(gpu, encoder, predicted.len())?,
            multipliers: multipliers.copy_out(gpu, encoder, multipliers.len())?,
            tet_solve,
        }))
    }
}

/// Copies of the last substep's data for residuals.
#[derive(Debug)]
pub(crate) struct LastSubstep {
    pub(crate) predicted: Copy<[f32; 4]>,
    /// Tet slot -> multipliers.
    pub(crate) multipliers: Copy<[f32; 2]>,
    pub(crate) tet_solve: TetSolve,
}

/// The kernels of a step, in the order of a substep; unneeded ones are absent.
#[derive(Debug)]
struct StepContext<'a> {
    predict: BoundKernel,
    /// Clears multipliers, if they are kept.
    clear: Option<BoundKernel>,
    /// Kernels for one color of tets, and for several small colors.
    solve: [BoundKernel; 2],
    project: Option<BoundKernel>,
    update: BoundKernel,
    /// Damping kernels, if a material is damped.
    damp: Option<[BoundKernel; 2]>,
    jacobi: Option<JacobiKernels>,
    handles: Option<AttachmentKernels>,
    /// Kernels of distances, then of volumes.
    scalars: Vec<ScalarKernels<'a>>,
    contacts: Option<ContactKernels<'a>>,
}

impl Frame {
    #[expect(
        clippy::too_many_arguments,
        reason = "the parts of a solver, borrowed one by one"
    )]
    fn bind<'a>(
        &self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        body: &'a BodyBuffers,
        host: &Solver<f32>,
        repaired: &Array<u32>,
        settings: &StepSettings,
        keeps: bool,
        begins: bool,
    ) -> Result<StepContext<'a>, GpuError> {
        let constants = self.settings.buffer();
        let (particles, previous) = (body.particles.buffer(), body.previous.buffer());
        let velocities = body.velocities.buffer();
        let several = settings.iterations > 1;
        let mapping = body.layout.mapping;
        let plain = Variant::default();
        let damping = Variant {
            various: !host.is_uniform(),
            tile: body.layout.tile(),
            ..plain
        };
        let solving = Variant {
            keeps,
            jacobi: self.jacobi.is_some(),
            ..damping
        };
        let solving = solving.with_tet_solve(settings.tet_solve, several);
        let tets = [
            constants,
            body.colors.ranges.array.buffer(),
            body.corners.buffer(),
            body.rest.buffer(),
            body.constants.buffer(),
            body.colors.lists.array.buffer(),
            particles,
        ];
        let multipliers = body.multipliers.buffer();
        let (corrections, tiles) = (body.corrections.buffer(), body.tiles.buffer());
        let (solved, damped): (&[_], &[_]) = match mapping {
            ClusterMapping::Threads => (&[multipliers, corrections], &[velocities]),
            ClusterMapping::Workgroups => (&[multipliers, tiles], &[velocities, tiles]),
        };
        let (solved, damped) = ([&tets, solved].concat(), [&tets, damped].concat());
        let update = [
            constants,
            particles,
            previous,
            velocities,
            repaired.buffer(),
        ];
        let uniforms = self.uniforms.as_ref().map(IterationUniforms::buffer);
        let shared = uniforms.map(|uniforms| Shared {
            settings: constants,
            uniforms,
            particles,
            previous,
            velocities,
            repaired: repaired.buffer(),
        });
        let mut scalars = Vec::new();
        for constraints in body.distances.iter().chain(&body.volumes) {
            let buffers = [constants, particles, previous];
            scalars.push(constraints.bind(gpu, kernels, buffers, several)?);
        }
        let contacts = match &body.contacts {
            Some(contacts) => {
                let buffers = [constants, particles, previous];
                contacts.bind(gpu, kernels, buffers, several, begins)?
            }
            None => None,
        };
        let mut bind =
            |source, variant, buffers: &[&Buffer]| kernels.bind(gpu, source, variant, buffers);
        Ok(StepContext {
            predict: bind(
                &PREDICT,
                plain,
                &[constants, particles, previous, velocities],
            )?,
            clear: match keeps {
                true => Some(bind(&CLEAR, plain, &[body.multipliers.buffer()])?),
                false => None,
            },
            solve: {
                let [one, several] = solve_tets(mapping);
                [
                    bind(one, solving, &solved)?,
                    bind(several, solving, &solved)?,
                ]
            },
            update: bind(&UPDATE_VELOCITIES, plain, &update)?,
            damp: match host.is_damped() {
                true => {
                    let [one, several] = damp_tets(mapping);
                    Some([
                        bind(one, damping, &damped)?,
                        bind(several, damping, &damped)?,
                    ])
                }
                false => None,
            },
            project: match (&self.colliders, &shared) {
                (Some(colliders), Some(shared)) => Some(colliders.bind(gpu, kernels, shared)?),
                _ => None,
            },
            handles: match (&body.attachments, &shared) {
                (Some(handles), Some(shared)) => Some(handles.bind(gpu, kernels, shared, several)?),
                _ => None,
            },
            jacobi: match (&self.jacobi, &shared) {
                (Some(jacobi), Some(shared)) => {
                    Some(jacobi.bind(gpu, kernels, body, shared, keeps)?)
                }
                _ => None,
            },
            scalars,
            contacts,
        })
    }
}
