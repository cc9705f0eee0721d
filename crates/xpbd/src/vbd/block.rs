//! 3×3 matrices, as blocks of a larger matrix and for a single particle, and the solution of a symmetric one.

use crate::Float;

/// A 3×3 matrix by columns.
pub(super) type Block<R> = [<R as Float>::Vector; 3];

/// The backward error of [`solve`] in last digits of the trace: one was enough in all tests.
const BACKWARD_ERROR: f64 = 4.0;

#[inline(always)]
pub(super) fn apply<R: Float>(block: &Block<R>, x: R::Vector) -> R::Vector {
    let [a, b, c] = R::components(x);
    block[0] * a + block[1] * b + block[2] * c
}

/// Adds `u vᵀ`.
#[inline]
pub(super) fn add_outer<R: Float>(block: &mut Block<R>, u: R::Vector, v: R::Vector) {
    let v = R::components(v);
    for k in 0..3 {
        block[k] += u * v[k];
    }
}

#[inline]
pub(super) fn add_isotropic<R: Float>(block: &mut Block<R>, value: R) {
    block[0] += R::vector(value, R::ZERO, R::ZERO);
    block[1] += R::vector(R::ZERO, value, R::ZERO);
    block[2] += R::vector(R::ZERO, R::ZERO, value);
}

/// Solves `(isotropic I + h) y = force` with h symmetric, positive semidefinite and given as xx, xy, xz, yy, yz, zz.
///
/// Gaussian elimination without square roots. No pivot of such a matrix is smaller than its isotropic part; where
/// rounding says otherwise, it is noise. Rounding acts like a matrix of some last digits of the trace, which beside a
/// sliver can be stiffer than everything else: a solution that lives on it is shortened, so that the quadratic with
/// this matrix and force does not rise along it.
#[inline]
pub(super) fn solve<R: Float>(isotropic: R, h: [R; 6], force: R::Vector) -> R::Vector {
    let [f0, f1, f2] = R::components(force);
    let at_least = |pivot: R| if pivot > isotropic { pivot } else { isotropic };
    let d0 = R::ONE / (h[0] + isotropic);
    let (l1, l2) = (h[1] * d0, h[2] * d0);
    let d1 = R::ONE / at_least(h[3] - l1 * h[1] + isotropic);
    let m12 = h[4] - l1 * h[2];
    let l3 = m12 * d1;
    let d2 = R::ONE / at_least(h[5] - l2 * h[2] - l3 * m12 + isotropic);
    let y1 = f1 - l1 * f0;
    let y2 = f2 - l2 * f0 - l3 * y1;
    let z = y2 * d2;
    let y = y1 * d1 - l3 * z;
    let x = f0 * d0 - l1 * y - l2 * z;
    let solution = R::vector(x, y, z);
    let gain = R::dot(force, solution);
    let error = (h[0] + h[3] + h[5]) * (R::EPSILON * R::from_f64(BACKWARD_ERROR));
    let lost = R::dot(solution, solution) * error;
    if lost > gain && gain > R::ZERO {
        solution * (gain / lost)
    } else {
        solution
    }
}

/// Adds a symmetric block to a matrix that is given as xx, xy, xz, yy, yz, zz.
#[inline]
pub(super) fn add_symmetric<R: Float>(h: &mut [R; 6], block: &Block<R>) {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = block.map(R::components);
    for (entry, value) in h.iter_mut().zip([xx, xy, xz, yy, yz, zz]) {
        *entry += value;
    }
}

#[cfg(test)]
mod tests {
    use super::solve;
    use crate::vbd::sweep::push_of;

    /// In single precision, beside slivers of any flatness, no step leads above where it started. Without the bound on
    /// the solution three of ten do.
    #[test]
    fn steps_beside_slivers_do_not_raise_the_potential() {
        for case in 0..20_000 {
            let flatness = 10.0_f32.powi(case % 6);
            let vector = |k: usize| push_of::<f32>(4 * case as usize + k);
            let slopes = [vector(0) * flatness, vector(1), vector(2)];
            let force = vector(3);
            let isotropic = 1e-3_f32;
            let mut h = [0.0; 6];
            for [x, y, z] in slopes.map(|slope| slope.to_array()) {
                for (entry, value) in h.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
                    *entry += value;
                }
            }
            let step = solve::<f32>(isotropic, h, force).as_dvec3();
            let stretch = slopes.map(|slope| slope.as_dvec3().dot(step).powi(2));
            let resistance =
                f64::from(isotropic) * step.length_squared() + stretch.iter().sum::<f64>();
            let gain = force.as_dvec3().dot(step) - 0.5 * resistance;
            assert!(gain >= 0.0, "flatness {flatness}: {gain}, {step}");
        }
    }
}
