//! [`TetConstraint`]: rest data of a Stable Neo-Hookean tet, and its two constraints with their gradients.
//!
//! This is the plain form, one tet at a time: measurements use it in double precision, and it is the oracle of the
//! kernel that steps use, [`crate::simd_kernel`].
//!
//! Source: Macklin and Müller 2021. Cost: 220 operations a tet.

use glam::{DMat3, DVec3};

use crate::{Float, Material};

/// The norm of the derivative of det F, √3 at rest, up to which tets follow their material exactly: that of a tet
/// stretched two and a half times along each axis, or fifty times along one at constant volume. Beyond it derivative
/// and value of the volume term are scaled down.
pub(crate) const MAX_COFACTOR_NORM: f64 = 10.0;

/// The trace of E beyond which `Ψ_D` is computed as `tr E / 2 - (J - 1) + (J - 1)² / 2`. Near rest that loses all
/// digits, and far from it the form without `tr E` does, in which terms of sixth degree cancel.
pub(crate) const LARGE_STRAIN: f64 = 2.0;

/// How often a step that raises the energy of its tet is shortened. Of two million random tets three left one whose
/// energy rose, by a part of 3e-5.
pub(crate) const SHORTENINGS: u32 = 3;

/// A tet with what the solver needs of its rest shape: 64 bytes in single precision.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TetConstraint<R> {
    pub(crate) particles: [u32; 4],
    /// Inverse of the rest edge matrix, row by row: row i is the gradient of the barycentric coordinate of corner
    /// i + 1.
    pub(crate) inverse_rest: [R; 9],
    /// `μV` in J: one over the compliance of the deviatoric constraint.
    pub(crate) stiffness: R,
    /// `l/μ`: how much stiffer the hydrostatic constraint is.
    pub(crate) ratio: R,
    pub(crate) gamma: R,
}

/// Both constraints with their gradients at the four corners.
pub(crate) struct Evaluation<R: Float> {
    pub(crate) deviatoric: R,
    pub(crate) hydrostatic: R,
    pub(crate) deviatoric_gradients: [R::Vector; 4],
    pub(crate) hydrostatic_gradients: [R::Vector; 4],
    /// The square of the norm of the derivative of det F; what only measures has no use for it.
    #[cfg(test)]
    slope_squared: R,
}

/// The two parts of the energy of the split form in units of μ.
struct SplitEnergy<R: Float> {
    shear: R,
    derivative: [R::Vector; 3],
    cofactor: [R::Vector; 3],
    bulge: R,
    /// Whether a step may raise the energy.
    #[cfg(test)]
    far: bool,
}

impl<R: Float> TetConstraint<R> {
    /// Prepares a tet; everything is computed in double precision and rounded once.
    pub(crate) fn new(particles: [u32; 4], rest: [DVec3; 4], material: &Material) -> Self {
        let [a, b, c, d] = rest;
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let volume = edges.determinant() / 6.0;
        let inverse = edges.inverse();
        let rows = [inverse.row(0), inverse.row(1), inverse.row(2)];
        let stiffness = material.mu() * volume;
        // The gradient of corner 0 is stored in place of another one if that keeps its slot from one tet to the next.
        let first = rows[0] + rows[1] + rows[2];
        let rows_of_all = rows.iter().chain([&first]);
        let entries = rows_of_all.flat_map(|r| r.to_array()).chain([stiffness]);
        let sound = volume > 0.0 && entries.into_iter().all(|v| R::from_f64(v).is_finite());
        // A tet too flat to be represented takes no part: without stiffness it leaves its corners to its neighbors.
        let entry = |v: f64| if sound { R::from_f64(v) } else { R::ZERO };
        let [ratio, gamma] = Self::constants(material);
        Self {
            particles,
            inverse_rest: std::array::from_fn(|i| entry(rows[i / 3][i % 3])),
            stiffness: entry(stiffness),
            ratio,
            gamma,
        }
    }

    /// What all tets of a material have in common: `l/μ` and `γ`.
    pub(crate) fn constants(material: &Material) -> [R; 2] {
        let ratio = material.volume_stiffness() / material.mu();
        [ratio, material.gamma()].map(R::from_f64)
    }

    /// Converts the tet to double precision, for measurements.
    pub(crate) fn to_f64(self) -> TetConstraint<f64> {
        TetConstraint {
            particles: self.particles,
            inverse_rest: self.inverse_rest.map(R::to_f64),
            stiffness: self.stiffness.to_f64(),
            ratio: self.ratio.to_f64(),
            gamma: self.gamma.to_f64(),
        }
    }

    /// `E Δt² / (ρ h²)` with h the smallest altitude, of the unsoftened material.
    pub(crate) fn kappa(&self, material: &Material, substep_time: f64) -> f64 {
        let q = self.inverse_rest.map(R::to_f64);
        let [a, b, c] = [0, 1, 2].map(|i| DVec3::new(q[3 * i], q[3 * i + 1], q[3 * i + 2]));
        // The gradient of a barycentric coordinate is as long as one over an altitude.
        let steepest = [a, b, c, a + b + c]
            .into_iter()
            .map(DVec3::length_squared)
            .fold(0.0, f64::max);
        material.young_modulus / material.density * substep_time * substep_time * steepest
    }

    /// Divides the stiffness by a factor.
    pub(crate) fn soften(&mut self, factor: f64) {
        self.stiffness = R::from_f64(self.stiffness.to_f64() / factor);
    }

    /// The columns of the deformation gradient F with the corners at `x`.
    #[inline]
    fn deformation(&self, x: [R::Vector; 4]) -> [R::Vector; 3] {
        let q = &self.inverse_rest;
        let (e1, e2, e3) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        [
            e1 * q[0] + e2 * q[3] + e3 * q[6],
            e1 * q[1] + e2 * q[4] + e3 * q[7],
            e1 * q[2] + e2 * q[5] + e3 * q[8],
        ]
    }

    /// Both constraints and their gradients.
    #[inline(always)]
    pub(crate) fn evaluate(&self, x: [R::Vector; 4]) -> Evaluation<R> {
        let [f1, f2, f3] = self.deformation(x);
        let norm = (R::dot(f1, f1) + R::dot(f2, f2) + R::dot(f3, f3)).sqrt();
        // The gradient F/|F| has no direction at F = 0; there the tet waits for its neighbors.
        let scale = if norm > R::ZERO {
            R::ONE / norm
        } else {
            R::ZERO
        };
        let cofactor = [R::cross(f2, f3), R::cross(f3, f1), R::cross(f1, f2)];
        Evaluation {
            deviatoric: norm,
            hydrostatic: R::dot(f1, cofactor[0]) - self.gamma,
            deviatoric_gradients: self.gradients([f1 * scale, f2 * scale, f3 * scale]),
            hydrostatic_gradients: self.gradients(cofactor),
            #[cfg(test)]
            slope_squared: cofactor.iter().fold(R::ZERO, |sum, &c| sum + R::dot(c, c)),
        }
    }

    /// Both constraints of [`crate::TetSolve::Split`] and their gradients: `√(2 Ψ_D / μ)`, of which the gradient is 0
    /// where the constraint is, and `det F - 1`.
    pub(crate) fn evaluate_split(&self, x: [R::Vector; 4]) -> Evaluation<R> {
        let split = self.split_energy(x);
        let twice = split.shear + split.shear;
        let root = if twice > R::ZERO {
            twice.sqrt()
        } else {
            R::ZERO
        };
        let scale = if root > R::ZERO {
            R::ONE / root
        } else {
            R::ZERO
        };
        Evaluation {
            deviatoric: root,
            hydrostatic: split.bulge,
            deviatoric_gradients: self.gradients(split.derivative.map(|column| column * scale)),
            hydrostatic_gradients: self.gradients(split.cofactor),
            #[cfg(test)]
            slope_squared: R::ZERO,
        }
    }

    /// `Ψ_D / μ` and its derivative, the derivative of the volume term and `J - 1`, the latter scaled down beyond
    /// [`MAX_COFACTOR_NORM`].
    fn split_energy(&self, x: [R::Vector; 4]) -> SplitEnergy<R> {
        let [a, b, c] = self.deformation(x);
        let mut cofactor = [R::cross(b, c), R::cross(c, a), R::cross(a, b)];
        let mut bulge = R::dot(a, cofactor[0]) - R::ONE;
        let [aa, bb, cc] = [a, b, c].map(|column| R::dot(column, column) - R::ONE);
        let (ab, ac, bc) = (R::dot(a, b), R::dot(a, c), R::dot(b, c));
        let second = aa * bb + aa * cc + bb * cc - ab * ab - ac * ac - bc * bc;
        let third = aa * (bb * cc - bc * bc) - ab * (ab * cc - bc * ac) + ac * (ab * bc - bb * ac);
        let mut shear = bulge * bulge - (second + third) * R::HALF;
        let trace = aa + bb + cc;
        let square = cofactor.iter().fold(R::ZERO, |sum, &c| sum + R::dot(c, c));
        let limit = R::from_f64(MAX_COFACTOR_NORM);
        let is_steep = square > limit * limit;
        if is_steep {
            let scale = limit / square.sqrt();
            cofactor = cofactor.map(|column| column * scale);
            bulge *= scale;
        }
        let is_large = is_steep || trace > R::from_f64(LARGE_STRAIN);
        if is_large {
            shear = trace * R::HALF - bulge + bulge * bulge * R::HALF;
        }
        let pressure = bulge - R::ONE;
        SplitEnergy {
            shear,
            derivative: [
                a + cofactor[0] * pressure,
                b + cofactor[1] * pressure,
                c + cofactor[2] * pressure,
            ],
            cofactor,
            bulge,
            #[cfg(test)]
            far: is_large || (square < R::ONE && square > R::ZERO),
        }
    }

    /// The gradients at the corners of a function of F with the given derivative.
    #[inline]
    fn gradients(&self, derivative: [R::Vector; 3]) -> [R::Vector; 4] {
        let q = &self.inverse_rest;
        let [d1, d2, d3] = derivative;
        let g1 = d1 * q[0] + d2 * q[1] + d3 * q[2];
        let g2 = d1 * q[3] + d2 * q[4] + d3 * q[5];
        let g3 = d1 * q[6] + d2 * q[7] + d3 * q[8];
        [-(g1 + g2 + g3), g1, g2, g3]
    }
}

impl TetConstraint<f64> {
    /// The elastic energy in J of the tet as the solver has it, softened or left out; 0 at rest.
    pub(crate) fn energy(&self, e: &Evaluation<f64>) -> f64 {
        let at_rest = 1.0 - self.gamma;
        let shape = e.deviatoric * e.deviatoric - 3.0;
        let bulge = e.hydrostatic * e.hydrostatic - at_rest * at_rest;
        0.5 * self.stiffness * (shape + self.ratio * bulge)
    }
}

#[cfg(test)]
impl<R: Float> Evaluation<R> {
    /// What solvers scale the hydrostatic constraint by: 1, or less where det F has a slope beyond
    /// [`MAX_COFACTOR_NORM`].
    pub(crate) fn hydrostatic_scale(&self) -> R {
        let limit = R::from_f64(MAX_COFACTOR_NORM);
        if self.slope_squared > limit * limit {
            limit / self.slope_squared.sqrt()
        } else {
            R::ONE
        }
    }
}

#[cfg(test)]
impl<R: Float> TetConstraint<R> {
    /// The changes of both multipliers that satisfy both constraints to first order, `None` if there is no way to.
    ///
    /// The equations are multiplied by stiffness and time squared, which makes the matrix one plus numbers of the order
    /// of kappa: as they are usually written, with compliances, they leave the range of single precision for a body of
    /// micrometers.
    pub(crate) fn solve(
        &self,
        e: &Evaluation<R>,
        weights: [R; 4],
        multipliers: [R; 2],
        time_squared: R,
    ) -> Option<[R; 2]> {
        let stiffness = self.stiffness * time_squared;
        let scale = e.hydrostatic_scale();
        let ratio = self.ratio * scale * scale;
        let weights = weights.map(|w| w * stiffness);
        let weighted = |g: &[R::Vector; 4], h: &[R::Vector; 4]| {
            weights[0] * R::dot(g[0], h[0])
                + weights[1] * R::dot(g[1], h[1])
                + weights[2] * R::dot(g[2], h[2])
                + weights[3] * R::dot(g[3], h[3])
        };
        // The matrix is one plus [m11, m12; ratio · m12, ratio · m22].
        let m11 = weighted(&e.deviatoric_gradients, &e.deviatoric_gradients);
        let m22 = weighted(&e.hydrostatic_gradients, &e.hydrostatic_gradients);
        let m12 = weighted(&e.deviatoric_gradients, &e.hydrostatic_gradients);
        // At rest the gradients are parallel and only the one keeps the system regular. The difference is not negative
        // (Cauchy-Schwarz); where rounding says otherwise, it is noise. Overflow makes it NaN and stays so.
        let parallel = m11 * m22 - m12 * m12;
        let parallel = if parallel < R::ZERO {
            R::ZERO
        } else {
            parallel
        };
        let inverse = R::ONE / (ratio * (parallel + m22) + m11 + R::ONE);
        let b1 = -(stiffness * e.deviatoric + multipliers[0]);
        let b2 = -(stiffness * ratio * e.hydrostatic + multipliers[1]);
        let d1 = ((ratio * m22 + R::ONE) * b1 - m12 * b2) * inverse;
        let d2 = ((m11 + R::ONE) * b2 - ratio * m12 * b1) * inverse;
        (d1 + d2).is_finite().then_some([d1, d2])
    }
}

#[cfg(test)]
impl<R: Float> TetConstraint<R> {
    /// The changes of both multipliers of the split form in a single iteration.
    pub(crate) fn solve_split(
        &self,
        e: &Evaluation<R>,
        weights: [R; 4],
        time_squared: R,
    ) -> [R; 2] {
        let stiffness = self.stiffness * time_squared;
        let weighted = |g: &[R::Vector; 4], h: &[R::Vector; 4]| {
            let products = (0..4).map(|k| weights[k] * R::dot(g[k], h[k]));
            products.fold(R::ZERO, |sum, product| sum + product)
        };
        // (1 - e⁻ʳ) / r as in the kernel.
        let [four, six] = [4.0, 6.0].map(R::from_f64);
        let decay = |r: R| (six + r) / (six + r * (four + r));
        let steepness = stiffness * weighted(&e.deviatoric_gradients, &e.deviatoric_gradients);
        // No step that is unstable in a direction of the tet: `2 Σ w |q|²` bounds its stiffness.
        let q = self.inverse_rest;
        let first = [0, 1, 2].map(|axis| q[axis] + q[3 + axis] + q[6 + axis]);
        let [second, third, fourth] = [0, 3, 6].map(|row| [q[row], q[row + 1], q[row + 2]]);
        let squares = [first, second, third, fourth].map(|[a, b, c]| a * a + b * b + c * c);
        let trace = (0..4).fold(R::ZERO, |sum, k| sum + weights[k] * squares[k]);
        let (part, limit) = (decay(steepness), R::ONE / ((trace + trace) * stiffness));
        let part = if part > limit { limit } else { part };
        let d1 = -(stiffness * e.deviatoric * part);
        let seen = e.hydrostatic + d1 * weighted(&e.deviatoric_gradients, &e.hydrostatic_gradients);
        let lame = stiffness * (self.ratio - R::ONE);
        let m = weighted(&e.hydrostatic_gradients, &e.hydrostatic_gradients);
        [d1, -(lame * seen) * decay(lame * m)]
    }

    /// The energy of the split form over `μV`, and whether a step may raise it.
    pub(crate) fn split_energy_and_far(&self, x: [R::Vector; 4]) -> (R, bool) {
        let split = self.split_energy(x);
        let volume = (self.ratio - R::ONE) * R::HALF * split.bulge * split.bulge;
        (split.shear + volume, split.far)
    }

    /// The part of a step from `x` that the split form takes.
    pub(crate) fn descent(&self, x: [R::Vector; 4], step: [R::Vector; 4]) -> R {
        let (before, far) = self.split_energy_and_far(x);
        let e = self.evaluate_split(x);
        let gradients = (0..4).map(|k| {
            let stress = e.deviatoric_gradients[k] * e.deviatoric
                + e.hydrostatic_gradients[k] * (e.hydrostatic * (self.ratio - R::ONE));
            R::dot(stress, step[k])
        });
        let slope = gradients.fold(R::ZERO, |sum, product| sum + product);
        let mut part = R::ONE;
        for _ in 0..SHORTENINGS {
            let moved = [0, 1, 2, 3].map(|k| x[k] + step[k] * part);
            let rise = self.split_energy_and_far(moved).0 - before;
            if !far || rise <= R::ZERO {
                break;
            }
            let along = slope * part;
            let shorter = -(along * R::HALF) / (rise - along) * part;
            part = if shorter > R::ZERO { shorter } else { R::ZERO };
        }
        part
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;

    const RUBBER: Material = Material {
        young_modulus: 1e6,
        poisson_ratio: 0.45,
        density: 1e3,
        damping: 0.0,
    };

    pub(crate) fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from_array)
    }

    /// A tet at rest of volume above 1e-3 in a cube of edge 2.
    pub(crate) fn rest() -> impl Strategy<Value = [DVec3; 4]> {
        let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).cross(c - a).dot(d - a) / 6.0;
        prop::array::uniform4(point()).prop_filter_map("flat", move |[a, b, c, d]| {
            let rest = if volume([a, b, c, d]) > 0.0 {
                [a, b, c, d]
            } else {
                [a, c, b, d]
            };
            (volume(rest) > 1e-3).then_some(rest)
        })
    }

    /// Deformations of every kind: general (half of them inverted), nearly singular, mirrored.
    fn deformation() -> impl Strategy<Value = DMat3> {
        let columns = || prop::array::uniform3(point().prop_map(|v| v * 2.0));
        let general = columns().prop_map(|[a, b, c]| DMat3::from_cols(a, b, c));
        let singular = (columns(), -1.0..1.0f64)
            .prop_map(|([a, b, c], s)| DMat3::from_cols(a, b, a * s + b + c * 1e-9));
        let mirrored = columns().prop_map(|[a, b, c]| {
            DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)) + DMat3::from_cols(a, b, c) * 0.05
        });
        let any = prop_oneof![general, singular, mirrored];
        // At F = 0 the norm has no gradient; near it, differences cannot see it.
        any.prop_filter("all but collapsed", |f| f.col(0).length() > 0.1)
    }

    proptest! {
        /// Central differences of step h leave h² |Q|³ / |F|² (1e-9 of |Q|) and rounding 1e-16 |F| / h (1e-10 of |Q|);
        /// the determinant is linear in each corner, so only rounding is left of it.
        #[test]
        fn gradients_are_the_slopes_of_the_constraints(
            rest in rest(),
            f in deformation(),
            shift in point(),
        ) {
            let tet = TetConstraint::<f64>::new([0, 1, 2, 3], rest, &RUBBER);
            let x = rest.map(|x| f * x + shift);
            let e = tet.evaluate(x);
            let q = tet.inverse_rest.iter().map(|v| v * v).sum::<f64>().sqrt();
            let step = 1e-5 / q;
            let size = e.deviatoric;
            for k in 0..4 {
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let [low, high] = [-step, step].map(|s| {
                        let mut moved = x;
                        moved[k] += axis * s;
                        tet.evaluate(moved)
                    });
                    let slope = (high.deviatoric - low.deviatoric) / (2.0 * step);
                    let error = (slope - e.deviatoric_gradients[k].dot(axis)).abs();
                    prop_assert!(error <= 1e-7 * q, "deviatoric: {error:e}, scale {q:e}");
                    let slope = (high.hydrostatic - low.hydrostatic) / (2.0 * step);
                    let error = (slope - e.hydrostatic_gradients[k].dot(axis)).abs();
                    let scale = q * (size * size).max(size);
                    prop_assert!(error <= 1e-7 * scale, "hydrostatic: {error:e}, scale {scale:e}");
                }
            }
        }

        /// What keeps momentum: corrections neither push nor turn a tet as a whole. In units of |Q|, |Q| |x|.
        #[test]
        fn gradients_neither_push_nor_turn(rest in rest(), f in deformation()) {
            let tet = TetConstraint::<f64>::new([0, 1, 2, 3], rest, &RUBBER);
            let x = rest.map(|x| f * x);
            let e = tet.evaluate(x);
            for gradients in [e.deviatoric_gradients, e.hydrostatic_gradients] {
                let push: DVec3 = gradients.iter().sum();
                let turn: DVec3 = (0..4).map(|k| x[k].cross(gradients[k])).sum();
                let scale: f64 = gradients.iter().map(|g| g.length()).sum();
                prop_assert!(push.length() <= 1e-14 * scale);
                prop_assert!(turn.length() <= 1e-13 * scale * 20.0, "{turn}");
            }
        }
    }

    /// The multipliers at rest are those of the stress that both constraints hold against each other.
    #[test]
    fn multipliers_at_rest_are_the_exact_ones() {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let tet = TetConstraint::<f64>::new([0, 1, 2, 3], rest, &RUBBER);
        for time in [1e-6, 1e-3, 1.0] {
            let weights = [0.024; 4];
            let e = tet.evaluate(rest);
            let change = tet
                .solve(&e, weights, [0.0; 2], time * time)
                .expect("at rest there is a solution");
            let stress = RUBBER.mu() / 6.0 * time * time;
            assert!((change[0] / (-3.0f64.sqrt() * stress) - 1.0).abs() < 1e-9);
            assert!((change[1] / stress - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_tet_without_volume_takes_no_part() {
        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y];
        let inverted = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::Z];
        for rest in [flat, inverted, [DVec3::ONE; 4]] {
            let tet = TetConstraint::<f32>::new([0, 1, 2, 3], rest, &RUBBER);
            assert_eq!(tet.inverse_rest, [0.0; 9]);
            assert_eq!(tet.stiffness, 0.0);
            let e = tet.evaluate(rest.map(|x| (x * 2.0).as_vec3()));
            assert_eq!(e.deviatoric_gradients, [glam::Vec3::ZERO; 4]);
            assert_eq!(e.hydrostatic_gradients, [glam::Vec3::ZERO; 4]);
        }
    }
}
