//! [`closest_on_triangle`]: the point of a triangle closest to another point, and on which part of the triangle it lies.
//!
//! Source: C. Ericson 2005, Real-Time Collision Detection, section 5.1.5, which divides space into the seven regions
//! that belong to the corners, the sides and the face. Cost: a few dozen operations.

use glam::DVec3;

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrianglePart {
    /// Inside.
    Face,
    /// On the side from the corner of this number to the next one, ends excluded.
    Side(u8),
    /// The corner of this number.
    Corner(u8),
}

/// The point of a triangle closest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// The point.
    pub point: DVec3,
    /// Its weights: the point is their sum over the corners, up to rounding. They lie in 0..=1 and add up to 1.
    pub weights: [f64; 3],
    /// The part of the triangle that it lies on.
    pub part: TrianglePart,
}

/// The point of the triangle `corners` closest to `x`; for finite input it is finite, also where the triangle has no
/// area.
///
/// # Example
/// ```
/// use incise_mesh::{TrianglePart, closest_on_triangle, glam::DVec3};
///
/// let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
/// let closest = closest_on_triangle(triangle, DVec3::new(0.5, -2.0, 1.0));
/// assert_eq!(closest.part, TrianglePart::Side(0));
/// assert_eq!(closest.point, DVec3::new(0.5, 0.0, 0.0));
/// assert_eq!(closest.weights, [0.5, 0.5, 0.0]);
/// ```
#[must_use]
#[inline]
pub fn closest_on_triangle([a, b, c]: [DVec3; 3], x: DVec3) -> ClosestPoint {
    let (ab, ac) = (b - a, c - a);
    let along = |from: DVec3| (ab.dot(x - from), ac.dot(x - from));
    let ((a1, a2), (b1, b2), (c1, c2)) = (along(a), along(b), along(c));
    if a1 <= 0.0 && a2 <= 0.0 {
        return at_corner(a, 0);
    }
    if b1 >= 0.0 && b2 <= b1 {
        return at_corner(b, 1);
    }
    if c2 >= 0.0 && c1 <= c2 {
        return at_corner(c, 2);
    }
    if is_flat(ab, ac) {
        return closest_on_sides([a, b, c], x);
    }
    let on_ab = a1 * b2 - b1 * a2;
    if on_ab <= 0.0 && a1 >= 0.0 && b1 <= 0.0 {
        let t = a1 / (a1 - b1);
        return ClosestPoint {
            point: a + ab * t,
            weights: [1.0 - t, t, 0.0],
            part: TrianglePart::Side(0),
        };
    }
    let on_ac = c1 * a2 - a1 * c2;
    if on_ac <= 0.0 && a2 >= 0.0 && c2 <= 0.0 {
        let t = a2 / (a2 - c2);
        return ClosestPoint {
            point: a + ac * t,
            weights: [1.0 - t, 0.0, t],
            part: TrianglePart::Side(2),
        };
    }
    let on_bc = b1 * c2 - c1 * b2;
    let (from_b, from_c) = (b2 - b1, c1 - c2);
    if on_bc <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        let t = from_b / (from_b + from_c);
        return ClosestPoint {
            point: b + (c - b) * t,
            weights: [0.0, 1.0 - t, t],
            part: TrianglePart::Side(1),
        };
    }
    let whole = on_ab + on_ac + on_bc;
    let (second, third) = (on_ac / whole, on_ab / whole);
    ClosestPoint {
        point: a + ab * second + ac * third,
        weights: [1.0 - second - third, second, third],
        part: TrianglePart::Face,
    }
}

/// Whether a triangle has no area beyond rounding.
#[inline]
fn is_flat(ab: DVec3, ac: DVec3) -> bool {
    const SINE: f64 = 1e-12;
    let area = ab.cross(ac).length_squared();
    area <= SINE * SINE * ab.length_squared() * ac.length_squared()
}

/// The closest point of the sides alone.
#[cold]
fn closest_on_sides(corners: [DVec3; 3], x: DVec3) -> ClosestPoint {
    let mut nearest = at_corner(corners[0], 0);
    for (k, side) in [0, 1, 2].into_iter().zip(0..) {
        let next = (k + 1) % 3;
        let along = corners[next] - corners[k];
        let t = (x - corners[k]).dot(along) / along.length_squared();
        let closest = if t >= 1.0 {
            at_corner(corners[next], [0, 1, 2][next])
        } else if t > 0.0 {
            let mut weights = [0.0; 3];
            (weights[k], weights[next]) = (1.0 - t, t);
            ClosestPoint {
                point: corners[k] + along * t,
                weights,
                part: TrianglePart::Side(side),
            }
        } else {
            at_corner(corners[k], side)
        };
        if closest.point.distance_squared(x) < nearest.point.distance_squared(x) {
            nearest = closest;
        }
    }
    nearest
}

fn at_corner(point: DVec3, corner: u8) -> ClosestPoint {
    let mut weights = [0.0; 3];
    weights[usize::from(corner)] = 1.0;
    ClosestPoint {
        point,
        weights,
        part: TrianglePart::Corner(corner),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least distance over a fine grid of points of the triangle.
    fn sampled([a, b, c]: [DVec3; 3], x: DVec3) -> f64 {
        let grid = (0..=100).flat_map(|u| (0..=100 - u).map(move |v| (u, v)));
        grid.map(|(u, v)| {
            let at = a + (b - a) * (f64::from(u) * 0.01) + (c - a) * (f64::from(v) * 0.01);
            at.distance(x)
        })
        .fold(f64::INFINITY, f64::min)
    }

    fn triangles() -> Vec<[DVec3; 3]> {
        let (a, b, c) = (
            DVec3::new(0.1, 0.0, 0.2),
            DVec3::new(1.0, 0.3, -0.1),
            DVec3::new(0.2, 0.9, 0.3),
        );
        let line = DVec3::new(0.3, 0.1, -0.1);
        vec![
            [a, b, c],
            [b, a, c],
            [a, a + line, a + line * 2.5], // without area
            [a, a + line * 2.5, a + line],
            [a, a, b],
            [a, b, b],
            [a, b, a],
            [a, a, a],
        ]
    }

    #[test]
    fn against_a_fine_sampling() {
        let mut parts = [0; 3];
        for corners in triangles() {
            for i in 0..1000 {
                let cell = [i % 10, i / 10 % 10, i / 100].map(|k| f64::from(k) * 0.3 - 1.0);
                let x = DVec3::from_array(cell);
                let closest = closest_on_triangle(corners, x);
                let distance = closest.point.distance(x);
                let sampled = sampled(corners, x);
                // Samples are 0.01 apart along sides of length one.
                assert!(distance <= sampled + 1e-12 && sampled <= distance + 0.01);
                let weights = closest.weights;
                assert!(weights.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)));
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                let weighted: DVec3 = weights.iter().zip(corners).map(|(w, c)| c * *w).sum();
                assert!(weighted.distance(closest.point) < 1e-12);
                match closest.part {
                    TrianglePart::Face => parts[0] += 1,
                    TrianglePart::Side(_) => parts[1] += 1,
                    TrianglePart::Corner(_) => parts[2] += 1,
                }
            }
        }
        assert!(parts.iter().all(|&count| count > 20), "{parts:?}");
    }

    #[test]
    fn points_of_the_triangle_are_their_own_closest() {
        for [a, b, c] in triangles().into_iter().take(2) {
            let corners = [a, b, c];
            for (k, corner) in (0..).zip(corners) {
                let closest = closest_on_triangle(corners, corner);
                assert_eq!(
                    (closest.part, closest.point),
                    (TrianglePart::Corner(k), corner)
                );
            }
            for (k, [from, to]) in [[a, b], [b, c], [c, a]].into_iter().enumerate() {
                let middle = from.midpoint(to);
                let outward = (to - from).cross((b - a).cross(c - a));
                let closest = closest_on_triangle(corners, middle + outward);
                assert_eq!(closest.part, TrianglePart::Side([0, 1, 2][k]));
                assert!(closest.point.distance(middle) < 1e-15);
            }
            let center = (a + b + c) / 3.0;
            let closest = closest_on_triangle(corners, center);
            assert_eq!(closest.part, TrianglePart::Face);
            assert!(closest.point.distance(center) < 1e-15);
        }
    }
}
