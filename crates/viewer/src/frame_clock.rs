//! [`FrameClock`]: the number of simulation frames in a frame of the window.
//!
//! Simulated time keeps up with real time. If the simulation is too slow, time beyond [`PATIENCE`] is dropped, so that
//! the window stays responsive; the panel shows the speed that is reached.

use std::time::Duration;

use web_time::Instant;

/// Longest simulation time between two pictures.
const PATIENCE: Duration = Duration::from_millis(40);

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

    /// Calls `step` for each frame of `time_step` seconds that has passed, until it returns false.
    pub(crate) fn run(&mut self, now: Instant, time_step: f64, mut step: impl FnMut() -> bool) {
        let passed = self.last.map(|last| (now - last).as_secs_f64());
        self.last = Some(now);
        let Some(passed) = passed else {
            step();
            return;
        };
        self.due += passed * self.speed;
        let mut done = 0.0;
        while self.due >= time_step {
            if now.elapsed() > PATIENCE {
                self.due = 0.0;
                break;
            }
            self.due -= time_step;
            done += time_step;
            if !step() {
                break;
            }
        }
        if passed > 0.0 {
            self.reached += NEWEST * (done / passed - self.reached);
        }
    }

    /// Recent mean of simulated time over real time.
    pub(crate) fn reached(&self) -> f64 {
        self.reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_follow_the_clock() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        let mut frames = 0;
        for tick in 0..=50 {
            // In the future, so that the limit of simulation time is never reached.
            let now = start + Duration::from_secs(1000) + Duration::from_millis(20 * tick);
            clock.run(now, 0.005, || {
                frames += 1;
                true
            });
        }
        // The first tick has no predecessor and runs one frame; later ones run a second's worth, up to rounding.
        assert!((200..=201).contains(&frames), "{frames}");
    }

    #[test]
    fn excess_time_is_dropped() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        let past = start - Duration::from_millis(500);
        clock.run(past, 0.01, || true);
        let mut frames = 0;
        // Half a second is due, but the limit of simulation time is reached.
        clock.run(past + Duration::from_millis(300), 0.01, || {
            frames += 1;
            true
        });
        assert_eq!((frames, clock.due), (0, 0.0));
    }

    #[test]
    fn a_failed_frame_stops_the_clock() {
        let (mut clock, start) = (
            FrameClock::default(),
            Instant::now() + Duration::from_secs(1000),
        );
        clock.run(start, 0.01, || true);
        let mut frames = 0;
        clock.run(start + Duration::from_secs(1), 0.01, || {
            frames += 1;
            frames < 3
        });
        assert_eq!(frames, 3);
    }
}
