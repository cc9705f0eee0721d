//! [`Shared`]: buffers of a frame for kernels that do not solve tets.

use wgpu::Buffer;

/// Buffers for the kernels of attachments, colliders and scalar constraints.
#[derive(Debug)]
pub(crate) struct Shared<'a> {
    pub(crate) settings: &'a Buffer,
    pub(crate) uniforms: &'a Buffer,
    pub(crate) particles: &'a Buffer,
    pub(crate) previous: &'a Buffer,
    pub(crate) velocities: &'a Buffer,
    pub(crate) repaired: &'a Buffer,
}
