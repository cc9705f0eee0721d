//! [`FrameClock`]: the number of simulation frames in a frame of the window.
//!
//! Simulated time keeps up with real time. If the simulation is too slow, time beyond [`PATIENCE_MS`] is dropped, so that
//! pictures keep coming; the panel shows the speed that is reached.

use web_time::Instant;

/// Longest time in ms to simulate between two pictures, unless one frame takes longer.
const PATIENCE_MS: f64 = 40.0;

/// Weight of the newest frame in the mean speed.
const NEWEST: f64 = 0.05;

/// The clock of a simulation.
#[derive(Debug)]
pub(crate) struct FrameClock {
    /// Target simulated time per second.
    pub(crate) speed: f64,
    last: Option<Instant>,
    /// Simulated time that is due in s.
    due: f64,
    /// Mean simulated time per second.
    reached: f64,
}

impl Default for FrameClock {
    fn default() -> Self {
        Self {
            speed: 1.0,
            last: None,
            due: 0.0,
            reached: 0.0,
        }
    }
}

impl FrameClock {
    /// Resets the clock: time that passes during a pause is not caught up.
    pub(crate) fn pause(&mut self) {
        (self.last, self.due) = (None, 0.0);
    }

    /// Number of frames of `time_step` seconds that are due and will be made at once; a frame takes `frame_ms`.
    pub(crate) fn take_due(&mut self, now: Instant, time_step: f64, frame_ms: f64) -> usize {
        let passed = self.last.map(|last| (now - last).as_secs_f64());
        self.last = Some(now);
        let Some(passed) = passed else {
            return 1;
        };
        self.due += passed * self.speed;
        let due = (self.due / time_step).floor();
        let most = (PATIENCE_MS / frame_ms).floor().max(1.0);
        let frames = due.min(most);
        let simulated = frames * time_step;
        self.due = if due > most {
            0.0
        } else {
            self.due - simulated
        };
        if passed > 0.0 {
            self.reached += NEWEST * (simulated / passed - self.reached);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number, bounded by the frames that fit"
        )]
        let frames = frames as usize;
        frames
    }

    /// Recent mean of simulated time over real time.
    pub(crate) fn reached(&self) -> f64 {
        self.reached
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn frames_follow_the_clock() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        let tick = |tick: u64| start + Duration::from_millis(20 * tick);
        let frames: usize = (0..=50).map(|i| clock.take_due(tick(i), 0.005, 1.0)).sum();
        // The first tick has no predecessor and runs one frame; later ones run a second's worth, up to rounding.
        assert!((200..=201).contains(&frames), "{frames}");
    }

    #[test]
    fn excess_time_is_dropped() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        let ms = |ms| start + Duration::from_millis(ms);
        // The time of the first frame is not known before.
        assert_eq!(clock.take_due(start, 0.01, 0.0), 1);
        // Half a second is due: four frames fit, or one if it takes long.
        assert_eq!(clock.take_due(ms(500), 0.01, 10.0), 4);
        assert_eq!(clock.due, 0.0);
        assert_eq!(clock.take_due(ms(1000), 0.01, 200.0), 1);
        assert_eq!(clock.take_due(ms(1005), 0.01, 200.0), 0);
        assert!(clock.due > 0.0);
        clock.pause();
        assert_eq!(clock.due, 0.0);
    }
}
