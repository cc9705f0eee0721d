//! Contacts on the device against those of the host.

use glam::{DVec3, dvec3};
use incise_coloring::{Order, greedy};
use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuSolver};
use incise_graph::{Coloring, Incidence, Schedule};
use incise_mesh::TetMesh;
use incise_xpbd::{
    Collider, ContactLaw, ContactState, EdgeContact, FaceContact, FaceLimit, Method, PairContact,
    Solver, StepSettings, SurfaceContact, XpbdError,
};
use proptest::prelude::*;

use crate::solver::{SOFT, body, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar};

const LAW: ContactLaw = ContactLaw {
    friction: 0.4,
    recovery_time: 0.02,
};

/// A free particle of the bar.
const HUB: u32 = 40;

/// Contacts with an order of solving.
#[derive(Clone, Debug, Default)]
struct List {
    pairs: Vec<PairContact>,
    surfaces: Vec<SurfaceContact>,
}

impl List {
    fn set(&self, solver: &mut Solver<f32>, law: &ContactLaw) {
        let count = solver.particle_count();
        let pairs = colors(count, self.pairs.iter().map(|pair| pair.particles));
        let surfaces = colors(count, self.surfaces.iter().map(SurfaceContact::particles));
        solver
            .set_contacts(law, (&self.pairs, &pairs), (&self.surfaces, &surfaces))
            .unwrap();
    }
}

/// Colors by first fit.
fn colors<const K: usize>(count: usize, contacts: impl Iterator<Item = [u32; K]>) -> Coloring {
    let incidence = Incidence::from_constraints(count, contacts).unwrap();
    greedy(&incidence, Order::Natural)
}

/// A number from 0 to 1 of a seed.
fn noise(seed: u64) -> f64 {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x >> 11) as f64 / (1_u64 << 53) as f64
}

/// A number below a count, of a seed.
#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding down is the purpose"
)]
fn picked(seed: u64, count: usize) -> u32 {
    (noise(seed) * count as f64) as u32
}

fn direction(seed: u64) -> DVec3 {
    dvec3(noise(seed), noise(seed + 1), noise(seed + 2)) - 0.5
}

/// A limit in a random direction.
fn limit(seed: u64) -> FaceLimit {
    FaceLimit {
        normal: direction(seed).to_array(),
        distance: 0.1 * noise(seed + 3),
    }
}

/// Contacts between particles and triangles of a body picked at random: with and without a second plane, thick ones, and
/// many on one vertex, which need a tail.
fn random(mesh: &TetMesh, seed: u64, number: u32) -> List {
    let count = mesh.positions.len();
    let pick = |k: u64| picked(seed + k, count);
    let mut list = List::default();
    for k in (0..u64::from(number)).map(|k| 100 * k) {
        let [a, b, c] = [pick(k), pick(k + 1), pick(k + 2)];
        if a != b {
            list.pairs.push(PairContact {
                particles: [a, b],
                normal: direction(seed + k + 10),
            });
        }
        // Every second contact is that of one vertex.
        let vertex = if k % 200 == 0 { HUB } else { c };
        let tet = mesh.tets[picked(seed + k + 3, mesh.tets.len()) as usize].map(|p| p.0);
        if !tet[..3].contains(&vertex) {
            let n = direction(seed + k + 20);
            let face = FaceContact {
                particles: [vertex, tet[0], tet[1], tet[2]],
                beyond: (k % 300 == 0).then(|| n.to_array()),
                limit: (k % 700 == 0).then(|| limit(seed + k + 30)),
                thickness: if k % 500 == 0 { 0.02 } else { 0.0 },
            };
            let edges = EdgeContact {
                particles: face.particles,
                normal: n,
                thickness: face.thickness,
            };
            list.surfaces.push(match k % 400 {
                0 => edges.into(),
                _ => face.into(),
            });
        }
    }
    list
}

/// The states of all particles as words.
fn state(solver: &Solver<f32>) -> Vec<u32> {
    let all = 0..solver.particle_count();
    let numbers = all.flat_map(|p| {
        let (x, v) = solver.particle_data(p);
        x.into_iter().chain(v)
    });
    // Zeros have two signs.
    numbers.map(|number| (number + 0.0).to_bits()).collect()
}

fn is_lavapipe(gpu: &GpuContext) -> bool {
    gpu.adapter().name.contains("llvmpipe")
}

fn gently() -> StepSettings {
    StepSettings {
        gravity: Some(DVec3::new(0.0, 0.0, -2.0)),
        colliders: vec![Collider::ground(-0.05, 0.3)],
        ..settings()
    }
}

/// Copies of a solver whose free particles are off by up to two units in the last place of 1. How far these come apart
/// shows what the rounding of a device may change: contacts at random places have no plane, or two of equal depth, so that
/// rounding decides which one acts.
fn with_rounding(host: &Solver<f32>) -> impl Iterator<Item = Solver<f32>> {
    (0..12).map(|number| {
        let mut solver = host.clone();
        for p in 0..solver.particle_count() {
            let by = direction(7919 * number + p as u64) * 2.0 * f64::from(f32::EPSILON);
            if !solver.is_fixed(p) {
                solver.set_position(p, solver.position(p) + by);
            }
        }
        solver
    })
}

/// By how much more than hosts a device may be off.
const MARGIN: f64 = 4.0;

/// Gives the particles of a solver the state of another one.
fn take_state(solver: &mut Solver<f32>, from: &Solver<f32>) {
    for p in 0..from.particle_count() {
        solver.set_position(p, from.position(p));
        solver.set_velocity(p, from.velocity(p));
    }
}

/// How far states of contacts are apart at most: depth in m, force in N.
fn apart(one: &[ContactState], other: &[ContactState]) -> [f64; 2] {
    assert_eq!(one.len(), other.len());
    let mut most = [0.0_f64; 2];
    for (one, other) in one.iter().zip(other) {
        assert_eq!((one.vertex, one.against), (other.vertex, other.against));
        most[0] = most[0].max((one.depth - other.depth).abs());
        most[1] = most[1].max(one.force.distance(other.force));
    }
    most
}

/// Steps both with contacts set in each frame: the same bits on lavapipe. Elsewhere both start each part of a frame from one
/// state, and are no farther apart after it than rounding puts hosts.
fn twins(test: &str, law: ContactLaw, settings: &StepSettings, parts: &[std::ops::Range<u32>]) {
    let Some(gpu) = gpu(test) else { return };
    let mesh = bar();
    for form in FORMS {
        let mut twins = Twins::new(gpu, &mesh, SOFT, form, |_| {});
        let mut without = body(&mesh, &[SOFT]);
        let order = twins.order.clone();
        let mut pressed = 0;
        for frame in 0..6 {
            for part in parts {
                let list = random(&mesh, 7000 * frame + u64::from(part.start), 60);
                let exact = is_lavapipe(gpu);
                if !exact {
                    let Twins { device, host, .. } = &mut twins;
                    take_state(device.edit().unwrap(), host);
                }
                twins.edit(|solver| list.set(solver, &law));
                let Twins {
                    device,
                    host,
                    schedule,
                    order,
                } = &mut twins;
                let others: Vec<_> = match exact {
                    true => Vec::new(),
                    false => with_rounding(host).collect(),
                };
                device
                    .step_part(schedule, settings, part.clone(), false)
                    .unwrap();
                host.step_part(order, settings, part.clone(), false)
                    .unwrap();
                device.check(schedule).unwrap();
                let there: Vec<_> = device.host().unwrap().contacts().collect();
                let here: Vec<_> = host.contacts().collect();
                if exact {
                    assert_eq!(there, here);
                } else {
                    // A micrometer and a millionth of the largest force.
                    let largest = here.iter().map(|c| c.force.length()).fold(0.0, f64::max);
                    let mut allowed = [1e-6, 1e-6 * largest, 1e-6];
                    for mut other in others {
                        other
                            .step_part(order, settings, part.clone(), false)
                            .unwrap();
                        let states: Vec<_> = other.contacts().collect();
                        let [depth, force] = apart(&states, &here);
                        let off = [depth, force, crate::solver::distance(&other, host)];
                        allowed = [0, 1, 2].map(|k| f64::max(allowed[k], MARGIN * off[k]));
                    }
                    let [depth, force] = apart(&there, &here);
                    let off = [
                        depth,
                        force,
                        crate::solver::distance(device.cached_host(), host),
                    ];
                    assert!(
                        (0..3).all(|k| off[k] <= allowed[k]),
                        "{test}, {form:?}, {frame}: {off:?} of {allowed:?}"
                    );
                }
                pressed += here.iter().filter(|c| c.pressure > 0.0).count();
                if exact {
                    assert!(
                        state(device.cached_host()) == state(host),
                        "{form:?} {frame}"
                    );
                }
            }
            without.step(&order, settings).unwrap();
        }
        assert_eq!(twins.device.repaired(), 0);
        assert!(pressed > 100, "{test}: {pressed} contacts pressed");
        let moved = crate::solver::distance(&twins.host, &without);
        assert!(moved > 1e-3, "{test}: the contacts did nothing");
        assert!(twins.host.contact_rounds().any(|round| round.is_tail));
    }
}

#[test]
fn contacts_press_and_rub() {
    let settings = gently();
    twins(
        "contacts_press_and_rub",
        LAW,
        &settings,
        std::slice::from_ref(&(0..settings.substeps)),
    );
}

#[test]
fn contacts_without_friction_that_part_at_once() {
    let law = ContactLaw {
        friction: 0.0,
        recovery_time: 0.0,
    };
    let test = "contacts_without_friction_that_part_at_once";
    let settings = gently();
    twins(
        test,
        law,
        &settings,
        std::slice::from_ref(&(0..settings.substeps)),
    );
}

#[test]
fn contacts_keep_multipliers() {
    let settings = StepSettings {
        iterations: 3,
        ..gently()
    };
    let test = "contacts_keep_multipliers";
    twins(
        test,
        LAW,
        &settings,
        std::slice::from_ref(&(0..settings.substeps)),
    );
}

/// Contacts are set again within the frame; the impulses are those since then.
#[test]
fn contacts_are_set_within_a_frame() {
    let settings = StepSettings {
        substeps: 5,
        ..gently()
    };
    twins(
        "contacts_are_set_within_a_frame",
        LAW,
        &settings,
        &[0..2, 2..3, 3..5],
    );
}

/// Particles alone, some fixed, with contacts between them.
fn dust(positions: &[DVec3], fixed: &[usize], list: &List) -> Solver<f32> {
    let mut solver = Solver::new(positions);
    (0..positions.len()).for_each(|p| solver.set_mass(p, 0.5 + 0.25 * (p % 4) as f64));
    for p in 0..positions.len() {
        solver.set_velocity(p, direction(31 * p as u64) * 2.0);
    }
    fixed.iter().for_each(|&p| solver.set_fixed(p, true));
    list.set(&mut solver, &LAW);
    solver
}

/// The states of both after some frames, and how far each group of particles may be off on the device.
fn both(
    gpu: &'static GpuContext,
    group: usize,
    make: impl Fn() -> Solver<f32>,
) -> ([Solver<f32>; 2], Option<Vec<f64>>) {
    let (schedule, settings) = (Schedule::default(), gently());
    let run = |mut solver: Solver<f32>| {
        for _ in 0..3 {
            solver.step(&schedule, &settings).unwrap();
        }
        solver
    };
    let mut device = GpuSolver::new(share(gpu), make(), ClusterMapping::Threads).unwrap();
    for _ in 0..3 {
        device.step(&schedule, &settings).unwrap();
    }
    device.check(&schedule).unwrap();
    let host = run(make());
    let start = make();
    let allowed = (!is_lavapipe(gpu)).then(|| {
        let least = vec![1e-6; start.particle_count().div_ceil(group)];
        with_rounding(&start).fold(least, |mut allowed, other| {
            let off = group_distances(&run(other), &host, group);
            for (allowed, off) in allowed.iter_mut().zip(off) {
                *allowed = f64::max(*allowed, MARGIN * off);
            }
            allowed
        })
    });
    ([device.host().unwrap().clone(), host], allowed)
}

/// The largest distance of a particle from its twin, for each group of so many particles.
fn group_distances(a: &Solver<f32>, b: &Solver<f32>, group: usize) -> Vec<f64> {
    let apart: Vec<f64> = (0..a.particle_count())
        .map(|p| a.position(p).distance(b.position(p)))
        .collect();
    apart
        .chunks(group)
        .map(|apart| apart.iter().copied().fold(0.0, f64::max))
        .collect()
}

/// Steps both and compares them, group by group.
fn assert_equal(gpu: &'static GpuContext, group: usize, make: impl Fn() -> Solver<f32>) {
    let ([device, host], allowed) = both(gpu, group, make);
    match allowed {
        None => assert_eq!(state(&device), state(&host)),
        Some(allowed) => {
            let far = group_distances(&device, &host, group);
            for (k, (far, allowed)) in far.iter().zip(&allowed).enumerate() {
                assert!(far <= allowed, "{far} of {allowed} in group {k}");
            }
        }
    }
    let all = 0..host.particle_count();
    assert!(all.clone().all(|p| host.position(p).is_finite()));
    assert!(all.clone().all(|p| device.position(p).is_finite()));
}

/// Triangles without area or of one point, a vertex on a corner, an edge without length with a second plane, coincident
/// pairs, contacts of fixed particles alone, and a triangle of micrometers: 192 cases of four particles, which share
/// nothing, in one solver, as each solver compiles its shaders.
#[test]
fn degenerate_contacts() {
    let Some(gpu) = gpu("degenerate_contacts") else {
        return;
    };
    let (o, x, y) = (DVec3::ZERO, DVec3::X, DVec3::Y);
    let below = dvec3(0.2, 0.2, -0.01);
    let triangles: [[DVec3; 4]; 8] = [
        [below, o, x, x * 2.0],
        [below, o, o, o],
        [o, o, x, y],
        [below, o, o, y],
        [o, o, o, o],
        [below, o, x, y],
        [below * 1e-6, o, x * 1e-6, y * 1e-6],
        [below, o, x, x + y * 1e-7],
    ];
    let (mut positions, mut all_fixed) = (Vec::new(), Vec::new());
    let mut list = List::default();
    for beyond in [None, Some([0.0, 0.0, 1.0]), Some([0.3, -0.2, 0.4])] {
        for fixed in [&[][..], &[0, 1, 2, 3], &[1, 2, 3], &[0, 2]] {
            for triangle in triangles {
                for of_edges in [false, true] {
                    let first = u32::try_from(positions.len()).unwrap();
                    let particles = [0, 1, 2, 3].map(|k| first + k);
                    let face = FaceContact {
                        particles,
                        beyond,
                        limit: beyond.map(|normal| FaceLimit {
                            normal,
                            distance: 0.1,
                        }),
                        thickness: 0.0,
                    };
                    let edges = EdgeContact {
                        particles,
                        normal: DVec3::from_array(beyond.unwrap_or([0.0, 0.1, -1.0])),
                        thickness: 0.0,
                    };
                    list.surfaces
                        .push(if of_edges { edges.into() } else { face.into() });
                    list.pairs.push(PairContact {
                        particles: [first + 1, first],
                        normal: DVec3::Z,
                    });
                    all_fixed.extend(fixed.iter().map(|k| positions.len() + k));
                    positions.extend(triangle);
                }
            }
        }
    }
    assert_equal(gpu, 4, || {
        let mut solver = dust(&positions, &all_fixed, &list);
        for p in 0..positions.len() {
            solver.set_velocity(p, direction(31 * (p % 4) as u64) * 2.0);
        }
        solver
    });
}

/// A tail is solved in the order of the host: many colors, one after the other, since one particle is in most contacts.
#[test]
fn tails_keep_the_order() {
    let Some(gpu) = gpu("tails_keep_the_order") else {
        return;
    };
    let positions: Vec<DVec3> = (0..200).map(|p| direction(17 * p)).collect();
    let ring = (0..200_u32).map(|p| [p, (p + 1) % 200]);
    let hub = (1..150_u32).map(|p| [0, p]);
    let pairs: Vec<_> = ring
        .chain(hub)
        .map(|particles| PairContact {
            particles,
            normal: direction(u64::from(particles[0] + 3 * particles[1])),
        })
        .collect();
    let all = colors(200, pairs.iter().map(|pair| pair.particles));
    assert!(all.color_count() > 149);
    let make = || {
        let mut solver = dust(&positions, &[3, 50], &List::default());
        let none = (&[][..], &Coloring::default());
        solver.set_contacts(&LAW, (&pairs, &all), none).unwrap();
        assert!(solver.contact_rounds().any(|round| round.is_tail));
        solver
    };
    assert_equal(gpu, positions.len(), make);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Random contacts between random particles, far from what a detector lists.
    #[test]
    fn any_contacts_are_those_of_the_host(
        seed in 0_u64..1 << 40,
        pairs in 0_u64..60,
        faces in 0_u64..60,
        particles in 5_usize..40,
    ) {
        let Some(gpu) = gpu("any_contacts_are_those_of_the_host") else {
            return Ok(());
        };
        let positions: Vec<DVec3> =
            (0..particles as u64).map(|p| direction(seed + 5 * p)).collect();
        let pick = |k: u64| picked(seed + 1000 + k, particles);
        let mut list = List::default();
        for k in 0..pairs {
            let particles = [pick(2 * k), pick(2 * k + 1)];
            if particles[0] != particles[1] {
                list.pairs.push(PairContact { particles, normal: direction(seed + 70 + k) });
            }
        }
        for k in 0..faces {
            let mut particles = [0, 1, 2, 3].map(|i| pick(500 + 4 * k + i));
            particles.sort_unstable();
            if particles.windows(2).all(|two| two[0] < two[1]) {
                let beyond = (k % 2 == 0).then(|| direction(seed + 90 + k).to_array());
                let limit = (k % 3 == 0).then(|| limit(seed + 95 + k));
                let thickness = 0.01 * (k % 3) as f64;
                list.surfaces.push(if k % 5 == 0 {
                    EdgeContact { particles, normal: direction(seed + 97 + k), thickness }.into()
                } else {
                    FaceContact { particles, beyond, limit, thickness }.into()
                });
            }
        }
        assert_equal(gpu, particles, || dust(&positions, &[2], &list));
    }
}

/// What does not change is not sent, and what is not declared has no dispatch and no memory.
#[test]
fn contacts_cost_what_they_are() {
    let Some(gpu) = gpu("contacts_cost_what_they_are") else {
        return;
    };
    let gpu = share(gpu);
    let mesh = bar();
    let (schedule, _) = crate::solver::schedules(&mesh, "serial:10");
    let make =
        || GpuSolver::new(gpu.clone(), body(&mesh, &[SOFT]), ClusterMapping::Threads).unwrap();
    let (mut device, mut bare) = (make(), make());
    let step = |device: &mut GpuSolver| {
        let before = gpu.traffic();
        device.step(&schedule, &settings()).unwrap();
        gpu.traffic().since(before)
    };
    step(&mut bare);
    let without = step(&mut bare);
    let list = random(&mesh, 5, 60);
    let set = |device: &mut GpuSolver, list: &List| list.set(device.edit().unwrap(), &LAW);
    set(&mut device, &list);
    step(&mut device);
    assert!(device.bytes() > bare.bytes());
    set(&mut device, &list);
    let same = step(&mut device);
    assert_eq!(same.uploaded_bytes, 0, "nothing has changed");
    assert!(same.dispatches > without.dispatches + 4);
    let count = list.pairs.len() + list.surfaces.len();
    assert!(same.dispatches < without.dispatches + 4 * count as u64);
    // One normal: a piece of 256 bytes.
    let mut other = list.clone();
    other.pairs[0].normal = DVec3::Z;
    set(&mut device, &other);
    assert_eq!(step(&mut device).uploaded_bytes, 256);
    // Declared, and none: no dispatch.
    set(&mut device, &List::default());
    step(&mut device);
    assert_eq!(step(&mut device).dispatches, without.dispatches);
    device.edit().unwrap().clear_contacts();
    step(&mut device);
    let after = step(&mut device);
    assert_eq!(after.dispatches, without.dispatches);
    assert_eq!(device.bytes(), bare.bytes());
    assert_eq!(after.buffers, 0);
}

/// Methods that do not solve contacts are refused as on the host; nothing has moved.
#[test]
fn other_methods_are_refused() {
    let Some(gpu) = gpu("other_methods_are_refused") else {
        return;
    };
    let solver = dust(&[DVec3::ZERO], &[], &List::default());
    let mut device = GpuSolver::new(share(gpu), solver, ClusterMapping::Threads).unwrap();
    let jacobi = StepSettings {
        method: Method::Jacobi,
        ..settings()
    };
    let none = Schedule::default();
    let refused = device.step(&none, &jacobi).unwrap_err();
    let method = "jacobi";
    assert_eq!(
        refused,
        GpuError::Settings(XpbdError::ContactMethod { method })
    );
    let late = device.step_part(&none, &settings(), 2..9, false);
    assert!(matches!(
        late,
        Err(GpuError::Settings(XpbdError::Setting { .. }))
    ));
    assert_eq!(device.host().unwrap().position(0), DVec3::ZERO);
    device.edit().unwrap().clear_contacts();
    device.step(&none, &jacobi).unwrap();
}
