//! Transposition of particles in vectors: from x, y, z and inverse mass side by side to a vector of each, and back.
//!
//! In single precision a particle is a block of 128 bits. With the particles of lanes 0, 4, 8 and 12 in the first vector,
//! 1, 5, 9 and 13 in the second and so on, no number leaves its block, and two rounds of unpacking are enough. Unlike
//! permutations across blocks they need no index vectors and overwrite no operand.

use fearless_simd::{Simd, SimdBase};

/// The place of a lane's particle in single precision.
#[inline(always)]
pub(crate) fn row_f32(lane: usize, lanes: usize) -> usize {
    lane % 4 * (lanes / 4) + lane / 4
}

/// The place of a lane's particle in double precision.
#[inline(always)]
pub(crate) fn row_f64(lane: usize, _: usize) -> usize {
    lane
}

/// Two rounds of taking the even and the odd ones apart.
#[inline(always)]
pub(crate) fn deinterleave<S: Simd, V: SimdBase<S>>(_: S, [a, b, c, d]: [V; 4]) -> [V; 4] {
    let (even, odd) = a.deinterleave(b);
    let (more_even, more_odd) = c.deinterleave(d);
    let (x, z) = even.deinterleave(more_even);
    let (y, w) = odd.deinterleave(more_odd);
    [x, y, z, w]
}

/// The inverse of [`deinterleave`].
#[inline(always)]
pub(crate) fn interleave<S: Simd, V: SimdBase<S>>(_: S, [x, y, z, w]: [V; 4]) -> [V; 4] {
    let (even, more_even) = x.interleave(z);
    let (odd, more_odd) = y.interleave(w);
    let (a, b) = even.interleave(odd);
    let (c, d) = more_even.interleave(more_odd);
    [a, b, c, d]
}

/// The transposition of the matrix of four rows in each block of 128 bits, its own inverse.
#[inline(always)]
pub(crate) fn within_blocks<S: Simd>(simd: S, rows: [S::f32s; 4]) -> [S::f32s; 4] {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(avx512) = simd.level().as_avx512()
            && S::f32s::LEN == 16
        {
            let [a, b, c, d] = rows;
            let [a, b, c, d] = x86::within_blocks_of_512(
                avx512,
                fearless_simd::f32x16::from_slice(avx512, a.as_slice()).into(),
                fearless_simd::f32x16::from_slice(avx512, b.as_slice()).into(),
                fearless_simd::f32x16::from_slice(avx512, c.as_slice()).into(),
                fearless_simd::f32x16::from_slice(avx512, d.as_slice()).into(),
            );
            return [
                S::f32s::from_slice(simd, a.as_slice()),
                S::f32s::from_slice(simd, b.as_slice()),
                S::f32s::from_slice(simd, c.as_slice()),
                S::f32s::from_slice(simd, d.as_slice()),
            ];
        }
        if let Some(avx2) = simd.level().as_avx2()
            && S::f32s::LEN == 8
        {
            let [a, b, c, d] = rows;
            let [a, b, c, d] = x86::within_blocks_of_256(
                avx2,
                fearless_simd::f32x8::from_slice(avx2, a.as_slice()).into(),
                fearless_simd::f32x8::from_slice(avx2, b.as_slice()).into(),
                fearless_simd::f32x8::from_slice(avx2, c.as_slice()).into(),
                fearless_simd::f32x8::from_slice(avx2, d.as_slice()).into(),
            );
            return [
                S::f32s::from_slice(simd, a.as_slice()),
                S::f32s::from_slice(simd, b.as_slice()),
                S::f32s::from_slice(simd, c.as_slice()),
                S::f32s::from_slice(simd, d.as_slice()),
            ];
        }
    }
    assert_eq!(S::f32s::LEN, 4, "one block");
    deinterleave(simd, rows)
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{
        __m256, __m512, _mm256_castpd_ps, _mm256_castps_pd, _mm256_unpackhi_pd, _mm256_unpackhi_ps,
        _mm256_unpacklo_pd, _mm256_unpacklo_ps, _mm512_castpd_ps, _mm512_castps_pd,
        _mm512_unpackhi_pd, _mm512_unpackhi_ps, _mm512_unpacklo_pd, _mm512_unpacklo_ps,
    };

    use fearless_simd::{SimdInto, f32x8, f32x16};

    fearless_simd::kernel!(
        #[inline(always)]
        pub(super) fn within_blocks_of_512(
            token: Avx512,
            a: __m512,
            b: __m512,
            c: __m512,
            d: __m512,
        ) -> [f32x16<fearless_simd::Avx512>; 4] {
            let low = _mm512_castps_pd(_mm512_unpacklo_ps(a, b));
            let high = _mm512_castps_pd(_mm512_unpackhi_ps(a, b));
            let more_low = _mm512_castps_pd(_mm512_unpacklo_ps(c, d));
            let more_high = _mm512_castps_pd(_mm512_unpackhi_ps(c, d));
            [
                _mm512_castpd_ps(_mm512_unpacklo_pd(low, more_low)).simd_into(token),
                _mm512_castpd_ps(_mm512_unpackhi_pd(low, more_low)).simd_into(token),
                _mm512_castpd_ps(_mm512_unpacklo_pd(high, more_high)).simd_into(token),
                _mm512_castpd_ps(_mm512_unpackhi_pd(high, more_high)).simd_into(token),
            ]
        }
    );

    fearless_simd::kernel!(
        #[inline(always)]
        pub(super) fn within_blocks_of_256(
            token: Avx2,
            a: __m256,
            b: __m256,
            c: __m256,
            d: __m256,
        ) -> [f32x8<fearless_simd::Avx2>; 4] {
            let low = _mm256_castps_pd(_mm256_unpacklo_ps(a, b));
            let high = _mm256_castps_pd(_mm256_unpackhi_ps(a, b));
            let more_low = _mm256_castps_pd(_mm256_unpacklo_ps(c, d));
            let more_high = _mm256_castps_pd(_mm256_unpackhi_ps(c, d));
            [
                _mm256_castpd_ps(_mm256_unpacklo_pd(low, more_low)).simd_into(token),
                _mm256_castpd_ps(_mm256_unpackhi_pd(low, more_low)).simd_into(token),
                _mm256_castpd_ps(_mm256_unpacklo_pd(high, more_high)).simd_into(token),
                _mm256_castpd_ps(_mm256_unpackhi_pd(high, more_high)).simd_into(token),
            ]
        }
    );
}
