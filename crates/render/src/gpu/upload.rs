//! [`Upload`]: device copies of the data to draw, uploaded only when they changed.
//!
//! After a cut or a reset the whole skin and all its colors are uploaded again: O(triangles), even for a small cut.
//! Positions are copied from the solvers on this device or else uploaded: 16 bytes per particle. View, planes and the
//! triangles of obstacles and blades are uploaded for each image.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use incise::Simulation;
use incise::cutting::{FaceTag, SkinVertex};
use incise::gpu::wgpu::{self, BufferUsages};
use incise::gpu::{GpuContext, GpuSolver};

use super::buffer::Buffer;
use super::count;
use crate::props::{Plane, PropCorner, Props};
use crate::view::View;
use crate::{RenderError, RenderScene, Style};

/// Flag of a vertex on a cut face.
const CUT: u32 = 0x8000_0000;

/// Key of an empty skin: revisions start at 1.
const NOTHING: (u64, bool) = (0, false);

/// `View` in `view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ViewNumbers {
    clip: [[f32; 4]; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    light: [f32; 4],
    size: [f32; 2],
    flags: u32,
    unused: u32,
}

/// `Patch` in `plane.wgsl`, `Ground` in `contact_shadow.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PlaneNumbers {
    center: [f32; 4],
    u: [f32; 4],
    v: [f32; 4],
    numbers: [f32; 4],
}

/// Buffers of the data to draw.
#[derive(Debug)]
pub(super) struct Upload {
    /// Revision of the uploaded skin, and whether its particles are numbered as in the device's solvers.
    skin: (u64, bool),
    coloring: u64,
    /// Origins of the solvers, or of the uploaded positions.
    origins: Vec<DVec3>,
    /// True if there is a ground.
    pub(super) has_ground: bool,
    pub(super) view: Buffer<ViewNumbers>,
    pub(super) positions: Buffer<[f32; 4]>,
    pub(super) vertices: Buffer<[u32; 2]>,
    pub(super) triangles: Buffer<[u32; 3]>,
    pub(super) parts: Buffer<[f32; 4]>,
    pub(super) sums: Buffer<[i32; 3]>,
    pub(super) colors: Buffer<u32>,
    pub(super) rims: Buffer<u32>,
    pub(super) count: Buffer<[u32; 4]>,
    pub(super) props: Buffer<PropCorner>,
    pub(super) planes: Buffer<PlaneNumbers>,
    pub(super) ground: Buffer<PlaneNumbers>,
}

impl Upload {
    pub(super) fn new(gpu: &GpuContext) -> Result<Self, RenderError> {
        let (storage, uniform) = (BufferUsages::STORAGE, BufferUsages::UNIFORM);
        Ok(Self {
            skin: NOTHING,
            coloring: 0,
            origins: Vec::new(),
            has_ground: false,
            view: Buffer::new(gpu, "view", uniform)?,
            positions: Buffer::new(gpu, "positions to draw", storage)?,
            vertices: Buffer::new(gpu, "skin vertices", storage)?,
            triangles: Buffer::new(gpu, "skin triangles", storage)?,
            parts: Buffer::new(gpu, "origins", storage)?,
            sums: Buffer::new(gpu, "normals", storage | BufferUsages::COPY_SRC)?,
            colors: Buffer::new(gpu, "colors", storage)?,
            rims: Buffer::new(gpu, "rims of cuts", storage)?,
            count: Buffer::new(gpu, "count of triangles", uniform)?,
            props: Buffer::new(gpu, "obstacles", BufferUsages::VERTEX)?,
            planes: Buffer::new(gpu, "planes", BufferUsages::VERTEX)?,
            ground: Buffer::new(gpu, "ground", uniform)?,
        })
    }

    /// Bytes uploaded since its creation.
    pub(super) fn sent(&self) -> u64 {
        let triangles = self.triangles.sent() + self.rims.sent() + self.count.sent();
        let skin = self.vertices.sent() + triangles;
        let bodies = skin + self.positions.sent() + self.parts.sent() + self.colors.sent();
        let planes = self.planes.sent() + self.ground.sent();
        bodies + self.view.sent() + self.props.sent() + planes
    }

    /// Uploads the skin if it has changed, and positions. `solvers` are the position sources; empty if positions are to
    /// be uploaded.
    pub(super) fn send_bodies(
        &mut self,
        gpu: &GpuContext,
        render_scene: &RenderScene,
        simulation: &Simulation,
        solvers: &[&GpuSolver],
    ) -> Result<(), RenderError> {
        let skin = (render_scene.topology, !solvers.is_empty());
        // The key is set only after the upload succeeded.
        if self.skin != skin {
            self.skin = NOTHING;
            self.send_skin(gpu, render_scene, simulation, solvers)?;
            self.skin = skin;
        }
        self.send_positions(gpu, simulation, solvers)
    }

    /// Uploads what depends on the view, and colors if they have changed.
    pub(super) fn send_view(
        &mut self,
        gpu: &GpuContext,
        render_scene: &RenderScene,
        style: &Style,
        view: &View,
    ) -> Result<(), RenderError> {
        let part = |origin: &DVec3| view.relative(*origin).extend(0.0).to_array();
        let parts: Vec<_> = self.origins.iter().map(part).collect();
        self.parts.replace(gpu, &parts)?;
        let colors = render_scene.colors_for(style.color_by);
        if !colors.is_empty() && self.coloring != render_scene.coloring {
            self.coloring = 0;
            self.colors.replace(gpu, colors)?;
            self.coloring = render_scene.coloring;
        }
        let flags = u32::from(style.wireframe)
            | u32::from(style.smooth) << 1
            | u32::from(!colors.is_empty()) << 2;
        self.view.replace(gpu, &[view_numbers(view, flags)])?;

        let props = Props::new(render_scene, view);
        self.props.replace(gpu, &props.corners)?;
        let planes: Vec<_> = props.planes.iter().map(plane_numbers).collect();
        self.planes.replace(gpu, &planes)?;
        let ground = props.planes.iter().find(|plane| plane.ground);
        self.has_ground = ground.is_some();
        if let Some(ground) = ground {
            self.ground.replace(gpu, &[plane_numbers(ground)])?;
        }
        Ok(())
    }

    /// Uploads the skin's triangles and vertices; particles are numbered as the positions are stored.
    fn send_skin(
        &mut self,
        gpu: &GpuContext,
        render_scene: &RenderScene,
        simulation: &Simulation,
        solvers: &[&GpuSolver],
    ) -> Result<(), RenderError> {
        let skin = render_scene.skin();
        // Index of the first particle of each solver.
        let mut first = Vec::with_capacity(solvers.len());
        let mut particles = 0;
        for solver in solvers {
            first.push(particles);
            particles += count(solver.cached_host().particle_count());
        }
        let vertex = |vertex: &SkinVertex| {
            let outer = vertex.tag == FaceTag::Outer;
            let cut = if outer { 0 } else { CUT };
            if solvers.is_empty() {
                return [vertex.particle.0, cut];
            }
            let (part, offset) = simulation.location_of(vertex.particle);
            [first[part] + count(offset), count(part) | cut]
        };
        let vertices: Vec<[u32; 2]> = skin.vertices().iter().map(vertex).collect();
        self.vertices.replace(gpu, &vertices)?;
        self.triangles.replace(gpu, skin.triangles())?;
        self.rims.replace(gpu, render_scene.rims())?;
        self.sums.resize(gpu, vertices.len())?;
        let triangles = count(skin.triangles().len());
        self.count.replace(gpu, &[[triangles, 0, 0, 0]])?;
        Ok(())
    }

    /// Uploads positions, or makes room for those of the solvers.
    fn send_positions(
        &mut self,
        gpu: &GpuContext,
        simulation: &Simulation,
        solvers: &[&GpuSolver],
    ) -> Result<(), RenderError> {
        self.origins.clear();
        if solvers.is_empty() {
            let positions = simulation.positions();
            // An origin near the bodies: single precision does not suffice far from the world origin.
            let origin = positions.first().copied().unwrap_or_default();
            let local = |x: &DVec3| (*x - origin).as_vec3().extend(0.0).to_array();
            let local: Vec<[f32; 4]> = positions.iter().map(local).collect();
            self.positions.replace(gpu, &local)?;
            self.origins.push(origin);
            return Ok(());
        }
        let hosts = || solvers.iter().map(|solver| solver.cached_host());
        self.origins.extend(hosts().map(|host| host.origin()));
        let particles = hosts().map(|host| host.particle_count()).sum();
        Ok(self.positions.resize(gpu, particles)?)
    }

    /// Copies the positions of solvers one after another. They stay for the next image, whatever the solvers do.
    pub(super) fn gather(&self, encoder: &mut wgpu::CommandEncoder, solvers: &[&GpuSolver]) {
        let mut offset = 0;
        for solver in solvers {
            let (from, bytes) = (solver.positions(), bytes_of(solver));
            encoder.copy_buffer_to_buffer(from, 0, self.positions.raw(), offset, bytes);
            offset += bytes;
        }
    }
}

/// Solvers of a simulation, if they run on this device and their particles are there.
pub(super) fn solvers_here<'s>(
    gpu: &Arc<GpuContext>,
    simulation: &'s Simulation,
) -> Vec<&'s GpuSolver> {
    let solvers: Vec<_> = simulation.device_solvers().collect();
    let here = |solver: &&GpuSolver| {
        Arc::ptr_eq(solver.gpu(), gpu) && bytes_of(solver) <= solver.positions().size()
    };
    if solvers.iter().all(here) {
        solvers
    } else {
        Vec::new()
    }
}

/// Size of a solver's positions in bytes.
fn bytes_of(solver: &GpuSolver) -> u64 {
    (solver.cached_host().particle_count() * size_of::<[f32; 4]>()) as u64
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

fn plane_numbers(plane: &Plane) -> PlaneNumbers {
    let with = |v: Vec3, w: f32| v.extend(w).to_array();
    let ground = if plane.ground { 1.0 } else { 0.0 };
    PlaneNumbers {
        center: with(plane.center, plane.radius),
        u: with(plane.u, plane.offsets[0]),
        v: with(plane.v, plane.offsets[1]),
        numbers: [plane.spacing, plane.opacity, ground, 0.0],
    }
}
