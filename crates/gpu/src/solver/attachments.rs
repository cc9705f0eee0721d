//! [`Attachments`]: what hangs on moving handles, on the device.
//!
//! What is rigid rigidly and what hangs by a compliance are two lists, since they are moved at different times; a list
//! that is empty costs no dispatch. The host says where the handles are at the end of each substep and the device moves
//! their anchors: rotations and sums in single precision, so anchors are taken relative to the middle of all anchors on a
//! handle, which the host moves in double precision.
//!
//! Twin: `constraints/attachments.rs` of incise-xpbd, to a few roundings. The anchor at the start of a frame is that of the handle
//! there. Cost: 32 bytes an attachment, sent when some have changed; 48 bytes a handle and substep, sent when they
//! differ from those before.

use glam::{DMat3, DVec3, Vec3};
use incise_xpbd::{AttachmentData, Changes, Solver, StepSettings};

use super::gpu_types::Attachment;
use super::kernels::{BoundKernel, Kernels, MOVE_HELD, SOLVE_ATTACHMENTS, UPDATE_HELD, Variant};
use super::layout::THREADS;
use super::shared::Shared;
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Three rows of a rotation with what is added to each.
type Rows = [[f32; 4]; 3];

/// Attachments with what hangs on them.
#[derive(Debug)]
pub(crate) struct Attachments {
    /// What is where its handle says.
    rigid: List,
    /// What is pulled there.
    soft: List,
    /// Handle -> the middle of the anchors on it.
    middles: Vec<DVec3>,
    /// All at the start of a frame, then all at the end of each substep.
    poses: Array<Rows>,
    sent: Vec<Rows>,
    /// Of what hangs; empty with one iteration.
    multipliers: Array<[f32; 4]>,
}

/// Attachments on the device with a copy on the host.
#[derive(Debug)]
struct List {
    array: Array<Attachment>,
    host: Vec<Attachment>,
}

impl List {
    fn new(gpu: &GpuContext, what: &'static str) -> Result<Self, GpuError> {
        Ok(Self {
            array: Array::zeros(gpu, what, 0)?,
            host: Vec::new(),
        })
    }

    fn set(&mut self, gpu: &GpuContext, list: Vec<Attachment>) -> Result<(), GpuError> {
        if self.host != list {
            self.array.replace(gpu, &list)?;
            self.host = list;
        }
        Ok(())
    }

    fn groups(&self) -> usize {
        self.host.len().div_ceil(THREADS)
    }
}

impl Attachments {
    fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            rigid: List::new(gpu, "particles rigid by handles")?,
            soft: List::new(gpu, "particles soft on handles")?,
            middles: Vec::new(),
            poses: Array::zeros(gpu, "poses of handles", 0)?,
            sent: Vec::new(),
            multipliers: Array::zeros(gpu, "multipliers of attachments", 0)?,
        })
    }

    /// Takes over what hangs on handles if it may have changed; nothing is kept for nothing.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        changes: &Changes,
    ) -> Result<(), GpuError> {
        // A particle that was fixed or freed may be attached to a handle.
        if !changes.attachments && changes.particles.is_empty() {
            return Ok(());
        }
        if solver.attachments().len() == 0 {
            *this = None;
            return Ok(());
        }
        let handles = match this {
            Some(handles) => handles,
            None => this.insert(Self::new(gpu)?),
        };
        handles.middles = middles(solver);
        let (mut rigid, mut soft) = (Vec::new(), Vec::new());
        for data in solver.attachments() {
            let attachment = attachment(&data, handles.middles[data.handle as usize]);
            if data.compliance > 0.0 {
                soft.push(attachment);
            } else if !solver.is_fixed(data.particle as usize) {
                rigid.push(attachment);
            }
        }
        handles.rigid.set(gpu, rigid)?;
        handles.soft.set(gpu, soft)
    }

    /// Sends where the handles are in a frame, unless that is there.
    pub(crate) fn prepare(
        &mut self,
        gpu: &GpuContext,
        host: &Solver<f32>,
        settings: &StepSettings,
    ) -> Result<(), GpuError> {
        if settings.iterations > 1 {
            self.multipliers.resize(gpu, self.soft.host.len())?;
        }
        let mut poses = Vec::with_capacity(self.sent.len());
        for substep in 0..=settings.substeps {
            let fraction = f64::from(substep) / f64::from(settings.substeps);
            for (pose, &middle) in host.handle_poses(fraction).zip(&self.middles) {
                let axes = DVec3::AXES.map(|axis| pose.rotation * axis);
                let rotation = DMat3::from_cols(axes[0], axes[1], axes[2]).transpose();
                let rows = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
                let add = (pose.apply(middle) - host.origin()).as_vec3().to_array();
                poses.push([0, 1, 2].map(|k| {
                    let Vec3 { x, y, z } = rows[k].as_vec3();
                    [x, y, z, add[k]]
                }));
            }
        }
        if self.sent != poses {
            self.poses.replace(gpu, &poses)?;
            self.sent = poses;
        }
        Ok(())
    }

    pub(crate) fn handle_count(&self) -> usize {
        self.middles.len()
    }

    pub(crate) fn rigid_count(&self) -> usize {
        self.rigid.host.len()
    }

    pub(crate) fn soft_count(&self) -> usize {
        self.soft.host.len()
    }

    /// The kernels for what there is.
    pub(crate) fn bind(
        &self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        shared: &Shared<'_>,
        keeps: bool,
    ) -> Result<AttachmentKernels, GpuError> {
        let (rigid, soft) = (self.rigid.array.buffer(), self.soft.array.buffer());
        let poses = self.poses.buffer();
        let mut passes = AttachmentKernels::default();
        if self.rigid_count() > 0 {
            let (plain, groups) = (Variant::default(), self.rigid.groups());
            let buffers = [
                shared.settings,
                shared.uniforms,
                shared.particles,
                rigid,
                poses,
                shared.repaired,
            ];
            let moving = kernels.bind(gpu, &MOVE_HELD, plain, &buffers)?;
            let buffers = [
                shared.settings,
                shared.particles,
                shared.previous,
                shared.velocities,
                rigid,
            ];
            let update = kernels.bind(gpu, &UPDATE_HELD, plain, &buffers)?;
            passes.rigid = Some((moving, update, groups));
        }
        if self.soft_count() > 0 {
            let variant = Variant {
                keeps,
                ..Variant::default()
            };
            let buffers = [
                shared.settings,
                shared.uniforms,
                shared.particles,
                shared.previous,
                soft,
                poses,
                self.multipliers.buffer(),
            ];
            let solve = kernels.bind(gpu, &SOLVE_ATTACHMENTS, variant, &buffers)?;
            passes.soft = Some((solve, self.soft.groups()));
        }
        Ok(passes)
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers = [
            self.rigid.array.buffer(),
            self.soft.array.buffer(),
            self.poses.buffer(),
            self.multipliers.buffer(),
        ];
        buffers.into_iter().map(wgpu::Buffer::size).sum()
    }
}

/// The kernels for what hangs on handles, with their workgroups.
#[derive(Debug, Default)]
pub(crate) struct AttachmentKernels {
    rigid: Option<(BoundKernel, BoundKernel, usize)>,
    soft: Option<(BoundKernel, usize)>,
}

impl AttachmentKernels {
    /// At the start of a substep; `uniform` is where its uniform is.
    pub(crate) fn move_held(&self, pass: &mut Recorder<'_>, uniform: u32) {
        if let Some((moving, _, groups)) = &self.rigid {
            moving.run(pass, &[uniform], *groups);
        }
    }

    /// In an iteration, after the tets.
    pub(crate) fn solve(&self, pass: &mut Recorder<'_>, uniform: u32) {
        if let Some((solve, groups)) = &self.soft {
            solve.run(pass, &[uniform], *groups);
        }
    }

    /// At the end of a substep.
    pub(crate) fn update_held(&self, pass: &mut Recorder<'_>) {
        if let Some((_, update, groups)) = &self.rigid {
            update.run(pass, &[], *groups);
        }
    }
}

/// The middle of the anchors on each handle; 0 without any.
fn middles(solver: &Solver<f32>) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); solver.handle_poses(0.0).len()];
    for data in solver.attachments() {
        let (sum, number) = &mut sums[data.handle as usize];
        *sum += data.anchor;
        *number += 1.0;
    }
    let middle = |(sum, number): (DVec3, f64)| sum / number.max(1.0);
    sums.into_iter().map(middle).collect()
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the device computes in single precision"
)]
fn attachment(data: &AttachmentData, middle: DVec3) -> Attachment {
    Attachment {
        anchor: (data.anchor - middle).as_vec3().to_array(),
        particle: data.particle,
        handle: data.handle,
        compliance: data.compliance as f32,
        damping: data.damping as f32,
        unused: 0,
    }
}
