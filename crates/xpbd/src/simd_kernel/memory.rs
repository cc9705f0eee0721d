//! Transfers between SIMD lanes and memory: corners of tets and multipliers.
//!
//! Cost: for each corner of each tet two moves from the particle to a buffer and two back in single precision, and a
//! transposition of the buffer by lanes.

use fearless_simd::{Simd, SimdBase, SimdFrom};

use super::Pass;
use crate::Float;

/// Most lanes of any instruction set.
const MOST_LANES: usize = 16;

#[inline(always)]
pub(super) fn splat<R: Float, S: Simd>(simd: S, value: R) -> R::Lanes<S> {
    R::Lanes::<S>::simd_from(simd, value)
}

/// The corners of the tets in all lanes: x, y, z and the inverse mass of each.
#[inline(always)]
pub(super) fn gather<R: Float, S: Simd>(
    simd: S,
    corners: &[[u32; 4]],
    read: impl Fn(u32) -> [R; 4],
) -> [[R::Lanes<S>; 4]; 4] {
    let lanes = R::Lanes::<S>::LEN;
    let mut gathered = [[splat::<R, S>(simd, R::ZERO); 4]; 4];
    // First all that is written, then all that is read: a wide load cannot overtake the narrow stores it needs.
    let mut buffers = [[R::ZERO; 4 * MOST_LANES]; 4];
    for (lane, corner) in corners.iter().enumerate().take(lanes) {
        for (buffer, &p) in buffers.iter_mut().zip(corner) {
            let values = read(p);
            buffer[4 * lane] = values[0];
            buffer[4 * lane + 1] = values[1];
            buffer[4 * lane + 2] = values[2];
            buffer[4 * lane + 3] = values[3];
        }
    }
    for (values, buffer) in gathered.iter_mut().zip(&buffers) {
        let a = R::Lanes::<S>::from_slice(simd, &buffer[..lanes]);
        let b = R::Lanes::<S>::from_slice(simd, &buffer[lanes..2 * lanes]);
        let c = R::Lanes::<S>::from_slice(simd, &buffer[2 * lanes..3 * lanes]);
        let d = R::Lanes::<S>::from_slice(simd, &buffer[3 * lanes..4 * lanes]);
        // Two rounds of taking the even and the odd ones apart.
        let (even, odd) = a.deinterleave(b);
        let (more_even, more_odd) = c.deinterleave(d);
        let (x, z) = even.deinterleave(more_even);
        let (y, w) = odd.deinterleave(more_odd);
        *values = [x, y, z, w];
    }
    gathered
}

/// Hands each corner of each tet in an active lane to `write`.
#[inline(always)]
pub(super) fn scatter<R: Float, S: Simd>(
    x: &[[R::Lanes<S>; 4]; 4],
    corners: &[[u32; 4]],
    active: u16,
    write: impl Fn(u32, [R; 4]),
) {
    let lanes = R::Lanes::<S>::LEN;
    let corners = &corners[..lanes];
    for (k, &[x, y, z, w]) in x.iter().enumerate() {
        let (even, more_even) = x.interleave(z);
        let (odd, more_odd) = y.interleave(w);
        let (a, b) = even.interleave(odd);
        let (c, d) = more_even.interleave(more_odd);
        let mut buffer = [R::ZERO; 4 * MOST_LANES];
        a.store_slice(&mut buffer[..lanes]);
        b.store_slice(&mut buffer[lanes..2 * lanes]);
        c.store_slice(&mut buffer[2 * lanes..3 * lanes]);
        d.store_slice(&mut buffer[3 * lanes..4 * lanes]);
        let lane = |lane: usize| {
            let at = 4 * lane;
            let values = [buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]];
            write(corners[lane][k], values);
        };
        // Most blocks are full: they need no look at each bit.
        if active.count_ones() as usize == lanes {
            (0..lanes).for_each(lane);
        } else {
            (0..lanes).filter(|l| active & (1 << l) != 0).for_each(lane);
        }
    }
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
