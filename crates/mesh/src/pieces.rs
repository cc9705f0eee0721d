//! [`Pieces`]: the connected pieces of a mesh, by shared particles or by shared faces.
//!
//! [`DisjointSets`], then one pass that numbers the pieces in the order of their first tet. Almost linear over
//! particles ([`TetMesh::pieces`]); O(n log n) over faces ([`TetMesh::face_pieces`]), which must be matched first. The
//! result depends only on the mesh.

use crate::{DisjointSets, Faces, TetId, TetMesh};

/// The piece of each tet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pieces {
    /// The piece of each tet, numbered from 0 in the order of their first tets.
    pub labels: Vec<u32>,
    /// The number of pieces.
    pub count: usize,
}

impl TetMesh {
    /// The pieces that can move independently: tets are connected when they share a particle.
    ///
    /// # Panics
    /// If a corner does not exist.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{glam::DVec3, kuhn_box};
    ///
    /// let mut mesh = kuhn_box([3, 1, 1], DVec3::ONE);
    /// mesh.tets.drain(6..12); // the middle cell
    /// let pieces = mesh.pieces();
    /// assert_eq!(pieces.count, 2);
    /// assert_eq!(pieces.labels, [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1]);
    /// ```
    #[must_use]
    pub fn pieces(&self) -> Pieces {
        let mut sets = DisjointSets::new(self.positions.len());
        for &[a, b, c, d] in &self.tets {
            for other in [b, c, d] {
                sets.unite(a.0, other.0);
            }
        }
        Pieces::number(
            self.tets.iter().map(|tet| sets.root(tet[0].0)),
            self.positions.len(),
        )
    }

    /// The pieces connected by material: tets are connected when they share a face.
    ///
    /// Never fewer than [`pieces`](Self::pieces), and more where parts touch only in a particle or an edge.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    #[must_use]
    pub fn face_pieces(&self) -> Pieces {
        self.face_pieces_from(&self.faces())
    }

    /// [`face_pieces`](Self::face_pieces) from sorted faces.
    ///
    /// # Panics
    /// If `faces` are those of a mesh with more tets.
    #[must_use]
    pub fn face_pieces_from(&self, faces: &Faces) -> Pieces {
        let mut sets = DisjointSets::new(self.tets.len());
        for face in faces.iter() {
            for pair in face.windows(2) {
                sets.unite(pair[0].tet().0, pair[1].tet().0);
            }
        }
        Pieces::number(
            (0..self.tets.len()).map(|t| sets.root(TetId::new(t).0)),
            self.tets.len(),
        )
    }
}

impl Pieces {
    /// The volume of each piece in m³.
    ///
    /// # Panics
    /// If `mesh` has fewer tets than there are labels.
    #[must_use]
    pub fn volumes(&self, mesh: &TetMesh) -> Vec<f64> {
        let mut volumes = vec![0.0; self.count];
        for (tet, &label) in self.labels.iter().enumerate() {
            volumes[label as usize] += mesh.volume(TetId::new(tet));
        }
        volumes
    }

    /// The number of tets in each piece.
    #[must_use]
    pub fn sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.count];
        for &label in &self.labels {
            sizes[label as usize] += 1;
        }
        sizes
    }

    fn number(roots: impl Iterator<Item = u32>, sets: usize) -> Self {
        let mut labels_of_roots = vec![u32::MAX; sets];
        let mut count = 0;
        let labels = roots
            .map(|root| {
                let label = &mut labels_of_roots[root as usize];
                if *label == u32::MAX {
                    *label = count;
                    count += 1;
                }
                *label
            })
            .collect();
        Self {
            labels,
            count: count as usize,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::ParticleId;

    #[test]
    fn an_edge_holds_particles_together_but_not_faces() {
        let mesh = TetMesh {
            positions: vec![
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                DVec3::Z,
                -DVec3::X,
                -DVec3::Y,
            ],
            tets: vec![[0, 1, 2, 3].map(ParticleId), [0, 4, 5, 3].map(ParticleId)],
        };
        let pieces = mesh.pieces();
        assert_eq!(
            (pieces.count, pieces.labels.as_slice()),
            (1, [0, 0].as_slice())
        );
        let strict = mesh.face_pieces();
        assert_eq!(
            (strict.count, strict.labels.as_slice()),
            (2, [0, 1].as_slice())
        );
        assert_eq!(strict.volumes(&mesh), [1.0 / 6.0; 2]);
        assert_eq!(strict.sizes(), [1, 1]);
    }

    #[test]
    fn labels_follow_the_order_of_the_tets() {
        let tets = [[8, 9, 10, 11], [0, 1, 2, 3], [11, 12, 13, 14], [4, 5, 6, 7]];
        let mesh = TetMesh {
            positions: vec![DVec3::ZERO; 15],
            tets: tets.map(|t| t.map(ParticleId)).to_vec(),
        };
        assert_eq!(mesh.pieces().labels, [0, 1, 0, 2]);
        assert_eq!(mesh.face_pieces().labels, [0, 1, 2, 3]);
    }

    #[test]
    fn no_tets_no_pieces() {
        assert_eq!(TetMesh::default().pieces(), Pieces::default());
        assert_eq!(TetMesh::default().face_pieces(), Pieces::default());
    }
}
