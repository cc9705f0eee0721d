//! Splitting of particles at which parts of a mesh touch without a common face.
//!
//! At such a particle the surface touches itself, and a simulation would connect the parts by a ball joint without
//! material. Each further part gets a copy of the particle.
//!
//! Cost: O(n log n) for n tets.

use crate::{DisjointSets, ParticleId, TetMesh};

impl TetMesh {
    /// Splits each particle whose tets are in several groups that share no face at it, one copy for each further group;
    /// returns the number of added particles. They are appended in the order of the particle and of the lowest tet of
    /// the group; the first group keeps the old particle.
    ///
    /// Parts that touch along an edge and are connected elsewhere at its ends keep touching.
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
        // All pairs of a particle and a tet at it.
        let mut stars: Vec<(ParticleId, u32)> = (0_u32..)
            .zip(&self.tets)
            .flat_map(|(t, tet)| tet.map(|p| (p, t)))
            .collect();
        stars.sort_unstable();
        // Both are taken from the original mesh, and no two changes affect one corner.
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
