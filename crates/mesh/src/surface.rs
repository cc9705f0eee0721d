//! [`Surface`]: the boundary of a mesh, i.e. the faces that belong to a single tet, oriented outward.
//!
//! All faces are sorted by their particles; those without a second side are the boundary. Cost: O(n log n).

use glam::DVec3;

use crate::faces::outward_face;
use crate::{DisjointSets, Faces, ParticleId, TetId, TetMesh};

/// Triangles, counterclockwise when seen from outside, and the tet of each.
///
/// The order is by tet, then by local face, the faces of a tet `[a, b, c, d]` being `acb`, `abd`, `adc`, `bcd`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Surface {
    /// The corners of each triangle.
    pub triangles: Vec<[ParticleId; 3]>,
    /// The tet of each triangle.
    pub tets: Vec<TetId>,
}

impl TetMesh {
    /// The boundary of the mesh. Faces with more than one tet are inside, whatever their orientation.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{glam::DVec3, kuhn_box};
    ///
    /// let mesh = kuhn_box([3, 2, 1], DVec3::ONE);
    /// let surface = mesh.surface();
    /// assert_eq!(surface.triangles.len(), 2 * 2 * (3 * 2 + 2 * 1 + 1 * 3));
    /// assert_eq!(surface.euler_characteristic(), 2);
    /// assert!((surface.volume(&mesh.positions) - 1.0).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.surface_from(&self.faces())
    }

    /// [`surface`](Self::surface) from sorted faces.
    ///
    /// # Panics
    /// If `faces` are those of a mesh with more tets.
    #[must_use]
    pub fn surface_from(&self, faces: &Faces) -> Surface {
        let mut boundary: Vec<u32> = faces
            .iter()
            .filter(|sides| sides.len() == 1)
            .map(|sides| sides[0].index())
            .collect();
        boundary.sort_unstable();
        Surface {
            triangles: boundary
                .iter()
                .map(|&index| outward_face(self.tets[index as usize / 4], index as usize % 4))
                .collect(),
            tets: boundary.iter().map(|&index| TetId(index / 4)).collect(),
        }
    }
}

impl Surface {
    /// The volume enclosed by the surface in m³, by the divergence theorem.
    ///
    /// # Panics
    /// If a corner has no position.
    #[must_use]
    pub fn volume(&self, positions: &[DVec3]) -> f64 {
        // Relative to a point of the surface, the terms do not cancel even far from the origin.
        let Some(origin) = self.triangles.first().map(|t| positions[t[0].index()]) else {
            return 0.0;
        };
        let corner = |p: ParticleId| positions[p.index()] - origin;
        self.triangles
            .iter()
            .map(|&[a, b, c]| corner(a).cross(corner(b)).dot(corner(c)))
            .sum::<f64>()
            / 6.0
    }

    /// True if every directed edge is matched by one in the opposite direction: the surface is closed.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        let mut forward = Vec::with_capacity(3 * self.triangles.len());
        forward.extend(self.directed_edges());
        let mut backward: Vec<_> = forward.iter().map(|&[a, b]| [b, a]).collect();
        forward.sort_unstable();
        backward.sort_unstable();
        forward == backward
    }

    /// True if the surface is closed and does not touch itself in an edge or a particle: each edge has two triangles,
    /// and the triangles at each particle form a single fan.
    ///
    /// # Panics
    /// From 2³¹ triangles on.
    #[must_use]
    pub fn is_manifold(&self) -> bool {
        let mut edges: Vec<_> = self.directed_edges().collect();
        edges.sort_unstable();
        let unique = edges.windows(2).all(|pair| pair[0] != pair[1]);
        if !unique || !self.is_closed() {
            return false;
        }
        // Around a particle, the corner (p; b, c) follows the corner (p; a, b). One fan visits them all.
        let mut corners = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            corners.extend([(a, b, c), (b, c, a), (c, a, b)]);
        }
        corners.sort_unstable();
        corners.chunk_by(|s, t| s.0 == t.0).all(|fan| {
            let start = fan[0].1;
            let mut here = start;
            let mut steps = 0;
            loop {
                let Ok(at) = fan.binary_search_by_key(&here, |corner| corner.1) else {
                    return false;
                };
                here = fan[at].2;
                steps += 1;
                if here == start || steps > fan.len() {
                    return steps == fan.len();
                }
            }
        })
    }

    /// The number of handles of all parts in total: 0 for balls, also with voids, 1 for a torus. `None` unless the
    /// surface is a manifold. O(n log n).
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{glam::DVec3, kuhn_box};
    ///
    /// let mut ring = kuhn_box([3, 3, 1], DVec3::ONE);
    /// ring.tets.drain(24..30); // the cell in the middle
    /// assert_eq!(ring.surface().genus(), Some(1));
    /// ```
    #[must_use]
    pub fn genus(&self) -> Option<usize> {
        if !self.is_manifold() {
            return None;
        }
        let particles = self.triangles.iter().flatten().map(|p| p.index() + 1);
        let mut sets = DisjointSets::new(particles.max().unwrap_or(0));
        for [a, b, c] in &self.triangles {
            sets.unite(a.0, b.0);
            sets.unite(a.0, c.0);
        }
        let mut roots: Vec<u32> = self.triangles.iter().map(|t| sets.root(t[0].0)).collect();
        roots.sort_unstable();
        roots.dedup();
        // Each part has a characteristic of 2 less 2 for each handle.
        let handles = 2 * isize::try_from(roots.len()).ok()? - self.euler_characteristic();
        usize::try_from(handles / 2).ok()
    }

    /// Vertices - edges + triangles: 2 for each sphere-like part, 0 for each torus-like one.
    #[must_use]
    #[expect(clippy::cast_possible_wrap, reason = "counts of things in memory")]
    pub fn euler_characteristic(&self) -> isize {
        let mut particles: Vec<_> = self.triangles.iter().flatten().copied().collect();
        particles.sort_unstable();
        particles.dedup();
        let mut edges: Vec<_> = self
            .directed_edges()
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        particles.len() as isize - edges.len() as isize + self.triangles.len() as isize
    }

    fn directed_edges(&self) -> impl Iterator<Item = [ParticleId; 2]> {
        self.triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids<const N: usize>(particles: [u32; N]) -> [ParticleId; N] {
        particles.map(ParticleId)
    }

    #[test]
    fn faces_of_one_tet_look_outward() {
        let mesh = TetMesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            tets: vec![ids([0, 1, 2, 3])],
        };
        let surface = mesh.surface();
        assert_eq!(
            surface.triangles,
            [
                ids([0, 2, 1]),
                ids([0, 1, 3]),
                ids([0, 3, 2]),
                ids([1, 2, 3])
            ]
        );
        assert_eq!(surface.tets, [TetId(0); 4]);
        assert!((surface.volume(&mesh.positions) - 1.0 / 6.0).abs() < 1e-16);
        assert!(surface.is_closed() && surface.is_manifold());
    }

    #[test]
    fn shared_face_is_inside() {
        let mesh = TetMesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE],
            tets: vec![ids([0, 1, 2, 3]), ids([1, 2, 3, 4])],
        };
        let surface = mesh.surface();
        assert_eq!(surface.triangles.len(), 6);
        assert_eq!(surface.euler_characteristic(), 2);
        assert!((surface.volume(&mesh.positions) - mesh.total_volume()).abs() < 1e-15);
    }

    #[test]
    fn tets_that_share_only_a_particle_or_an_edge_are_closed_but_not_manifold() {
        let corners = vec![
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            -DVec3::X,
            -DVec3::Y,
            -DVec3::Z,
        ];
        let touching = [[0, 4, 6, 5], [0, 3, 4, 5]];
        for second in touching {
            let mesh = TetMesh {
                positions: corners.clone(),
                tets: vec![ids([0, 1, 2, 3]), ids(second)],
            };
            let surface = mesh.surface();
            assert!(surface.is_closed() && !surface.is_manifold());
        }
    }

    #[test]
    fn a_hole_is_noticed() {
        let mesh = TetMesh {
            positions: vec![DVec3::ZERO; 4],
            tets: vec![ids([0, 1, 2, 3])],
        };
        let mut surface = mesh.surface();
        surface.triangles.pop();
        assert!(!surface.is_closed() && !surface.is_manifold());
    }
}
