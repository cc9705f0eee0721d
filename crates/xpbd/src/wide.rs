//! [`wide`]: compiles a loop for the wide registers of the processor at hand.
//!
//! The crate is compiled for the baseline of its target, so that it runs everywhere. What is inlined into the closure is
//! compiled a second time, with AVX2, and that is taken where the processor has it: four numbers in double precision in
//! an instruction in place of two. Products and sums are not fused, so the bits are the same. Cost: a branch.

#[cfg(target_arch = "x86_64")]
use fearless_simd::{Level, Simd};

/// Calls `body`, compiled for the instructions of this processor. Functions that `body` calls have to be inlined.
#[inline(always)]
pub(crate) fn wide<T>(body: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = Level::new().as_avx2() {
        return simd.vectorize(body);
    }
    body()
}
