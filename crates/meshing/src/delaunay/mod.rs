//! Delaunay tetrahedralization of points, with exact signs.
//!
//! Points are inserted one by one (Bowyer 1981, Watson 1981; module `cells`) in rounds along a space-filling curve
//! (module `order`). Expected cost: O(n log n) for evenly distributed points; the output, and so the cost, is quadratic
//! for the worst point sets, such as two skew lines.
//!
//! An implementation of our own: of the available crates, `simple_delaunay_lib` does not document its handling of
//! degenerate points, `rita` builds a C++ library, and `delaunay`, for any dimension, has more than fifty dependencies.

mod cells;
mod order;

use glam::DVec3;
use robust::{Coord, orient2d};

use self::cells::Cells;
pub(super) use self::order::morton_keys;
use crate::MeshingError;
use incise_mesh::{ParticleId, TetMesh, orientation};

/// Computes the Delaunay tetrahedralization of `points` (meters): tets that fill their convex hull, with no point
/// strictly inside the circumsphere of any.
///
/// The particles are the points in the given order. Of equal points exactly one is used by tets. All other points are
/// used, and no tet is flat. Where more than four points lie on an empty sphere, several results are valid; the
/// returned one depends only on the points and their order, not on the platform.
///
/// Signs are exact as long as the smallest nonzero difference of two coordinates is at least about 1e-60 of the largest
/// coordinate, at any scale.
///
/// # Errors
/// [`MeshingError::Points`] if a coordinate is not finite, or all points lie in one plane; fewer than four always do.
///
/// # Panics
/// From 2³⁰ tets on.
///
/// # Example
/// ```
/// use incise_meshing::delaunay;
/// use incise_mesh::glam::{DVec3, dvec3};
///
/// let corners = (0..8).map(|i| dvec3((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64));
/// let mesh = delaunay(&corners.chain([DVec3::splat(0.5)]).collect::<Vec<_>>())?;
/// mesh.check()?;
/// assert_eq!(mesh.tets.len(), 12); // two on each side of the cube, around its center
/// assert!((mesh.total_volume() - 1.0).abs() < 1e-14);
/// assert!(delaunay(&[DVec3::ZERO, DVec3::X, DVec3::Y]).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn delaunay(points: &[DVec3]) -> Result<TetMesh, MeshingError> {
    if let Some(bad) = points.iter().position(|p| !p.is_finite()) {
        let message = format!("point {bad} is {}, give finite ones", points[bad]);
        return Err(MeshingError::Points(message));
    }
    let scaled = scaled(points);
    let order = order::insertion_order(&scaled);
    let first = first_tet(&scaled, &order).ok_or_else(|| flat(points))?;
    let mut cells = Cells::new(&scaled, first);
    for point in order {
        if !first.contains(&point) {
            cells.insert(point);
        }
    }
    let tets = cells.into_tets();
    Ok(TetMesh {
        positions: points.to_vec(),
        tets: tets.into_iter().map(|tet| tet.map(ParticleId)).collect(),
    })
}

fn flat(points: &[DVec3]) -> MeshingError {
    MeshingError::Points(format!(
        "the {} points lie in one plane, give four that do not",
        points.len()
    ))
}

/// Multiplies the points by the power of two that brings them near 1. This is exact and prevents overflow and underflow
/// of products.
fn scaled(points: &[DVec3]) -> Vec<DVec3> {
    let largest = points.iter().fold(0.0, |m, p| p.abs().max_element().max(m));
    // Exponent bits of 1/2^e from those of 2^e, clamped to normal numbers.
    let exponent = largest.to_bits() >> 52;
    let scale = f64::from_bits((2046 - exponent).max(1) << 52);
    points.iter().map(|&p| p * scale).collect()
}

/// First four points in the order that form a tet, oriented to a positive volume.
fn first_tet(points: &[DVec3], order: &[u32]) -> Option<[u32; 4]> {
    let at = |point: u32| points[point as usize];
    let mut rest = order.iter().copied();
    let a = rest.next()?;
    let b = rest.find(|&b| at(b) != at(a))?;
    let c = rest.find(|&c| !are_collinear(at(a), at(b), at(c)))?;
    let d = rest.find(|&d| orientation([a, b, c, d].map(at)) != 0.0)?;
    Some(if orientation([a, b, c, d].map(at)) > 0.0 {
        [a, b, c, d]
    } else {
        [a, b, d, c]
    })
}

/// True if three points lie on a line: their projections along all axes are collinear.
fn are_collinear(a: DVec3, b: DVec3, c: DVec3) -> bool {
    (0..3).all(|axis| {
        let shadow = |p: DVec3| Coord {
            x: p[(axis + 1) % 3],
            y: p[(axis + 2) % 3],
        };
        orient2d(shadow(a), shadow(b), shadow(c)) == 0.0
    })
}

#[cfg(test)]
mod tests;
