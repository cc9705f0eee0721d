//! Expected error of a substep, and the largest kappa for an accuracy.
//!
//! The error of a colored Gauss-Seidel pass in the split form was measured against Newton's method on held, twisted and
//! compressed bars of kappa 1/32 to 1/2 and Poisson's ratio 0 to 0.49 (`tests/suite/reference.rs` of `incise-xpbd`).
//! With `x = kappa · λ/E` (λ is Lamé's first constant) a state at rest is off by at most
//! `0.03 kappa + 0.07 kappa² + 0.085 x² / (1 + 0.6 x)` of the displacement, and a motion over some periods, which a
//! substep damps, by at most `0.13 √kappa` (`cargo xtask defaults`). Beyond a Poisson's ratio of 0.49 the error at rest
//! is assumed to grow with λ/E as well. The block and sequential forms have `0.03 kappa + 0.1 x` at rest. The larger of
//! both is the expected error. Cost: O(1) a tet.

use incise_xpbd::{Material, TetSolve};

/// The accuracy of `substeps = "auto"` in a scene that does not state one: a tenth of the motion.
pub(crate) const DEFAULT_ACCURACY: f64 = 0.1;

/// λ/E at the largest Poisson's ratio of the measurements, 0.49.
const MEASURED: f64 = 16.44;

/// The expected error of a tet with a kappa, as a fraction of the motion.
pub(crate) fn expected_error(kappa: f64, poisson_ratio: f64, form: TetSolve) -> f64 {
    let nu = poisson_ratio;
    let lame = nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let x = kappa * lame;
    let beyond = (lame / MEASURED).max(1.0);
    let at_rest = match form {
        TetSolve::Split => 0.03 * kappa + 0.07 * kappa * kappa + 0.085 * x * x / (1.0 + 0.6 * x),
        TetSolve::Block | TetSolve::Sequential => 0.03 * kappa + 0.1 * x,
    };
    (beyond * at_rest).max(0.13 * kappa.sqrt())
}

/// The largest kappa of which the expected error is at most `accuracy`.
pub(crate) fn largest_kappa(accuracy: f64, poisson_ratio: f64, form: TetSolve) -> f64 {
    // The error grows with kappa; 60 halvings leave nothing of the interval in double precision.
    let (mut low, mut high) = (0.0, 1e6);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if expected_error(middle, poisson_ratio, form) <= accuracy {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// [`largest_kappa`] of each material.
pub(crate) fn largest_kappas(accuracy: f64, materials: &[Material], form: TetSolve) -> Vec<f64> {
    let of = |material: &Material| largest_kappa(accuracy, material.poisson_ratio, form);
    materials.iter().map(of).collect()
}

/// Whether the volume term causes the expected error of a tet: at the same kappa and a Poisson's ratio of 0.45 it would
/// be less than half.
pub(crate) fn is_nearly_incompressible(kappa: f64, poisson_ratio: f64, form: TetSolve) -> bool {
    poisson_ratio > 0.45
        && expected_error(kappa, poisson_ratio, form) > 2.0 * expected_error(kappa, 0.45, form)
}

/// The volume of the tets that are solved less accurately than the accuracy wanted, updated by cuts.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct OutsideVolume {
    /// The largest accurate kappa by material; empty where no accuracy is judged.
    limits: Vec<f64>,
    /// Volume at rest in m³ outside the accuracy, now and when substeps were chosen.
    pub(crate) outside: f64,
    pub(crate) at_choice: f64,
}

impl OutsideVolume {
    /// Measures all tets, given by material, kappa and volume.
    pub(crate) fn new(limits: Vec<f64>, tets: impl Iterator<Item = (u16, f64, f64)>) -> Self {
        let mut volume = Self {
            limits,
            outside: 0.0,
            at_choice: 0.0,
        };
        tets.for_each(|tet| volume.add(tet));
        volume.at_choice = volume.outside;
        volume
    }

    fn of(&self, (material, kappa, volume): (u16, f64, f64)) -> f64 {
        let limit = self.limits.get(usize::from(material));
        if limit.is_some_and(|&limit| kappa > limit) {
            volume
        } else {
            0.0
        }
    }

    /// Adds a tet, given by material, kappa and volume.
    pub(crate) fn add(&mut self, tet: (u16, f64, f64)) {
        self.outside += self.of(tet);
    }

    /// Removes a tet.
    pub(crate) fn remove(&mut self, tet: (u16, f64, f64)) {
        self.outside = (self.outside - self.of(tet)).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Measured sag errors of a held beam under its weight, in `tests/suite/reference.rs` of `incise-xpbd`: the law is an
    /// upper bound, and no more than four times as large where rest decides.
    #[test]
    fn the_law_bounds_what_was_measured() {
        for (nu, kappa, measured) in [
            (0.0, 0.5, 0.017),
            (0.3, 0.5, 0.025),
            (0.3, 0.25, 0.0081),
            (0.45, 0.5, 0.126),
            (0.45, 0.25, 0.042),
            (0.45, 0.125, 0.0128),
            (0.49, 0.5, 0.618),
            (0.49, 0.25, 0.304),
            (0.49, 0.125, 0.123),
            (0.49, 0.0625, 0.040),
            (0.49, 0.03125, 0.0118),
        ] {
            let expected = expected_error(kappa, nu, TetSolve::Split);
            assert!(expected >= measured, "{nu}, {kappa}: {expected}");
            if measured > 0.1 {
                assert!(expected < 2.0 * measured, "{nu}, {kappa}: {expected}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_largest_kappa_has_the_accuracy(
            accuracy in 1e-4..1.0f64,
            nu in 0.0..0.4999f64,
            block in any::<bool>(),
        ) {
            let form = if block { TetSolve::Block } else { TetSolve::Split };
            let kappa = largest_kappa(accuracy, nu, form);
            let error = expected_error(kappa, nu, form);
            prop_assert!((error / accuracy - 1.0).abs() < 1e-6, "{error} for {accuracy}");
        }
    }
}
