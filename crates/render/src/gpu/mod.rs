//! [`GpuRenderer`]: pictures drawn by a device.
//!
//! The bodies' vertices are not sent: the vertex shader reads positions from the solver's own buffer, looks up the triangle
//! and its corners, and normals are computed on the device too. What is sent is the skin's triangles and colors when they
//! changed, and some hundred bytes of view a picture. A simulation that runs on the processor sends its positions. All is
//! one submit; nothing is read back unless a [`Picture`] is asked for.
//!
//! Cost: a thread a triangle for the normals, four samples a pixel.

mod buffer;
mod pipelines;
mod shaders;
mod target;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use incise::Simulation;
use incise::cutting::FaceTag;
use incise::gpu::wgpu::{self, BufferUsages};
use incise::gpu::{GpuContext, GpuSolver};

pub use shaders::{Shader, shaders};

use crate::props::Props;
use crate::view::View;
use crate::{Camera, Painting, Picture, RenderError, Style};
use buffer::Buffer;
use pipelines::{Pipelines, bind};
use target::{Dark, Target};

/// Threads of a workgroup of `normals.wgsl`.
const THREADS: usize = 64;
/// Most workgroups along one axis.
const WIDEST: u32 = 65_535;
/// Set in a vertex that a cut laid bare.
const CUT: u32 = 0x8000_0000;

/// `View` in `view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct ViewNumbers {
    clip: [[f32; 4]; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    light: [f32; 4],
    size: [f32; 2],
    flags: u32,
    unused: u32,
}

/// `Patch` in `plane.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct PlaneNumbers {
    center: [f32; 4],
    u: [f32; 4],
    v: [f32; 4],
    numbers: [f32; 4],
}

/// Draws on a device. One of them serves any number of paintings and simulations, but those that take turns upload their
/// triangles each time.
///
/// # Example
/// ```
/// use std::sync::Arc;
///
/// use incise::gpu::{GpuContext, GpuError, GpuOptions};
/// use incise::{Scene, Simulation, scene::ShapeSpec};
/// use incise_render::{Camera, GpuRenderer, Painting, Style};
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()), // take the software renderer
///     other => Arc::new(other?),
/// };
/// let mut scene = Scene::built_in();
/// scene.body[0].shape = Some(ShapeSpec { kind: "liver".into(), tets: 500 });
/// let simulation = Simulation::new(&scene)?;
/// let painting = Painting::new(&simulation, &scene);
/// let [low, high] = painting.bounds(&simulation);
/// let mut renderer = GpuRenderer::new(gpu)?;
/// let camera = Camera::fit(low, high);
/// let picture = renderer.picture(&painting, &simulation, &camera, &Style::default(), [64, 48])?;
/// assert_ne!(picture.pixel(32, 24), picture.pixel(0, 0));
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Arc<GpuContext>,
    pipelines: Pipelines,
    target: Option<Target>,
    dark: Dark,
    /// What was uploaded last.
    topology: u64,
    coloring: u64,
    view: Buffer<ViewNumbers>,
    positions: Buffer<[f32; 4]>,
    vertices: Buffer<[u32; 2]>,
    triangles: Buffer<[u32; 3]>,
    parts: Buffer<[f32; 4]>,
    sums: Buffer<[i32; 3]>,
    colors: Buffer<u32>,
    count: Buffer<[u32; 4]>,
    props: Buffer<crate::props::PropCorner>,
    planes: Buffer<PlaneNumbers>,
    ground: Buffer<PlaneNumbers>,
}

impl GpuRenderer {
    /// Compiles what is drawn with.
    ///
    /// # Errors
    /// [`RenderError::Unable`] names what the device lacks; [`RenderError::Gpu`] if it is lost.
    pub fn new(gpu: Arc<GpuContext>) -> Result<Self, RenderError> {
        pipelines::require(&gpu)?;
        let pipelines = Pipelines::new(&gpu)?;
        let (storage, uniform) = (BufferUsages::STORAGE, BufferUsages::UNIFORM);
        Ok(Self {
            pipelines,
            target: None,
            dark: Dark::new(&gpu),
            topology: 0,
            coloring: 0,
            view: Buffer::new(&gpu, "view", uniform)?,
            positions: Buffer::new(&gpu, "positions to draw", storage)?,
            vertices: Buffer::new(&gpu, "skin vertices", storage)?,
            triangles: Buffer::new(&gpu, "skin triangles", storage)?,
            parts: Buffer::new(&gpu, "origins", storage)?,
            sums: Buffer::new(&gpu, "normals", storage | BufferUsages::COPY_SRC)?,
            colors: Buffer::new(&gpu, "colors", storage)?,
            count: Buffer::new(&gpu, "count of triangles", uniform)?,
            props: Buffer::new(&gpu, "obstacles", BufferUsages::VERTEX)?,
            planes: Buffer::new(&gpu, "planes", BufferUsages::VERTEX)?,
            ground: Buffer::new(&gpu, "ground", uniform)?,
            gpu,
        })
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Arc<GpuContext> {
        &self.gpu
    }

    /// Whether a simulation has to be [read back](Simulation::read_back) for a picture of the present: it is on a device,
    /// but on another one than this, or with several solvers.
    #[must_use]
    pub fn needs_read_back(&self, simulation: &Simulation) -> bool {
        let on_device = simulation.device_solvers().next().is_some();
        on_device && only_solver(&self.gpu, simulation).is_none()
    }

    /// Draws into textures of its own and returns the finished picture's, which stays the same until the size changes, for
    /// a window to show: `Rgba8UnormSrgb`, to be sampled, copied or drawn over. Returns when the commands are with the
    /// driver.
    ///
    /// A simulation whose only solver is on this device is drawn from there; its colors are those of
    /// [`Painting::color`]. Of others the positions that the host knows are sent: see [`Simulation::read_back`].
    ///
    /// # Errors
    /// If a side of the picture is 0 or more than the device allows; if the device is lost or out of memory.
    ///
    /// # Panics
    /// If the painting does not follow the simulation.
    pub fn draw(
        &mut self,
        painting: &Painting,
        simulation: &Simulation,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<&wgpu::TextureView, RenderError> {
        let largest = self.gpu.device().limits().max_texture_dimension_2d;
        let view = View::new(camera, size, largest)?;
        self.gpu.check()?;
        if self
            .target
            .as_ref()
            .is_none_or(|target| target.size != size)
        {
            self.target = Some(Target::new(&self.gpu, size)?);
        }
        let Some(target) = &self.target else {
            unreachable!("it was just made");
        };
        self.gpu.check()?;
        let solver = solver_here(&self.gpu, painting, simulation);
        let positions = match solver {
            Some(solver) => {
                let origin = view.relative(solver.as_last_seen().origin());
                self.parts
                    .replace(&self.gpu, &[origin.extend(0.0).to_array()])?;
                solver.positions()
            }
            None => {
                let origin = origin(simulation);
                let places: Vec<[f32; 4]> = simulation
                    .positions()
                    .iter()
                    .map(|x| (*x - origin).as_vec3().extend(0.0).to_array())
                    .collect();
                self.positions.replace(&self.gpu, &places)?;
                let origin = view.relative(origin);
                self.parts
                    .replace(&self.gpu, &[origin.extend(0.0).to_array()])?;
                self.positions.raw()
            }
        };
        if self.topology != painting.topology() {
            let skin = painting.skin();
            let vertices: Vec<[u32; 2]> = skin
                .vertices()
                .iter()
                .map(|vertex| {
                    let cut = vertex.tag != FaceTag::Outer;
                    [vertex.particle.0, if cut { CUT } else { 0 }]
                })
                .collect();
            self.vertices.replace(&self.gpu, &vertices)?;
            self.triangles.replace(&self.gpu, skin.triangles())?;
            self.sums.resize(&self.gpu, vertices.len())?;
            let triangles = u32::try_from(skin.triangles().len()).unwrap_or(u32::MAX / 3);
            self.count.replace(&self.gpu, &[[triangles, 0, 0, 0]])?;
            self.topology = painting.topology();
        }
        let colors = painting.colors_for(style.color_by);
        if !colors.is_empty() && self.coloring != painting.coloring() {
            self.colors.replace(&self.gpu, colors)?;
            self.coloring = painting.coloring();
        }
        let flags = u32::from(style.wireframe)
            | u32::from(style.smooth) << 1
            | u32::from(!colors.is_empty()) << 2;
        self.view
            .replace(&self.gpu, &[view_numbers(&view, flags)])?;
        let props = Props::new(painting, simulation, &view);
        self.props.replace(&self.gpu, &props.corners)?;
        let planes: Vec<_> = props.planes.iter().map(plane_numbers).collect();
        self.planes.replace(&self.gpu, &planes)?;

        let ground = props.planes.iter().find(|plane| plane.ground);
        if let Some(ground) = ground {
            self.ground.replace(&self.gpu, &[plane_numbers(ground)])?;
        }

        let gpu = &*self.gpu;
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let triangles = self.triangles.len();
        if triangles > 0 {
            encoder.clear_buffer(self.sums.raw(), 0, None);
            let bound = bind(
                gpu,
                &self.pipelines.normals.get_bind_group_layout(0),
                vec![
                    positions.as_entire_binding(),
                    self.vertices.raw().as_entire_binding(),
                    self.triangles.raw().as_entire_binding(),
                    self.sums.raw().as_entire_binding(),
                    self.count.raw().as_entire_binding(),
                ],
            );
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipelines.normals);
            pass.set_bind_group(0, &bound, &[]);
            let groups = count(triangles.div_ceil(THREADS));
            let rows = groups.div_ceil(WIDEST);
            pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
        }
        if ground.is_some() {
            self.draw_impression(&mut encoder, positions);
        }
        let mut pass = begin(&mut encoder, target);
        let view_only = |pipeline: &wgpu::RenderPipeline| {
            let layout = pipeline.get_bind_group_layout(0);
            bind(gpu, &layout, vec![self.view.raw().as_entire_binding()])
        };
        pass.set_pipeline(&self.pipelines.background);
        pass.set_bind_group(0, &view_only(&self.pipelines.background), &[]);
        pass.draw(0..3, 0..1);
        if triangles > 0 {
            let bound = bind(
                gpu,
                &self.pipelines.skin.get_bind_group_layout(0),
                vec![
                    self.view.raw().as_entire_binding(),
                    positions.as_entire_binding(),
                    self.vertices.raw().as_entire_binding(),
                    self.triangles.raw().as_entire_binding(),
                    self.parts.raw().as_entire_binding(),
                    self.sums.raw().as_entire_binding(),
                    self.colors.raw().as_entire_binding(),
                ],
            );
            pass.set_pipeline(&self.pipelines.skin);
            pass.set_bind_group(0, &bound, &[]);
            pass.draw(0..count(3 * triangles), 0..1);
        }
        if !props.corners.is_empty() {
            pass.set_pipeline(&self.pipelines.props);
            pass.set_bind_group(0, &view_only(&self.pipelines.props), &[]);
            pass.set_vertex_buffer(0, self.props.raw().slice(..));
            pass.draw(0..count(props.corners.len()), 0..1);
        }
        if !planes.is_empty() {
            let bound = bind(
                gpu,
                &self.pipelines.plane.get_bind_group_layout(0),
                vec![
                    self.view.raw().as_entire_binding(),
                    wgpu::BindingResource::TextureView(&self.dark.views[0]),
                    wgpu::BindingResource::Sampler(&self.dark.sampler),
                ],
            );
            pass.set_pipeline(&self.pipelines.plane);
            pass.set_bind_group(0, &bound, &[]);
            pass.set_vertex_buffer(0, self.planes.raw().slice(..));
            pass.draw(0..6, 0..count(planes.len()));
        }
        drop(pass);
        gpu.queue().submit([encoder.finish()]);
        gpu.check()?;
        Ok(&target.resolved)
    }

    /// The sums that [`normal_sums`](crate::normal_sums) defines, of the skin's vertices in the last picture, for tests: waits
    /// for the device.
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    pub fn read_normal_sums(&self) -> Result<Vec<[i32; 3]>, RenderError> {
        let bytes = (self.sums.len() * size_of::<[i32; 3]>()) as u64;
        let values = target::read_buffer(&self.gpu, "normals", self.sums.raw(), bytes)?;
        Ok(bytemuck::pod_collect_to_vec(&values))
    }

    /// Draws what bodies leave on the ground and blurs it.
    fn draw_impression(&self, encoder: &mut wgpu::CommandEncoder, positions: &wgpu::Buffer) {
        let [first, second] = &self.dark.views;
        {
            let mut pass = begin_dark(encoder, first);
            if self.triangles.len() > 0 {
                let bound = bind(
                    &self.gpu,
                    &self.pipelines.impression.get_bind_group_layout(0),
                    vec![
                        self.ground.raw().as_entire_binding(),
                        positions.as_entire_binding(),
                        self.vertices.raw().as_entire_binding(),
                        self.triangles.raw().as_entire_binding(),
                        self.parts.raw().as_entire_binding(),
                    ],
                );
                pass.set_pipeline(&self.pipelines.impression);
                pass.set_bind_group(0, &bound, &[]);
                pass.draw(0..count(3 * self.triangles.len()), 0..1);
            }
        }
        let blurs = [
            (&self.pipelines.across, first, second),
            (&self.pipelines.down, second, first),
        ];
        for (pipeline, from, to) in blurs {
            let layout = pipeline.get_bind_group_layout(0);
            let from = wgpu::BindingResource::TextureView(from);
            let bound = bind(&self.gpu, &layout, vec![from]);
            let mut pass = begin_dark(encoder, to);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.draw(0..3, 0..1);
        }
    }

    /// Draws, waits and reads the picture back.
    ///
    /// # Errors
    /// As [`GpuRenderer::draw`].
    ///
    /// # Panics
    /// As [`GpuRenderer::draw`].
    pub fn picture(
        &mut self,
        painting: &Painting,
        simulation: &Simulation,
        camera: &Camera,
        style: &Style,
        size: [u32; 2],
    ) -> Result<Picture, RenderError> {
        self.draw(painting, simulation, camera, style, size)?;
        match &self.target {
            Some(target) => target.read(&self.gpu),
            None => unreachable!("a picture was drawn into it"),
        }
    }
}

/// The solver whose positions can be drawn as they are, if it has taken them there by now: a step does.
fn solver_here<'s>(
    gpu: &Arc<GpuContext>,
    painting: &Painting,
    simulation: &'s Simulation,
) -> Option<&'s GpuSolver> {
    only_solver(gpu, simulation).filter(|_| painting.device_is_current())
}

/// The only solver of a simulation, if it is on this device.
fn only_solver<'s>(gpu: &Arc<GpuContext>, simulation: &'s Simulation) -> Option<&'s GpuSolver> {
    let mut solvers = simulation.device_solvers();
    let first = solvers.next()?;
    (solvers.next().is_none() && Arc::ptr_eq(first.gpu(), gpu)).then_some(first)
}

/// A point near the bodies that positions are sent relative to.
pub(crate) fn origin(simulation: &Simulation) -> DVec3 {
    simulation.positions().first().copied().unwrap_or_default()
}

fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn view_numbers(view: &View, flags: u32) -> ViewNumbers {
    let with = |v: Vec3, w: f32| v.extend(w).to_array();
    ViewNumbers {
        clip: view.clip.to_cols_array_2d(),
        right: with(view.right, view.tangents[0]),
        up: with(view.up, view.tangents[1]),
        forward: with(view.forward, 0.0),
        light: with(view.light, 0.0),
        size: view.size.map(|side| side as f32),
        flags,
        unused: 0,
    }
}

fn plane_numbers(plane: &crate::props::Plane) -> PlaneNumbers {
    let with = |v: Vec3, w: f32| v.extend(w).to_array();
    let ground = if plane.ground { 1.0 } else { 0.0 };
    PlaneNumbers {
        center: with(plane.center, plane.radius),
        u: with(plane.u, plane.offsets[0]),
        v: with(plane.v, plane.offsets[1]),
        numbers: [plane.spacing, plane.opacity, ground, 0.0],
    }
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
        label: Some("impression"),
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
