//! [`stretch`]: the largest principal stretch of a tet.
//!
//! With the edges from one corner as columns, R at rest and D now, the deformation gradient is F = D R⁻¹; its singular
//! values are the principal stretches. The largest is the square root of the largest eigenvalue of `FᵀF`, which has a
//! closed form for a symmetric 3 x 3 matrix (O. K. Smith, "Eigenvalues of a symmetric 3 × 3 matrix", 1961). Cost: some
//! 100 operations.

use glam::{DMat3, DVec3};

/// Largest principal stretch of a tet with corners at `rest` and at `now` in m: 1 where nothing is deformed, and for a
/// tet with zero rest volume.
///
/// # Example
/// ```
/// use glam::DVec3;
///
/// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let pulled = rest.map(|x| x * DVec3::new(0.9, 1.5, 0.9));
/// assert!((incise_render::stretch(rest, pulled) - 1.5).abs() < 1e-12);
/// ```
#[must_use]
pub fn stretch(rest: [DVec3; 4], now: [DVec3; 4]) -> f64 {
    let edges = |[a, b, c, d]: [DVec3; 4]| DMat3::from_cols(b - a, c - a, d - a);
    let inverse = edges(rest).inverse();
    if !inverse.is_finite() {
        return 1.0;
    }
    let deformation = edges(now) * inverse;
    largest_eigenvalue(deformation.transpose() * deformation)
        .max(0.0)
        .sqrt()
}

/// Largest eigenvalue of a symmetric matrix.
fn largest_eigenvalue(m: DMat3) -> f64 {
    let [a, b, c] = [m.x_axis.x, m.y_axis.y, m.z_axis.z];
    let [d, e, f] = [m.y_axis.x, m.z_axis.x, m.z_axis.y];
    let mean = (a + b + c) / 3.0;
    let aside = d * d + e * e + f * f;
    let spread = (a - mean).powi(2) + (b - mean).powi(2) + (c - mean).powi(2) + 2.0 * aside;
    let p = (spread / 6.0).sqrt();
    if p <= f64::EPSILON * mean.abs() {
        return mean;
    }
    let scaled = (m - DMat3::from_diagonal(DVec3::splat(mean))) * (1.0 / p);
    let angle = (scaled.determinant() * 0.5).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * p * angle.cos()
}
