//! Parts of a mesh that hang together at a single particle, taken apart.
//!
//! Where two parts meet at a particle but in no face around it, the surface touches itself there, and a simulation
//! would join the parts by a ball joint without any material. Each further part gets a particle of its own at the same
//! place.
//!
//! Cost: O(n log n) for n tets.

use crate::{DisjointSets, ParticleId, TetMesh};

impl TetMesh {
    /// Gives each group of tets around a particle that share faces at it a particle of its own; the number of particles
    /// added. They lie at the end, in the order of the particle and of the lowest tet of the group, whose first group
    /// keeps the old one.
    ///
    /// Parts that touch along an edge and are joined elsewhere at its ends still do.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{ParticleId, TetMesh, glam::DVec3};
    ///
    /// // Two tets on opposite sides of the origin.
    /// let mut positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    /// positions.extend([-DVec3::X, -DVec3::Z, -DVec3::Y]);
    /// let tets = vec![[0, 1, 2, 3].map(ParticleId), [0, 4, 5, 6].map(ParticleId)];
    /// let mut mesh = TetMesh { positions, tets };
    /// assert_eq!(mesh.pieces().count, 1);
    /// assert_eq!(mesh.split_pinches(), 1);
    /// assert_eq!(mesh.pieces().count, 2);
    /// ```
    pub fn split_pinches(&mut self) -> usize {
        let before = self.positions.len();
        // A tet at a particle, for all particles.
        let mut stars: Vec<(ParticleId, u32)> = (0_u32..)
            .zip(&self.tets)
            .flat_map(|(t, tet)| tet.map(|p| (p, t)))
            .collect();
        stars.sort_unstable();
        // Both are taken from the mesh as it was, and no two changes concern the same corner.
        let old = self.tets.clone();
        let mut faces: Vec<([ParticleId; 2], u32)> = Vec::new();
        let mut groups = DisjointSets::default();
        for star in stars.chunk_by(|s, t| s.0 == t.0) {
            let particle = star[0].0;
            faces.clear();
            for (place, &(_, t)) in (0_u32..).zip(star) {
                let mut others = old[t as usize].into_iter().filter(|&p| p != particle);
                let (Some(a), Some(b), Some(c)) = (others.next(), others.next(), others.next())
                else {
                    continue;
                };
                for [u, v] in [[a, b], [b, c], [c, a]] {
                    faces.push(([u.min(v), u.max(v)], place));
                }
            }
            faces.sort_unstable();
            groups.reset(star.len());
            for pair in faces.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                groups.unite(pair[0].1, pair[1].1);
            }
            let mut made: Vec<(u32, ParticleId)> = vec![(0, particle)];
            for (place, &(_, t)) in (0_u32..).zip(star) {
                let lowest = groups.root(place);
                let known = made.iter().find(|entry| entry.0 == lowest);
                let own = known.map(|entry| entry.1).unwrap_or_else(|| {
                    let own = ParticleId::new(self.positions.len());
                    self.positions.push(self.positions[particle.index()]);
                    made.push((lowest, own));
                    own
                });
                for corner in &mut self.tets[t as usize] {
                    if *corner == particle {
                        *corner = own;
                    }
                }
            }
        }
        self.positions.len() - before
    }
}
