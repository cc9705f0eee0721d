//! The second derivatives of the potential, made positive semidefinite without a decomposition of F.
//!
//! In F the energy density over μ has the Hessian `I + l c cᵀ + p ∂²J` with `J = det F`, `c = ∂J/∂F`, l in units of μ
//! and `p = l (J - γ)`. Only `∂²J` is indefinite. With the singular values σ of F its eigenvalues are `±σᵢ` and the
//! three roots λ of `λ³ - |F|² λ - 2J`, the latter in the space of stretches, where c lies. So p is held
//! - below `1 / y`, with -y the smallest root: it is the lowest eigenvalue of all;
//! - above `-1 / σ_max`, for the sake of the `±σᵢ`. Of the stretches at most one is then negative, and `l c cᵀ` makes
//!   up for it if and only if the determinant on that space, `1 - p² |F|² + 2 p³ J + l (|c|² - 2 p J |F|² + 3 p² J²)`,
//!   is not negative. If it is (a tet pressed nearly flat or inside out), p is held above `-1 / z` with z the largest
//!   root.
//!
//! At rest `p = -1` is just the second bound, so nothing is changed there: a turn of the whole has no stiffness, and
//! Newton's method is Newton's.
//!
//! Source: eigenvalues from Smith, de Goes, Kim 2018, section 4; the bounds are derived here.
//! Cost: about 150 operations and four square roots a tet.

use crate::Float;
use crate::neo_hookean::TetConstraint;

/// Newton steps for a root; from above, each at least halves what is too much: at a double root 2 % of it remain.
const ROOT_STEPS: usize = 6;

/// `√(lV) (det F - γ)` of a tet with its corners at `x`, held within the bounds; 0 for what is not finite.
#[inline(always)]
pub(super) fn held_excess<R: Float>(tet: &TetConstraint<R>, x: [R::Vector; 4]) -> R {
    let q = &tet.inverse_rest;
    let (e1, e2, e3) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let f1 = e1 * q[0] + e2 * q[3] + e3 * q[6];
    let f2 = e1 * q[1] + e2 * q[4] + e3 * q[7];
    let f3 = e1 * q[2] + e2 * q[5] + e3 * q[8];
    let pressure = tet.ratio * (R::dot(f1, R::cross(f2, f3)) - tet.gamma);
    // p V = √(lV) · excess, and μV is the stiffness.
    let excess = (tet.stiffness / tet.ratio).sqrt() * held::<R>(pressure, [f1, f2, f3], tet.ratio);
    if excess.is_finite() { excess } else { R::ZERO }
}

/// The pressure p held within its bounds; p and l in units of μ.
#[inline(always)]
fn held<R: Float>(pressure: R, f: [R::Vector; 3], l: R) -> R {
    let [f1, f2, f3] = f;
    let [half, two, three] = [0.5, 2.0, 3.0].map(R::from_f64);
    let cofactor = [R::cross(f2, f3), R::cross(f3, f1), R::cross(f1, f2)];
    let first = R::dot(f1, f1) + R::dot(f2, f2) + R::dot(f3, f3);
    let second = R::dot(cofactor[0], cofactor[0])
        + R::dot(cofactor[1], cofactor[1])
        + R::dot(cofactor[2], cofactor[2]);
    let third = R::dot(f1, cofactor[0]);
    let m = first / three;
    // The roots of λ³ - |F|² λ - 2J are √m t with t³ - 3t = 2ρ; the y are the same for -J.
    let extreme = m.sqrt();
    let rho = third / (m * extreme);
    if pressure >= R::ZERO {
        // No root is above 2.
        if pressure <= R::ONE / (extreme * two) {
            return pressure;
        }
        let high = R::ONE / (extreme * largest_root(-rho));
        return if pressure > high { high } else { pressure };
    }
    // The σ² are the roots of λ³ - |F|² λ² + |c|² λ - J², which are m + √q t with t³ - 3t = 2ρ.
    let q = m * m - second / three;
    let q = if q > R::ZERO { q } else { R::ZERO };
    let spread = q.sqrt();
    let mut p = pressure;
    if pressure * pressure * (m + two * spread) > R::ONE {
        let value = ((m - first) * m + second) * m - third * third;
        let turn = if spread > R::ZERO {
            -half * value / (q * spread)
        } else {
            R::ONE
        };
        let low = -(R::ONE / (m + spread * largest_root(turn)).sqrt());
        p = if pressure < low { low } else { pressure };
    }
    let made_up = l * (second - two * p * third * first + three * p * p * third * third);
    if R::ONE - p * p * first + two * p * p * p * third + made_up >= R::ZERO {
        return p;
    }
    let low = -(R::ONE / (extreme * largest_root(rho)));
    if p < low { low } else { p }
}

/// The largest root of `t³ - 3t = 2ρ`, from 1 to 2, or up to 2.1 % more; ρ lies between -1 and 1.
#[inline(always)]
fn largest_root<R: Float>(rho: R) -> R {
    let [two, three] = [2.0, 3.0].map(R::from_f64);
    let mut t = two;
    for _ in 0..ROOT_STEPS {
        let slope = three * (t * t - R::ONE);
        let next = t - (t * (t * t - three) - two * rho) / slope;
        // From above, the iterates fall to the root; at a double root, where the slope vanishes, rounding must not throw
        // them about.
        if !(next < t && next > R::ONE) {
            break;
        }
        t = next;
    }
    t
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;

    use super::*;

    type Matrix = [[f64; 9]; 9];

    /// The Hessian `I + l c cᵀ + p ∂²J` in units of μ.
    fn hessian(f: [DVec3; 3], l: f64, p: f64) -> Matrix {
        let cofactor = [f[1].cross(f[2]), f[2].cross(f[0]), f[0].cross(f[1])];
        let c: Vec<f64> = cofactor.iter().flat_map(|c| c.to_array()).collect();
        let mut h = [[0.0; 9]; 9];
        for i in 0..9 {
            h[i][i] += 1.0;
            for j in 0..9 {
                h[i][j] += l * c[i] * c[j];
            }
        }
        // Moving column k + 1 by δ changes the cofactor of column k by δ × (column k + 2), and so on around.
        for k in 0..3 {
            for (axis, unit) in DVec3::AXES.into_iter().enumerate() {
                let next = unit.cross(f[(k + 2) % 3]).to_array();
                let last = f[(k + 1) % 3].cross(unit).to_array();
                for i in 0..3 {
                    h[3 * k + i][3 * ((k + 1) % 3) + axis] += p * next[i];
                    h[3 * k + i][3 * ((k + 2) % 3) + axis] += p * last[i];
                }
            }
        }
        h
    }

    /// The smallest pivot of a matrix plus a multiple of the identity.
    fn smallest_pivot(mut h: Matrix, shift: f64) -> f64 {
        let mut smallest = f64::INFINITY;
        for k in 0..9 {
            let upper = h[k];
            let pivot = upper[k] + shift;
            smallest = smallest.min(pivot);
            for row in &mut h[k + 1..] {
                let factor = row[k] / pivot;
                for (entry, above) in row[k + 1..].iter_mut().zip(&upper[k + 1..]) {
                    *entry -= factor * above;
                }
            }
        }
        smallest
    }

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-2.0..2.0f64).prop_map(DVec3::from_array)
    }

    /// General, nearly flat, nearly a turn, nearly a mirror image, and tiny ones.
    fn deformation() -> impl Strategy<Value = [DVec3; 3]> {
        let general = prop::array::uniform3(point());
        let flat = (point(), point(), -1.0..1.0f64).prop_map(|(a, b, s)| [a, b, a * s + b * 0.3]);
        let near = |sign: f64| {
            prop::array::uniform3(point()).prop_map(move |[a, b, c]| {
                let m = DMat3::from_diagonal(DVec3::new(1.0, 1.0, sign))
                    + DMat3::from_cols(a, b, c) * 0.01;
                [m.x_axis, m.y_axis, m.z_axis]
            })
        };
        let tiny = prop::array::uniform3(point()).prop_map(|f| f.map(|c| c * 1e-3));
        prop_oneof![general, flat, near(1.0), near(-1.0), tiny]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Whatever the pressure was, no direction is negative beyond rounding.
        #[test]
        fn held_pressure_leaves_no_negative_direction(
            f in deformation(),
            log_l in 0.0..4.0f64,
            pressure in -10.0..10.0f64,
        ) {
            let l = 10f64.powf(log_l);
            for p in [pressure, -1e9, 1e9].map(|p| held::<f64>(p, f, l)) {
                let h = hessian(f, l, p);
                let size = (0..9).map(|i| h[i][i]).fold(0.0, f64::max);
                let pivot = smallest_pivot(h, 1e-6 * size);
                prop_assert!(pivot > 0.0, "{pivot:e} of {size:e}, l {l}, p {p}");
            }
        }
    }

    /// At rest, turned, the pressure -1 is kept, and turning further costs nothing.
    #[test]
    fn rest_is_not_clamped() {
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1);
        let f = [turn.x_axis, turn.y_axis, turn.z_axis];
        for l in [1.0, 10.0, 1e4] {
            // The spread of the singular values is the root of rounding.
            assert!((held::<f64>(-1.0, f, l) + 1.0).abs() < 1e-7);
        }
        let spin = DVec3::new(0.3, -0.2, 0.5);
        let motion: Vec<f64> = f.iter().flat_map(|c| spin.cross(*c).to_array()).collect();
        for row in hessian(f, 7.0, -1.0) {
            let force: f64 = row.iter().zip(&motion).map(|(h, m)| h * m).sum();
            assert!(force.abs() < 1e-14);
        }
    }

    #[test]
    fn roots_are_the_largest() {
        for angle in [0.0, 0.3, 1.0, 2.0, 3.0, std::f64::consts::PI] {
            // t = 2 cos(φ/3) for ρ = cos φ.
            let root = 2.0 * (angle / 3.0f64).cos();
            let found = largest_root(angle.cos());
            assert!(
                (-1e-12..0.03).contains(&(found - root)),
                "{angle}: {found} for {root}"
            );
        }
    }
}
