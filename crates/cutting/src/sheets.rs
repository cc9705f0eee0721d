//! [`Sheets`]: the faces of each stroke as they were opened, which tell how far an improvement may move its cut faces.
//!
//! Particles are only ever appended and their rest positions never change, so a face is kept as its particles. Faces are
//! chained by stroke and by the cells of a grid that they overlap. Cells are as large as an edge of a mean tet, or a power of
//! two times that for larger faces, so that a face has eight of them at most. Cost: O(1) for each face opened; for each
//! point looked up the faces of the stroke in the cells around it.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{Bounds, ParticleId, TetMesh, closest_on_triangle};

use crate::index::index;

const NONE: u32 = u32::MAX;
/// Most halvings of a triangle to find out whether it is near.
const MOST_STEPS: usize = 256;
/// Most sizes of cells.
const MOST_SIZES: usize = 1024;

/// The faces of all strokes as they were opened, each for both sides.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Sheets {
    /// Whether faces that open are entered.
    pub(crate) is_recording: bool,
    /// Size of the smallest cells in m.
    cell: f64,
    /// Particles and number of the stroke, in the order in which the faces were opened.
    faces: Vec<([ParticleId; 3], u32)>,
    /// Number of faces for each size of cells.
    sizes: Vec<usize>,
    /// The last entry of each chain by a hash of stroke and cell. Never iterated.
    last: HashMap<u64, u32, FixedState>,
    /// Faces in the order of their entry, each with the entry before it in its chain.
    entries: Vec<(u32, u32)>,
}

impl Sheets {
    /// Those of a mesh whose mean tet has edges of a length in m.
    pub(crate) fn new(edge: f64) -> Self {
        Self {
            is_recording: true,
            cell: edge,
            ..Self::default()
        }
    }

    /// Hashes of the cells of a size that a box overlaps, for a stroke.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cell so far away that its number does not fit shares a chain with others"
    )]
    fn cells(&self, stroke: u32, size: usize, bounds: Bounds) -> impl Iterator<Item = u64> + use<> {
        let length = self.cell * (size as f64).exp2();
        // A body without volume has one cell.
        let length = if length > 0.0 { length } else { f64::INFINITY };
        let [low, high] =
            [bounds.low, bounds.high].map(|x| (x / length).to_array().map(|c| c.floor() as i64));
        let start = u64::from(stroke) << 16 | size as u64;
        let mix = |hash: u64, by: i64| {
            (hash.rotate_left(23) ^ by as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        };
        (low[0]..=high[0]).flat_map(move |x| {
            let x = mix(start, x);
            (low[1]..=high[1]).flat_map(move |y| {
                let y = mix(x, y);
                (low[2]..=high[2]).map(move |z| {
                    let hash = mix(y, z);
                    hash ^ hash >> 29
                })
            })
        })
    }

    /// The smallest size of cells that are at least as large as a box.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to the largest size"
    )]
    fn size_of(&self, bounds: Bounds) -> usize {
        let ratio = (bounds.high - bounds.low).max_element() / self.cell;
        let size = ratio.log2().ceil().clamp(0.0, MOST_SIZES as f64 - 1.0);
        size as usize
    }

    /// Number of faces opened.
    pub(crate) fn count(&self) -> usize {
        self.faces.len()
    }

    /// Enters a face that a stroke opened.
    pub(crate) fn enter(&mut self, particles: [ParticleId; 3], stroke: u32, positions: &[DVec3]) {
        let bounds = Bounds::around(particles.map(|p| positions[p.index()]));
        let size = self.size_of(bounds);
        if self.sizes.len() <= size {
            self.sizes.resize(size + 1, 0);
        }
        self.sizes[size] += 1;
        let face = index(self.faces.len());
        self.faces.push((particles, stroke));
        for hash in self.cells(stroke, size, bounds) {
            let entry = index(self.entries.len());
            let before = self.last.insert(hash, entry).unwrap_or(NONE);
            self.entries.push((face, before));
        }
    }

    /// Forgets all but the first `count` faces. The mesh still has their particles.
    pub(crate) fn truncate(&mut self, mesh: &TetMesh, count: usize) {
        while self.faces.len() > count {
            let Some((particles, stroke)) = self.faces.pop() else {
                break;
            };
            let bounds = Bounds::around(particles.map(|p| mesh.positions[p.index()]));
            let size = self.size_of(bounds);
            self.sizes[size] -= 1;
            let cells: Vec<u64> = self.cells(stroke, size, bounds).collect();
            for hash in cells.into_iter().rev() {
                match self.entries.pop() {
                    Some((_, before)) if before != NONE => self.last.insert(hash, before),
                    _ => self.last.remove(&hash),
                };
            }
        }
    }

    /// Appends those of a mesh that was appended after so many particles; `positions` are of both.
    pub(crate) fn append(&mut self, other: &Self, positions: &[DVec3], particles: usize) {
        for &(corners, stroke) in &other.faces {
            let shifted = corners.map(|p| ParticleId::new(particles + p.index()));
            self.enter(shifted, stroke, positions);
        }
    }

    /// Whether all of a triangle is within a distance of the faces that a stroke opened. False, too, if that takes too many
    /// steps to find out.
    ///
    /// The distance from one face is largest at a corner, since a face is convex. So a triangle is near if there is a face
    /// near all of its corners, or else if both of its halves are near.
    pub(crate) fn has_near(
        &self,
        mesh: &TetMesh,
        stroke: u32,
        triangle: [DVec3; 3],
        distance: f64,
    ) -> bool {
        let mut halves = vec![triangle];
        let (mut last, mut steps) = (None, 0);
        while let Some(piece) = halves.pop() {
            let found = self.find_near(mesh, stroke, &piece, distance, last);
            if found.is_some() {
                last = found;
                continue;
            }
            let lengths = [0, 1, 2].map(|k| piece[k].distance_squared(piece[(k + 1) % 3]));
            let [a, b, c] = match lengths {
                [x, y, z] if x >= y && x >= z => [0, 1, 2],
                [_, y, z] if y >= z => [1, 2, 0],
                _ => [2, 0, 1],
            }
            .map(|k: usize| piece[k]);
            let middle = a.midpoint(b);
            steps += 1;
            if steps > MOST_STEPS
                || self
                    .find_near(mesh, stroke, &[middle], distance, last)
                    .is_none()
            {
                return false;
            }
            halves.extend([[b, c, middle], [c, a, middle]]);
        }
        true
    }

    /// A face of a stroke that is within a distance of all of some points; `first` is looked at first.
    fn find_near(
        &self,
        mesh: &TetMesh,
        stroke: u32,
        points: &[DVec3],
        distance: f64,
        first: Option<u32>,
    ) -> Option<u32> {
        let is_near = |face: &u32| {
            let (particles, of) = self.faces[*face as usize];
            let corners = particles.map(|p| mesh.positions[p.index()]);
            let is_at = |x: &DVec3| {
                let closest = closest_on_triangle(corners, *x).point;
                closest.distance_squared(*x) <= distance * distance
            };
            of == stroke && points.iter().all(is_at)
        };
        if let Some(first) = first.filter(is_near) {
            return Some(first);
        }
        let x = points[0];
        let bounds = Bounds {
            low: x - distance,
            high: x + distance,
        };
        let used = (0..self.sizes.len()).filter(|size| self.sizes[*size] > 0);
        let chains = used.flat_map(|size| self.cells(stroke, size, bounds));
        let mut faces = chains.flat_map(|hash| self.chain(hash));
        faces.find(is_near)
    }

    /// The faces of a chain, last first.
    fn chain(&self, hash: u64) -> impl Iterator<Item = u32> + '_ {
        let mut at = self.last.get(&hash).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let &(face, before) = self.entries.get(at as usize)?;
            at = before;
            Some(face)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of two triangles and a large one above it, of two strokes.
    fn sheets() -> (Sheets, TetMesh) {
        let mesh = TetMesh {
            positions: vec![
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                DVec3::new(1.0, 1.0, 0.0),
                DVec3::new(-40.0, -40.0, 1.0),
                DVec3::new(40.0, -40.0, 1.0),
                DVec3::new(0.0, 40.0, 1.0),
            ],
            tets: Vec::new(),
        };
        let mut sheets = Sheets::new(1.0);
        for (corners, stroke) in [([0, 1, 2], 3), ([1, 3, 2], 3), ([4, 5, 6], 8)] {
            sheets.enter(corners.map(ParticleId), stroke, &mesh.positions);
        }
        (sheets, mesh)
    }

    #[test]
    fn triangles_near_a_stroke() {
        let (sheets, mesh) = sheets();
        let square = |height: f64, size: f64| [0.0, 1.0, 2.0].map(|k| corner(k, height, size));
        let is_near = |stroke, triangle| sheets.has_near(&mesh, stroke, triangle, 0.1);
        // Over both triangles of a stroke, up to the distance.
        assert!(is_near(3, square(0.0, 1.0)) && is_near(3, square(0.09, 1.0)));
        assert!(!is_near(3, square(0.11, 1.0)) && !is_near(3, square(0.0, 1.2)));
        assert!(is_near(8, square(1.0, 20.0)) && is_near(8, square(1.05, 0.01)));
        // Of another stroke.
        assert!(!is_near(8, square(0.0, 1.0)) && !is_near(3, square(1.0, 1.0)));
        assert!(!is_near(4, square(0.0, 1.0)));
    }

    /// Corners of half a square.
    fn corner(k: f64, height: f64, size: f64) -> DVec3 {
        let [x, y] = [f64::from(k > 0.0), f64::from(k > 1.0)];
        DVec3::new(0.5 - size * (0.5 - x), 0.5 - size * (0.5 - y), height)
    }

    #[test]
    fn what_is_forgotten_leaves_no_trace() {
        let (mut sheets, mesh) = sheets();
        let before = sheets.clone();
        let count = sheets.count();
        for corners in [[0, 1, 3], [4, 5, 6], [2, 3, 6]] {
            sheets.enter(corners.map(ParticleId), 3, &mesh.positions);
        }
        sheets.truncate(&mesh, count);
        assert_eq!(sheets.faces, before.faces);
        assert_eq!(sheets.entries, before.entries);
        assert_eq!(sheets.last, before.last);
    }
}
