//! [`BodyBuffers`]: the arrays of a body on the device, and their synchronization with a solver on the host.
//!
//! Changes by a cut arrive as patches, which a kernel scatters: the numbers of a tet slot are in 16 parts of an array.
//! Nothing else is sent. Memory: 96 bytes per slot and 48 per particle; 16 per slot more with several materials, 8
//! where multipliers are kept, 16 per particle for Jacobi. Cost: O(changes).

use incise_graph::Schedule;
use incise_xpbd::{Changes, Solver};

use super::attachments::Attachments;
use super::colors::Colors;
use super::contacts::Contacts;
use super::gpu_types::{DispatchRange, NUMBERS, ParticlePatch, TetPatch};
use super::kernels::{Kernels, Kind, PATCH_PARTICLES, PATCH_TETS, Variant};
use super::layout::{ClusterMapping, Layout, THREADS};
use super::scalar_constraints::ScalarConstraints;
use super::tile::number_count;
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Patches sent in one upload.
const PATCHES: usize = 1 << 16;

/// A body on the device.
#[derive(Debug)]
pub(crate) struct BodyBuffers {
    pub(crate) layout: Layout,
    pub(crate) colors: Colors,
    /// Position relative to the host's origin, and inverse mass.
    pub(crate) particles: Array<[f32; 4]>,
    /// Positions at the start of the substep.
    pub(crate) previous: Array<[f32; 4]>,
    pub(crate) velocities: Array<[f32; 4]>,
    pub(crate) corners: Array<[u32; 4]>,
    pub(crate) rest: Array<f32>,
    pub(crate) constants: Array<[f32; 4]>,
    pub(crate) tiles: Array<u32>,
    /// Multipliers; empty unless a step keeps them.
    pub(crate) multipliers: Array<[f32; 2]>,
    /// Sums of Jacobi corrections; empty until the first Jacobi step, and all 0 between iterations.
    pub(crate) corrections: Array<[f32; 4]>,
    /// Attachments, if there are any.
    pub(crate) attachments: Option<Attachments>,
    /// Distance constraints, if there are any.
    pub(crate) distances: Option<ScalarConstraints>,
    pub(crate) volumes: Option<ScalarConstraints>,
    /// Contacts, if they are declared.
    pub(crate) contacts: Option<Contacts>,
    tet_patches: Array<TetPatch>,
    particle_patches: Array<ParticlePatch>,
    range: Array<DispatchRange>,
}

impl BodyBuffers {
    pub(crate) fn new(gpu: &GpuContext, mapping: ClusterMapping) -> Result<Self, GpuError> {
        Ok(Self {
            layout: Layout::new(mapping),
            colors: Colors::new(gpu)?,
            particles: Array::zeros(gpu, "positions", 0)?,
            previous: Array::zeros(gpu, "previous positions", 0)?,
            velocities: Array::zeros(gpu, "velocities", 0)?,
            corners: Array::zeros(gpu, "corners of tets", 0)?,
            rest: Array::zeros(gpu, "rest shapes", 0)?,
            constants: Array::zeros(gpu, "materials of tets", 0)?,
            tiles: Array::zeros(gpu, "tiles", 0)?,
            multipliers: Array::zeros(gpu, "multipliers", 0)?,
            corrections: Array::zeros(gpu, "corrections", 0)?,
            attachments: None,
            distances: None,
            volumes: None,
            contacts: None,
            tet_patches: Array::zeros(gpu, "patches of tets", 0)?,
            particle_patches: Array::zeros(gpu, "patches of particles", 0)?,
            range: Array::with_usage(gpu, "size of a patch", 1, wgpu::BufferUsages::UNIFORM)?,
        })
    }

    /// Sends the changes since the last call.
    pub(crate) fn sync(
        &mut self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        solver: &Solver<f32>,
        schedule: &Schedule,
        changes: &Changes,
    ) -> Result<(), GpuError> {
        self.sync_particles(gpu, kernels, solver, changes)?;
        Attachments::sync(&mut self.attachments, gpu, solver, changes)?;
        if changes.distances {
            ScalarConstraints::sync(&mut self.distances, gpu, solver, Kind::Distance)?;
        }
        if changes.volumes {
            ScalarConstraints::sync(&mut self.volumes, gpu, solver, Kind::Volume)?;
        }
        if changes.contacts {
            Contacts::sync(&mut self.contacts, gpu, solver)?;
        }
        let patch = self.layout.sync(schedule, solver, changes)?;
        if patch.regrouped {
            self.colors.sync(gpu, self.layout.slots.groups())?;
        }
        let various = !solver.is_uniform();
        let tet_slots = self.layout.tet_slot_count();
        if patch.is_rebuilt {
            self.corners = Array::zeros(gpu, "corners of tets", tet_slots)?;
        }
        self.corners.resize(gpu, tet_slots)?;
        self.rest
            .resize(gpu, tet_slots.next_multiple_of(THREADS) * NUMBERS)?;
        if various {
            self.constants.resize(gpu, tet_slots)?;
        }
        if self.layout.mapping == ClusterMapping::Workgroups {
            let tiles = self.layout.slots.slot_count();
            let room = self.layout.depth();
            let numbers_of_tile = number_count(room);
            self.tiles.resize(gpu, tiles * numbers_of_tile)?;
            for (tile, numbers) in &patch.tiles {
                let start = *tile as usize * numbers_of_tile;
                self.tiles.write(gpu, start, &numbers.numbers(room));
            }
        }
        for patches in patch.tets.chunks(PATCHES) {
            self.tet_patches.replace(gpu, patches)?;
            let variant = Variant {
                various,
                ..Variant::default()
            };
            let buffers = [
                self.range.buffer(),
                self.tet_patches.buffer(),
                self.corners.buffer(),
                self.rest.buffer(),
                self.constants.buffer(),
            ];
            let bound = kernels.bind(gpu, &PATCH_TETS, variant, &buffers)?;
            self.range.write(gpu, 0, &[count(patches.len())]);
            let mut encoder = gpu.encoder("patch tets");
            let mut pass = Recorder::new(gpu, &mut encoder, "patch tets", None);
            bound.run(&mut pass, &[], patches.len().div_ceil(THREADS));
            drop(pass);
            gpu.submit(encoder)?;
        }
        Ok(())
    }

    fn sync_particles(
        &mut self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        solver: &Solver<f32>,
        changes: &Changes,
    ) -> Result<(), GpuError> {
        let number = solver.particle_count();
        self.particles.resize(gpu, number)?;
        self.previous.resize(gpu, number)?;
        self.velocities.resize(gpu, number)?;
        if changes.all_particles {
            let (particles, velocities): (Vec<_>, Vec<_>) = (0..number)
                .map(|p| {
                    let (particle, [x, y, z]) = solver.particle_data(p);
                    (particle, [x, y, z, 0.0])
                })
                .unzip();
            self.particles.write(gpu, 0, &particles);
            self.velocities.write(gpu, 0, &velocities);
            return Ok(());
        }
        let mut changed = changes.particles.clone();
        changed.sort_unstable();
        changed.dedup();
        changed.retain(|&p| (p as usize) < number);
        for chunk in changed.chunks(PATCHES) {
            let patches: Vec<ParticlePatch> = chunk
                .iter()
                .map(|&index| {
                    let (particle, velocity) = solver.particle_data(index as usize);
                    ParticlePatch {
                        particle,
                        velocity,
                        index,
                    }
                })
                .collect();
            self.particle_patches.replace(gpu, &patches)?;
            let buffers = [
                self.range.buffer(),
                self.particle_patches.buffer(),
                self.particles.buffer(),
                self.velocities.buffer(),
            ];
            let bound = kernels.bind(gpu, &PATCH_PARTICLES, Variant::default(), &buffers)?;
            self.range.write(gpu, 0, &[count(patches.len())]);
            let mut encoder = gpu.encoder("patch particles");
            let mut pass = Recorder::new(gpu, &mut encoder, "patch particles", None);
            bound.run(&mut pass, &[], patches.len().div_ceil(THREADS));
            drop(pass);
            gpu.submit(encoder)?;
        }
        Ok(())
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> u64 {
        let arrays: u64 = [
            self.particles.buffer(),
            self.previous.buffer(),
            self.velocities.buffer(),
            self.corners.buffer(),
            self.rest.buffer(),
            self.constants.buffer(),
            self.tiles.buffer(),
            self.multipliers.buffer(),
            self.corrections.buffer(),
            self.tet_patches.buffer(),
            self.particle_patches.buffer(),
            self.colors.lists.array.buffer(),
            self.colors.ranges.array.buffer(),
        ]
        .into_iter()
        .map(wgpu::Buffer::size)
        .sum();
        let scalars = self.distances.iter().chain(&self.volumes);
        let handles = self.attachments.as_ref().map_or(0, Attachments::bytes);
        let contacts = self.contacts.as_ref().map_or(0, Contacts::bytes);
        arrays + handles + contacts + scalars.map(ScalarConstraints::bytes).sum::<u64>()
    }
}

fn count(patches: usize) -> DispatchRange {
    DispatchRange {
        first: 0,
        count: u32::try_from(patches).expect("patches are sent in chunks"),
    }
}
