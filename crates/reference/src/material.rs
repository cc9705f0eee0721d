//! [`Material`]: engineering constants of a tet.

use crate::{ReferenceError, StableNeoHookean};

/// The material of a tet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus in Pa, positive.
    pub young_modulus: f64,
    /// Poisson's ratio, from 0 to below 0.5.
    pub poisson_ratio: f64,
    /// Mass density at rest in kg/m³, positive.
    pub density: f64,
}

impl Material {
    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`ReferenceError::Material`] names the first value outside its range.
    pub fn check(&self) -> Result<(), ReferenceError> {
        let refuse = |what, value, range| Err(ReferenceError::Material { what, value, range });
        for (what, value) in [
            ("young_modulus", self.young_modulus),
            ("density", self.density),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return refuse(what, value, "positive and finite");
            }
        }
        if !(0.0..0.5).contains(&self.poisson_ratio) {
            return refuse(
                "poisson_ratio",
                self.poisson_ratio,
                "at least 0 and below 0.5",
            );
        }
        Ok(())
    }

    /// Energy density as a function of the deformation gradient.
    ///
    /// With Lamé's `λ = 2 μ ν / (1 - 2 ν)` the volume term has the factor `l = λ + μ = μ / (1 - 2 ν)` and is zero at `γ
    /// = 1 + μ / l = 2 (1 - ν)`.
    #[must_use]
    pub fn law(&self) -> StableNeoHookean {
        let nu = self.poisson_ratio;
        let mu = 0.5 * self.young_modulus / (1.0 + nu);
        StableNeoHookean {
            mu,
            l: mu / (1.0 - 2.0 * nu),
            gamma: 2.0 * (1.0 - nu),
        }
    }
}
