//! Outcome of a body's run, as values and as a verdict.

use serde::{Deserialize, Serialize};

use super::methods::Column;

/// Row of the matrix: an extreme with its outcome in every column.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) id: String,
    pub(crate) name: String,
    /// True for an extreme state to recover from: the distance from the rest shape then counts.
    pub(crate) is_state: bool,
    pub(crate) outcomes: Vec<Outcome>,
}

impl Row {
    /// Columns of the row with the largest number of columns.
    pub(crate) fn columns(rows: &[Self]) -> Vec<Column> {
        let longest = rows.iter().max_by_key(|row| row.outcomes.len());
        let outcomes = longest.map_or(&[][..], |row| &row.outcomes);
        outcomes.iter().map(|outcome| outcome.column).collect()
    }
}

/// Outcome of a body's run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Outcome {
    pub(crate) column: Column,
    /// Substeps per frame; at the end the largest of any body.
    pub(crate) substeps: u32,
    /// Kappa of a substep for the stiffest tet, without softening; for cuts the largest of all frames.
    pub(crate) kappa: f64,
    pub(crate) frames: usize,
    /// First frame after which a value was not finite; monitoring stops there.
    pub(crate) not_finite: Option<usize>,
    /// Largest rise of the total energy (kinetic, elastic and gravitational) above the start, in units of the elastic
    /// energy at the start plus the work of gravity over the length of the body.
    pub(crate) energy_rise: f64,
    /// Distance from the rest shape up to a rigid motion, over the length of the body, at the end; `None` for bodies in
    /// pieces.
    pub(crate) distance: Option<f64>,
    /// Time in s from which to the end no tet was inverted and the volume was correct.
    pub(crate) in_shape_from: Option<f64>,
    pub(crate) tets: usize,
    /// Inverted tets at the end.
    pub(crate) inverted: usize,
    /// Volume at the end over the rest volume.
    pub(crate) volume: f64,
    /// Largest momentum of a free body without gravity, over the largest sum of its particles' momentum magnitudes.
    pub(crate) momentum_drift: Option<f64>,
    /// Number of resets of particles that were not finite, per particle and substep.
    pub(crate) repaired: usize,
    /// Tets softened to the limit of kappa; for cuts the maximum over all frames.
    pub(crate) softened: usize,
    /// True if no particle has moved.
    pub(crate) frozen: bool,
    /// Error of building the simulation, if any.
    #[serde(default)]
    pub(crate) refused: Option<String>,
    /// True if any frame had a warning; only simulations warn.
    #[serde(default)]
    pub(crate) warned: bool,
}

impl Outcome {
    /// Outcome of a body before its first frame.
    pub(crate) fn new(column: Column) -> Self {
        Self {
            column,
            substeps: 1,
            kappa: 0.0,
            frames: 0,
            not_finite: None,
            energy_rise: 0.0,
            distance: None,
            in_shape_from: None,
            tets: 0,
            inverted: 0,
            volume: 0.0,
            momentum_drift: None,
            repaired: 0,
            softened: 0,
            frozen: false,
            refused: None,
            warned: false,
        }
    }
}

/// Tolerance of the volume, as a fraction.
pub(crate) const VOLUME_TOLERANCE: f64 = 0.05;
/// Largest fraction of inverted tets that counts as a few.
const FEW: f64 = 0.02;
/// Energy rise, in units of the initial energy, that rounding cannot cause.
const ENERGY_TOLERANCE: f64 = 1.0;
/// Largest distance of a vibrating body from its rest shape, over its length.
const DISTANCE_TOLERANCE: f64 = 0.1;

/// Worst defect of an outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verdict {
    NotFinite,
    /// A value is out of its range.
    Refused,
    /// Less than half the volume, or more than twice the volume.
    Collapsed,
    Frozen,
    /// More than a few inverted tets.
    Inverted,
    /// Energy above that at the start.
    Gains,
    Repaired,
    FewInverted,
    /// Wrong volume.
    Off,
    /// Not at rest yet, or at rest in another shape.
    Bent,
    Fine,
}

/// Severity of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Color {
    Green,
    Yellow,
    Red,
}

impl Verdict {
    pub(crate) fn color(self) -> Color {
        match self {
            Self::NotFinite | Self::Collapsed | Self::Frozen | Self::Inverted => Color::Red,
            Self::Refused
            | Self::Gains
            | Self::Repaired
            | Self::FewInverted
            | Self::Off
            | Self::Bent => Color::Yellow,
            Self::Fine => Color::Green,
        }
    }
}

impl Outcome {
    /// Worst verdict that applies.
    pub(crate) fn verdict(&self, is_state: bool) -> Verdict {
        let far = |distance: f64| distance > DISTANCE_TOLERANCE;
        if self.not_finite.is_some() {
            Verdict::NotFinite
        } else if self.refused.is_some() {
            Verdict::Refused
        } else if !(0.5..=2.0).contains(&self.volume) {
            Verdict::Collapsed
        } else if self.frozen {
            Verdict::Frozen
        } else if self.inverted as f64 > FEW * self.tets as f64 {
            Verdict::Inverted
        } else if self.energy_rise > ENERGY_TOLERANCE {
            Verdict::Gains
        } else if self.repaired > 0 {
            Verdict::Repaired
        } else if self.inverted > 0 {
            Verdict::FewInverted
        } else if (self.volume - 1.0).abs() > VOLUME_TOLERANCE {
            Verdict::Off
        } else if is_state && self.distance.is_some_and(far) {
            Verdict::Bent
        } else {
            Verdict::Fine
        }
    }

    /// Verdict in words, with a mark if the simulation warned.
    pub(crate) fn words(&self, is_state: bool) -> String {
        let warned = if self.warned { ", warned" } else { "" };
        self.verdict_in_words(is_state) + warned
    }

    fn verdict_in_words(&self, is_state: bool) -> String {
        match self.verdict(is_state) {
            Verdict::NotFinite => "NOT FINITE".to_owned(),
            Verdict::Collapsed => format!("collapsed {}", ratio(self.volume)),
            Verdict::Refused => "refused".to_owned(),
            Verdict::Frozen => "frozen".to_owned(),
            Verdict::Inverted | Verdict::FewInverted => format!("{} inverted", self.inverted),
            Verdict::Gains => format!("energy {:.0e}", self.energy_rise),
            Verdict::Repaired => format!("{} repaired", self.repaired),
            Verdict::Off => format!("volume {}", ratio(self.volume)),
            Verdict::Bent => {
                format!("bent {:.0} %", 100.0 * self.distance.unwrap_or(0.0))
            }
            Verdict::Fine => "ok".to_owned(),
        }
    }
}

/// Formats a ratio of volumes.
fn ratio(volume: f64) -> String {
    match volume.abs() {
        ..0.005 => "0".to_owned(),
        ..100.0 => format!("{volume:.2}"),
        _ => format!("{volume:.0e}"),
    }
}
