//! Forces on handles, colliders and fixed particles: by closed forms, and by the momentum that they must account for.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Collider, ColliderShape, ContactLaw,
    DistanceConstraint, EdgePoint, FaceContact, Force, Forces, Integrator, Material, Method, Pose,
    Real, SolidBlade, Solver, StepSettings, TetSolve, VbdSettings, VertexStars, VolumeConstraint,
    XpbdError,
};

use crate::body::{
    GRAVITY, KineticDamping, RUBBER, advance, body, disturb, plain, positions, within,
};
use crate::vbd::stars;

/// The sum of all forces on what holds the bodies, in N.
fn total(forces: &Forces) -> DVec3 {
    let handles = forces.handles.iter().chain(&forces.colliders);
    let fixed = forces.fixed.iter().map(|&(_, force)| force);
    handles.map(|f| f.force).chain(fixed).sum()
}

/// Momentum in kg·m/s with that of held particles.
fn momentum<R: Real>(solver: &Solver<R>) -> DVec3 {
    let all = 0..solver.particle_count();
    all.map(|p| solver.velocity(p) * solver.mass(p)).sum()
}

fn mass<R: Real>(solver: &Solver<R>) -> f64 {
    (0..solver.particle_count()).map(|p| solver.mass(p)).sum()
}

fn one_by_one(constraints: usize) -> Schedule {
    let colors = (0u32..).take(constraints).map(ColorId).collect();
    Schedule::new(&Clustering::none(constraints), &Coloring::new(colors))
}

/// A beam with one end fixed, the other on a moving handle, and everything in between that a solver knows: a spring to
/// a handle, distances and volumes at held and free particles.
fn crowded<R: Real>() -> (TetMesh, Solver<R>) {
    let mesh = kuhn_box([5, 2, 2], dvec3(0.5, 0.2, 0.2));
    let mut solver = body::<R>(
        &mesh,
        Material {
            damping: 0.01,
            ..RUBBER
        },
    );
    disturb(&mut solver, 0.002, 5);
    let rigid = solver.add_handle(Pose::at(dvec3(0.5, 0.1, 0.1)));
    let soft = solver.add_handle(Pose::at(dvec3(0.25, 0.1, 0.2)));
    let (mut fixed, mut held, mut middle) = (Vec::new(), Vec::new(), Vec::new());
    for (p, x) in mesh.positions.iter().enumerate() {
        if x.x < 0.01 {
            solver.set_fixed(p, true);
            fixed.push(u32::try_from(p).unwrap());
        } else if x.x > 0.49 {
            solver.attach(p, rigid, 0.0, 0.0).unwrap();
            held.push(u32::try_from(p).unwrap());
        } else {
            middle.push(u32::try_from(p).unwrap());
            if x.z > 0.19 {
                solver.attach(p, soft, 1e-4, 0.01).unwrap();
            }
        }
    }
    let distance = |a: u32, b: u32, length: f64| DistanceConstraint {
        particles: [a, b],
        length,
        compliance: 1e-5,
        damping: 0.01,
        tension_only: false,
    };
    let distances = [
        distance(fixed[0], middle[0], 0.3),
        distance(held[0], middle[1], 0.1),
        distance(middle[2], middle[3], 0.05),
    ];
    solver.set_distances(&distances, one_by_one(3)).unwrap();
    let corners = mesh.tets[0].map(|p| p.0);
    let rest = corners.map(|p| mesh.positions[p as usize]);
    let volume = VolumeConstraint::of_tet(corners, rest, 1e-3);
    solver.set_volumes(&[volume], one_by_one(1)).unwrap();
    (mesh, solver)
}

/// Where a floor with friction presses into the beam from below.
fn pressed(substeps: u32) -> StepSettings {
    let floor = Collider {
        friction: 0.4,
        velocity: dvec3(0.1, 0.0, 0.05),
        ..Collider::ground(0.004, 0.4)
    };
    let ball = Collider::new(ColliderShape::Sphere {
        center: dvec3(0.2, -0.005, 0.1),
        radius: 0.03,
    });
    StepSettings {
        substeps,
        gravity: Some(GRAVITY),
        colliders: vec![floor, ball],
        ..StepSettings::new(0.01)
    }
}

/// Moves both handles of [`crowded`] in frame `frame`.
fn drag<R: Real>(solver: &mut Solver<R>, frame: u32) {
    let way = f64::from(frame + 1) * 1e-3;
    solver.move_handle(0, Pose::at(dvec3(0.5 + way, 0.1, 0.1 - way)));
    solver.move_handle(1, Pose::at(dvec3(0.25, 0.1 + 2.0 * way, 0.2)));
}

/// The momentum changes by gravity minus the measured forces. Returns the largest difference of a frame, as a part of
/// the forces.
fn imbalance<R: Real>(
    solver: &mut Solver<R>,
    settings: &StepSettings,
    frames: u32,
    mut step: impl FnMut(&mut Solver<R>),
) -> f64 {
    let mut worst = 0.0_f64;
    let weight = GRAVITY * mass(solver);
    solver.measure_forces(true);
    for frame in 0..frames {
        drag(solver, frame);
        let before = momentum(solver);
        step(solver);
        let forces = solver.forces().unwrap();
        let mut all = forces.handles.iter().chain(&forces.colliders);
        assert!(all.any(|f| f.force.length() > 0.1), "{forces:?}");
        let change = (momentum(solver) - before) / settings.time_step;
        let size: f64 = forces.handles.iter().map(|f| f.force.length()).sum();
        worst = worst.max((change - weight + total(&forces)).length() / size);
    }
    worst
}

/// Third law, exactly: every impulse is counted once, for all forms, iterations and kinds of constraints. Rounding in
/// double precision leaves 1e-12.
#[test]
fn momentum_changes_by_gravity_and_the_measured_forces() {
    for tet_solve in [TetSolve::Split, TetSolve::Block, TetSolve::Sequential] {
        for (method, iterations, relaxation) in [
            (Method::GaussSeidel, 1, 1.0),
            (Method::GaussSeidel, 3, 0.8),
            (Method::Jacobi, 2, 0.1),
        ] {
            let (mesh, mut solver) = crowded::<f64>();
            let schedule = plain(&mesh);
            let settings = StepSettings {
                tet_solve,
                method,
                iterations,
                relaxation,
                ..pressed(20)
            };
            let first = {
                let mut solver = solver.clone();
                solver.measure_forces(true);
                advance(&mut solver, &schedule, &settings, 1);
                solver.forces().unwrap()
            };
            let mut all = first.handles.iter().chain(&first.colliders);
            assert!(all.all(|f| f.force.length() > 0.1), "{first:?}");
            let worst = imbalance(&mut solver, &settings, 4, |solver| {
                advance(solver, &schedule, &settings, 1);
            });
            within(&format!("{tet_solve:?} {method:?}"), worst, 1e-9);
        }
    }
}

/// In single precision it is the last digits of positions over the substep that are left.
#[test]
fn single_precision_measures_the_forces_of_double_precision() {
    fn forces<R: Real>() -> Forces {
        let (mesh, mut solver) = crowded::<R>();
        solver.measure_forces(true);
        for frame in 0..3 {
            drag(&mut solver, frame);
            advance(&mut solver, &plain(&mesh), &pressed(10), 1);
        }
        solver.forces().unwrap()
    }
    let (single, double) = (forces::<f32>(), forces::<f64>());
    let size = double.handles[0].force.length();
    let lists = |f: &Forces| [f.handles.clone(), f.colliders.clone()].concat();
    for (a, b) in lists(&single).iter().zip(lists(&double)) {
        within("force", (a.force - b.force).length(), 2e-3 * size);
        within("torque", (a.torque - b.torque).length(), 2e-3 * size);
    }
    for (&(p, a), &(q, b)) in single.fixed.iter().zip(&double.fixed) {
        assert_eq!(p, q);
        within("fixed", (a - b).length(), 2e-3 * size);
    }
}

/// Measuring changes no bit, in any form, and what was measured does not depend on the number of threads.
#[test]
fn measuring_changes_no_bit() {
    let run = |measuring: bool, threads: usize, tet_solve, iterations| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let (mesh, mut solver) = crowded::<f32>();
            let settings = StepSettings {
                tet_solve,
                iterations,
                ..pressed(8)
            };
            solver.measure_forces(measuring);
            for frame in 0..5 {
                drag(&mut solver, frame);
                advance(&mut solver, &plain(&mesh), &settings, 1);
            }
            (positions(&solver), solver.forces())
        })
    };
    for tet_solve in [TetSolve::Split, TetSolve::Block, TetSolve::Sequential] {
        for iterations in [1, 2] {
            let (plain, none) = run(false, 1, tet_solve, iterations);
            assert_eq!(none, None);
            let (measured, forces) = run(true, 1, tet_solve, iterations);
            assert_eq!(measured, plain);
            assert_eq!(run(true, 3, tet_solve, iterations), (plain, forces));
        }
    }
}

/// Brings a body to rest and returns the forces then.
fn at_rest<R: Real>(solver: &mut Solver<R>, mesh: &TetMesh, settings: &StepSettings) -> Forces {
    let schedule = plain(mesh);
    let mut damping = KineticDamping::default();
    for _ in 0..600 {
        advance(solver, &schedule, settings, 1);
        damping.apply(solver);
    }
    solver.measure_forces(true);
    advance(solver, &schedule, settings, 1);
    solver.forces().unwrap()
}

fn rubber_block() -> TetMesh {
    kuhn_box([4, 2, 2], dvec3(0.2, 0.1, 0.1))
}

/// A cantilever: its holder bears the weight, and the weight times half its length as torque about the end. The tip
/// sinks, so the center of mass is nearer by 1%.
fn cantilever<R: Real>() {
    for is_fixed in [true, false] {
        let mesh = rubber_block();
        let mut solver = body::<R>(&mesh, RUBBER);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for (p, x) in mesh.positions.iter().enumerate() {
            if x.x == 0.0 {
                if is_fixed {
                    solver.set_fixed(p, true);
                } else {
                    solver.attach(p, handle, 0.0, 0.0).unwrap();
                }
            }
        }
        let settings = StepSettings {
            substeps: 20,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.01)
        };
        let forces = at_rest(&mut solver, &mesh, &settings);
        let force = if is_fixed {
            let mut sum = Force::default();
            for (p, force) in forces.fixed {
                sum.force += force;
                sum.torque += solver.position(p as usize).cross(force);
            }
            sum
        } else {
            assert!(forces.fixed.is_empty());
            forces.handles[0]
        };
        let weight = 9.81 * 1000.0 * 0.2 * 0.1 * 0.1;
        let error = force.force - DVec3::NEG_Z * weight;
        within("force", error.length(), 0.01 * weight);
        // The weight acts at the center of mass.
        let center: DVec3 = (0..solver.particle_count())
            .map(|p| solver.position(p) * solver.mass(p))
            .sum();
        let center = center / mass(&solver);
        let torque = center.cross(DVec3::NEG_Z * weight);
        within("lever", (center.x - 0.1).abs(), 0.002);
        within(
            "torque",
            (force.torque - torque).length(),
            0.01 * torque.length(),
        );
    }
}

#[test]
fn the_holder_of_a_cantilever_bears_weight_and_torque() {
    cantilever::<f32>();
    cantilever::<f64>();
}

/// A block at rest on a floor presses with its weight, and without torque about the point below its center.
#[test]
fn a_block_on_a_floor_presses_with_its_weight() {
    let mesh = rubber_block();
    let mut solver = body::<f64>(&mesh, RUBBER);
    let settings = StepSettings {
        substeps: 20,
        gravity: Some(GRAVITY),
        colliders: vec![Collider::ground(0.0, 0.3)],
        ..StepSettings::new(0.01)
    };
    let forces = at_rest(&mut solver, &mesh, &settings);
    let weight = 9.81 * 2.0;
    let error = forces.colliders[0].force - DVec3::NEG_Z * weight;
    within("force", error.length(), 0.01 * weight);
    let torque = forces.colliders[0].torque_about(dvec3(0.1, 0.05, 0.0));
    within("torque", torque.length(), 0.01 * weight * 0.1);
}

/// On an incline the floor bears the weight's parts: `m g sin` of it is friction, below the angle of friction all, above
/// it the coefficient times `m g cos`.
#[test]
fn an_incline_bears_the_parts_of_the_weight() {
    for (degrees, sticks) in [(15.0_f64, true), (40.0, false)] {
        let angle = degrees.to_radians();
        let mesh = rubber_block();
        let mut solver = body::<f64>(&mesh, RUBBER);
        let normal = dvec3(0.0, 0.0, 1.0);
        // Gravity is tilted in place of the floor.
        let gravity = dvec3(angle.sin(), 0.0, -angle.cos()) * 9.81;
        let settings = StepSettings {
            substeps: 20,
            gravity: Some(gravity),
            colliders: vec![Collider::ground(0.0, 0.5)],
            ..StepSettings::new(0.01)
        };
        let schedule = plain(&mesh);
        let mut damping = KineticDamping::default();
        for _ in 0..if sticks { 600 } else { 100 } {
            advance(&mut solver, &schedule, &settings, 1);
            if sticks {
                damping.apply(&mut solver);
            }
        }
        solver.measure_forces(true);
        // What slides also swings: the mean of many frames is what counts.
        let frames = if sticks { 1 } else { 100 };
        let mut force = DVec3::ZERO;
        for _ in 0..frames {
            advance(&mut solver, &schedule, &settings, 1);
            force += solver.forces().unwrap().colliders[0].force / f64::from(frames);
        }
        let weight = 2.0 * 9.81;
        let pressure = weight * angle.cos();
        let friction = if sticks {
            weight * angle.sin()
        } else {
            0.5 * pressure
        };
        within(
            "pressure",
            (-force.dot(normal) / pressure - 1.0).abs(),
            0.01,
        );
        within("friction", (force.x / friction - 1.0).abs(), 0.01);
    }
}

/// A spring of a handle pulls with its stiffness times its length: the other end hangs on a fixed particle.
#[test]
fn a_spring_pulls_with_stiffness_times_length() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::X]);
    solver.set_mass(1, 0.5);
    let rod = DistanceConstraint {
        particles: [0, 1],
        length: 1.0,
        compliance: 0.0,
        damping: 0.0,
        tension_only: false,
    };
    solver.set_mass(0, 0.1);
    solver.set_fixed(0, true);
    solver.set_distances(&[rod], one_by_one(1)).unwrap();
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.attach(1, handle, 1.0 / 200.0, 0.1).unwrap();
    solver.set_handle(handle, Pose::at(DVec3::X * 0.25));
    solver.measure_forces(true);
    let settings = StepSettings {
        substeps: 10,
        iterations: 20,
        ..StepSettings::new(0.01)
    };
    for _ in 0..100 {
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    let forces = solver.forces().unwrap();
    let expected = DVec3::NEG_X * 200.0 * 0.25;
    within(
        "spring",
        (forces.handles[0].force - expected).length(),
        1e-6,
    );
    within("rod", (forces.fixed[0].1 + expected).length(), 1e-6);
}

/// A bar without contraction across, pulled by a hundredth: both ends bear `E A ε`. At this strain the energy departs
/// from Hooke's law by about 1%.
#[test]
fn a_pulled_bar_bears_young_modulus_times_area_times_strain() {
    let mesh = kuhn_box([8, 2, 2], dvec3(0.4, 0.1, 0.1));
    let bar = Material {
        poisson_ratio: 0.0,
        damping: 0.02,
        ..RUBBER
    };
    let mut solver = body::<f64>(&mesh, bar);
    let ends = [0.0, 0.4].map(|_| solver.add_handle(Pose::at(DVec3::ZERO)));
    for (p, x) in mesh.positions.iter().enumerate() {
        for (end, at) in ends.into_iter().zip([0.0, 0.4]) {
            if (x.x - at).abs() < 1e-9 {
                solver.attach(p, end, 0.0, 0.0).unwrap();
            }
        }
    }
    solver.move_handle(ends[1], Pose::at(DVec3::X * 0.004));
    let settings = StepSettings {
        substeps: 20,
        ..StepSettings::new(0.01)
    };
    let forces = at_rest(&mut solver, &mesh, &settings);
    let expected = 1e6 * 0.01 * 0.01;
    for (handle, sign) in forces.handles.iter().zip([1.0, -1.0]) {
        let error = handle.force * sign - DVec3::X * expected;
        within("end", error.length(), 0.02 * expected);
    }
}

/// What a held corner of a contact is pressed by goes on to its holder: a weight lies on a fixed triangle.
#[test]
fn a_fixed_triangle_passes_a_contact_on() {
    let at = [dvec3(0.2, 0.3, 0.0), DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut solver = Solver::<f64>::new(&at);
    solver.set_mass(0, 2.0);
    for p in 1..4 {
        solver.set_mass(p, 1.0);
        solver.set_fixed(p, true);
    }
    let contact = FaceContact {
        particles: [0, 1, 2, 3],
        beyond: None,
        limit: None,
        thickness: 0.0,
    };
    let law = ContactLaw {
        friction: 0.0,
        recovery_time: 0.02,
    };
    let (none, one) = (Coloring::new(vec![]), Coloring::new(vec![ColorId(0)]));
    solver
        .set_contacts(&law, (&[], &none), (&[contact.into()], &one))
        .unwrap();
    solver.measure_forces(true);
    let settings = StepSettings {
        substeps: 4,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.016)
    };
    // The parts of a frame add up.
    for part in [0..1, 1..4] {
        solver
            .step_part(&Schedule::default(), &settings, part, false)
            .unwrap();
    }
    let forces = solver.forces().unwrap();
    let shares = [0.5, 0.2, 0.3];
    for (&(_, force), share) in forces.fixed.iter().zip(shares) {
        let expected = GRAVITY * (1.0 + 2.0 * share);
        within("corner", (force - expected).length(), 1e-9);
    }
}

fn correction<R: Real>(stars: &VertexStars<R>) -> CoarseCorrection<R> {
    CoarseCorrection::new(stars, CoarseCorrectionSettings::default()).unwrap()
}

/// VBD measures what XPBD does, by the balance of a converged substep.
#[test]
fn vbd_balances_where_it_converges() {
    let (_, mut solver) = crowded::<f64>();
    let mut settings = VbdSettings::new(0.01, 100);
    settings.step = StepSettings {
        iterations: 100,
        ..pressed(4)
    };
    let mut stars = stars(&solver);
    let mut correction = correction(&stars);
    let step = settings.step.clone();
    let mut drive = |solver: &mut Solver<f64>| {
        solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
    };
    // The first frame begins far from its solution and does not converge.
    drive(&mut solver);
    within("vbd", imbalance(&mut solver, &step, 5, drive), 1e-9);
}

/// At rest VBD's cantilever bears its weight, whatever the integrator. (In motion BDF2 gives the forces at the ends of its
/// substeps, whose mean is that of the frame only over several frames.)
#[test]
fn vbd_holds_the_weight_of_a_cantilever() {
    for integrator in [Integrator::ImplicitEuler, Integrator::Bdf2] {
        let mesh = rubber_block();
        let rubber = Material {
            damping: 0.05,
            ..RUBBER
        };
        let mut solver = body::<f64>(&mesh, rubber);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for (p, x) in mesh.positions.iter().enumerate() {
            if x.x == 0.0 {
                solver.attach(p, handle, 0.0, 0.0).unwrap();
            }
            if x.x > 0.19 {
                solver.attach(p, handle, 0.1, 0.0).unwrap();
            }
        }
        let mut settings = VbdSettings::new(0.02, 200);
        settings.integrator = integrator;
        settings.step.gravity = Some(GRAVITY);
        settings.tolerance = Some(1e-9);
        let mut stars = stars(&solver);
        let mut correction = correction(&stars);
        for _ in 0..60 {
            solver
                .step_vbd_two_level(&mut stars, &mut correction, &settings)
                .unwrap();
        }
        solver.measure_forces(true);
        solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
        let force = solver.forces().unwrap().handles[0].force;
        within(
            "weight",
            (force - GRAVITY * 2.0).length(),
            0.01 * 9.81 * 2.0,
        );
    }
}

#[test]
fn chebyshev_does_not_measure_forces() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    let settings = StepSettings {
        method: Method::Chebyshev {
            spectral_radius: 0.9,
            chebyshev_start: 2,
        },
        ..StepSettings::new(0.01)
    };
    let step = |solver: &mut Solver<f64>| solver.step(&Schedule::default(), &settings);
    step(&mut solver).unwrap();
    solver.measure_forces(true);
    let refused = step(&mut solver);
    assert!(
        matches!(refused, Err(XpbdError::ForceMethod { method }) if method == "chebyshev"),
        "{refused:?}"
    );
    solver.measure_forces(false);
    step(&mut solver).unwrap();
}

/// Two particles on springs at one place and a wedge of half angle α between them, the place a way s behind its edge:
/// without friction each goes straight onto its plane, by `s sin α`, and the blade is pressed back by `2 k s sin² α`.
#[test]
fn a_wedge_is_pressed_back_by_what_it_pushes_apart() {
    let (stiffness, angle, behind) = (50.0, 0.4_f64, 0.01);
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO; 2]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    for p in 0..2 {
        solver.set_mass(p, 0.01);
        solver.attach(p, handle, 1.0 / stiffness, 0.05).unwrap();
    }
    let edge = |x: f64| [dvec3(x, -0.1, 0.0), dvec3(x, 0.1, 0.0)];
    // Spring and blade are one after the other in an iteration; several agree.
    let settings = StepSettings {
        substeps: 10,
        iterations: 30,
        ..StepSettings::new(0.01)
    };
    solver.measure_forces(true);
    let mut x = -0.001;
    for _ in 0..400 {
        let next = (x + 0.001_f64).min(behind);
        let blade = SolidBlade {
            edge: [edge(x), edge(next)],
            front: dvec3(1.0, 0.5, 0.0),
            thickness: 0.1,
            wedge_angle: 2.0 * angle,
            height: 0.05,
            friction: 0.0,
            sides: vec![(0, true), (1, false)],
            toughness: 0.0,
            uncut: Vec::new(),
        };
        x = next;
        solver.set_blades(vec![blade]).unwrap();
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    let away = behind * angle.sin();
    let place = |sign: f64| dvec3(angle.sin(), 0.0, sign * angle.cos()) * away;
    // `edge × front` is -z.
    within(
        "positive",
        (solver.position(0) - place(-1.0)).length(),
        1e-9,
    );
    within("negative", (solver.position(1) - place(1.0)).length(), 1e-9);
    let forces = solver.forces().unwrap();
    let expected = DVec3::NEG_X * (2.0 * stiffness * away * angle.sin());
    within("blade", (forces.blades[0].force - expected).length(), 1e-9);
    within(
        "handle",
        (forces.handles[0].force + expected).length(),
        1e-9,
    );
    // Beside the edge, and farther behind it than the blade is high, particles are free.
    for shift in [dvec3(0.0, 0.3, 0.0), dvec3(0.1, 0.0, 0.0)] {
        let moved = edge(x).map(|end| end + shift);
        let blade = SolidBlade {
            edge: [moved; 2],
            front: DVec3::X,
            thickness: 0.1,
            wedge_angle: 2.0 * angle,
            height: 0.05,
            friction: 0.0,
            sides: vec![(0, true), (1, false)],
            toughness: 0.0,
            uncut: Vec::new(),
        };
        solver.set_blades(vec![blade]).unwrap();
        solver.step(&Schedule::default(), &settings).unwrap();
        assert_eq!(solver.forces().unwrap().blades, [Force::default()]);
    }
}

/// A blade that slides past a pressed particle drags it along by the coefficient of friction times the pressure.
#[test]
fn a_sliding_blade_drags_by_friction() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.set_mass(0, 0.01);
    solver.attach(0, handle, 1.0 / 50.0, 0.05).unwrap();
    let edge = |x: f64| [dvec3(x, -0.1, 0.0), dvec3(x, 0.1, 0.0)];
    // Spring and blade are one after the other in an iteration; several agree.
    let settings = StepSettings {
        substeps: 10,
        iterations: 30,
        ..StepSettings::new(0.01)
    };
    solver.measure_forces(true);
    for frame in 0..100 {
        let x = 0.1 + 1e-3 * f64::from(frame);
        let blade = SolidBlade {
            edge: [edge(x), edge(x + 1e-3)],
            front: DVec3::X,
            thickness: 0.02,
            wedge_angle: 1.0,
            height: 1.0,
            friction: 0.3,
            sides: vec![(0, true)],
            toughness: 0.0,
            uncut: Vec::new(),
        };
        solver.set_blades(vec![blade]).unwrap();
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    let force = solver.forces().unwrap().blades[0].force;
    // Half the thickness stretches the spring.
    within("pressure", (force.z - 50.0 * 0.01).abs(), 1e-6);
    within("friction", (force.x + 0.3 * force.z).abs(), 1e-6);
}

/// Tissue on springs gives before an edge until the springs pull by the toughness times the length of the edge; from there
/// on the edge passes at this force, and what is lost is the force times its way. A blade that goes back is free.
#[test]
fn an_edge_passes_at_the_toughness_times_its_length() {
    let (toughness, length, stiffness) = (40.0, 0.05, 25.0);
    let limit = toughness * length;
    for (iterations, held) in [(1, false), (20, false), (20, true)] {
        let mut solver = Solver::<f64>::new(&[DVec3::ZERO; 4]);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for p in 0..4 {
            solver.set_mass(p, 0.01);
            solver.attach(p, handle, 1.0 / stiffness, 0.05).unwrap();
        }
        if held {
            solver.set_fixed(0, true);
        }
        let edge = |x: f64| [dvec3(x, -0.1, 0.0), dvec3(x, 0.1, 0.0)];
        let settings = StepSettings {
            substeps: 20,
            iterations,
            ..StepSettings::new(0.01)
        };
        solver.measure_forces(true);
        let shares = [0.4, 0.3, 0.2, 0.1];
        // Force, work and place of the point after a frame.
        let mut frame = |from: f64, to: f64| {
            let blade = SolidBlade {
                edge: [edge(from), edge(to)],
                front: DVec3::X,
                thickness: 0.001,
                wedge_angle: 0.1,
                height: 0.05,
                friction: 0.0,
                sides: Vec::new(),
                toughness,
                uncut: vec![EdgePoint {
                    particles: [0, 1, 2, 3],
                    weights: shares,
                    along: 0.1,
                    length,
                }],
            };
            solver.set_blades(vec![blade]).unwrap();
            solver.step(&Schedule::default(), &settings).unwrap();
            let corners = shares.iter().enumerate();
            let x = corners.map(|(p, share)| solver.position(p).x * share);
            let x = x.sum::<f64>();
            let force = solver.forces().unwrap().blades[0].force;
            (force, solver.blade_work()[0], x)
        };
        let mut at = -0.01;
        let (mut driven, mut lost) = (0.0, 0.0);
        // Slowly: the springs stay in balance.
        let (mut gives, mut passes) = (0, 0);
        for number in 0..2000 {
            let to = at + 5e-5;
            let (force, work, x) = frame(at, to);
            driven -= force.x * (to - at);
            lost += work;
            at = to;
            assert!(
                force.x <= 0.0 && -force.x <= limit * (1.0 + 1e-12),
                "{force}"
            );
            assert_eq!([force.y, force.z], [0.0; 2]);
            if work < 1e-6 * limit * 5e-5 && at > 0.001 {
                assert!((x - at).abs() < 1e-9, "{number}: {x} {at}");
                gives += 1;
            } else if at > 0.001 && number > 1000 {
                assert!((force.x + limit).abs() < 1e-3 * limit, "{number}: {force}");
                assert!((work - limit * 5e-5).abs() < 0.02 * limit * 5e-5, "{work}");
                passes += 1;
            }
        }
        assert!(gives > 100 && passes > 100, "{gives} {passes}");
        assert!(lost > 0.0 && driven > lost, "{driven} {lost}");
        for _ in 0..10 {
            let (force, work, _) = frame(at, at - 0.1);
            assert_eq!((force, work), (DVec3::ZERO, 0.0));
            at -= 0.1;
        }
    }
}

#[test]
fn blades_are_refused_by_what_is_wrong_and_by_vbd() {
    let mut solver = body::<f64>(&rubber_block(), RUBBER);
    let good = SolidBlade {
        edge: [[DVec3::ZERO, DVec3::Y]; 2],
        front: DVec3::X,
        thickness: 0.01,
        wedge_angle: 0.5,
        height: 0.1,
        friction: 0.0,
        sides: vec![(0, true)],
        toughness: 0.0,
        uncut: Vec::new(),
    };
    solver.set_blades(vec![good.clone()]).unwrap();
    let mut settings = VbdSettings::new(0.01, 1);
    settings.step.gravity = Some(GRAVITY);
    let mut of_solver = stars(&solver);
    let refused = solver.step_vbd(&mut of_solver, &settings);
    assert!(matches!(refused, Err(XpbdError::BladeMethod { .. })));
    for bad in [
        SolidBlade {
            thickness: 0.0,
            ..good.clone()
        },
        SolidBlade {
            height: f64::NAN,
            ..good.clone()
        },
        SolidBlade {
            wedge_angle: 3.2,
            ..good.clone()
        },
        SolidBlade {
            friction: -0.1,
            ..good.clone()
        },
        SolidBlade {
            front: DVec3::Y,
            ..good.clone()
        },
        SolidBlade {
            sides: vec![(9999, true)],
            ..good.clone()
        },
        SolidBlade {
            toughness: -1.0,
            ..good.clone()
        },
        SolidBlade {
            uncut: vec![EdgePoint {
                particles: [0, 1, 2, 9999],
                weights: [0.25; 4],
                along: 0.0,
                length: 0.1,
            }],
            ..good.clone()
        },
        SolidBlade {
            uncut: vec![EdgePoint {
                particles: [0, 1, 2, 3],
                weights: [0.25; 4],
                along: f64::NAN,
                length: 0.1,
            }],
            ..good.clone()
        },
    ] {
        assert!(solver.set_blades(vec![bad.clone()]).is_err(), "{bad:?}");
    }
    solver.set_blades(Vec::new()).unwrap();
    solver.step_vbd(&mut of_solver, &settings).unwrap();
}
