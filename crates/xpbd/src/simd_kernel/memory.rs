//! Transfers between SIMD lanes and memory: corners of tets and multipliers.
//!
//! Corners pass through a buffer, since no instruction set loads vectors from many places as fast. A corner that the next
//! tet of a lane shares stays in the buffer, in the same slot: [`crate::layout`] orders tets and corners for that. So a
//! block exchanges the corners that change, by a mask, and a lane writes back all four after its last tet.
//!
//! Cost: for each corner that is exchanged two checks of an index, a move from the buffer to the particle that leaves and
//! one of the particle that comes to the buffer, if a single thread runs in single precision; twice the moves if several
//! do or in double precision without wide registers. For each block a transposition of the buffer by lanes.

use fearless_simd::{Simd, SimdBase, SimdFrom};

use crate::Float;

/// Most lanes of any instruction set.
const MOST_LANES: usize = 16;

/// A particle in each lane for each of the four corners: corner by corner, and within a corner in the rows of
/// [`Float::row`]. They are made once for many blocks, since clearing them costs as much as filling them.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Buffers<R>([[R; 4]; 4 * MOST_LANES]);

impl<R: Float> Buffers<R> {
    /// Empty buffers.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self([[R::ZERO; 4]; 4 * MOST_LANES])
    }

    /// The numbers of a corner in all lanes.
    #[inline(always)]
    fn corner<S: Simd>(&self, k: usize) -> &[R] {
        let numbers = 4 * R::Lanes::<S>::LEN;
        &self.0.as_flattened()[k * numbers..(k + 1) * numbers]
    }

    /// Sets the numbers of a corner in a lane.
    #[inline(always)]
    pub(crate) fn set<S: Simd>(&mut self, k: usize, lane: usize, values: [R; 4]) {
        let lanes = R::Lanes::<S>::LEN;
        self.0[k * lanes + R::row(lane, lanes)] = values;
    }

    /// The numbers of a corner in a lane.
    #[inline(always)]
    pub(crate) fn get<S: Simd>(&self, k: usize, lane: usize) -> [R; 4] {
        let lanes = R::Lanes::<S>::LEN;
        self.0[k * lanes + R::row(lane, lanes)]
    }

    /// The numbers of a corner, each as a vector of all lanes.
    #[inline(always)]
    pub(crate) fn columns<S: Simd>(&self, simd: S, k: usize) -> [R::Lanes<S>; 4] {
        R::columns(simd, load_rows::<R, S>(simd, self.corner::<S>(k)))
    }

    /// The inverse of [`Self::columns`].
    #[inline(always)]
    pub(crate) fn put<S: Simd>(&mut self, simd: S, k: usize, columns: [R::Lanes<S>; 4]) {
        store_rows::<R, S>(R::rows(simd, columns), self.corner_mut::<S>(k));
    }

    #[inline(always)]
    fn corner_mut<S: Simd>(&mut self, k: usize) -> &mut [R] {
        let numbers = 4 * R::Lanes::<S>::LEN;
        &mut self.0.as_flattened_mut()[k * numbers..(k + 1) * numbers]
    }
}

#[inline(always)]
pub(crate) fn splat<R: Float, S: Simd>(simd: S, value: R) -> R::Lanes<S> {
    R::Lanes::<S>::simd_from(simd, value)
}

/// The particles of a pass.
pub(crate) trait Access<R: Float> {
    fn read(&mut self, particle: u32) -> [R; 4];

    fn write(&mut self, particle: u32, values: [R; 4]);
}

/// Particles that several threads see: atomic moves of 64 bits.
pub(crate) struct Shared<'a, R: Float>(pub(crate) &'a [R::Particle]);

/// Particles that one thread sees: the compiler merges the moves of a particle.
pub(crate) struct Alone<'a, R: Float>(pub(crate) &'a mut [R::Particle]);

impl<R: Float> Access<R> for Shared<'_, R> {
    #[inline(always)]
    fn read(&mut self, particle: u32) -> [R; 4] {
        R::read(&self.0[particle as usize])
    }

    #[inline(always)]
    fn write(&mut self, particle: u32, values: [R; 4]) {
        R::write(&self.0[particle as usize], values);
    }
}

impl<R: Float> Access<R> for Alone<'_, R> {
    #[inline(always)]
    fn read(&mut self, particle: u32) -> [R; 4] {
        R::read_alone(&mut self.0[particle as usize])
    }

    #[inline(always)]
    fn write(&mut self, particle: u32, values: [R; 4]) {
        R::write_alone(&mut self.0[particle as usize], values);
    }
}

/// Reads the corners of the tets in all lanes of a block.
#[inline(always)]
pub(crate) fn read_all<R: Float, S: Simd>(
    particles: &mut impl Access<R>,
    corners: &[u32],
    buffers: &mut Buffers<R>,
) {
    let count = 4 * R::Lanes::<S>::LEN;
    let (corners, buffers) = (&corners[..count], &mut buffers.0[..count]);
    // Rolled: with all corners unrolled, the compiler keeps indices on the stack.
    for first in (0..count).step_by(8) {
        for i in first..first + 8 {
            buffers[i] = particles.read(corners[i]);
        }
    }
}

/// Writes the corners whose bits are set in `changed`, of a block to particles, and reads those of the next block in
/// their place.
#[inline(always)]
pub(crate) fn exchange<R: Float, S: Simd>(
    particles: &mut impl Access<R>,
    [leaving, coming]: [&[u32]; 2],
    changed: u64,
    buffers: &mut Buffers<R>,
) {
    let count = 4 * R::Lanes::<S>::LEN;
    let (leaving, coming) = (&leaving[..count], &coming[..count]);
    let buffers = &mut buffers.0[..count];
    let mut left = changed;
    while left != 0 {
        let i = left.trailing_zeros() as usize % count;
        left &= left - 1;
        particles.write(leaving[i], buffers[i]);
        buffers[i] = particles.read(coming[i]);
    }
}

/// Reads the corners whose bits are set in `changed`.
#[inline(always)]
pub(crate) fn read_changed<R: Float, S: Simd>(
    particles: &mut impl Access<R>,
    coming: &[u32],
    changed: u64,
    buffers: &mut Buffers<R>,
) {
    let count = 4 * R::Lanes::<S>::LEN;
    let (coming, buffers) = (&coming[..count], &mut buffers.0[..count]);
    let mut left = changed;
    while left != 0 {
        let i = left.trailing_zeros() as usize % count;
        left &= left - 1;
        buffers[i] = particles.read(coming[i]);
    }
}

/// Hands each corner of the tets in some lanes to `write`.
#[inline(always)]
pub(crate) fn write_lanes<R: Float, S: Simd>(
    corners: &[u32],
    lanes: u16,
    buffers: &Buffers<R>,
    mut write: impl FnMut(u32, [R; 4]),
) {
    let length = R::Lanes::<S>::LEN;
    let count = 4 * length;
    let (corners, buffers) = (&corners[..count], &buffers.0[..count]);
    // The lanes of most groups end together: they need no look at each bit.
    if lanes.count_ones() as usize == length {
        for first in (0..count).step_by(8) {
            for i in first..first + 8 {
                write(corners[i], buffers[i]);
            }
        }
    } else {
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let row = R::row(lane, length) % length;
            for k in 0..4 {
                let i = k * length + row;
                write(corners[i], buffers[i]);
            }
        }
    }
}

/// The corners in the buffers: x, y, z and the inverse mass of each.
#[inline(always)]
pub(super) fn gathered<R: Float, S: Simd>(simd: S, buffers: &Buffers<R>) -> [[R::Lanes<S>; 4]; 4] {
    [
        buffers.columns(simd, 0),
        buffers.columns(simd, 1),
        buffers.columns(simd, 2),
        buffers.columns(simd, 3),
    ]
}

/// Puts corners into the buffers.
#[inline(always)]
pub(super) fn put<R: Float, S: Simd>(simd: S, x: &[[R::Lanes<S>; 4]; 4], buffers: &mut Buffers<R>) {
    buffers.put(simd, 0, x[0]);
    buffers.put(simd, 1, x[1]);
    buffers.put(simd, 2, x[2]);
    buffers.put(simd, 3, x[3]);
}

/// Moves the corners in the buffers, which for that do not have to stay in registers.
#[inline(always)]
pub(super) fn shift<R: Float, S: Simd>(
    simd: S,
    changes: &[[R::Lanes<S>; 3]; 4],
    buffers: &mut Buffers<R>,
) {
    add_rows::<R, S>(simd, changes[0], buffers.corner_mut::<S>(0));
    add_rows::<R, S>(simd, changes[1], buffers.corner_mut::<S>(1));
    add_rows::<R, S>(simd, changes[2], buffers.corner_mut::<S>(2));
    add_rows::<R, S>(simd, changes[3], buffers.corner_mut::<S>(3));
}

#[inline(always)]
fn add_rows<R: Float, S: Simd>(simd: S, [x, y, z]: [R::Lanes<S>; 3], values: &mut [R]) {
    let changes = R::rows(simd, [x, y, z, splat::<R, S>(simd, R::ZERO)]);
    let [a, b, c, d] = load_rows::<R, S>(simd, values);
    let moved = [
        a + changes[0],
        b + changes[1],
        c + changes[2],
        d + changes[3],
    ];
    store_rows::<R, S>(moved, values);
}

#[inline(always)]
fn load_rows<R: Float, S: Simd>(simd: S, values: &[R]) -> [R::Lanes<S>; 4] {
    let lanes = R::Lanes::<S>::LEN;
    [
        R::Lanes::<S>::from_slice(simd, &values[..lanes]),
        R::Lanes::<S>::from_slice(simd, &values[lanes..2 * lanes]),
        R::Lanes::<S>::from_slice(simd, &values[2 * lanes..3 * lanes]),
        R::Lanes::<S>::from_slice(simd, &values[3 * lanes..4 * lanes]),
    ]
}

#[inline(always)]
fn store_rows<R: Float, S: Simd>([a, b, c, d]: [R::Lanes<S>; 4], values: &mut [R]) {
    let lanes = R::Lanes::<S>::LEN;
    a.store_slice(&mut values[..lanes]);
    b.store_slice(&mut values[lanes..2 * lanes]);
    c.store_slice(&mut values[2 * lanes..3 * lanes]);
    d.store_slice(&mut values[3 * lanes..4 * lanes]);
}

/// The two multipliers of the tets in all lanes of a block.
#[inline(always)]
pub(super) fn load_multipliers<R: Float, S: Simd>(
    simd: S,
    cells: &mut impl Access<R>,
    block: usize,
) -> [R::Lanes<S>; 2] {
    let lanes = R::Lanes::<S>::LEN;
    let mut values = [[R::ZERO; 4]; MOST_LANES / 2];
    for (cell, values) in multiplier_cells(block, lanes).zip(&mut values) {
        *values = cells.read(cell);
    }
    let values = values.as_flattened();
    [
        R::Lanes::<S>::from_slice(simd, &values[..lanes]),
        R::Lanes::<S>::from_slice(simd, &values[lanes..2 * lanes]),
    ]
}

/// The inverse of [`load_multipliers`].
#[inline(always)]
pub(super) fn store_multipliers<R: Float, S: Simd>(
    cells: &mut impl Access<R>,
    block: usize,
    [shear, volume]: [R::Lanes<S>; 2],
) {
    let lanes = R::Lanes::<S>::LEN;
    let mut values = [[R::ZERO; 4]; MOST_LANES / 2];
    let flat = values.as_flattened_mut();
    shear.store_slice(&mut flat[..lanes]);
    volume.store_slice(&mut flat[lanes..2 * lanes]);
    for (cell, values) in multiplier_cells(block, lanes).zip(values) {
        cells.write(cell, values);
    }
}

/// The cells of the multipliers of a block. No other block has a part of them.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "as many as particles")]
fn multiplier_cells(block: usize, lanes: usize) -> std::ops::Range<u32> {
    let cells = lanes / 2;
    (block * cells) as u32..((block + 1) * cells) as u32
}
