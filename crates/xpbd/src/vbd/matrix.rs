//! [`Blocks`]: a symmetric matrix with one 3×3 block for each pair of particles with a common tet.
//!
//! Rows and columns follow the solving order of the stars, so colors are contiguous. The part right of the diagonal is a
//! copy of the left part, for those who call [`Blocks::mirror`]. Cost: 9 numbers an edge and direction; a product is twice as many operations as numbers.

use std::ops::Range;

use rayon::prelude::*;

use super::block::Block;
use super::row_slices::threads_for;
use super::stars::StarData;
use crate::wide::wide;
use crate::{Float, XpbdError};

/// A symmetric matrix of blocks with the pattern of a mesh.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Blocks<R: Float> {
    /// Where the blocks of each row end, a 0 before the first.
    pub(super) offsets: Vec<usize>,
    /// Where the blocks right of the diagonal begin in each row.
    pub(super) upper: Vec<usize>,
    /// Where the values of each block are: itself, or its transpose left of the diagonal.
    pub(super) sources: Vec<u32>,
    /// The column of each block; the diagonal comes first in its row, the others ascend.
    pub(super) columns: Vec<u32>,
    pub(super) blocks: Vec<Block<R>>,
    /// For each term, the indices of its three blocks within their row.
    pub(super) block_indices: Vec<[u32; 3]>,
    /// The held excess of each tet.
    pub(super) excess: Vec<R>,
    /// That of the stars whose pattern it has.
    revision: u64,
    /// Number of patterns so far.
    pub(super) patterns: u64,
}

/// The pattern of consecutive rows.
#[derive(Default)]
struct Pattern {
    columns: Vec<u32>,
    block_indices: Vec<[u32; 3]>,
    /// For each row the end of its blocks up to the diagonal, and the end of all its blocks.
    rows: Vec<[usize; 2]>,
    /// For each column the last row that has a block there, and the index of the block in that row.
    seen: Vec<(u32, u32)>,
}

impl Pattern {
    fn with_rows(rows: usize) -> Self {
        Self {
            seen: vec![(u32::MAX, 0); rows],
            ..Self::default()
        }
    }

    /// Appends a row.
    fn push<R: Float>(&mut self, stars: &StarData<R>, row: usize) {
        let (columns, seen) = (&mut self.columns, &mut self.seen);
        let diagonal = u32::try_from(row).expect("particles are numbered in 32 bits");
        let first = columns.len();
        columns.push(diagonal);
        seen[row].0 = diagonal;
        let of_tets = stars.of(row).iter().flat_map(|term| term.others);
        for p in of_tets.chain(stars.constraints.neighbors(row)) {
            let column = stars.row_of[p as usize];
            let mark = &mut seen[column as usize].0;
            if *mark != diagonal {
                *mark = diagonal;
                columns.push(column);
            }
        }
        let beside = &mut columns[first + 1..];
        beside.sort_unstable();
        let below = first + 1 + beside.partition_point(|&column| column < diagonal);
        for (block, &column) in (1u32..).zip(&*beside) {
            seen[column as usize].1 = block;
        }
        let block = |p: u32| seen[stars.row_of[p as usize] as usize].1;
        let terms = stars.of(row).iter();
        self.block_indices
            .extend(terms.map(|term| term.others.map(block)));
        self.rows.push([below, self.columns.len()]);
    }
}

impl<R: Float> Blocks<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.offsets)
            + size_of_val(&*self.upper)
            + size_of_val(&*self.sources)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.blocks)
            + size_of_val(&*self.block_indices)
            + size_of_val(&*self.excess)
    }

    /// The pattern of some stars; no values yet. O(pairs + blocks log valence).
    pub(super) fn new(stars: &StarData<R>) -> Self {
        let mut blocks = Self::empty();
        blocks.sync(stars);
        blocks
    }

    /// A matrix without rows.
    pub(super) fn empty() -> Self {
        Self {
            offsets: vec![0],
            upper: Vec::new(),
            sources: Vec::new(),
            columns: Vec::new(),
            blocks: Vec::new(),
            block_indices: Vec::new(),
            excess: Vec::new(),
            revision: 0,
            patterns: 0,
        }
    }

    /// Takes the pattern of other stars; memory is used again, and values are undefined until they are filled.
    /// O(pairs + blocks log valence), or a copy of the rows that an update of the stars has kept.
    pub(super) fn sync(&mut self, stars: &StarData<R>) {
        let Self {
            offsets,
            upper,
            sources,
            columns,
            blocks,
            block_indices,
            revision,
            patterns: count,
            ..
        } = self;
        let rows = stars.order.len();
        let is_updated = stars.moved.len() == upper.len()
            && stars.kept.len() == rows
            && stars.revision == *revision + 1;
        let patterns = if is_updated {
            let mut pattern = Pattern::with_rows(rows);
            for (row, &before) in stars.kept.iter().enumerate() {
                let before = before as usize;
                if before >= upper.len() {
                    pattern.push(stars, row);
                    continue;
                }
                let first = pattern.columns.len();
                let own = &columns[offsets[before]..offsets[before + 1]];
                let own = own.iter().map(|&column| stars.moved[column as usize]);
                pattern.columns.extend(own);
                let pairs = stars.offsets_before[before]..stars.offsets_before[before + 1];
                pattern
                    .block_indices
                    .extend_from_slice(&block_indices[pairs]);
                let below = first + upper[before] - offsets[before];
                pattern.rows.push([below, pattern.columns.len()]);
            }
            vec![pattern]
        } else {
            let parts = threads_for(rows);
            let range = |part| rows * part / parts..rows * (part + 1) / parts;
            let patterns = (0..parts).into_par_iter().map(|part| {
                let mut pattern = Pattern::with_rows(rows);
                range(part).for_each(|row| pattern.push(stars, row));
                pattern
            });
            patterns.collect()
        };
        *revision = stars.revision;
        *count += 1;
        offsets.clear();
        offsets.push(0);
        upper.clear();
        columns.clear();
        block_indices.clear();
        for pattern in patterns {
            let first = columns.len();
            columns.extend_from_slice(&pattern.columns);
            block_indices.extend_from_slice(&pattern.block_indices);
            for [below, end] in pattern.rows {
                upper.push(first + below);
                offsets.push(first + end);
            }
        }
        blocks.resize(columns.len(), [R::Vector::default(); 3]);
        // Rows come in ascending order, so the transposes in a row are met from its first block on.
        let mut next: Vec<usize> = offsets[..rows].iter().map(|first| first + 1).collect();
        sources.clear();
        let number = |block: usize| u32::try_from(block).expect("blocks are numbered in 32 bits");
        for (row, &from) in upper.iter().enumerate() {
            sources.extend((offsets[row]..from).map(number));
            for &column in &columns[from..offsets[row + 1]] {
                let block = &mut next[column as usize];
                sources.push(number(*block));
                *block += 1;
            }
        }
    }

    /// Copies what is left of the diagonal to its right.
    pub(super) fn mirror(&mut self) {
        for row in 0..self.upper.len() {
            for block in self.upper(row) {
                let [a, b, c] = self.blocks[self.sources[block] as usize].map(R::components);
                self.blocks[block] = [
                    R::vector(a[0], b[0], c[0]),
                    R::vector(a[1], b[1], c[1]),
                    R::vector(a[2], b[2], c[2]),
                ];
            }
        }
    }

    /// `y = A x`, row by row.
    #[cfg(test)]
    pub(super) fn multiply(&self, x: &[R::Vector], y: &mut [R::Vector]) {
        for (row, y) in y.iter_mut().enumerate() {
            *y = R::Vector::default();
            for (column, block) in self.row(row) {
                *y += super::block::apply::<R>(block, x[column]);
            }
        }
    }

    /// The blocks of a row left of the diagonal.
    pub(super) fn lower(&self, row: usize) -> Range<usize> {
        self.offsets[row] + 1..self.upper[row]
    }

    /// The blocks of a row right of the diagonal.
    pub(super) fn upper(&self, row: usize) -> Range<usize> {
        self.upper[row]..self.offsets[row + 1]
    }

    /// Compares the pattern with a rebuilt one.
    ///
    /// # Errors
    /// [`XpbdError::Layout`] if it differs.
    pub(super) fn check(&self, stars: &StarData<R>) -> Result<(), XpbdError> {
        let rebuilt = Self::new(stars);
        let is_same = self.offsets == rebuilt.offsets
            && self.upper == rebuilt.upper
            && self.sources == rebuilt.sources
            && self.columns == rebuilt.columns
            && self.block_indices == rebuilt.block_indices
            && self.blocks.len() == rebuilt.blocks.len();
        let what = "pattern of blocks";
        is_same
            .then_some(())
            .ok_or(XpbdError::Layout { what, number: 0 })
    }

    /// Whether this is the pattern of as many rows and pairs.
    pub(super) fn belongs_to(&self, stars: &StarData<R>) -> bool {
        self.offsets.len() == stars.order.len() + 1 && self.block_indices.len() == stars.terms.len()
    }

    /// The columns and blocks of a row.
    #[inline]
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, &Block<R>)> + Clone {
        let range = self.offsets[row]..self.offsets[row + 1];
        self.columns[range.clone()]
            .iter()
            .map(|&c| c as usize)
            .zip(&self.blocks[range])
    }
}

/// Sets each element, `at_a_time` of them on a thread if there are enough for two.
#[inline(always)]
pub(super) fn each_row<V: Send>(y: &mut [V], at_a_time: usize, value: impl Fn(usize) -> V + Sync) {
    let work = |first: usize, y: &mut [V]| {
        wide(
            #[inline(always)]
            || {
                for (row, y) in (first..).zip(y) {
                    *y = value(row);
                }
            },
        );
    };
    if y.len() < 2 * at_a_time {
        return work(0, y);
    }
    let chunks = y.par_chunks_mut(at_a_time).enumerate();
    chunks.for_each(|(chunk, y)| work(chunk * at_a_time, y));
}
