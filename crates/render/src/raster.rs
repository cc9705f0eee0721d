//! [`clip`] and [`fill`]: clipping of triangles to the view volume, and the rows of pixels whose centers they cover.
//!
//! Without clipping, triangles behind a camera inside the scene would be drawn. A row starts at the first pixel center
//! on or right of one edge and ends before the first center on or right of the other. An edge is always walked from its
//! upper end, so triangles that share it cover each pixel center along it exactly once.
//!
//! Source: Sutherland and Hodgman 1974 for clipping; Pineda 1988 for the depth plane. Cost: O(rows) and a division per
//! triangle, an addition per pixel.

use std::ops::Range;

use glam::{Vec2, Vec3, Vec4};

/// Planes of the view volume: a point with positive products with all of them is inside. Depth is from 0 to w.
const PLANES: [Vec4; 6] = [
    Vec4::new(1.0, 0.0, 0.0, 1.0),
    Vec4::new(-1.0, 0.0, 0.0, 1.0),
    Vec4::new(0.0, 1.0, 0.0, 1.0),
    Vec4::new(0.0, -1.0, 0.0, 1.0),
    Vec4::new(0.0, 0.0, 1.0, 0.0),
    Vec4::new(0.0, 0.0, -1.0, 1.0),
];

/// Clips a triangle in clip coordinates to the view volume and passes the resulting triangles to `each`.
pub(crate) fn clip(corners: [Vec4; 3], mut each: impl FnMut([Vec4; 3])) {
    let beyond = |plane: &Vec4| corners.iter().any(|corner| plane.dot(*corner) < 0.0);
    let mut polygon = corners.to_vec();
    for plane in PLANES.iter().filter(|plane| beyond(plane)) {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &to) in polygon.iter().enumerate() {
            let from = polygon[(i + polygon.len() - 1) % polygon.len()];
            let [before, after] = [from, to].map(|corner| plane.dot(corner));
            if (before < 0.0) != (after < 0.0) {
                kept.push(from.lerp(to, before / (before - after)));
            }
            if after >= 0.0 {
                kept.push(to);
            }
        }
        polygon = kept;
        if polygon.len() < 3 {
            return;
        }
    }
    for i in 1..polygon.len() - 1 {
        each([polygon[0], polygon[i], polygon[i + 1]]);
    }
}

/// Row of pixels that a triangle covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) y: usize,
    /// First pixel, and the one after the last.
    pub(crate) start: usize,
    pub(crate) end: usize,
    /// Depth at the center of the first pixel, and its step per pixel.
    depth: f32,
    growth: f32,
}

impl Row {
    /// Depths at the centers of its pixels.
    pub(crate) fn depths(self) -> impl Iterator<Item = f32> {
        (0u16..).map(move |x| self.depth + f32::from(x) * self.growth)
    }
}

/// Rows among `rows` of the pixels below `width` whose center is inside a triangle, given in pixels from the upper left
/// and a depth.
pub(crate) fn fill(
    corners: [Vec3; 3],
    width: usize,
    rows: Range<usize>,
    mut each: impl FnMut(Row),
) {
    let [mut a, mut b, mut c] = corners;
    let above = |p: Vec3, q: Vec3| (p.y, p.x) <= (q.y, q.x);
    if !above(a, b) {
        (a, b) = (b, a);
    }
    if !above(b, c) {
        (b, c) = (c, b);
    }
    if !above(a, b) {
        (a, b) = (b, a);
    }
    let (ab, ac) = (b - a, c - a);
    let area = Vec2::new(ab.x, ab.y).perp_dot(Vec2::new(ac.x, ac.y));
    let growth = Vec2::new(ab.z * ac.y - ac.z * ab.y, ab.x * ac.z - ac.x * ab.z) / area;
    if !growth.is_finite() {
        return;
    }
    let x_at =
        |from: Vec3, to: Vec3, y: f32| from.x + (y - from.y) * ((to.x - from.x) / (to.y - from.y));
    for y in first_middle(a.y).max(rows.start)..first_middle(c.y).min(rows.end) {
        let middle = y as f32 + 0.5;
        let long = x_at(a, c, middle);
        let short = if middle < b.y {
            x_at(a, b, middle)
        } else {
            x_at(b, c, middle)
        };
        let start = first_middle(long.min(short));
        let end = first_middle(long.max(short)).min(width);
        if start < end {
            let along = Vec2::new(start as f32 + 0.5 - a.x, middle - a.y);
            each(Row {
                y,
                start,
                end,
                depth: a.z + growth.dot(along),
                growth: growth.x,
            });
        }
    }
}

/// First pixel whose center is at or beyond a coordinate.
fn first_middle(place: f32) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and below 0 is 0"
    )]
    let first = (place - 0.5).ceil() as usize;
    first
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIDE: usize = 24;

    fn covered(corners: [Vec3; 3]) -> Vec<u32> {
        let mut counts = vec![0; SIDE * SIDE];
        fill(corners, SIDE, 0..SIDE, |row| {
            for x in row.start..row.end {
                counts[SIDE * row.y + x] += 1;
            }
        });
        counts
    }

    fn place() -> impl Strategy<Value = Vec3> {
        // Includes pixel centers, where the fill rule matters.
        let at = prop_oneof![
            -4.0f32..28.0,
            (-8i16..56).prop_map(|half| f32::from(half) / 2.0)
        ];
        (at.clone(), at, 0.1f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        /// Signed areas in double precision decide clear cases; depth equals that of barycentric coordinates.
        #[test]
        fn middles_inside_are_covered_once(corners in [place(), place(), place()]) {
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let cross = |p: glam::DVec3, q: glam::DVec3, x: f64, y: f64| {
                (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)
            };
            let area = cross(a, b, c.x, c.y);
            let counts = covered(corners);
            for y in 0..SIDE {
                for x in 0..SIDE {
                    let (mx, my) = (x as f64 + 0.5, y as f64 + 0.5);
                    let of = [cross(b, c, mx, my), cross(c, a, mx, my), cross(a, b, mx, my)];
                    let signed = of.map(|s| s * area.signum());
                    let least = signed.into_iter().fold(f64::INFINITY, f64::min);
                    let count = counts[SIDE * y + x];
                    prop_assert!(count <= 1);
                    if least > 1e-3 {
                        prop_assert_eq!(count, 1, "{} {}", x, y);
                    } else if least < -1e-3 {
                        prop_assert_eq!(count, 0, "{} {}", x, y);
                    }
                }
            }
            if area.abs() > 1.0 {
                fill(corners, SIDE, 0..SIDE, |row| {
                    for (x, depth) in (row.start..row.end).zip(row.depths()) {
                        let (mx, my) = (x as f64 + 0.5, row.y as f64 + 0.5);
                        let mixed = (cross(b, c, mx, my) * a.z + cross(c, a, mx, my) * b.z
                            + cross(a, b, mx, my) * c.z) / area;
                        assert!((f64::from(depth) - mixed).abs() < 1e-3, "{depth} {mixed}");
                    }
                });
            }
        }

        /// Two triangles on either side of an edge leave no gap and share no pixel.
        #[test]
        fn an_edge_belongs_to_one_side([a, b, c, d] in [place(), place(), place(), place()]) {
            let side = |p: Vec3| (b - a).truncate().perp_dot((p - a).truncate());
            // On the opposite side from c.
            let d = if side(c) * side(d) > 0.0 { a + b - d } else { d };
            prop_assume!(side(c) * side(d) < 0.0);
            let (one, other) = (covered([a, b, c]), covered([b, a, d]));
            prop_assert!(one.iter().zip(&other).all(|(p, q)| p + q <= 1));
            // A pixel center on the edge between its ends belongs to one of the two.
            for y in 0..SIDE {
                for x in 0..SIDE {
                    let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let on = (b - a).truncate().perp_dot(middle - a.truncate()) == 0.0;
                    let share = (middle - a.truncate()).dot((b - a).truncate());
                    let within = share > 0.0 && share < (b - a).truncate().length_squared();
                    if on && within && middle.y != a.y.min(b.y) && a.y != b.y {
                        let at = SIDE * y + x;
                        prop_assert_eq!(one[at] + other[at], 1, "{} {}", x, y);
                    }
                }
            }
        }

        /// Clipping keeps exactly the visible part: sample points of the triangle are inside the view volume if and
        /// only if one of the parts contains them.
        #[test]
        fn clipping_keeps_what_is_in_view(
            corners in prop::array::uniform3((-3.0f32..3.0, -3.0f32..3.0, -3.0f32..3.0, -1.0f32..3.0)),
            shares in prop::collection::vec((0.0f32..1.0, 0.0f32..1.0), 40),
        ) {
            let corners: [Vec4; 3] = corners.map(Vec4::from);
            let mut parts = Vec::new();
            clip(corners, |part| parts.push(part));
            for corner in parts.iter().flatten() {
                prop_assert!(PLANES.iter().all(|plane| plane.dot(*corner) > -1e-4));
            }
            for (u, v) in shares {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let x = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
                let margin = PLANES.iter().map(|plane| plane.dot(x)).fold(f32::INFINITY, f32::min);
                // In the triangle's plane by its own coordinates, in which the parts are linear.
                let inside = parts.iter().any(|part| contains(*part, x));
                if margin > 1e-2 {
                    prop_assert!(inside, "{} {:?}", x, parts);
                }
            }
        }
    }

    /// True if a point in the plane of a triangle in four dimensions is inside it, up to rounding.
    fn contains([a, b, c]: [Vec4; 3], x: Vec4) -> bool {
        let (ab, ac, ax) = ((b - a).as_dvec4(), (c - a).as_dvec4(), (x - a).as_dvec4());
        let (bb, bc, cc) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
        let (xb, xc) = (ax.dot(ab), ax.dot(ac));
        let determinant = bb * cc - bc * bc;
        let (v, w) = (
            (cc * xb - bc * xc) / determinant,
            (bb * xc - bc * xb) / determinant,
        );
        v > -1e-3 && w > -1e-3 && v + w < 1.0 + 1e-3
    }
}
