//! [`Blocks`]: a symmetric matrix with one 3×3 block for each pair of particles with a common tet.
//!
//! Rows and columns follow the solving order of the stars, so colors are contiguous. The part right of the diagonal is a
//! copy of the left part. Cost: 9 numbers an edge and direction; a product is twice as many operations as numbers.

use std::ops::Range;

use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::{Block, apply};
use super::row_slices::threads_for;
use super::stars::StarData;
use crate::Float;

/// A symmetric matrix of blocks with the pattern of a mesh.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Blocks<R: Float> {
    /// Where the blocks of each row end, a 0 before the first.
    pub(super) offsets: Vec<usize>,
    /// Where the blocks right of the diagonal begin in each row.
    pub(super) upper: Vec<usize>,
    /// Where the transpose of each block right of the diagonal is, row by row.
    mirrors: Vec<u32>,
    /// The column of each block; the diagonal comes first in its row, the others ascend.
    pub(super) columns: Vec<u32>,
    pub(super) blocks: Vec<Block<R>>,
    /// For each term, the indices of its three blocks within their row.
    pub(super) block_indices: Vec<[u32; 3]>,
    /// The held excess of each tet.
    pub(super) excess: Vec<R>,
}

/// The pattern of consecutive rows.
struct Pattern {
    columns: Vec<u32>,
    block_indices: Vec<[u32; 3]>,
    /// For each row the end of its blocks up to the diagonal, and the end of all its blocks.
    rows: Vec<[usize; 2]>,
}

impl Pattern {
    fn new<R: Float>(stars: &StarData<R>, row_of: &[u32], rows: Range<usize>) -> Self {
        let mut columns = Vec::new();
        let mut block_indices = Vec::new();
        let mut ends = Vec::with_capacity(rows.len());
        // For each column the last row that has a block there, and the index of the block in that row.
        let mut seen = vec![(u32::MAX, 0u32); row_of.len()];
        for row in rows {
            let diagonal = u32::try_from(row).expect("particles are numbered in 32 bits");
            let first = columns.len();
            columns.push(diagonal);
            seen[row].0 = diagonal;
            let of_tets = stars.of(row).iter().flat_map(|term| term.others);
            for p in of_tets.chain(stars.constraints.neighbors(row)) {
                let column = row_of[p as usize];
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
            let terms = stars.of(row).iter();
            block_indices
                .extend(terms.map(|term| term.others.map(|p| seen[row_of[p as usize] as usize].1)));
            ends.push([below, columns.len()]);
        }
        Self {
            columns,
            block_indices,
            rows: ends,
        }
    }
}

impl<R: Float> Blocks<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.offsets)
            + size_of_val(&*self.upper)
            + size_of_val(&*self.mirrors)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.blocks)
            + size_of_val(&*self.block_indices)
            + size_of_val(&*self.excess)
    }

    /// The pattern of some stars; no values yet. O(pairs + blocks log valence).
    pub(super) fn new(stars: &StarData<R>) -> Self {
        let mut blocks = Self {
            offsets: Vec::new(),
            upper: Vec::new(),
            mirrors: Vec::new(),
            columns: Vec::new(),
            blocks: Vec::new(),
            block_indices: Vec::new(),
            excess: Vec::new(),
        };
        blocks.sync(stars);
        blocks
    }

    /// Takes the pattern of other stars; memory is used again. O(pairs + blocks log valence).
    pub(super) fn sync(&mut self, stars: &StarData<R>) {
        let Self {
            offsets,
            upper,
            mirrors,
            columns,
            blocks,
            block_indices,
            ..
        } = self;
        let rows = stars.order.len();
        let mut row_of = vec![0u32; rows];
        for (row, &p) in (0u32..).zip(&stars.order) {
            row_of[p as usize] = row;
        }
        offsets.clear();
        offsets.push(0);
        upper.clear();
        columns.clear();
        block_indices.clear();
        let parts = threads_for(rows);
        let range = |part| rows * part / parts..rows * (part + 1) / parts;
        let patterns = (0..parts).into_par_iter();
        let patterns: Vec<Pattern> = patterns
            .map(|part| Pattern::new(stars, &row_of, range(part)))
            .collect();
        for pattern in patterns {
            let first = columns.len();
            columns.extend_from_slice(&pattern.columns);
            block_indices.extend_from_slice(&pattern.block_indices);
            for [below, end] in pattern.rows {
                upper.push(first + below);
                offsets.push(first + end);
            }
        }
        blocks.clear();
        blocks.resize(columns.len(), [R::Vector::default(); 3]);
        // Rows come in ascending order, so the transposes in a row are met from its first block on.
        let mut next: Vec<usize> = offsets[..rows].iter().map(|first| first + 1).collect();
        mirrors.clear();
        for (row, &from) in upper.iter().enumerate() {
            for &column in &columns[from..offsets[row + 1]] {
                let block = &mut next[column as usize];
                mirrors.push(u32::try_from(*block).expect("blocks are numbered in 32 bits"));
                *block += 1;
            }
        }
    }

    /// Copies what is left of the diagonal to its right, but in rows of particles that are held.
    pub(super) fn mirror(&mut self, held: &[bool]) {
        let mut mirrors = self.mirrors.iter();
        for (row, &held) in held.iter().enumerate() {
            let right = self.upper[row]..self.offsets[row + 1];
            for (block, &mirror) in right.zip(&mut mirrors) {
                if !held {
                    let [a, b, c] = self.blocks[mirror as usize].map(R::components);
                    self.blocks[block] = [
                        R::vector(a[0], b[0], c[0]),
                        R::vector(a[1], b[1], c[1]),
                        R::vector(a[2], b[2], c[2]),
                    ];
                }
            }
        }
    }

    /// `y = A x`.
    pub(super) fn multiply(&self, x: &[R::Vector], y: &mut [R::Vector]) {
        self.each_row(y, |row| {
            let all = self.offsets[row]..self.offsets[row + 1];
            -self.without(R::Vector::default(), all, |column| x[column])
        });
    }

    /// `y = -U x` with U what is right of the diagonal.
    pub(super) fn multiply_upper(&self, x: &[R::Vector], y: &mut [R::Vector]) {
        self.each_row(y, |row| {
            self.without(R::Vector::default(), self.upper(row), |column| x[column])
        });
    }

    pub(super) fn each_row(&self, y: &mut [R::Vector], value: impl Fn(usize) -> R::Vector + Sync) {
        let rows = y.par_iter_mut().with_min_len(PARALLEL_ROWS).enumerate();
        rows.for_each(|(row, y)| *y = value(row));
    }

    /// `b` less some blocks times the vectors of their columns.
    #[inline]
    pub(super) fn without(
        &self,
        mut b: R::Vector,
        range: Range<usize>,
        x: impl Fn(usize) -> R::Vector,
    ) -> R::Vector {
        for (&column, block) in self.columns[range.clone()].iter().zip(&self.blocks[range]) {
            b = b - apply::<R>(block, x(column as usize));
        }
        b
    }

    /// The blocks of a row left of the diagonal.
    pub(super) fn lower(&self, row: usize) -> Range<usize> {
        self.offsets[row] + 1..self.upper[row]
    }

    /// The blocks of a row right of the diagonal.
    pub(super) fn upper(&self, row: usize) -> Range<usize> {
        self.upper[row]..self.offsets[row + 1]
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
