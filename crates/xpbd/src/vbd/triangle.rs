//! [`Triangle`]: the blocks on one side of the diagonal, four rows side by side, so that a product takes four rows at
//! a time.
//!
//! Rows of a color are sorted by their number of blocks and taken in fours; the shorter ones of four end with zero
//! blocks. Every row is summed by itself, in the order of its columns, so that its sum is the same whatever rows are
//! beside it. Cost: 9 numbers a block and some percent for zeros.
//!
//! Source: sliced ELLPACK with sorted rows after Kreutzer, Hager, Wellein, Fehske, Bishop 2014.

use std::cmp::Reverse;
use std::ops::Range;

use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::matrix::Blocks;
use crate::Float;
use crate::wide::wide;

/// Blocks of four rows that a thread takes at a time.
const PARALLEL_BLOCKS: usize = 2048;

/// Rows side by side.
const WIDTH: usize = 4;

/// The row of a lane that has none, or the source of a zero block.
const NONE: u32 = u32::MAX;

/// A vector of each of the rows of a slice: x of all, y of all, z of all.
type Lanes<R> = [[R; WIDTH]; 3];

/// Blocks of four rows: each entry of the block by columns, of all rows.
type LaneBlock<R> = [[R; WIDTH]; 9];

/// The blocks left or right of the diagonal.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Triangle<R: Float> {
    /// The rows of each slice.
    rows: Vec<[u32; WIDTH]>,
    /// Where the blocks of each slice end, a 0 before the first.
    offsets: Vec<usize>,
    /// Where the slices of each color end, a 0 before the first.
    colors: Vec<usize>,
    columns: Vec<[u32; WIDTH]>,
    /// Where the values of each block are in the matrix.
    sources: Vec<[u32; WIDTH]>,
    blocks: Vec<LaneBlock<R>>,
    /// The products of a call.
    products: Vec<Lanes<R>>,
}

impl<R: Float> Triangle<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.rows)
            + size_of_val(&*self.offsets)
            + size_of_val(&*self.colors)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.sources)
            + size_of_val(&*self.blocks)
            + size_of_val(&*self.products)
    }

    /// Takes the pattern of the blocks that `range` gives for each row, with rows of the colors that `ends` bounds.
    /// O(blocks + rows log rows).
    pub(super) fn sync(
        &mut self,
        matrix: &Blocks<R>,
        ends: &[usize],
        range: impl Fn(usize) -> Range<usize>,
    ) {
        let Self {
            rows,
            offsets,
            colors,
            columns,
            sources,
            ..
        } = self;
        rows.clear();
        offsets.clear();
        offsets.push(0);
        colors.clear();
        colors.push(0);
        columns.clear();
        sources.clear();
        // Blocks of each row, and the row.
        let mut order: Vec<(usize, u32)> = Vec::new();
        for color in ends.windows(2) {
            order.clear();
            let own = (0u32..).zip(0..color[1]).skip(color[0]);
            order.extend(own.map(|(number, row)| (range(row).len(), number)));
            order.sort_unstable_by_key(|&(length, row)| (Reverse(length), row));
            for own in order.chunks(WIDTH) {
                let first = columns.len();
                let (longest, row) = own[0];
                // A row that has ended goes on with zero times unknowns of the first one.
                let beside = matrix.columns[range(row as usize)].iter();
                columns.extend(beside.map(|&column| [column; WIDTH]));
                sources.resize(first + longest, [NONE; WIDTH]);
                let mut lanes = [NONE; WIDTH];
                for (lane, &(_, row)) in own.iter().enumerate() {
                    lanes[lane] = row;
                    let own = columns[first..].iter_mut().zip(&mut sources[first..]);
                    for ((column, source), block) in own.zip(range(row as usize)) {
                        column[lane] = matrix.columns[block];
                        source[lane] = matrix.sources[block];
                    }
                }
                offsets.push(columns.len());
                rows.push(lanes);
            }
            colors.push(rows.len());
        }
        let zero = [[R::ZERO; WIDTH]; 9];
        self.blocks.resize(self.columns.len(), zero);
    }

    /// Takes the values of the blocks, which `TRANSPOSED` says how their sources hold. O(blocks).
    pub(super) fn fill<const TRANSPOSED: bool>(&mut self, matrix: &Blocks<R>) {
        let blocks = self.blocks.par_chunks_mut(PARALLEL_BLOCKS);
        let own = blocks.zip(self.sources.par_chunks(PARALLEL_BLOCKS));
        own.for_each(|(targets, sources)| {
            wide(
                #[inline(always)]
                || {
                    for (target, sources) in targets.iter_mut().zip(sources) {
                        for (lane, &source) in sources.iter().enumerate() {
                            let block = matrix.blocks.get(source as usize);
                            let [a, b, c] = block.copied().unwrap_or_default();
                            let columns = [R::components(a), R::components(b), R::components(c)];
                            for (column, entries) in columns.iter().enumerate() {
                                for (row, &entry) in entries.iter().enumerate() {
                                    let k = match TRANSPOSED {
                                        false => 3 * column + row,
                                        true => 3 * row + column,
                                    };
                                    target[k][lane] = entry;
                                }
                            }
                        }
                    }
                },
            );
        });
    }

    /// Calls `take` with each row and its product with `z`.
    pub(super) fn product(&mut self, z: &[R::Vector], mut take: impl FnMut(usize, R::Vector)) {
        self.multiply(0..self.rows.len(), z);
        for (rows, products) in self.rows.iter().zip(&self.products) {
            each_lane::<R>(rows, products, &mut take);
        }
    }

    /// Calls `take` with the unknowns `z`, each row of a color and its product with them, to set those of the row.
    pub(super) fn relax(
        &mut self,
        color: usize,
        z: &mut [R::Vector],
        mut take: impl FnMut(&mut [R::Vector], usize, R::Vector),
    ) {
        let slices = self.colors[color]..self.colors[color + 1];
        self.multiply(slices.clone(), z);
        for (rows, products) in self.rows[slices].iter().zip(&self.products) {
            each_lane::<R>(rows, products, &mut |row, product| take(z, row, product));
        }
    }

    /// Number of colors.
    pub(super) fn color_count(&self) -> usize {
        self.colors.len() - 1
    }

    fn multiply(&mut self, slices: Range<usize>, z: &[R::Vector]) {
        let Self {
            offsets,
            columns,
            blocks,
            products,
            ..
        } = self;
        products.resize(slices.len(), [[R::ZERO; WIDTH]; 3]);
        let work = |first: usize, products: &mut [Lanes<R>]| {
            wide(
                #[inline(always)]
                || {
                    for (ends, product) in offsets[first..].windows(2).zip(products) {
                        let own = ends[0]..ends[1];
                        *product = slice_product::<R>(&columns[own.clone()], &blocks[own], z);
                    }
                },
            );
        };
        let at_a_time = PARALLEL_ROWS / WIDTH;
        if products.len() < 2 * at_a_time {
            return work(slices.start, products);
        }
        let chunks = products.par_chunks_mut(at_a_time).enumerate();
        chunks.for_each(|(chunk, products)| work(slices.start + chunk * at_a_time, products));
    }
}

/// Calls `take` with each row of a slice and its product.
#[inline(always)]
fn each_lane<R: Float>(
    rows: &[u32; WIDTH],
    [x, y, z]: &Lanes<R>,
    take: &mut impl FnMut(usize, R::Vector),
) {
    for (lane, &row) in rows.iter().enumerate() {
        if row != NONE {
            take(row as usize, R::vector(x[lane], y[lane], z[lane]));
        }
    }
}

/// The products of a slice. The nine products of a block have a sum each: additions wait for each other only from
/// block to block.
#[inline(always)]
fn slice_product<R: Float>(
    columns: &[[u32; WIDTH]],
    blocks: &[LaneBlock<R>],
    z: &[R::Vector],
) -> Lanes<R> {
    let mut sums = [[R::ZERO; WIDTH]; 9];
    for (columns, block) in columns.iter().zip(blocks) {
        let rows = columns.map(|column| R::components(z[column as usize]));
        for axis in 0..3 {
            let x = rows.map(|row| row[axis]);
            for k in 3 * axis..3 * axis + 3 {
                for lane in 0..WIDTH {
                    sums[k][lane] += block[k][lane] * x[lane];
                }
            }
        }
    }
    std::array::from_fn(|k| {
        std::array::from_fn(|lane| sums[k][lane] + (sums[3 + k][lane] + sums[6 + k][lane]))
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Rows of 0 to 6 blocks in colors of several sizes: the sums of the same products, row by row.
    #[test]
    fn products_are_those_of_the_rows() {
        let colors = [0, 7, 7, 12, 29];
        let rows = 29;
        let mut matrix = Blocks::<f64>::empty();
        let number = |k: usize| ((k * 37 + 11) % 101) as f64 / 50.0 - 1.0;
        let vector = |k: usize| DVec3::new(number(k), number(k + 1), number(k + 2));
        for (row, diagonal) in (0u32..).take(rows).enumerate() {
            matrix.columns.push(diagonal);
            matrix.blocks.push([DVec3::ZERO; 3]);
            for k in 0..(row * 5) % 7 {
                let at = matrix.blocks.len();
                let column = (row * 13 + k * 17) % rows;
                matrix
                    .columns
                    .push(u32::try_from(column).expect("a small number"));
                matrix
                    .blocks
                    .push([vector(at), vector(at + 40), vector(at + 71)]);
            }
            matrix.offsets.push(matrix.blocks.len());
            matrix.sources = (0..).take(matrix.blocks.len()).collect();
        }
        let range = |row: usize| matrix.offsets[row] + 1..matrix.offsets[row + 1];
        let z: Vec<DVec3> = (0..rows).map(|row| vector(3 * row)).collect();
        let mut triangle = Triangle::default();
        triangle.sync(&matrix, &colors, range);
        triangle.fill::<false>(&matrix);
        let mut seen = vec![0; rows];
        let expected = |row: usize| -> DVec3 {
            let blocks = matrix.blocks[range(row)].iter();
            let terms = blocks
                .zip(&matrix.columns[range(row)])
                .map(|([a, b, c], &column)| {
                    let x = z[column as usize];
                    *a * x.x + *b * x.y + *c * x.z
                });
            terms.sum()
        };
        let check = |row: usize, product: DVec3| {
            assert!((product - expected(row)).length() < 1e-13, "{row}");
        };
        triangle.product(&z, |row, product| {
            seen[row] += 1;
            check(row, product);
        });
        let mut unknowns = z.clone();
        for color in 0..triangle.color_count() {
            triangle.relax(color, &mut unknowns, |_, row, product| {
                assert!((colors[color]..colors[color + 1]).contains(&row));
                seen[row] += 1;
                check(row, product);
            });
        }
        assert_eq!(seen, vec![2; rows]);
    }
}
