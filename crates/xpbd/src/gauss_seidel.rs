//! One pass over the tets: color by color, within a color in parallel, several tets in an instruction.
//!
//! Clusters of one color share no particle. They are distributed evenly to threads, and within a thread to SIMD lanes;
//! a small color stays on one thread. Every tet has the same inputs and rounding on every thread and lane, so results
//! do not depend on threads and instruction sets. A Jacobi pass is the same loop with another destination.
//!
//! A pass on one thread moves particles by fewer instructions, since no other thread sees them. Several threads work on
//! a copy of the particles in which those near each other in space are near each other in memory, and each solves its part
//! of space: a particle that another thread has moved takes about as long to fetch as a tet to solve. [`Pace`] decides for
//! each pass whether it runs on several threads.
//!
//! Source: paper sections 3 and 4.1. Cost: see [`crate::simd_kernel`]; on several threads a barrier a color, and two
//! copies of the particles.

use std::ops::Range;

use fearless_simd::{Level, Simd, SimdBase, dispatch};

use crate::layout::Layout;
use crate::pace::Pace;
use crate::simd_kernel::{
    Access, Alone, Block, BlockKernel, Buffers, Cells, Damping, Pass, PlainSplit, Sequential,
    Shared, Split, exchange, read_all, read_changed, write_lanes,
};
use crate::team::parallel_rounds;
use crate::{Float, TetSolve};

/// Fewest blocks that a thread is given of a color: about a microsecond of work.
const BLOCKS_A_THREAD: usize = 4;

/// Fewest particles that a thread copies.
const PARTICLES_A_THREAD: usize = 512;

/// Groups of a color that take turns, block by block. Each block needs the corners that the block before it in its group
/// has moved; one of another group can start earlier.
const TURNS: usize = 2;

/// What passes of one kind on several threads need: whether threads pay, and memory.
#[derive(Debug)]
pub(crate) struct Sharing<R: Float> {
    pub(crate) pace: Pace,
    /// Copies of what the pass moves and of positions, in the order of places.
    cells: Vec<R::Particle>,
    positions: Vec<R::Particle>,
}

impl<R: Float> Sharing<R> {
    pub(crate) fn new(pace: Pace) -> Self {
        Self {
            pace,
            cells: Vec::new(),
            positions: Vec::new(),
        }
    }
}

impl<R: Float> Default for Sharing<R> {
    fn default() -> Self {
        Self::new(Pace::default())
    }
}

/// Solves all tets once.
#[inline(never)]
pub(crate) fn solve<R: Float>(
    level: Level,
    form: TetSolve,
    pass: &Pass<'_, R>,
    cells: &mut Cells<'_, R>,
    sharing: &mut Sharing<R>,
) {
    match form {
        TetSolve::Split if pass.is_plain() => with::<R, PlainSplit>(level, pass, cells, sharing),
        TetSolve::Split => with::<R, Split>(level, pass, cells, sharing),
        TetSolve::Block => with::<R, Block>(level, pass, cells, sharing),
        TetSolve::Sequential => with::<R, Sequential>(level, pass, cells, sharing),
    }
}

/// Damps the velocities at the corners of all tets once.
#[inline(never)]
pub(crate) fn damp<R: Float>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut Cells<'_, R>,
    sharing: &mut Sharing<R>,
) {
    with::<R, Damping>(level, pass, cells, sharing);
}

/// Of the instruction sets of x86-64, SSE 4.2 has nothing over SSE 2 that the kernel needs.
#[cfg(target_arch = "x86_64")]
fn with<R: Float, K: BlockKernel>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut Cells<'_, R>,
    sharing: &mut Sharing<R>,
) {
    if let Some(simd) = level.as_avx512() {
        colors::<R, _, K>(simd, pass, cells, sharing);
    } else if let Some(simd) = level.as_avx2() {
        colors::<R, _, K>(simd, pass, cells, sharing);
    } else {
        let simd = level.as_sse2().expect("every x86-64 processor has SSE 2");
        colors::<R, _, K>(simd, pass, cells, sharing);
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn with<R: Float, K: BlockKernel>(
    level: Level,
    pass: &Pass<'_, R>,
    cells: &mut Cells<'_, R>,
    sharing: &mut Sharing<R>,
) {
    dispatch!(level, simd => colors::<R, _, K>(simd, pass, cells, sharing));
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
    cells: &mut Cells<'_, R>,
    sharing: &mut Sharing<R>,
) {
    let layout = pass.layout;
    if !has_work_for_several(layout) {
        alone::<R, S, K>(simd, pass, cells);
        return;
    }
    let threads = rayon::current_num_threads();
    let chunks = |color: usize| chunk_count(layout, color, threads);
    let colors = layout.color_count();
    let Sharing {
        pace,
        cells: cells_there,
        positions: positions_there,
    } = sharing;
    pace.run(layout.blocks.len(), |is_shared| {
        if !is_shared {
            alone::<R, S, K>(simd, pass, cells);
            return;
        }
        let Cells {
            moved: cells,
            positions,
            multipliers,
        } = &*cells;
        let solve = |pass: &Pass<'_, R>, [cells, at]: [&[R::Particle]; 2], color, chunk| {
            let all = layout.groups_of(color);
            let own = &all[part(all.len(), chunk, chunks(color))];
            let seen = [cells, at, multipliers].map(Shared);
            groups::<R, S, K>(simd, pass, seen, own);
        };
        if !pass.corrections.is_empty() || !pass.refused.is_empty() {
            parallel_rounds(colors, chunks, |color, chunk| {
                solve(pass, [cells, positions], color, chunk);
            });
            return;
        }
        // Threads copy the particles of their parts of space to their places, and at last back.
        let particles = layout.places.particles();
        let zero = || R::particle([R::ZERO; 4]);
        cells_there.resize_with(particles.len(), zero);
        if !positions.is_empty() {
            positions_there.resize_with(particles.len(), zero);
        }
        let (cells_there, positions_there) = (&**cells_there, &**positions_there);
        let there = Pass {
            corners: &layout.blocks.places,
            ..*pass
        };
        let copiers = (particles.len() / PARTICLES_A_THREAD).clamp(1, threads);
        let last = colors + 1;
        let chunks_of = |round: usize| match round.checked_sub(1) {
            Some(color) if color < colors => chunks(color),
            _ => copiers,
        };
        let copy = |to: &R::Particle, from: &R::Particle| R::write(to, R::read(from));
        parallel_rounds(colors + 2, chunks_of, |round, chunk| {
            if (1..last).contains(&round) {
                solve(&there, [cells_there, positions_there], round - 1, chunk);
                return;
            }
            let own = part(particles.len(), chunk, copiers);
            for (&particle, place) in particles[own.clone()].iter().zip(own) {
                // Particles that were removed keep their places.
                let Some(cell) = cells.get(particle as usize) else {
                    continue;
                };
                if round == last {
                    copy(cell, &cells_there[place]);
                    continue;
                }
                copy(&cells_there[place], cell);
                if let Some(position) = positions_there.get(place) {
                    copy(position, &positions[particle as usize]);
                }
            }
        });
    });
}

/// The number of threads that a color is divided among.
fn chunk_count<R: Float>(layout: &Layout<R>, color: usize, threads: usize) -> usize {
    match layout.block_count_of(color) {
        0 => 0,
        blocks => {
            let groups = layout.groups_of(color).len();
            (blocks / BLOCKS_A_THREAD).clamp(1, threads.min(groups))
        }
    }
}

/// Whether there are several threads, and a color large enough for two of them.
pub(crate) fn has_work_for_several<R: Float>(layout: &Layout<R>) -> bool {
    let threads = rayon::current_num_threads();
    threads > 1 && (0..layout.color_count()).any(|color| chunk_count(layout, color, threads) > 1)
}

/// A part of a range from 0 on, one of several of about the same size.
fn part(length: usize, number: usize, parts: usize) -> Range<usize> {
    length * number / parts..length * (number + 1) / parts
}

/// Solves all tets on this thread.
#[inline(always)]
fn alone<R: Float, S: Simd, K: BlockKernel>(simd: S, pass: &Pass<'_, R>, cells: &mut Cells<'_, R>) {
    for color in 0..pass.layout.color_count() {
        let Cells {
            moved,
            positions,
            multipliers,
        } = cells;
        let seen = [Alone(moved), Alone(positions), Alone(multipliers)];
        groups::<R, S, K>(simd, pass, seen, pass.layout.groups_of(color));
    }
}

/// Solves the tets of some groups of a color. `seen` are the cells, in the order of [`Cells`].
///
/// The corners of a block stay in its buffers until another corner takes their slot or their lane has no more tets; until
/// then no other group reads them, since clusters of a color share no particle.
#[inline(always)]
fn groups<R: Float, S: Simd, K: BlockKernel>(
    simd: S,
    pass: &Pass<'_, R>,
    seen: [impl Access<R>; 3],
    groups: &[u32],
) {
    simd.vectorize(
        #[inline(always)]
        move || {
            // Variables of their own: behind references they would be loaded again for each corner.
            let [mut particles, mut at, mut multipliers] = seen;
            let blocks = &pass.layout.blocks;
            let mut buffers = [Buffers::<R>::new(); TURNS];
            let mut positions = [Buffers::<R>::new(); TURNS];
            for together in groups.chunks(TURNS) {
                let mut next = [(0, 0); TURNS];
                for (turn, &group) in together.iter().enumerate() {
                    let range = pass.layout.blocks_of(group);
                    next[turn] = (range.start, range.end);
                    if range.is_empty() {
                        continue;
                    }
                    let corners = pass.corners_of::<S>(range.start);
                    read_all::<R, S>(&mut particles, corners, &mut buffers[turn]);
                    if K::READS_POSITIONS {
                        read_all::<R, S>(&mut at, corners, &mut positions[turn]);
                    }
                }
                let mut is_left = true;
                while is_left {
                    is_left = false;
                    for ((next, buffers), positions) in
                        next.iter_mut().zip(&mut buffers).zip(&mut positions)
                    {
                        let (block, end) = *next;
                        if block >= end {
                            continue;
                        }
                        K::run(simd, pass, buffers, positions, &mut multipliers, block);
                        let corners = pass.corners_of::<S>(block);
                        let following = block + 1;
                        let mut ending = blocks.active[block];
                        if following < end {
                            ending &= !blocks.active[following];
                        }
                        if ending != 0 {
                            write_lanes::<R, S>(corners, ending, buffers, |p, values| {
                                particles.write(p, values);
                            });
                        }
                        if following < end {
                            let coming = pass.corners_of::<S>(following);
                            let changed = blocks.changed[following];
                            exchange::<R, S>(&mut particles, [corners, coming], changed, buffers);
                            if K::READS_POSITIONS {
                                read_changed::<R, S>(&mut at, coming, changed, positions);
                            }
                        }
                        *next = (following, end);
                        is_left = true;
                    }
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_clustering::cluster;
    use incise_coloring::{Algorithm, color};
    use incise_graph::{Incidence, Schedule};
    use incise_mesh::{ParticleId, kuhn_box};

    use super::*;
    use crate::substep::Factors;
    use crate::{Material, Real, Solver};

    /// Several threads give the bits of one, where they solve parts of a body that share particles, in all kernels. A
    /// particle that was removed keeps its place, here one before that of the last particle.
    #[test]
    fn threads_that_share_particles_give_the_same_bits() {
        check::<f32>();
        check::<f64>();
    }

    fn check<R: Real>() {
        // Its particles in shuffled order, 1000 being prime to their number.
        let mut mesh = kuhn_box([20, 8, 8], DVec3::new(2.5, 1.0, 1.0));
        let count = mesh.positions.len();
        let shuffled = |p: usize| p * 1000 % count;
        for (p, &x) in mesh.positions.clone().iter().enumerate() {
            mesh.positions[shuffled(p)] = x;
        }
        for tet in &mut mesh.tets {
            *tet = tet.map(|p| ParticleId::new(shuffled(p.index())));
        }
        let rubber = Material {
            young_modulus: 1e6,
            poisson_ratio: 0.45,
            density: 1e3,
            damping: 0.01,
        };
        let mut solver = Solver::<R>::new(&mesh.positions);
        let material = solver.add_material(rubber).expect("a material");
        for (t, tet) in mesh.tets.iter().enumerate() {
            let corners = tet.map(|p| mesh.positions[p.index()]);
            solver.push_tet(tet.map(|p| p.0), corners, material);
            solver.set_fixed(tet[0].index(), t % 97 == 0);
        }
        for p in 0..count {
            solver.set_mass(p, 1.0);
        }
        let tets = mesh.tets.iter().copied();
        let incidence = Incidence::from_constraints(count, tets).expect("a mesh");
        let clustering = cluster("serial:10".parse().expect("a method"), &incidence);
        let coloring = color(Algorithm::Auto, &incidence.quotient(&clustering), 0)
            .expect("a coloring")
            .coloring;
        let schedule = Schedule::new(&clustering, &coloring);
        let level = Level::new();
        let lay_out = |solver: &mut Solver<R>| {
            let Solver {
                tets, particles, ..
            } = solver;
            tets.update_layout(particles, &schedule, lanes::<R>(level));
        };
        lay_out(&mut solver);
        // Two particles more, of which the second has a tet first and is removed.
        let [first, second] = [0, 1].map(|tet| solver.tet_particles(tet));
        let with = |[_, b, c, d]: [u32; 4], new: usize| {
            [u32::try_from(new).expect("few particles"), b, c, d]
        };
        solver.push_copy(0);
        solver.push_copy(0);
        solver.relink_tet(0, with(first, count + 1));
        lay_out(&mut solver);
        solver.relink_tet(1, with(second, count));
        solver.relink_tet(0, first);
        lay_out(&mut solver);
        solver.truncate_particles(count + 1);
        let (layout, particles) = (&solver.tets.layout, &solver.particles);
        let last = layout.places.particles()[count..].iter();
        assert!(last.map(|&p| p as usize).eq([count + 1, count]));
        let time = 1e-3;
        let factors = Factors {
            time_squared: R::from_f64(time * time),
            per_time: R::from_f64(1.0 / time),
            relaxation: R::ONE,
        };
        // Somewhere near rest, as positions and as velocities.
        let moved = |scale: f64| -> Vec<R::Particle> {
            let all = (0..particles.len()).map(|p| {
                let x = mesh.positions[p % count];
                let off = DVec3::splat(p as f64) * DVec3::new(0.7, 1.1, 1.9);
                let [x, y, z] = (x * scale + 0.02 * off.map(f64::sin)).to_array();
                R::particle([
                    R::from_f64(x),
                    R::from_f64(y),
                    R::from_f64(z),
                    particles.weight(p),
                ])
            });
            all.collect()
        };
        let pass = Pass {
            layout,
            corners: &layout.blocks.corners,
            keeps_multipliers: false,
            corrections: &[],
            refused: &[],
            iterated: false,
            factors,
        };
        let bits = |cells: &[R::Particle]| -> Vec<[u64; 4]> {
            let all = cells.iter().map(R::read);
            all.map(|cell| cell.map(|value| value.to_f64().to_bits()))
                .collect()
        };
        let run = |threads: usize, form: Option<TetSolve>| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads start").install(|| {
                assert_eq!(has_work_for_several(layout), threads > 1);
                let (mut cells, mut positions) = match form {
                    Some(_) => (moved(1.0), Vec::new()),
                    None => (moved(0.0), moved(1.0)),
                };
                for _ in 0..3 {
                    let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                    let mut cells = Cells {
                        moved: &mut cells,
                        positions: &mut positions,
                        multipliers: &mut [],
                    };
                    match form {
                        Some(form) => solve(level, form, &pass, &mut cells, &mut sharing),
                        None => damp(level, &pass, &mut cells, &mut sharing),
                    }
                    assert_eq!(sharing.cells.is_empty(), threads == 1, "{threads} threads");
                }
                bits(&cells)
            })
        };
        let start = moved(1.0);
        for form in [
            Some(TetSolve::Split),
            Some(TetSolve::Block),
            Some(TetSolve::Sequential),
            None,
        ] {
            let alone = run(1, form);
            assert_ne!(alone, bits(&start), "{form:?}");
            for threads in [2, 3, 8] {
                assert!(run(threads, form) == alone, "{form:?}: {threads} threads");
            }
        }
    }
}
