//! [`normal_sums`]: vertex normals of the skin, and the reference for its twin `normals.wgsl`.
//!
//! The normal of a vertex is the sum of the unit normals of its triangles, each weighted by the triangle's angle at the
//! vertex (G. Thürmer and C. Wüthrich, "Computing vertex normals from polygonal facets", 1998), so that it does not
//! depend on the triangulation of a surface. Sums are in fixed point, in units of about a millionth: integer sums do
//! not depend on their order, also across threads of a device. Cost: O(triangles).

use glam::Vec3;

/// Fixed-point value of 1. Angles around a vertex would have to add up to 2000 to overflow.
const UNIT: f32 = 1_048_576.0;

/// Sums of angle-weighted triangle normals for each vertex, in fixed point; positions are in m. The sums do not have
/// unit length. A vertex without triangles, or with degenerate ones only, has zeros.
///
/// # Panics
/// If a triangle has a vertex that does not exist.
///
/// # Example
/// ```
/// use glam::Vec3;
///
/// let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// let sums = incise_render::normal_sums(&[[0, 1, 2]], &positions);
/// assert!(sums.iter().all(|&[x, y, z]| x == 0 && y == 0 && z > 0));
/// assert_eq!(sums[1], sums[2]); // both have an angle of 45°
/// ```
#[must_use]
pub fn normal_sums(triangles: &[[u32; 3]], positions: &[Vec3]) -> Vec<[i32; 3]> {
    let mut sums = vec![[0; 3]; positions.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        let (ab, bc, ca) = (unit(b - a), unit(c - b), unit(a - c));
        let normal = unit(ab.cross(-ca));
        if normal == Vec3::ZERO {
            // Zero area; edges may have length 0, for which atan2 is undefined.
            continue;
        }
        let at_a = angle(ab, -ca);
        let at_b = angle(bc, -ab);
        let at_c = std::f32::consts::PI - at_a - at_b;
        for (v, angle) in corners.iter().zip([at_a, at_b, at_c]) {
            let sum = &mut sums[*v as usize];
            for (sum, part) in sum.iter_mut().zip((normal * angle).to_array()) {
                *sum += fixed(part);
            }
        }
    }
    sums
}

/// Angle between two directions, from sine and cosine.
fn angle(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Unit vector, or zero. Scaled by the largest component first: squares of short edges must not underflow.
fn unit(v: Vec3) -> Vec3 {
    let largest = v.abs().max_element();
    if largest > 0.0 {
        (v / largest).normalize()
    } else {
        Vec3::ZERO
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "at most π million, which is far from the end"
)]
fn fixed(part: f32) -> i32 {
    (part * UNIT).round_ties_even() as i32
}
