//! [`SettingEffects`]: what turning a knob did, measured.
//!
//! The frames before a turn are compared with those after it: time of a frame without its cuts, and what the frame left
//! unsolved. Both are medians, so that a frame in which something else happened does not count. Frames right after the
//! turn are left out, since the body has to settle into the new settings.

use std::collections::VecDeque;

use incise::FrameReport;

/// Frames on each side of a turn.
const FRAMES: usize = 60;
/// Frames after a turn that do not count.
const SETTLE: usize = 20;
/// Fewest frames to say something.
const FEWEST: usize = 10;
/// Turns that are remembered.
const TURNS: usize = 6;

/// What is measured of a frame.
#[derive(Clone, Copy, Debug)]
struct Sample {
    ms: f64,
    residual: Option<f64>,
}

/// Medians of some frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measure {
    pub(crate) ms: f64,
    pub(crate) residual: Option<f64>,
}

/// A turn of a knob and what it did.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Effect {
    /// The change as text, for example `substeps 5 to 10`.
    pub(crate) what: String,
    pub(crate) before: Option<Measure>,
    /// Of the frames so far.
    pub(crate) after: Option<Measure>,
}

/// The last turns of knobs.
#[derive(Debug, Default)]
pub(crate) struct SettingEffects {
    /// Since the last turn, at most [`FRAMES`].
    recent: VecDeque<Sample>,
    /// Frames since the last turn that do not count yet.
    settling: usize,
    /// Newest last.
    turns: VecDeque<Effect>,
}

impl SettingEffects {
    /// Takes a frame in.
    pub(crate) fn note(&mut self, report: &FrameReport, ms: f64) {
        if self.settling > 0 {
            self.settling -= 1;
            return;
        }
        // A cut is no matter of these knobs.
        if report.cut.is_some() {
            return;
        }
        let residual = report.residual;
        self.recent.push_back(Sample {
            ms,
            residual: residual.map(|residual| residual.force_relative.unwrap_or(residual.force)),
        });
        if self.recent.len() > FRAMES {
            self.recent.pop_front();
        }
        let measure = self.measure();
        if let Some(turn) = self.turns.back_mut() {
            turn.after = measure;
        }
    }

    /// A knob was turned. Turns of the same knob in a row before anything could be measured count as one.
    pub(crate) fn turned(&mut self, knob: &str, from: &str, to: &str) {
        let before = self.measure();
        self.recent.clear();
        self.settling = SETTLE;
        let same = |turn: &&mut Effect| turn.after.is_none() && turn.what.starts_with(knob);
        if let Some(turn) = self.turns.back_mut().filter(same) {
            let from = turn.what[knob.len()..]
                .split(" to ")
                .next()
                .unwrap_or(from)
                .trim();
            turn.what = format!("{knob} {from} to {to}");
            return;
        }
        self.turns.push_back(Effect {
            what: format!("{knob} {from} to {to}"),
            before,
            after: None,
        });
        if self.turns.len() > TURNS {
            self.turns.pop_front();
        }
    }

    /// The turns, newest first.
    pub(crate) fn turns(&self) -> impl Iterator<Item = &Effect> {
        self.turns.iter().rev()
    }

    fn measure(&self) -> Option<Measure> {
        let of = |value: fn(&Sample) -> Option<f64>| median(self.recent.iter().filter_map(value));
        (self.recent.len() >= FEWEST).then(|| Measure {
            ms: of(|sample| Some(sample.ms)).unwrap_or(0.0),
            residual: of(|sample| sample.residual),
        })
    }
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

impl Effect {
    /// The time of a frame before and after, for example `1.20 to 2.31 ms (×1.93)`.
    pub(crate) fn time(&self) -> String {
        compare(self.before.map(|m| m.ms), self.after.map(|m| m.ms), "ms")
    }

    /// The residual before and after, in the format of [`Effect::time`]; empty if it was not measured.
    pub(crate) fn residual(&self) -> String {
        let of = |measure: Option<Measure>| measure.and_then(|measure| measure.residual);
        match (of(self.before), of(self.after)) {
            (None, None) => String::new(),
            (before, after) => compare(before, after, "residual"),
        }
    }
}

fn compare(before: Option<f64>, after: Option<f64>, unit: &str) -> String {
    let number = |value: f64| match value {
        value if value != 0.0 && !(1e-2..1e4).contains(&value.abs()) => format!("{value:.1e}"),
        value => format!("{value:.2}"),
    };
    match (before, after) {
        (Some(before), Some(after)) if before > 0.0 => {
            let (factor, before, after) = (number(after / before), number(before), number(after));
            format!("{before} to {after} {unit} (×{factor})")
        }
        (_, Some(after)) => format!("{} {unit}", number(after)),
        (_, None) => "measuring".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(effects: &mut SettingEffects, count: usize, ms: f64) {
        for _ in 0..count {
            effects.note(&FrameReport::default(), ms);
        }
    }

    #[test]
    fn a_turn_is_compared_with_the_frames_before_it() {
        let mut effects = SettingEffects::default();
        frames(&mut effects, 30, 2.0);
        effects.turned("substeps", "5", "10");
        assert_eq!(effects.turns().next().unwrap().time(), "measuring");
        // While it settles nothing counts, then one slow frame in ten does not.
        frames(&mut effects, SETTLE, 1000.0);
        for _ in 0..4 {
            frames(&mut effects, 9, 4.0);
            frames(&mut effects, 1, 90.0);
        }
        let effect = effects.turns().next().unwrap();
        assert_eq!(effect.what, "substeps 5 to 10");
        assert_eq!(effect.time(), "2.00 to 4.00 ms (×2.00)");
        assert_eq!(effect.residual(), "");
    }

    #[test]
    fn a_drag_of_a_knob_is_one_turn() {
        let mut effects = SettingEffects::default();
        frames(&mut effects, 30, 2.0);
        for to in 6..=9 {
            let from = (to - 1).to_string();
            effects.turned("substeps", &from, &to.to_string());
            frames(&mut effects, 3, 3.0);
        }
        assert_eq!(effects.turns().count(), 1);
        let effect = effects.turns().next().unwrap();
        assert_eq!(effect.what, "substeps 5 to 9");
        assert_eq!(effect.before.unwrap().ms, 2.0);
    }
}
