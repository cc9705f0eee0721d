//! [`parallel_rounds`]: runs rounds of chunks on several threads, with a barrier between rounds.
//!
//! A color takes about as long as waking a thread. Helpers are therefore woken once for all colors and meet at a
//! counter after each. A free thread takes the next chunk of the round. Helpers that have not started are not waited
//! for: if the pool is busy elsewhere, the caller does all chunks. A thread without a chunk spins for a moment,
//! then yields and at last parks, since the thread it waits for may need its core: on a busy machine, or where a helper
//! was woken on the core of the caller.

use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};

/// Looks at the counter before a waiting thread lets others have its core: about a microsecond.
const LOOKS: u32 = 100;
/// Times that a waiting thread lets others have its core before it parks: some tens of microseconds if none wants it.
const YIELDS: u32 = 50;

/// Calls `work(round, chunk)` for all chunks of all rounds, `chunks(round)` of them in each, on the threads of the
/// present rayon pool. A round begins when the one before it has ended; what its chunks wrote is visible then.
pub(crate) fn parallel_rounds(
    rounds: usize,
    chunks: impl Fn(usize) -> usize + Sync,
    work: impl Fn(usize, usize) + Sync,
) {
    let team = Team {
        rounds,
        chunks: &chunks,
        work: &work,
        next: AtomicU64::new(0),
        done: AtomicU32::new(0),
        parked: AtomicUsize::new(0),
        lock: Mutex::new(()),
        round_ended: Condvar::new(),
    };
    // No more than the largest round can use.
    let most = (0..rounds).map(&chunks).max().unwrap_or(0);
    let helpers = rayon::current_num_threads().min(most).saturating_sub(1);
    rayon::scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| team.work());
        }
        team.work();
    });
}

struct Team<'a, C, W> {
    rounds: usize,
    chunks: &'a C,
    work: &'a W,
    /// The round in the upper half, its next chunk in the lower.
    next: AtomicU64,
    /// Chunks of the round that have ended.
    done: AtomicU32,
    parked: AtomicUsize,
    lock: Mutex<()>,
    round_ended: Condvar,
}

impl<C: Fn(usize) -> usize, W: Fn(usize, usize)> Team<'_, C, W> {
    fn work(&self) {
        let mut seen = self.next.load(Ordering::Acquire);
        loop {
            let (round, chunk) = ((seen >> 32) as usize, (seen & 0xffff_ffff) as usize);
            if round >= self.rounds {
                return;
            }
            if chunk >= (self.chunks)(round) {
                seen = if (self.chunks)(round) == 0 {
                    self.enter(round, round + 1)
                } else {
                    self.wait_for_end(seen)
                };
                continue;
            }
            let order = Ordering::AcqRel;
            match self
                .next
                .compare_exchange_weak(seen, seen + 1, order, Ordering::Acquire)
            {
                Err(now) => seen = now,
                Ok(_) => {
                    // A panic must not leave the others waiting, so the chunk ends in any case.
                    let end = EndOfChunk { team: self, round };
                    (self.work)(round, chunk);
                    drop(end);
                    seen = self.next.load(Ordering::Acquire);
                }
            }
        }
    }

    /// Begins the next round, unless another thread has.
    fn enter(&self, from: usize, to: usize) -> u64 {
        let (from, to) = ((from as u64) << 32, (to as u64) << 32);
        let order = Ordering::AcqRel;
        match self
            .next
            .compare_exchange(from, to, order, Ordering::Acquire)
        {
            Ok(_) => to,
            Err(now) => now,
        }
    }

    fn end_chunk(&self, round: usize) {
        let ended = self.done.fetch_add(1, Ordering::AcqRel) + 1;
        if ended as usize == (self.chunks)(round) {
            self.done.store(0, Ordering::Relaxed);
            self.next
                .store(((round + 1) as u64) << 32, Ordering::SeqCst);
            if self.parked.load(Ordering::SeqCst) > 0 {
                // A thread that is about to park looks at the counter again under the lock.
                drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
                self.round_ended.notify_all();
            }
        }
    }

    /// Waits until the round of `seen` has ended.
    fn wait_for_end(&self, seen: u64) -> u64 {
        let round = seen >> 32;
        for _ in 0..LOOKS {
            let now = self.next.load(Ordering::Acquire);
            if now >> 32 != round {
                return now;
            }
            std::hint::spin_loop();
        }
        for _ in 0..YIELDS {
            std::thread::yield_now();
            let now = self.next.load(Ordering::Acquire);
            if now >> 32 != round {
                return now;
            }
        }
        self.parked.fetch_add(1, Ordering::SeqCst);
        let mut guard = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        let now = loop {
            let now = self.next.load(Ordering::SeqCst);
            if now >> 32 != round {
                break now;
            }
            guard = self
                .round_ended
                .wait(guard)
                .unwrap_or_else(PoisonError::into_inner);
        };
        self.parked.fetch_sub(1, Ordering::SeqCst);
        now
    }
}

struct EndOfChunk<'a, 'b, C: Fn(usize) -> usize, W: Fn(usize, usize)> {
    team: &'a Team<'b, C, W>,
    round: usize,
}

impl<C: Fn(usize) -> usize, W: Fn(usize, usize)> Drop for EndOfChunk<'_, '_, C, W> {
    fn drop(&mut self) {
        self.team.end_chunk(self.round);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every chunk once, and none before all of the round before it.
    #[test]
    fn rounds_follow_one_another() {
        let sizes = [3usize, 0, 1, 7, 0, 0, 2, 40, 1];
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let ended: Vec<AtomicUsize> = sizes.iter().map(|_| AtomicUsize::new(0)).collect();
            pool.expect("threads start").install(|| {
                for _ in 0..50 {
                    ended.iter().for_each(|e| e.store(0, Ordering::Relaxed));
                    parallel_rounds(
                        sizes.len(),
                        |round| sizes[round],
                        |round, chunk| {
                            assert!(chunk < sizes[round]);
                            for before in 0..round {
                                assert_eq!(ended[before].load(Ordering::Relaxed), sizes[before]);
                            }
                            if (round + chunk) % 5 == 0 {
                                std::thread::sleep(std::time::Duration::from_micros(200));
                            }
                            ended[round].fetch_add(1, Ordering::Relaxed);
                        },
                    );
                    let counts: Vec<_> = ended.iter().map(|e| e.load(Ordering::Relaxed)).collect();
                    assert_eq!(counts, sizes);
                }
            });
        }
    }

    /// Two teams in one pool, each called from a thread of it, must not wait for each other's threads.
    #[test]
    fn teams_in_one_pool_do_not_block_each_other() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let count = AtomicUsize::new(0);
        pool.expect("threads start").install(|| {
            let rounds = || {
                parallel_rounds(
                    100,
                    |_| 4,
                    |_, _| {
                        count.fetch_add(1, Ordering::Relaxed);
                    },
                );
            };
            rayon::join(rounds, rounds);
        });
        assert_eq!(count.into_inner(), 800);
    }

    #[test]
    #[should_panic(expected = "chunk 2 of round 1")]
    fn a_panic_comes_through() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        pool.expect("threads start").install(|| {
            parallel_rounds(
                3,
                |_| 4,
                |round, chunk| {
                    assert!(round != 1 || chunk != 2, "chunk {chunk} of round {round}");
                },
            );
        });
    }
}
