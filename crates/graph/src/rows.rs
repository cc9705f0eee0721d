//! Ragged arrays that change: rows one after the other, each with some room to grow.
//!
//! All values are in one array, as in CSR, but a row has a start, a length and a capacity, so a row
//! that exceeds its capacity moves to the end and leaves a hole. Capacities grow by a quarter and
//! 4. [`Rows::tidy`] closes the holes once more than two thirds of the array are holes and spare
//! capacity, so memory stays within three times the values (and a constant). Each value pushed
//! costs amortized O(1): between two tidy-ups the number of values pushed or removed is
//! proportional to their total.

use crate::csr::offset;

/// Values beyond three times the held ones that do not trigger a tidy-up.
const SPARE: usize = 64;

#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Span {
    start: u32,
    length: u32,
    room: u32,
}

/// Rows of values, each of which can grow and shrink.
///
/// Deterministic: the order within a row depends only on the calls. Methods that move values return
/// their number, so that a caller can count the cost.
///
/// ```
/// use incise_graph::Rows;
///
/// let mut rows = Rows::default();
/// rows.refill(2, [(1, 'a'), (0, 'b'), (1, 'c')].into_iter());
/// assert_eq!(rows.row(1), ['a', 'c']);
/// rows.push(0, 'd');
/// assert_eq!(rows.swap_remove(1, 0), 'a');
/// assert_eq!((rows.row(0), rows.row(1)), (&['b', 'd'][..], &['c'][..]));
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Rows<T> {
    spans: Vec<Span>,
    values: Vec<T>,
    /// The number of values in rows.
    held: usize,
}

/// No rows.
impl<T> Default for Rows<T> {
    fn default() -> Self {
        Self {
            spans: Vec::new(),
            values: Vec::new(),
            held: 0,
        }
    }
}

impl<T: Copy> Rows<T> {
    /// Replaces all rows by `rows` rows without spare capacity, reusing the memory. An entry is a
    /// row and a value; the values of a row keep their order. O(rows + entries).
    ///
    /// # Panics
    /// If an entry names another row, or there are 2³² entries.
    pub fn refill(&mut self, rows: usize, entries: impl Iterator<Item = (usize, T)> + Clone) {
        self.spans.clear();
        self.spans.resize(rows, Span::default());
        self.values.clear();
        for (row, value) in entries.clone() {
            self.spans[row].room += 1;
            self.values.push(value);
        }
        self.held = self.values.len();
        let mut start = 0;
        for span in &mut self.spans {
            span.start = start;
            start = offset(start as usize + span.room as usize);
        }
        for (row, value) in entries {
            let span = &mut self.spans[row];
            self.values[(span.start + span.length) as usize] = value;
            span.length += 1;
        }
    }

    /// The number of rows, including empty ones.
    #[must_use]
    pub fn row_count(&self) -> usize {
        self.spans.len()
    }

    /// The number of values in all rows.
    #[must_use]
    pub fn value_count(&self) -> usize {
        self.held
    }

    /// The values of a row.
    ///
    /// # Panics
    /// If there is no such row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[T] {
        let span = self.spans[row];
        &self.values[span.start as usize..(span.start + span.length) as usize]
    }

    /// All rows.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[T]> {
        (0..self.row_count()).map(|row| self.row(row))
    }

    /// Appends empty rows until there are `rows`, or removes the last ones. O(rows changed).
    pub fn set_row_count(&mut self, rows: usize) {
        let gone = self.spans.get(rows..).unwrap_or(&[]);
        self.held -= gone.iter().map(|span| span.length as usize).sum::<usize>();
        self.spans.resize(rows, Span::default());
    }

    /// Appends a value to a row; returns the number of values moved for it. Amortized O(1).
    ///
    /// # Panics
    /// If there is no such row, or the array would hold 2³² values.
    pub fn push(&mut self, row: usize, value: T) -> usize {
        let Span {
            start,
            length,
            room,
        } = self.spans[row];
        let mut moved = 0;
        if length == room {
            let old = start as usize..(start + length) as usize;
            let room = old.len() + old.len() / 4 + 4;
            let mut first = old.start;
            // The last row grows in its position.
            if old.end != self.values.len() {
                moved = old.len();
                first = self.values.len();
                self.values.extend_from_within(old);
            }
            self.values.resize(first + room, value);
            offset(self.values.len());
            self.spans[row] = Span {
                start: offset(first),
                length,
                room: offset(room),
            };
        }
        let span = &mut self.spans[row];
        self.values[(span.start + span.length) as usize] = value;
        span.length += 1;
        self.held += 1;
        moved
    }

    /// Inserts a value before the one at `at`; returns the number of values moved for it. O(row).
    ///
    /// # Panics
    /// If there is no such row or `at` is past its end.
    pub fn insert(&mut self, row: usize, at: usize, value: T) -> usize {
        let mut moved = self.push(row, value);
        let values = &mut self.row_mut(row)[at..];
        values.rotate_right(1);
        moved += values.len() - 1;
        moved
    }

    /// Removes the value at `at`, keeping the order of the others; returns the number of values
    /// moved for it. O(row).
    ///
    /// # Panics
    /// If there is no such row or value.
    pub fn remove(&mut self, row: usize, at: usize) -> usize {
        let values = &mut self.row_mut(row)[at..];
        values.rotate_left(1);
        let moved = values.len() - 1;
        self.pop(row);
        moved
    }

    /// Removes and returns the value at `at`, which is replaced by the last of the row. O(1).
    ///
    /// # Panics
    /// If there is no such row or value.
    pub fn swap_remove(&mut self, row: usize, at: usize) -> T {
        let values = self.row_mut(row);
        let removed = values[at];
        values[at] = values[values.len() - 1];
        self.pop(row);
        removed
    }

    /// Removes the last value of a row, if there is one. O(1).
    ///
    /// # Panics
    /// If there is no such row.
    pub fn pop(&mut self, row: usize) -> Option<T> {
        let value = self.row(row).last().copied()?;
        self.spans[row].length -= 1;
        self.held -= 1;
        Some(value)
    }

    /// Closes all holes if they exceed the limit; returns the number of values moved. Call it after
    /// a number of edits. Amortized O(1) for each of them.
    pub fn tidy(&mut self) -> usize {
        if self.values.len() <= 3 * self.held + SPARE {
            return 0;
        }
        let mut values = Vec::with_capacity(self.held);
        for span in &mut self.spans {
            let first = offset(values.len());
            let old = span.start as usize..(span.start + span.length) as usize;
            values.extend_from_slice(&self.values[old]);
            span.start = first;
            span.room = span.length;
        }
        self.values = values;
        self.held
    }

    fn row_mut(&mut self, row: usize) -> &mut [T] {
        let span = self.spans[row];
        &mut self.values[span.start as usize..(span.start + span.length) as usize]
    }
}
