//! One pass over the tets: color by color, within a color in parallel, several tets in an instruction.
//!
//! Clusters of one color share no particle. They are distributed evenly to threads, and within a thread to SIMD lanes;
//! a small color stays on one thread. Every tet has the same inputs and rounding on every thread and lane, so results
//! do not depend on threads and instruction sets. A Jacobi pass is the same loop with another destination.
//!
//! A pass on one thread moves particles by fewer instructions, since no other thread sees them. [`Pace`] decides for
//! each pass whether it runs on several threads.
//!
//! Source: paper sections 3 and 4.1. Cost: see [`crate::simd_kernel`]; on several threads a barrier a color.

use fearless_simd::{Level, Simd, SimdBase, dispatch};

use crate::pace::Pace;
use crate::simd_kernel::{
    Access, Alone, Block, BlockKernel, Damping, Pass, PlainSplit, Sequential, Shared, Split,
    buffers,
};
use crate::team::parallel_rounds;
use crate::{Float, TetSolve};

/// Fewest blocks that a thread is given of a color: about a microsecond of work.
const BLOCKS_A_THREAD: usize = 4;

/// Groups of a color that take turns, block by block. Each block needs the corners that the block before it in its group
/// has moved; one of another group can start earlier.
const TURNS: usize = 2;

/// Solves all tets once.
#[inline(never)]
pub(crate) fn solve<R: Float>(
    level: Level,
    form: TetSolve,
    pass: &Pass<'_, R>,
    cells: &mut [R::Particle],
    pace: &mut Pace,
) {
    match form {
        TetSolve::Split if pass.is_plain() => with::<R, PlainSplit>(level, pass, cells, pace),
        TetSolve::Split => with::<R, Split>(level, pass, cells, pace),
        TetSolve::Block => with::<R, Block>(level, pass, cells, pace),
        TetSolve::Sequential => with::<R, Sequential>(level, pass, cells, pace),
    }
}

/// Damps the velocities at the corners of all tets once.
#[inline(never)]
pub(crate) fn damp<R: Float>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut [R::Particle],
    pace: &mut Pace,
) {
    with::<R, Damping>(level, pass, cells, pace);
}

/// Of the instruction sets of x86-64, SSE 4.2 has nothing over SSE 2 that the kernel needs.
#[cfg(target_arch = "x86_64")]
fn with<R: Float, K: BlockKernel>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut [R::Particle],
    pace: &mut Pace,
) {
    if let Some(simd) = level.as_avx512() {
        colors::<R, _, K>(simd, pass, cells, pace);
    } else if let Some(simd) = level.as_avx2() {
        colors::<R, _, K>(simd, pass, cells, pace);
    } else {
        let simd = level.as_sse2().expect("every x86-64 processor has SSE 2");
        colors::<R, _, K>(simd, pass, cells, pace);
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn with<R: Float, K: BlockKernel>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut [R::Particle],
    pace: &mut Pace,
) {
    dispatch!(level, simd => colors::<R, _, K>(simd, pass, cells, pace));
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
fn colors<R: Float, S: Simd, K: BlockKernel>(
    simd: S,
    pass: &Pass<'_, R>,
    cells: &mut [R::Particle],
    pace: &mut Pace,
) {
    let layout = pass.layout;
    let threads = rayon::current_num_threads();
    let chunks = |color: usize| match layout.block_count_of(color) {
        0 => 0,
        blocks => {
            let groups = layout.groups_of(color).len();
            (blocks / BLOCKS_A_THREAD).clamp(1, threads.min(groups))
        }
    };
    let share = |color: usize, chunk: usize| {
        let (groups, chunks) = (layout.groups_of(color), chunks(color));
        let start = |part: usize| groups.len() * part / chunks;
        &groups[start(chunk)..start(chunk + 1)]
    };
    let colors = layout.color_count();
    let alone = |cells: &mut [R::Particle]| {
        for color in 0..colors {
            groups::<R, S, K>(simd, pass, &mut Alone(cells), layout.groups_of(color));
        }
    };
    if threads == 1 || (0..colors).all(|color| chunks(color) < 2) {
        alone(cells);
        return;
    }
    pace.run(layout.blocks.len(), |is_shared| {
        if is_shared {
            let cells = &*cells;
            parallel_rounds(colors, chunks, |color, chunk| {
                groups::<R, S, K>(simd, pass, &mut Shared(cells), share(color, chunk));
            });
        } else {
            alone(cells);
        }
    });
}

/// Solves the tets of some groups of a color.
#[inline(always)]
fn groups<R: Float, S: Simd, K: BlockKernel>(
    simd: S,
    pass: &Pass<'_, R>,
    cells: &mut impl Access<R>,
    groups: &[u32],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut buffers = buffers::<R>();
            for together in groups.chunks(TURNS) {
                let mut next = [(0, 0); TURNS];
                for (next, &group) in next.iter_mut().zip(together) {
                    let blocks = pass.layout.blocks_of(group);
                    *next = (blocks.start, blocks.end);
                }
                let mut is_left = true;
                while is_left {
                    is_left = false;
                    for (block, end) in &mut next {
                        if block < end {
                            K::run(simd, pass, cells, &mut buffers, *block);
                            *block += 1;
                            is_left = true;
                        }
                    }
                }
            }
        },
    );
}
