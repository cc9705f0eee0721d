//! The kernel against the plain form, one tet at a time, and against itself with other instructions.

use fearless_simd::Level;
use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::layout::Ingredients;
use crate::neo_hookean::TetConstraint;
use crate::neo_hookean::tests::{point, rest};
use crate::real::load;
use crate::{Material, TetSolve, gauss_seidel};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};

const RUBBER: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.45,
    density: 1e3,
    damping: 0.01,
};

/// Tets that share no particle, in one color, so that one pass is one solve of each.
struct Case<R: Real> {
    tets: Vec<TetConstraint<R>>,
    particles: Vec<[R; 4]>,
    previous: Vec<R::Vector>,
    factors: Factors<R>,
}

impl<R: Real> Case<R> {
    fn new(rest: &[[DVec3; 4]], moved: &[[DVec3; 4]], time: f64) -> Self {
        let mut tets = Vec::new();
        let mut particles = Vec::new();
        let mut previous = Vec::new();
        for (t, (rest, moved)) in rest.iter().zip(moved).enumerate() {
            let first = u32::try_from(4 * t).unwrap();
            let corners = [0, 1, 2, 3].map(|k| first + k);
            tets.push(TetConstraint::new(corners, *rest, &RUBBER));
            for (k, (x, at_rest)) in moved.iter().zip(rest).enumerate() {
                let [x, y, z] = x.to_array().map(R::from_f64);
                // One corner of each tet is held.
                let weight = [0.0, 3.0, 0.5, 1.0][k];
                particles.push([x, y, z, R::from_f64(weight)]);
                previous.push(R::from_dvec3(*at_rest));
            }
        }
        let factors = Factors {
            time_squared: R::from_f64(time * time),
            per_time: R::from_f64(1.0 / time),
            relaxation: R::from_f64(0.9),
        };
        Self {
            tets,
            particles,
            previous,
            factors,
        }
    }

    /// The positions after a pass by the kernel.
    fn by_lanes(&self, level: Level, damped: bool, form: TetSolve) -> Vec<R::Vector> {
        self.by_lanes_keeping(level, damped, form, &[])
    }

    /// The same with multipliers, two for each lane of a single block.
    fn by_lanes_keeping(
        &self,
        level: Level,
        damped: bool,
        form: TetSolve,
        multipliers: &[R::Atomic],
    ) -> Vec<R::Vector> {
        let count = self.tets.len();
        let coloring = Coloring::new(vec![ColorId(0); count]);
        let schedule = Schedule::new(&Clustering::none(count), &coloring);
        let particles: Vec<_> = self.particles.iter().map(|v| R::particle(*v)).collect();
        let mut layout = Layout::default();
        let lanes = gauss_seidel::lanes::<R>(level);
        let damping = if damped { RUBBER.damping } else { 0.0 };
        layout.follow(&schedule, lanes, true, |t| {
            let tet = self.tets[t as usize];
            Ingredients {
                weights: tet.particles.map(|p| self.particles[p as usize][3]),
                constants: [tet.ratio, tet.gamma, R::from_f64(damping)],
                tet,
            }
        });
        let pass = Pass {
            layout: &layout,
            particles: &particles,
            previous: &self.previous,
            multipliers,
            corrections: &[],
            factors: self.factors,
        };
        R::solve_tets(level, damped, form, &pass);
        particles.iter().map(load::<R>).collect()
    }

    /// The same by the plain form, one tet at a time, with gradients at the corners.
    fn one_by_one(&self, damped: bool) -> Vec<R::Vector> {
        let mut moved: Vec<_> = self
            .particles
            .iter()
            .map(|&[x, y, z, _]| R::vector(x, y, z))
            .collect();
        for tet in &self.tets {
            let corners = tet.particles.map(|p| p as usize);
            let x = corners.map(|p| moved[p]);
            let weights = corners.map(|p| self.particles[p][3]);
            let e = tet.evaluate(x);
            let (mut damping, mut rates) = (R::ZERO, [R::ZERO; 2]);
            if damped {
                damping = R::from_f64(RUBBER.damping) * self.factors.per_time;
                for k in 0..4 {
                    let motion = x[k] - self.previous[corners[k]];
                    rates[0] += damping * R::dot(e.deviatoric_gradients[k], motion);
                    rates[1] += damping * R::dot(e.hydrostatic_gradients[k], motion);
                }
            }
            let none = [R::ZERO; 2];
            let time_squared = self.factors.time_squared;
            let change = tet.solve(&e, weights, none, time_squared, damping, rates);
            let change = change.unwrap_or(none).map(|c| c * self.factors.relaxation);
            for k in 0..4 {
                let along =
                    e.deviatoric_gradients[k] * change[0] + e.hydrostatic_gradients[k] * change[1];
                moved[corners[k]] = x[k] + along * weights[k];
            }
        }
        moved
    }
}

/// All instruction sets of this processor that the kernel is compiled for.
fn levels() -> Vec<Level> {
    #[cfg(target_arch = "x86_64")]
    {
        let best = Level::new();
        let avx512 = best.as_avx512().map(|simd| simd.level());
        let avx2 = best.as_avx2().map(|simd| simd.level());
        let sse2 = best.as_sse2().map(|simd| simd.level());
        [avx512, avx2, sse2].into_iter().flatten().collect()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        vec![Level::new(), Level::baseline()]
    }
}

/// Any number of tets from none to several blocks, each at rest and moved anywhere, some of them collapsed.
fn tets() -> impl Strategy<Value = Vec<([DVec3; 4], [DVec3; 4])>> {
    let moved = prop_oneof![
        8 => prop::array::uniform4(point()),
        // Far beyond where the slope of the volume counts as steep.
        2 => prop::array::uniform4(point().prop_map(|x| x * 1e3)),
        1 => point().prop_map(|x| [x; 4]),
        1 => prop::array::uniform3(point()).prop_map(|[a, b, c]| [a, b, c, a + b - c]),
    ];
    prop::collection::vec((rest(), moved), 0..40)
}

fn case<R: Real>(tets: &[([DVec3; 4], [DVec3; 4])], time: f64) -> Case<R> {
    let (rest, moved): (Vec<_>, Vec<_>) = tets.iter().copied().unzip();
    Case::new(&rest, &moved, time)
}

proptest! {
    /// Two ways to the same numbers: they differ by rounding, amplified by the condition of the system, which grows
    /// with the stiffness (`time` up to kappa 1e2 or so here) and with the flatness of the tet at rest.
    #[test]
    fn lanes_solve_what_the_plain_form_solves(
        tets in tets(),
        time in prop::sample::select(vec![1e-5, 1e-4, 1e-3]),
        damped in any::<bool>(),
    ) {
        let case = case::<f64>(&tets, time);
        let expected = case.one_by_one(damped);
        for level in levels() {
            let moved = case.by_lanes(level, damped, TetSolve::Block);
            for (a, b) in moved.iter().zip(&expected) {
                let scale = 1.0 + b.length();
                prop_assert!(a.distance(*b) <= 1e-9 * scale, "{a} instead of {b}");
            }
        }
    }

    /// To the bit.
    #[test]
    fn instruction_sets_do_not_change_a_bit(
        tets in tets(),
        time in prop::sample::select(vec![1e-5, 1e-2, 1e2]),
        damped in any::<bool>(),
        sequential in any::<bool>(),
    ) {
        let form = if sequential { TetSolve::Sequential } else { TetSolve::Block };
        let (single, double) = (case::<f32>(&tets, time), case::<f64>(&tets, time));
        let first = levels()[0];
        let expected = (single.by_lanes(first, damped, form), double.by_lanes(first, damped, form));
        for level in levels() {
            let moved = (single.by_lanes(level, damped, form), double.by_lanes(level, damped, form));
            prop_assert_eq!(&moved, &expected, "{:?}", level);
        }
    }
}

/// A tet too large to be squared is left alone, its multipliers with it, and so is one without size.
#[test]
fn tets_out_of_range_stay_as_they_are() {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for size in [1e30, 0.0] {
        for form in [TetSolve::Block, TetSolve::Sequential] {
            let case = Case::<f32>::new(&[rest], &[rest.map(|x| x * size)], 1e-3);
            let multipliers: Vec<_> = (0..2 * 16).map(|_| 0.0f32.cell()).collect();
            for level in levels() {
                let moved = case.by_lanes_keeping(level, true, form, &multipliers);
                for (x, before) in moved.iter().zip(&case.particles) {
                    assert_eq!(x.to_array(), before[..3], "{size:e}, {form:?}");
                }
                assert!(multipliers.iter().all(|m| f32::load(m).is_finite()));
            }
        }
    }
}
