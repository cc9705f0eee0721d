//! [`SettingEffects`]: the measured effect of changed settings.
//!
//! Frames before and after a change are compared by the median frame time and the median residual; frames with a cut are
//! left out. Frames right after the change do not count, since the body has to settle.

use std::collections::VecDeque;

use incise::FrameReport;

/// Frames compared on each side of a change.
const FRAMES: usize = 60;
/// Frames after a change that do not count.
const SETTLE: usize = 20;
/// Smallest number of frames for a median.
const FEWEST: usize = 10;
/// Number of changes that are kept.
const CHANGES: usize = 6;

/// Measurements of a frame.
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

/// A changed setting and its effect.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Effect {
    /// The change as text, for example `Substeps 5 to 10`.
    pub(crate) what: String,
    pub(crate) before: Option<Measure>,
    /// Medians of the frames since the change.
    pub(crate) after: Option<Measure>,
}

/// Effects of the last changes.
#[derive(Clone, Debug, Default)]
pub(crate) struct SettingEffects {
    /// Frames since the last change, at most [`FRAMES`].
    recent: VecDeque<Sample>,
    /// Frames to skip until the body has settled.
    settling: usize,
    /// Newest last.
    changes: VecDeque<Effect>,
}

impl SettingEffects {
    /// Adds a frame.
    pub(crate) fn note(&mut self, report: &FrameReport, ms: f64) {
        if self.settling > 0 {
            self.settling -= 1;
            return;
        }
        // The time of a cut does not depend on solver settings.
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
        if let Some(effect) = self.changes.back_mut() {
            effect.after = measure;
        }
    }

    /// Adds a change. Successive changes of one setting that were not measured count as one.
    pub(crate) fn note_change(&mut self, setting: &str, from: &str, to: &str) {
        let before = self.measure();
        self.recent.clear();
        self.settling = SETTLE;
        let same =
            |effect: &&mut Effect| effect.after.is_none() && effect.what.starts_with(setting);
        if let Some(effect) = self.changes.back_mut().filter(same) {
            let from = effect.what[setting.len()..]
                .split(" to ")
                .next()
                .unwrap_or(from)
                .trim();
            effect.what = format!("{setting} {from} to {to}");
            return;
        }
        self.changes.push_back(Effect {
            what: format!("{setting} {from} to {to}"),
            before,
            after: None,
        });
        if self.changes.len() > CHANGES {
            self.changes.pop_front();
        }
    }

    /// The changes, newest first.
    pub(crate) fn changes(&self) -> impl Iterator<Item = &Effect> {
        self.changes.iter().rev()
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
        (_, None) => "measuring...".to_owned(),
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
    fn a_change_is_compared_with_the_frames_before_it() {
        let mut effects = SettingEffects::default();
        frames(&mut effects, 30, 2.0);
        effects.note_change("Substeps", "5", "10");
        assert_eq!(effects.changes().next().unwrap().time(), "measuring...");
        // Frames while the body settles do not count; later, one slow frame in ten does not change the median.
        frames(&mut effects, SETTLE, 1000.0);
        for _ in 0..4 {
            frames(&mut effects, 9, 4.0);
            frames(&mut effects, 1, 90.0);
        }
        let effect = effects.changes().next().unwrap();
        assert_eq!(effect.what, "Substeps 5 to 10");
        assert_eq!(effect.time(), "2.00 to 4.00 ms (×2.00)");
        assert_eq!(effect.residual(), "");
    }

    #[test]
    fn a_drag_of_a_slider_is_one_change() {
        let mut effects = SettingEffects::default();
        frames(&mut effects, 30, 2.0);
        for to in 6..=9 {
            let from = (to - 1).to_string();
            effects.note_change("Substeps", &from, &to.to_string());
            frames(&mut effects, 3, 3.0);
        }
        assert_eq!(effects.changes().count(), 1);
        let effect = effects.changes().next().unwrap();
        assert_eq!(effect.what, "Substeps 5 to 9");
        assert_eq!(effect.before.unwrap().ms, 2.0);
    }
}
