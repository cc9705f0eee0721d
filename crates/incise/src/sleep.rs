//! [`SleepState`]: the sleep timer of an island of bodies.
//!
//! A body whose fastest particle has stayed below a speed for a time is not solved any more: it keeps its positions bit
//! for bit, its velocities become zero, and it costs nothing until it is cut, one of its attachments moves, or a moving
//! collider may reach the ball around it in the next frame. On a GPU any moving collider keeps all bodies awake.
//!
//! Trade-off: the remaining motion below that speed and slow creep are lost. Shear is damped only by the substeps, so a
//! large soft body vibrates for seconds before it sleeps. The time condition keeps a body awake that is slow only for a
//! moment, as at the top of its flight.
//!
//! Source: sleeping islands as in rigid body engines. Cost: a pass over the particles a frame while awake,
//! and asleep in scenes with moving colliders.

use crate::scene::SleepSpec;

/// Sleep timer of an island.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SleepState {
    spec: SleepSpec,
    /// Time at rest so far in s.
    still: f64,
    asleep: bool,
}

impl SleepState {
    pub(crate) fn new(spec: SleepSpec) -> Self {
        Self {
            spec,
            still: 0.0,
            asleep: false,
        }
    }

    pub(crate) fn asleep(&self) -> bool {
        self.asleep
    }

    pub(crate) fn wake(&mut self) {
        *self = Self::new(self.spec);
    }

    /// Counts a frame of `time` s at whose end the largest speed is `speed`; tells whether the island falls asleep now.
    pub(crate) fn count(&mut self, speed: f64, time: f64) -> bool {
        self.still = if speed <= self.spec.speed {
            self.still + time
        } else {
            0.0
        };
        self.asleep = self.still >= self.spec.time;
        self.asleep
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_uninterrupted_rest_counts() {
        let spec = SleepSpec {
            speed: 1.0,
            time: 0.5,
        };
        let mut rest = SleepState::new(spec);
        assert!(!rest.count(1.0, 0.25));
        assert!(!rest.count(1.1, 0.25));
        assert!(!rest.count(0.0, 0.25));
        assert!(rest.count(0.0, 0.25) && rest.asleep());
        rest.wake();
        assert!(!rest.asleep() && !rest.count(0.0, 0.25));
    }
}
