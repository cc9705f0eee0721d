//! What became of a body in a run, in numbers and in a word.

use serde::{Deserialize, Serialize};

use super::methods::Column;

/// A row of the matrix: an extreme with what became of it in every column.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) id: String,
    pub(crate) name: String,
    /// Whether it is a state to come back from: then the distance from the shape at rest counts.
    pub(crate) is_state: bool,
    pub(crate) outcomes: Vec<Outcome>,
}

impl Row {
    /// The columns of the row that has most of them.
    pub(crate) fn columns(rows: &[Self]) -> Vec<Column> {
        let longest = rows.iter().max_by_key(|row| row.outcomes.len());
        let outcomes = longest.map_or(&[][..], |row| &row.outcomes);
        outcomes.iter().map(|outcome| outcome.column).collect()
    }
}

/// What became of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Outcome {
    pub(crate) column: Column,
    /// Of a frame; at the end the largest of any body.
    pub(crate) substeps: u32,
    /// Of a substep, of the stiffest tet, had none been softened; for cuts the largest of all frames.
    pub(crate) kappa: f64,
    pub(crate) frames: usize,
    /// The first frame after which a number was not finite; nothing after that was looked at.
    pub(crate) not_finite: Option<usize>,
    /// The most that kinetic, elastic and gravitational energy together rose above the start, in units of what there is
    /// to begin with: elastic energy at the start, and the work of gravity over the length of the body.
    pub(crate) energy_rise: f64,
    /// From the shape at rest up to a rigid motion, over the length of the body, at the end; not for bodies in pieces.
    pub(crate) distance: Option<f64>,
    /// From when on until the end no tet was inverted and the volume was right, in s.
    pub(crate) in_shape_from: Option<f64>,
    pub(crate) tets: usize,
    /// At the end.
    pub(crate) inverted: usize,
    /// Volume at the end over that at rest.
    pub(crate) volume: f64,
    /// The most momentum that a free body without gravity ever had, over the most that its particles had one by one.
    pub(crate) momentum_drift: Option<f64>,
    /// Particles that would not have been finite and were put back, once for each substep.
    pub(crate) repaired: usize,
    /// Tets softened to the limit of kappa; for cuts the most of all frames.
    pub(crate) softened: usize,
    /// Whether no particle has moved at all.
    pub(crate) frozen: bool,
    /// Why no simulation of it could be built.
    #[serde(default)]
    pub(crate) refused: Option<String>,
    /// Whether any frame carried a warning; only simulations warn.
    #[serde(default)]
    pub(crate) warned: bool,
}

impl Outcome {
    /// Of a body of which nothing is known yet.
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

/// The share of the volume by which it may differ.
pub(crate) const VOLUME_TOLERANCE: f64 = 0.05;
/// More tets than this share inverted are no more a few.
const FEW: f64 = 0.02;
/// More than this many times the energy to begin with does not come from rounding.
const ENERGY_TOLERANCE: f64 = 1.0;
/// What a body that still vibrates is from its shape at rest at most, over its length.
const DISTANCE_TOLERANCE: f64 = 0.1;

/// What is worst about an outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verdict {
    NotFinite,
    /// A value is out of its range.
    Refused,
    /// Less than half the volume, or more than twice.
    Collapsed,
    Frozen,
    /// More than a few tets.
    Inverted,
    /// More energy than there was.
    Gains,
    Repaired,
    FewInverted,
    /// The volume.
    Off,
    /// Not at rest yet, or at rest elsewhere.
    Bent,
    Fine,
}

/// How bad it is.
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
    /// The worst that can be said.
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

    /// The verdict in words, with whether the simulation warned.
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

/// A ratio of volumes.
fn ratio(volume: f64) -> String {
    match volume.abs() {
        ..0.005 => "0".to_owned(),
        ..100.0 => format!("{volume:.2}"),
        _ => format!("{volume:.0e}"),
    }
}
