//! [`Closest`]: on which side of a surface of triangles a point lies, and how far from it.
//!
//! The closest point of the surface decides. Where it lies inside a triangle, the point is where that triangle's normal
//! points to or not. On a common side or corner of several, their normals may disagree; the one to ask is their sum,
//! weighted by the angles they take up there, which is right for every closed surface that does not cross itself.
//! Beyond the rim of an open one, the surface counts as continued straight on.
//!
//! Source: J. A. Bærentzen and H. Aanæs 2005 (the weights). Cost: O(log m + k) for
//! m triangles, k of them as close as the edges of the mesh are long.

use std::f64::consts::PI;

use glam::DVec3;
use incise_mesh::{Bounds, TrianglePart, closest_on_triangle};

use crate::tree::BoxTree;

/// Closest points this near each other, against the distance to them, are one point of several triangles.
const SAME_POINT: f64 = 1e-6;

/// The point of a triangle closest to `x`, and the angle that the triangle takes up around it: a full turn inside, half
/// of one on a side.
fn closest(corners: [DVec3; 3], x: DVec3) -> (DVec3, f64) {
    let closest = closest_on_triangle(corners, x);
    let angle = match closest.part {
        TrianglePart::Face => 2.0 * PI,
        TrianglePart::Side(_) => PI,
        TrianglePart::Corner(corner) => {
            let [at, next, last] = [0, 1, 2].map(|k| corners[(usize::from(corner) + k) % 3]);
            (next - at).angle_between(last - at)
        }
    };
    (closest.point, angle)
}

/// The closest point of a surface.
pub(crate) struct Closest {
    /// From the closest point to the point asked for.
    pub(crate) offset: DVec3,
    /// The weighted sum of the normals there.
    pub(crate) normal: DVec3,
}

impl Closest {
    /// `reach` is a guess at the distance. `None` where numbers overflow.
    pub(crate) fn new(
        tree: &BoxTree,
        corners: impl Fn(usize) -> [DVec3; 3],
        normal: impl Fn(usize) -> DVec3,
        x: DVec3,
        reach: f64,
    ) -> Option<Self> {
        let within = |distance: f64| {
            let found = tree.overlapping(Bounds {
                low: x - distance,
                high: x + distance,
            });
            let mut found: Vec<usize> = found.collect();
            // The tree has an order of its own.
            found.sort_unstable();
            let points = found.into_iter().map(|t| (closest(corners(t), x), t));
            points.collect::<Vec<_>>()
        };
        let nearest = |found: &[((DVec3, f64), usize)]| {
            let distances = found.iter().map(|((point, _), _)| point.distance(x));
            distances.fold(f64::INFINITY, f64::min)
        };
        let mut found = within(reach);
        let mut distance = nearest(&found);
        if distance > reach {
            // Nothing so near: not further than any triangle.
            distance = distance.min(closest(corners(0), x).0.distance(x));
            found = within(distance * (1.0 + SAME_POINT));
            distance = nearest(&found);
        }
        let mut points = found.iter().map(|((point, _), _)| *point);
        let point = points.find(|point| point.distance(x) <= distance)?;
        let same = found
            .iter()
            .filter(|((other, _), _)| other.distance(point) <= SAME_POINT * distance);
        Some(Self {
            offset: x - point,
            normal: same.map(|&((_, angle), t)| normal(t) * angle).sum(),
        })
    }

    /// Whether the point asked for lies where the normals point to. `None` on the surface or where normals cancel.
    pub(crate) fn side(&self) -> Option<bool> {
        let above = self.normal.dot(self.offset);
        (above != 0.0 && above.is_finite()).then_some(above > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a fine sampling of the triangle, all around it.
    #[test]
    fn the_closest_point() {
        let corners = [
            DVec3::new(0.1, 0.0, 0.2),
            DVec3::new(1.0, 0.3, -0.1),
            DVec3::new(0.2, 0.9, 0.3),
        ];
        let [a, b, c] = corners;
        let (mut inside, mut on_sides, mut at_corners) = (0, 0, 0);
        for i in 0..10 {
            for j in 0..10 {
                let x = DVec3::new(f64::from(i) * 0.3 - 1.0, f64::from(j) * 0.3 - 1.0, 0.4);
                let (point, angle) = closest(corners, x);
                let samples = (0..=100).flat_map(|u| (0..=100 - u).map(move |v| (u, v)));
                let sampled = samples
                    .map(|(u, v)| {
                        let at = a + (b - a) * f64::from(u) * 0.01 + (c - a) * f64::from(v) * 0.01;
                        at.distance(x)
                    })
                    .fold(f64::INFINITY, f64::min);
                let distance = point.distance(x);
                // Samples are 0.01 apart along sides of length one.
                assert!(distance <= sampled + 1e-12 && sampled <= distance + 0.01);
                match angle {
                    angle if angle > 1.5 * PI => inside += 1,
                    angle if angle > 0.9 * PI => on_sides += 1,
                    _ => at_corners += 1,
                }
            }
        }
        assert!(inside > 3 && on_sides > 3 && at_corners > 3);
    }
}
