//! The kernel against the plain form, one tet at a time, and against itself with other instructions.

use fearless_simd::Level;
use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::float::load;
use crate::gauss_seidel::Sharing;
use crate::layout::{ClusterOrder, Ingredients};
use crate::neo_hookean::TetConstraint;
use crate::neo_hookean::tests::{point, rest};
use crate::pace::Pace;
use crate::{Material, TetSolve, gauss_seidel};
use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Schedule};

const RUBBER: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.45,
    density: 1e3,
    damping: 0.01,
};

/// Clusters of tets that share no particle with other clusters, in one color, so that one pass is one solve of each tet.
struct Case<R: Float> {
    tets: Vec<TetConstraint<R>>,
    /// Tet -> cluster.
    clusters: Vec<ClusterId>,
    particles: Vec<[R; 4]>,
    velocities: Vec<R::Vector>,
    factors: Factors<R>,
}

impl<R: Float> Case<R> {
    fn new(rest: &[[DVec3; 4]], moved: &[[DVec3; 4]], time: f64) -> Self {
        let mut tets = Vec::new();
        let mut particles = Vec::new();
        let mut velocities = Vec::new();
        for (t, (rest, moved)) in rest.iter().zip(moved).enumerate() {
            let first = u32::try_from(4 * t).unwrap();
            let corners = [0, 1, 2, 3].map(|k| first + k);
            tets.push(TetConstraint::new(corners, *rest, &RUBBER));
            for (k, (x, at_rest)) in moved.iter().zip(rest).enumerate() {
                let [x, y, z] = x.to_array().map(R::from_f64);
                // One corner of each tet is held.
                let weight = [0.0, 3.0, 0.5, 1.0][k];
                particles.push([x, y, z, R::from_f64(weight)]);
                velocities.push(R::from_dvec3(
                    DVec3::from_array([x, y, z].map(R::to_f64)) - *at_rest,
                ));
            }
        }
        let factors = Factors {
            time_squared: R::from_f64(time * time),
            per_time: R::from_f64(1.0 / time),
            relaxation: R::from_f64(0.9),
        };
        Self {
            clusters: (0..tets.len()).map(ClusterId::new).collect(),
            tets,
            particles,
            velocities,
            factors,
        }
    }

    /// Clusters whose tets share corners, of so many tets each. A tet has a corner in place of one of another tet of its
    /// cluster, mirrored in the other three; numbers choose tet, corner and order of corners, and `noise` moves corners by
    /// up to as much of an edge.
    fn connected(lengths: &[usize], numbers: &[usize], noise: f64, time: f64) -> Self {
        let mut case = Self::new(&[], &[], time);
        let mut numbers = numbers.iter().copied().cycle();
        let mut next = |below: usize| numbers.next().unwrap_or(0) % below;
        let mut at_rest = Vec::new();
        for (cluster, &length) in lengths.iter().enumerate() {
            let mut tets: Vec<[usize; 4]> = Vec::new();
            for _ in 0..length {
                let mut tet = [0, 1, 2, 3].map(|k| at_rest.len() + k);
                if tets.is_empty() {
                    at_rest.extend([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
                } else {
                    tet = tets[next(tets.len())];
                    let k = next(4);
                    let others = (0..4).filter(|&j| j != k).map(|j| at_rest[tet[j]]);
                    let mirrored = others.sum::<DVec3>() * (2.0 / 3.0) - at_rest[tet[k]];
                    tet[k] = at_rest.len();
                    at_rest.push(mirrored);
                    // The mirror turns the tet inside out; an exchange of two corners turns it back.
                    tet.swap(next(2), 2 + next(2));
                }
                tets.push(tet);
                let rest = tet.map(|p| at_rest[p]);
                let corners = tet.map(|p| u32::try_from(p).unwrap());
                case.tets.push(TetConstraint::new(corners, rest, &RUBBER));
                case.clusters.push(ClusterId::new(cluster));
            }
        }
        for (p, x) in at_rest.into_iter().enumerate() {
            let mut off = || noise * (next(2001) as f64 / 1000.0 - 1.0);
            let moved = x + DVec3::new(off(), off(), off());
            let [x, y, z] = moved.to_array().map(R::from_f64);
            let weight = [0.0, 3.0, 0.5, 1.0, 2.0][p % 5];
            case.particles.push([x, y, z, R::from_f64(weight)]);
            case.velocities.push(R::vector(y, z, x));
        }
        case
    }

    /// The positions after a pass by the kernel.
    fn by_lanes(&self, level: Level, form: TetSolve) -> Vec<R::Vector> {
        self.by_lanes_keeping(level, form, false, &mut [])
    }

    /// The layout of the tets.
    fn layout(&self, level: Level) -> Layout<R> {
        let clustering = Clustering::from_labels(self.clusters.clone()).unwrap();
        let coloring = Coloring::new(vec![ColorId(0); clustering.cluster_count()]);
        let schedule = Schedule::new(&clustering, &coloring);
        let mut layout = Layout::default();
        let lanes = gauss_seidel::lanes::<R>(level);
        let positions = || {
            let positions = self.particles.iter();
            let positions = positions.map(|v| DVec3::from_slice(&[0, 1, 2].map(|k| v[k].to_f64())));
            positions.collect()
        };
        layout.update(&schedule, lanes, true, positions, |t| {
            let tet = self.tets[t as usize];
            Ingredients {
                weights: tet.particles.map(|p| self.particles[p as usize][3]),
                constants: [tet.ratio, tet.gamma, R::from_f64(RUBBER.damping)],
                tet,
            }
        });
        layout
    }

    /// The tets in the order of the layout, cluster by cluster.
    fn ordered(&self) -> Vec<TetConstraint<R>> {
        let tets: Vec<u32> = (0..).take(self.tets.len()).collect();
        let of = |tet: u32| self.tets[tet as usize];
        let clusters =
            tets.chunk_by(|&a, &b| self.clusters[a as usize] == self.clusters[b as usize]);
        let mut order = ClusterOrder::default();
        let mut ordered = Vec::new();
        for tets in clusters {
            let tets = order.of(tets, |tet| of(tet).particles);
            ordered.extend(tets.iter().map(|tet| of(tet.tet)));
        }
        ordered
    }

    /// The positions after a pass with multipliers, two for each lane of a single block.
    fn by_lanes_keeping(
        &self,
        level: Level,
        form: TetSolve,
        iterated: bool,
        multipliers: &mut [R::Particle],
    ) -> Vec<R::Vector> {
        self.paced(level, form, iterated, multipliers, &mut Sharing::default())
    }

    /// The positions after a pass on one thread or on several.
    fn paced(
        &self,
        level: Level,
        form: TetSolve,
        iterated: bool,
        multipliers: &mut [R::Particle],
        sharing: &mut Sharing<R>,
    ) -> Vec<R::Vector> {
        let mut particles: Vec<_> = self.particles.iter().map(|v| R::particle(*v)).collect();
        let layout = self.layout(level);
        let pass = Pass {
            layout: &layout,
            corners: &layout.blocks.corners,
            keeps_multipliers: !multipliers.is_empty(),
            corrections: &[],
            refused: &[],
            iterated,
            factors: self.factors,
        };
        let mut cells = Cells {
            moved: &mut particles,
            positions: &mut [],
            multipliers,
        };
        gauss_seidel::solve(level, form, &pass, &mut cells, sharing);
        particles.iter().map(load::<R>).collect()
    }

    /// The velocities after a damping pass by the kernel.
    fn damped(&self, level: Level) -> Vec<R::Vector> {
        self.damped_paced(level, &mut Sharing::default())
    }

    /// The velocities after a damping pass on one thread or on several.
    fn damped_paced(&self, level: Level, sharing: &mut Sharing<R>) -> Vec<R::Vector> {
        let mut particles: Vec<_> = self.particles.iter().map(|v| R::particle(*v)).collect();
        let weights = self.particles.iter().map(|v| v[3]);
        let mut velocities: Vec<_> = self
            .velocities
            .iter()
            .zip(weights)
            .map(|(&v, weight)| {
                let [x, y, z] = R::components(v);
                R::particle([x, y, z, weight])
            })
            .collect();
        let layout = self.layout(level);
        let pass = Pass {
            layout: &layout,
            corners: &layout.blocks.corners,
            keeps_multipliers: false,
            corrections: &[],
            refused: &[],
            iterated: false,
            factors: self.factors,
        };
        let mut cells = Cells {
            moved: &mut velocities,
            positions: &mut particles,
            multipliers: &mut [],
        };
        gauss_seidel::damp(level, &pass, &mut cells, sharing);
        velocities.iter().map(load::<R>).collect()
    }

    /// The positions after a pass of plain code, one tet at a time, with gradients at the corners.
    fn one_by_one(&self, form: TetSolve) -> Vec<R::Vector> {
        let mut moved: Vec<_> = self
            .particles
            .iter()
            .map(|&[x, y, z, _]| R::vector(x, y, z))
            .collect();
        for tet in &self.ordered() {
            let corners = tet.particles.map(|p| p as usize);
            let x = corners.map(|p| moved[p]);
            let weights = corners.map(|p| self.particles[p][3]);
            let e = match form {
                TetSolve::Split => tet.evaluate_split(x),
                _ => tet.evaluate(x),
            };
            let time_squared = self.factors.time_squared;
            let change = match form {
                TetSolve::Split => Some(tet.solve_split(&e, weights, time_squared)),
                _ => tet.solve(&e, weights, [R::ZERO; 2], time_squared),
            };
            let change = change.unwrap_or([R::ZERO; 2]);
            let change = change.map(|c| c * self.factors.relaxation);
            let step = [0, 1, 2, 3].map(|k| {
                let along =
                    e.deviatoric_gradients[k] * change[0] + e.hydrostatic_gradients[k] * change[1];
                along * weights[k]
            });
            let part = match form {
                TetSolve::Split => tet.descent(x, step),
                _ => R::ONE,
            };
            for k in 0..4 {
                moved[corners[k]] = x[k] + step[k] * part;
            }
        }
        moved
    }
}

/// All instruction sets of this processor that the kernel is compiled for.
pub(crate) fn levels() -> Vec<Level> {
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

fn case<R: Float>(tets: &[([DVec3; 4], [DVec3; 4])], time: f64) -> Case<R> {
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
        split in any::<bool>(),
    ) {
        let form = if split { TetSolve::Split } else { TetSolve::Block };
        let case = case::<f64>(&tets, time);
        let expected = case.one_by_one(form);
        for level in levels() {
            let moved = case.by_lanes(level, form);
            for (a, b) in moved.iter().zip(&expected) {
                let scale = 1.0 + b.length();
                prop_assert!(a.distance(*b) <= 1e-9 * scale, "{a} instead of {b}");
            }
        }
    }

    /// Corners that stay in the buffers, in slots that are not those of the mesh: the numbers of the plain form, which
    /// knows neither, up to rounding. Lanes end after different blocks.
    #[test]
    fn connected_tets_keep_their_corners(
        lengths in prop::collection::vec(1usize..14, 1..40),
        numbers in prop::collection::vec(0usize..1_000_000, 200),
        time in prop::sample::select(vec![1e-5, 1e-4]),
        split in any::<bool>(),
    ) {
        let form = if split { TetSolve::Split } else { TetSolve::Block };
        let case = Case::<f64>::connected(&lengths, &numbers, 0.05, time);
        let expected = case.one_by_one(form);
        let shared = case.tets.len() > lengths.len();
        for level in levels() {
            let moved = case.by_lanes(level, form);
            let layout = case.layout(level);
            prop_assert_eq!(layout.blocks.changed.iter().any(|&bits| bits != 0), shared);
            for (a, b) in moved.iter().zip(&expected) {
                prop_assert!(a.distance(*b) <= 1e-9, "{a} instead of {b}");
            }
        }
    }

    /// To the bit, whatever the number of lanes, on several threads, and with multipliers that are kept.
    #[test]
    fn connected_tets_have_the_same_bits_in_all_kernels(
        lengths in prop::collection::vec(1usize..14, 1..40),
        numbers in prop::collection::vec(0usize..1_000_000, 200),
        form in prop::sample::select(vec![TetSolve::Split, TetSolve::Block, TetSolve::Sequential]),
    ) {
        let single = Case::<f32>::connected(&lengths, &numbers, 0.1, 1e-4);
        let double = Case::<f64>::connected(&lengths, &numbers, 0.1, 1e-4);
        let run = |level: Level| {
            (single.by_lanes(level, form), double.by_lanes(level, form), single.damped(level), double.damped(level))
        };
        let expected = run(levels()[0]);
        let none = || -> Vec<_> { (0..600 * 8).map(|_| f32::particle([0.0; 4])).collect() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("threads start");
        for level in levels() {
            prop_assert_eq!(&run(level), &expected, "{:?}", level);
            prop_assert_eq!(&single.by_lanes_keeping(level, form, false, &mut none()), &expected.0);
            pool.install(|| {
                let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                prop_assert_eq!(&single.paced(level, form, false, &mut none(), &mut sharing), &expected.0);
                let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                prop_assert_eq!(&double.paced(level, form, false, &mut [], &mut sharing), &expected.1);
                let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                prop_assert_eq!(&double.damped_paced(level, &mut sharing), &expected.3);
                Ok(())
            })?;
        }
    }

    /// However far a tet is from rest and whatever the stiffness, a step of the split form does not raise its energy,
    /// up to what three shortenings leave of a rise in one tet of a million.
    #[test]
    fn a_step_far_from_rest_does_not_raise_the_energy(
        tets in tets(),
        time in prop::sample::select(vec![1e-5, 1e-4, 1e-3, 1e-1, 1e3]),
    ) {
        let case = case::<f64>(&tets, time);
        let moved = case.by_lanes(levels()[0], TetSolve::Split);
        for tet in &case.tets {
            let corners = tet.particles.map(|p| p as usize);
            let x = corners.map(|p| DVec3::from_slice(&case.particles[p]));
            let (before, far) = tet.split_energy_and_far(x);
            let (after, _) = tet.split_energy_and_far(corners.map(|p| moved[p]));
            prop_assert!(!far || after <= 1.01 * before, "{before} -> {after}");
        }
    }

    /// To the bit.
    #[test]
    fn instruction_sets_do_not_change_a_bit(
        tets in tets(),
        time in prop::sample::select(vec![1e-5, 1e-2, 1e2]),
        form in prop::sample::select(vec![TetSolve::Split, TetSolve::Block, TetSolve::Sequential]),
        iterated in any::<bool>(),
    ) {
        let (single, double) = (case::<f32>(&tets, time), case::<f64>(&tets, time));
        let run = |level: Level| {
            let mut multipliers: Vec<_> = (0..80 * 4).map(|_| f32::particle([1e-3; 4])).collect();
            let kept = single.by_lanes_keeping(level, form, iterated, &mut multipliers);
            (kept, double.by_lanes(level, form), single.damped(level), double.damped(level))
        };
        let expected = run(levels()[0]);
        for level in levels() {
            prop_assert_eq!(&run(level), &expected, "{:?}", level);
        }
    }

    /// Damping takes kinetic energy away and never gives any, keeps momentum of a free tet, and leaves a rotating tet
    /// alone.
    #[test]
    fn damping_takes_kinetic_energy_away(
        tets in tets(),
        time in prop::sample::select(vec![1e-5, 1e-2, 1e2]),
        spin in point(),
    ) {
        let mut case = case::<f64>(&tets, time);
        for particle in &mut case.particles {
            particle[3] = if particle[3] == 0.0 { 2.0 } else { particle[3] };
        }
        let mass = |p: usize| 1.0 / case.particles[p][3];
        let damped = case.damped(levels()[0]);
        for t in 0..tets.len() {
            let corners = 4 * t..4 * t + 4;
            let energy = |v: &[DVec3]| -> f64 {
                corners.clone().map(|p| mass(p) * v[p].length_squared()).sum()
            };
            let momentum = |v: &[DVec3]| -> DVec3 { corners.clone().map(|p| v[p] * mass(p)).sum() };
            let (before, after) = (energy(&case.velocities), energy(&damped));
            prop_assert!(after <= before * (1.0 + 1e-9) + 1e-12, "{before} -> {after}");
            let change = momentum(&damped) - momentum(&case.velocities);
            prop_assert!(change.length() <= 1e-9 * (1.0 + before.sqrt()), "{change}");
        }
        let mut turning = case;
        for (velocity, [x, y, z, _]) in turning.velocities.iter_mut().zip(&turning.particles) {
            *velocity = spin.cross(DVec3::new(*x, *y, *z));
        }
        let damped = turning.damped(levels()[0]);
        for (a, b) in damped.iter().zip(&turning.velocities) {
            prop_assert!(a.distance(*b) <= 1e-9 * (1.0 + b.length()), "{a} instead of {b}");
        }
    }
}

/// Several threads move particles by other instructions than one, and by the same bits. So does a pass that keeps
/// multipliers, which is another kernel. Some lanes of the last block are empty.
#[test]
fn several_threads_and_kept_multipliers_change_no_bit() {
    fn check<R: Float<Vector: PartialEq>>() {
        let rest = vec![[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]; 603];
        let moved = rest.iter().enumerate().map(|(t, corners)| {
            let strain = 1e-3 * t as f64;
            corners
                .map(|x| DVec3::new(x.x * (1.3 - strain), x.y + strain * x.z, x.z - strain * x.x))
        });
        let case = Case::<R>::new(&rest, &moved.collect::<Vec<_>>(), 1e-2);
        let none = || -> Vec<_> { (0..640 / 2).map(|_| R::particle([R::ZERO; 4])).collect() };
        for level in levels() {
            for form in [TetSolve::Split, TetSolve::Block, TetSolve::Sequential] {
                let alone = case.by_lanes(level, form);
                let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                let several = case.paced(level, form, false, &mut [], &mut sharing);
                assert_eq!(several, alone, "{level:?} {form:?}");
                let kept = case.by_lanes_keeping(level, form, false, &mut none());
                assert_eq!(kept, alone, "{level:?} {form:?}");
                let mut sharing = Sharing::new(Pace::of_threads_that_gain());
                let kept = case.paced(level, form, false, &mut none(), &mut sharing);
                assert_eq!(kept, alone, "{level:?} {form:?}");
            }
            let mut sharing = Sharing::new(Pace::of_threads_that_gain());
            assert_eq!(case.damped_paced(level, &mut sharing), case.damped(level));
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
    pool.expect("threads start").install(|| {
        check::<f32>();
        check::<f64>();
    });
}

/// Near the saddle of the shear energy, at `F = s` with `s⁴ - 2 s + 1 = 0`, and near a line, where the slope of the
/// volume vanishes, the linearized zeros of the constraints are far away.
#[test]
fn corners_stay_bounded_near_saddles_and_lines() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let saddle = 0.543_689_012_692_076_4;
    let mut moved = Vec::new();
    for off in [-1e-3, -1e-6, 0.0, 1e-9, 1e-4] {
        moved.push(corners.map(|x| x * (saddle + off)));
        moved.push(corners.map(|x| DVec3::new(x.x, x.y * 1e-3, x.z * off)));
    }
    let case = Case::<f64>::new(&vec![corners; moved.len()], &moved, 1e3);
    for x in case.by_lanes(levels()[0], TetSolve::Split) {
        assert!(x.length() < 3.0, "{x}");
    }
}

/// At rest the split form moves nothing by more than rounding, whatever the stiffness.
#[test]
fn the_split_form_leaves_a_tet_at_rest_alone() {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * 1e-3];
    for time in [1e-5, 1e-1, 1e3] {
        let case = Case::<f64>::new(&[rest], &[rest], time);
        let mut multipliers: Vec<_> = (0..8).map(|_| f64::particle([0.0; 4])).collect();
        for (iterated, multipliers) in [(false, &mut [][..]), (true, &mut multipliers)] {
            let moved = case.by_lanes_keeping(levels()[0], TetSolve::Split, iterated, multipliers);
            for (x, at_rest) in moved.iter().zip(rest) {
                assert!(x.distance(at_rest) <= 1e-14, "{time}: {x} for {at_rest}");
            }
        }
    }
}

/// A tet too large to be squared is left alone, its multipliers with it, and so is one without size.
#[test]
fn tets_out_of_range_stay_as_they_are() {
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for size in [1e30, 0.0] {
        for form in [TetSolve::Split, TetSolve::Block, TetSolve::Sequential] {
            let case = Case::<f32>::new(&[rest], &[rest.map(|x| x * size)], 1e-3);
            let mut multipliers: Vec<_> = (0..8).map(|_| f32::particle([0.0; 4])).collect();
            for (level, iterated) in levels().into_iter().flat_map(|l| [(l, false), (l, true)]) {
                let moved = case.by_lanes_keeping(level, form, iterated, &mut multipliers);
                for (x, before) in moved.iter().zip(&case.particles) {
                    assert_eq!(x.to_array(), before[..3], "{size:e}, {form:?}");
                }
                let mut values = multipliers.iter().flat_map(f32::read);
                assert!(values.all(f32::is_finite));
            }
        }
    }
}
