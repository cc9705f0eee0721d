//! [`Choice`]: the number of substeps that `auto` chooses for a body.
//!
//! The error of a substep grows with kappa, `E Δt² / (ρ h²)` with h the smallest altitude of a tet, and with Poisson's
//! ratio (`accuracy.rs`). Kappa falls with the square of the number of substeps. One pass over the tets at rest gives
//! the number that every tet needs for the accuracy wanted; the largest decides, with two exceptions, which are
//! reported. The number is capped. And a few slivers do not decide for the whole body: tets that need more than twice
//! the substeps of all others, together less than a thousandth of the volume, are solved less accurately.
//!
//! Source: kappa is the square of a Courant number; that substeps and not iterations make XPBD accurate, Macklin et al.
//! 2019. Cost: O(n log n) for each choice.

use incise_xpbd::TetSolve;
use serde::Serialize;

use crate::accuracy::{expected_error, is_nearly_incompressible};

/// Largest share of a body's volume that its slivers have together.
const SLIVER_VOLUME: f64 = 1e-3;

/// Slivers have more than this many times the kappa of all other tets, that is, they need more than twice as many substeps.
const SLIVER_KAPPA: f64 = 4.0;

/// Reason for fewer substeps than all tets need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Deserialize))]
pub enum Shortfall {
    /// More than `max_substeps` are needed.
    Cap,
    /// More are needed than `budget_ms` allows.
    Budget,
    /// Cuts need more than twice the number of the start.
    Growth,
    /// Cuts need substeps too short for single precision.
    Precision,
    /// Only a few slivers need more.
    Sliver,
}

/// Choice of substeps by `auto` for a body, and its expected error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Choice {
    /// Number of substeps that would solve every tet with the accuracy wanted.
    pub substeps_wanted: u32,
    /// The substeps that would solve all tets but slivers with it.
    #[serde(skip)]
    pub(crate) substeps_needed: u32,
    /// The number that was chosen; that of the body is larger if it is joined to one with more.
    #[serde(skip)]
    pub substeps: u32,
    /// Reason for a smaller number than `substeps_wanted`, if it is smaller; the cap takes precedence.
    pub shortfall: Option<Shortfall>,
    /// Number of tets that were ignored as slivers.
    pub sliver_tets: usize,
    /// Share of the slivers in the volume at rest.
    pub sliver_volume_fraction: f64,
    /// The expected error of all other tets with the chosen number, as a fraction of the motion; 1 stands for 1 or more.
    pub expected_error: f64,
    /// Whether that error comes from a Poisson's ratio near 0.5.
    #[serde(skip)]
    pub(crate) nearly_incompressible: bool,
    /// Whether VBD takes the place of substeps.
    #[serde(skip)]
    pub(crate) by_vbd: bool,
}

/// A choice with the fields that reports leave out: `#[serde(with = "saved")]`.
#[cfg(feature = "save")]
pub(crate) mod saved {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Choice, Shortfall};

    #[derive(Serialize, Deserialize)]
    #[serde(remote = "Choice")]
    struct All {
        substeps_wanted: u32,
        substeps_needed: u32,
        substeps: u32,
        shortfall: Option<Shortfall>,
        sliver_tets: usize,
        sliver_volume_fraction: f64,
        expected_error: f64,
        nearly_incompressible: bool,
        by_vbd: bool,
    }

    #[derive(Serialize, Deserialize)]
    struct Saved(#[serde(with = "All")] Choice);

    pub(crate) fn serialize<S: Serializer>(
        choice: &Option<Choice>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        choice.map(Saved).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Choice>, D::Error> {
        let saved = Option::<Saved>::deserialize(deserializer)?;
        Ok(saved.map(|saved| saved.0))
    }
}

impl Choice {
    /// Returns the choice with two-level VBD of this expected error in place of too many substeps.
    pub(crate) fn solved_by_vbd(self, expected_error: f64) -> Self {
        Self {
            substeps: 1,
            shortfall: None,
            sliver_tets: 0,
            sliver_volume_fraction: 0.0,
            expected_error,
            nearly_incompressible: false,
            by_vbd: true,
            ..self
        }
    }
}

/// A tet as the choice of substeps sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TetDemand {
    /// At one substep.
    pub(crate) kappa: f64,
    /// The largest kappa of the accuracy wanted.
    pub(crate) largest_kappa: f64,
    pub(crate) poisson_ratio: f64,
    pub(crate) volume: f64,
}

impl TetDemand {
    /// Kappa at one substep over the largest accurate one: the square of the substeps needed.
    fn excess(&self) -> f64 {
        self.kappa / self.largest_kappa
    }
}

/// Chooses substeps.
pub(crate) fn choose(tets: Vec<TetDemand>, max_substeps: u32, form: TetSolve) -> Choice {
    evaluate(tets, |needed| needed.min(max_substeps), form)
}

/// Evaluates the number of substeps that `take` returns for the needed one.
pub(crate) fn evaluate(
    mut tets: Vec<TetDemand>,
    take: impl FnOnce(u32) -> u32,
    form: TetSolve,
) -> Choice {
    tets.sort_unstable_by(|a, b| b.excess().total_cmp(&a.excess()));
    let stiffest = tets.first().map_or(0.0, TetDemand::excess);
    let total: f64 = tets.iter().map(|tet| tet.volume).sum();
    // The first tet that belongs to the bulk however the slivers are counted.
    let mut sum = 0.0;
    let bulk = tets.iter().find(|tet| {
        sum += tet.volume;
        sum >= SLIVER_VOLUME * total
    });
    let limit = bulk.map_or(stiffest, |tet| SLIVER_KAPPA * tet.excess());
    let slivers = tets.partition_point(|tet| tet.excess() > limit);
    let volume: f64 = tets[..slivers].iter().map(|tet| tet.volume).sum();
    let decisive = tets.get(slivers).map_or(0.0, TetDemand::excess);
    let (wanted, chosen) = (wanted(stiffest), wanted(decisive));
    let substeps = take(chosen);
    let error = |tet: &TetDemand| {
        let kappa = tet.kappa / f64::from(substeps).powi(2);
        let error = expected_error(kappa, tet.poisson_ratio, form);
        let near = is_nearly_incompressible(kappa, tet.poisson_ratio, form);
        (error, near)
    };
    let errors = tets[slivers..].iter().map(error);
    let (expected_error, nearly_incompressible) =
        errors.fold((0.0, false), |a, b| if b.0 > a.0 { b } else { a });
    Choice {
        substeps_wanted: wanted,
        substeps_needed: chosen,
        substeps,
        shortfall: if chosen > substeps {
            Some(Shortfall::Cap)
        } else if wanted > chosen {
            Some(Shortfall::Sliver)
        } else {
            None
        },
        sliver_tets: slivers,
        sliver_volume_fraction: if slivers > 0 { volume / total } else { 0.0 },
        expected_error: expected_error.min(1.0),
        nearly_incompressible,
        by_vbd: false,
    }
}

/// The smallest number of substeps whose square is at least this.
fn wanted(square: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and no cap is as large"
    )]
    let mut substeps = (square.sqrt().ceil() as u32).max(1);
    // The root may be rounded down.
    while substeps < u32::MAX && square > f64::from(substeps).powi(2) {
        substeps += 1;
    }
    substeps
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn demand(kappa: f64, volume: f64) -> TetDemand {
        TetDemand {
            kappa,
            largest_kappa: 0.5,
            poisson_ratio: 0.3,
            volume,
        }
    }

    fn choice(tets: &[(f64, f64)], cap: u32) -> Choice {
        let tets = tets.iter().map(|&(kappa, volume)| demand(kappa, volume));
        choose(tets.collect(), cap, TetSolve::Split)
    }

    #[test]
    fn the_smallest_sufficient_number_is_chosen() {
        for (square, substeps) in [
            (0.0, 1),
            (1.0, 1),
            (1.000_000_1, 2),
            (4.0, 2),
            (9.0, 3),
            (9.000_000_1, 4),
            (1e6, 1000),
            (1e300, u32::MAX),
            (f64::INFINITY, u32::MAX),
        ] {
            assert_eq!(wanted(square), substeps, "{square}");
        }
    }

    #[test]
    fn few_slivers_are_left_aside_and_many_are_not() {
        let body = |slivers: usize| {
            let mut tets = vec![(8.0, 1.0); 1000];
            tets.extend(vec![(800.0, 0.01); slivers]);
            tets
        };
        // 90 slivers are 0.09 % of the volume, 200 are 0.2 %.
        let few = choice(&body(90), 200);
        assert_eq!((few.substeps, few.substeps_wanted), (4, 40));
        assert_eq!(
            (few.shortfall, few.sliver_tets),
            (Some(Shortfall::Sliver), 90)
        );
        assert!((few.sliver_volume_fraction - 0.9 / 1000.9).abs() < 1e-12);
        let many = choice(&body(200), 200);
        assert_eq!((many.substeps, many.shortfall), (40, None));
        // Tets just smaller than the others are no slivers.
        let graded = choice(&[(8.0, 1000.0), (30.0, 0.1)], 200);
        assert_eq!((graded.substeps, graded.shortfall), (8, None));
        // The cap is reported before the slivers.
        let capped = choice(&body(90), 3);
        assert_eq!(
            (capped.substeps, capped.shortfall),
            (3, Some(Shortfall::Cap))
        );
        assert!(capped.expected_error > few.expected_error);
        assert_eq!(choice(&[], 200).substeps, 1);
    }

    proptest! {
        /// Against the rule, word by word.
        #[test]
        fn all_but_slivers_are_served(
            tets in prop::collection::vec((-3.0..6.0f64, -6.0..1.0f64), 1..200),
            cap in 1..2000u32,
        ) {
            let tets: Vec<(f64, f64)> =
                tets.into_iter().map(|(k, v)| (10f64.powf(k), 10f64.powf(v))).collect();
            let choice = choice(&tets, cap);
            let total: f64 = tets.iter().map(|t| t.1).sum();
            let served = |n: u32| tets.iter().filter(move |t| t.0 / 0.5 <= f64::from(n).powi(2));
            let shortfall = |n: u32| total - served(n).map(|t| t.1).sum::<f64>();
            prop_assert!(choice.substeps <= cap);
            if choice.shortfall == Some(Shortfall::Cap) {
                prop_assert_eq!(choice.substeps, cap);
                prop_assert!(served(cap).count() < tets.len());
            } else {
                prop_assert!(shortfall(choice.substeps) <= 1.001e-3 * total);
                prop_assert!(tets.len() - served(choice.substeps).count() <= choice.sliver_tets);
                prop_assert_eq!(
                    choice.shortfall.is_none(),
                    served(choice.substeps).count() == tets.len()
                );
            }
            // One fewer would leave a tet behind that is no sliver.
            if choice.substeps > 1 && choice.shortfall.is_none() {
                prop_assert!(served(choice.substeps - 1).count() < tets.len());
            }
            prop_assert!(choice.substeps_wanted == 1 || served(choice.substeps_wanted - 1).count() < tets.len());
            prop_assert_eq!(served(choice.substeps_wanted).count(), tets.len());
        }
    }
}
