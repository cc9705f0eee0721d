//! Distance from a point to the nearest triangle of a tree.
//!
//! Source: C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5 (the nearest point of a triangle by the
//! regions of its corners and edges). Cost: usually O(log n); O(n) for points equally far from many triangles.

use std::cell::Cell;

use glam::DVec3;

use super::tree::Tree;

/// Distance to the nearest triangle, or `reach` if none is nearer.
pub(super) fn distance_within(tree: &Tree, point: DVec3, reach: f64) -> f64 {
    tree.nearest(point, reach * reach, |_, t| distance_squared(t, point))
        .sqrt()
}

/// Index in the tree of a nearest triangle: of equally near ones the first that the search meets.
pub(super) fn nearest_triangle(tree: &Tree, point: DVec3) -> usize {
    let nearest = Cell::new((f64::INFINITY, 0));
    tree.nearest(point, f64::INFINITY, |t, corners| {
        let distance = distance_squared(corners, point);
        if distance < nearest.get().0 {
            nearest.set((distance, t));
        }
        distance
    });
    nearest.get().1
}

/// Squared distance from a point to a triangle, which may be degenerate.
fn distance_squared(&[a, b, c]: &[DVec3; 3], point: DVec3) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    if area > 0.0 {
        // Barycentric coordinates of the projected point, times the area.
        let v = ap.cross(ac).dot(normal);
        let w = ab.cross(ap).dot(normal);
        if v >= 0.0 && w >= 0.0 && v + w <= area {
            let height = ap.dot(normal);
            return height * height / area;
        }
    }
    [(a, b), (b, c), (c, a)]
        .map(|(from, to)| to_segment(from, to, point))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

// Without this, inlining varies with unrelated changes, and a call is significant in the cost of `tetrahedralize`.
#[inline(always)]
fn to_segment(from: DVec3, to: DVec3, point: DVec3) -> f64 {
    let along = to - from;
    let length = along.length_squared();
    let t = if length > 0.0 {
        ((point - from).dot(along) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (from + t * along).distance_squared(point)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    #[test]
    fn regions_of_a_triangle() {
        let t = [DVec3::ZERO, dvec3(2.0, 0.0, 0.0), dvec3(0.0, 2.0, 0.0)];
        for (point, expected) in [
            (dvec3(0.5, 0.5, 3.0), 9.0),
            (dvec3(-1.0, -1.0, 0.0), 2.0),
            (dvec3(3.0, 0.0, 0.0), 1.0),
            (dvec3(1.0, -2.0, 1.0), 5.0),
            (dvec3(2.0, 2.0, 0.0), 2.0),
        ] {
            assert!(
                (distance_squared(&t, point) - expected).abs() < 1e-14,
                "{point}"
            );
        }
        let line = [DVec3::ZERO, dvec3(1.0, 0.0, 0.0), dvec3(3.0, 0.0, 0.0)];
        assert!((distance_squared(&line, dvec3(2.0, 1.0, 0.0)) - 1.0).abs() < 1e-15);
    }
}
