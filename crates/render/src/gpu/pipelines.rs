//! [`Pipelines`]: all shaders compiled, each with its render state.

use incise::gpu::wgpu::{self, VertexAttribute, VertexFormat, VertexStepMode};
use incise::gpu::{GpuContext, GpuError};

use super::shaders::shaders;
use super::target::{COLOR, DARK, DEPTH, SAMPLES};
use crate::RenderError;

/// All pipelines and their layouts.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) normals: wgpu::ComputePipeline,
    pub(super) contact_shadow: wgpu::RenderPipeline,
    pub(super) across: wgpu::RenderPipeline,
    pub(super) down: wgpu::RenderPipeline,
    pub(super) background: wgpu::RenderPipeline,
    pub(super) skin: wgpu::RenderPipeline,
    pub(super) props: wgpu::RenderPipeline,
    pub(super) plane: wgpu::RenderPipeline,
}

/// State of a render pipeline.
struct How<'a> {
    shader: &'a str,
    fragment: &'a str,
    /// Step mode and attributes of the vertex buffer, if there is one.
    vertices: Option<(VertexStepMode, &'a [VertexFormat])>,
    /// Depth mode for the image with its samples; `None` for the contact shadow.
    depth: Option<Depth>,
    blend: Option<wgpu::BlendState>,
}

/// Depth test and write mode.
#[derive(Clone, Copy)]
enum Depth {
    /// Background: drawn without a depth test.
    Behind,
    /// Opaque: tests and writes depth.
    Solid,
    /// Transparent: tests depth and writes none.
    Veil,
}

impl Pipelines {
    /// # Errors
    /// If the device rejects one of them.
    pub(super) fn new(gpu: &GpuContext) -> Result<Self, RenderError> {
        let created = gpu.guarded(wgpu::ErrorFilter::Validation, |_| Self::create(gpu));
        created.map_err(|error| RenderError::Unable {
            adapter: gpu.adapter().name.clone(),
            reason: one_line(&error.to_string()),
        })
    }

    fn create(gpu: &GpuContext) -> Self {
        let how = How {
            shader: "",
            fragment: "fragment",
            vertices: None,
            depth: None,
            blend: None,
        };
        let corner = [
            VertexFormat::Float32x3,
            VertexFormat::Float32x3,
            VertexFormat::Unorm8x4,
        ];
        let patch = [VertexFormat::Float32x4; 4];
        let blur = |fragment| {
            drawn(
                gpu,
                &How {
                    shader: "blur",
                    fragment,
                    ..how
                },
            )
        };
        Self {
            normals: computed(gpu, "normals"),
            contact_shadow: drawn(
                gpu,
                &How {
                    shader: "contact_shadow",
                    blend: Some(LARGEST),
                    ..how
                },
            ),
            across: blur("across"),
            down: blur("down"),
            background: drawn(
                gpu,
                &How {
                    shader: "background",
                    depth: Some(Depth::Behind),
                    ..how
                },
            ),
            skin: drawn(
                gpu,
                &How {
                    shader: "skin",
                    depth: Some(Depth::Solid),
                    ..how
                },
            ),
            props: drawn(
                gpu,
                &How {
                    shader: "props",
                    vertices: Some((VertexStepMode::Vertex, &corner)),
                    depth: Some(Depth::Solid),
                    ..how
                },
            ),
            plane: drawn(
                gpu,
                &How {
                    shader: "plane",
                    vertices: Some((VertexStepMode::Instance, &patch)),
                    depth: Some(Depth::Veil),
                    blend: Some(COVERING),
                    ..how
                },
            ),
        }
    }
}

/// Binds buffers, textures and samplers in the order of the shader's binding numbers.
pub(super) fn bind(
    gpu: &GpuContext,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry {
            binding,
            resource: resource.clone(),
        })
        .collect();
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}

/// Blend by maximum.
const LARGEST: wgpu::BlendState = wgpu::BlendState {
    color: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Max,
    },
    alpha: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Max,
    },
};

/// Alpha blend over an opaque target.
const COVERING: wgpu::BlendState = wgpu::BlendState {
    color: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::SrcAlpha,
        dst_factor: wgpu::BlendFactor::OneMinusSrcAlpha,
        operation: wgpu::BlendOperation::Add,
    },
    alpha: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::Zero,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    },
};

/// Joins the lines of a message into one.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let lines: Vec<_> = lines.filter(|line| !line.is_empty()).collect();
    lines.join(" ")
}

fn module(gpu: &GpuContext, name: &str) -> wgpu::ShaderModule {
    let source = shaders().into_iter().find(|shader| shader.name == name);
    let source = source.map(|shader| shader.source).unwrap_or_default();
    gpu.device()
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        })
}

fn computed(gpu: &GpuContext, name: &str) -> wgpu::ComputePipeline {
    gpu.device()
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: None,
            module: &module(gpu, name),
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
}

fn drawn(gpu: &GpuContext, how: &How<'_>) -> wgpu::RenderPipeline {
    let module = module(gpu, how.shader);
    let mut attributes = Vec::new();
    let mut stride = 0;
    let formats = how.vertices.map_or(&[] as &[_], |(_, formats)| formats);
    for (shader_location, &format) in (0..).zip(formats) {
        attributes.push(VertexAttribute {
            format,
            offset: stride,
            shader_location,
        });
        stride += format.size();
    }
    let layout = how.vertices.map(|(step_mode, _)| wgpu::VertexBufferLayout {
        array_stride: stride,
        step_mode,
        attributes: &attributes,
    });
    let buffers = if layout.is_some() { &[layout][..] } else { &[] };
    gpu.device()
        .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(how.shader),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers,
            },
            // No culling: the inside is visible through an open cut.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: how.depth.map(|depth| wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(matches!(depth, Depth::Solid)),
                depth_compare: Some(match depth {
                    Depth::Behind => wgpu::CompareFunction::Always,
                    Depth::Solid | Depth::Veil => wgpu::CompareFunction::Less,
                }),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState {
                count: if how.depth.is_some() { SAMPLES } else { 1 },
                ..wgpu::MultisampleState::default()
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(how.fragment),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    format: if how.depth.is_some() { COLOR } else { DARK },
                    blend: how.blend,
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
}

/// Checks that the device supports the features that the shaders use.
///
/// # Errors
/// If it does not; the error names the missing feature.
pub(super) fn require(gpu: &GpuContext) -> Result<(), RenderError> {
    let limits = gpu.device().limits();
    let needs = [
        (
            "storage buffers in a vertex shader",
            limits.max_storage_buffers_per_shader_stage,
            6,
        ),
        (
            "threads in a workgroup",
            limits.max_compute_invocations_per_workgroup,
            64,
        ),
    ];
    for (what, granted, needed) in needs {
        if granted < needed {
            return Err(RenderError::Unable {
                adapter: gpu.adapter().name.clone(),
                reason: format!("it grants {granted} {what}, and {needed} are needed"),
            });
        }
    }
    gpu.check().map_err(|error: GpuError| error.into())
}
