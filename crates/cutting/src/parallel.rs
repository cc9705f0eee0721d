//! Maps over many items by several threads, a few by one.
//!
//! Results come in the order of the items and each depends on its item only, so they are the same for any number of
//! threads. Source: plain data parallelism through the crate `rayon`. Cost: one call an item.

use rayon::prelude::*;

/// Fewer items than this are not worth waking another thread for.
const PARALLEL_ITEMS: usize = 4096;

/// The results of `f`, in the order of the items.
pub(crate) fn map<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    if items.len() < PARALLEL_ITEMS {
        return items.iter().map(f).collect();
    }
    items.par_iter().with_min_len(1024).map(&f).collect()
}

/// The results of `f` that are something, in the order of the items.
pub(crate) fn filter_map<T: Sync, R: Send>(
    items: &[T],
    f: impl Fn(&T) -> Option<R> + Sync,
) -> Vec<R> {
    if items.len() < PARALLEL_ITEMS {
        return items.iter().filter_map(f).collect();
    }
    let results = items.par_iter().with_min_len(1024).filter_map(&f);
    results.collect()
}

/// The results of `f` for the numbers below `count`, in their order.
pub(crate) fn map_numbers<R: Send>(count: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    if count < PARALLEL_ITEMS {
        return (0..count).map(f).collect();
    }
    let numbers = (0..count).into_par_iter().with_min_len(PARALLEL_ITEMS);
    numbers.map(&f).collect()
}

/// The results of `f` for the numbers below `count` that are something, in their order.
pub(crate) fn filter_map_numbers<R: Send>(
    count: usize,
    f: impl Fn(usize) -> Option<R> + Sync,
) -> Vec<R> {
    if count < PARALLEL_ITEMS {
        return (0..count).filter_map(f).collect();
    }
    let numbers = (0..count).into_par_iter().with_min_len(PARALLEL_ITEMS);
    numbers.filter_map(&f).collect()
}
