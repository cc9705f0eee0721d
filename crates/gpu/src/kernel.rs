//! [`Kernel`]: a compute shader with its bindings, and [`Recorder`]: the pass that dispatches kernels.
//!
//! All buffers of a kernel are in one bind group, in the order of the shader's binding numbers. Their kinds are listed
//! explicitly, because layouts derived from shaders do not have dynamic offsets. A dispatch of a pass sees the writes
//! of those before it: wgpu inserts barriers. Cost: well below a microsecond to record a dispatch.

use wgpu::{BindGroup, Buffer, ComputePass, ComputePipeline};

use crate::traffic::count;
use crate::{GpuContext, GpuError};

/// The kind of a buffer binding of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BindingKind {
    /// Storage that is only read.
    Read,
    /// Storage that is read and written.
    Write,
    /// Values common to all threads.
    Uniform,
    /// A uniform buffer of which each dispatch sees this many bytes at a dynamic offset; see [`STRIDE`].
    DynamicUniform(u64),
}

/// Distance in bytes between the ranges that dispatches see: WebGPU's largest alignment.
pub(crate) const STRIDE: u32 = 256;

/// Largest number of workgroups along one axis.
const WIDEST: u32 = 65_535;

/// A compiled compute shader.
#[derive(Debug)]
pub(crate) struct Kernel {
    pipeline: ComputePipeline,
    layout: wgpu::BindGroupLayout,
    uses: Vec<BindingKind>,
}

impl Kernel {
    /// Compiles a shader whose entry point is `main`. The texts of `parts` are concatenated; `constants` are the values
    /// of its overrides.
    ///
    /// # Errors
    /// If the device rejects it.
    pub(crate) fn new(
        gpu: &GpuContext,
        name: &str,
        parts: &[&str],
        uses: &[BindingKind],
        constants: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        let created = gpu.guarded(wgpu::ErrorFilter::Validation, |device| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
            });
            let entries: Vec<_> = (0..)
                .zip(uses)
                .map(|(binding, &usage)| wgpu::BindGroupLayoutEntry {
                    binding,
                    visibility: wgpu::ShaderStages::COMPUTE,
                    ty: binding_type(usage),
                    count: None,
                })
                .collect();
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(name),
                entries: &entries,
            });
            let all = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&all),
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            });
            Self {
                pipeline,
                layout,
                uses: uses.to_vec(),
            }
        });
        created.map_err(|error| GpuError::Command {
            message: format!("{name}: {error}"),
        })
    }

    /// Binds buffers in the order of the shader's binding numbers.
    ///
    /// # Panics
    /// If the number of buffers is not the number of bindings.
    pub(crate) fn bind(&self, gpu: &GpuContext, buffers: &[&Buffer]) -> BindGroup {
        assert_eq!(buffers.len(), self.uses.len(), "a buffer for each use");
        let entries: Vec<_> = (0..)
            .zip(buffers.iter().zip(&self.uses))
            .map(|(binding, (&buffer, &usage))| wgpu::BindGroupEntry {
                binding,
                resource: match usage {
                    BindingKind::DynamicUniform(bytes) => {
                        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                            buffer,
                            offset: 0,
                            size: wgpu::BufferSize::new(bytes),
                        })
                    }
                    _ => buffer.as_entire_binding(),
                },
            })
            .collect();
        gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &entries,
        })
    }
}

fn binding_type(usage: BindingKind) -> wgpu::BindingType {
    let (ty, has_dynamic_offset, size) = match usage {
        BindingKind::Read => (
            wgpu::BufferBindingType::Storage { read_only: true },
            false,
            None,
        ),
        BindingKind::Write => (
            wgpu::BufferBindingType::Storage { read_only: false },
            false,
            None,
        ),
        BindingKind::Uniform => (wgpu::BufferBindingType::Uniform, false, None),
        BindingKind::DynamicUniform(bytes) => (
            wgpu::BufferBindingType::Uniform,
            true,
            wgpu::BufferSize::new(bytes),
        ),
    };
    wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset,
        min_binding_size: size,
    }
}

/// A compute pass.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    gpu: &'a GpuContext,
    pass: ComputePass<'static>,
}

impl<'a> Recorder<'a> {
    /// Begins a pass; it must be dropped before other commands are recorded.
    pub(crate) fn new(
        gpu: &'a GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        label: &str,
        timestamps: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) -> Self {
        count(&gpu.counters().passes, 1);
        let pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(label),
            timestamp_writes: timestamps,
        });
        let pass = pass.forget_lifetime();
        Self { gpu, pass }
    }

    /// Runs a kernel in this many workgroups; 0 records nothing. `offsets` are in bytes, one for each
    /// [`BindingKind::DynamicUniform`].
    ///
    /// More than 65,535 workgroups become a grid: `workgroup_index` in the shaders' common part numbers them, and the
    /// last row may have surplus workgroups.
    pub(crate) fn dispatch(
        &mut self,
        kernel: &Kernel,
        bound: &BindGroup,
        offsets: &[u32],
        groups: usize,
    ) {
        if groups == 0 {
            return;
        }
        let groups = u32::try_from(groups).unwrap_or(u32::MAX);
        let rows = groups.div_ceil(WIDEST);
        self.pass.set_pipeline(&kernel.pipeline);
        self.pass.set_bind_group(0, bound, offsets);
        self.pass
            .dispatch_workgroups(groups.div_ceil(rows), rows, 1);
        count(&self.gpu.counters().dispatches, 1);
    }

    /// Runs a kernel in the number of workgroups that a buffer holds.
    pub(crate) fn dispatch_indirect(
        &mut self,
        kernel: &Kernel,
        bound: &BindGroup,
        offsets: &[u32],
        arguments: &Buffer,
        at: u64,
    ) {
        self.pass.set_pipeline(&kernel.pipeline);
        self.pass.set_bind_group(0, bound, offsets);
        self.pass.dispatch_workgroups_indirect(arguments, at);
        count(&self.gpu.counters().dispatches, 1);
    }
}
