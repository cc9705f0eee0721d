//! The triangulation under construction: flat arrays of cells, and the insertion of one point.
//!
//! The outside is filled with ghost cells, one on each face of the hull, that share a vertex at infinity; a point
//! outside is then inserted like any other. A cell is in conflict with a new point strictly inside its circumsphere; a
//! ghost is in conflict with a point strictly beyond its hull face, or in the plane of the face and strictly inside its
//! circumcircle. The cells in conflict form a cavity that is star-shaped around the point; they are replaced by the
//! cone from the point over the cavity's boundary.
//!
//! Signs are exact, and points on a sphere count as outside. This equals a symbolic perturbation that raises each point
//! above the paraboloid by a much smaller amount than the next, and so is consistent. No flat cell ever arises: a point
//! in the plane of a boundary face is on one side of both its circumspheres.
//!
//! Sources: A. Bowyer and D. F. Watson (independently), 1981; ghosts as in J. R. Shewchuk, "Lecture Notes on Geometric
//! Robustness" and "Delaunay mesh generation", 2012. Cost of an insertion: linear in the length of the walk, O(k log k)
//! for a cavity of k faces.

use glam::DVec3;
use incise_mesh::orientation;
use robust::{Coord3D, insphere};

use crate::index::tet_index;

/// The vertex at infinity.
const GHOST: u32 = u32::MAX;
/// Marker in place of the first vertex of a removed cell.
const DEAD: u32 = u32::MAX - 1;

/// Delaunay triangulation of the points inserted so far.
pub(super) struct Cells<'a> {
    points: &'a [DVec3],
    /// Vertices of each cell; a ghost has positive orientation when its vertex at infinity is replaced by a point
    /// beyond its face.
    vertices: Vec<[u32; 4]>,
    /// Neighbors across the face opposite each vertex: four times the cell index plus the index of that cell's vertex
    /// opposite the face.
    neighbors: Vec<[u32; 4]>,
    /// Result of the last conflict test of each cell: twice the insertion number, plus one if in conflict.
    marks: Vec<u64>,
    free: Vec<u32>,
    /// Start of the next walk; a cell that is not a ghost.
    start: u32,
    insertions: u64,
    /// Buffers reused between insertions: the cells in conflict, the new cells, the sides between new cells.
    cavity: Vec<u32>,
    made: Vec<u32>,
    sides: Vec<(u64, u32)>,
}

impl<'a> Cells<'a> {
    /// Creates the triangulation of four points with a positive volume.
    pub(super) fn new(points: &'a [DVec3], first: [u32; 4]) -> Self {
        let mut cells = Self {
            points,
            vertices: vec![first],
            neighbors: vec![[0; 4]],
            marks: vec![0; 5],
            free: Vec::new(),
            start: 0,
            insertions: 0,
            cavity: Vec::new(),
            made: (0..5).collect(),
            sides: Vec::new(),
        };
        for opposite in 0..4 {
            // Seen from outside the first cell, its face has the opposite orientation.
            let mut ghost = first;
            ghost[opposite] = GHOST;
            ghost.swap((opposite + 1) % 4, (opposite + 2) % 4);
            cells.vertices.push(ghost);
            cells.neighbors.push([0; 4]);
            let own = (0..4).find(|&k| ghost[k] == GHOST).unwrap_or(opposite);
            cells.join(code(0, opposite), code(tet_index(opposite + 1), own));
        }
        for ghost in 1..5_u32 {
            for k in 0..4 {
                if cells.vertices[ghost as usize][k] != GHOST {
                    cells.note_side(ghost, k, GHOST);
                }
            }
        }
        cells.join_sides();
        cells
    }

    /// Inserts a point; returns false if another vertex has its position.
    pub(super) fn insert(&mut self, point: u32) -> bool {
        let p = self.points[point as usize];
        let Some(first) = self.locate(p) else {
            return false;
        };
        self.insertions += 1;
        let [tested, conflict] = [2 * self.insertions, 2 * self.insertions + 1];
        self.cavity.clear();
        self.made.clear();
        self.cavity.push(first);
        self.marks[first as usize] = conflict;
        let mut next = 0;
        while let Some(&cell) = self.cavity.get(next) {
            next += 1;
            for k in 0..4 {
                let across = self.neighbors[cell as usize][k];
                let other = across / 4;
                if self.marks[other as usize] < tested {
                    let inside = self.is_in_conflict(other, p);
                    self.marks[other as usize] = tested + u64::from(inside);
                    if inside {
                        self.cavity.push(other);
                    }
                }
                if self.marks[other as usize] == tested {
                    let mut vertices = self.vertices[cell as usize];
                    vertices[k] = point;
                    let new = self.push(vertices);
                    self.marks[new as usize] = tested;
                    self.join(code(new, k), across);
                    self.made.push(new);
                    for side in (0..4).filter(|&side| side != k) {
                        self.note_side(new, side, point);
                    }
                }
            }
        }
        self.join_sides();
        for cell in self.cavity.drain(..) {
            self.vertices[cell as usize][0] = DEAD;
            self.free.push(cell);
        }
        let real = self.made.iter().find(|&&cell| self.ghost(cell).is_none());
        self.start = *real.expect("each point of a hull with volume has a cell");
        true
    }

    /// Returns the cells that are not ghosts.
    pub(super) fn into_tets(self) -> Vec<[u32; 4]> {
        let mut tets = self.vertices;
        tets.retain(|tet| tet[0] != DEAD && !tet.contains(&GHOST));
        tets
    }

    /// Finds a cell in conflict with the point; `None` if the point coincides with a vertex.
    ///
    /// The walk crosses any face that has the point strictly beyond it; it cannot cycle in a Delaunay triangulation (H.
    /// Edelsbrunner, "An acyclicity theorem for cell complexes", 1990).
    fn locate(&self, p: DVec3) -> Option<u32> {
        let mut cell = self.start;
        'walk: loop {
            let vertices = self.vertices[cell as usize];
            let corners = vertices.map(|v| self.points[v as usize]);
            for k in 0..4 {
                let mut seen = corners;
                seen[k] = p;
                if orientation(seen) < 0.0 {
                    cell = self.neighbors[cell as usize][k] / 4;
                    if self.ghost(cell).is_some() {
                        return Some(cell);
                    }
                    continue 'walk;
                }
            }
            return (!corners.contains(&p)).then_some(cell);
        }
    }

    fn is_in_conflict(&self, cell: u32, p: DVec3) -> bool {
        let vertices = self.vertices[cell as usize];
        let Some(ghost) = self.ghost(cell) else {
            return is_in_sphere(vertices.map(|v| self.points[v as usize]), p);
        };
        let corners: [DVec3; 4] = std::array::from_fn(|k| {
            if k == ghost {
                p
            } else {
                self.points[vertices[k] as usize]
            }
        });
        let beyond = orientation(corners);
        // In the plane of the face, the circumsphere behind it is the face's circumcircle.
        beyond > 0.0
            || beyond == 0.0 && self.is_in_conflict(self.neighbors[cell as usize][ghost] / 4, p)
    }

    /// Index of the vertex at infinity in a cell; `None` if the cell is not a ghost.
    fn ghost(&self, cell: u32) -> Option<usize> {
        let vertices = self.vertices[cell as usize];
        (0..4).find(|&k| vertices[k] == GHOST)
    }

    fn push(&mut self, vertices: [u32; 4]) -> u32 {
        if let Some(cell) = self.free.pop() {
            self.vertices[cell as usize] = vertices;
            return cell;
        }
        let cell = tet_index(self.vertices.len());
        self.vertices.push(vertices);
        self.neighbors.push([0; 4]);
        self.marks.push(0);
        cell
    }

    fn join(&mut self, a: u32, b: u32) {
        self.neighbors[a as usize / 4][a as usize % 4] = b;
        self.neighbors[b as usize / 4][b as usize % 4] = a;
    }

    /// Records a face that contains the apex, keyed by its other two vertices.
    fn note_side(&mut self, cell: u32, k: usize, apex: u32) {
        let mut edge = [0; 2];
        let mut filled = 0;
        for (j, &v) in self.vertices[cell as usize].iter().enumerate() {
            if j != k && v != apex {
                edge[filled] = u64::from(v);
                filled += 1;
            }
        }
        edge.sort_unstable();
        self.sides.push((edge[0] << 32 | edge[1], code(cell, k)));
    }

    /// Joins the recorded faces in pairs.
    fn join_sides(&mut self) {
        let mut sides = std::mem::take(&mut self.sides);
        sides.sort_unstable();
        for pair in sides.chunks_exact(2) {
            debug_assert_eq!(pair[0].0, pair[1].0, "the boundary of a cavity is closed");
            self.join(pair[0].1, pair[1].1);
        }
        sides.clear();
        self.sides = sides;
    }
}

/// True if a point lies strictly inside the circumsphere of a positively oriented tet.
pub(super) fn is_in_sphere(corners: [DVec3; 4], p: DVec3) -> bool {
    let [a, b, c, d, p] = [corners[0], corners[1], corners[2], corners[3], p].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    // The predicate has the opposite orientation convention.
    insphere(b, a, c, d, p) > 0.0
}

fn code(cell: u32, vertex: usize) -> u32 {
    4 * cell + tet_index(vertex)
}
