//! [`Substeps`]: how many substeps a frame has, and how `auto` chooses them for a body.
//!
//! A substep is accurate while kappa, `E Δt² / (ρ h²)` with h the smallest altitude of a tet, is at most 0.5. As kappa
//! falls with the square of the number of substeps, one pass over the tets at rest tells the number that every tet
//! wants, and the largest decides, but for two exceptions, which are reported. No more than a cap is taken. And a few
//! slivers do not make the whole body wait: tets that want more than twice the substeps of all others, together less
//! than a thousandth of the volume, are left to the limit of kappa, which softens them. Without such a limit they
//! decide, for nothing else keeps them stable.
//!
//! The number is chosen once. What a cut leaves is small tets of little volume: the limit of kappa softens them, too.
//!
//! Source: kappa is the square of a Courant number; that substeps and not iterations make XPBD accurate, Macklin et al.
//! 2019. Cost: O(n log n) once.

use std::fmt;

use serde::de::{Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Up to this kappa a substep is accurate.
pub(crate) const ACCURATE_KAPPA: f64 = 0.5;

/// Slivers are less than this share of a body's volume...
const SLIVER_VOLUME: f64 = 1e-3;

/// ... and more than this much stiffer than all other tets: they want more than twice as many substeps.
const SLIVER_KAPPA: f64 = 4.0;

/// How many substeps a frame has: in a scene a number, or `"auto"`.
///
/// ```
/// use incise::{Scene, scene::Substeps};
///
/// let scene = Scene::from_toml("[solver]\nsubsteps = \"auto\"\nmax_substeps = 50")?;
/// assert_eq!(scene.solver.substeps, Substeps::Auto);
/// assert_eq!(Scene::from_toml("[solver]\nsubsteps = 20")?.solver.substeps, 20.into());
/// # Ok::<(), incise::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Substeps {
    /// This many, at least 1.
    Fixed(u32),
    /// For each body the fewest that bring the kappa of its tets at rest to 0.5, few slivers left aside, but no more
    /// than `max_substeps`. Cuts do not change the number.
    Auto,
}

impl From<u32> for Substeps {
    fn from(substeps: u32) -> Self {
        Self::Fixed(substeps)
    }
}

impl Serialize for Substeps {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(substeps) => serializer.serialize_u32(*substeps),
            Self::Auto => serializer.serialize_str("auto"),
        }
    }
}

impl<'de> Deserialize<'de> for Substeps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Substeps;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of substeps or \"auto\"")
            }

            fn visit_i64<E: serde::de::Error>(self, number: i64) -> Result<Substeps, E> {
                let number = u32::try_from(number)
                    .map_err(|_| E::invalid_value(Unexpected::Signed(number), &self))?;
                Ok(Substeps::Fixed(number))
            }

            fn visit_u64<E: serde::de::Error>(self, number: u64) -> Result<Substeps, E> {
                let number = u32::try_from(number)
                    .map_err(|_| E::invalid_value(Unexpected::Unsigned(number), &self))?;
                Ok(Substeps::Fixed(number))
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Substeps, E> {
                match name {
                    "auto" => Ok(Substeps::Auto),
                    _ => Err(E::unknown_variant(name, &["auto"])),
                }
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// Why not all tets have the substeps they want.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Missed {
    /// They want more than `max_substeps`.
    Cap,
    /// Those that want more are few slivers.
    Sliver,
}

/// What `auto` chose for a body, and what it left undone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Choice {
    /// The substeps that would bring the kappa of every tet at rest to 0.5.
    pub substeps_wanted: u32,
    /// The number that was chosen; that of the body is larger if it is joined to one with more.
    #[serde(skip)]
    pub substeps: u32,
    /// Why it was not all that is wanted, if it was not; the cap if both reasons hold.
    pub missed: Option<Missed>,
    /// Tets that were left aside as slivers.
    pub sliver_tets: usize,
    /// Their share of the volume at rest.
    pub sliver_volume_fraction: f64,
}

/// Chooses substeps for tets given by their kappa at one substep and their volume. `spare_slivers` says whether slivers
/// are left aside.
pub(crate) fn choose(mut tets: Vec<(f64, f64)>, max_substeps: u32, spare_slivers: bool) -> Choice {
    tets.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let stiffest = tets.first().map_or(0.0, |tet| tet.0);
    let total: f64 = tets.iter().map(|tet| tet.1).sum();
    let (mut slivers, mut volume) = (0, 0.0);
    if spare_slivers {
        // The first tet that belongs to the bulk however the slivers are counted.
        let mut sum = 0.0;
        let bulk = tets.iter().find(|tet| {
            sum += tet.1;
            sum >= SLIVER_VOLUME * total
        });
        let limit = bulk.map_or(stiffest, |tet| SLIVER_KAPPA * tet.0);
        slivers = tets.partition_point(|tet| tet.0 > limit);
        volume = tets[..slivers].iter().map(|tet| tet.1).sum();
    }
    let decisive = tets.get(slivers).map_or(0.0, |tet| tet.0);
    let (wanted, chosen) = (wanted(stiffest), wanted(decisive));
    Choice {
        substeps_wanted: wanted,
        substeps: chosen.min(max_substeps),
        missed: if chosen > max_substeps {
            Some(Missed::Cap)
        } else if wanted > chosen {
            Some(Missed::Sliver)
        } else {
            None
        },
        sliver_tets: slivers,
        sliver_volume_fraction: if slivers > 0 { volume / total } else { 0.0 },
    }
}

/// The smallest number of substeps that brings a kappa at one substep to [`ACCURATE_KAPPA`].
fn wanted(kappa: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and no cap is as large"
    )]
    let mut substeps = ((kappa / ACCURATE_KAPPA).sqrt().ceil() as u32).max(1);
    // The root may be rounded down.
    while substeps < u32::MAX && kappa / f64::from(substeps).powi(2) > ACCURATE_KAPPA {
        substeps += 1;
    }
    substeps
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_smallest_sufficient_number_is_wanted() {
        for (kappa, substeps) in [
            (0.0, 1),
            (0.5, 1),
            (0.500_000_1, 2),
            (2.0, 2),
            (4.5, 3),
            (4.500_000_1, 4),
            (5e5, 1000),
            (1e300, u32::MAX),
            (f64::INFINITY, u32::MAX),
        ] {
            assert_eq!(wanted(kappa), substeps, "{kappa}");
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
        let few = choose(body(90), 200, true);
        assert_eq!((few.substeps, few.substeps_wanted), (4, 40));
        assert_eq!((few.missed, few.sliver_tets), (Some(Missed::Sliver), 90));
        assert!((few.sliver_volume_fraction - 0.9 / 1000.9).abs() < 1e-12);
        let many = choose(body(200), 200, true);
        assert_eq!((many.substeps, many.missed), (40, None));
        let unlimited = choose(body(90), 200, false);
        assert_eq!((unlimited.substeps, unlimited.missed), (40, None));
        // Tets just smaller than the others are no slivers: they are served.
        let graded = choose(vec![(8.0, 1000.0), (30.0, 0.1)], 200, true);
        assert_eq!((graded.substeps, graded.missed), (8, None));
        // The cap is told before the slivers.
        let capped = choose(body(90), 3, true);
        assert_eq!((capped.substeps, capped.missed), (3, Some(Missed::Cap)));
        assert_eq!(choose(Vec::new(), 200, true).substeps, 1);
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
            let choice = choose(tets.clone(), cap, true);
            let total: f64 = tets.iter().map(|t| t.1).sum();
            let served = |n: u32| tets.iter().filter(move |t| t.0 / f64::from(n).powi(2) <= 0.5);
            let missed = |n: u32| total - served(n).map(|t| t.1).sum::<f64>();
            prop_assert!(choice.substeps <= cap);
            if choice.missed == Some(Missed::Cap) {
                prop_assert_eq!(choice.substeps, cap);
                prop_assert!(served(cap).count() < tets.len());
            } else {
                prop_assert!(missed(choice.substeps) <= 1.001e-3 * total);
                prop_assert!(tets.len() - served(choice.substeps).count() <= choice.sliver_tets);
                prop_assert_eq!(
                    choice.missed.is_none(),
                    served(choice.substeps).count() == tets.len()
                );
            }
            // One fewer would leave a tet behind that is no sliver.
            if choice.substeps > 1 && choice.missed.is_none() {
                prop_assert!(served(choice.substeps - 1).count() < tets.len());
            }
            prop_assert!(choice.substeps_wanted == 1 || served(choice.substeps_wanted - 1).count() < tets.len());
            prop_assert_eq!(served(choice.substeps_wanted).count(), tets.len());
        }
    }
}
