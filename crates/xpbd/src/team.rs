//! [`parallel_rounds`]: runs rounds of chunks on several threads, with a barrier between rounds; and [`keep_awake`],
//! which keeps these threads ready from one pass to the next.
//!
//! A color takes less time than waking a thread, which is 50 µs and more. Helpers are therefore woken once a frame, look
//! for work until it ends, and within a pass meet at a counter after each color. Each thread takes the same share of
//! every round, so that particles stay in its cache. A share whose thread is late is taken by another one. Helpers that
//! have not started are not waited for: if the pool is busy elsewhere, the caller does all chunks. A thread without a
//! chunk spins for a moment, then yields and at last parks, since the thread it waits for may need its core: on a busy
//! machine, or where a helper was woken on the core of the caller.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Looks at the counter before a waiting thread takes a chunk of another thread that is there: less than a microsecond.
const PATIENCE: u32 = 50;
/// Looks at the counter before a waiting thread lets others have its core: about a microsecond.
const LOOKS: u32 = 100;
/// Times that a waiting thread lets others have its core before it parks: some tens of microseconds if none wants it.
const YIELDS: u32 = 50;
/// For how long a thread that is kept awake looks for work in vain.
const MOST_IDLE: Duration = Duration::from_micros(500);

thread_local! {
    /// Whether the thread solves a frame or looks for work in one.
    static IN_FRAME: Cell<bool> = const { Cell::new(false) };
}

/// A thread in a frame, until it is dropped, by a panic too.
struct InFrame;

impl InFrame {
    /// `None` if the thread is in a frame already.
    fn enter() -> Option<Self> {
        (!IN_FRAME.replace(true)).then(|| Self)
    }
}

impl Drop for InFrame {
    fn drop(&mut self) {
        IN_FRAME.set(false);
    }
}

/// Runs `work` on a thread of the present rayon pool, if it is large. From outside of the pool each parallel loop in it
/// would hand its work to a thread of the pool and sleep until that has ended, some 30 µs each time.
pub(crate) fn in_pool_if<T: Send>(is_large: bool, work: impl FnOnce() -> T + Send) -> T {
    match is_large {
        true => rayon::scope(|_| work()),
        false => work(),
    }
}

/// Runs `frame`, and meanwhile keeps the other threads of the present rayon pool looking for work: each of them until it
/// has found none for half a millisecond. A thread without work lets other programs have its core.
pub(crate) fn keep_awake<T>(frame: impl FnOnce() -> T) -> T {
    /// Ends the wait of the others, by a panic too.
    struct End(Arc<AtomicBool>);
    impl Drop for End {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Release);
        }
    }

    // Outside of a pool it is not known which threads will help.
    let is_alone = rayon::current_thread_index().is_none() || rayon::current_num_threads() < 2;
    let Some(_in_frame) = (!is_alone).then(InFrame::enter).flatten() else {
        return frame();
    };
    let end = End(Arc::new(AtomicBool::new(false)));
    let has_ended = Arc::clone(&end.0);
    // Not part of a scope, which would wait for a thread that is busy elsewhere and comes late.
    rayon::spawn_broadcast(move |_| look_for_work(&has_ended));
    frame()
}

/// Runs what the pool has to do until a frame has ended, unless the thread is in a frame already: it must come back to that.
fn look_for_work(has_ended: &AtomicBool) {
    let Some(_in_frame) = InFrame::enter() else {
        return;
    };
    let mut idle_since = Instant::now();
    while !has_ended.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            idle_since = Instant::now();
        } else if idle_since.elapsed() > MOST_IDLE {
            return;
        } else {
            std::thread::yield_now();
        }
    }
}

/// Calls `work(round, chunk)` for all chunks of all rounds, `chunks(round)` of them in each, on the threads of the
/// present rayon pool. A round begins when the one before it has ended; what its chunks wrote is visible then. As far
/// as threads are free, each takes the chunks of its own part: of n chunks and m threads, thread k takes number `k n / m`.
pub(crate) fn parallel_rounds(
    rounds: usize,
    chunks: impl Fn(usize) -> usize + Sync,
    work: impl Fn(usize, usize) + Sync,
) {
    // No more than the largest round can use.
    let most = (0..rounds).map(&chunks).max().unwrap_or(0);
    let threads = rayon::current_num_threads();
    let team = Team {
        rounds,
        threads,
        chunks: &chunks,
        work: &work,
        round: AtomicUsize::new(0),
        claimed: (0..most).map(|_| AtomicUsize::new(0)).collect(),
        ended: AtomicUsize::new(0),
        present: AtomicUsize::new(0),
        parked: AtomicUsize::new(0),
        lock: Mutex::new(()),
        round_ended: Condvar::new(),
    };
    let helpers = threads.min(most).saturating_sub(1);
    rayon::scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| team.work());
        }
        team.work();
    });
}

struct Team<'a, C, W> {
    rounds: usize,
    threads: usize,
    chunks: &'a C,
    work: &'a W,
    /// The present round.
    round: AtomicUsize,
    /// For each chunk the rounds up to which a thread has taken it.
    claimed: Vec<AtomicUsize>,
    /// Chunks of the round that have ended.
    ended: AtomicUsize,
    /// Threads that have started.
    present: AtomicUsize,
    parked: AtomicUsize,
    lock: Mutex<()>,
    round_ended: Condvar,
}

impl<C: Fn(usize) -> usize, W: Fn(usize, usize)> Team<'_, C, W> {
    fn work(&self) {
        let thread = rayon::current_thread_index().unwrap_or(0);
        self.present.fetch_add(1, Ordering::Relaxed);
        let mut round = self.round.load(Ordering::Acquire);
        while round < self.rounds {
            let chunks = (self.chunks)(round);
            if chunks == 0 {
                round = self.begin(round, round + 1);
                continue;
            }
            let own = thread * chunks / self.threads;
            if self.take(round, own) {
                self.run(round, own);
            }
            round = self.help(round, own, chunks);
        }
    }

    /// Waits until a round has ended; takes chunks of it that no thread has taken. Returns the present round.
    fn help(&self, round: usize, own: usize, chunks: usize) -> usize {
        let mut looks = 0;
        loop {
            let now = self.round.load(Ordering::Acquire);
            if now != round {
                return now;
            }
            let is_late = looks >= PATIENCE || self.present.load(Ordering::Relaxed) < self.threads;
            let left = || (1..chunks).map(|k| (own + k) % chunks);
            if is_late && let Some(chunk) = left().find(|&chunk| self.take(round, chunk)) {
                self.run(round, chunk);
                continue;
            }
            if looks < LOOKS {
                std::hint::spin_loop();
            } else if looks < LOOKS + YIELDS {
                std::thread::yield_now();
            } else {
                return self.park(round);
            }
            looks += 1;
        }
    }

    /// Takes a chunk of a round, unless another thread has, or the round has ended.
    fn take(&self, round: usize, chunk: usize) -> bool {
        let claimed = &self.claimed[chunk];
        let seen = claimed.load(Ordering::Relaxed);
        // The round began after all chunks of the one before it had ended, and that was seen with Acquire.
        let (order, next) = (Ordering::Relaxed, round + 1);
        seen <= round && claimed.compare_exchange(seen, next, order, order).is_ok()
    }

    fn run(&self, round: usize, chunk: usize) {
        // A panic must not leave the others waiting, so the chunk ends in any case.
        let _end = EndOfChunk { team: self, round };
        (self.work)(round, chunk);
    }

    /// Begins a round, unless another thread has; returns the present one.
    fn begin(&self, from: usize, to: usize) -> usize {
        let order = Ordering::AcqRel;
        match self
            .round
            .compare_exchange(from, to, order, Ordering::Acquire)
        {
            Ok(_) => to,
            Err(now) => now,
        }
    }

    fn end_chunk(&self, round: usize) {
        let ended = self.ended.fetch_add(1, Ordering::AcqRel) + 1;
        if ended == (self.chunks)(round) {
            self.ended.store(0, Ordering::Relaxed);
            self.round.store(round + 1, Ordering::SeqCst);
            if self.parked.load(Ordering::SeqCst) > 0 {
                // A thread that is about to park looks at the round again under the lock.
                drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
                self.round_ended.notify_all();
            }
        }
    }

    /// Sleeps until a round has ended; returns the present one.
    fn park(&self, round: usize) -> usize {
        self.parked.fetch_add(1, Ordering::SeqCst);
        let mut guard = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        let now = loop {
            let now = self.round.load(Ordering::SeqCst);
            if now != round {
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

    /// Large work goes to a thread of the pool, once; small work stays, and so does what is in the pool already.
    #[test]
    fn large_work_is_done_in_the_pool() {
        use rayon::current_thread_index as number;
        assert_eq!(number(), None);
        let inside = in_pool_if(true, || (number(), in_pool_if(true, number)));
        assert!(inside.0.is_some() && inside.0 == inside.1);
        assert_eq!(in_pool_if(false, number), None);
    }

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
                                std::thread::sleep(Duration::from_micros(200));
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

    /// Threads that were kept awake leave the frame when it ends, by a panic too, or when there is nothing to do in it.
    #[test]
    fn threads_leave_a_frame() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.expect("threads start");
        let all_leave = || {
            let start = Instant::now();
            while pool.broadcast(|_| IN_FRAME.get()).contains(&true) {
                assert!(start.elapsed() < Duration::from_secs(60), "a thread stays");
                std::thread::sleep(MOST_IDLE);
            }
        };
        let joins = AtomicUsize::new(0);
        let frame = || {
            assert!(IN_FRAME.get());
            // A frame within the frame is a part of it.
            keep_awake(|| {
                parallel_rounds(
                    20,
                    |_| 3,
                    |_, _| {
                        joins.fetch_add(1, Ordering::Relaxed);
                    },
                );
            });
            assert!(IN_FRAME.get());
        };
        pool.install(|| keep_awake(frame));
        assert_eq!(joins.load(Ordering::Relaxed), 60);
        all_leave();
        let panic = || pool.install(|| keep_awake(|| panic!("in a frame")));
        let result: Result<(), _> = std::panic::catch_unwind(std::panic::AssertUnwindSafe(panic));
        assert!(result.is_err());
        all_leave();
        pool.install(|| {
            keep_awake(|| {
                let others = || {
                    let threads = rayon::broadcast(|_| IN_FRAME.get());
                    threads.into_iter().filter(|&it| it).count()
                };
                let start = Instant::now();
                while others() > 1 {
                    assert!(start.elapsed() < Duration::from_secs(60), "a thread stays");
                    std::thread::sleep(2 * MOST_IDLE);
                }
            });
        });
        // Outside of a pool no thread is kept awake.
        assert!(!keep_awake(|| IN_FRAME.get()));
    }
}
