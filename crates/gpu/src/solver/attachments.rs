//! [`Attachments`]: attachments to moving handles on the device.
//!
//! Rigid and compliant attachments are two lists, since they are moved at different times; an empty list costs no
//! dispatch. The host passes the poses of the handles at the end of each substep and the device moves the anchors.
//! Rotations and sums are in single precision, so anchors are relative to the middle of all anchors on a handle, which
//! the host moves in double precision.
//!
//! Twin: `constraints/attachments.rs` of incise-xpbd, equal up to a few roundings. As in the twin, the anchor at the
//! start of a frame is the handle's. Cost: 32 bytes per attachment, sent when some have changed; 48 bytes per handle
//! and substep, sent when they have changed.

use glam::{DMat3, DVec3, Vec3};
use incise_xpbd::{AttachmentData, Changes, Solver, StepSettings};

use super::gpu_types::Attachment;
use super::kernels::{
    BoundKernel, Kernels, MOVE_RIGID_ATTACHMENTS, SOLVE_ATTACHMENTS, UPDATE_RIGID_ATTACHMENTS,
    Variant,
};
use super::layout::THREADS;
use super::shared::Shared;
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Three rows of a rotation, each with its component of the translation.
type Rows = [[f32; 4]; 3];

/// The attachments of a body.
#[derive(Debug)]
pub(crate) struct Attachments {
    /// Particles that are moved to their anchors.
    rigid: List,
    /// Particles that are pulled to their anchors by a compliant constraint.
    soft: List,
    /// Handle -> the middle of the anchors on it.
    middles: Vec<DVec3>,
    /// Poses of all handles at the start of a frame, then at the end of each substep.
    poses: Array<Rows>,
    sent: Vec<Rows>,
    /// Multipliers of compliant attachments; empty with one iteration.
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

    /// Applies changes of attachments; without attachments no memory is kept.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        changes: &Changes,
    ) -> Result<(), GpuError> {
        // A particle that was fixed or freed may have an attachment.
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

    /// Sends the poses of the handles in a frame, unless the device has them.
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

    /// Binds the kernels of the lists that are not empty.
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
            let moving = kernels.bind(gpu, &MOVE_RIGID_ATTACHMENTS, plain, &buffers)?;
            let buffers = [
                shared.settings,
                shared.particles,
                shared.previous,
                shared.velocities,
                rigid,
            ];
            let update = kernels.bind(gpu, &UPDATE_RIGID_ATTACHMENTS, plain, &buffers)?;
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

/// The kernels of attachments, with their workgroups.
#[derive(Debug, Default)]
pub(crate) struct AttachmentKernels {
    rigid: Option<(BoundKernel, BoundKernel, usize)>,
    soft: Option<(BoundKernel, usize)>,
}

impl AttachmentKernels {
    /// Moves rigidly attached particles at the start of a substep; `uniform` is the offset of its uniform.
    pub(crate) fn move_rigid_attachments(&self, pass: &mut Recorder<'_>, uniform: u32) {
        if let Some((moving, _, groups)) = &self.rigid {
            moving.run(pass, &[uniform], *groups);
        }
    }

    /// Solves compliant attachments in an iteration, after the tets.
    pub(crate) fn solve(&self, pass: &mut Recorder<'_>, uniform: u32) {
        if let Some((solve, groups)) = &self.soft {
            solve.run(pass, &[uniform], *groups);
        }
    }

    /// Updates rigidly attached particles at the end of a substep.
    pub(crate) fn update_rigid_attachments(&self, pass: &mut Recorder<'_>) {
        if let Some((_, update, groups)) = &self.rigid {
            update.run(pass, &[], *groups);
        }
    }
}

/// The middle of the anchors on each handle; 0 without any.
fn middles(solver: &Solver<f32>) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); solver.handle_count()];
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
