//! Points for an irregular mesh: Poisson disk samples on the surface of a solid, jittered lattice points inside.
//!
//! Surface points come from dense random candidates near the surface. Newton steps along the gradient move them onto
//! it; a candidate is accepted, in random order, if it keeps a minimum distance from the accepted points (maximal
//! Poisson disk sampling: no gap is larger than the distance). Candidates on edges and corners are first, so that these
//! stay sharp. Inside, the vertices of a body-centered cubic lattice are moved at random.
//!
//! Source: Delaunay meshing of jittered lattices is folklore; for the surface M. S. Ebeida and others, "Efficient
//! maximal Poisson-disk sampling", 2011. Cost: linear in the volume over the cube of the spacing, some thirty distance
//! evaluations per point.

use glam::DVec3;

use crate::index::index;
use crate::random::{hash, in_cube};
use crate::{Lattice, MeshingError, Shape};

/// No entry in a list.
const NONE: u32 = u32::MAX;
/// Largest move of a lattice point along each axis, in spacings.
const JITTER: f64 = 0.33;
/// Smallest distance between surface points, in spacings.
const APART: f64 = 0.65;
/// Smallest distance of inner points from the surface, and from its points, in spacings.
const DEPTH: f64 = 0.4;
const FROM_SURFACE_POINTS: f64 = 0.6;
/// Candidates for surface points per spacing.
const CANDIDATES: f64 = 3.0;

/// Samples points of `shape` for a body-centered cubic lattice with cells of side `spacing`.
pub(super) fn sample(shape: Shape, spacing: f64, seed: u64) -> Result<Vec<DVec3>, MeshingError> {
    let half = shape.half_extent();
    let low = -half - 2.0 * spacing;
    let mut near = Grid::new(low, -low, spacing);
    for p in candidates(shape, spacing, seed)? {
        if !near.has_within(p, APART * spacing) {
            near.push(p);
        }
    }
    let lattice = Lattice::covering(-half, half, spacing, in_cube(seed, 0))?;
    let mut points = Vec::new();
    let [nx, ny, nz] = lattice.cells;
    for vertex in 0..2 * nx * ny * nz {
        let cell = vertex / 2;
        let at = [cell % nx, cell / nx % ny, cell / nx / ny].map(|c| c as f64);
        let center = 0.5 * (vertex % 2) as f64;
        let jitter = JITTER * in_cube(seed.wrapping_add(1), vertex as u64);
        let p = lattice.origin + spacing * (DVec3::from_array(at) + center + jitter);
        if is_deep(shape, p, DEPTH * spacing) && !near.has_within(p, FROM_SURFACE_POINTS * spacing)
        {
            points.push(p);
        }
    }
    near.points.append(&mut points);
    Ok(near.points)
}

/// Random points on the surface, several per spacing: corners first, then edges, then the rest, each in random order.
fn candidates(shape: Shape, spacing: f64, seed: u64) -> Result<Vec<DVec3>, MeshingError> {
    let half = shape.half_extent();
    let fine = spacing / CANDIDATES;
    let lattice = Lattice::covering(-half, half, fine, DVec3::ZERO)?;
    let [nx, ny, nz] = lattice.cells;
    let mut found = Vec::new();
    for cell in 0..nx * ny * nz {
        let at = DVec3::from_array([cell % nx, cell / nx % ny, cell / nx / ny].map(|c| c as f64));
        let p = lattice.origin + fine * (at + 0.5 * in_cube(seed.wrapping_add(2), cell as u64));
        if shape.signed_distance(p).abs() < 2.5 * fine
            && let Some(p) = project(shape, p, spacing)
        {
            let random = hash(seed.wrapping_add(3), cell as u64);
            found.push((smoothness(shape, p), random, p));
        }
    }
    found.sort_unstable_by_key(|&(smooth, random, _)| (smooth, random));
    Ok(found.into_iter().map(|(_, _, p)| p).collect())
}

/// Projects a point onto the surface; `None` if it is farther than `reach` or the iteration fails.
pub(super) fn project(shape: Shape, from: DVec3, reach: f64) -> Option<DVec3> {
    let mut p = from;
    for _ in 0..12 {
        let distance = shape.signed_distance(p);
        if distance.abs() < 1e-9 {
            return (p.distance(from) <= reach).then_some(p);
        }
        let slope = gradient(shape, p);
        p -= distance * slope / slope.length_squared().max(1e-2);
    }
    None
}

/// True if a point lies inside by more than `depth`, to first order.
fn is_deep(shape: Shape, p: DVec3, depth: f64) -> bool {
    let distance = shape.signed_distance(p);
    // The distance functions of shapes are never steeper than the true distance.
    distance <= -depth || distance < 0.0 && distance < -depth * gradient(shape, p).length()
}

fn gradient(shape: Shape, p: DVec3) -> DVec3 {
    const STEP: f64 = 1e-6;
    let along = |axis: DVec3| {
        let step = STEP * axis;
        (shape.signed_distance(p + step) - shape.signed_distance(p - step)) / (2.0 * STEP)
    };
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

/// Class of a surface point: 0 at a corner, 1 at an edge, 2 elsewhere. Outside a sharp edge the distance changes faster
/// than inside.
fn smoothness(shape: Shape, p: DVec3) -> u8 {
    let step = 1e-5 * gradient(shape, p).normalize_or_zero();
    let [outside, inside] = [p + step, p - step].map(|p| shape.signed_distance(p).abs());
    // 1, √(1/2) and √(1/3) on a side, an edge and a corner of a box.
    match inside / outside.max(1e-9) {
        ratio if ratio < 0.64 => 0,
        ratio if ratio < 0.9 => 1,
        _ => 2,
    }
}

/// Grid of cubic cells for neighbor search.
struct Grid {
    low: DVec3,
    side: f64,
    cells: [usize; 3],
    /// Last point of each cell; for each point the previous one in its cell.
    last: Vec<u32>,
    before: Vec<u32>,
    points: Vec<DVec3>,
}

impl Grid {
    fn new(low: DVec3, high: DVec3, side: f64) -> Self {
        let mut grid = Self {
            low,
            side,
            cells: [usize::MAX; 3],
            last: Vec::new(),
            before: Vec::new(),
            points: Vec::new(),
        };
        grid.cells = grid.cell(high).map(|cell| cell + 1);
        grid.last = vec![NONE; grid.cells.iter().product()];
        grid
    }

    fn cell(&self, p: DVec3) -> [usize; 3] {
        let at = ((p - self.low) / self.side).to_array();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "kept within the grid"
        )]
        std::array::from_fn(|axis| (at[axis].max(0.0) as usize).min(self.cells[axis] - 1))
    }

    fn push(&mut self, p: DVec3) {
        let [i, j, k] = self.cell(p);
        let cell = i + self.cells[0] * (j + self.cells[1] * k);
        self.before.push(self.last[cell]);
        self.last[cell] = index(self.points.len());
        self.points.push(p);
    }

    /// True if there is a point nearer than `distance`.
    fn has_within(&self, p: DVec3, distance: f64) -> bool {
        let [low, high] = [p - distance, p + distance].map(|p| self.cell(p));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    let mut point = self.last[i + self.cells[0] * (j + self.cells[1] * k)];
                    while point != NONE {
                        if self.points[point as usize].distance(p) < distance {
                            return true;
                        }
                        point = self.before[point as usize];
                    }
                }
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_points_are_on_the_surface_and_apart_without_gaps() {
        for shape in Shape::ALL {
            let spacing = 0.1;
            let points = sample(shape, spacing, 5).expect("a lattice");
            let on = |p: DVec3| shape.signed_distance(p).abs() < 1e-8;
            let surface: Vec<DVec3> = points.iter().copied().filter(|&p| on(p)).collect();
            for (n, p) in surface.iter().enumerate() {
                assert!(
                    surface[..n]
                        .iter()
                        .all(|q| q.distance(*p) >= APART * spacing)
                );
            }
            for p in &points[surface.len()..] {
                assert!(shape.signed_distance(*p) < 0.0);
                let near = FROM_SURFACE_POINTS * spacing;
                assert!(surface.iter().all(|q| q.distance(*p) >= near));
            }
            // Every other surface point has a sample nearby; candidates are a third of a spacing apart.
            for n in 0..500 {
                let from = in_cube(9, n) * shape.half_extent();
                if let Some(p) = project(shape, from, 1.0) {
                    let nearest = surface.iter().map(|q| q.distance(p)).fold(1.0, f64::min);
                    assert!(nearest < (APART + 0.5) * spacing, "{shape}: {nearest}");
                }
            }
        }
    }

    #[test]
    fn corners_are_kept() {
        let points = sample(Shape::Box, 0.2, 1).expect("a lattice");
        for corner in 0..8 {
            let side = |axis: u32| f64::from(corner >> axis & 1) - 0.5;
            let corner = DVec3::new(side(0), side(1), side(2));
            assert!(points.iter().any(|p| p.distance(corner) < 1e-6), "{corner}");
        }
    }
}
