//! [`TetConstraint`]: a Stable Neo-Hookean tet as two constraints, solved together.
//!
//! With deformation gradient F, the deviatoric constraint is `C_D = |F|` and the hydrostatic one `C_H = det F - γ`;
//! half their squares over the compliances `1/(μV)` and `1/(lV)` are the energy exactly. At rest both gradients are
//! parallel, so solving one after the other lets them fight; solved as one 2×2 system the rest shape stays at rest
//! whatever the stiffness.
//!
//! Source: Macklin and Müller 2021 (constraints), Ton-That et al. 2023 (block solve), paper equations 5 and 6. The
//! paper prints a minus in its equation 6; its equation 3 gives the plus used here. Cost: about 390 operations, one
//! square root and three divisions a tet.

use glam::{DMat3, DVec3};

use crate::{Material, Real};

/// A tet with what the solver needs of its rest shape: 64 bytes in single precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TetConstraint<R> {
    pub(crate) particles: [u32; 4],
    /// Inverse of the rest edge matrix, row by row: row i is the gradient of the barycentric coordinate of corner i + 1.
    pub(crate) inverse_rest: [R; 9],
    /// `1/(μV)` and `1/(lV)` in 1/J.
    pub(crate) compliance: [R; 2],
    pub(crate) gamma: R,
}

/// Both constraints with their gradients at the four corners.
pub(crate) struct Evaluation<R: Real> {
    pub(crate) deviatoric: R,
    pub(crate) hydrostatic: R,
    pub(crate) deviatoric_gradients: [R::Vector; 4],
    pub(crate) hydrostatic_gradients: [R::Vector; 4],
}

impl<R: Real> TetConstraint<R> {
    /// Prepares a tet; everything is computed in double precision and rounded once.
    pub(crate) fn new(particles: [u32; 4], rest: [DVec3; 4], material: &Material) -> Self {
        let [a, b, c, d] = rest;
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let volume = edges.determinant() / 6.0;
        let inverse = edges.inverse();
        let rows = [inverse.row(0), inverse.row(1), inverse.row(2)];
        let representable = |v: f64| R::from_f64(v).is_finite();
        let sound = volume > 0.0
            && rows
                .iter()
                .all(|r| r.to_array().into_iter().all(representable));
        // A tet too flat to be represented takes no part: zero gradients leave its corners to its neighbors.
        let entry = |v: f64| if sound { R::from_f64(v) } else { R::ZERO };
        let compliance =
            [material.mu(), material.volume_stiffness()].map(|k| R::from_f64(1.0 / (k * volume)));
        Self {
            particles,
            inverse_rest: std::array::from_fn(|i| entry(rows[i / 3][i % 3])),
            compliance,
            gamma: R::from_f64(material.gamma()),
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
        self.compliance = self.compliance.map(|c| R::from_f64(c.to_f64() * factor));
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

    /// The changes of both multipliers that satisfy both constraints to first order, `None` if there is no way to.
    ///
    /// `rates` are the damped rates `γ ∇C · (x - xₙ)` with `damping` γ; both are zero without damping.
    #[inline(always)]
    pub(crate) fn solve(
        &self,
        e: &Evaluation<R>,
        weights: [R; 4],
        multipliers: [R; 2],
        per_time_squared: R,
        damping: R,
        rates: [R; 2],
    ) -> Option<[R; 2]> {
        let weighted = |g: &[R::Vector; 4], h: &[R::Vector; 4]| {
            weights[0] * R::dot(g[0], h[0])
                + weights[1] * R::dot(g[1], h[1])
                + weights[2] * R::dot(g[2], h[2])
                + weights[3] * R::dot(g[3], h[3])
        };
        let [a1, a2] = [
            self.compliance[0] * per_time_squared,
            self.compliance[1] * per_time_squared,
        ];
        let damped = R::ONE + damping;
        let s11 = damped * weighted(&e.deviatoric_gradients, &e.deviatoric_gradients);
        let s22 = damped * weighted(&e.hydrostatic_gradients, &e.hydrostatic_gradients);
        let s12 = damped * weighted(&e.deviatoric_gradients, &e.hydrostatic_gradients);
        // At rest the gradients are parallel and only the compliances keep the system regular. The first difference is
        // not negative (Cauchy-Schwarz); where rounding says otherwise, it is noise.
        let parallel = s11 * s22 - s12 * s12;
        let parallel = if parallel > R::ZERO {
            parallel
        } else {
            R::ZERO
        };
        let determinant = parallel + a1 * s22 + a2 * s11 + a1 * a2;
        let b1 = -(e.deviatoric + a1 * multipliers[0] + rates[0]);
        let b2 = -(e.hydrostatic + a2 * multipliers[1] + rates[1]);
        let inverse = R::ONE / determinant;
        let d1 = ((s22 + a2) * b1 - s12 * b2) * inverse;
        let d2 = ((s11 + a1) * b2 - s12 * b1) * inverse;
        (determinant > R::ZERO && (d1 + d2).is_finite()).then_some([d1, d2])
    }
}
