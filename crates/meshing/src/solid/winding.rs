//! The winding number of a surface around a point, without error.
//!
//! A ray runs from the point along +x. Each triangle that it leaves the surface through counts 1, each that it enters
//! through -1. Whether it meets a triangle is a question of three orientations in the yz plane, whether it does so
//! ahead of the point one of an orientation in space; both come from exact predicates. Where the ray meets an edge or a
//! corner, it is taken as moved by an infinitely small step along y, and by a much smaller one along z, so that it
//! passes through exactly one of the triangles there (simulation of simplicity).
//!
//! Source: J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997
//! (the predicates, from the crate `robust`); H. Edelsbrunner and E. Mücke, "Simulation of Simplicity", 1990. Cost:
//! O(log n) and the triangles whose boxes the ray meets.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::tree::Tree;

/// How often the triangles wind around a point.
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

/// 1 if the ray from a point leaves through the triangle, -1 if it enters through it, 0 if it misses it.
fn crossing(triangle: &[DVec3; 3], point: DVec3) -> i32 {
    let [a, b, c] = *triangle;
    let side = side_in_plane(a, b, point);
    if side == 0 || side != side_in_plane(b, c, point) || side != side_in_plane(c, a, point) {
        return 0;
    }
    // Positive where the point lies below the triangle as seen from where it is counterclockwise. A triangle that is
    // counterclockwise in the yz plane is so seen from +x: then below means that it is ahead.
    let below = orient3d(spatial(a), spatial(b), spatial(c), spatial(point));
    let ahead = if side > 0 { below > 0.0 } else { below < 0.0 };
    if ahead { side } else { 0 }
}

/// On which side of the edge the moved ray passes, seen along -x: 1 on the left, -1 on the right, 0 for an edge along
/// x.
fn side_in_plane(from: DVec3, to: DVec3, point: DVec3) -> i32 {
    let sign = |x: f64| i32::from(x > 0.0) - i32::from(x < 0.0);
    let exact = orient2d(planar(from), planar(to), planar(point));
    // How the orientation changes with the two steps.
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
