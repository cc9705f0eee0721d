//! Signed distances of simple solids and their smooth blends, negative inside.
//!
//! Source: I. Quilez, "Distance functions" and "Smooth minimum" (articles). The ellipsoid's value is only a lower bound
//! of the distance, scaled from the unit ball; stuffing needs no more. Constant time.

use glam::DVec3;

/// Ball around the origin.
pub(super) fn ball(p: DVec3, radius: f64) -> f64 {
    p.length() - radius
}

/// Axis-aligned box around the origin.
pub(super) fn cuboid(p: DVec3, half: DVec3) -> f64 {
    let beyond = p.abs() - half;
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
}

/// Torus in the xy plane around the origin.
pub(super) fn torus(p: DVec3, ring: f64, tube: f64) -> f64 {
    let from_ring = (p.x * p.x + p.y * p.y).sqrt() - ring;
    (from_ring * from_ring + p.z * p.z).sqrt() - tube
}

/// Axis-aligned ellipsoid: exact sign; the absolute value is at most the distance.
pub(super) fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    (((p - center) / radii).length() - 1.0) * radii.min_element()
}

/// Round cone: hull of two balls. Exact.
///
/// The nearest ball of the family between the ends is where the line to its center is inclined by the slope of the
/// radius, clamped to the ends. The distance of the ends must exceed the difference of their radii.
pub(super) fn round_cone(p: DVec3, [from, to]: [DVec3; 2], [first, last]: [f64; 2]) -> f64 {
    let axis = to - from;
    let length = axis.length();
    let along = (p - from).dot(axis) / length;
    let aside = ((p - from).length_squared() - along * along)
        .max(0.0)
        .sqrt();
    let slope = (first - last) / length;
    let center = (along - aside * slope / (1.0 - slope * slope).sqrt()).clamp(0.0, length);
    let lead = along - center;
    (lead * lead + aside * aside).sqrt() - (first - slope * center)
}

/// Union of two solids with the crease between them filled over a width of about `k`.
pub(super) fn smooth_union(a: f64, b: f64, k: f64) -> f64 {
    let overlap = (k - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * k)
}

/// First solid minus the second, with the new edge rounded over a width of about `k`.
pub(super) fn smooth_difference(a: f64, b: f64, k: f64) -> f64 {
    smooth_intersection(a, -b, k)
}

/// Intersection of two solids, with the new edge rounded over a width of about `k`.
pub(super) fn smooth_intersection(a: f64, b: f64, k: f64) -> f64 {
    -smooth_union(-a, -b, k)
}
