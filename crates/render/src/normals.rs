//! [`normal_sums`]: the normals of skin vertices: twin of `normals.wgsl`, which it defines.
//!
//! The normal of a vertex is the sum of the normals of its triangles, each of length 1 times the angle of the triangle
//! there (G. Thürmer and C. Wüthrich, "Computing vertex normals from polygonal facets", 1998), so that it does not depend on
//! how a surface is divided into triangles. Sums are in fixed point, a millionth: integers can be added in any order, also
//! by threads of a device, with the same result. Cost: O(triangles).

use glam::Vec3;

/// What a length of 1 is in the sums. Angles around a vertex would have to add up to 2000 to overflow.
const UNIT: f32 = 1_048_576.0;

/// Three sums a vertex, for corners of triangles and the positions of vertices in m. They are no unit vectors; a vertex
/// without a triangle, or with flat ones only, has zeros.
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
            // No area and perhaps no edges, of which an arc tangent is not defined.
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

/// Of two directions, by sine and cosine.
fn angle(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Of length 1, or zero. Longest part first: squares of small edges must not vanish.
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
