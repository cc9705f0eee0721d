//! Transfers between SIMD lanes and memory: corners of tets and multipliers.
//!
//! Corners pass through a buffer, since no instruction set loads vectors from many places as fast. Rolled loops move
//! them: unrolled, the compiler keeps indices on the stack. Cost: for each corner of each tet a check of its index, and
//! in single precision a move from the particle to the buffer and one back if a single thread runs, two each if several
//! do; then a transposition of the buffer by lanes.

use fearless_simd::{Simd, SimdBase, SimdFrom};

use super::Pass;
use crate::Float;

/// Most lanes of any instruction set.
const MOST_LANES: usize = 16;

/// A particle in each lane.
type Buffer<R> = [[R; 4]; MOST_LANES];

/// A particle in each lane for each of the four corners. They are made once for many blocks, since clearing them costs
/// as much as filling them.
pub(crate) type Buffers<R> = [Buffer<R>; 4];

/// Empty buffers.
#[inline(always)]
pub(crate) fn buffers<R: Float>() -> Buffers<R> {
    [[[R::ZERO; 4]; MOST_LANES]; 4]
}

#[inline(always)]
pub(super) fn splat<R: Float, S: Simd>(simd: S, value: R) -> R::Lanes<S> {
    R::Lanes::<S>::simd_from(simd, value)
}

/// The particles of a pass.
pub(crate) trait Access<R: Float> {
    /// Copies the corners of the tets in all lanes into the buffers.
    fn read<S: Simd>(&mut self, corners: &[[u32; 4]], buffers: &mut Buffers<R>);

    /// Copies the corners of the tets in active lanes from the buffers.
    fn write<S: Simd>(&mut self, corners: &[[u32; 4]], active: u16, buffers: &Buffers<R>);
}

/// Particles that several threads see: atomic moves of 64 bits.
pub(crate) struct Shared<'a, R: Float>(pub(crate) &'a [R::Particle]);

/// Particles that one thread sees: the compiler merges the moves of a particle.
pub(crate) struct Alone<'a, R: Float>(pub(crate) &'a mut [R::Particle]);

impl<R: Float> Access<R> for Shared<'_, R> {
    #[inline(always)]
    fn read<S: Simd>(&mut self, corners: &[[u32; 4]], buffers: &mut Buffers<R>) {
        let cells = self.0;
        read_corners::<R, S>(corners, buffers, |p| R::read(&cells[p as usize]));
    }

    #[inline(always)]
    fn write<S: Simd>(&mut self, corners: &[[u32; 4]], active: u16, buffers: &Buffers<R>) {
        let cells = self.0;
        let write = |p: u32, values| R::write(&cells[p as usize], values);
        write_corners::<R, S>(corners, active, buffers, write);
    }
}

// The slice is a variable of its own: behind the reference it would be loaded again for each corner.
impl<R: Float> Access<R> for Alone<'_, R> {
    #[inline(always)]
    fn read<S: Simd>(&mut self, corners: &[[u32; 4]], buffers: &mut Buffers<R>) {
        let cells = &mut *self.0;
        let read = |p: u32| R::read_alone(&mut cells[p as usize]);
        read_corners::<R, S>(corners, buffers, read);
    }

    #[inline(always)]
    fn write<S: Simd>(&mut self, corners: &[[u32; 4]], active: u16, buffers: &Buffers<R>) {
        let cells = &mut *self.0;
        let write = |p: u32, values| R::write_alone(&mut cells[p as usize], values);
        write_corners::<R, S>(corners, active, buffers, write);
    }
}

#[expect(
    clippy::needless_range_loop,
    reason = "four lanes by number have rows that the compiler knows"
)]
#[inline(always)]
fn read_corners<R: Float, S: Simd>(
    corners: &[[u32; 4]],
    buffers: &mut Buffers<R>,
    mut read: impl FnMut(u32) -> [R; 4],
) {
    let lanes = R::Lanes::<S>::LEN;
    let corners = &corners[..lanes];
    let [a, b, c, d] = buffers;
    // Four lanes at a time, of which the compiler knows the rows.
    for first in (0..lanes).step_by(4) {
        for lane in first..(first + 4).min(lanes) {
            let (corner, row) = (corners[lane], R::row::<S>(lane));
            a[row] = read(corner[0]);
            b[row] = read(corner[1]);
            c[row] = read(corner[2]);
            d[row] = read(corner[3]);
        }
    }
}

/// Hands each corner of each tet in an active lane to `write`.
#[expect(
    clippy::needless_range_loop,
    reason = "four lanes by number have rows that the compiler knows"
)]
#[inline(always)]
pub(super) fn write_corners<R: Float, S: Simd>(
    corners: &[[u32; 4]],
    active: u16,
    [a, b, c, d]: &Buffers<R>,
    mut write: impl FnMut(u32, [R; 4]),
) {
    let lanes = R::Lanes::<S>::LEN;
    let corners = &corners[..lanes];
    // Most blocks are full: they need no look at each bit.
    if active.count_ones() as usize == lanes {
        for first in (0..lanes).step_by(4) {
            for lane in first..(first + 4).min(lanes) {
                let (corner, row) = (corners[lane], R::row::<S>(lane));
                write(corner[0], a[row]);
                write(corner[1], b[row]);
                write(corner[2], c[row]);
                write(corner[3], d[row]);
            }
        }
    } else {
        let mut left = active;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let (corner, row) = (corners[lane], R::row::<S>(lane) % MOST_LANES);
            write(corner[0], a[row]);
            write(corner[1], b[row]);
            write(corner[2], c[row]);
            write(corner[3], d[row]);
        }
    }
}

/// The corners of the tets in all lanes: x, y, z and the inverse mass of each.
#[inline(always)]
pub(super) fn gather<R: Float, S: Simd>(
    simd: S,
    particles: &mut impl Access<R>,
    corners: &[[u32; 4]],
    buffers: &mut Buffers<R>,
) -> [[R::Lanes<S>; 4]; 4] {
    // First all that is written, then all that is read: a wide load cannot overtake the narrow stores it needs.
    particles.read::<S>(corners, buffers);
    gathered(simd, buffers)
}

/// The corners in the buffers.
#[inline(always)]
pub(super) fn gathered<R: Float, S: Simd>(
    simd: S,
    [a, b, c, d]: &Buffers<R>,
) -> [[R::Lanes<S>; 4]; 4] {
    [
        R::columns(simd, load_rows::<R, S>(simd, a)),
        R::columns(simd, load_rows::<R, S>(simd, b)),
        R::columns(simd, load_rows::<R, S>(simd, c)),
        R::columns(simd, load_rows::<R, S>(simd, d)),
    ]
}

/// Puts corners into the buffers.
#[inline(always)]
pub(super) fn put<R: Float, S: Simd>(
    simd: S,
    x: &[[R::Lanes<S>; 4]; 4],
    [a, b, c, d]: &mut Buffers<R>,
) {
    store_rows::<R, S>(R::rows(simd, x[0]), a);
    store_rows::<R, S>(R::rows(simd, x[1]), b);
    store_rows::<R, S>(R::rows(simd, x[2]), c);
    store_rows::<R, S>(R::rows(simd, x[3]), d);
}

/// Moves the corners in the buffers, which for that do not have to stay in registers.
#[inline(always)]
pub(super) fn shift<R: Float, S: Simd>(
    simd: S,
    changes: &[[R::Lanes<S>; 3]; 4],
    [a, b, c, d]: &mut Buffers<R>,
) {
    add_rows::<R, S>(simd, changes[0], a);
    add_rows::<R, S>(simd, changes[1], b);
    add_rows::<R, S>(simd, changes[2], c);
    add_rows::<R, S>(simd, changes[3], d);
}

#[inline(always)]
fn add_rows<R: Float, S: Simd>(simd: S, [x, y, z]: [R::Lanes<S>; 3], buffer: &mut Buffer<R>) {
    let changes = R::rows(simd, [x, y, z, splat::<R, S>(simd, R::ZERO)]);
    let [a, b, c, d] = load_rows::<R, S>(simd, buffer);
    let moved = [
        a + changes[0],
        b + changes[1],
        c + changes[2],
        d + changes[3],
    ];
    store_rows::<R, S>(moved, buffer);
}

#[inline(always)]
fn load_rows<R: Float, S: Simd>(simd: S, buffer: &Buffer<R>) -> [R::Lanes<S>; 4] {
    let lanes = R::Lanes::<S>::LEN;
    let values = buffer.as_flattened();
    [
        R::Lanes::<S>::from_slice(simd, &values[..lanes]),
        R::Lanes::<S>::from_slice(simd, &values[lanes..2 * lanes]),
        R::Lanes::<S>::from_slice(simd, &values[2 * lanes..3 * lanes]),
        R::Lanes::<S>::from_slice(simd, &values[3 * lanes..4 * lanes]),
    ]
}

#[inline(always)]
fn store_rows<R: Float, S: Simd>([a, b, c, d]: [R::Lanes<S>; 4], buffer: &mut Buffer<R>) {
    let lanes = R::Lanes::<S>::LEN;
    let values = buffer.as_flattened_mut();
    a.store_slice(&mut values[..lanes]);
    b.store_slice(&mut values[lanes..2 * lanes]);
    c.store_slice(&mut values[2 * lanes..3 * lanes]);
    d.store_slice(&mut values[3 * lanes..4 * lanes]);
}

#[inline(always)]
pub(super) fn load_multipliers<R: Float, S: Simd>(
    simd: S,
    pass: &Pass<'_, R>,
    block: usize,
) -> [R::Lanes<S>; 2] {
    let lanes = R::Lanes::<S>::LEN;
    let mut multipliers = [splat::<R, S>(simd, R::ZERO); 2];
    for (k, values) in multipliers.iter_mut().enumerate() {
        let start = (2 * block + k) * lanes;
        let mut buffer = [R::ZERO; MOST_LANES];
        for (lane, cell) in pass.multipliers[start..start + lanes].iter().enumerate() {
            buffer[lane] = R::load(cell);
        }
        *values = R::Lanes::<S>::from_slice(simd, &buffer[..lanes]);
    }
    multipliers
}

#[inline(always)]
pub(super) fn store_multipliers<R: Float, S: Simd>(
    pass: &Pass<'_, R>,
    block: usize,
    multipliers: [R::Lanes<S>; 2],
) {
    let lanes = R::Lanes::<S>::LEN;
    for (k, values) in multipliers.into_iter().enumerate() {
        let start = (2 * block + k) * lanes;
        let mut buffer = [R::ZERO; MOST_LANES];
        values.store_slice(&mut buffer[..lanes]);
        for (lane, cell) in pass.multipliers[start..start + lanes].iter().enumerate() {
            buffer[lane].store(cell);
        }
    }
}
