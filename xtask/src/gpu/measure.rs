//! Timing: medians and minima of many runs; the first run is excluded, because it compiles kernels.
//!
//! A wait for a device takes longer than a small frame, so short runs are repeated before a wait.

use std::time::Instant;

use incise::gpu::{GpuContext, GpuError};

use super::report::Times;
use crate::experiment::median;

/// Target time before a wait in ms, and largest number of runs in it.
const BATCH_MS: f64 = 50.0;
const MOST: u32 = 20;

impl Times {
    /// Of several runs; 0 of none.
    pub(crate) fn of(ms: Vec<f64>) -> Self {
        Self {
            median: median(ms.iter().copied()),
            fastest: ms.into_iter().reduce(f64::min).unwrap_or(0.0),
        }
    }
}

/// Milliseconds elapsed since `start`.
pub(crate) fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Times a synchronous run, after one warm-up run.
pub(crate) fn timed<T, E>(
    repeats: u32,
    mut run: impl FnMut() -> Result<T, E>,
) -> Result<(T, Times), E> {
    let mut result = run()?;
    let mut ms = Vec::new();
    for _ in 0..repeats {
        let start = Instant::now();
        result = run()?;
        ms.push(ms_since(start));
    }
    Ok((result, Times::of(ms)))
}

/// Submits pending buffer writes and waits for the device.
pub(crate) fn flush(gpu: &GpuContext) -> Result<(), GpuError> {
    gpu.queue().submit([]);
    gpu.wait()
}

/// Number of runs of the given duration before a wait.
pub(crate) fn batch(ms: f64) -> u32 {
    (1..MOST)
        .find(|&runs| f64::from(runs) * ms >= BATCH_MS)
        .unwrap_or(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_and_the_fastest() {
        let times = Times::of(vec![3.0, 1.0, 2.0, 9.0, 5.0]);
        assert_eq!((times.median, times.fastest), (3.0, 1.0));
        assert_eq!(median([]), 0.0);
    }

    #[test]
    fn the_first_run_is_not_counted() {
        let mut runs = 0;
        let (last, _) = timed(3, || {
            runs += 1;
            Ok::<_, GpuError>(runs)
        })
        .unwrap();
        assert_eq!(last, 4);
    }

    #[test]
    fn short_runs_are_put_together() {
        assert_eq!([1000.0, 50.0, 10.0, 0.0].map(batch), [1, 1, 5, 20]);
    }
}
