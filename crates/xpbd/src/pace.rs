//! [`Pace`]: decides from measured times whether a pass runs on one thread or on several.
//!
//! Several threads can be slower than one: when another program has a core, when helpers are woken on the core of the
//! caller, or when a virtual machine loses a core for a while. A thread that is taken away in the middle of its work
//! is waited for, and the language has no way to know beforehand. So time is accounted for: what passes on several
//! threads gain over one is kept, up to a limit, what they lose is taken from it, and when nothing is left, passes run
//! on one thread until the loss is a small share of the time. Results do not depend on the number of threads, so this
//! changes no bit.
//!
//! Cost: a clock reading before and after each pass, and a pass on one thread now and then to know its time.

use std::time::Instant;

/// The largest share of the time that several threads may lose.
const LOSS: f64 = 0.03;
/// The most that is kept of what was gained, in ns: some time slices of an operating system.
const MOST_GAIN: f64 = 10e6;
/// Passes on one thread before the first on several: the first ones fill the caches.
const WARM_UP: u32 = 4;
/// Passes on several threads in a row.
const IN_A_ROW: u32 = 64;
/// Growth of the known time of one thread from pass to pass, unless it is confirmed.
const DRIFT: f64 = 1.02;

/// The account of one kind of pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pace {
    /// Time of a block on one thread in ns.
    alone: f64,
    /// Passes on one thread so far.
    measured: u32,
    /// Passes on several threads since the last on one.
    in_a_row: u32,
    /// What passes on several threads have gained in ns.
    balance: f64,
    /// Time in ns for which passes run on one thread.
    recovery: f64,
}

impl Pace {
    /// Whether the next pass runs on several threads.
    pub(crate) fn is_shared(&self) -> bool {
        self.measured >= WARM_UP && self.in_a_row < IN_A_ROW && self.recovery <= 0.0
    }

    fn record_alone(&mut self, blocks: f64, time: f64) {
        let block = time / blocks;
        self.alone = match self.measured {
            0 => block,
            _ => block.min(self.alone * DRIFT),
        };
        self.measured = self.measured.saturating_add(1);
        self.in_a_row = 0;
        self.recovery -= time;
    }

    fn record_shared(&mut self, blocks: f64, time: f64) {
        self.in_a_row += 1;
        self.balance = (self.balance + self.alone * blocks - time).min(MOST_GAIN);
        if self.balance < 0.0 {
            self.recovery = -self.balance / LOSS;
            self.balance = 0.0;
        }
    }

    /// An account of so much gain that passes run on several threads.
    #[cfg(test)]
    pub(crate) fn of_threads_that_gain() -> Self {
        Self {
            alone: f64::INFINITY,
            measured: WARM_UP,
            ..Self::default()
        }
    }

    /// Runs a pass over so many blocks, told whether on several threads, and accounts for its time.
    pub(crate) fn run(&mut self, blocks: usize, pass: impl FnOnce(bool)) {
        let (shared, start) = (self.is_shared(), Instant::now());
        pass(shared);
        let time = start.elapsed().as_secs_f64() * 1e9;
        let blocks = blocks.max(1) as f64;
        if shared {
            self.record_shared(blocks, time);
        } else {
            self.record_alone(blocks, time);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The time of all passes over that of one thread alone, if a pass takes 1 ms on one thread and `shared(n)` on
    /// several.
    fn share(passes: u32, shared: impl Fn(u32) -> f64) -> f64 {
        let mut pace = Pace::default();
        let mut time = 0.0;
        for n in 0..passes {
            if pace.is_shared() {
                pace.record_shared(1e3, shared(n) * 1e6);
                time += shared(n);
            } else {
                pace.record_alone(1e3, 1e6);
                time += 1.0;
            }
        }
        time / f64::from(passes)
    }

    #[test]
    fn threads_that_lose_are_left_out() {
        for loss in [1.2, 3.0, 30.0] {
            let share = share(20_000, |_| loss);
            assert!(share < 1.0 + 2.0 * LOSS, "{loss}: {share}");
        }
    }

    #[test]
    fn threads_that_gain_are_used() {
        assert!(share(20_000, |_| 0.5) < 0.52);
        // A time slice lost now and then is paid for by what was gained.
        let with_losses = share(20_000, |n| if n % 20 == 0 { 5.0 } else { 0.5 });
        assert!(with_losses < 0.75, "{with_losses}");
    }

    #[test]
    fn threads_come_back_when_they_gain_again() {
        let share = share(20_000, |n| if n < 5_000 { 3.0 } else { 0.5 });
        assert!(share < 0.7, "{share}");
    }
}
