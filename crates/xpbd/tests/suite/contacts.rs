//! Contacts against closed forms, conservation laws and a slow scalar oracle.

use glam::{DQuat, DVec3, dvec3};
use incise_coloring::{Order, greedy};
use incise_graph::{ColorId, Coloring, Incidence, Schedule};
use incise_xpbd::{
    ContactLaw, EdgeContact, FaceContact, FaceLimit, Method, PairContact, Real, Solver,
    StepSettings, SurfaceContact, VbdSettings, VertexStars, XpbdError,
};
use proptest::prelude::*;

use crate::body::{GRAVITY, Noise, positions, within};

/// No friction, overlaps part in 20 ms.
const SMOOTH: ContactLaw = ContactLaw {
    friction: 0.0,
    recovery_time: 0.02,
};

const NO_FACES: [FaceContact; 0] = [];

fn face(particles: [u32; 4]) -> FaceContact {
    FaceContact {
        particles,
        beyond: None,
        limit: None,
        thickness: 0.0,
    }
}

fn edges(particles: [u32; 4], normal: DVec3) -> EdgeContact {
    EdgeContact {
        particles,
        normal,
        thickness: 0.0,
    }
}

fn surfaces(contacts: &[impl Copy + Into<SurfaceContact>]) -> Vec<SurfaceContact> {
    contacts.iter().map(|&contact| contact.into()).collect()
}

fn pair(particles: [u32; 2], normal: DVec3) -> PairContact {
    PairContact { particles, normal }
}

/// Colors by first fit.
fn colors<const K: usize>(particles: usize, contacts: &[[u32; K]]) -> Coloring {
    let incidence = Incidence::from_constraints(particles, contacts.iter().copied()).unwrap();
    greedy(&incidence, Order::Natural)
}

fn set<R: Real>(
    solver: &mut Solver<R>,
    law: &ContactLaw,
    pairs: &[PairContact],
    faces: &[impl Copy + Into<SurfaceContact>],
) {
    let count = solver.particle_count();
    let faces = &surfaces(faces)[..];
    let of_pairs: Vec<[u32; 2]> = pairs.iter().map(|c| c.particles).collect();
    let of_faces: Vec<[u32; 4]> = faces.iter().map(SurfaceContact::particles).collect();
    let (of_pairs, of_faces) = (colors(count, &of_pairs), colors(count, &of_faces));
    solver
        .set_contacts(law, (pairs, &of_pairs), (faces, &of_faces))
        .unwrap();
    assert_eq!(solver.contact_counts(), [pairs.len(), faces.len()]);
}

fn step<R: Real>(solver: &mut Solver<R>, settings: &StepSettings) {
    let report = solver.step(&Schedule::default(), settings).unwrap();
    assert_eq!(report.repaired, 0);
}

fn momentum<R: Real>(solver: &Solver<R>) -> DVec3 {
    let all = 0..solver.particle_count();
    all.map(|p| solver.velocity(p) * solver.mass(p)).sum()
}

fn angular_momentum<R: Real>(solver: &Solver<R>) -> DVec3 {
    let all = 0..solver.particle_count();
    all.map(|p| {
        solver
            .position(p)
            .cross(solver.velocity(p) * solver.mass(p))
    })
    .sum()
}

/// Two particles that meet go on together with the momentum that they had: `(m₁ v₁ + m₂ v₂) / (m₁ + m₂)` along the
/// normal, and across it as before.
#[test]
fn a_pair_meets_without_bouncing() {
    for ratio in [1.0, 1e3, 1e-3] {
        let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::Z * 0.01]);
        solver.set_mass(0, 2.0);
        solver.set_mass(1, 2.0 * ratio);
        solver.set_velocity(0, dvec3(0.5, 0.0, 1.0));
        solver.set_velocity(1, dvec3(0.0, -0.25, -1.0));
        let before = momentum(&solver);
        set(
            &mut solver,
            &SMOOTH,
            &[pair([0, 1], DVec3::Z * 7.0)],
            &NO_FACES,
        );
        let settings = StepSettings {
            substeps: 4,
            ..StepSettings::new(0.01)
        };
        for _ in 0..10 {
            step(&mut solver, &settings);
        }
        let common = (1.0 - ratio) / (1.0 + ratio);
        within(
            "momentum",
            momentum(&solver).distance(before) / before.length(),
            1e-12,
        );
        within(
            "first",
            solver.velocity(0).distance(dvec3(0.5, 0.0, common)),
            1e-12,
        );
        within(
            "second",
            solver.velocity(1).distance(dvec3(0.0, -0.25, common)),
            1e-12,
        );
        let gap = solver.position(1).z - solver.position(0).z;
        within("overlap", gap.abs(), 1e-14);
    }
}

/// A vertex hits a free triangle of unequal masses. Linear momentum is kept to the rounding of positions over a substep,
/// 1e-16 m / 1e-3 s in each of 40. The force acts along the line from the foot to the vertex as they are predicted, so
/// that angular momentum changes by the impulse times what they slide in a substep, 1 m/s · 1e-3 s.
#[test]
fn a_vertex_on_a_free_triangle_keeps_momentum() {
    for friction in [0.0, 0.6] {
        let at = [
            dvec3(0.3, 0.25, 0.03),
            DVec3::ZERO,
            DVec3::X,
            dvec3(0.2, 1.1, 0.1),
        ];
        let mut solver = Solver::<f64>::new(&at);
        for (p, mass) in [0.7, 1.0, 3.0, 0.2].into_iter().enumerate() {
            solver.set_mass(p, mass);
            solver.set_velocity(p, dvec3(0.1, -0.2, 0.3) * (p as f64 + 0.5));
        }
        solver.set_velocity(0, dvec3(0.4, 0.1, -2.0));
        let (linear, angular) = (momentum(&solver), angular_momentum(&solver));
        let law = ContactLaw { friction, ..SMOOTH };
        set(&mut solver, &law, &[], &[face([0, 1, 2, 3])]);
        let settings = StepSettings {
            substeps: 10,
            ..StepSettings::new(0.01)
        };
        let mut impulse = 0.0;
        for _ in 0..4 {
            step(&mut solver, &settings);
            let contact = solver.contacts().next().unwrap();
            impulse += contact.pressure * settings.time_step;
            // The triangle turns by up to 5e-3 in a substep, so that a step along its normal misses by the square.
            within("overlap", contact.depth, 3e-5);
        }
        // That of 0.7 kg at more than 1 m/s against a triangle that gives way.
        assert!(impulse > 0.2, "{impulse}");
        within(
            "linear",
            momentum(&solver).distance(linear) / linear.length(),
            1e-12,
        );
        let change = angular_momentum(&solver).distance(angular) / angular.length();
        within("angular", change, 1e-3);
    }
}

/// Particles on a fixed slope of tan θ = 1/2: with `μ > tan θ` they stay, with less they slide by
/// `g (sin θ - μ cos θ) Δt² n (n + 1) / 2` in n substeps, which is the closed form of the scheme.
fn slope<R: Real>(tolerance: f64, of_pressure: f64) {
    for (friction, iterations) in [
        (0.0, 1),
        (0.2, 1),
        (0.2, 3),
        (0.48, 1),
        (0.49, 2),
        (0.51, 1),
        (0.52, 3),
    ] {
        let down = dvec3(2.0, 0.0, -1.0).normalize();
        let corners = [
            down * -3.0,
            down * 5.0 - DVec3::Y * 4.0,
            down * 5.0 + DVec3::Y * 4.0,
        ];
        let mut at = corners.to_vec();
        let count = 5;
        at.extend((0..count).map(|p| down * 0.1 * f64::from(p)));
        let mut solver = Solver::<R>::new(&at);
        let contacts: Vec<FaceContact> = (0..count).map(|p| face([3 + p, 0, 1, 2])).collect();
        for p in 0..count {
            solver.set_mass(3 + p as usize, 0.1 * f64::from(p + 1));
        }
        let law = ContactLaw { friction, ..SMOOTH };
        set(&mut solver, &law, &[], &contacts);
        let settings = StepSettings {
            substeps: 20,
            iterations,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.016)
        };
        let start = positions(&solver);
        let frames = 30;
        for _ in 0..frames {
            step(&mut solver, &settings);
        }
        let (sine, cosine) = (1.0 / 5f64.sqrt(), 2.0 / 5f64.sqrt());
        let along = (-GRAVITY.z * (sine - friction * cosine)).max(0.0);
        let n = f64::from(frames * 20);
        let way = along * (0.016f64 / 20.0).powi(2) * n * (n + 1.0) / 2.0;
        for (p, start) in start.iter().enumerate().skip(3) {
            let moved = solver.position(p) - start;
            within("way", moved.distance(down * way), tolerance);
        }
        for (p, contact) in solver.contacts().enumerate() {
            let weight = solver.mass(3 + p) * -GRAVITY.z;
            within(
                "pressure",
                (contact.pressure / (weight * cosine) - 1.0).abs(),
                of_pressure,
            );
        }
    }
}

/// In single precision positions of a meter are rounded by 6e-8 m, which over a substep is 7e-5 m/s; as a random walk of
/// 600 substeps that is 2e-3 m/s, over half a second. The pressure of a substep comes from a way of 6e-6 m.
#[test]
fn friction_is_coulombs_law() {
    slope::<f64>(1e-11, 1e-8);
    slope::<f32>(5e-3, 2e-2);
}

/// An overlap of 2 mm parts at its depth over the recovery time, no faster, and the contact is open after that time.
#[test]
fn an_overlap_parts_at_its_depth_over_the_recovery_time() {
    for (recovery_time, substeps) in [(0.02, 20), (0.1, 7), (1e-3, 40)] {
        let depth = 2e-3;
        let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::NEG_Z * depth]);
        solver.set_mass(0, 1.0);
        solver.set_mass(1, 4.0);
        let law = ContactLaw {
            recovery_time,
            ..SMOOTH
        };
        set(&mut solver, &law, &[pair([0, 1], DVec3::Z)], &NO_FACES);
        let settings = StepSettings {
            substeps,
            ..StepSettings::new(0.01)
        };
        let allowed = depth / recovery_time;
        let mut time = 0.0;
        while time < 3.0 * recovery_time {
            step(&mut solver, &settings);
            time += 0.01;
            let speed = solver.velocity(1).z - solver.velocity(0).z;
            within("speed", (speed / allowed - 1.0).abs(), 1e-9);
            let depth_now = depth - allowed * time;
            let contact = solver.contacts().next().unwrap();
            within("depth", (contact.depth - depth_now).abs(), 1e-12);
        }
    }
    // Without a recovery time it parts in the first substep.
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::NEG_Z * 1e-3]);
    (0..2).for_each(|p| solver.set_mass(p, 1.0));
    let law = ContactLaw {
        recovery_time: 0.0,
        ..SMOOTH
    };
    set(&mut solver, &law, &[pair([0, 1], DVec3::Z)], &NO_FACES);
    step(&mut solver, &StepSettings::new(1e-3));
    within(
        "depth",
        solver.contacts().next().unwrap().depth.abs(),
        1e-15,
    );
}

/// A particle under load that starts in overlap ends at the surface: the part that each substep keeps goes to 0, and
/// the load does not push it in.
#[test]
fn at_rest_no_overlap_is_left() {
    let at = [dvec3(0.2, 0.2, -1e-3), DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut solver = Solver::<f64>::new(&at);
    solver.set_mass(0, 3.0);
    set(&mut solver, &SMOOTH, &[], &[face([0, 1, 2, 3])]);
    let settings = StepSettings {
        substeps: 10,
        gravity: Some(GRAVITY),
        // Contacts are not scaled.
        relaxation: 0.3,
        ..StepSettings::new(0.016)
    };
    for _ in 0..120 {
        step(&mut solver, &settings);
    }
    let contact = solver.contacts().next().unwrap();
    within("depth", contact.depth.abs(), 1e-14);
    within("force", contact.force.distance(DVec3::Z * 3.0 * 9.81), 1e-9);
}

/// Parting an overlap moves no particle by more than four times the overlap, however light it is and however far from the
/// point of contact, and keeps momentum; the overlap parts all the same. Without the bound a corner with a share of 1%
/// moves by up to a hundred times the overlap.
#[test]
fn an_overlap_throws_no_light_particle() {
    let depth = 1e-3;
    let law = ContactLaw {
        recovery_time: 0.0,
        ..SMOOTH
    };
    let settings = StepSettings::new(1e-3);
    let light = [1e-9, 1e-6, 1e-3, 1.0];
    let heavy = [1.0, 1e3, f64::INFINITY];
    let mut bounded = 0;
    for (light, heavy) in light.into_iter().flat_map(|l| heavy.map(|h| (l, h))) {
        for share in [0.5, 0.1, 0.01, 1e-3, -0.2] {
            // Of a vertex and a triangle the third corner is light, of two edges the second end of the second.
            let (triangle, cross) = (
                [
                    dvec3(0.4 * (1.0 - share), share, -depth),
                    DVec3::ZERO,
                    DVec3::X,
                    DVec3::Y,
                ],
                [
                    dvec3(share, -0.4, -depth),
                    dvec3(share, 0.6, -depth),
                    DVec3::ZERO,
                    DVec3::X,
                ],
            );
            let on_triangle: SurfaceContact = face([0, 1, 2, 3]).into();
            let on_edge: SurfaceContact = edges([0, 1, 2, 3], DVec3::Z).into();
            for (at, contact) in [(triangle, on_triangle), (cross, on_edge)] {
                if share < 0.0 && contact == on_edge {
                    continue;
                }
                let mut solver = Solver::<f64>::new(&at);
                for (p, mass) in [heavy, heavy, heavy, light].into_iter().enumerate() {
                    // Particles without a mass are held.
                    if mass.is_finite() {
                        solver.set_mass(p, mass);
                    }
                }
                set(&mut solver, &law, &[], &[contact]);
                step(&mut solver, &settings);
                let moved = (0..4).map(|p| solver.position(p).distance(at[p]));
                let moved = moved.fold(0.0, f64::max) / depth;
                assert!(
                    moved < 4.0 + 1e-9,
                    "{moved} times the overlap: {light} {heavy} {share}"
                );
                bounded += usize::from(moved > 3.99);
                if heavy.is_finite() {
                    // Positions are rounded to 2e-16 m.
                    let allowed = (1e-9 * light * 4.0 * depth + 3.0 * heavy * 2.3e-16) / 1e-3;
                    within("momentum", momentum(&solver).length(), allowed);
                }
                let mut steps = 1;
                while solver.contacts().next().unwrap().depth > 1e-9 * depth && steps < 2000 {
                    step(&mut solver, &settings);
                    steps += 1;
                }
                assert!(steps < 2000, "still deep: {light} {heavy} {share}");
            }
        }
    }
    assert!(bounded > 20, "the bound acts in {bounded} cases");
}

/// A thickness is the distance that a particle comes to rest at, above the middle, an edge and a corner.
#[test]
fn a_thickness_is_kept() {
    for (x, y) in [(0.3, 0.3), (0.5, 0.0), (0.0, 0.0), (-0.1, 0.4)] {
        let at = [dvec3(x, y, 0.05), DVec3::ZERO, DVec3::X, DVec3::Y];
        let mut solver = Solver::<f64>::new(&at);
        solver.set_mass(0, 1.0);
        let contact = FaceContact {
            thickness: 0.01,
            ..face([0, 1, 2, 3])
        };
        set(&mut solver, &SMOOTH, &[], &[contact]);
        let settings = StepSettings {
            substeps: 5,
            gravity: Some(GRAVITY),
            ..StepSettings::new(0.016)
        };
        for _ in 0..60 {
            step(&mut solver, &settings);
        }
        within(
            "height",
            (solver.position(0) - dvec3(x, y, 0.01)).length(),
            1e-12,
        );
    }
}

/// The front of a block, x = 0, whose lower edge is on z = 0; the surface beyond is the bottom. Particle 0 is in front of
/// it at a height.
fn block(height: f64, beyond: bool, turn: DQuat) -> Solver<f64> {
    let at = [dvec3(0.05, 0.1, height), DVec3::NEG_Y, DVec3::Y, DVec3::Z];
    let mut solver = Solver::<f64>::new(&at.map(|x| turn * x));
    solver.set_mass(0, 1.0);
    let contact = FaceContact {
        // -z, from (0, 2, 0) and (0, 1, 1).
        beyond: beyond.then_some([0.5, -1.0, 0.0]),
        ..face([0, 1, 2, 3])
    };
    let law = ContactLaw {
        friction: 0.5,
        ..SMOOTH
    };
    set(&mut solver, &law, &[], &[contact]);
    solver
}

/// A vertex flies at the front of a block, turned by some rotation, at 1 m/s.
fn fly_at_a_block(height: f64, beyond: bool, turn: DQuat) -> (DVec3, DVec3) {
    let mut solver = block(height, beyond, turn);
    solver.set_velocity(0, turn * DVec3::NEG_X);
    let settings = StepSettings {
        substeps: 20,
        ..StepSettings::new(0.016)
    };
    for _ in 0..10 {
        step(&mut solver, &settings);
    }
    let back = turn.inverse();
    (back * solver.position(0), back * solver.velocity(0))
}

/// On its way down and out through the bottom, a vertex goes no deeper under the front than the slight overlap in which
/// the plane that takes less to satisfy is chosen, also if it leaves the bottom faster than an overlap parts.
#[test]
fn a_vertex_that_leaves_by_one_surface_is_held_by_the_other() {
    let mut solver = block(0.5, true, DQuat::IDENTITY);
    solver.set_velocity(0, dvec3(-100.0, 0.0, -200.0));
    let settings = StepSettings::new(8e-4);
    let mut fell = false;
    for _ in 0..40 {
        step(&mut solver, &settings);
        let at = solver.position(0);
        // 1% of the edge.
        assert!(at.x > -0.02 || at.z < 0.02, "{at}");
        fell |= at.z < 0.0;
    }
    assert!(fell, "it slides down the front");
}

/// What passes below the lower edge of a block is not caught by its front, also if it overlaps the bottom a little;
/// what is higher is stopped. Without the surface beyond, all is stopped.
#[test]
fn a_vertex_slides_past_a_convex_edge() {
    for turn in [
        DQuat::IDENTITY,
        DQuat::from_axis_angle(dvec3(0.48, 0.6, 0.64), 1.3),
    ] {
        for height in [0.0, -1e-3, 1e-12, 1e-6, 2e-5] {
            let (x, v) = fly_at_a_block(height, true, turn);
            within(
                "way",
                (x.x - (0.05 - 0.16)).abs(),
                3.0 * height.max(0.0) + 1e-12,
            );
            // The overlap with the bottom parts in the recovery time; friction acts on that.
            within(
                "fall",
                (v - DVec3::NEG_X).length(),
                2.0 * height.max(0.0) / 0.02 + 1e-12,
            );
        }
        let (x, v) = fly_at_a_block(0.3, true, turn);
        within(
            "stop",
            (x - dvec3(0.0, 0.1, 0.3)).length() + v.length(),
            1e-12,
        );
        let (x, _) = fly_at_a_block(1e-12, false, turn);
        within("caught", x.x.abs(), 1e-12);
    }
}

/// Pressed into the edge, a vertex is put onto the nearer one of both surfaces, and the force acts on the edge.
#[test]
fn a_vertex_on_an_edge_presses_on_the_edge() {
    let at = [dvec3(-0.01, 0.5, 2e-3), DVec3::NEG_Y, DVec3::Y, DVec3::Z];
    let mut solver = Solver::<f64>::new(&at);
    (0..4).for_each(|p| solver.set_mass(p, 1.0));
    let contact = FaceContact {
        beyond: Some([0.5, -1.0, 0.0]),
        ..face([0, 1, 2, 3])
    };
    set(&mut solver, &SMOOTH, &[], &[contact]);
    within(
        "depth",
        (solver.contacts().next().unwrap().depth - 2e-3).abs(),
        1e-15,
    );
    let law = ContactLaw {
        recovery_time: 0.0,
        ..SMOOTH
    };
    set(&mut solver, &law, &[], &[contact]);
    step(&mut solver, &StepSettings::new(1e-3));
    // Weights 1, 1/4 and 3/4 on particles of one mass: λ = depth / (1 + 1/16 + 9/16).
    let multiplier = 2e-3 / (1.0 + 1.0 / 16.0 + 9.0 / 16.0);
    for (p, share) in [-1.0, 0.25, 0.75, 0.0].into_iter().enumerate() {
        let moved = solver.position(p) - at[p];
        within("way", moved.distance(DVec3::Z * share * multiplier), 1e-15);
    }
}

/// A vertex below the plane of a triangle is held up to the limit and not past it, whatever the plane says.
#[test]
fn past_its_limit_a_contact_is_open() {
    // The edge from the first corner to the second is the x axis, the surface ends towards -y.
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let limit = FaceLimit {
        normal: [0.0, -1.0, 0.0],
        distance: 0.25,
    };
    for (y, limit, held) in [
        (-0.2, Some(limit), true),
        (
            -0.2,
            Some(FaceLimit {
                distance: 0.0,
                ..limit
            }),
            false,
        ),
        (-0.3, Some(limit), false),
        (-0.3, None, true),
        (
            0.3,
            Some(FaceLimit {
                distance: 0.0,
                ..limit
            }),
            true,
        ),
    ] {
        let at = [dvec3(0.3, y, 0.01), corners[0], corners[1], corners[2]];
        for iterations in [1, 3] {
            let mut solver = Solver::<f64>::new(&at);
            solver.set_mass(0, 1.0);
            let contact = FaceContact {
                limit,
                ..face([0, 1, 2, 3])
            };
            set(&mut solver, &SMOOTH, &[], &[contact]);
            let settings = StepSettings {
                substeps: 10,
                iterations,
                gravity: Some(GRAVITY),
                ..StepSettings::new(0.016)
            };
            for _ in 0..20 {
                step(&mut solver, &settings);
            }
            let z = solver.position(0).z;
            assert_eq!(z.abs() < 1e-12, held, "{z} at {y} with {limit:?}");
            let state = solver.contacts().next().unwrap();
            assert_eq!(state.pressure > 0.0, held);
            assert!(state.depth <= 1e-12, "past the limit nothing overlaps");
        }
    }
}

/// Two free edges that cross fly at each other: they stop, momentum and angular momentum stay, and the force acts where
/// they are closest.
#[test]
fn two_edges_meet_and_keep_momentum() {
    let at = [
        dvec3(-0.5, 0.1, 0.01),
        dvec3(1.0, 0.1, 0.01),
        dvec3(0.2, -1.0, 0.0),
        dvec3(0.2, 0.5, 0.0),
    ];
    let mut solver = Solver::<f64>::new(&at);
    (0..4).for_each(|p| solver.set_mass(p, 1.0 + p as f64));
    (0..2).for_each(|p| solver.set_velocity(p, dvec3(0.3, 0.0, -1.0)));
    set(&mut solver, &SMOOTH, &[], &[edges([0, 1, 2, 3], DVec3::Z)]);
    let before = (momentum(&solver), angular_momentum(&solver));
    let settings = StepSettings {
        substeps: 8,
        ..StepSettings::new(0.016)
    };
    for _ in 0..3 {
        step(&mut solver, &settings);
    }
    within("momentum", momentum(&solver).distance(before.0), 1e-12);
    let turned = angular_momentum(&solver).distance(before.1);
    // The normal is the given one, while the edges turn on after they have met.
    within("angular momentum", turned, 2e-3 * before.1.length());
    let contact = solver.contacts().next().unwrap();
    within("depth", contact.depth, 1e-12);
    assert_eq!((contact.vertex, contact.against), (0, 2));
    let [a, b] = [0, 1].map(|p| solver.position(p));
    let line = (b - a).normalize();
    let off = (contact.point - a).reject_from(line).length();
    within("point", off, 1e-12);
    assert!(contact.point.x > a.x && contact.point.x < b.x);
}

/// Edges touch between their ends only, on the side of their normal, and not if they are parallel, have no length or lie
/// in each other exactly.
#[test]
fn what_edges_do_not_touch() {
    let first = [dvec3(-1.0, 0.0, 0.0), dvec3(1.0, 0.0, 0.0)];
    let depth = 1e-3;
    let cases = [
        (
            "crossing",
            [dvec3(0.2, -1.0, depth), dvec3(0.2, 1.0, depth)],
            true,
        ),
        (
            "at an end",
            [dvec3(1.0, 0.0, depth), dvec3(1.0, 1.0, depth)],
            true,
        ),
        (
            "past an end",
            [dvec3(1.01, -1.0, depth), dvec3(1.01, 1.0, depth)],
            false,
        ),
        (
            "before its own",
            [dvec3(0.0, 0.1, depth), dvec3(0.0, 1.0, depth)],
            false,
        ),
        (
            "apart",
            [dvec3(0.2, -1.0, -depth), dvec3(0.2, 1.0, -depth)],
            false,
        ),
        (
            "exactly touching",
            [dvec3(0.2, -1.0, 0.0), dvec3(0.2, 1.0, 0.0)],
            false,
        ),
        (
            "parallel",
            [dvec3(-1.0, 0.0, depth), dvec3(1.0, 0.0, depth)],
            false,
        ),
        (
            "nearly parallel",
            [dvec3(-1.0, -0.004, depth), dvec3(1.0, 0.004, depth)],
            false,
        ),
        (
            "a point",
            [dvec3(0.2, 0.0, depth), dvec3(0.2, 0.0, depth)],
            false,
        ),
    ];
    for (name, second, touches) in cases {
        for iterations in [1, 3] {
            let at = [first[0], first[1], second[0], second[1]];
            let mut solver = Solver::<f64>::new(&at);
            (0..4).for_each(|p| solver.set_mass(p, 1.0));
            let law = ContactLaw {
                friction: 0.5,
                recovery_time: 0.0,
            };
            set(&mut solver, &law, &[], &[edges([0, 1, 2, 3], DVec3::Z)]);
            let settings = StepSettings {
                iterations,
                ..StepSettings::new(1e-3)
            };
            step(&mut solver, &settings);
            let moved = (0..4).any(|p| solver.position(p) != at[p]);
            assert_eq!(moved, touches, "{name}");
            let contact = solver.contacts().next().unwrap();
            assert_eq!(contact.pressure > 0.0, touches, "{name}");
            assert!(contact.depth < 1e-12, "{name}: {}", contact.depth);
        }
    }
}

/// What a contact pressed along one plane is taken back along that plane, also if another contact has moved the vertex
/// to where the other plane is the nearer one: the sum of what acted is nothing.
#[test]
fn an_impulse_is_taken_back_where_it_acted() {
    // A front that faces x with a bottom that faces -z, and a plate that drives the vertex down and against the front.
    let at = [
        dvec3(-0.01, 0.1, 0.02),
        DVec3::NEG_Y,
        DVec3::Y,
        DVec3::Z,
        dvec3(-3.0, -3.0, 0.25),
        dvec3(0.0, 3.0, -0.05),
        dvec3(3.0, -3.0, -0.35),
    ];
    let [a, b, c] = [at[4], at[5], at[6]];
    assert!((b - a).cross(c - a).z < 0.0);
    let contacts = [
        FaceContact {
            beyond: Some([0.5, -1.0, 0.0]),
            ..face([0, 1, 2, 3])
        },
        face([0, 4, 5, 6]),
    ];
    for friction in [0.0, 0.4] {
        let law = ContactLaw {
            friction,
            recovery_time: 0.0,
        };
        let mut solver = Solver::<f64>::new(&at);
        solver.set_mass(0, 1.0);
        set(&mut solver, &law, &[], &contacts);
        let settings = StepSettings {
            iterations: 6,
            ..StepSettings::new(1e-3)
        };
        step(&mut solver, &settings);
        let states: Vec<_> = solver.contacts().collect();
        assert_eq!(states[0].pressure, 0.0, "below the block it is free");
        let first = states[0].force.length();
        assert!(first < 1e-9 * states[1].pressure, "{first} N are left");
        assert!(states[1].pressure > 0.0 && solver.position(0).z < 0.0);
    }
}

/// Exactly closed contacts and those that open write nothing: every bit is that of a run without contacts. Vertices
/// are on a corner, an edge and a face of dyadic coordinates, and all move on together.
fn closed_contacts_are_silent<R: Real>() {
    let at = [
        DVec3::ZERO,
        DVec3::ZERO,
        DVec3::X,
        DVec3::Y,
        DVec3::X,
        dvec3(0.5, 0.0, 0.0),
        dvec3(0.25, 0.25, 0.0),
        dvec3(0.25, 0.5, 0.125),
    ];
    let run = |with: bool| {
        let mut solver = Solver::<R>::new(&at);
        for p in 0..at.len() {
            solver.set_mass(p, 1.0 + p as f64 / 7.0);
            solver.set_velocity(p, dvec3(0.3, -0.7, 0.11));
        }
        // What parts is not held back.
        solver.set_velocity(7, dvec3(0.3, -0.7, 0.2));
        let contacts = [0, 4, 5, 6, 7].map(|p| face([p, 1, 2, 3]));
        if with {
            let law = ContactLaw {
                friction: 0.5,
                ..SMOOTH
            };
            set(
                &mut solver,
                &law,
                &[pair([0, 1], dvec3(0.1, 0.2, 0.3))],
                &contacts,
            );
        }
        // Dyadic as well, so that positions stay exact.
        let settings = StepSettings {
            substeps: 4,
            iterations: 2,
            ..StepSettings::new(0.015625)
        };
        for _ in 0..8 {
            step(&mut solver, &settings);
        }
        let velocities: Vec<DVec3> = (0..at.len()).map(|p| solver.velocity(p)).collect();
        (positions(&solver), velocities)
    };
    assert!(run(true) == run(false));
}

#[test]
fn closed_contacts_leave_every_bit() {
    closed_contacts_are_silent::<f64>();
}

/// A sheet of loose vertices falls on a triangulated plate of free particles, one of which is under dozens of
/// vertices, so that there is a tail; with pairs beside it.
fn sheet<R: Real>(threads: usize, iterations: u32) -> Vec<DVec3> {
    let n = 40u32;
    let mut at: Vec<DVec3> = (0..n * n)
        .map(|p| dvec3(f64::from(p % n), f64::from(p / n), 0.0))
        .collect();
    let mut noise = Noise(11);
    let plate = at.len();
    let mut contacts = Vec::new();
    for y in 0..n - 1 {
        for x in 0..n - 1 {
            let corner = x + n * y;
            // Below the middle there are forty.
            let hub = (x, y) == (n / 2, n / 2);
            for _ in 0..if hub { 40 } else { 1 } {
                let offset = dvec3(0.3, 0.3, 0.01) + noise.vector() * 0.2;
                let vertex = u32::try_from(at.len()).unwrap();
                at.push(at[corner as usize] + offset.with_z(0.01));
                contacts.push(face([vertex, corner, corner + 1, corner + n]));
            }
        }
    }
    let pairs: Vec<PairContact> = (0..n - 1)
        .map(|p| pair([p, p + 1], dvec3(1.0, 0.1, 0.2)))
        .collect();
    let mut solver = Solver::<R>::new(&at);
    for p in 0..at.len() {
        solver.set_mass(p, 0.1 + noise.scalar().abs());
        let falling = DVec3::NEG_Z + noise.vector() * 0.5;
        solver.set_velocity(p, if p < plate { DVec3::ZERO } else { falling });
    }
    let law = ContactLaw {
        friction: 0.4,
        ..SMOOTH
    };
    set(&mut solver, &law, &pairs, &contacts);
    assert!(solver.contact_color_count() > 40);
    let settings = StepSettings {
        substeps: 3,
        iterations,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.016)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(|| {
        for _ in 0..4 {
            step(&mut solver, &settings);
        }
    });
    let pressing = solver.contacts().filter(|c| c.pressure > 0.0).count();
    assert!(pressing > 100, "{pressing}");
    positions(&solver)
}

#[test]
fn threads_do_not_change_a_bit() {
    for iterations in [1, 3] {
        let one = sheet::<f32>(1, iterations);
        assert!(one == sheet::<f32>(2, iterations) && one == sheet::<f32>(3, iterations));
    }
    assert!(sheet::<f64>(1, 2) == sheet::<f64>(3, 2));
}

/// Lists of the size of the last ones and steps with them take no memory.
#[test]
fn a_frame_asks_for_no_memory() {
    for iterations in [1, 3] {
        let at = [
            dvec3(0.2, 0.2, 1e-4),
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::Y,
        ];
        let mut solver = Solver::<f32>::new(&at);
        (0..5).for_each(|p| solver.set_mass(p, 1.0));
        let (pairs, faces) = ([pair([3, 4], DVec3::X)], [face([0, 1, 2, 3])]);
        let one = Coloring::new(vec![ColorId(0)]);
        let settings = StepSettings {
            substeps: 3,
            iterations,
            gravity: Some(GRAVITY),
            ..StepSettings::new(2e-3)
        };
        let frame = |solver: &mut Solver<f32>| {
            let set = solver.set_contacts(&SMOOTH, (&pairs, &one), (&faces.map(Into::into), &one));
            set.unwrap();
            solver.step(&Schedule::default(), &settings).unwrap();
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
        pool.build().unwrap().install(|| {
            frame(&mut solver);
            let count = allocation_counter::measure(|| frame(&mut solver)).count_total;
            assert_eq!(count, 0);
        });
    }
}

/// A clone continues to the bit, and solvers without contacts have no memory for them.
#[test]
fn clones_continue_and_cleared_contacts_are_gone() {
    let at = [dvec3(0.2, 0.2, 1e-3), DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut solver = Solver::<f64>::new(&at);
    (0..4).for_each(|p| solver.set_mass(p, 1.0 + p as f64));
    let bare = solver.bytes();
    assert!(!solver.has_contacts());
    set(&mut solver, &SMOOTH, &[], &[face([0, 1, 2, 3])]);
    assert!(solver.has_contacts() && solver.bytes() > bare);
    solver.set_velocity(0, DVec3::NEG_Z);
    let settings = StepSettings::new(2e-3);
    step(&mut solver, &settings);
    let mut clone = solver.clone();
    step(&mut solver, &settings);
    step(&mut clone, &settings);
    assert_eq!(positions(&solver), positions(&clone));
    solver.clear_contacts();
    assert_eq!((solver.bytes(), solver.contact_counts()), (bare, [0, 0]));
    assert!(!solver.has_contacts());
}

#[test]
fn methods_without_contacts_are_refused_by_name() {
    let mut solver = Solver::<f64>::new(&[DVec3::ZERO, DVec3::Z]);
    (0..2).for_each(|p| solver.set_mass(p, 1.0));
    set(&mut solver, &SMOOTH, &[], &NO_FACES);
    let chebyshev = Method::Chebyshev {
        spectral_radius: 0.9,
        chebyshev_start: 2,
    };
    for (method, name) in [(Method::Jacobi, "jacobi"), (chebyshev, "chebyshev")] {
        let settings = StepSettings {
            method,
            ..StepSettings::new(0.01)
        };
        let error = solver.step(&Schedule::default(), &settings).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
    let colors = Coloring::new([0, 1].map(ColorId).to_vec());
    let order = Schedule::new(&incise_graph::Clustering::none(2), &colors);
    let mut stars = VertexStars::new(&solver, &order).unwrap();
    let settings = VbdSettings::new(0.01, 3);
    let error = solver.step_vbd(&mut stars, &settings).unwrap_err();
    assert_eq!(error, XpbdError::ContactMethod { method: "vbd" });
    solver.clear_contacts();
    assert!(solver.step_vbd(&mut stars, &settings).is_ok());
}

#[test]
fn bad_contacts_and_foreign_colors_are_refused() {
    let mut solver = Solver::<f32>::new(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE]);
    let none = Coloring::new(vec![]);
    let zeros = |count: usize| Coloring::new(vec![ColorId(0); count]);
    let good = face([0, 1, 2, 3]);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        for (law, contact, name) in [
            (
                ContactLaw {
                    friction: bad,
                    ..SMOOTH
                },
                good,
                "contact friction",
            ),
            (
                ContactLaw {
                    recovery_time: bad,
                    ..SMOOTH
                },
                good,
                "contact recovery_time",
            ),
            (
                SMOOTH,
                FaceContact {
                    thickness: bad,
                    ..good
                },
                "thickness",
            ),
            (
                SMOOTH,
                FaceContact {
                    limit: Some(FaceLimit {
                        normal: [0.0, -1.0, 0.0],
                        distance: bad,
                    }),
                    ..good
                },
                "limit distance",
            ),
        ] {
            let set = solver.set_contacts(&law, (&[], &none), (&[contact.into()], &zeros(1)));
            let error = set.unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
            assert!(!solver.has_contacts());
        }
    }
    for normal in [[0.0; 3], [f64::NAN, 0.0, 1.0]] {
        let limit = FaceLimit {
            normal,
            distance: 0.0,
        };
        for contact in [
            FaceContact {
                beyond: Some(normal),
                ..good
            },
            FaceContact {
                limit: Some(limit),
                ..good
            },
        ] {
            let set = solver.set_contacts(&SMOOTH, (&[], &none), (&[contact.into()], &zeros(1)));
            assert!(set.is_err());
        }
        let contact = pair([0, 1], DVec3::from_array(normal));
        assert!(
            solver
                .set_contacts(&SMOOTH, (&[contact], &zeros(1)), (&[], &none))
                .is_err()
        );
    }
    let touching = [good, face([4, 3, 1, 2])];
    for (faces, colors, message) in [
        (&touching[..], zeros(2), "share particle 3"),
        (
            &touching[..],
            Coloring::new(vec![ColorId(20); 2]),
            "share particle 3",
        ),
        (&touching[..1], zeros(2), "found 2"),
        (&[face([0, 1, 2, 5])][..], zeros(1), "particle 5"),
        (&[face([0, 1, 2, 0])][..], zeros(1), "particle 0 twice"),
        (
            &[face([0, 1, 2, 0])][..],
            Coloring::new(vec![ColorId(20)]),
            "particle 0 twice",
        ),
    ] {
        let set = solver.set_contacts(&SMOOTH, (&[], &none), (&surfaces(faces), &colors));
        let error = set.unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    // A pair and a face may share a color and a particle: they are solved one after the other.
    let pairs = [pair([0, 3], DVec3::Z)];
    solver
        .set_contacts(
            &SMOOTH,
            (&pairs, &zeros(1)),
            (&surfaces(&touching[..1]), &zeros(1)),
        )
        .unwrap();
}

/// The slow, obvious version: plain arrays of doubles, contacts in order of color, the formulas as they are written in
/// the description of the law, the foot of a vertex by solving the normal equations.
mod oracle {
    pub(super) type V = [f64; 3];

    pub(super) struct Particle {
        pub(super) x: V,
        pub(super) previous: V,
        pub(super) v: V,
        pub(super) weight: f64,
    }

    /// Particles, the coefficients of the normal beyond an edge and of a limit with its distance, zeros for none; or the
    /// normal of a pair. A thickness.
    #[derive(Clone)]
    pub(super) struct Contact {
        pub(super) particles: Vec<usize>,
        pub(super) normal: Option<V>,
        pub(super) limit: (V, f64),
        pub(super) of_pair: V,
        /// Whether the normal is that of two edges.
        pub(super) is_edges: bool,
        pub(super) thickness: f64,
        /// The plane that the multiplier belongs to.
        pub(super) plane: usize,
        pub(super) multiplier: f64,
        pub(super) friction: V,
    }

    fn add(a: V, b: V, f: f64) -> V {
        [a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]]
    }
    fn dot(a: V, b: V) -> f64 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }
    fn cross(a: V, b: V) -> V {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }
    fn combine(shares: &[f64], points: &[V]) -> V {
        let mut sum = [0.0; 3];
        for (share, point) in shares.iter().zip(points) {
            sum = add(sum, *point, *share);
        }
        sum
    }

    /// Where two lines are closest, by the normal equations.
    fn on_edges(x: &[V]) -> [f64; 2] {
        let [d, e, r] = [(1, 0), (3, 2), (0, 2)].map(|(a, b)| add(x[a], x[b], -1.0));
        let (a, b, c) = (dot(d, d), dot(d, e), dot(e, e));
        let (p, q) = (dot(d, r), dot(e, r));
        let determinant = a * c - b * b;
        [(b * q - c * p) / determinant, (a * q - b * p) / determinant]
    }

    /// The shares of the particles and the unit normal of each plane.
    fn planes(contact: &Contact, x: &[V]) -> Vec<(Vec<f64>, V)> {
        let unit = |n: V| n.map(|c| c / dot(n, n).sqrt());
        if contact.is_edges {
            let [s, t] = on_edges(x).map(|part| part.clamp(0.0, 1.0));
            return vec![(vec![1.0 - s, s, t - 1.0, -t], unit(contact.of_pair))];
        }
        let Some(n) = contact.normal else {
            return vec![(vec![-1.0, 1.0], unit(contact.of_pair))];
        };
        let (e1, e2, r) = (
            add(x[2], x[1], -1.0),
            add(x[3], x[1], -1.0),
            add(x[0], x[1], -1.0),
        );
        let (a, b, c) = (dot(e1, e1), dot(e1, e2), dot(e2, e2));
        let (p, q) = (dot(e1, r), dot(e2, r));
        let determinant = a * c - b * b;
        let (beta2, beta3) = ((c * p - b * q) / determinant, (a * q - b * p) / determinant);
        let mut beta = [1.0 - beta2 - beta3, beta2, beta3];
        if beta.iter().any(|&beta| beta < -0.25) {
            let grown = beta.map(|beta| (beta + 0.25f64).max(0.0));
            let sum: f64 = grown.iter().sum();
            beta = grown.map(|g| g / sum * 1.75 - 0.25);
        }
        let area = cross(e1, e2);
        let mut planes = vec![(vec![1.0, -beta[0], -beta[1], -beta[2]], unit(area))];
        if n != [0.0; 3] {
            let t = (p / a).clamp(-0.25, 1.25);
            let n = add(add(area.map(|a| a * n[2]), e1, n[0]), e2, n[1]);
            planes.push((vec![1.0, t - 1.0, -t, 0.0], unit(n)));
        }
        planes
    }

    /// Whether a vertex inside is past the end of the surface.
    fn is_past(contact: &Contact, x: &[V]) -> bool {
        if contact.is_edges {
            return on_edges(x).iter().any(|part| !(0.0..=1.0).contains(part));
        }
        let (n, distance) = contact.limit;
        if contact.normal.is_none() || n == [0.0; 3] {
            return false;
        }
        let [e1, e2, r] = [(2, 1), (3, 1), (0, 1)].map(|(a, b)| add(x[a], x[b], -1.0));
        let n = add(add(cross(e1, e2).map(|a| a * n[2]), e1, n[0]), e2, n[1]);
        let n = n.map(|c| c / dot(n, n).sqrt());
        let t = (dot(e1, r) / dot(e1, e1)).clamp(0.0, 1.0);
        dot(n, add(r, e1, -t)) > distance + contact.thickness
    }

    fn push(particles: &mut [Particle], contact: &Contact, shares: &[f64], impulse: V) {
        for (&p, share) in contact.particles.iter().zip(shares) {
            particles[p].x = add(particles[p].x, impulse, particles[p].weight * share);
        }
    }

    pub(super) fn solve(
        particles: &mut [Particle],
        contact: &mut Contact,
        friction: f64,
        kept: f64,
    ) {
        let points = |particles: &[Particle]| -> Vec<V> {
            contact.particles.iter().map(|&p| particles[p].x).collect()
        };
        let x = points(particles);
        let before = contact.particles.iter().map(|&p| particles[p].previous);
        let before: Vec<V> = before.collect();
        // The plane, its residual, shares and normal; none where the contact is open.
        let chosen = |x: &[V]| {
            let planes = planes(contact, x);
            let height = |k: usize, x: &[V]| {
                let (shares, n) = &planes[k];
                dot(*n, combine(shares, x)) - contact.thickness
            };
            let residual = |k: usize| height(k, x) - kept * height(k, &before).min(0.0);
            let edge = add(x[1], x[contact.particles.len().min(3) - 1], -1.0);
            let slight = 0.01 * dot(edge, edge).sqrt();
            let start = |k: usize| height(k, &before);
            // Outside of the triangle's plane is outside, whatever the plane beyond says.
            let plane = if planes.len() == 1 || height(0, x) >= 0.0 {
                0
            } else if height(1, x) >= 0.0 {
                1
            } else if start(0).min(start(1)) > -slight {
                usize::from(residual(1) > residual(0))
            } else {
                usize::from(start(1) > start(0))
            };
            let residual = residual(plane);
            (
                residual,
                plane,
                is_past(contact, x) && (residual < 0.0 || contact.is_edges),
            )
        };
        let (mut residual, mut plane, is_past) = chosen(&x);
        let mut x = x;
        if contact.multiplier > 0.0 && (is_past || plane != contact.plane) {
            let (shares, n) = planes(contact, &x).swap_remove(contact.plane);
            let impulse = add(contact.friction, n, contact.multiplier);
            push(particles, contact, &shares, impulse.map(|i| -i));
            x = points(particles);
            let (now, at, is_past) = chosen(&x);
            (contact.multiplier, contact.friction) = (0.0, [0.0; 3]);
            if now >= 0.0 || is_past {
                return;
            }
            (residual, plane) = (now, at);
        } else if is_past {
            return;
        }
        let (shares, n) = planes(contact, &x).swap_remove(plane);
        let of = |k: usize| particles[contact.particles[k]].weight;
        let w: f64 = shares.iter().enumerate().map(|(k, s)| of(k) * s * s).sum();
        // No particle moves by more than four times the residual.
        let moves = shares.iter().enumerate().map(|(k, s)| of(k) * s.abs());
        let w = moves.fold(w, |w, by| w.max(by / 4.0));
        let new = (contact.multiplier - residual / w).max(0.0);
        if w == 0.0 || (new == 0.0 && contact.multiplier == 0.0) {
            return;
        }
        let mut impulse = n.map(|n| n * (new - contact.multiplier));
        (contact.multiplier, contact.plane) = (new, plane);
        let moved: Vec<V> = x
            .iter()
            .zip(&before)
            .map(|(a, b)| add(*a, *b, -1.0))
            .collect();
        let slide = combine(&shares, &moved);
        let slide = add(slide, n, -dot(n, slide));
        let mut wanted = add(contact.friction, slide, -1.0 / w);
        let length = dot(wanted, wanted).sqrt();
        if length > friction * new {
            wanted = wanted.map(|t| t * friction * new / length);
        }
        if friction > 0.0 {
            impulse = add(add(impulse, wanted, 1.0), contact.friction, -1.0);
            contact.friction = wanted;
        }
        push(particles, contact, &shares, impulse);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Random particles, triangles of a sensible shape, contacts above, in and below them.
    #[test]
    fn the_slow_oracle_agrees(
        points in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-1.0..1.0f64), 0.05..5.0f64), 6..14),
        contacts in prop::collection::vec((prop::array::uniform4(0..14usize), prop::array::uniform3(-0.5..0.5f64), 0..6u8, 0.0..0.05f64), 1..12),
        friction in 0.0..1.0f64,
        recovery_time in 0.0..0.05f64,
        iterations in 1..4u32,
    ) {
        let count = points.len();
        let at: Vec<DVec3> = points.iter().map(|(x, ..)| DVec3::from_array(*x)).collect();
        let mut solver = Solver::<f64>::new(&at);
        for (p, (_, v, mass)) in points.iter().enumerate() {
            // Some stay where they are.
            if p % 5 != 4 {
                solver.set_mass(p, *mass);
                solver.set_velocity(p, DVec3::from_array(*v));
            }
        }
        let origin = solver.origin();
        let mut particles: Vec<oracle::Particle> = (0..count).map(|p| oracle::Particle {
            x: (at[p] - origin).to_array(),
            previous: [0.0; 3],
            v: solver.velocity(p).to_array(),
            weight: if p % 5 == 4 { 0.0 } else { 1.0 / points[p].2 },
        }).collect();
        let (mut pairs, mut faces) = (Vec::new(), Vec::new());
        for (numbers, normal, kind, thickness) in contacts {
            let mut numbers = numbers.map(|p| p % count);
            for k in 1..4 {
                while numbers[..k].contains(&numbers[k]) {
                    numbers[k] = (numbers[k] + 1) % count;
                }
            }
            let [a, b, c] = [1, 2, 3].map(|k| at[numbers[k]]);
            let small = numbers.map(|p| u32::try_from(p).unwrap());
            if kind == 0 {
                pairs.push(pair([small[0], small[1]], DVec3::from_array(normal) + DVec3::Z));
            } else if kind > 3 {
                let [a, b, c, d] = numbers.map(|p| at[p]);
                let sine = (b - a).normalize_or_zero().cross((d - c).normalize_or_zero()).length();
                if sine > 0.2 && a.distance(b).min(c.distance(d)) > 0.2 {
                    let normal = DVec3::from_array(normal) + DVec3::Z;
                    faces.push(SurfaceContact::from(EdgeContact { thickness, ..edges(small, normal) }));
                }
            } else if (b - a).cross(c - a).length() > 0.3 {
                let beyond = (kind > 1).then_some([normal[0], normal[1] - 1.0, 1.0]);
                let normal = [normal[1], normal[2] - 0.7, normal[0]];
                let limit = (kind > 2).then_some(FaceLimit { normal, distance: thickness });
                faces.push(FaceContact { beyond, limit, thickness, ..face(small) }.into());
            }
        }
        let law = ContactLaw { friction, recovery_time };
        set(&mut solver, &law, &pairs, &faces);
        let (substeps, time) = (3, 0.01);
        let settings = StepSettings { substeps, iterations, gravity: Some(GRAVITY), ..StepSettings::new(time) };
        step(&mut solver, &settings);

        type Raw = (Vec<u32>, Option<[f64; 3]>, [f64; 3], f64, ([f64; 3], f64), bool);
        let no_limit = ([0.0; 3], 0.0);
        let of_pairs = pairs.iter().map(|c| (c.particles.to_vec(), None, c.normal.to_array(), 0.0, no_limit, false));
        let of_faces = faces.iter().map(|c| {
            let c = match c {
                SurfaceContact::Face(c) => c,
                SurfaceContact::Edges(c) => {
                    return (c.particles.to_vec(), None, c.normal.to_array(), c.thickness, no_limit, true);
                }
            };
            let beyond = Some(c.beyond.unwrap_or_default());
            let limit = c.limit.map_or(no_limit, |limit| (limit.normal, limit.distance));
            (c.particles.to_vec(), beyond, [0.0; 3], c.thickness, limit, false)
        });
        let order = |list: Vec<Raw>, colors: &Coloring| {
            let mut order: Vec<usize> = (0..list.len()).collect();
            order.sort_by_key(|&c| colors.color(c));
            let contact = |c: &usize| oracle::Contact {
                particles: list[*c].0.iter().map(|&p| p as usize).collect(),
                normal: list[*c].1,
                of_pair: list[*c].2,
                thickness: list[*c].3,
                limit: list[*c].4,
                is_edges: list[*c].5,
                plane: 0,
                multiplier: 0.0,
                friction: [0.0; 3],
            };
            order.iter().map(contact).collect::<Vec<_>>()
        };
        let (of_pairs, of_faces): (Vec<_>, Vec<_>) = (of_pairs.collect(), of_faces.collect());
        let in_pairs: Vec<[u32; 2]> = pairs.iter().map(|c| c.particles).collect();
        let in_faces: Vec<[u32; 4]> = faces.iter().map(SurfaceContact::particles).collect();
        let mut all = order(of_pairs, &colors(count, &in_pairs));
        all.extend(order(of_faces, &colors(count, &in_faces)));
        let dt = time / f64::from(substeps);
        let kept = 1.0 - (dt / recovery_time).min(1.0);
        for _ in 0..substeps {
            for particle in &mut particles {
                particle.previous = particle.x;
                if particle.weight > 0.0 {
                    particle.v[2] -= 9.81 * dt;
                    particle.x = [0, 1, 2].map(|k| particle.x[k] + dt * particle.v[k]);
                }
            }
            for contact in &mut all {
                (contact.multiplier, contact.friction) = (0.0, [0.0; 3]);
            }
            for _ in 0..iterations {
                for contact in &mut all {
                    oracle::solve(&mut particles, contact, friction, kept);
                }
            }
            for particle in &mut particles {
                particle.v = [0, 1, 2].map(|k| (particle.x[k] - particle.previous[k]) / dt);
            }
        }
        for (p, particle) in particles.iter().enumerate() {
            let x = DVec3::from_array(particle.x) + origin;
            // Triangles are at worst 30 times as long as high; each of up to 100 solves multiplies rounding by a few.
            let scale = 1.0 + x.length();
            prop_assert!(solver.position(p).distance(x) < 1e-7 * scale, "{p}: {} {x}", solver.position(p));
        }
    }

    /// Anything finite at all, in both precisions.
    #[test]
    fn any_contact_leaves_any_particle_finite(
        points in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -45..37i32, -300..300i32), 4..9),
        contacts in prop::collection::vec((prop::array::uniform4(0..9usize), prop::array::uniform3(-1.0..1.0f64), -40..37i32, 0..5u8), 1..10),
        friction in 0.0..2.0f64,
        iterations in 1..4u32,
    ) {
        let count = points.len();
        let at: Vec<DVec3> = points
            .iter()
            .map(|(x, size, _)| DVec3::from_array(*x) * 10f64.powi(*size))
            .collect();
        let (mut pairs, mut faces) = (Vec::new(), Vec::new());
        for (numbers, normal, size, kind) in contacts {
            let mut numbers = numbers.map(|p| p % count);
            for k in 1..4 {
                while numbers[..k].contains(&numbers[k]) {
                    numbers[k] = (numbers[k] + 1) % count;
                }
            }
            let numbers = numbers.map(|p| u32::try_from(p).unwrap());
            let normal = normal.map(|n| n * 10f64.powi(size));
            if kind == 0 {
                pairs.push(pair([numbers[0], numbers[1]], DVec3::from_array(normal)));
            } else {
                let thickness = if kind == 1 { 10f64.powi(size) } else { 0.0 };
                let beyond = (kind > 1).then_some(normal);
                let limit = (kind > 2).then_some(FaceLimit { normal, distance: 10f64.powi(size) });
                faces.push(if kind == 4 {
                    edges(numbers, DVec3::from_array(normal)).into()
                } else {
                    FaceContact { particles: numbers, beyond, limit, thickness }.into()
                });
            }
        }
        let law = ContactLaw { friction, ..SMOOTH };
        finite::<f32>(&at, &points, &law, &pairs, &faces, iterations)?;
        finite::<f64>(&at, &points, &law, &pairs, &faces, iterations)?;
    }
}

fn finite<R: Real>(
    at: &[DVec3],
    points: &[([f64; 3], i32, i32)],
    law: &ContactLaw,
    pairs: &[PairContact],
    faces: &[SurfaceContact],
    iterations: u32,
) -> Result<(), TestCaseError> {
    let mut solver = Solver::<R>::new(at);
    for (p, (_, _, mass)) in points.iter().enumerate() {
        solver.set_mass(p, 10f64.powi(*mass));
    }
    let in_pairs: Vec<[u32; 2]> = pairs.iter().map(|c| c.particles).collect();
    let in_faces: Vec<[u32; 4]> = faces.iter().map(SurfaceContact::particles).collect();
    let (in_pairs, in_faces) = (colors(at.len(), &in_pairs), colors(at.len(), &in_faces));
    // Coefficients out of the range of the precision are refused.
    if solver
        .set_contacts(law, (pairs, &in_pairs), (faces, &in_faces))
        .is_err()
    {
        return Ok(());
    }
    let settings = StepSettings {
        substeps: 2,
        iterations,
        gravity: Some(GRAVITY),
        ..StepSettings::new(0.1)
    };
    for _ in 0..3 {
        solver.step(&Schedule::default(), &settings).unwrap();
    }
    for p in 0..at.len() {
        prop_assert!(solver.position(p).is_finite() && solver.velocity(p).is_finite());
    }
    Ok(())
}
