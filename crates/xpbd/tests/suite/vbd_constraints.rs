//! Distances, volumes and soft attachments in VBD: closed forms, descent, slopes, and the limit that XPBD has.

use glam::{DVec3, dvec3};
use incise_coloring::color;
use incise_graph::{Clustering, ConstraintGraph, Incidence, Schedule};
use incise_mesh::kuhn_box;
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, DistanceConstraint, ImplicitStep, Material, Pose,
    Real, Solver, StepSettings, VbdSettings, VolumeConstraint,
};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, RUBBER, body, largest_distance, plain, positions, within};
use crate::vbd::{bits, everything, falling, stars};

const REST: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

pub(crate) fn distance(
    particles: [u32; 2],
    length: f64,
    compliance: f64,
    damping: f64,
) -> DistanceConstraint {
    DistanceConstraint {
        particles,
        length,
        compliance,
        damping,
        tension_only: false,
    }
}

fn order<const K: usize>(particles: usize, constraints: &[[u32; K]]) -> Schedule {
    let incidence = Incidence::from_constraints(particles, constraints.iter().copied()).unwrap();
    let graph = ConstraintGraph::from_incidence(&incidence);
    let colored = color("greedy".parse().unwrap(), &graph, 0).unwrap();
    Schedule::new(&Clustering::none(constraints.len()), &colored.coloring)
}

pub(crate) fn link<R: Real>(solver: &mut Solver<R>, constraints: &[DistanceConstraint]) {
    let particles: Vec<[u32; 2]> = constraints.iter().map(|c| c.particles).collect();
    let schedule = order(solver.particle_count(), &particles);
    solver.set_distances(constraints, schedule).unwrap();
}

fn fill<R: Real>(solver: &mut Solver<R>, constraints: &[VolumeConstraint]) {
    let particles: Vec<[u32; 4]> = constraints.iter().map(|c| c.particles).collect();
    let schedule = order(solver.particle_count(), &particles);
    solver.set_volumes(constraints, schedule).unwrap();
}

/// Particles one below the other; the first has no mass and stays.
fn hanging<R: Real>(count: u32, mass: f64, compliance: f64, damping: f64) -> Solver<R> {
    let at: Vec<DVec3> = (0..count).map(|p| DVec3::NEG_Z * f64::from(p)).collect();
    let mut solver = Solver::new(&at);
    (1..at.len()).for_each(|p| solver.set_mass(p, mass));
    let springs: Vec<DistanceConstraint> = (1..count)
        .map(|p| distance([p - 1, p], 1.0, compliance, damping))
        .collect();
    link(&mut solver, &springs);
    solver
}

fn correction<R: Real>(solver: &Solver<R>) -> CoarseCorrection<R> {
    CoarseCorrection::new(&stars(solver), CoarseCorrectionSettings::default()).unwrap()
}

/// Frames of VBD, by sweeps alone or with corrections.
fn advance<R: Real>(
    solver: &mut Solver<R>,
    settings: &VbdSettings,
    two_level: bool,
    frames: usize,
) {
    let mut stars = stars(solver);
    let mut correction = correction(solver);
    for _ in 0..frames {
        let report = if two_level {
            solver.step_vbd_two_level(&mut stars, &mut correction, settings)
        } else {
            solver.step_vbd(&mut stars, settings)
        };
        assert_eq!(report.unwrap().repaired, 0);
    }
}

/// Spring `i` of a damped chain carries all that hangs below it.
fn chain_settles<R: Real>(two_level: bool, tolerance: f64) {
    let (count, mass, compliance) = (4, 0.2, 0.05);
    let mut solver = hanging::<R>(count, mass, compliance, 0.2);
    advance(&mut solver, &falling(20), two_level, 600);
    let mut z = 0.0;
    for p in 1..count {
        z -= 1.0 + f64::from(count - p) * mass * -GRAVITY.z * compliance;
        within(
            "height",
            (solver.position(p as usize).z - z).abs(),
            tolerance,
        );
    }
}

#[test]
fn a_chain_of_springs_settles_where_each_carries_what_hangs_below() {
    for two_level in [false, true] {
        chain_settles::<f64>(two_level, 1e-7);
        chain_settles::<f32>(two_level, 1e-4);
    }
}

/// A damped spring is a damped oscillator: backward Euler of `m ẍ + k τ ẋ + k x = 0` has the amplification
/// `1 / (1 - s Δt)` with the roots s, here two real ones. Followed over 50 steps.
#[test]
fn a_damped_spring_is_backward_euler_of_a_damped_oscillator() {
    let (mass, compliance, tau, time) = (2.0, 1e-3, 0.02, 0.005);
    let mut solver = hanging::<f64>(2, mass, compliance, tau);
    solver.set_position(1, DVec3::NEG_Z * 1.1);
    let (mut x, mut v) = (0.1, 0.0);
    let mut stars = stars(&solver);
    let settings = VbdSettings::new(time, 3);
    for _ in 0..50 {
        solver.step_vbd(&mut stars, &settings).unwrap();
        let k = 1.0 / compliance;
        v = (v - time / mass * k * x) / (1.0 + time / mass * k * (time + tau));
        x += time * v;
        within("length", (-solver.position(1).z - 1.0 - x).abs(), 1e-12);
    }
    within("it has decayed", x.abs(), 0.03);
}

/// On a soft attachment a particle is lower by weight times compliance, and stays there.
#[test]
fn a_soft_attachment_gives_way_by_force_times_compliance() {
    for (two_level, compliance, damping) in [
        (false, 0.01, 0.0),
        (true, 0.01, 0.0),
        (false, 1e-6, 0.1),
        (false, 1e-300, 0.0),
    ] {
        let mut solver = Solver::<f64>::new(&[DVec3::ONE]);
        solver.set_mass(0, 2.0);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        solver.attach(0, handle, compliance, damping).unwrap();
        let sag = GRAVITY * 2.0 * compliance;
        solver.set_position(0, DVec3::ONE + sag);
        advance(&mut solver, &falling(2), two_level, 100);
        within("sag", solver.position(0).distance(DVec3::ONE + sag), 1e-12);
    }
}

/// Damping is against the handle: a particle carried along at its speed feels none.
#[test]
fn damping_is_relative_to_the_handle() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.set_mass(0, 1.0);
    solver.attach(0, handle, 1e-2, 0.2).unwrap();
    solver.set_velocity(0, DVec3::X * 3.0);
    let mut stars = stars(&solver);
    for frame in 1..=100 {
        let at = DVec3::X * 0.03 * f64::from(frame);
        solver.move_handle(handle, Pose::at(at));
        solver
            .step_vbd(&mut stars, &VbdSettings::new(0.01, 1))
            .unwrap();
        within("carried", solver.position(0).distance(at), 1e-12);
    }
}

/// A weight above three corners that stay, held by volume alone: `s = 6 α m g`. A hard one gives what the multipliers
/// have left: each of 20 iterations divides it by 11.
fn volume_carries<R: Real>(two_level: bool, tolerance: f64) {
    for compliance in [1e-4, 0.0] {
        let mut solver = Solver::<R>::new(&REST);
        solver.set_mass(3, 1.0);
        let volume = VolumeConstraint::of_tet([0, 1, 2, 3], REST, compliance);
        fill(&mut solver, &[volume]);
        let lower = DVec3::Z * (1.0 + GRAVITY.z * 6.0 * compliance);
        solver.set_position(3, lower);
        advance(&mut solver, &falling(20), two_level, 100);
        within("height", solver.position(3).distance(lower), tolerance);
    }
}

#[test]
fn a_tet_carries_a_weight_by_its_volume() {
    for two_level in [false, true] {
        volume_carries::<f64>(two_level, 1e-12);
        volume_carries::<f32>(two_level, 1e-5);
    }
}

/// A thread is no constraint on what falls until it is taut, then carries the weight and never pushes.
#[test]
fn a_thread_pulls_but_does_not_push() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, dvec3(0.0, 0.0, -0.5)]);
    solver.set_mass(1, 1.0);
    let thread = DistanceConstraint {
        tension_only: true,
        ..distance([0, 1], 1.0, 1e-6, 0.01)
    };
    link(&mut solver, &[thread]);
    let mut stars = stars(&solver);
    // Each iteration divides what the multiplier lacks by about 11.
    let mut settings = falling(8);
    settings.step.time_step = 1e-3;
    for frame in 1..=310 {
        solver.step_vbd(&mut stars, &settings).unwrap();
        let n = f64::from(frame);
        let fallen = 0.5 * -GRAVITY.z * 1e-6 * n * (n + 1.0);
        within("fall", (solver.position(1).z + 0.5 + fallen).abs(), 1e-12);
    }
    for _ in 0..3000 {
        solver.step_vbd(&mut stars, &settings).unwrap();
        assert!(solver.position(1).length() < 1.0 + 4e-3);
    }
    let length = solver.position(1).length();
    within("length at rest", (length - 1.0 - 9.81e-6).abs(), 1e-8);
    // Thrown up it flies as if there were no thread.
    settings.step.gravity = None;
    solver.set_velocity(1, DVec3::Z * 2.0);
    let start = solver.position(1).z;
    for _ in 0..200 {
        solver.step_vbd(&mut stars, &settings).unwrap();
    }
    within("flight", (solver.position(1).z - start - 0.4).abs(), 1e-6);
}

/// Rods keep their length: a chain of five that swings down from the horizontal. The violation that is left after the
/// iterations falls with their number.
#[test]
fn the_violation_of_rods_falls_with_the_iterations() {
    let violation = |iterations, two_level| {
        let at: Vec<DVec3> = (0..6).map(|p| DVec3::X * f64::from(p)).collect();
        let mut solver = Solver::<f64>::new(&at);
        (1..6).for_each(|p| solver.set_mass(p, 1.0));
        let rods: Vec<_> = (1..6)
            .map(|p| distance([p - 1, p], 1.0, 0.0, 0.0))
            .collect();
        link(&mut solver, &rods);
        let mut worst: f64 = 0.0;
        for _ in 0..60 {
            advance(&mut solver, &falling(iterations), two_level, 1);
            for rod in &rods {
                let [a, b] = rod.particles.map(|p| solver.position(p as usize));
                worst = worst.max((a.distance(b) - 1.0).abs());
            }
        }
        worst
    };
    // In a frame free particles fall by g Δt² = 2.7 mm; the last swings at up to 7 m/s.
    let sweeps = [20, 100, 400].map(|iterations| violation(iterations, false));
    assert!(
        sweeps[1] < 0.5 * sweeps[0] && sweeps[2] < 0.1 * sweeps[1],
        "{sweeps:?}"
    );
    let corrected = [3, 10, 30].map(|iterations| violation(iterations, true));
    assert!(corrected[1] < 0.1 * corrected[0], "{corrected:?}");
    within("rods", sweeps[2], 1e-5);
    within("rods by corrections", corrected[2], 1e-7);
}

/// A body on springs, threads, rods, soft attachments, with volume constraints and damping.
fn linked<R: Real>(material: Material, hard: bool) -> Solver<R> {
    let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
    let mut at = mesh.positions.clone();
    let count = u32::try_from(at.len()).unwrap();
    at.extend([
        dvec3(0.5, 0.0, 0.5),
        dvec3(0.5, 0.2, 0.5),
        dvec3(0.6, 0.1, 0.1),
    ]);
    let mut solver = Solver::<R>::new(&at);
    solver.add_material(material).unwrap();
    let mut volumes = Vec::new();
    for (t, tet) in mesh.tets.iter().enumerate() {
        let rest = mesh.corners(incise_mesh::TetId::new(t));
        let corners = tet.map(|p| p.0);
        solver.push_tet(corners, rest, 0);
        if t % 3 == 0 {
            volumes.push(VolumeConstraint {
                damping: if t % 2 == 0 { 0.01 } else { 0.0 },
                ..VolumeConstraint::of_tet(corners, rest, if hard && t == 0 { 0.0 } else { 1e-6 })
            });
        }
    }
    for (p, x) in at.iter().enumerate() {
        solver.set_mass(p, 0.1 + 0.01 * p as f64);
        solver.set_fixed(p, x.x == 0.0);
    }
    solver.set_fixed(count as usize, true);
    fill(&mut solver, &volumes);
    let end: Vec<u32> = (0..count).filter(|&p| at[p as usize].x == 0.4).collect();
    let mut springs = vec![
        distance([end[0], count], 0.3, 1e-3, 0.05),
        distance([count + 1, end[1]], 0.3, 1e-4, 0.0),
        distance([end[2], count + 2], 0.2, if hard { 0.0 } else { 1e-4 }, 0.0),
        distance([count + 1, count + 2], 0.3, 1e-3, 0.01),
    ];
    springs[3].tension_only = true;
    link(&mut solver, &springs);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.attach(end[3] as usize, handle, 1e-3, 0.02).unwrap();
    solver
        .attach(count as usize + 1, handle, 1e-2, 0.0)
        .unwrap();
    solver
}

/// Sweeps and corrections end in the same place, at a residual of 1e-9: the matrix is that of the potential, or the
/// second would not converge in 60 rounds.
#[test]
fn corrections_lead_where_sweeps_lead() {
    let run = |two_level, hard| {
        let mut solver = linked::<f64>(
            Material {
                damping: 0.005,
                ..RUBBER
            },
            hard,
        );
        let mut stars = stars(&solver);
        let mut correction = correction(&solver);
        let mut settings = falling(if two_level { 60 } else { 20_000 });
        settings.tolerance = Some(1e-9);
        for _ in 0..3 {
            let report = if two_level {
                solver.step_vbd_two_level(&mut stars, &mut correction, &settings)
            } else {
                solver.step_vbd(&mut stars, &settings)
            };
            let report = report.unwrap();
            assert!(
                report.residual.unwrap() <= 1e-9,
                "{two_level} {hard} {report:?}"
            );
        }
        positions(&solver)
    };
    for hard in [false, true] {
        within(
            "distance",
            largest_distance(&run(false, hard), &run(true, hard)),
            1e-7,
        );
    }
}

/// XPBD and VBD go to the same motion as substeps shrink: half the substep, half the distance.
#[test]
fn xpbd_and_vbd_approach_each_other() {
    let soft = Material {
        young_modulus: 1e5,
        poisson_ratio: 0.3,
        ..RUBBER
    };
    let apart = |substeps: u32| {
        let mut xpbd = linked::<f64>(soft, false);
        let mut vbd = linked::<f64>(soft, false);
        let mesh = kuhn_box([4, 2, 2], dvec3(0.4, 0.2, 0.2));
        let schedule = plain(&mesh);
        let step = StepSettings {
            substeps,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.01)
        };
        let mut stars = stars(&vbd);
        let mut settings = falling(100);
        settings.step = StepSettings {
            iterations: 100,
            ..step.clone()
        };
        settings.tolerance = Some(1e-8);
        let start = positions(&vbd);
        for _ in 0..12 {
            xpbd.step(&schedule, &step).unwrap();
            vbd.step_vbd(&mut stars, &settings).unwrap();
        }
        let moved = largest_distance(&positions(&vbd), &start);
        assert!(moved > 0.02, "{moved}");
        largest_distance(&positions(&xpbd), &positions(&vbd)) / moved
    };
    let gaps = [10, 20, 40].map(apart);
    within("gap", gaps[2], 0.03);
    for pair in gaps.windows(2) {
        within("half the substep", pair[1] / pair[0], 0.65);
    }
}

fn state<R: Real>(threads: usize, two_level: bool) -> u64 {
    let mesh = kuhn_box([10, 10, 10], DVec3::ONE);
    let mut solver = body::<R>(
        &mesh,
        Material {
            damping: 0.01,
            ..RUBBER
        },
    );
    let mut noise = Noise(8);
    let count = u32::try_from(mesh.positions.len()).unwrap();
    let springs: Vec<_> = (0..count - 1)
        .map(|p| {
            let [a, b] = [p, p + 1].map(|p| mesh.positions[p as usize]);
            let compliance = if p % 7 == 0 { 0.0 } else { 1e-4 };
            DistanceConstraint {
                tension_only: p % 3 == 0,
                ..distance([p, p + 1], 0.9 * a.distance(b), compliance, 1e-3)
            }
        })
        .collect();
    link(&mut solver, &springs);
    let volumes: Vec<_> = (0..mesh.tets.len())
        .step_by(2)
        .map(|t| {
            let rest = mesh.corners(incise_mesh::TetId::new(t));
            VolumeConstraint::of_tet(mesh.tets[t].map(|p| p.0), rest, 1e-7)
        })
        .collect();
    fill(&mut solver, &volumes);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for p in 0..solver.particle_count() {
        solver.set_velocity(p, noise.vector());
        if p % 5 == 0 {
            solver.attach(p, handle, 1e-3, 0.01).unwrap();
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build()
        .unwrap()
        .install(|| advance(&mut solver, &everything(), two_level, 1));
    bits(&solver)
}

#[test]
fn threads_do_not_change_a_bit() {
    for two_level in [false, true] {
        let [one, two, three] = [1, 2, 3].map(|threads| state::<f32>(threads, two_level));
        assert_eq!((one, one), (two, three));
        assert_eq!(state::<f64>(1, two_level), state::<f64>(2, two_level));
    }
}

/// Changed constraints need new stars.
#[test]
#[should_panic(expected = "the stars belong to these particles, tets and constraints")]
fn stars_without_the_constraints_are_refused() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X]);
    let mut stars = stars(&solver);
    link(&mut solver, &[distance([0, 1], 1.0, 0.0, 0.0)]);
    let _ = solver.step_vbd(&mut stars, &VbdSettings::new(0.01, 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    /// Any constraints, damping, state and relaxation: no sweep and no correction raises the potential beyond rounding.
    #[test]
    fn the_potential_never_rises(
        particles in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -2..3i32), 6..12),
        springs in prop::collection::vec((0..12u32, 1..12u32, 0.0..2.0f64, -7..1i32, 0..16u8), 0..12),
        attached in prop::collection::vec((0..12usize, -6..1i32), 0..4),
        (modulus, damping) in (2..8i32, prop_oneof![Just(0.0), 1e-3..0.1f64]),
        relaxation in 0.5..1.9f64,
        squeeze in prop::array::uniform3(-1.5..1.5f64),
    ) {
        let at: Vec<DVec3> = particles.iter().map(|(x, _)| DVec3::from_array(*x)).collect();
        let count = u32::try_from(at.len()).unwrap();
        let mut solver = Solver::<f64>::new(&at);
        solver.add_material(Material { young_modulus: 10f64.powi(modulus), damping, ..RUBBER }).unwrap();
        let mut volumes = Vec::new();
        for p in 0..count - 3 {
            let mut tet = [p, p + 1, p + 2, p + 3];
            let rest = |tet: [u32; 4]| tet.map(|p| at[p as usize]);
            let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).cross(c - a).dot(d - a);
            if volume(rest(tet)) < 0.0 {
                tet.swap(1, 2);
            }
            // Slivers have stiffnesses of 1e6 times the others and only drown the potential.
            if volume(rest(tet)) < 0.05 {
                continue;
            }
            solver.push_tet(tet, rest(tet), 0);
            let compliance = if p % 2 == 0 { 0.0 } else { 1e-4 };
            volumes.push(VolumeConstraint { damping, ..VolumeConstraint::of_tet(tet, rest(tet), compliance) });
        }
        fill(&mut solver, &volumes);
        let list: Vec<_> = springs.iter().map(|&(p, other, length, compliance, what)| {
            let [a, b] = [p % count, (p % count + 1 + other % (count - 1)) % count];
            DistanceConstraint {
                tension_only: what & 1 == 0,
                ..distance([a, b], length, if what & 2 == 0 { 0.0 } else { 10f64.powi(compliance) }, if what & 4 == 0 { 0.0 } else { 0.05 })
            }
        }).collect();
        link(&mut solver, &list);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for &(p, compliance) in &attached {
            solver.attach(p % at.len(), handle, 10f64.powi(compliance), damping).unwrap();
        }
        let mut noise = Noise(4);
        for (p, (_, mass)) in particles.iter().enumerate() {
            solver.set_mass(p, 10f64.powi(*mass));
            solver.set_velocity(p, noise.vector() * 10.0);
            solver.set_position(p, at[p] * DVec3::from_array(squeeze));
        }
        let mut stars = stars(&solver);
        let mut correction = correction(&solver);
        let mut settings = falling(1);
        settings.step.relaxation = relaxation;
        let mut step = ImplicitStep::new(&mut solver, &mut stars, &settings).unwrap();
        for round in 0..12 {
            let start = step.potential();
            if round % 3 == 2 {
                step.correct(&mut correction);
            } else {
                step.sweep();
            }
            let end = step.potential();
            prop_assert!(end - start <= 1e-10 * start.abs(), "{round}: {start} to {end}");
            step.update_multipliers();
        }
    }

    /// Anything finite at all leaves all particles finite, in both precisions.
    #[test]
    fn any_constraint_leaves_any_particle_finite(
        particles in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -45..37i32, -300..300i32), 4..8),
        springs in prop::collection::vec((0..8u32, 1..8u32, -40..37i32, -300..300i32, -10..10i32, 0..8u8), 1..12),
        rest_volume in (-3.0..10.0f64, -300..300i32),
        two_level in any::<bool>(),
    ) {
        let count = u32::try_from(particles.len()).unwrap();
        let at: Vec<DVec3> = particles
            .iter()
            .map(|(x, size, _)| DVec3::from_array(*x) * 10f64.powi(*size))
            .collect();
        let list: Vec<DistanceConstraint> = springs
            .iter()
            .map(|&(p, other, length, compliance, damping, what)| DistanceConstraint {
                particles: [p % count, (p % count + 1 + other % (count - 1)) % count],
                length: if what & 1 == 0 { 0.0 } else { 10f64.powi(length) },
                compliance: if what & 2 == 0 { 0.0 } else { 10f64.powi(compliance) },
                damping: if what & 2 == 0 { 0.0 } else { 10f64.powi(damping) },
                tension_only: what & 4 == 0,
            })
            .collect();
        let volume = VolumeConstraint {
            particles: [0, 1, 2, 3],
            rest_volume: rest_volume.0 * 10f64.powi(rest_volume.1),
            compliance: list[0].compliance,
            damping: list[0].damping,
        };
        finite::<f32>(&at, &particles, &list, volume, two_level)?;
        finite::<f64>(&at, &particles, &list, volume, two_level)?;
    }
}

fn finite<R: Real>(
    at: &[DVec3],
    particles: &[([f64; 3], i32, i32)],
    list: &[DistanceConstraint],
    volume: VolumeConstraint,
    two_level: bool,
) -> Result<(), TestCaseError> {
    let mut solver = Solver::<R>::new(at);
    for (p, (_, _, mass)) in particles.iter().enumerate() {
        solver.set_mass(p, 10f64.powi(*mass));
    }
    link(&mut solver, list);
    fill(&mut solver, &[volume]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver
        .attach(1, handle, list[0].compliance, list[0].damping)
        .unwrap();
    let mut stars = stars(&solver);
    let mut correction = correction(&solver);
    for _ in 0..3 {
        let report = if two_level {
            solver.step_vbd_two_level(&mut stars, &mut correction, &falling(3))
        } else {
            solver.step_vbd(&mut stars, &falling(3))
        };
        prop_assert!(report.is_ok());
    }
    for p in 0..at.len() {
        prop_assert!(solver.position(p).is_finite() && solver.velocity(p).is_finite());
    }
    Ok(())
}
