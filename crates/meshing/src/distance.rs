//! Signed distances of simple solids and their smooth blends, negative inside.
//!
//! Source: I. Quilez, "Distance functions" and "Smooth minimum" (articles); the ellipsoid is only a bound of the
//! distance, scaled from the unit ball, which is all that stuffing needs. Constant time.

use glam::DVec3;

/// A ball around the origin.
pub(super) fn ball(p: DVec3, radius: f64) -> f64 {
    p.length() - radius
}

/// An axis-aligned box around the origin.
pub(super) fn cuboid(p: DVec3, half: DVec3) -> f64 {
    let beyond = p.abs() - half;
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
}

/// A ring in the xy plane around the origin.
pub(super) fn torus(p: DVec3, ring: f64, tube: f64) -> f64 {
    let from_ring = (p.x * p.x + p.y * p.y).sqrt() - ring;
    (from_ring * from_ring + p.z * p.z).sqrt() - tube
}

/// An axis-aligned ellipsoid: right in sign, in size at most the distance.
pub(super) fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    (((p - center) / radii).length() - 1.0) * radii.min_element()
}

/// A ball that moves from one end to the other while its radius changes evenly. Exact.
///
/// The nearest ball on the way is where the line to its center leans by the slope of the radius, unless that lies
/// beyond an end; the ends must be farther apart than their radii differ.
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

/// The union of two solids with the crease between them filled over a width of about `k`.
pub(super) fn smooth_union(a: f64, b: f64, k: f64) -> f64 {
    let overlap = (k - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * k)
}

/// The first solid without the second, the new edge rounded over a width of about `k`.
pub(super) fn smooth_difference(a: f64, b: f64, k: f64) -> f64 {
    smooth_intersection(a, -b, k)
}

/// What two solids share, the new edge rounded over a width of about `k`.
pub(super) fn smooth_intersection(a: f64, b: f64, k: f64) -> f64 {
    -smooth_union(-a, -b, k)
}
