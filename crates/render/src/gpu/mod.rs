//! [`GpuRenderer`]: images drawn by a device.
//!
//! Vertex positions are not uploaded: they are copied from the buffers of the solvers, on the device; the vertex shader
//! looks up the triangle and its corners, and normals are computed on the device. Triangles and colors of the whole skin
//! are uploaded when any of them changed, view and obstacles for each image. A simulation on the processor uploads its
//! positions. The copy can be drawn again while the simulation steps on another thread. All commands go in one submit; only an [`Image`] is
//! read back.
//!
//! Cost: one thread per triangle for the normals, four samples per pixel.

mod buffer;
mod pipelines;
mod shaders;
mod target;
mod upload;

use std::sync::Arc;

use incise::Simulation;
use incise::gpu::wgpu::{self, BindingResource};
use incise::gpu::{GpuContext, GpuOptions, GpuSolver};

pub use shaders::{Shader, shaders};

use crate::view::View;
use crate::{Camera, Image, RenderError, RenderScene, Style};
use pipelines::{Pipelines, bind};
use target::{Dark, Target};
use upload::{Upload, solvers_here};

/// Workgroup size of `normals.wgsl`.
const THREADS: usize = 64;
/// Largest number of workgroups along one axis.
const WIDEST: u32 = 65_535;

/// Renderer on a device. One renderer serves any number of render scenes and simulations, but alternating between them
/// uploads the triangles each time.
///
/// # Example
/// ```
/// use std::sync::Arc;
///
/// use incise::gpu::{GpuContext, GpuError, GpuOptions};
/// use incise::{Scene, Simulation, scene::ShapeSpec};
/// use incise_render::{Camera, GpuRenderer, RenderScene, Style};
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()), // take the software renderer
///     other => Arc::new(other?),
/// };
/// let mut scene = Scene::built_in();
/// scene.body[0].shape = Some(ShapeSpec::new("liver", 500));
/// let simulation = Simulation::new(&scene)?;
/// let render_scene = RenderScene::new(&simulation, &scene);
/// let [low, high] = render_scene.bounds(&simulation);
/// let mut renderer = GpuRenderer::new(gpu)?;
/// let camera = Camera::fit(low, high);
/// let picture = renderer.picture(&render_scene, &simulation, &camera, &Style::default(), [64, 48])?;
/// assert_ne!(picture.pixel(32, 24), picture.pixel(0, 0));
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Arc<GpuContext>,
    pipelines: Pipelines,
    target: Option<Target>,
    dark: Dark,
    upload: Upload,
    readbacks: u64,
}

impl GpuRenderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Unable`] names the missing feature; [`RenderError::Gpu`] if the device is lost.
    pub fn new(gpu: Arc<GpuContext>) -> Result<Self, RenderError> {
        pipelines::require(&gpu)?;
        Ok(Self {
            pipelines: Pipelines::new(&gpu)?,
            target: None,
            dark: Dark::new(&gpu),
            upload: Upload::new(&gpu)?,
            readbacks: 0,
            gpu,
        })
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Arc<GpuContext> {
        &self.gpu
    }

    /// Name and interface of the device.
    pub(crate) fn describe(&self) -> String {
        let adapter = self.gpu.adapter();
        format!("{} ({})", adapter.name, adapter.backend)
    }

    /// Number of bytes uploaded by this renderer. Uploads of the solvers are counted by [`GpuContext::traffic`].
    #[must_use]
    pub fn uploaded_bytes(&self) -> u64 {
        self.upload.sent()
    }

    /// Number of readbacks by this renderer, each with a wait for the device: one per [`Image`].
    #[must_use]
    pub fn readbacks(&self) -> u64 {
        self.readbacks
    }

    /// True if drawing the current state needs a [readback](Simulation::read_back) of the simulation first: it runs on
    /// another device, or it has made no step since the render scene was created or reset.
    #[must_use]
    pub fn needs_read_back(&self, render_scene: &RenderScene, simulation: &Simulation) -> bool {
        let mut solvers = simulation.device_solvers();
        let current = render_scene.device_is_current;
        solvers.any(|solver| !current || !Arc::ptr_eq(solver.gpu(), &self.gpu))
    }

    /// Draws into textures of the renderer and returns the texture of the finished image, for a window to show. The
    /// texture stays the same until the size changes and holds stored colors (`Rgba8Unorm`) for sampling. Returns when
    /// the commands are submitted.
    ///
    /// The positions of a simulation on this device are copied there after its first step since the render scene was
    /// created or reset. Otherwise the host's positions are uploaded: see [`GpuRenderer::needs_read_back`].
    ///
    /// # Errors
    /// If a side of the image is 0 or more than the device allows; if the device is lost or out of memory.
    ///
    /// # Panics
    /// If the render scene does not match the simulation.
    pub fn draw(
        &mut self,
        render_scene: &RenderScene,
        simulation: &Simulation,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<&wgpu::TextureView, RenderError> {
        let solvers = if render_scene.device_is_current {
            solvers_here(&self.gpu, simulation)
        } else {
            Vec::new()
        };
        self.gpu.check()?;
        self.upload
            .send_bodies(&self.gpu, render_scene, simulation, &solvers)?;
        self.show(render_scene, &solvers, camera, style, size)
    }

    /// Draws the positions of the last [`GpuRenderer::draw`] again, with another camera or style, without the simulation:
    /// it may be busy on another thread.
    ///
    /// # Errors
    /// Returns the errors of [`GpuRenderer::draw`].
    pub fn redraw(
        &mut self,
        render_scene: &RenderScene,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<&wgpu::TextureView, RenderError> {
        self.show(render_scene, &[], camera, style, size)
    }

    /// Draws the uploaded skin at the positions of solvers, or at the last ones.
    fn show(
        &mut self,
        render_scene: &RenderScene,
        solvers: &[&GpuSolver],
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<&wgpu::TextureView, RenderError> {
        let largest = self.gpu.device().limits().max_texture_dimension_2d;
        let view = View::new(camera, size, largest)?;
        self.gpu.check()?;
        let target = match self.target.take() {
            Some(target) if target.size == size => target,
            _ => Target::new(&self.gpu, size)?,
        };
        self.upload
            .send_view(&self.gpu, render_scene, style, &view)?;
        self.record(&target, solvers);
        self.gpu.check()?;
        Ok(&self.target.insert(target).shown)
    }

    /// Submits the draw commands.
    fn record(&self, target: &Target, solvers: &[&GpuSolver]) {
        let (gpu, upload) = (&*self.gpu, &self.upload);
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        upload.gather(&mut encoder, solvers);
        let positions = upload.positions.raw();
        self.compute_normals(&mut encoder, positions);
        if upload.has_ground {
            self.draw_contact_shadow(&mut encoder, positions);
        }
        let mut pass = begin(&mut encoder, target);
        let view = || upload.view.raw().as_entire_binding();
        let mut draw = |pipeline: &wgpu::RenderPipeline,
                        rest: &[BindingResource<'_>],
                        vertices: Option<&wgpu::Buffer>,
                        counts: [usize; 2]| {
            if counts.contains(&0) {
                return;
            }
            let layout = pipeline.get_bind_group_layout(0);
            let bound = bind(gpu, &layout, &[&[view()], rest].concat());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bound, &[]);
            if let Some(vertices) = vertices {
                pass.set_vertex_buffer(0, vertices.slice(..));
            }
            pass.draw(0..count(counts[0]), 0..count(counts[1]));
        };
        let skin = [
            positions.as_entire_binding(),
            upload.vertices.raw().as_entire_binding(),
            upload.triangles.raw().as_entire_binding(),
            upload.parts.raw().as_entire_binding(),
            upload.sums.raw().as_entire_binding(),
            upload.colors.raw().as_entire_binding(),
            upload.rims.raw().as_entire_binding(),
        ];
        let ground = [
            BindingResource::TextureView(&self.dark.views[0]),
            BindingResource::Sampler(&self.dark.sampler),
        ];
        let Pipelines {
            background,
            skin: bodies,
            props,
            plane,
            ..
        } = &self.pipelines;
        let corners = Some(upload.props.raw());
        let patches = Some(upload.planes.raw());
        draw(background, &[], None, [3, 1]);
        draw(bodies, &skin, None, [3 * upload.triangles.len(), 1]);
        draw(props, &[], corners, [upload.props.len(), 1]);
        draw(plane, &ground, patches, [6, upload.planes.len()]);
        drop(pass);
        gpu.queue().submit([encoder.finish()]);
    }

    /// Computes the normal sums of the skin's vertices.
    fn compute_normals(&self, encoder: &mut wgpu::CommandEncoder, positions: &wgpu::Buffer) {
        let upload = &self.upload;
        if upload.triangles.len() == 0 {
            return;
        }
        encoder.clear_buffer(upload.sums.raw(), 0, None);
        let bound = bind(
            &self.gpu,
            &self.pipelines.normals.get_bind_group_layout(0),
            &[
                positions.as_entire_binding(),
                upload.vertices.raw().as_entire_binding(),
                upload.triangles.raw().as_entire_binding(),
                upload.sums.raw().as_entire_binding(),
                upload.count.raw().as_entire_binding(),
            ],
        );
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipelines.normals);
        pass.set_bind_group(0, &bound, &[]);
        let groups = count(upload.triangles.len().div_ceil(THREADS));
        let rows = groups.div_ceil(WIDEST);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
    }

    /// Reads the [`normal_sums`](crate::normal_sums) of the skin's vertices in the last image, for tests. Waits for the
    /// device.
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    pub fn read_normal_sums(&mut self) -> Result<Vec<[i32; 3]>, RenderError> {
        let bytes = (self.upload.sums.len() * size_of::<[i32; 3]>()) as u64;
        let sums = self.upload.sums.raw();
        let values = target::read_buffer(&self.gpu, "normals", sums, bytes, &mut self.readbacks)?;
        Ok(bytemuck::pod_collect_to_vec(&values))
    }

    /// Draws the contact shadow and blurs it.
    fn draw_contact_shadow(&self, encoder: &mut wgpu::CommandEncoder, positions: &wgpu::Buffer) {
        let [first, second] = &self.dark.views;
        {
            let mut pass = begin_dark(encoder, first);
            if self.upload.triangles.len() > 0 {
                let bound = bind(
                    &self.gpu,
                    &self.pipelines.contact_shadow.get_bind_group_layout(0),
                    &[
                        self.upload.ground.raw().as_entire_binding(),
                        positions.as_entire_binding(),
                        self.upload.vertices.raw().as_entire_binding(),
                        self.upload.triangles.raw().as_entire_binding(),
                        self.upload.parts.raw().as_entire_binding(),
                    ],
                );
                pass.set_pipeline(&self.pipelines.contact_shadow);
                pass.set_bind_group(0, &bound, &[]);
                pass.draw(0..count(3 * self.upload.triangles.len()), 0..1);
            }
        }
        let blurs = [
            (&self.pipelines.across, first, second),
            (&self.pipelines.down, second, first),
        ];
        for (pipeline, from, to) in blurs {
            let layout = pipeline.get_bind_group_layout(0);
            let from = BindingResource::TextureView(from);
            let bound = bind(&self.gpu, &layout, &[from]);
            let mut pass = begin_dark(encoder, to);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.draw(0..3, 0..1);
        }
    }

    /// Draws, waits and reads the image back.
    ///
    /// # Errors
    /// Returns the errors of [`GpuRenderer::draw`].
    ///
    /// # Panics
    /// Panics where [`GpuRenderer::draw`] does.
    pub fn picture(
        &mut self,
        render_scene: &RenderScene,
        simulation: &Simulation,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<Image, RenderError> {
        self.draw(render_scene, simulation, camera, style, size)?;
        match &self.target {
            Some(target) => target.read(&self.gpu, &mut self.readbacks),
            None => unreachable!("a picture was drawn into it"),
        }
    }
}

fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn begin<'e>(encoder: &'e mut wgpu::CommandEncoder, target: &Target) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("picture"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &target.samples,
            depth_slice: None,
            resolve_target: Some(&target.resolved),
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Discard,
            },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &target.depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(1.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    })
}

fn begin_dark<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("contact_shadow"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    })
}

/// Opens a renderer on a hardware device, or on the one that `WGPU_ADAPTER_NAME` names.
///
/// # Errors
/// The reason, if no device can draw.
pub(crate) fn open() -> Result<GpuRenderer, String> {
    let options = GpuOptions::from_env();
    if options.adapter.is_none() && !may_have_gpu() {
        return Err("there is no GPU".to_owned());
    }
    let gpu = GpuContext::new(&options).map_err(|error| error.to_string())?;
    let adapter = gpu.adapter();
    if adapter.software && options.adapter.is_none() {
        return Err(format!("the only GPU is software ({})", adapter.name));
    }
    GpuRenderer::new(gpu.into()).map_err(|error| error.to_string())
}

/// Opens a renderer on the device of a simulation; `None` without one that can draw.
pub(crate) fn open_for(simulation: &Simulation) -> Option<GpuRenderer> {
    let solver = simulation.device_solvers().next()?;
    GpuRenderer::new(Arc::clone(solver.gpu())).ok()
}

/// True if the state of a simulation is on a device.
pub(crate) fn is_on_device(simulation: &Simulation) -> bool {
    simulation.device_solvers().next().is_some()
}

/// True if a hardware device may exist. Loading drivers takes a tenth of a second, and drivers without a device print
/// warnings; on Linux a GPU is visible in the file system.
fn may_have_gpu() -> bool {
    const NODES: [&str; 6] = [
        "/dev/dri",
        "/dev/nvidiactl",
        "/dev/dxg",
        "/dev/nvhost-gpu",
        "/dev/kgsl-3d0",
        "/dev/mali0",
    ];
    !cfg!(target_os = "linux") || NODES.iter().any(|node| std::path::Path::new(node).exists())
}
