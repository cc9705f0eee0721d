//! Distance between two shapes up to a rigid motion.
//!
//! The best rotation is the unit quaternion that maximizes a quadratic form (Horn 1987); its eigenvector to the largest
//! eigenvalue is what repeated squaring of the shifted matrix leaves. Cost: O(particles) and some dozens of products of
//! 4 × 4 matrices.

use incise::mesh::glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

/// Squarings: eigenvalues apart by a part in 1e9 are told apart.
const SQUARINGS: usize = 40;

/// RMS distance between `rest` and `shape` after the best rigid motion, over the longest side of `rest`.
pub(crate) fn distance(rest: &[DVec3], shape: &[DVec3]) -> f64 {
    let count = rest.len().max(1) as f64;
    let middle = |points: &[DVec3]| points.iter().sum::<DVec3>() / count;
    let (from, to) = (middle(rest), middle(shape));
    let ends = (DVec3::MAX, DVec3::MIN);
    let (low, high) = rest
        .iter()
        .fold(ends, |(low, high), &x| (low.min(x), high.max(x)));
    let size = (high - low).max_element().max(f64::MIN_POSITIVE);
    // In units of the body, to avoid overflow and underflow.
    let pairs = || {
        let pairs = rest.iter().zip(shape);
        pairs.map(|(&a, &b)| ((a - from) / size, (b - to) / size))
    };
    let rotation = rotation(pairs());
    let sum: f64 = pairs()
        .map(|(a, b)| (rotation * a).distance_squared(b))
        .sum();
    (sum / count).sqrt()
}

/// Rotation that best aligns the first points with the second.
fn rotation(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> DQuat {
    let mut s = DMat3::ZERO;
    for (a, b) in pairs {
        s += DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    }
    // Column j, row i: sum of a_i b_j.
    let [x, y, z] = [s.x_axis, s.y_axis, s.z_axis];
    let skew = DVec3::new(z.y - y.z, x.z - z.x, y.x - x.y);
    let off = DVec3::new(z.y + y.z, x.z + z.x, y.x + x.y);
    let mut n = DMat4::from_cols(
        DVec4::new(x.x + y.y + z.z, skew.x, skew.y, skew.z),
        DVec4::new(skew.x, x.x - y.y - z.z, off.z, off.y),
        DVec4::new(skew.y, off.z, y.y - x.x - z.z, off.x),
        DVec4::new(skew.z, off.y, off.x, z.z - x.x - y.y),
    );
    let norm = norm(&n);
    if norm == 0.0 {
        return DQuat::IDENTITY;
    }
    n += DMat4::IDENTITY * norm;
    for _ in 0..SQUARINGS {
        n = n * (1.0 / self::norm(&n));
        n = n * n;
    }
    let columns = [n.x_axis, n.y_axis, n.z_axis, n.w_axis];
    let longest = columns
        .into_iter()
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let q = longest.unwrap_or(DVec4::X).normalize();
    DQuat::from_xyzw(q.y, q.z, q.w, q.x)
}

/// Frobenius norm: an upper bound of the largest eigenvalue.
fn norm(m: &DMat4) -> f64 {
    let columns = [m.x_axis, m.y_axis, m.z_axis, m.w_axis];
    columns
        .iter()
        .map(|c| c.length_squared())
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<DVec3> {
        let mut noise = crate::random::Random(3);
        (0..20)
            .map(|_| noise.vector() * DVec3::new(3.0, 2.0, 1.0))
            .collect()
    }

    /// Rounding of the fit is all that is left, also at half turns and in other units.
    #[test]
    fn rigid_motions_are_no_distance() {
        let rest = points();
        let mut noise = crate::random::Random(5);
        let mut turns: Vec<DQuat> = [DVec3::X, DVec3::Y, DVec3::Z]
            .map(|axis| DQuat::from_axis_angle(axis, std::f64::consts::PI))
            .to_vec();
        for _ in 0..20 {
            turns.push(DQuat::from_axis_angle(
                noise.vector().normalize(),
                4.0 * noise.signed(),
            ));
        }
        for turn in turns {
            let moved: Vec<_> = rest.iter().map(|&x| turn * x + DVec3::splat(7.0)).collect();
            assert!(distance(&rest, &moved) < 1e-7, "{turn}");
        }
        let small: Vec<_> = rest.iter().map(|&x| x * 1e-6).collect();
        assert!(distance(&small, &small) < 1e-7);
    }

    /// A point is at the distance of the root of the mean square of the distances from the middle; a mirror image is
    /// not the shape.
    #[test]
    fn other_shapes_are_a_distance() {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let point = [DVec3::ONE; 4];
        // Squared: 3/16 from the middle for the corner at 0, 11/16 for the others, 9/16 in the mean.
        assert!((distance(&rest, &point) - 0.75).abs() < 1e-12);
        let doubled = rest.map(|x| x * 2.0);
        assert!((distance(&rest, &doubled) - 0.75).abs() < 1e-7);
        let mirrored = rest.map(|x| x * DVec3::new(1.0, 1.0, -1.0));
        assert!(distance(&rest, &mirrored) > 0.1);
    }
}
