//! [`MergedCells`]: merges interior lattice cells into larger cells, and fills these with tets.
//!
//! Cubes of 2, 4, 8 .. cells a side become one cell each, so that cells form the leaves of octrees whose neighbors,
//! also at edges and corners, differ by a factor of two at most. A face between cells of one size is filled as in the
//! lattice: four tets around the line between the two centers, or two per edge that a smaller cell halves. A face
//! between a cell and four smaller ones is cut into eight triangles that meet at its center; each is joined to the
//! center on either side. Both sides of a face and all cells around an edge use equal triangles and halves, so faces
//! match.
//!
//! Source: the graded interior of F. Labelle and J. R. Shewchuk, "Isosurface Stuffing", 2007, with a different choice
//! of tets between sizes. Cost: linear in the number of cells, one byte each.

/// Coordinates of a lattice vertex in half spacings.
type At = [i32; 3];

/// Levels of merged cells; see the module.
#[derive(Clone, Debug, Default)]
pub(super) struct MergedCells {
    cells: [usize; 3],
    /// Level of the merged cell that contains each cell; empty if there are none.
    levels: Vec<u8>,
}

impl MergedCells {
    /// Merges cells up to `most` times where the corner and center of all cells within one layer are inside.
    pub(super) fn new(cells: [usize; 3], most: u32, inside: impl Fn(usize) -> bool) -> Self {
        if most == 0 {
            return Self::default();
        }
        let [nx, ny, nz] = cells;
        let mut merged = Self {
            cells,
            levels: vec![0; nx * ny * nz],
        };
        // Cubes larger than the largest power of two that fits cannot be merged.
        let fits = nx.min(ny).min(nz).max(1).ilog2();
        let most = u8::try_from(most.min(fits)).unwrap_or(u8::MAX);
        for level in 1..=most {
            merged.merge(level, &inside);
        }
        while merged.split_beside_small() {}
        merged
    }

    /// True if a cell is part of a larger one.
    pub(super) fn is_merged(&self, cell: usize) -> bool {
        self.levels.get(cell).is_some_and(|&level| level > 0)
    }

    /// Merges eight cells of the level below wherever possible.
    fn merge(&mut self, level: u8, inside: &impl Fn(usize) -> bool) {
        let side = 1 << level;
        for low in self.blocks(level) {
            let ready = if level == 1 {
                self.around(low, side, 1).all(inside)
                    && (0..3).all(|a| low[a] > 0 && low[a] + side < self.cells[a])
            } else {
                self.around(low, side, 0)
                    .all(|cell| self.levels[cell] == level - 1)
            };
            if ready {
                self.set(low, side, level);
            }
        }
    }

    /// Undoes the last merge for cells that touch a cell less than half as large; returns true if there were any.
    fn split_beside_small(&mut self) -> bool {
        let mut changed = false;
        for level in 2..=self.levels.iter().copied().max().unwrap_or(0) {
            let side = 1 << level;
            for low in self.blocks(level) {
                if self.levels[self.cell(low)] == level
                    && self
                        .around(low, side, 1)
                        .any(|cell| self.levels[cell] + 1 < level)
                {
                    self.set(low, side, level - 1);
                    changed = true;
                }
            }
        }
        changed
    }

    /// Low cells of all cubes of a level that lie in the lattice.
    fn blocks(&self, level: u8) -> impl Iterator<Item = [usize; 3]> + use<> {
        let side = 1 << level;
        let [nx, ny, nz] = self.cells.map(|n| n / side);
        (0..nx * ny * nz)
            .map(move |block| [block % nx, block / nx % ny, block / nx / ny].map(|b| b * side))
    }

    /// Cells of a cube and of the given number of layers around it, clipped to the lattice.
    fn around(
        &self,
        low: [usize; 3],
        side: usize,
        layers: usize,
    ) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, nz] = self.cells;
        let range = move |axis: usize, count: usize| {
            low[axis].saturating_sub(layers)..(low[axis] + side + layers).min(count)
        };
        range(2, nz).flat_map(move |z| {
            range(1, ny).flat_map(move |y| range(0, nx).map(move |x| x + nx * (y + ny * z)))
        })
    }

    fn set(&mut self, low: [usize; 3], side: usize, level: u8) {
        for cell in self.around(low, side, 0) {
            self.levels[cell] = level;
        }
    }

    fn cell(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.cells[0] * (y + self.cells[1] * z)
    }

    /// Level of the cell that contains a point, which must not lie on a face between cells.
    #[expect(clippy::cast_sign_loss, reason = "merged cells are not at the rim")]
    fn level_at(&self, at: At) -> u8 {
        self.levels[self.cell(at.map(|c| (c >> 1) as usize))]
    }

    /// Emits all tets at merged cells, in no particular orientation.
    pub(super) fn fill(&self, mut emit: impl FnMut([At; 4])) {
        let most = self.levels.iter().copied().max().unwrap_or(0);
        for level in 1..=most {
            for low in self.blocks(level) {
                if self.levels[self.cell(low)] == level {
                    self.fill_cell(low, level, &mut emit);
                }
            }
        }
    }

    /// Emits the tets at a merged cell, except those that belong to its neighbors.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "a lattice has at most 2^26 cells"
    )]
    fn fill_cell(&self, low: [usize; 3], level: u8, emit: &mut impl FnMut([At; 4])) {
        // Half a side, in half spacings.
        let half = 1 << level;
        let center = low.map(|c| 2 * c as i32 + half);
        for (axis, sign) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
            let face = step(center, axis, sign * half);
            // Just across the face, off all lattice edges there.
            let across = step(face.map(|c| c + 1), axis, if sign > 0 { 0 } else { -2 });
            let beyond = self.level_at(across);
            let others = [(axis + 1) % 3, (axis + 2) % 3];
            if beyond == level {
                if sign > 0 {
                    self.fill_between(center, face, axis, level, emit);
                }
            } else if beyond < level {
                // The eight triangles around the face center, and the centers beyond where those cells are smaller.
                for (u, v) in [(-1, -1), (1, -1), (1, 1), (-1, 1)] {
                    let corner = step(step(face, others[0], u * half), others[1], v * half);
                    let quarter = step(
                        step(step(face, others[0], u * half / 2), others[1], v * half / 2),
                        axis,
                        sign * half / 2,
                    );
                    for middle in [
                        step(face, others[0], u * half),
                        step(face, others[1], v * half),
                    ] {
                        emit([center, face, middle, corner]);
                        emit([quarter, face, middle, corner]);
                    }
                }
            }
        }
    }

    /// Fills around the line between the centers of two cells of one size.
    fn fill_between(
        &self,
        center: At,
        face: At,
        axis: usize,
        level: u8,
        emit: &mut impl FnMut([At; 4]),
    ) {
        let half = 1 << level;
        let beyond = step(face, axis, half);
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        for (out, along) in [(others[0], others[1]), (others[1], others[0])] {
            for sign in [-1, 1] {
                let middle = step(face, out, sign * half);
                let [from, to] = [step(middle, along, -half), step(middle, along, half)];
                if self.is_halved(middle, level) {
                    emit([center, beyond, from, middle]);
                    emit([center, beyond, middle, to]);
                } else {
                    emit([center, beyond, from, to]);
                }
            }
        }
    }

    /// True if a cell around the middle of an edge of a cell is smaller than that cell.
    fn is_halved(&self, middle: At, level: u8) -> bool {
        (0..8).any(|octant| {
            let near = [0, 1, 2].map(|a| middle[a] + if octant >> a & 1 == 1 { 1 } else { -1 });
            self.level_at(near) < level
        })
    }
}

fn step(mut at: At, axis: usize, by: i32) -> At {
    at[axis] += by;
    at
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use crate::{Lattice, stuff, stuff_graded};
    use incise_mesh::{TetMesh, dihedral_angles};

    fn mesh(levels: u32, cells: f64, region: impl Fn(DVec3) -> f64 + Sync) -> TetMesh {
        let lattice = Lattice::covering(-DVec3::ONE, DVec3::ONE, 2.0 / cells, dvec3(0.3, 0.1, 0.7));
        stuff_graded(&lattice.expect("is a box"), levels, region).expect("fits")
    }

    /// Checks regions of all kinds: matching faces, positive tets, unchanged surface and volume, and the bounds of the
    /// angles.
    #[test]
    fn graded_meshes_are_sound_and_have_the_same_surface() {
        let ball = |p: DVec3| p.length() - 0.95;
        let box_ = |p: DVec3| (p.abs() - dvec3(0.9, 0.7, 0.8)).max_element();
        let ring = |p: DVec3| (p.truncate().length() - 0.6).hypot(p.z) - 0.3;
        let two = |p: DVec3| {
            let (a, b) = (p - dvec3(0.2, 0.1, 0.0), p + dvec3(0.3, 0.3, 0.2));
            (a.length() - 0.7).min(b.length() - 0.5)
        };
        let regions: [&(dyn Fn(DVec3) -> f64 + Sync); 4] = [&ball, &box_, &ring, &two];
        for region in regions {
            for cells in [12.0, 25.0, 40.0] {
                let uniform = mesh(0, cells, region);
                for levels in [1, 2, 5] {
                    let graded = mesh(levels, cells, region);
                    graded.check().expect("faces match and tets are positive");
                    // Up to the rounding of sums of some 10^5 terms.
                    let more = graded.total_volume() / uniform.total_volume() - 1.0;
                    assert!(more.abs() < 1e-11, "{more}");
                    assert!(graded.tets.len() <= uniform.tets.len());
                    // Equal surfaces, with different particle numbers.
                    let corners = |mesh: &TetMesh| {
                        let mut all: Vec<_> = mesh
                            .surface()
                            .triangles
                            .iter()
                            .flatten()
                            .map(|p| mesh.positions[p.index()].to_array().map(f64::to_bits))
                            .collect();
                        all.sort_unstable();
                        all
                    };
                    assert_eq!(corners(&graded), corners(&uniform));
                    assert!(graded.surface().is_manifold());
                    let quality = graded.quality();
                    assert!(quality.min_dihedral > 9.3 && quality.max_dihedral < 161.7);
                }
            }
        }
    }

    #[test]
    fn a_thick_body_has_far_fewer_tets() {
        let ball = |p: DVec3| p.length() - 1.0;
        let [uniform, once, often] = [0, 1, 9].map(|levels| mesh(levels, 60.0, ball).tets.len());
        assert!(
            2 * once < uniform && 5 * often < 2 * uniform,
            "{uniform} {once} {often}"
        );
        let lattice = Lattice::covering(-DVec3::ONE, DVec3::ONE, 0.1, DVec3::ZERO).expect("a box");
        let plain = stuff(&lattice, ball).expect("fits");
        assert_eq!(stuff_graded(&lattice, 0, ball).expect("fits"), plain);
    }

    #[test]
    fn tets_of_merged_cells_have_angles_of_45_to_120_degrees() {
        let graded = mesh(4, 40.0, |p| p.length() - 0.95);
        // Tets without a corner near the surface.
        let deep = graded.tets.iter().filter(|tet| {
            tet.iter()
                .all(|p| graded.positions[p.index()].length() < 0.95 - 4.0 * 0.05)
        });
        for tet in deep {
            let angles = dihedral_angles(tet.map(|p| graded.positions[p.index()]));
            for angle in angles {
                assert!((44.99..120.01).contains(&angle), "{angle}");
            }
        }
    }
}
