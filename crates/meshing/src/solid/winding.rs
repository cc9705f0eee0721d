//! Exact winding number of a surface around a point.
//!
//! A ray runs from the point along +x. Each triangle through which it leaves the surface counts 1, each through which
//! it enters counts -1. Three orientations in the yz plane decide if the ray's line hits a triangle, and one
//! orientation in space decides if the hit is ahead of the point; both come from exact predicates. Where the ray hits
//! an edge or a corner, it is perturbed by an infinitely small step along y, and by a much smaller one along z, so that
//! it passes through exactly one of the triangles there (simulation of simplicity).
//!
//! Source: J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997
//! (the predicates, from the crate `robust`); H. Edelsbrunner and E. Mücke, "Simulation of Simplicity", 1990. Cost:
//! O(log n) and the triangles whose boxes the ray meets.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::tree::Tree;

/// Winding number of the triangles around a point.
pub(super) fn winding_number(tree: &Tree, point: DVec3) -> i32 {
    let mut winding = 0;
    tree.visit(
        |bounds| {
            bounds.high.x >= point.x
                && bounds.low.y <= point.y
                && point.y <= bounds.high.y
                && bounds.low.z <= point.z
                && point.z <= bounds.high.z
        },
        |triangle| winding += crossing(triangle, point),
    );
    winding
}

/// Returns 1 if the ray from a point leaves through the triangle, -1 if it enters through it, 0 if it misses it.
fn crossing(triangle: &[DVec3; 3], point: DVec3) -> i32 {
    let [a, b, c] = *triangle;
    let side = side_in_plane(a, b, point);
    if side == 0 || side != side_in_plane(b, c, point) || side != side_in_plane(c, a, point) {
        return 0;
    }
    // Positive if the point lies below the triangle, seen from where it is counterclockwise. A triangle that is
    // counterclockwise in the yz plane is seen from +x: below then means ahead of the point.
    let below = orient3d(spatial(a), spatial(b), spatial(c), spatial(point));
    let ahead = if side > 0 { below > 0.0 } else { below < 0.0 };
    if ahead { side } else { 0 }
}

/// Side of the edge on which the perturbed ray passes, seen along -x: 1 on the left, -1 on the right, 0 for an edge
/// along x.
fn side_in_plane(from: DVec3, to: DVec3, point: DVec3) -> i32 {
    let sign = |x: f64| i32::from(x > 0.0) - i32::from(x < 0.0);
    let exact = orient2d(planar(from), planar(to), planar(point));
    // Change of the orientation by the two perturbation steps.
    [exact, from.z - to.z, to.y - from.y]
        .into_iter()
        .map(sign)
        .find(|&side| side != 0)
        .unwrap_or(0)
}

fn planar(p: DVec3) -> Coord<f64> {
    Coord { x: p.y, y: p.z }
}

fn spatial(p: DVec3) -> Coord3D<f64> {
    Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}
