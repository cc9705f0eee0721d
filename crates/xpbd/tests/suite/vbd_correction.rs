//! Corrections: they lead to the same solution as sweeps, in far fewer rounds, and never uphill.

use glam::{DQuat, DVec3, EulerRot, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionReport, CoarseCorrectionSettings, Collider, Guess,
    ImplicitStep, Integrator, Material, Real, Solver, VbdSettings, VertexStars, XpbdError,
};

use crate::body::{GRAVITY, RUBBER, body, disturb, largest_distance, positions, within};
use crate::extremes::{assert_finite, cases};
use crate::vbd::{bits, everything, falling, held_beam, stars};

/// Small aggregates, so that a small body has some.
const SMALL: CoarseCorrectionSettings = CoarseCorrectionSettings {
    iterations: 50,
    reduction: 0.03,
    aggregate: 12,
};

fn correction<R: Real>(stars: &VertexStars<R>) -> CoarseCorrection<R> {
    let correction = CoarseCorrection::new(stars, SMALL).unwrap();
    assert!(correction.aggregate_count() > 3);
    correction
}

/// At kappa 4e5 and nearly without compressibility, where sweeps alone get nowhere: a residual of 1e-9 of its start in
/// a few rounds. Measured: 5 to 7.
#[test]
fn a_stiff_step_converges_in_a_few_rounds() {
    let steel = Material {
        young_modulus: 1e10,
        poisson_ratio: 0.49,
        ..RUBBER
    };
    let mut solver = held_beam::<f64>(steel);
    let mut stars = stars(&solver);
    let mut correction = correction(&stars);
    let mut settings = falling(12);
    settings.tolerance = Some(1e-9);
    for _ in 0..5 {
        let report = solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
        assert!(report.residual.unwrap() <= 1e-9, "{report:?}");
    }
}

#[test]
fn corrections_lead_where_sweeps_lead() {
    let run = |corrected| {
        let mut solver = held_beam::<f64>(RUBBER);
        let mut stars = stars(&solver);
        let mut correction = correction(&stars);
        let mut settings = falling(5000);
        settings.tolerance = Some(1e-10);
        for _ in 0..3 {
            let report = if corrected {
                solver.step_vbd_two_level(&mut stars, &mut correction, &settings)
            } else {
                solver.step_vbd(&mut stars, &settings)
            };
            assert!(report.unwrap().residual.unwrap() <= 1e-10);
        }
        positions(&solver)
    };
    let (sweeps, both) = (run(false), run(true));
    // The tip sinks by millimeters.
    within("distance", largest_distance(&sweeps, &both), 1e-8);
}

/// The worst error of any frame of 40, as a part of the motion, and the rounds of all frames, for some accuracies.
fn errors_of_accuracies(
    body: impl Fn() -> Solver<f64>,
    settings: &VbdSettings,
    accuracies: &[f64],
) -> Vec<(f64, f64)> {
    let run = |accuracy: Option<f64>| {
        let mut solver = body();
        let start = positions(&solver);
        let mut stars = stars(&solver);
        let mut correction = correction(&stars);
        let mut settings = settings.clone();
        settings.accuracy = accuracy;
        settings.tolerance = accuracy.is_none().then_some(1e-9);
        let mut states = Vec::new();
        let mut rounds = 0;
        for _ in 0..40 {
            let report = solver.step_vbd_two_level(&mut stars, &mut correction, &settings);
            rounds += report.unwrap().iterations;
            states.push(positions(&solver));
        }
        (start, states, rounds)
    };
    let (start, exact, most) = run(None);
    let motion = exact.iter().map(|state| largest_distance(&start, state));
    let motion = motion.fold(0.0, f64::max);
    let all = accuracies.iter().map(|&accuracy| {
        let (_, states, rounds) = run(Some(accuracy));
        let apart = states.iter().zip(&exact);
        let worst = apart
            .map(|(a, b)| largest_distance(a, b))
            .fold(0.0, f64::max);
        (worst / motion, f64::from(rounds) / f64::from(most))
    });
    all.collect()
}

/// A beam that sinks, vibrates and comes to rest, with matrices that are kept from one substep to the next: in every
/// frame its positions differ from those of converged steps by at most the accuracy asked for, as a part of the motion.
#[test]
fn an_accuracy_bounds_the_error() {
    for (young_modulus, poisson_ratio) in [(1e5, 0.3), (1e7, 0.49), (1e9, 0.4999)] {
        let material = Material {
            young_modulus,
            poisson_ratio,
            damping: 0.01,
            ..RUBBER
        };
        for guess in [Guess::Inertia, Guess::Adaptive] {
            let accuracies = [0.1, 0.05, 0.02];
            let mut settings = falling(50);
            settings.guess = guess;
            let errors = errors_of_accuracies(|| held_beam(material), &settings, &accuracies);
            for (accuracy, (error, rounds)) in accuracies.into_iter().zip(errors) {
                let what =
                    format!("E = {young_modulus:e}, nu = {poisson_ratio}, {guess:?}, {accuracy}");
                assert!(error <= accuracy, "{what}: {error}");
                assert!(rounds < 1.0, "{what}: {rounds} of the rounds");
            }
        }
    }
}

/// A beam that hangs by an edge of one end and falls through a quarter of a turn: little strain, much motion.
#[test]
fn an_accuracy_bounds_the_error_of_a_swing() {
    for (young_modulus, poisson_ratio) in [(1e7, 0.3), (1e9, 0.45)] {
        let material = Material {
            young_modulus,
            poisson_ratio,
            ..RUBBER
        };
        let hinged = || {
            let mut solver = held_beam::<f64>(material);
            for p in 0..solver.particle_count() {
                let x = solver.position(p);
                solver.set_fixed(p, x.x == 0.0 && x.z == 0.0);
            }
            solver
        };
        let mut settings = falling(50);
        settings.guess = Guess::Adaptive;
        let accuracies = [0.1, 0.02];
        let errors = errors_of_accuracies(hinged, &settings, &accuracies);
        for (accuracy, (error, _)) in accuracies.into_iter().zip(errors) {
            let what = format!("E = {young_modulus:e}, nu = {poisson_ratio}");
            assert!(error <= accuracy, "{what}: {error} of {accuracy}");
        }
    }
}

/// A strained beam, held at both ends, holds most of the energy. A tet beside it that nothing holds keeps falling
/// as implicit Euler falls: `g Δt² n (n + 1) / 2` after n substeps.
#[test]
fn a_body_falls_freely_beside_a_strained_one() {
    let steel = Material {
        young_modulus: 1e9,
        ..RUBBER
    };
    let mut mesh = kuhn_box([6, 2, 2], dvec3(0.6, 0.2, 0.2));
    let beam = mesh.positions.len();
    let crumb = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::NEG_Z];
    mesh.positions
        .extend(crumb.map(|x| x * 0.05 + DVec3::splat(2.0)));
    mesh.tets
        .push([0, 1, 2, 3].map(|k| incise_mesh::ParticleId::new(beam + k)));
    let mut solver = body::<f64>(&mesh, steel);
    for p in 0..beam {
        let x = solver.position(p);
        solver.set_position(p, dvec3(1.1 * x.x, x.y, x.z));
        solver.set_fixed(p, x.x == 0.0 || x.x == 0.6);
    }
    let start = positions(&solver);
    let mut stars = stars(&solver);
    let mut correction = correction(&stars);
    let mut settings = falling(50);
    settings.guess = Guess::Adaptive;
    settings.accuracy = Some(0.05);
    for n in 1..=30 {
        let report = solver.step_vbd_two_level(&mut stars, &mut correction, &settings);
        assert!(report.unwrap().error.unwrap() <= 0.05);
        let way = GRAVITY * (f64::from(n * (n + 1)) / 2.0 / 3600.0);
        for (p, start) in start.iter().enumerate().skip(beam) {
            let off = (solver.position(p) - start).distance(way);
            within("way", off, 1e-3 * way.length());
        }
    }
}

/// A free body turns once at 10 rad/s; the prediction of each step stretches it.
#[test]
fn an_accuracy_bounds_the_error_of_a_spinning_body() {
    for (young_modulus, poisson_ratio) in [(1e5, 0.4999), (1e7, 0.3), (1e9, 0.0), (1e10, 0.0)] {
        let material = Material {
            young_modulus,
            poisson_ratio,
            ..RUBBER
        };
        let spinning = || {
            let mesh = kuhn_box([6, 2, 2], dvec3(0.6, 0.2, 0.2));
            let mut solver = body::<f64>(&mesh, material);
            for p in 0..solver.particle_count() {
                let arm = solver.position(p) - dvec3(0.3, 0.1, 0.1);
                solver.set_velocity(p, dvec3(0.0, 0.0, 10.0).cross(arm));
            }
            solver
        };
        for (integrator, guess) in [
            (Integrator::ImplicitEuler, Guess::Inertia),
            (Integrator::ImplicitEuler, Guess::Adaptive),
            (Integrator::Bdf2, Guess::Inertia),
        ] {
            let mut settings = VbdSettings::new(0.016, 50);
            settings.integrator = integrator;
            settings.guess = guess;
            let accuracies = [0.1, 0.02];
            let errors = errors_of_accuracies(spinning, &settings, &accuracies);
            for (accuracy, (error, _)) in accuracies.into_iter().zip(errors) {
                let what = format!("E = {young_modulus:e}, nu = {poisson_ratio}, {integrator:?}");
                assert!(error <= accuracy, "{what}: {error} of {accuracy}");
            }
        }
    }
}

/// From insane states, stiff and soft. Rounding may raise the potential: by 1e-10 of its start.
#[test]
fn corrections_never_raise_the_potential() {
    for (young_modulus, poisson_ratio) in [(1e3, 0.0), (1e6, 0.45), (1e12, 0.4999)] {
        let states: [fn(DVec3) -> DVec3; 5] = [
            |x| x * 2.0,
            |x| dvec3(x.x, x.y, -x.z),
            |x| dvec3(x.x, x.y, 0.0),
            |_| DVec3::ZERO,
            |x| {
                dvec3(
                    x.x,
                    (37.0 * x.x + 91.0 * x.y).sin(),
                    (53.0 * x.z - 17.0 * x.x).cos(),
                )
            },
        ];
        for state in states {
            let mut solver = held_beam::<f64>(Material {
                young_modulus,
                poisson_ratio,
                ..RUBBER
            });
            for p in 0..solver.particle_count() {
                solver.set_position(p, state(solver.position(p)));
            }
            let mut stars = stars(&solver);
            let mut correction = correction(&stars);
            let mut step = ImplicitStep::new(&mut solver, &mut stars, &falling(1)).unwrap();
            let start = step.potential();
            let mut last = start;
            for round in 0..20 {
                if round % 2 == 1 {
                    step.sweep();
                }
                let CoarseCorrectionReport { taken, .. } = step.correct(&mut correction);
                assert!((0.0..=1.0).contains(&taken));
                let now = step.potential();
                within("rise", now - last, 1e-10 * start.abs());
                last = now;
            }
        }
    }
}

/// The state after two frames of everything at once.
fn state<R: Real>(threads: usize) -> u64 {
    let mesh = kuhn_box([10, 10, 10], DVec3::ONE);
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.01, 6);
    let mut stars = stars(&solver);
    let mut correction =
        CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        for _ in 0..2 {
            solver
                .step_vbd_two_level(&mut stars, &mut correction, &everything())
                .unwrap();
        }
    });
    bits(&solver)
}

#[test]
fn threads_do_not_change_a_bit() {
    let [one, two, three] = [1, 2, 3].map(state::<f32>);
    assert_eq!((one, one), (two, three));
    let [one, two, three] = [1, 2, 3].map(state::<f64>);
    assert_eq!((one, one), (two, three));
}

fn all_survive<R: Real>() {
    for (what, (mesh, material, time_step, prepare)) in cases::<R>() {
        let mut solver = body::<R>(&mesh, material);
        prepare(&mut solver);
        let mut stars = stars(&solver);
        let mut correction = CoarseCorrection::new(&stars, SMALL).unwrap();
        let mut settings = VbdSettings::new(time_step, 2);
        settings.step.gravity = Some(GRAVITY);
        settings.step.colliders = vec![Collider::ground(-1.0, 0.5)];
        for _ in 0..5 {
            solver
                .step_vbd_two_level(&mut stars, &mut correction, &settings)
                .unwrap();
        }
        assert_finite(&solver, &what);
    }
}

#[test]
fn corrections_stay_finite_in_single_precision() {
    all_survive::<f32>();
}

#[test]
fn corrections_stay_finite_in_double_precision() {
    all_survive::<f64>();
}

/// A body that lies on the ground keeps above it and comes to rest.
#[test]
fn the_ground_holds_under_corrections() {
    let mesh = kuhn_box([3, 3, 3], DVec3::splat(0.3));
    let mut solver = body::<f64>(&mesh, RUBBER);
    let mut stars = stars(&solver);
    let mut correction = CoarseCorrection::new(&stars, SMALL).unwrap();
    let mut settings = falling(6);
    settings.step.colliders = vec![Collider::ground(-0.02, 0.5)];
    for _ in 0..120 {
        solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
        assert!(positions(&solver).iter().all(|x| x.z >= -0.02));
    }
    within("speed", solver.max_speed(), 1e-2);
    within(
        "volume",
        (solver.volume().total / solver.volume().rest - 1.0).abs(),
        0.01,
    );
}

/// A stiff body that falls on the ground on an edge, with too few rounds to converge, never has more energy after a frame
/// than before, friction or not. Rounding of single precision: 1e-4 of the first energy.
fn an_impact_adds_no_energy<R: Real>(tolerance: f64) {
    for (poisson_ratio, friction) in [(0.3, 0.0), (0.3, 0.5), (0.49, 0.0), (0.49, 0.5)] {
        let mut mesh = kuhn_box([8, 4, 4], dvec3(0.1, 0.05, 0.05));
        let tilt = DQuat::from_euler(EulerRot::XYZ, 0.4, 0.3, 0.2);
        for x in &mut mesh.positions {
            *x = tilt * *x;
        }
        let stiff = Material {
            young_modulus: 1e8,
            poisson_ratio,
            ..RUBBER
        };
        let mut solver = body::<R>(&mesh, stiff);
        for p in 0..solver.particle_count() {
            solver.set_velocity(p, dvec3(0.3, 0.0, -1.8));
        }
        let mut stars = stars(&solver);
        let mut correction = correction(&stars);
        let mut settings = VbdSettings::new(0.01, 20);
        settings.step.gravity = Some(GRAVITY);
        settings.guess = Guess::Adaptive;
        settings.accuracy = Some(0.05);
        settings.step.colliders = vec![Collider::ground(-0.08, friction)];
        let energy = |solver: &Solver<R>| {
            let energy = solver.energy(Some(GRAVITY));
            energy.kinetic + energy.elastic + energy.gravity
        };
        let first = solver.energy(None).kinetic;
        for frame in 0..60 {
            let before = energy(&solver);
            solver
                .step_vbd_two_level(&mut stars, &mut correction, &settings)
                .unwrap();
            let gain = (energy(&solver) - before) / first;
            assert!(
                gain < tolerance,
                "{poisson_ratio} {friction} {frame}: {gain}"
            );
        }
        assert!(solver.max_speed() < 0.5, "it has come to rest");
    }
}

#[test]
fn an_impact_adds_no_energy_in_double_precision() {
    an_impact_adds_no_energy::<f64>(1e-9);
}

#[test]
fn an_impact_adds_no_energy_in_single_precision() {
    an_impact_adds_no_energy::<f32>(1e-4);
}

/// Two bodies that share no particle, one disturbed: the other does not feel it, though one correction serves both.
#[test]
fn separate_pieces_are_not_coupled() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let count = u32::try_from(mesh.positions.len()).unwrap();
    let far: Vec<DVec3> = mesh.positions.iter().map(|x| *x + DVec3::X).collect();
    let mut solver = Solver::<f64>::new(&[mesh.positions.clone(), far].concat());
    solver.add_material(RUBBER).unwrap();
    for shift in [0, count] {
        for (t, tet) in mesh.tets.iter().enumerate() {
            let rest = mesh.corners(incise_mesh::TetId::new(t));
            solver.push_tet(tet.map(|p| p.0 + shift), rest, 0);
        }
    }
    for p in 0..solver.particle_count() {
        solver.set_mass(p, 0.3);
        if p >= count as usize {
            solver.set_velocity(p, DVec3::new(0.0, solver.position(p).x - 1.15, 0.3));
        }
    }
    let mut stars = stars(&solver);
    let mut correction = CoarseCorrection::new(&stars, SMALL).unwrap();
    for _ in 0..5 {
        solver
            .step_vbd_two_level(&mut stars, &mut correction, &VbdSettings::new(0.01, 3))
            .unwrap();
    }
    for p in 0..count as usize {
        within("the piece at rest", solver.velocity(p).length(), 1e-9);
    }
    assert!(solver.max_speed() > 0.1);
}

#[test]
fn bad_settings_are_refused() {
    let stars = stars(&held_beam::<f32>(RUBBER));
    for (name, settings) in [
        (
            "iterations",
            CoarseCorrectionSettings {
                iterations: 0,
                ..SMALL
            },
        ),
        (
            "reduction",
            CoarseCorrectionSettings {
                reduction: 1.0,
                ..SMALL
            },
        ),
        (
            "reduction",
            CoarseCorrectionSettings {
                reduction: f64::NAN,
                ..SMALL
            },
        ),
        (
            "aggregate",
            CoarseCorrectionSettings {
                aggregate: 0,
                ..SMALL
            },
        ),
    ] {
        let error = CoarseCorrection::new(&stars, settings).unwrap_err();
        assert!(
            matches!(error, XpbdError::Setting { what, .. } if what == name),
            "{error}"
        );
    }
}
