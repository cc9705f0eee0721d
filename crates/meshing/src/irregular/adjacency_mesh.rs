//! Tetrahedral mesh for local changes: each tet knows its neighbors, and a few tets at a time are replaced by others
//! that fill the same volume.
//!
//! Cost: constant time per change.

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use crate::index::tet_index;

/// No neighbor: a boundary face.
pub(super) const NONE: u32 = u32::MAX;
/// Marker in place of the first corner of a removed tet.
const DEAD: u32 = u32::MAX;

/// Tets with their neighbors.
pub(super) struct AdjacencyMesh {
    pub(super) positions: Vec<DVec3>,
    /// Marks the particles on the surface.
    pub(super) on_surface: Vec<bool>,
    /// Positively oriented.
    tets: Vec<[u32; 4]>,
    /// Neighbors across the face opposite each corner: four times the tet plus its corner opposite the face, or `NONE`.
    neighbors: Vec<[u32; 4]>,
    /// One tet at each particle.
    at: Vec<u32>,
    free: Vec<u32>,
    /// Buffers reused between changes.
    faces: Vec<([u32; 3], u32, bool)>,
}

impl AdjacencyMesh {
    /// Takes a valid mesh with a manifold surface.
    pub(super) fn new(mesh: TetMesh) -> Self {
        let particles = mesh.positions.len();
        let faces = mesh.faces();
        let mut mesh = Self {
            positions: mesh.positions,
            on_surface: vec![false; particles],
            neighbors: vec![[NONE; 4]; mesh.tets.len()],
            at: vec![NONE; particles],
            tets: mesh.tets.iter().map(|tet| tet.map(|p| p.0)).collect(),
            free: Vec::new(),
            faces: Vec::new(),
        };
        /// Corner opposite each local face.
        const OPPOSITE: [usize; 4] = [3, 2, 1, 0];
        for face in faces.iter() {
            if let [a, b] = face {
                let [a, b] = [a, b].map(|s| code(s.tet().0, OPPOSITE[s.local()]));
                mesh.join(a, b);
            } else {
                for p in face[0].face() {
                    mesh.on_surface[p.index()] = true;
                }
            }
        }
        for (t, tet) in (0..).zip(&mesh.tets) {
            for &p in tet {
                mesh.at[p as usize] = t;
            }
        }
        mesh
    }

    /// Returns the mesh without unused particles; tets ascend by their lowest particles.
    pub(super) fn into_mesh(self) -> TetMesh {
        let mut tets = self.tets;
        tets.retain(|tet| tet[0] != DEAD);
        let mut numbers = vec![NONE; self.positions.len()];
        for &p in tets.iter().flatten() {
            numbers[p as usize] = 0;
        }
        let mut positions = Vec::new();
        for (number, position) in numbers.iter_mut().zip(&self.positions) {
            if *number != NONE {
                *number = ParticleId::new(positions.len()).0;
                positions.push(*position);
            }
        }
        for tet in &mut tets {
            *tet = tet.map(|p| numbers[p as usize]);
        }
        tets.sort_unstable_by_key(|tet| {
            let mut sorted = *tet;
            sorted.sort_unstable();
            sorted
        });
        TetMesh {
            positions,
            tets: tets.into_iter().map(|tet| tet.map(ParticleId)).collect(),
        }
    }

    /// One past the largest tet index.
    pub(super) fn end(&self) -> u32 {
        tet_index(self.tets.len())
    }

    /// Corners of a tet; `None` if it was removed.
    pub(super) fn tet(&self, t: u32) -> Option<[u32; 4]> {
        Some(self.tets[t as usize]).filter(|tet| tet[0] != DEAD)
    }

    pub(super) fn neighbor(&self, t: u32, corner: usize) -> u32 {
        self.neighbors[t as usize][corner]
    }

    pub(super) fn corners(&self, tet: [u32; 4]) -> [DVec3; 4] {
        tet.map(|p| self.positions[p as usize])
    }

    /// Collects the tets and the particles around an inner edge `a b` of a tet, counterclockwise seen from `b`; returns
    /// false for an edge on the surface.
    ///
    /// Tet `k` lies between the particles `k` and `k + 1` of the ring.
    pub(super) fn ring(&self, t: u32, [i, j]: [usize; 2], ring: &mut Ring) -> bool {
        let tet = self.tets[t as usize];
        let rest = other_two(i, j);
        // The ring is counterclockwise if (a, b, first, second) is positive.
        let [k, l] = if is_even([i, j, rest[0], rest[1]]) {
            rest
        } else {
            [rest[1], rest[0]]
        };
        ring.clear();
        let (mut cell, mut first, mut second) = (t, tet[k], tet[l]);
        loop {
            ring.tets.push(cell);
            ring.particles.push(first);
            let corners = self.tets[cell as usize];
            let behind = (0..4).find(|&c| corners[c] == first).unwrap_or(0);
            let across = self.neighbors[cell as usize][behind];
            if across == NONE {
                return false;
            }
            cell = across / 4;
            if cell == t {
                return true;
            }
            first = second;
            second = self.tets[cell as usize][across as usize % 4];
        }
    }

    /// Collects all tets at a particle.
    pub(super) fn star(&self, particle: u32, star: &mut Vec<u32>) {
        star.clear();
        star.push(self.at[particle as usize]);
        let mut next = 0;
        while let Some(&t) = star.get(next) {
            next += 1;
            for k in 0..4 {
                let across = self.neighbors[t as usize][k];
                if self.tets[t as usize][k] != particle
                    && across != NONE
                    && !star.contains(&(across / 4))
                {
                    star.push(across / 4);
                }
            }
        }
    }

    /// Replaces tets by others with equal outer faces and no new particles.
    pub(super) fn replace(&mut self, old: &[u32], new: &[[u32; 4]]) {
        let mut faces = std::mem::take(&mut self.faces);
        faces.clear();
        for &t in old {
            for k in 0..4 {
                let across = self.neighbors[t as usize][k];
                if across == NONE || !old.contains(&(across / 4)) {
                    faces.push((face(self.tets[t as usize], k), across, false));
                }
            }
        }
        for &t in old {
            self.tets[t as usize][0] = DEAD;
            self.free.push(t);
        }
        for &tet in new {
            let t = self.free.pop().unwrap_or_else(|| {
                self.tets.push(tet);
                self.neighbors.push([NONE; 4]);
                tet_index(self.tets.len() - 1)
            });
            self.tets[t as usize] = tet;
            self.neighbors[t as usize] = [NONE; 4];
            for (k, p) in tet.into_iter().enumerate() {
                self.at[p as usize] = t;
                faces.push((face(tet, k), code(t, k), true));
            }
        }
        faces.sort_unstable();
        for pair in faces.chunks_exact(2) {
            debug_assert_eq!(pair[0].0, pair[1].0, "outer faces stay");
            if pair[0].1 != NONE && pair[1].1 != NONE {
                self.join(pair[0].1, pair[1].1);
            }
        }
        self.faces = faces;
    }

    /// Removes a tet at the surface.
    pub(super) fn remove(&mut self, t: u32) {
        let tet = self.tets[t as usize];
        for (k, &p) in tet.iter().enumerate() {
            let across = self.neighbors[t as usize][k];
            self.on_surface[p as usize] = true;
            if across != NONE {
                self.neighbors[across as usize / 4][across as usize % 4] = NONE;
                for q in face(tet, k) {
                    self.at[q as usize] = across / 4;
                }
            }
        }
        self.tets[t as usize][0] = DEAD;
        self.free.push(t);
    }

    fn join(&mut self, a: u32, b: u32) {
        self.neighbors[a as usize / 4][a as usize % 4] = b;
        self.neighbors[b as usize / 4][b as usize % 4] = a;
    }
}

/// Tets and particles around an edge.
#[derive(Default)]
pub(super) struct Ring {
    pub(super) tets: Vec<u32>,
    pub(super) particles: Vec<u32>,
}

impl Ring {
    fn clear(&mut self) {
        self.tets.clear();
        self.particles.clear();
    }
}

/// Remaining two of the numbers 0 to 3, ascending.
pub(super) fn other_two(i: usize, j: usize) -> [usize; 2] {
    let mut rest = (0..4).filter(|&k| k != i && k != j);
    [rest.next().unwrap_or(0), rest.next().unwrap_or(0)]
}

/// True for an even permutation.
fn is_even(order: [usize; 4]) -> bool {
    let inversions: usize = (0..4)
        .map(|k| (0..k).filter(|&j| order[j] > order[k]).count())
        .sum();
    inversions.is_multiple_of(2)
}

/// Face opposite a corner, ascending.
fn face(tet: [u32; 4], corner: usize) -> [u32; 3] {
    let mut face = [1, 2, 3].map(|k| tet[(corner + k) % 4]);
    face.sort_unstable();
    face
}

fn code(tet: u32, corner: usize) -> u32 {
    4 * tet + tet_index(corner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fan;
    use incise_mesh::{kuhn_box, signed_volume};

    #[test]
    fn rings_and_stars_are_complete() {
        let mesh = AdjacencyMesh::new(fan(7));
        let (mut ring, mut star) = (Ring::default(), Vec::new());
        assert!(mesh.ring(3, [0, 1], &mut ring));
        assert_eq!(ring.tets, [3, 4, 5, 6, 0, 1, 2]);
        assert_eq!(ring.particles, [5, 6, 7, 8, 2, 3, 4]);
        assert!(mesh.ring(3, [1, 0], &mut ring));
        assert_eq!(ring.tets, [3, 2, 1, 0, 6, 5, 4]);
        assert!(!mesh.ring(3, [0, 2], &mut ring));
        mesh.star(1, &mut star);
        star.sort_unstable();
        assert_eq!(star, [0, 1, 2, 3, 4, 5, 6]);
        assert!(mesh.on_surface.iter().all(|&on| on));
    }

    #[test]
    fn edges_are_removed_and_faces_put_back() {
        // Three tets around an edge are two on a face.
        let mut mesh = AdjacencyMesh::new(fan(3));
        mesh.replace(&[0, 1, 2], &[[2, 3, 4, 1], [2, 4, 3, 0]]);
        assert!(
            (0..mesh.end())
                .filter_map(|t| mesh.tet(t))
                .all(|t| signed_volume(mesh.corners(t)) > 0.0)
        );
        let live: Vec<u32> = (0..mesh.end()).filter(|&t| mesh.tet(t).is_some()).collect();
        mesh.replace(&live, &[[0, 1, 2, 3], [0, 1, 3, 4], [0, 1, 4, 2]]);
        let mut mesh = mesh.into_mesh();
        mesh.tets[1..].sort_unstable();
        assert_eq!(mesh.positions, fan(3).positions);
        assert_eq!(mesh.tets.len(), 3);
        mesh.check().expect("sound");
    }

    #[test]
    fn a_mesh_comes_out_as_it_went_in() {
        let mesh = kuhn_box([3, 2, 2], DVec3::ONE);
        let out = AdjacencyMesh::new(mesh.clone()).into_mesh();
        assert_eq!(out.positions, mesh.positions);
        let sorted = |mesh: &TetMesh| {
            let mut tets = mesh.tets.clone();
            tets.sort_unstable();
            tets
        };
        assert_eq!(sorted(&out), sorted(&mesh));
    }
}
