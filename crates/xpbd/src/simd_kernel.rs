//! SIMD kernels of a tet: the constraints of the Stable Neo-Hookean energy, and viscous damping of velocities, for
//! several tets at once, one in each lane of a processor.
//!
//! [`TetSolve`] names the three ways to solve a tet.
//!
//! **Split** (default). With deformation gradient F, `J = det F` and `E = Fᵀ F - I` the energy density is
//! `Ψ = Ψ_D + λ/2 (J - 1)²`, where `Ψ_D = μ ((J - 1)² - (I₂(E) + I₃(E)) / 2)` is never negative and 0 only for
//! rotations (and at F = 0). Both parts and both derivatives vanish at rest, so a body at rest stays at rest at any
//! stiffness. The shear part moves the corners along its own force, by `Δt² f(ρ)` with `ρ = Δt² S / (2U)`, `U = V Ψ_D`
//! and S the sum of the squared force over the masses. The volume part is a constraint `J - 1` that sees this step; its
//! implicit factor `1 / (1 + r)` is replaced by `f(r)`. Here `f(r) = (1 - e⁻ʳ) / r`, the exact decay over the substep:
//! the implicit factor makes each tet too soft and the explicit one too stiff, by the same amount to first order, and a
//! colored pass adds these errors up. With f their first order cancels, so sag at rest is off by kappa squared in place
//! of kappa. As f is at most 1 and about `1 / ρ` beyond, a step never goes far beyond the linearized zero of `√U`. In a
//! flat tet, or one with a light corner, that zero can be beyond rest in the stiffest direction, so the step is also at
//! most the inverse of `2 tr G`, which bounds the stiffness in all directions (G: see below). Far from rest the zero may
//! be far away: `Ψ_D` has a saddle at F = 0.54, where its slope is 0 and its value is not, and the slope of the volume
//! vanishes where a tet collapses to a line. There, and where a tet is strained by more than 0.8, a step that would raise
//! the energy of its tet is shortened ([`Tets::descent`]). In a substep of several
//! iterations both parts are XPBD constraints with multipliers (shear is `√(2 Ψ_D)`), since such steps must not be
//! repeated. E, not F, enters `Ψ_D`: in single precision `|F|² - 3` loses all digits at a strain of 1e-4.
//!
//! **Block**. `C_D = |F|` and `C_H = J - γ` as one 2×2 system. The deviatoric constraint is not 0 at rest, so shear is
//! explicit without a limit: a body at rest becomes unstable from a kappa between 2 and 4 on.
//!
//! **Sequential**. The two constraints of the block form one after the other, as in the paper.
//!
//! No form needs gradients at the corners. With `G = Σ w q qᵀ` over the corners (see `Blocks`), `Σ w |∇C|²` is
//! `G : AᵀA = |A L|²` for `A = dC/dF` and `G = L Lᵀ`. A correction is one matrix times the gradients of the barycentric
//! coordinates.
//!
//! Products and sums are rounded one by one, not fused, so that every instruction set gives the same bits. Arrays of
//! lanes are written out, because the closure of `[T; N]::map` is compiled without the instructions of the kernel, so
//! each sum in it becomes a call.
//!
//! Source: Smith, de Goes, Kim 2018 (energy), Macklin and Müller 2021 (constraints), Ton-That et al. 2023 (block
//! solve), paper equations 5 and 6 (the paper prints a minus in its equation 6; its equation 3 gives the plus used
//! here). The split is derived in `docs/solver.md`. Cost: about 430 operations and three divisions a tet (split), 330,
//! one square root and two divisions (block); in single precision 80 bytes of the layout and, of 16 bytes each, the
//! corners that the tet before does not have, read and written: 1.5 to 2.2 in clusters of 10.

mod memory;

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

use crate::layout::{CONSTANTS, Layout, REST};
use crate::neo_hookean::{LARGE_STRAIN, MAX_COFACTOR_NORM, SHORTENINGS};
use crate::particles::add_to;
use crate::substep::Factors;
use crate::{Float, TetSolve};
pub(crate) use memory::{
    Access, Alone, Buffers, Shared, exchange, read_all, read_changed, splat, write_lanes,
};
use memory::{gathered, load_multipliers, put, shift, store_multipliers};

/// The input of a pass over the tets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pass<'a, R: Float> {
    pub(crate) layout: &'a Layout<R>,
    /// Block, corner, row: the corners, as numbers of the particles of the pass.
    pub(crate) corners: &'a [u32],
    /// Whether [`Cells::multipliers`] are kept.
    pub(crate) keeps_multipliers: bool,
    /// Sums of the corrections of a Jacobi pass, which leaves the particles unchanged; else empty.
    pub(crate) corrections: &'a [R::Particle],
    /// Of each particle, what it would have been moved by times its mass, if the inverse mass is 0; empty if not kept.
    pub(crate) refused: &'a [R::Particle],
    /// Whether a substep has more than one iteration, so that multipliers accumulate.
    pub(crate) iterated: bool,
    pub(crate) factors: Factors<R>,
}

impl<'a, R: Float> Pass<'a, R> {
    /// The corners of a block.
    #[inline(always)]
    pub(crate) fn corners_of<S: Simd>(&self, block: usize) -> &'a [u32] {
        let count = 4 * R::Lanes::<S>::LEN;
        &self.corners[block * count..(block + 1) * count]
    }

    /// Whether particles alone are written, in a single iteration.
    pub(crate) fn is_plain(&self) -> bool {
        !self.iterated
            && !self.keeps_multipliers
            && self.corrections.is_empty()
            && self.refused.is_empty()
    }
}

/// What a pass reads and writes.
#[derive(Debug)]
pub(crate) struct Cells<'a, R: Float> {
    /// What is moved, with the inverse mass of each particle: positions, and in [`Damping`] velocities.
    pub(crate) moved: &'a mut [R::Particle],
    /// Of [`Damping`] only, else empty.
    pub(crate) positions: &'a mut [R::Particle],
    /// Block, number, lane, four in a cell; empty if not kept.
    pub(crate) multipliers: &'a mut [R::Particle],
}

/// A kernel over a block of tets. Each implementation is compiled on its own; whether multipliers are kept and where
/// corrections go is decided once a block at run time, which costs nothing measurable.
pub(crate) trait BlockKernel {
    /// Whether the kernel reads [`Cells::positions`].
    const READS_POSITIONS: bool = false;

    /// Processes the tets of a block, which share no particle. Their corners are in the buffers, positions in the second
    /// of them.
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        positions: &Buffers<R>,
        multipliers: &mut impl Access<R>,
        block: usize,
    );
}

/// [`TetSolve::Split`].
pub(crate) struct Split;
/// [`TetSolve::Split`] in a single iteration of Gauss-Seidel that keeps neither multipliers nor what held particles are
/// refused. Without these choices fewer registers are spilled.
pub(crate) struct PlainSplit;
/// [`TetSolve::Block`].
pub(crate) struct Block;
/// [`TetSolve::Sequential`].
pub(crate) struct Sequential;
/// Damping of velocities.
pub(crate) struct Damping;

impl BlockKernel for Split {
    #[inline(always)]
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        _: &Buffers<R>,
        multipliers: &mut impl Access<R>,
        block: usize,
    ) {
        solve_block::<R, S>(simd, pass, corners, multipliers, block, TetSolve::Split);
    }
}

impl BlockKernel for PlainSplit {
    #[inline(always)]
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        _: &Buffers<R>,
        _: &mut impl Access<R>,
        block: usize,
    ) {
        let tets = Tets::<R, S>::new(simd, pass, block);
        let x = gathered::<R, S>(simd, corners);
        let change = tets.split(&x, &tets.gradients(), corners, None);
        let changes = corner_changes::<R, S>(&x, &change, &tets.again().gradients());
        shift::<R, S>(simd, &changes, corners);
    }
}

impl BlockKernel for Block {
    #[inline(always)]
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        _: &Buffers<R>,
        multipliers: &mut impl Access<R>,
        block: usize,
    ) {
        solve_block::<R, S>(simd, pass, corners, multipliers, block, TetSolve::Block);
    }
}

impl BlockKernel for Sequential {
    #[inline(always)]
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        _: &Buffers<R>,
        multipliers: &mut impl Access<R>,
        block: usize,
    ) {
        solve_block::<R, S>(
            simd,
            pass,
            corners,
            multipliers,
            block,
            TetSolve::Sequential,
        );
    }
}

impl BlockKernel for Damping {
    const READS_POSITIONS: bool = true;

    #[inline(always)]
    fn run<R: Float, S: Simd>(
        simd: S,
        pass: &Pass<'_, R>,
        corners: &mut Buffers<R>,
        positions: &Buffers<R>,
        _: &mut impl Access<R>,
        block: usize,
    ) {
        damp_block::<R, S>(simd, pass, corners, positions, block);
    }
}

type Matrix<V> = [[V; 3]; 3];

/// What the hydrostatic constraint is made of.
struct Volume<V> {
    /// The derivative of det F.
    cofactor: Matrix<V>,
    /// det F.
    volume: V,
    gamma: V,
}

/// The parts of the energy of the split form, divided by μ where they are energies.
struct Energies<V, M> {
    /// `Ψ_D`.
    shear: V,
    /// Its derivative.
    derivative: Matrix<V>,
    /// The derivative of det F.
    cofactor: Matrix<V>,
    /// `det F - 1`.
    bulge: V,
    /// Whether a step may raise the energy: strained beyond [`LARGE_STRAIN`] or flattened so far that the derivative of
    /// det F is shorter than 1. Where that is 0, shear alone moves the corners, and not too far.
    far: M,
}

/// [`Energies`] in lanes.
type EnergiesOf<R, S> =
    Energies<<R as Float>::Lanes<S>, <<R as Float>::Lanes<S> as SimdBase<S>>::Mask>;

/// The tets of one block.
struct Tets<'a, R: Float, S: Simd> {
    simd: S,
    rest: &'a [R],
    /// `l/μ`.
    ratio: R::Lanes<S>,
    gamma: R::Lanes<S>,
    /// Damping time over the time of a substep; see [`Damping`].
    damping: R::Lanes<S>,
    time_squared: R::Lanes<S>,
    relaxation: R::Lanes<S>,
}

/// Solves the constraints of the tets of a block.
#[inline(always)]
fn solve_block<R: Float, S: Simd>(
    simd: S,
    pass: &Pass<'_, R>,
    corners: &mut Buffers<R>,
    cells: &mut impl Access<R>,
    block: usize,
    form: TetSolve,
) {
    let mut x = gathered::<R, S>(simd, corners);
    let tets = Tets::<R, S>::new(simd, pass, block);
    let q = tets.gradients();
    let f = deformation::<R, S>(&x, &q);
    let keeps = pass.keeps_multipliers;
    let mut multipliers = if keeps {
        load_multipliers::<R, S>(simd, cells, block)
    } else {
        [splat::<R, S>(simd, R::ZERO); 2]
    };
    let jacobi = !pass.corrections.is_empty();
    let before = x;
    match form {
        TetSolve::Split => {
            let change = if pass.iterated {
                tets.split_iterated(&f, &mut multipliers)
            } else {
                tets.split(&x, &q, corners, keeps.then_some(&mut multipliers))
            };
            move_corners::<R, S>(&mut x, &change, &q);
            tets.refuse(pass, block, &x, &change);
        }
        TetSolve::Block => {
            let change = tets.both(&f, &mut multipliers);
            move_corners::<R, S>(&mut x, &change, &q);
            tets.refuse(pass, block, &x, &change);
        }
        TetSolve::Sequential => {
            let change = tets.deviatoric(&f, &mut multipliers[0]);
            move_corners::<R, S>(&mut x, &change, &q);
            tets.refuse(pass, block, &x, &change);
            let f = if jacobi {
                f
            } else {
                deformation::<R, S>(&x, &q)
            };
            let change = tets.hydrostatic(&f, &mut multipliers[1]);
            move_corners::<R, S>(&mut x, &change, &q);
            tets.refuse(pass, block, &x, &change);
        }
    }
    if keeps {
        store_multipliers::<R, S>(cells, block, multipliers);
    }
    if jacobi {
        let mut changes = x;
        for k in 0..4 {
            for axis in 0..3 {
                changes[k][axis] -= before[k][axis];
            }
        }
        put::<R, S>(simd, &changes, corners);
        let add = |p: u32, [x, y, z, _]: [R; 4]| {
            let sum = &pass.corrections[p as usize];
            let [a, b, c, d] = R::read(sum);
            R::write(sum, [a + x, b + y, c + z, d]);
        };
        let active = pass.layout.blocks.active[block];
        write_lanes::<R, S>(pass.corners_of::<S>(block), active, corners, add);
        x = before;
    }
    put::<R, S>(simd, &x, corners);
}

/// Damps the velocities of the corners of the tets of a block.
#[inline(always)]
fn damp_block<R: Float, S: Simd>(
    simd: S,
    pass: &Pass<'_, R>,
    velocities: &mut Buffers<R>,
    positions: &Buffers<R>,
    block: usize,
) {
    let x = gathered::<R, S>(simd, positions);
    let mut v = gathered::<R, S>(simd, velocities);
    let tets = Tets::<R, S>::new(simd, pass, block);
    let q = tets.gradients();
    let f = deformation::<R, S>(&x, &q);
    let change = tets.damped_volume(&f, &deformation::<R, S>(&v, &q));
    move_corners::<R, S>(&mut v, &change, &q);
    tets.refuse(pass, block, &v, &change);
    let change = tets.damped_shear(&f, &deformation::<R, S>(&v, &q));
    move_corners::<R, S>(&mut v, &change, &q);
    tets.refuse(pass, block, &v, &change);
    put::<R, S>(simd, &v, velocities);
}

impl<'a, R: Float, S: Simd> Tets<'a, R, S> {
    #[inline(always)]
    fn new(simd: S, pass: &Pass<'a, R>, block: usize) -> Self {
        let lanes = R::Lanes::<S>::LEN;
        let blocks = &pass.layout.blocks;
        let rest = &blocks.rest[block * REST * lanes..(block + 1) * REST * lanes];
        let mut constants = [splat::<R, S>(simd, R::ZERO); CONSTANTS];
        for (k, constant) in constants.iter_mut().enumerate() {
            *constant = if blocks.constants.is_empty() {
                splat::<R, S>(simd, blocks.constant[k])
            } else {
                let start = (block * CONSTANTS + k) * lanes;
                R::Lanes::<S>::from_slice(simd, &blocks.constants[start..start + lanes])
            };
        }
        let [ratio, gamma, damping] = constants;
        Self {
            simd,
            rest,
            ratio,
            gamma,
            damping: damping * splat::<R, S>(simd, pass.factors.per_time),
            time_squared: splat::<R, S>(simd, pass.factors.time_squared),
            relaxation: splat::<R, S>(simd, pass.factors.relaxation),
        }
    }

    /// These tets, of which what is read comes from memory again in place of a register that was spilled.
    #[inline(always)]
    fn again(&self) -> Self {
        Self {
            rest: std::hint::black_box(self.rest),
            ..*self
        }
    }

    #[inline(always)]
    fn splat(&self, value: R) -> R::Lanes<S> {
        splat::<R, S>(self.simd, value)
    }

    #[inline(always)]
    fn rest(&self, k: usize) -> R::Lanes<S> {
        let lanes = R::Lanes::<S>::LEN;
        R::Lanes::<S>::from_slice(self.simd, &self.rest[k * lanes..(k + 1) * lanes])
    }

    /// The rows of the inverse rest matrix: the gradients of the barycentric coordinates of corners 1 to 3.
    #[inline(always)]
    fn gradients(&self) -> Matrix<R::Lanes<S>> {
        [
            [self.rest(0), self.rest(1), self.rest(2)],
            [self.rest(3), self.rest(4), self.rest(5)],
            [self.rest(6), self.rest(7), self.rest(8)],
        ]
    }

    /// `A L`, with the Cholesky factor L of G.
    #[inline(always)]
    fn times_factor(&self, m: &Matrix<R::Lanes<S>>) -> Matrix<R::Lanes<S>> {
        let [a, b, c] = m;
        let [xx, yy, zz, yx, zx, zy] = self.metric_factor();
        let mut factored = *m;
        for axis in 0..3 {
            factored[0][axis] = xx * a[axis] + yx * b[axis] + zx * c[axis];
            factored[1][axis] = yy * b[axis] + zy * c[axis];
            factored[2][axis] = zz * c[axis];
        }
        factored
    }

    /// L: its diagonal, then yx, zx, zy.
    #[inline(always)]
    fn metric_factor(&self) -> [R::Lanes<S>; 6] {
        [
            self.rest(9),
            self.rest(10),
            self.rest(11),
            self.rest(12),
            self.rest(13),
            self.rest(14),
        ]
    }

    /// The trace of G.
    #[inline(always)]
    fn trace(&self) -> R::Lanes<S> {
        let [xx, yy, zz, yx, zx, zy] = self.metric_factor();
        xx * xx + yy * yy + zz * zz + yx * yx + zx * zx + zy * zy
    }

    /// `G : AᵀA = |A L|²` in units of the stiffness times time squared.
    #[inline(always)]
    fn weighted(&self, a: &Matrix<R::Lanes<S>>) -> R::Lanes<S> {
        let factored = self.times_factor(a);
        product::<R, S>(&factored, &factored) * self.time_squared
    }

    /// `μV` times the square of the time.
    #[inline(always)]
    fn stiffness(&self) -> R::Lanes<S> {
        self.rest(15) * self.time_squared
    }

    /// The norm of F and one over it; at F = 0 the gradient has no direction, no correction is finite, and the tet
    /// waits for its neighbors.
    #[inline(always)]
    fn norm(&self, f: &Matrix<R::Lanes<S>>) -> (R::Lanes<S>, R::Lanes<S>) {
        let square =
            dot::<R, S>(&f[0], &f[0]) + dot::<R, S>(&f[1], &f[1]) + dot::<R, S>(&f[2], &f[2]);
        let norm = square.sqrt();
        (norm, self.splat(R::ONE) / norm)
    }

    /// The derivative of det F, det F and γ; where the first is longer than [`MAX_COFACTOR_NORM`], all three are scaled
    /// down to that.
    ///
    /// The stiffness against a change of volume grows with the square of the derivative, which is that of an area. In a
    /// tet stretched a hundred times it is 10⁸ times what kappa says, and such tets throw their corners away, farther
    /// each time. A constraint over a number has the same solutions and pulls the same way, less.
    #[inline(always)]
    fn volume(&self, f: &Matrix<R::Lanes<S>>) -> Volume<R::Lanes<S>> {
        let mut cofactor = cofactor::<R, S>(f);
        let [a, b, c] = &cofactor;
        let square = dot::<R, S>(a, a) + dot::<R, S>(b, b) + dot::<R, S>(c, c);
        let mut volume = dot::<R, S>(&f[0], a);
        let mut gamma = self.gamma;
        let limit = R::from_f64(MAX_COFACTOR_NORM);
        let steep = square.simd_gt(self.splat(limit * limit));
        if steep.any_true() {
            let scale = self.splat(limit) / square.sqrt();
            let scale = steep.select(scale, self.splat(R::ONE));
            for entry in cofactor.as_flattened_mut() {
                *entry *= scale;
            }
            volume *= scale;
            gamma *= scale;
        }
        Volume {
            cofactor,
            volume,
            gamma,
        }
    }

    /// The two parts of the energy: `Ψ_D / μ`, its derivative, the derivative of the volume term and `J - 1`.
    ///
    /// Beyond [`MAX_COFACTOR_NORM`] the volume terms of *both* parts are scaled down. Scaled in one of them alone the
    /// two no longer cancel, and torn slivers throw their corners.
    #[inline(always)]
    fn energies(&self, f: &Matrix<R::Lanes<S>>) -> EnergiesOf<R, S> {
        let (one, half) = (self.splat(R::ONE), self.splat(R::HALF));
        let [a, b, c] = f;
        let mut cofactor = cofactor::<R, S>(f);
        let mut bulge = dot::<R, S>(a, &cofactor[0]) - one;
        let aa = dot::<R, S>(a, a) - one;
        let bb = dot::<R, S>(b, b) - one;
        let cc = dot::<R, S>(c, c) - one;
        let (ab, ac, bc) = (dot::<R, S>(a, b), dot::<R, S>(a, c), dot::<R, S>(b, c));
        let minor = bb * cc - bc * bc;
        let second = aa * (bb + cc) + minor - ab * ab - ac * ac;
        let third = aa * minor - ab * (ab * cc - bc * ac) + ac * (ab * bc - bb * ac);
        let mut shear = bulge * bulge - (second + third) * half;
        let trace = aa + bb + cc;
        let square = dot::<R, S>(&cofactor[0], &cofactor[0])
            + dot::<R, S>(&cofactor[1], &cofactor[1])
            + dot::<R, S>(&cofactor[2], &cofactor[2]);
        let limit = R::from_f64(MAX_COFACTOR_NORM);
        let steep = square.simd_gt(self.splat(limit * limit));
        let large = steep | trace.simd_gt(self.splat(R::from_f64(LARGE_STRAIN)));
        if large.any_true() {
            let scale = self.splat(limit) / square.sqrt();
            let scale = steep.select(scale, one);
            for entry in cofactor.as_flattened_mut() {
                *entry *= scale;
            }
            bulge *= scale;
            let direct = trace * half - bulge + bulge * bulge * half;
            shear = large.select(direct, shear);
        }
        // Lanes without a tet have F = 0.
        let zero = self.splat(R::ZERO);
        let far = large | (square.simd_lt(one) & square.simd_gt(zero));
        let pressure = bulge - one;
        let mut derivative = *f;
        for j in 0..3 {
            for axis in 0..3 {
                derivative[j][axis] = f[j][axis] + pressure * cofactor[j][axis];
            }
        }
        Energies {
            shear,
            derivative,
            cofactor,
            bulge,
            far,
        }
    }

    /// Keeps what [`move_corners`] does not move the corners of inverse mass 0 by, if that is asked for.
    #[inline(always)]
    fn refuse(
        &self,
        pass: &Pass<'_, R>,
        block: usize,
        x: &[[R::Lanes<S>; 4]; 4],
        change: &Matrix<R::Lanes<S>>,
    ) {
        if pass.refused.is_empty() {
            return;
        }
        let zero = self.splat(R::ZERO);
        let weights = [x[0][3], x[1][3], x[2][3], x[3][3]];
        let [a, b, c, d] = weights;
        let are_free = a.simd_gt(zero) & b.simd_gt(zero) & c.simd_gt(zero) & d.simd_gt(zero);
        // Few blocks have a corner that is held.
        if !are_free.all_true() {
            self.keep_refused(pass, block, &weights, change);
        }
    }

    /// Called with copies, so that a pass that keeps nothing has its registers.
    #[inline(never)]
    fn keep_refused(
        &self,
        pass: &Pass<'_, R>,
        block: usize,
        weights: &[R::Lanes<S>; 4],
        change: &Matrix<R::Lanes<S>>,
    ) {
        self.simd.vectorize(
            #[inline(always)]
            || {
                let q = &self.gradients();
                let mut offers = [q[0], q[0], q[1], q[2]];
                for axis in 0..3 {
                    let row = [change[0][axis], change[1][axis], change[2][axis]];
                    for j in 0..3 {
                        offers[j + 1][axis] = dot::<R, S>(&row, &q[j]);
                    }
                    offers[0][axis] = -(offers[1][axis] + offers[2][axis] + offers[3][axis]);
                }
                let lanes = R::Lanes::<S>::LEN;
                let corners = pass.corners_of::<S>(block);
                let active = pass.layout.blocks.active[block];
                for lane in (0..lanes).filter(|lane| active & (1 << lane) != 0) {
                    for k in 0..4 {
                        if weights[k][lane] > R::ZERO {
                            continue;
                        }
                        let [x, y, z] = &offers[k];
                        let offered = R::vector(x[lane], y[lane], z[lane]);
                        let corner = corners[k * lanes + R::row(lane, lanes)];
                        add_to::<R>(&pass.refused[corner as usize], offered);
                    }
                }
            },
        );
    }

    /// The part of a step that is taken where all of it would raise the energy of a tet that is far from rest, else 1:
    /// that of the minimum of the parabola through the energy and its slope before the step and the energy after it,
    /// and so on up to [`SHORTENINGS`] times while the energy still rises.
    ///
    /// Compiled once and called with copies, so that the loop over tets near rest keeps its registers. The corners are
    /// those in the buffers.
    #[cold]
    #[inline(never)]
    fn descent(&self, buffers: &Buffers<R>, change: &Matrix<R::Lanes<S>>) -> R::Lanes<S> {
        self.simd.vectorize(
            #[inline(always)]
            || self.descent_in_lanes(&gathered(self.simd, buffers), change),
        )
    }

    #[inline(always)]
    fn descent_in_lanes(
        &self,
        x: &[[R::Lanes<S>; 4]; 4],
        change: &Matrix<R::Lanes<S>>,
    ) -> R::Lanes<S> {
        let (one, zero) = (self.splat(R::ONE), self.splat(R::ZERO));
        let half = self.splat(R::HALF);
        let lame = self.ratio - one;
        let q = &self.gradients();
        let f = deformation::<R, S>(x, q);
        let energies = self.energies(&f);
        let energy = |e: &EnergiesOf<R, S>| e.shear + lame * half * e.bulge * e.bulge;
        let push = lame * energies.bulge;
        let mut moved = *x;
        move_corners::<R, S>(&mut moved, change, q);
        let moved = deformation::<R, S>(&moved, q);
        let (mut stress, mut way) = (f, f);
        for j in 0..3 {
            for axis in 0..3 {
                stress[j][axis] = energies.derivative[j][axis] + push * energies.cofactor[j][axis];
                way[j][axis] = moved[j][axis] - f[j][axis];
            }
        }
        let before = energy(&energies);
        let slope = product::<R, S>(&stress, &way);
        let mut part = one;
        for _ in 0..SHORTENINGS {
            let mut after = f;
            for j in 0..3 {
                for axis in 0..3 {
                    after[j][axis] = f[j][axis] + way[j][axis] * part;
                }
            }
            let rise = energy(&self.energies(&after)) - before;
            // A rise that is no number counts as one, and leaves no part.
            let rises = energies.far & !rise.simd_le(zero);
            if !rises.any_true() {
                break;
            }
            let along = slope * part;
            let shorter = -(along * half) / (rise - along) * part;
            let shorter = shorter.simd_gt(zero).select(shorter, zero);
            part = rises.select(shorter, part);
        }
        part
    }

    /// The change of the corners per weight by a shear step of `along` and the volume constraint that sees it, and that
    /// of the volume multiplier. `factored` is `A L` of the derivative of the shear energy.
    #[inline(always)]
    fn split_change(
        &self,
        energies: &EnergiesOf<R, S>,
        factored: &Matrix<R::Lanes<S>>,
        along: R::Lanes<S>,
        iterated: bool,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let (one, zero) = (self.splat(R::ONE), self.splat(R::ZERO));
        let Energies {
            derivative,
            cofactor,
            bulge,
            ..
        } = energies;
        let lame = self.ratio - one;
        let steep = self.times_factor(cofactor);
        let mixed = product::<R, S>(factored, &steep) * self.time_squared;
        let b = -(lame * (self.stiffness() * *bulge + along * mixed) + *multiplier);
        let r = lame * (product::<R, S>(&steep, &steep) * self.time_squared);
        let d = if iterated {
            b / (r + one)
        } else {
            b * self.decay(r)
        };
        let (along, d) = (along * self.relaxation, d * self.relaxation);
        let sound = (along + d).is_finite();
        *multiplier += sound.select(d, zero);
        let mut change = [[zero; 3]; 3];
        for j in 0..3 {
            for axis in 0..3 {
                let entry = derivative[j][axis] * along + cofactor[j][axis] * d;
                change[j][axis] = sound.select(entry, zero);
            }
        }
        change
    }

    /// `(1 - e⁻ʳ) / r` as a quotient that agrees up to `r²` and tends to `1 / r`; times r it is at most 1.1.
    #[inline(always)]
    fn decay(&self, r: R::Lanes<S>) -> R::Lanes<S> {
        let (four, six) = (self.splat(R::from_f64(4.0)), self.splat(R::from_f64(6.0)));
        (six + r) / (six + r * (four + r))
    }

    /// [`Self::decay`] of r, but no more than the step that is stable in the stiffest direction of the tet: at rest no
    /// curvature of the shear energy is above twice the largest eigenvalue of G, which the trace bounds.
    #[inline(always)]
    fn bounded_decay(&self, r: R::Lanes<S>) -> R::Lanes<S> {
        let (four, six) = (self.splat(R::from_f64(4.0)), self.splat(R::from_f64(6.0)));
        let trace = self.trace() * self.time_squared;
        let above = six + r;
        above / (six + r * (four + r)).max((trace + trace) * above)
    }

    /// The change of the corners per weight by the split form in a single iteration, and the multipliers of this
    /// iteration if there is a place for them.
    #[inline(always)]
    fn split(
        &self,
        x: &[[R::Lanes<S>; 4]; 4],
        q: &Matrix<R::Lanes<S>>,
        buffers: &Buffers<R>,
        multipliers: Option<&mut [R::Lanes<S>; 2]>,
    ) -> Matrix<R::Lanes<S>> {
        let zero = self.splat(R::ZERO);
        let f = &deformation::<R, S>(x, q);
        let energies = self.energies(f);
        let twice = energies.shear + energies.shear;
        let factored = self.times_factor(&energies.derivative);
        let steepness = product::<R, S>(&factored, &factored) * self.time_squared;
        let part = self.bounded_decay(steepness / twice);
        let part = energies.shear.simd_gt(zero).select(part, zero);
        let along = -(self.stiffness() * part);
        let mut volume = multipliers
            .as_ref()
            .map_or(zero, |multipliers| multipliers[1]);
        let mut change = self.split_change(&energies, &factored, along, false, &mut volume);
        let mut part = None;
        if energies.far.any_true() {
            // Copies, so that only this branch needs them in memory.
            let (tets, whole) = (Self { ..*self }, change);
            let taken = tets.descent(buffers, &whole);
            for entry in change.as_flattened_mut() {
                *entry *= taken;
            }
            part = Some(taken);
        }
        if let Some(multipliers) = multipliers {
            let root = twice.max(zero).sqrt();
            let shear = along * root * self.relaxation;
            multipliers[0] += shear.is_finite().select(shear, zero);
            multipliers[1] = volume;
            if let Some(part) = part {
                for multiplier in multipliers {
                    *multiplier *= part;
                }
            }
        }
        change
    }

    /// The change of the corners per weight by an iteration of the split form with accumulating multipliers.
    #[inline(always)]
    fn split_iterated(
        &self,
        f: &Matrix<R::Lanes<S>>,
        multipliers: &mut [R::Lanes<S>; 2],
    ) -> Matrix<R::Lanes<S>> {
        let (one, zero) = (self.splat(R::ONE), self.splat(R::ZERO));
        let energies = self.energies(f);
        let positive = energies.shear.simd_gt(zero);
        let twice = positive.select(energies.shear + energies.shear, one);
        let root = twice.sqrt();
        let factored = self.times_factor(&energies.derivative);
        let m = product::<R, S>(&factored, &factored) * self.time_squared / twice;
        let d = -((self.stiffness() * root + multipliers[0]) / (m + one));
        let sound = d.is_finite();
        let d = sound.select(positive.select(d, zero), zero);
        multipliers[0] += d * self.relaxation;
        self.split_change(&energies, &factored, d / root, true, &mut multipliers[1])
    }

    /// The change of the corners' velocities per weight by the viscosity of the volume: one implicit step.
    #[inline(always)]
    fn damped_volume(
        &self,
        f: &Matrix<R::Lanes<S>>,
        rate: &Matrix<R::Lanes<S>>,
    ) -> Matrix<R::Lanes<S>> {
        let one = self.splat(R::ONE);
        let cofactor = self.volume(f).cofactor;
        let viscosity = (self.ratio - one) * self.damping;
        let m = viscosity * self.weighted(&cofactor);
        let d = -(viscosity * self.stiffness() * product::<R, S>(&cofactor, rate)) / (m + one);
        self.along(&cofactor, d)
    }

    /// The change of the corners' velocities per weight by the viscosity of shear: one implicit step along its force.
    ///
    /// With `D = sym(Fᵀ Ḟ)` the dissipation is `τ V μ |D|²` and its force along `A = F D`. Moving by `-σ w A q` changes
    /// D by `-σ B`, `B = sym(Fᵀ A G)`; the minimum over σ of kinetic energy and dissipation is taken.
    #[inline(always)]
    fn damped_shear(
        &self,
        f: &Matrix<R::Lanes<S>>,
        rate: &Matrix<R::Lanes<S>>,
    ) -> Matrix<R::Lanes<S>> {
        let zero = self.splat(R::ZERO);
        let strain_rate = symmetric::<R, S>(f, rate);
        let force = times_symmetric::<R, S>(f, &strain_rate);
        let factored = self.times_factor(&force);
        let [xx, yy, zz, yx, zx, zy] = self.metric_factor();
        let [a, b, c] = &factored;
        let mut weighted = factored;
        for axis in 0..3 {
            weighted[0][axis] = xx * a[axis] * self.time_squared;
            weighted[1][axis] = (yx * a[axis] + yy * b[axis]) * self.time_squared;
            weighted[2][axis] = (zx * a[axis] + zy * b[axis] + zz * c[axis]) * self.time_squared;
        }
        let change = symmetric::<R, S>(f, &weighted);
        let [xx, yy, zz, xy, xz, yz] = change;
        let off = xy * xy + xz * xz + yz * yz;
        let square = xx * xx + yy * yy + zz * zz + off + off;
        let steepness = product::<R, S>(&factored, &factored) * self.time_squared;
        let twice = self.damping + self.damping;
        let d = twice * self.stiffness() * steepness / (steepness + twice * square);
        let moving = steepness.simd_gt(zero);
        self.along(&force, moving.select(-d, zero))
    }

    /// A matrix times a factor, 0 where the factor is not finite.
    #[inline(always)]
    fn along(&self, direction: &Matrix<R::Lanes<S>>, factor: R::Lanes<S>) -> Matrix<R::Lanes<S>> {
        let zero = self.splat(R::ZERO);
        let sound = factor.is_finite();
        let mut change = *direction;
        for entry in change.as_flattened_mut() {
            *entry = sound.select(*entry * factor, zero);
        }
        change
    }

    /// The change of F's corners per weight that satisfies both constraints to first order, and of the multipliers.
    ///
    /// The equations are multiplied by stiffness and time squared, which makes the matrix one plus numbers of the order
    /// of kappa: as they are usually written, with compliances, they leave the range of single precision for a body of
    /// micrometers.
    #[inline(always)]
    fn both(
        &self,
        f: &Matrix<R::Lanes<S>>,
        multipliers: &mut [R::Lanes<S>; 2],
    ) -> Matrix<R::Lanes<S>> {
        let (one, zero) = (self.splat(R::ONE), self.splat(R::ZERO));
        let (norm, scale) = self.norm(f);
        let Volume {
            cofactor,
            volume,
            gamma,
        } = self.volume(f);
        let [xx, yy, zz, yx, zx, zy] = self.metric_factor();
        let trace = xx * xx + (yx * yx + yy * yy) + (zx * zx + zy * zy + zz * zz);
        let trace = trace * self.time_squared;
        let m11 = self.weighted(f) * scale * scale;
        let m22 = self.weighted(&cofactor);
        let m12 = trace * volume * scale;
        let (deviatoric, hydrostatic) = (norm, volume - gamma);
        // At rest the gradients are parallel and only the one keeps the system regular. The difference is not negative
        // (Cauchy-Schwarz); where rounding says otherwise, it is noise. Overflow makes it NaN and stays so.
        let parallel = m11 * m22 - m12 * m12;
        let parallel = parallel.simd_lt(zero).select(zero, parallel);
        let inverse = one / (self.ratio * (parallel + m22) + m11 + one);
        let stiffness = self.stiffness();
        let b1 = -(stiffness * deviatoric + multipliers[0]);
        let b2 = -(stiffness * self.ratio * hydrostatic + multipliers[1]);
        let d1 = ((self.ratio * m22 + one) * b1 - m12 * b2) * inverse * self.relaxation;
        let d2 = ((m11 + one) * b2 - self.ratio * m12 * b1) * inverse * self.relaxation;
        let sound = (d1 + d2).is_finite();
        let (d1, d2) = (sound.select(d1, zero), sound.select(d2, zero));
        multipliers[0] += d1;
        multipliers[1] += d2;
        let along = d1 * scale;
        let mut change = [[zero; 3]; 3];
        for j in 0..3 {
            for axis in 0..3 {
                let entry = f[j][axis] * along + cofactor[j][axis] * d2;
                change[j][axis] = sound.select(entry, zero);
            }
        }
        change
    }

    /// [`Tets::both`] for the deviatoric constraint alone.
    #[inline(always)]
    fn deviatoric(
        &self,
        f: &Matrix<R::Lanes<S>>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let (norm, scale) = self.norm(f);
        let m = self.weighted(f) * scale * scale;
        self.alone(f, scale, self.stiffness(), norm, m, multiplier)
    }

    /// [`Tets::both`] for the hydrostatic constraint alone.
    #[inline(always)]
    fn hydrostatic(
        &self,
        f: &Matrix<R::Lanes<S>>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let Volume {
            cofactor,
            volume,
            gamma,
        } = self.volume(f);
        let constraint = volume - gamma;
        let m = self.weighted(&cofactor) * self.ratio;
        let stiffness = self.stiffness() * self.ratio;
        let one = self.splat(R::ONE);
        self.alone(&cofactor, one, stiffness, constraint, m, multiplier)
    }

    /// The change of a multiplier that satisfies its constraint, whose derivative is `scale` times a matrix, times
    /// that.
    #[inline(always)]
    fn alone(
        &self,
        derivative: &Matrix<R::Lanes<S>>,
        scale: R::Lanes<S>,
        stiffness: R::Lanes<S>,
        constraint: R::Lanes<S>,
        m: R::Lanes<S>,
        multiplier: &mut R::Lanes<S>,
    ) -> Matrix<R::Lanes<S>> {
        let zero = self.splat(R::ZERO);
        let b = -(stiffness * constraint + *multiplier);
        let d = b / (m + self.splat(R::ONE)) * self.relaxation;
        let sound = d.is_finite();
        *multiplier += sound.select(d, zero);
        self.along(derivative, d * scale)
    }
}

/// The columns of F.
#[inline(always)]
fn deformation<R: Float, S: Simd>(
    x: &[[R::Lanes<S>; 4]; 4],
    q: &Matrix<R::Lanes<S>>,
) -> Matrix<R::Lanes<S>> {
    let mut f = *q;
    for axis in 0..3 {
        let [a, b, c] = [
            x[1][axis] - x[0][axis],
            x[2][axis] - x[0][axis],
            x[3][axis] - x[0][axis],
        ];
        for j in 0..3 {
            f[j][axis] = a * q[0][j] + b * q[1][j] + c * q[2][j];
        }
    }
    f
}

/// Moves the corners by the weight of each times a matrix times the gradient of its barycentric coordinate.
#[inline(always)]
fn move_corners<R: Float, S: Simd>(
    x: &mut [[R::Lanes<S>; 4]; 4],
    change: &Matrix<R::Lanes<S>>,
    q: &Matrix<R::Lanes<S>>,
) {
    for axis in 0..3 {
        let row = [change[0][axis], change[1][axis], change[2][axis]];
        let a = dot::<R, S>(&row, &q[0]);
        let b = dot::<R, S>(&row, &q[1]);
        let c = dot::<R, S>(&row, &q[2]);
        x[0][axis] -= x[0][3] * (a + b + c);
        x[1][axis] += x[1][3] * a;
        x[2][axis] += x[2][3] * b;
        x[3][axis] += x[3][3] * c;
    }
}

/// What [`move_corners`] moves each corner by.
#[inline(always)]
fn corner_changes<R: Float, S: Simd>(
    x: &[[R::Lanes<S>; 4]; 4],
    change: &Matrix<R::Lanes<S>>,
    q: &Matrix<R::Lanes<S>>,
) -> [[R::Lanes<S>; 3]; 4] {
    let mut changes = [q[0], q[0], q[1], q[2]];
    for axis in 0..3 {
        let row = [change[0][axis], change[1][axis], change[2][axis]];
        let a = dot::<R, S>(&row, &q[0]);
        let b = dot::<R, S>(&row, &q[1]);
        let c = dot::<R, S>(&row, &q[2]);
        changes[0][axis] = -(x[0][3] * (a + b + c));
        changes[1][axis] = x[1][3] * a;
        changes[2][axis] = x[2][3] * b;
        changes[3][axis] = x[3][3] * c;
    }
    changes
}

#[inline(always)]
pub(crate) fn dot<R: Float, S: Simd>(a: &[R::Lanes<S>; 3], b: &[R::Lanes<S>; 3]) -> R::Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<R: Float, S: Simd>(
    a: &[R::Lanes<S>; 3],
    b: &[R::Lanes<S>; 3],
) -> [R::Lanes<S>; 3] {
    [
        a[1] * b[2] - b[1] * a[2],
        a[2] * b[0] - b[2] * a[0],
        a[0] * b[1] - b[0] * a[1],
    ]
}

/// The derivative of the determinant.
#[inline(always)]
fn cofactor<R: Float, S: Simd>([a, b, c]: &Matrix<R::Lanes<S>>) -> Matrix<R::Lanes<S>> {
    [
        cross::<R, S>(b, c),
        cross::<R, S>(c, a),
        cross::<R, S>(a, b),
    ]
}

/// The symmetric part of `AᵀB`: xx, yy, zz, xy, xz, yz.
#[inline(always)]
fn symmetric<R: Float, S: Simd>(
    a: &Matrix<R::Lanes<S>>,
    b: &Matrix<R::Lanes<S>>,
) -> [R::Lanes<S>; 6] {
    [
        dot::<R, S>(&a[0], &b[0]),
        dot::<R, S>(&a[1], &b[1]),
        dot::<R, S>(&a[2], &b[2]),
        symmetric_entry::<R, S>(a, b, 0, 1),
        symmetric_entry::<R, S>(a, b, 0, 2),
        symmetric_entry::<R, S>(a, b, 1, 2),
    ]
}

/// An entry of [`symmetric`] off the diagonal. A closure would be compiled without the instructions of the kernel.
#[inline(always)]
fn symmetric_entry<R: Float, S: Simd>(
    a: &Matrix<R::Lanes<S>>,
    b: &Matrix<R::Lanes<S>>,
    i: usize,
    j: usize,
) -> R::Lanes<S> {
    (dot::<R, S>(&a[i], &b[j]) + dot::<R, S>(&a[j], &b[i])) * R::HALF
}

/// A matrix times a symmetric one.
#[inline(always)]
fn times_symmetric<R: Float, S: Simd>(
    a: &Matrix<R::Lanes<S>>,
    [xx, yy, zz, xy, xz, yz]: &[R::Lanes<S>; 6],
) -> Matrix<R::Lanes<S>> {
    let mut result = *a;
    for axis in 0..3 {
        let (x, y, z) = (a[0][axis], a[1][axis], a[2][axis]);
        result[0][axis] = x * *xx + y * *xy + z * *xz;
        result[1][axis] = x * *xy + y * *yy + z * *yz;
        result[2][axis] = x * *xz + y * *yz + z * *zz;
    }
    result
}

/// The sum of the products of all entries.
#[inline(always)]
fn product<R: Float, S: Simd>(a: &Matrix<R::Lanes<S>>, b: &Matrix<R::Lanes<S>>) -> R::Lanes<S> {
    dot::<R, S>(&a[0], &b[0]) + dot::<R, S>(&a[1], &b[1]) + dot::<R, S>(&a[2], &b[2])
}

#[cfg(test)]
pub(crate) mod tests;
