//! [`Substep`]: the present substep as constraints see it.

use crate::{Float, StepSettings};

/// The time of a substep and the settings as numbers of the solver's precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors<R> {
    /// Square of the time of a substep in s².
    pub(crate) time_squared: R,
    /// One over the time of a substep in 1/s.
    pub(crate) per_time: R,
    /// Factor on each correction.
    pub(crate) relaxation: R,
}

/// One of the equal parts of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Substep<'a, R> {
    pub(crate) settings: &'a StepSettings,
    /// Its number in the frame, from 0 on.
    pub(crate) number: u32,
    /// The part of the frame that has passed at its end.
    pub(crate) fraction: f64,
    /// The time in s from the start of the frame to its end.
    pub(crate) elapsed: f64,
    /// Whether constraints accumulate multipliers: in several iterations, or for residuals.
    pub(crate) has_multipliers: bool,
    pub(crate) factors: Factors<R>,
}

impl<'a, R: Float> Substep<'a, R> {
    /// The substep of a number from 0 on. `keep` says that residuals are asked for.
    pub(crate) fn new(settings: &'a StepSettings, number: u32, keep: bool) -> Self {
        let time = settings.substep_time();
        let ended = f64::from(number + 1);
        Self {
            settings,
            number,
            fraction: ended / f64::from(settings.substeps),
            elapsed: ended * time,
            has_multipliers: keep || settings.iterations > 1,
            factors: Factors {
                time_squared: R::from_f64(time * time),
                per_time: R::from_f64(1.0 / time),
                relaxation: R::from_f64(settings.relaxation),
            },
        }
    }
}
