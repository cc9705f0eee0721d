//! Ragged arrays: all rows one after the other, and the offset of each.
//!
//! This is the storage of all constant lists of lists in the crate. Its only algorithm is
//! transposition by counting sort, which also sorts: rows are walked in ascending order, so every
//! transposed row is ascending. Cost: O(rows + values).

use crate::GraphError;

/// Rows of `u32`: row `i` is `values[offsets[i]..offsets[i + 1]]`; there is one offset more than
/// rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Csr {
    pub(crate) offsets: Vec<u32>,
    pub(crate) values: Vec<u32>,
}

/// Converts `count` to an offset; the callers document the limit.
pub(crate) fn offset(count: usize) -> u32 {
    u32::try_from(count).expect("a ragged array holds at most 2^32 - 1 entries")
}

/// An error unless `count` items can be numbered in 32 bits; `what` names the items.
pub(crate) fn fits(what: &'static str, count: usize) -> Result<(), GraphError> {
    match u32::try_from(count) {
        Ok(_) => Ok(()),
        Err(_) => Err(GraphError::TooMany { what, count }),
    }
}

/// Turns counts, shifted by one (`counts[i + 1]` for row `i`), into offsets.
pub(crate) fn accumulate(counts: &mut [u32]) {
    let mut sum = 0;
    for count in counts {
        sum = offset(sum as usize + *count as usize);
        *count = sum;
    }
}

impl Csr {
    /// Checks and takes rows with arbitrary values. O(rows).
    ///
    /// # Errors
    /// Offsets that do not start at 0, go down or end elsewhere than at `values.len()`.
    pub(crate) fn new(offsets: Vec<u32>, values: Vec<u32>) -> Result<Self, GraphError> {
        if offsets.first() != Some(&0) {
            return Err(GraphError::OffsetsStart);
        }
        for (row, pair) in offsets.windows(2).enumerate() {
            if pair[1] < pair[0] {
                return Err(GraphError::OffsetsDecrease {
                    row,
                    before: pair[0],
                    after: pair[1],
                });
            }
        }
        let last = offsets[offsets.len() - 1];
        if last as usize != values.len() {
            return Err(GraphError::OffsetsEnd {
                last,
                values: values.len(),
            });
        }
        Ok(Self { offsets, values })
    }

    /// No rows, with capacity for `rows`.
    pub(crate) fn with_rows(rows: usize) -> Self {
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        Self {
            offsets,
            values: Vec::new(),
        }
    }

    /// Ends the current row, which has the values pushed since the last call.
    pub(crate) fn end_row(&mut self) {
        self.offsets.push(offset(self.values.len()));
    }

    pub(crate) fn row_count(&self) -> usize {
        self.offsets.len() - 1
    }

    pub(crate) fn row(&self, row: usize) -> &[u32] {
        &self.values[self.offsets[row] as usize..self.offsets[row + 1] as usize]
    }

    pub(crate) fn rows(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.offsets
            .windows(2)
            .map(|pair| &self.values[pair[0] as usize..pair[1] as usize])
    }

    /// Row `j` of the result lists, ascending, the rows of `self` that hold `j`. Values must be
    /// below `columns`.
    pub(crate) fn transpose(&self, columns: usize) -> Self {
        let mut offsets = vec![0; columns + 1];
        for &value in &self.values {
            offsets[value as usize + 1] += 1;
        }
        accumulate(&mut offsets);
        let mut cursor = offsets.clone();
        let mut values = vec![0; self.values.len()];
        for (id, row) in (0..).zip(self.rows()) {
            for &value in row {
                let position = &mut cursor[value as usize];
                values[*position as usize] = id;
                *position += 1;
            }
        }
        Self { offsets, values }
    }

    /// Row `j` of the result lists, ascending, the positions of `labels` that hold `j`; labels from
    /// `rows` on are left out.
    pub(crate) fn group(rows: usize, labels: impl Iterator<Item = u32> + Clone) -> Self {
        let mut offsets = vec![0; rows + 1];
        for label in labels.clone().filter(|&label| (label as usize) < rows) {
            offsets[label as usize + 1] += 1;
        }
        accumulate(&mut offsets);
        let mut cursor = offsets.clone();
        let mut values = vec![0; offsets[rows] as usize];
        for (id, label) in (0..).zip(labels) {
            if let Some(position) = cursor[..rows].get_mut(label as usize) {
                values[*position as usize] = id;
                *position += 1;
            }
        }
        Self { offsets, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposing_twice_sorts_the_rows() {
        let csr = Csr {
            offsets: vec![0, 2, 2, 5],
            values: vec![3, 1, 2, 0, 3],
        };
        let once = csr.transpose(4);
        assert_eq!(
            once.rows().collect::<Vec<_>>(),
            [&[2][..], &[0], &[2], &[0, 2]]
        );
        let twice = once.transpose(3);
        assert_eq!(
            twice.rows().collect::<Vec<_>>(),
            [&[1, 3][..], &[], &[0, 2, 3]]
        );
    }

    #[test]
    fn grouping_leaves_out_foreign_labels() {
        let csr = Csr::group(3, [2, 0, u32::MAX, 2, 3].into_iter());
        assert_eq!(csr.rows().collect::<Vec<_>>(), [&[1][..], &[], &[0, 3]]);
    }

    #[test]
    fn no_rows() {
        let csr = Csr::with_rows(0);
        assert_eq!(csr.row_count(), 0);
        assert_eq!(csr.transpose(0).row_count(), 0);
    }
}
