//! One pass over the tets: color by color, within a color in parallel, several tets in an instruction.
//!
//! Clusters of one color share no particle. They are distributed evenly to threads, and within a thread to SIMD lanes;
//! a small color stays on one thread. Every tet has the same inputs and rounding on every thread and lane, so results
//! do not depend on threads and instruction sets. A Jacobi pass is the same loop with another destination.
//!
//! Source: paper sections 3 and 4.1. Cost: see [`crate::simd_kernel`]; a barrier a color.

use fearless_simd::{Level, Simd, SimdBase, dispatch};

use crate::simd_kernel::{Block, BlockKernel, Damping, Pass, Sequential, Split};
use crate::team::parallel_rounds;
use crate::{Float, TetSolve};

/// Fewest blocks that a thread is given of a color: about a microsecond of work.
const BLOCKS_A_THREAD: usize = 4;

/// Solves all tets once.
#[inline(never)]
pub(crate) fn solve<R: Float>(level: Level, form: TetSolve, pass: &Pass<'_, R>) {
    match form {
        TetSolve::Split => with::<R, Split>(level, pass),
        TetSolve::Block => with::<R, Block>(level, pass),
        TetSolve::Sequential => with::<R, Sequential>(level, pass),
    }
}

/// Damps the velocities at the corners of all tets once.
#[inline(never)]
pub(crate) fn damp<R: Float>(level: Level, pass: &Pass<'_, R>) {
    with::<R, Damping>(level, pass);
}

/// Of the instruction sets of x86-64, SSE 4.2 has nothing over SSE 2 that the kernel needs.
#[cfg(target_arch = "x86_64")]
fn with<R: Float, K: BlockKernel>(level: Level, pass: &Pass<'_, R>) {
    if let Some(simd) = level.as_avx512() {
        colors::<R, _, K>(simd, pass);
    } else if let Some(simd) = level.as_avx2() {
        colors::<R, _, K>(simd, pass);
    } else {
        let simd = level.as_sse2().expect("every x86-64 processor has SSE 2");
        colors::<R, _, K>(simd, pass);
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn with<R: Float, K: BlockKernel>(level: Level, pass: &Pass<'_, R>) {
    dispatch!(level, simd => colors::<R, _, K>(simd, pass));
}

/// The tets in a block.
pub(crate) fn lanes<R: Float>(level: Level) -> usize {
    #[inline(always)]
    fn length<R: Float, S: Simd>(_: S) -> usize {
        R::Lanes::<S>::LEN
    }
    dispatch!(level, simd => length::<R, _>(simd))
}

#[inline(always)]
fn colors<R: Float, S: Simd, K: BlockKernel>(simd: S, pass: &Pass<'_, R>) {
    let layout = pass.layout;
    let threads = rayon::current_num_threads();
    let chunks = |color: usize| match layout.block_count_of(color) {
        0 => 0,
        blocks => {
            let groups = layout.groups_of(color).len();
            (blocks / BLOCKS_A_THREAD).clamp(1, threads.min(groups))
        }
    };
    let solve = |color: usize, chunk: usize| {
        let (groups, chunks) = (layout.groups_of(color), chunks(color));
        let share = |part: usize| groups.len() * part / chunks;
        let groups = &groups[share(chunk)..share(chunk + 1)];
        simd.vectorize(
            #[inline(always)]
            || {
                for &group in groups {
                    for block in layout.blocks_of(group) {
                        K::run(simd, pass, block);
                    }
                }
            },
        );
    };
    let colors = layout.color_count();
    if threads == 1 || (0..colors).all(|color| chunks(color) < 2) {
        for color in 0..colors {
            for chunk in 0..chunks(color) {
                solve(color, chunk);
            }
        }
    } else {
        parallel_rounds(colors, chunks, solve);
    }
}
