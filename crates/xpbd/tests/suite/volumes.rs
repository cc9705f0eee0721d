//! Volume constraints against closed forms, and through the edits of a cut.

use glam::{DVec3, dvec3};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetId, TetMesh, kuhn_box};
use incise_xpbd::{
    Collider, ColliderShape, Material, Real, Solver, StepSettings, VolumeConstraint, XpbdError,
};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, RUBBER, body, disturb, plain, positions, schedule, within};

const REST: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

fn one() -> Schedule {
    Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]))
}

fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

/// One constraint per tet of a mesh.
fn constraints(mesh: &TetMesh, compliance: f64) -> Vec<VolumeConstraint> {
    (0..mesh.tets.len())
        .map(|t| {
            let rest = mesh.corners(TetId::new(t));
            VolumeConstraint::of_tet(mesh.tets[t].map(|p| p.0), rest, compliance)
        })
        .collect()
}

/// A weight on a corner above three that stay, held up by volume alone: the tet is lower by weight over stiffness. The
/// volume is `(h - s) / 6` at area 1/2, so the force is `dE/ds = (s / h) V₀ / (α h)`, with `h = 1` and `V₀ = 1/6`.
fn carries<R: Real>(tolerance: f64) {
    for (compliance, iterations) in [(1e-4, 1), (1e-4, 5), (0.0, 1)] {
        let mut solver = Solver::<R>::new(&REST);
        solver.set_mass(3, 1.0);
        let constraint = VolumeConstraint::of_tet([0, 1, 2, 3], REST, compliance);
        solver.set_volumes(&[constraint], one()).unwrap();
        let lower = DVec3::Z * (1.0 + GRAVITY.z * 6.0 * compliance);
        solver.set_position(3, lower);
        let settings = StepSettings {
            substeps: 3,
            iterations,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.01)
        };
        for _ in 0..100 {
            solver.step(&Schedule::default(), &settings).unwrap();
            within("height", solver.position(3).distance(lower), tolerance);
        }
    }
}

/// Balance solves the equations of a substep, so only rounding remains.
#[test]
fn a_tet_carries_a_weight_by_its_volume() {
    carries::<f64>(1e-12);
    carries::<f32>(2e-6);
}

/// A block between a floor and a lid that comes down: it keeps its volume, which without the constraints it does not.
fn squeezed(compliance: Option<f64>) -> f64 {
    let mesh = kuhn_box([3, 3, 3], DVec3::splat(0.3));
    let soft = Material {
        young_modulus: 1e4,
        poisson_ratio: 0.2,
        damping: 5e-3,
        ..RUBBER
    };
    let mut solver = body::<f64>(&mesh, soft);
    let order = plain(&mesh);
    if let Some(compliance) = compliance {
        let list = constraints(&mesh, compliance);
        solver.set_volumes(&list, order.clone()).unwrap();
        assert_eq!(solver.volume_count(), list.len());
    }
    let lid = Collider {
        velocity: DVec3::NEG_Z * 0.1,
        ..Collider::new(ColliderShape::Plane {
            point: DVec3::Z * 0.3,
            normal: DVec3::NEG_Z,
        })
    };
    let mut settings = StepSettings {
        substeps: 20,
        colliders: vec![Collider::ground(0.0, 0.0), lid],
        ..StepSettings::new(0.01)
    };
    // Down by a quarter, then wait.
    for frame in 0..150 {
        if frame == 75 {
            settings.colliders[1].velocity = DVec3::ZERO;
        }
        solver.step(&order, &settings).unwrap();
        settings.colliders[1] = settings.colliders[1].moved(0.01);
    }
    let top = positions(&solver).iter().map(|x| x.z).fold(0.0, f64::max);
    assert!(top <= 0.225 + 1e-12, "{top}");
    assert_eq!(solver.volume().inverted, 0);
    let volume = solver.volume();
    volume.total / volume.rest - 1.0
}

/// Poisson's ratio 0.2 loses 1 - 0.75 · 1.25^0.4 = 18 % at small strains, about as much at these. Constraints of no
/// compliance keep the volume of each tet to the accuracy of one pass a substep.
#[test]
fn volume_is_kept_under_pressure() {
    let free = squeezed(None);
    assert!(free < -0.1, "{free}");
    within("volume", squeezed(Some(0.0)).abs(), 2e-3);
    // A bulk modulus ten times that of the material, E / 3(1 - 2ν) = 5.6 kPa, leaves about a tenth of the loss.
    let stiff = squeezed(Some(1.0 / 55e3));
    assert!(stiff < -0.005 && stiff > -0.04, "{stiff}");
}

/// At rest the constraints agree with the material: nothing moves.
#[test]
fn a_body_at_rest_stays_at_rest() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    for compliance in [0.0, 1e-6] {
        let mut solver = body::<f64>(&mesh, RUBBER);
        let order = plain(&mesh);
        let list = constraints(&mesh, compliance);
        solver.set_volumes(&list, order.clone()).unwrap();
        for _ in 0..100 {
            solver.step(&order, &StepSettings::new(5e-4)).unwrap();
        }
        for (x, rest) in positions(&solver).iter().zip(&mesh.positions) {
            within("way", x.distance(*rest), 1e-12);
        }
    }
}

/// Momentum is kept, also with masses a million apart.
#[test]
fn momentum_is_kept() {
    let mut solver = Solver::<f64>::new(&REST);
    let masses = [1e-3, 1.0, 1e3, 1.0];
    let mut noise = Noise(12);
    for (p, mass) in masses.into_iter().enumerate() {
        solver.set_mass(p, mass);
        solver.set_velocity(p, noise.vector());
    }
    let constraint = VolumeConstraint {
        damping: 0.01,
        ..VolumeConstraint::of_tet([0, 1, 2, 3], REST, 1e-4)
    };
    solver.set_volumes(&[constraint], one()).unwrap();
    let momentum = |s: &Solver<f64>| -> DVec3 { (0..4).map(|p| s.velocity(p) * masses[p]).sum() };
    let before = momentum(&solver);
    let settings = StepSettings {
        substeps: 10,
        iterations: 2,
        ..StepSettings::new(0.01)
    };
    for _ in 0..100 {
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    // Rounding of a position costs 1e-16 m times 1000 kg over 1e-3 s in each of 1000 substeps; they move by meters.
    within("momentum", momentum(&solver).distance(before), 1e-6);
}

/// A cut by hand: a tet is replaced by a child, another child appended, one relinked to a copy; each keeps its volume.
#[test]
fn constraints_follow_a_cut() {
    let mut solver = Solver::<f64>::new(&REST);
    let whole = VolumeConstraint::of_tet([0, 1, 2, 3], REST, 0.0);
    solver.set_volumes(&[whole], one()).unwrap();
    solver.push_particle_between(2, 3, 0.5);
    let middle = (REST[2] + REST[3]) / 2.0;
    let [a, b, c, d] = REST;
    let children = [
        ([0, 1, 2, 4], [a, b, c, middle]),
        ([0, 1, 4, 3], [a, b, middle, d]),
    ];
    for (place, (particles, rest)) in children.into_iter().enumerate() {
        let child = VolumeConstraint::of_tet(particles, rest, 0.0);
        solver.put_volume(place, child).unwrap();
    }
    // The upper child separates: it gets copies of what it shares.
    for p in [0, 1, 4] {
        solver.push_copy(p);
    }
    solver.relink_volume(1, [5, 6, 7, 3]);
    solver.reschedule_volumes(&Schedule::new(
        &Clustering::none(2),
        &Coloring::new(vec![ColorId(0); 2]),
    ));
    assert_eq!(solver.volume_count(), 2);
    for p in 0..8 {
        solver.set_mass(p, 1.0);
    }
    disturb(&mut solver, 0.05, 2);
    let settings = StepSettings {
        iterations: 10,
        ..StepSettings::new(0.01)
    };
    solver.step(&Schedule::default(), &settings).unwrap();
    for (particles, rest) in [([0, 1, 2, 4], children[0].1), ([5, 6, 7, 3], children[1].1)] {
        let now = volume(particles.map(|p| solver.position(p)));
        within("volume", (now - volume(rest)).abs(), 1e-12);
    }
    let bad = VolumeConstraint {
        compliance: -1.0,
        ..whole
    };
    assert!(matches!(
        solver.put_volume(0, bad),
        Err(XpbdError::Constraint {
            index: 0,
            what: "compliance",
            ..
        })
    ));
}

#[test]
#[should_panic(expected = "the schedule belongs to these volume constraints")]
fn a_foreign_schedule_is_refused() {
    let mut solver = Solver::<f64>::new(&REST);
    let whole = VolumeConstraint::of_tet([0, 1, 2, 3], REST, 0.0);
    solver.set_volumes(&[whole], one()).unwrap();
    let two = Coloring::new(vec![ColorId(0); 2]);
    solver.reschedule_volumes(&Schedule::new(&Clustering::none(2), &two));
}

#[test]
fn bad_constraints_are_refused_by_name() {
    let good = VolumeConstraint::of_tet([0, 1, 2, 3], REST, 0.0);
    let mut solver = Solver::<f64>::new(&REST);
    for bad in [f64::NAN, f64::INFINITY] {
        for (name, constraint) in [
            (
                "rest_volume",
                VolumeConstraint {
                    rest_volume: bad,
                    ..good
                },
            ),
            (
                "compliance",
                VolumeConstraint {
                    compliance: bad,
                    ..good
                },
            ),
            (
                "damping",
                VolumeConstraint {
                    damping: bad,
                    ..good
                },
            ),
        ] {
            let error = solver.set_volumes(&[constraint], one()).unwrap_err();
            let XpbdError::Constraint { what, .. } = error else {
                panic!("{error}");
            };
            assert_eq!(what, name);
        }
    }
    assert_eq!(solver.volume_count(), 0);
}

/// Tets without a volume at rest take no part.
#[test]
fn a_sliver_takes_no_part() {
    let mut solver = Solver::<f32>::new(&REST);
    (0..4).for_each(|p| solver.set_mass(p, 1.0));
    for rest_volume in [0.0, -1.0, 1e-300] {
        let sliver = VolumeConstraint {
            rest_volume,
            ..VolumeConstraint::of_tet([0, 1, 2, 3], REST, 0.0)
        };
        solver.set_volumes(&[sliver], one()).unwrap();
        solver
            .step(&Schedule::default(), &StepSettings::new(0.01))
            .unwrap();
        assert_eq!(positions(&solver), REST);
    }
}

fn state<R: Real>(threads: usize, iterations: u32) -> Vec<DVec3> {
    let mesh = kuhn_box([14, 14, 14], DVec3::ONE);
    let order = schedule(&mesh, "greedy", "serial:5");
    assert!((0..order.color_count()).any(|c| order.color_constraints(c).count() > 512));
    let mut solver = body::<R>(&mesh, RUBBER);
    disturb(&mut solver, 0.005, 6);
    let mut list = constraints(&mesh, 1e-7);
    list[0].damping = 1e-3;
    solver.set_volumes(&list, order.clone()).unwrap();
    let settings = StepSettings {
        iterations,
        ..StepSettings::new(1e-3)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(|| {
        for _ in 0..3 {
            solver.step(&order, &settings).unwrap();
        }
    });
    positions(&solver)
}

#[test]
fn threads_do_not_change_a_bit() {
    for iterations in [1, 2] {
        let one = state::<f32>(1, iterations);
        assert!(one == state::<f32>(2, iterations) && one == state::<f32>(3, iterations));
    }
    assert!(state::<f64>(1, 2) == state::<f64>(3, 2));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Anything finite at all, in single precision.
    #[test]
    fn any_constraint_leaves_any_particle_finite(
        particles in prop::array::uniform4((prop::array::uniform3(-1.0..1.0f64), -45..37i32, -300..300i32)),
        rest_volume in (-3.0..10.0f64, -300..300i32),
        compliance in prop_oneof![Just(0.0), (-300..300i32).prop_map(|e| 10f64.powi(e))],
        damping in prop_oneof![Just(0.0), (-10..10i32).prop_map(|e| 10f64.powi(e))],
        iterations in 1..4u32,
    ) {
        let at = particles.map(|(x, size, _)| DVec3::from_array(x) * 10f64.powi(size));
        let mut solver = Solver::<f32>::new(&at);
        for (p, (_, _, mass)) in particles.iter().enumerate() {
            solver.set_mass(p, 10f64.powi(*mass));
        }
        let constraint = VolumeConstraint {
            particles: [0, 1, 2, 3],
            rest_volume: rest_volume.0 * 10f64.powi(rest_volume.1),
            compliance,
            damping,
        };
        solver.set_volumes(&[constraint], one()).unwrap();
        let settings = StepSettings {
            substeps: 2,
            iterations,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.1)
        };
        for _ in 0..3 {
            solver.step(&Schedule::default(), &settings).unwrap();
        }
        for p in 0..4 {
            prop_assert!(solver.position(p).is_finite() && solver.velocity(p).is_finite());
        }
    }
}
