//! [`direction`]: length and direction of a vector, for every vector that has one.
//!
//! Squares of lengths leave the range of single precision beyond 1e19 m and below 1e-19 m. Divided by its largest
//! component first, a vector keeps its direction however long or short it is. Cost: three divisions more.

use crate::Float;

/// The length of a vector and the vector of length 1 along it; `None` for zero and for what is no number.
#[inline]
pub(crate) fn direction<R: Float>(v: R::Vector) -> Option<(R, R::Vector)> {
    let [x, y, z] = R::components(v);
    let [a, b, c] = [x, y, z].map(absolute);
    let largest = if a > b { a } else { b };
    let largest = if c > largest { c } else { largest };
    let scaled = R::vector(x / largest, y / largest, z / largest);
    let length = R::dot(scaled, scaled).sqrt();
    (length > R::ZERO).then(|| (largest * length, scaled * (R::ONE / length)))
}

/// The absolute value.
#[inline]
pub(crate) fn absolute<R: Float>(value: R) -> R {
    if value < R::ZERO { -value } else { value }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::direction;

    /// The scaled vector has a largest component of 1, so three roundings of 6e-8 remain, and the last digit of what is
    /// denormal.
    #[test]
    fn any_vector_but_zero_has_a_direction() {
        for scale in [1.0, 1e-18, 1e-25, 1e-36, 1e18, 1e25, 1e37] {
            let (length, unit) = direction::<f32>(vec3(3.0, -4.0, 12.0) * scale).unwrap();
            assert!((length / (13.0 * scale) - 1.0).abs() < 1e-6, "{scale}");
            assert!(unit.distance(vec3(3.0, -4.0, 12.0) / 13.0) < 1e-6);
        }
        let (_, unit) = direction::<f32>(vec3(0.0, 0.0, -1e-45)).unwrap();
        assert_eq!(unit, Vec3::NEG_Z);
        assert_eq!(direction::<f32>(Vec3::ZERO), None);
        assert_eq!(direction::<f32>(Vec3::NAN), None);
    }
}
