//! Isosurface stuffing: fills the inside of a level set with well-shaped tets.
//!
//! The function is sampled at the vertices of a body-centered cubic lattice. On each edge between an inside and an
//! outside vertex the surface is located on the function itself (not on its linear interpolant). A vertex with a cut
//! point close enough to cause slivers is moved onto it, which removes the other cuts at its edges. Each lattice tet is
//! then filled from the stencils of the module `stencil`.
//!
//! For every function, faces match, every tet is positive, and the dihedral angles stay between 9.3 and 161.7 degrees.
//! These bounds were found by enumerating all extremes of the stencils, not by proof. The paper proves 10.7 and 164.8
//! degrees; smooth surfaces usually stay within those bounds, but not always. Features thinner than the spacing are
//! lost, sharp edges are beveled.
//!
//! Source: F. Labelle and J. R. Shewchuk, "Isosurface Stuffing: Fast Tetrahedral Meshes with Good Dihedral Angles",
//! 2007, for a uniform lattice. Cost: linear in the number of lattice cells, with two samples and 26 bytes each;
//! vertices with a cut at their edges take more. A true distance function saves the samples far from the surface.

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh, signed_volume};
use rayon::prelude::*;

use crate::MeshingError;
use crate::index::index;
use crate::lattice::{Lattice, root};
use crate::merged_cells::MergedCells;
use crate::neighbors::{NEIGHBORS, add, backward, direction, directions, steps};
use crate::stencil::{Corner, Node, Side, fill};

/// Fraction of a long edge within which a vertex moves onto a cut (value of the paper).
pub(super) const ALPHA_LONG: f64 = 0.24999;
/// Fraction of a short edge within which a vertex moves onto a cut (value of the paper).
pub(super) const ALPHA_SHORT: f64 = 0.41189;
/// No entry in a table of indices.
const NONE: u32 = u32::MAX;

/// Fills the region where `distance` is negative with tets.
///
/// `distance` takes a position in meters and must be continuous; only its sign affects the shape of the result. The
/// region must not reach the outermost layer of cells. The result has no unused particles. It has no tets if no lattice
/// vertex lies inside.
///
/// Deterministic: equal function values give bit-identical results on every platform and for any number of threads.
/// Sampling and the search for the surface are parallel. Tets are in the order of the cells, x first, and particles in
/// the order of their first use.
///
/// # Errors
/// [`MeshingError::Lattice`] if `distance` is not finite somewhere, the region reaches the outermost layer of cells, or
/// the lattice has more than 2²⁶ cells.
///
/// # Example
/// ```
/// use incise_meshing::{Lattice, stuff};
/// use incise_mesh::glam::DVec3;
///
/// let lattice = Lattice::covering(-DVec3::ONE, DVec3::ONE, 0.25, DVec3::ZERO)?;
/// let ball = stuff(&lattice, |p| p.length() - 1.0)?;
/// ball.check()?;
/// assert!(ball.quality().min_dihedral > 10.7);
/// assert!((ball.total_volume() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.03);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn stuff(
    lattice: &Lattice,
    distance: impl Fn(DVec3) -> f64 + Sync,
) -> Result<TetMesh, MeshingError> {
    stuff_graded(lattice, 0, distance)
}

/// Fills the region where `distance` is negative with tets, with inner cells merged up to `levels` times: a cube of
/// eight cells becomes one if it and all cells around it lie inside. Neighbors, also at edges and corners, differ by
/// one doubling at most.
///
/// The surface is that of [`stuff`], with tets of equal size there. Tets inside merged cells have dihedral angles of
/// 45 to 120 degrees. A thick body of n tets keeps some n^(2/3).
///
/// # Errors
/// The errors of [`stuff`].
///
/// # Example
/// ```
/// use incise_meshing::{Lattice, stuff, stuff_graded};
/// use incise_mesh::glam::DVec3;
///
/// let lattice = Lattice::covering(-DVec3::ONE, DVec3::ONE, 0.05, DVec3::ZERO)?;
/// let ball = |p: DVec3| p.length() - 1.0;
/// let (uniform, graded) = (stuff(&lattice, ball)?, stuff_graded(&lattice, 3, ball)?);
/// graded.check()?;
/// assert!(2 * graded.tets.len() < uniform.tets.len());
/// assert!((graded.total_volume() - uniform.total_volume()).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn stuff_graded(
    lattice: &Lattice,
    levels: u32,
    distance: impl Fn(DVec3) -> f64 + Sync,
) -> Result<TetMesh, MeshingError> {
    let mut grid = Grid::new(lattice, Slope::Any, &distance)?;
    grid.coarsen(levels);
    Ok(grid.extract(grid.tet_count()))
}

/// Known bound of the slope of the function.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Slope {
    /// Unknown: the function is sampled everywhere.
    Any,
    /// Values at two points differ by no more than their distance: few samples suffice far from the surface.
    AtMostOne,
}

/// Sampled lattice. Vertex `2 c` is the low corner of cell `c`, vertex `2 c + 1` its center.
///
/// All vertices of the rim lie outside. An index step past the rim may wrap to the opposite rim and still lands
/// outside.
pub(super) struct Grid {
    lattice: Lattice,
    /// Index steps to the neighbors of a corner and of a center, in the order of [`NEIGHBORS`].
    steps: [[isize; 14]; 2],
    /// Side of each vertex.
    sides: Vec<Side>,
    /// Index in `near` of each vertex that has an edge with a cut.
    near_indices: Vec<u32>,
    /// Vertices that have an edge with a cut, in ascending order.
    near: Vec<Near>,
    cuts: Vec<DVec3>,
    /// Merged cells.
    merged_cells: MergedCells,
}

/// A vertex with cuts at its edges.
struct Near {
    vertex: u32,
    /// Bit mask over [`NEIGHBORS`] of the neighbors on the opposite side before vertices were moved.
    opposite: u16,
    /// Cut onto which the vertex was moved.
    moved: u32,
    /// First cut of an inside vertex. Its cuts are in the order of [`NEIGHBORS`].
    first: u32,
}

impl Grid {
    /// Samples the function, locates the surface on the edges and moves vertices onto it.
    pub(super) fn new(
        lattice: &Lattice,
        slope: Slope,
        distance: &(impl Fn(DVec3) -> f64 + Sync),
    ) -> Result<Self, MeshingError> {
        let vertices = 2 * lattice.cell_count()?;
        let mut grid = Self {
            lattice: *lattice,
            steps: steps(lattice.cells),
            sides: vec![Side::Outside; vertices],
            near_indices: Vec::new(),
            near: Vec::new(),
            cuts: Vec::new(),
            merged_cells: MergedCells::default(),
        };
        let values = grid.sample(slope, distance)?;
        grid.cut(&values, distance);
        drop(values);
        grid.warp();
        Ok(grid)
    }

    /// Computes the sides. Returns the value at each vertex, or 0 where it was not needed.
    fn sample(
        &mut self,
        slope: Slope,
        distance: &(impl Fn(DVec3) -> f64 + Sync),
    ) -> Result<Vec<f64>, MeshingError> {
        let mut values = vec![0.0; self.sides.len()];
        let mut sides = std::mem::take(&mut self.sides);
        let [nx, ny, _] = self.lattice.cells;
        let [row, layer] = [2 * nx, 2 * nx * ny].map(|length| length.max(1));
        let layers: Vec<Result<(), MeshingError>> = sides
            .par_chunks_mut(layer)
            .zip(values.par_chunks_mut(layer))
            .enumerate()
            .map(|(z, (sides, values))| {
                let (mut last, mut skipped) = (Side::Outside, 0);
                for (i, (side, value)) in sides.iter_mut().zip(values).enumerate() {
                    if i % row == 0 || skipped == 0 {
                        (last, *value) = self.sample_at(z * layer + i, distance)?;
                        skipped = self.vertices_far_from_surface(slope, *value);
                    } else {
                        skipped -= 1;
                    }
                    *side = last;
                }
                Ok(())
            })
            .collect();
        // The first error in the order of the vertices, independent of the threads.
        layers.into_iter().collect::<Result<(), _>>()?;
        self.sides = sides;
        Ok(values)
    }

    /// Number of next vertices in the row that have no neighbor on the opposite side, given the value at a vertex.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "only a positive finite number is cast"
    )]
    fn vertices_far_from_surface(&self, slope: Slope, value: f64) -> usize {
        // The n-th is at most n / 2 + 0.71 spacings away, its neighbors one more. The rest is a margin for rounding.
        let vertices = 2.0 * (0.999 * value.abs() / self.lattice.spacing - 1.75);
        match slope {
            Slope::AtMostOne if vertices > 0.0 => vertices as usize,
            _ => 0,
        }
    }

    fn sample_at(
        &self,
        vertex: usize,
        distance: &impl Fn(DVec3) -> f64,
    ) -> Result<(Side, f64), MeshingError> {
        let at = self.lattice.coordinates(vertex);
        let position = self.lattice.position(at);
        let value = distance(position);
        if !value.is_finite() {
            return Err(MeshingError::Lattice(format!(
                "the distance at {position} is {value}, it must be finite"
            )));
        }
        // Vertices in the outermost layer lack neighbors.
        let rim = (0..3).any(|axis| !(2..2 * self.lattice.limit(axis) - 2).contains(&at[axis]));
        if rim && value <= 0.0 {
            let message = format!(
                "the region reaches its rim at {position}, use a lattice with a cell to spare"
            );
            return Err(MeshingError::Lattice(message));
        }
        let side = match value {
            v if v < 0.0 => Side::Inside,
            v if v > 0.0 => Side::Outside,
            _ => Side::Surface,
        };
        Ok((side, value))
    }

    /// Locates the surface on every edge from an inside to an outside vertex.
    fn cut(&mut self, values: &[f64], distance: &(impl Fn(DVec3) -> f64 + Sync)) {
        self.near_indices = vec![NONE; self.sides.len()];
        let mut edges = Vec::new();
        for vertex in 0..self.sides.len() {
            let opposite = self.opposite_neighbors(vertex);
            if opposite == 0 {
                continue;
            }
            self.near_indices[vertex] = index(self.near.len());
            self.near.push(Near {
                vertex: index(vertex),
                opposite,
                moved: NONE,
                first: index(edges.len()),
            });
            if self.sides[vertex] == Side::Inside {
                edges.extend(directions(opposite).map(|direction| (index(vertex), direction)));
            }
        }
        self.cuts = edges
            .into_par_iter()
            .map(|(vertex, direction)| {
                let inside = vertex as usize;
                let outside = self.neighbor(inside, direction);
                let at = self.lattice.coordinates(inside);
                let ends = [at, add(at, NEIGHBORS[direction])].map(|at| self.lattice.position(at));
                root(ends, [values[inside], values[outside]], distance)
            })
            .collect();
    }

    /// Bit mask over [`NEIGHBORS`] of the neighbors on the opposite side of the surface.
    fn opposite_neighbors(&self, vertex: usize) -> u16 {
        let opposite = match self.sides[vertex] {
            Side::Inside => Side::Outside,
            Side::Outside => Side::Inside,
            Side::Surface => return 0,
        };
        let mut neighbors = 0;
        for (direction, &step) in self.steps[vertex % 2].iter().enumerate() {
            // Indices before the first and after the last vertex are outside, like the rim.
            let side = self.sides.get(vertex.wrapping_add_signed(step));
            neighbors |= u16::from(side == Some(&opposite)) << direction;
        }
        neighbors
    }

    /// Moves vertices onto cut points that are too close, one after another, and drops the cuts at their edges.
    fn warp(&mut self) {
        let long = self.lattice.spacing;
        let short = long * (0.75_f64).sqrt();
        for near_index in 0..self.near.len() {
            let Near {
                vertex, opposite, ..
            } = self.near[near_index];
            let vertex = vertex as usize;
            let at = self.lattice.coordinates(vertex);
            let position = self.lattice.position(at);
            let mut nearest = (f64::INFINITY, NONE);
            for direction in directions(opposite) {
                let neighbor = self.neighbor(vertex, direction);
                if self.sides[neighbor] == Side::Surface {
                    continue;
                }
                let cut = if self.sides[vertex] == Side::Inside {
                    self.cut_at(near_index, direction)
                } else {
                    self.cut_at(self.near_indices[neighbor] as usize, backward(direction))
                };
                let distance = self.cuts[cut].distance(position);
                let bound = if direction < 6 {
                    ALPHA_LONG * long
                } else {
                    ALPHA_SHORT * short
                };
                if distance < bound && distance < nearest.0 {
                    nearest = (distance, index(cut));
                }
            }
            if nearest.1 != NONE {
                self.near[near_index].moved = nearest.1;
                self.sides[vertex] = Side::Surface;
            }
        }
    }

    /// Index of the cut on the edge in a direction from the inside vertex with this index in `near`.
    fn cut_at(&self, near_index: usize, direction: usize) -> usize {
        let Near {
            opposite, first, ..
        } = self.near[near_index];
        let before = opposite & ((1 << direction) - 1);
        (first + before.count_ones()) as usize
    }

    fn neighbor(&self, vertex: usize, direction: usize) -> usize {
        vertex.wrapping_add_signed(self.steps[vertex % 2][direction])
    }

    /// Merges cells inside, up to `levels` times. All lattice tets at them are uncut and have no moved vertices.
    pub(super) fn coarsen(&mut self, levels: u32) {
        let cells = self.lattice.cells;
        self.merged_cells = MergedCells::new(cells, levels, |cell| {
            [2 * cell, 2 * cell + 1].map(|vertex| self.sides[vertex] == Side::Inside) == [true; 2]
        });
    }

    /// Number of tets that [`extract`](Self::extract) makes.
    pub(super) fn tet_count(&self) -> usize {
        let mut count = 0;
        self.fill_all(|_| count += 1);
        count
    }

    /// Creates the mesh; `tets` is its number of tets.
    pub(super) fn extract(&self, tets: usize) -> TetMesh {
        let mut output = Output {
            mesh: TetMesh {
                positions: Vec::new(),
                tets: Vec::with_capacity(tets),
            },
            vertices: vec![NONE; self.sides.len()],
            cuts: vec![NONE; self.cuts.len()],
        };
        self.fill_all(|nodes| output.push(self, nodes));
        output.mesh
    }

    /// Fills all lattice tets: four around each face between two cells.
    fn fill_all(&self, mut emit: impl FnMut([Node; 4])) {
        /// Corners of a face across an axis, counterclockwise, relative to the center below the face.
        const RING: [[i32; 2]; 4] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
        // Index steps from a center to the next one along each axis, and to the corners of the face between them.
        let ways = [0, 1, 2].map(|axis| {
            let corners = RING.map(|[u, v]| {
                let mut to = [1; 3];
                to[(axis + 1) % 3] = u;
                to[(axis + 2) % 3] = v;
                6 + (0..3).map(|a| usize::from(to[a] > 0) << a).sum::<usize>()
            });
            (2 * axis + 1, corners)
        });
        let [nx, ny, nz] = self.lattice.cells;
        // The faces of the last cells along each axis are outside.
        let cells = (0..nz.saturating_sub(1)).flat_map(|z| {
            (0..ny.saturating_sub(1))
                .flat_map(move |y| (0..nx.saturating_sub(1)).map(move |x| x + nx * (y + ny * z)))
        });
        for cell in cells {
            let center = 2 * cell + 1;
            for (next, corners) in ways {
                let above = self.neighbor(center, next);
                if self.merged_cells.is_merged(cell) || self.merged_cells.is_merged(above / 2) {
                    continue;
                }
                let ring = corners.map(|way| self.neighbor(center, way));
                let inside = |&vertex: &usize| self.sides[vertex] == Side::Inside;
                if ![center, above].iter().chain(&ring).any(inside) {
                    continue;
                }
                let at = self.lattice.coordinates(center);
                let corner = |way: usize, vertex| self.corner(add(at, NEIGHBORS[way]), vertex);
                let [below, above] = [self.corner(at, center), corner(next, above)];
                for i in 0..4 {
                    let [p, q] = [i, (i + 1) % 4].map(|i| corner(corners[i], ring[i]));
                    fill([below, above, p, q], &mut emit);
                }
            }
        }
        self.merged_cells.fill(|tet| {
            emit(tet.map(|at| Node::Vertex(self.corner(at, self.vertex(at)))));
        });
    }

    /// Index of a vertex.
    #[expect(clippy::cast_sign_loss, reason = "callers stay inside the lattice")]
    fn vertex(&self, at: [i32; 3]) -> usize {
        let [nx, ny, _] = self.lattice.cells;
        let [x, y, z] = at.map(|c| (c / 2) as usize);
        2 * (x + nx * (y + ny * z)) + (at[0] & 1) as usize
    }

    fn corner(&self, at: [i32; 3], vertex: usize) -> Corner {
        Corner {
            vertex,
            at,
            side: self.sides[vertex],
        }
    }
}

/// Mesh under construction, with the particles already made for lattice vertices and cuts.
struct Output {
    mesh: TetMesh,
    vertices: Vec<u32>,
    cuts: Vec<u32>,
}

impl Output {
    fn push(&mut self, grid: &Grid, nodes: [Node; 4]) {
        let mut tet = nodes.map(|node| self.particle(grid, node));
        if signed_volume(tet.map(|p| self.mesh.positions[p.index()])) < 0.0 {
            tet.swap(2, 3);
        }
        self.mesh.tets.push(tet);
    }

    fn particle(&mut self, grid: &Grid, node: Node) -> ParticleId {
        let (entry, position) = match node {
            Node::Vertex(corner) => {
                let moved = match grid.near_indices[corner.vertex] {
                    NONE => NONE,
                    near_index => grid.near[near_index as usize].moved,
                };
                let position = match moved {
                    NONE => grid.lattice.position(corner.at),
                    cut => grid.cuts[cut as usize],
                };
                (&mut self.vertices[corner.vertex], position)
            }
            Node::Cut(inside, outside) => {
                let near_index = grid.near_indices[inside.vertex] as usize;
                let cut = grid.cut_at(near_index, direction(inside, outside));
                (&mut self.cuts[cut], grid.cuts[cut])
            }
        };
        if *entry == NONE {
            *entry = index(self.mesh.positions.len());
            self.mesh.positions.push(position);
        }
        ParticleId(*entry)
    }
}

#[cfg(test)]
mod tests;
