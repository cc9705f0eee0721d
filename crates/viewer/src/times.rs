//! [`Times`]: stage times of the last frames as a rolling plot.

use std::collections::VecDeque;

use eframe::egui::{Color32, Ui};
use egui_plot::{FilledArea, Legend, Plot};
use incise::report::Milliseconds;

/// Frames that are shown.
const FRAMES: usize = 240;

/// The time of a stage in ms.
type Stage = fn(&Milliseconds) -> f64;

/// The stages from the bottom up, with their colors.
const STAGES: [(&str, Color32, Stage); 9] = [
    ("solve", Color32::from_rgb(86, 142, 190), |ms| ms.solve),
    ("contact", Color32::from_rgb(96, 178, 178), |ms| ms.contact),
    ("cut", Color32::from_rgb(203, 84, 75), |ms| ms.cut),
    ("cluster", Color32::from_rgb(226, 158, 74), |ms| ms.cluster),
    ("color", Color32::from_rgb(240, 205, 92), |ms| ms.color),
    ("schedule", Color32::from_rgb(122, 173, 98), |ms| {
        ms.schedule
    }),
    ("upload", Color32::from_rgb(153, 122, 184), |ms| ms.upload),
    ("readback", Color32::from_rgb(196, 131, 172), |ms| {
        ms.readback
    }),
    ("other", Color32::from_rgb(150, 150, 150), |ms| ms.other),
];

/// Stage times of the last frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Times {
    frames: VecDeque<(u64, Milliseconds)>,
}

impl Times {
    pub(crate) fn note(&mut self, frame: u64, ms: Milliseconds) {
        // After a reset or undo, frames would overlap in the plot.
        if self.frames.back().is_some_and(|last| last.0 >= frame) {
            self.frames.clear();
        }
        self.frames.push_back((frame, ms));
        if self.frames.len() > FRAMES {
            self.frames.pop_front();
        }
    }

    /// The mean of a stage over the frames shown, in ms.
    fn mean(&self, stage: Stage) -> f64 {
        let sum: f64 = self.frames.iter().map(|(_, ms)| stage(ms)).sum();
        sum / self.frames.len().max(1) as f64
    }

    pub(crate) fn show(&self, ui: &mut Ui) {
        let frames: Vec<f64> = self.frames.iter().map(|(frame, _)| *frame as f64).collect();
        let mut low = vec![0.0; frames.len()];
        let plot = Plot::new("stage times")
            .height(150.0)
            .allow_drag(false)
            .allow_zoom(false)
            .allow_scroll(false)
            .allow_boxed_zoom(false)
            .include_y(0.0)
            .legend(Legend::default())
            .y_axis_label("Frame time (ms)");
        plot.show(ui, |plot| {
            for (name, color, stage) in STAGES {
                let mean = self.mean(stage);
                if mean == 0.0 {
                    continue;
                }
                let of_frames = self.frames.iter().map(|(_, ms)| stage(ms));
                let high: Vec<f64> = low
                    .iter()
                    .zip(of_frames)
                    .map(|(a, b)| a + b.max(0.0))
                    .collect();
                let name = format!("{name} {mean:.2}");
                plot.add(FilledArea::new(name, &frames, &low, &high).fill_color(color));
                low = high;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frames_are_kept_and_a_reset_clears_the_plot() {
        let mut times = Times::default();
        for frame in 0..300 {
            let mut ms = Milliseconds::default();
            ms.solve = 2.0;
            times.note(frame, ms);
        }
        assert_eq!(
            (times.frames.len(), times.mean(|ms| ms.solve)),
            (FRAMES, 2.0)
        );
        times.note(7, Milliseconds::default());
        assert_eq!(times.frames.len(), 1);
    }
}
