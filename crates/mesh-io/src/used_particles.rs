//! The particles that triangles use, for formats that leave out the others. O(n log n).

use incise_mesh::ParticleId;

/// The used particles in ascending order, and the index of each among them (0 for unused ones).
pub(super) struct UsedParticles {
    pub(super) particles: Vec<usize>,
    pub(super) indices: Vec<u32>,
}

impl UsedParticles {
    pub(super) fn new(triangles: &[[ParticleId; 3]], count: usize) -> Self {
        let mut particles: Vec<usize> = triangles.iter().flatten().map(|p| p.index()).collect();
        particles.sort_unstable();
        particles.dedup();
        let mut indices = vec![0; count];
        for (index, &particle) in (0..).zip(&particles) {
            indices[particle] = index;
        }
        Self { particles, indices }
    }
}
