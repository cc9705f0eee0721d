//! [`DeviceIncidence`]: constraints and their particles in device memory.
//!
//! Each direction is one array of offsets, then values. The offsets count from the front of the array. One array
//! instead of two leaves kernels more of the eight buffers that WebGPU guarantees. Cost: one upload of at most 8 bytes
//! per constraint, particle and pair of them.

use incise_graph::Incidence;

use super::rounds::parts;
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Constraints and their particles in device memory, ready to be colored without building a graph.
///
/// See [`scgc_incidence`](super::scgc_incidence()) for an example.
#[derive(Debug)]
pub struct DeviceIncidence {
    constraints: usize,
    particles: usize,
    pub(super) particles_of: Array<u32>,
    pub(super) constraints_of: Array<u32>,
    /// Uniforms of even and odd rounds.
    pub(super) parts: Array<u32>,
}

impl DeviceIncidence {
    /// Uploads an incidence. O(constraints + particles + pairs).
    ///
    /// # Errors
    /// If the device has no room for it, or if offsets and values are more than 2^32 numbers in total.
    pub fn new(gpu: &GpuContext, incidence: &Incidence) -> Result<Self, GpuError> {
        let (constraints, particles) = (incidence.constraint_count(), incidence.particle_count());
        let pairs = incidence.values().len();
        let particles_of = rows(constraints, pairs, |c| incidence.particles_of(c));
        let constraints_of = rows(particles, pairs, |p| incidence.constraints_of(p));
        let too_large = GpuError::Unsupported {
            what: "more than 2^32 constraints and particles together",
        };
        let (Some(particles_of), Some(constraints_of)) = (particles_of, constraints_of) else {
            return Err(too_large);
        };
        Ok(Self {
            constraints,
            particles,
            particles_of: Array::new(gpu, "particles of constraints", &particles_of)?,
            constraints_of: Array::new(gpu, "constraints of particles", &constraints_of)?,
            parts: parts(gpu, constraints)?,
        })
    }

    /// The number of constraints, which are the vertices of the coloring.
    #[must_use]
    pub fn constraint_count(&self) -> usize {
        self.constraints
    }

    /// The number of particles.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.particles
    }
}

/// Offsets and values in one list; `None` if it would be too long.
fn rows<'a>(count: usize, pairs: usize, row: impl Fn(usize) -> &'a [u32]) -> Option<Vec<u32>> {
    let mut end = u32::try_from(count + 1).ok()?;
    u32::try_from(count + 1 + pairs).ok()?;
    let mut list = Vec::with_capacity(count + 1 + pairs);
    list.push(end);
    for i in 0..count {
        // Each row is shorter than the whole list.
        end += u32::try_from(row(i).len()).ok()?;
        list.push(end);
    }
    for i in 0..count {
        list.extend_from_slice(row(i));
    }
    Some(list)
}
