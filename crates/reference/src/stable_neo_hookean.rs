//! [`StableNeoHookean`]: energy density, stress and stiffness as functions of the deformation gradient.
//!
//! `Ψ(F) = μ/2 (|F|² - 3) + l/2 (J - γ)²` with `J = det F`, minus its value at rest. Stress is its first derivative,
//! `P = μ F + l (J - γ) cof F`; stiffness its second, a 9×9 matrix over the entries of F column by column:
//! `μ I + l g gᵀ + l (J - γ) ∂²J/∂F²` with `g = vec cof F`.
//!
//! Source: Smith, de Goes, Kim 2018, equations 13 to 19 (the energy without its barrier against the point).
//! Cost: about 100 operations for the stress, 300 for the stiffness.

use glam::{DMat3, DVec3};

use crate::symmetric::Matrix9;

/// Stable Neo-Hookean material, given by the constants of its energy; [`crate::Material::law`] computes them.
///
/// ```
/// use glam::DMat3;
/// use incise_reference::Material;
///
/// let law = Material { young_modulus: 1e5, poisson_ratio: 0.45, density: 1000.0 }.law();
/// assert_eq!(law.energy_density(DMat3::IDENTITY), 0.0);
/// // Small stretches follow Hooke's law: (λ + 2 μ) times the strain.
/// let strain = 1e-6;
/// let mut stretched = DMat3::IDENTITY;
/// stretched.x_axis.x += strain;
/// let modulus = law.l - law.mu + 2.0 * law.mu;
/// assert!((law.stress(stretched).x_axis.x / (modulus * strain) - 1.0).abs() < 1e-5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Shear modulus μ in Pa.
    pub mu: f64,
    /// Factor `l` of the volume term in Pa: Lamé's λ plus μ.
    pub l: f64,
    /// Value of `det F` at which the volume term is zero: `1 + μ/l`.
    pub gamma: f64,
}

impl StableNeoHookean {
    /// Energy density Ψ(F) in J/m³: 0 at rest, its minimum.
    #[must_use]
    pub fn energy_density(&self, f: DMat3) -> f64 {
        let j = f.determinant();
        // (J - γ)² - (1 - γ)² as a product: the difference would lose its digits to cancellation near rest.
        0.5 * (self.mu * (square(f) - 3.0) + self.l * (j - 1.0) * (j + 1.0 - 2.0 * self.gamma))
    }

    /// First Piola-Kirchhoff stress `∂Ψ/∂F` in Pa.
    #[must_use]
    pub fn stress(&self, f: DMat3) -> DMat3 {
        f * self.mu + cofactor(f) * (self.l * (f.determinant() - self.gamma))
    }

    /// Stiffness `∂²Ψ/∂F²` in Pa, with the entries of F in column-major order.
    #[must_use]
    pub fn stiffness(&self, f: DMat3) -> Matrix9 {
        let g = cofactor(f).to_cols_array();
        let pressure = self.l * (f.determinant() - self.gamma);
        let mut h: Matrix9 =
            std::array::from_fn(|i| std::array::from_fn(|j| self.l * (g[i] * g[j])));
        for (i, row) in h.iter_mut().enumerate() {
            row[i] += self.mu;
        }
        // ∂cof F/∂F: from f₁ × f₂ = [f₁] f₂ and its cyclic permutations, off-diagonal blocks of cross products.
        for (i, j, axis) in [(0, 1, -f.z_axis), (0, 2, f.y_axis), (1, 2, -f.x_axis)] {
            let cross = cross_matrix(axis * pressure);
            for (c, column) in cross.iter().enumerate() {
                for (r, entry) in column.to_array().into_iter().enumerate() {
                    h[3 * i + r][3 * j + c] += entry;
                    h[3 * j + c][3 * i + r] += entry;
                }
            }
        }
        h
    }

    /// Bound of the size of each term of the stress, in Pa: near rest the terms cancel and only their rounding error is
    /// left.
    pub(crate) fn stress_terms(&self, f: DMat3) -> f64 {
        let cofactor = square(cofactor(f)).sqrt();
        self.mu * square(f).sqrt() + self.l * (f.determinant().abs() + self.gamma) * cofactor
    }

    /// Bound of the size of each term of the energy density, in J/m³: near rest the terms cancel and only their
    /// rounding error is left.
    pub(crate) fn energy_terms(&self, f: DMat3) -> f64 {
        let bulge = f.determinant().abs() + self.gamma;
        0.5 * self.mu * (square(f) + 3.0) + 0.5 * self.l * bulge * bulge
    }

    /// Bound of the norm of the stiffness, in Pa.
    pub(crate) fn stiffness_bound(&self, f: DMat3) -> f64 {
        let pressure = self.l * (f.determinant() - self.gamma).abs();
        self.mu + self.l * square(cofactor(f)) + pressure * square(f).sqrt()
    }
}

/// Cofactor matrix: the derivative of the determinant.
fn cofactor(f: DMat3) -> DMat3 {
    let (a, b, c) = (f.x_axis, f.y_axis, f.z_axis);
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

/// Squared Frobenius norm.
fn square(f: DMat3) -> f64 {
    f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared()
}

/// Columns of the cross-product matrix of `a`.
fn cross_matrix(a: DVec3) -> [DVec3; 3] {
    [a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z)]
}
