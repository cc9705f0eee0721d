//! Structs shared by host and kernels; tests compare them with the shaders.

use bytemuck::{Pod, Zeroable};

/// Numbers of a tet's rest shape.
pub(crate) const NUMBERS: usize = 16;

/// `Settings` in `settings.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Settings {
    pub(crate) gravity: [f32; 3],
    pub(crate) time: f32,
    pub(crate) time_squared: f32,
    pub(crate) per_time: f32,
    pub(crate) relaxation: f32,
    pub(crate) one: f32,
    pub(crate) half: f32,
    pub(crate) max_cofactor_norm: f32,
    pub(crate) particles: u32,
    pub(crate) depth: u32,
    pub(crate) colliders: u32,
    pub(crate) handles: u32,
    pub(crate) rigid: u32,
    pub(crate) soft: u32,
    pub(crate) material: [f32; 4],
}

/// `DispatchRange` in `settings.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct DispatchRange {
    pub(crate) first: u32,
    pub(crate) count: u32,
}

/// `IterationUniform` in `iteration.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct IterationUniform {
    pub(crate) substep: u32,
    pub(crate) iteration: u32,
    pub(crate) weight: f32,
    pub(crate) unused: u32,
}

/// `ContactUniform` in `contact.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ContactUniform {
    pub(crate) friction: f32,
    pub(crate) kept: f32,
    pub(crate) margin: f32,
    pub(crate) unused: f32,
}

/// `Attachment` in `attachments.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Attachment {
    pub(crate) anchor: [f32; 3],
    pub(crate) particle: u32,
    pub(crate) handle: u32,
    pub(crate) compliance: f32,
    pub(crate) damping: f32,
    pub(crate) unused: u32,
}

/// `Units` in `measure_tets.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Units {
    pub(crate) tet_slots: u32,
    pub(crate) length: f32,
    pub(crate) slope: f32,
    pub(crate) unused: u32,
}

/// `TetSums` in `measure_tets.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TetSums {
    pub(crate) energy: f32,
    pub(crate) change: f32,
    pub(crate) least: f32,
    pub(crate) inverted: u32,
}

/// `ParticleSums` in `measure_particles.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ParticleSums {
    pub(crate) moment: [f32; 3],
    pub(crate) kinetic: f32,
    pub(crate) speed_squared: f32,
    pub(crate) unused: [f32; 3],
}

/// `TetPatch` in `patch_tets.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TetPatch {
    pub(crate) tet_slot: u32,
    pub(crate) unused: [u32; 3],
    /// All 0 for an empty slot.
    pub(crate) corners: [u32; 4],
    pub(crate) rest: [f32; NUMBERS],
    pub(crate) constants: [f32; 4],
}

/// `ParticlePatch` in `patch_particles.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ParticlePatch {
    pub(crate) particle: [f32; 4],
    pub(crate) velocity: [f32; 3],
    pub(crate) index: u32,
}
