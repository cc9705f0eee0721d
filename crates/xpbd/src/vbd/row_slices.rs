//! [`row_slices`]: the rows of a ragged array, divided among threads.
//!
//! Each thread gets consecutive rows and a slice with their entries, so that rows are written in parallel without a copy.
//! Cost: O(threads).

use std::ops::Range;

use super::PARALLEL_ROWS;

/// Threads that are worth their start for a number of rows, at least 1.
pub(super) fn threads_for(rows: usize) -> usize {
    rayon::current_num_threads()
        .min(rows.div_ceil(PARALLEL_ROWS))
        .max(1)
}

/// The rows in one slice a thread, each with its entries; `offsets` has a 0 and the end of the entries of each row.
pub(super) fn row_slices<'a, B>(
    offsets: &[usize],
    mut entries: &'a mut [B],
) -> Vec<(Range<usize>, &'a mut [B])> {
    let rows = offsets.len() - 1;
    let parts = threads_for(rows);
    let mut slices = Vec::with_capacity(parts);
    for part in 0..parts {
        let (start, end) = (rows * part / parts, rows * (part + 1) / parts);
        let (own, later) = entries.split_at_mut(offsets[end] - offsets[start]);
        entries = later;
        slices.push((start..end, own));
    }
    slices
}
