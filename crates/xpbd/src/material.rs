//! [`Material`]: elastic constants, density and damping of a body, and the constants of its Stable Neo-Hookean energy.
//!
//! The energy density is `μ/2 (|F|² - 3) + l/2 (det F - γ)²` with `l = λ + μ` and `γ = 1 + μ/l`. Written with the Lamé
//! λ in place of `l`, as it is often printed, the material would have the small-strain constant `λ - μ`: at Poisson's
//! ratio 0.3 its stiffness would be a tenth too low, below 0.25 it would not exist.
//! Source: Smith, de Goes, Kim 2018, section 3.4; Macklin and Müller 2021.

use crate::XpbdError;

/// The material of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Material {
    /// Young's modulus in Pa, positive.
    pub young_modulus: f64,
    /// Poisson's ratio, from 0 to below 0.5.
    pub poisson_ratio: f64,
    /// Mass density at rest in kg/m³, positive.
    pub density: f64,
    /// Damping time τ in s; 0 is none. A Kelvin-Voigt viscosity of τ times the stiffness (Rayleigh damping with
    /// `β = τ`): a vibration of angular frequency ω is damped by the fraction `τ ω / 2` of critical, in shear and in
    /// volume. It acts on strain rates, so it moves no equilibrium and does not resist rotation.
    pub damping: f64,
}

impl Material {
    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Material`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Material { what, value, range });
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.young_modulus) {
            return refuse("young_modulus", self.young_modulus, "positive and finite");
        }
        if !(0.0..0.5).contains(&self.poisson_ratio) {
            return refuse(
                "poisson_ratio",
                self.poisson_ratio,
                "at least 0 and below 0.5",
            );
        }
        if !positive(self.density) {
            return refuse("density", self.density, "positive and finite");
        }
        if !(self.damping.is_finite() && self.damping >= 0.0) {
            return refuse("damping", self.damping, "at least 0 and finite");
        }
        Ok(())
    }

    /// Returns Lamé's second constant μ (the shear modulus) in Pa.
    #[must_use]
    pub fn mu(&self) -> f64 {
        self.young_modulus / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// Returns the factor `l = λ + μ` of the volume term in Pa.
    #[must_use]
    pub fn volume_stiffness(&self) -> f64 {
        let nu = self.poisson_ratio;
        let lambda = self.young_modulus * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
        lambda + self.mu()
    }

    /// Returns the rest value `γ = 1 + μ/l` of the determinant in the volume term, which makes the rest shape free of
    /// stress.
    #[must_use]
    pub fn gamma(&self) -> f64 {
        1.0 + self.mu() / self.volume_stiffness()
    }
}
